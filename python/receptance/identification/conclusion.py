"""The result of a fit from the ends of all starts, with uncertainty and advice."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from receptance.identification.covariance import covariance_of, variance_factor
from receptance.identification.observations import MeasuredFRF
from receptance.identification.result import Identification, Start
from receptance.identification.unknowns import Variables
from receptance.report import Provenance

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.identification.problem import Problem
    from receptance.identification.task import Observation, Task

__all__ = ["conclude", "contradicts"]

_TIED = 0.99
"""Least correlation of two parameters that are reported as tied."""
_AT_BOUND = 1e-3
"""Largest distance from a bound, as a share of the range, of a variable that is reported at its bound."""
_SAME = 0.2
"""Ends that differ by less than this many standard errors are one optimum."""
_SMALL_PROBABILITY = 1e-3
"""Standard deviations are reported as too large below this probability of so small a chi-square."""
_LARGE_PROBABILITY = 0.01
"""Data and model are contradictory below this probability of so large a chi-square."""
_UNEXPLAINED = 2.0
"""Residuals are reported as unexplained above this rms, in standard deviations, and as too small below its inverse."""


def conclude(
    task: Task,
    problem: Problem,
    runs: Sequence[Start],
    *,
    loss: float | None,
    seed: int,
    notes: list[str],
) -> Identification:
    """Return the result of the best run."""
    variables, observed = problem.variables, task.observed
    known = "standard deviations" in task.units
    count = len(variables.unknowns)
    best = min(runs, key=lambda run: run.cost)
    residual = problem.value(best.variables)
    inverse, correlation = covariance_of(problem.curvature_root(best.variables))
    factor = 1.0 if known else variance_factor(residual, count, loss)
    covariance = np.full_like(inverse, np.inf) if np.isinf(factor) else _scaled(inverse, factor)
    values = np.array([best.values[name] for name in variables.names])
    errors = np.sqrt(np.diag(covariance)) * variables.slopes(values)
    # Residuals are reported in the stated standard deviations.
    parts = [task.noise_factor * part for part in problem.parts(residual)]
    rms = float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))
    same, elsewhere = _count_optima(runs, best, variables, residual.size, np.sqrt(np.diag(covariance)))
    if not known and residual.size == count:
        notes.append(
            "there are as many unknowns as observed numbers, so the scatter cannot be estimated and the standard "
            "errors are infinite: give the observations standard deviations"
        )
    lost = [run for run in runs if not np.isfinite(run.cost)]
    if lost:
        notes.append(f"the model has no value at {len(lost)} of {len(runs)} starts; at the first: {lost[0].message}")
    return Identification(
        unknowns=variables.unknowns,
        values=dict(best.values),
        standard_errors=dict(zip(variables.names, errors.tolist(), strict=True)),
        covariance=covariance,
        correlation=correlation,
        residuals=parts,
        units=list(task.units),
        labels=[o.label or f"observation {i}" for i, o in enumerate(observed)],
        rms=rms,
        degrees_of_freedom=residual.size - count,
        known_scatter=known,
        noise_factor=task.noise_factor,
        converged=best.converged,
        advice=[
            *_start_advice(runs, best, same, elsewhere),
            *_bound_advice(best.variables, variables, task.parameters.errors),
            *_covariance_advice(inverse, correlation, variables.names),
            *(_misfit_advice(parts, sum(task.independent_numbers()), count, task.noise_factor) if known else ()),
            *_copy_advice(observed),
        ],
        notes=notes,
        starts=tuple(runs),
        agreeing=same,
        assemblies=[placed.apply(o.assembly, values) for placed, o in zip(task.placed, observed, strict=True)],
        evaluations=sum(run.evaluations for run in runs),
        seed=seed,
        task=task,
        provenance=Provenance(seed=seed),
    )


def _scaled(inverse: NDArray[np.float64], factor: float) -> NDArray[np.float64]:
    """Return factor times the matrix; infinite elements stay infinite if the factor is zero."""
    return np.where(np.isinf(inverse), np.inf, np.where(np.isinf(inverse), 0.0, inverse) * factor)


def _count_optima(
    runs: Sequence[Start], best: Start, variables: Variables, size: int, spread: NDArray[np.float64]
) -> tuple[int, int]:
    """Count the runs that reached the best optimum, and equally good ones that ended at another."""
    low, high = variables.limits
    # Along a flat valley ends differ by a small part of the standard errors.
    tolerance = np.maximum(_AT_BOUND * (high - low), np.where(np.isfinite(spread), _SAME * spread, 0.0))
    good = best.cost * (1.0 + 1e-3) + 1e-12 * size
    as_good = [run for run in runs if run.cost <= good]
    same = [run for run in as_good if np.all(np.abs(run.variables - best.variables) <= tolerance)]
    return len(same), len(as_good) - len(same)


def _start_advice(runs: Sequence[Start], best: Start, same: int, elsewhere: int) -> list[str]:
    advice = []
    if not best.converged:
        advice.append(
            f"not converged after {best.evaluations} evaluations ({best.message.rstrip('.')}): raise max_evaluations, "
            "give a better start, or narrow the bounds"
        )
    if elsewhere:
        advice.append(
            f"{elsewhere} start(s) fit as well with other values: the data do not distinguish them; fix a parameter or "
            "measure another assembly"
        )
    if len(runs) > 1 and same == 1 and not elsewhere:
        advice.append(
            f"only 1 of {len(runs)} starts reached the best optimum, so a better one may exist: raise starts, or "
            "narrow the bounds"
        )
    return advice


def _bound_advice(x: NDArray[np.float64], variables: Variables, errors: Sequence[str]) -> list[str]:
    low, high = variables.limits
    advice = []
    extreme: list[str] = []
    for i, unknown in enumerate(variables.unknowns):
        near = _AT_BOUND * (high[i] - low[i])
        if unknown.name in errors:
            extreme += [unknown.name] if min(x[i] - low[i], high[i] - x[i]) <= near else []
            continue
        sides = (("lower", unknown.lower, x[i] - low[i]), ("upper", unknown.upper, high[i] - x[i]))
        advice += [
            f"{unknown.name} is at its {side} bound {bound:g}: widen the bound, unless the data limit it from one "
            "side only; its interval is not valid there"
            for side, bound, distance in sides
            if distance <= near
        ]
    if extreme:
        limit = variables.unknowns[variables.names.index(extreme[0])].upper
        advice.append(
            f"{', '.join(extreme)}: {limit:g} standard deviations off, the limit of the fit: the tolerances are too "
            "small, a dimension is wrong, or the model is incomplete"
        )
    return advice


def _covariance_advice(
    inverse: NDArray[np.float64], correlation: NDArray[np.float64], names: tuple[str, ...]
) -> list[str]:
    advice = [
        f"the data do not determine {name}: fix it, or measure something that depends on it"
        for name, variance in zip(names, np.diag(inverse), strict=True)
        if np.isinf(variance)
    ]
    for i, first in enumerate(names):
        for j in range(i):
            if abs(correlation[i, j]) > _TIED:
                advice.append(
                    f"{names[j]} and {first} are tied (correlation {correlation[i, j]:+.4f}): the data determine a "
                    "combination of them; fix one, or measure another overhang or mode"
                )
    return advice


def contradicts(chi_square: float, left: float) -> bool:
    """Return whether chi-square with `left` degrees of freedom is significantly large, at the 1 % level."""
    from scipy.special import chdtrc  # the light part of scipy.stats

    return left > 0.0 and bool(chdtrc(left, chi_square) < _LARGE_PROBABILITY)


def _misfit_advice(
    residuals: Sequence[NDArray[np.float64]], independent: float, fitted: int, noise_factor: float
) -> list[str]:
    """Compare chi-square with its expectation, one for each independent number."""
    from scipy.special import chdtr  # the light part of scipy.stats

    chi_square = sum(float(np.sum(part**2)) for part in residuals)
    rms = float(np.sqrt(chi_square / independent))
    if noise_factor > 1.0:
        return [
            "the model does not explain the data within standard deviations and tolerances: it is incomplete or "
            f"these are too small; the fit and its intervals use {noise_factor:.3g} times the standard deviations"
        ]
    if rms > _UNEXPLAINED:
        return [
            f"the residuals are {rms:.3g} times what the standard deviations explain: the model is incomplete or the "
            "standard deviations are too small, and then the standard errors are too small as well"
        ]
    # Every fitted number uses one degree of freedom, errors of tolerances included.
    left = independent - fitted
    if left > 0.0 and chi_square < left / _UNEXPLAINED**2 and chdtr(left, chi_square) < _SMALL_PROBABILITY:
        share = float(np.sqrt(chi_square / left))
        return [
            f"the residuals are only {share:.2g} times what the standard deviations explain: these are stated too "
            "large (a percentage for a share, or a limit for a standard deviation?), and the standard errors are too "
            "large as well; or the data have no noise"
        ]
    return []


def _comparable(one: Observation, other: Observation) -> bool:
    # Two structures may have the same natural frequencies to the digits that are written.
    if isinstance(one, MeasuredFRF):
        return True
    return one.assembly is other.assembly or bool(one.configuration and one.configuration == other.configuration)


def _copy_advice(observed: Sequence[Observation]) -> list[str]:
    """Return advice on observations with the same numbers, which noise would make different."""
    advice = []
    names = [one.label or f"observation {i}" for i, one in enumerate(observed)]
    pairs = [
        (i, j)
        for i in range(len(observed))
        for j in range(i)
        if type(observed[i]) is type(observed[j]) and _comparable(observed[i], observed[j])
    ]
    # Sorting can take longer than a fit, so only comparable observations are sorted.
    values = {
        i: np.unique(one.receptance if isinstance(one, MeasuredFRF) else one.frequency_hz)
        for i, one in enumerate(observed)
        if any(i in pair for pair in pairs)
    }
    for i, j in pairs:
        same = np.intersect1d(values[i], values[j], assume_unique=True).size
        least = min(values[i].size, values[j].size)
        if same > 0.5 * least:
            advice.append(
                f"{names[j]} and {names[i]} have the same numbers ({same} of {least}): a measurement that counts twice "
                "makes the standard errors too small; leave one of them out"
            )
    return advice
