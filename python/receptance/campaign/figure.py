"""Figures of campaigns: assemblies to scale, predictions, parameters over levels, and comparisons of candidates."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from numpy.typing import NDArray

from receptance.campaign.check import CampaignCheck, listed, marks_of
from receptance.campaign.comparison import Comparison
from receptance.campaign.data import CampaignData
from receptance.campaign.identification import LevelSeries
from receptance.campaign.prediction import Prediction
from receptance.campaign.spindle import SpindleIdentification
from receptance.campaign.values import kind_of
from receptance.coupling.figure import draw_spindle, draw_with_law
from receptance.fit.figure import (
    MOST_FRFS,
    cell_grid,
    draw_curves,
    draw_frequencies,
    draw_ratio,
    left_out,
    legend_with_noise,
    pair_of_panels,
    set_up_magnitude,
)
from receptance.fit.prediction import PredictedFRF
from receptance.model.assembly import Assembly
from receptance.model.figure import draw_assemblies
from receptance.model.sketch import Drawing
from receptance.model.terminals import ModalPart, Mode
from receptance.report.colours import BAND, INK, PALE
from receptance.report.figure import finished, panels, surface, title_left
from receptance.sweep.figure import draw_misfit

_MOST_OF_CAMPAIGN = 3
"""Most assemblies in the figure of a campaign."""
_GAP = 2.5
"""Times the median spacing of lines: no curve crosses a wider gap."""
_MOST_SHAPES = 8
"""Most assemblies in the figure of a check; those of the same shape are drawn once."""


def draw_campaign(campaign: CampaignData, ax: Axes | None = None) -> Figure:
    """Draw the first assemblies to scale."""
    first = list(campaign.assemblies.items())[:_MOST_OF_CAMPAIGN]
    return draw_assemblies([Drawing(assembly, name) for name, assembly in first], ax)


def draw_check(check: CampaignCheck, ax: Axes | None = None) -> Figure:
    """Draw the assemblies to scale with sensors and points of measurement."""
    groups: dict[Any, list[str]] = {}
    drawings: dict[Any, Drawing] = {}
    for name, assembly in check.campaign.assemblies.items():
        everything = (*check.campaign.measurements.values(), *check.campaign.on_blanks.values())
        measured = [m for m in everything if m.configuration == name]
        marks = tuple(dict.fromkeys(mark for observation in measured for mark in marks_of(observation)))
        shown = measured[0].assembly if measured else assembly
        if name in check.campaign.blanks:
            shown = _in_spindle(shown, check.campaign.blanks[name])
        key = (*(_shape(element) for element in shown.elements.items()), tuple(shown.attachments), marks)
        groups.setdefault(key, []).append(name)
        drawings.setdefault(key, Drawing(shown, "", marks))
    titled = [
        Drawing(drawing.assembly, listed(groups[key]), drawing.marks)
        for key, drawing in list(drawings.items())[:_MOST_SHAPES]
    ]
    left = len(drawings) - len(titled)
    more = f"  ·  {left} more shapes are not drawn" if left else ""
    return draw_assemblies(titled, ax, title=f"{check.campaign.title}{more}")


def _in_spindle(blank: Assembly, name: str) -> Assembly:
    """Return a blank with its spindle, which is drawn, whether it is identified or not."""
    any_mode = Mode(frequency_hz=1e3, damping_ratio=0.0, y=0.0, theta=0.0)
    return Assembly([*blank.elements.values(), ModalPart(modes=(any_mode,), name=name)], blank.attachments.values())


def _shape(item: tuple[str, Any]) -> Any:
    name, element = item
    segments = getattr(element, "segments", ())
    sizes = tuple((s.length, s.ends, s.material.name) for s in segments)
    return name, sizes, getattr(element, "length", 0.0)


def draw_prediction(prediction: Prediction, ax: Axes | None = None) -> Figure:
    """Draw predictions with their intervals, and measurements."""
    frfs = prediction.frfs[:MOST_FRFS]
    compared = [frequencies for frequencies in prediction.frequencies if frequencies.measured_hz is not None]
    title = f"{prediction.title}{left_out(prediction.frfs, frfs)}"
    figure, cells = cell_grid(ax, len(frfs) + bool(compared), title)
    for frf, cell in zip(frfs, cells, strict=False):
        _predicted_frf(cell, frf, prediction)
    if compared:
        rows = [
            (
                frequencies.name,
                [mode.mode for mode in frequencies.modes],
                frequencies.measured_hz,
                frequencies.predicted_hz,
                prediction.reach * frequencies.scatter.total,
                np.array([mode.measured_deviation_hz for mode in frequencies.modes]),
            )
            for frequencies in compared
        ]
        title = f"Natural frequencies held out, with {100.0 * prediction.level:g} % intervals"
        draw_frequencies(cells[len(frfs)].subplots(), title, "predicted", rows)
    return finished(figure, prediction.rejection)


def _predicted_frf(cell: SubFigure, frf: PredictedFRF, prediction: Prediction) -> None:
    measured = frf.measured is not None
    if not measured:
        frf = _with_gaps(frf)
    lines = frf.frequency_hz.real
    top, below = pair_of_panels(cell)
    title = f"{frf.name}: {'held out' if measured else 'predicted, not measured'}"
    set_up_magnitude(top, title, frf.response, frf.excitation)
    size = np.abs(frf.receptance)
    shown = size if frf.measured is None else np.concatenate([size, np.abs(frf.measured)])
    limits = float(np.nanmin(shown)) / 2.0, float(np.nanmax(shown)) * 30.0
    low, high = frf.band(prediction.level)
    low, high = np.clip(low, limits[0] / 10.0, None), np.clip(high, None, limits[1] * 10.0)
    top.fill_between(lines, low, high, color=BAND, linewidth=0, label=f"{100.0 * prediction.level:g} % band")
    draw_curves(top, lines, frf.measured, frf.receptance, "predicted")
    top.set_ylim(*limits)
    if not measured:
        for frequencies in prediction.frequencies:
            if frequencies.name == frf.name:
                _name_modes(top, frequencies.predicted_hz, prediction.reach * frequencies.scatter.total)
    legend_with_noise(top, frf.measured_deviation)
    label = "measured over\npredicted (dB)" if measured else "band (dB)"
    log_ratio = frf.log_ratio.real if measured else None
    draw_ratio(below, label, lines, log_ratio, prediction.reach * frf.scatter.total, frf.measured_deviation)


def _with_gaps(frf: PredictedFRF) -> PredictedFRF:
    """Return a prediction with a line without a value in each gap of its lines, so that no curve crosses it."""
    lines = frf.frequency_hz
    spacing = np.diff(lines.real)
    at = np.flatnonzero(spacing > _GAP * np.median(spacing)) + 1 if spacing.size else np.empty(0, dtype=np.intp)
    if not at.size:
        return frf

    def inserted(values: NDArray[Any]) -> NDArray[Any]:
        return np.insert(values, at, np.nan, axis=-1)

    middles = np.insert(lines, at, 0.5 * (lines[at - 1] + lines[at]))
    scatter = replace(frf.scatter, total=inserted(frf.scatter.total))
    return replace(
        frf, frequency_hz=middles, receptance=inserted(frf.receptance), scatter=scatter, drawn=inserted(frf.drawn)
    )


def _name_modes(axes: Axes, frequency_hz: NDArray[np.float64], half_hz: NDArray[np.float64]) -> None:
    """Annotate natural frequencies with their intervals."""
    for frequency, half in zip(frequency_hz, half_hz, strict=True):
        text = f"{frequency:.0f} ± {half:.0f} Hz" if np.isfinite(half) else f"{frequency:.0f} Hz, open"
        axes.axvline(frequency, color=PALE, linewidth=0.7, linestyle=":")
        axes.annotate(
            text, (frequency, 0.03), xycoords=("data", "axes fraction"), xytext=(-4, 0), textcoords="offset points",
            rotation=90, ha="right", va="bottom", fontsize=8, color=INK,
        )  # fmt: skip


def draw_series(levels: LevelSeries, ax: Axes | None = None) -> Figure:
    """Draw each parameter over the levels, with 95 % intervals and its law (Xu et al. 2012, figures 10 to 13)."""
    over = f"{levels.over} ({levels.unit})" if levels.unit else levels.over
    count = len(levels)
    columns = min(count, 3 if count > 4 else 2)
    rows = -(-count // columns)
    figure = surface(ax, 5.6 * columns + (1.5 if columns == 1 else 0.0), 4.2 * rows + 0.7)
    for axes, (name, series) in zip(panels(figure, count, columns), levels.items(), strict=True):
        draw_with_law(axes, series, over, kind_of(name).unit)
    if levels.provenance.title:
        title_left(figure, levels.provenance.title)
    return finished(figure)


def draw_spindle_identification(found: SpindleIdentification, ax: Axes | None = None) -> Figure:
    """Draw the terms of a spindle with bands and usable lines, its modes over them, and the condition number."""
    return draw_spindle(found.table, ax, modes=found.modes, rejection=found.rejection)


def draw_comparison(comparison: Comparison, ax: Axes | None = None) -> Figure:
    """Draw the smallest misfit over each parameter and each pair of at most four."""
    return draw_misfit(comparison.candidates, ax=ax)
