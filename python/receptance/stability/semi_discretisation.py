"""Stability of milling with the periodic force as it is: first-order semi-discretisation.

Within a step of the tooth period the force coefficient is its exact mean over the step, and the delayed displacement
goes linearly from one step to the next; the state then follows exactly, by matrix exponentials. The largest eigenvalue
of the map over one tooth passing decides. Both approximations are second order in the step. Steps begin and end where a
tooth enters or leaves the cut, so that halving them takes away three quarters of the error, and the values for two
steps give one of fourth order (Richardson).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq

from receptance import _checks

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from receptance.stability.cutting import Milling
    from receptance.stability.modal_model import TipModes

__all__ = ["floquet_multiplier", "semi_discretised_limit"]

_STEPS_PER_WAVE = 20
"""Steps in a period of the highest mode: multipliers are then good to some 1e-5."""
_FEWEST = 24
_FEWEST_IN_CUT = 12
_MOST = 2000
_EVALUATIONS = 60
_NEAR = 1.15
"""Factor by which a crossing near a depth is sought."""
_CLOSE = 1e-3
"""Relative accuracy of the limits of draws, whose spread is far larger."""
_LEAST = 1e-4
"""Share of the largest depth below which nothing is sought."""
"""Most to refine one limit by."""


def floquet_multiplier(
    cut: Milling,
    tip: TipModes,
    *,
    speed_rpm: float,
    depth: ArrayLike,
    steps: int | None = None,
    extrapolate: bool = True,
) -> NDArray[np.float64]:
    """Return the largest Floquet multiplier, by magnitude, over one tooth passing: under one is stable.

    Parameters
    ----------
    cut : Milling
        The cut.
    tip : TipModes
        Modes of the tool tip.
    speed_rpm : float
        Spindle speed in revolutions per minute.
    depth : array_like
        Axial depths of cut `(n,)` in m, zero or more.
    steps : int, optional
        Steps of the tooth period; by default 20 per period of the highest mode, at least 24.

    extrapolate : bool, optional
        Whether the values for `steps` and twice as many give one of fourth order.

    Returns
    -------
    ndarray
        `(n,)`.

    Raises
    ------
    ValueError
        Values out of range, or a speed so low that a tooth period takes over 2000 steps.

    References
    ----------
    Insperger, Stepan 2011, Semi-Discretization for Time-Delay Systems, section 3 (first order).

    Examples
    --------
    >>> from receptance.stability import Milling, TipModes
    >>> tip = TipModes(frequency_hz=[922.0], damping_ratio=[0.011], shapes=[[0.03993**-0.5, 0.0]])
    >>> cut = Milling(teeth=2, k_t=6e8, k_n=2e8)
    >>> floquet_multiplier(cut, tip, speed_rpm=5000.0, depth=[0.2e-3, 0.5e-3]).round(3)
    array([0.82 , 1.074])
    """
    speed = _checks.positive("floquet_multiplier", "speed_rpm", speed_rpm, unit="rpm")
    depths = np.atleast_1d(_checks.unmasked("floquet_multiplier", "depth", depth, np.float64))
    if depths.ndim != 1 or not np.isfinite(depths).all() or (depths < 0.0).any():
        raise ValueError(f"floquet_multiplier: depth is {depth!r}, expected finite depths in m, zero or more")
    pair = _Pair(cut, tip, speed, _steps(cut, tip, speed, steps))
    return np.array([pair.extrapolated(one) if extrapolate else pair.coarse.largest(one) for one in depths])


def semi_discretised_limit(
    cut: Milling,
    tip: TipModes,
    *,
    speeds_rpm: ArrayLike,
    most: float,
    steps: int | None = None,
    resolution: float = 0.02,
    tolerance: float = 1e-4,
) -> NDArray[np.float64]:
    """Return the smallest depth at which milling becomes unstable, at each spindle speed.

    Parameters
    ----------
    cut, tip, steps
        As for `floquet_multiplier`.
    speeds_rpm : array_like
        Spindle speeds `(n,)`.
    most : float
        Largest depth in m to look at.
    resolution : float, optional
        Share of `most` by which depths are first tried, so that an unstable depth below a stable one is seen.
    tolerance : float, optional
        Relative accuracy of the limit.

    Returns
    -------
    ndarray
        `(n,)` in m; infinite where all depths up to `most` are stable.

    Raises
    ------
    ValueError
        Values out of range.
    """
    owner = "semi_discretised_limit"
    highest = _checks.positive(owner, "most", most, unit="m")
    share = _checks.positive(owner, "resolution", resolution)
    close = _checks.positive(owner, "tolerance", tolerance)
    speeds = np.atleast_1d(_checks.unmasked(owner, "speeds_rpm", speeds_rpm, np.float64))
    tried = np.asarray(highest * np.arange(1, int(np.ceil(1.0 / share)) + 1) * share, dtype=np.float64)
    limits = []
    for speed in speeds:
        rate = _checks.positive(owner, "speeds_rpm", speed, unit="rpm")
        limits.append(_first_crossing(_Pair(cut, tip, rate, _steps(cut, tip, rate, steps)), tried, close))
    return np.array(limits)


def limit_near(cut: Milling, tip: TipModes, speed_rpm: float, depth: float, most: float) -> float:
    """Return the crossing into instability nearest to a depth, for draws around what it is the limit of.

    Where a draw is still stable at `most` it is infinite.
    """
    map_ = _PassingMap(cut, tip, speed_rpm, _nodes(cut, _steps(cut, tip, speed_rpm, None)))

    def excess(depth: float) -> float:
        return map_.largest(depth) - 1.0

    low = high = min(depth, most)
    if excess(low) > 0.0:
        while excess(low) > 0.0:
            low, high = low / _NEAR, low
            if low < _LEAST * most:
                return 0.0
    else:
        while excess(high) <= 0.0:
            if high >= most:
                return float("inf")
            low, high = high, min(high * _NEAR, most)
    return float(brentq(excess, low, high, xtol=_CLOSE * high, maxiter=_EVALUATIONS))


def _steps(cut: Milling, tip: TipModes, speed: float, steps: int | None) -> int:
    if steps is None:
        period = 60.0 / (cut.teeth * speed)
        steps = max(_FEWEST, int(np.ceil(_STEPS_PER_WAVE * period * tip.frequency_hz.max())))
    if isinstance(steps, bool) or not isinstance(steps, (int, np.integer)) or not 4 <= steps <= _MOST:
        raise ValueError(
            f"semi-discretisation at {speed:g} rpm: steps is {steps!r}, expected a whole number from 4 to {_MOST}; at "
            "speeds this low the zeroth-order solution serves"
        )
    return int(steps)


def _first_crossing(pair: _Pair, tried: NDArray[np.float64], close: float) -> float:
    """The smallest depth with a multiplier of one, sought with coarse steps and refined with both."""
    stable = 0.0
    for depth in tried:
        if pair.coarse.largest(float(depth)) > 1.0:
            unstable = float(depth)
            break
        stable = float(depth)
    else:
        return float("inf")

    def excess(depth: float) -> float:
        return pair.extrapolated(depth) - 1.0

    # What coarse steps saw may lie on the other side of a bracket's end.
    while excess(unstable) <= 0.0:
        stable, unstable = unstable, unstable + tried[0]
        if unstable > 2.0 * tried[-1]:
            return float("inf")
    while stable > 0.0 and excess(stable) > 0.0:
        unstable, stable = stable, max(stable - float(tried[0]), 0.0)
    # Without a cut the structure's own damping is all there is: just under one.
    if stable == 0.0:
        stable = 1e-9 * unstable
    return float(brentq(excess, stable, unstable, xtol=close * unstable, maxiter=_EVALUATIONS))


class _Pair:
    """The map with some steps and with twice as many."""

    def __init__(self, cut: Milling, tip: TipModes, speed: float, steps: int) -> None:
        nodes = _nodes(cut, steps)
        between = np.sort(np.concatenate([nodes, 0.5 * (nodes[1:] + nodes[:-1])]))
        self.coarse, self.fine = _PassingMap(cut, tip, speed, nodes), _PassingMap(cut, tip, speed, between)

    def extrapolated(self, depth: float) -> float:
        """The largest multiplier without the error that goes with the square of the step."""
        return (4.0 * self.fine.largest(depth) - self.coarse.largest(depth)) / 3.0


def _nodes(cut: Milling, steps: int) -> NDArray[np.float64]:
    """Angles of the first tooth between which the steps lie, over one tooth pitch, even between entry and exit."""
    pitch = 2.0 * np.pi / cut.teeth
    ends = np.unique([0.0, *np.mod(cut.engagement, pitch), pitch])
    # A whole number of pitches in the cut leaves ends that differ by rounding.
    ends = ends[np.concatenate([[True], np.diff(ends) > 1e-9 * pitch])]
    ends[-1] = pitch
    pieces = [ends[:1]]
    middles = 0.5 * (ends[1:] + ends[:-1])
    width = 1e-6 * pitch
    idle = ~np.any(cut.directional_mean(middles - width, middles + width), axis=(1, 2))
    for first, last, rests in zip(ends[:-1], ends[1:], idle, strict=True):
        count = 1 if rests else max(_FEWEST_IN_CUT, round(steps * (last - first) / pitch))
        pieces.append(np.linspace(first, last, count + 1)[1:])
    return np.concatenate(pieces)


class _PassingMap:
    """The map of state and past displacements over one tooth passing, for any depth."""

    def __init__(self, cut: Milling, tip: TipModes, speed: float, angles: NDArray[np.float64]) -> None:
        self.step = np.diff(angles) * 60.0 / (2.0 * np.pi * speed)
        coefficient = cut.directional_mean(angles[:-1], angles[1:])
        self.shapes = tip.shapes
        # Directions in which nothing moves have no past.
        self.used = np.flatnonzero(np.any(tip.shapes != 0.0, axis=0))
        self.force = np.einsum("ki,nij->nkj", tip.shapes, coefficient)  # modal force over displacement and depth
        w = 2.0 * np.pi * tip.frequency_hz
        k = w.size
        self.free = np.zeros((2 * k, 2 * k))
        self.free[:k, k:] = np.eye(k)
        self.free[k:, :k] = -np.diag(w**2)
        self.free[k:, k:] = -np.diag(2.0 * tip.damping_ratio * w)

    def largest(self, depth: float) -> float:
        """Magnitude of the largest eigenvalue."""
        state, from_past, from_change = self._pieces(depth)
        k2, p, m = state.shape[1], self.used.size, self.step.size
        shape = np.zeros((p, k2))
        shape[:, : k2 // 2] = self.shapes[:, self.used].T
        # Rows: the state now, and the displacements at the beginning of each step one tooth ago.
        size = k2 + m * p
        now = np.eye(size)[:k2]
        past = np.eye(size)[k2:].reshape(m, p, size)
        history: list[NDArray[np.float64]] = []
        for i in range(m):
            history.append(shape @ now)
            old, new = past[i], past[i + 1] if i + 1 < m else history[0]
            now = state[i] @ now + from_past[i] @ old + from_change[i] @ (new - old)
        after = np.concatenate([now, np.concatenate(history)])
        return float(np.abs(np.linalg.eigvals(after)).max())

    def _pieces(self, depth: float) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Exact propagation over each step: of the state, of a constant past, of one that rises from zero."""
        k2, p = self.free.shape[0], self.used.size
        k = k2 // 2
        generator = np.zeros((self.step.size, k2 + 2 * p, k2 + 2 * p))
        generator[:, :k2, :k2] = self.free
        regenerative = depth * self.force
        generator[:, k:k2, :k] += regenerative @ self.shapes.T
        generator[:, k:k2, k2 : k2 + p] = -regenerative[:, :, self.used]
        generator *= self.step[:, None, None]
        generator[:, k2 : k2 + p, k2 + p :] = np.eye(p)
        whole = expm(generator)
        return whole[:, :k2, :k2], whole[:, :k2, k2 : k2 + p], whole[:, :k2, k2 + p :]
