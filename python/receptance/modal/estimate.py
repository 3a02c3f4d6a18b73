"""What an estimate of one mode from one FRF consists of."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from receptance import _checks

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.modal._least_squares import PoleFit

__all__ = ["ModeEstimate"]

Method = Literal["peak", "half-power", "circle", "global"]


@dataclass(frozen=True, kw_only=True)
class ModeEstimate:
    """One mode as one method sees it, H = C / (w_r^2 - w^2 + 2 i zeta_r w_r w) near it.

    Attributes
    ----------
    method : {"peak", "half-power", "circle", "global"}
        How it was estimated.
    frequency_hz, frequency_standard_error_hz : float
        Undamped natural frequency w_r / 2 pi and its standard error.
    damping_ratio, damping_standard_error : float
        Viscous damping ratio zeta_r, that of an exponential window taken off; NaN where the lines do not determine it.
    modal_constant : complex
        C of the receptance, in 1/kg for m/N; real for a mode whose damping does not couple it to others. From
        magnitudes alone ("peak") the phase is that of the line at the peak.
    modal_constant_standard_error : complex
        Its real part is the standard error of the real part, its imaginary part that of the imaginary part.
    lines_in_band : float
        Width of the half-power band over the distance of the lines, both as measured (an exponential window widens
        the band). Under five a half-power damping is too large.
    band_hz : (float, float)
        First and last line that was used.
    lines : int
        How many lines were used.
    degrees_of_freedom : float
        Of the standard errors: those of the FRF's variance where it has one, infinite if that is exact, else those of
        the residuals.
    notes : tuple of str
        What a person should know.

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
    frequency_hz: float
    frequency_standard_error_hz: float
    damping_ratio: float
    damping_standard_error: float
    modal_constant: complex
    modal_constant_standard_error: complex
    lines_in_band: float
    band_hz: tuple[float, float]
    lines: int
    degrees_of_freedom: float
    notes: tuple[str, ...] = ()

    @property
    def pole(self) -> complex:
        """-zeta w_r + i w_r sqrt(1 - zeta^2) in rad/s."""
        w = 2.0 * np.pi * self.frequency_hz
        return complex(-self.damping_ratio * w, w * np.sqrt(1.0 - self.damping_ratio**2))

    def frequency_interval_hz(self, level: float = 0.95) -> tuple[float, float]:
        """Interval that holds the natural frequency with this probability, if the errors are as estimated."""
        reach = quantile(level, self.degrees_of_freedom) * self.frequency_standard_error_hz
        return self.frequency_hz - reach, self.frequency_hz + reach

    def damping_interval(self, level: float = 0.95) -> tuple[float, float]:
        """Interval that holds the damping ratio with this probability, if the errors are as estimated."""
        reach = quantile(level, self.degrees_of_freedom) * self.damping_standard_error
        return self.damping_ratio - reach, self.damping_ratio + reach

    def __repr__(self) -> str:
        return (
            f"ModeEstimate({self.method}: {self.frequency_hz:.6g} +- {self.frequency_standard_error_hz:.1g} Hz, "
            f"damping {100.0 * self.damping_ratio:.4g} +- {100.0 * self.damping_standard_error:.1g} %, "
            f"{self.lines_in_band:.1f} lines in the half-power band)"
        )


def quantile(level: float, degrees_of_freedom: float) -> float:
    """Return how many standard errors a two-sided interval reaches."""
    from scipy.special import ndtri, stdtrit

    level = _checks.number("interval", "level", level)
    if not 0.0 < level < 1.0:
        raise ValueError(f"interval: level is {level:g}, expected between 0 and 1")
    if not np.isfinite(degrees_of_freedom):
        return float(ndtri(0.5 + 0.5 * level))
    return float(stdtrit(max(degrees_of_freedom, 1.0), 0.5 + 0.5 * level))


def modal_values(
    poles: NDArray[np.complex128], covariance: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Natural frequencies in Hz, damping ratios, and their joint covariance, frequencies first.

    Parameters
    ----------
    poles : ndarray
        `(M,)` complex, rad/s.
    covariance : ndarray
        `(2M, 2M)` of the real, then the imaginary parts.
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
    """Return the covariance times a factor; infinite as a whole where something in it is not determined."""
    if np.isfinite(factor) and np.all(np.isfinite(covariance)):
        return covariance * factor
    return np.full(covariance.shape, np.inf)


def joint_with_residue(fit: PoleFit, mode: int, entry: int) -> NDArray[np.float64]:
    """`(3, 3)` covariance of the real part of a residue, its imaginary part and the mode's damped frequency."""
    count = fit.poles.size
    own = [mode, count + mode]
    joint = np.empty((3, 3))
    joint[:2, :2] = fit.of_coefficients[entry][np.ix_(own, own)]
    joint[:2, 2] = joint[2, :2] = fit.with_poles[entry][own, count + mode]
    joint[2, 2] = fit.of_poles[count + mode, count + mode]
    return joint


def constants(pole: complex, residue: complex, of_residue: NDArray[np.float64]) -> tuple[complex, complex]:
    """Modal constant C = 2 i w_d A and its standard errors, real and imaginary part.

    Parameters
    ----------
    pole, residue : complex
        The mode's pole and its residue A.
    of_residue : ndarray
        `(3, 3)` covariance of the real part of A, its imaginary part and w_d.
    """
    w = pole.imag
    value = 2j * w * residue
    slope = np.array([[0.0, -2.0 * w, -2.0 * residue.imag], [2.0 * w, 0.0, 2.0 * residue.real]])
    if not np.all(np.isfinite(of_residue)):
        return value, complex(np.inf, np.inf)
    spread = np.sqrt(np.maximum(np.diag(slope @ of_residue @ slope.T), 0.0))
    return value, complex(spread[0], spread[1])
