"""Fits of the base model and of its extensions: one least-squares problem each, with tolerances, from several starts.

Starts are compared on the most informative lines, and the best ones are fitted on all lines, so that the selection of
lines does not affect the result.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from receptance.diagnosis.line_selection import informative_lines, thin
from receptance.diagnosis.model import Model
from receptance.diagnosis.thresholds import (
    CONTINUED_STARTS,
    CONVERGED,
    DIFFERENT_END,
    EVALUATIONS,
    EVALUATIONS_EXPLORING,
    EVALUATIONS_OF_BASE,
    EVALUATIONS_OF_START,
    SAME_END,
    TOLERANCE_OF_BASE,
)
from receptance.errors import ReceptanceError
from receptance.identification.fit import conclude
from receptance.identification.observations import MeasuredFRF
from receptance.identification.result import Identification, Start
from receptance.identification.search import fit_direct, fit_staged

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.identification.observations import Observation
    from receptance.identification.problem import Problem
from receptance.identification.task import Task

__all__ = [
    "Explored",
    "Fit",
    "chi_square_on_few_lines",
    "evaluate_at",
    "evaluate_start",
    "explore",
    "fit_base",
    "observed_numbers",
    "problem_of",
    "refit",
]


def observed_numbers(one: Observation) -> float:
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
        The fitted model.
    task : Task
        The model as a task of the identification.
    problem : Problem
        Its residuals on all lines.
    x : ndarray
        The fitted variables.
    chi_square : float
        Sum of the squared residuals, priors included.
    converged : bool
        Whether the fit has converged.
    evaluations : int
        Number of evaluations of all observations.
    regained : float
        Decrease of chi-square on all lines from the end point on few lines: the loss by the selection of lines.
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
        """Values of the unknowns in SI units by name."""
        return self.problem.named(self.x)

    @cached_property
    def residual(self) -> NDArray[np.float64]:
        """All residuals, priors last."""
        return self.problem.residual(self.x).copy()

    @cached_property
    def by_configuration(self) -> dict[str, float]:
        """Sum of squared residuals of each configuration, without priors."""
        sums = dict.fromkeys(self.model.configurations, 0.0)
        parts = self.problem.parts(self.residual)
        for index, (one, part) in enumerate(zip(self.model.observations, parts, strict=True)):
            sums[one.site(index).configuration] += float(part @ part)
        return sums

    @cached_property
    def jacobian(self) -> NDArray[np.float64]:
        """Derivatives of the residuals with respect to the fitted variables."""
        return self.problem.jacobian(self.x).copy()

    @cached_property
    def independent(self) -> float:
        """Effective number of independent observed numbers."""
        return sum(observed_numbers(one) for one in self.model.observations)

    @cached_property
    def one_mode(self) -> bool:
        """Whether no observation of a jointed model has two modes, or lines more than an octave beyond its only one."""
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
            assembly = self.task.parameters.at(one.site(index)).apply(one.assembly, values)
            modes = assembly.natural_frequencies(high)
            modes = modes[modes > low]
            if modes.size > 1 or (modes.size and not 0.5 * modes[0] < low < high < 2.0 * modes[0]):
                return False
        return True

    @property
    def left(self) -> float:
        """Degrees of freedom; a prior counts as an observed number, so errors of tolerances use none."""
        return self.independent - sum(unknown.prior is None for unknown in self.task.parameters.unknowns)

    @property
    def freedom(self) -> float:
        """Degrees of freedom, at least one."""
        return max(self.left, 1.0)

    @property
    def misfit(self) -> float:
        """Chi-square divided by its expectation from noise and floor."""
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
            message="converged" if self.converged else "the limit of evaluations was reached",
        )
        return conclude(self.task, self.problem, [start], loss=None, seed=seed, notes=list(notes))


def problem_of(model: Model, threads: int | None) -> tuple[Task, Problem]:
    """Return a model as a task, and its residuals."""
    task = model.task(threads)
    return task, task.problem()


def _few(model: Model, threads: int | None) -> tuple[Task, Problem]:
    """Return the same on the most informative lines."""
    task = model.task(threads)
    return task, task.problem(informative_lines(model))


def fit_base(model: Model, *, seed: int = 0, threads: int | None = None) -> Fit:
    """Return the model fitted from its own starting values: in stages on few lines, then on all lines."""
    task = thin(model).task(threads)
    problem = task.problem()
    # Not `identify`: it enlarges the noise where data contradict the model, which would hide the misfit.
    if all(isinstance(one, MeasuredFRF) for one in model.observations):
        starts = task.variables.draw(1, seed)
        runs = fit_staged(task, problem, starts, seed, EVALUATIONS_OF_BASE, TOLERANCE_OF_BASE)
    else:
        runs = fit_direct(problem, task.variables.draw(8, seed), EVALUATIONS_OF_BASE, TOLERANCE_OF_BASE)
    best = min(runs, key=lambda run: run.cost)
    if not np.isfinite(best.cost):
        raise ReceptanceError(f"the model cannot be evaluated at any start of the fit: {best.message}")
    return _finish(model, best.values, threads, problem.evaluations)


@dataclass(frozen=True, eq=False)
class Explored:
    """End points of the starts of a model on few lines, the best one first.

    Attributes
    ----------
    model : Model
        The model.
    ends : tuple of (float, dict of str to float)
        Chi-square and values of each different end point.
    evaluations : int
        Number of evaluations of all observations.
    threads : int or None
        As in `Assembly.receptance`.
    """

    model: Model
    ends: tuple[tuple[float, dict[str, float]], ...]
    evaluations: int
    threads: int | None

    @property
    def chi_square(self) -> float:
        """Smallest chi-square on few lines."""
        return self.ends[0][0] if self.ends else np.inf

    def finish(self) -> Fit:
        """Return the fit on all lines, the better one from the best end point and from another one nearly as good."""
        near = [values for cost, values in self.ends if cost < self.chi_square + SAME_END][:2]
        done = [_finish(self.model, values, self.threads, 0) for values in near]
        evaluations = self.evaluations + sum(fit.evaluations for fit in done)
        return replace(min(done, key=lambda fit: fit.chi_square), evaluations=evaluations)

    def evaluate(self) -> Fit:
        """Return the model on all lines at the best end point of few lines, without a further fit."""
        task, problem = problem_of(self.model, self.threads)
        x = _vector(task, self.ends[0][1])
        residual = problem.residual(x)
        return Fit(self.model, task, problem, x, float(residual @ residual), False, self.evaluations)


def explore(model: Model, starts: Sequence[Mapping[str, float]], *, threads: int | None = None) -> Explored:
    """Return the end points of fits on few lines.

    Parameters
    ----------
    model : Model
        The model.
    starts : sequence of mapping of str to float
        Values of unknowns by name; the other unknowns begin at their own starts.
    threads : int, optional
        As in `Assembly.receptance`.
    """
    task, problem = _few(model, threads)
    found: list[tuple[float, NDArray[np.float64]]] = []
    vectors = [_vector(task, values) for values in starts]
    begun = problem.fit(np.array(vectors), EVALUATIONS_OF_START, least=CONVERGED) if vectors else []
    ranked = sorted((end for end in begun if np.isfinite(end.cost)), key=lambda end: end.cost)
    for end in ranked[:CONTINUED_STARTS]:
        if not end.converged:
            end = problem.fit_one(end.x, EVALUATIONS_EXPLORING, least=CONVERGED)
        found.append((2.0 * end.cost, end.x))
    found.sort(key=lambda pair: pair[0])
    different: list[tuple[float, NDArray[np.float64]]] = []
    for cost, x in found:
        if all(_differ(x, other, task) for _, other in different):
            different.append((cost, x))
    ends = tuple((cost, problem.named(x)) for cost, x in different)
    return Explored(model, ends, problem.evaluations, threads)


def chi_square_on_few_lines(fit: Fit, threads: int | None = None) -> float:
    """Return chi-square of a fit on few lines, after a short fit to these."""
    _, problem = _few(fit.model, threads)
    return 2.0 * problem.fit_one(fit.x, EVALUATIONS_OF_START, least=CONVERGED).cost


def refit(model: Model, start: Mapping[str, float], *, threads: int | None = None) -> Fit:
    """Return a model fitted on all lines from one start."""
    return _finish(model, start, threads, 0)


def _differ(x: NDArray[np.float64], other: NDArray[np.float64], task: Task) -> bool:
    low, high = task.variables.limits
    return bool(np.max(np.abs(x - other) / (high - low)) > DIFFERENT_END)


def _finish(model: Model, values: Mapping[str, float], threads: int | None, before: int) -> Fit:
    task, problem = problem_of(model, threads)
    end = problem.fit_one(_vector(task, values), EVALUATIONS, least=CONVERGED)
    if not np.isfinite(end.cost):
        raise ReceptanceError(f"the model cannot be evaluated at any start of the fit: {problem.reason(end.x)}")
    regained = 2.0 * (end.first - end.cost)
    return Fit(model, task, problem, end.x, 2.0 * end.cost, end.converged, before + end.evaluations, regained)


def _vector(task: Task, values: Mapping[str, float]) -> NDArray[np.float64]:
    unknowns = task.variables.unknowns
    chosen = [min(max(float(values.get(u.name, u.start or 0.0)), u.lower), u.upper) for u in unknowns]
    return task.variables.from_values(np.array(chosen, dtype=np.float64))


def evaluate_start(model: Model, threads: int | None = None) -> Fit:
    """Return a model at its starting values, without a fit."""
    task, problem = problem_of(model, threads)
    x = problem.variables.start
    residual = problem.residual(x)
    return Fit(model, task, problem, x, float(residual @ residual), False)


def evaluate_at(fit: Fit, model: Model) -> Fit:
    """Return a model at the values of a fit of a smaller model, without a fit."""
    task, problem = problem_of(model, fit.task.threads)
    x = _vector(task, fit.values)
    residual = problem.residual(x)
    return replace(fit, model=model, task=task, problem=problem, x=x, chi_square=float(residual @ residual))
