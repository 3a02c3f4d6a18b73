"""Quantities as people write them: text with a number and a unit, turned into SI."""

from __future__ import annotations

import functools
import math
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

from receptance.campaign.suggestions import did_you_mean
from receptance.io.units import can_be_unit

if TYPE_CHECKING:
    from pint import UnitRegistry
    from pydantic import GetCoreSchemaHandler

__all__ = ["KINDS", "Amount", "Kind", "OneOf", "parse", "parse_any"]

_TEXT = re.compile(r"\s*(?P<number>[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(?P<unit>.*?)\s*", re.DOTALL)
_DECIMAL_COMMA = re.compile(r"\s*[-+]?\d+,\d+")
_POWER = re.compile(r"\b((?:[mcdkµu]?m)|s)([234])\b")
_NEWTON_METRE = re.compile(r"\b([kmMµu]?N)([mc]?m)\b")
_LONGEST = 200
"""Characters of a quantity."""
_ANGLES = {"radian", "degree", "turn", "revolution", "revolutions_per_minute", "revolutions_per_second", "cycle"}
_LEVELS = ("bel", "neper", "octave")
NUMBER = r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?"


@dataclass(frozen=True)
class Kind:
    """A physical quantity: its name, its SI unit, an example, and the least value that makes sense.

    Parameters
    ----------
    name : str
        As it is called in messages.
    unit : str
        SI unit, as pint reads it; empty for a plain number.
    example : str
        What a person might write.
    least : {"above zero", "zero or more", "any"}
        What values are allowed.
    most : float, optional
        Largest value in SI units.
    """

    name: str
    unit: str
    example: str
    least: str = "above zero"
    most: float = math.inf

    @property
    def expected(self) -> str:
        """What was expected, in words."""
        if not self.unit:
            return f"a number such as {self.example}"
        return f'{self.name} as text with a unit, such as "{self.example}"'


KINDS = {
    kind.name: kind
    for kind in (
        Kind("a length", "m", "62.3 mm"),
        Kind("a length or zero", "m", "20 mm", "zero or more"),
        Kind("a modulus", "Pa", "580 GPa"),
        Kind("a density", "kg/m^3", "14500 kg/m^3"),
        Kind("a mass", "kg", "0.6 g", "zero or more"),
        Kind("a moment of inertia", "kg m^2", "2e-7 kg m^2", "zero or more"),
        Kind("a stiffness", "N/m", "3.5e8 N/m", "zero or more"),
        Kind("a rotational stiffness", "N m/rad", "4e4 N m/rad", "zero or more"),
        Kind("a coupling stiffness", "N/rad", "1e5 N/rad", "any"),
        Kind("a damping", "N s/m", "120 N s/m", "zero or more"),
        Kind("a rotational damping", "N m s/rad", "0.03 N m s/rad", "zero or more"),
        Kind("a coupling damping", "N s/rad", "0.5 N s/rad", "any"),
        Kind("a frequency", "Hz", "2.5 kHz"),
        Kind("a frequency or zero", "Hz", "650 Hz", "zero or more"),
        Kind("a damping ratio", "", "0.03", "zero or more"),
        Kind("a mode shape", "1/kg**0.5", "0.25 1/kg**0.5", "any"),
        Kind("a slope of a mode shape", "rad/(m*kg**0.5)", "1.1 rad/(m*kg**0.5)", "any"),
        Kind("a receptance", "m/N", "2e-9 m/N", "any"),
        Kind("a rotational receptance", "rad/(N m)", "2e-7 rad/(N m)", "any"),
        Kind("a coupling receptance", "m/(N m)", "1e-8 m/(N m)", "any"),
        Kind("a frequency or zero", "Hz", "500 Hz", "zero or more"),
        Kind("a rate of decay", "1/s", "20 1/s", "zero or more"),
        Kind("a time of either sign", "s", "5e-6 s", "any"),
        Kind("a logarithm", "", "0.03", "any"),
        Kind("a force", "N", "20 N"),
        Kind("a time", "s", "2 ms"),
        Kind("a time or zero", "s", "2 ms", "zero or more"),
        Kind("a loss factor", "", "0.002", "zero or more"),
        Kind("a share", "", "0.1", "zero or more"),
        Kind("a share above zero", "", "0.05", "above zero", 1.0),
        Kind("an exponent", "", "1.0", "above zero", 4.0),
        Kind("a level", "", "2.0", "zero or more"),
        Kind("an amplitude", "m", "1 um", "zero or more"),
        Kind("an angle", "rad", "1e-5 rad", "zero or more"),
        Kind("a Poisson's ratio", "", "0.22", "any", 0.5),
        Kind("a cutting coefficient", "N/m^2", "800 MPa"),
        Kind("a cutting coefficient or zero", "N/m^2", "300 MPa", "zero or more"),
        Kind("an immersion", "", "0.5", "above zero", 1.0),
        Kind("a spindle speed", "rpm", "12000 rpm"),
        Kind("a direction", "deg", "30 deg", "any"),
    )
}


@functools.cache
def _units() -> UnitRegistry[Any]:
    from pint import UnitRegistry  # takes a good part of a second

    return UnitRegistry()


def parse(text: Any, kind: Kind) -> float:
    """Return a quantity in SI units.

    Parameters
    ----------
    text : str
        A number and a unit; a plain number where the quantity has no unit.
    kind : Kind
        What is expected.

    Raises
    ------
    ValueError
        Not text, no unit, an unknown unit, another quantity, or a value out of range; the message says what was
        found and what was expected.

    Examples
    --------
    >>> from receptance.campaign.quantities import KINDS, parse
    >>> parse("580 GPa", KINDS["a modulus"])
    580000000000.0
    >>> parse("62.3 N", KINDS["a length"])
    Traceback (most recent call last):
    ValueError: is "62.3 N", a force, expected a length as text with a unit, such as "62.3 mm"
    """
    if not kind.unit:
        if isinstance(text, bool) or not isinstance(text, (int, float)):
            raise ValueError(f"is {shown(text)}, expected {kind.expected}")
        try:
            value = float(text)
        except OverflowError:
            raise ValueError(f"is a number of more than 300 digits, expected {kind.expected}") from None
        return _in_range(text, value, kind)
    number, unit = split(text, kind.expected)
    if not unit:
        raise ValueError(f"is {shown(text)}, without a unit, expected {kind.expected}")
    return _in_range(text, number * _factor(text, unit, kind), kind)


def parse_any(text: str) -> tuple[float, str]:
    """Return the SI value and the SI unit of a quantity of any kind; no unit means a plain number."""
    expected = 'a number, or text with a number and a unit such as "135 N m"'
    number, unit = split(text, expected)
    if not unit:
        return number, ""
    found = _unit(text, unit, expected)
    if _is_angular(found) or _has_offset(found):
        raise ValueError(f'is {shown(text)}, expected a unit without angle over time or offset, such as "Hz" or "K"')
    base = (1.0 * found).to_base_units()
    return number * float(base.magnitude), f"{base.units:~C}".replace("**", "^").replace("*", " ")


def split(text: Any, expected: str) -> tuple[float, str]:
    """Return the number and the unit of a text."""
    if not isinstance(text, str):
        raise ValueError(f"is {shown(text)}, expected {expected}")
    if len(text) > _LONGEST:
        raise ValueError(f"is {shown(text)}, a text of {len(text)} characters, expected {expected}")
    match = _TEXT.fullmatch(text)
    if _DECIMAL_COMMA.match(text):
        raise ValueError(f"is {shown(text)}, expected {expected}; decimals are written with a point")
    if match is None:
        raise ValueError(f"is {shown(text)}, expected {expected}")
    number = float(match["number"])
    if not math.isfinite(number):
        raise ValueError(f"is {shown(text)}, too large a number, expected {expected}")
    return number, match["unit"]


def shown(value: Any) -> str:
    """Return a value as it stands in the file, as far as that is short."""
    if isinstance(value, str):
        return f'"{value if len(value) <= 60 else value[:57] + "..."}"'
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, dict):
        return "a table"
    if isinstance(value, list):
        return f"a list of {len(value)}"
    return f"{value:g}" if isinstance(value, float) else str(value)


_FACTORS: dict[tuple[str, str], float] = {}
"""Of units that were converted before: a table has the same ones in every row."""


def _factor(text: str, unit: str, kind: Kind) -> float:
    if (unit, kind.unit) not in _FACTORS:
        _FACTORS[unit, kind.unit] = _new_factor(text, unit, kind)
    return _FACTORS[unit, kind.unit]


def _new_factor(text: str, unit: str, kind: Kind) -> float:
    found = _unit(text, unit, kind.expected)
    wanted = _units().parse_units(kind.unit)
    if found.dimensionality != wanted.dimensionality:
        raise ValueError(f"is {shown(text)}, {_name_of(found)}, expected {kind.expected}")
    parts = {str(part).removesuffix("s") for part in found._units}
    if kind.unit == "Hz" and not (len(parts) == 1 and next(iter(parts)).endswith("hertz")):
        # To pint a radian is a plain number, so rad/s and rpm would pass for hertz and be wrong by 2 pi.
        raise ValueError(f"is {shown(text)}, expected {kind.expected}; write it in Hz or kHz")
    if kind.unit == "rpm" and parts != {"revolutions_per_minute"}:
        raise ValueError(f"is {shown(text)}, expected {kind.expected}; write it in rpm")
    if kind.unit == "1/s" and (parts & _ANGLES or any(part.endswith(("hertz", "becquerel")) for part in parts)):
        raise ValueError(f"is {shown(text)}, expected {kind.expected}; a rate of decay is in 1/s, not in Hz")
    return float((1.0 * found).to(wanted).magnitude)


def _unit(text: str, unit: str, expected: str) -> Any:
    written = _NEWTON_METRE.sub(r"\1 \2", _POWER.sub(r"\1^\2", unit))
    try:
        if not can_be_unit(written):
            raise ValueError("not one power of each unit")
        found = _units().parse_units(written)
        if any(level in str(part) for part in found._units for level in _LEVELS):
            raise ValueError("a level has no factor to SI")
        return found
    except Exception as error:
        # What pint raises for odd text is not one family of exceptions.
        name = getattr(error, "unit_names", None)
        word = name[0] if isinstance(name, (tuple, list)) and name else (name if isinstance(name, str) else unit)
        raise ValueError(
            f"is {shown(text)}, with the unknown unit {shown(word)}{did_you_mean(word, _COMMON)}, expected {expected}"
        ) from None


_COMMON = ("mm", "cm", "m", "µm", "um", "GPa", "MPa", "Pa", "kg", "g", "N", "kN", "Hz", "kHz", "rad", "deg", "s", "ms")


def _is_angular(unit: Any) -> bool:
    parts = {str(part) for part in unit._units}
    return bool(parts & _ANGLES) and "[time]" in unit.dimensionality and not parts & {"newton", "meter"}


def _has_offset(unit: Any) -> bool:
    return any("degree_" in str(part) or "delta_" in str(part) for part in unit._units)


def _name_of(unit: Any) -> str:
    if unit.dimensionless:
        return "without a dimension"
    plain = (("a force", "N"), ("a moment", "N m"), ("an area", "m^2"), ("a velocity", "m/s"))
    for name, example in (*plain, *((kind.name.removesuffix(" or zero"), kind.unit) for kind in KINDS.values())):
        if example and unit.dimensionality == _units().parse_units(example).dimensionality:
            return name
    return f"a quantity in {unit:~C}"


def _in_range(text: Any, value: float, kind: Kind) -> float:
    if not math.isfinite(value):
        raise ValueError(f"is {shown(text)}, expected a finite value: {kind.expected}")
    if kind.least == "above zero" and value <= 0.0:
        raise ValueError(f"is {shown(text)}, expected more than zero: {kind.expected}")
    if kind.least == "zero or more" and value < 0.0:
        raise ValueError(f"is {shown(text)}, expected zero or more: {kind.expected}")
    if value > kind.most:
        raise ValueError(f"is {shown(text)}, expected at most {kind.most:g} {kind.unit}".rstrip())
    return value


@dataclass(frozen=True)
class Amount:
    """Marks a field of a pydantic model as a quantity; in Python the field is a float in SI units."""

    kind: Kind

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> Any:
        """Replace pydantic's own reading of a float by `parse`; that the unit fits is more than a schema can say."""
        from pydantic import PlainValidator, WithJsonSchema

        del source
        reading = PlainValidator(lambda value: parse(value, self.kind))
        return handler.generate_schema(Annotated[Any, reading, WithJsonSchema(json_schema(self.kind))])


def json_schema(kind: Kind) -> dict[str, Any]:
    """Return what a JSON Schema can say of a quantity."""
    if not kind.unit:
        bound = {"above zero": {"exclusiveMinimum": 0}, "zero or more": {"minimum": 0}, "any": {}}[kind.least]
        return {"type": "number", "examples": [float(kind.example)], **bound}
    return {"type": "string", "pattern": rf"^\s*{NUMBER}(\s+\S|[^\s\d]).*$", "examples": [kind.example]}


@dataclass(frozen=True)
class OneOf:
    """Marks a field whose value may be of several types; pydantic's own answer would name each of them in turn."""

    types: tuple[type, ...]
    what: str

    def __init__(self, *types: type, what: str) -> None:
        object.__setattr__(self, "types", types)
        object.__setattr__(self, "what", what)

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> Any:
        """Check the type before pydantic does, in words."""
        from pydantic import BeforeValidator

        return handler.generate_schema(Annotated[source, BeforeValidator(self._check)])

    def _check(self, value: Any) -> Any:
        if isinstance(value, bool) or not isinstance(value, self.types):
            raise ValueError(f"is {shown(value)}, expected {self.what}")
        return value
