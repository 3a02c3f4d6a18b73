"""Texts of a verdict: sentences of the summary and of the report."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from receptance.diagnosis.by_mode import ModeResidual
    from receptance.diagnosis.causes import Parameter
    from receptance.diagnosis.verdict import Candidate, Gain, Verdict

__all__ = [
    "cause_lines",
    "deviation_factor",
    "discrepancy",
    "implausible",
    "improvement_interval",
    "remarks",
    "report_sentences",
    "sentence",
    "sizes",
]

SENTENCE = {
    "adequate": "The model is adequate: noise, floor and tolerances explain the residuals.",
    "undecided": "The model cannot be judged: too few degrees of freedom are left.",
    "named": "The model is inadequate, and the data identify the cause.",
    "suspected": "The model may be inadequate; one cause is suspected.",
    "ambiguous": "The model is inadequate; these data cannot distinguish between several causes.",
    "partly explained": "The model is inadequate; a cause explains most of the error, and the rest has no known cause.",
    "unexplained": "The model is inadequate, and no known cause explains the misfit.",
}

UNFINISHED = "This result is preliminary, because causes were not tried: the diagnosis was interrupted"

_EXPECTED = "times its expectation from noise and floor"


def sentence(verdict: Verdict) -> str:
    """Return the verdict in one sentence, and where the diagnosis was interrupted if it was."""
    if verdict.final:
        return SENTENCE[verdict.verdict]
    position = verdict.settings["interrupted"]
    return (
        f"{UNFINISHED} in step {position['step']} of about {position['of_about']}, after {position['seconds']:.0f} s."
    )


# Sizes with units.

_SMALLER_UNIT = {"kg": (1e3, "g"), "m": (1e3, "mm"), "s": (1e6, "µs")}


def sizes(one: Candidate) -> str:
    """Return the sizes of a candidate, with units and 95 % intervals."""
    texts = []
    for name, (value, *ends) in one.parameters.items():
        parameter = one.declared[name]
        # An interval by the curvature may exceed the bounds of the parameter.
        low, high = (min(max(end, parameter.lower), parameter.upper) for end in ends)
        title, unit, scale = _quantity(parameter, name, (value, low, high))
        if scale is None:
            shown = [f"{_percent(number):+.3g}" for number in (value, low, high)]
        else:
            shown = [_rounded(scale * number, high - low, scale) for number in (value, low, high)]
        texts.append(f"{title} {shown[0]}{' ' + unit if unit else ''} ({shown[1]} to {shown[2]})")
    return ", ".join(texts)


def implausible(parameters: Mapping[str, Parameter], values: Mapping[str, float]) -> str:
    """Return the sizes of a cause outside their plausible range, and the range; empty where there is none."""
    texts = []
    for name, value in values.items():
        parameter = parameters[name]
        if parameter.is_plausible(value):
            continue
        numbers = (value, *(parameter.plausible or (parameter.lower, parameter.upper)))
        title, unit, scale = _quantity(parameter, name, numbers)
        shown = [f"{_percent(x):+.3g} %" if scale is None else f"{scale * x:.3g} {unit}".strip() for x in numbers]
        texts.append(f"{title} {shown[0]}, where {shown[1]} to {shown[2]} is plausible")
    return "; ".join(texts)


def _quantity(parameter: Parameter, name: str, numbers: Sequence[float]) -> tuple[str, str, float | None]:
    """Return title and unit in which numbers are shown, and their scale; None for a logarithm, shown in percent."""
    title = name.removeprefix(f"{parameter.cause}.")
    if title.startswith("log_"):
        return title.removeprefix("log_"), "%", None
    largest = max((abs(number) for number in numbers if math.isfinite(number)), default=0.0)
    scale, unit = (1.0, parameter.unit)
    if largest < 1.0:
        scale, unit = _SMALLER_UNIT.get(unit, (1.0, unit))
    return title, unit, scale


def _rounded(value: float, width: float, scale: float) -> str:
    """Return a number with the digits that its interval justifies."""
    if not (math.isfinite(value) and math.isfinite(width) and width > 0.0):
        return f"{value:.4g}"
    digits = 1 - math.floor(math.log10(width * scale))
    whole = max(math.floor(math.log10(abs(value))) + 1, 1) if value else 1
    return f"{value:.{min(max(whole + digits, 2), 8)}g}"


def _percent(logarithm: float) -> float:
    return 100.0 * math.expm1(min(logarithm, 50.0))


# Lines of the summary.


def remarks(one: Candidate) -> str:
    """Return why a candidate is doubtful; empty where it is not."""
    return ", ".join(
        text for text, ok in (("not plausible", one.plausible), ("not converged", one.converged)) if not ok
    )


def cause_lines(verdict: Verdict) -> list[str]:
    """Return lines on reported and vetoed causes and on a better alternative; details are indented."""
    lines = []
    near = next((one for one in verdict.candidates if one.plausible and one.evidence > verdict.threshold), None)
    if verdict.verdict == "unexplained" and near is not None:
        lines.append(f"plausible cause with the highest evidence: {near.id} ({near.variant}): {near.meaning}")
        lines.append(f"  size: {sizes(near) or 'no parameter'}; misfit with it {near.misfit:.2f}")
    for one in verdict.causes:
        lines.append(f"{one.id} ({one.group}; {one.variant}): {one.meaning}")
        lines.append(f"  size: {sizes(one) or 'no parameter'}")
        if verdict.discrepancy is None:
            lines.append(f"  chi-square decreases by {one.gain:.0f}, evidence {one.evidence:+.0f}")
        if one.look_alikes:
            cosines = ", ".join(f"{name} {cosine:.2f}" for name, cosine in one.look_alikes.items())
            lines.append(f"  look-alikes: {cosines}")
        lines.append(f"  remedy: {one.remedy}")
    for one in verdict.vetoed:
        lines += [f"vetoed: {_veto(verdict, one)}", f"  {one.meaning}; remedy: {one.remedy}"]
    if (other := verdict.alternative) is not None:
        lines.append(f"a change that is not a known cause: {other.meaning} {other.variant}")
        lines.append(f"  size: {sizes(other)}")
        lines.append(f"  remedy: {other.remedy}")
    return lines


def discrepancy(verdict: Verdict) -> str:
    """Return the discrepancy of the base, and of the extended model, in one line."""
    after = "" if verdict.discrepancy_after is None else f"; with the cause {verdict.discrepancy_after}"
    return f"error of the model beside noise: {verdict.discrepancy}{after}"


def _veto(verdict: Verdict, one: Candidate) -> str:
    return (
        f"{' + '.join((one.id, *one.together_with))} reduces the misfit from {verdict.adequacy.misfit:.2f} to "
        f"{one.misfit:.2f}, more than any plausible cause, but only with an implausible size: {one.vetoed}"
    )


def improvement_interval(gain: Gain) -> str:
    """Return the interval of an improvement as text."""
    low, high = gain.interval
    if low == high == 0.0:
        return "none: no cause is added to the model"
    if not math.isfinite(low):
        return "no interval: one configuration was held out"
    units = ""
    if gain.units > len(gain.folds):
        units = f", from {gain.units} {gain.unit} with a correlation of {gain.correlation:.2f} within a fold"
    return f"{low:.3g} to {high:.3g} (95 %{units}), better in {gain.better} of {len(gain.folds)} folds"


def deviation_factor(verdict: Verdict) -> float | None:
    """Return the factor on all standard deviations that makes the base model adequate; None if it is adequate."""
    found = verdict.adequacy
    excess = max(found.misfit / found.limit, found.smooth / found.smooth_limit)
    return math.sqrt(excess) if excess > 1.0 else None


# Sentences of the report.


def report_sentences(verdict: Verdict, before: Sequence[ModeResidual], after: Sequence[ModeResidual]) -> list[str]:
    """Return the sentences on data, model, causes, modes and gain."""
    model = verdict.selection.base.model
    receptances = model.receptances
    lines = sum(one.frequency_hz.size for one in receptances)
    frequencies = sum(one.frequency_hz.size for one in model.frequencies)
    data = [f"{len(receptances)} receptances with {lines} lines"] if receptances else []
    data += [f"{frequencies} natural frequencies"] if frequencies else []
    count = len(model.configurations)
    sentences = [
        f"The data are {' and '.join(data)} of {count} configuration{'s' if count != 1 else ''}. The model was fitted "
        "to all of them together; dimensions and materials vary within their tolerances.",
        _adequacy_sentence(verdict),
        *_cause_sentences(verdict),
        *(f"{_veto(verdict, one)}." for one in verdict.vetoed),
        *_mode_sentences(before, after),
    ]
    if (gain := verdict.gain) is not None:
        text = f"{gain.metric}: {gain.held_out_before:.4g} before, {gain.held_out_after:.4g} after"
        sentences.append(f"Held-out data: {text}; improvement {improvement_interval(gain)}.")
    if verdict.bias is not None:
        sentences.append(f"Held-out data with the model as given: {verdict.bias}.")
    return sentences


def _adequacy_sentence(verdict: Verdict) -> str:
    if verdict.verdict == "undecided":
        return "The data have too few degrees of freedom to test the model."
    adequacy = verdict.adequacy
    text = f"The misfit is {adequacy.misfit:.2f} {_EXPECTED}"
    if not adequacy.passed:
        return f"{text}, and is largest in {adequacy.worst[0]}." if adequacy.worst else f"{text}."
    if verdict.verdict in ("named", "suspected", "ambiguous"):
        return f"{text}. The model passes the test of adequacy, but a cause has evidence above the detection threshold."
    return f"{text}; the model is adequate."


def _cause_sentences(verdict: Verdict) -> list[str]:
    after = verdict.adequacy_after
    misfit = f" The misfit with it is {after.misfit:.2f} {_EXPECTED}." if after is not None else ""
    if verdict.verdict == "ambiguous":
        between = ", ".join(verdict.ambiguous_between)
        return [f"These data cannot distinguish between {between}: each of them explains the misfit.{misfit}"]
    if (other := verdict.alternative) is not None:
        return [
            f"A cause of the catalogue explains the data similarly well, but {other.meaning} {other.variant} "
            f"({sizes(other)}) is preferred. It is not a known cause, so no cause is named: {other.remedy}."
        ]
    if verdict.verdict == "unexplained":
        causes = "known causes" if verdict.final else "causes that were tried so far"
        return [
            f"None of the {len(verdict.candidates)} {causes} explains it. The reason may be a cause outside the "
            "catalogue, or several causes together.",
            *_unexplained_sentences(verdict),
        ]
    names = " and ".join(one.id for one in verdict.causes)
    if verdict.verdict == "partly explained":
        return [
            f"{names} explains most of the error of the model, not all of it: "
            f"{'; '.join(one.meaning for one in verdict.causes)}.",
            f"{discrepancy(verdict).capitalize()}.",
        ]
    if verdict.verdict == "suspected":
        return [f"{names} explains the misfit and is suspected only; the notes state the reasons.{misfit}"]
    if verdict.verdict == "named":
        return [f"The cause is {names}: {'; '.join(one.meaning for one in verdict.causes)}.{misfit}"]
    return ["No cause of the catalogue has evidence above the detection threshold."]


def _unexplained_sentences(verdict: Verdict) -> list[str]:
    """Describe the cause with the highest evidence if none explains the data, and the misfit of the model."""
    sentences = []
    if verdict.candidates:
        best = verdict.candidates[0]
        text = (
            f"{best.id} has the highest evidence ({best.meaning}): the misfit with it is {best.misfit:.3g} {_EXPECTED}"
        )
        if verdict.gain is not None and best.held_out is not None:
            text += (
                f", and held-out data ({verdict.gain.metric}) change from {verdict.gain.held_out_before:.3g} to "
                f"{best.held_out:.3g}"
            )
        sentences.append(f"{text}.")
    times = deviation_factor(verdict)
    if times is not None:
        sentences.append(f"The model would be adequate if all standard deviations were {times:.2g} times as large.")
    return sentences


def _mode_sentences(before: Sequence[ModeResidual], after: Sequence[ModeResidual]) -> list[str]:
    fitted, extended = (np.array([one.frequency_percent for one in modes]) for modes in (before, after))
    if not np.isfinite(fitted).any():
        return []
    worst = before[int(np.nanargmax(np.abs(fitted)))]
    text = (
        f"The errors of the natural frequencies of the fitted model are {_rms(fitted):.2g} % rms, the largest one in "
        f"{worst.label}, mode {worst.mode} ({worst.frequency_percent:+.2g} %)"
    )
    return [
        text
        + (f"; those of the extended model are {_rms(extended):.2g} % rms." if np.isfinite(extended).any() else ".")
    ]


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.nanmean(values**2)))
