"""FRFs, coherences and time series in tables of numbers with named columns, whatever the format of the file."""

from __future__ import annotations

import math
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

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
from receptance.io.column_names import (
    PARTS,
    QUALITY_NAMES,
    TableColumn,
    column_unit,
    is_unit,
    level_reference,
    usual_unit,
)
from receptance.io.description import measurement_of
from receptance.io.errors import FileFormatError, check_time, error_location
from receptance.io.measurements import Coherence, Measurement, TimeSeries
from receptance.units import Unit, UnitError, frf_kind, parse_unit

EXAMPLE = "frequency [Hz],accelerance real [m/s^2/N],accelerance imaginary [m/s^2/N],coherence [1]"
"""A header for messages."""
_Entries: TypeAlias = Mapping[str, Mapping[str, int]]
"""Indices of the columns of each response and excitation by role."""


@dataclass(frozen=True)
class NumberTable:
    """Named columns of numbers."""

    columns: tuple[TableColumn, ...]
    values: NDArray[np.float64]
    """`(rows, columns)`."""
    header: int
    """Line number of the header; 0 if it was given as an option."""
    lines: tuple[int, ...]
    about: dict[str, Any] | None
    notes: tuple[str, ...] = ()
    label: str = ""
    averages: int | None = None
    """Number of averages in a line before the header."""
    start_s: float = 0.0
    """Time of the first row, if there is no column of times."""
    step_s: float | None = None
    """Time step that the file states in place of a column of times."""
    step_error_s: float = 0.0
    """Largest error of that step, from the digits with which it is written."""

    def indices(self, role: str) -> list[int]:
        """Return the indices of the columns with a role."""
        return [index for index, column in enumerate(self.columns) if column.role == role]


def measurements_in(table: NumberTable, options: ReadOptions) -> list[Measurement]:
    """Return the FRF or coherence in a table with a frequency, or the time records in another one.

    A table without times needs its time step or the sample rate of the options; a time that begins again begins another
    record.
    """
    frequency, time = table.indices("frequency"), table.indices("time")
    with error_location(line=table.header or None):
        if frequency:
            return [_by_frequency(table, frequency[0], options)]
        return _time_records(table, time[0] if time else None, options)


def measurements_in_rows(
    columns: Sequence[TableColumn], values: Sequence[NDArray[np.float64]], options: ReadOptions
) -> list[Measurement]:
    """Return the measurements in columns of numbers that are no text; errors name the row."""
    rows = tuple(range(1, values[0].size + 1))
    try:
        return measurements_in(NumberTable(tuple(columns), np.stack(values, axis=1), 0, rows, None), options)
    except FileFormatError as error:
        if error.line is None:
            raise
        raise FileFormatError(error.problem, place=f"row {error.line}") from None


def _column_unit(column: TableColumn) -> Unit | None:
    """Return the unit of a column, or None."""
    if not column.unit:
        return None
    try:
        unit = column_unit(column.unit)
        if column.role != "magnitude" and level_reference(column.unit):
            raise UnitError(f"{column.unit!r} is the unit of a magnitude, expected a linear one")
    except UnitError as error:
        raise FileFormatError(f"column {column.name!r}: {error}") from None
    return unit


def _column_in_unit(table: NumberTable, index: int, unit: str) -> NDArray[np.float64]:
    """Return the values of a column in a unit; the column must have a unit of its dimension."""
    column, target = table.columns[index], parse_unit(unit)
    source = _column_unit(column)
    if source is None:
        expected = f"{column.name} [{usual_unit(column) or unit}]"
        raise FileFormatError(
            f"column {column.name!r} has no unit, expected {expected}; {_header_option(table)}", option="columns"
        )
    turns = parse_unit("rad/s")
    if column.role == "frequency" and source.dimension == turns.dimension:
        # An angular frequency in rad/s, or a speed in rpm.
        source = replace(source, factor=source.factor / (2.0 * math.pi), dimension=target.dimension)
    if source.dimension != target.dimension:
        raise FileFormatError(f"column {column.name!r} is in {source.text!r}, expected {unit}")
    values: NDArray[np.float64] = table.values[:, index]
    return values if source.factor == target.factor else values * (source.factor / target.factor)


def _header_option(table: NumberTable) -> str:
    """Return the option that gives the header of a table with the units that it does not state."""
    names = []
    for column in table.columns:
        unit = column.unit or usual_unit(column)
        names.append(f"{column.name} [{unit}]" if unit else column.name)
    return (
        f"give the header with the units, for example columns={names!r} (on the command line --columns "
        f"{shlex.quote(','.join(names))})"
    )


def _time_records(table: NumberTable, time: int | None, options: ReadOptions) -> list[Measurement]:
    """Return the record in a table, or one for each hit if its time begins again."""
    channels = [index for index in range(len(table.columns)) if index != time]
    if not channels:
        raise FileFormatError("there is a time column and no other")
    if table.about is not None and table.about["receptance"] == "time series":
        return [measurement_of({"values": table.values[:, channels]}, table.about, options, table.lines)]
    names = [table.columns[index].name for index in channels]
    units, notes = _channel_units(table, channels, options)
    if time is None and table.step_s is None and options.sample_rate_hz is None:
        raise FileFormatError(
            "there are no times and no sample rate; give it: sample_rate_hz=51200 (on the command line "
            "--sample-rate 51200)"
        )
    count = len(table.lines)
    seconds = np.array([table.start_s]) if time is None else _column_in_unit(table, time, "s")
    if (bad := np.flatnonzero(~np.isfinite(seconds))).size:
        raise FileFormatError(f"the time is {seconds[bad[0]]}, expected a finite number", line=table.lines[bad[0]])
    starts = [0] if time is None else _restarts(table, seconds)
    records: list[Measurement] = []
    rate = options.sample_rate_hz
    for number, (start, end) in enumerate(zip(starts, [*starts[1:], count], strict=True), 1):
        check_time()
        # All records have the rate of the first one, within the digits of the times.
        agreed = replace(options, sample_rate_hz=rate)
        with error_location(line=table.lines[start] if number > 1 else None):
            rate, begins = sampling(seconds[start:end], agreed, step=table.step_s, step_error=table.step_error_s)
        records.append(
            make(
                TimeSeries,
                rows=table.lines[start:end],
                values=table.values[start:end, channels],
                channels=names,
                units=units,
                sample_rate_hz=rate,
                start_s=begins,
                label=f"record {number} of {len(starts)}" if len(starts) > 1 else table.label,
                notes=notes,
            )
        )
    return records


def _channel_units(table: NumberTable, channels: list[int], options: ReadOptions) -> tuple[list[str], list[str]]:
    """Return the unit of each channel, and the notes of the table with those on units that were overridden."""
    names = [table.columns[index].name for index in channels]
    units, notes = [], list(table.notes)
    for index, given in zip(channels, options.channel_units(names), strict=True):
        column = table.columns[index]
        unit = column.unit if given is None or given == SI else given
        if not unit:
            raise FileFormatError(
                f"channel {column.name!r} has no unit; give it, for example unit={{{column.name!r}: 'N'}} (on the "
                f"command line --unit {shlex.quote(f'{column.name}=N')}), or {column.name} [N] as its name",
                option="unit",
            )
        if is_unit(unit) and frf_kind(column_unit(unit)) is not None:
            raise FileFormatError(f"{unit!r} is the unit of an FRF, but column {column.name!r} is a time record")
        if column.unit and unit != column.unit:
            notes.append(f"{column.name}: the unit in the file, {column.unit!r}, was overridden by {unit!r}")
        units.append(unit)
    return units, notes


def _restarts(table: NumberTable, seconds: NDArray[np.float64]) -> list[int]:
    """Return the rows at which the time begins, again after the first; a time that goes back elsewhere raises."""
    starts = [0, *(np.flatnonzero(seconds[1:] < seconds[:-1]) + 1).tolist()]
    step = (seconds[starts[1] - 1] - seconds[0]) / max(starts[1] - 1, 1) if len(starts) > 1 else 0.0
    for start in starts[1:]:
        if not abs(seconds[start] - seconds[0]) <= step:
            raise FileFormatError(
                f"the time is {seconds[start]:.9g} s after {seconds[start - 1]:.9g} s, expected ascending times, or "
                f"times that begin again at {seconds[0]:.9g} s with each hit",
                line=table.lines[start],
            )
    return starts


def _by_frequency(table: NumberTable, frequency: int, options: ReadOptions) -> Measurement:
    lines = _column_in_unit(table, frequency, "Hz")
    entries: dict[str, dict[str, int]] = {}
    for index, column in enumerate(table.columns):
        if column.role in PARTS:
            roles = entries.setdefault(column.entry, {})
            if column.role in roles:
                raise FileFormatError(
                    f"there are two columns {column.name!r}; add the response, such as "
                    f"'{column.name} tip' and '{column.name} nose'"
                )
            roles[column.role] = index
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
        return measurement_of({"frequency_hz": lines, "values": values}, about, options, table.lines)
    return make(Coherence, rows=table.lines, frequency_hz=lines, values=values[:, :, None], notes=_unread_notes(table))


def _coherence(table: NumberTable, index: int) -> NDArray[np.float64]:
    """Return a column from 0 to 1; percent are converted if the column has this unit."""
    return _column_in_unit(table, index, "1") if table.columns[index].unit else table.values[:, index]


def _unread_notes(table: NumberTable) -> list[str]:
    unread = [f"column {column.name!r} was not read" for column in table.columns if column.role == "channel"]
    return [*table.notes, *unread]


def _frf(table: NumberTable, lines: NDArray[np.float64], entries: _Entries, options: ReadOptions) -> FRF:
    parts = [_entry(table, columns, options) for columns in entries.values()]
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
        rows=table.lines,
        frequency_hz=lines,
        values=np.stack([values for values, _ in parts], axis=1)[:, :, None],
        form=kinds[0].form,
        directions=([kind.response for kind in kinds], [kinds[0].excitation]),
        coherence=coherence,
        labels=(list(entries), [""]) if any(entries) else None,
        label=table.label,
        averages=table.averages,
        notes=notes,
        options=options,
    )


def _entry(
    table: NumberTable, indices: Mapping[str, int], options: ReadOptions
) -> tuple[NDArray[np.complex128], Resolved]:
    """Return the values of one response and excitation, with their columns by role, and their kind and factor to SI."""
    check_time()
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
        magnitude = _magnitude(table, indices["magnitude"])
        phase = _column_in_unit(table, indices["phase"], "rad")
        unit = _column_unit(table.columns[indices["phase"]])
        notes = phase_notes(phase, degrees=unit is not None and unit.factor != parse_unit("rad").factor)
        with np.errstate(invalid="ignore"):  # infinite magnitudes are refused with the values
            values = magnitude * np.exp(1j * phase)
    resolved = resolve_frf(
        options,
        declared=declared,
        form=first.form,
        directions=None,
        undeclared=f"column {first.name!r} has no unit, such as {first.name} [m/s^2/N]",
    )
    return to_si(values, resolved.factor), replace(resolved, notes=(*resolved.notes, *notes))


def _magnitude(table: NumberTable, index: int) -> NDArray[np.float64]:
    """Return linear magnitudes in the unit of a column; levels in dB are 20 times the logarithm of a ratio."""
    column, values = table.columns[index], table.values[:, index]
    if column.unit and level_reference(column.unit):
        with np.errstate(over="ignore"):
            # An infinite value is refused with those of the FRF.
            return np.asarray(10.0 ** (values / 20.0))
    negative = np.flatnonzero(values < 0.0)
    if negative.size:
        row = int(negative[0])
        raise FileFormatError(
            f"column {column.name!r} is {values[row]:g}, expected zero or more: a magnitude is not negative; "
            f"if these are levels in dB, state their reference, such as {column.name} [dB re 1 m/s^2/N]",
            line=table.lines[row],
        )
    return np.asarray(values)


def _described_frf(
    table: NumberTable,
    about: dict[str, Any],
    lines: NDArray[np.float64],
    entries: Mapping[str, Mapping[str, int]],
    options: ReadOptions,
) -> Measurement:
    """Return an FRF written by this library, with the fields in the line before the header."""
    values = []
    for indices in entries.values():
        column, resolved = _entry(table, indices, ReadOptions())
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
    return measurement_of(arrays, about, options, table.lines)
