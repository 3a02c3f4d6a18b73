"""Stability lobes as a figure."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from receptance.stability import Lobes

__all__ = ["draw_lobes"]


def draw_lobes(lobes: Lobes, *, probability: float = 0.95, title: str = "") -> Figure:
    """Draw the limit of depth over spindle speed, its band and the chatter frequency.

    Parameters
    ----------
    lobes : Lobes
        What to draw.
    probability : float, optional
        Of the depth that is drawn beside the limit where draws of the receptance were given.
    title : str, optional
        Above the figure.

    Returns
    -------
    matplotlib.figure.Figure
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 5.6), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=[3, 1])
    speed = lobes.speeds_rpm / 1e3
    finite = np.isfinite(lobes.depth)
    highest = 1e3 * np.max(lobes.depth[finite], initial=0.0)
    lowest = 1e3 * np.min(lobes.depth[finite], initial=np.inf)
    # A few high lobes at high speed would press all others onto the axis.
    top = min(1.08 * highest, 12.0 * lowest) if finite.any() else 1.0
    limit = np.where(finite, 1e3 * lobes.depth, 2.0 * top)
    above.fill_between(speed, limit, 2.0 * top, color="#d95f02", alpha=0.12, lw=0, label="chatter")
    above.plot(speed, limit, color="#1b4f72", lw=1.4, label="limit")
    if lobes.lower is not None and lobes.upper is not None:
        high = np.where(np.isfinite(lobes.upper), 1e3 * lobes.upper, 2.0 * top)
        above.fill_between(
            speed, 1e3 * lobes.lower, high, color="#1b4f72", alpha=0.25, lw=0, label="95 % band of the limit"
        )
        stable = 1e3 * lobes.stable_depth(probability)
        above.plot(speed, stable, color="#1e8449", lw=1.2, ls="--", label=f"stable with {100 * probability:g} %")
    above.set_ylim(0.0, top)
    above.set_ylabel("depth of cut (mm)")
    figure.legend(loc="outside lower center", ncols=4, frameon=False)
    below.plot(speed, lobes.chatter_hz, ".", color="#1b4f72", ms=1.5)
    below.set_xlabel("spindle speed (1000 rpm)")
    below.set_ylabel("chatter (Hz)")
    below.set_xlim(speed[0], speed[-1])
    for axes in (above, below):
        axes.grid(alpha=0.3)
    if title:
        figure.suptitle(title)
    return figure
