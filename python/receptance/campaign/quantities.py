"""Quantities, standard deviations, conditions and levels in a campaign file: reading, and their JSON schema."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

from receptance._text import shown
from receptance.units import FORCE, NUMBER, Quantity, parse, parse_any, split

if TYPE_CHECKING:
    from pydantic import GetCoreSchemaHandler

__all__ = [
    "Amount",
    "Condition",
    "Deviation",
    "OneOf",
    "Spread",
    "json_schema",
    "parse_condition",
    "parse_deviation",
    "parse_level",
    "parse_share",
]


@dataclass(frozen=True)
class Amount:
    """Marks a field of a pydantic model as a quantity; in Python the field is a float in SI units."""

    quantity: Quantity

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> Any:
        """Read the field with `parse`; a JSON schema cannot say that the unit fits."""
        from pydantic import PlainValidator, WithJsonSchema

        del source
        reading = PlainValidator(lambda value: parse(value, self.quantity))
        return handler.generate_schema(Annotated[Any, reading, WithJsonSchema(json_schema(self.quantity))])


def json_schema(quantity: Quantity) -> dict[str, Any]:
    """Return the JSON Schema of a quantity."""
    if quantity.unit:
        return {"type": "string", "pattern": rf"^\s*{NUMBER}(\s+\S|[^\s\d]).*$", "examples": [quantity.example]}
    bounds = {"exclusiveMinimum": quantity.above, "minimum": quantity.least, "maximum": quantity.most}
    finite = {key: bound for key, bound in bounds.items() if abs(bound) != float("inf")}
    return {"type": "number", "examples": [float(quantity.example)], **finite}


@dataclass(frozen=True)
class OneOf:
    """Marks a field whose value may be of several types; pydantic's own message would name each of them in turn."""

    types: tuple[type, ...]
    what: str

    def __init__(self, *types: type, what: str) -> None:
        object.__setattr__(self, "types", types)
        object.__setattr__(self, "what", what)

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> Any:
        """Check the type before pydantic does."""
        from pydantic import BeforeValidator

        return handler.generate_schema(Annotated[source, BeforeValidator(self._check)])

    def _check(self, value: Any) -> Any:
        if isinstance(value, bool) or not isinstance(value, self.types):
            raise ValueError(f"is {shown(value)}, expected {self.what}")
        return value


# Standard deviations -------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Deviation:
    """A standard deviation.

    Attributes
    ----------
    amount : float
        In SI units, or as a share of the value if it is relative.
    relative : bool
        Whether it is a share of the value.
    name : str
        Name of the error: everything with the same name has the same error. Empty for an error of its own.
    """

    amount: float
    relative: bool
    name: str = ""

    def of(self, value: float) -> float:
        """Return the standard deviation of a value, in SI units."""
        return self.amount * abs(value) if self.relative else self.amount


def parse_share(text: Any, expected: str) -> float:
    """Return a percentage such as "2 %" as a share."""
    number, unit = split(text, expected)
    if unit not in ("%", "percent"):
        raise ValueError(f"is {shown(text)}, expected {expected}")
    if number < 0.0:
        raise ValueError(f"is {shown(text)}, expected zero or more: {expected}")
    return number / 100.0


def parse_deviation(value: Any, quantity: Quantity) -> Deviation:
    """Return the standard deviation of a quantity.

    Examples
    --------
    >>> from receptance import units
    >>> from receptance.campaign.quantities import parse_deviation
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
        found = str(error).split(", expected", 1)[0]
        raise ValueError(f"{found}, expected {expected}") from None


def _deviation_of(quantity: Quantity) -> Quantity:
    return Quantity(quantity.name, quantity.unit, _small(quantity), least=0.0)


def _small(quantity: Quantity) -> str:
    """Return an example of a standard deviation of a quantity."""
    unit = quantity.example.partition(" ")[2]
    return f"0.1 {unit}" if unit else "0.01"


@dataclass(frozen=True)
class Spread:
    """Marks a field of a pydantic model as a standard deviation; in Python it is a `Deviation`."""

    quantity: Quantity

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> Any:
        """Read the field with `parse_deviation`."""
        from pydantic import PlainValidator, WithJsonSchema

        del source
        reading = PlainValidator(lambda value: parse_deviation(value, self.quantity))
        return handler.generate_schema(Annotated[Any, reading, WithJsonSchema(_deviation_schema(self.quantity))])


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
    >>> from receptance.campaign.quantities import parse_condition
    >>> parse_condition("5 kN")
    Condition(value=5000.0, unit='kg m/s^2', written='5 kN')
    """
    if isinstance(written, bool) or not isinstance(written, (str, int, float)):
        raise ValueError(f"is {shown(written)}, expected text with a number and a unit, or a plain number")
    value, unit = parse_any(written) if isinstance(written, str) else (float(written), "")
    if not math.isfinite(value):
        raise ValueError(f"is {shown(written)}, expected a finite number")
    return Condition(value, unit, written if isinstance(written, str) else f"{written:g}")


def parse_level(written: Any) -> tuple[float, bool]:
    """Return a level, and whether it is a force in N.

    Examples
    --------
    >>> from receptance.campaign.quantities import parse_level
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
