"""The values of a part, a joint or a sensor as they stand in the campaign file."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import tomlkit

from receptance.campaign.problems import Issue, KeyPath, path_text
from receptance.session.document import Document

_SECTIONS = ("parts", "joints", "modal_parts", "spindles", "attachments", "sensors")


@dataclass(frozen=True)
class FileValue:
    """A value of the file at its key."""

    path: KeyPath
    value: Any
    """As TOML has it: a text with unit, a number, a list."""

    @property
    def owner(self) -> str:
        """The table that it belongs to, such as "parts.tool"."""
        return path_text(self.path[:2])

    @property
    def key(self) -> str:
        """Its key within the owner."""
        return path_text(self.path[2:])

    @property
    def text(self) -> str:
        """The value as it is shown and typed: texts without quotes, all else as in the file."""
        return self.value if isinstance(self.value, str) else str(tomlkit.item(self.value).as_string())

    def parsed(self, text: str) -> Any:
        """Return what is typed as a value: of a text a text, else what the file would have, or the text itself."""
        if isinstance(self.value, str):
            return text
        try:
            return tomllib.loads(f"value = {text}")["value"]
        except tomllib.TOMLDecodeError:
            return text

    def mistakes(self, document: Document) -> list[Issue]:
        """Return the mistakes at its key."""
        return [issue for issue in document.mistakes if issue.path[: len(self.path)] == self.path]


def values_of(document: Document, assembly: str, element: str) -> list[FileValue]:
    """Return the values of an element of an assembly: its own, those of the assembly, its unknowns and its materials.

    Examples
    --------
    >>> import tempfile
    >>> from receptance import examples
    >>> from receptance.session.document import Document
    >>> from receptance.session.values import values_of
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = examples.write("forgotten-sensor", folder)
    ...     document = Document.open(folder)
    >>> [(value.owner, value.key, value.text) for value in values_of(document, "55 mm", "tool")][:2]
    [('parts.tool', 'segments[0].length', '40 mm'), ('parts.tool', 'segments[0].outer_diameter', '12 mm')]
    """
    try:
        contents = tomllib.loads(document.text)
    except tomllib.TOMLDecodeError:
        return []
    values = [
        FileValue(path, value)
        for section in _SECTIONS
        for path, value in _leaves((section, element), _at(contents, section, element))
    ]
    of_element = f"{element}."
    for key in ("set", "tolerance"):
        written = _at(contents, "assemblies", assembly, key)
        values += [
            FileValue(("assemblies", assembly, key, *path), value)
            for path, value in _leaves((), written)
            if str(path[0]).startswith(of_element)
        ]
    unknowns = _at(contents, "unknowns")
    for address in unknowns if isinstance(unknowns, dict) else ():
        if address.startswith(of_element):
            values += [FileValue(path, value) for path, value in _leaves(("unknowns", address), unknowns[address])]
    materials = _at(contents, "materials")
    named = dict.fromkeys(value.value for value in values if isinstance(value.value, str))
    for name in named if isinstance(materials, dict) else ():
        if name in materials:
            values += [FileValue(path, value) for path, value in _leaves(("materials", name), materials[name])]
    return values


def _at(contents: Any, *path: str) -> Any:
    """Return what is at a path of keys; an empty table where there is nothing."""
    for key in path:
        contents = contents.get(key, {}) if isinstance(contents, dict) else {}
    return contents


def _leaves(path: KeyPath, contents: Any) -> Iterator[tuple[KeyPath, Any]]:
    """Return the values below a table with their paths; lists of plain values are one value."""
    if isinstance(contents, dict):
        for key, value in contents.items():
            yield from _leaves((*path, key), value)
    elif isinstance(contents, list) and any(isinstance(item, dict) for item in contents):
        for index, item in enumerate(contents):
            yield from _leaves((*path, index), item)
    elif path:
        yield path, contents
