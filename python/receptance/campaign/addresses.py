"""What kind of quantity stands behind an address, and places on parts."""

from __future__ import annotations

import re
from typing import Any, Literal

from receptance.campaign.quantities import KINDS, Kind, parse, shown
from receptance.campaign.suggestions import did_you_mean, one_of

__all__ = ["FIELDS", "SPRING_FIELDS", "kind_of", "parse_position", "value_at"]

_SPRING = {
    "k_y": "a stiffness",
    "k_theta": "a rotational stiffness",
    "k_ytheta": "a coupling stiffness",
    "c_y": "a damping",
    "c_theta": "a rotational damping",
    "c_ytheta": "a coupling damping",
    "loss_factor": "a loss factor",
}
SPRING_FIELDS = tuple(_SPRING)
_SLIP = {
    "slip_y": "a share",
    "slip_theta": "a share",
    "exponent": "an exponent",
    "level": "a level",
    "reference_y": "an amplitude",
    "reference_theta": "an angle",
}
_SEGMENT = {"length": "a length", "outer_diameter": "a length", "inner_diameter": "a length or zero"}
_MATERIAL = {
    "youngs_modulus": "a modulus",
    "density": "a density",
    "poisson_ratio": "a Poisson's ratio",
    "loss_factor": "a loss factor",
}
_OBSERVATION = {
    "log_gain": "a logarithm",
    "delay": "a time of either sign",
    "decay_rate": "a rate of decay",
    "decay_rate_of_velocity": "a rate of decay",
    "decay_rate_of_displacement": "a rate of decay",
    "end": "a time",
}
"""What stands between a structure and the record, see `receptance.identification.factors`."""
FIELDS: dict[str, Kind] = {
    field: KINDS[name]
    for field, name in (
        {
            **_SPRING,
            **_SLIP,
            **_SEGMENT,
            **_MATERIAL,
            **_OBSERVATION,
            "mass": "a mass",
            "inertia": "a moment of inertia",
        }.items()
    )
}
_MODE = {
    "frequency_hz": "a frequency or zero",
    "damping_ratio": "a damping ratio",
    "y": "a mode shape",
    "theta": "a slope of a mode shape",
    "y_imaginary": "a mode shape",
    "theta_imaginary": "a slope of a mode shape",
    "residual_y": "a receptance",
    "residual_theta": "a rotational receptance",
    "residual_ytheta": "a coupling receptance",
}
FIELDS |= {field: KINDS[name] for field, name in _MODE.items()}
_INSIDE = r"(?:mode\[\d+\]|segment\[(?:\d+|\*)\]|shank|sleeve)\.(?:core\.)?|(?:inner|outer)\."
_ADDRESS = re.compile(rf"(?P<owner>[^\W\d]\w*)\.(?:{_INSIDE})?(?P<field>\w+)")


def kind_of(address: str) -> Kind:
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
        return parse(text, KINDS["a length or zero"])
    except ValueError as error:
        found = str(error).split(", expected", 1)[0]
        raise ValueError(
            f'{found}, expected a distance from the tip-side end of the part such as "0 mm" or "62.3 mm", or "end"'
            if found
            else f"is {shown(text)}"
        ) from None
