"""What kind of quantity stands behind an address, and places on parts."""

from __future__ import annotations

import re
from typing import Any, Literal

from receptance import units
from receptance._text import did_you_mean, one_of, shown
from receptance.beams import Segment
from receptance.collet import ColletJoint
from receptance.fields import Element, Number
from receptance.joints import PointJoint, PointMass
from receptance.materials import Material
from receptance.microslip import MicroslipJoint
from receptance.modal_parts import ModalPart, Mode
from receptance.spread import SpreadJoint
from receptance.units import Quantity, parse

__all__ = ["FIELDS", "kind_of", "parse_position", "value_at"]

_OBSERVATION = {
    "log_gain": units.LOGARITHM,
    "delay": units.DELAY,
    "decay_rate": units.DECAY_RATE,
    "decay_rate_of_velocity": units.DECAY_RATE,
    "decay_rate_of_displacement": units.DECAY_RATE,
    "end": units.TIME,
}
"""Unknowns of the measuring chain, see `receptance.identification.factors`."""
_ELEMENTS: tuple[type[Element], ...] = (
    PointJoint,
    MicroslipJoint,
    SpreadJoint,
    ColletJoint,
    Segment,
    Material,
    PointMass,
    Mode,
    ModalPart,
)
FIELDS: dict[str, Quantity] = {
    name: field.quantity
    for element in _ELEMENTS
    for name, field in element.declared.items()
    if isinstance(field, Number) and field.parameter
} | _OBSERVATION
_INSIDE = r"(?:mode\[\d+\]|segment\[(?:\d+|\*)\]|shank|sleeve)\.(?:core\.)?|(?:inner|outer)\."
_ADDRESS = re.compile(rf"(?P<owner>[^\W\d]\w*)\.(?:{_INSIDE})?(?P<field>\w+)")


def kind_of(address: str) -> Quantity:
    """Return what kind of quantity an address names.

    Raises
    ------
    ValueError
        It is not the form of an address, or there is no such quantity.

    Examples
    --------
    >>> from receptance.campaign.addresses import kind_of
    >>> kind_of("tool.segment[0].length").unit
    'm'
    """
    match = _ADDRESS.fullmatch(address)
    if match is None:
        raise ValueError('is no address; expected one like "joint.k_theta" or "tool.segment[0].length"')
    field = match["field"]
    if field not in FIELDS:
        raise ValueError(f'names no quantity "{field}"{did_you_mean(field, FIELDS)}; expected {one_of(FIELDS)}')
    return FIELDS[field]


def value_at(address: str, value: Any) -> float:
    """Return a quantity given for an address, in SI units."""
    return parse(value, kind_of(address))


def parse_position(text: str) -> float | Literal["end"]:
    """Return a distance from the tip-side end of a part in m, or "end"."""
    if text == "end":
        return "end"
    try:
        return parse(text, units.LENGTH_OR_ZERO)
    except ValueError as error:
        found = str(error).split(", expected", 1)[0]
        raise ValueError(
            f'{found}, expected a distance from the tip-side end of the part such as "0 mm" or "62.3 mm", or "end"'
            if found
            else f"is {shown(text)}"
        ) from None
