"""The figure of a campaign over levels: every parameter with its intervals and the law that describes it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from receptance.campaign.addresses import kind_of
from receptance.plot._style import COLOURS, finished, set_up, surface, title_left

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from receptance.campaign.series import LevelSeries
    from receptance.taper import ForceSeries

__all__ = ["draw_force_series", "draw_over_levels", "draw_series"]

_NORMAL = 1.96
_RAISED = str.maketrans("-0123456789", "\u207b\u2070\u00b9\u00b2\u00b3\u2074\u2075\u2076\u2077\u2078\u2079")
_LAWS = {"constant": "constant", "linear": "K\u2080 + a F", "power": "K\u2080 + a F\u207f"}


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
        factor, label = _unit(kind_of(name).unit, series)
        _draw_with_law(axes, series, factor, over, label)
    for axes in panels[count:]:
        axes.set_visible(False)
    if found.provenance.title:
        title_left(figure, found.provenance.title)
    return finished(figure)


def draw_force_series(series: ForceSeries, ax: Axes | None = None) -> Figure:
    """Draw one parameter over force with 95 % whiskers and its law; units as they are."""
    figure = surface(ax, 7.1, 4.9)
    factor, label = _unit("", series)
    _draw_with_law(figure.subplots(), series, factor, "force", label)
    return finished(figure)


def _draw_with_law(axes: Axes, series: ForceSeries, factor: float, over: str, label: str) -> None:
    set_up(axes, series.name, over, label)
    draw_over_levels(axes, series, factor, COLOURS[0] if ".k_" in series.name else COLOURS[1], "identified, 95 %")
    _legend(axes, series)


def draw_over_levels(
    axes: Axes, series: ForceSeries, factor: float, colour: str, label: str, *, marker: str = "o", law: bool = True
) -> None:
    """Draw a parameter over its levels with whiskers, and its law."""
    if law:
        fine = np.linspace(float(series.force[0]), float(series.force[-1]), 200)
        axes.plot(fine, factor * series.law.at(fine), color=colour, alpha=0.45, linewidth=1.4)
    axes.errorbar(
        series.force,
        factor * series.values,
        _NORMAL * factor * series.standard_errors,
        fmt=marker,
        color=colour,
        markersize=4,
        capsize=2.5,
        linewidth=1.0,
        label=label,
    )


def _unit(unit: str, series: ForceSeries) -> tuple[float, str]:
    """Return the factor by which values are multiplied, and the label of the axis."""
    power = 3 * math.floor(math.log10(float(np.max(np.abs(series.values)))) / 3.0)
    if -3 < power <= 3:
        return 1.0, unit
    return 10.0**-power, f"10{str(power).translate(_RAISED)} {unit}"


def _legend(axes: Axes, series: ForceSeries) -> None:
    low, high = series.exponent_interval
    law = _LAWS[series.law.name]
    text = f"{law}, n = {series.law.exponent:.2f} ({low:.2f} to {high:.2f})" if series.law.name == "power" else law
    bottom, top = axes.get_ylim()
    axes.set_ylim(bottom, top + 0.3 * (top - bottom))
    axes.legend(frameon=False, fontsize=9, loc="upper left", title=text, title_fontsize=9, alignment="left")
