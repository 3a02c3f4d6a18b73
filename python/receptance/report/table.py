"""Tables of results, and the rounding of their numbers."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

__all__ = ["Cell", "Column", "Table", "interval", "joined", "number"]

Interval: TypeAlias = tuple[float | None, float | None]
Cell: TypeAlias = str | float | Interval | None
"""Text, a number, a Boolean, an interval, or None for an empty cell."""


def number(value: float, form: str = ".4g") -> str:
    """Return a number as text; an infinite one is "not determined", NaN is empty.

    Examples
    --------
    >>> from receptance.report.table import number
    >>> number(416234.0), number(float("inf")), number(1.5, "+.2f")
    ('4.162e+05', 'not determined', '+1.50')
    """
    if math.isnan(value):
        return ""
    return format(value, form) if math.isfinite(value) else "not determined"


def interval(ends: Interval, form: str = ".4g") -> str:
    """Return an interval as text; an end that is None or infinite is open.

    Examples
    --------
    >>> from receptance.report.table import interval
    >>> interval((98e3, 102e3)), interval((4e7, None)), interval((None, 2.0)), interval((None, None))
    ('9.8e+04 to 1.02e+05', 'above 4e+07', 'below 2', 'open')
    """
    low, high = (None if end is None or math.isinf(end) else format(end, form) for end in ends)
    if low is None:
        return "open" if high is None else f"below {high}"
    return f"above {low}" if high is None else f"{low} to {high}"


@dataclass(frozen=True)
class Column:
    """A column of numbers.

    Attributes
    ----------
    name : str
        Heading.
    unit : str
        Unit of its numbers, shown in brackets below the heading; empty without a unit or with several.
    form : str
        Format specification of its numbers for `format`.
    """

    name: str
    unit: str = ""
    form: str = ".4g"

    @property
    def heading(self) -> str:
        """Name and unit."""
        return f"{self.name}\n[{self.unit}]" if self.unit else self.name

    def text(self, cell: Cell) -> str:
        """Return a cell as text."""
        if cell is None:
            return ""
        if isinstance(cell, str):
            return cell
        if isinstance(cell, tuple):
            return interval(cell, self.form)
        if cell is True or cell is False:
            return "yes" if cell else "no"
        return number(float(cell), self.form) if "d" not in self.form else format(cell, self.form)


@dataclass(frozen=True)
class Table:
    """A table of a result; its numbers are rounded when it is rendered.

    Attributes
    ----------
    title : str
        Heading.
    columns : sequence of Column and str
        A string is the heading of a column of text.
    rows : sequence of sequences
        A cell for each column: text, a number, a Boolean, an interval `(low, high)` or None.
    note : str
        Sentence below the table.

    Raises
    ------
    ValueError
        A row with more or fewer cells than there are columns.

    Examples
    --------
    >>> from receptance.report import Column, Table
    >>> table = Table("Joints", ("parameter", Column("value", "N/m")), [("joint.k_y", 4.2e8)])
    >>> table.texts()
    [['joint.k_y', '4.2e+08']]
    """

    title: str
    columns: Sequence[Column | str]
    rows: Sequence[Sequence[Cell]]
    note: str = ""

    def __post_init__(self) -> None:
        for row in self.rows:
            if len(row) != len(self.columns):
                raise ValueError(f"table {self.title!r}: a row has {len(row)} cells, expected {len(self.columns)}")

    @property
    def headings(self) -> list[str]:
        """Headings of the columns, with units."""
        return [column if isinstance(column, str) else column.heading for column in self.columns]

    def texts(self) -> list[list[str]]:
        """Return the cells as text."""
        columns = [Column(column) if isinstance(column, str) else column for column in self.columns]
        return [[column.text(cell) for column, cell in zip(columns, row, strict=True)] for row in self.rows]

    def without_empty(self) -> Table:
        """Return the table without columns that are empty in all rows."""
        kept = [i for i in range(len(self.columns)) if any(row[i] not in (None, "") for row in self.rows)]
        columns = [self.columns[i] for i in kept]
        return Table(self.title, columns, [[row[i] for i in kept] for row in self.rows], self.note)


def joined(tables: Iterable[Table]) -> list[Table]:
    """Return tables after joining the rows of those with the same title and columns."""
    found: dict[tuple[object, ...], Table] = {}
    for one in tables:
        key = (one.title, *one.columns)
        before = found.get(key)
        rows = one.rows if before is None else [*before.rows, *one.rows]
        found[key] = Table(one.title, one.columns, rows, one.note)
    return list(found.values())
