"""Natural frequency and damping from the half-power points of a peak."""

from __future__ import annotations

import functools
import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from receptance.errors import ReceptanceWarning
from receptance.modal._lines import select_lines_of_single_entry
from receptance.modal._local import highest_line, polar_errors, relative_scatter
from receptance.modal.estimate import ModeEstimate

if TYPE_CHECKING:
    from receptance.frf import FRF

_MIN_LINES = 5.0
"""Least number of lines in the half-power band without a warning of bias."""


def half_power(frf: FRF, *, low_hz: float | None = None, high_hz: float | None = None) -> ModeEstimate:
    """Estimate natural frequency and damping from the half-power points of the highest peak in a band.

    On the magnitude of the mobility (w times the receptance), whose half-power points w_1 and w_2 satisfy
    w_2 - w_1 = 2 zeta w_r and w_1 w_2 = w_r^2 exactly for one viscously damped mode. The peak is the highest line, and
    the points are interpolated linearly between lines, as is customary. With few lines the peak is truncated and the
    width is overestimated. This is not corrected; below five lines a warning states the mean bias, and `circle_fit` or
    `fit_modes` should be used instead.

    Parameters
    ----------
    frf : FRF
        One response and one excitation.
    low_hz, high_hz : float, optional
        The band; its highest peak is the mode.

    Returns
    -------
    ModeEstimate
        The standard errors contain the scatter of the lines (stated by the variance of the FRF, else from the residuals
        of one mode fitted around the peak) and that of the position of the peak between two lines. They contain neither
        the bias nor the influence of neighbouring modes.

    Warns
    -----
    ReceptanceWarning
        Fewer than five lines in the half-power band.

    Raises
    ------
    TypeError, ValueError
        Several responses or excitations, fewer than three lines, no peak inside the band, or no half-power point
        to one side of it.

    References
    ----------
    Ewins, Modal Testing, 2nd ed. 2000, ch. 4 (peak amplitude method).

    Examples
    --------
    >>> import numpy as np
    >>> from receptance import FRF
    >>> from receptance.modal import half_power
    >>> f = np.arange(600.0, 1000.0, 1.0)
    >>> s = 2j * np.pi * f
    >>> frf = FRF(frequency_hz=f, values=1.0 / (s**2 + 2 * 0.01 * 5000.0 * s + 5000.0**2))
    >>> mode = half_power(frf)
    >>> f"{mode.frequency_hz:.1f} Hz, {100 * mode.damping_ratio:.2f} %, {mode.lines_in_band:.0f} lines"
    '795.8 Hz, 1.00 %, 16 lines'
    """
    owner = "half_power"
    lines, mobility = select_lines_of_single_entry(owner, frf, low_hz, high_hz, 3)
    peak = highest_line(owner, lines, np.abs(mobility))
    points = _points(owner, lines.frequency_hz, np.abs(mobility), peak)
    width, spacing = points.high - points.low, lines.spacing_at(peak)
    resolution = _resolution(round(float(np.clip(width / spacing, 0.5, 50.0)), 1))
    scatter, freedom, notes = relative_scatter(lines, peak, width)

    # The centre, the log of the width and that of the modal constant by the log of every line.
    slopes = np.stack([0.5 * (points.slopes[0] + points.slopes[1]), (points.slopes[1] - points.slopes[0]) / width])
    slopes = np.vstack([slopes, slopes[1]])
    slopes[2, peak] += 1.0
    # Lines with infinite scatter matter only if they are used.
    reach = np.multiply(np.abs(slopes), scatter, out=np.zeros_like(slopes), where=slopes != 0.0)
    # Of correlated lines only the two at each end contribute, so that the variance is at most doubled.
    centre_error, width_error, constant_error = np.sqrt(min(lines.correlated_lines, 2.0) * np.sum(reach**2, axis=1))

    decay = np.pi * width - frf.decay_rate
    # w_1 w_2 is w_r^2 of the mode with the window's damping; its damped frequency is not changed by the window.
    damped_squared = (2.0 * np.pi) ** 2 * points.low * points.high - (np.pi * width) ** 2
    natural = float(np.sqrt(damped_squared + decay**2))
    # Rotation on the circle from the highest line to the resonance.
    turn = np.arctan2(lines.frequency_hz[peak] - np.sqrt(points.low * points.high), 0.5 * width)
    constant = complex(2.0 * np.pi * width * mobility[peak] * np.exp(1j * turn))
    phase_error = float(np.hypot(scatter[peak], 2.0 * centre_error / width))
    messages = [*lines.notes, *notes]
    if width / spacing < _MIN_LINES:
        messages.append(_bias_warning(width / spacing, natural, resolution.bias, frf.decay_rate > 0.0))
        warnings.warn(f"{owner}: {messages[-1]}", ReceptanceWarning, stacklevel=2)
    if decay <= 0.0:
        messages.append("the peak is no wider than the exponential window makes it: the damping is not determined")
    return ModeEstimate(
        method="half-power",
        frequency_hz=natural / (2.0 * np.pi),
        frequency_standard_error_hz=float(np.hypot(centre_error, resolution.centre_error * spacing)),
        damping_ratio=decay / natural,
        damping_standard_error=float(np.hypot(width_error, resolution.width_error) * np.pi * width / natural),
        modal_constant=constant,
        modal_constant_standard_error=polar_errors(
            constant,
            float(np.hypot(constant_error, resolution.constant_error)),
            float(np.hypot(phase_error, resolution.phase_error)),
        ),
        lines_in_band=width / spacing,
        band_hz=(float(lines.frequency_hz[points.first]), float(lines.frequency_hz[points.last])),
        lines=points.last - points.first + 1,
        degrees_of_freedom=freedom,
        notes=tuple(messages),
    )


def _bias_warning(lines: float, natural: float, bias: float, window: bool) -> str:
    return (
        f"only {lines:.1f} lines in the half-power band of the mode at {natural / (2.0 * np.pi):.6g} Hz: its width "
        f"{'(including that of the exponential window) ' if window else ''}is overestimated by "
        f"{100.0 * bias:.2g} % on average; use circle_fit or fit_modes"
    )


@dataclass(frozen=True)
class _Points:
    """Half-power frequencies, their `(2, n)` derivatives by the log of every line, and the outermost lines used."""

    low: float
    high: float
    slopes: NDArray[np.float64]
    first: int
    last: int


def _points(owner: str, f: NDArray[np.float64], size: NDArray[np.float64], peak: int) -> _Points:
    level = size[peak] / np.sqrt(2.0)
    points, outermost, slopes = [], [], np.zeros((2, f.size))
    for side, step in enumerate((-1, 1)):
        outer = peak
        while size[outer] > level:
            outer += step
            if not 0 <= outer < size.size:
                raise ValueError(
                    f"{owner}: the mobility does not fall to its half-power point "
                    f"{'below' if step < 0 else 'above'} the peak at {f[peak]:g} Hz before the band ends at "
                    f"{f[outer - step]:g} Hz; widen the band, or use fit_modes if there is another mode beside the peak"
                )
        inner = outer - step
        gap, rise = f[inner] - f[outer], size[inner] - size[outer]
        share = (level - size[outer]) / rise
        points.append(float(f[outer] + share * gap))
        slopes[side, peak] += level / rise * gap
        slopes[side, inner] -= size[inner] * share / rise * gap
        slopes[side, outer] -= size[outer] * (1.0 - share) / rise * gap
        outermost.append(outer)
    return _Points(points[0], points[1], slopes, outermost[0], outermost[1])


@dataclass(frozen=True)
class _Resolution:
    """Errors of the half-power method for one mode from the position of the lines, averaged over all positions.

    Mean relative error of the width, and standard deviations of the width (relative), of the centre (in distances of
    the lines), of the log of the modal constant, and of its phase.
    """

    bias: float
    width_error: float
    centre_error: float
    constant_error: float
    phase_error: float


_SHIFTS = tuple((np.arange(40) + 0.5) / 40.0)
_NEARBY = (0.85, 0.9, 0.95, 1.0, 1.05)
"""Ratios of the true to the apparent number of lines over which the errors are averaged."""


@functools.lru_cache(maxsize=256)
def _resolution(lines_in_band: float) -> _Resolution:
    # (factors, shifts, quantities)
    table = np.array([[_estimates_at(lines_in_band * factor, shift) for shift in _SHIFTS] for factor in _NEARBY])
    deviations = np.sqrt(np.mean(table.var(axis=1), axis=0)).tolist()
    return _Resolution(float(table[:, :, 0].mean()) - 1.0, *deviations)


def _estimates_at(lines_in_band: float, shift: float) -> tuple[float, float, float, float]:
    """Return relative width, centre, log of the modal constant and its phase for one position of the lines."""
    reach = int(2.0 * lines_in_band) + 6
    x = np.arange(-reach, reach + 1).astype(np.float64) + shift
    values = 1.0 / (1.0 + 2j * x / lines_in_band)
    size = np.abs(values)
    peak = int(np.argmax(size))
    points = _points("", x, size, peak)
    width, centre = points.high - points.low, 0.5 * (points.low + points.high)
    phase = float(np.angle(values[peak]) + np.arctan2(x[peak] - centre, 0.5 * width))
    return width / lines_in_band, centre, float(np.log(width / lines_in_band * size[peak])), phase
