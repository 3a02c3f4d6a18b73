"""Stability of milling with the periodic cutting force: first-order semi-discretisation.

Within a step the force coefficient is its exact mean over the step and over the depth of cut, and the delayed
displacement is linear; the state then follows from matrix exponentials. The largest eigenvalue of the map over one
period determines stability: the tooth period, or with teeth of different pitch or helix the time in which the cutter
turns into itself. Both approximations are of second order in the step. Steps begin and end where a straight tooth
enters or leaves the cut, so halving them reduces the error by the factor 4, and Richardson extrapolation gives fourth
order. Each tooth has its own delay; delayed displacements between steps are interpolated by cubic polynomials. Where
the helix differs, delays vary along the edges, which are divided into slices so short that a delay varies by no more
than a step in each.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from receptance import _checks, units
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
_STEPS_PER_DELAY = 6
"""Smallest number of steps in the shortest delay between two teeth."""
_SAME = 1e-9
"""Angles that differ by less, relative to the tooth pitch, are the same."""
_CLOSEST = float(np.deg2rad(units.PITCH.least))
"""Smallest delay between two edges, in rad."""


def floquet_multiplier(
    cut: Milling,
    tip: TipModes,
    *,
    speed_rpm: float,
    depth: ArrayLike,
    steps: int | None = None,
    extrapolate: bool = True,
) -> NDArray[np.float64]:
    """Return the largest magnitude of the Floquet multipliers over one period; below one the cut is stable.

    The period is the tooth period, or with teeth that differ in pitch or helix the time in which the cutter turns into
    itself, at most a revolution.

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
        Steps per mean tooth period; by default 20 per period of the highest mode, at least 24, more for unequal teeth.
    extrapolate : bool, optional
        Whether to extrapolate from `steps` and twice as many steps to fourth order.

    Returns
    -------
    ndarray
        `(n,)` magnitudes.

    Raises
    ------
    ValueError
        Values out of range, a speed at which a tooth period needs more than 2000 steps, or edges of different helix
        that come closer than 5 degrees within the depth.

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
    period = _PeriodMap(cut, tip, speed_rpm, _nodes(cut, _steps(cut, tip, speed_rpm, None)))

    def excess(depth: float) -> float:
        return period.largest(depth) - 1.0

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
        of_delay = _STEPS_PER_DELAY * 2.0 * np.pi / (cut.teeth * cut.pitch.min())
        steps = max(_FEWEST_STEPS, int(np.ceil(max(of_delay, _STEPS_PER_WAVE * period * tip.frequency_hz.max()))))
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
    """Maps of a period with a number of steps and with twice as many."""

    def __init__(self, cut: Milling, tip: TipModes, speed: float, steps: int) -> None:
        nodes = _nodes(cut, steps)
        halved = np.sort(np.concatenate([nodes, 0.5 * (nodes[1:] + nodes[:-1])]))
        self.coarse, self.fine = _PeriodMap(cut, tip, speed, nodes), _PeriodMap(cut, tip, speed, halved)

    def extrapolated(self, depth: float) -> float:
        """Return the largest multiplier after Richardson extrapolation."""
        return (4.0 * self.fine.largest(depth) - self.coarse.largest(depth)) / 3.0


def _teeth_in_period(cut: Milling) -> int:
    """Return the number of teeth after which pitch and helix repeat."""
    pattern = np.stack([cut.pitch, cut.twist])
    return next(
        n for n in range(1, cut.teeth + 1) if cut.teeth % n == 0 and np.allclose(np.roll(pattern, n, axis=1), pattern)
    )


def _angles(cut: Milling) -> NDArray[np.float64]:
    """Return the angles of the lower ends of the edges when the first one is at zero; the others follow it."""
    return np.asarray(-np.concatenate([[0.0], np.cumsum(cut.pitch)[:-1]]))


def _nodes(cut: Milling, steps: int) -> NDArray[np.float64]:
    """Return the angles of the cutter at the ends of the steps, over one period."""
    mean = 2.0 * np.pi / cut.teeth
    period = float(cut.pitch[: _teeth_in_period(cut)].sum())
    enters, leaves = cut.engagement
    ends = np.mod(np.add.outer([enters, leaves], -_angles(cut)).ravel(), period)
    ends = np.unique([0.0, *ends, period])
    # Where several teeth enter or leave at once, ends coincide up to rounding.
    ends = ends[np.concatenate([[True], np.diff(ends) > _SAME * mean])]
    ends[-1] = period
    # Without a force one step is exact, but displacements between steps are interpolated from close ones only.
    straight = cut.is_even and not cut.twist.any()
    middles = 0.5 * (ends[1:] + ends[:-1])
    idle = ~np.any(cut.directional(np.add.outer(middles, _angles(cut))), axis=(1, 2, 3))
    pieces = [ends[:1]]
    for first, last, no_tooth in zip(ends[:-1], ends[1:], idle, strict=True):
        fewest = int(np.ceil(_FEWEST_IN_CUT * (last - first) / min(leaves - enters, mean) - _SAME))
        count = 1 if no_tooth and straight else max(fewest, round(steps * (last - first) / mean), 1)
        pieces.append(np.linspace(first, last, count + 1)[1:])
    return np.concatenate(pieces)


@dataclass(frozen=True)
class _Delays:
    """The delayed displacements at a depth of cut.

    `angle` are the different delays `(d,)` in rad, `force` is the coefficient of each in each step, `(d, n, 2, 2)` in
    N/m^2.
    """

    angle: NDArray[np.float64]
    force: NDArray[np.float64]


def _delays(cut: Milling, nodes: NDArray[np.float64], depth: float) -> _Delays:
    """Return the delays of all edges, which are divided into slices where a delay varies along an edge."""
    twist, behind = cut.twist, np.roll(cut.pitch, 1)
    # The edge in front of the first one is the last one.
    closing = twist - np.roll(twist, 1)
    nearest = behind + np.minimum(closing * depth, 0.0)
    if (nearest < _CLOSEST).any():
        close = int(np.argmin(nearest))
        at = 1e3 * (behind[close] - _CLOSEST) / -closing[close]
        raise ValueError(
            f"semi-discretisation at a depth of {1e3 * depth:.3g} mm: edges {close or cut.teeth} and {close + 1} come "
            f"closer than {np.rad2deg(_CLOSEST):g} degrees {at:.3g} mm from the tip, expected smaller depths or other "
            "helix angles"
        )
    step = float(np.diff(nodes).max())
    counts = np.maximum(1, np.ceil(np.abs(closing) * depth / step - _SAME)).astype(np.intp)
    tooth = np.repeat(np.arange(cut.teeth), counts)
    share = 1.0 / counts[tooth]
    low = depth * share * np.concatenate([np.arange(count) for count in counts])
    start = (_angles(cut)[tooth] - twist[tooth] * low)[:, None] + nodes
    lag = (twist[tooth] * depth * share)[:, None]
    force = cut.directional_mean(start[:, :-1], start[:, 1:], lag) * share[:, None, None, None]
    angle = behind[tooth] + closing[tooth] * (low + 0.5 * depth * share)
    order = np.argsort(angle, kind="stable")
    angle, force = angle[order], force[order]
    first = np.flatnonzero(np.diff(angle, prepend=-1.0) > _SAME * 2.0 * np.pi / cut.teeth)
    return _Delays(angle[first], np.add.reduceat(force, first))


@dataclass(frozen=True)
class _Past:
    """How past displacements act in each step of a period, over the depth of cut, with p flexible directions.

    The displacements are those at the `before` nodes before the period and at its own, one after the other. Their
    forces at the beginning and at the end of the steps are products with `begins` and `ends`, `(n, p, nodes * p)` in
    N/m^2, which are zero outside the slices `used`; `present` is the force of the present ones, `(n, p, p)`.
    """

    before: int
    begins: NDArray[np.float64]
    ends: NDArray[np.float64]
    used: list[slice]
    present: NDArray[np.float64]


def _weights(
    nodes: NDArray[np.float64], at: NDArray[np.float64], latest: NDArray[np.intp]
) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Return four neighbouring nodes and their weights in the cubic interpolation at angles, `(..., 4)`.

    No node is later than `latest`; at a node it has the whole weight.
    """
    size = nodes.size
    first = np.clip(np.searchsorted(nodes, at, "right") - 2, 0, np.minimum(latest, size - 1) - 3)
    chosen = first[..., None] + np.arange(4)
    places = nodes[chosen]
    away = at[..., None] - places
    near = np.abs(away) < _SAME
    weights = np.ones(chosen.shape)
    for i, j in itertools.permutations(range(4), 2):
        weights[..., i] *= away[..., j] / (places[..., i] - places[..., j])
    return chosen, np.where(near.any(axis=-1, keepdims=True), near, weights)


class _PeriodMap:
    """The map of state and past displacements over one period, for any depth."""

    def __init__(self, cut: Milling, tip: TipModes, speed: float, nodes: NDArray[np.float64]) -> None:
        self.cut, self.nodes = cut, nodes
        self.step = np.diff(nodes) * 60.0 / (2.0 * np.pi * speed)
        # Rigid directions need no past displacements.
        self.used = np.flatnonzero(np.any(tip.shapes != 0.0, axis=0))
        self.shapes = tip.shapes[:, self.used]
        w = 2.0 * np.pi * tip.frequency_hz
        k = w.size
        self.free = np.zeros((2 * k, 2 * k))
        self.free[:k, k:] = np.eye(k)
        self.free[k:, :k] = -np.diag(w**2)
        self.free[k:, k:] = -np.diag(2.0 * tip.damping_ratio * w)
        # Angles and delays of straight edges are the same at all depths.
        self._straight = None if cut.twist.any() else self._past_at(0.0)

    def largest(self, depth: float) -> float:
        """Return the largest magnitude of the eigenvalues."""
        past = self._straight or self._past_at(depth)
        before, begins, ends = past.before, depth * past.begins, depth * past.ends
        state, from_force, from_change = self._propagators(depth * past.present)
        k2, p, m = state.shape[1], self.used.size, self.step.size
        shape = np.zeros((p, k2))
        shape[:, : k2 // 2] = self.shapes.T
        # Columns: the state at the start, and the displacements at the nodes before it.
        size = k2 + before * p
        now = np.eye(size)[:k2]
        history = np.zeros(((before + m + 1) * p, size))
        history[: before * p, k2:] = np.eye(before * p)
        history[before * p : (before + 1) * p] = shape @ now
        for i in range(m):
            used = past.used[i]
            begin, end = begins[i][:, used] @ history[used], ends[i][:, used] @ history[used]
            now = state[i] @ now - from_force[i] @ begin - from_change[i] @ (end - begin)
            row = (before + i + 1) * p
            history[row : row + p] = shape @ now
        after = np.concatenate([now, history[m * p : (before + m) * p]])
        return float(np.abs(np.linalg.eigvals(after)).max())

    def _past_at(self, depth: float) -> _Past:
        """Return how past displacements act at a depth of cut."""
        delays = _delays(self.cut, self.nodes, depth)
        force = delays.force[:, :, self.used[:, None], self.used]
        period, m, p = self.nodes[-1], self.step.size, self.used.size
        turns = int(np.ceil((delays.angle[-1] + self.nodes[1]) / period)) + 1
        nodes = np.concatenate([*(self.nodes[:-1] - n * period for n in range(turns, 0, -1)), self.nodes])
        latest = turns * m + np.arange(m)
        both = [_weights(nodes, self.nodes[side : m + side] - delays.angle[:, None], latest) for side in (0, 1)]
        first, last = (
            np.array([edge(np.where(weights != 0.0, chosen, none), axis=(0, 2)) for chosen, weights in both])
            for edge, none in ((np.min, nodes.size), (np.max, -1))
        )
        needed = int(first.min())
        before = turns * m - needed
        products = []
        for chosen, weights in both:
            product = np.zeros((m, before + m + 1, p, p))
            for i in range(4):
                rows, columns = np.nonzero(weights[..., i])
                terms = weights[rows, columns, i, None, None] * force[rows, columns]
                # A step meets a node with several delays.
                np.add.at(product, (columns, chosen[rows, columns, i] - needed), terms)
            products.append(np.moveaxis(product, 2, 1).reshape(m, p, -1))
        limits = zip((first.min(axis=0) - needed) * p, (last.max(axis=0) - needed + 1) * p, strict=True)
        used = [slice(int(low), int(high)) for low, high in limits]
        return _Past(before, products[0], products[1], used, force.sum(axis=0))

    def _propagators(
        self, force: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Return the propagators of each step: of the state, of a constant force and of a rising one."""
        k2, p = self.free.shape[0], self.used.size
        k = k2 // 2
        generator = np.zeros((self.step.size, k2 + 2 * p, k2 + 2 * p))
        generator[:, :k2, :k2] = self.free
        generator[:, k:k2, :k] += self.shapes @ force @ self.shapes.T
        generator[:, k:k2, k2 : k2 + p] = self.shapes
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
