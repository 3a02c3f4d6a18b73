"""The figure of an FRF."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from receptance.frf.places import Unplaced, describe
from receptance.report.figure import COLOURS, INK, PALE, finished, set_up, surface, title_left

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure
    from numpy.typing import NDArray

    from receptance.frf import FRF

__all__ = ["draw_frf"]

_MOST_NAMED = 8
"""Entries that the legend names; of more it says how many there are."""
_OPACITY = 0.24
"""Of the band of 95 %."""
_PHASE_FROM = {"receptance": -225.0, "mobility": -180.0, "accelerance": -135.0}
"""Where the full turn that is shown begins, in degrees: in the middle of what a drive point does not reach."""


def draw_frf(frf: FRF, ax: Axes | None = None) -> Figure:
    """Draw magnitude, phase and, where it is known, coherence of all entries of an FRF.

    The usable band is white and the rest shaded; where the variance is known a pale band around the magnitude holds
    95 %.

    Parameters
    ----------
    frf : FRF
        With one entry or several.
    ax : Axes, optional
        As in `Result.plot`.

    Returns
    -------
    matplotlib.figure.Figure
        The figure.
    """
    rows = 3 if frf.coherence is not None else 2
    figure = surface(ax, 9.0, 5.4 + 1.4 * (rows - 2))
    heights = [3.0, 1.4, 1.0][:rows]
    panels = figure.subplots(rows, 1, sharex=True, squeeze=False, height_ratios=heights)[:, 0]
    units = {unit for row in frf.units for unit in row}
    unit = units.pop().replace("^2", "²") if len(units) == 1 else "SI units"
    set_up(panels[0], "", "", f"|{frf.form}| ({unit})")
    set_up(panels[1], "", "", "phase (°)")
    for number, entry in enumerate(np.ndindex(frf.shape[1:])):
        _draw_entry(panels, frf, entry, COLOURS[number % len(COLOURS)], number < _MOST_NAMED)
    panels[0].set_yscale("log")
    panels[1].set_yticks([-180, -90, 0, 90, 180])
    panels[1].set_ylim(_PHASE_FROM[frf.form] - 5.0, _PHASE_FROM[frf.form] + 365.0)
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
    # A single line has no length: show the point.
    marker = "o" if f.size == 1 else ""
    panels[0].plot(f, size, color=colour, linewidth=1.1, marker=marker, label=_name(frf, i, j) if named else None)
    if frf.log_variance is not None:
        half = np.where(np.isfinite(frf.log_variance[:, i, j]), frf.log_interval()[:, i, j], np.nan)
        half = np.minimum(half, np.log(1e3))
        panels[0].fill_between(f, size * np.exp(-half), size * np.exp(half), color=colour, alpha=_OPACITY, linewidth=0)
    phase = (np.degrees(np.angle(h)) - _PHASE_FROM[frf.form]) % 360.0 + _PHASE_FROM[frf.form]
    # A jump by a full turn is no motion of the structure: the line ends and begins again.
    jumps = np.flatnonzero(np.abs(np.diff(phase)) > 180.0) + 1
    panels[1].plot(
        np.insert(f, jumps, np.nan), np.insert(phase, jumps, np.nan), color=colour, linewidth=1.1, marker=marker
    )
    if frf.coherence is not None:
        panels[2].plot(f, frf.coherence[:, i, j], color=colour, linewidth=0.9, marker=marker)


def _name(frf: FRF, row: int, column: int) -> str:
    """Return what the legend calls an entry: as the file does, by its places, or by its numbers."""
    response, excitation = frf.responses[row], frf.excitations[column]
    if frf.labels is not None and (frf.labels[0][row] or frf.labels[1][column]):
        return f"{frf.labels[0][row]} over {frf.labels[1][column]}"
    load = "force" if excitation.direction == "y" else "moment"
    if isinstance(response, Unplaced) or isinstance(excitation, Unplaced):
        return f"{response.direction} {row} over {load} {column}" if frf.values[0].size > 1 else ""
    return f"{describe(response)} over {load}{describe(excitation).removeprefix(excitation.direction)}"


def _limits(frequency_hz: NDArray[np.float64]) -> tuple[float, float]:
    first, last = float(frequency_hz[0]), float(frequency_hz[-1])
    return (first, last) if last > first else (0.9 * first - 1.0, 1.1 * last + 1.0)


def _shade(axes: Axes, frf: FRF) -> None:
    """Shade the lines outside the usable band, up to half way to the next line inside."""
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
    about = []
    if n_out * n_in > _MOST_NAMED:
        about.append(f"{n_out} responses x {n_in} excitations")
    if frf.averages is not None:
        about.append(f"{frf.averages} averages")
    if frf.decay_rate:
        about.append(f"exponential window {frf.decay_rate:g}/s")
    if frf.log_variance is not None:
        about.append("pale: 95 % interval")
    if frf.usable is not None and not frf.usable.all():
        about.append("grey: outside the usable band")
    title_left(figure, "  ·  ".join([title, *about]), 11.0)
    if any(_name(frf, i, j) for i, j in np.ndindex(n_out, n_in)):
        axes.legend(fontsize=8.5, frameon=False, loc="best")
