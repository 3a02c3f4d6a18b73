"""Texts of a verdict: sentences, sizes with units, ratios and odds."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from receptance._text import join_names
from receptance.report.table import amount, amount_interval, amounts, percent

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from receptance.diagnosis.causes import Parameter
    from receptance.diagnosis.held_out import Gain
    from receptance.diagnosis.verdict import CandidateCause, Verdict

SENTENCE = {
    "adequate": "Noise, floor and tolerances explain the residuals.",
    "undecided": "The model cannot be judged: too few degrees of freedom are left.",
    "named": "The model is inadequate, and the data identify the cause.",
    "suspected": "The model may be inadequate; one cause is suspected.",
    "ambiguous": "The model is inadequate; these data cannot distinguish between several causes.",
    "partly explained": "The model is inadequate; a cause explains most of the error, and the rest has no known cause.",
    "unexplained": "The model is inadequate, and no known cause explains the misfit.",
}


def sentence(verdict: Verdict) -> str:
    """Return the verdict in one sentence, and where the diagnosis was interrupted if it was."""
    if verdict.final:
        return SENTENCE[verdict.verdict]
    position = verdict.settings["interrupted"]
    return (
        "This result is preliminary, because causes were not tried: the diagnosis was interrupted in step "
        f"{position['step']} of about {position['of_about']}, after {position['seconds']:.0f} s."
    )


# Names.


def title_of(id: str) -> str:
    """Return the name of a cause in texts and figures."""
    from receptance.diagnosis.catalogue import CATALOGUE

    return CATALOGUE[id].title if id in CATALOGUE else id.replace("_", " ")


def names(ids: Sequence[str]) -> str:
    """Return the names of causes as a list in a sentence."""
    return join_names([title_of(id) for id in ids])


def place(one: CandidateCause) -> str:
    """Return where or how a cause acts; empty if it acts everywhere."""
    return "" if one.variant == "all" else one.variant


def capital(text: str) -> str:
    """Return a text with a capital first letter."""
    return text[:1].upper() + text[1:]


# Sizes with units.


def sizes(one: CandidateCause) -> str:
    """Return the sizes of a candidate, with units and 95 % intervals."""
    texts = []
    for name, (value, *ends) in one.parameters.items():
        parameter = one.declared[name]
        # An interval by the curvature may exceed the bounds of the parameter.
        low, high = (min(max(end, parameter.lower), parameter.upper) for end in ends)
        title = _title(parameter, name)
        digits = _digits(value, high - low)
        if title.startswith("log_"):
            texts_of = [percent(_relative(number), 3, sign=True).removesuffix(" %") for number in (value, low, high)]
            unit = "%"
        else:
            texts_of, unit = amounts([value, low, high], parameter.unit, digits)
        unit = f" {unit}" if unit else ""
        shown = _words(title)
        texts.append(f"{shown} {texts_of[0]}{unit} (95 %: {texts_of[1]} to {texts_of[2]}{unit})")
    return ", ".join(texts)


def implausible(parameters: Mapping[str, Parameter], values: Mapping[str, float]) -> str:
    """Return the sizes of a cause outside their plausible range, and the range; empty where there is none."""
    texts = []
    for name, value in values.items():
        parameter = parameters[name]
        if parameter.is_plausible(value):
            continue
        numbers = (value, *parameter.plausible)
        title = _title(parameter, name)
        if title.startswith("log_"):
            shown = [percent(_relative(x), 3, sign=True) for x in numbers]
        else:
            numbers_shown, unit = amounts(numbers, parameter.unit)
            shown = [f"{text} {unit}".strip() for text in numbers_shown]
        texts.append(f"{_words(title)} {shown[0]}, where {shown[1]} to {shown[2]} is plausible")
    return "; ".join(texts)


def _title(parameter: Parameter, name: str) -> str:
    return name.removeprefix(f"{parameter.cause}.")


def _words(title: str) -> str:
    """Return the name of a parameter in words; names in a campaign, such as k_y, are kept."""
    word, *rest = title.removeprefix("log_").split(" ")
    return " ".join([word if word.startswith(("k_", "c_")) else word.replace("_", " "), *rest])


def _digits(value: float, width: float) -> int:
    """Return the significant digits that the width of the interval justifies."""
    ratio = abs(value) / width if width > 0.0 else 0.0
    # Neither an underflow nor an open interval says anything of the digits.
    return min(max(math.floor(math.log10(ratio)) + 3, 2), 6) if math.isfinite(ratio) and ratio > 0.0 else 3


def _relative(logarithm: float) -> float:
    return math.expm1(min(logarithm, 50.0))


# Ratios.

_LARGEST_ODDS = 1e6


def odds(difference: float) -> str:
    """Return the odds of an explanation to one with more evidence, from the difference of both.

    Evidence is twice the logarithm of the odds.

    Examples
    --------
    >>> from receptance.diagnosis.wording import odds
    >>> odds(0.0), odds(7.0), odds(4000.0)
    ('1 : 1', '1 : 33', '< 1 : 1e6')
    """
    ratio = math.exp(min(0.5 * max(difference, 0.0), 50.0))
    return "< 1 : 1e6" if ratio > _LARGEST_ODDS else f"1 : {amount(ratio, digits=2).removesuffix('.0')}"


def share(before: float, after: float, noise: float = 1.0) -> str:
    """Return the share of the misfit above the noise that is explained, in percent; empty where there is none.

    Parameters
    ----------
    before, after, noise : float
        Chi-square divided by its expectation.

    Examples
    --------
    >>> from receptance.diagnosis.wording import share
    >>> share(5.0, 2.0), share(5.0, 1.001), share(0.99, 0.98), share(1.04, 1.02, 1.02)
    ('75 %', '> 99 %', '', '100 %')
    """
    if before <= noise:
        return ""
    percent = 100.0 * min(max((before - after) / (before - noise), 0.0), 1.0)
    return "> 99 %" if 99.0 < percent < 99.99 else f"{percent:.0f} %"


def times(misfit: float) -> str:
    """Return the root mean square of residuals relative to their expectation."""
    return amount(math.sqrt(misfit))


def residual(verdict: Verdict, misfit: float) -> str:
    """Return the size of residuals in words."""
    beside = "noise and model error" if verdict.discrepancy is not None and verdict.causes else "the noise"
    return f"residuals of {times(misfit)} times {beside}"


def metric(name: str) -> tuple[str, float, str]:
    """Return a metric of held-out data in words, the factor to the unit in which it is shown, and this unit."""
    if name.startswith("log-spectral distance"):
        return "distance of the spectra", 20.0 / math.log(10.0), "dB"
    if name == "predictive log score in nats":
        return "predictive log score", 1.0, "nats"
    if name.endswith(" in percent"):
        return name.removesuffix(" in percent"), 1.0, "%"
    return name, 1.0, ""


def of_metric(metric_name: str, value: float, digits: int = 3) -> str:
    """Return the value of a metric of held-out data in the unit in which it is shown.

    Examples
    --------
    >>> from receptance.diagnosis.wording import of_metric
    >>> of_metric("predictive log score in nats", -760123.0), of_metric("rms error in percent", 2.2e-4)
    ('-760,000 nats', '< 0.001 %')
    """
    _, scale, unit = metric(metric_name)
    shown = scale * value
    if unit == "%":
        return percent(0.01 * shown, digits)
    if unit == "nats" and math.isfinite(shown) and abs(shown) >= 1e3:
        return f"{float(f'{shown:.{digits}g}'):,.0f} nats"
    return amount(shown, unit, digits)


# Sentences.


def where(verdict: Verdict) -> list[str]:
    """Return the place of the largest residual, and the standard deviations with which the model would be adequate."""
    own = verdict.adequacy
    if own.passed or verdict.verdict == "undecided":
        return []
    found = [f"The largest residuals are in {own.worst[0]}."] if own.worst else []
    factor = math.sqrt(max(own.misfit / own.limit, own.smooth / own.smooth_limit))
    if verdict.verdict == "unexplained" and verdict.final and factor > 1.0:
        found.append(
            f"The model would be adequate if all standard deviations were {amount(factor, digits=2)} times as large."
        )
    return found


def veto(verdict: Verdict, one: CandidateCause) -> str:
    """Return why a cause that explains the data is not reported."""
    return (
        f"With the {names((one.id, *one.together_with))} the residuals fall from {times(verdict.adequacy.misfit)} to "
        f"{times(one.misfit)} times the noise, "
        f"more than with any plausible cause, but only with an implausible size: {one.vetoed}"
    )


def improvement_interval(gain: Gain) -> str:
    """Return the interval of an improvement as text, in the unit of the metric."""
    low, high = gain.interval
    if low == high == 0.0:
        return "none: no cause is added to the model"
    if not math.isfinite(low):
        return "no interval: one configuration was held out"
    _, scale, unit = metric(gain.metric)
    units = ""
    if gain.units > len(gain.folds):
        units = f", from {gain.units} {gain.unit} with a correlation of {gain.correlation:.2f} within a fold"
    better = amount_interval((scale * low, scale * high), unit, 3)
    return f"better by {better} (95 %{units}), in {gain.better} of {len(gain.folds)} folds"
