"""Units of measured data as texts, what they say about the quantity, and the way to SI."""

from __future__ import annotations

import functools
import re
from dataclasses import dataclass
from typing import Any

from receptance.frf.forms import FORMS, Form

__all__ = [
    "CHANNEL_UNITS",
    "FORMS",
    "Dimension",
    "FRFKind",
    "Unit",
    "UnitError",
    "can_be_unit",
    "channel_kind",
    "form_name",
    "frf_kind",
    "frf_unit",
    "parse_unit",
]

_SYNONYMS = {"compliance": "receptance", "inertance": "accelerance"}

# A registry of its own: the angle is a dimension, so that rad/N and m/(N m) are told apart, g is what it means in a
# vibration laboratory, and nothing exotic is understood by accident.
_DEFINITIONS = """
nano- = 1e-9 = n-
micro- = 1e-6 = u- = µ- = μ-
milli- = 1e-3 = m-
centi- = 1e-2 = c-
deci- = 1e-1 = d-
kilo- = 1e3 = k-
mega- = 1e6 = M-
metre = [length] = m = meter
second = [time] = s = sec = seconds = Seconds
newton = [force] = N
radian = [angle] = rad
volt = [voltage] = V
minute = 60 * second = min
hertz = 1 / second = Hz = Hertz
degree = 0.017453292519943295 * radian = deg
inch = 0.0254 * metre = in
foot = 0.3048 * metre = ft
mil = 0.0000254 * metre
pound_force = 4.4482216152605 * newton = lbf
poundal = 0.138254954376 * newton = pdl
kilogram_force = 9.80665 * newton = kgf = kp
dyne = 1e-5 * newton = dyn
standard_gravity = 9.80665 * metre / second ** 2 = g = gn = G
kilogram = newton * second ** 2 / metre = kg
pascal = newton / metre ** 2 = Pa
percent = 0.01
"""

_LOADS = {(("force", 1),): "y", (("force", 1), ("length", 1)): "theta"}
_CHANNELS = {
    ("length", 0): ("displacement", "m"),
    ("length", 1): ("velocity", "m/s"),
    ("length", 2): ("acceleration", "m/s^2"),
    ("angle", 0): ("rotation", "rad"),
    ("angle", 1): ("angular velocity", "rad/s"),
    ("angle", 2): ("angular acceleration", "rad/s^2"),
}

CHANNEL_UNITS = {"force": "N", "moment": "N m"} | dict(_CHANNELS.values())
"""Quantities of time records and their SI units."""

_LONGEST = 80
_ALLOWED = re.compile(r"[A-Za-zµμ_0-9.*/() ]+")
_EXPONENT = r"[+-]?\d(?:\.5)?"
_POWER = re.compile(rf"(?<=[A-Za-zµμ)])\s*(?:\^|\*\*)\s*(?:{_EXPONENT}|\(\s*{_EXPONENT}\s*\))(?![\d.]|\s*(?:\^|\*\*))")

Dimension = tuple[tuple[str, int], ...]
"""Powers of length, time, force, angle and voltage, sorted by name; without those that are zero."""


class UnitError(ValueError):
    """A text that is not a unit which this library understands."""


@dataclass(frozen=True)
class Unit:
    """A unit: what to multiply numbers with to be in SI, and its dimension."""

    text: str
    factor: float
    dimension: Dimension


@dataclass(frozen=True)
class FRFKind:
    """What the dimension of an FRF's unit says."""

    form: Form
    response: str
    """`"y"` or `"theta"`: translation or rotation per load."""
    excitation: str
    """`"y"` or `"theta"`: per force or per moment."""


def form_name(quantity: str) -> Form:
    """Return receptance, mobility or accelerance for one of their names, or raise a ValueError.

    Examples
    --------
    >>> from receptance.io.units import form_name
    >>> form_name("Inertance")
    'accelerance'
    """
    if not isinstance(quantity, str):
        raise TypeError(f"quantity is {quantity!r}, expected one of {', '.join(FORMS)}")
    name = quantity.strip().lower()
    for form in FORMS:
        if _SYNONYMS.get(name, name) == form:
            return form
    raise ValueError(f"quantity is {quantity!r}, expected one of {', '.join(FORMS)}")


@functools.cache
def _registry() -> Any:
    import pint

    registry: Any = pint.UnitRegistry(None)
    registry.load_definitions(_DEFINITIONS.strip().splitlines())
    return registry


@functools.lru_cache(maxsize=256)
def parse_unit(text: str) -> Unit:
    """Return the unit that a text names, as analysers spell it: `m/s^2/N`, `(m/s²)/N`, `g/lbf`, `um/N`, `rad/(N m)`.

    Raises
    ------
    UnitError
        A text that is not understood.

    Examples
    --------
    >>> from receptance.io.units import parse_unit
    >>> parse_unit("g/N").factor
    9.80665
    """
    if not isinstance(text, str):
        raise TypeError(f"the unit is {text!r}, expected a text such as 'm/s^2/N'")
    plain = _plain(text)
    if "db" in plain.lower():
        raise UnitError(
            f"the unit {text!r} is a level in dB; export linear values, a level does not say what it refers to"
        )
    named = plain == "1" or re.search(r"[A-Za-zµμ]", plain)
    if not named or not can_be_unit(plain) or not _ALLOWED.fullmatch(_POWER.sub("", plain)):
        raise UnitError(_not_understood(text))
    try:
        base = (_registry().Quantity(1.0, "") * _registry().parse_expression(plain)).to_base_units()
        factor = float(base.magnitude)
        powers = {name.strip("[]"): float(power) for name, power in dict(base.dimensionality).items()}
    except Exception as error:
        # pint raises whatever its parts raise: syntax errors, undefined units, arithmetic.
        unknown = getattr(error, "unit_names", None)
        what = unknown if isinstance(unknown, str) else ", ".join(map(str, unknown or ()))
        raise UnitError(_not_understood(text) + (f" (what is {what!r}?)" if what else "")) from None
    if not 0.0 < factor < float("inf") or any(power != round(power) for power in powers.values()):
        raise UnitError(_not_understood(text))
    return Unit(text, factor, tuple(sorted((name, int(power)) for name, power in powers.items() if power)))


def can_be_unit(text: str) -> bool:
    """Return whether a text may be given to pint as a unit.

    pint computes what stands in a text as well, and a power of a power such as `m^9^9^9` takes for ever.

    Examples
    --------
    >>> from receptance.io.units import can_be_unit
    >>> can_be_unit("kg*m^2"), can_be_unit("1/kg**0.5"), can_be_unit("m^9^9^9")
    (True, True, False)
    """
    return len(text) <= _LONGEST and not re.search(r"\^|\*\*|//", _POWER.sub("", text))


def _not_understood(text: str) -> str:
    return f"{text!r} is not understood as a unit, expected something like 'm/s^2/N' or 'g'"


def _plain(text: str) -> str:
    """Return the text as pint spells it."""
    plain = text.strip()
    for sign, power in (("⁻", "-"), ("¹", "1"), ("²", "2"), ("³", "3"), ("⁴", "4")):
        plain = plain.replace(sign, power)
    plain = plain.replace("·", "*").replace("×", "*").replace("⋅", "*").replace("°", "deg").replace("%", "percent")
    plain = re.sub(r"\bNm\b", "N m", plain)
    plain = re.sub(r"\bsec\b", "s", plain, flags=re.IGNORECASE)
    # s2 and s-2 are s^2 and s^-2.
    return re.sub(r"\b([A-Za-zµμ]+)(-?\d)\b", r"\1^\2", plain)


def frf_kind(unit: Unit) -> FRFKind | None:
    """Return what FRF has this unit, or None.

    Examples
    --------
    >>> from receptance.io.units import frf_kind, parse_unit
    >>> frf_kind(parse_unit("(m/s²)/N"))
    FRFKind(form='accelerance', response='y', excitation='y')
    """
    return _frf_kinds().get(unit.dimension)


@functools.cache
def _frf_kinds() -> dict[Dimension, FRFKind]:
    kinds = {}
    for motion, direction in (("length", "y"), ("angle", "theta")):
        for order, form in enumerate(FORMS):
            for load, about in _LOADS.items():
                powers = {motion: 1, "time": -order}
                for name, power in load:
                    powers[name] = powers.get(name, 0) - power
                kinds[tuple(sorted((n, p) for n, p in powers.items() if p))] = FRFKind(form, direction, about)
    return kinds


def frf_unit(kind: FRFKind) -> str:
    """Return the SI unit of an FRF.

    Examples
    --------
    >>> from receptance.io.units import FRFKind, frf_unit
    >>> frf_unit(FRFKind("mobility", "theta", "theta"))
    'rad/s/(N m)'
    """
    motion = "m" if kind.response == "y" else "rad"
    rate = ("", "/s", "/s^2")[FORMS.index(kind.form)]
    return f"{motion}{rate}/{'N' if kind.excitation == 'y' else '(N m)'}"


def channel_kind(unit: Unit) -> tuple[str, str] | None:
    """Return the quantity and the SI unit of a time record with this unit, or None.

    Examples
    --------
    >>> from receptance.io.units import channel_kind, parse_unit
    >>> channel_kind(parse_unit("g"))
    ('acceleration', 'm/s^2')
    """
    load = _LOADS.get(unit.dimension)
    if load is not None:
        return ("force", "N") if load == "y" else ("moment", "N m")
    powers = dict(unit.dimension)
    order = -powers.pop("time", 0)
    if len(powers) == 1:
        ((name, power),) = powers.items()
        if power == 1:
            return _CHANNELS.get((name, order))
    return None
