"""Mistakes in a campaign file with their places and lines; all mistakes are reported together."""

from __future__ import annotations

import functools
import json
import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from receptance._text import did_you_mean, one_of, shown
from receptance.campaign.values import AddressError, BrokenReferenceError

if TYPE_CHECKING:
    from pydantic import BaseModel

KeyPath = tuple[str | int, ...]

_BARE = re.compile(r"[A-Za-z0-9_-]+")
_TOKEN = re.compile(
    r"""[ \t\r\n]+|\#[^\n]*
    |(?P<token>[\[\]{}=,]|[^\s"'\[\]{}=,\#]+
    |\"{3}(?:[^\\]|\\.)*?"{3,5}(?!")|'{3}.*?'{3,5}(?!')|"(?:[^"\\\n]|\\.)*"|'[^'\n]*')""",
    re.DOTALL | re.VERBOSE,
)
"""Blanks and comments; brackets and signs, bare words and numbers, strings in their four forms."""


def lines_of(text: str) -> dict[KeyPath, int]:
    r"""Return the line, counted from 1, on which every table, key and list item of a valid TOML text begins.

    Parameters
    ----------
    text : str
        A text that `tomllib` can read.

    Examples
    --------
    >>> from receptance.campaign.problems import lines_of
    >>> found = lines_of('[parts.tool]\nsegments = [\n  { length = "60 mm" },\n]\n')
    >>> found["parts", "tool", "segments", 0, "length"]
    3
    """
    rest = list(reversed(_tokens(text)))
    lines: dict[KeyPath, int] = {}
    counts: dict[KeyPath, int] = {}  # of tables so far in each array of tables

    def keys(end: str) -> list[str]:
        found: list[str] = []
        while (token := rest.pop()[0]) != end:
            found += [_unquoted(token)] if token[0] in "\"'" else filter(None, token.split("."))
        return found

    def read_pair(path: KeyPath) -> None:
        line = rest[-1][1]
        for key in keys("="):
            path = (*path, key)
            lines.setdefault(path, line)
        read_value(path)

    def read_value(path: KeyPath) -> None:
        token, line = rest.pop()
        if token not in ("[", "{"):
            while rest and rest[-1][1] == line and rest[-1][0] not in (",", "]", "}"):
                rest.pop()  # a date and a time
            return
        index = 0
        while (following := rest[-1][0]) not in ("]", "}"):
            if following == ",":
                rest.pop()
            elif token == "{":
                read_pair(path)
            else:
                lines[(*path, index)] = rest[-1][1]
                read_value((*path, index))
                index += 1
        rest.pop()

    table: KeyPath = ()
    while rest:
        token, line = rest[-1]
        if token != "[":
            read_pair(table)
            continue
        rest.pop()
        several = rest[-1][0] == "["
        if several:
            rest.pop()
        *outer, last = keys("]")
        if several:
            rest.pop()
        table = ()
        for key in outer:
            table = (*table, key)
            lines.setdefault(table, line)
            if table in counts:
                table = (*table, counts[table] - 1)
        table = (*table, last)
        lines.setdefault(table, line)
        if several:
            counts[table] = counts.get(table, 0) + 1
            table = (*table, counts[table] - 1)
            lines[table] = line
    return lines


def _tokens(text: str) -> list[tuple[str, int]]:
    """Return the tokens of a TOML text with their lines."""
    found: list[tuple[str, int]] = []
    place, line = 0, 1
    while place < len(text):
        match = _TOKEN.match(text, place)
        if match is None:
            raise ValueError(f"line {line} has no value")
        if match["token"]:
            found.append((match["token"], line))
        place, line = match.end(), line + match[0].count("\n")
    return found


def line_of(path: KeyPath, lines: dict[KeyPath, int]) -> int | None:
    """Return the line of a value, or of the innermost table around it that is in the text."""
    for length in range(len(path), 0, -1):
        if path[:length] in lines:
            return lines[path[:length]]
    return None


def _unquoted(quoted: str) -> str:
    (key,) = tomllib.loads(f"{quoted} = 0")
    return key


@dataclass(frozen=True)
class Issue:
    """A mistake in a file.

    Attributes
    ----------
    path : tuple of str and int
        Keys and list indices from the top of the file.
    text : str
        Value that was found, and values that are expected.
    line : int or None
        Line of the file, counted from 1, if it is known.
    """

    path: KeyPath
    text: str
    line: int | None = None

    def __str__(self) -> str:
        where = [f"line {self.line}"] if self.line else []
        where += [path_text(self.path)] if self.path else []
        # The text is a predicate of the path, if there is one, else a sentence.
        return f"{', '.join(where)}: {self.text}" if where else self.text


class CampaignError(ValueError):
    """A campaign file has mistakes, or lacks data for an analysis.

    Parameters
    ----------
    file : path-like
        The file.
    problems : iterable of Issue
        The mistakes.

    Attributes
    ----------
    problems : tuple of Issue
        The mistakes in the order of the file.
    """

    def __init__(self, file: Path | str, problems: Iterable[Issue]) -> None:
        self.file = str(file)
        self.problems = tuple(sorted(problems, key=lambda problem: problem.line or 0))
        count = len(self.problems)
        if count == 1 and not self.problems[0].path and self.problems[0].line is None:
            super().__init__(f"{self.file}: {self.problems[0].text}")
            return
        head = f"{self.file} has {'a mistake' if count == 1 else f'{count} mistakes'}:"
        super().__init__("\n".join([head, *(f"  {problem}" for problem in self.problems)]))

    @classmethod
    def about(cls, file: Path | str, text: str) -> CampaignError:
        """Return an error about a file as a whole."""
        return cls(file, [Issue((), text)])

    def __reduce__(self) -> tuple[type[CampaignError], tuple[str, tuple[Issue, ...]]]:
        return type(self), (self.file, self.problems)


@contextmanager
def errors_about(file: Path | str, prefix: str = "") -> Iterator[None]:
    """Raise a ValueError of the library as an error about a file."""
    try:
        yield
    except CampaignError:
        raise
    except ValueError as error:
        raise CampaignError.about(file, f"{prefix}{error}") from error


class Problems:
    """Collects mistakes and finds their lines in the text of the file, which is searched at the first mistake."""

    def __init__(self, text: str = "") -> None:
        self._text = text
        self.found: list[Issue] = []
        self.templates: dict[KeyPath, KeyPath] = {}
        """Section and name of expanded tables, and of the tables of the file they come from; see `expand_series`."""
        self.incomplete: set[str] = set()
        """Sections in which some names are not known, because the series has a mistake."""

    def add(self, path: KeyPath, text: str) -> None:
        """Add a mistake, unless it was added before."""
        problem = Issue(path, text, line_of(self._in_file(path), self._lines))
        if problem not in self.found:
            self.found.append(problem)

    @cached_property
    def _lines(self) -> dict[KeyPath, int]:
        try:
            return lines_of(self._text)
        except (ValueError, IndexError, RecursionError):  # the values are known; messages then have no lines
            return {}

    def in_file(self) -> list[Issue]:
        """Return the mistakes at their places in the file; one that occurs at all levels of a series is listed once."""
        found = (Issue(self._in_file(one.path), one.text, one.line) for one in self.found)
        return list(dict.fromkeys(found))

    def _in_file(self, path: KeyPath) -> KeyPath:
        return (*self.templates.get(path[:2], path[:2]), *path[2:])

    def at(self, path: KeyPath) -> bool:
        """Return whether there is a mistake at or below a path."""
        return any(problem.path[: len(path)] == path for problem in self.found)


def path_text(path: KeyPath) -> str:
    """Return a path as text, `assemblies.short.chain[1]`.

    Examples
    --------
    >>> from receptance.campaign.problems import path_text
    >>> path_text(("unknowns", "joint.k_y", "lower"))
    'unknowns."joint.k_y".lower'
    """
    text = ""
    for step in path:
        if isinstance(step, int):
            text += f"[{step}]"
        else:
            key = step if _BARE.fullmatch(step) else json.dumps(step, ensure_ascii=False)
            text += f".{key}" if text else key
    return text


def translate(
    errors: Iterable[Mapping[str, Any]], data: Mapping[str, Any], model: type[BaseModel]
) -> dict[KeyPath, tuple[str, bool]]:
    """Return by path in the file the text of each error of pydantic, and whether only a reference is wrong."""
    details = list(errors)
    schema = _schema_of(model)
    places = [_place(error, data) for error in details]
    misspelt = {
        (*place[:-1], near)
        for error, place in zip(details, places, strict=True)
        if error["type"] == "extra_forbidden"
        and (near := _near(str(place[-1]), _known_keys(error["loc"], schema), data, place))
    }
    found: dict[KeyPath, tuple[str, bool]] = {}
    for error, place in zip(details, places, strict=True):
        if error["type"] == "missing" and place in misspelt:
            continue  # reported as a misspelt key
        if error["type"] == "literal_error" and any(place == other[: len(place)] != other for other in places):
            continue  # a table with a mistake, where a word is allowed as well
        text = _text_of(error, place, _known_keys(error["loc"], schema), data)
        found.setdefault(place, (text, isinstance(_cause(error), BrokenReferenceError)))
    return found


def _cause(error: Mapping[str, Any]) -> Any:
    """Return the exception that a validator has raised, or None."""
    return error.get("ctx", {}).get("error")


def _place(error: Mapping[str, Any], data: Any) -> KeyPath:
    """Return the place of an error as a path in the file, without members of unions and marks of keys.

    The place of a wrong address is its key, even if a value below it cannot be read without its quantity.
    """
    path: list[int | str] = []
    node: Any = data
    loc = error["loc"]
    for step in loc[:-1]:
        within = isinstance(node, list) and isinstance(step, int) and step < len(node)
        chosen = isinstance(node, Mapping) and node.get("kind") == step
        if not chosen and (within or (isinstance(node, Mapping) and step in node)):
            node = node[step]
            path.append(step)
    last = loc[-1]
    if error["type"] == "missing" or (isinstance(node, Mapping) and last in node) or isinstance(last, int):
        path.append(last)
    cause = _cause(error)
    if isinstance(cause, AddressError) and cause.address in path:
        while path[-1] != cause.address:
            path.pop()
    return tuple(path)


def _near(word: str, known: list[str], data: Any, place: KeyPath) -> str:
    """Return the known key nearest to a misspelt one, if the table does not have it."""
    table: Any = data
    for step in place[:-1]:
        table = table[step]
    match = re.search(r'"(.+?)"', did_you_mean(word, [name for name in known if name not in table]))
    return match.group(1) if match else ""


def _text_of(error: Mapping[str, Any], place: KeyPath, known: list[str], data: Any) -> str:
    kind, found = error["type"], error["input"]
    context = error.get("ctx", {})
    if kind == "value_error":
        return str(context["error"])
    if kind == "missing":
        return "is missing" if len(place) > 1 else f"is missing, expected tables such as [{place[0]}.NAME]"
    if kind == "extra_forbidden":
        if place in _REMOVED:
            return _REMOVED[place]
        near = _near(str(place[-1]), known, data, place)
        hint = f'; did you mean "{near}"?' if near else f"; expected {one_of(known)}"
        return f"is not a known key{hint}"
    if kind == "string_pattern_mismatch":
        return f"is {shown(found)}, expected one word of letters, digits and underscores"
    if kind in ("literal_error", "enum"):
        options = re.findall(r"'([^']*)'", context["expected"])
        expected = one_of(options) if options else context["expected"]
        return f"is {shown(found)}, expected {expected}{did_you_mean(str(found), options)}"
    if kind in ("union_tag_not_found", "union_tag_invalid"):
        return _text_of_kind(context)
    expected = _EXPECTED.get(kind, "")
    if kind in _LIMITS:
        expected = expected.format(context[_LIMITS[kind]])
    if kind in ("too_short", "too_long", "string_too_short"):
        expected = expected.format(context.get("min_length", context.get("max_length")))
    return f"is {shown(found)}, expected {expected or error['msg']}"


_REMOVED: dict[KeyPath, str] = {
    ("settings", "tolerances"): "was removed: errors of dimensions and materials are always fitted, with their "
    "tolerances as priors; delete this line",
}
_LIMITS = {"greater_than_equal": "ge", "greater_than": "gt", "less_than_equal": "le", "less_than": "lt"}
"""Key of the limit in the context of an error of pydantic, by its type."""
_EXPECTED = {
    "string_type": "text in quotes",
    "float_type": "a number",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "bool_type": "true or false",
    "list_type": "a list in square brackets",
    "dict_type": "a table",
    "model_type": "a table",
    "model_attributes_type": "a table",
    "greater_than_equal": "at least {}",
    "greater_than": "more than {}",
    "less_than_equal": "at most {}",
    "less_than": "less than {}",
    "too_short": "at least {}",
    "too_long": "at most {}",
    "string_too_short": "some text",
}


def _text_of_kind(context: Mapping[str, Any]) -> str:
    tags = re.findall(r"'([^']*)'", str(context.get("expected_tags", "")))
    if "tag" not in context:
        return "has no `kind`" + (f", expected {one_of(tags)}" if tags else "")
    return f"has the kind {shown(context['tag'])}, expected {one_of(tags)}{did_you_mean(str(context['tag']), tags)}"


@functools.cache
def _schema_of(model: type[BaseModel]) -> dict[str, Any]:
    return model.model_json_schema()


def _known_keys(loc: tuple[int | str, ...], schema: dict[str, Any]) -> list[str]:
    """Return the keys known in the table that holds the last step of the location of an error."""

    def resolved(node: Any) -> dict[str, Any]:
        while isinstance(node, dict):
            choices = [one for one in node.get("anyOf", ()) if one != {"type": "null"}]
            if len(choices) == 1:  # an optional table
                node = choices[0]
            elif "$ref" in node:
                node = schema["$defs"].get(node["$ref"].rsplit("/", 1)[-1], {})
            else:
                return node
        return {}

    def stepped(node: dict[str, Any], step: int | str) -> Any:
        if isinstance(step, int):
            return node.get("items", {})
        if step in node.get("properties", {}):
            return node["properties"][step]
        if step in schema["$defs"]:  # a member of a union
            return {"$ref": step}
        if "discriminator" in node:
            return {"$ref": node["discriminator"]["mapping"].get(step, "")}
        return node.get("additionalProperties") or next(iter(node.get("patternProperties", {}).values()), {})

    node = resolved(schema)
    for step in loc[:-1]:
        node = resolved(stepped(node, step))
    return list(node.get("properties", {}))
