"""What a small dose of each cause would do to the residuals, once everything else is fitted again, to first order.

It decides the order in which causes are tried, what chance alone would do, and which causes look alike in the data at
hand; what a cause is worth is decided by its own fit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from receptance.diagnosis.causes import Cause, Variant
from receptance.diagnosis.fitting import Fit, problem_of
from receptance.identification.residuals import InfeasibleError

__all__ = ["Direction", "chance", "directions", "look_alike"]


@dataclass(frozen=True, eq=False)
class Direction:
    """A variant of a cause, seen from a fit that does not have it.

    Attributes
    ----------
    cause, variant : Cause, Variant
        What it is.
    names : tuple of str
        Its unknowns.
    count : int
        How many of them there are.
    slopes : ndarray
        `(n, k)` what they do to the residuals, without what a refit of everything else undoes; no zero columns.
    one_sided : bool
        Whether there is one, and it can only grow.
    score : float
        Decrease of chi-square that it promises.
    step : dict of str to float
        The values at which it promises that.
    """

    cause: Cause
    variant: Variant
    names: tuple[str, ...]
    count: int
    slopes: NDArray[np.float64]
    one_sided: bool
    score: float
    step: dict[str, float]

    @cached_property
    def basis(self) -> NDArray[np.float64]:
        """Orthonormal columns that span the slopes."""
        return np.linalg.qr(self.slopes)[0]

    @property
    def step_name(self) -> tuple[Cause, str]:
        """The cause and the name of its variant."""
        return self.cause, self.variant.name


def directions(fit: Fit, variants: Sequence[tuple[Cause, Variant]]) -> list[Direction]:
    """Return what each variant promises, seen from a fit."""
    basis, _ = np.linalg.qr(fit.jacobian)
    rest = fit.residual - basis @ (basis.T @ fit.residual)
    return [_direction(fit, cause, variant, basis, rest) for cause, variant in variants]


def _direction(
    fit: Fit, cause: Cause, variant: Variant, basis: NDArray[np.float64], rest: NDArray[np.float64]
) -> Direction:
    before = {u.name for u in fit.model.unknowns}
    names = tuple(u.name for u in variant.model.unknowns if u.name not in before)
    empty = Direction(cause, variant, names, len(names), np.zeros((rest.size, 0)), False, 0.0, {})
    if variant.fresh or not names:
        return empty
    try:
        own, starts = _slopes(fit, variant, names)
    except InfeasibleError:
        return empty
    data = own.shape[0]
    # Priors of the base do not feel the cause, and one of its own is zero at its null.
    slopes = np.zeros((rest.size, len(names)))
    slopes[:data] = own
    slopes = slopes - basis @ (basis.T @ slopes)
    norms = np.linalg.norm(slopes, axis=0)
    seen = norms > 1e-8 * max(float(norms.max(initial=0.0)), 1e-300)
    slopes = slopes[:, seen]
    if not slopes.shape[1]:
        return empty
    solution, *_ = np.linalg.lstsq(slopes, -rest, rcond=1e-10)
    seen_names = [name for name, yes in zip(names, seen, strict=True) if yes]
    lone = len(seen_names) == 1 and cause.parameter_of(seen_names[0]).one_sided
    score = float(-rest @ (slopes @ solution))
    if lone and not _allowed(cause, seen_names[0], float(solution[0])):
        solution, score = np.zeros(1), 0.0
    step = _step(cause, starts, dict(zip(seen_names, map(float, solution), strict=True)))
    return Direction(cause, variant, names, len(names), slopes, lone, score, step)


def _slopes(fit: Fit, variant: Variant, names: tuple[str, ...]) -> tuple[NDArray[np.float64], dict[str, float]]:
    """Return the derivatives of the observed residuals with respect to a variant's own unknowns, and where these start.

    Nothing else is asked of the core.
    """
    task, problem = problem_of(variant.model, fit.task.threads)
    unknowns = task.parameters.unknowns
    values = np.array([fit.values.get(u.name, u.start or 0.0) for u in unknowns], dtype=np.float64)
    fresh = np.array([u.name in names for u in unknowns])
    x = task.variables.from_values(values)
    rows = problem.slopes(x, fresh) / task.variables.slopes(values)[fresh]
    return rows[: sum(problem.sizes)], {u.name: float(u.start or 0.0) for u in unknowns if u.name in names}


def _step(cause: Cause, starts: dict[str, float], solution: dict[str, float]) -> dict[str, float]:
    """Return where a solution to first order leads.

    What is secondary has slopes in proportion to the dose at which they were taken, and moves so much less as the
    cause has become larger than that.
    """
    main = [name for name in solution if not cause.parameter_of(name).secondary]
    step = {name: starts[name] + solution[name] for name in solution}
    if len(main) != 1:
        return step
    dose, there = starts[main[0]], step[main[0]]
    for name in set(solution) - set(main):
        step[name] = starts[name] + (solution[name] * dose / there if there else 0.0)
    return step


def _allowed(cause: Cause, name: str, step: float) -> bool:
    parameter = cause.parameter_of(name)
    return step > 0.0 if parameter.null == parameter.lower else step < 0.0


def chance(
    found: Sequence[Direction], penalty: float, *, level: float = 0.999, draws: int = 20000, seed: int = 0
) -> float:
    """Return what the best cause gains in evidence by chance alone, at a level: the base bootstrapped, to first order.

    Residuals are drawn from noise and priors; every cause is fitted to them as its direction says, and the largest gain
    in evidence, the decrease of chi-square less `penalty` for each unknown, is noted. The level is high because this is
    chance to first order of noise whose size is known: that of ten hits is measured, and of 150 virtual diagnoses
    with nothing hidden five passed the level .99.
    """
    kept = [one for one in found if one.slopes.shape[1]]
    if not kept:
        return 0.0
    matrix = np.hstack([one.slopes / np.linalg.norm(one.slopes, axis=0) for one in kept])
    gram = matrix.T @ matrix
    values, vectors = np.linalg.eigh(gram)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    noise = np.random.default_rng([seed, 20]).standard_normal((draws, gram.shape[0])) @ root.T
    best = np.full(draws, -np.inf)
    begin = 0
    for one in kept:
        own = slice(begin, begin + one.slopes.shape[1])
        begin = own.stop
        pull = noise[:, own]
        gain = np.einsum("di,ij,dj->d", pull, np.linalg.pinv(gram[own, own], rcond=1e-10), pull)
        if one.one_sided:
            gain = np.where(pull[:, 0] > 0.0, gain, 0.0)
        best = np.maximum(best, gain - penalty * one.count)
    return float(np.quantile(best, level))


def look_alike(first: Direction, second: Direction) -> float:
    """Return how much of the smaller of two causes the other one can do, from 0 to 1: the largest canonical cosine."""
    if not first.slopes.shape[1] or not second.slopes.shape[1]:
        return 0.0
    both = first.basis.T @ second.basis
    return float(np.linalg.svd(both, compute_uv=False)[0].clip(0.0, 1.0))
