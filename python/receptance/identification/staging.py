"""The staged fit: natural frequencies first, then broad resonances, then the data as they are.

The squared log residual of a lightly damped receptance has a narrow valley: a start whose resonances are off by more
than their width slides into another one. So every start is led through problems that are easier and easier to miss:
the peaks as natural frequencies, the receptance with damping added to data and model alike (`smearing`) and taken down
step by step, and only then the whitened complex log residual itself. The early stages see few lines and take
tolerances as exact; whatever they end in is only a start.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from receptance.identification.minimise import minimise
from receptance.identification.observations import MeasuredFrequencies
from receptance.identification.result import Start
from receptance.identification.smearing import smeared

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.identification.problem import Problem
    from receptance.identification.task import Observation, Task

__all__ = ["fit_staged"]

_WIDTHS = (0.3, 0.1, 0.03, 0.01)
"""Relative widths of the resonances, step by step."""
_LINES = 80
"""Lines of each receptance in the early stages."""
_MORE = 15
"""Starts that are drawn besides each given one."""
_KEPT = 4
"""How many different ends go on to the data as they are."""
_NEAR = 0.02
"""Ends closer than this share of the range are the same."""
_EARLY = 30
"""Most evaluations of an early stage."""


def fit_staged(
    task: Task, problem: Problem, starts: NDArray[np.float64], seed: int, most: int, tolerance: float
) -> list[Start]:
    """Return the end of every given start, the best of the ends that it was led to."""
    exact = task.without_errors()
    ladder = [_with(exact, [smeared(o, width, _LINES) for o in task.observed]) for width in _WIDTHS]
    peaks = _peaks(exact)
    drawn = task.variables.draw(1 + _MORE, seed)[1:]
    return [_one(task, problem, peaks, ladder, np.vstack([x, drawn]), most, tolerance) for x in starts]


def _with(task: Task, observed: Sequence[Observation]) -> Problem:
    other = task.on(observed, ["standard deviations"] * len(observed))
    return other.quick(other.problem())


def _peaks(task: Task) -> Problem | None:
    """Return the peaks of the receptances as natural frequencies, numbered from the lowest."""
    from scipy.signal import find_peaks  # slow to import

    found: list[Observation] = []
    for one in task.observed:
        if isinstance(one, MeasuredFrequencies):
            found.append(smeared(one, 0.05, 0))
            continue
        places, _ = find_peaks(np.log(np.abs(one.receptance)), prominence=1.0)
        if not len(places):
            return None
        frequency = one.frequency_hz.real[places]
        found.append(
            MeasuredFrequencies(
                assembly=one.assembly,
                frequency_hz=frequency,
                standard_deviation_hz=0.03 * frequency,
                label=one.label,
                configuration=one.configuration,
                conditions=one.conditions,
            )
        )
    return _with(task, found)


def _one(
    task: Task,
    problem: Problem,
    peaks: Problem | None,
    ladder: Sequence[Problem],
    starts: NDArray[np.float64],
    most: int,
    tolerance: float,
) -> Start:
    before = problem.evaluations
    count = task.parameters.count
    ends = []
    for x in starts[:, :count]:
        begun = _feasible(ladder[0], x)
        if begun is None:
            continue
        ends.append(_led(ladder[:1], begun))
        if peaks is not None:
            near = minimise(peaks, begun, most=_EARLY, least=1e-3)
            if np.isfinite(near.cost):
                ends.append(_led(ladder[:1], near.x))
    ends = [_led(ladder[1:2], x) for _, x in _different(ends, task, 2 * _KEPT)]
    ends = [_led(ladder[2:], x) for _, x in _different(ends, task, _KEPT)]
    best = None
    for _, x in _different(ends, task, _KEPT):
        whole = np.append(x, task.variables.start[count:])
        end = minimise(problem, whole, most=most, least=min(tolerance * max(problem.size, 1), 1e-6))
        if best is None or end.cost < best.cost:
            best = end
    first = problem.named(starts[0])
    if best is None or not np.isfinite(best.cost):
        return Start(
            start=first,
            values=first,
            variables=starts[0],
            cost=np.inf,
            evaluations=problem.evaluations - before,
            converged=False,
            message=problem.reason or "the model has no value there",
        )
    return Start(
        start=first,
        values=problem.named(best.x),
        variables=best.x,
        cost=best.cost,
        evaluations=problem.evaluations - before,
        converged=best.converged,
        message="no step promises anything more" if best.converged else "the evaluations were used up",
    )


def _led(ladder: Sequence[Problem], x: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
    """Return the cost of the last stage and where it ended."""
    cost = np.inf
    for stage in ladder:
        end = minimise(stage, x, most=_EARLY, least=1e-3)
        if np.isfinite(end.cost):
            x, cost = end.x, end.cost
    return cost, x


def _feasible(stage: Problem, x: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Return a start at which the model has a value: what may have either sign goes back to its own start."""
    if np.isfinite(stage.residual(x)).all():
        return x
    variables = stage.variables
    other = np.where(variables.logarithmic, x, variables.start)
    return other if np.isfinite(stage.residual(other)).all() else None


def _different(
    ends: Sequence[tuple[float, NDArray[np.float64]]], task: Task, most: int
) -> list[tuple[float, NDArray[np.float64]]]:
    """Return the best ends that are different ones."""
    low, high = task.variables.limits[:, : task.parameters.count]
    kept: list[tuple[float, NDArray[np.float64]]] = []
    for cost, x in sorted((end for end in ends if np.isfinite(end[0])), key=lambda end: end[0]):
        if len(kept) == most:
            break
        if all(np.max(np.abs(x - other) / (high - low)) > _NEAR for _, other in kept):
            kept.append((cost, x))
    return kept
