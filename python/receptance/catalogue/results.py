"""Results of a catalogue: the most flexible mode of each tool, CSV files of modes and stable depths, lobes, FRFs."""

from __future__ import annotations

import csv
import io
import re
import unicodedata
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from receptance._files import check_target, inert, write_whole
from receptance.campaign import Campaign
from receptance.catalogue.building import Catalogue
from receptance.catalogue.prediction import ToolPrediction
from receptance.fit.covariance import UNINFORMATIVE
from receptance.report import ACCEPTED, Column, Provenance, Rejection, Result, Table
from receptance.report.table import Cell
from receptance.stability import Lobes, Milling, stability_lobes
from receptance.stability.lobes import with_rejection, without_limits

_MODE_QUANTITIES = {"frequency": "Hz", "damping": "%", "dynamic stiffness": "N/um"}
_MODE_UNITS = np.array([1.0, 1e2, 1e-6])
"""Units of the columns: natural frequency in Hz, damping ratio in percent, dynamic stiffness in N/um."""
_NOTE = "note"
"""Column that says why there are no numbers, or why they are widened."""
_DEPTH_COLUMNS = (
    "name",
    "holder",
    "teeth",
    "cut",
    "rank",
    "speed [rpm]",
    "stable depth [mm]",
    "probability",
    "limit [mm]",
    "speed lower [rpm]",
    "speed upper [rpm]",
    "always stable [mm]",
    _NOTE,
)
_ROWS = 20
"""Largest number of tools in the table of a summary."""
_WIDEST = 100.0
"""Ratio of the ends of an interval from which on it is too wide to be useful."""
_LONGEST_NAME = 100
_RESERVED = re.compile(r"(con|prn|aux|nul|com[0-9]|lpt[0-9])(\..*)?", re.IGNORECASE)
"""File names that Windows reserves for devices."""


@dataclass(frozen=True)
class ToolSummary:
    """The most flexible mode of a tool."""

    name: str
    """The tool."""
    holder: str
    modes: int
    """Number of modes that were found."""
    values: NDArray[np.float64] | None
    """`(3,)` natural frequency in Hz, damping ratio and dynamic stiffness in N/m of the most flexible mode, None
    without one."""
    interval: NDArray[np.float64] | None
    """`(3, 2)` their intervals."""
    notes: tuple[str, ...]
    rejection: Rejection = ACCEPTED
    """As in `ToolPrediction`."""


def summaries(predictions: Iterable[ToolPrediction]) -> Iterator[ToolSummary]:
    """Yield the summary of each prediction, which need not be kept in memory."""
    for prediction in predictions:
        mode, row = prediction.most_flexible, prediction.row
        values, interval = (None, None) if mode is None else (prediction.modes[mode], prediction.modes_interval[mode])
        count, notes = len(prediction.modes), prediction.notes
        yield ToolSummary(row.name, row.holder, count, values, interval, notes, prediction.rejection)


@dataclass(frozen=True, kw_only=True)
class CatalogueSummary(Result):
    """The most flexible mode of every tool of a catalogue."""

    tools: tuple[ToolSummary, ...]
    """The tools in the order of the catalogue."""
    level: float
    """Level of the intervals."""
    notes: tuple[str, ...] = ()
    provenance: Provenance = field(default_factory=Provenance, repr=False)

    heading = "Catalogue"
    plotted_by = "receptance.catalogue.figure:draw_catalogue"

    @property
    def rejection(self) -> Rejection:
        """Why the fit is rejected; false if it is accepted or there is none."""
        return sum((tool.rejection for tool in self.tools), ACCEPTED)

    def tables(self) -> list[Table]:
        """Return the most flexible mode of the first tools."""
        columns: list[Column | str] = ["tool", "holder"]
        for name, unit, form in (
            ("frequency", "Hz", ".0f"),
            ("damping", "%", ".2f"),
            ("dynamic stiffness", "N/\u00b5m", ".3g"),
        ):
            columns += [Column(name, unit, form), Column("interval", form=form)]
        rows: list[list[Cell]] = []
        for tool in self.tools[:_ROWS]:
            if tool.values is None or tool.interval is None:
                rows.append([tool.name, tool.holder, "none", None, None, None, None, None])
                continue
            cells: list[Cell] = []
            for value, ends, unit in zip(tool.values.tolist(), tool.interval, _MODE_UNITS.tolist(), strict=True):
                low, high = (unit * ends).tolist()
                cells += [unit * value, (low, high) if high < _WIDEST * low else UNINFORMATIVE]
            rows.append([tool.name, tool.holder, *cells])
        more = len(self.tools) - len(rows)
        note = f"and {more} more" if more else ""
        return [Table("The most flexible mode of each tool", columns, rows, note)]

    def data(self) -> dict[str, Any]:
        """Return the number of modes and the most flexible mode of each tool."""
        names = ("frequency_hz", "damping_ratio", "dynamic_stiffness")
        tools = [
            {
                "name": tool.name,
                "holder": tool.holder,
                "modes": tool.modes,
                "most_flexible": None
                if tool.values is None or tool.interval is None
                else {
                    name: {"value": value, "interval": ends}
                    for name, value, ends in zip(names, tool.values, tool.interval, strict=True)
                },
                "notes": tool.notes,
            }
            for tool in self.tools
        ]
        return {"level": self.level, "tools": tools}


def summary_of(catalogue: Catalogue, predictions: Iterable[ToolPrediction]) -> CatalogueSummary:
    """Return the summary of all predictions, with the notes on the campaign, its catalogue and its tools."""
    campaign, tools = catalogue.campaign, tuple(summaries(predictions))
    of_tools = [note for tool in tools for note in tool.notes]
    return CatalogueSummary(
        tools=tools,
        level=campaign.table.prediction.level,
        notes=tuple(dict.fromkeys([*campaign.notes, *catalogue.notes, *of_tools])),
        provenance=campaign.provenance(),
    )


def write_modes(path: Path, predictions: Iterable[ToolPrediction]) -> Iterator[ToolPrediction]:
    """Write a CSV row for each mode of each tool, and yield the predictions unchanged.

    The file appears when the last prediction was yielded. Frequencies are in Hz, damping ratios in percent, dynamic
    stiffnesses in N/um, each with its interval.
    """
    columns = [f"{name}{end} [{unit}]" for name, unit in _MODE_QUANTITIES.items() for end in ("", " lower", " upper")]

    def rows(prediction: ToolPrediction) -> Iterator[list[object]]:
        row = prediction.row
        for number, (values, interval) in enumerate(zip(prediction.modes, prediction.modes_interval, strict=True)):
            cells = np.column_stack([values, interval]) * _MODE_UNITS[:, None]
            teeth, most_flexible = "" if row.teeth is None else row.teeth, number == prediction.most_flexible
            numbers = [f"{cell:.6g}" for cell in cells.ravel()]
            flexible, note = "yes" if most_flexible else "", inert("; ".join(prediction.rejection))
            yield [inert(row.name), inert(row.holder), teeth, number + 1, *numbers, flexible, note]

    return _write_rows(path, ("name", "holder", "teeth", "mode", *columns, "most flexible", _NOTE), predictions, rows)


def _write_rows(
    path: Path,
    header: Sequence[str],
    predictions: Iterable[ToolPrediction],
    rows: Callable[[ToolPrediction], Iterable[list[object]]],
) -> Iterator[ToolPrediction]:
    check_target(path)
    text = io.StringIO(newline="")
    writer = csv.writer(text)
    writer.writerow(header)
    for prediction in predictions:
        writer.writerows(rows(prediction))
        yield prediction
    write_whole({path: text.getvalue().encode()})


def tool_lobes(prediction: ToolPrediction, campaign: Campaign, cut: str) -> Lobes:
    """Return the lobes of a tool that was predicted with draws, by the mean force, with the same tip in x and y.

    Parameters
    ----------
    prediction : ToolPrediction
        The tool, with draws.
    campaign : Campaign
        Campaign with the cut, the spindle speeds and the probability.
    cut : str
        Name of the cut. The number of teeth is that of the row of the tool, or that of the cut if the row has none; a
        radial depth in mm refers to the diameter of the tool.

    Raises
    ------
    CampaignError
        The campaign has no such cut, or no spindle speeds.
    ValueError
        There are fewer draws than the probability needs, or the teeth of the cut differ in pitch or helix.
    """
    settings = campaign.table.stability
    (chosen,) = campaign.select_cuts([cut])
    chosen = chosen.with_tool(prediction.row.teeth, prediction.row.diameter)
    if prediction.rejection.unusable:
        return chosen.label(without_limits(chosen.cut, campaign.spindle_speeds(), prediction.rejection))
    identity = np.eye(2 if isinstance(chosen.cut, Milling) else 1)
    lobes = stability_lobes(
        chosen.cut,
        prediction.tip.frequency_hz,
        prediction.tip.receptance[:, None, None] * identity,
        speeds_rpm=campaign.spindle_speeds(),
        draws=prediction.tip.drawn[:, :, None, None] * identity,
        cuts=chosen.drawn(len(prediction.tip.drawn), settings.seed),
    )
    probability = None if lobes.draws is None else settings.probability
    return with_rejection(replace(chosen.label(lobes), probability=probability), prediction.rejection)


def write_depths(
    path: Path, predictions: Iterable[ToolPrediction], campaign: Campaign, cut: str
) -> Iterator[ToolPrediction]:
    """Write recommended speeds and depths of each tool as CSV, and yield the predictions unchanged.

    The file appears when the last prediction was yielded.
    """

    def rows(prediction: ToolPrediction) -> Iterator[list[object]]:
        lobes = tool_lobes(prediction, campaign, cut)
        limits = dict(zip(lobes.speeds_rpm.tolist(), lobes.depth.tolist(), strict=True))
        teeth = getattr(lobes.cut, "teeth", "")
        note = inert("; ".join(lobes.rejection))
        if not lobes.best_cuts:
            empty = [""] * (len(_DEPTH_COLUMNS) - 5)
            yield [*map(inert, (prediction.row.name, prediction.row.holder)), teeth, inert(lobes.name), *empty, note]
        for rank, best in enumerate(lobes.best_cuts):
            values = (best.speed_rpm, 1e3 * best.depth, best.probability, 1e3 * limits[best.speed_rpm])
            ends = (best.lowest_rpm, best.highest_rpm, 1e3 * float(np.min(lobes.certain_depth)))
            cells = [f"{value:.6g}" for value in (*values, *ends)]
            name, holder, cut_name = map(inert, (prediction.row.name, prediction.row.holder, lobes.name))
            yield [name, holder, teeth, cut_name, rank + 1, *cells, note]

    return _write_rows(path, _DEPTH_COLUMNS, predictions, rows)


def file_names(names: Iterable[str]) -> dict[str, str]:
    """Return a different file name, without an ending, for each tool.

    Characters that file systems do not accept become underscores. Names that are then equal, or differ by case alone,
    are numbered; a name that needs no change is kept.

    Examples
    --------
    >>> from receptance.catalogue.results import file_names
    >>> file_names(["a/b", "a?b", "T.", "T"])
    {'a/b': 'a_b', 'a?b': 'a_b-2', 'T.': 'T-2', 'T': 'T'}
    """
    plain = {name: _portable(name) for name in names}
    counts = Counter(map(_folded, plain.values()))
    # Unique names are not changed, so a number never leads to a name that exists.
    taken = {folded for folded, count in counts.items() if count == 1}
    assigned: dict[str, str] = {}
    for name in sorted(plain, key=lambda name: plain[name] != name):
        base, unique, number = plain[name], plain[name], 1
        while counts[_folded(base)] > 1 and _folded(unique) in taken:
            number += 1
            unique = f"{base}-{number}"
        taken.add(_folded(unique))
        assigned[name] = unique
    return {name: assigned[name] for name in plain}


def _portable(name: str) -> str:
    """Return a name with the characters that all file systems accept."""
    plain = re.sub(r"[^\w.+-]+", "_", unicodedata.normalize("NFC", name))[:_LONGEST_NAME].strip("._") or "tool"
    return f"_{plain}" if _RESERVED.fullmatch(plain) else plain


def _folded(name: str) -> str:
    return unicodedata.normalize("NFKC", name).casefold()
