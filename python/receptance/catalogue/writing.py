"""Results of a catalogue as tables, reduced as they come."""

from __future__ import annotations

import csv
import re
import unicodedata
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from receptance._files import inert, streamed
from receptance.frf import FRF

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.catalogue.prediction import ToolPrediction

__all__ = ["Reduced", "as_frf", "file_names", "reduced", "write_modes"]

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
_LONGEST = 100
_RESERVED = re.compile(r"(con|prn|aux|nul|com[0-9]|lpt[0-9])(\..*)?", re.IGNORECASE)
"""Devices of Windows."""
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
                        inert(row.name),
                        inert(row.holder),
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


def file_names(names: Iterable[str]) -> dict[str, str]:
    """Return for each tool the name of its files, without an ending; no two tools have the same.

    What file systems do not take becomes an underscore. Names that are the same then, or differ by case alone, get
    numbers; a name that needs no change keeps itself.

    Examples
    --------
    >>> from receptance.catalogue.writing import file_names
    >>> file_names(["a/b", "a?b", "T.", "T"])
    {'a/b': 'a_b', 'a?b': 'a_b-2', 'T.': 'T-2', 'T': 'T'}
    """
    plain = {name: _plain(name) for name in names}
    counts = Counter(map(_alike, plain.values()))
    # A name that no other is like keeps its own, so numbers never lead to one that is there.
    taken = {alike for alike, count in counts.items() if count == 1}
    chosen: dict[str, str] = {}
    for name in sorted(plain, key=lambda name: plain[name] != name):
        base, unique, number = plain[name], plain[name], 1
        while counts[_alike(base)] > 1 and _alike(unique) in taken:
            number += 1
            unique = f"{base}-{number}"
        taken.add(_alike(unique))
        chosen[name] = unique
    return {name: chosen[name] for name in plain}


def _plain(name: str) -> str:
    """Return a name without what a file system does not like."""
    plain = re.sub(r"[^\w.+-]+", "_", unicodedata.normalize("NFC", name))[:_LONGEST].strip("._") or "tool"
    return f"_{plain}" if _RESERVED.fullmatch(plain) else plain


def _alike(name: str) -> str:
    return unicodedata.normalize("NFKC", name).casefold()
