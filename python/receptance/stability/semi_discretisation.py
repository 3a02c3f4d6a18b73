"""Stability of milling with the periodic cutting force: first-order semi-discretisation.

Within a step of the tooth period the force coefficient is its exact mean over the step, and the delayed displacement
is linear; the state then follows from matrix exponentials. The largest eigenvalue of the map over one tooth period
determines stability. Both approximations are of second order in the step. Steps begin and end where a tooth enters or
leaves the cut, so halving them reduces the error by the factor 4, and Richardson extrapolation gives fourth order.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from receptance import _checks
from receptance.stability.cutting import Milling
from receptance.stability.lobes import Lobes, ensemble, with_draws
from receptance.stability.tip import TipModes

_STEPS_PER_WAVE = 20
"""Steps per period of the highest mode, for errors of the multipliers of about 1e-5."""
_FEWEST_STEPS, _MOST_STEPS = 24, 2000
"""Smallest default and largest number of steps per tooth period."""
_FEWEST_IN_CUT = 12
"""Smallest number of steps while a set of teeth is in the cut."""
_EVALUATIONS = 60
"""Largest number of evaluations for one limit."""
_DEPTH_FACTOR = 1.15
"""Factor between the depths of the search for a crossing near a depth."""
_DRAW_ACCURACY = 1e-3
"""Relative accuracy of the limits of draws, which scatter far more."""
_SMALLEST_DEPTH = 1e-4
"""Smallest depth of the search, as a share of the largest depth."""


def floquet_multiplier(
    cut: Milling,
    tip: TipModes,
    *,
    speed_rpm: float,
    depth: ArrayLike,
    steps: int | None = None,
    extrapolate: bool = True,
) -> NDArray[np.float64]:
    """Return the largest magnitude of the Floquet multipliers over one tooth period; below one the cut is stable.

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
        Steps per tooth period; by default 20 per period of the highest mode, at least 24.
    extrapolate : bool, optional
        Whether to extrapolate from `steps` and twice as many steps to fourth order.

    Returns
    -------
    ndarray
        `(n,)` magnitudes.

    Raises
    ------
    ValueError
        Values out of range, or a speed at which a tooth period needs more than 2000 steps.

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
    maps = _Maps(cut, tip, speed, _steps(cut, tip, speed, steps))
    multiplier = maps.extrapolated if extrapolate else maps.coarse.largest
    return np.array([multiplier(depth) for depth in depths])


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
    """Return the smallest unstable depth of cut at each spindle speed.

    Parameters
    ----------
    cut, tip, steps
        As for `floquet_multiplier`.
    speeds_rpm : array_like
        Spindle speeds `(n,)` in rpm.
    most : float
        Largest depth in m.
    resolution : float, optional
        Distance of the depths of the first search as a share of `most`; it finds unstable depths below stable ones.
    tolerance : float, optional
        Relative accuracy of the limit.

    Returns
    -------
    ndarray
        `(n,)` limits in m; infinite if all depths up to `most` are stable.

    Raises
    ------
    ValueError
        Values out of range.
    """
    owner = "semi_discretised_limit"
    highest = _checks.positive(owner, "most", most, unit="m")
    share = _checks.positive(owner, "resolution", resolution)
    accuracy = _checks.positive(owner, "tolerance", tolerance)
    speeds = np.atleast_1d(_checks.unmasked(owner, "speeds_rpm", speeds_rpm, np.float64))
    depths = np.asarray(highest * np.arange(1, int(np.ceil(1.0 / share)) + 1) * share, dtype=np.float64)
    limits = []
    for speed in speeds:
        rate = _checks.positive(owner, "speeds_rpm", speed, unit="rpm")
        limits.append(_first_crossing(_Maps(cut, tip, rate, _steps(cut, tip, rate, steps)), depths, accuracy))
    return np.array(limits)


def _limit_near(cut: Milling, tip: TipModes, speed_rpm: float, depth: float, most: float) -> float:
    """Return the limit of a draw: the crossing into instability nearest to the nominal limit `depth`.

    It is infinite if the draw is stable at `most`.
    """
    passing = _PassingMap(cut, tip, speed_rpm, _nodes(cut, _steps(cut, tip, speed_rpm, None)))

    def excess(depth: float) -> float:
        return passing.largest(depth) - 1.0

    low = high = min(depth, most)
    if excess(low) > 0.0:
        while excess(low) > 0.0:
            low, high = low / _DEPTH_FACTOR, low
            if low < _SMALLEST_DEPTH * most:
                return 0.0
    else:
        while excess(high) <= 0.0:
            if high >= most:
                return float("inf")
            low, high = high, min(high * _DEPTH_FACTOR, most)
    return _root(excess, low, high, _DRAW_ACCURACY)


def _root(excess: Callable[[float], float], low: float, high: float, accuracy: float) -> float:
    """Return the depth between two others at which a function is zero."""
    return float(scipy.optimize.brentq(excess, low, high, xtol=accuracy * high, maxiter=_EVALUATIONS))


def _steps(cut: Milling, tip: TipModes, speed: float, steps: int | None) -> int:
    if steps is None:
        period = 60.0 / (cut.teeth * speed)
        steps = max(_FEWEST_STEPS, int(np.ceil(_STEPS_PER_WAVE * period * tip.frequency_hz.max())))
    if isinstance(steps, bool) or not isinstance(steps, (int, np.integer)) or not 4 <= steps <= _MOST_STEPS:
        raise ValueError(
            f"semi-discretisation at {speed:g} rpm: steps is {steps!r}, expected a whole number from 4 to "
            f"{_MOST_STEPS}; use stability_lobes at such low speeds"
        )
    return int(steps)


def _first_crossing(maps: _Maps, depths: NDArray[np.float64], accuracy: float) -> float:
    """Return the smallest depth with a multiplier of one, bracketed with coarse steps and refined by extrapolation."""
    spacing, stable = float(depths[0]), 0.0
    for depth in depths.tolist():
        if maps.coarse.largest(depth) > 1.0:
            unstable = depth
            break
        stable = depth
    else:
        return float("inf")

    def excess(depth: float) -> float:
        return maps.extrapolated(depth) - 1.0

    # The extrapolated multiplier may shift the crossing beyond an end of the bracket.
    while excess(unstable) <= 0.0:
        stable, unstable = unstable, unstable + spacing
        if unstable > 2.0 * depths[-1]:
            return float("inf")
    while stable > 0.0 and excess(stable) > 0.0:
        unstable, stable = stable, max(stable - spacing, 0.0)
    # At zero depth the multiplier is below one only by the structural damping.
    if stable == 0.0:
        stable = 1e-9 * unstable
    return _root(excess, stable, unstable, accuracy)


class _Maps:
    """Maps of a tooth period with a number of steps and with twice as many."""

    def __init__(self, cut: Milling, tip: TipModes, speed: float, steps: int) -> None:
        nodes = _nodes(cut, steps)
        halved = np.sort(np.concatenate([nodes, 0.5 * (nodes[1:] + nodes[:-1])]))
        self.coarse, self.fine = _PassingMap(cut, tip, speed, nodes), _PassingMap(cut, tip, speed, halved)

    def extrapolated(self, depth: float) -> float:
        """Return the largest multiplier after Richardson extrapolation."""
        return (4.0 * self.fine.largest(depth) - self.coarse.largest(depth)) / 3.0


def _nodes(cut: Milling, steps: int) -> NDArray[np.float64]:
    """Return the angles of the first tooth at the ends of the steps, over one tooth pitch."""
    pitch = 2.0 * np.pi / cut.teeth
    ends = np.unique([0.0, *np.mod(cut.engagement, pitch), pitch])
    # If the cut spans a whole number of pitches, ends coincide up to rounding.
    ends = ends[np.concatenate([[True], np.diff(ends) > 1e-9 * pitch])]
    ends[-1] = pitch
    pieces = [ends[:1]]
    middles = 0.5 * (ends[1:] + ends[:-1])
    width = 1e-6 * pitch
    idle = ~np.any(cut.directional_mean(middles - width, middles + width), axis=(1, 2))
    for first, last, no_tooth in zip(ends[:-1], ends[1:], idle, strict=True):
        count = 1 if no_tooth else max(_FEWEST_IN_CUT, round(steps * (last - first) / pitch))
        pieces.append(np.linspace(first, last, count + 1)[1:])
    return np.concatenate(pieces)


class _PassingMap:
    """The map of state and past displacements over one tooth period, for any depth."""

    def __init__(self, cut: Milling, tip: TipModes, speed: float, angles: NDArray[np.float64]) -> None:
        self.step = np.diff(angles) * 60.0 / (2.0 * np.pi * speed)
        coefficient = cut.directional_mean(angles[:-1], angles[1:])
        self.shapes = tip.shapes
        # Rigid directions need no past displacements.
        self.used = np.flatnonzero(np.any(tip.shapes != 0.0, axis=0))
        self.force = np.einsum("ki,nij->nkj", tip.shapes, coefficient)  # modal force over displacement and depth
        w = 2.0 * np.pi * tip.frequency_hz
        k = w.size
        self.free = np.zeros((2 * k, 2 * k))
        self.free[:k, k:] = np.eye(k)
        self.free[k:, :k] = -np.diag(w**2)
        self.free[k:, k:] = -np.diag(2.0 * tip.damping_ratio * w)

    def largest(self, depth: float) -> float:
        """Return the largest magnitude of the eigenvalues."""
        state, from_past, from_change = self._pieces(depth)
        k2, p, m = state.shape[1], self.used.size, self.step.size
        shape = np.zeros((p, k2))
        shape[:, : k2 // 2] = self.shapes[:, self.used].T
        # Rows: the current state, and the displacements at the beginning of each step one tooth period before.
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
        """Return the propagators of each step: of the state, of a constant and of a rising past displacement."""
        k2, p = self.free.shape[0], self.used.size
        k = k2 // 2
        generator = np.zeros((self.step.size, k2 + 2 * p, k2 + 2 * p))
        generator[:, :k2, :k2] = self.free
        regenerative = depth * self.force
        generator[:, k:k2, :k] += regenerative @ self.shapes.T
        generator[:, k:k2, k2 : k2 + p] = -regenerative[:, :, self.used]
        generator *= self.step[:, None, None]
        generator[:, k2 : k2 + p, k2 + p :] = np.eye(p)
        whole = scipy.linalg.expm(generator)
        return whole[:, :k2, :k2], whole[:, :k2, k2 : k2 + p], whole[:, :k2, k2 + p :]


def semi_discretised_lobes(
    cut: Milling,
    tip: TipModes,
    *,
    speeds_rpm: ArrayLike,
    most: float,
    draws: Sequence[TipModes] | None = None,
    cuts: Sequence[Milling] | None = None,
    threads: int | None = None,
    progress: Callable[[str], None] | None = None,
) -> Lobes:
    """Return the limit of the depth of cut over spindle speed with the periodic cutting force.

    The limit of each draw is the crossing nearest to that of `tip`; an additional unstable island of the draw below it
    is missed. Each draw takes 10 to 100 ms per speed, longer at low speeds.

    Parameters
    ----------
    cut, tip, speeds_rpm, most
        As for `semi_discretised_limit`.
    draws : sequence of TipModes, optional
        Random modes within the uncertainty (`TipModes.drawn_from_estimates`), at least 20.
    cuts : sequence of Milling, optional
        Random cuts within the uncertainty (`Milling.drawn`), as many as draws, or at least 20 without draws.
    threads : int, optional
        Threads over draws; by default RECEPTANCE_THREADS or all that this process may use.
    progress : callable, optional
        Called with a progress message for each speed.

    Returns
    -------
    Lobes
        Limits, infinite above `most`; chatter frequencies are NaN.

    Raises
    ------
    ValueError
        As `semi_discretised_limit`, or too few draws.

    Examples
    --------
    >>> from receptance.stability import Milling, TipModes, semi_discretised_lobes
    >>> tip = TipModes(frequency_hz=[922.0], damping_ratio=[0.011], shapes=[[0.03993**-0.5, 0.0]])
    >>> cut = Milling(teeth=2, k_t=6e8, k_n=2e8, immersion=0.05)
    >>> lobes = semi_discretised_lobes(cut, tip, speeds_rpm=[25e3], most=5e-3, cuts=cut.drawn(20, k_t=0.1))
    >>> f"{1e3 * lobes.depth[0]:.2f} mm, stable with 90 %: {1e3 * lobes.stable_depth(0.9)[0]:.2f} mm"
    '2.91 mm, stable with 90 %: 2.60 mm'
    """
    owner = "semi_discretised_lobes"
    if not isinstance(cut, Milling):
        raise TypeError(f"{owner}: cut is {type(cut).__name__}, expected Milling; use stability_lobes for turning")
    speeds = np.atleast_1d(_checks.unmasked(owner, "speeds_rpm", speeds_rpm, np.float64))
    pairs = None if draws is None and cuts is None else ensemble(owner, cut, tip, draws, cuts)
    depths, limits = [], []
    with ThreadPoolExecutor(_checks.worker_count(threads)) as pool:
        for number, speed in enumerate(speeds):
            if progress is not None:
                progress(f"semi-discretisation at {speed:g} rpm, {number + 1} of {speeds.size}")
            depth = float(semi_discretised_limit(cut, tip, speeds_rpm=speed, most=most)[0])
            depths.append(depth)
            if pairs is not None:
                rows = [(*pair, float(speed), depth, most) for pair in pairs]
                limits.append(list(pool.map(lambda row: _limit_near(*row), rows)))
    unlimited = int(np.count_nonzero(np.isinf(depths)))
    text = f"at {unlimited} of {speeds.size} speeds all depths up to {1e3 * most:g} mm are stable"
    lobes = Lobes(
        speeds_rpm=speeds,
        depth=np.array(depths),
        chatter_hz=np.full(speeds.size, np.nan),
        cut=cut,
        notes=(text,) if unlimited else (),
    )
    return lobes if pairs is None else with_draws(lobes, np.array(limits).T)
