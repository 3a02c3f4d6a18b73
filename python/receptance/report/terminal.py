"""Results on a terminal and as plain text.

Numbers in tables are never cut. If a table is wider than the terminal, headings and columns of text are wrapped; if
that is not sufficient, the table is split into parts, each with the columns that identify the rows.
"""

from __future__ import annotations

import io
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import rich.table
from rich import box
from rich.cells import cell_len
from rich.console import Console
from rich.padding import Padding
from rich.text import Text

from receptance._text import printable
from receptance.report.table import REJECTED, Fact

if TYPE_CHECKING:
    from rich.console import ConsoleOptions, RenderResult

    from receptance.report.result import Renderable
    from receptance.report.table import Table

LEAST_WIDTH = 40
"""Smallest width in characters that fits every interval with its name."""
_COPIED = 4
"""Indentation of lines to copy."""
_LEAST_TEXT = 8
"""Smallest width of a text column whose words are broken."""


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
    print_list(console, REJECTED, content.rejection)
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
    console.print(_Columns(table))
    if table.note:
        console.print(Padding(Text(table.note), (0, 0, 1, 2), expand=False))


class _Columns:
    """A table that fits the width of the console without cutting a cell."""

    def __init__(self, table: Table) -> None:
        self._text = [isinstance(column, str) for column in table.columns]
        self._heads = table.headings
        # Before the layout: an escaped character takes more room.
        self._rows = rows = [[printable(text) for text in row] for row in table.texts()]
        cells = [[row[i] for row in rows] for i in range(len(self._heads))]
        self._natural = [_widest([head, *own]) for head, own in zip(self._heads, cells, strict=True)]
        # Headings and text may wrap between words; numbers and intervals stay on one line.
        self._least = [
            max(_longest_word([head, *own]) if text else max(_longest_word([head]), _widest(own)), 1)
            for head, own, text in zip(self._heads, cells, self._text, strict=True)
        ]

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        for chosen in self._parts(options.max_width):
            yield self._part(chosen, options.max_width)

    def _parts(self, width: int) -> list[list[int]]:
        """Return the columns of each part."""
        everything = list(range(len(self._heads)))
        if self._needed(everything) <= width:
            return [everything]
        named_by = everything[: self._naming()]
        while len(named_by) > 1 and any(
            self._needed([*named_by, i], fold=True) > width for i in everything[len(named_by) :]
        ):
            named_by.pop()
        parts: list[list[int]] = []
        for i in everything[len(named_by) :]:
            if parts and self._needed([*parts[-1], i]) <= width:
                parts[-1].append(i)
            else:
                parts.append([*named_by, i])
        return parts

    def _naming(self) -> int:
        """Return the number of first columns that identify the rows; an empty first cell repeats the one above."""
        rows: list[tuple[str, ...]] = []
        first = ""
        for row in self._rows:
            first = row[0] or first
            rows.append((first, *row[1:]))
        for count in range(1, len(self._heads)):
            if len({row[:count] for row in rows}) == len(rows):
                return count
        return 1

    def _needed(self, chosen: Sequence[int], *, fold: bool = False) -> int:
        """Return the smallest width of a table of some columns; with `fold`, words of text columns may be broken."""
        least = [min(self._least[i], _LEAST_TEXT) if fold and self._text[i] else self._least[i] for i in chosen]
        return sum(least) + _beside(len(chosen))

    def _part(self, chosen: Sequence[int], width: int) -> rich.table.Table:
        room = width - _beside(len(chosen))
        widths = {i: self._natural[i] for i in chosen}
        # The widest column is narrowed first; words are broken only if that is not sufficient.
        for least in (
            self._least,
            [min(n, _LEAST_TEXT) if t else n for n, t in zip(self._least, self._text, strict=True)],
        ):
            while sum(widths.values()) > room and (wider := [i for i in chosen if widths[i] > least[i]]):
                widths[max(wider, key=lambda i: widths[i])] -= 1
        found = rich.table.Table(box=box.SIMPLE_HEAD, pad_edge=False)
        for i in chosen:
            found.add_column(
                Text(self._heads[i]),
                justify="left" if self._text[i] else "right",
                overflow="fold",
                width=widths[i],
            )
        for row in self._rows:
            found.add_row(*(Text(row[i]) for i in chosen))
        return found


def _beside(count: int) -> int:
    """Return the width of edges, padding and separators of a table."""
    return 3 * count - 1


def _widest(texts: Iterable[str]) -> int:
    return max((cell_len(line) for text in texts for line in text.split("\n")), default=0)


def _longest_word(texts: Iterable[str]) -> int:
    return max((cell_len(word) for text in texts for word in text.split()), default=0)
