"""Figures of stability lobes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from receptance.report.figure import COLOURS, INK, PALE, add_legend, finished, label_point, set_up, surface

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from receptance.stability import Lobes, Stability, StableCut

__all__ = ["draw_lobes", "draw_lobes_on", "draw_several_lobes"]

_MOST = 8
_LEVEL = 0.95
"""Probability of the drawn stable depths if the lobes have draws but no probability."""

_LIMIT, _CHATTER, _STABLE = COLOURS[0], COLOURS[1], COLOURS[2]
_HIGHEST = 15.0
"""Upper end of the depth axis over the lowest limit, so that high lobes do not compress the others."""


def draw_lobes(lobes: Lobes, ax: Axes | None = None, *, recommended: int = 3) -> Figure:
    """Draw the limit of depth over spindle speed, its band, recommended speeds and the chatter frequency.

    Parameters
    ----------
    lobes : Lobes
        The lobes.
    ax : Axes, optional
        As in `Result.plot`.
    recommended : int, optional
        Number of marked recommended speeds.

    Returns
    -------
    matplotlib.figure.Figure
        The figure.
    """
    shown = bool(np.isfinite(lobes.chatter_hz).any())
    figure = surface(ax, 9.0, 5.8 if shown else 4.6)
    rows = figure.subplots(2, 1, sharex=True, height_ratios=[3, 1]) if shown else [figure.subplots()]
    draw_lobes_on(rows[0], lobes, recommended=recommended)
    add_legend(figure, ncols=4)
    set_up(rows[0], lobes.title_of_cut(), "" if shown else "spindle speed (1000 rpm)", "depth of cut (mm)")
    if shown:
        rows[1].plot(1e-3 * lobes.speeds_rpm, lobes.chatter_hz, ".", color=_LIMIT, ms=1.5)
        set_up(rows[1], "", "spindle speed (1000 rpm)", "chatter (Hz)")
    rows[0].set_xlim(1e-3 * lobes.speeds_rpm.min(), 1e-3 * lobes.speeds_rpm.max())
    return finished(figure)


def draw_several_lobes(several: Stability, ax: Axes | None = None, *, recommended: int = 3) -> Figure:
    """Draw up to eight lobe diagrams below each other; a single one like `draw_lobes`."""
    shown = list(several.values())[:_MOST]
    if len(shown) == 1:
        return draw_lobes(shown[0], ax, recommended=recommended)
    figure = surface(ax, 9.0, 0.6 + 3.1 * len(shown))
    for axes, lobes in zip(figure.subplots(len(shown), 1, squeeze=False)[:, 0], shown, strict=True):
        draw_lobes_on(axes, lobes, recommended=recommended)
        set_up(axes, lobes.title_of_cut(), "spindle speed (1000 rpm)", "depth of cut (mm)")
        axes.set_xlim(1e-3 * lobes.speeds_rpm.min(), 1e-3 * lobes.speeds_rpm.max())
    handles = {text: line for axes in figure.axes for line, text in zip(*axes.get_legend_handles_labels(), strict=True)}
    add_legend(figure, handles.values(), handles.keys(), ncols=4)
    return finished(figure)


def draw_lobes_on(axes: Axes, lobes: Lobes, *, recommended: int = 3) -> None:
    """Draw limit, band, stable depth at a probability, and recommended speeds into axes."""
    probability = lobes.probability or _LEVEL
    order = np.argsort(lobes.speeds_rpm, kind="stable")
    speed = 1e-3 * lobes.speeds_rpm[order]
    depth = lobes.depth[order]
    known = lobes.draws is not None
    chosen = probability if known else None
    marked = lobes.recommended(probability=chosen, count=recommended) if np.isfinite(depth).any() else ()
    top = max(_top(lobes, depth), 1.15e3 * max((cut.depth for cut in marked), default=0.0))
    limit = _shown(depth, top)
    axes.fill_between(speed, limit, 2.0 * top, color=_CHATTER, alpha=0.10, lw=0, label="chatter")
    if lobes.lower is not None and lobes.upper is not None:
        low, high = _shown(lobes.lower[order], top), _shown(lobes.upper[order], top)
        axes.fill_between(speed, low, high, color=_LIMIT, alpha=0.22, lw=0, label="95 % band of the limit")
    axes.plot(speed, limit, color=_LIMIT, lw=1.3, label="limit")
    if known:
        stable = _shown(lobes.stable_depth(probability)[order], top)
        axes.plot(speed, stable, color=_STABLE, lw=1.3, ls="--", label=f"stable with {100 * probability:g} %")
    _mark_speeds(axes, marked, 1e-3 * float(np.ptp(lobes.speeds_rpm)), top)
    axes.set_ylim(0.0, top)


def _mark_speeds(axes: Axes, marked: Sequence[StableCut], range_: float, top: float) -> None:
    """Mark recommended speeds with labels that do not overlap."""
    taken: list[tuple[float, float]] = []
    for cut in marked:
        x, y = 1e-3 * cut.speed_rpm, 1e3 * cut.depth
        axes.plot([x, x], [0.0, y], color=PALE, lw=0.8, zorder=1)
        axes.plot(x, y, "v", color=INK, ms=6, zorder=4)
        height = y + 0.04 * top
        while any(abs(x - other) < 0.2 * range_ and abs(height - at) < 0.06 * top for other, at in taken):
            height -= 0.065 * top
        taken.append((x, height))
        left = bool(x > np.mean(axes.get_xlim()))
        label_point(axes, f"{cut.speed_rpm:.0f} rpm, {y:.2g} mm", (x, height), left=left)


def _top(lobes: Lobes, depth: NDArray[np.float64]) -> float:
    finite = np.isfinite(depth)
    if not finite.any():
        return 1.0
    highest = lobes.upper if lobes.upper is not None else lobes.depth
    most = np.max(highest[np.isfinite(highest)], initial=float(depth[finite].max()))
    return float(1e3 * min(1.1 * most, _HIGHEST * depth[finite].min()))


def _shown(depth: NDArray[np.float64], top: float) -> NDArray[np.float64]:
    return np.minimum(1e3 * depth, 2.0 * top)
