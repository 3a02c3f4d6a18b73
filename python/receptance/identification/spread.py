"""How well data determine the fitted variables: covariance, correlation, quantiles."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from receptance import _checks

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["SAYS_NOTHING", "covariance_of", "quantile", "says_nothing", "variance_factor"]

SAYS_NOTHING = "says nothing"
"""What is printed in the place of an interval that says nothing."""
_WIDE = 0.5
"""Half of an interval of a frequency as a share of the frequency, from which on it says nothing: modes lie nearer."""


def says_nothing(frequency_hz: ArrayLike, half_hz: ArrayLike) -> NDArray[np.bool_]:
    """Return whether intervals of frequencies, from half widths in Hz, are too wide to say anything."""
    half = np.asarray(half_hz, dtype=np.float64)
    return ~(half < _WIDE * np.abs(np.asarray(frequency_hz, dtype=np.float64)))


def quantile(level: float, degrees_of_freedom: int | None) -> float:
    """Return how many standard errors a two-sided interval reaches; normal if the degrees of freedom are None."""
    from scipy.special import ndtri, stdtrit  # the light part of scipy.stats

    level = _checks.number("interval", "level", level)
    if not 0.0 < level < 1.0:
        raise ValueError(f"interval: level is {level:g}, expected between 0 and 1")
    if degrees_of_freedom is None:
        return float(ndtri(0.5 + 0.5 * level))
    return float(stdtrit(max(degrees_of_freedom, 1), 0.5 + 0.5 * level))


def variance_factor(residual: NDArray[np.float64], unknowns: int, smoothing: float | None) -> float:
    """Return what the inverse of J^T J is to be multiplied by where the scatter is estimated from the residuals.

    For a sum of squares the residual variance. For a sum of soft absolute values that of an M-estimator,
    E[psi^2] / E[psi']^2 (Huber 1981, sect. 7.6), where psi(r) = r / sqrt(1 + (r/C)^2) and C is the smoothing. When C is
    well below the scatter psi' is a spike that few residuals meet, so its mean is taken over a width of
    a robust standard deviation times n^(-1/5), which keeps the spike's area.
    """
    n = residual.size
    if n <= unknowns:
        return float("inf")
    if smoothing is None:
        return float(np.sum(np.square(residual))) / (n - unknowns)
    robust = float(np.median(np.abs(residual))) / 0.6745
    width = float(np.hypot(smoothing, robust * n**-0.2))
    psi = residual / np.sqrt(1.0 + (residual / smoothing) ** 2)
    slope = smoothing / width * float(np.mean((1.0 + (residual / width) ** 2) ** -1.5))
    return float(np.sum(np.square(psi))) / (n - unknowns) / slope**2


def covariance_of(jacobian: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the inverse of J^T J, infinite for variables the data do not determine, and the correlations.

    Two variables of which the data determine only a combination have a correlation of 1 or -1.
    """
    count = jacobian.shape[1]
    norms = np.linalg.norm(jacobian, axis=0)
    scale = np.where(norms > 0.0, norms, 1.0)
    # Only the triangle matters, and it has p rows however many lines there are.
    triangle = np.linalg.qr(jacobian / scale, mode="r")
    padded = np.zeros((count, count))
    padded[: len(triangle)] = triangle
    _, singular, rows = np.linalg.svd(padded)
    least = singular[0] * max(jacobian.shape) * np.finfo(np.float64).eps
    null = rows[singular <= least]
    if singular[0] == 0.0:
        return np.full((count, count), np.inf), np.eye(count)
    factor = rows.T / np.maximum(singular, least)
    covariance = factor @ factor.T
    deviation = np.sqrt(np.diag(covariance))
    correlation = np.clip(covariance / np.outer(deviation, deviation), -1.0, 1.0)
    np.fill_diagonal(correlation, 1.0)
    covariance = covariance / np.outer(scale, scale)
    # A direction that nothing moves in takes every variable with it that has a share in it.
    lost = np.any(np.abs(null) > 1e-6, axis=0)
    covariance[lost, :] = covariance[:, lost] = np.inf
    return covariance, correlation
