"""Sections of tables and sentences in which a study reports its results."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import reduce
from typing import Any, NamedTuple

__all__ = ["Section", "Table", "cell", "table"]


class Table(NamedTuple):
    """A table of texts; a column whose heading begins with < is aligned left, others are numbers."""

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]


class Section(NamedTuple):
    """A heading with its tables, then its sentences."""

    title: str
    tables: Sequence[Table]
    sentences: Sequence[str]


def table(title: str, rows: Sequence[Mapping[str, Any]], columns: Mapping[str, str]) -> Table:
    """Return a table of dictionaries.

    Parameters
    ----------
    title : str
        Title.
    rows : sequence of mappings
        One for each row.
    columns : mapping of str to str
        By heading the key of a row, with dots for inner dictionaries, and after a colon the format of a number.

    Examples
    --------
    >>> from receptance.studies.report import table
    >>> table("Joints", [{"name": "k_y", "interval": (1.0, None)}], {"joint": "name", "interval": "interval:.1f"})
    Table(title='Joints', columns=['<joint', 'interval'], rows=[['k_y', '1.0 to open']])
    """
    keys = [key.partition(":")[::2] for key in columns.values()]
    heads = [head if form else f"<{head}" for head, (_, form) in zip(columns, keys, strict=True)]
    body = [[cell(_value(row, path), form) for path, form in keys] for row in rows]
    return Table(title, heads, body)


def _value(row: Mapping[str, Any], path: str) -> Any:
    if path in row:
        return row[path]
    return reduce(lambda inner, key: inner[key], path.split("."), row)


def cell(value: Any, form: str) -> str:
    """Return a value as text; a pair is an interval, None or infinity an open end of it."""
    if isinstance(value, (list, tuple)):
        return " to ".join(cell(end, form) or "open" for end in value)
    if isinstance(value, bool):
        return "yes" if value else "no"
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    return "open" if isinstance(value, float) and math.isinf(value) else format(value, form)
