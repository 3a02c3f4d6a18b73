"""Figure of a transfer: predictions of configurations that were not fitted."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from receptance._text import printable
from receptance.identification.covariance import UNINFORMATIVE
from receptance.report.figure import (
    BAD,
    BAND,
    COLOURS,
    INK,
    PALE,
    add_legend,
    finished,
    label_point,
    set_up,
    surface,
    title_left,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from receptance.identification import PredictedFRF, Transfer

__all__ = ["draw_transfer"]

_MOST = 8
"""Most receptances that are drawn."""
_ROW = 0.24
"""Height of a line of the table of modes in inches."""
_OPEN = 1e3
"""Factor to either side up to which a band is drawn."""


def draw_transfer(found: Transfer, ax: Axes | None = None) -> Figure:
    """Draw errors of predicted natural frequencies with their intervals, and predicted receptances with their bands."""
    frfs = found.frfs[:_MOST]
    if not found.modes and not frfs:
        raise ValueError(f"nothing was predicted: {'; '.join(found.not_predicted) or 'there is no split'}")
    columns = 1 if not frfs else 2
    rows = max(len(frfs), 1)
    tall = 1.6 + _ROW * len(found.modes)
    height = max(tall, 2.9 * rows) + 0.6
    figure = surface(ax, 7.2 + 6.2 * (columns - 1), height)
    hits, count = found.inside
    text = f"{hits} of {count} natural frequencies in their {100 * found.level:g} % intervals"
    title_left(figure, f"{found.title}\n{text}", 12.0 if len(found.title) < 50 * columns else 10.0)
    cells = figure.subfigures(1, columns, squeeze=False, width_ratios=[7.2, 6.2][:columns])[0]
    _draw_modes(cells[0].subplots(), found)
    if frfs:
        for axes, frf in zip(np.ravel(cells[1].subplots(len(frfs), 1, squeeze=False)), frfs, strict=True):
            _draw_frf(axes, frf, found.level)
    return finished(figure)


def _draw_modes(axes: Axes, found: Transfer) -> None:
    set_up(axes, "Held out", "predicted against measured (%)", grid="x")
    axes.axvline(0.0, color=INK, linewidth=1.0)
    labels, before, several = [], "", len({mode.configuration for mode in found.modes}) > 1
    for row, mode in enumerate(found.modes):
        text = f"{mode.measured_hz:.0f} Hz" + ("" if mode.mode is None else f"  mode {mode.mode}")
        labels.append(f"{mode.configuration}   {text}" if mode.configuration != before and several else text)
        before = mode.configuration
        interval = mode.interval_hz(found.level, mode.measured_deviation_hz)
        if mode.measured_hz is None or mode.error_percent is None or interval is None:
            axes.plot(0.0, row, "x", color=BAD, markersize=7)
            label_point(axes, "no prediction", (0.0, row), offset=(6.0, -3.0), colour=BAD)
            continue
        if mode.uninformative(found.level):
            axes.plot(mode.error_percent, row, "o", color=PALE, markerfacecolor="white", markersize=5)
            point = mode.error_percent, row
            label_point(axes, f"interval {UNINFORMATIVE}", point, offset=(6.0, -3.0), colour=PALE)
            continue
        low, high = (100.0 * (end / mode.measured_hz - 1.0) for end in interval)
        inside = mode.within(found.level)
        colour = COLOURS[0] if inside else BAD
        if np.isfinite(high):
            axes.plot([low, high], [row, row], color=colour, linewidth=2.2, alpha=0.45, solid_capstyle="butt")
        axes.plot(mode.error_percent, row, "o" if inside else "D", color=colour, markersize=5)
    axes.set_yticks(range(len(labels)), list(map(printable, labels)), fontsize=8)
    axes.set_ylim(len(labels) - 0.4, -0.6)
    axes.plot([], [], "o", color=COLOURS[0], markersize=5, label="measured is inside the interval")
    axes.plot([], [], "D", color=BAD, markersize=5, label="measured is outside the interval")
    add_legend(axes, fontsize=8, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderaxespad=0.1)


def _draw_frf(axes: Axes, frf: PredictedFRF, level: float) -> None:
    set_up(axes, "", "frequency (Hz)", "magnitude (SI)")
    share = frf.share_within(level)
    inside = "no useful band" if share is None else f"{100.0 * share:.0f} % of lines in the band"
    axes.set_title(
        f"{frf.name}: {frf.rms_decibel:.2f} dB, {inside}",
        loc="left",
        fontsize=10,
        color=INK,
    )
    lines = frf.frequency_hz.real
    size = np.abs(frf.receptance)
    low, high = frf.band(level)
    axes.fill_between(
        lines, np.maximum(low, size / _OPEN), np.minimum(high, size * _OPEN), color=BAND, linewidth=0.0, label="band"
    )
    axes.plot(lines, np.abs(np.asarray(frf.measured)), ".", color=PALE, markersize=2.5, label="measured")
    axes.plot(lines, size, color=COLOURS[0], linewidth=1.2, label="predicted")
    axes.set_yscale("log")
    add_legend(axes, fontsize=8, loc="upper right")
