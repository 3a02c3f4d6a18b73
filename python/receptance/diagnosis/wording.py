"""Texts on parts of a verdict."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

    from receptance.diagnosis.causes import Parameter
    from receptance.diagnosis.verdict import Candidate, Gain, Verdict

__all__ = [
    "deviation_factor",
    "gained",
    "implausible",
    "improved",
    "on_causes",
    "sentence",
    "sizes",
    "vetoes",
]

SENTENCE = {
    "adequate": "The model is adequate: noise, floor and tolerances explain the residuals.",
    "undecided": "The model cannot be judged: too few degrees of freedom are left.",
    "named": "The model is inadequate, and the data identify the cause.",
    "suspected": "The model may be inadequate; one cause is suspected.",
    "ambiguous": "The model is inadequate; these data cannot distinguish between several causes.",
    "unexplained": "The model is inadequate, and no known cause explains the misfit.",
}


UNFINISHED = "This result is preliminary, because causes were not tried: the diagnosis was interrupted"


def sentence(verdict: Verdict) -> str:
    """Return the verdict in one sentence, and where the diagnosis was interrupted if it was."""
    if verdict.final:
        return SENTENCE[verdict.verdict]
    far = verdict.settings["interrupted"]
    return f"{UNFINISHED} in step {far['step']} of about {far['of_about']}, after {far['seconds']:.0f} s."


def sizes(one: Candidate) -> str:
    """Return the sizes of a candidate, with units and 95 % intervals."""
    texts = []
    for name, (found, *ends) in one.parameters.items():
        title = name.removeprefix(f"{one.id}.")
        parameter = one.declared[name]
        # An interval by the curvature may exceed the bounds of the parameter.
        numbers = (found, *(min(max(end, parameter.lower), parameter.upper) for end in ends))
        largest = max((abs(number) for number in numbers if math.isfinite(number)), default=0.0)
        scale, unit = _readable(parameter.unit, largest)
        if title.startswith("log_"):
            # A logarithm of a factor is shown in percent.
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
        f"{one.misfit:.2f}, more than any plausible cause does, but only with an implausible size: {one.vetoed}"
        for one in verdict.vetoed
    ]


def _readable(unit: str, largest: float) -> tuple[float, str]:
    """Return how a number in SI units is multiplied to be read, and the unit that it then has."""
    return _SMALLER[unit] if unit in _SMALLER and largest < 1.0 else (1.0, unit)


def _rounded(value: float, width: float, scale: float) -> str:
    """Return a number with the digits that its interval justifies."""
    if not (math.isfinite(value) and math.isfinite(width) and width > 0.0):
        return f"{value:.4g}"
    digits = 1 - math.floor(math.log10(width * scale))
    whole = max(math.floor(math.log10(abs(value))) + 1, 1) if value else 1
    return f"{value:.{min(max(whole + digits, 2), 8)}g}"


def _percent(logarithm: float) -> float:
    return 100.0 * math.expm1(min(logarithm, 50.0))


def improved(gain: Gain) -> str:
    """Return the interval of an improvement as text."""
    low, high = gain.interval
    if low == high == 0.0:
        return "none: nothing is extended"
    if not math.isfinite(low):
        return "by the one configuration that was held out, so without an interval"
    return f"{low:.3g} to {high:.3g} (95 %), better in {gain.better} of {len(gain.folds)} folds"


def deviation_factor(verdict: Verdict) -> float | None:
    """Return the factor on all standard deviations that makes the base model adequate; None if it is adequate."""
    found = verdict.adequacy
    short = max(found.misfit / found.limit, found.smooth / found.smooth_limit)
    return math.sqrt(short) if short > 1.0 else None


def gained(gain: Gain) -> str:
    """Return an improvement as text."""
    text = f"{gain.metric}: {gain.held_out_before:.4g} before, {gain.held_out_after:.4g} after"
    return f"{text}; improvement {improved(gain)}"


def on_causes(verdict: Verdict) -> list[str]:
    """Return lines on reported and vetoed causes and on a better alternative; details are indented."""
    lines = []
    near = next((one for one in verdict.candidates if one.plausible and one.evidence > verdict.threshold), None)
    if verdict.verdict == "unexplained" and near is not None:
        lines.append(f"nearest of the plausible causes: {near.id} ({near.variant}): {near.meaning}")
        lines.append(f"  size: {sizes(near) or 'no number'}; it leaves a misfit of {near.misfit:.2f}")
    for one in verdict.causes:
        lines.append(f"{one.id} ({one.group}; {one.variant}): {one.meaning}")
        lines.append(f"  size: {sizes(one) or 'no number'}")
        lines.append(f"  chi-square falls by {one.gain:.0f}, evidence {one.evidence:+.0f}")
        if one.look_alikes:
            alike = ", ".join(f"{name} {cosine:.2f}" for name, cosine in one.look_alikes.items())
            lines.append(f"  looks like: {alike}")
        lines.append(f"  what to do: {one.remedy}")
    for one, text in zip(verdict.vetoed, vetoes(verdict), strict=True):
        lines += [f"vetoed: {text}", f"  {one.meaning}; what to do: {one.remedy}"]
    if (other := verdict.alternative) is not None:
        lines.append(f"a change that is not a known cause: {other.meaning} {other.variant}")
        lines.append(f"  size: {sizes(other)}")
        lines.append(f"  what to do: {other.remedy}")
    return lines
