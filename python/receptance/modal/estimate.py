"""Estimate of one mode, and the conversion of poles and residues to modal parameters."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from receptance.frf.variance import interval_factor
from receptance.modal._least_squares import PoleFit

Method = Literal["peak", "half-power", "circle", "global"]


def _intervals(
    values: ArrayLike, standard_errors: ArrayLike, level: float, degrees_of_freedom: ArrayLike
) -> NDArray[np.float64]:
    """Return the confidence intervals `(..., 2)` of values."""
    half_widths = interval_factor(level, degrees_of_freedom) * np.asarray(standard_errors)
    return np.stack([np.subtract(values, half_widths), np.add(values, half_widths)], axis=-1)


class ModeIntervals:
    """Confidence intervals from values, standard errors and degrees of freedom; of arrays `(k,)` they are `(k, 2)`."""

    frequency_hz: float | NDArray[np.float64]
    frequency_standard_error_hz: float | NDArray[np.float64]
    damping_ratio: float | NDArray[np.float64]
    damping_standard_error: float | NDArray[np.float64]
    degrees_of_freedom: float | NDArray[np.float64]

    def frequency_interval_hz(self, level: float = 0.95) -> NDArray[np.float64]:
        """Return lower and upper end of the confidence interval of the natural frequency."""
        return _intervals(self.frequency_hz, self.frequency_standard_error_hz, level, self.degrees_of_freedom)

    def damping_interval(self, level: float = 0.95) -> NDArray[np.float64]:
        """Return lower and upper end of the confidence interval of the damping ratio."""
        return _intervals(self.damping_ratio, self.damping_standard_error, level, self.degrees_of_freedom)


@dataclass(frozen=True, kw_only=True)
class ModeEstimate(ModeIntervals):
    """Estimate of one mode, H = C / (w_r^2 - w^2 + 2 i zeta_r w_r w) near it.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance import FRF
    >>> from receptance.modal import half_power
    >>> w = 2j * np.pi * np.linspace(700.0, 900.0, 401)
    >>> frf = FRF(frequency_hz=w.imag / (2 * np.pi), values=1.0 / (w**2 + 2 * 0.01 * 5000.0 * w + 5000.0**2))
    >>> mode = half_power(frf)
    >>> f"{mode.frequency_hz:.1f} Hz, {100 * mode.damping_ratio:.2f} %, {mode.lines_in_band:.0f} lines"
    '795.8 Hz, 1.00 %, 32 lines'
    """

    method: Method
    """Method of the estimate."""
    frequency_hz: float
    """Undamped natural frequency w_r / 2 pi."""
    frequency_standard_error_hz: float
    damping_ratio: float
    """Viscous damping ratio zeta_r without that of an exponential window; NaN if the lines do not determine it."""
    damping_standard_error: float
    modal_constant: complex
    """C of the receptance, in 1/kg for m/N; real for proportional damping. With the method "peak" its phase is that of
    the line at the peak."""
    modal_constant_standard_error: complex
    """Standard errors of the real part and of the imaginary part, as a complex number."""
    lines_in_band: float
    """Width of the half-power band over the distance of the lines (an exponential window widens the band). Below five
    the half-power method overestimates the damping."""
    band_hz: tuple[float, float]
    """First and last line used."""
    lines: int
    """Number of lines used."""
    degrees_of_freedom: float
    """Degrees of freedom of the standard errors: those of the variance of the FRF, infinite if it is exact, or those of
    the residuals."""
    notes: tuple[str, ...] = ()

    @property
    def pole(self) -> complex:
        """-zeta w_r + i w_r sqrt(1 - zeta^2) in rad/s."""
        w = 2.0 * np.pi * self.frequency_hz
        return complex(-self.damping_ratio * w, w * np.sqrt(1.0 - self.damping_ratio**2))

    def __repr__(self) -> str:
        return (
            f"ModeEstimate({self.method}: {self.frequency_hz:.6g} +- {self.frequency_standard_error_hz:.1g} Hz, "
            f"damping {100.0 * self.damping_ratio:.4g} +- {100.0 * self.damping_standard_error:.1g} %, "
            f"{self.lines_in_band:.1f} lines in the half-power band)"
        )


def modal_values(
    poles: NDArray[np.complex128], covariance: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return natural frequencies in Hz, damping ratios, and their joint covariance, frequencies first.

    The covariance `(2M, 2M)` of the `(M,)` poles in rad/s is that of the real, then the imaginary parts.
    """
    size = np.abs(poles)
    frequency, damping = size / (2.0 * np.pi), -poles.real / size
    slope = np.block(
        [
            [np.diag(poles.real / size / (2.0 * np.pi)), np.diag(poles.imag / size / (2.0 * np.pi))],
            [np.diag(-(poles.imag**2) / size**3), np.diag(poles.real * poles.imag / size**3)],
        ]
    )
    if not np.all(np.isfinite(covariance)):
        return frequency, damping, np.full(covariance.shape, np.inf)
    return frequency, damping, slope @ covariance @ slope.T


def scaled(covariance: NDArray[np.float64], factor: float) -> NDArray[np.float64]:
    """Return the covariance times a factor; infinite if any element is not finite."""
    if np.isfinite(factor) and np.all(np.isfinite(covariance)):
        return covariance * factor
    return np.full(covariance.shape, np.inf)


def joint_with_residue(fit: PoleFit, mode: int, entry: int) -> NDArray[np.float64]:
    """Return the `(3, 3)` covariance of the real and imaginary part of a residue and the damped frequency."""
    count = fit.poles.size
    parts = [mode, count + mode]
    joint = np.empty((3, 3))
    joint[:2, :2] = fit.coefficient_covariance[entry][np.ix_(parts, parts)]
    joint[:2, 2] = joint[2, :2] = fit.cross_covariance[entry][parts, count + mode]
    joint[2, 2] = fit.pole_covariance[count + mode, count + mode]
    return joint


def constants(pole: complex, residue: complex, covariance: NDArray[np.float64]) -> tuple[complex, complex]:
    """Return the modal constant C = 2 i w_d A and the standard errors of its real and imaginary part.

    The covariance `(3, 3)` is that of the real part of the residue A, its imaginary part and w_d.
    """
    w = pole.imag
    value = 2j * w * residue
    slope = np.array([[0.0, -2.0 * w, -2.0 * residue.imag], [2.0 * w, 0.0, 2.0 * residue.real]])
    if not np.all(np.isfinite(covariance)):
        return value, complex(np.inf, np.inf)
    deviation = np.sqrt(np.maximum(np.diag(slope @ covariance @ slope.T), 0.0))
    return value, complex(deviation[0], deviation[1])
