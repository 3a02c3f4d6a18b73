"""Units of recorded channels, turned into SI factors."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pint import UnitRegistry

__all__ = ["SI_UNITS", "factor_to_si"]

SI_UNITS = {
    "force": "N",
    "moment": "N m",
    "displacement": "m",
    "velocity": "m/s",
    "acceleration": "m/s^2",
    "rotation": "rad",
    "angular velocity": "rad/s",
    "angular acceleration": "rad/s^2",
}
"""SI unit of every quantity that a channel may hold."""


def factor_to_si(owner: str, what: str, quantity: str, unit: str) -> float:
    """Return the factor from a recorded number to SI.

    Parameters
    ----------
    owner, what : str
        What is named in errors, such as "TimeRecords 'hammer'" and "force_unit".
    quantity : str
        A key of `SI_UNITS`.
    unit : str
        A unit, such as "m/s^2", "um" or "g", or an expression with the sensitivity of a sensor, such as
        "V/(2.25 mV/N)".

    Raises
    ------
    TypeError
        Not text.
    ValueError
        An unknown unit, or the unit of another quantity.

    Examples
    --------
    >>> from receptance.measurement.units import factor_to_si
    >>> factor_to_si("here", "response_unit", "acceleration", "g")
    9.80665
    >>> round(factor_to_si("here", "force_unit", "force", "V/(2.25 mV/N)"), 3)
    444.444
    """
    expected = f'a unit of {quantity} such as "{SI_UNITS[quantity]}", or "V/(10 mV/({SI_UNITS[quantity]}))"'
    if not isinstance(unit, str):
        raise TypeError(f"{owner}: {what} is {unit!r}, expected {expected}")
    if unit.strip() == SI_UNITS[quantity]:
        return 1.0
    if quantity == "acceleration" and unit.strip() in ("g", "g0", "gn", "g_n"):
        # pint's g is the gram, which no acceleration is measured in.
        return 9.80665
    from receptance.io.units import can_be_unit

    if not can_be_unit(unit):
        raise ValueError(f"{owner}: {what} is {unit[:60]!r}, which is not understood as a unit, expected {expected}")
    registry = _registry()
    try:
        found: Any = registry.Quantity(unit) if unit.strip() else None
        if found is None or not found.is_compatible_with(SI_UNITS[quantity]):
            of = "" if found is None else f", which is {found.dimensionality}"
            raise ValueError(f"{owner}: {what} is {unit!r}{of}, expected {expected}")
        factor = float(found.to(SI_UNITS[quantity]).magnitude)
    except ValueError:
        raise
    except Exception as error:  # pint raises a dozen types for what it cannot read
        raise ValueError(
            f"{owner}: {what} is {unit!r}, which is not understood ({error}), expected {expected}"
        ) from None
    if not 0.0 < abs(factor) < float("inf"):
        raise ValueError(f"{owner}: {what} is {unit!r}, a factor of {factor:g}, expected {expected}")
    return factor


@functools.cache
def _registry() -> UnitRegistry[Any]:
    from pint import UnitRegistry  # takes a good part of a second

    return UnitRegistry()
