"""Stability lobe diagrams: limit of the depth of cut over spindle speed by the mean cutting force, with bands."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from receptance import _checks
from receptance._peaks import local_maxima
from receptance.frf.plausibility import check_drive_point
from receptance.report import ACCEPTED, Column, Provenance, Rejection, Result, Results, Table
from receptance.stability.cutting import Milling, Turning
from receptance.stability.tip import beyond_lines

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

    Raises
    ------
    ValueError
        Teeth whose pitch or helix differs. One helix of all teeth changes neither mean force nor delay.

    References
    ----------
    Altintas, Budak 1995, eqs. 15 to 24; for turning Altintas 2012, eqs. 4.16 to 4.20.
    """
    if isinstance(cut, Turning):
        eigenvalues = -cut.k * cut.share * receptance[:, 0, 0][:, None]
    else:
        cut.require_even("mean force")
        mean = cut.teeth * cut.directional_mean(np.array([0.0]), np.array([2.0 * np.pi]))[0]
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
    """Return the lowest critical depth at each spindle speed, and its chatter frequency, `(n_speeds,)` in m and Hz.

    In lobe j a tooth period contains j whole waves and the phase. Between two lines the number of waves and 1/depth are
    linear in frequency. The limit is infinite, the frequency NaN at speeds without chatter.
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


_Cut = TypeVar("_Cut", Milling, Turning, Milling | Turning)
_Tip = TypeVar("_Tip")

_FEWEST_DRAWS = 20
_ERROR_ABOVE = 0.3
"""Standard deviation of the logarithm of a depth that modes above the lines limit: nothing was measured of them."""
_WIDEST = 10.0
"""Ratio of the ends of a band from which its lower end is no recommendation."""
_LEVEL = 0.95
"""Level of the band of the limit."""
_RECOMMENDED = 5
"""Number of recommended speeds of each cut in results."""
_SHOULDER = 0.9
"""Share of the recommended depth that must be stable at the neighbouring speeds of its range."""
_PROMINENCE = 0.2
"""Smallest prominence of a lobe in the logarithm of the depth."""


@dataclass(frozen=True, kw_only=True)
class StableCut:
    """A recommended spindle speed."""

    speed_rpm: float
    """Spindle speed in rpm."""
    depth: float
    """Depth of cut in m that is stable at this speed."""
    probability: float | None
    """Probability that the depth is stable; None for an exact receptance."""
    lowest_rpm: float
    """Lowest speed of the range in which 90 % of the depth are stable with the same probability."""
    highest_rpm: float
    """Highest speed of that range."""
    chatter_hz: float
    """Chatter frequency in Hz above the limit at this speed."""


@dataclass(frozen=True, kw_only=True)
class Lobes(Result):
    """Limit of the depth of cut over spindle speed."""

    speeds_rpm: NDArray[np.float64]
    """Spindle speeds `(n,)` in rpm."""
    depth: NDArray[np.float64]
    """Limit of the stable depth in m `(n,)`; infinite where no line of the receptance can chatter, NaN where the lines
    do not contain the mode of the tip, so that no limit is known."""
    chatter_hz: NDArray[np.float64]
    """Chatter frequency in Hz at the limit `(n,)`; NaN where the limit is not finite."""
    cut: Milling | Turning
    lower: NDArray[np.float64] | None = None
    """`(n,)` lower end of the 95 % band of the limit in m, if draws of receptance or cut are given."""
    upper: NDArray[np.float64] | None = None
    """`(n,)` its upper end."""
    draws: NDArray[np.float64] | None = field(default=None, repr=False)
    """Limits of each draw in m `(m, n)`."""
    name: str = ""
    """Name of the cut."""
    tips: Mapping[str, str | None] = field(default_factory=dict)
    """Source of the receptance of the tip by direction, "x" and "y"; None for a rigid direction."""
    spread: Mapping[str, float] = field(default_factory=dict)
    """Standard deviations of the logarithms of the cutting coefficients."""
    probability: float | None = None
    """Probability of the recommended depths; None if they are the limits."""
    rejection: Rejection = ACCEPTED
    """Why there are no limits, or why they are widened, such as the rejection of the fit that predicts the tip."""
    notes: tuple[str, ...] = ()
    provenance: Provenance = field(default_factory=Provenance, repr=False)
    """Campaign, and versions of the software."""

    heading = "Stability"
    plotted_by = "receptance.stability.figure:draw_lobes"

    @property
    def certain_depth(self) -> NDArray[np.float64]:
        """Depths `(n,)` in m that are stable with `probability`, or the limits if it is None."""
        return self.depth if self.probability is None else self.stable_depth(self.probability)

    @property
    def has_limits(self) -> bool:
        """Whether there is a limit at any speed."""
        return not bool(np.isnan(self.depth).all())

    @property
    def best_cuts(self) -> tuple[StableCut, ...]:
        """Recommended speeds for `probability`, deepest cut first; empty if no speed has a finite limit."""
        if not np.isfinite(self.certain_depth).any():
            return ()
        return self.recommended(probability=self.probability, count=_RECOMMENDED)

    def stable_depth(self, probability: float = 0.95) -> NDArray[np.float64]:
        """Return the depths `(n,)` in m that are stable with a probability.

        Raises
        ------
        ValueError
            No draws, or too few draws for the probability.
        """
        share = _checks.number("Lobes", "probability", probability)
        if not 0.0 < share < 1.0:
            raise ValueError(f"Lobes: probability is {share:g}, expected between 0 and 1")
        draws = self._required_draws()
        fewest = int(np.ceil(1.0 / min(share, 1.0 - share)))
        if len(draws) < fewest:
            raise ValueError(
                f"Lobes: there are {len(draws)} draws, expected at least {fewest} for a probability of {share:g}"
            )
        return np.quantile(draws, 1.0 - share, axis=0, method="lower")

    def stable_probability(self, depth: ArrayLike) -> NDArray[np.float64]:
        """Return the probability that a depth is stable, at each speed.

        Parameters
        ----------
        depth : array_like
            Depths in m: one number, one per speed `(n,)`, or several for all speeds `(k, 1)`.

        Returns
        -------
        ndarray
            `(n,)` or `(k, n)` share of the draws with a higher limit.

        Raises
        ------
        ValueError
            No draws, or depths whose shape does not match the speeds.
        """
        draws = self._required_draws()
        depths = _checks.unmasked("Lobes", "depth", depth, np.float64)
        if depths.ndim > 2 or (depths.ndim and depths.shape[-1] not in (1, self.speeds_rpm.size)):
            raise ValueError(
                f"Lobes: depth has shape {depths.shape}, expected one number, ({self.speeds_rpm.size},) or (k, 1)"
            )
        return np.asarray(np.mean(draws.reshape(len(draws), *(1,) * (depths.ndim == 2), -1) > depths, axis=0))

    def best(self, *, probability: float | None = None) -> tuple[float, float]:
        """Return speed in rpm and depth in m of the deepest stable cut, optionally with a probability.

        Raises
        ------
        ValueError
            No speed has a finite limit, or as `stable_depth`.
        """
        depth, finite = self._finite(probability)
        index = int(np.argmax(np.where(finite, depth, -np.inf)))
        return float(self.speeds_rpm[index]), float(depth[index])

    def recommended(self, *, probability: float | None = 0.95, count: int = 5) -> tuple[StableCut, ...]:
        """Return the speeds with the deepest stable cuts, one per lobe, deepest first.

        Parameters
        ----------
        probability : float or None, optional
            Probability that the depth is stable; None for an exact receptance.
        count : int, optional
            Largest number of speeds.

        Raises
        ------
        ValueError
            As `best`.
        """
        depth, finite = self._finite(probability)
        order = np.argsort(self.speeds_rpm, kind="stable")
        depth = np.where(finite, depth, np.min(depth))[order]
        speeds, chatter = self.speeds_rpm[order], self.chatter_hz[order]
        height = np.log(np.maximum(depth, np.finfo(np.float64).tiny))
        # The padding makes maxima at the ends of the range count as peaks.
        padded = np.pad(height, 1, constant_values=height.min() - 2.0 * _PROMINENCE)
        peaks = local_maxima(padded, _PROMINENCE)[0] - 1
        cuts = []
        for peak in sorted(peaks.tolist(), key=lambda i: -depth[i])[:count]:
            low = np.flatnonzero(depth < _SHOULDER * depth[peak])
            first = int(low[low < peak].max(initial=-1)) + 1
            last = int(low[low > peak].min(initial=depth.size)) - 1
            cut = StableCut(
                speed_rpm=float(speeds[peak]),
                depth=float(depth[peak]),
                probability=probability,
                lowest_rpm=float(speeds[first]),
                highest_rpm=float(speeds[last]),
                chatter_hz=float(chatter[peak]),
            )
            cuts.append(cut)
        return tuple(cuts)

    def tables(self) -> list[Table]:
        """Return the recommended speeds."""
        limits = dict(zip(self.speeds_rpm.tolist(), self.depth.tolist(), strict=True))
        depth = "depth" if self.probability is None else f"stable with {100.0 * self.probability:g} %"
        columns = (
            "cut",
            Column("speed", "rpm", ".0f"),
            Column(depth, "mm", ".3g"),
            Column("limit", "mm", ".3g"),
            Column("90 % of depth", "rpm", ".0f"),
            Column("chatter frequency", "Hz", ".0f"),
        )
        rows = [
            (
                self.name,
                cut.speed_rpm,
                1e3 * cut.depth,
                1e3 * limits[cut.speed_rpm],
                (cut.lowest_rpm, cut.highest_rpm),
                cut.chatter_hz,
            )
            for cut in self.best_cuts
        ]
        return [Table("Recommended speeds", columns, rows).without_empty()] if rows else []

    def sentences(self) -> list[str]:
        """Return a description of the cut, and the depth that is stable at every speed."""
        low, high = self.speeds_rpm.min(), self.speeds_rpm.max()
        probability = "" if self.probability is None else f" with {100.0 * self.probability:g} %"
        text = f"no line limits the depth of cut from {low:.0f} to {high:.0f} rpm; give lines over all modes"
        if np.isnan(self.depth).all():
            text = f"no limit is known from {low:.0f} to {high:.0f} rpm"
        elif np.isfinite(self.certain_depth).any():
            depth = 1e3 * self.certain_depth.min()
            text = f"stable{probability} at every speed from {low:.0f} to {high:.0f} rpm: {depth:.3g} mm"
        return [self.title_of_cut(), f"  {text}"]

    def title_of_cut(self) -> str:
        """Return a description of the cut: name, type and tips."""
        if isinstance(self.cut, Milling):
            kind = "slot" if self.cut.immersion == 1.0 else f"{self.cut.feed}-milling, immersion {self.cut.immersion:g}"
            text = f"{self.cut.teeth} teeth"
            for name, angles in (("pitch", self.cut.pitch_deg), ("helix", np.atleast_1d(self.cut.helix_deg).tolist())):
                text += f", {name} {', '.join(f'{angle:g}' for angle in angles)} deg" if any(angles) else ""
            text += f", {kind}"
        else:
            text = "turning"
        if self.tips:
            text += f"; x: {self.tips['x']}"
        if self.tips and isinstance(self.cut, Milling):
            text += f", y: {self.tips.get('y') or 'rigid'}"
        return f"{self.name}: {text}" if self.name else text

    def data(self) -> dict[str, Any]:
        """Return limits, bands and recommended speeds; depths in m."""
        return {
            "name": self.name,
            "kind": "milling" if isinstance(self.cut, Milling) else "turning",
            "cut": vars(self.cut),
            "spread": self.spread,
            "tips": self.tips,
            "probability": self.probability,
            "draws": 0 if self.draws is None else len(self.draws),
            "always_stable": float(np.min(self.certain_depth)),
            "recommended": self.best_cuts,
            "speeds_rpm": self.speeds_rpm,
            "limit": self.depth,
            "lower": self.lower,
            "upper": self.upper,
            "stable_depth": self.certain_depth,
            "chatter_hz": self.chatter_hz,
        }

    def _required_draws(self) -> NDArray[np.float64]:
        if self.draws is None:
            raise ValueError("Lobes: there are no draws, from which probabilities follow; give draws or cuts")
        return self.draws

    def _finite(self, probability: float | None) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        depth = self.depth if probability is None else self.stable_depth(probability)
        finite = np.isfinite(depth)
        if not finite.any():
            raise ValueError("Lobes: no speed has a finite limit of depth")
        return depth, finite


class Stability(Results[Lobes]):
    """Stability of several cuts, by name.

    Parameters
    ----------
    items : mapping of str to Lobes
        The cuts.
    identified : Result, optional
        Fit from which the tips were predicted.
    provenance, notes : optional
        As in `Results`.
    """

    heading = "Stability"
    key = "cuts"
    plotted_by = "receptance.stability.figure:draw_stability"

    def __init__(
        self,
        items: Mapping[str, Lobes],
        *,
        identified: Result | None = None,
        provenance: Provenance | None = None,
        notes: Sequence[str] = (),
    ) -> None:
        super().__init__(items, provenance=provenance, notes=notes)
        self.identified = identified

    def data(self) -> dict[str, Any]:
        """Return the cuts, and the fit from which the tips were predicted."""
        return {
            "cuts": [{**lobes.data(), "notes": lobes.notes} for lobes in self.values()],
            "identified": None if self.identified is None else self.identified.to_dict(),
        }


def stability_lobes(
    cut: Milling | Turning,
    frequency_hz: ArrayLike,
    receptance: ArrayLike,
    *,
    speeds_rpm: ArrayLike,
    draws: ArrayLike | None = None,
    cuts: Sequence[Milling | Turning] | None = None,
) -> Lobes:
    """Return the limit of the depth of cut over spindle speed from the receptance of the tool tip.

    Milling uses the mean of the cutting force over a tooth pitch (zeroth order), which neglects effects of interrupted
    cutting at small immersion; `semi_discretised_limit` includes them.

    Parameters
    ----------
    cut : Milling or Turning
        The cut.
    frequency_hz : array_like
        Ascending lines `(n,)` in Hz, several within the half-power bandwidth of each resonance; the limit is
        interpolated between them.
    receptance : array_like
        Receptance in m/N: `(n, 2, 2)` in x and y for milling (see `receptance_matrix`), or `(n,)` for one flexible
        direction, for turning that of the chip thickness.
    speeds_rpm : array_like
        Spindle speeds `(k,)`.
    draws : array_like, optional
        Random receptances within the uncertainty, `(m, ...)` with the shape of `receptance`; at least 20.
    cuts : sequence of Milling or Turning, optional
        Random cuts within the uncertainty (`Milling.drawn`), as many as draws, or at least 20 without draws.

    Returns
    -------
    Lobes
        Limits, chatter frequencies, and bands if draws or cuts are given. If the magnitude rises to an end of the
        lines, these do not contain the mode: limits are NaN, and `rejection` has the reason.

    Raises
    ------
    ValueError
        Shapes that do not match, values that are not finite, too few draws, or a receptance that no passive structure
        has at a drive point.

    References
    ----------
    Altintas, Budak 1995, CIRP Annals 44.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance.stability import Milling, TipModes, stability_lobes
    >>> tip = TipModes(frequency_hz=[922.0], damping_ratio=[0.011], shapes=[[0.03993**-0.5, 0.0]])
    >>> f = np.arange(800.0, 1200.0, 0.1)
    >>> lobes = stability_lobes(
    ...     Milling(teeth=2, k_t=6e8, k_n=2e8), f, tip.receptance(f), speeds_rpm=np.arange(4000.0, 30000.0, 20.0)
    ... )
    >>> f"{1e3 * lobes.depth.min():.3f} mm"
    '0.298 mm'
    """
    owner = "stability_lobes"
    lines = checked_lines(owner, frequency_hz)
    speeds = checked_speeds(owner, speeds_rpm)
    matrix = _shaped(owner, "receptance", receptance, lines.size, cut)
    for i in range(matrix.shape[1]):
        reason = check_drive_point(lines, matrix[:, i, i], "receptance").reason
        if reason:
            raise ValueError(f"{owner}: receptance[:, {i}, {i}]: a tip in a cut is a drive point, but {reason}")
    if reasons := beyond_lines(lines, matrix):
        return without_limits(cut, speeds, Rejection(unusable=reasons))
    teeth = cut.teeth if isinstance(cut, Milling) else 1
    depth, chatter = limit_over_speed(teeth, speeds, lines, *critical_depths(cut, lines, matrix))
    plain = Lobes(speeds_rpm=speeds, depth=depth, chatter_hz=chatter, cut=cut, notes=_on_ends(lines, chatter))
    if draws is None and cuts is None:
        return plain
    tips = None
    if draws is not None:
        arrays = list(_checks.unmasked(owner, "draws", draws))
        tips = [_shaped(owner, f"draws[{i}]", array, lines.size, cut) for i, array in enumerate(arrays)]
    limits = [
        limit_over_speed(teeth, speeds, lines, *critical_depths(drawn_cut, lines, tip))[0]
        for drawn_cut, tip in ensemble(owner, cut, matrix, tips, cuts)
    ]
    return with_draws(plain, np.array(limits))


def without_limits(cut: Milling | Turning, speeds_rpm: NDArray[np.float64], rejection: Rejection) -> Lobes:
    """Return lobes whose limits are unknown, NaN, with the reasons."""
    unknown = np.full(speeds_rpm.size, np.nan)
    return Lobes(speeds_rpm=speeds_rpm, depth=unknown, chatter_hz=unknown, cut=cut, rejection=rejection)


def limited_above(lobes: Lobes, depth: float, chatter_hz: float, highest_hz: float, seed: int) -> Lobes:
    """Return lobes with the limit of a mode above the lines, which is the same at every speed.

    Parameters
    ----------
    lobes : Lobes
        Limits by the modes on the lines.
    depth, chatter_hz : float
        Least depth in m at which the mode chatters, and its frequency.
    highest_hz : float
        The highest line.
    seed : int
        Seed of the errors of this depth in the draws. The speeds of its lobes are not known well enough to use them.
    """
    is_lower = lobes.depth > depth
    if lobes.rejection.unusable or (not is_lower.any() and lobes.draws is None):
        return lobes
    limited = replace(
        lobes, depth=np.minimum(lobes.depth, depth), chatter_hz=np.where(is_lower, chatter_hz, lobes.chatter_hz)
    )
    if lobes.draws is not None:
        errors = np.random.default_rng([seed, 3]).standard_normal(len(lobes.draws))
        limited = with_draws(limited, np.minimum(lobes.draws, depth * np.exp(_ERROR_ABOVE * errors)[:, None]))
    if not is_lower.any():
        return limited
    text = (
        f"above the lines, which end at {highest_hz:.0f} Hz, the model chatters from {1e3 * depth:.2g} mm "
        f"({chatter_hz:.0f} Hz): no larger depth is stated; measure up to {1.2 * chatter_hz:.0f} Hz to use deeper lobes"
    )
    return replace(limited, notes=(*limited.notes, text))


def with_rejection(lobes: Lobes, rejection: Rejection) -> Lobes:
    """Return lobes with the rejection of the fit from which their tip was predicted.

    Of a fit that allows for an error of its model, lobes whose band at every speed is so wide that its lower end says
    nothing have no limits.
    """
    reasons = rejection + lobes.rejection
    if not rejection.widened or lobes.draws is None:
        return replace(lobes, rejection=reasons)
    always = lobes.draws.min(axis=1)
    low, high = np.quantile(always, [0.5 - 0.5 * _LEVEL, 0.5 + 0.5 * _LEVEL], method="nearest").tolist()
    if high <= _WIDEST * low:
        return replace(lobes, rejection=reasons)
    text = (
        f"the depth that is stable at every speed is between {1e3 * low:.2g} and {1e3 * high:.2g} mm with the error of "
        f"the model, more than a factor of {_WIDEST:g} apart, so no depth is stated: mend the model, or measure the "
        "tip itself in this set-up"
    )
    named = f"{lobes.name}: {text}" if lobes.name else text
    unknown = without_limits(lobes.cut, lobes.speeds_rpm, Rejection(unusable=(named,)) + reasons)
    return replace(
        unknown, name=lobes.name, tips=lobes.tips, spread=lobes.spread, notes=lobes.notes, provenance=lobes.provenance
    )


def checked_lines(owner: str, frequency_hz: ArrayLike) -> NDArray[np.float64]:
    """Return the lines, which are at least two and real."""
    lines = _checks.frequencies(frequency_hz)
    if lines.dtype.kind == "c" or lines.size < 2:
        raise ValueError(f"{owner}: frequency_hz has {lines.size} {lines.dtype} lines, expected two or more real ones")
    return lines.real


def checked_speeds(owner: str, speeds_rpm: ArrayLike) -> NDArray[np.float64]:
    """Return the spindle speeds `(k,)`, which are positive."""
    speeds = np.atleast_1d(_checks.unmasked(owner, "speeds_rpm", speeds_rpm, np.float64))
    if speeds.ndim != 1 or not speeds.size or not (np.isfinite(speeds) & (speeds > 0.0)).all():
        raise ValueError(f"{owner}: speeds_rpm must be finite and more than zero, one dimension")
    return speeds


def with_draws(lobes: Lobes, draws: NDArray[np.float64]) -> Lobes:
    """Return lobes with a band from the limits of each draw `(m, n)`."""
    low, high = (np.quantile(draws, q, axis=0, method="nearest") for q in (0.5 - 0.5 * _LEVEL, 0.5 + 0.5 * _LEVEL))
    return replace(lobes, lower=low, upper=high, draws=draws)


def ensemble(
    owner: str, cut: _Cut, tip: _Tip, draws: Sequence[_Tip] | None, cuts: Sequence[_Cut] | None
) -> list[tuple[_Cut, _Tip]]:
    """Return pairs of random cuts and tips; without draws the nominal cut or tip is used in all pairs."""
    count = len((cuts if draws is None else draws) or ())
    if count < _FEWEST_DRAWS:
        raise ValueError(f"{owner}: there are {count} draws, expected at least {_FEWEST_DRAWS}")
    if cuts is not None and len(cuts) != count:
        raise ValueError(
            f"{owner}: there are {len(cuts)} cuts and {count} draws of the receptance, expected equal numbers"
        )
    for i, drawn in enumerate(cuts or ()):
        if type(drawn) is not type(cut) or getattr(drawn, "teeth", 1) != getattr(cut, "teeth", 1):
            raise ValueError(f"{owner}: cuts[{i}] is {drawn!r}, expected the type and the number of teeth of {cut!r}")
    return [(cut if cuts is None else cuts[i], tip if draws is None else draws[i]) for i in range(count)]


def _shaped(owner: str, name: str, values: ArrayLike, lines: int, cut: Milling | Turning) -> NDArray[np.complex128]:
    array = _checks.unmasked(owner, name, values, np.complex128)
    size = 2 if isinstance(cut, Milling) else 1
    if array.shape == (lines,):
        matrix = np.zeros((lines, size, size), np.complex128)
        matrix[:, 0, 0] = array
        array = matrix
    if array.shape != (lines, size, size):
        raise ValueError(f"{owner}: {name} has shape {array.shape}, expected {(lines,)} or {(lines, size, size)}")
    if not np.isfinite(array).all():
        line = int(np.argwhere(~np.isfinite(array))[0][0])
        raise ValueError(f"{owner}: {name} is not finite at line {line}")
    return array


def _on_ends(lines: NDArray[np.float64], chatter: NDArray[np.float64]) -> tuple[str, ...]:
    """Return notes if the limit is determined by the ends of the lines; outside of them it may be lower."""
    step = np.median(np.diff(lines))
    at_end = np.isfinite(chatter) & ((chatter < lines[0] + step) | (chatter > lines[-1] - step))
    missing = ~np.isfinite(chatter)
    notes = []
    if at_end.any():
        notes.append(
            f"at {at_end.sum()} of {chatter.size} speeds the chatter frequency is at an end of the lines, {lines[0]:g} "
            f"or {lines[-1]:g} Hz: the limit may be lower; extend the lines"
        )
    if missing.any():
        notes.append(f"at {missing.sum()} of {chatter.size} speeds no line has a stability limit; extend the lines")
    return tuple(notes)
