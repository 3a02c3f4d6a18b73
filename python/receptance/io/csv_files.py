"""FRFs, coherences and time series in CSV files and other tables with a header."""

from __future__ import annotations

import csv
import io
import shlex
from typing import Any

import numpy as np
from numpy.typing import NDArray

from receptance._files import inert
from receptance.frf import FRF
from receptance.io.build import complex_values, make, make_frf, sampling, to_si
from receptance.io.description import about_text, arrays_of, measurement_of
from receptance.io.errors import FileFormatError, error_location
from receptance.io.measurements import Coherence, Measurement, TimeSeries
from receptance.io.options import SI, ReadOptions, Resolved, resolve_frf
from receptance.io.table import EXAMPLE, MARK, PARTS, QUALITY_NAMES, Table, column_in_unit, column_unit, read_table
from receptance.io.text import check_ascending


def read_csv(data: bytes, options: ReadOptions) -> list[Measurement]:
    """Return the FRF, coherence or time records in a table of numbers.

    Raises
    ------
    FileFormatError
        A header without quantities or units, or rows that are not numbers; the message names the line.
    """
    table = read_table(data, options)
    frequency, time = table.indices("frequency"), table.indices("time")
    with error_location(line=table.header or None):
        return [_time_series(table, time[0], options) if time else _by_frequency(table, frequency[0], options)]


def _time_series(table: Table, time: int, options: ReadOptions) -> Measurement:
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
    rate, start = sampling(column_in_unit(table, time, "s"), options)
    return make(
        TimeSeries,
        values=table.values[:, channels],
        channels=names,
        units=units,
        sample_rate_hz=rate,
        start_s=start,
        notes=notes,
    )


def _by_frequency(table: Table, frequency: int, options: ReadOptions) -> Measurement:
    lines = column_in_unit(table, frequency, "Hz")
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


def _coherence(table: Table, index: int) -> NDArray[np.float64]:
    """Return a column from 0 to 1; percent are converted if the column has this unit."""
    return column_in_unit(table, index, "1") if table.columns[index].unit else table.values[:, index]


def _unread_notes(table: Table) -> list[str]:
    unread = [f"column {column.name!r} was not read" for column in table.columns if column.role == "channel"]
    return [*table.notes, *unread]


def _frf(table: Table, lines: NDArray[np.float64], entries: list[str], options: ReadOptions) -> FRF:
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


def _entry(table: Table, entry: str, options: ReadOptions) -> tuple[NDArray[np.complex128], Resolved]:
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
    declared = column_unit(first)
    if "real" in indices:
        imaginary = column_unit(table.columns[indices["imaginary"]])
        if declared is not None and imaginary is not None and declared != imaginary:
            raise FileFormatError(f"the real part is in {declared.text!r}, the imaginary part in {imaginary.text!r}")
        values = complex_values(table.values[:, indices["real"]], table.values[:, indices["imaginary"]])
    else:
        _check_magnitude(table, indices["magnitude"])
        values = table.values[:, indices["magnitude"]] * np.exp(1j * column_in_unit(table, indices["phase"], "rad"))
    resolved = resolve_frf(
        options,
        declared=declared,
        form=first.form,
        directions=None,
        undeclared=f"column {first.name!r} has no unit, such as {first.name} [m/s^2/N]",
    )
    return to_si(values, resolved.factor), resolved


def _check_magnitude(table: Table, index: int) -> None:
    negative = np.flatnonzero(table.values[:, index] < 0.0)
    if negative.size:
        row = int(negative[0])
        raise FileFormatError(
            f"column {table.columns[index].name!r} is {table.values[row, index]:g}, expected zero or more: a magnitude "
            "is not negative; if these are levels in dB, export linear values",
            line=table.lines[row],
        )


def _described_frf(
    table: Table, about: dict[str, Any], lines: NDArray[np.float64], entries: list[str], options: ReadOptions
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
