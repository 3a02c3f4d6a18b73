"""Figure of the intervals that are expected with further measurements."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from receptance._text import printable
from receptance.report.figure import COLOURS, INK, PALE, finished, set_up, surface, title_left

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from receptance.identification.next_measurement import Expectation, NextMeasurement

__all__ = ["draw_next_measurement"]

_WIDEST = 1e4
"""An open side is drawn up to this factor of the value, with an arrow head."""
_COLUMNS = 3


def draw_next_measurement(found: NextMeasurement, ax: Axes | None = None) -> Figure:
    """Draw the interval of each target now and as expected with each candidate, the best candidate on top."""
    # Four panels are drawn as a square.
    columns = min(len(found.targets), 2 if len(found.targets) == 4 else _COLUMNS)
    rows = -(-len(found.targets) // columns)
    names = ["now", *(one.label for one in found.ranking)]
    height = rows * (0.9 + 0.36 * len(names)) + 0.7
    figure = surface(ax, 2.2 + 3.6 * columns, height)
    title_left(figure, f"{found.title}: intervals now and as expected")
    panels = np.ravel(figure.subplots(rows, columns, squeeze=False, sharey=True))
    for axes, name in zip(panels, found.targets, strict=False):
        _draw_target(axes, name, [one.expected[name] for one in found.ranking], names)
    for axes in panels[len(found.targets) :]:
        axes.set_visible(False)
    return finished(figure)


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
        if high / low < 20.0:
            _plain_ticks(axes)
    axes.set_yticks(range(len(names)), list(map(printable, names)), fontsize=9)
    axes.set_ylim(len(names) - 0.5, -0.5)


def _plain_ticks(axes: Axes) -> None:
    """Use a few plain numbers along a logarithmic axis with a small range."""
    from matplotlib.ticker import FuncFormatter, MaxNLocator, NullLocator

    axes.xaxis.set_major_locator(MaxNLocator(nbins=4, steps=[1, 2, 5, 10]))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.4g}"))


def _shown(e: Expectation, ends: tuple[float, float]) -> tuple[float, float]:
    """Return an interval whose open sides end with the axis."""
    if e.scale == "log":
        low, high = e.value / _WIDEST, e.value * _WIDEST
    else:
        whole = 10.0 * max(abs(e.value), e.upper - e.lower)
        low, high = e.value - whole, e.value + whole
    return max(ends[0], low), min(ends[1], high)
