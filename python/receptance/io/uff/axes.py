"""Axes of the functions of a universal file: labels, specific data types and the units of data set 164."""

from __future__ import annotations

import numpy as np

from receptance.io.errors import FileFormatError
from receptance.io.options import SI, ReadOptions
from receptance.io.uff.sets import Function
from receptance.units import CHANNEL_UNITS, FORMS, Form, FRFKind, Unit, UnitError, channel_kind, frf_unit, parse_unit

__all__ = [
    "LOADS",
    "MOTIONS",
    "QUANTITIES",
    "channel_unit",
    "code_of",
    "declared_form",
    "declared_unit",
    "directions",
    "expect_abscissa",
]

MOTIONS: dict[int, Form] = {8: "receptance", 11: "mobility", 12: "accelerance"}
"""Specific data types of a numerator, and the form of an FRF with it."""
LOADS = (9, 13)
"""Specific data types of a denominator: reaction force and excitation force."""
QUANTITIES = {8: "displacement", 9: "force", 11: "velocity", 12: "acceleration", 13: "force"}
_ABSCISSAE = {17: ("time", "s"), 18: ("frequency", "Hz")}
_WITH_ROTATION = {
    "force": "moment",
    "displacement": "rotation",
    "velocity": "angular velocity",
    "acceleration": "angular acceleration",
}
_TOLERANCE = 1e-4
"""Of two statements of the same unit: labels round."""


def expect_abscissa(function: Function, kind: int) -> None:
    """Raise where the abscissa is not time in s (17) or frequency in Hz (18)."""
    axis = function.axes[0]
    wanted, unit = _ABSCISSAE[kind]
    if axis.unit:
        try:
            known = parse_unit(axis.unit)
        except UnitError as error:
            if axis.kind == kind:
                # A word for what the data type says already.
                return
            raise FileFormatError(f"the abscissa's unit: {error}") from None
        if (known.dimension, known.factor) != (parse_unit(unit).dimension, 1.0):
            raise FileFormatError(f"the abscissa is in {axis.unit!r}, expected {unit}")
    elif axis.kind != kind:
        raise FileFormatError(f"the abscissa's specific data type is {axis.kind}, expected {kind} ({wanted})")


def declared_form(function: Function) -> Form | None:
    """Return receptance, mobility or accelerance by specific data type or axis label, None where neither says it."""
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
    words = numerator.label.lower()
    named: dict[str, Form] = {"compliance": FORMS[0], "inertance": FORMS[2]} | {form: form for form in FORMS}
    return next((form for word, form in named.items() if word in words), None)


def directions(function: Function) -> tuple[str, str] | None:
    """Return "y" or "theta" (translation or rotation) of response and reference, None where one is not said."""
    codes = function.response.direction, function.reference.direction
    if 0 in codes:
        return None
    return ("theta" if abs(codes[0]) > 3 else "y", "theta" if abs(codes[1]) > 3 else "y")


def declared_unit(function: Function, form: Form | None, options: ReadOptions) -> Unit | None:
    """Return the unit by the axis labels and by data set 164, which must agree; None where the file has neither."""
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
                "data set 164 gives the units of length and force, but not every direction and specific data type says "
                "what was measured; give quantity= and unit="
            )
        return label
    kind = FRFKind(form, *sides)
    length, force = 1.0 / function.units.length, 1.0 / function.units.force
    factor = (length if sides[0] == "y" else 1.0) / (force if sides[1] == "y" else force * length)
    if label is not None and options.unit is None and not np.isclose(label.factor, factor, rtol=_TOLERANCE, atol=0.0):
        raise FileFormatError(
            f"the file contradicts itself: by its labels the unit is {label.text!r}, by data set 164 "
            f"({function.units.description}) it is {factor:.6g} {frf_unit(kind)}; find out which is true and give unit="
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
        # Half a unit: that of the load is not said.
        return None
    return unit


def channel_unit(function: Function, name: str, options: ReadOptions) -> tuple[str, float, str]:
    """Return the unit of a time record, what its numbers must be multiplied with to be in it, and a note or nothing."""
    axis = function.axes[1]
    quantity = QUANTITIES.get(axis.kind, "")
    if abs(function.response.direction) > 3:
        quantity = _WITH_ROTATION.get(quantity, quantity)
    system = _system_factor(function, quantity)
    given = options.channel_unit(name)
    if given is not None:
        if given == SI and not quantity:
            raise FileFormatError(
                f"unit is 'SI', but the file does not say what channel {name!r} measured; give its unit"
            )
        unit = CHANNEL_UNITS[quantity] if given == SI else given
        said = axis.unit or (f"{system:.6g} {CHANNEL_UNITS[quantity]}" if system is not None else "")
        return unit, 1.0, f"the unit in the file, {said!r}, was overruled by {unit!r}" if said not in ("", unit) else ""
    if axis.unit:
        _check_label(axis.unit, name, quantity, system)
        return axis.unit, 1.0, ""
    if system is not None:
        return CHANNEL_UNITS[quantity], system, ""
    raise FileFormatError(
        f"neither a data set 164 nor an axis label says in which unit channel {name!r} is; give it: "
        f"unit={{{name!r}: 'N'}}, say (on the command line --unit '{name}=N')"
    )


def _check_label(text: str, name: str, quantity: str, system: float | None) -> None:
    try:
        unit = parse_unit(text)
    except UnitError:
        # Kept as it is: volts and counts are no motion and no load.
        return
    said = channel_kind(unit)
    if quantity and (said is None or said[0] != quantity):
        raise FileFormatError(
            f"the file contradicts itself: channel {name!r} is said to be a {quantity}, but its unit is {text!r}; "
            "give unit= for it"
        )
    if system is not None and not np.isclose(unit.factor, system, rtol=_TOLERANCE, atol=0.0):
        raise FileFormatError(
            f"the file contradicts itself: by its label channel {name!r} is in {text!r}, by data set 164 in "
            f"{system:.6g} {CHANNEL_UNITS[quantity]}; find out which is true and give unit= for it"
        )


def _system_factor(function: Function, quantity: str) -> float | None:
    """Return what to multiply with to be in SI by data set 164."""
    units = function.units
    if units is None or quantity not in CHANNEL_UNITS:
        return None
    if quantity in ("force", "moment"):
        return 1.0 / (units.force * (units.length if quantity == "moment" else 1.0))
    return 1.0 / units.length if quantity in ("displacement", "velocity", "acceleration") else 1.0


def code_of(quantity: str, *, rotation: bool) -> int:
    """Return the specific data type of a time record's quantity at a point of this kind, 0 where there is none."""
    for code, name in QUANTITIES.items():
        if code != LOADS[0] and quantity == (_WITH_ROTATION[name] if rotation else name):
            return code
    return 0
