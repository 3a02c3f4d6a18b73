"""Natural frequencies and damping ratios of a campaign, from the file itself or from a CSV file."""

from __future__ import annotations

import csv
import math
import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from receptance import units
from receptance._files import read_whole
from receptance._text import did_you_mean, one_of, shown
from receptance.campaign.values import Deviation, parse_deviation, parse_share
from receptance.io.text import truncation_notes
from receptance.units import parse

if TYPE_CHECKING:
    from receptance.campaign.schema import FrequenciesTable

__all__ = ["Frequencies", "FrequencyTableError", "damping_of", "deviations_of", "read_frequencies"]

_COLUMNS = ("mode", "frequency", "standard_deviation", "damping_ratio", "damping_deviation")
_SHARES = ("damping_ratio", "damping_deviation")
_UNKNOWN = "unknown"
_RATIO = 'a damping ratio such as "1.2 %", or "unknown"'
_SPREAD = 'a standard deviation such as "5 %" of the ratio, or a number'
_HEAD = re.compile(r"\s*(?P<name>\w+?)\s*(?:\[(?P<unit>[^\]]*)\])?\s*")


@dataclass(frozen=True)
class Frequencies:
    """Measured modes.

    Attributes
    ----------
    frequency_hz, deviation_hz : list of float
        Natural frequencies and their standard deviations.
    modes : list of int or None
        Numbers of the modes.
    damping, damping_deviation : list of float or None
        Damping ratios, NaN if unknown, and their standard deviations relative to them.
    """

    frequency_hz: list[float]
    modes: list[int] | None = None
    deviation_hz: list[float] | None = None
    damping: list[float] | None = None
    damping_deviation: list[float] | None = None


class FrequencyTableError(ValueError):
    """A CSV file of natural frequencies cannot be read; the message names the line."""


def deviations_of(written: str | list[str] | None, frequency_hz: list[float]) -> list[float] | None:
    """Return the standard deviations of frequencies in Hz; one text stands for all of them.

    Raises
    ------
    ValueError
        A text is not a standard deviation of a frequency, or the list has a different length.
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


def read_frequencies(path: Path) -> Frequencies:
    """Read a CSV file of natural frequencies.

    The first line names the columns: `frequency [Hz]` (or another unit of frequency), and optionally `mode`,
    `standard_deviation [Hz]`, `damping_ratio [%]` and `damping_deviation [%]` of the ratio. Lines that begin with # are
    comments.

    Raises
    ------
    FrequencyTableError
        A line cannot be read.
    OSError
        The file cannot be opened.
    """
    try:
        text = read_whole(path).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise FrequencyTableError(f"byte {error.start} is not UTF-8 text, expected a CSV table") from None
    # A number at the end of a truncated file is still a number, so that only the missing end of line shows it.
    lines = [(number, line) for number, line in enumerate(text.splitlines(), 1) if line.strip()]
    truncation_notes(text, lines)
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
            # Unknown columns are not quoted: the file may be of any kind.
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


def frequencies_of(table: FrequenciesTable, folder: Path) -> Frequencies:
    """Return the measured modes from the table itself or from its CSV file."""
    found = Frequencies(list(table.frequencies or [])) if table.file is None else read_frequencies(folder / table.file)
    return replace(found, modes=table.modes or found.modes)


def damping_of(table: FrequenciesTable, given: Frequencies) -> tuple[list[float] | None, list[float] | None]:
    """Return damping ratios and their standard deviations.

    Raises
    ------
    ValueError
        A text is not a ratio or a standard deviation, or a list has a different length.
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
    """Return a standard deviation; for an unknown ratio a positive value without effect."""
    return 1.0 if math.isnan(ratio) else deviation
