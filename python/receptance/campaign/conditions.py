"""Numbers with units that describe a configuration or a measurement: torque, insertion, force level."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from receptance._text import shown
from receptance.units import parse_any

__all__ = ["Condition", "parse_condition"]


@dataclass(frozen=True)
class Condition:
    """A number that describes a configuration or a measurement.

    Attributes
    ----------
    value : float
        In SI units.
    unit : str
        SI unit, empty for a plain number.
    written : str
        As it stands in the file.
    """

    value: float
    unit: str
    written: str


def parse_condition(written: Any) -> Condition:
    """Return a condition.

    Examples
    --------
    >>> from receptance.campaign.conditions import parse_condition
    >>> parse_condition("5 kN")
    Condition(value=5000.0, unit='kg m/s^2', written='5 kN')
    """
    if isinstance(written, bool) or not isinstance(written, (str, int, float)):
        raise ValueError(f"is {shown(written)}, expected text with a number and a unit, or a plain number")
    value, unit = parse_any(written) if isinstance(written, str) else (float(written), "")
    if not math.isfinite(value):
        raise ValueError(f"is {shown(written)}, expected a finite number")
    return Condition(value, unit, written if isinstance(written, str) else f"{written:g}")
