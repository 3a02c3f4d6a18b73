"""Sections of tables and sentences in which a study reports its results."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import reduce
from typing import Any, NamedTuple

from receptance.report import Column, Table


class ReportSection(NamedTuple):
    """A heading with its tables, then its sentences."""

    title: str
    tables: Sequence[Table]
    sentences: Sequence[str]


def table(title: str, rows: Sequence[Mapping[str, Any]], columns: Mapping[str, str]) -> Table:
    """Return a table of dictionaries.

    By heading, `columns` has the key of a row, with dots for inner dictionaries, and after a colon the format of a
    number. A column without a format is text; a list or a tuple in a row is an interval.

    Examples
    --------
    >>> from receptance.studies.report import table
    >>> rows = [{"name": "k_y", "interval": (1.0, None)}]
    >>> table("Joints", rows, {"joint": "name", "interval": "interval:.1f"}).texts()
    [['k_y', 'above 1.0']]
    """
    keys = [key.partition(":")[::2] for key in columns.values()]
    heads = [Column(head, form=form) if form else head for head, (_, form) in zip(columns, keys, strict=True)]
    return Table(title, heads, [[_cell(row, path) for path, _ in keys] for row in rows])


def _cell(row: Mapping[str, Any], path: str) -> Any:
    value = row[path] if path in row else reduce(lambda inner, key: inner[key], path.split("."), row)
    return tuple(value) if isinstance(value, list) else value
