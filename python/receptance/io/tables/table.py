"""Tables of numbers with a header: splitting, units and the places of mistakes."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance.io.errors import FileFormatError
from receptance.io.fields import parse_about
from receptance.io.limits import check_fields, check_time
from receptance.io.options import ReadOptions
from receptance.io.tables.columns import Column, parse_column
from receptance.io.text import check_count, decode, doubts_of_end, number, numbered_lines
from receptance.units import Unit, UnitError, parse_unit

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["EXAMPLE", "MARK", "Table", "column_unit", "read_table", "scaled"]

MARK = "# receptance: "
"""Begins the line in which this library keeps what columns cannot hold."""
EXAMPLE = "frequency [Hz],accelerance real [m/s^2/N],accelerance imaginary [m/s^2/N],coherence [1]"
_LONGEST_NAME = 1000
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
    whole = decode(data)
    lines = numbered_lines(whole)
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
    for name in names:
        if len(name) > _LONGEST_NAME:
            raise FileFormatError(
                f"a column has a name of {len(name)} characters, expected a short one", line=header or None
            )
    columns = [parse_column(name) for name in names]
    if rows and _are_units(columns, rows[0][1], delimiter):
        columns = _with_units(columns, *rows[0], options)
        rows = rows[1:]
    while columns and not columns[-1].name and all(len(row) < len(columns) or not row[-1].strip() for _, row in rows):
        # A delimiter at the end of each row.
        columns.pop()
    abscissae = [index for index, column in enumerate(columns) if column.role in ("frequency", "time")]
    for index in abscissae[1:]:
        # The first one is; f and t behind it are a force and a temperature.
        columns[index] = replace(columns[index], role="channel")
    if not abscissae:
        # What stands here is not shown: nothing has told yet that the file is a table of measurements.
        raise FileFormatError(
            f"of the {len(columns)} columns none is named frequency or time, expected a header such as {EXAMPLE} or "
            "time [s],hammer [N],tip [m/s^2]. If the file has no header give it with columns=[...]",
            line=header or None,
        )
    table = _numbers(columns, rows, header, delimiter, about, shown=options.columns is None)
    declared = None if about is None else about.get("rows")
    if isinstance(declared, int):
        check_count(whole, len(rows), declared, lines[-1][0])
        return replace(table, notes=notes)
    return replace(table, notes=(*notes, *doubts_of_end(whole, lines[-len(rows) :])))


def _are_units(columns: Sequence[Column], fields: Sequence[str], delimiter: str) -> bool:
    """Return whether the row below the names says units: of the frequency or time, else in all cells with text."""
    if len(fields) != len(columns):
        return False
    texts = [field.strip("[]() \t") for field in fields]
    first = next((index for index, column in enumerate(columns) if column.role in ("frequency", "time")), None)
    decisive = [texts[first]] if first is not None and texts[first] else [text for text in texts if text]
    if not decisive or any(_is_number(text, delimiter) for text in decisive):
        return False
    try:
        return all(parse_unit(text) for text in decisive)
    except UnitError:
        return False


def _with_units(columns: Sequence[Column], line: int, fields: Sequence[str], options: ReadOptions) -> list[Column]:
    """Return columns with the units of the row below their names, which may say the same as these but nothing else."""
    found = []
    for column, field in zip(columns, fields, strict=True):
        unit = field.strip("[]() \t")
        overruled = options.unit is not None and column.role not in ("frequency", "time")
        if column.unit and unit and not overruled and not _same_unit(column.unit, unit):
            raise FileFormatError(
                f"column {column.name!r} is in {column.unit!r} by its name and in {unit!r} by this row of units; "
                "remove the one that is wrong, or give the unit with unit=",
                line=line,
            )
        found.append(replace(column, unit=column.unit or unit))
    return found


def _same_unit(one: str, other: str) -> bool:
    try:
        first, second = parse_unit(one), parse_unit(other)
    except UnitError:
        return one == other
    return (first.factor, first.dimension) == (second.factor, second.dimension)


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
        raise FileFormatError("this line has no columns between commas, semicolons or tabs", line=line)
    for sign in there:
        ((_, names),) = _split([(line, text)], sign)
        if any(len(name) <= _LONGEST_NAME and parse_column(name).role in ("frequency", "time") for name in names):
            return sign
    return there[0]


def _split(lines: Sequence[tuple[int, str]], delimiter: str) -> list[tuple[int, list[str]]]:
    rows: list[tuple[int, list[str]]] = []
    fields_so_far = 0
    for index, (line, text) in enumerate(lines):
        if index % 1024 == 0:
            check_time()
        fields_so_far += text.count(delimiter) + 1
        check_fields(fields_so_far)
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
    *,
    shown: bool,
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
            # Below names that were given the first row may be anything, and is not shown.
            show = shown or index > 0
            what = f"column {columns[k].name!r}"
            values[index, k] = number(field, line, what, decimal_comma=delimiter != ",", show=show)
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
