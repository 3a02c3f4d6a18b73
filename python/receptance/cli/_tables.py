"""What the printed tables share."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from rich import box
from rich.console import Console, Group
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

__all__ = ["ends", "head", "print_sentences", "table"]


def table(title: str, columns: Sequence[str], rows: Iterable[Sequence[str]]) -> Group:
    """Return a titled table whose columns are numbers; a column that begins with < is text."""
    found = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for column in columns:
        text = column.startswith("<")
        found.add_column(Text(column.removeprefix("<")), justify="left" if text else "right", no_wrap=True)
    for row in rows:
        found.add_row(*(Text(cell) for cell in row))
    return Group(Text(title, style="bold"), found)


def head(console: Console, text: str) -> None:
    """Print a heading."""
    console.rule(Text(text, style="bold"), align="left")


def print_sentences(console: Console, sentences: Iterable[str]) -> None:
    """Print findings, one paragraph each."""
    for sentence in sentences:
        console.print(Padding(Text(sentence), (0, 0, 0, 2), expand=False))
    console.print()


def ends(interval: tuple[float | None, float | None], form: str) -> str:
    """Return an interval as text; an open end is said to be open."""
    low, high = ("open" if end is None else format(end, form) for end in interval)
    return f"{low} to {high}"
