"""What the printed tables share."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from rich import box
from rich.cells import cell_len
from rich.console import Console, Group
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

if TYPE_CHECKING:
    from rich.console import ConsoleOptions, RenderResult

__all__ = ["ends", "head", "print_sentences", "table"]

_LEAST_TEXT = 8
"""Characters that a text column keeps where its words have to be broken."""


def table(title: str, columns: Sequence[str], rows: Iterable[Sequence[str]]) -> Group:
    """Return a titled table whose columns are numbers; a column that begins with < is text.

    Numbers are never cut. Where the table is wider than the console, headings and text columns are wrapped; where that
    is not enough the table is printed in parts, each with the columns that name the rows.
    """
    return Group(Text(title, style="bold"), _Columns(columns, [list(row) for row in rows]))


class _Columns:
    """A table that fits the width of the console without cutting a cell."""

    def __init__(self, columns: Sequence[str], rows: list[list[str]]) -> None:
        self._text = [column.startswith("<") for column in columns]
        self._heads = [column.removeprefix("<") for column in columns]
        self._rows = rows
        cells = [[row[i] for row in rows] for i in range(len(columns))]
        self._natural = [_widest([head, *own]) for head, own in zip(self._heads, cells, strict=True)]
        # A heading may wrap between words, and so may text. A number may not, and an interval stays on one line.
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
        """Return how many of the first columns tell the rows apart; an empty first cell repeats the one above it."""
        seen: list[tuple[str, ...]] = []
        first = ""
        for row in self._rows:
            first = row[0] or first
            seen.append((first, *row[1:]))
        count = 1
        while count < len(self._heads) - 1 and len({row[:count] for row in seen}) < len(seen):
            count += 1
        return count if len({row[:count] for row in seen}) == len(seen) else 1

    def _needed(self, chosen: Sequence[int], *, fold: bool = False) -> int:
        """Return the least width of a table of some columns, with words of text columns broken or not."""
        least = [min(self._least[i], _LEAST_TEXT) if fold and self._text[i] else self._least[i] for i in chosen]
        return sum(least) + _beside(len(chosen))

    def _part(self, chosen: Sequence[int], width: int) -> Table:
        room = width - _beside(len(chosen))
        widths = {i: self._natural[i] for i in chosen}
        # The widest column gives way first; words are broken only where nothing else is left.
        for least in (
            self._least,
            [min(n, _LEAST_TEXT) if t else n for n, t in zip(self._least, self._text, strict=True)],
        ):
            while sum(widths.values()) > room and (wider := [i for i in chosen if widths[i] > least[i]]):
                widths[max(wider, key=lambda i: widths[i])] -= 1
        found = Table(box=box.SIMPLE_HEAD, pad_edge=False)
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
    """Return how many characters a table of some columns has besides their widths: edges, padding, separators."""
    return 3 * count - 1


def _widest(texts: Iterable[str]) -> int:
    return max((cell_len(line) for text in texts for line in text.split("\n")), default=0)


def _longest_word(texts: Iterable[str]) -> int:
    return max((cell_len(word) for text in texts for word in text.split()), default=0)


def head(console: Console, text: str) -> None:
    """Print a heading."""
    if cell_len(text) + 4 > console.width:
        console.print(Text(text, style="bold"))  # a rule would cut it
    else:
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
