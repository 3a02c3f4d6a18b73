"""The contents of a measurement file as a result: tables, figure and data."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from os import PathLike
from pathlib import Path
from typing import Any, Unpack

import numpy as np

from receptance.errors import collected_warnings
from receptance.frf import FRF
from receptance.io.build import ReadKeywords
from receptance.io.files import FORMATS, file_format, read_all
from receptance.io.measurements import Measurement, TimeSeries
from receptance.report import Provenance, Result, Table

MOST_DRAWN = 4
"""Most measurements of one file in a figure."""


@dataclass(frozen=True)
class FileContents(Result):
    """Measurements of one file, as `receptance show` prints and draws them.

    Examples
    --------
    >>> from receptance.io import Coherence
    >>> from receptance.io.contents import FileContents
    >>> found = FileContents("a.csv", "table", (Coherence(frequency_hz=[1.0, 2.0], values=[0.9, 1.0]),))
    >>> found.data()["measurements"][0]["median_coherence"]
    0.95
    """

    name: str
    """Name of the file."""
    format: str
    """Format in words."""
    measurements: tuple[Measurement, ...]
    """The contents."""
    warned: tuple[str, ...] = ()
    """Warnings of the reader."""
    provenance: Provenance = field(default_factory=Provenance)

    heading = "Contents of a file"
    plotted_by = "receptance.io.figure:draw_contents"

    @classmethod
    def read(cls, path: str | PathLike[str], **options: Unpack[ReadKeywords]) -> FileContents:
        """Return what a file contains, with the warnings of its reader; options and errors are those of `read_all`."""
        with collected_warnings() as warned:
            measurements = read_all(path, **options)
            kind = options.get("format") or file_format(path)
        return cls(Path(path).name, FORMATS[kind].title, tuple(measurements), tuple(warned))

    @property
    def title(self) -> str:
        """Name of the file, and its only measurement or their number."""
        if len(self.measurements) == 1:
            return f"{self.name}: {self.measurements[0].title}"
        return f"{self.name}: {len(self.measurements)} measurements"

    @property
    def description(self) -> str:
        """Format of the file."""
        return f"Format: {self.format}"

    @property
    def notes(self) -> tuple[str, ...]:
        """Warnings of the reader and notes on the measurements, each once."""
        notes = dict.fromkeys(
            [*self.warned, *(note for measurement in self.measurements for note in measurement.notes)]
        )
        if len(self.measurements) > MOST_DRAWN:
            notes[
                f"the figure shows the first {MOST_DRAWN} of {len(self.measurements)} measurements; "
                "`--number N` shows another"
            ] = None
        return tuple(notes)

    def tables(self) -> list[Table]:
        """Return the tables of all measurements, with their numbers if there are several."""
        found = []
        for number, measurement in enumerate(self.measurements, 1):
            first, *others = measurement.tables()
            named = f"{number}: {measurement.title}" if len(self.measurements) > 1 else first.title
            found += [replace(first, title=named), *others]
        return found

    def data(self) -> dict[str, Any]:
        """Return the format, and kind, band, unit and quality of each measurement."""
        return {"file": self.name, "format": self.format, "measurements": list(map(_facts, self.measurements))}


def _facts(measurement: Measurement) -> dict[str, Any]:
    if isinstance(measurement, TimeSeries):
        return {
            "title": measurement.title,
            "kind": "time records",
            "samples": len(measurement),
            "sample_rate_hz": measurement.sample_rate_hz,
            "channels": dict(zip(measurement.channels, measurement.units, strict=True)),
        }
    coherence = measurement.coherence if isinstance(measurement, FRF) else measurement.values
    facts: dict[str, Any] = {
        "title": measurement.title,
        "kind": "frf" if isinstance(measurement, FRF) else "coherence",
        "lines": int(measurement.frequency_hz.size),
        "band_hz": measurement.frequency_hz[[0, -1]],
    }
    if isinstance(measurement, FRF):
        facts |= {
            "form": measurement.form,
            "units": measurement.distinct_units,
            "responses": [coordinate.describe() for coordinate in measurement.responses],
            "excitations": [coordinate.describe() for coordinate in measurement.excitations],
            "averages": measurement.averages,
        }
    return facts if coherence is None else facts | {"median_coherence": float(np.median(coherence))}
