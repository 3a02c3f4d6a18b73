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
_STIFFNESS = 2
"""Of these steps, the first ones find stiffness alone; damping is invisible there."""
_LINES = 80
"""Lines of each receptance in the early stages."""
_MORE = 15
"""Starts that are drawn besides each given one."""
_KEPT = 4
"""How many different ends go on to the data as they are."""
_NEAR = 0.02
"""Ends closer than this share of the range are the same."""
_EARLY = 40
"""Most evaluations of an early stage."""
_LOSS = 0.02
"""Loss factor that dampings are set to before they are found."""
_PEAK = 0.003
"""Relative standard deviation of a peak as a natural frequency."""


def fit_staged(
    task: Task, problem: Problem, starts: NDArray[np.float64], seed: int, most: int, tolerance: float
) -> list[Start]:
    """Return the end of every given start, the best of the ends that it was led to."""
    ladder = Ladder(task)
    drawn = task.variables.draw(1 + _MORE, seed)[1:]
    return [_one(task, problem, ladder, np.vstack([x, drawn]), most, tolerance) for x in starts]


class Ladder:
    """The easier problems on the way to one."""

    def __init__(self, task: Task) -> None:
        exact = task.without_errors()
        self.variables = exact.variables
        self.count = len(exact.variables.unknowns)
        names = [unknown.address.split(" ")[0].rsplit(".", 1)[-1] for unknown in exact.variables.unknowns]
        self._damping = np.array([name.startswith("c_") or name == "loss_factor" for name in names])
        self._coupling = np.array([name.endswith("_ytheta") for name in names])
        self._columns = {unknown.name: i for i, unknown in enumerate(exact.variables.unknowns)}
        self._angular = 2.0 * np.pi * float(np.median([np.median(o.frequency_hz.real) for o in task.observed]))
        self.peaks = _peaks(exact)
        steps = [[smeared(o, width, _LINES) for o in task.observed] for width in _WIDTHS]
        problems = [_with(exact, kept) if len(kept := [o for o in s if o]) == len(s) else None for s in steps]
        self.broad = [problem for problem in problems[:_STIFFNESS] if problem is not None]
        self.narrow = [problem for problem in problems[_STIFFNESS:] if problem is not None]

    def begin(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return a start without coupling, and with some damping that goes with its stiffness."""
        x = np.where(self._coupling & ~self.variables.logarithmic, self.variables.start, x)
        return self.damped(x)

    def damped(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the variables with dampings that suit their stiffnesses."""
        values = self.variables.to_values(x)
        for name, column in self._columns.items():
            if not self._damping[column]:
                continue
            stiffness = self._columns.get(name.replace(".c_", ".k_"))
            if name.rsplit(".", 1)[-1].startswith("loss_factor"):
                values[column] = _LOSS
            elif stiffness is not None:
                values[column] = _LOSS * values[stiffness] / self._angular
        values = np.clip(values, [u.lower for u in self.variables.unknowns], [u.upper for u in self.variables.unknowns])
        return self.variables.from_values(values)

    def stiffness(self, x: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        """Return where a start leads while damping is held: by way of the peaks, and of broad resonances."""
        ends = []
        alone = ~(self._damping | self._coupling)
        begun = self.begin(x)
        ways: list[list[Problem]] = [self.broad]
        if self.peaks is not None:
            ways.append([self.peaks, *self.broad[1:]])
        for way in ways:
            at = begun
            for stage in way:
                for free in (alone, ~self._damping):
                    end = minimise(stage, self.damped(at), free=free, most=_EARLY, least=1e-3)
                    at = end.x if np.isfinite(end.cost) else at
            ends.append(at)
        return ends

    def cost(self, x: NDArray[np.float64]) -> float:
        """Return how well stiffness fits, on the narrowest of the broad problems."""
        stage = (self.broad or self.narrow)[-1:] or ([self.peaks] if self.peaks is not None else [])
        if not stage:
            return 0.0
        residual = stage[0].residual(self.damped(x))
        return 0.5 * float(residual @ residual)

    def descend(self, x: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        """Return where the narrow problems lead, damping and all."""
        x, cost = self.damped(x), self.cost(x)
        for stage in self.narrow:
            end = minimise(stage, x, most=_EARLY, least=1e-3)
            if np.isfinite(end.cost):
                x, cost = end.x, end.cost
        return cost, x


def _with(task: Task, observed: Sequence[Observation]) -> Problem:
    other = task.on(observed, ["standard deviations"] * len(observed))
    return other.quick(other.problem())


def _peaks(task: Task) -> Problem | None:
    """Return the peaks of the receptances as natural frequencies, numbered from the lowest."""
    from scipy.signal import find_peaks  # slow to import

    found: list[Observation] = []
    for one in task.observed:
        if isinstance(one, MeasuredFrequencies):
            found.append(one)
            continue
        places, _ = find_peaks(np.log(np.abs(one.receptance)), prominence=1.0)
        if not len(places):
            return None
        frequency = one.frequency_hz.real[places]
        found.append(
            MeasuredFrequencies(
                assembly=one.assembly,
                frequency_hz=frequency,
                standard_deviation_hz=_PEAK * frequency,
                label=one.label,
                configuration=one.configuration,
                conditions=one.conditions,
            )
        )
    return _with(task, found)


def _one(
    task: Task,
    problem: Problem,
    ladder: Ladder,
    starts: NDArray[np.float64],
    most: int,
    tolerance: float,
) -> Start:
    before = problem.evaluations
    count = ladder.count
    ends = [(ladder.cost(end), end) for x in starts[:, :count] for end in ladder.stiffness(x)]
    ends = [ladder.descend(x) for _, x in _different(ends, task, 2 * _KEPT)]
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


def dense_reference(task: Task, problem: Problem, starts: int, seed: int) -> float:
    """Return the least cost from many starts over all bounds, straight into the problem: what a fit is held to.

    Dimensions and materials are exact first, as in the early stages, and then free from every different end.
    """
    exact = task.without_errors()
    bare = exact.problem()
    quick = exact.quick(bare)
    ends = []
    for x in exact.variables.draw(starts, seed):
        begun = _feasible(quick, x)
        if begun is not None:
            end = minimise(quick, begun, most=200, least=1e-3)
            ends.append((end.cost, end.x))
    count = task.parameters.count
    costs = [
        minimise(problem, np.append(x, task.variables.start[count:]), most=200).cost
        for _, x in _different(ends, task, starts)[:8]
    ]
    return min(costs, default=np.inf)
