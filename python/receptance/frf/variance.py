"""Variance of an FRF from its coherence, pooled over neighbouring lines, and intervals from variances.

For n averages with the coherence g^2, the real part and the imaginary part of the logarithm of H1 each have the
variance (1 - g^2) / (2 (n - 1) g^2) (Bendat and Piersol 2010, sect. 9.1, with n - 1 for n because the slope is
estimated as well), with 2 (n - 1) degrees of freedom. For ten averages it is uncertain by a factor of 1.6. Noise of the
response and relative scatter change slowly with frequency, so the variance of the values is modelled as a + b |H|^2 and
fitted over a window of lines around each line.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import special

from receptance import _checks
from receptance.frf.data import FRFData
from receptance.frf.fields import average_count

_HALF_WIDTHS = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64)
_TARGET_FREEDOM = 60.0
"""Degrees of freedom of the median line at which the window stops growing; t is then within 2 % of the normal."""
_REWEIGHTINGS = 4
"""Fits with the weights of the previous fit; the result does not change after three."""
_MIN_VARIATION = 1e-9
"""Relative variation of |H|^2 in a window below which a and b cannot be separated."""
_MIN_PROBABILITY = 1e-3
"""A line that is less probable than this given its neighbours (hum, for example) keeps its variance."""
_SHARE_HALF_WIDTH = 8
"""Independent lines to each side from which the additive share of the variance is estimated."""
LINES_AT_ONCE = 4096
"""Lines processed at once, to limit memory."""
_FULL_DIGITS = 0.1
"""Least coherence from which its decimals are counted."""
_MOST_DECIMALS = 6
"""Most decimals by which a rounded column is recognised; single precision has seven."""
_SINGLE_PRECISION = 4e-8
"""Largest error of a number up to 1 in single precision."""
_NOTED_INCOHERENCE = 1e-4
"""Least 1 - coherence that is noted: below it, the deviation of ten averages is less than 0.3 %."""


def resolution(numbers: NDArray[np.float64]) -> float:
    """Return half a unit of the last digit of numbers of zero or more, which a zero among them may stand for.

    The unit is the largest power of ten, from 0.1 to 1e-6, of which all numbers are multiples, else the smallest
    positive number; 0 if all are zero.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance.frf.variance import resolution
    >>> resolution(np.array([0.0, 0.02, 0.0, 0.11])), resolution(np.array([0.0, 3e-7, 1.23456789e-3]))
    (0.005, 1.5e-07)
    """
    positive = numbers[(numbers > 0.0) & np.isfinite(numbers)]
    if not positive.size:
        return 0.0
    for decimals in range(1, _MOST_DECIMALS + 1):
        half = 0.5 * 10.0**-decimals
        if positive.min() > half and np.all(np.abs(positive - positive.round(decimals)) <= _SINGLE_PRECISION):
            return half
    return 0.5 * float(positive.min())


def _incoherence(coherence: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return 1 - coherence, at least half a unit of the last digit of the coherence.

    Small coherences are left out of the digits, because a format of three digits gives them more decimals.
    """
    unexplained = 1.0 - coherence
    return np.where(unexplained == 0.0, resolution(unexplained[coherence >= _FULL_DIGITS]), unexplained)


def saturation_note(coherence: NDArray[np.float64]) -> str:
    """Return a note on lines where a coherence is exactly 1 because of its few digits, or an empty text."""
    count = np.count_nonzero(coherence == 1.0)
    least = float(_incoherence(coherence).min(initial=1.0))
    if not count or least < _NOTED_INCOHERENCE:
        return ""
    return (
        f"the coherence is exactly 1 on {count} of {coherence.size} lines, because it has few digits: 1 - coherence is "
        f"taken as {least:g} there, half a unit of the last digit; export it with more digits for smaller deviations"
    )


def variance_from_coherence(coherence: ArrayLike, averages: int) -> tuple[NDArray[np.float64], float]:
    """Return the variance of the logarithm of an FRF from its coherence, and its degrees of freedom, 2 (n - 1).

    It is that of the real part and of the imaginary part, of the shape of `coherence`; infinite where the coherence is
    0. A coherence is no better than its last digit: where it is 1, 1 - coherence is half a unit of the last digit of
    all values, unless all are 1.

    Examples
    --------
    >>> from receptance.frf.variance import variance_from_coherence
    >>> variance, freedom = variance_from_coherence([0.95, 1.0], averages=10)
    >>> [round(number, 5) for number in variance.tolist()], freedom
    ([0.00292, 0.00028], 18.0)
    """
    quality = _checks.numbers("variance_from_coherence", "coherence", coherence, "iuf", "real numbers").astype(float)
    wrong = ~((quality >= 0.0) & (quality <= 1.0))
    if wrong.any():
        raise ValueError(f"variance_from_coherence: coherence is {quality[wrong][0]:g}, expected from 0 to 1")
    n = average_count("variance_from_coherence", averages)
    if n < 2:
        raise ValueError(
            f"variance_from_coherence: averages is {n}, expected at least 2: the coherence of one record is always 1"
        )
    unexplained = _incoherence(quality)
    with np.errstate(divide="ignore"):
        return unexplained / (2.0 * (n - 1) * (1.0 - unexplained)), 2.0 * (n - 1)


def unused_coherence(frf: FRFData) -> str:
    """Return a note on a coherence that gives no variance, or an empty text."""
    if frf.log_variance is not None or frf.coherence is None:
        return ""
    if frf.averages is None:
        return (
            "the coherence is not used, because the number of averaged records is unknown: give it, `averages = 10` "
            "for example, and standard deviations are computed from the coherence"
        )
    return (
        f"the coherence is not used, because averages is {frf.averages}: the coherence of a single record is always 1; "
        "give a standard deviation"
    )


def pool_variance(
    values: NDArray[np.complex128],
    log_variance: NDArray[np.float64],
    degrees_of_freedom: ArrayLike,
    *,
    correlated_lines: ArrayLike = 1.0,
    half_width: int | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the variance `(n,)` of one entry, pooled over neighbouring lines, and its degrees of freedom.

    `values` are in the measured form. Degrees of freedom and correlated lines are one number or `(n,)`. The window has
    the fewest lines that give 60 degrees of freedom on the median line, at most 64 to each side, or `half_width` lines.
    Lines with infinite variance or a value of zero are returned unchanged. The degrees of freedom follow from the
    variance of the fit (Satterthwaite 1946).

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
    variance, freedom, correlated = (
        np.broadcast_to(_checks.unmasked(owner, name, number, np.float64), values.shape)
        for name, number in (
            ("log_variance", log_variance),
            ("degrees_of_freedom", degrees_of_freedom),
            ("correlated_lines", correlated_lines),
        )
    )
    if half_width is not None:
        half_width = int(_checks.not_negative(owner, "half_width", half_width))
    return _pooled(values, variance, freedom, correlated, half_width)


def _pooled(
    values: NDArray[np.complex128],
    log_variance: NDArray[np.float64],
    degrees_of_freedom: NDArray[np.float64],
    correlated_lines: NDArray[np.float64],
    half_width: int | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return what `pool_variance` returns, from arrays `(n,)`."""
    result, line_freedom = log_variance.copy(), degrees_of_freedom.copy()
    known = np.isfinite(result) & np.isfinite(line_freedom) & (values != 0.0)
    correlated = correlated_lines[known]
    gain = np.abs(values[known]) ** 2
    gain /= gain.max(initial=np.finfo(float).tiny)
    scatter = result[known] * gain
    if half_width is None:
        widths = [width for width in _HALF_WIDTHS if width <= (gain.size - 1) // 2]
    else:
        widths = [min(half_width, (gain.size - 1) // 2)]
    # Simulated data without noise have zero variance and are not fitted.
    if not scatter.any() or not widths or widths[0] < 1:
        return result, line_freedom
    known_freedom = line_freedom[known]
    for width in widths:
        with np.errstate(all="ignore"):
            fitted, freedom = _fit(scatter, gain, known_freedom, correlated, width)
            pooled = fitted / gain
        if float(np.median(freedom)) >= _TARGET_FREEDOM:
            break
    # Lines keep their variance if values spanning hundreds of decades make the fit overflow.
    is_finite = np.isfinite(pooled) & np.isfinite(freedom)
    result[known] = np.where(is_finite, pooled, result[known])
    line_freedom[known] = np.where(is_finite, freedom, known_freedom)
    return result, line_freedom


def _fit(
    scatter: NDArray[np.float64],
    gain: NDArray[np.float64],
    line_freedom: NDArray[np.float64],
    correlated: NDArray[np.float64],
    width: int,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return a + b |H|^2 on each line from those within `width`, with a, b >= 0, and its degrees of freedom."""

    def total(terms: NDArray[np.float64]) -> NDArray[np.float64]:
        # Summed separately for each window: a running sum would lose the small terms beside a resonance.
        return np.convolve(terms, np.ones(2 * width + 1), mode="same")

    lowest = 1e-12 * float(scatter.max())
    power = np.maximum(total(scatter) / total(np.ones_like(scatter)), lowest)
    for _ in range(_REWEIGHTINGS):
        weight = power**-2.0
        w, wg, wgg = total(weight), total(weight * gain), total(weight * gain**2)
        ws, wgs = total(weight * scatter), total(weight * gain * scatter)
        centre = wg / w
        variation = wgg - wg * centre
        level = variation <= _MIN_VARIATION * wgg
        variation = np.where(level, 1.0, variation)
        slope = np.where(level, 0.0, (wgs - centre * ws) / variation)
        flat = slope <= 0.0
        through_zero = ~flat & (ws / w <= slope * centre)
        # The fit is sum_k (alpha + beta g_k) w_k scatter_k.
        off = gain - centre
        alpha = np.where(flat, 1.0 / w, np.where(through_zero, 0.0, 1.0 / w - off * centre / variation))
        beta = np.where(flat, 0.0, np.where(through_zero, gain / wgg, off / variation))
        power = np.maximum(alpha * ws + beta * wgs, lowest)
    size = weight**2 * power**2 * correlated * 2.0 / line_freedom
    variance = alpha**2 * total(size) + 2.0 * alpha * beta * total(size * gain) + beta**2 * total(size * gain**2)
    # The freedom of the line is a lower limit, with correlated or steeply weighted neighbours as well.
    freedom = np.maximum(2.0 * power**2 / variance, line_freedom)
    unlikely = special.chdtrc(line_freedom, line_freedom * scatter / power) < _MIN_PROBABILITY
    return np.where(unlikely, scatter, power), np.where(unlikely, line_freedom, freedom)


def additive_share(
    values: NDArray[np.complex128], log_variance: NDArray[np.float64], correlated_lines: ArrayLike = 1.0
) -> NDArray[np.float64]:
    """Return the share `(n,)` of a in the variance a + b |H|^2 of one entry, from the lines around each line.

    Noise of the response is additive (a). Noise of the force and scatter between hits are proportional to the FRF (b).
    The values are not zero and the variances finite. The share is 0 where |H| does not change with frequency.

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
    half = min(_SHARE_HALF_WIDTH, (power.size - 1) // (2 * int(stride.max())))
    if half < 1:
        return result
    for first in range(0, power.size, LINES_AT_ONCE):
        lines = np.arange(first, min(first + LINES_AT_ONCE, power.size))
        near = lines_around(lines, half, stride[lines], power.size)
        # Variances of zero are handled by the caller.
        with np.errstate(divide="ignore", invalid="ignore"):
            result[lines] = _share(power[near], noise[near], near == lines[:, None])
    return result


def _share(power: NDArray[np.float64], noise: NDArray[np.float64], is_line: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return the share of a in noise = a + b |H|^2 with a, b >= 0; each row has the lines around a line."""
    g = power / power.mean(axis=1, keepdims=True)
    y = noise / noise.mean(axis=1, keepdims=True)
    # Weighted for relative deviations, because both span decades beside a resonance.
    w = 1.0 / (0.5 * (y + 1.0)) ** 2
    total, first, second = (np.sum(w * g**k, axis=1) for k in range(3))
    variation = total * second - first**2
    flat = variation <= _MIN_VARIATION * total * second
    slope = (total * np.sum(w * g * y, axis=1) - first * np.sum(w * y, axis=1)) / np.where(flat, 1.0, variation)
    slope = np.clip(slope, 0.0, np.sum(w * g * y, axis=1) / second)
    constant = np.maximum(np.sum(w * y, axis=1) - slope * first, 0.0) / total
    middle = np.sum(g * is_line, axis=1)
    middle = np.where(middle > 0.0, middle, 1.0)
    share: NDArray[np.float64] = constant / (constant + slope * middle)
    return np.where(flat | ~np.isfinite(share), 0.0, share)


def lines_around(lines: NDArray[np.intp], half: int, stride: NDArray[np.intp], size: int) -> NDArray[np.intp]:
    """Return the indices of the lines around each line, `(n, 2 half + 1)`, in steps of a stride, within the record."""
    begin = np.clip(lines - half * stride, 0, size - 1 - 2 * half * stride)
    return np.asarray(begin[:, None] + stride[:, None] * np.arange(2 * half + 1))


def pool_entries(
    frf: FRFData, log_variance: NDArray[np.float64], degrees_of_freedom: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return variance and degrees of freedom `(n, n_responses, n_excitations)`, pooled in each entry."""
    variance, freedom = log_variance.copy(), degrees_of_freedom.copy()
    for i, j in np.ndindex(frf.values.shape[1:]):
        entry = frf.values[:, i, j], log_variance[:, i, j], degrees_of_freedom[:, i, j]
        variance[:, i, j], freedom[:, i, j] = _pooled(*entry, frf.correlated_lines)
    return variance, freedom


def interval_factor(level: float, degrees_of_freedom: ArrayLike | None) -> NDArray[np.float64]:
    """Return the half-width of a two-sided interval of a level in standard deviations.

    It is a quantile of Student's t distribution, of the shape of the degrees of freedom of the variance; of the normal
    distribution where these are None or infinite, because the variance is known exactly.

    Examples
    --------
    >>> from receptance.frf.variance import interval_factor
    >>> interval_factor(0.95, [4.0, float("inf")]).round(3).tolist()
    [2.776, 1.96]
    """
    level = _checks.number("interval", "level", level)
    if not 0.0 < level < 1.0:
        raise ValueError(f"interval: level is {level:g}, expected between 0 and 1")
    upper = 0.5 + 0.5 * level
    freedom = np.asarray(np.inf if degrees_of_freedom is None else degrees_of_freedom, dtype=np.float64)
    estimated = np.isfinite(freedom)
    normal = special.ndtri(upper)
    if not estimated.any():
        return np.full(freedom.shape, normal)

    return np.asarray(np.where(estimated, special.stdtrit(np.where(estimated, freedom, 1.0), upper), normal))
