"""Likelihood of a fit: constrained fits and their likelihood ratio, profile likelihoods, and the evidence of a model.

A profile holds one parameter at several values and fits all others again. The rise of -2 log L over its least value is
chi-squared with one degree of freedom at the true value (Wilks 1938), so the values whose rise is below the quantile
are a confidence interval. Unlike a standard error it accounts for bounds, curvature and open sides.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import special

from receptance import _checks
from receptance.errors import ReceptanceError, warn_user
from receptance.fit.identification import restart
from receptance.fit.problem import COST_TOLERANCE, End
from receptance.fit.result import Identification
from receptance.report import Column, Provenance, Result, Results, Table
from receptance.report.table import amount, amount_interval, percent

_BETTER = 0.01
"""Decrease of the cost, in residual variances, from which on the fit was not the global optimum."""
_END_TOLERANCE = 0.01
"""Relative tolerance of the root of the rise at the end of an interval."""
_MAX_FITS = 40
"""Largest number of fits on one side."""
_GROWTH = 3.0
"""Largest growth of a step along a flat side."""
_RESTARTS = 4
"""Largest number of restarts from a better optimum."""
_MOST_EVALUATIONS = 400
"""Largest number of evaluations of the profile of a value whose linear interval exceeds the bounds."""
_COST_TOLERANCE = 1e-5
"""Tolerance of the cost of a constrained fit, in residual variances."""
_FACTOR = 1.5
"""Intervals with ends farther than this factor from the value are stated as factors, others in percent."""
_WIDE = 10.0
"""Intervals over more than this factor determine little more than the order of magnitude."""
_TIED = 10.0
"""Least path of another parameter along the profile, in its conditional standard errors, for the two to be tied."""
_TIED_RANGE = 0.02
"""Least path of that parameter as a share of its range."""


def require_likelihood(fit: Identification) -> None:
    """Raise ValueError if receptances were fitted with the percentage objective."""
    pairs = zip(fit.units, fit.task.observed, strict=True)
    if any(unit == "percent" and observation.is_receptance for unit, observation in pairs):
        raise ValueError("the percentage objective is no likelihood: identify with the objective 'log'")


@dataclass(frozen=True, kw_only=True)
class ConstrainedFit:
    """The best fit with some parameters at given values."""

    values: dict[str, float]
    """The given values in SI units."""
    others: dict[str, float]
    """The other parameters, fitted again."""
    rise: float
    """Increase of -2 log L over the unconstrained fit; infinite if the model has no value."""
    p_value: float
    """Probability of at least this increase if the given values are true (Wilks 1938); from the F distribution if the
    scatter was estimated."""

    def rejected(self, level: float = 0.95) -> bool:
        """Return whether the data reject the values at a level."""
        return self.p_value < 1.0 - level

    def __repr__(self) -> str:
        held = ", ".join(f"{name}={value:.4g}" for name, value in self.values.items())
        return f"ConstrainedFit({held}: rise {self.rise:.3g}, p = {self.p_value:.2g})"


def constrained_fit(fit: Identification, values: Mapping[str, float], *, starts: int = 8) -> ConstrainedFit:
    """Fit all other parameters with some at given values, and test the values by the likelihood ratio.

    A profile holds one parameter; this tests a set of several values at once. Errors of tolerances are fitted within
    their priors.

    Parameters
    ----------
    fit : Identification
        From `identify`, with the objective "log".
    values : mapping of str to float
        Values by name, in SI units, within the bounds of the fit.
    starts : int, optional
        Number of starts of the others: the fitted values, then a Latin hypercube within the bounds, without errors.

    Raises
    ------
    TypeError, ValueError
        A parameter that was not identified, a value outside its bounds, or the percentage objective, which is no
        likelihood.

    Examples
    --------
    >>> from receptance import STEEL, Assembly, Observation, Part, Segment, identify
    >>> from receptance.fit import constrained_fit
    >>> bar = Assembly([Part([Segment(length=0.1, outer_diameter=0.02, material=STEEL)], name="bar")])
    >>> rung = Observation.from_modes(assembly=bar, frequency_hz=bar.natural_frequencies(3e4), standard_deviation_hz=5)
    >>> fit = identify(rung, {"bar.segment[0].youngs_modulus": (1e11, 3e11)})
    >>> [constrained_fit(fit, {"bar.segment[0].youngs_modulus": e}).rejected() for e in (2.101e11, 2.11e11)]
    [False, True]
    """
    if not values:
        raise ValueError("values is empty, expected at least one parameter and its value")
    require_likelihood(fit)
    problem = fit.task.problem()
    variables = problem.variables
    held = np.array(list(fit.values.values()))
    free = np.ones(held.size, dtype=np.bool_)
    for name, value in values.items():
        index = fit.index(name)
        unknown = variables.unknowns[index]
        number = _checks.number("constrained_fit", name, value)
        if not unknown.lower <= number <= unknown.upper:
            raise ValueError(
                f"constrained_fit: {name} is {number:g}, outside the bounds {unknown.lower:g} to {unknown.upper:g}"
            )
        held[index], free[index] = number, False
    start, best = variables.from_values(held), problem.fit_one(fit.vector, least=1e-9)
    variance = fit.variance_of_residuals(best.cost)
    # Errors start at their fitted values.
    drawn = free & (np.arange(start.size) < fit.task.parameters.count)
    begun = [start, *(np.where(drawn, x, start) for x in variables.draw(max(starts, 1), fit.seed)[1:])]
    end = min(problem.fit(np.array(begun), free=free, least=COST_TOLERANCE), key=lambda run: run.cost)
    rise = 2.0 * (end.cost - best.cost) / variance if np.isfinite(end.cost) and variance > 0.0 else np.inf
    if rise < -_BETTER:
        warn_user("the constrained fit found a better optimum than the fit: identify with more starts")
    rise = max(float(rise), 0.0)
    others = variables.to_values(end.x)
    return ConstrainedFit(
        values={name: float(value) for name, value in values.items()},
        others={name: float(others[i]) for i, name in enumerate(fit.addresses) if free[i]},
        rise=rise,
        p_value=_p_value(rise, len(values), fit.scatter_freedom),
    )


def _p_value(rise: float, count: int, degrees_of_freedom: float | None) -> float:
    if np.isinf(rise):
        return 0.0
    if degrees_of_freedom is None:
        return float(special.chdtrc(count, rise))

    return float(special.fdtrc(count, max(degrees_of_freedom, 1), rise / count))


def log_evidence(fit: Identification) -> float:
    """Return the natural logarithm of the evidence, by Laplace's approximation at the fit.

    It compares models, such as laws, that are fitted to the same observations with the same standard deviations;
    factors that depend on these alone are omitted. The prior of an unknown without one is uniform within its bounds,
    on the scale of the fit; errors and individual parts are standard normal. A difference of 3 is a factor of 20 in
    probability, a difference of 10 is decisive. The result is NaN if the data do not determine a parameter: the
    approximation needs a peak of the likelihood.

    Raises
    ------
    ValueError
        No standard deviations, the percentage objective, or a fit that allows for a discrepancy.

    Examples
    --------
    >>> from receptance import STEEL, Assembly, Observation, Part, PointJoint, Segment, identify
    >>> from receptance.fit import Law, Power, log_evidence
    >>> bar = Segment(length=0.1, outer_diameter=0.02, material=STEEL)
    >>> pair = Assembly([Part([bar], name="tool"), PointJoint(k_y=1e8, k_theta=1e5), Part([bar], name="holder")])
    >>> measured = [
    ...     Observation.from_modes(
    ...         assembly=pair,
    ...         frequency_hz=pair.replace({"joint.k_theta": k}).natural_frequencies(2e4)[:2],
    ...         standard_deviation_hz=1.0,
    ...         configuration=f"{torque} N m",
    ...         conditions={"torque": torque},
    ...     )
    ...     for torque, k in ((40.0, 0.9e5), (80.0, 1.2e5))
    ... ]
    >>> grows = Power(of="torque", reference=40.0)
    >>> laws = [Law(address="joint.k_theta", lower=1e3, upper=1e7, powers=powers) for powers in ((), grows)]
    >>> constant, power = (log_evidence(identify(measured, law, noise="stated")) for law in laws)
    >>> power > constant + 10.0
    True
    """
    if not fit.known_scatter:
        raise ValueError("evidence needs standard deviations: give the observations them, and the objective 'log'")
    if fit.discrepancy is not None:
        raise ValueError(
            "the fit allows for an error of its model, which differs between models; fits whose evidence is compared "
            'need the same noise: identify with noise="stated"'
        )
    problem = fit.task.problem()
    residual = problem.residual(fit.vector)
    total = -0.5 * float(residual @ residual)
    low, high = problem.variables.limits
    slopes = problem.variables.priors[:, 1]
    total += float(np.sum(np.log(slopes))) - 0.5 * slopes.size * math.log(2.0 * math.pi)
    total -= sum(math.log(high[i] - low[i]) for i, unknown in enumerate(fit.unknowns) if unknown.prior is None)
    if not np.isfinite(fit.covariance).all():
        return float("nan")
    sign, logarithm = np.linalg.slogdet(fit.covariance)
    if sign <= 0.0:
        return float("nan")
    return total + 0.5 * len(fit.unknowns) * math.log(2.0 * math.pi) + 0.5 * float(logarithm)


def interval_statement(value: float, lower: float, upper: float, *, scale: str, tied_to: str = "") -> str:
    """Return the meaning of an interval as text; open sides are 0 or -inf, and inf.

    Examples
    --------
    >>> from receptance.fit.likelihood import interval_statement
    >>> interval_statement(1e5, 9.8e4, 1.02e5, scale="log")
    'determined to 2 %'
    >>> interval_statement(1e9, 4e7, float("inf"), scale="log")
    'only a lower bound: 4e+07'
    >>> interval_statement(1e9, 0.0, float("inf"), scale="log", tied_to="joint.k_theta")
    'tied to joint.k_theta: the data determine a combination of the two'
    """
    open_below = lower == 0.0 if scale == "log" else math.isinf(lower)
    open_above = math.isinf(upper)
    suffix = f", tied to {tied_to}" if tied_to else ""
    if open_below and open_above:
        if tied_to:
            return f"tied to {tied_to}: the data determine a combination of the two"
        return "not determined within the bounds"
    if open_above:
        return f"only a lower bound: {lower:.2g}{suffix}"
    if open_below:
        return f"only an upper bound: {upper:.2g}{suffix}"
    if scale == "log":
        factor = max(value / lower, upper / value)
        if factor <= _FACTOR:
            return f"determined to {percent(math.sqrt(upper / lower) - 1.0)}"
        if upper / lower <= _WIDE:
            return f"determined to a factor of {factor:.2g}{suffix}"
        return f"poorly determined: between {lower:.2g} and {upper:.2g}{suffix}"
    half = 0.5 * (upper - lower)
    if lower <= 0.0 <= upper:
        return f"not distinguishable from zero: {lower:.2g} to {upper:.2g}{suffix}"
    return f"determined to {percent(half / abs(value))}" + (suffix if half > 0.5 * abs(value) else "")


@dataclass(frozen=True, kw_only=True)
class Profile(Result):
    """Profile likelihood of one parameter, and its confidence interval."""

    name: str
    """Its name in the fit."""
    value: float
    """Most likely value in SI units."""
    lower: float
    """Lower end of the interval in SI units; zero or -infinity where that side is open."""
    upper: float
    """Upper end; infinity where that side is open."""
    lower_open: bool
    """Whether the rise stays below the threshold down to the lower bound of the fit."""
    upper_open: bool
    """Whether the rise stays below the threshold up to the upper bound of the fit."""
    level: float
    """Level of the interval."""
    values: NDArray[np.float64]
    """`(n,)` values at which the parameter was held, ascending, in SI units."""
    rise: NDArray[np.float64]
    """`(n,)` rise of -2 log L at these values."""
    paths: NDArray[np.float64]
    """`(n, p)` all fitted variables at these values."""
    threshold: float
    """Rise at the ends of the interval."""
    statement: str
    """Meaning of the interval as text."""
    evaluations: int
    """Evaluations of the model."""
    unit: str = ""
    """SI unit of the value; empty for a plain number."""
    notes: tuple[str, ...] = ()
    provenance: Provenance = field(default_factory=Provenance, repr=False)

    heading = "Profile likelihood"
    plotted_by = "receptance.fit.figure:draw_profiles"

    @property
    def bounded(self) -> bool:
        """Whether the interval is closed on both sides."""
        return not (self.lower_open or self.upper_open)

    def tables(self) -> list[Table]:
        """Return the interval and its meaning."""
        columns = ("parameter", Column("value"), Column(f"{100.0 * self.level:g} % interval"), "meaning")
        ends = (None if self.lower_open else self.lower, None if self.upper_open else self.upper)
        row = (self.name, amount(self.value, self.unit, 4), amount_interval(ends, self.unit), self.statement)
        return [Table("Profile likelihoods", columns, [row])]

    def data(self) -> dict[str, Any]:
        """Return interval, meaning and points."""
        return {
            "statement": self.statement,
            "level": self.level,
            "interval": (self.lower, self.upper),
            "open": (self.lower_open, self.upper_open),
            "values": self.values,
            "rise": self.rise,
        }

    def __repr__(self) -> str:
        return f"Profile({self.name}: {self.statement})"


class Profiles(Results[Profile]):
    """Profile likelihoods by name of the parameter.

    `fit` is the fit that was profiled: the given one, or the one that was restarted from a better optimum. `unfinished`
    has the parameters whose profiles would have taken more evaluations than allowed.
    """

    heading = "Profile likelihoods"
    key = "profiles"
    plotted_by = "receptance.fit.figure:draw_profiles"

    def __init__(
        self,
        items: Mapping[str, Profile],
        *,
        fit: Identification | None = None,
        unfinished: Sequence[str] = (),
        provenance: Provenance | None = None,
        notes: Sequence[str] = (),
    ) -> None:
        super().__init__(items, provenance=provenance, notes=notes)
        self.fit, self.unfinished = fit, tuple(unfinished)


def profile_likelihoods(
    fit: Identification,
    names: str | Sequence[str] | None = None,
    *,
    level: float = 0.95,
    most: int | None = None,
    progress: Callable[[str], None] | None = None,
) -> Profiles:
    """Profile likelihoods: confidence intervals with bounds and open sides, and their meaning as text.

    Each parameter is held at several values, and all others are fitted again, errors of tolerances included. Where that
    finds a better optimum, the fit is restarted from there and profiled again: `Profiles.fit` is the profiled fit.

    Parameters
    ----------
    fit : Identification
        From `identify`, with the objective "log".
    names : str or sequence of str, optional
        Parameters; by default all but the errors of tolerances.
    level : float, optional
        Level of the intervals.
    most : int, optional
        Number of evaluations of the model after which no further constrained fit begins; by default there is no limit.
    progress : callable, optional
        Called with a progress message.

    Raises
    ------
    ValueError
        A parameter that was not identified, or the percentage objective, which is no likelihood.
    ReceptanceError
        Each of several restarts was followed by a better optimum.

    Examples
    --------
    >>> from receptance import STEEL, Assembly, Observation, Part, Segment, identify
    >>> from receptance.fit import profile_likelihoods
    >>> bar = Assembly([Part([Segment(length=0.1, outer_diameter=0.02, material=STEEL)], name="bar")])
    >>> rung = Observation.from_modes(assembly=bar, frequency_hz=bar.natural_frequencies(3e4), standard_deviation_hz=5)
    >>> profile_likelihoods(identify(rung, {"bar.segment[0].youngs_modulus": (1e11, 3e11)}))
    Profiles({'bar.segment[0].youngs_modulus': Profile(bar.segment[0].youngs_modulus: determined to 0.09 %)})
    """
    if names is None:
        names = [name for name in fit.addresses if name not in fit.errors]
    chosen = [names] if isinstance(names, str) else list(names)
    for name in chosen:
        fit.index(name)
    require_likelihood(fit)
    for _ in range(_RESTARTS):
        profiles: dict[str, Profile] = {}
        try:
            profiler = _Profiler(fit, level, most)
            for name in chosen:
                if progress is not None:
                    progress(f"profiling {name}, {len(profiles) + 1} of {len(chosen)}")
                profiles[name] = profiler.profile(name)
        except BetterOptimumError as error:
            warn_user("a better optimum than that of the fit was found while profiling: the fit is restarted from it")
            fit = restart(fit, error.better)
            continue
        except _EvaluationsUsedError:
            pass
        unfinished = [name for name in chosen if name not in profiles]
        return Profiles(profiles, fit=fit, unfinished=unfinished, provenance=fit.provenance)
    raise ReceptanceError(f"profiling found a better optimum {_RESTARTS} times: identify with more starts")


def interval_within_bounds(fit: Identification, name: str, level: float = 0.95) -> tuple[float, float]:
    """Return the confidence interval of a value in SI units, which ends at the bounds of the unknown.

    It is linear, see `Identification.interval`. Where it would exceed the bounds, the linear approximation says
    nothing, and the interval is that of the profile likelihood, if this ends within `_MOST_EVALUATIONS`.

    Examples
    --------
    >>> from receptance import STEEL, Assembly, Observation, Part, PointMass, Segment, Unknown, identify
    >>> from receptance.fit.likelihood import interval_within_bounds
    >>> bar = Part([Segment(length=0.1, outer_diameter=0.02, material=STEEL)], name="bar")
    >>> bare, loaded = (Assembly([bar], [PointMass(mass=mass, name="mass")]) for mass in (0.0, 1e-4))
    >>> modes = loaded.natural_frequencies(3e4)
    >>> rung = Observation.from_modes(assembly=bare, frequency_hz=modes, standard_deviation_hz=20)
    >>> fit = identify(rung, Unknown(address="mass.mass", lower=0.0, upper=0.1, scale="linear"))
    >>> fit.interval("mass.mass")[0] < 0.0
    True
    >>> low, high = interval_within_bounds(fit, "mass.mass")
    >>> low == 0.0 and high > 1e-4
    True
    """
    unknown = fit.unknowns[fit.index(name)]
    low, high = fit.interval(name, level)
    if low < unknown.lower or high > unknown.upper:
        try:
            profile = _Profiler(fit, level, _MOST_EVALUATIONS).profile(name)
            low, high = profile.lower, profile.upper
        except (BetterOptimumError, _EvaluationsUsedError):
            pass
    return max(low, unknown.lower), min(high, unknown.upper)


class _Profiler:
    """Constrained fits around one optimum."""

    def __init__(self, identification: Identification, level: float, most: int | None) -> None:
        self.identification = identification
        self.level, self.most = level, most
        self.problem = identification.task.problem()
        self.variables = self.problem.variables
        self.limits = self.variables.limits
        self.best = self.problem.fit_one(identification.vector, least=1e-12)
        self.variance = identification.variance_of_residuals(self.best.cost)
        if self.best.first - self.best.cost > _BETTER * max(self.variance, 1e-300):
            raise BetterOptimumError(self.best)
        self.threshold = identification.confidence_multiplier(level) ** 2

    def profile(self, name: str) -> Profile:
        """Profile one parameter."""
        index = self.identification.index(name)
        before = self.problem.evaluations
        low, high = (self._side(index, sign) for sign in (-1.0, 1.0))
        unknown = self.variables.unknowns[index]
        points = sorted([*low.points, (self.best.x, 0.0), *high.points], key=lambda point: float(point[0][index]))
        paths = np.array([point[0] for point in points])
        value = self._value(index, self.best.x[index])
        lower = self._value(index, low.end) if not low.open else (0.0 if unknown.scale == "log" else -np.inf)
        upper = self._value(index, high.end) if not high.open else np.inf
        return Profile(
            name=name,
            unit=unknown.unit,
            value=value,
            lower=lower,
            upper=upper,
            lower_open=low.open,
            upper_open=high.open,
            level=self.level,
            values=np.array([self._value(index, point[index]) for point in paths]),
            rise=np.array([point[1] for point in points]),
            paths=paths,
            threshold=self.threshold,
            statement=interval_statement(
                value, lower, upper, scale=str(unknown.scale), tied_to=self._tied_to(index, paths)
            ),
            evaluations=self.problem.evaluations - before,
        )

    def _value(self, index: int, variable: float) -> float:
        vector = self.best.x.copy()
        vector[index] = variable
        return float(self.variables.to_values(vector)[index])

    def _side(self, index: int, sign: float) -> _Side:
        """Step to one side until the rise exceeds the threshold, then bracket the end of the interval."""
        bound = float(self.limits[0 if sign < 0.0 else 1][index])
        target = float(np.sqrt(self.threshold))
        inside = _ProfilePoint(self.best, float(self.best.x[index]), 0.0)
        outside: _ProfilePoint | None = None
        points: list[tuple[NDArray[np.float64], float]] = []
        step = self._first_step(index) * target
        infeasible = np.inf  # distance from `inside` at which the model has no value
        for _ in range(_MAX_FITS):
            if outside is None:
                at = inside.at + sign * step
                if sign * (at - bound) >= 0.0:
                    at = bound
                if abs(at - inside.at) >= 0.999 * infeasible:
                    at = inside.at + sign * 0.5 * infeasible
                near = inside
            else:
                at = _interpolate(inside, outside, target)
                near = min(inside, outside, key=lambda point: abs(point.at - at))
            fit = self._constrained(index, at, near.fit)
            distance = abs(at - inside.at)
            if not np.isfinite(fit.cost):
                infeasible = distance
                if infeasible <= 1e-3 * step or infeasible <= 1e-9:
                    break
                continue
            infeasible = np.inf if outside is not None else infeasible - distance
            rise = max(2.0 * (fit.cost - self.best.cost) / self.variance if self.variance > 0.0 else np.inf, 0.0)
            point = _ProfilePoint(fit, float(fit.x[index]), float(np.sqrt(rise)))
            points.append((fit.x, rise))
            if at == bound and point.root < target:
                return _Side(points, bound, True)
            # A flat side may stay just below the threshold, so a point below it is an end only inside a bracket.
            if abs(point.root - target) <= _END_TOLERANCE * target and (point.root >= target or outside is not None):
                return _Side(points, point.at, False)
            if point.root < target:
                growth = (target - point.root) / max(point.root - inside.root, 1e-3 * target) * distance
                step = min(max(1.05 * growth, 0.2 * step), _GROWTH * max(step, distance))
                inside = point
            else:
                outside = point
            if outside is not None and abs(outside.at - inside.at) <= 1e-7 * float(np.ptp(self.limits[:, index])):
                break
        end = inside.at if outside is None else _interpolate(inside, outside, target)
        return _Side(points, end, outside is None)

    def _first_step(self, index: int) -> float:
        """Return the standard error of a variable, at most a tenth of its range."""
        most = 0.1 * float(np.ptp(self.limits[:, index]))
        others = np.arange(self.best.x.size) != index
        normal = self.best.curvature
        slope = _conditional_slope(normal, index)
        curvature = float(normal[index, index] + normal[index, others] @ slope)
        if not (curvature > 0.0 and self.variance > 0.0):
            return most
        return min(float(np.sqrt(self.variance / curvature)), most)

    def _constrained(self, index: int, at: float, near: End) -> End:
        """Fit all other variables with one held, from a linear prediction of a neighbouring fit."""
        if self.most is not None and self.problem.evaluations >= self.most:
            raise _EvaluationsUsedError
        free = np.ones(near.x.size, dtype=np.bool_)
        free[index] = False
        start = near.x.copy()
        start[index] = at
        predicted = start.copy()
        predicted[free] += _conditional_slope(near.curvature, index) * (at - near.x[index])
        # The prediction of a variable that the data do not determine can be out of bounds; it keeps its value.
        low, high = self.limits
        predicted = np.where((low <= predicted) & (predicted <= high), predicted, start)
        least = _COST_TOLERANCE * (self.variance if self.variance > 0.0 else 1.0)
        fit = self.problem.fit_one(predicted, free=free, least=least, of_all=True)
        if not np.isfinite(fit.cost):
            fit = self.problem.fit_one(start, free=free, least=least, of_all=True)
        if fit.cost < self.best.cost - _BETTER * max(self.variance, 1e-300):
            better = self.problem.fit_one(fit.x, least=1e-12)
            if better.converged:
                raise BetterOptimumError(better)
        return fit

    def _tied_to(self, index: int, paths: NDArray[np.float64]) -> str:
        """Return the name of the parameter that compensates the profiled one most, if any does."""
        count = self.identification.task.parameters.count
        conditional = 1.0 / np.sqrt(np.maximum(np.diag(self.best.curvature) / max(self.variance, 1e-300), 1e-300))
        path = np.ptp(paths[:, :count], axis=0)
        share = path / np.ptp(self.limits[:, :count], axis=0)
        relative = np.where(share > _TIED_RANGE, path / conditional[:count], 0.0)
        if index < count:
            relative[index] = 0.0
        other = int(relative.argmax()) if relative.size else 0
        if not relative.size or relative[other] < _TIED:
            return ""
        return self.identification.addresses[other]


class BetterOptimumError(Exception):
    """A constrained fit is better than the optimum that is profiled."""

    def __init__(self, better: End) -> None:
        super().__init__("a better optimum was found while profiling")
        self.better = better


class _EvaluationsUsedError(Exception):
    """The evaluations of a profile are used up."""


class _ProfilePoint(NamedTuple):
    """A constrained fit, the value of the held variable and the root of the rise of -2 log L."""

    fit: End
    at: float
    root: float


class _Side(NamedTuple):
    """Points of a profile on one side, with their rises, the end of the interval, and whether it is open."""

    points: list[tuple[NDArray[np.float64], float]]
    end: float
    open: bool


def _conditional_slope(normal: NDArray[np.float64], index: int) -> NDArray[np.float64]:
    """Return the derivatives of the other variables' constrained optimum with respect to one variable."""
    others = np.arange(len(normal)) != index
    matrix = normal[np.ix_(others, others)]
    scale = np.sqrt(np.maximum(np.diag(matrix), 0.0))
    scale = np.where(scale > 0.0, scale, 1.0)
    ridge = 1e-9 * np.eye(len(matrix))
    result: NDArray[np.float64] = (
        -np.linalg.solve(matrix / np.outer(scale, scale) + ridge, normal[others, index] / scale) / scale
    )
    return result


def _interpolate(inside: _ProfilePoint, outside: _ProfilePoint, target: float) -> float:
    """Return where the linearly interpolated root reaches the target, at a distance from the ends of the bracket."""
    share = (target - inside.root) / (outside.root - inside.root)
    return inside.at + min(max(share, 0.05), 0.95) * (outside.at - inside.at)
