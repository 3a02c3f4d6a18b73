"""Tables with a header that names quantity and unit, with numbers that read back as they were."""

from __future__ import annotations

import csv
import io
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance._files import inert
from receptance.frf import FRF
from receptance.io.coherence import Coherence
from receptance.io.fields import about_text, arrays_of
from receptance.io.tables.columns import QUALITIES
from receptance.io.tables.table import MARK
from receptance.io.time_series import TimeSeries

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["csv_bytes"]

_NAMES = {field: name for name, field in QUALITIES.items()}


def csv_bytes(thing: FRF | TimeSeries | Coherence) -> bytes:
    """Return the contents of a CSV file; nothing is lost, numbers have all digits that they need."""
    columns = _time_columns(thing) if isinstance(thing, TimeSeries) else _frequency_columns(thing)
    stream = io.StringIO()
    stream.write(f"{MARK}{about_text(thing, rows=len(columns[0][1]))}\n")
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow([inert(name) for name, _ in columns])
    writer.writerows(zip(*([repr(x) for x in values.tolist()] for _, values in columns), strict=True))
    return stream.getvalue().encode()


def _time_columns(series: TimeSeries) -> list[tuple[str, NDArray[Any]]]:
    columns = [("time [s]", series.time_s)]
    for index, (name, unit) in enumerate(zip(series.channels, series.units, strict=True)):
        columns.append((" ".join(f"{name} [{unit}]".split()), series.values[:, index]))
    return columns


def _frequency_columns(thing: FRF | Coherence) -> list[tuple[str, NDArray[Any]]]:
    arrays = arrays_of(thing)
    columns: list[tuple[str, NDArray[Any]]] = [("frequency [Hz]", arrays.pop("frequency_hz"))]
    values = arrays.pop("values")
    pairs = [(row, column) for row in range(values.shape[1]) for column in range(values.shape[2])]
    for row, column in pairs:
        entry = f" {row + 1}/{column + 1}" if len(pairs) > 1 else ""
        one = values[:, row, column]
        if isinstance(thing, FRF):
            unit = thing.units[row][column]
            columns.append((f"{thing.form} real{entry} [{unit}]", one.real))
            columns.append((f"{thing.form} imaginary{entry} [{unit}]", one.imag))
        else:
            columns.append((f"coherence{entry} [1]", one))
    for field, array in arrays.items():
        name = _NAMES.get(field, field)
        if array.dtype.kind == "b":
            array = array.astype(np.int64)
        if array.ndim == 1:
            columns.append((f"{name} [1]", array))
            continue
        for row, column in pairs:
            entry = f" {row + 1}/{column + 1}" if len(pairs) > 1 else ""
            columns.append((f"{name}{entry} [1]", array[:, row, column]))
    return columns
