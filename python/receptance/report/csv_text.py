"""Tables as CSV."""

from __future__ import annotations

import csv
import io

from receptance._files import inert
from receptance.report.table import Cell, Column, Table

_FORM = ".8g"


def table_csv(table: Table) -> str:
    r"""Return a table as CSV: numbers with eight digits, intervals as two columns, units in the heading.

    Text that a spreadsheet would take for a formula is quoted.

    Examples
    --------
    >>> from receptance.report import Column, Table
    >>> from receptance.report.csv_text import table_csv
    >>> columns = ("mode", Column("frequency", "Hz", ".0f"), Column("interval", form=".0f"))
    >>> print(table_csv(Table("Modes", columns, [("first", 694.21, (690.0, None)), ("=1", None, None)])))
    mode,frequency [Hz],interval lower,interval upper
    first,694.21,690,
    '=1,,,
    <BLANKLINE>
    """
    is_interval = [any(isinstance(row[i], tuple) for row in table.rows) for i in range(len(table.columns))]
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    header: list[str] = []
    for column, ends in zip(table.columns, is_interval, strict=True):
        name = inert((column if isinstance(column, str) else column.heading).replace("\n", " "))
        header += [f"{name} lower", f"{name} upper"] if ends else [name]
    writer.writerow(header)
    for row in table.rows:
        cells: list[str] = []
        for cell, ends in zip(row, is_interval, strict=True):
            pair = cell if isinstance(cell, tuple) else (cell, None)
            cells += [_text(end) for end in (pair if ends else (cell,))]
        writer.writerow(cells)
    return text.getvalue()


def _text(cell: Cell) -> str:
    text = Column("", form=_FORM).text(cell)
    return inert(text.replace("\n", " ")) if isinstance(cell, str) else text
