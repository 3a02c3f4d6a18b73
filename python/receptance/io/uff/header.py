"""Header of data set 58: axes, units of data set 164, and the fields that this library stores in the ID lines.

ID line 4 holds the coordinates, `receptance ["tool",0.0,"y"] ["tool",0.05,"y"]` (response, excitation), ID line 5 the
other values, `receptance {"averages":10,"decay_rate":20.0}`: averages, decay rate, sample rate, first frequency line
and increment with all digits ("lines"), and whether the points are only numbered ("labels":0). The format has no place
for them; other programs show these lines as text.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from receptance.io.build import SI, ReadOptions
from receptance.io.description import coordinate_from_list, coordinate_to_list
from receptance.io.errors import FileFormatError
from receptance.io.uff.datasets import Function
from receptance.model.coordinates import Coordinate
from receptance.units import (
    CHANNEL_UNITS,
    FORM_NAMES,
    ROTATIONS,
    Form,
    FRFKind,
    Unit,
    UnitError,
    channel_kind,
    frf_unit,
    parse_unit,
)

_MARK = "receptance "
WIDTH = 80


def coordinates_line(response: Coordinate, excitation: Coordinate) -> str | None:
    """Return ID line 4, or None if it is too long."""
    line = _MARK + " ".join(json.dumps(coordinate_to_list(c), separators=(",", ":")) for c in (response, excitation))
    return line if len(line) <= WIDTH else None


def values_line(values: Mapping[str, Any]) -> str:
    """Return ID line 5, empty without values; the exact frequency lines are left out if the line is too long."""
    line = _MARK + json.dumps(dict(values), separators=(",", ":"), sort_keys=True) if values else ""
    return line if len(line) <= WIDTH else values_line({k: v for k, v in values.items() if k != "lines"})


def stored_coordinates(texts: Sequence[str]) -> tuple[Coordinate, Coordinate] | None:
    """Return response and excitation from the ID lines; None for lines of other programs and damaged ones."""
    ends = _parse_json(texts[3].replace("] [", "],["), "[{}]") if texts[3].startswith(_MARK) else None
    if not isinstance(ends, list) or len(ends) != 2:
        return None
    try:
        return coordinate_from_list(ends[0]), coordinate_from_list(ends[1])
    except ValueError:
        return None


def stored_values(texts: Sequence[str]) -> dict[str, Any]:
    """Return the values in the ID lines by name; lines of other programs, and damaged values, are ignored.

    Examples
    --------
    >>> from receptance.io.uff.header import stored_values
    >>> stored_values(["hit 3", "", "", "", 'receptance {"averages":10}'])
    {'averages': 10}
    """
    values = _parse_json(texts[4], "{}") if texts[4].startswith(_MARK) else None
    return _valid_values(values) if isinstance(values, dict) else {}


def _parse_json(line: str, form: str) -> Any:
    try:
        return json.loads(form.replace("{}", line.removeprefix(_MARK)))
    except (ValueError, RecursionError):
        return None


def _valid_values(values: dict[str, Any]) -> dict[str, Any]:
    valid: dict[str, Any] = {}
    averages = values.get("averages")
    if isinstance(averages, int) and not isinstance(averages, bool) and averages > 0:
        valid["averages"] = averages
    lines = values.get("lines")
    if isinstance(lines, list) and len(lines) == 2 and all(isinstance(x, float) and 0.0 <= x < math.inf for x in lines):
        valid["lines"] = (lines[0], lines[1])
    if values.get("labels") == 0:
        valid["labels"] = 0
    for name in ("decay_rate", "sample_rate_hz"):
        value = values.get(name)
        if isinstance(value, (int, float)) and not isinstance(value, bool) and 0.0 < value < math.inf:
            valid[name] = float(value)
    return valid


MOTIONS: dict[int, Form] = {8: "receptance", 11: "mobility", 12: "accelerance"}
"""Form of an FRF by the specific data type of its numerator."""
MOTION_CODES = {form: code for code, form in MOTIONS.items()}
LOADS = (9, 13)
"""Specific data types of loads: reaction force and excitation force."""
QUANTITIES = {8: "displacement", 9: "force", 11: "velocity", 12: "acceleration", 13: "force"}
_ABSCISSAE = {17: ("time", "s"), 18: ("frequency", "Hz")}
_UNIT_TOLERANCE = 1e-4
"""Largest relative difference of two statements of the same unit; labels are rounded."""


def expect_abscissa(function: Function, kind: int) -> None:
    """Raise if the abscissa is not time in s (17) or frequency in Hz (18), as expected."""
    axis = function.axes[0]
    quantity, unit = _ABSCISSAE[kind]
    if axis.unit:
        try:
            declared = parse_unit(axis.unit)
        except UnitError as error:
            if axis.kind == kind:
                # Text that is not a unit; the data type is sufficient.
                return
            raise FileFormatError(f"the abscissa's unit: {error}") from None
        if declared != parse_unit(unit):
            raise FileFormatError(f"the abscissa is in {axis.unit!r}, expected {unit}")
    elif axis.kind != kind:
        raise FileFormatError(f"the abscissa's specific data type is {axis.kind}, expected {kind} ({quantity})")


def declared_form(function: Function) -> Form | None:
    """Return the form by specific data type or axis label, or None."""
    numerator, denominator = function.axes[1:]
    if numerator.kind in QUANTITIES and numerator.kind not in MOTIONS:
        raise FileFormatError(f"the numerator of the FRF is a {QUANTITIES[numerator.kind]}, expected a motion per load")
    if denominator.kind in MOTIONS:
        raise FileFormatError(
            f"the denominator of the FRF is a {QUANTITIES[denominator.kind]}, expected a load: transmissibilities and "
            "dynamic stiffnesses are not read"
        )
    if numerator.kind in MOTIONS:
        return MOTIONS[numerator.kind]
    label = numerator.label.lower()
    return next((form for word, form in FORM_NAMES.items() if word in label), None)


def directions(function: Function) -> tuple[str, str] | None:
    """Return the directions "y" or "theta" of response and reference, or None if one is not stated."""
    codes = function.response.direction, function.reference.direction
    if 0 in codes:
        return None
    return ("theta" if abs(codes[0]) > 3 else "y", "theta" if abs(codes[1]) > 3 else "y")


def declared_unit(function: Function, form: Form | None, options: ReadOptions) -> Unit | None:
    """Return the unit by the axis labels or data set 164, which must agree, or None."""
    try:
        label = _label_unit(function)
    except UnitError as error:
        if options.unit is not None and (options.unit != SI or options.quantity is not None):
            return None
        raise FileFormatError(f"the axis label: {error}; give quantity= and unit=") from None
    if function.units is None:
        return label
    form, sides = options.quantity or form, directions(function)
    if form is None or sides is None:
        if label is None and options.unit is None:
            raise FileFormatError(
                "data set 164 gives the units of length and force, but directions or specific data types are "
                "missing; give quantity= and unit="
            )
        return label
    kind = FRFKind(form, *sides)
    length, force = 1.0 / function.units.length, 1.0 / function.units.force
    factor = (length if sides[0] == "y" else 1.0) / (force if sides[1] == "y" else force * length)
    if (
        label is not None
        and options.unit is None
        and not np.isclose(label.factor, factor, rtol=_UNIT_TOLERANCE, atol=0.0)
    ):
        raise FileFormatError(
            f"the file contradicts itself: by its labels the unit is {label.text!r}, by data set 164 "
            f"({function.units.description}) it is {factor:.6g} {frf_unit(kind)}; find out which is correct "
            "and give unit="
        )
    if label is not None:
        return label
    return Unit(f"{frf_unit(kind)} times {factor:.6g}", factor, parse_unit(frf_unit(kind)).dimension)


def _label_unit(function: Function) -> Unit | None:
    numerator, denominator = function.axes[1:]
    if numerator.unit and denominator.unit:
        return parse_unit(f"({numerator.unit})/({denominator.unit})")
    unit = parse_unit(numerator.unit) if numerator.unit else None
    if unit is not None and denominator.kind in LOADS and channel_kind(unit) is not None:
        # The unit of the load is missing.
        return None
    return unit


def channel_unit(function: Function, name: str, given: str | None) -> tuple[str, float, str]:
    """Return the unit of a time series, the factor of its numbers to this unit, and a note or an empty text.

    `given` is the unit in the options, or None.
    """
    axis = function.axes[1]
    quantity = QUANTITIES.get(axis.kind, "")
    if abs(function.response.direction) > 3:
        quantity = ROTATIONS.get(quantity, quantity)
    system = _system_factor(function, quantity)
    if given is not None:
        if given == SI and not quantity:
            raise FileFormatError(
                f"unit is 'SI', but the file does not state the quantity of channel {name!r}; give its unit"
            )
        unit = CHANNEL_UNITS[quantity] if given == SI else given
        stated = axis.unit or (f"{system:.6g} {CHANNEL_UNITS[quantity]}" if system is not None else "")
        return (
            unit,
            1.0,
            f"the unit in the file, {stated!r}, was overridden by {unit!r}" if stated not in ("", unit) else "",
        )
    if axis.unit:
        _check_label_unit(axis.unit, name, quantity, system)
        return axis.unit, 1.0, ""
    if system is not None:
        return CHANNEL_UNITS[quantity], system, ""
    raise FileFormatError(
        f"neither a data set 164 nor an axis label states the unit of channel {name!r}; give it, for example "
        f"unit={{{name!r}: 'N'}} (on the command line --unit '{name}=N')"
    )


def _check_label_unit(text: str, name: str, quantity: str, system: float | None) -> None:
    try:
        unit = parse_unit(text)
    except UnitError:
        # Other units, such as volts and counts, are kept.
        return
    kind = channel_kind(unit)
    if quantity and (kind is None or kind[0] != quantity):
        raise FileFormatError(
            f"the file contradicts itself: channel {name!r} is declared as {quantity}, but its unit is {text!r}; "
            "give unit= for it"
        )
    if system is not None and not np.isclose(unit.factor, system, rtol=_UNIT_TOLERANCE, atol=0.0):
        raise FileFormatError(
            f"the file contradicts itself: by its label channel {name!r} is in {text!r}, by data set 164 in "
            f"{system:.6g} {CHANNEL_UNITS[quantity]}; find out which is correct and give unit= for it"
        )


def _system_factor(function: Function, quantity: str) -> float | None:
    """Return the factor to SI by data set 164, or None."""
    units = function.units
    if units is None or quantity not in CHANNEL_UNITS:
        return None
    if quantity in ("force", "moment"):
        return 1.0 / (units.force * (units.length if quantity == "moment" else 1.0))
    return 1.0 / units.length if quantity in ("displacement", "velocity", "acceleration") else 1.0


def code_of(quantity: str, *, rotation: bool) -> int:
    """Return the specific data type of a quantity at a point of translation or rotation, 0 if there is none."""
    for code, name in QUANTITIES.items():
        if code != LOADS[0] and quantity == (ROTATIONS[name] if rotation else name):
            return code
    return 0
