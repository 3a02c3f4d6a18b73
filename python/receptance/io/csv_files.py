"""FRFs, coherences and time series in CSV files and other tables with a header."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from receptance._files import inert
from receptance.errors import warn_user
from receptance.frf import FRF
from receptance.io.build import ReadOptions
from receptance.io.column_names import (
    AXES,
    LONGEST_NAME,
    QUALITY_NAMES,
    TableColumn,
    column_unit,
    is_unit,
    named_column,
    parse_column,
    with_complex_parts,
    with_one_axis,
)
from receptance.io.description import about_text, arrays_of, parse_about
from receptance.io.errors import FileFormatError, check_time, error_location
from receptance.io.measurements import Coherence, Measurement, TimeSeries
from receptance.io.tables import EXAMPLE, NumberTable, measurements_in
from receptance.io.text import (
    complex_parts,
    excerpt,
    number,
    numbered_lines,
    parse_lines,
    truncation_notes,
)

MARK = "# receptance: "
"""Beginning of the line with the fields of a measurement that columns do not hold."""
_BLANKS = " "
"""Delimiter of columns of numbers that are separated by any number of blanks."""
_DELIMITERS = f"\t;,{_BLANKS}"
_AVERAGES = re.compile(
    r"#?\W*(?:(?:number|no\.?|nr\.?|anzahl)\s+(?:of\s+)?)?(?:averages?|averaging|avg\.?|mittelungen|mittelungszahl|moyennes|"
    r"promedios|medie)\W+(?P<count>\d{1,6})\W*",
    re.IGNORECASE,
)
"""A line before the header with the number of averages."""
_WINDOW = re.compile(r"\b(?:window|fenster|fenêtre|fenetre|finestra|ventana)\b", re.IGNORECASE)
"""A line before the header with the window of the analyser."""
_EXPONENTIAL = re.compile(r"exp|espon", re.IGNORECASE)
_MAX_PREAMBLE = 1000
"""Lines within which a header is searched for."""
_FIRST_ROWS = 10
"""Rows by which columns of complex numbers are recognised."""


def _read_table(data: bytes, options: ReadOptions) -> NumberTable:
    """Return the table in a file, with its header or that of the options."""
    content, every = numbered_lines(data)
    about = None
    for line, text in every:
        if text.startswith(MARK):
            with error_location(line=line):
                about = parse_about(text.removeprefix(MARK).strip())
    lines = [numbered for numbered in every if not numbered[1].startswith("#")]
    if not lines:
        raise FileFormatError(f"the file is empty, expected a header such as {EXAMPLE} and rows of numbers")
    skipped, delimiter = _layout(lines, options)
    lines = lines[skipped:]
    notes = [_skipped(skipped, lines[0][0])] if skipped else []
    averages = None
    if about is None:
        before = [numbered for numbered in every if numbered[0] < lines[0][0]]
        averages = _averages(before, notes)
        notes += _window_notes(before)
    header, columns, lines = _columns(lines, delimiter, options)
    if options.sample_rate_hz is None and not any(column.role in AXES for column in columns):
        # The header is not quoted, because the file is not known to be a measurement.
        raise FileFormatError(
            f"of the {len(columns)} columns none is named frequency or time, expected a header such as {EXAMPLE} or "
            "time [s],hammer [N],tip [m/s^2]. If the file has no header or one with other names, give it with "
            "columns=[...] (on the command line --columns), a name with its unit for each column; time records without "
            "a column of times need sample_rate_hz= (--sample-rate) as well",
            line=header or None,
            option="columns",
        )
    if not lines:
        raise FileFormatError("there are no rows of numbers below the header", line=header or None)
    row = _split(*lines[0], delimiter)
    if delimiter == "," and len(row) > len(columns) and all(re.fullmatch(r"\s*-?\d+", cell) for cell in row):
        raise FileFormatError(
            f"there are {len(row)} columns of whole numbers, expected {len(columns)}: commas seem to be decimal "
            "signs as well as separators; export the table with semicolons or tabs between its columns",
            line=lines[0][0],
        )
    columns, split = _with_complex_columns(columns, lines, delimiter)
    # The first row below a given header is not quoted, because the file may be anything.
    values = parse_lines(
        lines,
        split,
        [f"column {column.name!r}" for column in columns],
        decimal_comma=delimiter != ",",
        quote_first_row=options.columns is None,
    )
    declared = None if about is None else about.get("rows")
    notes += truncation_notes(content, lines, declared if isinstance(declared, int) else None)
    rows = tuple(line for line, _ in lines)
    return NumberTable(tuple(columns), values, header, rows, about, tuple(notes), averages=averages)


def _columns(
    lines: list[tuple[int, str]], delimiter: str, options: ReadOptions
) -> tuple[int, list[TableColumn], list[tuple[int, str]]]:
    """Return the line number of the header, its columns with their units, and the lines below it."""
    header, names = lines[0][0], _split(*lines[0], delimiter)
    has_names = not _is_number(names[0], delimiter)
    if options.columns is not None:
        header = header if has_names else 0
        names = list(options.columns)
    elif not has_names:
        raise FileFormatError(
            f"this line holds numbers, expected a header such as {EXAMPLE}; for a file without a header give it with "
            f"columns=[...] (on the command line --columns), a name with its unit for each of the {len(names)} columns",
            line=header,
            option="columns",
        )
    lines = lines[1:] if has_names else lines
    columns = []
    for name in names:
        if len(name) > LONGEST_NAME:
            raise FileFormatError(
                f"a column has a name of {len(name)} characters, expected a short one", line=header or None
            )
        check_time()
        columns.append(parse_column(name))
    if lines and _are_units(columns, units := _split(*lines[0], delimiter), delimiter):
        columns = _with_units(columns, lines[0][0], units, options)
        lines = lines[1:]
    cells = _split(*lines[0], delimiter) if lines else []
    while columns and not columns[-1].name and (len(cells) < len(columns) or not cells[-1].strip()):
        # Every row ends with a delimiter.
        columns.pop()
    return header, with_one_axis(columns), lines


def _with_complex_columns(
    columns: Sequence[TableColumn], lines: Sequence[tuple[int, str]], delimiter: str
) -> tuple[list[TableColumn], Callable[[int, str], list[str]]]:
    """Return the columns with two for each column of complex numbers, and the function that splits a line into them."""
    first_rows = [_split(line, text, delimiter) for line, text in lines[:_FIRST_ROWS]]
    are_complex = [
        column.role not in AXES and any(complex_parts(row[index]) for row in first_rows if index < len(row))
        for index, column in enumerate(columns)
    ]
    if not any(are_complex):
        return list(columns), lambda line, text: _split(line, text, delimiter)
    parts = with_complex_parts(columns, are_complex, lines[0][0])

    def split(line: int, text: str) -> list[str]:
        fields: list[str] = []
        for index, cell in enumerate(_split(line, text, delimiter)):
            if index < len(are_complex) and are_complex[index]:
                fields += complex_parts(cell) or (cell, "0")
            else:
                fields.append(_real_text(cell) if index < len(columns) and columns[index].role in AXES else cell)
        return fields

    return parts, split


def _real_text(cell: str) -> str:
    """Return the real part of a frequency in a table of complex numbers alone, as NumPy writes it."""
    parts = complex_parts(cell)
    return parts[0] if parts and number(parts[1], 0, "", decimal_comma=True) == 0.0 else cell


def _skipped(count: int, first: int) -> str:
    return (
        f"1 line before line {first} was not read" if count == 1 else f"{count} lines before line {first} were not read"
    )


def _averages(before: Sequence[tuple[int, str]], notes: list[str]) -> int | None:
    """Return the number of averages that the lines before the header state, with a note; None if they state none."""
    found = {int(match["count"]): line for line, text in before if (match := _AVERAGES.fullmatch(text.strip()))}
    if len(found) != 1:
        return None
    ((count, line),) = found.items()
    if count < 1:
        return None
    notes.append(f"{count} averages, by line {line}")
    return count


def _window_notes(before: Sequence[tuple[int, str]]) -> list[str]:
    """Return a note on each line before the header that states a window, with a warning of an exponential one."""
    notes = []
    for line, text in before:
        if not _WINDOW.search(text):
            continue
        note = f"line {line} states a window, {excerpt(text.strip())}"
        if _EXPONENTIAL.search(text):
            note += (
                ": an exponential window adds damping to every mode. Its decay rate is not read; state it as "
                "`decay_rate` of the FRF, or `response_decay_rate` of hits, in 1/s"
            )
            warn_user(note)
        notes.append(note)
    return notes


def _are_units(columns: Sequence[TableColumn], fields: Sequence[str], delimiter: str) -> bool:
    """Return whether the row below the names has units: that of the axis, else all cells with text."""
    if len(fields) != len(columns):
        return False
    texts = [field.strip("[]() \t") for field in fields]
    first = next((index for index, column in enumerate(columns) if column.role in AXES), None)
    decisive = [texts[first]] if first is not None and texts[first] else [text for text in texts if text]
    return bool(decisive) and all(is_unit(text) and not _is_number(text, delimiter) for text in decisive)


def _with_units(
    columns: Sequence[TableColumn], line: int, fields: Sequence[str], options: ReadOptions
) -> list[TableColumn]:
    """Return columns with the units of the row below their names, which must not contradict units in the names."""
    with_units = []
    for column, field in zip(columns, fields, strict=True):
        unit = named_column(column.name, field.strip("[]() \t")).unit
        overridden = options.unit is not None and column.role not in AXES
        if column.unit and unit and not overridden and not _same_unit(column.unit, unit):
            raise FileFormatError(
                f"column {column.name!r} is in {column.unit!r} by its name and in {unit!r} by this row of units; "
                "remove the wrong one, or give the unit with unit=",
                line=line,
            )
        with_units.append(replace(column, unit=column.unit or unit))
    return with_units


def _same_unit(first: str, second: str) -> bool:
    if is_unit(first) and is_unit(second):
        return column_unit(first) == column_unit(second)
    return first == second


def _layout(lines: Sequence[tuple[int, str]], options: ReadOptions) -> tuple[int, str]:
    """Return the number of lines before the header, or before the table if the header is given, and the delimiter.

    A header names a frequency or a time, and the row below it, or below a row of units, has a number for each name. A
    given header replaces the lines above the first row with as many numbers. Without a line that can be a header it is
    the line above the first row of numbers: that of channels without a column of times, or for the message. A single
    column is a table only if the sample rate is given.
    """
    given = options.columns
    if given is None:
        for index, (line, text) in enumerate(lines[:_MAX_PREAMBLE]):
            for delimiter in _DELIMITERS:
                check_time()
                cells = _fields(line, text, delimiter)
                if any(len(name) <= LONGEST_NAME and parse_column(name).role in AXES for name in cells) and (
                    (index == 0 and delimiter != _BLANKS) or _has_numbers_below(lines, index, len(cells), delimiter)
                ):
                    return index, delimiter
    for least in (2, 1) if options.sample_rate_hz is not None else (2,):
        for index, (line, text) in enumerate(lines[:_MAX_PREAMBLE]):
            for delimiter in _DELIMITERS:
                check_time()
                cells = _fields(line, text, delimiter, least)
                if not cells or not _are_numbers(cells, delimiter) or len(cells) != len(given or cells):
                    continue
                above = [_fields(*lines[before], delimiter, least) for before in (index - 1, index - 2) if before >= 0]
                names = int(bool(above) and len(above[0]) == len(cells))
                if given and len(above) > names == 1 and len(above[1]) == len(cells):
                    # Names with a row of units below.
                    names += _are_units([parse_column(name) for name in given], above[0], delimiter)
                return index - names, delimiter
    line, text = lines[0]
    delimiters = [delimiter for delimiter in _DELIMITERS if delimiter != _BLANKS and delimiter in text]
    if not delimiters:
        raise FileFormatError("this line has no columns separated by commas, semicolons or tabs", line=line)
    return 0, delimiters[0]


def _has_numbers_below(lines: Sequence[tuple[int, str]], index: int, count: int, delimiter: str) -> bool:
    """Return whether one of the next two lines has so many numbers."""
    below = (_fields(*line, delimiter) for line in lines[index + 1 : index + 3])
    return any(len(cells) == count and _are_numbers(cells, delimiter) for cells in below)


def _are_numbers(cells: Sequence[str], delimiter: str) -> bool:
    return all(_is_number(cell, delimiter) for cell in cells)


def _fields(line: int, text: str, delimiter: str, least: int = 2) -> list[str]:
    """Return the columns of a line, without trailing empty ones; none if there are fewer than the least number."""
    try:
        fields = _split(line, text, delimiter)
    except FileFormatError:
        return []
    while fields and not fields[-1].strip():
        fields.pop()
    return fields if len(fields) >= least else []


def _split(line: int, text: str, delimiter: str) -> list[str]:
    if delimiter == _BLANKS:
        fields = text.split()
        return fields if ("(" not in text and "[" not in text) or _are_numbers(fields, delimiter) else _joined(fields)
    if '"' not in text:
        return text.split(delimiter)
    try:
        return next(csv.reader([text], delimiter=delimiter, strict=True))
    except (csv.Error, StopIteration) as error:
        raise FileFormatError(f"this row cannot be split into columns: {error}", line=line) from None


def _joined(words: Sequence[str]) -> list[str]:
    """Return names between blanks, each with its unit in brackets, which may contain blanks."""
    cells: list[list[str]] = []
    depth = 0
    for word in words:
        opens = word.startswith(("(", "["))
        if depth > 0 or (opens and cells and not cells[-1][0].startswith(("(", "[")) and len(cells[-1]) == 1):
            cells[-1].append(word)
        else:
            cells.append([word])
        depth = max(0, depth + sum(map(word.count, "([")) - sum(map(word.count, ")]")))
    return [" ".join(cell) for cell in cells]


def _is_number(field: str, delimiter: str) -> bool:
    try:
        for part in complex_parts(field) or (field,):
            number(part, 0, "", decimal_comma=delimiter != ",")
    except FileFormatError:
        return False
    return True


def read_csv(data: bytes, options: ReadOptions) -> list[Measurement]:
    """Return the FRF, coherence or time records in a table of numbers; errors name the line."""
    return measurements_in(_read_table(data, options), options)


def csv_bytes(measurement: Measurement) -> bytes:
    """Return the contents of a CSV file; all fields are stored, numbers with all digits."""
    columns = _time_columns(measurement) if isinstance(measurement, TimeSeries) else _frequency_columns(measurement)
    stream = io.StringIO()
    stream.write(f"{MARK}{about_text(measurement, rows=len(columns[0][1]))}\n")
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow([inert(name) for name, _ in columns])
    writer.writerows(zip(*([repr(x) for x in values.tolist()] for _, values in columns), strict=True))
    return stream.getvalue().encode()


def _time_columns(series: TimeSeries) -> list[tuple[str, NDArray[Any]]]:
    columns = [("time [s]", series.time_s)]
    for index, (name, unit) in enumerate(zip(series.channels, series.units, strict=True)):
        columns.append((" ".join(f"{name} [{unit}]".split()), series.values[:, index]))
    return columns


def _frequency_columns(measurement: FRF | Coherence) -> list[tuple[str, NDArray[Any]]]:
    arrays = arrays_of(measurement)
    columns: list[tuple[str, NDArray[Any]]] = [("frequency [Hz]", arrays.pop("frequency_hz"))]
    values = arrays.pop("values")
    pairs = [(row, column) for row in range(values.shape[1]) for column in range(values.shape[2])]
    for row, column in pairs:
        entry = f" {row + 1}/{column + 1}" if len(pairs) > 1 else ""
        entry_values = values[:, row, column]
        if isinstance(measurement, FRF):
            unit = measurement.units[row][column]
            columns.append((f"{measurement.form} real{entry} [{unit}]", entry_values.real))
            columns.append((f"{measurement.form} imaginary{entry} [{unit}]", entry_values.imag))
        else:
            columns.append((f"coherence{entry} [1]", entry_values))
    for field, array in arrays.items():
        name = QUALITY_NAMES.get(field, field)
        if array.dtype.kind == "b":
            array = array.astype(np.int64)
        if array.ndim == 1:
            columns.append((f"{name} [1]", array))
            continue
        for row, column in pairs:
            entry = f" {row + 1}/{column + 1}" if len(pairs) > 1 else ""
            columns.append((f"{name}{entry} [1]", array[:, row, column]))
    return columns
