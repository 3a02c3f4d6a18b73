"""Values of the keys of a campaign file: quantities, deviations, levels, priors, addresses, names and files.

Markers of fields read or check a value while its table is validated, so that the mistakes of a table are reported
together.
"""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BeforeValidator,
    GetPydanticSchema,
    PlainSerializer,
    PlainValidator,
    ValidationInfo,
    WithJsonSchema,
)
from pydantic_core import core_schema

from receptance import units
from receptance._text import did_you_mean, instead_of, one_of, shown
from receptance.identification.mapping import FACTORS
from receptance.identification.unknowns import PARAMETERS, Prior
from receptance.units import FORCE, NUMBER, Quantity, parse, parse_any, split

if TYPE_CHECKING:
    from receptance.campaign.schema import PriorTable


def _read_by(validator: core_schema.CoreSchema, schema: Callable[[], dict[str, Any]]) -> GetPydanticSchema:
    """Return the marker of a field that a validator reads, whatever the type of the value that it returns."""
    return GetPydanticSchema(lambda *_: validator, lambda *_: schema())


def amount(quantity: Quantity) -> GetPydanticSchema:
    """Return the marker of a quantity, a float in SI units; the JSON schema does not check the unit."""
    reading = core_schema.no_info_plain_validator_function(lambda value: parse(value, quantity))
    return _read_by(reading, lambda: json_schema(quantity))


def json_schema(quantity: Quantity) -> dict[str, Any]:
    """Return the JSON Schema of a quantity."""
    if quantity.unit:
        return {"type": "string", "pattern": rf"^\s*{NUMBER}(\s+\S|[^\s\d]).*$", "examples": [quantity.example]}
    bounds = {"exclusiveMinimum": quantity.above, "minimum": quantity.least, "maximum": quantity.most}
    finite = {key: bound for key, bound in bounds.items() if abs(bound) != float("inf")}
    return {"type": "number", "examples": [float(quantity.example)], **finite}


def of_types(*types: type, what: str) -> BeforeValidator:
    """Return the marker of a value of several types, for one message instead of one of pydantic for each type."""

    def check(value: Any) -> Any:
        if isinstance(value, bool) or not isinstance(value, types):
            raise ValueError(f"is {shown(value)}, expected {what}")
        return value

    return BeforeValidator(check)


_LARGEST_PERCENTAGE = 1000.0

# Standard deviations -------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Deviation:
    """A standard deviation.

    Attributes
    ----------
    amount : float
        Value in SI units, or relative to the value of the parameter.
    relative : bool
        Whether it is relative.
    name : str
        Name of the error; deviations with the same name are one error. Empty for an independent error.
    """

    amount: float
    relative: bool
    name: str = ""

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


DeviationShare = Annotated[float, PlainValidator(parse_deviation_share), WithJsonSchema({"type": "string"})]
"""A standard deviation of an FRF, relative to its magnitude."""
Share = Annotated[
    float,
    PlainValidator(lambda text: parse_share(text, 'a percentage such as "5 %"')),
    PlainSerializer(lambda share: f"{100.0 * share:g} %"),
    WithJsonSchema({"type": "string"}),
]
"""A percentage."""


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
    written = f'"{_small(quantity)}"' if quantity.unit else _small(quantity)
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
    try:
        return Deviation(parse(value, _deviation_of(quantity)), False, name)
    except ValueError as error:
        raise ValueError(f"{_found(error)}, expected {expected}") from None


def _deviation_of(quantity: Quantity) -> Quantity:
    return Quantity(quantity.name, quantity.unit, _small(quantity), least=0.0, written=(0.0, quantity.written[1]))


def _small(quantity: Quantity) -> str:
    """Return an example of a standard deviation of a quantity."""
    unit = quantity.example.partition(" ")[2]
    return f"0.1 {unit}" if unit else "0.01"


def spread(quantity: Quantity) -> GetPydanticSchema:
    """Return the marker of a standard deviation, a `Deviation`."""
    reading = core_schema.no_info_plain_validator_function(lambda value: parse_deviation(value, quantity))
    return _read_by(reading, lambda: _deviation_schema(quantity))


def _deviation_schema(quantity: Quantity) -> dict[str, Any]:
    example = _small(quantity)
    share = {"type": "string", "pattern": rf"^\s*{NUMBER}\s*(%|percent)\s*$", "examples": ["2 %"]}
    spellings = [json_schema(_deviation_of(quantity)), share]
    named = {
        "type": "object",
        "properties": {"value": {"anyOf": spellings}, "name": {"type": "string", "minLength": 1}},
        "required": ["value", "name"],
        "additionalProperties": False,
    }
    return {"anyOf": [*spellings, named], "examples": [example if quantity.unit else float(example), "2 %"]}


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


def _parse_force_window(written: Any) -> float | Literal["auto", "none"]:
    """Return the length of the force window in s, "auto" or "none"."""
    if written in ("auto", "none"):
        return "auto" if written == "auto" else "none"
    try:
        return parse(written, units.TIME)
    except ValueError as error:
        raise ValueError(f'{_found(error)}, expected a time such as "2 ms", "auto" or "none"') from None


def _found(error: ValueError) -> str:
    """Return what was found, without what was expected."""
    return str(error).split(", expected", 1)[0]


ForceWindow = Annotated[
    float | Literal["auto", "none"], PlainValidator(_parse_force_window), WithJsonSchema({"type": "string"})
]
"""Length of a force window in s, "auto" or "none"."""

# Priors --------------------------------------------------------------------------------------------------------------


def prior_of(kind: Quantity, table: PriorTable, logarithmic: bool) -> Prior:
    """Return the prior of an unknown on the scale of the fit."""
    mean = parse(table.value, kind)
    return Prior(mean=mean, standard_deviation=_prior_deviation(kind, table.spread, mean, logarithmic))


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


class AddressError(ValueError):
    """A text, `address`, is not the address of a parameter."""

    def __init__(self, address: str, text: str) -> None:
        super().__init__(text)
        self.address = address


def kind_of(address: str) -> Quantity:
    """Return the quantity of the parameter at an address.

    Raises
    ------
    AddressError
        The text is not an address, or names an unknown parameter.

    Examples
    --------
    >>> from receptance.campaign.values import kind_of
    >>> kind_of("tool.segment[0].length").unit
    'm'
    """
    match = _ADDRESS.fullmatch(address)
    if match is None:
        text = 'is not an address, expected one such as "joint.k_theta" or "tool.segment[0].length"'
        raise AddressError(address, text)
    field = match["field"]
    if field not in PARAMETERS:
        near = did_you_mean(field, PARAMETERS)
        raise AddressError(address, f'names an unknown quantity "{field}"{near}; expected {one_of(PARAMETERS)}')
    return PARAMETERS[field]


def value_at(address: str, value: Any) -> float:
    """Return the value of the parameter at an address in SI units."""
    return parse(value, kind_of(address))


def parse_position(written: Any) -> float | Literal["end"]:
    """Return a position on a part: the distance from its tip-side end in m, or "end"."""
    if written == "end":
        return "end"
    try:
        return parse(written, units.LENGTH_OR_ZERO)
    except ValueError as error:
        expected = 'a distance from the tip-side end of the part such as "0 mm" or "62.3 mm", or "end"'
        raise ValueError(f"{_found(error)}, expected {expected}") from None


# References ----------------------------------------------------------------------------------------------------------

OWNERS = ("parts", "modal_parts", "joints", "attachments", "sensors")
"""Sections whose names begin addresses."""
_SINGULAR = {
    "assemblies": "an assembly",
    "attachments": "an attachment",
    "materials": "a material",
    "parts": "a part",
    "modal_parts": "a modal part",
}


class BrokenReferenceError(ValueError):
    """A reference to a name or a file that does not exist; the table is valid otherwise."""


@dataclass(frozen=True)
class References:
    """Names and files to which tables may refer; the context of the validation.

    `named` are all names of each section, those of tables with mistakes included. References to `broken` sections,
    which are missing or are no tables, are not checked; nor are data files without a `folder`.
    """

    named: dict[str, list[str]]
    broken: frozenset[str]
    folder: Path | None

    def check_name(self, name: str, sections: tuple[str, ...]) -> None:
        """Raise a `BrokenReferenceError` if no section has the name."""
        known = [other for section in sections for other in self.named[section]]
        if name in known or not self.broken.isdisjoint(sections):
            return
        # Messages mention modal parts only if the file has some.
        mentioned = [section for section in sections if section != "modal_parts" or self.named[section]]
        what = " or ".join(_SINGULAR.get(section, f"a {section.removesuffix('s')}") for section in mentioned)
        raise BrokenReferenceError(f'is "{name}", which is not {what} of this file{instead_of(name, known)}')

    def check_machine(self, name: str) -> None:
        """Raise a `BrokenReferenceError` if the machine of a catalogue cannot contain an element of this name."""
        if name in self.named["modal_parts"]:
            raise BrokenReferenceError(
                f'is "{name}", a modal part, which `machine` cannot contain; expected parts and joints, or the spindle '
                'in a file of its own, named by `spindle = "FILE"`'
            )
        self.check_name(name, ("parts", "joints"))

    def check_address(self, address: str) -> None:
        """Raise an `AddressError` if a text is not an address, or its owner is unknown."""
        kind_of(address)
        owner = address.split(".", 1)[0]
        known = [name for section in OWNERS for name in self.named[section]]
        if owner not in known and address not in FACTORS and self.broken.isdisjoint(OWNERS):
            text = f'begins with "{owner}", which is not a part, joint, attachment or sensor of this file'
            raise AddressError(address, text + instead_of(owner, known))

    def check_file(self, name: str) -> None:
        """Raise a `BrokenReferenceError` if a data file does not exist."""
        if self.folder is None or (file := self.folder / name).is_file():
            return
        what = "is a folder" if file.is_dir() else "does not exist"
        near = [other.name for other in sorted(file.parent.iterdir())] if file.parent.is_dir() else []
        text = f'is "{name}", which {what}, expected a data file in {self.folder.resolve()}'
        raise BrokenReferenceError(text + did_you_mean(file.name, near))


def _checked(check: Callable[[References, str], None]) -> AfterValidator:
    """Return the marker of a text that is checked against the context of the validation, if there is one."""

    def validated(text: str, info: ValidationInfo) -> str:
        if isinstance(info.context, References):
            check(info.context, text)
        return text

    return AfterValidator(validated)


def name_of(*sections: str, optional: bool = False) -> AfterValidator:
    """Return the marker of a text that is a name in one of some sections of the file, or, if `optional`, empty."""

    def check(references: References, name: str) -> None:
        if name or not optional:
            references.check_name(name, sections)

    return _checked(check)


DataFile = Annotated[str, _checked(References.check_file)]
"""Path of a data file, relative to the campaign file."""
Address = Annotated[str, _checked(References.check_address)]
"""Address of a parameter."""
NameInMachine = Annotated[str, _checked(References.check_machine)]
"""Name in the chain of the machine of a catalogue."""


# Values at addresses -------------------------------------------------------------------------------------------------

PLAIN_NUMBER = Quantity("a number", "", "0.02")
"""Value of an unknown that moves parameters or is a multiple of one."""


@dataclass(frozen=True)
class _Unread:
    """A value of the file that is not read yet, and its address."""

    value: Any
    address: str
    plain: bool = False
    """Whether it is a plain number."""
    owned: bool = False
    """Whether the address is one of an element of the file."""

    def quantity(self, references: References | None) -> Quantity:
        if self.owned and references is not None:
            references.check_address(self.address)
        return PLAIN_NUMBER if self.plain else kind_of(self.address)


def by_address(*keys: str) -> BeforeValidator:
    """Return the marker of a dictionary by address, whose values have the quantity of the address.

    With keys, these keys of its tables have it.
    """

    def at(address: Any, value: Any) -> Any:
        if not keys:
            return _Unread(value, str(address))
        if not isinstance(value, Mapping):
            return value
        plain = bool(value.get("moves")) or value.get("multiple") is not None
        owned = not value.get("moves")
        marked = {key: _Unread(value[key], str(address), plain, owned) for key in keys if key in value}
        return {**value, **marked}

    def mark(given: Any) -> Any:
        return (
            {address: at(address, value) for address, value in given.items()} if isinstance(given, Mapping) else given
        )

    return BeforeValidator(mark)


def _read_at_address(given: Any, info: ValidationInfo, *, deviation: bool = False) -> Any:
    """Return a value of `by_address` in SI units, or a standard deviation, with the quantity of its address."""
    if not isinstance(given, _Unread):  # read before, in a table that is validated again
        return given
    quantity = given.quantity(info.context)
    types = (str, int, float, dict) if deviation else (str, int, float)
    if isinstance(given.value, bool) or not isinstance(given.value, types):
        also = 'a standard deviation such as "0.1 mm" or "2 %"'
        what = also if deviation else "text with a number and a unit, or a plain number"
        raise ValueError(f"is {shown(given.value)}, expected {what}")
    return parse_deviation(given.value, quantity) if deviation else parse(given.value, quantity)


_PLAIN: list[dict[str, Any]] = [{"type": "string"}, {"type": "number"}]
_NAMED = {"type": "object", "additionalProperties": {"anyOf": _PLAIN}}
Value = Annotated[
    float, _read_by(core_schema.with_info_plain_validator_function(_read_at_address), lambda: {"anyOf": [*_PLAIN]})
]
"""Value of the parameter at the address that `by_address` attaches."""
DeviationAtAddress = Annotated[
    Deviation,
    _read_by(
        core_schema.with_info_plain_validator_function(functools.partial(_read_at_address, deviation=True)),
        lambda: {"anyOf": [*_PLAIN, _NAMED]},
    ),
]
"""Standard deviation of the parameter at the address that `by_address` attaches."""


Position = Annotated[
    float | Literal["end"],
    PlainValidator(parse_position),
    WithJsonSchema({"type": "string", "minLength": 1, "examples": ["62.3 mm", "end"]}),
]
"""A distance from the tip-side end of a part, or its far end."""
