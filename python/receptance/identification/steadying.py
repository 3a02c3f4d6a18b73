"""Variances of the logarithm of an FRF whose errors are independent of those of the values that they weigh.

Noise of the response is additive: its variance a does not depend on the FRF, and that of the logarithm is a / |H|^2.
Divided by the measured |H|^2, it is smaller where noise has made the line larger: with e the relative error of a line,
weights go with 1 + 2 Re e, and the mean of weight times error is 2 instead of 0, on quiet and on noisy lines alike. A
fit of hundreds of lines is then off by up to half a standard error. So |H|^2 is taken from neighbouring lines, without
the line itself.

The part of the variance that is proportional to |H|^2 needs no division and stays as it is.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from receptance.frf.variance import additive_share, lines_around

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["steadied", "weakly_known"]

_HALF_WIDTHS = (3, 6, 12, 24)
"""Lines to each side of the local parabolas that are tried, in units of the lines that are correlated."""
_AGREES = 2.0
"""A parabola agrees where chi-square a degree of freedom is up to this many standard deviations above 1."""
_FAR = 9.0
"""Square of how many standard deviations the line itself may be off."""
_AT_ONCE = 4096


def steadied(
    frequency_hz: NDArray[np.float64],
    values: NDArray[np.complex128],
    log_variance: NDArray[np.float64],
    correlated_lines: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the variances of the logarithm with |H|^2 from neighbouring lines, `(n,)`.

    Lines whose neighbours do not tell it, beside sharp resonances where there is little noise, keep their own.

    Parameters
    ----------
    frequency_hz : ndarray
        `(n,)`.
    values : ndarray
        `(n,)` complex, none of them zero.
    log_variance : ndarray
        `(n,)` of each line alone, finite.
    correlated_lines : ndarray
        `(n,)` how many neighbouring lines share one independent value.
    """
    result = log_variance.copy()
    values = values / np.abs(values).max()
    power = np.maximum(np.abs(values) ** 2, np.finfo(np.float64).tiny)
    stride = np.maximum(np.rint(correlated_lines), 1.0).astype(np.intp)
    share = additive_share(values, log_variance, correlated_lines)
    for first in range(0, values.size, _AT_ONCE):
        own = np.arange(first, min(first + _AT_ONCE, values.size))
        # Variances of zero are for the caller to judge; here such lines agree with nothing.
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = power[own] / _smooth_power(own, frequency_hz, values, 2.0 * log_variance * power, stride[own])
        result[own] *= 1.0 + share[own] * (ratio - 1.0)
    return result


def weakly_known(degrees_of_freedom: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the factor on variances that are estimated with so many degrees of freedom, as weights of a fit.

    With weights 1 / v of estimated v the variance of a weighted mean is 1 + 4 / nu times what the weights say, to first
    order (Meier 1953); nu / (nu - 4) where all weights are independent. Below 8 degrees of freedom it is 2.
    """
    factor: NDArray[np.float64] = 1.0 / (1.0 - np.minimum(4.0 / degrees_of_freedom, 0.5))
    return factor


def _smooth_power(
    own: NDArray[np.intp],
    frequency_hz: NDArray[np.float64],
    values: NDArray[np.complex128],
    noise: NDArray[np.float64],
    stride: NDArray[np.intp],
) -> NDArray[np.float64]:
    """Return |H|^2 from the widest parabola through neighbours that agrees with the noise, else the measured one."""
    power = np.abs(values[own]) ** 2
    open_ = np.arange(own.size)
    for half in _HALF_WIDTHS:
        open_ = open_[2 * half * stride[open_] < values.size]
        if not open_.size:
            break
        at, step = own[open_], stride[open_]
        near = lines_around(at, half, step, values.size)
        others = np.abs(near - at[:, None]) >= step[:, None]
        x = frequency_hz[near] - frequency_hz[at, None]
        x /= np.abs(x).max(axis=1, keepdims=True)
        columns = np.stack([np.ones_like(x), x, x * x], axis=-1)
        inverse = np.linalg.inv(np.einsum("ki,kia,kib->kab", others, columns, columns))
        fitted = np.einsum("kab,kib,ki->ka", inverse, columns, others * values[near])
        left = np.abs(values[near] - np.einsum("kia,ka->ki", columns, fitted)) ** 2
        freedom = np.count_nonzero(others, axis=1) - 3.0
        chi_square = np.sum(others * left / noise[near], axis=1) / freedom
        off = np.abs(values[at] - fitted[:, 0]) ** 2 / (noise[at] * (1.0 + inverse[:, 0, 0]))
        agrees = (chi_square < 1.0 + _AGREES / np.sqrt(freedom)) & (off < _FAR)
        open_ = open_[agrees]
        power[open_] = np.abs(fitted[agrees, 0]) ** 2
    least: NDArray[np.float64] = np.maximum(power, np.finfo(np.float64).tiny)
    return least
