"""Sections of tables and sentences in which a study reports its results."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

__all__ = ["Section", "Table", "interval_text"]


class Table(NamedTuple):
    """A table of texts; a column whose heading begins with < is aligned left, others are numbers."""

    title: str
    columns: Sequence[str]
    rows: Iterable[Sequence[str]]


class Section(NamedTuple):
    """A heading with its tables, then its sentences."""

    title: str
    tables: Sequence[Table]
    sentences: Sequence[str]


def interval_text(interval: Sequence[float | None], form: str) -> str:
    """Return an interval as text; an end that is None is open."""
    low, high = ("open" if end is None else format(end, form) for end in interval)
    return f"{low} to {high}"
