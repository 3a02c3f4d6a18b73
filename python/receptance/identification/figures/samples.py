"""Draws from a posterior as a figure."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from receptance.report.figure import BAD, COLOURS, finished, set_up, surface, title_left

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from receptance.identification.sampling import Samples

__all__ = ["draw_samples"]

_COLUMNS = 4


def draw_samples(samples: Samples, ax: Axes | None = None) -> Figure:
    """Draw a histogram of each parameter with its 95 % interval.

    Parameters
    ----------
    samples : Samples
        From `Identification.sample`.
    ax : Axes, optional
        As in `Result.plot`.

    Returns
    -------
    matplotlib.figure.Figure
        The figure.
    """
    columns = min(len(samples.names), _COLUMNS)
    rows = -(-len(samples.names) // columns)
    figure = surface(ax, 3.6 * columns, 3.0 * rows + 0.5)
    if samples.provenance.title:
        title_left(figure, samples.provenance.title)
    panels = np.ravel(figure.subplots(rows, columns, squeeze=False))
    for axes, name in zip(panels, samples.names, strict=False):
        set_up(axes, name, "value, SI units")
        axes.hist(samples.of(name), bins="auto", color=COLOURS[0], alpha=0.6)
        for end in samples.interval(name):
            axes.axvline(end, color=BAD, linewidth=1.0, linestyle=":")
        axes.set_yticks([])
    for axes in panels[len(samples.names) :]:
        axes.set_visible(False)
    return finished(figure)
