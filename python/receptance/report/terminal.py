"""Results on a terminal and as plain text.

Numbers in tables are never cut. If a table is wider than the terminal, headings and columns of text are wrapped; if
that is not sufficient, the table is split into parts, each with the columns that identify the rows.
"""

from __future__ import annotations

import io
import textwrap
from collections.abc import Iterable, Iterator, Sequence
from typing import Literal

import rich.table
from rich import box
from rich.cells import cell_len
from rich.console import Console
from rich.padding import Padding
from rich.text import Text

from receptance._text import printable
from receptance.report.result import Renderable
from receptance.report.table import Fact, Table

LEAST_WIDTH = 40
"""Smallest width in characters that fits every interval with its name."""
_COPIED = 4
"""Indentation of lines to copy."""
_LEAST_TEXT = 8
"""Smallest width of a text column whose words are broken."""
_BESIDE = 3
"""Width of padding and separator beside a column."""


def as_text(content: Renderable, width: int = 100) -> str:
    """Return a result or another renderable as plain text with tables of at most `width` characters."""
    buffer = io.StringIO()
    # Otherwise rich would show the text below the cell of a notebook instead of writing it.
    console = Console(
        file=buffer,
        width=max(width, LEAST_WIDTH),
        color_system=None,
        highlight=False,
        markup=False,
        force_jupyter=False,
    )
    print_result(console, content)
    return "\n".join(printable(line).rstrip() for line in buffer.getvalue().split("\n")).rstrip()


def print_result(console: Console, content: Renderable, measured: Sequence[Table] = ()) -> None:
    """Print rejection, warnings, findings, tables, next step and notes; of a campaign also data, seed and versions."""
    print_title(console, content.title)
    for heading, reasons in content.rejection.headed():
        print_list(console, heading, reasons)
    if content.description:
        print_sentences(console, [content.description])
    # Above the numbers, which a reader should not use before.
    print_list(console, "Advice", content.warnings())
    for table in measured:
        print_table(console, table)
    print_facts(console, content.facts())
    print_sentences(console, content.sentences())
    for table in content.tables():
        print_table(console, table)
    if content.next_step:
        print_facts(console, [Fact("Next step", (content.next_step,))])
    print_list(console, "Notes", list(content.grouped_notes()))
    if content.origin:
        console.print(Text(content.origin))


def print_list(console: Console, title: str, texts: Sequence[str]) -> None:
    """Print texts as a list with a title; nothing if there are none. Leading spaces add to the indentation."""
    if texts:
        console.print(Text(title, style="bold"))
        for text in texts:
            indent = len(text) - len(text.lstrip(" "))
            grid = rich.table.Table.grid(padding=(0, 1, 0, 0))
            grid.add_column(width=1)
            grid.add_column(overflow="fold")
            grid.add_row(Text("-"), Text(text.lstrip(" ")))
            console.print(Padding(grid, (0, 0, 0, 2 + indent), expand=False))
        console.print()


def print_facts(console: Console, facts: Sequence[Fact]) -> None:
    """Print findings: labels in one column, texts in another, and below them lines to copy, which are not wrapped."""
    width = max((cell_len(fact.label) for fact in facts), default=0)
    for fact in facts:
        grid = rich.table.Table.grid(padding=(0, 2, 0, 0))
        grid.add_column(width=width)
        grid.add_column(overflow="fold")
        for number, text in enumerate(fact.texts):
            grid.add_row(Text("" if number else fact.label, style="bold"), Text(text))
        console.print(grid)
        for line in fact.lines:
            console.print(Text(f"{'':{_COPIED}}{line}"), soft_wrap=True)
    if facts:
        console.print()


def print_title(console: Console, text: str) -> None:
    """Print a heading."""
    if cell_len(text) + 4 > console.width:
        console.print(Text(text, style="bold"))  # a rule would cut the title
    else:
        console.rule(Text(text, style="bold"), align="left")


def print_sentences(console: Console, sentences: Iterable[str]) -> None:
    """Print sentences, a paragraph each; leading spaces add to the indentation."""
    printed = False
    for sentence in sentences:
        indent = len(sentence) - len(sentence.lstrip(" "))
        console.print(Padding(Text(sentence.lstrip(" ")), (0, 0, 0, 2 + indent), expand=False))
        printed = True
    if printed:
        console.print()


def print_table(console: Console, table: Table) -> None:
    """Print a table with its title and its note."""
    if table.title:
        console.print(Text(table.title, style="bold"))
    for part in _parts(table, console.width):
        console.print(part)
    if table.note:
        console.print(Padding(Text(table.note), (0, 0, 1, 2), expand=False))


def _parts(table: Table, width: int, *, is_stacked: bool = False) -> Iterator[rich.table.Table]:
    """Yield the table, or parts of it that fit the width, each with the columns that identify the rows.

    A table that is too wide has its intervals below their values, if it fits then.
    """
    # Before the layout: an escaped character takes more room.
    heads, rows = table.headings, [[printable(text) for text in row] for row in table.texts()]
    texts = [isinstance(column, str) for column in table.columns]
    every = range(len(heads))
    natural = [_widest([heads[i], *(row[i] for row in rows)]) for i in every]
    # Headings and text may wrap between words; numbers and intervals stay on one line.
    words = [_widest(" ".join([heads[i], *(row[i] for row in rows if texts[i])]).split()) for i in every]
    least = [max(words[i], 0 if texts[i] else _widest([row[i] for row in rows]), 1) for i in every]
    broken = [min(least[i], _LEAST_TEXT) if texts[i] else least[i] for i in every]

    def fits(columns: Sequence[int], widths: Sequence[int]) -> bool:
        return sum(widths[i] for i in columns) + _BESIDE * len(columns) - 1 <= width

    def part(columns: Sequence[int]) -> rich.table.Table:
        grid = rich.table.Table(box=box.SIMPLE_HEAD, pad_edge=False)
        wide, whole = not fits(columns, natural), fits(columns, least)
        for i in columns:
            head = heads[i] if texts[i] or not wide else "\n".join(_wrapped(heads[i], least[i]))
            # Rich narrows the widest columns that may wrap, and breaks words where that is not sufficient.
            fixed = not texts[i] or (whole and natural[i] == least[i])
            justify: Literal["left", "right"] = "left" if texts[i] else "right"
            grid.add_column(Text(head), justify=justify, overflow="fold", no_wrap=fixed)
        for row in rows:
            grid.add_row(*(Text(row[i]) for i in columns))
        return grid

    if fits(every, least) or (is_stacked and fits(every, broken)):
        yield part(every)
        return
    stacked = table.stacked()
    if len(stacked.columns) < len(every):
        narrow = list(_parts(stacked, width, is_stacked=True))
        if len(narrow) == 1:
            yield from narrow
            return
    named_by = list(every[: _naming(rows)])
    while len(named_by) > 1 and not all(fits([*named_by, i], broken) for i in every[len(named_by) :]):
        named_by.pop()
    columns: list[int] = []
    for i in every[len(named_by) :]:
        if columns and not fits([*columns, i], least):
            yield part(columns)
            columns = []
        columns = [*(columns or named_by), i]
    yield part(columns or named_by)


def _naming(rows: Sequence[Sequence[str]]) -> int:
    """Return the number of first columns that identify the rows; an empty first cell repeats the one above."""
    named, first = [], ""
    for row in rows:
        first = row[0] or first
        named.append((first, *row[1:]))
    columns = range(1, len(rows[0]) if rows else 1)
    return next((count for count in columns if len({row[:count] for row in named}) == len(rows)), 1)


def _wrapped(heading: str, width: int) -> list[str]:
    return [line for part in heading.split("\n") for line in textwrap.wrap(part, width)]


def _widest(texts: Iterable[str]) -> int:
    return max((cell_len(line) for text in texts for line in text.split("\n")), default=0)
