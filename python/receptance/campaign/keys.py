"""Keys of the tables of a campaign file: reading of their values, and their JSON Schema.

A table is a class whose annotations declare its keys, like the fields of an element, or an element itself. Each
declaration reads its value. A mistake is added at the place of its value, and reading goes on, so that all mistakes of
a file are found in one pass.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, Final, Self

from receptance._text import did_you_mean, instead_of, nearest, one_of, shown
from receptance.campaign.problems import KeyPath, Problems
from receptance.campaign.values import PLAIN_NUMBER, Deviation, kind_of, parse_deviation, small_deviation
from receptance.fit.parameters import FACTORS
from receptance.model.beams import Material
from receptance.model.fields import AttachedTo, Element, Field, Key, Member, Number, Numbers, T
from receptance.model.materials import MATERIALS
from receptance.units import NUMBER, Quantity, parse

OWNERS = ("parts", "modal_parts", "spindles", "joints", "attachments", "sensors")
"""Sections whose names begin addresses."""
_SINGULAR = {
    "assemblies": "an assembly",
    "attachments": "an attachment",
    "materials": "a material",
    "parts": "a part",
    "modal_parts": "a modal part",
    "spindles": "a spindle",
}
_RARE = ("modal_parts", "spindles")
"""Sections that messages mention only if the file has them."""
WORD = r"^[^\W\d]\w*$"
"""Pattern of a name that begins addresses."""
WRONG: Final = object()
"""Result of reading a value with a mistake, which was added."""
TEXT: dict[str, Any] = {"type": "string"}
PLAIN: list[dict[str, Any]] = [TEXT, {"type": "number"}]
"""JSON Schemas of a text and of a number."""

# Places ---------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Place:
    """The place of a value in the file: its path, and the table that has it.

    `named` are all names of each section, those of tables with mistakes included. References to `broken` sections,
    which are missing or are no tables, are not checked; nor are data files without a `folder`.
    """

    problems: Problems
    named: Mapping[str, list[str]]
    broken: frozenset[str]
    folder: Path | None
    path: KeyPath = ()
    table: Mapping[str, Any] = field(default_factory=dict)

    def at(self, key: str | int, table: Mapping[str, Any] | None = None) -> Place:
        """Return the place of a key or an item."""
        return replace(self, path=(*self.path, key), table=table or {})

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
            near = nearest(key, [name for name in declared if name not in written])
            misspelt.add(near)
            hint = f'; did you mean "{near}"?' if near else f"; expected {one_of(declared)}"
            self.at(key).mistake(f"is not a known key{hint}")
        values: dict[str, Any] = dict.fromkeys(unknown, WRONG)
        for name, declaration in declared.items():
            if name in written:
                values[name] = self.at(name, written).read(declaration, written[name])
            elif name not in of.defaults:
                values[name] = WRONG
                if name not in misspelt:
                    meaning = declaration.doc.partition(";")[0]
                    if isinstance(declaration, Number):
                        meaning = f"{meaning}, such as {declaration.quantity.example}"
                    expected = f": {meaning}" if self.path else f", expected tables such as [{name}.NAME]"
                    self.at(name).mistake(f"is missing{expected}")
        return values

    def name(self, name: str, *sections: str) -> None:
        """Add a mistake if no section has the name; the table with the name is usable."""
        names = [other for section in sections for other in self.named[section]]
        if name in names or not self.broken.isdisjoint(sections):
            return
        mentioned = [one for one in sections if one not in _RARE or self.named[one]] or list(sections)
        what = " or ".join(_SINGULAR.get(section, f"a {section.removesuffix('s')}") for section in mentioned)
        near = nearest(name, list(MATERIALS)) if "materials" in sections else ""
        listed = f'; the list of materials has "{near}"' if near else ""
        self.mistake(f'is "{name}", which is not {what} of this file{instead_of(name, names)}{listed}')

    def address(self, address: str) -> None:
        """Raise if a text is not an address, or its owner is unknown."""
        kind_of(address)
        owner = address.split(".", 1)[0]
        names = [name for section in OWNERS for name in self.named[section]]
        if owner not in names and address not in FACTORS and self.broken.isdisjoint(OWNERS):
            text = f'begins with "{owner}", which is not a part, joint, attachment or sensor of this file'
            raise ValueError(text + instead_of(owner, names))


def check_word(_: Place, key: str) -> None:
    """Raise unless a key is a word."""
    if not re.search(WORD, key):
        raise ValueError(f"is {shown(key)}, expected one word of letters, digits and underscores")


def check_name(_: Place, key: str) -> None:
    """Raise for an empty key."""
    if not key:
        raise ValueError(f"is {shown(key)}, expected some text")


# Single values --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Value(Field[T]):
    """A value that a function returns from the written one and its place."""

    doc: str
    parse: Callable[[Any, Place], T]
    form: dict[str, Any] = field(default_factory=lambda: TEXT)

    def read(self, written: Any, place: Place) -> T:
        return self.parse(written, place)

    def schema(self) -> dict[str, Any]:
        return self.form


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


def text(doc: str = "") -> Field[str]:
    """Declare a text."""
    return Value(doc, lambda written, _: text_of(written))


def word(value: str) -> Field[Any]:
    """Declare the key `kind` with the value that selects the table."""
    return Value(f'`"{value}"`', lambda written, _: text_of(written), TEXT | {"const": value})


def flag(doc: str) -> Field[bool]:
    """Declare a value that is true or false."""

    def read(written: Any, _: Place) -> bool:
        if not isinstance(written, bool):
            raise ValueError(f"is {shown(written)}, expected true or false")
        return written

    return Value(doc, read, {"type": "boolean"})


def plain(
    doc: str = "",
    types: tuple[type, ...] = (str, int, float),
    expected: str = "text with a number and a unit, or a plain number",
    form: Sequence[Mapping[str, Any]] = PLAIN,
) -> Field[Any]:
    """Declare a value of one of several types, which is read where more is known: a text with a unit or a number."""

    def read(written: Any, _: Place) -> Any:
        if isinstance(written, bool) or not isinstance(written, types):
            raise ValueError(f"is {shown(written)}, expected {expected}")
        return written

    return Value(doc, read, {"anyOf": list(form)})


def one_or_list(doc: str, item: Field[T], expected: str, types: tuple[type, ...] = (str,)) -> Field[T | list[T]]:
    """Declare a value that is written as one of some types, or a list of such values."""

    def read(written: Any, place: Place) -> Any:
        if isinstance(written, bool) or not isinstance(written, (*types, list)):
            raise ValueError(f"is {shown(written)}, expected {expected}")
        return (ListOf("", item) if isinstance(written, list) else item).read(written, place)

    form = item.schema()
    return Value(doc, read, {"anyOf": [*form.get("anyOf", [form]), {"type": "array", "items": form}]})


def name_in(doc: str, *sections: str, optional: bool = False) -> Field[str]:
    """Declare a name in one of some sections of the file, or, if `optional`, an empty text."""

    def read(written: Any, place: Place) -> str:
        name = text_of(written)
        if name or not optional:
            place.name(name, *sections)
        return name

    return Value(doc, read)


def name_in_machine() -> Field[str]:
    """Declare a name in the chain of the machine of a catalogue."""

    def read(written: Any, place: Place) -> str:
        name = text_of(written)
        if name in place.named["modal_parts"]:
            place.mistake(
                f'is "{name}", a modal part, which `machine` cannot contain; expected parts and joints, or the '
                'spindle in a file of its own, [spindles.NAME], and `spindle = "NAME"`'
            )
        elif name in place.named["spindles"]:
            place.mistake(
                f'is "{name}", a measured spindle; expected parts and joints before it in `machine`, which may be '
                f'empty, and `spindle = "{name}"`'
            )
        else:
            place.name(name, "parts", "joints")
        return name

    return Value("", read)


def data_file(doc: str = "") -> Field[str]:
    """Declare the path of a data file, relative to the campaign file."""

    def read(written: Any, place: Place) -> str:
        name, folder = text_of(written), place.folder
        if folder is not None and not (file := folder / name).is_file():
            what = "is a folder" if file.is_dir() else "does not exist"
            near = [other.name for other in sorted(file.parent.iterdir())] if file.parent.is_dir() else []
            mistake = f'is "{name}", which {what}, expected a data file in {folder.resolve()}'
            place.mistake(mistake + did_you_mean(file.name, near))
        return name

    return Value(doc, read)


def spindle_file(doc: str) -> Field[str]:
    """Declare the file of a spindle, which is not there yet where `blanks` of the same table identify it."""
    present = data_file()

    def read(written: Any, place: Place) -> str:
        return text_of(written) if place.table.get("blanks") else present.read(written, place)

    return Value(doc, read)


def deviation_of(quantity: Quantity, doc: str) -> Field[Deviation]:
    """Declare the standard deviation of a quantity."""
    small = small_deviation(quantity)
    share = {"type": "string", "pattern": rf"^\s*{NUMBER}\s*(%|percent)\s*$", "examples": ["2 %"]}
    spellings = [Number(small, "").schema(), share]
    named = {
        "type": "object",
        "properties": {"value": {"anyOf": spellings}, "name": {"type": "string", "minLength": 1}},
        "required": ["value", "name"],
        "additionalProperties": False,
    }
    example = small.example if small.unit else float(small.example)
    form = {"anyOf": [*spellings, named], "examples": [example, "2 %"]}
    return Value(doc, lambda written, _: parse_deviation(written, quantity), form)


def value_of_unknown(doc: str) -> Field[float]:
    """Declare a bound or a start of an unknown, with the quantity of the address that is the name of its table."""

    def read(written: Any, place: Place) -> Any:
        moves, address = bool(place.table.get("moves")), str(place.path[-2])
        try:
            if not moves:
                place.address(address)
        except ValueError as error:
            place.mistake(str(error), up=1)
            return WRONG
        has_no_unit = moves or place.table.get("multiple") is not None
        return parse(plain().read(written, place), PLAIN_NUMBER if has_no_unit else kind_of(address))

    return Value(doc, read, {"anyOf": PLAIN})


def value_at_address() -> Field[float]:
    """Declare the value of the parameter whose address is the key."""

    def read(written: Any, place: Place) -> float:
        quantity = kind_of(str(place.path[-1]))
        return parse(plain().read(written, place), quantity)

    return Value("", read, {"anyOf": PLAIN})


def deviation_at_address() -> Field[Deviation]:
    """Declare the standard deviation of the parameter whose address is the key."""
    written = plain("", (str, int, float, dict), 'a standard deviation such as "0.1 mm" or "2 %"')

    def read(value: Any, place: Place) -> Deviation:
        quantity = kind_of(str(place.path[-1]))
        return parse_deviation(written.read(value, place), quantity)

    return Value("", read, {"anyOf": [*PLAIN, {"type": "object", "additionalProperties": {"anyOf": PLAIN}}]})


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
            else:
                values[key] = at.read(self.item, value)
        return values

    def schema(self) -> dict[str, Any]:
        if not self.pattern:
            return {"type": "object", "additionalProperties": self.item.schema()}
        names = {"patternProperties": {self.pattern: self.item.schema()}, "additionalProperties": False}
        return {"type": "object", **names}


@dataclass(frozen=True)
class NamedTables(MapOf[T]):
    """A table of the file with tables by name; those with mistakes are left out."""

    def read(self, written: Any, place: Place) -> dict[str, Any]:
        if not isinstance(written, dict):
            place.mistake(f"is {shown(written)}, expected a table")
            return {}
        return {key: value for key, value in self._values(written, place).items() if value is not WRONG}


@dataclass(frozen=True)
class Keys(Field[T]):
    """The keys of a table, and the defaults of those that are not needed."""

    doc: str
    title: str
    """Name of its definition in the JSON Schema."""
    text: str
    """Description of the table."""
    declared: Mapping[str, Field[Any]]
    defaults: Mapping[str, Any]
    made: Callable[[Mapping[str, Any]], T]
    """Returns the table from the values of the written keys."""
    element: type[Element] | None = None
    """The class of an element whose fields are the keys."""

    def read(self, written: Any, place: Place) -> Any:
        values = place.keys(self, table_of(written))
        return WRONG if WRONG in values.values() else self.made(values)

    def schema(self) -> dict[str, Any]:
        return {"$ref": f"#/$defs/{self.title}"} if self.title else self.definition()

    def definition(self) -> dict[str, Any]:
        """Return the JSON Schema of the table."""
        properties = {}
        for key, of in self.declared.items():
            schema, default = of.schema(), self.defaults.get(key)
            # Of a quantity, which is text, the default is a number in SI units.
            typed = isinstance(default, str) or schema.get("type") != "string"
            shown_default = {"default": default} if isinstance(default, (bool, int, float, str)) and typed else {}
            properties[key] = {**schema, **({} if default == "" else shown_default), "description": of.doc}
        required = [key for key in self.declared if key not in self.defaults]
        return {
            "type": "object",
            "description": self.text.strip().splitlines()[0],
            "properties": properties,
            "additionalProperties": False,
            **({"required": required} if required else {}),
        }


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

    @classmethod
    def keys(cls, doc: str = "") -> Keys[Self]:
        """Declare a key whose value is such a table."""
        defaults = {key: getattr(cls, key) for key in cls.declared if hasattr(cls, key)}
        return Keys(doc, cls.__name__, cls.__doc__ or "", cls.declared, defaults, lambda values: cls(**values))

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


class ElementTable:
    """The table of an element: the values of its keys, and which of them are `written` in the file."""

    def __init__(self, element: type[Element], written: frozenset[str], values: Mapping[str, Any]) -> None:
        self.element, self.written = element, written
        vars(self).update(values)

    def __getattr__(self, name: str) -> Any:
        raise AttributeError(f"the table of a {self.element.__name__} has no {name}")


def element_keys(
    element: type[Element],
    doc: str = "",
    *,
    kind: str = "",
    more: type[KeyTable] = KeyTable,
    without: tuple[str, ...] = (),
    defaults: Mapping[str, Any] | None = None,
    title: str = "",
) -> Keys[ElementTable]:
    """Declare the table of an element, whose keys are the fields of the element.

    `kind` is the value of its key `kind`, with the default "point". `more` has additional or other keys, `without` are
    fields that are not keys, and `defaults` those that differ from the element's.
    """
    others = more.keys()
    declared: dict[str, Field[Any]] = {"kind": word(kind)} if kind else {}
    declared |= others.declared
    every: dict[str, Any] = {"kind": "point"} if kind == "point" else {}
    every |= others.defaults
    for name, of in element.declared.items():
        if name in ("name", *without, *others.declared):
            continue
        declared[name] = key = _key(of)
        if isinstance(key, Keys):
            every |= {} if key.declared.keys() - key.defaults.keys() else {name: key.made({})}
        elif hasattr(element, name):
            every[name] = getattr(element, name)
    if element.toleranced:
        declared["tolerance"], every["tolerance"] = _tolerances(element), {}
    every |= defaults or {}
    text = (more if others.declared and more.__doc__ else element).__doc__ or ""

    def made(values: Mapping[str, Any]) -> ElementTable:
        return ElementTable(element, frozenset(values), {**every, **values})

    return Keys(doc, title or f"{element.__name__}Table", text, declared, every, made, element)


def _key(of: Field[Any]) -> Field[Any]:
    """Return the declaration of the key of a field that refers to other tables."""
    if isinstance(of, Member) and of.kind is Material:
        return name_in(f"name, in this file or in the list of materials, of the {of.doc}", "materials")
    if isinstance(of, Member):
        return element_keys(of.kind, of.doc, title=f"{of.kind.__name__}MemberTable")
    if isinstance(of, AttachedTo):
        return name_in(of.doc, "parts", optional=True)
    return ListOf(of.doc, Real(least=0.0)) if isinstance(of, Numbers) else of


def _tolerances(element: type[Element]) -> Keys[Mapping[str, Deviation]]:
    """Declare the standard deviations of the numbers of an element by name."""
    declared = {
        name: deviation_of(of.quantity, f"of the {of.doc.partition(';')[0]}")
        for name, of in element.declared.items()
        if isinstance(of, Number) and of.parameter
    }
    doc = "standard deviations of the numbers above, by the same keys"
    text = f"Standard deviations of the numbers of a table of {element.__name__}."
    return Keys(doc, "", text, declared, dict.fromkeys(declared), lambda values: values)


@dataclass(frozen=True)
class OneKind(Field[Any]):
    """One of several tables, selected by the key `kind`."""

    choices: tuple[Keys[Any], ...]
    doc: str = ""

    @cached_property
    def by_word(self) -> dict[str, Keys[Any]]:
        """The tables by the value of `kind`."""
        return {keys.declared["kind"].schema()["const"]: keys for keys in self.choices}

    def kind_of(self, element: Element) -> str | None:
        """Return the value of `kind` of an element; None if it is of none of these classes."""
        return next((word for word, keys in self.by_word.items() if keys.element is type(element)), None)

    def read(self, written: Any, place: Place) -> Any:
        words = self.by_word
        kind = table_of(written).get("kind", "point" if "point" in words else None)
        if kind is None:
            raise ValueError(f"has no `kind`, expected {one_of(words)}")
        if not isinstance(kind, str) or kind not in words:
            raise ValueError(f"has the kind {shown(kind)}, expected {one_of(words)}{did_you_mean(str(kind), words)}")
        return words[kind].read(written, place)

    def schema(self) -> dict[str, Any]:
        references = {word: keys.schema()["$ref"] for word, keys in self.by_word.items()}
        return {
            "oneOf": [{"$ref": reference} for reference in references.values()],
            "discriminator": {"propertyName": "kind", "mapping": references},
        }
