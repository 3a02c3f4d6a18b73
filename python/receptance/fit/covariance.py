"""Covariance of the fitted variables, its square root for draws, and multipliers of confidence intervals."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from receptance.frf.variance import interval_factor

NORMAL_QUARTILE = 0.6745
"""Median of the absolute value of a standard normal variable."""
UNINFORMATIVE = "uninformative"
"""Printed instead of an interval that is too wide."""
_WIDE = 0.5
"""Relative half width from which on the interval of a frequency is uninformative: it contains neighbouring modes."""


def is_uninformative(frequency_hz: ArrayLike, half_hz: ArrayLike) -> NDArray[np.bool_]:
    """Return whether intervals of frequencies are too wide to be informative, from half widths in Hz."""
    half = np.asarray(half_hz, dtype=np.float64)
    return ~(half < _WIDE * np.abs(np.asarray(frequency_hz, dtype=np.float64)))


def confidence_multiplier(level: float, degrees_of_freedom: float | None) -> float:
    """Return `interval_factor` of one number of degrees of freedom, at least 1; None for the normal distribution."""
    return float(interval_factor(level, None if degrees_of_freedom is None else max(degrees_of_freedom, 1)))


def variance_factor(residual: NDArray[np.float64], unknowns: int, smoothing: float | None) -> float:
    """Return the factor of the inverse of J^T J if the scatter is estimated from the residuals.

    For a sum of squares it is the residual variance. For a sum of smoothed absolute values it is that of an
    M-estimator, E[psi^2] / E[psi']^2 (Huber 1981, sect. 7.6), with psi(r) = r / sqrt(1 + (r/C)^2) and the smoothing C.
    If C is well below the scatter, psi' is a narrow peak that contains few residuals. Its mean is then estimated with
    a bandwidth of a robust standard deviation times n^(-1/5), which preserves the area of the peak.
    """
    n = residual.size
    if n <= unknowns:
        return float("inf")
    if smoothing is None:
        return float(np.sum(np.square(residual))) / (n - unknowns)
    robust = float(np.median(np.abs(residual))) / NORMAL_QUARTILE
    width = float(np.hypot(smoothing, robust * n**-0.2))
    psi = residual / np.sqrt(1.0 + (residual / smoothing) ** 2)
    slope = smoothing / width * float(np.mean((1.0 + (residual / width) ** 2) ** -1.5))
    return float(np.sum(np.square(psi))) / (n - unknowns) / slope**2


def covariance_of(jacobian: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the inverse of J^T J and the correlations.

    Rows and columns of variables that the data do not determine are infinite. Two variables of which the data determine
    only a combination have a correlation of 1 or -1.
    """
    count = jacobian.shape[1]
    norms = np.linalg.norm(jacobian, axis=0)
    scale = np.where(norms > 0.0, norms, 1.0)
    # R has the same singular values and at most p rows.
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
    # Every variable with a component in the null space is undetermined.
    undetermined = np.any(np.abs(null) > 1e-6, axis=0)
    covariance[undetermined, :] = covariance[:, undetermined] = np.inf
    return covariance, correlation


def square_root(covariance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a matrix R with R R^T equal to a positive semidefinite covariance.

    R = D S, where D is diagonal with the standard deviations and S is the symmetric root of the correlations. S is
    unique, so draws do not depend on the signs of the eigenvectors, which differ between processors.

    Examples
    --------
    >>> import numpy as np
    >>> square_root(np.diag([4.0, 0.0, 1.0]))
    array([[2., 0., 0.],
           [0., 0., 0.],
           [0., 0., 1.]])
    """
    deviation = np.sqrt(np.diag(covariance))
    scale = np.where(deviation > 0.0, deviation, 1.0)
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    root: NDArray[np.float64] = scale[:, None] * ((vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T)
    return root
