"""The figure of a campaign over levels."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from receptance.campaign.addresses import kind_of
from receptance.report.figure import finished, surface, title_left
from receptance.taper.figure import axis_unit, draw_with_law

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from receptance.campaign.series import LevelSeries

__all__ = ["draw_series"]


def draw_series(found: LevelSeries, ax: Axes | None = None) -> Figure:
    """Draw each parameter over the levels, with 95 % whiskers and its law, as the paper's figures 10 to 13.

    Parameters
    ----------
    found : LevelSeries
        Of a campaign with a series of six levels or more.
    ax : Axes, optional
        As in `Result.plot`.

    Returns
    -------
    matplotlib.figure.Figure
        The figure.
    """
    over = f"{found.over} ({found.unit})" if found.unit else found.over
    count = len(found)
    columns = min(count, 3 if count > 4 else 2)
    rows = -(-count // columns)
    figure = surface(ax, 5.6 * columns + (1.5 if columns == 1 else 0.0), 4.2 * rows + 0.7)
    panels = list(np.ravel(figure.subplots(rows, columns, squeeze=False)))
    for axes, (name, series) in zip(panels, found.items(), strict=False):
        factor, label = axis_unit(kind_of(name).unit, series)
        draw_with_law(axes, series, factor, over, label)
    for axes in panels[count:]:
        axes.set_visible(False)
    if found.provenance.title:
        title_left(figure, found.provenance.title)
    return finished(figure)
