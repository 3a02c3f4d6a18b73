"""Variance of an FRF from the scatter between hits, pooled over neighbouring lines.

The force of a hammer is what it is, not a random signal: with F_i the force of hit i, H1 = sum(conj(F_i) X_i) / S
with S = sum |F_i|^2 is the least-squares slope of X_i = H F_i + e_i, complex, with known F_i. So H1 - H is Gaussian
with variance E|e|^2 / S, whatever the hits' strengths, and Q = sum |X_i - H1 F_i|^2 is E|e|^2 / 2 times a chi-square of
2 (n - 1) degrees of freedom, independent of it. In terms of coherence Q = S |H1|^2 (1 - g^2) / g^2, so the variance of
the real and of the imaginary part, each, of log H1 is (1 - g^2) / (2 (n - 1) g^2), to first order in the deviation.

Of one line Q / (n - 1) is an estimate with few degrees of freedom. Neighbours share what depends on frequency slowly:
noise on the response and the *relative* scatter (noise on the force, hits that differ), E|e|^2 = a + b |H|^2 with a and
b smooth. They are fitted over a window of lines; the degrees of freedom follow from the fit's own variance, in which
lines that a window or zero padding correlates count as fewer (Satterthwaite 1946).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["LAGS", "Pooled", "pool"]

_HALF_WIDTHS = (0, 1, 2, 4, 8, 16, 32, 64)
"""Lines to each side that are tried."""
LAGS = 2 * _HALF_WIDTHS[-1] + 1
"""Lines in the widest window."""
_ENOUGH = 60.0
"""Degrees of freedom at which pooling stops: t is then within 2 % of the normal."""
_FAIR_TRY = 4
"""Lines to each side after which pooling also stops when more of them"""
_GROWTH = 1.02
"""hardly add freedom: noise on the force is the same for all neighbours."""
_ROUNDS = 4
"""Of fitting with weights from the last fit; nothing moves after three."""
_LEVEL = 1e-9
"""Relative spread of |H|^2 in a window below which it tells nothing of b."""
_OWN = 1e-3
"""A line whose scatter is so unlikely under its neighbours' keeps its own."""


@dataclass(frozen=True)
class Pooled:
    """Mean power of the scatter of one hit on each line, `(n_lines,)`, and its degrees of freedom."""

    power: NDArray[np.float64]
    degrees_of_freedom: NDArray[np.float64]
    half_width: int
    kept_own: NDArray[np.bool_]


def _single(scatter: NDArray[np.float64], hits: int, skew: NDArray[np.float64]) -> Pooled:
    """Return what each line says alone; `skew` as in `pool`."""
    freedom = 2.0 * (hits - 1) / (1.0 + skew**2)
    return Pooled(scatter.copy(), freedom, 0, np.zeros(scatter.size, dtype=bool))


def pool(
    scatter: NDArray[np.float64],
    gain: NDArray[np.float64],
    hits: int,
    *,
    correlation: NDArray[np.float64],
    common: NDArray[np.float64],
    skew: NDArray[np.float64],
    half_width: int | None = None,
) -> Pooled:
    """Pool the scatter of neighbouring lines.

    Parameters
    ----------
    scatter : ndarray
        `(n_lines,)` sum of |X_i - H F_i|^2 over the hits, divided by n - 1.
    gain : ndarray
        `(n_lines,)` |H|^2.
    hits : int
        Number of hits n, at least 2.
    correlation : ndarray
        `(LAGS,)` correlation, in magnitude, of the response's noise between lines 0, 1, 2 ... apart.
    common : ndarray
        `(n_lines,)` smallest share of the scatter that is noise on the force. Whatever scatters with |H|^2 is taken
        as fully correlated between neighbours: the force's window is short, so its noise has a smooth spectrum.
    skew : ndarray
        `(n_lines,)` how much of the scatter is in one phase only, from 0 to 1: it then has half the freedom.
    half_width : int, optional
        Lines to each side; by default as few as give 60 degrees of freedom on the median line.

    Returns
    -------
    Pooled
        The fitted power and its degrees of freedom.
    """
    widths = _HALF_WIDTHS if half_width is None else (half_width,)
    most = (scatter.size - 1) // 2
    found = _single(scatter, hits, skew)
    before = 0.0
    for width in widths:
        if width > most:
            break
        if width:
            found = _window(scatter, gain, hits, correlation, common, skew, width)
        median = float(np.median(found.degrees_of_freedom))
        if half_width is None and (median >= _ENOUGH or (width >= _FAIR_TRY and median < _GROWTH * before)):
            break
        before = median
    return found


def _window(
    scatter: NDArray[np.float64],
    gain: NDArray[np.float64],
    hits: int,
    correlation: NDArray[np.float64],
    common: NDArray[np.float64],
    skew: NDArray[np.float64],
    width: int,
) -> Pooled:
    total = _Sums(width)
    power = total(scatter) / total(np.ones_like(scatter))
    for _ in range(_ROUNDS):
        weight = power**-2.0
        fit = _Fit(total, weight, gain)
        power = fit.value(scatter)
    variance = fit.variance(power, correlation, np.maximum(common, fit.proportional / power), skew, hits)
    freedom = 2.0 * power**2 / variance
    own = _unlikely(scatter / power, hits)
    lonely = _single(scatter, hits, skew)
    return Pooled(np.where(own, scatter, power), np.where(own, lonely.degrees_of_freedom, freedom), width, own)


class _Sums:
    """Sums over the lines within `width` of each one; cut off at the ends."""

    def __init__(self, width: int) -> None:
        self.width = width

    def __call__(self, values: NDArray[np.float64], lag: int = 0) -> NDArray[np.float64]:
        """Return the sum over l with l and l + lag inside the window of each line, `(n_lines,)`.

        Added up from sums of two, four, eight ... neighbours: a running sum would lose the small terms beside a
        resonance in the rounding of the large ones.
        """
        length = 2 * self.width + 1 - lag
        padded = np.concatenate([np.zeros(self.width), values, np.zeros(self.width)])
        n_lines = values.size + lag
        found = np.zeros(n_lines)
        block, size, begin = padded, 1, 0
        while length:
            if length & size:
                found += block[begin : begin + n_lines]
                begin, length = begin + size, length - size
            block = block[:-size] + block[size:]
            size *= 2
        return found


class _Fit:
    """The weighted fit of a + b |H|^2, a and b at least zero, over the window of each line."""

    def __init__(self, total: _Sums, weight: NDArray[np.float64], gain: NDArray[np.float64]) -> None:
        self.total, self.weight, self.gain = total, weight, gain
        self.w, self.wg, self.wgg = total(weight), total(weight * gain), total(weight * gain**2)
        self.centre = self.wg / self.w
        spread = self.wgg - self.wg * self.centre
        self.level = spread <= _LEVEL * self.wgg
        self.spread = np.where(self.level, 1.0, spread)
        self.alpha = self.beta = np.zeros_like(gain)
        self.proportional = np.zeros_like(gain)

    def value(self, scatter: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the fit on each line; it is sum_l (alpha + beta |H_l|^2) w_l scatter_l."""
        ws, wgs = self.total(self.weight * scatter), self.total(self.weight * self.gain * scatter)
        mean = ws / self.w
        slope = np.where(self.level, 0.0, (wgs - self.centre * ws) / self.spread)
        flat = self.level | (slope <= 0.0)
        through_zero = ~flat & (mean - slope * self.centre <= 0.0)
        off = self.gain - self.centre
        self.alpha = np.where(flat, 1.0 / self.w, 1.0 / self.w - off * self.centre / self.spread)
        self.beta = np.where(flat, 0.0, off / self.spread)
        self.alpha = np.where(through_zero, 0.0, self.alpha)
        self.beta = np.where(through_zero, self.gain / self.wgg, self.beta)
        self.proportional = self.gain * np.where(flat, 0.0, np.where(through_zero, wgs / self.wgg, slope))
        fitted: NDArray[np.float64] = self.alpha * ws + self.beta * wgs
        return fitted

    def variance(
        self,
        power: NDArray[np.float64],
        correlation: NDArray[np.float64],
        common: NDArray[np.float64],
        skew: NDArray[np.float64],
        hits: int,
    ) -> NDArray[np.float64]:
        """Return the variance of the fit on each line: each scatter has power^2 / (n - 1), neighbours alike in part."""
        share = np.clip(common, 0.0, 1.0)
        size = self.weight * power * np.sqrt((1.0 + skew**2) / (hits - 1))
        found: NDArray[np.float64] = np.zeros_like(power)
        for lag in range(2 * self.total.width + 1):
            n = power.size - lag
            if n <= 0:
                break
            first, second = slice(0, n), slice(lag, None)
            alike: NDArray[np.float64] = np.sqrt((1.0 - share[first]) * (1.0 - share[second])) * correlation[lag]
            alike = alike + np.sqrt(share[first] * share[second])
            product = (2.0 if lag else 1.0) * size[first] * size[second] * alike**2
            g, h = self.gain[first], self.gain[second]
            sums = [self.total(term, lag) for term in (product, product * (g + h), product * g * h)]
            a, b = self.alpha, self.beta
            found = found + a * a * sums[0] + a * b * sums[1] + b * b * sums[2]
        return found


def _unlikely(ratio: NDArray[np.float64], hits: int) -> NDArray[np.bool_]:
    from scipy.special import gammaincc  # slow to import

    chance: NDArray[np.float64] = gammaincc(hits - 1.0, (hits - 1.0) * ratio)
    return chance < _OWN
