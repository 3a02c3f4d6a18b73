"""Figures of FRFs."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from numpy.typing import NDArray

from receptance.frf import FRF
from receptance.model.coordinates import UnknownPosition
from receptance.report.colours import COLOURS, INK, PALE
from receptance.report.figure import add_legend, finished, phase_line, set_up, set_up_phase, surface, title_left

_MAX_NAMED = 8
"""Most entries named in the legend; of more entries only the number is given."""
_OPACITY = 0.24
"""Opacity of the 95 % band."""
PHASE_FROM = {"receptance": -225.0, "mobility": -180.0, "accelerance": -135.0}
"""Lower end of the phase axis in degrees, in the middle of the range that a drive point does not reach."""


def draw_frf(frf: FRF, ax: Axes | None = None) -> Figure:
    """Draw magnitude, phase and, if known, coherence of all entries of an FRF.

    Lines outside the usable band are shaded. If the variance is known, a pale band around the magnitude is the 95 %
    interval.
    """
    rows = 3 if frf.coherence is not None else 2
    figure = surface(ax, 9.0, 5.4 + 1.4 * (rows - 2))
    heights = [3.0, 1.4, 1.0][:rows]
    panels = figure.subplots(rows, 1, sharex=True, squeeze=False, height_ratios=heights)[:, 0]
    unit = frf.unit.replace("^2", "²") if len(frf.distinct_units) == 1 else "SI units"
    set_up(panels[0], "", "", f"|{frf.form}| ({unit})")
    set_up_phase(panels[1], PHASE_FROM[frf.form])
    for number, entry in enumerate(np.ndindex(frf.shape[1:])):
        _draw_entry(panels, frf, entry, COLOURS[number % len(COLOURS)], number < _MAX_NAMED)
    panels[0].set_yscale("log")
    if rows == 3:
        set_up(panels[2], "", "", "coherence")
        panels[2].set_ylim(0.0, 1.05)
    panels[-1].set_xlabel("frequency (Hz)", color=INK)
    panels[-1].set_xlim(*_limits(frf.frequency_hz))
    for axes in panels:
        _shade(axes, frf)
    _title(figure, panels[0], frf)
    return finished(figure)


def _draw_entry(panels: NDArray[np.object_], frf: FRF, entry: tuple[int, ...], colour: str, named: bool) -> None:
    i, j = entry
    f, h = frf.frequency_hz, frf.values[:, i, j]
    size = np.where(h == 0.0, np.nan, np.abs(h))
    # A single line would be invisible without a marker.
    marker = "o" if f.size == 1 else ""
    panels[0].plot(f, size, color=colour, linewidth=1.1, marker=marker, label=_name(frf, i, j) if named else None)
    if frf.log_variance is not None:
        half = np.where(np.isfinite(frf.log_variance[:, i, j]), frf.log_interval()[:, i, j], np.nan)
        half = np.minimum(half, np.log(1e3))
        panels[0].fill_between(f, size * np.exp(-half), size * np.exp(half), color=colour, alpha=_OPACITY, linewidth=0)
    panels[1].plot(*phase_line(f, h, PHASE_FROM[frf.form]), color=colour, linewidth=1.1, marker=marker)
    if frf.coherence is not None:
        panels[2].plot(f, frf.coherence[:, i, j], color=colour, linewidth=0.9, marker=marker)


def _name(frf: FRF, row: int, column: int) -> str:
    """Return the name of an entry in the legend: its labels, coordinates or numbers."""
    response, excitation = frf.responses[row], frf.excitations[column]
    if frf.labels is not None and (frf.labels[0][row] or frf.labels[1][column]):
        return f"{frf.labels[0][row]} over {frf.labels[1][column]}"
    load = "force" if excitation.direction == "y" else "moment"
    if isinstance(response, UnknownPosition) or isinstance(excitation, UnknownPosition):
        return f"{response.direction} {row} over {load} {column}" if frf.values[0].size > 1 else ""
    return f"{response.describe()} over {load}{excitation.describe().removeprefix(excitation.direction)}"


def _limits(frequency_hz: NDArray[np.float64]) -> tuple[float, float]:
    first, last = float(frequency_hz[0]), float(frequency_hz[-1])
    return (first, last) if last > first else (0.9 * first - 1.0, 1.1 * last + 1.0)


def _shade(axes: Axes, frf: FRF) -> None:
    """Shade the lines outside the usable band, up to the middle between them and the next usable line."""
    if frf.usable is None:
        return
    f = frf.frequency_hz
    middle = 0.5 * (f[1:] + f[:-1])
    edges = np.r_[f[0], middle, f[-1]]
    turns = np.flatnonzero(np.diff(np.r_[True, frf.usable, True].astype(np.int8)))
    for begin, end in zip(turns[::2], turns[1::2], strict=True):
        axes.axvspan(float(edges[begin]), float(edges[end]), color=PALE, alpha=0.25, linewidth=0, zorder=0)


def _title(figure: Figure | SubFigure, axes: Axes, frf: FRF) -> None:
    _, n_out, n_in = frf.shape
    title = frf.label or frf.form.capitalize()
    details = []
    if n_out * n_in > _MAX_NAMED:
        details.append(f"{n_out} responses x {n_in} excitations")
    if frf.averages is not None:
        details.append(f"{frf.averages} averages")
    if frf.decay_rate:
        details.append(f"exponential window {frf.decay_rate:g}/s")
    if frf.log_variance is not None:
        details.append("pale: 95 % interval")
    if frf.usable is not None and not frf.usable.all():
        details.append("grey: outside the usable band")
    title_left(figure, "  ·  ".join([title, *details]), 11.0)
    if any(_name(frf, i, j) for i, j in np.ndindex(n_out, n_in)):
        add_legend(axes, loc="best")
