"""Pydantic models from the declarations of elements, and values with the quantity of their address."""

from __future__ import annotations

import functools
import operator
from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, fields
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, get_args, get_type_hints

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    PlainValidator,
    Tag,
    WithJsonSchema,
    create_model,
)
from pydantic import Field as Key

from receptance._text import shown
from receptance.campaign.quantities import Amount, Deviation, Spread, kind_of, parse_deviation, parse_position
from receptance.model.beams import Material
from receptance.model.fields import Choice, Count, Element, Field, Member, Number
from receptance.units import Quantity, parse

if TYPE_CHECKING:
    from pydantic import GetCoreSchemaHandler

__all__ = [
    "PLAIN_NUMBER",
    "AtAddress",
    "ByAddress",
    "ElementTable",
    "Of",
    "OneKind",
    "Position",
    "Table",
    "table_of",
    "tolerance_of",
]

PLAIN_NUMBER = Quantity("a number", "", "0.02")
"""Value of an unknown that moves parameters or is a multiple of one."""


class Table(BaseModel):
    """A table of the file; unknown keys are mistakes, and text is not converted to numbers."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, use_attribute_docstrings=True)


class ElementTable(Table):
    """A table whose keys follow from the declarations of an element."""

    # `create_model` states every description. A search for source code would take half of the time of the import.
    model_config = ConfigDict(use_attribute_docstrings=False)

    origin: ClassVar[tuple[Callable[[Any], type[ElementTable]], Any]]
    """Function that makes the model, and its argument."""

    def __reduce__(self) -> tuple[Any, ...]:
        # The model is made at run time, so that pickle cannot import it by name.
        return _restored, (*type(self).origin, self.__getstate__())

    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any: ...


def _restored(function: Callable[[Any], type[ElementTable]], argument: Any, state: dict[Any, Any]) -> ElementTable:
    model = function(argument)
    table = model.__new__(model)
    table.__setstate__(state)
    return table


def _read_position(value: Any) -> float | str:
    if not isinstance(value, str):
        raise ValueError(f'is {shown(value)}, expected a distance such as "62.3 mm", or "end"')
    return parse_position(value)


Position = Annotated[
    float | Literal["end"],
    PlainValidator(_read_position),
    WithJsonSchema({"type": "string", "minLength": 1, "examples": ["62.3 mm", "end"]}),
]
"""A distance from the tip-side end of a part, or its far end."""


@dataclass(frozen=True)
class Of:
    """Marks a field as the table of an element.

    Parameters
    ----------
    element : type
        Class of the element.
    tag : str, optional
        Value of the key `kind`.
    keys : type, optional
        A model with additional or changed keys.
    without : tuple of str, optional
        Fields of the element that are not keys.
    name : str, optional
        Name of the model in the JSON schema.
    """

    element: type[Element]
    tag: str = ""
    keys: type[ElementTable] = ElementTable
    without: tuple[str, ...] = ()
    name: str = ""

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> Any:
        """Replace the annotated type by the model."""
        del source
        return handler.generate_schema(table_of(self))


@dataclass(frozen=True)
class OneKind:
    """Marks a field as the table of one of several elements, selected by the key `kind`."""

    choices: tuple[Of, ...]

    def __init__(self, *choices: Of) -> None:
        object.__setattr__(self, "choices", choices)

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> Any:
        """Replace the annotated type by a union of the models."""
        del source
        union = functools.reduce(operator.or_, (Annotated[table_of(one), Tag(one.tag)] for one in self.choices))
        return handler.generate_schema(Annotated[union, Discriminator("kind")])


@functools.cache
def table_of(of: Of) -> type[ElementTable]:
    """Return the model of an element: its fields, and their standard deviations as `tolerance`."""
    declared = {
        name: field
        for name, field in of.element.declared.items()
        if name not in ("name", *of.without, *of.keys.model_fields)
    }
    entries: dict[str, Any] = {}
    if of.tag:
        default: Any = of.tag if of.tag == "point" else ...
        entries["kind"] = (Literal[of.tag], Key(default, description=f'`"{of.tag}"`'))
    for name, field in declared.items():
        kind, default = _key(of.element, name, field)
        named = isinstance(field, Member) and field.kind is Material
        entries[name] = (kind, Key(default, description=f"name of the {field.doc}" if named else field.doc))
    if of.element.toleranced:
        tolerance = tolerance_of(Of(of.element))
        text = "standard deviations of the numbers above, by the same keys"
        entries["tolerance"] = (tolerance, Key(tolerance(), description=text))
    doc = of.keys.__doc__ if of.keys is not ElementTable and of.keys.__doc__ else of.element.__doc__ or ""
    name = of.name or f"{of.element.__name__}Table"
    model = create_model(name, __base__=of.keys, __doc__=doc.strip().splitlines()[0], **entries)
    model.origin = (table_of, of)
    return model


def _key(element: type[Element], name: str, field: Field) -> tuple[Any, Any]:
    """Return type and default of a key."""
    (own,) = (one for one in fields(element) if one.name == name)  # type: ignore[arg-type]
    default: Any = ... if own.default is MISSING else own.default
    if isinstance(field, Number):
        return Annotated[float, Amount(field.quantity)], default
    if isinstance(field, Member) and field.kind is Material:
        return (str, ...) if default is ... else (str | None, None)
    if isinstance(field, Member):
        table = table_of(Of(field.kind, name=f"{field.kind.__name__}MemberTable"))
        optional = not any(key.is_required() for key in table.model_fields.values())
        return table, table() if optional else ...
    if isinstance(field, Count):
        kind: Any = Annotated[int, Key(ge=field.least, le=field.most)]
        return (kind | None if default is None else kind), default
    if isinstance(field, Choice):
        return Literal[field.words], default
    if name == "position":
        return Position, default
    hint = get_args(get_type_hints(element, include_extras=True)[name])[0]
    if hint == tuple[float, ...]:
        return Annotated[list[Annotated[float, Key(ge=0.0)]], Key()], list(default)
    return hint, default


@functools.cache
def tolerance_of(of: Of) -> type[ElementTable]:
    """Return the model of the standard deviations of an element's own numbers."""
    element = of.element
    entries: dict[str, Any] = {}
    for name, field in element.declared.items():
        if isinstance(field, Number) and field.parameter:
            kind = Annotated[Deviation | None, Spread(field.quantity)]
            entries[name] = (kind, Key(None, description=f"of the {field.doc.partition(';')[0]}"))
    doc = f"Standard deviations of the numbers of a table of {element.__name__}."
    model = create_model(f"{element.__name__}Tolerance", __base__=ElementTable, __doc__=doc, **entries)
    model.origin = (tolerance_of, of)
    return model


# Values at addresses -------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Unread:
    """A value of the file that is not read yet, and its address."""

    value: Any
    address: str
    plain: bool = False

    @property
    def quantity(self) -> Quantity:
        return PLAIN_NUMBER if self.plain else kind_of(self.address)


@dataclass(frozen=True)
class ByAddress:
    """Marks a dictionary by address: its values, or keys of its tables, have the quantity of the address.

    Parameters
    ----------
    *keys : str
        Keys of the tables; without keys, the values themselves.
    """

    keys: tuple[str, ...] = ()

    def __init__(self, *keys: str) -> None:
        object.__setattr__(self, "keys", keys)

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> Any:
        """Attach the address to every value before validation."""
        return handler.generate_schema(Annotated[source, BeforeValidator(self._marked)])

    def _marked(self, given: Any) -> Any:
        if not isinstance(given, Mapping):
            return given
        return {address: self._at(address, value) for address, value in given.items()}

    def _at(self, address: Any, value: Any) -> Any:
        if not self.keys:
            return _Unread(value, str(address))
        if not isinstance(value, Mapping):
            return value
        plain = bool(value.get("moves")) or value.get("multiple") is not None
        marked = {key: _Unread(value[key], str(address), plain) for key in self.keys if key in value}
        return {**value, **marked}


@dataclass(frozen=True)
class AtAddress:
    """Marks a value in a dictionary of `ByAddress` as a quantity in SI units, or as a standard deviation."""

    deviation: bool = False

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> Any:
        """Read the value with the quantity of its address."""
        del source
        plain: list[dict[str, Any]] = [{"type": "string"}, {"type": "number"}]
        schema = [*plain, {"type": "object", "additionalProperties": {"anyOf": plain}}] if self.deviation else plain
        return handler.generate_schema(Annotated[Any, PlainValidator(self._read), WithJsonSchema({"anyOf": schema})])

    def _read(self, given: Any) -> Any:
        if not isinstance(given, _Unread):  # read before, in a table that is validated again
            return given
        types = (str, int, float, dict) if self.deviation else (str, int, float)
        if isinstance(given.value, bool) or not isinstance(given.value, types):
            also = 'a standard deviation such as "0.1 mm" or "2 %"'
            what = also if self.deviation else "text with a number and a unit, or a plain number"
            raise ValueError(f"is {shown(given.value)}, expected {what}")
        if self.deviation:
            return parse_deviation(given.value, given.quantity)
        return parse(given.value, given.quantity)
