"""Results of a catalogue as tables, reduced as they come."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from receptance._files import streamed
from receptance.frf import FRF

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.catalogue.prediction import ToolPrediction

__all__ = ["Reduced", "as_frf", "file_name", "reduced", "write_modes"]

_HEADER = (
    "name",
    "holder",
    "teeth",
    "mode",
    "frequency [Hz]",
    "frequency lower [Hz]",
    "frequency upper [Hz]",
    "damping [%]",
    "damping lower [%]",
    "damping upper [%]",
    "dynamic stiffness [N/um]",
    "dynamic stiffness lower [N/um]",
    "dynamic stiffness upper [N/um]",
    "most flexible",
)
_UNITS = np.array([1.0, 1e2, 1e-6])


@dataclass(frozen=True)
class Reduced:
    """What is kept of a tool: its most flexible mode, `(3,)` values and `(3, 2)` interval, None without one."""

    name: str
    holder: str
    modes: int
    values: NDArray[np.float64] | None
    interval: NDArray[np.float64] | None
    notes: tuple[str, ...]


def reduced(predictions: Iterable[ToolPrediction]) -> Iterator[Reduced]:
    """Return of each tool what an overview needs."""
    for one in predictions:
        most = one.most_flexible
        values, interval = (None, None) if most is None else (one.modes[most], one.modes_interval[most])
        yield Reduced(one.row.name, one.row.holder, len(one.modes), values, interval, one.notes)


def write_modes(path: Path, predictions: Iterable[ToolPrediction]) -> Iterator[ToolPrediction]:
    """Write a row for each mode of each tool while predictions go through; the file is there when all have.

    Frequencies in Hz, damping ratios in percent, dynamic stiffness in N/um, each with its interval.
    """
    with streamed(path) as file:
        rows = csv.writer(file)
        rows.writerow(_HEADER)
        for one in predictions:
            row, interval = one.row, one.modes_interval
            for number, values in enumerate(one.modes):
                cells = np.column_stack([values, interval[number]]) * _UNITS[:, None]
                rows.writerow(
                    [
                        row.name,
                        row.holder,
                        "" if row.teeth is None else row.teeth,
                        number + 1,
                        *(f"{cell:.6g}" for cell in cells.ravel()),
                        "yes" if number == one.most_flexible else "",
                    ]
                )
            yield one


def as_frf(one: ToolPrediction) -> FRF:
    """Return the predicted tip as an FRF for other programs.

    Without a variance: that of an FRF is understood as noise from line to line, and errors of a prediction are not.
    """
    return FRF(
        frequency_hz=one.frequency_hz,
        values=one.receptance,
        label=one.row.name,
        source="predicted by receptance",
        notes=("predicted, not measured",),
    )


def file_name(name: str) -> str:
    """Return a name without what a file system does not like."""
    return re.sub(r"[^\w.+-]+", "_", name).strip("._") or "tool"
