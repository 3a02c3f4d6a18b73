"""Tables of the studies: cells are texts, and a column whose heading begins with < is one of text."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from receptance.report import Column, Table
from receptance.report.table import interval as ends
from receptance.report.terminal import print_sentences, rendered
from receptance.report.terminal import print_title as head

if TYPE_CHECKING:
    from rich.console import Group

__all__ = ["ends", "head", "print_sentences", "table"]


def table(title: str, columns: Sequence[str], rows: Iterable[Sequence[str]]) -> Group:
    """Return a table to print."""
    kinds = [name.removeprefix("<") if name.startswith("<") else Column(name) for name in columns]
    return rendered(Table(title, kinds, list(rows)))
