"""The choice of the next measurement: the intervals that are expected with each of several candidates."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from receptance import _checks
from receptance._text import first_of
from receptance.errors import ReceptanceError
from receptance.fit.covariance import confidence_multiplier
from receptance.fit.likelihood import Profile, profile_likelihoods, require_likelihood
from receptance.fit.observation import Observation, altered
from receptance.fit.predictor import Predictor
from receptance.fit.result import Identification
from receptance.predict.gain import SMALLEST, Target, data_of, expected_deviations, names_of, predictors_at, worth
from receptance.predict.menu import Candidate, Menu
from receptance.report import ACCEPTED, Column, Provenance, Rejection, Result, Table
from receptance.report.table import Cell, Interval, percent

_WIDE = 0.1
"""Half width of an interval from which a profile is computed: in log10, or as a share of the range of the bounds."""
_EDGE = 1e-3
"""Distance from a bound, as a share of the range, up to which a parameter counts as at the bound."""
_EVALUATIONS_OF_PROFILES = 1000
"""Evaluations of the model after which no further profile begins; a parameter without one is taken at the fit."""
_QUANTILES = (0.1, 0.3, 0.5, 0.7, 0.9)
"""Quantiles of the likelihood along a profile at which the information is taken, with equal weights."""


@dataclass(frozen=True, kw_only=True)
class Expectation:
    """The present interval of a target, and the one that is expected with one more measurement."""

    name: str
    """Name of a parameter, of a natural frequency or of the logarithm of a receptance."""
    value: float
    """Present value in SI units or Hz; zero for the logarithm of a receptance."""
    scale: str
    """Whether intervals are symmetric in the logarithm."""
    now: tuple[float, float]
    """Present interval; infinite or zero at an open side."""
    lower: float
    """Lower end of the expected interval about the present value, not beyond the present interval."""
    upper: float
    """Its upper end."""
    deviation: float
    """Expected standard deviation, of log10 of the value where the scale is "log"."""
    deviation_now: float
    """The present one."""
    deviations: tuple[float, ...]
    """Expected standard deviation at each point, if the true values were there; `deviation` is their geometric mean."""
    stays_open: float
    """Share of these points at which the interval would still reach the bounds of the fit."""

    @property
    def range(self) -> tuple[float, float]:
        """The 10 % and 90 % quantiles of the deviations: the dependence of the expectation on the true values."""
        low, high = np.quantile(self.deviations, [0.1, 0.9])
        return float(low), float(high)

    @property
    def shrink(self) -> float:
        """Expected standard deviation as a share of the present one."""
        return self.deviation / self.deviation_now if self.deviation_now > 0.0 else 1.0

    @property
    def percent(self) -> float:
        """Half width of the expected interval, in percent of the value."""
        if self.scale == "log":
            return 100.0 * (self.upper / self.value - 1.0)
        whole = abs(self.value) or 1.0
        return 100.0 * 0.5 * (self.upper - self.lower) / whole


@dataclass(frozen=True, kw_only=True)
class RankedCandidate:
    """A candidate and its expected intervals."""

    candidate: Candidate
    """The measurement."""
    expected: dict[str, Expectation]
    """By target."""
    shrink: float
    """Geometric mean over the targets of the expected standard deviation as a share of the present one."""
    score: float
    """The worth, -ln(shrink) / sqrt(cost); the ranking is by this."""

    @property
    def label(self) -> str:
        """Label of the candidate."""
        return self.candidate.label


@dataclass(frozen=True, kw_only=True)
class NextMeasurement(Result):
    """Ranked candidates and the intervals that are expected with them."""

    ranking: tuple[RankedCandidate, ...]
    """The candidates, the best one first."""
    targets: tuple[str, ...]
    """Names of the targets."""
    level: float
    """Level of all intervals."""
    points: tuple[dict[str, float], ...]
    """Values of the unknowns of the fit, in SI units by name, at which the information was taken and averaged."""
    profiled: tuple[str, ...]
    """Parameters with intervals so wide that these points lie along their profiles."""
    notes: tuple[str, ...]
    rejection: Rejection = ACCEPTED
    """Rejection of the fit; false if it is accepted."""
    provenance: Provenance = field(default_factory=Provenance, repr=False)

    heading = "Next measurement"
    plotted_by = "receptance.predict.figure:draw_next_measurement"

    @property
    def best(self) -> RankedCandidate:
        """The first of the ranking."""
        return self.ranking[0]

    def tables(self) -> list[Table]:
        """Return the ranking, and for each target the present interval and that with each candidate."""
        priced = len({one.candidate.cost for one in self.ranking}) > 1
        ranking = Table(
            "Candidates, the best first",
            (
                Column("", form="d"),
                "candidate",
                "assembly",
                Column("deviations expected", "% of now", ".3g"),
                Column("cost", form="g"),
            ),
            [
                (
                    place,
                    one.label,
                    _configuration(one.candidate.observation),
                    100.0 * one.shrink,
                    one.candidate.cost if priced else None,
                )
                for place, one in enumerate(self.ranking, start=1)
            ],
        ).without_empty()
        rows: list[list[Cell]] = []
        for name in self.targets:
            first = self.ranking[0].expected[name]
            rows.append([name, "now", _ends(first, first.now), None, None])
            for one in self.ranking:
                e = one.expected[name]
                half = e.percent if e.value != 0.0 else 100.0 * e.deviation
                share = 100.0 * e.stays_open if e.stays_open else None
                rows.append([None, f"with {one.label}", _ends(e, (e.lower, e.upper)), half, share])
        columns = (
            "target",
            "measured",
            Column(f"{100.0 * self.level:g} % interval, SI units", form=".5g"),
            Column("half of it", "%", ".2g"),
            Column("chance that it\nstays open", "%", ".0f"),
        )
        return [ranking, Table("Intervals now and as expected, about the value of now", columns, rows).without_empty()]

    def sentences(self) -> list[str]:
        """Return the best candidate."""
        return [f"best: {self.best.label}; deviations to {percent(self.best.shrink, 3)} of now."]

    def data(self) -> dict[str, Any]:
        """Return the ranking with the expected intervals."""
        return {
            "targets": self.targets,
            "level": self.level,
            "points": len(self.points),
            "profiled": self.profiled,
            "ranking": [
                {
                    "candidate": one.label,
                    "cost": one.candidate.cost,
                    "shrink": one.shrink,
                    "score": one.score,
                    "expected": {
                        name: {
                            "value": e.value,
                            "now": e.now,
                            "expected": (e.lower, e.upper),
                            "deviation_now": e.deviation_now,
                            "deviation": e.deviation,
                            "deviation_10_90": e.range,
                            "scale": e.scale,
                            "stays_open": e.stays_open,
                        }
                        for name, e in one.expected.items()
                    },
                }
                for one in self.ranking
            ],
        }

    def __repr__(self) -> str:
        order = [f"{one.label} ({percent(one.shrink, 3)})" for one in self.ranking]
        return f"NextMeasurement({first_of(order, ' > ')})"


def next_measurement(
    found: Identification,
    candidates: Candidate | Sequence[Candidate] | None = None,
    *,
    targets: Target | Sequence[Target] | None = None,
    level: float = 0.95,
    profiles: Mapping[str, Profile] | None = None,
    progress: Callable[[str], None] | None = None,
) -> NextMeasurement:
    """Rank hypothetical measurements by the intervals of the targets that are expected with them.

    Each candidate is simulated with the fitted model, and the derivatives of its residuals are added to those of the
    fit. Its own errors, those of a new clamping for example, are new unknowns with their priors. Errors of one name are
    one error.

    Where all parameters are well known this is done at the fit. The likelihood of a parameter whose interval is wide or
    open is far from Gaussian. The information is then taken at several points along its profile, which divide the
    likelihood within the bounds into equal parts, and the logarithms of the standard deviations are averaged. The
    result reports this, and the differences between the points.

    Parameters
    ----------
    found : Identification
        The fit.
    candidates : Candidate or sequence of Candidate, optional
        The measurements to rank; by default those of the `Menu` that can be made on what was measured.
    targets : str, Candidate or a sequence of them, optional
        Names of unknowns, or predictions of natural frequencies or of receptances, whose intervals should become
        narrower. Standard deviations and costs of predictions do not matter. By default all unknowns except errors.
    level : float, optional
        Level of the intervals.
    profiles : mapping of str to Profile, optional
        Profiles from `profile_likelihoods(found)`; those that are needed and missing are computed.
    progress : callable, optional
        Called with a text at each step.

    Returns
    -------
    NextMeasurement
        The candidates, the best one first, with the present and the expected interval of each target.

    Raises
    ------
    TypeError, ValueError
        No candidate, two candidates of one label, natural frequencies without standard deviations, an unknown target, a
        fit of percentages, which are no likelihood, or a candidate without any of the unknowns.
    ReceptanceError
        The model of a candidate has no value at the fit. Candidates of the menu are left out with a note instead.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance import STEEL, Assembly, Observation, Part, PointJoint, Segment, Unknown, identify
    >>> from receptance.predict import Candidate, next_measurement
    >>> bar = Segment(length=0.1, outer_diameter=0.02, material=STEEL)
    >>> pair = Assembly([Part([bar], name="tool"), PointJoint(k_y=1e8, k_theta=1e5), Part([bar], name="holder")])
    >>> modes = Observation.from_modes(
    ...     assembly=pair, frequency_hz=pair.natural_frequencies(2e4)[:3], standard_deviation_hz=5.0
    ... )
    >>> found = identify(modes, Unknown(address="joint.k_theta", lower=1e3, upper=1e7))
    >>> lines = np.linspace(100.0, 5000.0, 200)
    >>> better = next_measurement(found, [
    ...     Candidate(observation=one) for one in (
    ...         Observation(label="tip FRF", assembly=pair, frequency_hz=lines, standard_deviation=0.02),
    ...         Observation.from_modes(label="first mode again", assembly=pair, modes=[1], standard_deviation_hz=5.0),
    ...     )
    ... ])
    >>> better.best.label
    'tip FRF'
    """
    stated = () if candidates is None else _check_candidates(candidates)
    require_likelihood(found)
    chosen = _check_targets(targets, found)
    confidence_multiplier(level, None)
    report = progress or (lambda _: None)
    possible = stated or _menu(found)
    found, wide = _wide_profiles(found, chosen, level, dict(profiles or {}), report)
    points, notes = _points(found, wide)
    report(f"evaluating {len(possible)} candidates at {len(points)} points")
    present = _present(found, chosen, level, points, wide)
    ranking = []
    for candidate in possible:
        report(f"evaluating {candidate.label}")
        try:
            expected = _expected(found, chosen, level, candidate, points, present)
        except (ReceptanceError, ValueError) as error:
            if stated:
                raise
            notes.append(f'"{candidate.label}" is not ranked: {error}')
            continue
        shrink = float(np.exp(np.mean([np.log(max(e.shrink, SMALLEST)) for e in expected.values()])))
        score = worth(-np.log(shrink), candidate.cost)
        ranking.append(RankedCandidate(candidate=candidate, expected=expected, shrink=shrink, score=score))
    if not ranking:
        raise ValueError(f"no measurement of the menu can be simulated, expected candidates: {'; '.join(notes)}")
    ranking.sort(key=lambda ranked: -ranked.score)
    if len({ranked.candidate.cost for ranked in ranking}) > 1:
        notes.append("the ranking is by the reduction of the deviations for the square root of the cost")
    if not stated:
        notes.append("the candidates are those of the menu, with the lines and the noise of what was measured")
    if found.warnings():
        notes.append(f"the fit has advice: {found.warnings()[0]}")
    return NextMeasurement(
        ranking=tuple(ranking),
        targets=tuple(ranking[0].expected),
        level=level,
        points=tuple(dict(zip(found.addresses, point.values.tolist(), strict=True)) for point in points),
        profiled=tuple(wide),
        rejection=found.rejection,
        notes=tuple(notes),
    )


def _menu(found: Identification) -> list[Candidate]:
    """Return the candidates of the menu; the scatter of the residuals is the noise where none was stated."""
    scatter = math.sqrt(found.residual_variance)
    observations = [
        observation
        if observation.weighted
        else altered(
            observation,
            standard_deviation=scatter
            * (1.0 if observation.is_receptance else observation.frequency_hz)
            * np.ones(observation.frequency_hz.size),
        )
        for observation in found.task.observed
    ]
    parameters = found.task.parameters
    return Menu(tuple(observations), parameters.given, parameters.tolerances).candidates()


def _check_candidates(candidates: Candidate | Sequence[Candidate]) -> tuple[Candidate, ...]:
    found = _checks.items("candidates", candidates, Candidate)
    for candidate in found:
        if not candidate.observation.weighted:
            raise ValueError(f"{candidate!r} has no standard deviation, which its weight needs; give it one")
    labels = [candidate.label for candidate in found]
    if double := sorted({label for label in labels if labels.count(label) > 1}):
        raise ValueError(f"two candidates have the label {double[0]!r}, expected different labels")
    return found


def _check_targets(targets: Target | Sequence[Target] | None, found: Identification) -> tuple[Target, ...]:
    if targets is None:
        return tuple(name for name in found.addresses if name not in found.errors)
    given = (targets,) if isinstance(targets, (str, Candidate)) else tuple(targets)
    if not given:
        raise ValueError("targets is empty, expected at least one")
    for one in given:
        if isinstance(one, str) and one not in found.values:
            raise ValueError(f"the target {one!r} was not identified, only {', '.join(found.addresses)}")
        if not isinstance(one, (str, Candidate)):
            raise TypeError(f"the target {one!r} is neither the name of an unknown nor a Candidate")
    return given


def _values(found: Identification, targets: Sequence[Target]) -> dict[str, float]:
    """Return the present values of the targets by name; 0 for the logarithm of a receptance."""
    values: dict[str, float] = {}
    data = iter(data_of(found.predictor, [target for target in targets if isinstance(target, Candidate)]).mean())
    for target in targets:
        if isinstance(target, str):
            values[target] = found.values[target]
            continue
        predicted = next(data)
        values |= zip(names_of(target), [0.0] if target.observation.is_receptance else predicted.tolist(), strict=True)
    return values


def _wide_profiles(
    found: Identification,
    targets: Sequence[Target],
    level: float,
    profiles: dict[str, Profile],
    report: Callable[[str], None],
) -> tuple[Identification, dict[str, Profile]]:
    """Return the fit and the profiles of parameters with wide intervals; those that are not given are computed.

    The fit is a better one where the profiles lead to it.
    """
    named = [target for target in targets if isinstance(target, str) and target not in found.errors]
    if len(named) < len(targets):
        named = [name for name in found.addresses if name not in found.errors]
    (low, high), x = found.task.variables.limits, found.vector
    wide = []
    for name in named:
        i = found.index(name)
        whole = float(high[i] - low[i])
        half = found.confidence_multiplier(level) * float(np.sqrt(found.covariance[i, i]))
        size = half if found.unknowns[i].scale == "log" else half / whole
        at_bound = min(x[i] - low[i], high[i] - x[i]) <= _EDGE * whole
        if not size < _WIDE or at_bound:
            wide.append(name)
    missing = [name for name in wide if name not in profiles]
    if missing:
        computed = profile_likelihoods(found, missing, level=level, most=_EVALUATIONS_OF_PROFILES, progress=report)
        found = computed.fit or found
        profiles |= computed
    return found, {name: profiles[name] for name in wide if name in profiles}


def _points(found: Identification, profiles: Mapping[str, Profile]) -> tuple[list[Predictor], list[str]]:
    """Return predictors at the fit, or at points along the profiles of parameters with wide intervals, and notes.

    Their information is that of the measurements of the fit at each point.
    """
    if not profiles:
        return predictors_at(found, [found.vector]), []
    vectors = [x for name, profile in profiles.items() for x in _quantiles_along(found.index(name), profile)]
    points = predictors_at(found, vectors)
    lost = len(vectors) - len(points)
    points = points or predictors_at(found, [found.vector])
    one = len(profiles) == 1
    notes = [
        f"the interval{'' if one else 's'} of {', '.join(profiles)} {'is' if one else 'are'} so wide that the "
        f"information at one point would mislead: it is averaged over {len(points)} points along the "
        f"profile{'' if one else 's'}, within the bounds of the fit"
    ]
    if lost:
        notes.append(f"the model has no value at {lost} more points")
    return points, notes


def _quantiles_along(index: int, profile: Profile) -> list[NDArray[np.float64]]:
    """Return the quantiles of the likelihood along a profile, with the other variables as they were fitted there."""
    paths = profile.paths
    at = paths[:, index]
    if at.size < 2 or at[-1] == at[0]:
        return [paths[int(np.argmin(profile.rise))]]
    fine = np.linspace(at[0], at[-1], 2001)
    # The square root of the rise is nearly linear between the points.
    density = np.exp(-0.5 * np.interp(fine, at, np.sqrt(profile.rise)) ** 2)
    share = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]))])
    chosen = np.interp(np.array(_QUANTILES) * share[-1], share, fine)
    found = []
    for value in chosen:
        right = int(np.clip(np.searchsorted(at, value), 1, at.size - 1))
        part = (value - at[right - 1]) / (at[right] - at[right - 1])
        found.append((1.0 - part) * paths[right - 1] + part * paths[right])
    return found


def _about(value: float, scale: str, half: float) -> tuple[float, float]:
    """Return the interval about a value; the half width is that of log10 of the value where the scale is "log"."""
    return (value / 10.0**half, value * 10.0**half) if scale == "log" else (value - half, value + half)


def _present(
    found: Identification,
    targets: Sequence[Target],
    level: float,
    points: Sequence[Predictor],
    profiles: Mapping[str, Profile],
) -> dict[str, Expectation]:
    """Return values, standard deviations and intervals of the targets from the measurements of the fit alone."""
    deviations = [expected_deviations(point, targets) for point in points]
    multiplier = found.confidence_multiplier(level)
    present = {}
    for name, value in _values(found, targets).items():
        deviation, scale = _geometric_mean([at_point[name] for at_point in deviations]), "linear"
        interval: tuple[float, float] | None = None
        if name in targets:
            i = found.index(name)
            scale = str(found.unknowns[i].scale)
            if name in profiles:
                ends = profiles[name]
                to = np.log10 if scale == "log" else np.asarray
                low, high = found.task.variables.limits[:, i]
                low = low if ends.lower_open else float(to(ends.lower))
                high = high if ends.upper_open else float(to(ends.upper))
                deviation = (high - low) / (2.0 * multiplier)
                interval = ends.lower, ends.upper
        interval = interval or _about(value, scale, multiplier * deviation)
        present[name] = Expectation(
            name=name,
            value=value,
            scale=scale,
            now=interval,
            lower=interval[0],
            upper=interval[1],
            deviation=deviation,
            deviation_now=deviation,
            deviations=(),
            stays_open=0.0,
        )
    return present


def _expected(
    found: Identification,
    targets: Sequence[Target],
    level: float,
    candidate: Candidate,
    points: Sequence[Predictor],
    present: Mapping[str, Expectation],
) -> dict[str, Expectation]:
    """Return the expectation of each target with a candidate, from all points."""
    at_points = [expected_deviations(point, targets, candidate) for point in points]
    multiplier, (low, high) = found.confidence_multiplier(level), found.task.variables.limits
    expected = {}
    for name, now in present.items():
        deviations = [at_point[name] for at_point in at_points]
        open_share = 0.0
        if name in targets and name not in found.errors:
            i = found.index(name)
            ends = [(point.x[i], multiplier * sd) for point, sd in zip(points, deviations, strict=True)]
            open_share = sum(x + half > high[i] or x - half < low[i] for x, half in ends) / len(points)
        typical = _geometric_mean(deviations)
        lower, upper = _about(now.value, now.scale, multiplier * typical)
        expected[name] = replace(
            now,
            # More data do not widen a side that is already bounded closely.
            lower=max(lower, now.lower),
            upper=min(upper, now.upper),
            deviation=typical,
            deviations=tuple(deviations),
            stays_open=open_share,
        )
    return expected


def _geometric_mean(deviations: Sequence[float]) -> float:
    return float(np.exp(np.mean(np.log(np.maximum(deviations, SMALLEST)))))


def _configuration(observation: Observation) -> str | None:
    """Return the configuration of an observation, or None where it is the label."""
    return None if observation.configuration == observation.label else observation.configuration


def _ends(e: Expectation, ends: tuple[float, float]) -> Interval:
    """Return an interval whose open sides are None."""
    low, high = ends
    return (None if np.isinf(low) or (e.scale == "log" and low == 0.0) else low), (None if np.isinf(high) else high)
