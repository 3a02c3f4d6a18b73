"""What kind of quantity stands behind an address, and places on parts."""

from __future__ import annotations

import re
from typing import Any, Literal

from receptance import units
from receptance._text import did_you_mean, one_of, shown
from receptance.units import Quantity, parse

__all__ = ["FIELDS", "SPRING_FIELDS", "kind_of", "parse_position", "value_at"]

_SPRING = {
    "k_y": units.STIFFNESS,
    "k_theta": units.ROTATIONAL_STIFFNESS,
    "k_ytheta": units.COUPLING_STIFFNESS,
    "c_y": units.DAMPING,
    "c_theta": units.ROTATIONAL_DAMPING,
    "c_ytheta": units.COUPLING_DAMPING,
    "loss_factor": units.LOSS_FACTOR,
}
SPRING_FIELDS = tuple(_SPRING)
_SLIP = {
    "slip_y": units.SHARE,
    "slip_theta": units.SHARE,
    "exponent": units.EXPONENT,
    "level": units.LEVEL,
    "reference_y": units.AMPLITUDE,
    "reference_theta": units.ANGLE,
}
_SEGMENT = {"length": units.LENGTH, "outer_diameter": units.LENGTH, "inner_diameter": units.LENGTH_OR_ZERO}
_MATERIAL = {
    "youngs_modulus": units.MODULUS,
    "density": units.DENSITY,
    "poisson_ratio": units.POISSON_RATIO,
    "loss_factor": units.LOSS_FACTOR,
}
_OBSERVATION = {
    "log_gain": units.LOGARITHM,
    "delay": units.DELAY,
    "decay_rate": units.DECAY_RATE,
    "decay_rate_of_velocity": units.DECAY_RATE,
    "decay_rate_of_displacement": units.DECAY_RATE,
    "end": units.TIME,
}
"""What stands between a structure and the record, see `receptance.identification.factors`."""
_MODE = {
    "frequency_hz": units.FREQUENCY_OR_ZERO,
    "damping_ratio": units.DAMPING_RATIO,
    "y": units.MODE_SHAPE,
    "theta": units.MODE_SLOPE,
    "y_imaginary": units.MODE_SHAPE,
    "theta_imaginary": units.MODE_SLOPE,
    "residual_y": units.RECEPTANCE,
    "residual_theta": units.ROTATIONAL_RECEPTANCE,
    "residual_ytheta": units.COUPLING_RECEPTANCE,
}
FIELDS: dict[str, Quantity] = {
    **_SPRING,
    **_SLIP,
    **_SEGMENT,
    **_MATERIAL,
    **_OBSERVATION,
    **_MODE,
    "mass": units.MASS,
    "inertia": units.INERTIA,
}
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
