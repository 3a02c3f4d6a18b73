"""Figure of the receptances of a spindle, line by line."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from receptance.model.terminals import ENTRIES
from receptance.report.figure import COLOURS, NORMAL_95, PALE, draw_condition, finished, set_up, surface, title_left

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from receptance.model.terminals import ModalPart
    from receptance.spindle.receptance import SpindleReceptance

_TITLES = ("y/F (m/N)", "θ/M (rad/(N m))", "y/M (m/(N m))")


def draw_spindle(spindle: SpindleReceptance, modes: ModalPart | None = None, ax: Axes | None = None) -> Figure:
    """Draw the magnitudes of the three terms with 95 % bands, and the condition number; unusable lines are pale.

    Fitted modes are drawn over the lines; `ax` as in `Result.plot`.
    """
    figure = surface(ax, 11.0, 8.5)
    text = f"Spindle line by line: {', '.join(spindle.labels)}"
    legend = (
        f"blue, with 95 % intervals: usable lines, standard deviation below {100.0 * spindle.limit:g} %;  grey: others"
    )
    more = ";  orange: modes" if modes else ""
    title_left(figure, f"{text}\n{legend}{more}", 10.5)
    grid = figure.add_gridspec(2, 2)
    lines = np.asarray(spindle.frequency_hz).real
    curve = None if modes is None else modes.receptance(spindle.frequency_hz)
    for number, (i, j) in enumerate(ENTRIES):
        axes = figure.add_subplot(grid[divmod(number, 2)])
        size, deviation = np.abs(spindle.matrix[:, i, j]), spindle.standard_deviation[:, i, j]
        set_up(axes, _TITLES[number], "frequency (Hz)" if number == 2 else "", "")
        shown = np.where(spindle.usable, size, np.nan)
        axes.semilogy(lines, np.where(spindle.usable, np.nan, size), ".", color=PALE, markersize=2.5)
        low = np.maximum(shown - NORMAL_95 * deviation, 0.05 * shown)
        axes.fill_between(lines, low, shown + NORMAL_95 * deviation, color=COLOURS[0], alpha=0.25, linewidth=0)
        axes.semilogy(lines, shown, ".", color=COLOURS[0], markersize=2.5)
        if curve is not None:
            axes.semilogy(lines, np.abs(curve[:, i, j]), color=COLOURS[1], linewidth=1.2)
        if spindle.usable.any():
            axes.set_ylim(0.3 * np.nanmin(shown), 3.0 * np.nanmax(shown))
        axes.set_xlim(lines[0], lines[-1])
    draw_condition(figure.add_subplot(grid[1, 1]), lines, spindle.condition)
    return finished(figure)
