"""Tables and findings of results, and the rounding of their numbers."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

Interval: TypeAlias = tuple[float | None, float | None]
Cell: TypeAlias = str | float | Interval | None
"""Text, a number, a Boolean, an interval, or None for an empty cell."""


def number(value: float, form: str = ".4g") -> str:
    """Return a number as text; an infinite one is "not determined", NaN is empty.

    Examples
    --------
    >>> from receptance.report.table import number
    >>> number(416234.0), number(float("inf")), number(1.5, "+.2f"), number(-0.001, "+.2f")
    ('4.162e+05', 'not determined', '+1.50', '0.00')
    """
    if math.isnan(value):
        return ""
    return _without_sign_of_zero(format(value, form)) if math.isfinite(value) else "not determined"


def _without_sign_of_zero(text: str) -> str:
    """Return a number as text without the sign of one that is rounded to zero."""
    return text if _NOT_ZERO.search(text) else text.lstrip("+-")


def interval(ends: Interval, form: str = ".4g") -> str:
    """Return an interval as text; an end that is None or not finite is open.

    Examples
    --------
    >>> from receptance.report.table import interval
    >>> interval((98e3, 102e3)), interval((4e7, None)), interval((None, 2.0)), interval((None, None))
    ('9.8e+04 to 1.02e+05', 'above 4e+07', 'below 2', 'open')
    """
    low, high = (None if end is None or not math.isfinite(end) else number(end, form) for end in ends)
    if low is None:
        return "open" if high is None else f"below {high}"
    return f"above {low}" if high is None else f"{low} to {high}"


_SMALLER = {
    "kg": ((1.0, 1.0, "kg"), (1e-5, 1e-3, "g"), (0.0, 1e-6, "mg")),
    "m": ((1.0, 1.0, "m"), (1e-4, 1e-3, "mm"), (0.0, 1e-6, "µm")),
    "s": ((1.0, 1.0, "s"), (1e-4, 1e-3, "ms"), (0.0, 1e-6, "µs")),
}
"""Units of small amounts by SI unit: smallest amount, scale and name."""
_PLAIN = (1e-3, 1e5)
"""Magnitudes that are written without a power of ten."""
_LEAST_SHARE = 1e-5
"""Smaller shares are not written in percent: no measurement is as accurate."""
_LEAST_BESIDE = 1e-6
"""Smaller magnitudes have a power of ten beside larger numbers that have none."""
_NOT_ZERO = re.compile("^[^e]*[1-9]")


def amounts(values: Sequence[float], unit: str = "", digits: int = 3) -> tuple[list[str], str]:
    """Return numbers in an SI unit as text in one unit, and this unit.

    Small masses, lengths and times get a smaller unit. `digits` are the significant digits of the largest number; the
    others have as many decimals.

    Examples
    --------
    >>> from receptance.report.table import amounts
    >>> amounts([1.99e-3, 1.5e-3], "kg"), amounts([2.4e8], "N/m"), amounts([0.3, 4.0, 12.0])
    ((['1.99', '1.50'], 'g'), (['2.40e8'], 'N/m'), (['0.3', '4.0', '12.0'], ''))
    """
    # Rounded, because 0.9999e-3 kg with two digits is 1.0 g.
    largest = max((abs(_rounded(value, digits)) for value in values if math.isfinite(value)), default=0.0)
    choices = _SMALLER.get(unit, ((0.0, 1.0, unit),)) if largest else ((0.0, 1.0, unit),)
    scale, shown = next((size, name) for least, size, name in choices if largest >= least)
    power = bool(largest) and not _PLAIN[0] <= largest / scale < _PLAIN[1]
    decimals = 0 if power else max(digits - 1 - _exponent(largest / scale), 0)

    def text(value: float) -> str:
        if not math.isfinite(value):
            return "not determined"
        number = value / scale
        if number and (power or abs(number) < _LEAST_BESIDE):
            mantissa, exponent = f"{number:.{digits - 1}e}".split("e")
            return f"{mantissa}e{int(exponent)}"
        # Beside a much larger number a small one keeps its own digits.
        size = max(digits - 1 - _exponent(number), 0) if abs(number) < 10.0**-decimals else decimals
        return _without_sign_of_zero(f"{number:.{size if number else decimals}f}")

    return [text(value) for value in values], shown


def _rounded(value: float, digits: int) -> float:
    return float(f"{value:.{digits - 1}e}")


def _exponent(value: float) -> int:
    """Return the power of ten of the first digit."""
    return math.floor(math.log10(abs(value)) + 1e-9) if value else 0


def amount(value: float, unit: str = "", digits: int = 3) -> str:
    """Return a number with its unit as text; see `amounts`.

    Examples
    --------
    >>> from receptance.report.table import amount
    >>> amount(1.99e-3, "kg"), amount(2.4e8, "N/m"), amount(0.0123, "N m s/rad"), amount(float("inf"), "N")
    ('1.99 g', '2.40e8 N/m', '0.0123 N m s/rad', 'not determined')
    """
    (text,), shown = amounts([value], unit, digits)
    return f"{text} {shown}" if shown and math.isfinite(value) else text


def percent(share: float, digits: int = 2, *, sign: bool = False) -> str:
    """Return a share in percent as text, with its sign on request; what is too small to matter is not written out.

    Examples
    --------
    >>> from receptance.report.table import percent
    >>> percent(0.02), percent(0.996), percent(2.2e-6), percent(0.163, 3, sign=True), percent(float("inf"))
    ('2 %', '100 %', '< 0.001 %', '+16.3 %', 'not determined')
    """
    if 0.0 < abs(share) < _LEAST_SHARE:
        return f"< {100.0 * _LEAST_SHARE:g} %"
    value = 100.0 * share
    text = number(value, f"{'+' if sign else ''}.{digits}g")
    if "e" in text:  # 100 has more digits than two
        text = f"{'+' if sign and value > 0.0 else ''}{amount(value, digits=digits)}"
    return f"{text} %" if math.isfinite(value) else text


def amount_interval(ends: Interval, unit: str = "", digits: int = 4) -> str:
    """Return an interval with its unit as text; an end that is None or not finite is open.

    Examples
    --------
    >>> from receptance.report.table import amount_interval
    >>> amount_interval((4.138e8, 4.237e8), "N/m"), amount_interval((None, 2e-3), "kg", 2)
    ('4.138e8 to 4.237e8 N/m', 'below 2.0 g')
    """
    low, high = (None if end is None or not math.isfinite(end) else end for end in ends)
    texts, shown = amounts([end for end in (low, high) if end is not None], unit, digits)
    if not texts:
        return "open"
    prefix = "" if len(texts) == 2 else "below " if low is None else "above "
    return f"{prefix}{' to '.join(texts)}{' ' + shown if shown else ''}"


@dataclass(frozen=True)
class Column:
    """A column of numbers."""

    name: str
    """Heading."""
    unit: str = ""
    """Unit of its numbers, shown in brackets below the heading; empty without a unit or with several."""
    form: str = ".4g"
    """Format specification of its numbers for `format`."""

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
    """A table of a result; its numbers are rounded when it is rendered. All rows have a cell for each column.

    Examples
    --------
    >>> from receptance.report import Column, Table
    >>> table = Table("Joints", ("parameter", Column("value", "N/m")), [("joint.k_y", 4.2e8)])
    >>> table.texts()
    [['joint.k_y', '4.2e+08']]
    """

    title: str
    """Heading."""
    columns: Sequence[Column | str]
    """A string is the heading of a column of text."""
    rows: Sequence[Sequence[Cell]]
    """A cell for each column: text, a number, a Boolean, an interval `(low, high)` or None."""
    note: str = ""
    """Sentence below the table."""

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

    def stacked(self) -> Table:
        r"""Return the table with intervals below the values to the left of them, which takes less width.

        Examples
        --------
        >>> from receptance.report import Column, Table
        >>> columns = ("tool", Column("frequency", "Hz", ".0f"), Column("interval", form=".0f"))
        >>> Table("Modes", columns, [("T1", 694.0, (690.0, 697.0))]).stacked().texts()
        [['T1', '694\n690 to 697']]
        """
        below = {
            i
            for i in range(1, len(self.columns))
            if any(isinstance(row[i], tuple) for row in self.rows)
            and not isinstance(self.columns[i - 1], str)
            and not any(isinstance(row[i - 1], tuple) for row in self.rows)
        }
        columns: list[Column | str] = []
        for i, heading in enumerate(self.headings):
            if i not in below:
                columns.append(self.columns[i])
            elif isinstance(value := columns[-1], Column):
                columns[-1] = Column(f"{value.heading}\n{heading}")
        rows = []
        for row, texts in zip(self.rows, self.texts(), strict=True):
            cells: list[Cell] = []
            for i, text in enumerate(texts):
                if i in below:
                    cells[-1] = f"{texts[i - 1]}\n{text}".rstrip("\n")
                else:
                    cells.append(row[i])
            rows.append(cells)
        return Table(self.title, columns, rows, self.note)

    def without_empty(self) -> Table:
        """Return the table without columns that are empty in all rows."""
        kept = [i for i in range(len(self.columns)) if any(row[i] not in (None, "") for row in self.rows)]
        columns = [self.columns[i] for i in kept]
        return Table(self.title, columns, [[row[i] for i in kept] for row in self.rows], self.note)


def joined(tables: Iterable[Table]) -> list[Table]:
    """Return tables after joining the rows of those with the same title and columns."""
    by_heading: dict[tuple[object, ...], Table] = {}
    for table in tables:
        key = (table.title, *table.columns)
        before = by_heading.get(key)
        rows = table.rows if before is None else [*before.rows, *table.rows]
        by_heading[key] = Table(table.title, table.columns, rows, table.note)
    return list(by_heading.values())


@dataclass(frozen=True)
class Fact:
    """A finding with a label, such as the verdict of a diagnosis."""

    label: str
    """One or two words."""
    texts: tuple[str, ...]
    """Sentences, a paragraph each."""
    lines: tuple[str, ...] = ()
    """Lines to copy into a file, which are shown as they are."""
