"""Tolerances as people write them: standard deviations, absolute or relative, perhaps with a name."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

from receptance.campaign.quantities import NUMBER, Kind, json_schema, parse, shown, split

if TYPE_CHECKING:
    from pydantic import GetCoreSchemaHandler

__all__ = ["Deviation", "Spread", "parse_deviation", "parse_share"]


@dataclass(frozen=True)
class Deviation:
    """A standard deviation.

    Attributes
    ----------
    amount : float
        In SI units, or as a share of the value where it is relative.
    relative : bool
        Whether it is a share of the value.
    name : str
        What the error belongs to: all that have the same name err together. Empty for the thing's own.
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


def parse_deviation(value: Any, kind: Kind) -> Deviation:
    """Return the standard deviation of a quantity of some kind.

    Examples
    --------
    >>> from receptance.campaign.deviations import parse_deviation
    >>> from receptance.campaign.quantities import KINDS
    >>> parse_deviation("2 %", KINDS["a length"])
    Deviation(amount=0.02, relative=True, name='')
    >>> parse_deviation({"value": "0.5 mm", "name": "gauge"}, KINDS["a length"])
    Deviation(amount=0.0005, relative=False, name='gauge')
    """
    expected = f'a standard deviation, absolute such as {_written(kind)} or relative such as "2 %"'
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
    allowed = Kind(expected, kind.unit, _small(kind), "zero or more")
    try:
        return Deviation(parse(value, allowed), False, name)
    except ValueError as error:
        found = str(error).split(", expected", 1)[0]
        raise ValueError(f"{found}, expected {expected}") from None


def _written(kind: Kind) -> str:
    return f'"{_small(kind)}"' if kind.unit else _small(kind)


def _small(kind: Kind) -> str:
    unit = kind.example.split(" ", 1)
    return "0.01" if len(unit) == 1 else f"0.1 {unit[1]}"


@dataclass(frozen=True)
class Spread:
    """Marks a field of a pydantic model as a standard deviation; in Python it is a `Deviation`."""

    kind: Kind

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> Any:
        """Replace pydantic's own reading by `parse_deviation`."""
        from pydantic import PlainValidator, WithJsonSchema

        del source
        reading = PlainValidator(lambda value: parse_deviation(value, self.kind))
        return handler.generate_schema(Annotated[Any, reading, WithJsonSchema(deviation_schema(self.kind))])


def deviation_schema(kind: Kind) -> dict[str, Any]:
    """Return what a JSON Schema can say of a standard deviation."""
    plain = Kind(kind.name, kind.unit, _small(kind), "zero or more")
    share = {"type": "string", "pattern": rf"^\s*{NUMBER}\s*(%|percent)\s*$", "examples": ["2 %"]}
    spellings = [json_schema(plain), share]
    named = {
        "type": "object",
        "properties": {"value": {"anyOf": spellings}, "name": {"type": "string", "minLength": 1}},
        "required": ["value", "name"],
        "additionalProperties": False,
    }
    return {"anyOf": [*spellings, named], "examples": [_small(kind) if kind.unit else float(_small(kind)), "2 %"]}
