"""Figures of inverse couplings."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from receptance.coupling.line_equations import TERMS
from receptance.model.joints import PointJoint
from receptance.report.figure import (
    BAD,
    COLOURS,
    NORMAL_95,
    PALE,
    draw_condition,
    finished,
    set_up,
    surface,
    title_left,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure
    from numpy.typing import NDArray

    from receptance.coupling.inverse import InverseCoupling, InverseCouplings

_SYMBOLS = {"k_y": "K_y", "k_theta": "K_\u03b8", "k_ytheta": "K_y\u03b8"}


def draw_inverse_coupling(found: InverseCouplings, ax: Axes | None = None) -> Figure:
    """Draw real and imaginary part of each term, with 95 % intervals on usable lines, and the condition number.

    Other lines are pale. The orange curves are the constant joint k + i w c that fits all lines.
    """
    heights = [2.6 * len(one.terms) + 2.6 for one in found.values()]
    figure = surface(ax, 11.0, sum(heights))
    cells = np.ravel(figure.subfigures(len(heights), 1, squeeze=False, height_ratios=heights))
    for cell, (name, one) in zip(cells, found.items(), strict=True):
        _draw_joint(cell, name, one)
    return finished(figure)


def _draw_joint(figure: SubFigure, name: str, found: InverseCoupling) -> None:
    title_left(
        figure,
        f"{name} line by line, from {', '.join(found.labels)}\n"
        f"blue, with 95 % intervals: usable lines, standard deviation below {100.0 * found.limit:g} %;  grey: other "
        "lines;  orange: k + i w c fitted to all lines",
        10.5,
    )
    rows = len(found.terms)
    grid = figure.add_gridspec(rows + 1, 2, height_ratios=[1.0] * rows + [0.8])
    lines = np.asarray(found.frequency_hz).real
    for row, term in enumerate(found.terms):
        value, noise, usable = found.term(term)
        model = found.model_deviation[:, *TERMS[term]]
        deviation = np.hypot(noise, model)
        joint = found.typical.get(term)
        for column, part in enumerate((value.real, value.imag)):
            axes = figure.add_subplot(grid[row, column])
            symbol = f"{'Re' if column == 0 else 'Im'} {_SYMBOLS[term]}"
            set_up(
                axes, f"{symbol} ({PointJoint.quantities[term].unit})", "frequency (Hz)" if row == rows - 1 else "", ""
            )
            constant = None
            if joint is not None:
                constant = np.full(lines.size, joint[0]) if column == 0 else 2.0 * np.pi * lines * joint[1]
            _draw_part(axes, lines, part, deviation, usable, constant)
            axes.set_xlim(lines[0], lines[-1])
    draw_condition(figure.add_subplot(grid[rows, :]), lines, found.condition)


def _draw_part(
    axes: Axes,
    lines: NDArray[np.float64],
    part: NDArray[np.float64],
    deviation: NDArray[np.float64],
    usable: NDArray[np.bool_],
    constant: NDArray[np.float64] | None,
) -> None:
    """Draw one part of a term; the axis is limited to the usable lines."""
    shown = np.isfinite(part)
    chosen = usable & shown
    axes.set_ylim(*_limits(part[chosen], part[shown], constant))
    axes.plot(lines[shown & ~chosen], part[shown & ~chosen], ".", color=PALE, markersize=2.5, alpha=0.5)
    if chosen.any():
        half = np.where(chosen, NORMAL_95 * deviation, np.nan)
        axes.fill_between(lines, part - half, part + half, color=COLOURS[0], alpha=0.2, linewidth=0)
        axes.plot(lines[chosen], part[chosen], ".", color=COLOURS[0], markersize=2.5)
    else:
        axes.text(0.5, 0.5, "no line is usable", transform=axes.transAxes, ha="center", color=BAD)
    if constant is not None:
        axes.plot(lines, constant, color=COLOURS[1], linewidth=1.4)


def _limits(
    usable: NDArray[np.float64], shown: NDArray[np.float64], constant: NDArray[np.float64] | None
) -> tuple[float, float]:
    """Return limits that include most usable values, the constant joint and zero."""
    values = usable if usable.size else shown
    ends = [0.0, *(np.quantile(values, [0.03, 0.97]) if values.size else [])]
    ends += [] if constant is None else [constant.min(), constant.max()]
    low, high = float(min(ends)), float(max(ends))
    room = 0.35 * (high - low) or 1.0
    return low - room, high + room
