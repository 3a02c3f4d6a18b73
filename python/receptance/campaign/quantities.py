"""Quantities, positions, standard deviations, conditions, levels and priors of a campaign file."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, Literal

from receptance import units
from receptance._text import did_you_mean, one_of, shown
from receptance.identification.unknowns import Prior
from receptance.model.beams import Material, Segment
from receptance.model.distributed import SpreadJoint
from receptance.model.fields import Element, Number
from receptance.model.joints import ColletJoint, MicroslipJoint, PointJoint, PointMass
from receptance.model.terminals import ModalPart, Mode
from receptance.units import FORCE, NUMBER, Quantity, parse, parse_any, split

if TYPE_CHECKING:
    from pydantic import GetCoreSchemaHandler

    from receptance.campaign.format import PriorTable

__all__ = [
    "FIELDS",
    "Amount",
    "Condition",
    "Deviation",
    "OneOf",
    "Spread",
    "json_schema",
    "kind_of",
    "parse_condition",
    "parse_deviation",
    "parse_level",
    "parse_position",
    "parse_share",
    "prior_of",
    "value_at",
]


@dataclass(frozen=True)
class Amount:
    """Marks a field of a pydantic model as a quantity; its value is a float in SI units."""

    quantity: Quantity

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> Any:
        """Read the field with `parse`; the JSON schema does not check the unit."""
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
    """Marks a field with values of several types, for one message instead of one of pydantic for each type."""

    types: tuple[type, ...]
    what: str

    def __init__(self, *types: type, what: str) -> None:
        object.__setattr__(self, "types", types)
        object.__setattr__(self, "what", what)

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> Any:
        """Check the type before pydantic."""
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
    """Marks a field of a pydantic model as a standard deviation; its value is a `Deviation`."""

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
    """A number with a unit that describes a configuration or a measurement.

    Attributes
    ----------
    value : float
        Value in SI units.
    unit : str
        SI unit, empty for a plain number.
    written : str
        Text in the file.
    """

    value: float
    unit: str
    written: str


def parse_condition(written: Any) -> Condition:
    """Return a condition from its value in the file.

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
    """Return a level, and whether it is a force in N instead of a ratio.

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


# Priors --------------------------------------------------------------------------------------------------------------


def prior_of(kind: Quantity, table: PriorTable, logarithmic: bool) -> Prior:
    """Return the prior of an unknown on the scale of the fit.

    Raises
    ------
    ValueError
        Value or standard deviation cannot be read.
    """
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


_OBSERVATION = {
    "log_gain": units.LOGARITHM,
    "delay": units.DELAY,
    "decay_rate": units.DECAY_RATE,
    "decay_rate_of_velocity": units.DECAY_RATE,
    "decay_rate_of_displacement": units.DECAY_RATE,
    "end": units.TIME,
}
"""Parameters of the measuring chain, see `receptance.identification.mapping`."""
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
    """Return the quantity of the parameter at an address.

    Raises
    ------
    ValueError
        The text is not an address, or names an unknown parameter.

    Examples
    --------
    >>> from receptance.campaign.quantities import kind_of
    >>> kind_of("tool.segment[0].length").unit
    'm'
    """
    match = _ADDRESS.fullmatch(address)
    if match is None:
        raise ValueError('is not an address, expected one such as "joint.k_theta" or "tool.segment[0].length"')
    field = match["field"]
    if field not in FIELDS:
        near = did_you_mean(field, FIELDS)
        raise ValueError(f'names an unknown quantity "{field}"{near}; expected {one_of(FIELDS)}')
    return FIELDS[field]


def value_at(address: str, value: Any) -> float:
    """Return the value of the parameter at an address in SI units."""
    return parse(value, kind_of(address))


def parse_position(text: str) -> float | Literal["end"]:
    """Return a position on a part: the distance from its tip-side end in m, or "end"."""
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
