"""Figures of fits and predictions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance._text import printable
from receptance.identification import MeasuredFRF
from receptance.identification.prediction import DECIBEL
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
    from matplotlib.figure import Figure, SubFigure
    from numpy.typing import NDArray

    from receptance.campaign import Prediction
    from receptance.identification import Identification, PredictedFRF

__all__ = ["draw_identification", "draw_prediction"]

_ROW = 4.4
"""Height of a row of panels in inches."""
_MOST_FRFS = 12
_STEPS = (0.0005, 0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5)
"""Distances of ticks on an axis of factors."""
_MAX_BAND = 3.0
"""Largest half width of a band that is drawn, as natural logarithm."""
_FORMS = {("y", "y"): "m/N", ("y", "theta"): "m/(N m)", ("theta", "y"): "rad/N", ("theta", "theta"): "rad/(N m)"}


def draw_identification(found: Identification, ax: Axes | None = None) -> Figure:
    """Draw measurements and fitted model, their ratio, and the intervals of the parameters."""
    everything = list(zip(found.labels, found.task.observed, found.assemblies, strict=True))
    frfs = [(label, one, assembly) for label, one, assembly in everything if isinstance(one, MeasuredFRF)]
    shown = frfs[:_MOST_FRFS]
    lists = [(label, one, assembly) for label, one, assembly in everything if not isinstance(one, MeasuredFRF)]
    figure, cells = _grid(ax, len(shown) + bool(lists) + 1, f"{found.title}{_left_out(frfs, shown)}")
    for (label, seen, assembly), cell in zip(shown, cells, strict=False):
        model = assembly.receptance(
            seen.frequency_hz, response=seen.response, excitation=seen.excitation, force=seen.force
        )
        top, below = _pair(cell)
        _magnitude(top, label, _FORMS[seen.response.direction, seen.excitation.direction])
        lines = seen.frequency_hz.real
        top.plot(lines, np.abs(seen.receptance), ".", color=PALE, markersize=2.5, label="measured")
        top.plot(lines, np.abs(model), color=COLOURS[0], linewidth=1.3, label="fitted")
        low, high = top.get_ylim()
        top.set_ylim(low, 30.0 * high)
        _legend(top, seen.standard_deviation)
        ratio = np.log(np.abs(seen.receptance / model))
        _ratio(below, "measured over\nfitted (dB)", lines, ratio, None, seen.standard_deviation)
    if lists:
        axes = cells[len(shown)].subplots()
        rows = []
        for label, listed, assembly in lists:
            fitted = assembly.lowest_natural_frequencies(max(listed.modes))[0][[mode - 1 for mode in listed.modes]]
            rows.append((label, listed.modes, listed.frequency_hz, fitted, None, listed.standard_deviation_hz))
        _frequencies(axes, "Natural frequencies, fitted against measured", "fitted", rows)
    _parameters(cells[len(shown) + bool(lists)].subplots(), found)
    return finished(figure)


def draw_prediction(found: Prediction, ax: Axes | None = None) -> Figure:
    """Draw predictions with their intervals, and measurements."""
    frfs = found.frfs[:_MOST_FRFS]
    compared = [one for one in found.frequencies if one.measured_hz is not None]
    title = f"{found.title}{_left_out(found.frfs, frfs)}"
    figure, cells = _grid(ax, len(frfs) + bool(compared), title)
    for frf, cell in zip(frfs, cells, strict=False):
        _predicted_frf(cell, frf, found)
    if compared:
        rows = [
            (
                one.name,
                [mode.mode for mode in one.modes],
                one.measured_hz,
                one.predicted_hz,
                found.reach * one.scatter.total,
                np.array([mode.measured_deviation_hz for mode in one.modes]),
            )
            for one in compared
        ]
        title = f"Natural frequencies held out, with {100.0 * found.level:g} % intervals"
        _frequencies(cells[len(frfs)].subplots(), title, "predicted", rows)
    return finished(figure)


def _grid(ax: Axes | None, count: int, title: str) -> tuple[Figure | SubFigure, list[SubFigure]]:
    columns = min(count, 3 if count > 4 or count == 3 else 2)
    rows = -(-count // columns)
    figure = surface(ax, 5.6 * columns + (2.0 if columns == 1 else 0.0), _ROW * rows + 0.6)
    cells = list(np.ravel(figure.subfigures(rows, columns, squeeze=False)))
    most = 64 * columns + 24
    text = title if len(title) < most else title[: most - 3] + "..."
    title_left(figure, text, 14.0 if len(text) < 32 * columns + 12 else 12.0)
    return figure, cells


def _left_out(all_of_them: Sequence[Any], *drawn: Sequence[Any]) -> str:
    rest = len(all_of_them) - sum(map(len, drawn))
    return f" ({rest} more responses are not drawn)" if rest > 0 else ""


def _pair(cell: SubFigure) -> tuple[Axes, Axes]:
    top, below = cell.subplots(2, 1, sharex=True, height_ratios=[2.6, 1.0])
    return top, below


def _magnitude(axes: Axes, title: str, unit: str) -> None:
    set_up(axes, title, y=f"|receptance| ({unit})")
    axes.set_yscale("log")


def _ratio(
    axes: Axes,
    label: str,
    lines: NDArray[np.float64],
    log_ratio: NDArray[np.float64] | None,
    band: NDArray[np.float64] | None,
    noise: NDArray[np.float64] | None,
) -> None:
    """Draw the ratio of magnitudes in dB, the band of the prediction and the noise of the lines."""
    set_up(axes, "", "frequency (Hz)", label)
    most = 0.5
    if band is not None:
        # The band is infinite if a relevant parameter is not determined.
        band = np.minimum(band, _MAX_BAND)
        axes.fill_between(lines, -DECIBEL * band, DECIBEL * band, color=BAND, linewidth=0)
        most = max(most, 1.5 * DECIBEL * float(np.percentile(band, 98)))
    if log_ratio is not None:
        axes.plot(lines, DECIBEL * log_ratio, ".", color=INK, markersize=1.8)
        most = max(most, 1.3 * DECIBEL * float(np.percentile(np.abs(log_ratio), 99)))
    if noise is not None:
        for sign in (-2.0, 2.0):
            axes.plot(lines, sign * DECIBEL * noise, color=BAD, linewidth=0.8, alpha=0.7)
        most = max(most, 3.0 * DECIBEL * float(np.median(noise)))
    axes.axhline(0.0, color=INK, linewidth=0.6)
    axes.set_ylim(-most, most)


def _legend(axes: Axes, noise: NDArray[np.float64] | None) -> None:
    if noise is not None:
        axes.plot([], [], color=BAD, linewidth=0.8, alpha=0.7, label="noise, two standard deviations (below)")
    add_legend(axes, loc="upper right", markerscale=4)


def _predicted_frf(cell: SubFigure, frf: PredictedFRF, found: Prediction) -> None:
    lines = frf.frequency_hz.real
    measured = frf.measured is not None
    top, below = _pair(cell)
    title = f"{frf.name}: {'held out' if measured else 'predicted, not measured'}"
    _magnitude(top, title, _FORMS[frf.response.direction, frf.excitation.direction])
    size = np.abs(frf.receptance)
    shown = size if frf.measured is None else np.concatenate([size, np.abs(frf.measured)])
    limits = float(shown.min()) / 2.0, float(shown.max()) * 30.0
    low, high = frf.band(found.level)
    low, high = np.clip(low, limits[0] / 10.0, None), np.clip(high, None, limits[1] * 10.0)
    top.fill_between(lines, low, high, color=BAND, linewidth=0, label=f"{100.0 * found.level:g} % band")
    if frf.measured is not None:
        top.plot(lines, np.abs(frf.measured), ".", color=PALE, markersize=2.5, label="measured")
    top.plot(lines, size, color=COLOURS[0], linewidth=1.3, label="predicted")
    top.set_ylim(*limits)
    if not measured:
        for one in found.frequencies:
            if one.name == frf.name:
                _name_modes(top, one.predicted_hz, found.reach * one.scatter.total)
    _legend(top, frf.measured_deviation)
    label = "measured over\npredicted (dB)" if measured else "band (dB)"
    log_ratio = frf.log_ratio.real if measured else None
    _ratio(below, label, lines, log_ratio, found.reach * frf.scatter.total, frf.measured_deviation)


def _name_modes(axes: Axes, frequency_hz: NDArray[np.float64], half_hz: NDArray[np.float64]) -> None:
    """Annotate natural frequencies with their intervals."""
    for frequency, half in zip(frequency_hz, half_hz, strict=True):
        text = f"{frequency:.0f} ± {half:.0f} Hz" if np.isfinite(half) else f"{frequency:.0f} Hz, open"
        axes.axvline(frequency, color=PALE, linewidth=0.7, linestyle=":")
        axes.annotate(
            text, (frequency, 0.03), xycoords=("data", "axes fraction"), xytext=(-4, 0), textcoords="offset points",
            rotation=90, ha="right", va="bottom", fontsize=8, color=INK,
        )  # fmt: skip


def _frequencies(axes: Axes, title: str, series: str, rows: Sequence[tuple[Any, ...]]) -> None:
    """Draw errors of calculated natural frequencies in percent, grouped by measurement."""
    set_up(axes, title, "", "against measured (%)")
    place = 0.0
    ticks: list[tuple[float, str]] = []
    for name, modes, measured, calculated, half, deviation in rows:
        x = place + np.arange(len(modes))
        error = 100.0 * (calculated / measured - 1.0)
        if deviation is not None and deviation.any():
            label = None if place else "reading, two standard deviations"
            half_reading = 200.0 * deviation / measured
            axes.errorbar(x, np.zeros(len(x)), half_reading, fmt="none", ecolor=PALE, capsize=5, label=label)
        bars = None if half is None else 100.0 * half / measured
        label = None if place else series
        axes.errorbar(x, error, bars, fmt="o", color=COLOURS[0], capsize=3, markersize=5, label=label)
        if len(rows) * len(modes) <= 24:
            for at, value, mode in zip(x, error, modes, strict=True):
                label_point(axes, f"{mode}", (at, value), offset=(6.0, 3.0))
        ticks.append((float(x.mean()), name))
        place = float(x[-1]) + 1.8
        if len(rows) > 1 and name is not rows[-1][0]:
            axes.axvline(place - 0.9, color="#E6E6E6", linewidth=0.8)
    axes.axhline(0.0, color=INK, linewidth=0.8)
    tilted = sum(len(name) for _, name in ticks) > 50
    axes.set_xticks(
        [at for at, _ in ticks],
        [printable(name) for _, name in ticks],
        rotation=35 if tilted else 0,
        ha="right" if tilted else "center",
        rotation_mode="anchor",
        fontsize=9,
    )
    low, high = axes.get_ylim()
    most = max(abs(low), abs(high), 0.05)
    axes.set_ylim(-most, 1.25 * most)
    axes.set_xlim(-1.2, place - 0.6)
    add_legend(axes, loc="upper right", ncols=2)


def _parameters(axes: Axes, found: Identification) -> None:
    """Draw the 95 % interval of every parameter relative to its value."""
    set_up(axes, "95 % intervals of the parameters", "relative to the value", grid="both")
    styles = [(BAND, 12.0, "with tolerances")] if found.errors else []
    styles.append((COLOURS[0], 6.0, "from the data"))
    for colour, width, label in styles:
        axes.plot([], [], color=colour, linewidth=width, label=label)
    labels = []
    for index, address in enumerate(name for name in found.values if name not in found.errors):
        value = found.values[address]
        intervals = [found.interval(address)] if found.errors else []
        for ends, (colour, width, _) in zip([*intervals, found.interval(address, exact=True)], styles, strict=True):
            low, high = sorted(end / value if value else float("inf") for end in ends)
            if np.isfinite(high) and low > 0.0:
                axes.plot([low, high], [-index] * 2, color=colour, linewidth=width, solid_capstyle="butt")
                continue
            text = "the interval includes zero" if np.isfinite(high) and value else "not determined"
            axes.annotate(
                text, (1.0, -index), xytext=(0, 9), textcoords="offset points", ha="center", fontsize=9, color=BAD
            )
        axes.plot(1.0, -index, "|", color=INK, markersize=11)
        labels.append(f"{printable(address)}\n{value:.4g}")
    axes.set_yticks([-i for i in range(len(labels))], labels, fontsize=8 if len(labels) > 6 else 9)
    axes.set_ylim(-len(labels) + 0.4, 0.6)
    axes.set_xscale("log")
    _factors(axes)
    add_legend(axes, loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=2)


def _factors(axes: Axes) -> None:
    """Set a few round ticks on both sides of one."""
    from matplotlib.ticker import FixedLocator, NullLocator

    low, high = axes.get_xlim()
    span = max(high, 1.0 / low, 1.001)
    decades = math.ceil(math.log10(span))
    step = next((s for s in _STEPS if 4.0 * s >= span - 1.0), None)
    if step is not None:
        above = [1.0 + k * step for k in range(1, 5)]
    elif decades == 1:
        above = [2.0, 5.0, 10.0]
    else:
        every = -(-decades // 4)
        above = [10.0**k for k in range(every, decades + 1, every)]
    ticks = [*(1.0 / tick for tick in above[::-1]), 1.0, *above]
    axes.xaxis.set_major_locator(FixedLocator(ticks))
    axes.xaxis.set_minor_locator(NullLocator())
    names = [f"{tick:.5g}" for tick in above]
    axes.set_xticks(ticks, [*(f"\u00f7 {name}" for name in names[::-1]), "1", *(f"\u00d7 {name}" for name in names)])
    axes.set_xlim(1.0 / span, span)
