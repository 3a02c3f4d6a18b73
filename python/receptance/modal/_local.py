"""One mode near the highest line of a band, for the peak, half-power and circle methods."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from receptance.modal._least_squares import PoleFit, PoleModel, PoleProblem
from receptance.modal._lines import Lines, mobility

BACKGROUND = (-1,)
"""Background of one mode: a constant mobility, which represents the other modes."""
_MIN_SHARE = 0.3
"""Least mobility of the lines of a mode relative to its peak: three half-power half-widths to each side."""
_LEAST = 7


def highest_line(owner: str, lines: Lines, size: NDArray[np.float64]) -> int:
    """Return the index of the highest line, or raise if it is the first or last of the band."""
    peak = int(np.argmax(size))
    if peak in (0, size.size - 1):
        f = lines.frequency_hz
        raise ValueError(
            f"{owner}: the highest mobility between {f[0]:g} and {f[-1]:g} Hz is at {f[peak]:g} Hz, the "
            f"{'first' if peak == 0 else 'last'} line of the band; expected a peak inside it: change low_hz or high_hz"
        )
    return peak


def lines_around_peak(size: NDArray[np.float64], peak: int, share: float = _MIN_SHARE, least: int = _LEAST) -> slice:
    """Return the lines around a peak above a share of its height, at least `least` if the band has as many."""
    first = last = peak
    while first > 0 and size[first - 1] >= share * size[peak]:
        first -= 1
    while last < size.size - 1 and size[last + 1] >= share * size[peak]:
        last += 1
    while last - first + 1 < min(least, size.size):
        down, up = first > 0, last < size.size - 1
        # The nearer end is extended first, which keeps the peak in the middle.
        if down and (not up or peak - first <= last - peak):
            first -= 1
        else:
            last += 1
    return slice(first, last + 1)


@dataclass(frozen=True)
class SingleMode:
    """One mode and a constant mobility fitted to some lines.

    Attributes
    ----------
    fit : PoleFit
        Fit with weights from the stated standard deviations, or equal weights.
    factor : float
        Factor of its covariances: the residual variance if no variance is stated, else 1.
    degrees_of_freedom : float
        Degrees of freedom of that factor.
    """

    fit: PoleFit
    factor: float
    degrees_of_freedom: float


def single_mode(lines: Lines, part: slice, start: complex) -> SingleMode:
    """Fit one mode and a constant mobility to the only entry, from a first pole."""
    values = lines.values[part]
    weights = np.ones(values.shape)
    if lines.relative is not None:
        weights = 1.0 / (lines.relative[part] * np.maximum(np.abs(values), np.finfo(np.float64).tiny))
    else:
        weights /= float(np.max(np.abs(values)))
    model = PoleModel(lines.s[part], lines.power, BACKGROUND)
    fit = PoleProblem(model, values, weights, lines.correlated_lines).fit(np.array([start]))
    if lines.relative is not None:
        return SingleMode(fit, 1.0, lines.freedom)
    freedom = fit.degrees_of_freedom
    if freedom < 0.5:
        return SingleMode(fit, float("inf"), 1.0)
    return SingleMode(fit, fit.chi_square / freedom, max(freedom / lines.correlated_lines, 1.0))


def relative_scatter(lines: Lines, peak: int, width_hz: float) -> tuple[NDArray[np.float64], float, tuple[str, ...]]:
    """Return the standard deviation of the log of every line of the only entry, its degrees of freedom, and notes.

    It is that stated by the FRF, or follows from the residuals of one mode fitted around the peak, with equal noise on
    all lines in the measured form.
    """
    if lines.relative is not None:
        return lines.relative[:, 0], lines.freedom, ()
    size = np.abs(lines.values[:, 0])
    part = lines_around_peak(np.abs(mobility(lines)), peak)
    decay = np.pi * width_hz - lines.frf.decay_rate
    single = single_mode(lines, part, complex(-decay, 2.0 * np.pi * lines.frequency_hz[peak]))
    if not np.isfinite(single.factor):
        note = f"{part.stop - part.start} lines around the peak are too few to estimate their scatter"
        return np.full(size.shape, np.inf), 1.0, (note,)
    deviation = np.sqrt(single.factor) * float(np.max(size[part]))
    floor = np.finfo(np.float64).tiny
    return deviation / np.maximum(size, floor), single.degrees_of_freedom, ()


def polar_errors(value: complex, log_error: float, phase_error: float) -> complex:
    """Return the standard errors of real and imaginary part from those of ln|value| and of the phase in rad."""
    if not (np.isfinite(log_error) and np.isfinite(phase_error)):
        return complex(np.inf, np.inf)
    return complex(
        np.hypot(value.real * log_error, value.imag * phase_error),
        np.hypot(value.imag * log_error, value.real * phase_error),
    )
