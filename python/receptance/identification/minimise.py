"""Levenberg and Marquardt's method with bounds and fixed variables, for the many small fits around one optimum.

A profile is some hundred fits that begin next to their end. SciPy's trust-region method decomposes the whole Jacobian
at every step; here the steps come from the normal matrix, which has as many rows as there are variables, and variables
that are fixed or at a bound with the slope pointing outwards are left out of it. The tests hold it to SciPy's optimum.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.identification.problem import Problem

__all__ = ["Found", "minimise"]

_FIRST = 1e-4
"""Damping of the first step, as a share of the curvature: a warm start is nearly right."""
_WHOLE = 1e-2
"""Damping up to which a step counts as undamped."""
_MOST_DAMPED = 1e12
_ROUNDING = 1e-13
"""A relative decrease of the cost that could be rounding."""


class Found(NamedTuple):
    """Where a fit ended: the variables, half the sum of squares, the normal matrix there, evaluations.

    `first` is half the sum of squares where it began.
    """

    x: NDArray[np.float64]
    cost: float
    normal: NDArray[np.float64]
    evaluations: int
    converged: bool
    first: float = np.inf


def minimise(
    problem: Problem,
    x: NDArray[np.float64],
    *,
    free: NDArray[np.bool_] | None = None,
    most: int = 100,
    least: float = 1e-6,
) -> Found:
    """Return the least sum of squares near a start.

    Parameters
    ----------
    problem : Problem
        The residuals.
    x : ndarray
        Start, within the bounds.
    free : ndarray of bool, optional
        Which variables move; by default all.
    most : int, optional
        Most evaluations.
    least : float, optional
        It ends where the next step promises less decrease of the cost than this.
    """
    low, high = problem.variables.limits
    moving = np.ones(x.size, dtype=np.bool_) if free is None else free
    before = problem.evaluations
    x = np.clip(x, low, high)
    cost, gradient, normal = _at(problem, x)
    first = cost
    damping, growth = _FIRST, 2.0
    converged = tried = False
    while np.isfinite(cost) and problem.evaluations - before < most:
        own = moving & ~((x <= low) & (gradient > 0.0)) & ~((x >= high) & (gradient < 0.0))
        if not own.any():
            converged = True
            break
        step = _bounded_step(normal, gradient, damping, own, low - x, high - x)
        trial = np.clip(x + step, low, high)
        step = trial - x
        promised = -float(gradient @ step + 0.5 * step @ normal @ step)
        if promised < 0.0 and damping < _MOST_DAMPED:
            # Variables that were stopped at bounds can turn a long step uphill; a short one goes down.
            damping *= growth
            growth *= 2.0
            continue
        if promised <= max(least, _ROUNDING * cost):
            # A damped step promises little of its own; only a whole one says that there is nothing left.
            if damping <= _WHOLE or tried:
                converged = promised >= 0.0
                break
            tried, damping = True, _FIRST
            continue
        tried = False
        there, slope, curvature = _at(problem, trial)
        gain = (cost - there) / promised if np.isfinite(there) else -1.0
        if gain > 1e-4:
            x, cost, gradient, normal = trial, there, slope, curvature
            damping = max(damping * max(0.1, 1.0 - (2.0 * gain - 1.0) ** 3), 1e-12)
            growth = 2.0
        else:
            damping *= growth
            growth *= 2.0
            if damping > _MOST_DAMPED:
                break
    return Found(x, cost, normal, problem.evaluations - before, converged, first)


def _at(problem: Problem, x: NDArray[np.float64]) -> tuple[float, NDArray[np.float64], NDArray[np.float64]]:
    there = problem.normal(x)
    return there or (np.inf, np.zeros(x.size), np.zeros((x.size, x.size)))


def _bounded_step(
    normal: NDArray[np.float64],
    gradient: NDArray[np.float64],
    damping: float,
    own: NDArray[np.bool_],
    down: NDArray[np.float64],
    up: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the step of the variables that move; those that would pass a bound stop there, and the rest know it."""
    step = np.zeros_like(gradient)
    left = own.copy()
    while left.any():
        pull = gradient[left] + normal[np.ix_(left, ~left)] @ step[~left]
        step[left] = _step(normal[np.ix_(left, left)], pull, damping)
        passed = left & ((step < down) | (step > up))
        if not passed.any():
            break
        step[passed] = np.clip(step[passed], down[passed], up[passed])
        left &= ~passed
    return step


def _step(normal: NDArray[np.float64], gradient: NDArray[np.float64], damping: float) -> NDArray[np.float64]:
    # A column that nearly cancels out can have a square just below zero.
    scale = np.sqrt(np.maximum(np.diag(normal), 0.0))
    scale = np.where(scale > 0.0, scale, 1.0)
    matrix = normal / np.outer(scale, scale)
    # The last digits keep what the data do not see at all where it is.
    matrix[np.diag_indices_from(matrix)] += damping + 1e-14
    result: NDArray[np.float64] = -np.linalg.solve(matrix, gradient / scale) / scale
    return result
