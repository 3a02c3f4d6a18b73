"""Mistakes in a campaign file with their places and lines; all mistakes are reported together."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

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
    """A mistake in a file."""

    path: KeyPath
    """Keys and list indices from the top of the file."""
    text: str
    """Value that was found, and values that are expected."""
    line: int | None = None
    """Line of the file, counted from 1, if it is known."""
    file: str = ""
    """The file, in an error about several of them."""

    def __str__(self) -> str:
        where = [self.file] if self.file else []
        where += [f"line {self.line}"] if self.line else []
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
        self.problems = tuple(sorted(problems, key=lambda problem: (problem.file, problem.line or 0)))
        count = len(self.problems)
        if count == 1 and not self.problems[0].path and self.problems[0].line is None:
            super().__init__(f"{self.file}: {self.problems[0].text}")
            return
        verb = "have" if any(problem.file for problem in self.problems) else "has"
        head = f"{self.file} {verb} {'a mistake' if count == 1 else f'{count} mistakes'}:"
        super().__init__("\n".join([head, *(f"  {problem}" for problem in self.problems)]))

    @classmethod
    def about(cls, file: Path | str, text: str) -> CampaignError:
        """Return an error about a file as a whole."""
        return cls(file, [Issue((), text)])

    @classmethod
    def of_files(cls, errors: Sequence[CampaignError]) -> CampaignError:
        """Return one error with the mistakes of several files."""
        problems = [replace(problem, file=error.file) for error in errors for problem in error.problems]
        return errors[0] if len(errors) == 1 else cls(" and ".join(error.file for error in errors), problems)

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
