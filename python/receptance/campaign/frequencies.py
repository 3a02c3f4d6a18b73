"""Natural frequencies as a campaign gives them: in the file itself or in a CSV table beside it."""

from __future__ import annotations

import csv
import math
import re
from dataclasses import dataclass, replace
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

from receptance import units
from receptance._files import read_whole
from receptance._text import did_you_mean, one_of, shown
from receptance.campaign.quantities import Deviation, parse_deviation, parse_share
from receptance.io.text import doubts_of_end
from receptance.units import parse

if TYPE_CHECKING:
    from receptance.campaign.format import FrequenciesTable

__all__ = ["Frequencies", "FrequencyTableError", "damping_of", "deviations_of", "read_frequencies"]

_COLUMNS = ("mode", "frequency", "standard_deviation", "damping_ratio", "damping_deviation")
_SHARES = ("damping_ratio", "damping_deviation")
_UNKNOWN = "unknown"
_RATIO = 'a damping ratio such as "1.2 %", or "unknown"'
_SPREAD = 'a standard deviation such as "5 %" of the ratio, or a number'
_HEAD = re.compile(r"\s*(?P<name>\w+?)\s*(?:\[(?P<unit>[^\]]*)\])?\s*")


@dataclass(frozen=True)
class Frequencies:
    """Modes as a campaign gives them: in Hz, ratios as shares, deviations of ratios as shares of them."""

    frequency_hz: list[float]
    modes: list[int] | None = None
    deviation_hz: list[float] | None = None
    damping: list[float] | None = None
    damping_deviation: list[float] | None = None


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
        deviation: Deviation = parse_deviation(text, units.FREQUENCY)
        if deviation.amount <= 0.0:
            raise ValueError(f"is {shown(text)}, expected more than zero")
        found.append(deviation.of(frequency))
    return found


def read_frequencies(path: FilePath) -> Frequencies:
    """Read a CSV table of natural frequencies.

    The first line names the columns: `frequency [Hz]` (or another unit of frequency), and where they are known `mode`,
    `standard_deviation [Hz]`, `damping_ratio [%]` and `damping_deviation [%]` of the ratio. Lines that begin with # are
    remarks.

    Raises
    ------
    FrequencyTableError
        What cannot be read, with its line.
    OSError
        A file that cannot be opened.
    """
    try:
        text = read_whole(path).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise FrequencyTableError(f"byte {error.start} is not UTF-8 text, expected a CSV table") from None
    # A last number that was cut off is a number still.
    lines = [(number, line) for number, line in enumerate(text.splitlines(), 1) if line.strip()]
    doubts_of_end(text, lines)
    rows = [
        (number, cells)
        for number, cells in ((n, _cells(n, line)) for n, line in lines)
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
    names = ("frequency", *(name for name in _COLUMNS if name != "frequency"))
    return Frequencies(*(found.get(name) for name in names))  # type: ignore[arg-type]


def _cells(number: int, line: str) -> list[str]:
    try:
        return next(csv.reader([line]), [])
    except csv.Error as error:
        raise FrequencyTableError(f"line {number} cannot be split into cells: {error}") from None


def _columns(number: int, cells: list[str]) -> list[tuple[str, str]]:
    columns: list[tuple[str, str]] = []
    for cell in cells:
        match = _HEAD.fullmatch(cell)
        name = match["name"] if match else cell.strip()
        unit = (match["unit"] or "").strip() if match else ""
        if name.endswith("_hz") and not unit:
            name, unit = name.removesuffix("_hz"), "Hz"
        if name not in _COLUMNS:
            # What is like none of the columns is not shown: the file may be anything.
            near = did_you_mean(name, _COLUMNS)
            what = f' "{cell.strip()}"' if near else ""
            text = f"line {number} names a column{what} that is not known, expected {one_of(_COLUMNS)}{near}"
            raise FrequencyTableError(text)
        expected = "%" if name in _SHARES else "Hz"
        if name != "mode" and not unit:
            raise FrequencyTableError(f'line {number}: the column "{name}" has no unit, expected "{name} [{expected}]"')
        if name in _SHARES and unit not in ("%", "1"):
            raise FrequencyTableError(f'line {number}: the column "{name}" is in {unit}, expected "{name} [%]"')
        columns.append((name, unit))
    names = [name for name, _ in columns]
    if len(set(names)) != len(names) or "frequency" not in names:
        raise FrequencyTableError(f'line {number} names {", ".join(names)}, expected each once and "frequency [Hz]"')
    return columns


def _cell(number: int, name: str, unit: str, cell: str) -> float | int:
    try:
        if name in _SHARES:
            share = 0.01 if unit == "%" else 1.0
            return float(cell) * share if cell else math.nan
        return int(cell) if name == "mode" else parse(f"{cell} {unit}", units.FREQUENCY)
    except ValueError as error:
        words = str(error)
        if name == "mode":
            words = f'is "{cell}", expected the number of a mode, from 1 on'
        elif name in _SHARES:
            words = f'is "{cell}", expected a number, or nothing'
        raise FrequencyTableError(f"line {number}: {name} {words}") from None


def frequencies_of(table: FrequenciesTable, folder: FilePath) -> Frequencies:
    """Return what is given of the modes, in the table itself or in the file that it names."""
    found = Frequencies(list(table.frequencies or [])) if table.file is None else read_frequencies(folder / table.file)
    return replace(found, modes=table.modes or found.modes)


def damping_of(table: FrequenciesTable, given: Frequencies) -> tuple[list[float] | None, list[float] | None]:
    """Return damping ratios and their standard deviations, as numbers.

    Raises
    ------
    ValueError
        A text that is no ratio or no standard deviation of one, or a list of another length.
    """
    ratios, spread = given.damping, given.damping_deviation
    if table.damping_ratios is not None:
        if ratios is not None:
            raise ValueError("has damping ratios and so has the file, expected one of the two")
        ratios = [math.nan if text == _UNKNOWN else parse_share(text, _RATIO) for text in table.damping_ratios]
    if ratios is None:
        if table.damping_deviation is not None:
            raise ValueError("has a damping_deviation, but no damping_ratios")
        return None, None
    if table.damping_deviation is None:
        deviations = None if spread is None else [_positive(s * r, r) for s, r in zip(spread, ratios, strict=True)]
        return ratios, deviations
    written = table.damping_deviation
    listed = written if isinstance(written, list) else [written] * len(ratios)
    if len(listed) != len(ratios):
        raise ValueError(f"has {len(listed)} damping deviations, expected one for all or {len(ratios)}, one for each")
    return ratios, [_positive(_deviation(one, ratio), ratio) for one, ratio in zip(listed, ratios, strict=True)]


def _deviation(written: str | float, ratio: float) -> float:
    return parse_share(written, _SPREAD) * ratio if isinstance(written, str) else float(written)


def _positive(deviation: float, ratio: float) -> float:
    """Return a standard deviation; that of an unknown ratio does not count."""
    return 1.0 if math.isnan(ratio) else deviation
