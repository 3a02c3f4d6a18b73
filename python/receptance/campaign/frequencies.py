"""Natural frequencies as a campaign gives them: in the file itself or in a CSV table beside it."""

from __future__ import annotations

import csv
import re
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

from receptance.campaign.deviations import Deviation, parse_deviation
from receptance.campaign.quantities import KINDS, parse, shown
from receptance.campaign.suggestions import did_you_mean, one_of

if TYPE_CHECKING:
    from receptance.campaign.measurement_models import FrequenciesTable

__all__ = ["Frequencies", "FrequencyTableError", "deviations_of", "read_frequencies"]

Frequencies = tuple[list[float], list[int] | None, list[float] | None]
"""Frequencies in Hz, modes and standard deviations in Hz."""
_COLUMNS = ("mode", "frequency", "standard_deviation")
_HEAD = re.compile(r"\s*(?P<name>\w+?)\s*(?:\[(?P<unit>[^\]]*)\])?\s*")


class FrequencyTableError(ValueError):
    """A table of natural frequencies that cannot be read; the message names the line."""


def deviations_of(written: str | list[str] | None, frequency_hz: list[float]) -> list[float] | None:
    """Return the standard deviations of frequencies in Hz; one text stands for all of them.

    Raises
    ------
    ValueError
        A text that is no standard deviation of a frequency, or a list of another length.
    """
    if written is None:
        return None
    texts = [written] * len(frequency_hz) if isinstance(written, str) else written
    if len(texts) != len(frequency_hz):
        raise ValueError(f"is a list of {len(texts)}, expected one text for all or {len(frequency_hz)}, one for each")
    found: list[float] = []
    for text, frequency in zip(texts, frequency_hz, strict=True):
        deviation: Deviation = parse_deviation(text, KINDS["a frequency"])
        if deviation.amount <= 0.0:
            raise ValueError(f"is {shown(text)}, expected more than zero")
        found.append(deviation.of(frequency))
    return found


def read_frequencies(path: FilePath) -> Frequencies:
    """Read a CSV table of natural frequencies.

    The first line names the columns: `frequency [Hz]` (or another unit of frequency), and where they are known `mode`
    and `standard_deviation [Hz]`. Lines that begin with # are remarks.

    Raises
    ------
    FrequencyTableError
        What cannot be read, with its line.
    OSError
        A file that cannot be opened.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise FrequencyTableError(f"byte {error.start} is not UTF-8 text, expected a CSV table") from None
    rows = [
        (number, cells)
        for number, cells in ((n, next(csv.reader([line]), [])) for n, line in enumerate(text.splitlines(), 1))
        if cells and cells[0].strip() and not cells[0].lstrip().startswith("#")
    ]
    if not rows:
        raise FrequencyTableError("the table is empty, expected a line that names the columns and one for each mode")
    columns = _columns(*rows[0])
    found: dict[str, list[Any]] = {name: [] for name, _ in columns}
    for number, cells in rows[1:]:
        if len(cells) != len(columns):
            raise FrequencyTableError(f"line {number} has {len(cells)} cells, expected {len(columns)}")
        for (name, unit), cell in zip(columns, cells, strict=True):
            found[name].append(_cell(number, name, unit, cell.strip()))
    if not found["frequency"]:
        raise FrequencyTableError("there is no frequency below the line that names the columns")
    return found["frequency"], found.get("mode"), found.get("standard_deviation")


def _columns(number: int, cells: list[str]) -> list[tuple[str, str]]:
    columns: list[tuple[str, str]] = []
    for cell in cells:
        match = _HEAD.fullmatch(cell)
        name = match["name"] if match else cell.strip()
        unit = (match["unit"] or "").strip() if match else ""
        if name.endswith("_hz") and not unit:
            name, unit = name.removesuffix("_hz"), "Hz"
        if name not in _COLUMNS:
            text = f'line {number} names a column "{cell.strip()}", expected {one_of(_COLUMNS)}'
            raise FrequencyTableError(text + did_you_mean(name, _COLUMNS))
        if name != "mode" and not unit:
            raise FrequencyTableError(f'line {number}: the column "{name}" has no unit, expected "{name} [Hz]"')
        columns.append((name, unit))
    names = [name for name, _ in columns]
    if len(set(names)) != len(names) or "frequency" not in names:
        raise FrequencyTableError(f'line {number} names {", ".join(names)}, expected each once and "frequency [Hz]"')
    return columns


def _cell(number: int, name: str, unit: str, cell: str) -> float | int:
    try:
        return int(cell) if name == "mode" else parse(f"{cell} {unit}", KINDS["a frequency"])
    except ValueError as error:
        words = str(error) if name != "mode" else f'is "{cell}", expected the number of a mode, from 1 on'
        raise FrequencyTableError(f"line {number}: {name} {words}") from None


def frequencies_of(table: FrequenciesTable, folder: FilePath) -> Frequencies:
    """Return frequencies, modes and standard deviations, from the table itself or from the file that it names."""
    if table.file is not None:
        found, modes, spread = read_frequencies(folder / table.file)
        return found, table.modes or modes, spread
    return list(table.frequencies or []), table.modes, None
