"""Variance of an FRF from coherence, pooled over neighbouring lines.

Of n averages, with g^2 the coherence, the real and the imaginary part of the logarithm of H1 have the variance
(1 - g^2) / (2 (n - 1) g^2) each (Bendat and Piersol 2010, sect. 9.1, with n - 1 for n: the slope itself takes one),
known with 2 (n - 1) degrees of freedom. Of few averages that is itself noisy, a factor of 1.6 either way for ten.
Neighbouring lines share what changes slowly with frequency: noise of the response and relative scatter, so the
variance of the values is a + b |H|^2 with a and b smooth, fitted over a window of lines around each one.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from receptance import _checks
from receptance.frf import arrays

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from receptance.frf.frf import FRF

__all__ = [
    "additive_share",
    "half_width_of",
    "lines_around",
    "pool_entries",
    "pool_variance",
    "variance_from_coherence",
    "with_variance",
]

_HALF_WIDTHS = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64)
_ENOUGH = 60.0
"""Degrees of freedom of the median line at which the window stops to grow: t is then within 2 % of the normal."""
_ROUNDS = 4
"""Of fitting with the weights of the last fit; nothing moves after three."""
_LEVEL = 1e-9
"""Relative spread of |H|^2 in a window below which it says nothing of b."""
_OWN = 1e-3
"""A line so unlikely under its neighbours (hum, say) keeps its own variance."""
_AROUND = 8
"""Lines to each side from which the additive part of the variance is found, in units of those that are correlated."""
_FLAT = 1e-9
"""Relative spread of |H|^2 below which the additive part cannot be told from the other."""
_AT_ONCE = 4096


def variance_from_coherence(coherence: ArrayLike, averages: int) -> tuple[NDArray[np.float64], float]:
    """Variance of the logarithm of an FRF from its coherence.

    Parameters
    ----------
    coherence : array_like
        From 0 to 1, of any shape.
    averages : int
        Number of independent averages, at least 2.

    Returns
    -------
    log_variance : ndarray
        Of the real and of the imaginary part, each; of the shape of `coherence`. Infinite where that is 0.
    degrees_of_freedom : float
        2 (n - 1).

    Raises
    ------
    TypeError, ValueError
        Coherence outside 0 to 1, or fewer than two averages: its coherence is 1 whatever was measured.

    Examples
    --------
    >>> from receptance.frf.variance import variance_from_coherence
    >>> variance, freedom = variance_from_coherence([0.9, 1.0], averages=10)
    >>> [round(number, 5) for number in variance.tolist()], freedom
    ([0.00617, 0.0], 18.0)
    """
    quality = _checks.numbers("variance_from_coherence", "coherence", coherence, "iuf", "real numbers").astype(float)
    wrong = ~((quality >= 0.0) & (quality <= 1.0))
    if wrong.any():
        raise ValueError(f"variance_from_coherence: coherence is {quality[wrong][0]:g}, expected from 0 to 1")
    n = arrays.count("variance_from_coherence", "averages", averages)
    if n is None or n < 2:
        raise ValueError(
            f"variance_from_coherence: averages is {n}, expected at least 2: the coherence of a single record is 1 "
            "whatever was measured"
        )
    with np.errstate(divide="ignore"):
        return (1.0 - quality) / (2.0 * (n - 1) * quality), 2.0 * (n - 1)


def with_variance(frf: FRF) -> FRF:
    """Return an FRF of one entry with the variance of its coherence, pooled; as it is where it has one, or cannot."""
    if frf.log_variance is not None or frf.coherence is None or frf.averages is None or frf.averages < 2:
        return frf
    variance, freedom = variance_from_coherence(frf.coherence[:, 0, 0], frf.averages)
    pooled, known = pool_variance(frf.values[:, 0, 0], variance, freedom, correlated_lines=frf.correlated_lines)
    return frf.with_(log_variance=pooled, degrees_of_freedom=known)


def pool_variance(
    values: NDArray[np.complex128],
    log_variance: NDArray[np.float64],
    degrees_of_freedom: ArrayLike,
    *,
    correlated_lines: ArrayLike = 1.0,
    half_width: int | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Pool the variance of one entry over neighbouring lines.

    Parameters
    ----------
    values : ndarray
        `(n,)` complex, in the form that was measured.
    log_variance : ndarray
        `(n,)` of each line alone; lines where it is infinite or the value is zero are left as they are.
    degrees_of_freedom : array_like
        Of each line alone, one number or `(n,)`.
    correlated_lines : array_like, optional
        How many neighbouring lines share one independent value, one number or `(n,)`.
    half_width : int, optional
        Lines to each side; by default as few as give 60 degrees of freedom on the median line, at most 64.

    Returns
    -------
    log_variance, degrees_of_freedom : ndarray
        `(n,)` each. The degrees follow from the fit's own variance (Satterthwaite 1946).

    Raises
    ------
    ValueError
        A half width below zero.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance.frf.variance import pool_variance
    >>> scatter = np.random.default_rng(1).chisquare(4.0, 400) / 4.0
    >>> pooled, freedom = pool_variance(np.ones(400, dtype=complex), 1e-4 * scatter, 4.0)
    >>> bool(pooled.std() < 0.4 * (1e-4 * scatter).std()), bool(freedom[200] > 60.0)
    (True, True)
    """
    owner = "pool_variance"
    values = _checks.unmasked(owner, "values", values)
    result = _checks.unmasked(owner, "log_variance", log_variance, np.float64).copy()
    freedoms = _checks.unmasked(owner, "degrees_of_freedom", degrees_of_freedom, np.float64)
    own = np.array(np.broadcast_to(freedoms, values.shape))
    known = np.isfinite(result) & np.isfinite(own) & (values != 0.0)
    shares = _checks.unmasked(owner, "correlated_lines", correlated_lines, np.float64)
    alike = np.broadcast_to(shares, values.shape)[known]
    gain = np.abs(values[known]) ** 2
    gain /= gain.max(initial=np.finfo(float).tiny)
    scatter = result[known] * gain
    if half_width is None:
        widths = [width for width in _HALF_WIDTHS if width <= (gain.size - 1) // 2]
    else:
        width = _checks.not_negative("pool_variance", "half_width", half_width)
        widths = [min(int(width), (gain.size - 1) // 2)]
    # All zero is what simulated data without noise have: nothing to fit.
    if not scatter.any() or not widths or widths[0] < 1:
        return result, own
    alone = own[known]
    for width in widths:
        with np.errstate(all="ignore"):
            fitted, freedom = _fit(scatter, gain, alone, alike, width)
            pooled = fitted / gain
        if float(np.median(freedom)) >= _ENOUGH:
            break
    # Values that span hundreds of decades leave nothing to fit: such lines keep their own.
    sound = np.isfinite(pooled) & np.isfinite(freedom)
    result[known] = np.where(sound, pooled, result[known])
    own[known] = np.where(sound, freedom, alone)
    return result, own


def _fit(
    scatter: NDArray[np.float64],
    gain: NDArray[np.float64],
    alone: NDArray[np.float64],
    alike: NDArray[np.float64],
    width: int,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return a + b |H|^2, both at least zero, on each line from those within `width`, and its degrees of freedom."""
    from scipy.special import gammaincc  # slow to import

    def total(terms: NDArray[np.float64]) -> NDArray[np.float64]:
        # Added up afresh for each window: a running sum would lose the small terms beside a resonance.
        return np.convolve(terms, np.ones(2 * width + 1), mode="same")

    lowest = 1e-12 * float(scatter.max())
    power = np.maximum(total(scatter) / total(np.ones_like(scatter)), lowest)
    for _ in range(_ROUNDS):
        weight = power**-2.0
        w, wg, wgg = total(weight), total(weight * gain), total(weight * gain**2)
        ws, wgs = total(weight * scatter), total(weight * gain * scatter)
        centre = wg / w
        spread = wgg - wg * centre
        level = spread <= _LEVEL * wgg
        spread = np.where(level, 1.0, spread)
        slope = np.where(level, 0.0, (wgs - centre * ws) / spread)
        flat = slope <= 0.0
        through_zero = ~flat & (ws / w <= slope * centre)
        # The fit is sum_k (alpha + beta g_k) w_k scatter_k.
        off = gain - centre
        alpha = np.where(flat, 1.0 / w, np.where(through_zero, 0.0, 1.0 / w - off * centre / spread))
        beta = np.where(flat, 0.0, np.where(through_zero, gain / wgg, off / spread))
        power = np.maximum(alpha * ws + beta * wgs, lowest)
    size = weight**2 * power**2 * alike * 2.0 / alone
    variance = alpha**2 * total(size) + 2.0 * alpha * beta * total(size * gain) + beta**2 * total(size * gain**2)
    # Correlated or steeply weighted neighbours cannot know less than the line alone.
    freedom = np.maximum(2.0 * power**2 / variance, alone)
    unlikely = gammaincc(alone / 2.0, alone / 2.0 * scatter / power) < _OWN
    return np.where(unlikely, scatter, power), np.where(unlikely, alone, freedom)


def additive_share(
    values: NDArray[np.complex128], log_variance: NDArray[np.float64], correlated_lines: ArrayLike = 1.0
) -> NDArray[np.float64]:
    """Share of a in the variance a + b |H|^2 of the values of one entry, from the lines around each one.

    Noise of the response is additive and gives a. Noise of the force, and scatter from hit to hit, is in proportion to
    the FRF and gives b.

    Parameters
    ----------
    values : ndarray
        `(n,)` complex, none of them zero.
    log_variance : ndarray
        `(n,)` finite.
    correlated_lines : array_like, optional
        How many neighbouring lines share one independent value, one number or `(n,)`.

    Returns
    -------
    ndarray
        `(n,)` from 0 to 1; 0 where |H| does not change with frequency.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance.frf.variance import additive_share
    >>> values = np.linspace(1.0, 3.0, 100).astype(complex)
    >>> share = additive_share(values, 1e-4 / np.abs(values) ** 2 + 1e-4)
    >>> bool(np.allclose(share, 1.0 / (1.0 + np.abs(values) ** 2), atol=1e-3))
    True
    """
    power = np.abs(values / np.abs(values).max()) ** 2
    power = np.maximum(power, np.finfo(np.float64).tiny)
    noise = log_variance * power
    stride = np.maximum(np.rint(np.broadcast_to(correlated_lines, power.shape)), 1.0).astype(np.intp)
    result = np.zeros(power.size)
    half = min(_AROUND, (power.size - 1) // (2 * int(stride.max())))
    if half < 1:
        return result
    for first in range(0, power.size, _AT_ONCE):
        own = np.arange(first, min(first + _AT_ONCE, power.size))
        near = lines_around(own, half, stride[own], power.size)
        # Variances of zero are for the caller to judge.
        with np.errstate(divide="ignore", invalid="ignore"):
            result[own] = _share(power[near], noise[near], near == own[:, None])
    return result


def _share(power: NDArray[np.float64], noise: NDArray[np.float64], own: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return the share of a in noise = a + b |H|^2, both at least zero; each row has the lines around one."""
    g = power / power.mean(axis=1, keepdims=True)
    y = noise / noise.mean(axis=1, keepdims=True)
    # Relative deviations count: both span decades beside a resonance.
    w = 1.0 / (0.5 * (y + 1.0)) ** 2
    total, first, second = (np.sum(w * g**k, axis=1) for k in range(3))
    spread = total * second - first**2
    flat = spread <= _FLAT * total * second
    slope = (total * np.sum(w * g * y, axis=1) - first * np.sum(w * y, axis=1)) / np.where(flat, 1.0, spread)
    slope = np.clip(slope, 0.0, np.sum(w * g * y, axis=1) / second)
    constant = np.maximum(np.sum(w * y, axis=1) - slope * first, 0.0) / total
    middle = np.sum(g * own, axis=1)
    middle = np.where(middle > 0.0, middle, 1.0)
    share: NDArray[np.float64] = constant / (constant + slope * middle)
    return np.where(flat | ~np.isfinite(share), 0.0, share)


def lines_around(own: NDArray[np.intp], half: int, stride: NDArray[np.intp], size: int) -> NDArray[np.intp]:
    """Return the lines around each one, `(n, 2 half + 1)`, in steps of a stride; within the record at its ends."""
    begin = np.clip(own - half * stride, 0, size - 1 - 2 * half * stride)
    return np.asarray(begin[:, None] + stride[:, None] * np.arange(2 * half + 1))


def pool_entries(
    frf: FRF, log_variance: NDArray[np.float64], degrees_of_freedom: NDArray[np.float64], half_width: int | None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return variance and degrees of freedom `(n, n_responses, n_excitations)`, pooled for each entry."""
    variance, freedom = log_variance.copy(), degrees_of_freedom.copy()
    for i, j in np.ndindex(frf.values.shape[1:]):
        variance[:, i, j], freedom[:, i, j] = pool_variance(
            frf.values[:, i, j],
            log_variance[:, i, j],
            degrees_of_freedom[:, i, j],
            correlated_lines=frf.correlated_lines,
            half_width=half_width,
        )
    return variance, freedom


def half_width_of(
    variance: NDArray[np.float64], degrees_of_freedom: NDArray[np.float64] | None, level: float
) -> NDArray[np.float64]:
    """Return half the width of the interval at a level: Student's t, or the normal distribution without degrees."""
    from scipy.special import ndtri, stdtrit  # slow to import

    share = _checks.positive("log_interval", "level", level)
    if share >= 1.0:
        raise ValueError(f"log_interval: level is {share:g}, expected less than 1")
    upper = 0.5 * (1.0 + share)
    factor = np.full(variance.shape, ndtri(upper))
    if degrees_of_freedom is not None:
        estimated = np.isfinite(degrees_of_freedom)
        factor[estimated] = stdtrit(degrees_of_freedom[estimated], upper)
    half: NDArray[np.float64] = np.sqrt(variance) * factor
    return half
