"""Keys of the tables of a campaign file: reading of their values, and their JSON Schema.

A table is a class whose annotations declare its keys, like the fields of an element, or an element itself. Each
declaration reads its value. A mistake is added at the place of its value, and reading goes on, so that all mistakes of
a file are found in one pass.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import KW_ONLY, MISSING, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, Final, Self, TypeVar

from receptance._text import did_you_mean, instead_of, nearest, one_of, shown
from receptance.campaign.problems import KeyPath, Problems
from receptance.campaign.values import PLAIN_NUMBER, Deviation, kind_of, parse_deviation, small_deviation
from receptance.fit.parameters import FACTORS
from receptance.model.beams import Material
from receptance.model.fields import AttachedTo, Element, Field, Key, Member, Number, Numbers, T
from receptance.units import NUMBER, Quantity, parse

OWNERS = ("parts", "modal_parts", "joints", "attachments", "sensors")
"""Sections whose names begin addresses."""
_SINGULAR = {
    "assemblies": "an assembly",
    "attachments": "an attachment",
    "materials": "a material",
    "parts": "a part",
    "modal_parts": "a modal part",
}
WRONG: Final = object()
"""Result of reading a value with a mistake, which was added."""
PLAIN: list[dict[str, Any]] = [{"type": "string"}, {"type": "number"}]
"""JSON Schemas of a text and of a number."""

# Places ---------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Names:
    """Names and files to which tables may refer.

    `named` are all names of each section, those of tables with mistakes included. References to `broken` sections,
    which are missing or are no tables, are not checked; nor are data files without a `folder`.
    """

    named: dict[str, list[str]]
    broken: frozenset[str]
    folder: Path | None


@dataclass(frozen=True)
class Place:
    """The place of a value in the file: its path, and the table that has it."""

    problems: Problems
    names: Names
    path: KeyPath = ()
    table: Mapping[str, Any] = field(default_factory=dict)

    def at(self, key: str | int, table: Mapping[str, Any] | None = None) -> Place:
        """Return the place of a key or an item."""
        return Place(self.problems, self.names, (*self.path, key), {} if table is None else table)

    def mistake(self, text: str, up: int = 0) -> None:
        """Add a mistake at this place, or some steps above it."""
        self.problems.add(self.path[: len(self.path) - up], text)

    def read(self, declared: Field[Any], written: Any) -> Any:
        try:
            return declared.read(written, self)
        except ValueError as error:
            self.mistake(str(error))
            return WRONG

    def keys(self, of: Keys[Any], written: Mapping[str, Any]) -> dict[str, Any]:
        """Return the values of the keys of a table, `WRONG` for those with mistakes."""
        declared, misspelt = of.declared, set()
        unknown = [key for key in written if key not in declared]
        for key in unknown:
            expected = [name for name in declared if name not in written]
            near = nearest(key, expected)
            misspelt.add(near)
            hint = f'; did you mean "{near}"?' if near else f"; expected {one_of(declared)}"
            self.at(key).mistake(f"is not a known key{hint}")
        values: dict[str, Any] = dict.fromkeys(unknown, WRONG)
        for name, declaration in declared.items():
            if name in written:
                values[name] = self.at(name, written).read(declaration, written[name])
            elif of.default_of(name) is MISSING:
                values[name] = WRONG
                if name not in misspelt:
                    tables = "" if self.path else f", expected tables such as [{name}.NAME]"
                    self.at(name).mistake(f"is missing{tables}")
        return values

    def name(self, name: str, sections: tuple[str, ...]) -> None:
        """Add a mistake if no section has the name; the table with the name is usable."""
        names = [other for section in sections for other in self.names.named[section]]
        if name in names or not self.names.broken.isdisjoint(sections):
            return
        # Messages mention modal parts only if the file has some.
        mentioned = [section for section in sections if section != "modal_parts" or self.names.named[section]]
        what = " or ".join(_SINGULAR.get(section, f"a {section.removesuffix('s')}") for section in mentioned)
        self.mistake(f'is "{name}", which is not {what} of this file{instead_of(name, names)}')

    def address(self, address: str) -> None:
        """Raise if a text is not an address, or its owner is unknown."""
        kind_of(address)
        owner = address.split(".", 1)[0]
        names = [name for section in OWNERS for name in self.names.named[section]]
        if owner not in names and address not in FACTORS and self.names.broken.isdisjoint(OWNERS):
            text = f'begins with "{owner}", which is not a part, joint, attachment or sensor of this file'
            raise ValueError(text + instead_of(owner, names))


def text_of(written: Any) -> str:
    """Return a text, or raise."""
    if not isinstance(written, str):
        raise ValueError(f"is {shown(written)}, expected text in quotes")
    return written


def table_of(written: Any) -> dict[str, Any]:
    """Return a table as it is written, or raise."""
    if not isinstance(written, dict):
        raise ValueError(f"is {shown(written)}, expected a table")
    return written


# Single values --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Text(Field[str]):
    """A text."""

    doc: str = ""

    def read(self, written: Any, place: Place) -> str:
        return text_of(written)

    def schema(self) -> dict[str, Any]:
        return {"type": "string"}


@dataclass(frozen=True)
class Word(Field[Any]):
    """The value of the key `kind`, which selects the table."""

    doc: str

    def read(self, written: Any, place: Place) -> str:
        return text_of(written)

    @property
    def word(self) -> str:
        """The word."""
        return self.doc.strip('`"')

    def schema(self) -> dict[str, Any]:
        return {"type": "string", "const": self.word}


@dataclass(frozen=True)
class Flag(Field[bool]):
    """True or false."""

    doc: str

    def read(self, written: Any, place: Place) -> bool:
        if not isinstance(written, bool):
            raise ValueError(f"is {shown(written)}, expected true or false")
        return written

    def schema(self) -> dict[str, Any]:
        return {"type": "boolean"}


@dataclass(frozen=True)
class Real(Field[float]):
    """A number without a unit, within bounds: more than `above`, at least `least`, less than `below`."""

    doc: str = ""
    _: KW_ONLY
    least: float | None = None
    above: float | None = None
    below: float | None = None

    def read(self, written: Any, place: Place) -> float:
        if isinstance(written, bool) or not isinstance(written, (int, float)):
            raise ValueError(f"is {shown(written)}, expected a number")
        if self.least is not None and not written >= self.least:
            raise ValueError(f"is {shown(written)}, expected at least {self.least:g}")
        if self.above is not None and not written > self.above:
            raise ValueError(f"is {shown(written)}, expected more than {self.above:g}")
        if self.below is not None and not written < self.below:
            raise ValueError(f"is {shown(written)}, expected less than {self.below:g}")
        return float(written)

    def schema(self) -> dict[str, Any]:
        bounds = {"minimum": self.least, "exclusiveMinimum": self.above, "exclusiveMaximum": self.below}
        return {"type": "number", **{key: bound for key, bound in bounds.items() if bound is not None}}


@dataclass(frozen=True)
class Written(Field[Any]):
    """A value of one of several types, which is read where more is known: a text with a unit or a number."""

    doc: str = ""
    _: KW_ONLY
    types: tuple[type, ...] = (str, int, float)
    expected: str = "text with a number and a unit, or a plain number"
    form: tuple[dict[str, Any], ...] = tuple(PLAIN)

    def read(self, written: Any, place: Place) -> Any:
        if isinstance(written, bool) or not isinstance(written, self.types):
            raise ValueError(f"is {shown(written)}, expected {self.expected}")
        if isinstance(written, list):
            # Numbers are allowed in the list where they are beside it.
            items = Written(types=(str, int, float)) if float in self.types else Text()
            return ListOf("", items).read(written, place)
        return written

    def schema(self) -> dict[str, Any]:
        return {"anyOf": list(self.form)}


@dataclass(frozen=True)
class Parsed(Field[T]):
    """A value that a function returns from the written one."""

    doc: str
    parse: Callable[[Any], T]
    form: dict[str, Any] = field(default_factory=lambda: {"type": "string"})

    def read(self, written: Any, place: Place) -> Any:
        return self.parse(written)

    def schema(self) -> dict[str, Any]:
        return self.form


@dataclass(frozen=True, init=False)
class NameOf(Text):
    """A name in one of some sections of the file, or, if `optional`, an empty text."""

    sections: tuple[str, ...] = ()
    optional: bool = False

    def __init__(self, doc: str, *sections: str, optional: bool = False) -> None:
        vars(self).update(doc=doc, sections=sections, optional=optional)

    def read(self, written: Any, place: Place) -> str:
        name = text_of(written)
        if name or not self.optional:
            place.name(name, self.sections)
        return name


@dataclass(frozen=True)
class NameInMachine(Text):
    """A name in the chain of the machine of a catalogue."""

    def read(self, written: Any, place: Place) -> str:
        name = text_of(written)
        if name in place.names.named["modal_parts"]:
            place.mistake(
                f'is "{name}", a modal part, which `machine` cannot contain; expected parts and joints, or the spindle '
                'in a file of its own, named by `spindle = "FILE"`'
            )
        else:
            place.name(name, ("parts", "joints"))
        return name


@dataclass(frozen=True)
class DataFile(Text):
    """The path of a data file, relative to the campaign file."""

    def read(self, written: Any, place: Place) -> str:
        name, folder = text_of(written), place.names.folder
        if folder is not None and not (file := folder / name).is_file():
            what = "is a folder" if file.is_dir() else "does not exist"
            near = [other.name for other in sorted(file.parent.iterdir())] if file.parent.is_dir() else []
            text = f'is "{name}", which {what}, expected a data file in {folder.resolve()}'
            place.mistake(text + did_you_mean(file.name, near))
        return name


@dataclass(frozen=True)
class DataFiles(Field[str | list[str]]):
    """The path of a data file, or a list of them."""

    doc: str

    def read(self, written: Any, place: Place) -> Any:
        if isinstance(written, list):
            return ListOf("", DataFile()).read(written, place)
        if not isinstance(written, str):
            raise ValueError(f"is {shown(written)}, expected the name of a file, or a list of them")
        return DataFile().read(written, place)

    def schema(self) -> dict[str, Any]:
        return {"anyOf": [{"type": "string"}, {"type": "array", "items": {"type": "string"}}]}


@dataclass(frozen=True)
class Deviated(Field[Deviation]):
    """The standard deviation of a quantity, a `Deviation`."""

    quantity: Quantity
    doc: str

    def read(self, written: Any, place: Place) -> Any:
        return parse_deviation(written, self.quantity)

    def schema(self) -> dict[str, Any]:
        small = small_deviation(self.quantity)
        share = {"type": "string", "pattern": rf"^\s*{NUMBER}\s*(%|percent)\s*$", "examples": ["2 %"]}
        spellings = [Number(small, "").schema(), share]
        named = {
            "type": "object",
            "properties": {"value": {"anyOf": spellings}, "name": {"type": "string", "minLength": 1}},
            "required": ["value", "name"],
            "additionalProperties": False,
        }
        example = small.example if small.unit else float(small.example)
        return {"anyOf": [*spellings, named], "examples": [example, "2 %"]}


@dataclass(frozen=True)
class ValueOfUnknown(Field[float]):
    """A bound or a start of an unknown, with the quantity of the address that is the name of its table."""

    doc: str

    def read(self, written: Any, place: Place) -> Any:
        moves, address = bool(place.table.get("moves")), str(place.path[-2])
        try:
            if not moves:
                place.address(address)
            plain = moves or place.table.get("multiple") is not None
            quantity = PLAIN_NUMBER if plain else kind_of(address)
        except ValueError as error:
            place.mistake(str(error), up=1)
            return WRONG
        return parse(Written().read(written, place), quantity)

    def schema(self) -> dict[str, Any]:
        return {"anyOf": PLAIN}


@dataclass(frozen=True)
class ValueAtAddress(Field[Any]):
    """The value of the parameter whose address is the key, or, if `deviation`, its standard deviation."""

    deviation: bool = False

    def read(self, written: Any, place: Place) -> Any:
        quantity = kind_of(str(place.path[-1]))
        types = (str, int, float, dict) if self.deviation else (str, int, float)
        expected = 'a standard deviation such as "0.1 mm" or "2 %"' if self.deviation else Written().expected
        value = Written(types=types, expected=expected).read(written, place)
        return parse_deviation(value, quantity) if self.deviation else parse(value, quantity)

    def schema(self) -> dict[str, Any]:
        named = {"type": "object", "additionalProperties": {"anyOf": PLAIN}}
        return {"anyOf": [*PLAIN, named] if self.deviation else PLAIN}


# Lists and tables -----------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class ListOf(Field[list[T]]):
    """A list of values, at least `least`."""

    doc: str
    item: Field[T]
    least: int = 0
    most: int = 1_000_000

    def read(self, written: Any, place: Place) -> Any:
        if not isinstance(written, list):
            raise ValueError(f"is {shown(written)}, expected a list in square brackets")
        values = [place.at(index).read(self.item, item) for index, item in enumerate(written)]
        if WRONG in values:
            return WRONG
        if len(written) < self.least:
            raise ValueError(f"is {shown(written)}, expected at least {self.least}")
        if len(written) > self.most:
            raise ValueError(f"is {shown(written)}, expected at most {self.most}")
        return values

    def schema(self) -> dict[str, Any]:
        least = {"minItems": self.least} if self.least else {}
        most = {"maxItems": self.most} if self.most == self.least else {}
        return {"type": "array", "items": self.item.schema(), **least, **most}


@dataclass(frozen=True)
class MapOf(Field[Mapping[str, T]]):
    """A table whose keys are names, conditions or addresses; `check_key` raises for a wrong one."""

    doc: str
    item: Field[T]
    check_key: Callable[[Place, str], None] = lambda place, key: None
    pattern: str = ""

    def read(self, written: Any, place: Place) -> Any:
        values = self._values(table_of(written), place)
        return WRONG if WRONG in values.values() else values

    def _values(self, written: dict[str, Any], place: Place) -> dict[str, Any]:
        values = {}
        for key, value in written.items():
            at = place.at(key)
            try:
                self.check_key(at, key)
            except ValueError as error:
                at.mistake(str(error))
                values[key] = WRONG
                continue
            values[key] = at.read(self.item, value)
        return values

    def schema(self) -> dict[str, Any]:
        if self.pattern:
            return {
                "type": "object",
                "patternProperties": {self.pattern: self.item.schema()},
                "additionalProperties": False,
            }
        return {"type": "object", "additionalProperties": self.item.schema()}


@dataclass(frozen=True)
class NamedTables(MapOf[T]):
    """A table of the file with tables by name; those with mistakes are left out."""

    def read(self, written: Any, place: Place) -> dict[str, Any]:
        if not isinstance(written, dict):
            place.mistake(f"is {shown(written)}, expected a table")
            return {}
        return {key: value for key, value in self._values(written, place).items() if value is not WRONG}


class KeyTable:
    """A table of the file, whose attributes are its keys; one that the file does not have has its default."""

    declared: ClassVar[dict[str, Field[Any]]] = {}
    """Declarations of the keys by name."""

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        cls.declared = {}
        for base in reversed(cls.__bases__):
            cls.declared |= getattr(base, "declared", {})
        for name, key in [(name, value) for name, value in vars(cls).items() if isinstance(value, Key)]:
            cls.declared[name] = key.of
            if key.needed:
                delattr(cls, name)
            else:
                setattr(cls, name, key.default)

    def __init__(self, **values: Any) -> None:
        vars(self).update(values)

    @property
    def written(self) -> frozenset[str]:
        """Keys that the file has."""
        return frozenset(vars(self))

    def data(self) -> dict[str, Any]:
        """Return the values of all keys."""
        return {key: getattr(self, key) for key in self.declared}

    def with_(self, **values: Any) -> Self:
        """Return the table with other values."""
        return type(self)(**{**vars(self), **values})


class Keys(Field[T], ABC):
    """The keys of a table with their defaults; `made` returns the table from the values of the written keys."""

    declared: Mapping[str, Field[Any]]

    @property
    @abstractmethod
    def title(self) -> str:
        """Name of its definition in the JSON Schema."""

    @property
    @abstractmethod
    def text(self) -> str:
        """Description of the table."""

    @abstractmethod
    def default_of(self, key: str) -> Any:
        """Return the default of a key; `MISSING` if it is needed."""

    @abstractmethod
    def made(self, values: dict[str, Any]) -> T:
        """Return the table with some values, and with defaults."""

    def read(self, written: Any, place: Place) -> Any:
        values = place.keys(self, table_of(written))
        return WRONG if WRONG in values.values() else self.made(values)

    def schema(self) -> dict[str, Any]:
        return {"$ref": f"#/$defs/{self.title}"}

    def definition(self) -> dict[str, Any]:
        """Return the JSON Schema of the table."""
        properties = {}
        for key, of in self.declared.items():
            schema, default = of.schema(), self.default_of(key)
            # Of a quantity, which is text, the default is a number in SI units.
            typed = isinstance(default, str) or schema.get("type") != "string"
            shown_default = {"default": default} if isinstance(default, (bool, int, float, str)) and typed else {}
            properties[key] = {**schema, **({} if default == "" else shown_default), "description": of.doc}
        required = [key for key in self.declared if self.default_of(key) is MISSING]
        return {
            "type": "object",
            "description": self.text.strip().splitlines()[0],
            "properties": properties,
            "additionalProperties": False,
            **({"required": required} if required else {}),
        }


K = TypeVar("K", bound=KeyTable)


@dataclass(frozen=True)
class TableOf(Keys[K]):
    """A table of a class."""

    table: type[K]
    doc: str = ""

    @property
    def declared(self) -> Mapping[str, Field[Any]]:  # type: ignore[override]
        """Declarations of the keys by name."""
        return self.table.declared

    @property
    def title(self) -> str:
        return self.table.__name__

    @property
    def text(self) -> str:
        return self.table.__doc__ or ""

    def default_of(self, key: str) -> Any:
        return getattr(self.table, key, MISSING)

    def made(self, values: dict[str, Any]) -> K:
        return self.table(**values)


class ElementTable:
    """The table of an element: the values of its keys, and which of them are `written` in the file."""

    def __init__(self, element: type[Element], written: frozenset[str], values: Mapping[str, Any]) -> None:
        self.element, self.written = element, written
        vars(self).update(values)

    def __getattr__(self, name: str) -> Any:
        raise AttributeError(f"the table of a {type(self).__name__} has no {name}")


@dataclass(frozen=True)
class Tolerances(Keys[dict[str, Deviation]]):
    """The standard deviations of the numbers of an element by name."""

    title = "Tolerances"
    element: type[Element]
    doc: str = "standard deviations of the numbers above, by the same keys"

    @cached_property
    def declared(self) -> Mapping[str, Field[Any]]:  # type: ignore[override]
        """Declarations of the keys."""
        numbers = {name: of for name, of in self.element.declared.items() if isinstance(of, Number) and of.parameter}
        return {name: Deviated(of.quantity, f"of the {of.doc.partition(';')[0]}") for name, of in numbers.items()}

    @property
    def text(self) -> str:
        return f"Standard deviations of the numbers of a table of {self.element.__name__}."

    def default_of(self, key: str) -> Any:
        return None

    def made(self, values: dict[str, Any]) -> dict[str, Deviation]:
        return values

    def schema(self) -> dict[str, Any]:
        return self.definition()


@dataclass(frozen=True)
class ElementOf(Keys[ElementTable]):
    """The table of an element, whose keys are the fields of the element."""

    element: type[Element]
    doc: str = ""
    _: KW_ONLY
    kind: str = ""
    """Value of the key `kind`; "point" is its default."""
    keys: type[KeyTable] = KeyTable
    """A table with additional or other keys."""
    without: tuple[str, ...] = ()
    """Fields of the element that are not keys."""
    defaults: Mapping[str, Any] = field(default_factory=dict)
    """Defaults of keys where they differ from those of the element."""
    name: str = ""
    """Name of its definition in the JSON Schema, by default from that of the element."""

    @property
    def title(self) -> str:
        return self.name or f"{self.element.__name__}Table"

    @property
    def text(self) -> str:
        return (self.keys if self.keys.declared and self.keys.__doc__ else self.element).__doc__ or ""

    @cached_property
    def declared(self) -> Mapping[str, Field[Any]]:  # type: ignore[override]
        """Declarations of the keys by name."""
        declared: dict[str, Field[Any]] = {"kind": Word(f'`"{self.kind}"`')} if self.kind else {}
        declared |= self.keys.declared
        for name, of in self.element.declared.items():
            if name not in ("name", *self.without, *self.keys.declared):
                declared[name] = _key(of)
        return {**declared, **({"tolerance": Tolerances(self.element)} if self.element.toleranced else {})}

    def default_of(self, key: str) -> Any:
        if key == "kind":
            return self.kind if self.kind == "point" else MISSING
        if key in self.defaults or key in self.keys.declared:
            return self.defaults.get(key, getattr(self.keys, key, MISSING))
        if key == "tolerance":
            return {}
        of = self.declared[key]
        if isinstance(of, ElementOf):
            return MISSING if MISSING in map(of.default_of, of.declared) else of.made({})
        return getattr(self.element, key, MISSING)

    def made(self, values: Mapping[str, Any]) -> ElementTable:
        every = {key: values.get(key, self.default_of(key)) for key in self.declared}
        return ElementTable(self.element, frozenset(values), every)


def _key(of: Field[Any]) -> Field[Any]:
    """Return the declaration of the key of a field that refers to other tables."""
    if isinstance(of, Member) and of.kind is Material:
        return NameOf(f"name of the {of.doc}", "materials")
    if isinstance(of, Member):
        return ElementOf(of.kind, of.doc, name=f"{of.kind.__name__}MemberTable")
    if isinstance(of, AttachedTo):
        return NameOf(of.doc, "parts", optional=True)
    return ListOf(of.doc, Real(least=0.0)) if isinstance(of, Numbers) else of


@dataclass(frozen=True, init=False)
class OneKind(Field[Any]):
    """One of several tables, selected by the key `kind`."""

    choices: tuple[TableOf[Any] | ElementOf, ...]
    doc: str = ""

    def __init__(self, *choices: TableOf[Any] | ElementOf) -> None:
        vars(self).update(choices=choices)

    @cached_property
    def by_word(self) -> dict[str, TableOf[Any] | ElementOf]:
        """The tables by the value of `kind`."""
        return {of.kind if isinstance(of, ElementOf) else of.table.declared["kind"].word: of for of in self.choices}

    def kind_of(self, element: Element) -> str | None:
        """Return the value of `kind` of an element; None if it is of none of these classes."""
        return next((word for word, of in self.by_word.items() if getattr(of, "element", None) is type(element)), None)

    def read(self, written: Any, place: Place) -> Any:
        words = self.by_word
        kind = table_of(written).get("kind", "point" if "point" in words else None)
        if kind is None:
            raise ValueError(f"has no `kind`, expected {one_of(words)}")
        if not isinstance(kind, str) or kind not in words:
            raise ValueError(f"has the kind {shown(kind)}, expected {one_of(words)}{did_you_mean(str(kind), words)}")
        return words[kind].read(written, place)

    def schema(self) -> dict[str, Any]:
        references = {word: of.schema()["$ref"] for word, of in self.by_word.items()}
        return {
            "oneOf": [{"$ref": reference} for reference in references.values()],
            "discriminator": {"propertyName": "kind", "mapping": references},
        }
