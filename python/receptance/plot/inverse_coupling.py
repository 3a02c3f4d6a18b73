"""A joint's stiffness line by line as a figure."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from receptance.plot._style import BAD, COLOURS, INK, PALE, keep_clear, new_figure, set_up

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from receptance.identification.inverse_coupling import InverseCoupling

__all__ = ["draw_inverse_coupling"]

_UNITS = {"k_y": "N/m", "k_theta": "N m/rad", "k_ytheta": "N/rad"}
_SYMBOLS = {"k_y": "K_y", "k_theta": "K_\u03b8", "k_ytheta": "K_y\u03b8"}
_REACH = 1.96


def draw_inverse_coupling(found: InverseCoupling, title: str = "") -> Figure:
    """Draw real and imaginary part of each term with 95 % intervals, where the data speak, and the condition number.

    Lines on which the data do not speak are pale. The lines across are the stiffness and the dashpot that suit all
    lines.

    Parameters
    ----------
    found : InverseCoupling
        From `invert_coupling`.
    title : str, optional
        Over the figure; by default what was measured.

    Returns
    -------
    matplotlib.figure.Figure
        It belongs to no window; save it with `savefig`.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance import STEEL, Assembly, MeasuredFRF, Part, PointJoint, Segment
    >>> from receptance.identification import invert_coupling
    >>> from receptance.plot.inverse_coupling import draw_inverse_coupling
    >>> bar = Segment(length=0.1, outer_diameter=0.02, material=STEEL)
    >>> pair = Assembly([Part([bar], name="tool"), PointJoint(k_y=1e8, k_theta=1e5), Part([bar], name="holder")])
    >>> lines = np.linspace(100.0, 4000.0, 40)
    >>> tip = MeasuredFRF(
    ...     assembly=pair, frequency_hz=lines, receptance=pair.receptance(lines), standard_deviation=0.01
    ... )
    >>> len(draw_inverse_coupling(invert_coupling(tip)).axes)
    3
    """
    rows = len(found.terms)
    height = 2.6 * rows + 2.6
    figure = new_figure(11.0, height)
    keep_clear(figure, 1.0 - 0.75 / height)
    text = title or f"Stiffness of {found.joint} line by line, from {', '.join(found.labels)}"
    figure.text(0.01, 1.0 - 0.25 / height, text, va="center", fontsize=13, color=INK)
    said = (
        f"blue, with 95 % intervals: lines that speak, standard deviation below {100.0 * found.limit:g} %;  grey: the "
        "others;  orange: the k + i w c that suits all"
    )
    figure.text(0.01, 1.0 - 0.55 / height, said, va="center", fontsize=9.5, color=INK)
    grid = figure.add_gridspec(rows + 1, 2, height_ratios=[1.0] * rows + [0.8])
    lines = np.asarray(found.frequency_hz).real
    for row, name in enumerate(found.terms):
        value, noise, usable = found.term(name)
        model = found.model_deviation[:, *((0, 0) if name == "k_y" else (1, 1) if name == "k_theta" else (0, 1))]
        deviation = np.hypot(noise, model)
        typical = found.typical.get(name)
        for column, part in enumerate((value.real, value.imag)):
            axes = figure.add_subplot(grid[row, column])
            symbol = f"{'Re' if column == 0 else 'Im'} {_SYMBOLS[name]}"
            set_up(axes, f"{symbol} [{_UNITS[name]}]", "", "")
            across = None
            if typical is not None:
                across = np.full(lines.size, typical[0]) if column == 0 else 2.0 * np.pi * lines * typical[1]
            _draw_part(axes, lines, part, deviation, usable, across)
            axes.set_xlim(lines[0], lines[-1])
    axes = figure.add_subplot(grid[rows, :])
    set_up(axes, "Condition number: by how much a relative error grows", "frequency [Hz]", "")
    axes.semilogy(lines, found.condition, color=COLOURS[0], linewidth=1.0)
    axes.axhline(1.0, color=PALE, linewidth=0.8)
    axes.set_xlim(lines[0], lines[-1])
    for below in figure.axes[-3:-1]:
        below.set_xlabel("frequency [Hz]", color=INK)
    return figure


def _draw_part(
    axes: Axes,
    lines: NDArray[np.float64],
    part: NDArray[np.float64],
    deviation: NDArray[np.float64],
    usable: NDArray[np.bool_],
    across: NDArray[np.float64] | None,
) -> None:
    """Draw one part of a term over what is of interest of its axis: silent lines are anywhere."""
    shown = np.isfinite(part)
    chosen = usable & shown
    axes.set_ylim(*_limits(part[chosen], part[shown], across))
    axes.plot(lines[shown & ~chosen], part[shown & ~chosen], ".", color=PALE, markersize=2.5, alpha=0.5)
    if chosen.any():
        reach = np.where(chosen, _REACH * deviation, np.nan)
        axes.fill_between(lines, part - reach, part + reach, color=COLOURS[0], alpha=0.2, linewidth=0)
        axes.plot(lines[chosen], part[chosen], ".", color=COLOURS[0], markersize=2.5)
    else:
        axes.text(0.5, 0.5, "no line speaks", transform=axes.transAxes, ha="center", color=BAD)
    if across is not None:
        axes.plot(lines, across, color=COLOURS[1], linewidth=1.4)


def _limits(
    usable: NDArray[np.float64], shown: NDArray[np.float64], across: NDArray[np.float64] | None
) -> tuple[float, float]:
    """Return limits that hold most of what is usable and the line across, zero included."""
    values = usable if usable.size else shown
    ends = [0.0, *(np.quantile(values, [0.03, 0.97]) if values.size else [])]
    ends += [] if across is None else [across.min(), across.max()]
    low, high = float(min(ends)), float(max(ends))
    room = 0.35 * (high - low) or 1.0
    return low - room, high + room
