"""FRFs, coherences and time series in CSV files and other tables with a header."""

from __future__ import annotations

import csv
import io
import re
import shlex
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from receptance._files import inert
from receptance.frf import FRF
from receptance.io.build import (
    SI,
    ReadOptions,
    Resolved,
    complex_values,
    make,
    make_frf,
    phase_notes,
    resolve_frf,
    sampling,
    to_si,
)
from receptance.io.description import QUALITY, about_text, arrays_of, measurement_of, parse_about
from receptance.io.errors import MAX_NUMBERS, FileFormatError, check_count, check_time, error_location
from receptance.io.measurements import Coherence, Measurement, TimeSeries
from receptance.io.text import (
    check_ascending,
    check_row_count,
    decode,
    number,
    numbered_lines,
    parse_rows,
    truncation_notes,
)
from receptance.units import FORM_NAMES, Form, Unit, UnitError, form_name, frf_kind, parse_unit

QUALITY_NAMES = {field: field.replace("_", " ") for field in QUALITY}
"""Names of the columns of further fields of an FRF."""
PARTS = {
    "real": ("real", "re", "realteil"),
    "imaginary": ("imaginary", "imag", "im", "imaginärteil", "imaginaerteil"),
    "magnitude": ("magnitude", "mag", "amplitude", "ampl", "amp", "abs", "betrag"),
    "phase": ("phase", "angle", "arg", "phasenwinkel"),
}
"""Roles of the columns of an FRF, with the words for them in names of columns."""
_AXES = {
    "frequency": ("frequency", "freq", "freq.", "f", "frequenz", "fréquence", "frequence", "frequenza", "frecuencia"),
    "time": ("time", "t", "zeit", "temps", "tempo", "tiempo"),
}
"""Roles of the first column, with the words for them."""
_COHERENCE = ("coherence", "coh", "coh.", "kohärenz", "kohaerenz", "cohérence", "coherencia", "gamma2", "γ²")
_FORMS = "|".join(FORM_NAMES)
_ESTIMATE = "frf|h[12v]?"
"""Names of an FRF that do not state its form: the letter of the transfer function, and its estimators."""
_PART = "|".join(word for words in PARTS.values() for word in words)
_FRF = re.compile(
    rf"(?:(?P<form>{_FORMS}|{_ESTIMATE})\s+)?(?P<part>{_PART})(?:\s+part)?(?:\s+(?P<after>{_FORMS}|frf))?"
    r"(?:\s+(?P<entry>.+))?",
    re.IGNORECASE,
)
_PART_OF = re.compile(rf"(?P<part>{_PART})\s*[({{]\s*(?P<form>{_FORMS}|{_ESTIMATE})\s*[)}}]", re.IGNORECASE)
"""A part as a function, as in `Re(H1)`; the parentheses hold no unit."""
_MAGNITUDE = re.compile(rf"\|\s*(?P<form>{_FORMS}|{_ESTIMATE})\s*\|", re.IGNORECASE)
"""A magnitude as in `|H|`."""
_QUALITY = re.compile(
    rf"(?P<name>{'|'.join(map(re.escape, _COHERENCE))}|{'|'.join(QUALITY_NAMES.values())})(?:\s+(?P<entry>.+))?",
    re.IGNORECASE,
)
_BRACKETS = re.compile(r"(?P<name>.*?)\s*\[(?P<unit>[^\[\]]*)\]", re.DOTALL)
_PARENTHESES = re.compile(r"(?P<name>[^()]*?)\s*\((?P<unit>.*)\)", re.DOTALL)
_SLASH = re.compile(r"(?P<name>[^/_]*?)\s*[/_]\s*(?P<unit>.+)", re.DOTALL)
"""A unit behind a slash (DIN 1313) or an underscore, as in `Frequenz / Hz` and `freq_Hz`."""


@dataclass(frozen=True)
class CsvColumn:
    """Meaning of a column, from its name."""

    name: str
    """Name without the unit."""
    unit: str | None
    role: str
    """frequency, time, real, imaginary, magnitude, phase, coherence, a field of QUALITY, or channel."""
    form: Form | None = None
    entry: str = ""
    """Response and excitation, if there are several."""


def parse_column(text: str) -> CsvColumn:
    """Return the meaning of a column name such as `accelerance real [m/s^2/N]` or `tip (g)`.

    Examples
    --------
    >>> from receptance.io.csv_files import parse_column
    >>> parse_column("Inertance imag 2/1 [m/s^2/N]")
    CsvColumn(name='Inertance imag 2/1', unit='m/s^2/N', role='imaginary', form='accelerance', entry='2/1')
    """
    text = text.strip()
    if (match := _BRACKETS.fullmatch(text)) and match["name"].strip():
        return _named(match["name"].strip(), match["unit"].strip())
    if match := _SLASH.fullmatch(text):
        column = _named(match["name"], match["unit"].strip())
        # Other slashes and underscores belong to the name, such as those of the entry `2/1`.
        if _has_unit_of_role(column):
            return column
    match = None if _PART_OF.fullmatch(text) else _PARENTHESES.fullmatch(text)
    if match and match["name"].strip():
        return _named(match["name"].strip(), match["unit"].strip())
    column = _named(text, None)
    return column if column.role != "channel" else replace(_named(text.replace("_", " "), None), name=text)


def _named(name: str, unit: str | None) -> CsvColumn:
    """Return the meaning of a name without its unit."""
    for role, words in _AXES.items():
        if name.lower() in words:
            return CsvColumn(name, unit, role)
    if quality := _QUALITY.fullmatch(name):
        field = quality["name"].lower().replace(" ", "_")
        return CsvColumn(name, unit, field if field in QUALITY else "coherence", entry=quality["entry"] or "")
    if frf := _FRF.fullmatch(name):
        word = frf["form"] or frf["after"] or ""
        return CsvColumn(name, unit, _role(frf["part"]), _form(word), frf["entry"] or "")
    if part := _PART_OF.fullmatch(name):
        return CsvColumn(name, unit, _role(part["part"]), _form(part["form"]))
    if magnitude := _MAGNITUDE.fullmatch(name):
        return CsvColumn(name, unit, "magnitude", _form(magnitude["form"]))
    return CsvColumn(name, unit, "channel")


def _role(word: str) -> str:
    return next(role for role, words in PARTS.items() if word.lower() in words)


def _form(word: str) -> Form | None:
    return form_name(word) if word.lower() in FORM_NAMES else None


def _has_unit_of_role(column: CsvColumn) -> bool:
    """Return whether the unit is one of the quantity that the column has by its name."""
    try:
        unit = parse_unit(column.unit or "")
    except UnitError:
        return False
    if column.role in ("real", "imaginary", "magnitude"):
        return frf_kind(unit) is not None
    expected = _UNITS.get(column.role)
    return expected is not None and unit.dimension == parse_unit(expected).dimension


MARK = "# receptance: "
"""Beginning of the line with the fields of a measurement that columns do not hold."""
EXAMPLE = "frequency [Hz],accelerance real [m/s^2/N],accelerance imaginary [m/s^2/N],coherence [1]"
_UNITS = {"frequency": "Hz", "time": "s", "phase": "deg"}
"""Usual units of columns whose quantity follows from their name."""
_BLANKS = " "
"""Delimiter of columns of numbers that are separated by any number of blanks."""
_DELIMITERS = f"\t;,{_BLANKS}"
_CELL = re.compile(r"[^\s\[(]+(?:\s?[\[(][^\])]*[\])])?|[\[(][^\])]*[\])]")
"""A cell between blanks: a number, or a name with its unit in brackets."""
_AVERAGES = re.compile(
    r"#?\W*(?:(?:number|no\.?|nr\.?|anzahl)\s+(?:of\s+)?)?(?:averages?|averaging|avg\.?|mittelungen|mittelungszahl|moyennes|"
    r"promedios|medie)\W+(?P<count>\d{1,6})\W*",
    re.IGNORECASE,
)
"""A line before the header with the number of averages."""
_MAX_NAME_LENGTH = 1000
_MAX_PREAMBLE = 1000
"""Lines within which a header is searched for."""
_MAY_BE_INFINITE = ("log_variance", "degrees_of_freedom")


@dataclass(frozen=True)
class CsvTable:
    """Named columns of numbers."""

    columns: tuple[CsvColumn, ...]
    values: NDArray[np.float64]
    """`(rows, columns)`."""
    header: int
    """Line number of the header; 0 if it was given as an option."""
    lines: tuple[int, ...]
    about: dict[str, Any] | None
    notes: tuple[str, ...] = ()
    averages: int | None = None
    """Number of averages in a line before the header."""

    def indices(self, role: str) -> list[int]:
        """Return the indices of the columns with a role."""
        return [index for index, column in enumerate(self.columns) if column.role == role]


def _read_table(data: bytes, options: ReadOptions) -> CsvTable:
    """Return the table in a file, with its header or that of the options."""
    content = decode(data)
    lines = numbered_lines(content)
    about = None
    for line, text in lines:
        if text.startswith(MARK):
            with error_location(line=line):
                about = parse_about(text.removeprefix(MARK).strip())
    every = lines
    lines = [(line, text) for line, text in lines if not text.startswith("#")]
    if not lines:
        raise FileFormatError(f"the file is empty, expected a header such as {EXAMPLE} and rows of numbers")
    skipped, delimiter = _layout(lines, options.columns)
    lines = lines[skipped:]
    notes = [_skipped(skipped, lines[0][0])] if skipped else []
    averages = None if about is not None else _averages([one for one in every if one[0] < lines[0][0]], notes)
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
            f"columns=[...] (on the command line --columns), a name with its unit for each of the {len(names)} columns",
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
            "time [s],hammer [N],tip [m/s^2]. If the file has no header or one with other names, give it with "
            "columns=[...] (on the command line --columns), a name with its unit for each column",
            line=header or None,
        )
    if not rows:
        raise FileFormatError("there are no rows of numbers below the header", line=header or None)
    if delimiter == "," and len(rows[0][1]) > len(columns) and all(re.fullmatch(r"\s*-?\d+", x) for x in rows[0][1]):
        raise FileFormatError(
            f"there are {len(rows[0][1])} columns of whole numbers, expected {len(columns)}: commas seem to be decimal "
            "signs as well as separators; export the table with semicolons or tabs between its columns",
            line=rows[0][0],
        )
    # The first row below a given header is not quoted, because the file may be anything.
    values = parse_rows(
        rows,
        [f"column {column.name!r}" for column in columns],
        decimal_comma=delimiter != ",",
        quote_first_row=options.columns is None,
    )
    table = CsvTable(tuple(columns), values, header, tuple(line for line, _ in rows), about, averages=averages)
    _check_finite(table)
    declared = None if about is None else about.get("rows")
    if isinstance(declared, int):
        check_row_count(content, len(rows), declared, lines[-1][0])
    else:
        notes += truncation_notes(content, lines[-len(rows) :])
    return replace(table, notes=tuple(notes))


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


def _are_units(columns: Sequence[CsvColumn], fields: Sequence[str], delimiter: str) -> bool:
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


def _with_units(
    columns: Sequence[CsvColumn], line: int, fields: Sequence[str], options: ReadOptions
) -> list[CsvColumn]:
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


def _layout(lines: Sequence[tuple[int, str]], given: Sequence[str] | None) -> tuple[int, str]:
    """Return the number of lines before the header, or before the table if the header is given, and the delimiter.

    A header names a frequency or a time, and the row below it, or below a row of units, has a number for each name. A
    given header replaces the lines above the first row with as many numbers. Without a line that can be a header it is
    the line above the first row of numbers, for the message.
    """
    if given is None:
        for index, (line, text) in enumerate(lines[:_MAX_PREAMBLE]):
            for delimiter in _DELIMITERS:
                cells = _fields(line, text, delimiter)
                if any(len(name) <= _MAX_NAME_LENGTH and parse_column(name).role in _AXES for name in cells) and (
                    (index == 0 and delimiter != _BLANKS) or _has_numbers_below(lines, index, len(cells), delimiter)
                ):
                    return index, delimiter
    for index, (line, text) in enumerate(lines[:_MAX_PREAMBLE]):
        for delimiter in _DELIMITERS:
            cells = _fields(line, text, delimiter)
            if not cells or not _are_numbers(cells, delimiter) or len(cells) != len(given or cells):
                continue
            above = [_fields(*lines[before], delimiter) for before in (index - 1, index - 2) if before >= 0]
            names = int(bool(above) and len(above[0]) == len(cells))
            if given and len(above) > names == 1 and len(above[1]) == len(cells):
                # Names with a row of units below.
                names += _are_units([parse_column(name) for name in given], above[0], delimiter)
            return index - names, delimiter
    line, text = lines[0]
    found = next((delimiter for delimiter in _DELIMITERS if delimiter != _BLANKS and delimiter in text), None)
    if found is None:
        raise FileFormatError("this line has no columns separated by commas, semicolons or tabs", line=line)
    return 0, found


def _has_numbers_below(lines: Sequence[tuple[int, str]], index: int, count: int, delimiter: str) -> bool:
    """Return whether one of the next two lines has so many numbers."""
    below = (_fields(*line, delimiter) for line in lines[index + 1 : index + 3])
    return any(len(cells) == count and _are_numbers(cells, delimiter) for cells in below)


def _are_numbers(cells: Sequence[str], delimiter: str) -> bool:
    return all(_is_number(cell, delimiter) for cell in cells)


def _fields(line: int, text: str, delimiter: str) -> list[str]:
    """Return the columns of a line, without trailing empty ones; none without a delimiter."""
    try:
        ((_, fields),) = _split([(line, text)], delimiter)
    except FileFormatError:
        return []
    while fields and not fields[-1].strip():
        fields.pop()
    return fields if len(fields) > 1 else []


def _split(lines: Sequence[tuple[int, str]], delimiter: str) -> list[tuple[int, list[str]]]:
    rows: list[tuple[int, list[str]]] = []
    count = 0
    for index, (line, text) in enumerate(lines):
        if index % 1024 == 0:
            check_time()
        count += text.count(delimiter) + 1
        check_count(count, MAX_NUMBERS, "numbers")
        if delimiter == _BLANKS:
            rows.append((line, text.split() if "(" not in text and "[" not in text else _CELL.findall(text)))
            continue
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


def _check_finite(table: CsvTable) -> None:
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


def _column_unit(column: CsvColumn) -> Unit | None:
    """Return the unit of a column, or None."""
    if not column.unit:
        return None
    try:
        return parse_unit(column.unit)
    except UnitError as error:
        raise FileFormatError(f"column {column.name!r}: {error}") from None


def _column_in_unit(table: CsvTable, index: int, unit: str) -> NDArray[np.float64]:
    """Return the values of a column in a unit; the column must have a unit of its dimension."""
    column, target = table.columns[index], parse_unit(unit)
    source = _column_unit(column)
    if source is None:
        expected = f"{column.name} [{_UNITS.get(column.role, unit)}]"
        raise FileFormatError(f"column {column.name!r} has no unit, expected {expected}; {_header_option(table)}")
    if source.dimension != target.dimension:
        raise FileFormatError(f"column {column.name!r} is in {source.text!r}, expected {unit}")
    values: NDArray[np.float64] = table.values[:, index]
    return values if source.factor == target.factor else values * (source.factor / target.factor)


def _header_option(table: CsvTable) -> str:
    """Return the option that gives the header of a table with the units that it does not state."""
    names = []
    for column in table.columns:
        unit = column.unit or _UNITS.get(column.role)
        names.append(f"{column.name} [{unit}]" if unit else column.name)
    return (
        f"give the header with the units, for example columns={names!r} (on the command line --columns "
        f"{shlex.quote(','.join(names))})"
    )


def read_csv(data: bytes, options: ReadOptions) -> list[Measurement]:
    """Return the FRF, coherence or time records in a table of numbers; errors name the line."""
    table = _read_table(data, options)
    frequency, time = table.indices("frequency"), table.indices("time")
    with error_location(line=table.header or None):
        return [_time_series(table, time[0], options) if time else _by_frequency(table, frequency[0], options)]


def _time_series(table: CsvTable, time: int, options: ReadOptions) -> Measurement:
    channels = [index for index in range(len(table.columns)) if index != time]
    if not channels:
        raise FileFormatError("there is a time column and no other")
    if table.about is not None and table.about["receptance"] == "time series":
        return measurement_of({"values": table.values[:, channels]}, table.about, options)
    names = [table.columns[index].name for index in channels]
    units, notes = [], list(table.notes)
    for index, given in zip(channels, options.channel_units(names), strict=True):
        column = table.columns[index]
        unit = column.unit if given is None or given == SI else given
        if not unit:
            raise FileFormatError(
                f"column {column.name!r} has no unit; write {column.name} [N], for example, or give "
                f"unit={{{column.name!r}: 'N'}} (on the command line --unit {shlex.quote(f'{column.name}=N')})"
            )
        if column.unit and unit != column.unit:
            notes.append(f"{column.name}: the unit in the file, {column.unit!r}, was overridden by {unit!r}")
        units.append(unit)
    rate, start = sampling(_column_in_unit(table, time, "s"), options)
    return make(
        TimeSeries,
        values=table.values[:, channels],
        channels=names,
        units=units,
        sample_rate_hz=rate,
        start_s=start,
        notes=notes,
    )


def _by_frequency(table: CsvTable, frequency: int, options: ReadOptions) -> Measurement:
    lines = _column_in_unit(table, frequency, "Hz")
    check_ascending(lines.tolist(), table.lines)
    entries = list(dict.fromkeys(column.entry for column in table.columns if column.role in PARTS))
    about = table.about or {"receptance": ""}
    if entries and about["receptance"] == "frf":
        return _described_frf(table, about, lines, entries, options)
    if entries:
        return _frf(table, lines, entries, options)
    coherence = table.indices("coherence")
    if not coherence:
        raise FileFormatError(f"no column is an FRF or a coherence; expected a header such as {EXAMPLE}")
    values = np.stack([_coherence(table, index) for index in coherence], axis=1)
    if about["receptance"] == "coherence":
        return measurement_of({"frequency_hz": lines, "values": values}, about, options)
    return make(Coherence, frequency_hz=lines, values=values[:, :, None], notes=_unread_notes(table))


def _coherence(table: CsvTable, index: int) -> NDArray[np.float64]:
    """Return a column from 0 to 1; percent are converted if the column has this unit."""
    return _column_in_unit(table, index, "1") if table.columns[index].unit else table.values[:, index]


def _unread_notes(table: CsvTable) -> list[str]:
    unread = [f"column {column.name!r} was not read" for column in table.columns if column.role == "channel"]
    return [*table.notes, *unread]


def _frf(table: CsvTable, lines: NDArray[np.float64], entries: list[str], options: ReadOptions) -> FRF:
    parts = [_entry(table, entry, options) for entry in entries]
    kinds = [resolved.kind for _, resolved in parts]
    if len({(kind.form, kind.excitation) for kind in kinds}) > 1:
        raise FileFormatError("the columns have different forms, or are per force and per moment; use several files")
    coherence_columns = {table.columns[index].entry: index for index in table.indices("coherence")}
    coherence = None
    if coherence_columns:
        if set(coherence_columns) != set(entries):
            raise FileFormatError("the coherence columns do not match the FRF columns, expected one for each")
        coherence = np.stack([_coherence(table, coherence_columns[entry]) for entry in entries], axis=1)[:, :, None]
    notes = [*_unread_notes(table), *dict.fromkeys(note for _, resolved in parts for note in resolved.notes)]
    return make_frf(
        frequency_hz=lines,
        values=np.stack([values for values, _ in parts], axis=1)[:, :, None],
        form=kinds[0].form,
        directions=([kind.response for kind in kinds], [kinds[0].excitation]),
        coherence=coherence,
        labels=(entries, [""]) if any(entries) else None,
        averages=table.averages,
        notes=notes,
        options=options,
    )


def _entry(table: CsvTable, entry: str, options: ReadOptions) -> tuple[NDArray[np.complex128], Resolved]:
    """Return the values of one response and excitation, their kind and factor to SI."""
    indices: dict[str, int] = {}
    for index, column in enumerate(table.columns):
        if column.role in PARTS and column.entry == entry:
            if column.role in indices:
                raise FileFormatError(
                    f"there are two columns {column.name!r}; add the response, such as "
                    f"'{column.name} tip' and '{column.name} nose'"
                )
            indices[column.role] = index
    if set(indices) not in ({"real", "imaginary"}, {"magnitude", "phase"}):
        names = ", ".join(repr(table.columns[index].name) for index in indices.values())
        raise FileFormatError(f"found {names}, expected a real and an imaginary part, or a magnitude and a phase")
    first = table.columns[indices["real" if "real" in indices else "magnitude"]]
    declared = _column_unit(first)
    notes: list[str] = []
    if "real" in indices:
        imaginary = _column_unit(table.columns[indices["imaginary"]])
        if declared is not None and imaginary is not None and declared != imaginary:
            raise FileFormatError(
                f"the real part is in {declared.text!r}, the imaginary part in {imaginary.text!r}, expected one unit"
            )
        values = complex_values(table.values[:, indices["real"]], table.values[:, indices["imaginary"]])
    else:
        _check_magnitude(table, indices["magnitude"])
        phase = _column_in_unit(table, indices["phase"], "rad")
        unit = _column_unit(table.columns[indices["phase"]])
        notes = phase_notes(phase, degrees=unit is not None and unit.factor != parse_unit("rad").factor)
        values = table.values[:, indices["magnitude"]] * np.exp(1j * phase)
    resolved = resolve_frf(
        options,
        declared=declared,
        form=first.form,
        directions=None,
        undeclared=f"column {first.name!r} has no unit, such as {first.name} [m/s^2/N]",
    )
    return to_si(values, resolved.factor), replace(resolved, notes=(*resolved.notes, *notes))


def _check_magnitude(table: CsvTable, index: int) -> None:
    negative = np.flatnonzero(table.values[:, index] < 0.0)
    if negative.size:
        row = int(negative[0])
        raise FileFormatError(
            f"column {table.columns[index].name!r} is {table.values[row, index]:g}, expected zero or more: a magnitude "
            "is not negative; if these are levels in dB, export linear values",
            line=table.lines[row],
        )


def _described_frf(
    table: CsvTable, about: dict[str, Any], lines: NDArray[np.float64], entries: list[str], options: ReadOptions
) -> Measurement:
    """Return an FRF written by this library, with the fields in the line before the header."""
    values = []
    for entry in entries:
        column, resolved = _entry(table, entry, ReadOptions())
        if resolved.factor != 1.0 or resolved.kind.form != about.get("form"):
            raise FileFormatError(
                f"the header states {resolved.kind.form}, not in SI or other than {about.get('form')!r} in the "
                "line '# receptance:' above; remove that line if the header is correct"
            )
        values.append(column)
    arrays: dict[str, NDArray[Any]] = {"frequency_hz": lines, "values": np.stack(values, axis=1)}
    for role in ("coherence", *QUALITY_NAMES):
        columns = table.indices(role)
        if columns:
            arrays[role] = table.values[:, columns]
    return measurement_of(arrays, about, options)


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
