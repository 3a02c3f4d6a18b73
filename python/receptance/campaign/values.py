"""Values of a campaign file: deviations, conditions, levels, priors, and quantities by address."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Any, Literal

from receptance import units
from receptance._text import did_you_mean, one_of, shown
from receptance.fit.unknowns import PARAMETERS, Prior
from receptance.units import FORCE, Quantity, parse, parse_any, split

_LARGEST_PERCENTAGE = 1000.0

# Standard deviations -------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Deviation:
    """A standard deviation."""

    amount: float
    """Value in SI units, or relative to the value of the parameter."""
    relative: bool
    """Whether it is relative."""
    name: str = ""
    """Name of the error; deviations with the same name are one error. Empty for an independent error."""

    def of(self, value: float) -> float:
        """Return the standard deviation for a value of the parameter, in SI units."""
        return self.amount * abs(value) if self.relative else self.amount


def parse_share(text: Any, expected: str) -> float:
    """Return a percentage such as "2 %" as a fraction."""
    number, unit = split(text, expected)
    if unit not in ("%", "percent"):
        raise ValueError(f"is {shown(text)}, expected {expected}")
    if number < 0.0:
        raise ValueError(f"is {shown(text)}, expected zero or more: {expected}")
    if number > _LARGEST_PERCENTAGE:
        raise ValueError(f"is {shown(text)}, expected at most {_LARGEST_PERCENTAGE:g} %: {expected}")
    return number / 100.0


def parse_deviation_share(text: Any) -> float:
    """Return a relative standard deviation from a percentage."""
    expected = 'a standard deviation of the FRF in percent, such as "2 %"'
    share = parse_share(text, expected)
    if share <= 0.0:
        raise ValueError(f'is "{text}", expected more than zero: {expected}')
    return share


def parse_deviation(value: Any, quantity: Quantity) -> Deviation:
    """Return the standard deviation of a quantity.

    Examples
    --------
    >>> from receptance import units
    >>> from receptance.campaign.values import parse_deviation
    >>> parse_deviation("2 %", units.LENGTH)
    Deviation(amount=0.02, relative=True, name='')
    >>> parse_deviation({"value": "0.5 mm", "name": "gauge"}, units.LENGTH)
    Deviation(amount=0.0005, relative=False, name='gauge')
    """
    small = small_deviation(quantity)
    written = f'"{small.example}"' if small.unit else small.example
    expected = f'a standard deviation, absolute such as {written} or relative such as "2 %"'
    name = ""
    if isinstance(value, dict):
        if set(value) != {"value", "name"} or not isinstance(value["name"], str) or not value["name"].strip():
            raise ValueError(
                f"is a table with {', '.join(map(str, value)) or 'nothing'}, expected exactly "
                "value (a standard deviation) and name (text)"
            )
        name, value = value["name"], value["value"]
    if isinstance(value, str) and value.strip().endswith(("%", "percent")):
        return Deviation(parse_share(value, expected), True, name)
    return Deviation(parse(value, small, expected), False, name)


def small_deviation(quantity: Quantity) -> Quantity:
    """Return the quantity of the standard deviations of a quantity."""
    unit = quantity.example.partition(" ")[2]
    example = f"0.1 {unit}" if unit else "0.01"
    return Quantity(quantity.name, quantity.unit, example, least=0.0, written=(0.0, quantity.written[1]))


def parse_frequency_deviation(text: str) -> Deviation:
    """Return the standard deviation of a natural frequency, in Hz or relative."""
    deviation = parse_deviation(text, units.FREQUENCY)
    if deviation.amount <= 0.0:
        raise ValueError(f"is {shown(text)}, expected more than zero")
    return deviation


def parse_damping_ratio(text: str) -> float:
    """Return a damping ratio from a percentage; NaN for "unknown"."""
    return math.nan if text == "unknown" else parse_share(text, 'a damping ratio such as "1.2 %", or "unknown"')


def parse_damping_deviation(written: Any) -> Deviation:
    """Return the standard deviation of a damping ratio: a percentage of it, or a number."""
    expected = 'a standard deviation such as "5 %" of the ratio, or a number'
    if isinstance(written, str):
        return Deviation(parse_share(written, expected), True)
    if isinstance(written, bool) or not isinstance(written, (int, float)):
        raise ValueError(f"is {shown(written)}, expected {expected}")
    return Deviation(float(written), False)


# Conditions and levels -----------------------------------------------------------------------------------------------


def parse_condition(written: Any) -> float:
    """Return the value of a condition in SI units from its value in the file.

    Examples
    --------
    >>> from receptance.campaign.values import parse_condition
    >>> parse_condition("5 kN")
    5000.0
    """
    if isinstance(written, bool) or not isinstance(written, (str, int, float)):
        raise ValueError(f"is {shown(written)}, expected text with a number and a unit, or a plain number")
    value = parse_any(written)[0] if isinstance(written, str) else float(written)
    if not math.isfinite(value):
        raise ValueError(f"is {shown(written)}, expected a finite number")
    return value


def parse_level(written: Any) -> tuple[float, bool]:
    """Return a level, and whether it is a force in N instead of a ratio.

    Examples
    --------
    >>> from receptance.campaign.values import parse_level
    >>> parse_level("50 N"), parse_level(2.0)
    ((50.0, True), (2.0, False))
    """
    if isinstance(written, bool) or not isinstance(written, (str, int, float)):
        raise ValueError(f'is {shown(written)}, expected a number, or a force such as "50 N"')
    if isinstance(written, str):
        return parse(written, FORCE), True
    if not 0.0 <= written < float("inf"):
        raise ValueError(f'is {shown(written)}, expected a number from 0 on, or a force such as "50 N"')
    return float(written), False


def parse_radial_depth(written: Any) -> tuple[float, bool]:
    """Return a radial depth of cut, and whether it is a length in m instead of a share of the diameter.

    Examples
    --------
    >>> from receptance.campaign.values import parse_radial_depth
    >>> parse_radial_depth("6 mm"), parse_radial_depth("50 %"), parse_radial_depth(0.5)
    ((0.006, True), (0.5, False), (0.5, False))
    """
    expected = 'a length such as "6 mm", or a share of the diameter such as 0.5 or "50 %", 1 for a slot'
    if isinstance(written, str) and not written.rstrip().endswith(("%", "percent")):
        return parse(written, units.LENGTH, expected), True
    if isinstance(written, str):
        share = parse_share(written, expected)
        if not units.IMMERSION.holds(share):
            raise ValueError(f"is {shown(written)}, expected {units.IMMERSION.bounds}: {expected}")
        return share, False
    return parse(written, units.IMMERSION, expected), False


def parse_force_window(written: Any) -> float | Literal["auto", "none"]:
    """Return the length of the force window in s, "auto" or "none"."""
    if written in ("auto", "none"):
        return "auto" if written == "auto" else "none"
    return parse(written, units.TIME, 'a time such as "2 ms", "auto" or "none"')


# Priors --------------------------------------------------------------------------------------------------------------


def prior_of(kind: Quantity, value: str | float, spread: str | float, logarithmic: bool) -> Prior:
    """Return the prior of an unknown on the scale of the fit, from its value and spread in the file."""
    mean = parse(value, kind)
    return Prior(mean=mean, standard_deviation=_prior_deviation(kind, spread, mean, logarithmic))


def _prior_deviation(kind: Quantity, written: str | float, mean: float, logarithmic: bool) -> float:
    expected = 'a standard deviation such as "30 %", or a quantity of the parameter\'s kind'
    if not isinstance(written, str):
        return parse(written, kind) / (abs(mean) if logarithmic else 1.0)
    if written.startswith("factor"):
        try:
            factor = float(written.removeprefix("factor"))
        except ValueError:
            factor = math.nan
        if not logarithmic or not factor > 1.0 or math.isinf(factor):
            also = ', or "factor 3", a number above one' if logarithmic else '; a factor needs the scale "log"'
            raise ValueError(f"has the spread {shown(written)}, expected {expected}{also}")
        return math.log(factor)
    if written.rstrip().endswith(("%", "percent")):
        share = parse_share(written, expected)
        return share if logarithmic else share * abs(mean)
    return parse(written, kind) / (abs(mean) if logarithmic else 1.0)


_INSIDE = r"(?:mode\[\d+\]|segment\[(?:\d+|\*)\]|shank|sleeve)\.(?:core\.)?|(?:inner|outer)\."
_ADDRESS = re.compile(rf"(?P<owner>[^\W\d]\w*)\.(?:{_INSIDE})?(?P<field>\w+)")


PLAIN_NUMBER = Quantity("a number", "", "0.02")
"""Value of an unknown that moves parameters or is a multiple of one."""


def kind_of(address: str) -> Quantity:
    """Return the quantity of the parameter at an address.

    Raises
    ------
    ValueError
        The text is not an address, or names an unknown parameter.

    Examples
    --------
    >>> from receptance.campaign.values import kind_of
    >>> kind_of("tool.segment[0].length").unit
    'm'
    """
    match = _ADDRESS.fullmatch(address)
    if match is None:
        raise ValueError('is not an address, expected one such as "joint.k_theta" or "tool.segment[0].length"')
    field = match["field"]
    if field not in PARAMETERS:
        near = did_you_mean(field, PARAMETERS)
        raise ValueError(f'names an unknown quantity "{field}"{near}; expected {one_of(PARAMETERS)}')
    return PARAMETERS[field]
