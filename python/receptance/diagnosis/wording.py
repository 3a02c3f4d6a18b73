"""Words and numbers of a diagnosis: names of causes, sizes with units, ratios and odds."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from receptance._text import join_names
from receptance.diagnosis.catalogue import CATALOGUE
from receptance.diagnosis.causes import Parameter
from receptance.report.table import amount, amounts, percent

# Names.


def title_of(id: str) -> str:
    """Return the name of a cause in texts and figures."""
    return CATALOGUE[id].title if id in CATALOGUE else id.replace("_", " ")


def names(ids: Sequence[str]) -> str:
    """Return the names of causes as a list in a sentence."""
    return join_names([title_of(id) for id in ids])


def capital(text: str) -> str:
    """Return a text with a capital first letter."""
    return text[:1].upper() + text[1:]


# Sizes with units.


def size_texts(
    values: Mapping[str, tuple[float, float, float]], parameters: Mapping[str, Parameter]
) -> list[tuple[str, str]]:
    """Return each value of a cause with its unit, such as "mass 1.99 g", and its 95 % interval, "1.98 to 2.00 g"."""
    texts = []
    for name, (value, *ends) in values.items():
        parameter = parameters[name]
        # An interval by the curvature may exceed the bounds of the parameter.
        low, high = (min(max(end, parameter.lower), parameter.upper) for end in ends)
        numbers, unit = _in_unit(parameter, name, (value, low, high), _digits(value, high - low))
        texts.append((f"{_words(parameter, name)} {numbers[0]}{unit}", f"{numbers[1]} to {numbers[2]}{unit}"))
    return texts


_MOST_SIZES = 6
"""Most sizes of a cause in a text."""


def sizes(values: Mapping[str, tuple[float, float, float]], parameters: Mapping[str, Parameter]) -> str:
    """Return the sizes of a cause, with units and 95 % intervals; of many those that are the most significant."""

    def significance(name: str) -> float:
        value, low, high = values[name]
        return abs(value - parameters[name].null) / max(high - low, 1e-300)

    kept = sorted(values, key=significance, reverse=True)[:_MOST_SIZES]
    texts = size_texts({name: value for name, value in values.items() if name in kept}, parameters)
    shown = ", ".join(f"{size} (95 %: {interval})" for size, interval in texts)
    return shown if len(values) <= _MOST_SIZES else f"{shown}, and {len(values) - _MOST_SIZES} less significant ones"


def implausible(parameters: Mapping[str, Parameter], values: Mapping[str, float]) -> str:
    """Return the sizes of a cause outside their plausible range, and the range; empty where there is none."""
    texts = []
    for name, value in values.items():
        parameter = parameters[name]
        if not parameter.is_plausible(value):
            numbers, unit = _in_unit(parameter, name, (value, *parameter.plausible), 3)
            size, low, high = (f"{number}{unit}" for number in numbers)
            texts.append(f"{_words(parameter, name)} {size}, where {low} to {high} is plausible")
    return "; ".join(texts)


def _in_unit(parameter: Parameter, name: str, values: Sequence[float], digits: int) -> tuple[list[str], str]:
    """Return numbers as text, and their unit with a space before it; logarithms in percent."""
    if _title(parameter, name).startswith("log_"):
        return [percent(_relative(value), 3, sign=True).removesuffix(" %") for value in values], " %"
    texts, unit = amounts(values, parameter.unit, digits)
    return texts, f" {unit}" if unit else ""


def _title(parameter: Parameter, name: str) -> str:
    return name.removeprefix(f"{parameter.cause}.")


def _words(parameter: Parameter, name: str) -> str:
    """Return the name of a parameter in words; names in a campaign, such as k_y, are kept."""
    word, *rest = _title(parameter, name).removeprefix("log_").split(" ")
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
