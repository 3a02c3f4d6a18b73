"""Figures of a parameter over levels, with intervals and the best law."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from receptance.report.figure import COLOURS, NORMAL_95, add_legend, add_room, finished, set_up, surface

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from receptance.taper import ForceSeries

_SUPERSCRIPTS = str.maketrans("-0123456789", "\u207b\u2070\u00b9\u00b2\u00b3\u2074\u2075\u2076\u2077\u2078\u2079")
_LAWS = {"constant": "constant", "linear": "K0 + a F", "power": "K0 + a F^n"}


def draw_force_series(series: ForceSeries, ax: Axes | None = None) -> Figure:
    """Draw a parameter over force with 95 % error bars and its law, in the units of the series."""
    figure = surface(ax, 7.1, 4.9)
    draw_with_law(figure.subplots(), series, "force", "")
    return finished(figure)


def draw_with_law(axes: Axes, series: ForceSeries, over: str, unit: str) -> None:
    """Draw a parameter over its levels and its law into empty axes, with titles and a legend.

    `over` is the label of the axis of the levels, `unit` that of the values.
    """
    factor, label = _axis_unit(unit, series)
    set_up(axes, series.name, over, label)
    draw_over_levels(axes, series, factor, COLOURS[0] if ".k_" in series.name else COLOURS[1], "identified, 95 %")
    low, high = series.exponent_interval
    law = _LAWS[series.law.name]
    if series.law.name == "power":
        law += f", n = {series.law.exponent:.2f} ({low:.2f} to {high:.2f})"
    add_room(axes, 0.3)
    add_legend(axes, loc="upper left", title=law, title_fontsize=9, alignment="left")


def draw_over_levels(
    axes: Axes, series: ForceSeries, factor: float, colour: str, label: str, *, marker: str = "o", law: bool = True
) -> None:
    """Draw a parameter over its levels with error bars, and its law."""
    if law:
        force = np.linspace(float(series.force[0]), float(series.force[-1]), 200)
        axes.plot(force, factor * series.law.at(force), color=colour, alpha=0.45, linewidth=1.4)
    axes.errorbar(
        series.force,
        factor * series.values,
        NORMAL_95 * factor * series.standard_errors,
        fmt=marker,
        color=colour,
        markersize=4,
        capsize=2.5,
        linewidth=1.0,
        label=label,
    )


def _axis_unit(unit: str, series: ForceSeries) -> tuple[float, str]:
    """Return the factor of the values on the axis, and the unit with its power of ten."""
    power = 3 * math.floor(math.log10(float(np.max(np.abs(series.values)))) / 3.0)
    if -3 < power <= 3:
        return 1.0, unit
    return 10.0**-power, f"10{str(power).translate(_SUPERSCRIPTS)} {unit}"
