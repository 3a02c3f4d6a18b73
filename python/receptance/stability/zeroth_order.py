"""Stability limits from receptances: turning, and milling by the mean cutting force (zeroth order)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from receptance.stability.cutting import Milling, Turning

_SHARES = (0.5, 0.2, 0.05)
"""Thresholds as shares of the largest 1/depth: segments above them are processed first."""


def critical_depths(
    cut: Milling | Turning, frequency_hz: NDArray[np.float64], receptance: NDArray[np.complex128]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the critical depth of cut at each frequency, and the phase between two teeth.

    Parameters
    ----------
    cut : Milling or Turning
        The cut.
    frequency_hz : ndarray
        Chatter frequencies `(n,)`.
    receptance : ndarray
        `(n, 2, 2)` in x and y for milling, `(n, 1, 1)` in the direction of the chip thickness for turning, in m/N.

    Returns
    -------
    depth, phase : ndarray
        `(n, k)` in m and rad for each of the k eigenvalues; infinite if the frequency cannot chatter. The tooth periods
        are (phase + 2 pi j) / w_c with any integer j >= 0.

    References
    ----------
    Altintas, Budak 1995, eqs. 15 to 24; for turning Altintas 2012, eqs. 4.16 to 4.20.
    """
    if isinstance(cut, Turning):
        eigenvalues = -cut.k * cut.share * receptance[:, 0, 0][:, None]
    else:
        mean = cut.directional_mean(np.array([0.0]), np.array([2.0 * np.pi]))[0]
        # One product for all lines is faster than one per line.
        eigenvalues = _eigenvalues((receptance.reshape(-1, 2) @ mean).reshape(receptance.shape))
    # 1 = a (1 - e^{-i w T}) mu, with the eigenvalue mu of G A: 1/a is real where Re(1/mu) = (1 - cos wT) a.
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1.0 / eigenvalues
        depth = np.abs(inverse) ** 2 / (2.0 * inverse.real)
        unstable = np.isfinite(depth) & (depth > 0.0)
        # a (1 - e^{-i psi}) = inverse.
        phase = np.mod(2.0 * np.arctan2(inverse.real, inverse.imag), 2.0 * np.pi)
    return np.where(unstable, depth, np.inf), np.where(unstable, phase, np.nan)


def _eigenvalues(matrices: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Return both eigenvalues of 2 x 2 matrices, the smaller one without cancellation."""
    half = 0.5 * (matrices[:, 0, 0] + matrices[:, 1, 1])
    determinant = matrices[:, 0, 0] * matrices[:, 1, 1] - matrices[:, 0, 1] * matrices[:, 1, 0]
    root = np.sqrt(half**2 - determinant)
    root = np.where((half.conj() * root).real < 0.0, -root, root)
    larger = half + root
    smaller = np.divide(determinant, larger, out=np.zeros_like(larger), where=larger != 0.0)
    return _continuous(np.stack([larger, smaller], axis=1))


def _continuous(pairs: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Return the pairs in the order in which each column is continuous over the lines."""
    before, after = pairs[:-1], pairs[1:]
    same_order = np.abs(after - before).sum(axis=1)
    exchanged = np.abs(after[:, ::-1] - before).sum(axis=1)
    reverse = np.concatenate([[0], np.cumsum(exchanged < same_order)]) % 2 == 1
    return np.where(reverse[:, None], pairs[:, ::-1], pairs)


def limit_over_speed(
    teeth: int,
    speeds_rpm: NDArray[np.float64],
    frequency_hz: NDArray[np.float64],
    depth: NDArray[np.float64],
    phase: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the lowest critical depth at each spindle speed, and its chatter frequency.

    In lobe j a tooth period contains j whole waves and the phase. Between two lines the number of waves and 1/depth are
    linear in frequency.

    Returns
    -------
    limit, chatter_hz : ndarray
        `(n_speeds,)` in m and Hz; infinite and NaN at speeds without chatter.
    """
    # The search needs ascending tooth periods.
    order = np.argsort(-speeds_rpm, kind="stable")
    period = 60.0 / (teeth * speeds_rpm[order])
    inverse_limit, chatter = np.zeros(period.size), np.full(period.size, np.nan)
    segments = _segments(frequency_hz, depth, phase)
    if len(segments):
        _apply_segments(inverse_limit, chatter, period, segments)
    limit = np.full(period.size, np.inf)
    np.divide(1.0, inverse_limit, out=limit, where=inverse_limit > 0.0)
    inverse_order = np.argsort(order)
    return limit[inverse_order], chatter[inverse_order]


def _segments(
    frequency_hz: NDArray[np.float64], depth: NDArray[np.float64], phase: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return segments `(n, 6)` between neighbouring lines that can chatter: frequency, waves, 1/depth at both ends."""
    segments = []
    for column in range(depth.shape[1]):
        chatters = np.isfinite(depth[:, column])
        first = np.flatnonzero(chatters[:-1] & chatters[1:])
        share = phase[:, column] / (2.0 * np.pi)
        # The phase is continuous along a branch; its step is less than half a turn.
        step = np.mod(share[first + 1] - share[first] + 0.5, 1.0) - 0.5
        ends = frequency_hz[first], frequency_hz[first + 1], share[first], share[first] + step
        segments.append(np.stack([*ends, 1.0 / depth[first, column], 1.0 / depth[first + 1, column]], axis=1))
    return np.concatenate(segments)


def _apply_segments(
    inverse_limit: NDArray[np.float64],
    chatter: NDArray[np.float64],
    period: NDArray[np.float64],
    segments: NDArray[np.float64],
) -> None:
    """Raise 1/limit to the maximum over all segments.

    Segments with large 1/depth are applied first; the others matter only at periods where these are absent.
    """
    highest = segments[:, 4:].max(axis=1)
    largest, remaining = highest.max(), np.arange(period.size)
    for share in (*_SHARES, 0.0):
        bound = share * largest
        selected = segments[highest >= bound]
        if len(selected):
            times = period[remaining]
            lobes = np.arange(-1.0, np.ceil(selected[:, 1].max() * times[-1]) + 1.0)
            values = inverse_limit[remaining], chatter[remaining]
            _apply_lobes(*values, times, lobes, selected)
            inverse_limit[remaining], chatter[remaining] = values
        segments, highest = segments[highest < bound], highest[highest < bound]
        remaining = remaining[inverse_limit[remaining] < bound]
        if not remaining.size or not len(segments):
            return


def _apply_lobes(
    inverse_limit: NDArray[np.float64],
    chatter: NDArray[np.float64],
    period: NDArray[np.float64],
    lobes: NDArray[np.float64],
    segments: NDArray[np.float64],
) -> None:
    """Raise 1/limit to the maximum over all lobes at the tooth periods that their segments cover."""
    times = (lobes[:, None, None] + segments[:, 2:4]) / segments[:, :2]
    low, high = times.min(axis=2), times.max(axis=2)
    begin, end = np.searchsorted(period, low, "left"), np.searchsorted(period, high, "right")
    count = np.where(high > 0.0, end - begin, 0).ravel()
    pair = np.repeat(np.arange(count.size), count)
    if not pair.size:
        return
    index = np.arange(pair.size) - np.repeat(np.cumsum(count) - count, count) + begin.ravel()[pair]
    lobe, segment = lobes[pair // len(segments)], segments[pair % len(segments)]
    # The zero of f T - share - lobe, which is linear along the segment.
    first, last = (segment[:, i] * period[index] - segment[:, 2 + i] - lobe for i in (0, 1))
    at = np.divide(first, first - last, out=np.zeros(index.size), where=first != last).clip(0.0, 1.0)
    value = segment[:, 4] + at * (segment[:, 5] - segment[:, 4])
    # In ascending order, so that the last assignment at a period is the largest value.
    order = np.argsort(value, kind="stable")
    order = order[value[order] > inverse_limit[index[order]]]
    inverse_limit[index[order]] = value[order]
    chatter[index[order]] = (segment[:, 0] + at * (segment[:, 1] - segment[:, 0]))[order]
