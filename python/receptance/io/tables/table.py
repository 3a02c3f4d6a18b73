"""Tables of numbers with a header: splitting, units and the places of mistakes."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance.io.errors import FileFormatError
from receptance.io.fields import parse_about
from receptance.io.options import ReadOptions
from receptance.io.tables.columns import Column, parse_column
from receptance.io.text import decode, number, numbered_lines, shown
from receptance.io.units import Unit, UnitError, parse_unit

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["EXAMPLE", "MARK", "Table", "column_unit", "read_table", "scaled"]

MARK = "# receptance: "
"""Begins the line in which this library keeps what columns cannot hold."""
EXAMPLE = "frequency [Hz],accelerance real [m/s^2/N],accelerance imaginary [m/s^2/N],coherence [1]"
_MOST_BEFORE = 1000
"""Lines in which a header is looked for."""
_MAY_BE_INFINITE = ("log_variance", "degrees_of_freedom")


@dataclass(frozen=True)
class Table:
    """Columns with names, and their numbers."""

    columns: tuple[Column, ...]
    values: NDArray[np.float64]
    """`(rows, columns)`."""
    header: int
    """Line of the header; 0 where it was given."""
    lines: tuple[int, ...]
    about: dict[str, Any] | None
    notes: tuple[str, ...] = ()

    def of(self, role: str) -> list[int]:
        """Return the columns that have a role."""
        return [index for index, column in enumerate(self.columns) if column.role == role]

    def error(self, problem: str) -> FileFormatError:
        """Return an error in the header."""
        return FileFormatError(problem, line=self.header or None)


def read_table(data: bytes, options: ReadOptions) -> Table:
    """Return the table in a file, with the header that is there or was given."""
    lines = numbered_lines(decode(data))
    about = None
    for line, text in lines:
        if text.startswith(MARK):
            try:
                about = parse_about(text.removeprefix(MARK).strip())
            except FileFormatError as error:
                raise FileFormatError(error.problem, line=line) from None
    lines = [(line, text) for line, text in lines if not text.startswith("#")]
    if not lines:
        raise FileFormatError(f"the file is empty, expected a header such as {EXAMPLE} and rows of numbers")
    skipped = _before_the_header(lines, options.columns)
    lines = lines[skipped:]
    notes = (f"{skipped} lines before line {lines[0][0]} were not read",) if skipped else ()
    delimiter = _delimiter(*lines[0])
    rows = _split(lines, delimiter)
    header, names = rows[0]
    if options.columns is not None:
        if not _is_number(names[0], delimiter):
            rows = rows[1:]
        else:
            header = 0
        names = list(options.columns)
    elif _is_number(names[0], delimiter):
        raise FileFormatError(
            f"this line holds numbers, expected a header such as {EXAMPLE}; if the file has none, give it with "
            "columns=[...] (on the command line --columns)",
            line=header,
        )
    else:
        rows = rows[1:]
    columns = [parse_column(name) for name in names]
    if (
        rows
        and len(rows[0][1]) == len(columns)
        and not any(_is_number(field, delimiter) for field in rows[0][1] if field.strip())
    ):
        # A row of units below the names.
        columns = [
            replace(c, unit=c.unit or unit.strip("[]() \t")) for c, unit in zip(columns, rows[0][1], strict=True)
        ]
        rows = rows[1:]
    while columns and not columns[-1].name and all(len(row) < len(columns) or not row[-1].strip() for _, row in rows):
        # A delimiter at the end of each row.
        columns.pop()
    abscissae = [index for index, column in enumerate(columns) if column.role in ("frequency", "time")]
    for index in abscissae[1:]:
        # The first one is; f and t behind it are a force and a temperature.
        columns[index] = replace(columns[index], role="channel")
    if not abscissae:
        found = ", ".join(repr(column.name) for column in columns[:8])
        raise FileFormatError(
            f"the columns are {found}; expected one named frequency or time, in a header such as {EXAMPLE} or "
            "time [s],hammer [N],tip [m/s^2]. If the file has no header give it with columns=[...]",
            line=header or None,
        )
    return replace(_numbers(columns, rows, header, delimiter, about), notes=notes)


def _before_the_header(lines: Sequence[tuple[int, str]], given: Sequence[str] | None) -> int:
    """Return how many lines there are before the header, or before the table where the header is given.

    A header names a frequency or a time and has a row of numbers, one for each name, below it, with at most one row of
    units between. A given header fits the first line with as many columns.
    """
    for index, (line, text) in enumerate(lines[:_MOST_BEFORE]):
        for sign in "\t;,":
            names = _fields(line, text, sign)
            if given is not None:
                if len(names) == len(given):
                    return index
            elif any(parse_column(name).role in ("frequency", "time") for name in names) and (
                index == 0
                or any(
                    len(row) == len(names) and all(_is_number(field, sign) for field in row)
                    for row in (_fields(*below, sign) for below in lines[index + 1 : index + 3])
                )
            ):
                return index
    return 0


def _fields(line: int, text: str, delimiter: str) -> list[str]:
    """Return the columns of a line, without empty ones at its end; none where there is no delimiter."""
    try:
        ((_, fields),) = _split([(line, text)], delimiter)
    except FileFormatError:
        return []
    while fields and not fields[-1].strip():
        fields.pop()
    return fields if len(fields) > 1 else []


def _delimiter(line: int, text: str) -> str:
    """Return what stands between columns: what leaves a frequency or time column whole, else what there is."""
    there = [sign for sign in "\t;," if sign in text]
    if not there:
        raise FileFormatError(f"found {shown(text)}, expected columns between commas, semicolons or tabs", line=line)
    for sign in there:
        ((_, names),) = _split([(line, text)], sign)
        if any(parse_column(name).role in ("frequency", "time") for name in names):
            return sign
    return there[0]


def _split(lines: Sequence[tuple[int, str]], delimiter: str) -> list[tuple[int, list[str]]]:
    rows = []
    for line, text in lines:
        if '"' not in text:
            rows.append((line, text.split(delimiter)))
            continue
        try:
            fields = next(csv.reader([text], delimiter=delimiter, strict=True))
        except (csv.Error, StopIteration) as error:
            raise FileFormatError(f"this row cannot be split into columns: {error}", line=line) from None
        rows.append((line, fields))
    return rows


def _is_number(field: str, delimiter: str) -> bool:
    try:
        number(field, 0, "", decimal_comma=delimiter != ",")
    except FileFormatError:
        return False
    return True


def _numbers(
    columns: Sequence[Column],
    rows: Sequence[tuple[int, list[str]]],
    header: int,
    delimiter: str,
    about: dict[str, Any] | None,
) -> Table:
    if not rows:
        raise FileFormatError("there are no rows of numbers below the header", line=header or None)
    width = len(columns)
    values = np.empty((len(rows), width))
    fast = _all_plain(rows, width)
    if fast is not None:
        values = fast
    for index, (line, fields) in enumerate(rows if fast is None else []):
        while len(fields) > width and not fields[-1].strip():
            fields.pop()
        if len(fields) != width:
            raise FileFormatError(f"there are {len(fields)} columns, the header has {width}", line=line)
        for k, field in enumerate(fields):
            values[index, k] = number(field, line, f"column {columns[k].name!r}", decimal_comma=delimiter != ",")
    lines = tuple(line for line, _ in rows)
    table = Table(tuple(columns), values, header, lines, about)
    _check_finite(table)
    return table


def _all_plain(rows: Sequence[tuple[int, list[str]]], width: int) -> NDArray[np.float64] | None:
    """Return the numbers where nothing in them is special (which is ten times as fast), else None."""
    try:
        values = np.array([[float(field) for field in fields] for _, fields in rows], dtype=np.float64)
    except ValueError:
        return None
    plain = values.shape == (len(rows), width) and not any("_" in field for _, fields in rows for field in fields)
    return values if plain else None


def _check_finite(table: Table) -> None:
    wrong = ~np.isfinite(table.values)
    for role in _MAY_BE_INFINITE:
        wrong[:, table.of(role)] = np.isnan(table.values[:, table.of(role)])
    frequency = table.of("frequency")
    if frequency and table.values[0, frequency[0]] == 0.0:
        # A receptance is not finite at 0 Hz; the FRF drops that line and says so.
        wrong[0] = False
    if wrong.any():
        row, column = (int(index) for index in np.argwhere(wrong)[0])
        raise FileFormatError(
            f"column {table.columns[column].name!r} is {table.values[row, column]}, expected a finite number",
            line=table.lines[row],
        )


def column_unit(column: Column) -> Unit | None:
    """Return the unit of a column, None where it says none."""
    if not column.unit:
        return None
    try:
        return parse_unit(column.unit)
    except UnitError as error:
        raise FileFormatError(f"column {column.name!r}: {error}") from None


def scaled(table: Table, index: int, unit: str) -> NDArray[np.float64]:
    """Return a column in a unit, which it must have."""
    column, wanted = table.columns[index], parse_unit(unit)
    found = column_unit(column)
    if found is None:
        raise FileFormatError(f"column {column.name!r} says no unit, expected {column.name} [{unit}]")
    if found.dimension != wanted.dimension:
        raise FileFormatError(f"column {column.name!r} is in {found.text!r}, expected {unit}")
    values: NDArray[np.float64] = table.values[:, index]
    return values if found.factor == wanted.factor else values * (found.factor / wanted.factor)
