"""Fits of the base model and of its extensions: one least-squares problem each, with tolerances, from several starts.

Starts are compared on the most informative lines, and the best ones are fitted on all lines, so that the selection of
lines does not affect the result.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from receptance.diagnosis.model import Model, UndecidableError
from receptance.diagnosis.thresholds import (
    AT_BOUND,
    BLOCKS,
    CONTINUED_BASE,
    EVALUATIONS,
    EVALUATIONS_EXPLORING,
    EVALUATIONS_OF_BASE,
    EVALUATIONS_OF_START,
    MARGIN,
    SCREENING_LIMIT,
    TOLERANCE_OF_BASE,
)
from receptance.errors import ReceptanceError
from receptance.fit import discrepancy_fit
from receptance.fit.adequacy import MISFIT_LIMIT, Adequacy, Strain, judge, misfit_limit, strain_of
from receptance.fit.compression import Compression
from receptance.fit.discrepancy import Discrepancy
from receptance.fit.identification import conclude
from receptance.fit.line_selection import FEWEST_LINES
from receptance.fit.observation import Observation
from receptance.fit.problem import CONVERGED, End, InfeasibleError, Problem, Task
from receptance.fit.result import Identification
from receptance.fit.search import Start, fit_direct, fit_staged


@dataclass(frozen=True, eq=False)
class Fit:
    """A model at its best point."""

    model: Model
    """The fitted model."""
    x: NDArray[np.float64]
    """The fitted variables."""
    chi_square: float
    """Sum of the squared residuals, priors included."""
    converged: bool
    """Whether the fit has converged."""
    evaluations: int = 0
    """Number of evaluations of all observations."""
    regained: float = 0.0
    """Decrease of chi-square on all lines from the end point on few lines: the loss by the selection of lines."""

    @property
    def task(self) -> Task:
        """The model as a task of the identification."""
        return self.model.task

    @property
    def problem(self) -> Problem:
        """The residuals on all lines."""
        return self.model.problem

    @cached_property
    def values(self) -> dict[str, float]:
        """Values of the unknowns in SI units by name."""
        return self.problem.named(self.x)

    @cached_property
    def residual(self) -> NDArray[np.float64]:
        """All residuals, priors last."""
        try:
            return self.problem.value(self.x)
        except InfeasibleError:
            return np.full(self.problem.size, np.inf)

    @property
    def parts(self) -> list[NDArray[np.float64]]:
        """Residuals of each observation."""
        return self.problem.parts(self.residual)

    @cached_property
    def by_configuration(self) -> dict[str, float]:
        """Sum of squared residuals of each configuration, without priors."""
        sums = dict.fromkeys(self.model.configurations, 0.0)
        for name, part in zip(self.model.configuration_of, self.parts, strict=True):
            sums[name] += float(part @ part)
        return sums

    @cached_property
    def adequacy(self) -> Adequacy:
        """Agreement with the data."""
        has_priors = any(unknown.prior is not None for unknown in self.task.parameters.unknowns)
        strain = strain_of(self.task, self.residual, self.curvature_root) if has_priors else Strain()
        return judge(self.model.observations, self.parts, self.chi_square, self.expected_chi_square, strain)

    @cached_property
    def curvature_root(self) -> NDArray[np.float64]:
        """R with R^T R = J^T J for the derivatives J of the residuals with respect to the fitted variables."""
        return self.problem.curvature_root(self.x)

    @cached_property
    def basis(self) -> NDArray[np.float64]:
        """Orthonormal columns that span the derivatives of the compressed data by the variables that no bound holds.

        A variable beyond its bound would explain residuals that the fit cannot.
        """
        try:
            # The problem would keep them.
            residual, slopes = self.compressed_problem.rows(self.x, np.ones(self.x.size, dtype=np.bool_))
        except InfeasibleError:
            residual, slopes = (
                np.zeros(self.compressed_problem.size),
                np.zeros((self.compressed_problem.size, self.x.size)),
            )
        return np.linalg.qr(slopes[:, ~self._held(slopes.T @ residual)])[0]

    @cached_property
    def compressed_residual(self) -> NDArray[np.float64]:
        """The residuals on the compressed data, priors last."""
        try:
            return self.compressed_problem.value(self.x)
        except InfeasibleError:
            return np.full(self.compressed_problem.size, np.inf)

    def _held(self, gradient: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return the mask of variables at a bound beyond which chi-square decreases."""
        low, high = self.task.variables.limits
        near = AT_BOUND * (high - low)
        held: NDArray[np.bool_] = ((self.x - low <= near) & (gradient > 0.0)) | (
            (high - self.x <= near) & (gradient < 0.0)
        )
        return held

    @cached_property
    def compression(self) -> Compression | None:
        """The data compressed about it; None where that is not worthwhile.

        The lines of truncated records have ripples, which blocks would hide.
        """
        if self.model.ends or not np.isfinite(self.residual).all():
            return None
        return Compression.about(self.model.observations, self.parts, self.model.configuration_of, BLOCKS)

    def compress(self, observations: Sequence[Observation]) -> tuple[Observation, ...]:
        """Return the observations of a model of the same data, compressed about this fit."""
        return tuple(observations) if self.compression is None else self.compression.of(observations)

    @cached_property
    def compressed_problem(self) -> Problem:
        """The residuals on the compressed data."""
        return self.problem if self.compression is None else self.task.problem(self.compress(self.model.observations))

    @cached_property
    def independent_values(self) -> float:
        """Effective number of independent measured values."""
        return sum(observation.independent_values for observation in self.model.observations)

    @cached_property
    def one_mode(self) -> bool:
        """Whether no observation of a jointed model has two modes, or lines more than an octave beyond its only one."""
        if not self.model.joints:
            return False
        values = self.task.variables.to_values(self.x)
        for observation, placed in zip(self.model.observations, self.task.mappings, strict=True):
            if not observation.is_receptance:
                if observation.frequency_hz.size > 1:
                    return False
                continue
            if not observation.assembly.countable:
                return False
            low, high = (float(observation.frequency_hz[i].real) for i in (0, -1))
            modes = placed.apply(observation.assembly, values).natural_frequencies(high)
            modes = modes[modes > low]
            if modes.size > 1 or (modes.size and not 0.5 * modes[0] < low < high < 2.0 * modes[0]):
                return False
        return True

    @property
    def degrees_of_freedom(self) -> float:
        """Degrees of freedom; a prior counts as a measured value, so errors of tolerances use none."""
        return self.independent_values - sum(unknown.prior is None for unknown in self.task.parameters.unknowns)

    @property
    def expected_chi_square(self) -> float:
        """Expectation of chi-square from noise and floor: the degrees of freedom, at least one."""
        return max(self.degrees_of_freedom, 1.0)

    @property
    def misfit(self) -> float:
        """Chi-square divided by its expectation from noise and floor."""
        return self.chi_square / self.expected_chi_square

    @cached_property
    def identification(self) -> Identification:
        """The fit as the result of `identify`."""
        start = Start(
            start=self.values,
            values=self.values,
            variables=self.x,
            cost=0.5 * self.chi_square,
            evaluations=self.evaluations,
            converged=self.converged,
            message="converged" if self.converged else "the limit of evaluations was reached",
        )
        return conclude(self.task, self.problem, [start], loss=None, seed=self.model.seed, notes=[])


def fit_base(model: Model, *, continuations: int = CONTINUED_BASE) -> Fit:
    """Return the model fitted from its own starting values: in stages on few lines, then on all lines.

    The fit on all lines is continued at most so many times, while it is neither converged nor adequate.
    """
    task = model.thinned.task
    problem = task.problem()
    # Not `identify`: it enlarges the noise where data contradict the model, which would hide the misfit.
    if model.unknown_modes:
        # Unknown modes of a spindle have starts of their own, see `start_modes`: a continuation with all of them at
        # once ends in a local optimum.
        runs = fit_direct(problem, task.variables.draw(1, model.seed), EVALUATIONS_OF_BASE, TOLERANCE_OF_BASE)
    elif len(model.receptances) == len(model.observations):
        runs = fit_staged(task, problem, 1, model.seed, EVALUATIONS_OF_BASE, TOLERANCE_OF_BASE)
    else:
        runs = fit_direct(problem, task.variables.draw(8, model.seed), EVALUATIONS_OF_BASE, TOLERANCE_OF_BASE)
    best = min(runs, key=lambda run: run.cost)
    if not np.isfinite(best.cost):
        raise ReceptanceError(f"the model cannot be evaluated at any start of the fit: {best.message}")
    fit = refit(model, best.values, evaluations=problem.evaluations)
    for _ in range(continuations):
        # A fit on its way says nothing about the model.
        if fit.converged or fit.adequacy.passed:
            break
        fit = continued(fit)
    return fit


def refit(model: Model, start: Mapping[str, float], *, evaluations: int = 0) -> Fit:
    """Return a model fitted on all lines from one start.

    A fit that explains all lines with implausible errors of the tolerances is repeated with these starting at zero.

    Parameters
    ----------
    model : Model
        The model.
    start : mapping of str to float
        Values of unknowns by name; the other unknowns begin at their own starts.
    evaluations : int
        Number of evaluations that led to the start.
    """
    problem = model.problem
    end = problem.fit_one(model.task.variables.vector_of(start), EVALUATIONS, least=CONVERGED)
    if not np.isfinite(end.cost):
        raise ReceptanceError(f"the model cannot be evaluated at any start of the fit: {problem.reason(end.x)}")
    fit = _fit_of(model, end, evaluations)
    if not model.task.parameters.errors or fit.misfit > misfit_limit(fit.expected_chi_square):
        return fit
    if fit.adequacy.strain.passed or not fit.adequacy.of_lines:
        return fit
    # In a long valley, as of modes above the lines, a fit may end with errors that its lines do not require.
    is_error = np.isin(model.task.variables.names, model.task.parameters.errors)
    nominal = problem.fit_one(np.where(is_error, 0.0, end.x), EVALUATIONS, least=CONVERGED)
    if 2.0 * nominal.cost < fit.chi_square - MARGIN:
        return _fit_of(model, nominal, fit.evaluations)
    return replace(fit, evaluations=fit.evaluations + nominal.evaluations)


def _fit_of(model: Model, end: End, evaluations: int) -> Fit:
    regained = 2.0 * (end.first - end.cost)
    return Fit(model, end.x, 2.0 * end.cost, end.converged, evaluations + end.evaluations, regained)


@dataclass(frozen=True, eq=False)
class DiscrepancyFit:
    """A fit that allows for the discrepancy of its model."""

    model: Model
    """The model, with the standard deviations of the noise."""
    found: discrepancy_fit.DiscrepancyFit
    """Discrepancy and fit as those of a task."""

    @property
    def discrepancy(self) -> Discrepancy:
        """The discrepancy, estimated with the fit."""
        return self.found.discrepancy

    @property
    def deviance(self) -> float:
        """As of the fit of the task."""
        return self.found.deviance

    @property
    def errors(self) -> int:
        """Number of errors of modes."""
        return self.found.errors

    @cached_property
    def fit(self) -> Fit:
        """The fit."""
        end = self.found.end
        model = self.model.allow(self.discrepancy)
        return _fit_of(model, end, 0)


def fit_discrepancy(model: Model, start: Mapping[str, float]) -> DiscrepancyFit:
    """Return the fit of a model that allows for its discrepancy, from values of unknowns by name."""
    return DiscrepancyFit(model, discrepancy_fit.fit_discrepancy(model.task, model.task.variables.vector_of(start)))


def sufficient(fit: DiscrepancyFit) -> DiscrepancyFit:
    """Return the fit with the smallest discrepancy that explains residuals and errors of the tolerances."""
    return replace(fit, found=discrepancy_fit.sufficient(fit.model.task, fit.found))


def continued(fit: Fit) -> Fit:
    """Return a fit that reached its limit of evaluations after further ones."""
    again = refit(fit.model, fit.values, evaluations=fit.evaluations)
    return replace(again, regained=fit.regained + again.regained)


_T = TypeVar("_T")


def fit_or_none(fit: Callable[[], _T | None]) -> _T | None:
    """Return a fit; None where the model has no value at its start, or cannot have its causes."""
    try:
        return fit()
    except (ReceptanceError, UndecidableError, ValueError):
        return None


def evaluate(model: Model, values: Mapping[str, float], *, evaluations: int = 0) -> Fit:
    """Return a model on all lines at given values, without a fit; parameters as in `refit`."""
    x = model.task.variables.vector_of(values)
    try:
        residual = model.problem.value(x)
    except InfeasibleError:
        return Fit(model, x, np.inf, False, evaluations)
    return Fit(model, x, float(residual @ residual), False, evaluations)


def with_null(model: Model, fit: Fit) -> Fit:
    """Return a model with a further cause, not evaluated: with the values and chi-square of the fit without it."""
    at_null = Fit(model, model.task.variables.vector_of(fit.values), fit.chi_square, fit.converged)
    at_null.__dict__["adequacy"] = fit.adequacy
    return at_null


@dataclass(frozen=True, eq=False)
class Exploration:
    """Ends of fits of a model to compressed data, the best one first."""

    model: Model
    problem: Problem
    """Its residuals on the compressed data."""
    scatter: float | None
    """Part of chi-square on all lines beside these; None where that part depends on the end."""
    ends: tuple[End, ...]
    evaluations: int
    """Number of evaluations of all observations."""

    @cached_property
    def best(self) -> Fit | None:
        """The model on all lines at the best end; None where there is none."""
        if not self.ends:
            return None
        end = self.ends[0]
        if self.scatter is None:
            return evaluate(self.model, self.problem.named(end.x), evaluations=self.evaluations)
        return Fit(self.model, end.x, 2.0 * end.cost + self.scatter, False, self.evaluations)

    @property
    def chi_square(self) -> float:
        """Chi-square on all lines at the best end."""
        return np.inf if self.best is None else self.best.chi_square

    @property
    def misfit(self) -> float:
        """Chi-square divided by its expectation from noise and floor."""
        return np.inf if self.best is None else self.best.misfit

    def go_on(self, starts: Sequence[Mapping[str, float]]) -> Exploration:
        """Return it with the best end fitted on, after fits from further starts if no end is adequate."""
        ends = list(self.ends)
        if starts and self.misfit > MISFIT_LIMIT:
            ends += _short_fits(self.model, self.problem, starts)
        ends = [
            end if end.converged else self.problem.fit_one(end.x, EVALUATIONS_EXPLORING, least=CONVERGED)
            for end in sorted(ends, key=lambda end: end.cost)[:1]
        ]
        return replace(self, ends=tuple(ends), evaluations=self.problem.evaluations)

    def finish(self) -> Fit | None:
        """Return the fit on all lines from the best end; None where the model has no value on all lines."""
        try:
            return refit(self.model, self.problem.named(self.ends[0].x), evaluations=self.evaluations)
        except ReceptanceError:
            return None


def explore(root: Fit, model: Model, starts: Sequence[Mapping[str, float]], *, far: bool = False) -> Exploration:
    """Return the ends of short fits to the data, compressed about `root`, from starts, each as in `refit`.

    Data that are not compressed are fitted on few lines. From `far` away the errors of tolerances are fitted last,
    because they would go to their bounds.
    """
    compression = root.compression
    data = model.on_few_lines if compression is None else compression.of(model.observations)
    # Blocks about a fit far from the data do not have the same sum of squares.
    scatter = None if compression is None or root.misfit > SCREENING_LIMIT else compression.scatter
    problem = model.task.problem(data)
    ends = sorted(_short_fits(model, problem, starts, far=far), key=lambda end: end.cost)
    return Exploration(model, problem, scatter, tuple(ends), problem.evaluations)


def _short_fits(
    model: Model, problem: Problem, starts: Sequence[Mapping[str, float]], *, far: bool = False
) -> list[End]:
    vectors = np.array([model.task.variables.vector_of(values) for values in starts]).reshape(len(starts), -1)
    if far:
        free = np.arange(vectors.shape[1]) < model.task.parameters.count
        coarse = problem.thinned(FEWEST_LINES) or problem
        vectors = np.array([end.x for end in coarse.fit(vectors, EVALUATIONS_EXPLORING, free=free, least=CONVERGED)])
        problem.evaluations += coarse.evaluations * (coarse is not problem)
    ends = problem.fit(vectors, EVALUATIONS_OF_START, least=CONVERGED)
    return [end for end in ends if np.isfinite(end.cost)]
