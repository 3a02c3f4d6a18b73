"""FRFs, coherences and time records in tables with a header that names quantity and unit."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from receptance.frf import FRF
from receptance.io.build import in_si, joined, make_frf, sampled
from receptance.io.coherence import Coherence
from receptance.io.errors import FileFormatError
from receptance.io.fields import thing_of
from receptance.io.options import SI, ReadOptions, Resolved, resolve_frf, several_channels
from receptance.io.tables.columns import QUALITIES
from receptance.io.tables.table import EXAMPLE, Table, column_unit, read_table, scaled
from receptance.io.text import check_ascending
from receptance.io.time_series import TimeSeries

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["read_csv"]

_PARTS = ("real", "imaginary", "magnitude", "phase")


def read_csv(data: bytes, options: ReadOptions) -> list[FRF | TimeSeries | Coherence]:
    """Return the FRF, coherence or time records in a table of numbers.

    Raises
    ------
    FileFormatError
        A header without quantities or units, or rows that are not numbers; the message names the line.
    """
    table = read_table(data, options)
    frequency, time = table.of("frequency"), table.of("time")
    try:
        if time:
            return [_time_series(table, time[0], options)]
        return [_by_frequency(table, frequency[0], options)]
    except FileFormatError as error:
        line = error.line if error.line is not None else table.header or None
        raise FileFormatError(error.problem, line=line, place=error.place) from None


def _time_series(table: Table, time: int, options: ReadOptions) -> TimeSeries:
    channels = [index for index in range(len(table.columns)) if index != time]
    if not channels:
        raise FileFormatError("there is a time column and no other")
    if table.about is not None and table.about["receptance"] == "time series":
        made = thing_of({"values": table.values[:, channels]}, table.about, options)
        assert isinstance(made, TimeSeries)
        return made
    names = [table.columns[index].name for index in channels]
    if isinstance(options.unit, str) and options.unit != SI and len(names) > 1:
        raise FileFormatError(several_channels(names, options.unit))
    units, notes = [], list(table.notes)
    for index in channels:
        column = table.columns[index]
        given = options.channel_unit(column.name)
        if (given is None or given == SI) and not column.unit:
            raise FileFormatError(
                f"column {column.name!r} says no unit; write {column.name} [N], say, or give "
                f"unit={{{column.name!r}: 'N'}}"
            )
        unit = column.unit if given is None or given == SI else given
        if column.unit and unit != column.unit:
            notes.append(f"{column.name}: the unit in the file, {column.unit!r}, was overruled by {unit!r}")
        units.append(unit or "")
    rate, start = sampled(scaled(table, time, "s"), options)
    try:
        return TimeSeries(
            values=table.values[:, channels],
            channels=names,
            units=units,
            sample_rate_hz=rate,
            start_s=start,
            notes=notes,
        )
    except ValueError as error:
        raise FileFormatError(str(error)) from None


def _by_frequency(table: Table, frequency: int, options: ReadOptions) -> FRF | Coherence:
    lines = scaled(table, frequency, "Hz")
    check_ascending(lines.tolist(), table.lines)
    entries = list(dict.fromkeys(column.entry for column in table.columns if column.role in _PARTS))
    own = table.about["receptance"] if table.about is not None else ""
    if entries:
        return _own_frf(table, lines, entries, options) if own == "frf" else _frf(table, lines, entries, options)
    coherence = table.of("coherence")
    if not coherence:
        raise FileFormatError(f"no column is an FRF or a coherence; expected a header such as {EXAMPLE}")
    values = np.stack([_coherence(table, index) for index in coherence], axis=1)
    if table.about is not None and own == "coherence":
        made = thing_of({"frequency_hz": lines, "values": values}, table.about, options)
        assert isinstance(made, Coherence)
        return made
    return Coherence(frequency_hz=lines, values=values[:, :, None], notes=_unread(table))


def _coherence(table: Table, index: int) -> NDArray[np.float64]:
    """Return a column from 0 to 1; without a unit it is taken as such, in percent it is converted."""
    return scaled(table, index, "1") if table.columns[index].unit else table.values[:, index]


def _unread(table: Table) -> list[str]:
    unread = (f"column {column.name!r} was not read" for column in table.columns if column.role == "channel")
    return [*table.notes, *unread]


def _frf(table: Table, lines: NDArray[np.float64], entries: list[str], options: ReadOptions) -> FRF:
    parts = [_entry(table, entry, options) for entry in entries]
    kinds = [resolved.kind for _, resolved in parts]
    if len({(kind.form, kind.excitation) for kind in kinds}) > 1:
        raise FileFormatError(
            "the columns are of different forms, or per force and per moment; put them into several files"
        )
    of_coherence = {table.columns[index].entry: index for index in table.of("coherence")}
    coherence = None
    if of_coherence:
        if set(of_coherence) != set(entries):
            raise FileFormatError("the coherence columns do not belong to the FRF columns: each needs its own")
        coherence = np.stack([_coherence(table, of_coherence[entry]) for entry in entries], axis=1)[:, :, None]
    notes = [*_unread(table), *dict.fromkeys(note for _, resolved in parts for note in resolved.notes)]
    return make_frf(
        frequency_hz=lines,
        values=np.stack([values for values, _ in parts], axis=1)[:, :, None],
        form=kinds[0].form,
        directions=([kind.response for kind in kinds], [kinds[0].excitation]),
        coherence=coherence,
        labels=(entries, [""]) if any(entries) else None,
        notes=notes,
        options=options,
    )


def _entry(table: Table, entry: str, options: ReadOptions) -> tuple[NDArray[np.complex128], Resolved]:
    """Return the values of one response and excitation in SI, and what they are."""
    found: dict[str, int] = {}
    for index, column in enumerate(table.columns):
        if column.role in _PARTS and column.entry == entry:
            if column.role in found:
                raise FileFormatError(
                    f"there are two columns {column.name!r}; add which response they are, such as "
                    f"'{column.name} tip' and '{column.name} nose'"
                )
            found[column.role] = index
    if set(found) not in ({"real", "imaginary"}, {"magnitude", "phase"}):
        names = ", ".join(repr(table.columns[index].name) for index in found.values())
        raise FileFormatError(f"found {names}, expected a real and an imaginary part, or a magnitude and a phase")
    first = table.columns[found["real" if "real" in found else "magnitude"]]
    declared = column_unit(first)
    if "real" in found:
        other = column_unit(table.columns[found["imaginary"]])
        if (
            declared is not None
            and other is not None
            and declared != other
            and ((declared.dimension, declared.factor) != (other.dimension, other.factor))
        ):
            raise FileFormatError(f"the real part is in {declared.text!r}, the imaginary part in {other.text!r}")
        values = joined(table.values[:, found["real"]], table.values[:, found["imaginary"]])
    else:
        values = table.values[:, found["magnitude"]] * np.exp(1j * scaled(table, found["phase"], "rad"))
    resolved = resolve_frf(
        options,
        declared=declared,
        form=first.form,
        directions=None,
        undeclared=f"column {first.name!r} says no unit, such as {first.name} [m/s^2/N]",
    )
    return in_si(values, resolved.factor), resolved


def _own_frf(table: Table, lines: NDArray[np.float64], entries: list[str], options: ReadOptions) -> FRF:
    """Return an FRF that this library wrote, with what stands in the line before the header."""
    assert table.about is not None
    values = []
    for entry in entries:
        column, resolved = _entry(table, entry, ReadOptions())
        if resolved.factor != 1.0 or resolved.kind.form != table.about.get("form"):
            raise FileFormatError(
                f"the header says {resolved.kind.form} and not SI or not {table.about.get('form')!r}, as the line "
                "'# receptance:' above does; leave out that line if the header is right"
            )
        values.append(column)
    arrays: dict[str, NDArray[Any]] = {"frequency_hz": lines, "values": np.stack(values, axis=1)}
    for role in ("coherence", *QUALITIES.values()):
        columns = table.of(role)
        if columns:
            arrays[role] = table.values[:, columns]
    made = thing_of(arrays, table.about, options)
    assert isinstance(made, FRF)
    return made
