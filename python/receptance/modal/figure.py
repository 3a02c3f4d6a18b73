"""Figures of modal estimates."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator, StrMethodFormatter
from numpy.typing import NDArray

from receptance.frf import form_factor
from receptance.frf.figure import PHASE_FROM
from receptance.modal.decay import RingDown
from receptance.modal.modal_fit import ModalFit
from receptance.report.colours import COLOURS, INK, PALE
from receptance.report.figure import add_legend, finished, phase_line, set_up, set_up_phase, surface, title_left
from receptance.units import FORMS, FRFKind, frf_unit

Curve = tuple[NDArray[np.float64], NDArray[np.complex128]]
"""Lines, and the fit on them in the form of the FRF."""
_LABEL_WIDTH = 0.04
"""Least distance of the labels of two modes, as a share of the band."""


def draw_modal_fit(fit: ModalFit, ax: Axes | None = None, *, response: int = 0, excitation: int = 0) -> Figure:
    """Draw measured and fitted values of one entry, its residuals, and the poles among their candidates."""
    figure = surface(ax, 11.0, 7.4)
    grid = figure.add_gridspec(2, 2, height_ratios=(1.6, 1.0), width_ratios=(1.45, 1.0))
    magnitude = figure.add_subplot(grid[0, 0])
    phase = figure.add_subplot(grid[1, 0], sharex=magnitude)
    poles = figure.add_subplot(grid[0, 1])
    plane = figure.add_subplot(grid[1, 1])
    curve = _curve(fit, response, excitation)
    _draw_magnitude(magnitude, fit, response, excitation, curve)
    _draw_phase(phase, fit, response, excitation, curve)
    _draw_poles(poles, fit)
    _draw_plane(plane, fit, response, excitation, curve)
    name = f"{fit.frf.label}: " if fit.frf.label else ""
    low, high = fit.frf.frequency_hz[[0, -1]]
    count = fit.frequency_hz.size
    title_left(figure, f"{name}{count} mode{'' if count == 1 else 's'} between {low:g} and {high:g} Hz")
    return finished(figure)


def _draw_magnitude(axes: Axes, fit: ModalFit, response: int, excitation: int, curve: Curve) -> None:
    frf = fit.frf
    unit = frf.units[response][excitation].replace("^2", "²")
    set_up(axes, "Measured and fitted", "", f"|{frf.form}| ({unit})")
    measured = frf.values[:, response, excitation]
    residuals = measured - fit.synthesised()[:, response, excitation]
    lines, fitted = curve
    axes.plot(frf.frequency_hz, np.abs(residuals), color=PALE, linewidth=0.8, label="residuals")
    axes.plot(frf.frequency_hz, np.abs(measured), ".", color=COLOURS[0], markersize=4, label="measured")
    axes.plot(lines, np.abs(fitted), color=COLOURS[1], linewidth=1.3, label="fitted")
    for number, frequency in enumerate(fit.frequency_hz):
        axes.axvline(frequency, color=PALE, linewidth=0.7, linestyle=":", label="modes" if number == 0 else None)
    axes.set_yscale("log")
    # The lower limit excludes residuals at the level of rounding.
    top, least = np.abs(measured).max(), np.abs(measured).min()
    low = max(min(least, float(np.quantile(np.abs(residuals), 0.05))), 1e-3 * least)
    axes.set_ylim(0.5 * low, 12.0 * top)
    add_legend(axes, ncols=4, loc="upper left")


def _draw_phase(axes: Axes, fit: ModalFit, response: int, excitation: int, curve: Curve) -> None:
    lines, fitted = curve
    lowest = PHASE_FROM[fit.frf.form]
    set_up_phase(axes, lowest, "frequency (Hz)")
    measured = phase_line(fit.frf.frequency_hz, fit.frf.values[:, response, excitation], lowest)
    axes.plot(*measured, ".", color=COLOURS[0], markersize=4)
    axes.plot(*phase_line(lines, fitted, lowest), color=COLOURS[1], linewidth=1.3)


def _draw_poles(axes: Axes, fit: ModalFit) -> None:
    set_up(axes, "Poles and candidates", "frequency (Hz)", "damping ratio (%)")
    candidates = np.concatenate(fit.stabilisation)
    damping = 100.0 * candidates.imag / np.abs(candidates)
    axes.plot(
        candidates.real[damping > 0.0], damping[damping > 0.0], ".", color="#C9C9C9", markersize=3, label="candidates"
    )
    values, interval = 100.0 * fit.damping_ratio, 100.0 * fit.damping_interval()
    errors = np.stack([values - interval[:, 0], interval[:, 1] - values])
    axes.errorbar(
        fit.frequency_hz, values, errors, fmt="o", color=COLOURS[1], markersize=6, capsize=4, label="modes, 95 %"
    )
    if np.all(values > 0.0):
        axes.set_yscale("log")
        axes.set_ylim(values.min() / 12.0, values.max() * 40.0)
    axes.set_xlim(fit.frf.frequency_hz[0], fit.frf.frequency_hz[-1])
    # Labels of neighbouring modes are above and below; a label that would overlap another one is left out.
    least = _LABEL_WIDTH * float(np.ptp(fit.frf.frequency_hz))
    last = [-np.inf, -np.inf]
    for number, (frequency, damping_percent) in enumerate(zip(fit.frequency_hz, values, strict=True)):
        below = number % 2
        if frequency - last[below] < least:
            continue
        last[below] = frequency
        axes.annotate(
            f"{frequency:.5g} Hz, {damping_percent:.3g} %",
            (frequency, damping_percent),
            xytext=(0.0, -8.0 if below else 8.0),
            textcoords="offset points",
            ha="center",
            va="top" if below else "bottom",
            rotation=90.0,
            fontsize=8.5,
            color=INK,
            bbox={"boxstyle": "round,pad=0.15", "fc": "white", "ec": "none", "alpha": 0.75},
        )
    add_legend(axes, loc="upper left", ncols=2)


def _draw_plane(axes: Axes, fit: ModalFit, response: int, excitation: int, curve: Curve) -> None:
    frf = fit.frf
    kind = FRFKind("mobility", frf.responses[response].direction, frf.excitations[excitation].direction)
    unit = frf_unit(kind)
    set_up(axes, "Mobility in the complex plane", f"real part ({unit})", f"imaginary part ({unit})")
    lines, fitted = curve
    for f, values, style in (
        (frf.frequency_hz, frf.values[:, response, excitation], {"marker": ".", "linestyle": "", "markersize": 4}),
        (lines, fitted, {"linewidth": 1.3}),
    ):
        w = 2j * np.pi * f
        s = w + frf.decay_rate
        mobility = values / s ** FORMS.index(frf.form) * w
        axes.plot(mobility.real, mobility.imag, color=COLOURS[1 if "linewidth" in style else 0], **style)
    axes.set_aspect("equal", adjustable="datalim")
    axes.ticklabel_format(style="sci", scilimits=(-2, 3))


def _curve(fit: ModalFit, response: int, excitation: int) -> Curve:
    """Return lines dense enough to draw every mode smoothly, and the fit on them in the form of the FRF."""
    f = fit.frf.frequency_hz
    apparent = (fit.frf.decay_rate - fit.poles.real) / (2.0 * np.pi)
    near = fit.poles.imag[:, None] / (2.0 * np.pi) + np.abs(apparent)[:, None] * np.tan(np.linspace(-1.5, 1.5, 121))
    lines = np.unique(np.concatenate([np.linspace(f[0], f[-1], 800), near.ravel()]))
    lines = lines[(lines >= f[0]) & (lines <= f[-1])]
    complex_lines = lines - 1j * fit.frf.decay_rate / (2.0 * np.pi)
    factor = form_factor(complex_lines, "receptance", fit.frf.form)
    return lines, fit.receptance(complex_lines)[:, response, excitation] * factor


def draw_ring_down(decay: RingDown, ax: Axes | None = None) -> Figure:
    """Draw natural frequency and damping against amplitude, with 95 % intervals."""
    figure = surface(ax, 10.0, 4.4)
    left, right = figure.subplots(1, 2)
    set_up(left, "Natural frequency", "amplitude (unit of the record)", "Hz")
    set_up(right, "Damping ratio", "amplitude (unit of the record)", "%")
    panels = (
        (left, decay.frequency_hz, decay.frequency_interval_hz(), 1.0),
        (right, decay.damping_ratio, decay.damping_interval(), 100.0),
    )
    # Labels of more ticks would overlap.
    decades = np.log10(decay.amplitude.max() / decay.amplitude.min())
    ticks = range(1, 10) if decades < 1.0 else (1, 2, 5) if decades < 2.5 else (1,)
    for axes, values, interval, scale in panels:
        errors = scale * np.stack([values - interval[:, 0], interval[:, 1] - values])
        axes.errorbar(decay.amplitude, scale * values, errors, fmt="o-", color=COLOURS[0], markersize=5, capsize=3)
        axes.set_xscale("log")
        axes.xaxis.set_major_locator(LogLocator(subs=ticks))
        axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axes.xaxis.set_minor_locator(NullLocator())
        axes.ticklabel_format(axis="y", useOffset=False)
    title_left(figure, f"Ring-down between {decay.band_hz[0]:g} and {decay.band_hz[1]:g} Hz")
    return finished(figure)
