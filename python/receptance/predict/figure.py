"""Figures of transfers and next measurements."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from receptance._text import printable
from receptance.fit.covariance import UNINFORMATIVE
from receptance.fit.figure import OPEN, WIDE, draw_curves
from receptance.fit.prediction import PredictedFRF
from receptance.predict.ranking import Expectation, NextMeasurement
from receptance.predict.transfers import Transfer
from receptance.report.colours import BAD, BAND, COLOURS, INK, PALE
from receptance.report.figure import add_legend, finished, label_point, panels, plain_ticks, set_up, surface, title_left

_WIDEST = 1e4
"""An open side of a target is drawn up to this factor of the value, with an arrow head."""


def draw_transfer(transfer: Transfer, ax: Axes | None = None) -> Figure:
    """Draw errors of predicted natural frequencies with their intervals, and predicted receptances with their bands."""
    frfs = transfer.frfs[:8]
    if not transfer.modes and not frfs:
        raise ValueError(f"nothing was predicted: {'; '.join(transfer.not_predicted) or 'there is no split'}")
    columns = 1 if not frfs else 2
    rows = max(len(frfs), 1)
    tall = 1.6 + 0.24 * len(transfer.modes)
    height = max(tall, 2.9 * rows) + 0.6
    figure = surface(ax, 7.2 + 6.2 * (columns - 1), height)
    hits, count = transfer.inside
    text = f"{hits} of {count} natural frequencies in their {100 * transfer.level:g} % intervals"
    title_left(figure, f"{transfer.title}\n{text}", 12.0 if len(transfer.title) < 50 * columns else 10.0)
    cells = figure.subfigures(1, columns, squeeze=False, width_ratios=[7.2, 6.2][:columns])[0]
    _draw_modes(cells[0].subplots(), transfer)
    if frfs:
        for axes, frf in zip(np.ravel(cells[1].subplots(len(frfs), 1, squeeze=False)), frfs, strict=True):
            _draw_frf(axes, frf, transfer.level)
    return finished(figure, transfer.rejection)


def _draw_modes(axes: Axes, transfer: Transfer) -> None:
    set_up(axes, "Held out", "predicted against measured (%)", grid="x")
    axes.axvline(0.0, color=INK, linewidth=1.0)
    labels, before, several = [], "", len({mode.configuration for mode in transfer.modes}) > 1
    for row, mode in enumerate(transfer.modes):
        text = f"{mode.measured_hz:.0f} Hz" + ("" if mode.mode is None else f"  mode {mode.mode}")
        labels.append(f"{mode.configuration}   {text}" if mode.configuration != before and several else text)
        before = mode.configuration
        interval = mode.interval_hz(transfer.level, mode.measured_deviation_hz)
        if mode.measured_hz is None or mode.error_percent is None or interval is None:
            axes.plot(0.0, row, "x", color=BAD, markersize=7)
            label_point(axes, "no prediction", (0.0, row), offset=(6.0, -3.0), colour=BAD)
            continue
        if mode.uninformative(transfer.level):
            axes.plot(mode.error_percent, row, "o", color=PALE, markerfacecolor="white", markersize=5)
            point = mode.error_percent, row
            label_point(axes, f"interval {UNINFORMATIVE}", point, offset=(6.0, -3.0), colour=PALE)
            continue
        low, high = (100.0 * (end / mode.measured_hz - 1.0) for end in interval)
        inside = mode.within(transfer.level)
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
        lines, np.maximum(low, size / OPEN), np.minimum(high, size * OPEN), color=BAND, linewidth=0.0, label="band"
    )
    draw_curves(axes, lines, frf.measured, frf.receptance, "predicted")
    axes.set_yscale("log")
    add_legend(axes, fontsize=8, loc="upper right")


def draw_next_measurement(measurement: NextMeasurement, ax: Axes | None = None) -> Figure:
    """Draw the interval of each target now and as expected with each candidate, the best candidate on top."""
    # Four panels are drawn as a square.
    columns = min(len(measurement.targets), 2 if len(measurement.targets) == 4 else 3)
    rows = -(-len(measurement.targets) // columns)
    names = ["now", *(candidate.label for candidate in measurement.ranking)]
    height = rows * (0.9 + 0.36 * len(names)) + 0.7
    figure = surface(ax, 2.2 + 3.6 * columns, height)
    title_left(figure, f"{measurement.title}: intervals now and as expected")
    cells = panels(figure, len(measurement.targets), columns, sharey=True)
    for axes, name in zip(cells, measurement.targets, strict=True):
        _draw_target(axes, name, [candidate.expected[name] for candidate in measurement.ranking], names)
    return finished(figure, measurement.rejection)


def _draw_target(axes: Axes, name: str, expected: list[Expectation], names: list[str]) -> None:
    set_up(axes, name, "", "")
    axes.grid(visible=False)
    first = expected[0]
    log = first.scale == "log"
    low, high = _shown(first, first.now)
    for row, (ends, colour) in enumerate(
        [((low, high), INK), *((_shown(e, (e.lower, e.upper)), COLOURS[0]) for e in expected)]
    ):
        axes.plot(ends, [row, row], color=colour, linewidth=4.0 if row else 3.0, solid_capstyle="butt")
        if row and expected[row - 1].stays_open >= 0.005:
            share = f"{100.0 * expected[row - 1].stays_open:.0f} % stays open"
            axes.annotate(share, (1.0, row), xycoords=("axes fraction", "data"), ha="right", va="bottom", fontsize=7.5)
    for end, side, is_open in ((low, "<", first.now[0] in (0.0, -np.inf)), (high, ">", np.isinf(first.now[1]))):
        if is_open and first.value != 0.0:
            axes.plot([end], [0], side, color=INK, markersize=7.0)
    if first.value != 0.0:
        axes.axvline(first.value, color=PALE, linewidth=0.9)
    if log:
        axes.set_xscale("log")
        if high / low < WIDE:
            plain_ticks(axes.xaxis)
    axes.set_yticks(range(len(names)), list(map(printable, names)), fontsize=9)
    axes.set_ylim(len(names) - 0.5, -0.5)


def _shown(e: Expectation, ends: tuple[float, float]) -> tuple[float, float]:
    """Return an interval whose open sides end with the axis."""
    if e.scale == "log":
        low, high = e.value / _WIDEST, e.value * _WIDEST
    else:
        whole = 10.0 * max(abs(e.value), e.upper - e.lower)
        low, high = e.value - whole, e.value + whole
    return max(ends[0], low), min(ends[1], high)
