"""Declarations of elements: each field is declared once, with quantity, bounds, default and documentation.

A field is declared by its annotation, `k_y: Annotated[float, Number(STIFFNESS, "translational stiffness")] = 0.0`. The
checks of its value, its column in the tables of the core, its address, its documentation and its key in a campaign file
are derived from the declaration.
"""

from __future__ import annotations

import inspect
import math
import textwrap
from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass, replace
from dataclasses import field as dataclass_field
from functools import cached_property
from typing import Annotated, Any, ClassVar, Generic, Literal, Self, TypeVar, cast, get_args, get_type_hints

import numpy as np

from receptance import _checks, units
from receptance._text import did_you_mean, shown
from receptance.units import Quantity, parse

T = TypeVar("T")
D = TypeVar("D")


class Field(Generic[T]):
    """A field with a description without a verb; by default it is neither passed to the core nor read from files."""

    doc: str

    def __init__(self, doc: str) -> None:
        self.doc = doc

    def default(self, value: D) -> T | D:
        """Return the declaration of a key with a default, to be assigned in the class of a table."""
        return cast(D, Key(self, value))

    def needed(self) -> T:
        """Return the declaration of a key without a default, to be assigned in the class of a table."""
        return cast(T, Key(self, needed=True))

    def read(self, written: Any, place: Any) -> Any:
        """Return the value of a key of a file; the text of a ValueError is a predicate of the key.

        The `place` is where a value with several parts reads them, see `receptance.campaign.keys.Place`.
        """
        raise TypeError(f"{type(self).__name__}: this field is not read from files")

    def write(self, value: Any) -> Any:
        """Return the value of a key as a file states it, with all digits."""
        return value

    def schema(self) -> dict[str, Any]:
        """Return the JSON Schema of the value of a key."""
        raise TypeError(f"{type(self).__name__}: this field is not read from files")


@dataclass(frozen=True)
class Key:
    """A key of a table: its declaration, and its default unless it is needed."""

    of: Field[Any]
    default: Any = None
    needed: bool = False


class AttachedTo(Field[str]):
    """The name of a part."""


class Position(Field[float | Literal["end"]]):
    """A distance in m from the tip-side end of a part, or "end"."""

    def read(self, written: Any, place: Any) -> float | Literal["end"]:
        if written == "end":
            return "end"
        try:
            return parse(written, units.LENGTH_OR_ZERO)
        except ValueError as error:
            expected = 'a distance from the tip-side end of the part such as "0 mm" or "62.3 mm", or "end"'
            raise ValueError(f"{str(error).split(', expected', 1)[0]}, expected {expected}") from None

    def write(self, value: float | str) -> str | float:
        return value if isinstance(value, str) else units.LENGTH.text(value)

    def schema(self) -> dict[str, Any]:
        return {"type": "string", "minLength": 1, "examples": ["62.3 mm", "end"]}


Name = Annotated[str, Field("first word of the addresses of its parameters")]
AttachedPart = Annotated[str, AttachedTo("name of the part to which it is attached; by default the first part")]
AttachedPosition = Annotated[
    float | Literal["end"], Position("distance in m from the tip-side end of the part, or its far end")
]


@dataclass(frozen=True)
class Number(Field[float]):
    """A number with the unit and bounds of a quantity; a parameter of assemblies has an address and a column."""

    quantity: Quantity
    doc: str
    _: KW_ONLY
    parameter: bool = True

    def read(self, written: Any, place: Any) -> float:
        return parse(written, self.quantity)

    def write(self, value: float) -> str | float:
        return self.quantity.text(value)

    def schema(self) -> dict[str, Any]:
        quantity = self.quantity
        if quantity.unit:
            pattern = rf"^\s*{units.NUMBER}(\s+\S|[^\s\d]).*$"
            return {"type": "string", "pattern": pattern, "examples": [quantity.example]}
        bounds = {"exclusiveMinimum": quantity.above, "minimum": quantity.least, "maximum": quantity.most}
        finite = {key: bound for key, bound in bounds.items() if math.isfinite(bound)}
        return {"type": "number", "examples": [float(quantity.example)], **finite}


@dataclass(frozen=True)
class Numbers(Field[tuple[float, ...]]):
    """Numbers of zero or more."""

    doc: str


@dataclass(frozen=True)
class Count(Field[int]):
    """An integer within bounds, or None if that is the default; passed to the core if `column`."""

    doc: str
    least: int = 1
    most: float = 1000
    column: bool = False

    def read(self, written: Any, place: Any) -> int:
        if isinstance(written, bool) or not isinstance(written, int):
            raise ValueError(f"is {shown(written)}, expected a whole number")
        if written < self.least:
            raise ValueError(f"is {written}, expected at least {self.least}")
        if written > self.most:
            raise ValueError(f"is {written}, expected at most {self.most:g}")
        return written

    def schema(self) -> dict[str, Any]:
        most = {"maximum": self.most} if math.isfinite(self.most) else {}
        return {"type": "integer", "minimum": self.least, **most}


@dataclass(frozen=True)
class Choice(Field[Any]):
    """One of several words, passed to the core as its index; files may have other words for them."""

    doc: str
    words: tuple[str, ...]
    others: Mapping[str, str] = dataclass_field(default_factory=dict)
    """Words for the same in files, with the one of `words`."""

    def read(self, written: Any, place: Any) -> str:
        words = (*self.words, *self.others)
        if written not in words:
            expected = ", ".join(f'"{word}"' for word in words)
            raise ValueError(f"is {shown(written)}, expected one of {expected}{did_you_mean(str(written), words)}")
        return self.others.get(str(written), str(written))

    def schema(self) -> dict[str, Any]:
        return {"type": "string", "enum": [*self.words, *self.others]}


@dataclass(frozen=True)
class Member(Field[Any]):
    """An element within an element, and the prefix of the addresses of its parameters; "" for those of the owner."""

    kind: type[Element]
    doc: str
    _: KW_ONLY
    prefix: str


@dataclass(frozen=True)
class CoreColumn:
    """A column of the row of an element in the tables of the core.

    The address within the element is empty if the column is not a parameter; the path are the names of nested fields.
    """

    address: str
    path: tuple[str, ...]
    field: Field[Any]

    def number(self, element: Any) -> float:
        """Return the value of an element in this column; zero for a member that is None."""
        value: Any = element
        for name in self.path:
            value = getattr(value, name)
            if value is None:
                return 0.0
        return float(self.field.words.index(value) if isinstance(self.field, Choice) else value)


def _declared(kind: type, hints: Mapping[str, Any]) -> dict[str, Field[Any]]:
    """Return the declared fields of a class by name, with the fields of base classes first."""
    declared: dict[str, Field[Any]] = {}
    for name, hint in hints.items():
        for metadata in getattr(hint, "__metadata__", ()):
            if isinstance(metadata, Field):
                declared[name] = metadata
    order = [name for base in reversed(kind.__mro__) for name in inspect.get_annotations(base)]
    return {name: declared[name] for name in dict.fromkeys(order) if name in declared}


def _layout(fields: Mapping[str, Field[Any]]) -> tuple[CoreColumn, ...]:
    """Return the columns of fields in the tables of the core."""
    columns: list[CoreColumn] = []
    for name, field in fields.items():
        if isinstance(field, Member):
            for column in field.kind.layout:
                address = f"{field.prefix}{column.address}" if column.address else ""
                columns.append(CoreColumn(address, (name, *column.path), column.field))
        elif isinstance(field, Number) and field.parameter:
            columns.append(CoreColumn(name, (name,), field))
        elif isinstance(field, Choice) or (isinstance(field, Count) and field.column):
            columns.append(CoreColumn("", (name,), field))
    return tuple(columns)


class _Signature:
    """Signature of an element's class with the types of its fields alone, without their declarations."""

    def __get__(self, element: object, kind: type) -> inspect.Signature:
        hints = get_type_hints(kind)
        _, *parameters = inspect.signature(kind.__init__).parameters.values()  # type: ignore[misc]
        return inspect.Signature(
            [parameter.replace(annotation=hints.get(parameter.name, parameter.annotation)) for parameter in parameters]
        )


class Element:
    """Base of all elements; checks, columns and addresses are derived from the declarations of the fields.

    Examples
    --------
    >>> from receptance import PointMass
    >>> PointMass.declared["mass"].quantity.unit
    'kg'
    >>> [column.address for column in PointMass.layout]
    ['mass', 'inertia']
    """

    declared: ClassVar[dict[str, Field[Any]]] = {}
    """Declarations of the fields by name, in the order of their definition."""
    layout: ClassVar[tuple[CoreColumn, ...]] = ()
    """Columns of an element in the tables of the core."""
    quantities: ClassVar[dict[str, Quantity]] = {}
    """Quantities of the parameters that are direct fields of the class, by name."""
    columns_of: ClassVar[tuple[str, ...]] = ()
    """Names of these parameters."""
    toleranced: ClassVar[bool] = True
    """Whether a campaign can state tolerances of its parameters."""
    role: ClassVar[str] = ""
    """Default name of an element of an assembly: "part", "joint", "spindle", "mass", "ground" or "resonator"."""
    __signature__ = _Signature()

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        hints = get_type_hints(cls, include_extras=True)
        cls.declared = _declared(cls, hints)
        cls.layout = _layout(cls.declared)
        numbers = {name: field for name, field in cls.declared.items() if isinstance(field, Number) and field.parameter}
        cls.quantities = {name: field.quantity for name, field in numbers.items()}
        cls.columns_of = tuple(cls.quantities)
        if cls.__doc__ and "{fields}" in cls.__doc__:
            cls.__doc__ = cls.__doc__.replace("    {fields}\n", _documented(cls, hints))

    @property
    def owner(self) -> str:
        """Class and name of the element, for messages."""
        name = getattr(self, "name", "")
        return f"{type(self).__name__} {name!r}" if name else type(self).__name__

    def __post_init__(self) -> None:
        """Check types and bounds of all fields, and convert numbers to float; errors name class, element and field."""
        for name, field in self.declared.items():
            value = getattr(self, name)
            optional = getattr(type(self), name, field) is None
            if value is None and optional:
                continue
            or_none = " or None" if optional else ""
            if isinstance(field, Number):
                _checks.set_fields(self, {name: _checks.quantity(self.owner, name, value, field.quantity)})
            elif isinstance(field, Choice):
                if value not in field.words:
                    raise ValueError(f"{self.owner}: {name} is {value!r}, expected one of {', '.join(field.words)}")
            elif isinstance(field, Count):
                expected = f"a whole number from {field.least} to {field.most}{or_none}"
                if isinstance(value, bool) or not isinstance(value, (int, np.integer)):
                    raise TypeError(f"{self.owner}: {name} is {value!r}, expected {expected}")
                if not field.least <= value <= field.most:
                    raise ValueError(f"{self.owner}: {name} is {value}, expected {expected}")
            elif isinstance(field, Member) and not isinstance(value, field.kind):
                raise TypeError(f"{self.owner}: {name} is {value!r}, expected a {field.kind.__name__}{or_none}")

    @cached_property
    def columns(self) -> tuple[float, ...]:
        """Row of the element in the tables of the core, without nodes."""
        return tuple(column.number(self) for column in self.layout)

    @cached_property
    def places(self) -> dict[str, int]:
        """Addresses of the parameters of the element with their columns."""
        return {
            column.address: index
            for index, column in enumerate(self.layout)
            if column.address and _is_present(self, column.path)
        }

    def with_values(self, values: Mapping[str, float]) -> Self:
        """Return the element with new values of some parameters, replaced together."""
        changes: dict[str, Any] = {}
        inside: dict[str, dict[str, float]] = {}
        for address, value in values.items():
            name, *nested = self._path(address)
            if nested:
                member = self.declared[name]
                assert isinstance(member, Member)
                inside.setdefault(name, {})[address.removeprefix(member.prefix)] = value
            else:
                changes[name] = value
        for name, member_values in inside.items():
            changes[name] = getattr(self, name).with_values(member_values)
        return replace(self, **changes)  # type: ignore[type-var]

    def _path(self, address: str) -> tuple[str, ...]:
        for column in self.layout:
            if column.address == address and _is_present(self, column.path):
                return column.path
        raise ValueError(f"{self.owner} has no parameter {address!r}, expected one of {', '.join(self.places)}")


def _is_present(element: Any, path: tuple[str, ...]) -> bool:
    for name in path:
        element = getattr(element, name)
        if element is None:
            return False
    return True


def _documented(kind: type[Element], hints: Mapping[str, Any]) -> str:
    """Return the entries of the declared fields in the section "Parameters" of the docstring of a class."""
    lines = []
    for name, field in kind.declared.items():
        default: Any = getattr(kind, name, ...)
        default = getattr(default, "default", default)
        written = f"{default:g}" if isinstance(default, float) else repr(default)
        optional = "" if default is ... else ", optional" if default in (None, "", ()) else f", default {written}"
        text = field.doc
        if isinstance(field, Number):
            type_name = "float"
            head, semicolon, tail = text.partition(";")
            unit = field.quantity.unit and f" in {field.quantity.unit}"
            bounds = field.quantity.bounds and f", {field.quantity.bounds}"
            text = f"{head}{unit}{bounds}{semicolon}{tail}"
        elif isinstance(field, Choice):
            type_name = "{" + ", ".join(f'"{word}"' for word in field.words) + "}"
        elif isinstance(field, Member):
            type_name = field.kind.__name__
        else:
            type_name = "int" if isinstance(field, Count) else _type_name(hints[name])
        lines += [
            f"    {name} : {type_name}{optional}",
            *(" " * 8 + line for line in textwrap.wrap(f"{text[0].upper()}{text[1:]}.", 104)),
        ]
    return "\n".join(lines) + "\n"


def _type_name(hint: Any) -> str:
    kind = get_args(hint)[0]
    return str(getattr(kind, "__name__", kind)).replace("typing.", "").replace(" | ", " or ")
