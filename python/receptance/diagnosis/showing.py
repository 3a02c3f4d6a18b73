"""A verdict as plain values and as text."""

from __future__ import annotations

import math
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping

    from receptance.diagnosis.causes import Parameter
    from receptance.diagnosis.verdict import Candidate, Gain, Verdict

__all__ = [
    "as_dict",
    "as_text",
    "gained",
    "implausible",
    "improved",
    "sentence",
    "sizes",
    "vetoes",
    "wanting",
]

_SHOWN = 6
SENTENCE = {
    "adequate": "The model is adequate: noise, floor and tolerances explain what is left.",
    "undecided": "The model cannot be judged: too few degrees of freedom are left.",
    "named": "The model lacks something, and the data say what.",
    "suspected": "Something may be missing; one cause is suspected, no more.",
    "ambiguous": "The model lacks something; these data cannot tell which of several causes it is.",
    "unexplained": "The model lacks something, and no known cause explains it.",
}


UNFINISHED = "This is what is known so far, and what was not tried may change it: the diagnosis was interrupted"


def sentence(verdict: Verdict) -> str:
    """Return the verdict in one sentence, and where the diagnosis was interrupted if it was."""
    if verdict.final:
        return SENTENCE[verdict.verdict]
    far = verdict.settings["interrupted"]
    return f"{UNFINISHED} in step {far['step']} of about {far['of_about']}, after {far['seconds']:.0f} s."


def as_dict(verdict: Verdict) -> dict[str, Any]:
    """Return a verdict as plain values, without numbers that JSON does not have."""
    from receptance.diagnosis.by_mode import residuals_by_mode

    after, best = verdict.adequacy_after, verdict.explanation
    modes = {
        "before": [asdict(one) for one in residuals_by_mode(verdict.selection.base)],
        "after": None if best is None else [asdict(one) for one in residuals_by_mode(best.fit)],
    }
    found: dict[str, Any] = _plain(
        {
            "verdict": verdict.verdict,
            "final": verdict.final,
            "causes": [_candidate(one) for one in verdict.causes],
            "ambiguous_between": list(verdict.ambiguous_between),
            "gain": None if verdict.gain is None else asdict(verdict.gain),
            "gains": [asdict(one) for one in verdict.gains],
            "next_measurement": None if verdict.next_measurement is None else asdict(verdict.next_measurement),
            "candidates": [_candidate(one) for one in verdict.candidates],
            "vetoed": [_candidate(one) for one in verdict.vetoed],
            "alternatives": [_candidate(one) for one in verdict.alternatives],
            "alternative": None if verdict.alternative is None else _candidate(verdict.alternative),
            "threshold": verdict.threshold,
            "adequacy": asdict(verdict.adequacy),
            "adequacy_after": None if after is None else asdict(after),
            "base": verdict.base.values,
            "extended": None if verdict.extended is None else verdict.extended.values,
            "residuals_by_mode": modes,
            "held_out_by_mode": {
                "before": [asdict(one) for one in verdict.held_out_modes],
                "after": [asdict(one) for one in verdict.held_out_modes_after],
            },
            "bias": None if verdict.bias is None else {**asdict(verdict.bias), "text": str(verdict.bias)},
            "frequency_errors_percent": verdict.frequency_errors(),
            "undecidable": verdict.undecidable,
            "notes": list(verdict.notes),
            "settings": verdict.settings,
        }
    )
    return found


def _candidate(one: Candidate) -> dict[str, Any]:
    fields = asdict(replace(one, declared={}))
    del fields["declared"]
    fields["parameters"] = {
        name: {"value": value, "lower": low, "upper": high} for name, (value, low, high) in one.parameters.items()
    }
    return fields


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(name): _plain(one) for name, one in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(one) for one in value]
    if isinstance(value, float) or hasattr(value, "item"):
        number = value.item() if hasattr(value, "item") else value
        return number if not isinstance(number, float) or math.isfinite(number) else None
    return value


def sizes(one: Candidate) -> str:
    """Return the sizes of a candidate, with units and 95 % intervals."""
    texts = []
    for name, (found, *ends) in one.parameters.items():
        title = name.removeprefix(f"{one.id}.")
        parameter = one.declared[name]
        # An interval by the curvature may reach beyond what the parameter can be.
        numbers = (found, *(min(max(end, parameter.lower), parameter.upper) for end in ends))
        largest = max((abs(number) for number in numbers if math.isfinite(number)), default=0.0)
        scale, unit = _readable(parameter.unit, largest)
        if title.startswith("log_"):
            # A logarithm of a factor, as everybody says it.
            title, unit = title.removeprefix("log_"), "%"
            value, low, high = (f"{_percent(number):+.3g}" for number in numbers)
        else:
            value, low, high = (_rounded(scale * number, numbers[2] - numbers[1], scale) for number in numbers)
        texts.append(f"{title} {value}{' ' + unit if unit else ''} ({low} to {high})")
    return ", ".join(texts)


_SMALLER = {"kg": (1e3, "g"), "m": (1e3, "mm"), "s": (1e6, "µs")}


def implausible(parameters: Mapping[str, Parameter], values: Mapping[str, float]) -> str:
    """Return the sizes of a cause outside their plausible range, and the range; empty where there is none."""
    texts = []
    for name, value in values.items():
        parameter = parameters[name]
        if parameter.is_plausible(value):
            continue
        title, unit = name.removeprefix(f"{parameter.cause}."), parameter.unit
        ends = parameter.plausible or (parameter.lower, parameter.upper)
        if title.startswith("log_"):
            title = title.removeprefix("log_")
            found, low, high = (f"{_percent(number):+.3g} %" for number in (value, *ends))
        else:
            scale, unit = _readable(unit, max(map(abs, (value, *ends))))
            found, low, high = (f"{scale * number:.3g} {unit}".strip() for number in (value, *ends))
        texts.append(f"{title} {found}, where {low} to {high} is plausible")
    return "; ".join(texts)


def vetoes(verdict: Verdict) -> list[str]:
    """Return the causes that were not reported because of their sizes, one sentence each."""
    return [
        f"{' + '.join((one.id, *one.together_with))} takes the misfit from {verdict.adequacy.misfit:.2f} to "
        f"{one.misfit:.2f}, more than any plausible cause does, but only with a size that is not believed: {one.vetoed}"
        for one in verdict.vetoed
    ]


def _readable(unit: str, largest: float) -> tuple[float, str]:
    """Return how a number in SI units is multiplied to be read, and the unit that it then has."""
    return _SMALLER[unit] if unit in _SMALLER and largest < 1.0 else (1.0, unit)


def _rounded(value: float, width: float, scale: float) -> str:
    """Return a number with as many digits as its interval is worth."""
    if not (math.isfinite(value) and math.isfinite(width) and width > 0.0):
        return f"{value:.4g}"
    digits = 1 - math.floor(math.log10(width * scale))
    whole = max(math.floor(math.log10(abs(value))) + 1, 1) if value else 1
    return f"{value:.{min(max(whole + digits, 2), 8)}g}"


def _percent(logarithm: float) -> float:
    return 100.0 * math.expm1(min(logarithm, 50.0))


def improved(gain: Gain) -> str:
    """Return the interval of an improvement in words; none where there is none."""
    low, high = gain.interval
    if low == high == 0.0:
        return "none: nothing is extended"
    if not math.isfinite(low):
        return "by the one configuration that was held out, so without an interval"
    return f"{low:.3g} to {high:.3g} (95 %), better in {gain.better} of {len(gain.folds)} folds"


def wanting(verdict: Verdict) -> float | None:
    """Return by how much standard deviations would have to grow for the base model to be adequate; None if it is."""
    found = verdict.adequacy
    short = max(found.misfit / found.limit, found.smooth / found.smooth_limit)
    return math.sqrt(short) if short > 1.0 else None


def gained(gain: Gain) -> str:
    """Return an improvement in words; a gain of zero is zero."""
    text = f"{gain.metric}: {gain.held_out_before:.4g} before, {gain.held_out_after:.4g} after"
    return f"{text}; improvement {improved(gain)}"


def _candidates(verdict: Verdict) -> list[str]:
    """Return the ranking of the causes, each alone."""
    gain = verdict.gain
    if not verdict.candidates:
        return []
    told = gain is not None and any(one.held_out is not None for one in verdict.candidates)
    lines = ["", "candidates, each alone (evidence, misfit left" + (", held out if believed):" if told else "):")]
    for one in verdict.candidates[:_SHOWN]:
        said = ""
        if told and gain is not None:
            after = gain.held_out_before if one.held_out is None else one.held_out
            said = f"  {gain.held_out_before:.3g} to {after:.3g}"
        said += "" if one.converged else ", not converged"
        said += "" if one.plausible else ", not plausible"
        lines.append(f"  {one.id:22s} {one.evidence:+9.1f}  {one.misfit:6.2f}{said}")
    return lines


def as_text(verdict: Verdict) -> str:
    """Return a short readable answer."""
    lines = [f"verdict: {verdict.verdict}", sentence(verdict)]
    if not verdict.final:
        lines = [f"verdict so far, not final: {verdict.verdict}", sentence(verdict)]
    after = verdict.adequacy_after
    left = f"; with the causes {after.misfit:.2f}" if after is not None else ""
    if verdict.final or verdict.selection.base.converged:
        lines.append(f"misfit: {verdict.adequacy.misfit:.2f} times what noise and floor explain{left}")
    else:
        lines.append("the base model is not fitted yet, so nothing is known of causes")
    times = wanting(verdict) if verdict.final else None
    if verdict.verdict == "unexplained" and times is not None:
        lines.append(f"the model would do if all standard deviations were {times:.2g} times as large as stated")
    near = next((one for one in verdict.candidates if one.plausible and one.evidence > verdict.threshold), None)
    if verdict.verdict == "unexplained" and near is not None:
        lines += ["", f"nearest of the plausible causes: {near.id} ({near.variant}): {near.meaning}"]
        lines.append(f"  size: {sizes(near) or 'no number'}; it leaves a misfit of {near.misfit:.2f}")
    for one in verdict.causes:
        lines += ["", f"{one.id} ({one.group}; {one.variant}): {one.meaning}"]
        lines.append(f"  size: {sizes(one) or 'no number'}")
        lines.append(f"  chi-square falls by {one.gain:.0f}, evidence {one.evidence:+.0f}")
        if one.look_alikes:
            alike = ", ".join(f"{name} {cosine:.2f}" for name, cosine in one.look_alikes.items())
            lines.append(f"  looks like: {alike}")
        lines.append(f"  what to do: {one.remedy}")
    for one, text in zip(verdict.vetoed, vetoes(verdict), strict=True):
        lines += ["", f"vetoed: {text}", f"  {one.meaning}; what to do: {one.remedy}"]
    if (other := verdict.alternative) is not None:
        lines += ["", f"a change that is not a known cause: {other.meaning} {other.variant}"]
        lines.append(f"  size: {sizes(other)}")
        lines.append(f"  what to do: {other.remedy}")
    if verdict.ambiguous_between:
        lines += ["", f"cannot be told apart: {', '.join(verdict.ambiguous_between)}"]
    lines += _candidates(verdict)
    errors = sorted(verdict.frequency_errors(), key=lambda row: -abs(row["before"]))
    if errors:
        extended = verdict.extended is not None
        columns = "before, after" if extended else "fitted"
        lines += ["", f"natural frequencies farthest off, calculated less measured in percent ({columns}):"]
        lines += [
            f"  {r['label']} mode {r['mode']}: {r['before']:+.2f}" + (f" {r['after']:+.2f}" if extended else "")
            for r in errors[:_SHOWN]
        ]
    if verdict.gains:
        lines += ["", "held out:", *(f"  {gained(one)}" for one in verdict.gains)]
    if verdict.bias is not None:
        lines.append(f"  {verdict.bias}")
    if verdict.next_measurement is not None:
        lines += ["", f"measure next: {verdict.next_measurement.action}; {verdict.next_measurement.reason}"]
    lines += [f"note: {text}" for text in verdict.notes]
    return "\n".join(lines)
