"""Fits of the base model and of its extensions: one least-squares problem each, with tolerances, from several starts.

Nothing here knows what a cause is. A fit gets a model and where to start; it explores on the lines that tell most and
ends on all of them, so that thinning loses nothing of the result.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance.diagnosis.model import Model
from receptance.errors import ReceptanceError
from receptance.identification.conclusion import conclude
from receptance.identification.fit import identify
from receptance.identification.observations import MeasuredFRF, on_lines
from receptance.identification.result import Identification, Start
from receptance.identification.task import place_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.identification.problem import Problem
    from receptance.identification.task import Observation, Task

__all__ = [
    "Explored",
    "Fit",
    "explore",
    "fit_base",
    "numbers_of",
    "on_few_lines",
    "problem_of",
    "refit",
    "starting_at",
    "telling_lines",
    "thinned",
    "unfitted",
]

EXPLORING = 120
"""Lines of each receptance while starts are compared."""
_CLOSE = 1e-3
"""A fit has converged where the next step promises less than this of chi-square."""
_AS_GOOD = 4.0
"""Ends on few lines whose chi-square differs by less may change places on all of them."""
_MOST = 100
_EXPLORING_MOST = 30
_BEGUN = 8
_CONTINUED = 2
"""Every start may take so many evaluations, and so many of them go on."""


def numbers_of(one: Observation) -> float:
    """Return the effective number of independent observed numbers of an observation."""
    if isinstance(one, MeasuredFRF):
        return 2.0 * one.independent_lines
    return float(one.frequency_hz.size + one.damped.size)


@dataclass(frozen=True, eq=False)
class Fit:
    """A model at its best point.

    Attributes
    ----------
    model : Model
        What was fitted.
    task : Task
        The same as a task of the identification.
    problem : Problem
        Its residuals on all lines.
    x : ndarray
        The fitted variables.
    chi_square : float
        Sum of the squared residuals, priors included.
    converged : bool
        Whether the end is one, and no other start that ended better was left unfinished.
    evaluations : int
        How often all observations were calculated on the way.
    regained : float
        Decrease of chi-square on all lines from where the few lines had led: what thinning had lost.
    """

    model: Model
    task: Task
    problem: Problem
    x: NDArray[np.float64]
    chi_square: float
    converged: bool
    evaluations: int = 0
    regained: float = 0.0

    @cached_property
    def values(self) -> dict[str, float]:
        """Values in SI units by name."""
        return self.problem.named(self.x)

    @cached_property
    def residual(self) -> NDArray[np.float64]:
        """All residuals, priors last."""
        return self.problem.residual(self.x).copy()

    @cached_property
    def by_configuration(self) -> dict[str, float]:
        """Sum of squares of the lines of each configuration, priors left out."""
        sums = dict.fromkeys(self.model.configurations, 0.0)
        parts = self.problem.parts(self.residual)
        for index, (one, part) in enumerate(zip(self.model.observations, parts, strict=True)):
            sums[place_of(one, index).configuration] += float(part @ part)
        return sums

    @cached_property
    def jacobian(self) -> NDArray[np.float64]:
        """Their derivatives with respect to the fitted variables."""
        return self.problem.jacobian(self.x).copy()

    @cached_property
    def independent(self) -> float:
        """Effective number of independent observed numbers."""
        return sum(numbers_of(one) for one in self.model.observations)

    @cached_property
    def one_mode(self) -> bool:
        """Whether no observation of a jointed model has more than one mode, or lines more than an octave beyond it."""
        if not self.model.joints:
            return False
        values = self.task.variables.to_values(self.x)
        for index, one in enumerate(self.model.observations):
            if not isinstance(one, MeasuredFRF):
                if one.frequency_hz.size > 1:
                    return False
                continue
            if not one.assembly.countable:
                return False
            low, high = (float(one.frequency_hz[i].real) for i in (0, -1))
            assembly = self.task.parameters.at(place_of(one, index)).apply(one.assembly, values)
            modes = assembly.natural_frequencies(high)
            modes = modes[modes > low]
            if modes.size > 1 or (modes.size and not 0.5 * modes[0] < low < high < 2.0 * modes[0]):
                return False
        return True

    @property
    def left(self) -> float:
        """Degrees of freedom: a prior counts as an observed number, so errors of tolerances cost none."""
        return self.independent - sum(unknown.prior is None for unknown in self.task.parameters.unknowns)

    @property
    def freedom(self) -> float:
        """The same, but at least one, to divide by."""
        return max(self.left, 1.0)

    @property
    def misfit(self) -> float:
        """Chi-square as a multiple of what noise and floor explain."""
        return self.chi_square / self.freedom

    def identification(self, seed: int = 0, notes: Sequence[str] = ()) -> Identification:
        """Return it as the result of `identify`."""
        start = Start(
            start=self.values,
            values=self.values,
            variables=self.x,
            cost=0.5 * self.chi_square,
            evaluations=self.evaluations,
            converged=self.converged,
            message="no step promises anything more" if self.converged else "the evaluations were used up",
        )
        return conclude(self.task, self.problem, [start], loss=None, seed=seed, notes=list(notes))


def telling_lines(model: Model, lines: int = EXPLORING) -> list[NDArray[np.intp] | None]:
    """Return the lines of each receptance that tell most, close where the logarithm changes fast; None for all.

    Records of one configuration on the same lines get the same ones: one evaluation then serves all of them.
    """
    paths: dict[Any, NDArray[np.float64]] = {}
    keys: list[Any] = []
    for index, one in enumerate(model.observations):
        keys.append(None)
        if isinstance(one, MeasuredFRF) and one.frequency_hz.size > lines and one.standard_deviation is not None:
            path = np.abs(np.diff(np.log(one.receptance))) / one.standard_deviation[1:]
            path = np.minimum(path, 20.0 * np.median(path)) + np.mean(path)
            place = place_of(one, index).configuration
            keys[index] = (place, one.response, one.excitation, one.frequency_hz.tobytes())
            paths[keys[index]] = paths.get(keys[index], 0.0) + path
    chosen: dict[Any, NDArray[np.intp] | None] = {None: None}
    for key, path in paths.items():
        total = np.concatenate([[0.0], np.cumsum(path)])
        ends = np.searchsorted(total, np.linspace(0.0, total[-1], lines)).clip(0, total.size - 1)
        chosen[key] = np.unique(ends)
    return [chosen[key] for key in keys]


def thinned(model: Model, lines: int = EXPLORING) -> Model:
    """Return the model with the lines of each receptance that tell most."""

    def fewer(one: Observation, chosen: NDArray[np.intp] | None) -> Observation:
        if chosen is None or not isinstance(one, MeasuredFRF) or one.standard_deviation is None:
            return one
        return on_lines(one, chosen)

    pairs = zip(model.observations, telling_lines(model, lines), strict=True)
    return replace(model, observations=tuple(fewer(one, chosen) for one, chosen in pairs))


def problem_of(model: Model, threads: int | None) -> tuple[Task, Problem]:
    """Return a model as a task, and its residuals."""
    task = model.task(threads)
    return task, task.problem()


def _few(model: Model, threads: int | None) -> tuple[Task, Problem]:
    """Return the same on the lines that tell most."""
    task = model.task(threads)
    return task, task.problem(telling_lines(model))


def fit_base(model: Model, *, seed: int = 0, threads: int | None = None) -> Fit:
    """Return the base model fitted from far: in stages on few lines, tolerances and all, then on all lines."""
    few = thinned(model)
    if all(isinstance(one, MeasuredFRF) for one in model.observations):
        found = identify(
            few.observations,
            few.unknowns,
            tolerances=few.tolerances,
            strategy="staged",
            starts=1,
            seed=seed,
            threads=threads,
        )
    else:
        found = identify(
            few.observations, few.unknowns, tolerances=few.tolerances, starts=8, seed=seed, threads=threads
        )
    return _finish(model, found.values, threads, found.evaluations)


@dataclass(frozen=True, eq=False)
class Explored:
    """Where the starts of a model ended on few lines, the best end first."""

    model: Model
    ends: tuple[tuple[float, dict[str, float]], ...]
    evaluations: int
    threads: int | None

    @property
    def chi_square(self) -> float:
        """Best sum of squares on the few lines."""
        return self.ends[0][0] if self.ends else np.inf

    def finished(self) -> Fit:
        """Return the fit on all lines, from the best end, and from another one that is nearly as good."""
        near = [values for cost, values in self.ends if cost < self.chi_square + _AS_GOOD][:2]
        done = [_finish(self.model, values, self.threads, 0) for values in near]
        evaluations = self.evaluations + sum(fit.evaluations for fit in done)
        return replace(min(done, key=lambda fit: fit.chi_square), evaluations=evaluations)

    def evaluated(self) -> Fit:
        """Return the model at the best end on few lines, for what is too far off to be worth more."""
        task, problem = problem_of(self.model, self.threads)
        x = _vector(task, self.ends[0][1])
        residual = problem.residual(x)
        return Fit(self.model, task, problem, x, float(residual @ residual), False, self.evaluations)


def explore(model: Model, starts: Sequence[Mapping[str, float]], *, threads: int | None = None) -> Explored:
    """Return where starts lead on few lines: names and values; what they do not name is as given."""
    task, problem = _few(model, threads)
    found: list[tuple[float, NDArray[np.float64]]] = []
    begun = problem.fit(np.array([_vector(task, values) for values in starts]), _BEGUN, least=_CLOSE) if starts else []
    ranked = sorted((end for end in begun if np.isfinite(end.cost)), key=lambda end: end.cost)
    for end in ranked[:_CONTINUED]:
        if not end.converged:
            end = problem.fit_one(end.x, _EXPLORING_MOST, least=_CLOSE)
        found.append((2.0 * end.cost, end.x))
    found.sort(key=lambda pair: pair[0])
    different: list[tuple[float, NDArray[np.float64]]] = []
    for cost, x in found:
        if all(_elsewhere(x, other, task) for _, other in different):
            different.append((cost, x))
    ends = tuple((cost, problem.named(x)) for cost, x in different)
    return Explored(model, ends, problem.evaluations, threads)


def on_few_lines(fit: Fit, threads: int | None = None) -> float:
    """Return chi-square of a fit on the few lines, at its best point there."""
    _, problem = _few(fit.model, threads)
    return 2.0 * problem.fit_one(fit.x, _BEGUN, least=_CLOSE).cost


def refit(model: Model, start: Mapping[str, float], *, threads: int | None = None) -> Fit:
    """Return a model fitted on all lines from one start."""
    return _finish(model, start, threads, 0)


def _elsewhere(x: NDArray[np.float64], other: NDArray[np.float64], task: Task) -> bool:
    low, high = task.variables.limits
    return bool(np.max(np.abs(x - other) / (high - low)) > 1e-2)


def _finish(model: Model, values: Mapping[str, float], threads: int | None, before: int) -> Fit:
    task, problem = problem_of(model, threads)
    end = problem.fit_one(_vector(task, values), _MOST, least=_CLOSE)
    if not np.isfinite(end.cost):
        raise ReceptanceError(f"the model has no value at its best point: {problem.reason(end.x)}")
    regained = 2.0 * (end.first - end.cost)
    return Fit(model, task, problem, end.x, 2.0 * end.cost, end.converged, before + end.evaluations, regained)


def _vector(task: Task, values: Mapping[str, float]) -> NDArray[np.float64]:
    unknowns = task.variables.unknowns
    chosen = [min(max(float(values.get(u.name, u.start or 0.0)), u.lower), u.upper) for u in unknowns]
    return task.variables.from_values(np.array(chosen, dtype=np.float64))


def unfitted(model: Model, threads: int | None = None) -> Fit:
    """Return a model where its fit would begin."""
    task, problem = problem_of(model, threads)
    x = problem.variables.start
    residual = problem.residual(x)
    return Fit(model, task, problem, x, float(residual @ residual), False)


def starting_at(fit: Fit, model: Model) -> Fit:
    """Return a model at the point of a fit of a smaller one, not fitted."""
    task, problem = problem_of(model, fit.task.threads)
    x = _vector(task, fit.values)
    residual = problem.residual(x)
    return replace(fit, model=model, task=task, problem=problem, x=x, chi_square=float(residual @ residual))
