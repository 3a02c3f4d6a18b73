"""Tables of numbers with a header: column names, units, rows, and the line of every error."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from receptance.io.description import QUALITY, parse_about
from receptance.io.errors import FileFormatError, error_location
from receptance.io.limits import MAX_NUMBERS, check_count, check_time
from receptance.io.options import ReadOptions
from receptance.io.text import check_row_count, decode, number, numbered_lines, parse_rows, truncation_notes
from receptance.units import FORM_NAMES, Form, Unit, UnitError, form_name, parse_unit

__all__ = [
    "EXAMPLE",
    "MARK",
    "PARTS",
    "QUALITY_NAMES",
    "Column",
    "Table",
    "column_in_unit",
    "column_unit",
    "parse_column",
    "read_table",
]

QUALITY_NAMES = {field: field.replace("_", " ") for field in QUALITY}
"""Names of the columns of further fields of an FRF."""
PARTS = {
    "real": ("real", "re"),
    "imaginary": ("imaginary", "imag", "im"),
    "magnitude": ("magnitude", "mag", "amplitude", "abs"),
    "phase": ("phase", "angle", "arg"),
}
"""Roles of the columns of an FRF, with the words for them in names of columns."""
_AXES = ("frequency", "time")
_FORMS = "|".join(FORM_NAMES)
_PART = "|".join(word for words in PARTS.values() for word in words)
_FRF = re.compile(
    rf"(?:(?P<form>{_FORMS}|frf|h)\s+)?(?P<part>{_PART})(?:\s+part)?(?:\s+(?P<after>{_FORMS}|frf))?(?:\s+(?P<entry>.+))?",
    re.IGNORECASE,
)
_QUALITY = re.compile(
    rf"(?P<name>coherence|coh|{'|'.join(QUALITY_NAMES.values())})(?:\s+(?P<entry>.+))?", re.IGNORECASE
)
_BRACKETS = re.compile(r"(?P<name>.*?)\s*\[(?P<unit>[^\[\]]*)\]", re.DOTALL)
_PARENTHESES = re.compile(r"(?P<name>[^()]*?)\s*\((?P<unit>.*)\)", re.DOTALL)


@dataclass(frozen=True)
class Column:
    """Meaning of a column, from its name."""

    name: str
    """Name without the unit."""
    unit: str | None
    role: str
    """frequency, time, real, imaginary, magnitude, phase, coherence, a field of QUALITY, or channel."""
    form: Form | None = None
    entry: str = ""
    """Response and excitation, if there are several."""


def parse_column(text: str) -> Column:
    """Return the meaning of a column name such as `accelerance real [m/s^2/N]` or `tip (g)`.

    Examples
    --------
    >>> from receptance.io.table import parse_column
    >>> parse_column("Inertance imag 2/1 [m/s^2/N]")
    Column(name='Inertance imag 2/1', unit='m/s^2/N', role='imaginary', form='accelerance', entry='2/1')
    """
    text = text.strip()
    match = _BRACKETS.fullmatch(text) or _PARENTHESES.fullmatch(text)
    name, unit = (match["name"].strip(), match["unit"].strip()) if match and match["name"].strip() else (text, None)
    if name.lower() in ("frequency", "freq", "f"):
        return Column(name, unit, "frequency")
    if name.lower() in ("time", "t"):
        return Column(name, unit, "time")
    if quality := _QUALITY.fullmatch(name):
        field = quality["name"].lower().replace(" ", "_")
        return Column(name, unit, field if field in QUALITY else "coherence", entry=quality["entry"] or "")
    if frf := _FRF.fullmatch(name):
        role = next(role for role, words in PARTS.items() if frf["part"].lower() in words)
        word = (frf["form"] or frf["after"] or "").lower()
        return Column(name, unit, role, form_name(word) if word not in ("", "frf", "h") else None, frf["entry"] or "")
    return Column(name, unit, "channel")


MARK = "# receptance: "
"""Beginning of the line with the fields of a measurement that columns do not hold."""
EXAMPLE = "frequency [Hz],accelerance real [m/s^2/N],accelerance imaginary [m/s^2/N],coherence [1]"
_DELIMITERS = "\t;,"
_MAX_NAME_LENGTH = 1000
_MAX_PREAMBLE = 1000
"""Lines within which a header is searched for."""
_MAY_BE_INFINITE = ("log_variance", "degrees_of_freedom")


@dataclass(frozen=True)
class Table:
    """Named columns of numbers."""

    columns: tuple[Column, ...]
    values: NDArray[np.float64]
    """`(rows, columns)`."""
    header: int
    """Line number of the header; 0 if it was given as an option."""
    lines: tuple[int, ...]
    about: dict[str, Any] | None
    notes: tuple[str, ...] = ()

    def indices(self, role: str) -> list[int]:
        """Return the indices of the columns with a role."""
        return [index for index, column in enumerate(self.columns) if column.role == role]


def read_table(data: bytes, options: ReadOptions) -> Table:
    """Return the table in a file, with its header or that of the options."""
    content = decode(data)
    lines = numbered_lines(content)
    about = None
    for line, text in lines:
        if text.startswith(MARK):
            with error_location(line=line):
                about = parse_about(text.removeprefix(MARK).strip())
    lines = [(line, text) for line, text in lines if not text.startswith("#")]
    if not lines:
        raise FileFormatError(f"the file is empty, expected a header such as {EXAMPLE} and rows of numbers")
    skipped = _preamble_length(lines, options.columns)
    lines = lines[skipped:]
    notes = [f"{skipped} lines before line {lines[0][0]} were not read"] if skipped else []
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
            f"this line holds numbers, expected a header such as {EXAMPLE}; for a file without a header give it with "
            "columns=[...] (on the command line --columns)",
            line=header,
        )
    else:
        rows = rows[1:]
    for name in names:
        if len(name) > _MAX_NAME_LENGTH:
            raise FileFormatError(
                f"a column has a name of {len(name)} characters, expected a short one", line=header or None
            )
    columns = [parse_column(name) for name in names]
    if rows and _are_units(columns, rows[0][1], delimiter):
        columns = _with_units(columns, *rows[0], options)
        rows = rows[1:]
    while columns and not columns[-1].name and all(len(row) < len(columns) or not row[-1].strip() for _, row in rows):
        # Every row ends with a delimiter.
        columns.pop()
    axes = [index for index, column in enumerate(columns) if column.role in _AXES]
    for index in axes[1:]:
        # Only the first is an axis; a later f or t is a channel, for example force or temperature.
        columns[index] = replace(columns[index], role="channel")
    if not axes:
        # The header is not quoted, because the file is not known to be a measurement.
        raise FileFormatError(
            f"of the {len(columns)} columns none is named frequency or time, expected a header such as {EXAMPLE} or "
            "time [s],hammer [N],tip [m/s^2]. If the file has no header give it with columns=[...]",
            line=header or None,
        )
    if not rows:
        raise FileFormatError("there are no rows of numbers below the header", line=header or None)
    # The first row below a given header is not quoted, because the file may be anything.
    values = parse_rows(
        rows,
        [f"column {column.name!r}" for column in columns],
        decimal_comma=delimiter != ",",
        quote_first_row=options.columns is None,
    )
    table = Table(tuple(columns), values, header, tuple(line for line, _ in rows), about)
    _check_finite(table)
    declared = None if about is None else about.get("rows")
    if isinstance(declared, int):
        check_row_count(content, len(rows), declared, lines[-1][0])
    else:
        notes += truncation_notes(content, lines[-len(rows) :])
    return replace(table, notes=tuple(notes))


def _are_units(columns: Sequence[Column], fields: Sequence[str], delimiter: str) -> bool:
    """Return whether the row below the names has units: that of the axis, else all cells with text."""
    if len(fields) != len(columns):
        return False
    texts = [field.strip("[]() \t") for field in fields]
    first = next((index for index, column in enumerate(columns) if column.role in _AXES), None)
    decisive = [texts[first]] if first is not None and texts[first] else [text for text in texts if text]
    if not decisive or any(_is_number(text, delimiter) for text in decisive):
        return False
    try:
        return all(parse_unit(text) for text in decisive)
    except UnitError:
        return False


def _with_units(columns: Sequence[Column], line: int, fields: Sequence[str], options: ReadOptions) -> list[Column]:
    """Return columns with the units of the row below their names, which must not contradict units in the names."""
    with_units = []
    for column, field in zip(columns, fields, strict=True):
        unit = field.strip("[]() \t")
        overridden = options.unit is not None and column.role not in _AXES
        if column.unit and unit and not overridden and not _same_unit(column.unit, unit):
            raise FileFormatError(
                f"column {column.name!r} is in {column.unit!r} by its name and in {unit!r} by this row of units; "
                "remove the wrong one, or give the unit with unit=",
                line=line,
            )
        with_units.append(replace(column, unit=column.unit or unit))
    return with_units


def _same_unit(first: str, second: str) -> bool:
    try:
        return parse_unit(first) == parse_unit(second)
    except UnitError:
        return first == second


def _preamble_length(lines: Sequence[tuple[int, str]], given: Sequence[str] | None) -> int:
    """Return the number of lines before the header, or before the table if the header is given.

    A header names a frequency or a time, and the row below it, or below a row of units, has a number for each name. A
    given header matches the first line with as many columns.
    """
    for index, (line, text) in enumerate(lines[:_MAX_PREAMBLE]):
        for delimiter in _DELIMITERS:
            names = _fields(line, text, delimiter)
            if given is not None:
                if len(names) == len(given):
                    return index
            elif any(parse_column(name).role in _AXES for name in names) and (
                index == 0
                or any(
                    len(row) == len(names) and all(_is_number(field, delimiter) for field in row)
                    for row in (_fields(*below, delimiter) for below in lines[index + 1 : index + 3])
                )
            ):
                return index
    return 0


def _fields(line: int, text: str, delimiter: str) -> list[str]:
    """Return the columns of a line, without trailing empty ones; none without a delimiter."""
    try:
        ((_, fields),) = _split([(line, text)], delimiter)
    except FileFormatError:
        return []
    while fields and not fields[-1].strip():
        fields.pop()
    return fields if len(fields) > 1 else []


def _delimiter(line: int, text: str) -> str:
    """Return the delimiter: the one that yields a frequency or time column, else the first one found."""
    candidates = [delimiter for delimiter in _DELIMITERS if delimiter in text]
    if not candidates:
        raise FileFormatError("this line has no columns separated by commas, semicolons or tabs", line=line)
    for delimiter in candidates:
        ((_, names),) = _split([(line, text)], delimiter)
        if any(len(name) <= _MAX_NAME_LENGTH and parse_column(name).role in _AXES for name in names):
            return delimiter
    return candidates[0]


def _split(lines: Sequence[tuple[int, str]], delimiter: str) -> list[tuple[int, list[str]]]:
    rows: list[tuple[int, list[str]]] = []
    count = 0
    for index, (line, text) in enumerate(lines):
        if index % 1024 == 0:
            check_time()
        count += text.count(delimiter) + 1
        check_count(count, MAX_NUMBERS, "numbers")
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


def _check_finite(table: Table) -> None:
    wrong = ~np.isfinite(table.values)
    for role in _MAY_BE_INFINITE:
        wrong[:, table.indices(role)] = np.isnan(table.values[:, table.indices(role)])
    frequency = table.indices("frequency")
    if frequency and table.values[0, frequency[0]] == 0.0:
        # A receptance may be infinite at 0 Hz; the FRF drops that line with a note.
        wrong[0] = False
    if wrong.any():
        row, column = (int(index) for index in np.argwhere(wrong)[0])
        raise FileFormatError(
            f"column {table.columns[column].name!r} is {table.values[row, column]}, expected a finite number",
            line=table.lines[row],
        )


def column_unit(column: Column) -> Unit | None:
    """Return the unit of a column, or None."""
    if not column.unit:
        return None
    try:
        return parse_unit(column.unit)
    except UnitError as error:
        raise FileFormatError(f"column {column.name!r}: {error}") from None


def column_in_unit(table: Table, index: int, unit: str) -> NDArray[np.float64]:
    """Return the values of a column in a unit; the column must have a unit of its dimension."""
    column, target = table.columns[index], parse_unit(unit)
    source = column_unit(column)
    if source is None:
        raise FileFormatError(f"column {column.name!r} has no unit, expected {column.name} [{unit}]")
    if source.dimension != target.dimension:
        raise FileFormatError(f"column {column.name!r} is in {source.text!r}, expected {unit}")
    values: NDArray[np.float64] = table.values[:, index]
    return values if source.factor == target.factor else values * (source.factor / target.factor)
