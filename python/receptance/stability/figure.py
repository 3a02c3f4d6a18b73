"""Figures of stability lobes."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from receptance.report.colours import COLOURS, INK, PALE
from receptance.report.figure import add_legend, finished, label_point, panels, set_up, surface
from receptance.stability.lobes import Lobes, Stability, StableCut
from receptance.stability.operating import top_of

_SPEED = "spindle speed (1000 rpm)"
_LARGEST_COUNT = 8
"""Largest number of diagrams in a figure."""
_TITLE = 92
"""Width of the title in characters."""
_RECOMMENDED = 3
"""Number of marked recommended speeds."""
_LEVEL = 0.95
"""Probability of the drawn stable depths if the lobes have draws but no probability."""
_LIMIT, _CHATTER, _STABLE = COLOURS[0], COLOURS[1], COLOURS[2]
_LABEL_WIDTH, _LABEL_HEIGHT = 0.17, 0.07
"""Size of the label of a speed as a share of the axes."""


def draw_lobes(lobes: Lobes, ax: Axes | None = None) -> Figure:
    """Draw the limit of depth over spindle speed, its band, recommended speeds and the chatter frequency."""
    with_chatter = bool(np.isfinite(lobes.chatter_hz).any())
    figure = surface(ax, 9.0, 5.8 if with_chatter else 4.6)
    rows = figure.subplots(2, 1, sharex=True, height_ratios=[3, 1]) if with_chatter else [figure.subplots()]
    _draw_diagram(rows[0], lobes)
    add_legend(figure, ncols=4)
    if with_chatter:
        rows[0].set_xlabel("")
        rows[1].plot(1e-3 * lobes.speeds_rpm, lobes.chatter_hz, ".", color=_LIMIT, ms=1.5)
        set_up(rows[1], "", _SPEED, "chatter (Hz)")
    return finished(figure, lobes.rejection)


def draw_stability(several: Stability, ax: Axes | None = None) -> Figure:
    """Draw up to eight lobe diagrams below each other; a single one like `draw_lobes`."""
    diagrams = list(several.values())[:_LARGEST_COUNT]
    if len(diagrams) == 1:
        return draw_lobes(diagrams[0], ax)
    figure = surface(ax, 9.0, 0.6 + 3.1 * len(diagrams))
    for axes, lobes in zip(panels(figure, len(diagrams), 1), diagrams, strict=True):
        _draw_diagram(axes, lobes)
    handles = {text: line for axes in figure.axes for line, text in zip(*axes.get_legend_handles_labels(), strict=True)}
    add_legend(figure, handles.values(), handles.keys(), ncols=4)
    return finished(figure, several.rejection)


def _draw_diagram(axes: Axes, lobes: Lobes) -> None:
    """Draw limit, band, stable depth at a probability, and recommended speeds into axes."""
    probability = lobes.probability or _LEVEL
    order = np.argsort(lobes.speeds_rpm, kind="stable")
    speed = 1e-3 * lobes.speeds_rpm[order]
    depth = lobes.depth[order]
    has_draws = lobes.draws is not None
    cuts: tuple[StableCut, ...] = ()
    if np.isfinite(depth).any():
        cuts = lobes.recommended(probability=probability if has_draws else None, count=_RECOMMENDED)
    top = max(top_of(lobes), 1.15e3 * max((cut.depth for cut in cuts), default=0.0))
    limit = highest = _clipped(depth, top)
    axes.fill_between(speed, limit, 2.0 * top, color=_CHATTER, alpha=0.10, lw=0, label="chatter")
    if lobes.lower is not None and lobes.upper is not None:
        low, highest = _clipped(lobes.lower[order], top), _clipped(lobes.upper[order], top)
        axes.fill_between(speed, low, highest, color=_LIMIT, alpha=0.22, lw=0, label="95 % band of the limit")
    axes.plot(speed, limit, color=_LIMIT, lw=1.3, label="limit")
    if has_draws:
        stable = _clipped(lobes.stable_depth(probability)[order], top)
        axes.plot(speed, stable, color=_STABLE, lw=1.3, ls="--", label=f"stable with {100 * probability:g} %")
    axes.set_ylim(0.0, max(top, _mark_speeds(axes, cuts, speed, np.minimum(highest, top), top)))
    axes.set_xlim(speed[0], speed[-1])
    set_up(axes, textwrap.fill(lobes.title_of_cut(), _TITLE), _SPEED, "depth of cut (mm)")


def _mark_speeds(
    axes: Axes, cuts: Sequence[StableCut], speed: NDArray[np.float64], highest: NDArray[np.float64], top: float
) -> float:
    """Mark recommended speeds with labels above all curves that do not overlap; return the height that they need."""
    width, step = _LABEL_WIDTH * float(np.ptp(speed)), _LABEL_HEIGHT * top
    labels: list[tuple[float, float, float]] = []
    for cut in cuts:
        x, y = 1e-3 * cut.speed_rpm, 1e3 * cut.depth
        sides = [(x, x + width), (x - width, x)]
        sides = [side for side in sides if speed[0] <= side[0] and side[1] <= speed[-1]] or sides[:1]
        heights = [highest[(speed >= low) & (speed <= high)].max(initial=y) + step for low, high in sides]
        best = int(np.argmin(heights))
        (low, high), height = sides[best], heights[best]
        while any(low < b and a < high and abs(height - other) < step for a, b, other in labels):
            height += step
        labels.append((low, high, height))
        axes.plot([x, x], [0.0, height], color=PALE, lw=0.8, zorder=1)
        axes.plot(x, y, "v", color=INK, ms=6, zorder=4)
        label_point(axes, f"{cut.speed_rpm:.0f} rpm, {y:.2g} mm", (x, height), left=high == x, offset=(3.0, 0.0))
    return max((height + step for _, _, height in labels), default=0.0)


def _clipped(depth: NDArray[np.float64], top: float) -> NDArray[np.float64]:
    return np.minimum(1e3 * depth, 2.0 * top)
