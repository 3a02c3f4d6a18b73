"""Figures of modal estimates: a global fit, and a ring-down."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from receptance.frf.presentation import PHASE_FROM
from receptance.report.figure import (
    COLOURS,
    PALE,
    add_legend,
    finished,
    label_point,
    phase_line,
    set_up,
    surface,
    title_left,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from receptance.modal import ModalFit, RingDown

__all__ = ["draw_modal_fit", "draw_ring_down"]

_NAMED = 8
"""Most modes labelled in the figure."""


def draw_modal_fit(fit: ModalFit, *, response: int = 0, excitation: int = 0, ax: Axes | None = None) -> Figure:
    """Draw measured and fitted values of one entry, its residuals, and the poles among their candidates.

    Parameters
    ----------
    fit : ModalFit
        The fit.
    response, excitation : int, optional
        The entry.
    ax : Axes, optional
        As in `Result.plot`.
    """
    figure = surface(ax, 11.0, 7.4)
    grid = figure.add_gridspec(2, 2, height_ratios=(1.6, 1.0), width_ratios=(1.45, 1.0))
    magnitude = figure.add_subplot(grid[0, 0])
    phase = figure.add_subplot(grid[1, 0], sharex=magnitude)
    poles = figure.add_subplot(grid[0, 1])
    plane = figure.add_subplot(grid[1, 1])
    _draw_magnitude(magnitude, fit, response, excitation)
    _draw_phase(phase, fit, response, excitation)
    _draw_poles(poles, fit)
    _draw_plane(plane, fit, response, excitation)
    name = f"{fit.frf.label}: " if fit.frf.label else ""
    low, high = fit.frf.frequency_hz[[0, -1]]
    count = fit.frequency_hz.size
    title_left(figure, f"{name}{count} mode{'' if count == 1 else 's'} between {low:g} and {high:g} Hz")
    return finished(figure)


def draw_ring_down(decay: RingDown, ax: Axes | None = None) -> Figure:
    """Draw natural frequency and damping of a mode against its amplitude, with 95 % intervals."""
    figure = surface(ax, 10.0, 4.4)
    left, right = figure.subplots(1, 2)
    set_up(left, "Natural frequency", "amplitude (unit of the record)", "Hz")
    set_up(right, "Damping ratio", "amplitude (unit of the record)", "%")
    panels = (
        (left, decay.frequency_hz, decay.frequency_interval_hz(), 1.0),
        (right, decay.damping_ratio, decay.damping_interval(), 100.0),
    )
    for axes, values, interval, scale in panels:
        reach = scale * np.stack([values - interval[:, 0], interval[:, 1] - values])
        axes.errorbar(decay.amplitude, scale * values, reach, fmt="o-", color=COLOURS[0], markersize=5, capsize=3)
        axes.set_xscale("log")
        axes.ticklabel_format(axis="y", useOffset=False)
    return finished(figure)


def _draw_magnitude(axes: Axes, fit: ModalFit, response: int, excitation: int) -> None:
    frf = fit.frf
    unit = frf.units[response][excitation].replace("^2", "²")
    set_up(axes, "Measured and fitted", "", f"|{frf.form}| ({unit})")
    measured = frf.values[:, response, excitation]
    residuals = measured - fit.synthesised()[:, response, excitation]
    lines, fitted = _curve(fit, response, excitation)
    axes.plot(frf.frequency_hz, np.abs(residuals), color=PALE, linewidth=0.8, label="residuals")
    axes.plot(frf.frequency_hz, np.abs(measured), ".", color=COLOURS[0], markersize=4, label="measured")
    axes.plot(lines, np.abs(fitted), color=COLOURS[1], linewidth=1.3, label="fitted")
    for number, place in enumerate(fit.frequency_hz):
        axes.axvline(place, color=PALE, linewidth=0.7, linestyle=":", label="modes" if number == 0 else None)
    axes.set_yscale("log")
    # The lower limit excludes residuals at the level of rounding.
    top, least = np.abs(measured).max(), np.abs(measured).min()
    low = max(min(least, float(np.quantile(np.abs(residuals), 0.05))), 1e-3 * least)
    axes.set_ylim(0.5 * low, 12.0 * top)
    add_legend(axes, ncols=4, loc="upper left")


def _draw_phase(axes: Axes, fit: ModalFit, response: int, excitation: int) -> None:
    set_up(axes, "", "frequency (Hz)", "phase (°)")
    lines, fitted = _curve(fit, response, excitation)
    lowest = PHASE_FROM[fit.frf.form]
    measured = phase_line(fit.frf.frequency_hz, fit.frf.values[:, response, excitation], lowest)
    axes.plot(*measured, ".", color=COLOURS[0], markersize=4)
    axes.plot(*phase_line(lines, fitted, lowest), color=COLOURS[1], linewidth=1.3)
    axes.set_yticks([-180, -90, 0, 90, 180])
    axes.set_ylim(lowest - 5.0, lowest + 365.0)


def _draw_poles(axes: Axes, fit: ModalFit) -> None:
    set_up(axes, "Poles and candidates", "frequency (Hz)", "damping ratio (%)")
    candidates = np.concatenate(fit.stabilisation)
    damping = 100.0 * candidates.imag / np.abs(candidates)
    axes.plot(
        candidates.real[damping > 0.0], damping[damping > 0.0], ".", color="#C9C9C9", markersize=3, label="candidates"
    )
    values, interval = 100.0 * fit.damping_ratio, 100.0 * fit.damping_interval()
    reach = np.stack([values - interval[:, 0], interval[:, 1] - values])
    axes.errorbar(
        fit.frequency_hz, values, reach, fmt="o", color=COLOURS[1], markersize=6, capsize=4, label="modes, 95 %"
    )
    if np.all(values > 0.0):
        axes.set_yscale("log")
        axes.set_ylim(values.min() / 12.0, values.max() * 40.0)
    axes.set_xlim(fit.frf.frequency_hz[0], fit.frf.frequency_hz[-1])
    for number in range(min(fit.frequency_hz.size, _NAMED)):
        # Labels of neighbouring modes are on opposite sides.
        even = number % 2 == 0
        text = f"{fit.frequency_hz[number]:.5g} Hz\n{values[number]:.3g} %"
        point = float(fit.frequency_hz[number]), float(values[number])
        label_point(axes, text, point, left=even, offset=(8.0, 8.0 if even else -26.0))
    add_legend(axes, loc="upper left", ncols=2)


def _draw_plane(axes: Axes, fit: ModalFit, response: int, excitation: int) -> None:
    set_up(axes, "Mobility in the plane", "real part", "imaginary part")
    frf = fit.frf
    lines, fitted = _curve(fit, response, excitation)
    for f, values, style in (
        (frf.frequency_hz, frf.values[:, response, excitation], {"marker": ".", "linestyle": "", "markersize": 4}),
        (lines, fitted, {"linewidth": 1.3}),
    ):
        w = 2j * np.pi * f
        s = w + frf.decay_rate
        power = {"receptance": 0, "mobility": 1, "accelerance": 2}[frf.form]
        moved = values / s**power * w
        axes.plot(moved.real, moved.imag, color=COLOURS[1 if "linewidth" in style else 0], **style)
    axes.set_aspect("equal", adjustable="datalim")
    axes.ticklabel_format(style="sci", scilimits=(-2, 3))


def _curve(fit: ModalFit, response: int, excitation: int) -> tuple[NDArray[np.float64], NDArray[np.complex128]]:
    """Return lines dense enough to draw every mode smoothly, and the fit on them in the form of the FRF."""
    from receptance.frf import form_factor

    f = fit.frf.frequency_hz
    apparent = (fit.frf.decay_rate - fit.poles.real) / (2.0 * np.pi)
    near = fit.poles.imag[:, None] / (2.0 * np.pi) + np.abs(apparent)[:, None] * np.tan(np.linspace(-1.5, 1.5, 121))
    lines = np.unique(np.concatenate([np.linspace(f[0], f[-1], 800), near.ravel()]))
    lines = lines[(lines >= f[0]) & (lines <= f[-1])]
    places = lines - 1j * fit.frf.decay_rate / (2.0 * np.pi)
    values = fit.receptance(places)[:, response, excitation] * form_factor(places, "receptance", fit.frf.form)
    return lines, values
