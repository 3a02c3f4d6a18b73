"""Which measurement next: what each of some candidates is expected to tell, before it is taken."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from receptance.errors import ReceptanceError
from receptance.identification.candidates import Candidate, FrequencyTarget, ReceptanceTarget
from receptance.identification.expectations import Expectation, NextMeasurement, RankedCandidate
from receptance.identification.information import Point, Surroundings, Target, deviation, joined, widened
from receptance.identification.observations import MeasuredFRF
from receptance.identification.profiles import Profile

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.identification.result import Identification

__all__ = ["next_measurement"]

_WIDE = 0.1
"""Half an interval, as log10 or as a share of the range of the bounds, beyond which a profile is taken: a quarter of
the value."""
_QUANTILES = (0.1, 0.3, 0.5, 0.7, 0.9)
"""Of the likelihood along a profile: points of equal weight."""


def next_measurement(
    found: Identification,
    candidates: Candidate | Sequence[Candidate],
    *,
    targets: Target | Sequence[Target] | None = None,
    level: float = 0.95,
    profiles: Mapping[str, Profile] | None = None,
    progress: Callable[[str], None] | None = None,
) -> NextMeasurement:
    """Rank measurements that could be taken by how well the targets are expected to be known with them.

    The information matrix of a candidate, from the derivatives of what it would observe, is added to that of the
    measurements taken. Errors that it brings, those of a new clamping say, are new unknowns with their priors, and what
    has the same name is one error in both.

    Where all parameters are well known this is done at the fit. A parameter whose interval is wide or open has a
    likelihood that is far from Gaussian, and the information at one point misleads: then it is done at points spread
    along its profile, in parts of equal likelihood within its bounds, and averaged as the mean of the logarithm of the
    deviation. The result says so, and how much the points differ.

    Parameters
    ----------
    found : Identification
        What is known now.
    candidates : Candidate or sequence of Candidate
        What could be measured.
    targets : str, FrequencyTarget, ReceptanceTarget or a sequence of them, optional
        What is to be known better: names of unknowns, or predictions. By default all unknowns but errors.
    level : float, optional
        Level of the intervals.
    profiles : mapping of str to Profile, optional
        From `found.profiles()`; those that are needed and not among them are computed.
    progress : callable, optional
        Is told what is being done.

    Returns
    -------
    NextMeasurement
        The candidates, the best first, with the interval of each target now and as expected.

    Raises
    ------
    TypeError, ValueError
        No candidate, two of one label, an unknown target, percentages, which are no likelihood, or a candidate that
        has none of the unknowns.
    ReceptanceError
        A candidate's model has no value where the fit is.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance import STEEL, Assembly, MeasuredFrequencies, Part, PointJoint, Segment, Unknown, identify
    >>> from receptance.identification import Candidate, next_measurement
    >>> bar = Segment(length=0.1, outer_diameter=0.02, material=STEEL)
    >>> pair = Assembly([Part([bar], name="tool"), PointJoint(k_y=1e8, k_theta=1e5), Part([bar], name="holder")])
    >>> modes = MeasuredFrequencies(
    ...     assembly=pair, frequency_hz=pair.natural_frequencies(2e4)[:3], standard_deviation_hz=5.0
    ... )
    >>> found = identify(modes, Unknown(address="joint.k_theta", lower=1e3, upper=1e7))
    >>> lines = np.linspace(100.0, 5000.0, 200)
    >>> better = next_measurement(found, [
    ...     Candidate(label="tip FRF", assembly=pair, frequency_hz=lines, standard_deviation=0.02),
    ...     Candidate(label="first mode again", assembly=pair, modes=(1,), standard_deviation_hz=5.0),
    ... ])
    >>> better.best.label
    'tip FRF'
    """
    menu = _candidates(candidates)
    if "percent" in found.units and any(isinstance(o, MeasuredFRF) for o in found.task.observed):
        raise ValueError(
            "the percentage objective is no likelihood, so it says nothing of what more data would bring: identify "
            "with the objective 'log'"
        )
    wanted = _targets(targets, found)
    known = Surroundings(found)
    reach = found.reach(level)
    say = progress or (lambda _: None)
    taken = _profiles(found, known, wanted, reach, level, dict(profiles or {}), say)
    points, notes = _points(known, taken)
    say(f"weighing {len(menu)} candidates at {len(points)} points")
    now = _Now(known, points, wanted, taken, reach)
    ranking = []
    for candidate in menu:
        say(f"weighing {candidate.label}")
        expected = _expected(known, candidate, points, wanted, now)
        shrink = float(np.exp(np.mean([np.log(max(one.shrink, 1e-300)) for one in expected.values()])))
        ranking.append(
            RankedCandidate(
                candidate=candidate, expected=expected, shrink=shrink, score=-np.log(shrink) / candidate.cost
            )
        )
    ranking.sort(key=lambda one: -one.score)
    if len({one.candidate.cost for one in ranking}) > 1:
        notes.append("the ranking is by what is gained for the cost")
    if found.advice:
        notes.append(f"the fit has advice of its own: {found.advice[0]}")
    return NextMeasurement(
        ranking=tuple(ranking),
        targets=tuple(ranking[0].expected),
        level=level,
        points=tuple(known.named(point) for point in points),
        profiled=tuple(taken),
        notes=tuple(notes),
    )


def _candidates(candidates: Candidate | Sequence[Candidate]) -> tuple[Candidate, ...]:
    menu = (candidates,) if isinstance(candidates, Candidate) else tuple(candidates)
    if not menu:
        raise ValueError("candidates is empty, expected at least one Candidate")
    for index, one in enumerate(menu):
        if not isinstance(one, Candidate):
            raise TypeError(f"candidates[{index}] is {one!r}, expected a Candidate")
    labels = [one.label for one in menu]
    if double := sorted({label for label in labels if labels.count(label) > 1}):
        raise ValueError(f"two candidates are called {double[0]!r}, expected different labels")
    return menu


def _targets(targets: Target | Sequence[Target] | None, found: Identification) -> tuple[Target, ...]:
    if targets is None:
        return tuple(name for name in found.addresses if name not in found.errors)
    given = (targets,) if isinstance(targets, (str, FrequencyTarget, ReceptanceTarget)) else tuple(targets)
    if not given:
        raise ValueError("targets is empty, expected at least one")
    for one in given:
        if isinstance(one, str) and one not in found.values:
            raise ValueError(f"the target {one!r} was not identified, only {', '.join(found.addresses)}")
        if not isinstance(one, (str, FrequencyTarget, ReceptanceTarget)):
            raise TypeError(f"the target {one!r} is no name, FrequencyTarget or ReceptanceTarget")
    return given


def _profiles(
    found: Identification,
    known: Surroundings,
    wanted: tuple[Target, ...],
    reach: float,
    level: float,
    given: dict[str, Profile],
    say: Callable[[str], None],
) -> dict[str, Profile]:
    """Return the profiles of what is wide, computed where they are not there."""
    named = [one for one in wanted if isinstance(one, str) and one not in found.errors]
    if len(named) < len(wanted):
        named = [name for name in found.addresses if name not in found.errors]
    low, high = found.task.variables.limits
    wide = []
    for name in named:
        i = found.addresses.index(name)
        whole = float(high[i] - low[i])
        half = reach * float(np.sqrt(found.covariance[i, i]))
        size = half if found.unknowns[i].scale == "log" else half / whole
        x = known.variables.from_values(known.values)[known.names.index(name)]
        edge = min(x - low[i], high[i] - x) <= 1e-3 * whole
        if not size < _WIDE or edge:
            wide.append(name)
    missing = [name for name in wide if name not in given]
    if missing:
        given |= found.profiles(missing, level=level, progress=say)
    return {name: given[name] for name in wide}


def _points(known: Surroundings, taken: Mapping[str, Profile]) -> tuple[list[Point], list[str]]:
    """Return the fit, or points spread along the profiles of what is wide."""
    at_fit = known.variables.from_values(known.values)
    if not taken:
        return [known.point(at_fit, 1.0)], []
    found, lost = [], 0
    for name, profile in taken.items():
        for path in _spread_along(known.names.index(name), profile):
            try:
                found.append(known.point(path, 1.0))
            except ReceptanceError:
                lost += 1
    if not found:
        found = [known.point(at_fit, 1.0)]
    notes = [
        f"{', '.join(taken)} {'is' if len(taken) == 1 else 'are'} known so little that the information at one point "
        f"would mislead: it was taken at {len(found)} points spread along the profile"
        f"{'' if len(taken) == 1 else 's'}, within the bounds of the fit, and averaged"
    ]
    if lost:
        notes.append(f"the model has no value at {lost} more points")
    return [Point(one.x, 1.0 / len(found), one.information) for one in found], notes


def _spread_along(index: int, profile: Profile) -> list[NDArray[np.float64]]:
    """Return points of a profile in parts of equal likelihood, other variables as they were fitted there."""
    paths = profile.paths
    at = paths[:, index]
    if at.size < 2 or at[-1] == at[0]:
        return [paths[int(np.argmin(profile.rise))]]
    fine = np.linspace(at[0], at[-1], 2001)
    # Roots of the rise go nearly straight between the points.
    density = np.exp(-0.5 * np.interp(fine, at, np.sqrt(profile.rise)) ** 2)
    share = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]))])
    chosen = np.interp(np.array(_QUANTILES) * share[-1], share, fine)
    found = []
    for value in chosen:
        right = int(np.clip(np.searchsorted(at, value), 1, at.size - 1))
        part = (value - at[right - 1]) / (at[right] - at[right - 1])
        found.append((1.0 - part) * paths[right - 1] + part * paths[right])
    return found


class _Now:
    """What is known of the targets before anything is measured."""

    def __init__(
        self,
        known: Surroundings,
        points: Sequence[Point],
        wanted: tuple[Target, ...],
        taken: Mapping[str, Profile],
        reach: float,
    ) -> None:
        self.reach = reach
        self.values: dict[str, float] = {}
        self.deviations: dict[str, float] = {}
        self.intervals: dict[str, tuple[float, float]] = {}
        self.scales: dict[str, str] = {}
        fit = Point(known.variables.from_values(known.values), 1.0, np.eye(len(known.names)))
        for target in wanted:
            names, _, values, _ = known.target(target, fit)
            logs = dict.fromkeys(names, 0.0)
            for point in points:
                _, gradients, _, own = known.target(target, point)
                matrix = joined(point.information, np.zeros((0, 0)), (), own)
                for name, gradient in zip(names, gradients, strict=True):
                    logs[name] += point.weight * np.log(max(deviation(matrix, gradient), 1e-300))
            for name, value in zip(names, values, strict=True):
                self._keep(name, target, float(value), float(np.exp(logs[name])), known, taken)

    def _keep(
        self,
        name: str,
        target: Target,
        value: float,
        spread: float,
        known: Surroundings,
        taken: Mapping[str, Profile],
    ) -> None:
        scale = "linear"
        if isinstance(target, str):
            i = known.names.index(name)
            scale = str(known.variables.unknowns[i].scale)
            value = float(known.values[i])
            if name in taken:
                low, high = known.variables.limits[:, i]
                ends = taken[name]
                to = np.log10 if scale == "log" else np.asarray
                low = low if ends.lower_open else float(to(ends.lower))
                high = high if ends.upper_open else float(to(ends.upper))
                spread = (high - low) / (2.0 * self.reach)
                self.intervals[name] = (ends.lower, ends.upper)
        self.values[name], self.deviations[name], self.scales[name] = value, spread, scale
        self.intervals.setdefault(name, self.about(name, spread))

    def about(self, name: str, spread: float) -> tuple[float, float]:
        """Return the interval about the value of now."""
        value, half = self.values[name], self.reach * spread
        if self.scales[name] == "log":
            return value / 10.0**half, value * 10.0**half
        return value - half, value + half


def _expected(
    known: Surroundings, candidate: Candidate, points: Sequence[Point], wanted: tuple[Target, ...], now: _Now
) -> dict[str, Expectation]:
    """Return what is expected of each target with a candidate, from all points."""
    spreads: dict[str, list[float]] = {name: [] for name in now.values}
    open_share = dict.fromkeys(now.values, 0.0)
    low, high = known.variables.limits
    for point in points:
        rows, fresh = known.rows(candidate, point)
        if not np.any(rows[:, : len(known.names)]):
            raise ValueError(f"{candidate!r} has none of the identified parameters {', '.join(known.found.addresses)}")
        for target in wanted:
            names, gradients, _, own = known.target(target, point)
            errors = list(dict.fromkeys([*fresh, *own]))
            matrix = joined(point.information, rows, fresh, errors)
            for name, gradient in zip(names, gradients, strict=True):
                after = deviation(matrix, widened(gradient, len(known.names), own, errors))
                spreads[name].append(after)
                if isinstance(target, str):
                    i = known.names.index(name)
                    half = now.reach * after
                    if name not in known.errors and (point.x[i] + half > high[i] or point.x[i] - half < low[i]):
                        open_share[name] += point.weight
    return {name: _expectation(name, np.array(spreads[name]), open_share[name], now) for name in now.values}


def _expectation(name: str, spreads: NDArray[np.float64], open_share: float, now: _Now) -> Expectation:
    typical = float(np.exp(np.mean(np.log(np.maximum(spreads, 1e-300)))))
    lower, upper = now.about(name, typical)
    # What is known already of a side where the likelihood is steep stays known.
    lower, upper = max(lower, now.intervals[name][0]), min(upper, now.intervals[name][1])
    return Expectation(
        name=name,
        value=now.values[name],
        scale=now.scales[name],
        now=now.intervals[name],
        lower=lower,
        upper=upper,
        deviation=typical,
        deviation_now=now.deviations[name],
        deviations=tuple(spreads.tolist()),
        stays_open=open_share,
    )
