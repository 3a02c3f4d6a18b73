"""Chances and quantiles that short commands need, without scipy.special.

Loading scipy.special takes a fifth of the processor time of `receptance identify` on a small campaign. The formulas
here are exact; where there is none, scipy.special is used.
"""

from __future__ import annotations

import math
from functools import lru_cache
from statistics import NormalDist
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

_MOST_TERMS = 1_000_000
"""Largest number of terms of sums, beyond which scipy.special is faster."""
_LEAST_FREEDOM = 0.5
"""Least degrees of freedom of a quantile: with fewer, and below the median, its first approximation is poor."""
_MOST_STEPS = 30
"""Most steps to a quantile; four are usual."""


def normal_quantile(chance: float) -> float:
    """Return the value below which a standard normal variable is with some probability between 0 and 1.

    Examples
    --------
    >>> from receptance._chances import normal_quantile
    >>> round(normal_quantile(0.975), 6)
    1.959964
    """
    return NormalDist().inv_cdf(chance)


def normal_chance(value: float) -> float:
    """Return the probability of a larger value of a standard normal variable.

    Examples
    --------
    >>> from receptance._chances import normal_chance
    >>> round(normal_chance(1.959964), 6)
    0.025
    """
    return 0.5 * math.erfc(value / math.sqrt(2.0))


def chi_square_chance(chi_square: ArrayLike, freedom: ArrayLike) -> NDArray[np.float64]:
    """Return the probability of a larger chi-square, element by element.

    For whole numbers of degrees of freedom it is a finite sum, with the error function for odd ones (Abramowitz and
    Stegun 26.4.4 and 26.4.5).

    Examples
    --------
    >>> from receptance._chances import chi_square_chance
    >>> chi_square_chance([3.841459, 9.210340], [1, 2]).round(6).tolist()
    [0.05, 0.01]
    """
    x, degrees = np.broadcast_arrays(
        0.5 * np.asarray(chi_square, dtype=np.float64), np.asarray(freedom, dtype=np.float64)
    )
    whole = bool(np.all((degrees == np.rint(degrees)) & (degrees > 0.0) & np.isfinite(x) & (x >= 0.0)))
    if not whole or float(degrees.sum()) > _MOST_TERMS:
        from scipy.special import gammaincc  # slow to import

        return np.asarray(gammaincc(0.5 * degrees, x))
    found = np.empty(x.shape)
    for number in set(degrees.astype(int).ravel().tolist()):
        chosen = degrees == number
        own = x[chosen]
        found[chosen] = _finite_sum(own, number)
    return found


def _finite_sum(x: NDArray[np.float64], freedom: int) -> NDArray[np.float64]:
    odd = freedom % 2
    first = np.array([math.erfc(math.sqrt(value)) for value in x.tolist()]) if odd else np.exp(-x)
    # Terms x^p e^-x / Gamma(p + 1), as exponentials of their logarithms: single factors overflow.
    powers = np.arange(0.5 if odd else 1.0, 0.5 * freedom)
    if not powers.size:
        return np.asarray(first)
    with np.errstate(divide="ignore"):
        logarithm = np.log(x)[:, None] * powers - np.array([math.lgamma(power + 1.0) for power in powers.tolist()])
    return np.asarray(np.minimum(first + np.exp(logarithm - x[:, None]).sum(axis=1), 1.0))


@lru_cache(maxsize=1024)
def chi_square_quantile(freedom: float, chance: float) -> float:
    """Return the value that chi-square exceeds with some probability.

    Newton's method leads to it from the approximation of Wilson and Hilferty (Abramowitz and Stegun 26.4.17).

    Parameters
    ----------
    freedom : float
        Degrees of freedom above 0.
    chance : float
        Between 0 and 1.

    Examples
    --------
    >>> from receptance._chances import chi_square_quantile
    >>> round(chi_square_quantile(2.0, 0.01), 6)
    9.21034
    """
    if not _LEAST_FREEDOM <= freedom <= _MOST_TERMS or chance > 0.5:
        from scipy.special import chdtri  # slow to import

        return float(chdtri(freedom, chance))
    share = 2.0 / (9.0 * freedom)
    half, x = 0.5 * freedom, 0.5 * freedom * (1.0 - share + normal_quantile(1.0 - chance) * math.sqrt(share)) ** 3
    for _ in range(_MOST_STEPS):
        density, larger = _gamma(half, x)
        # On the logarithm of the chance, which is nearly a parabola.
        step = larger * math.log(larger / chance) / density
        x = max(x + step, 0.1 * x)
        if abs(step) <= 1e-14 * x:
            break
    return 2.0 * x


def _gamma(shape: float, x: float) -> tuple[float, float]:
    """Return the density of a gamma variable and the probability of a larger value (Abramowitz and Stegun 6.5.29)."""
    density = math.exp((shape - 1.0) * math.log(x) - x - math.lgamma(shape))
    term = total = x / shape
    further = shape
    while term > 1e-17 * total:
        further += 1.0
        term *= x / further
        total += term
    return density, max(1.0 - density * total, 1e-300)


def f_chance_4(ratio: float, freedom: int) -> float:
    """Return the probability of a larger F with 4 and an even number of degrees of freedom; 1 for a negative ratio.

    Examples
    --------
    >>> from receptance._chances import f_chance_4
    >>> round(f_chance_4(3.478050, 10), 6)
    0.05
    """
    if ratio <= 0.0:
        return 1.0
    half = freedom // 2
    # The incomplete beta function of half and 2 is a polynomial.
    share = half / (half + 2.0 * ratio)
    return float(share**half * (1.0 + half * (1.0 - share)))
