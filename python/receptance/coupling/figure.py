"""Figures of inverse couplings, spindles line by line, numbers of modes, and parameters over force."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.ticker import FixedLocator, MaxNLocator, NullLocator
from numpy.typing import NDArray

from receptance.coupling.force_series import ForceSeries
from receptance.coupling.inverse import InverseCoupling, InverseCouplings
from receptance.coupling.line_equations import TERMS
from receptance.coupling.spindle_modes import SpindleModes
from receptance.coupling.spindle_receptance import SpindleReceptance
from receptance.coupling.stabilisation import DAMPING_CHANGE, FREQUENCY_CHANGE, Stabilisation, Stabilisations
from receptance.model.joints import PointJoint
from receptance.model.terminals import ENTRIES
from receptance.report import ACCEPTED, Rejection
from receptance.report.colours import BAD, BAND, COLOURS, INK, PALE
from receptance.report.figure import add_legend, finished, set_up, surface, title_left

_NORMAL_95 = 1.96
"""Half width of a 95 % interval in standard deviations."""
_FINE = 2000
"""Number of lines of a curve of modes."""
_SYMBOLS = {"k_y": "K_y", "k_theta": "K_\u03b8", "k_ytheta": "K_y\u03b8"}
_TITLES = ("y/F (m/N)", "θ/M (rad/(N m))", "y/M (m/(N m))")
_SUPERSCRIPTS = str.maketrans("-0123456789", "\u207b\u2070\u00b9\u00b2\u00b3\u2074\u2075\u2076\u2077\u2078\u2079")
_FLAT = 10.0
"""Criterion up to which its axis is linear."""
_LAWS = {"constant": "constant", "linear": "K0 + a F", "power": "K0 + a F^n"}


def draw_inverse_coupling(coupling: InverseCoupling | InverseCouplings, ax: Axes | None = None) -> Figure:
    """Draw real and imaginary part of each term, with 95 % intervals on usable lines, and the condition number.

    Other lines are pale. The orange curves are the constant joint k + i w c that fits all lines.
    """
    joints = coupling if isinstance(coupling, InverseCouplings) else {coupling.name or coupling.joint: coupling}
    heights = [2.6 * len(joint.terms) + 2.6 for joint in joints.values()]
    figure = surface(ax, 11.0, sum(heights))
    cells = np.ravel(figure.subfigures(len(heights), 1, squeeze=False, height_ratios=heights))
    for cell, (name, joint) in zip(cells, joints.items(), strict=True):
        _draw_joint(cell, name, joint)
    return finished(figure)


def _draw_joint(figure: SubFigure, name: str, coupling: InverseCoupling) -> None:
    title_left(
        figure,
        f"{name} line by line, from {', '.join(coupling.labels)}\n"
        f"blue, with 95 % intervals: usable lines, standard deviation below {100.0 * coupling.limit:g} %;  grey: other "
        "lines;  orange: k + i w c fitted to all lines",
        10.5,
    )
    rows = len(coupling.terms)
    grid = figure.add_gridspec(rows + 1, 2, height_ratios=[1.0] * rows + [0.8])
    lines = np.asarray(coupling.frequency_hz).real
    for row, term in enumerate(coupling.terms):
        value, noise, usable = coupling.term(term)
        model = coupling.model_deviation[:, *TERMS[term]]
        deviation = np.hypot(noise, model)
        joint = coupling.typical.get(term)
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
    _draw_condition(figure.add_subplot(grid[rows, :]), lines, coupling.condition)


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
        half = np.where(chosen, _NORMAL_95 * deviation, np.nan)
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


def _draw_condition(axes: Axes, lines: NDArray[np.float64], condition: NDArray[np.float64]) -> None:
    """Draw the condition number of a system of equations over the frequency lines."""
    set_up(axes, "Condition number: amplification of relative errors", "frequency (Hz)", "")
    axes.semilogy(lines, condition, color=COLOURS[0], linewidth=1.0)
    axes.axhline(1.0, color=PALE, linewidth=0.8)
    axes.set_xlim(lines[0], lines[-1])


def draw_spindle(
    spindle: SpindleReceptance,
    ax: Axes | None = None,
    *,
    modes: SpindleModes | None = None,
    rejection: Rejection = ACCEPTED,
) -> Figure:
    """Draw the three terms with bands, modes over them, and the condition number."""
    figure = surface(ax, 11.0, 8.5)
    text = (
        f"Spindle line by line: {', '.join(spindle.labels)}\nblue, with 95 % intervals: usable lines, standard "
        f"deviation below {100.0 * spindle.limit:g} %;  grey: others"
    )
    if modes is not None:
        text += f";  orange: {len(modes.part.modes)} modes and a residual"
    title_left(figure, text, 10.5)
    grid = figure.add_gridspec(2, 2)
    lines = np.asarray(spindle.frequency_hz).real
    for number, (i, j) in enumerate(ENTRIES):
        axes = figure.add_subplot(grid[divmod(number, 2)])
        size, deviation = np.abs(spindle.matrix[:, i, j]), spindle.standard_deviation[:, i, j]
        set_up(axes, _TITLES[number], "frequency (Hz)" if number == 2 else "", "")
        shown = np.where(spindle.usable, size, np.nan)
        axes.semilogy(lines, np.where(spindle.usable, np.nan, size), ".", color=PALE, markersize=2.5)
        low = np.maximum(shown - _NORMAL_95 * deviation, 0.05 * shown)
        axes.fill_between(lines, low, shown + _NORMAL_95 * deviation, color=COLOURS[0], alpha=0.25, linewidth=0)
        axes.semilogy(lines, shown, ".", color=COLOURS[0], markersize=2.5)
        if spindle.usable.any():
            axes.set_ylim(0.3 * np.nanmin(shown), 3.0 * np.nanmax(shown))
        if modes is not None:
            fine = np.linspace(lines[0], lines[-1], _FINE)
            axes.semilogy(fine, np.abs(modes.part.receptance(fine)[:, i, j]), color=COLOURS[1], linewidth=1.2)
        axes.set_xlim(lines[0], lines[-1])
    _draw_condition(figure.add_subplot(grid[1, 1]), lines, spindle.condition)
    return finished(figure, rejection)


def draw_stabilisation(stabilised: Stabilisation | Stabilisations, ax: Axes | None = None) -> Figure:
    """Draw the modes by their number over a measured FRF, and the criterion that chooses the number."""
    spindles = list(stabilised.values()) if isinstance(stabilised, Stabilisations) else [stabilised]
    heights = [2.2 + 0.24 * len(each.fits) for each in spindles]
    figure = surface(ax, 11.0, sum(heights) + 0.8)
    if stabilised.provenance.title:
        title_left(figure, stabilised.provenance.title)
    cells = np.ravel(figure.subfigures(len(spindles), 1, squeeze=False, height_ratios=heights))
    for cell, each in zip(cells, spindles, strict=True):
        left, right = cell.subplots(1, 2, sharey=True, width_ratios=[3.0, 1.2])
        _draw_modes_by_number(left, each)
        _draw_criterion(right, each)
    return finished(figure)


def _draw_modes_by_number(axes: Axes, stabilised: Stabilisation) -> None:
    """Draw a mark for each mode of each number of modes, over the magnitude of the FRF."""
    set_up(axes, f"Modes of {stabilised.name} by their number", "frequency (Hz)", "number of modes", grid="none")
    behind = axes.twinx()
    behind.semilogy(stabilised.lines_hz, stabilised.magnitude, color=PALE, linewidth=0.9, alpha=0.6)
    least, most = float(stabilised.magnitude.min()), float(stabilised.magnitude.max())
    behind.set_ylim(least / 2.0, most * (most / least) ** 0.2)  # below the legend
    behind.set_axis_off()
    axes.set_zorder(behind.get_zorder() + 1.0)
    axes.set_facecolor("none")
    numbers = range(1, len(stabilised.fits))
    rows = [(stabilised.fits[count].modes[:, 0], count, stabilised.stable(count)) for count in numbers]
    frequency = np.concatenate([row[0] for row in rows])
    height = np.concatenate([np.full(row[0].size, row[1]) for row in rows])
    stable = np.concatenate([row[2] for row in rows])
    axes.axhspan(stabilised.used - 0.4, stabilised.used + 0.4, color=BAND, alpha=0.6, linewidth=0)
    axes.plot(
        frequency[stable],
        height[stable],
        "o",
        color=COLOURS[0],
        markersize=5,
        label=f"stable: frequency within {100.0 * FREQUENCY_CHANGE:g} %, damping within {100.0 * DAMPING_CHANGE:g} %",
    )
    axes.plot(
        frequency[~stable], height[~stable], "o", color=COLOURS[0], mfc="white", markersize=5, label="other modes"
    )
    axes.plot([], [], color=PALE, linewidth=0.9, label=f"|{stabilised.measured}|" if stabilised.measured else "FRF")
    first, last = stabilised.lines_hz[[0, -1]]
    axes.set_xlim(min(first, frequency.min()), max(last, 1.02 * frequency.max()))
    axes.set_ylim(0.4, 0.5 + 1.1 * len(stabilised.fits))  # room for the legend
    axes.yaxis.set_major_locator(MaxNLocator(integer=True))
    if frequency.max() > last:
        axes.axvline(last, color=PALE, linewidth=0.8, linestyle=":")
    add_legend(axes, loc="upper left", ncols=3)


def _draw_criterion(axes: Axes, stabilised: Stabilisation) -> None:
    """Draw the criterion by the number of modes, and name chi-square beside it."""
    set_up(axes, "Criterion above the least", "beside the marks: chi-square per number", grid="x")
    numbers = np.arange(1, len(stabilised.fits))
    values = stabilised.criterion[1:]
    mark = ", chosen" if stabilised.stated is None else ", stated"
    axes.axhspan(stabilised.used - 0.4, stabilised.used + 0.4, color=BAND, alpha=0.6, linewidth=0)
    axes.plot(values, numbers, "o-", color=COLOURS[1], markersize=4.5, linewidth=1.0)
    axes.set_xscale("symlog", linthresh=_FLAT)
    axes.xaxis.set_major_locator(FixedLocator([0.0, 1e2, 1e4, 1e6, 1e8]))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_xlim(-0.4 * _FLAT, 60.0 * max(values.max(), _FLAT))
    for value, number, chi_square in zip(values, numbers, stabilised.chi_square[1:], strict=True):
        axes.annotate(
            f"{chi_square:.4g}{mark if number == stabilised.used else ''}",
            (value, number),
            xytext=(7, 0),
            textcoords="offset points",
            va="center",
            fontsize=8.5,
            color=INK,
        )


def draw_force_series(series: ForceSeries, ax: Axes | None = None) -> Figure:
    """Draw values with 95 % intervals, and the best law."""
    figure = surface(ax, 7.1, 4.9)
    draw_with_law(figure.subplots(), series, "force", "")
    return finished(figure)


def draw_with_law(axes: Axes, series: ForceSeries, over: str, unit: str) -> None:
    """Draw a parameter over its levels and its law into empty axes, with titles and a legend.

    `over` is the label of the axis of the levels, `unit` that of the values.
    """
    factor, label = _axis_unit(unit, series)
    set_up(axes, series.name, over, label)
    colour = COLOURS[0] if ".k_" in series.name else COLOURS[1]
    levels = np.linspace(float(series.force[0]), float(series.force[-1]), 200)
    axes.plot(levels, factor * series.law.at(levels), color=colour, alpha=0.45, linewidth=1.4)
    axes.errorbar(
        series.force,
        factor * series.values,
        _NORMAL_95 * factor * series.standard_errors,
        fmt="o",
        color=colour,
        markersize=4,
        capsize=2.5,
        linewidth=1.0,
        label="identified, 95 %",
    )
    low, high = series.exponent_interval
    law = _LAWS[series.law.name]
    if series.law.name == "power":
        law += f", n = {series.law.exponent:.2f} ({low:.2f} to {high:.2f})"
    bottom, top = axes.get_ylim()
    axes.set_ylim(bottom, top + 0.3 * (top - bottom))  # room for the legend
    add_legend(axes, loc="upper left", title=law, title_fontsize=9, alignment="left")


def _axis_unit(unit: str, series: ForceSeries) -> tuple[float, str]:
    """Return the factor of the values on the axis, and the unit with its power of ten."""
    power = 3 * math.floor(math.log10(float(np.max(np.abs(series.values)))) / 3.0)
    if -3 < power <= 3:
        return 1.0, unit
    return 10.0**-power, f"10{str(power).translate(_SUPERSCRIPTS)} {unit}"
