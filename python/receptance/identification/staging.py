"""The staged fit: natural frequencies first, then broad resonances, then the data as they are.

The squared log residual of a lightly damped receptance has a narrow valley: a start whose resonances are off by more
than their width slides into another one. So every start is led through problems that are easier and easier to miss:
the peaks as natural frequencies, the receptance with damping added to data and model alike (`smearing`) and taken down
step by step, and only then the whitened complex log residual itself. The early stages see few lines and take
tolerances as exact; whatever they end in is only a start.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from receptance.identification.minimise import minimise
from receptance.identification.models import ModelledProblem
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
_SOME = 60
"""Evaluations on all lines, after which the best ends go on."""
_AHEAD = 3
"""How many of them."""
_FINISHED = 2
"""How many of the best ends are finished where they creep."""
_LONGER = 2
"""Times the evaluations that this may take."""
_NEAR = 0.02
"""Ends closer than this share of the range are the same."""
_EARLY = 40
"""Most evaluations of an early stage."""
_EASY = 1e-4
"""Tolerance of an early stage."""
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
    count = ladder.count
    begun = np.vstack([starts, drawn])[:, :count]
    # One batch for all starts; each way has one end a start.
    ways = ladder.stiffness(begun)
    costs = [ladder.costs(way) for way in ways]
    shared = range(len(starts), len(begun))
    runs = []
    for own, x in enumerate(starts):
        ends = [(cost[i], way[i]) for way, cost in zip(ways, costs, strict=True) for i in (own, *shared)]
        before = problem.evaluations
        chosen = np.array([end for _, end in _different(ends, task, 2 * _KEPT)]).reshape(-1, count)
        errors = task.variables.start[count:]
        wholes = [np.append(end, errors) for _, end in _different(ladder.descend(chosen), task, _KEPT)]
        wholes += [end for _, end in _different(ladder.descend_with_errors(chosen, errors), task, _KEPT)]
        runs.append(_one(problem, x, wholes, before, most, tolerance))
    return runs


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
        # A dimension that is far off can mislead the exact ones, so the narrow steps are taken with errors as well.
        loose = [[o for o in step if o] for step in steps[1:]] if len(task.variables.unknowns) > self.count else []
        self.loose = [_with(task, kept) for kept in loose if len(kept) == len(task.observed)]
        self.broad = [problem for problem in problems[:_STIFFNESS] if problem is not None]
        self.narrow = [problem for problem in problems[_STIFFNESS:] if problem is not None]

    def begin(self, starts: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return starts without coupling, and with some damping that goes with their stiffness."""
        starts = np.where(self._coupling & ~self.variables.logarithmic, self.variables.start, starts)
        return self.damped(starts)

    def damped(self, starts: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the variables `(n, p)` with dampings that suit their stiffnesses."""
        values = self.variables.to_values(starts)
        for name, column in self._columns.items():
            if not self._damping[column]:
                continue
            stiffness = self._columns.get(name.replace(".c_", ".k_"))
            if name.rsplit(".", 1)[-1].startswith("loss_factor"):
                values[:, column] = _LOSS
            elif stiffness is not None:
                values[:, column] = _LOSS * values[:, stiffness] / self._angular
        values = np.clip(values, [u.lower for u in self.variables.unknowns], [u.upper for u in self.variables.unknowns])
        return self.variables.from_values(values)

    def stiffness(self, starts: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        """Return where starts lead while damping is held: by way of broad resonances, and of the peaks."""
        alone = ~(self._damping | self._coupling)
        begun = self.begin(starts)
        ways: list[list[Problem]] = [self.broad]
        if self.peaks is not None:
            ways.append([self.peaks, *self.broad[1:]])
        ends = []
        for way in ways:
            at = begun
            for stage in way:
                for free in (alone, ~self._damping):
                    there, cost = _ends(stage, self.damped(at), _EARLY, _EASY, free)
                    at = np.where(np.isfinite(cost)[:, None], there, at)
            ends.append(at)
        return ends

    def costs(self, ends: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return how well stiffnesses fit, on the narrowest of the broad problems."""
        stage = (self.broad or self.narrow)[-1:] or ([self.peaks] if self.peaks is not None else [])
        if not stage:
            return np.zeros(len(ends))
        there = [stage[0].normal(x) for x in self.damped(ends)]
        return np.array([np.inf if normal is None else normal.cost for normal in there])

    def descend(self, ends: NDArray[np.float64]) -> list[tuple[float, NDArray[np.float64]]]:
        """Return where the narrow problems lead, damping and all."""
        cost, at = self.costs(ends), self.damped(ends)
        for stage in self.narrow:
            there, found = _ends(stage, at, _EARLY, _EASY)
            kept = np.isfinite(found)
            at, cost = np.where(kept[:, None], there, at), np.where(kept, found, cost)
        return list(zip(cost.tolist(), at, strict=True))

    def descend_with_errors(
        self, ends: NDArray[np.float64], errors: NDArray[np.float64]
    ) -> list[tuple[float, NDArray[np.float64]]]:
        """Return where they lead with dimensions and materials free, as far as their tolerances let them be."""
        if not self.loose or not len(ends):
            return []
        at = np.hstack([self.damped(ends), np.tile(errors, (len(ends), 1))])
        cost = np.full(len(ends), np.inf)
        for stage in self.loose:
            there, found = _ends(stage, at, _EARLY, _EASY)
            at, cost = np.where(np.isfinite(found)[:, None], there, at), found
        return list(zip(cost.tolist(), at, strict=True))


def _ends(
    stage: Problem,
    starts: NDArray[np.float64],
    most: int,
    tolerance: float,
    free: NDArray[np.bool_] | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return where fits end, and their cost: in the core if it knows the models."""
    if not len(starts) or (free is not None and not free.any()):
        costs = [stage.normal(x) for x in starts]
        return starts, np.array([np.inf if cost is None else cost.cost for cost in costs])
    if isinstance(stage, ModelledProblem):
        ends = stage.models.fit(starts, most, tolerance, free)
        return np.array([end.x for end in ends]), np.array([end.cost for end in ends])
    found = [minimise(stage, x, free=free, most=most, least=10.0 * tolerance) for x in starts]
    return np.array([end.x for end in found]), np.array([end.cost for end in found])


def _with(task: Task, observed: Sequence[Observation]) -> Problem:
    other = task.on(observed, ["standard deviations"] * len(observed))
    whole = other.problem()
    return other.modelled(whole) or other.quick(whole)


def _peaks(task: Task) -> Problem | None:
    """Return the peaks of the receptances as natural frequencies, numbered from the lowest."""
    from scipy.signal import find_peaks  # slow to import

    if not all(one.assembly.countable for one in task.observed):
        return None

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
    problem: Problem,
    start: NDArray[np.float64],
    wholes: list[NDArray[np.float64]],
    before: int,
    most: int,
    tolerance: float,
) -> Start:
    """Return the best end of the problem itself that the easier ones led a start to."""
    first = problem.named(start)
    runs = problem.fit_all(np.array(_ahead(problem, wholes)), most, tolerance) if wholes else []
    runs = sorted(runs, key=lambda run: run.cost)[:_FINISHED]
    runs = [run if run.converged or not np.isfinite(run.cost) else _finished(problem, run, most) for run in runs]
    best = min(runs, key=lambda run: run.cost, default=None)
    if best is None or not np.isfinite(best.cost):
        return Start(
            start=first,
            values=first,
            variables=start,
            cost=np.inf,
            evaluations=problem.evaluations - before,
            converged=False,
            message=problem.reason or "the model has no value there",
        )
    return replace(best, start=first, evaluations=problem.evaluations - before)


def _ahead(problem: Problem, wholes: list[NDArray[np.float64]]) -> list[NDArray[np.float64]]:
    """Return the ends that are best after some steps on all lines, where there are many."""
    if not isinstance(problem, ModelledProblem):
        return wholes
    there, cost = _ends(problem, np.array(wholes), _SOME, _EASY)
    order = np.argsort(cost)[:_AHEAD]
    return [there[i] for i in order if np.isfinite(cost[i])] or wholes[:1]


def _finished(problem: Problem, run: Start, most: int) -> Start:
    """Return where a run leads that its evaluations did not take to the end.

    Along a bent narrow valley, stiffness against coupling, the trust region creeps, most of all where an error was
    thrown far off on the way; steps from the normal matrix with bounds left out of it are longer there.
    """
    end = minimise(problem, run.variables, most=_LONGER * most)
    if not end.cost < run.cost:
        return run
    message = "no step promises anything more" if end.converged else run.message
    values = problem.named(end.x)
    return replace(run, variables=end.x, values=values, cost=end.cost, converged=end.converged, message=message)


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
        own = x[: low.size]
        if all(np.max(np.abs(own - other[: low.size]) / (high - low)) > _NEAR for _, other in kept):
            kept.append((cost, x))
    return kept


def dense_reference(task: Task, problem: Problem, starts: int, seed: int) -> float:
    """Return the least cost from many starts over all bounds, straight into the problem: what a fit is held to.

    Dimensions and materials are exact first, as in the early stages, and then free from every different end.
    """
    exact = task.without_errors()
    bare = exact.problem()
    quick = exact.quick(bare)
    begun = [x for x in (_feasible(quick, x) for x in exact.variables.draw(starts, seed)) if x is not None]
    ends = [(run.cost, run.variables) for run in quick.fit_all(np.array(begun), 200, 1e-6)] if begun else []
    count = task.parameters.count
    wholes = [np.append(x, task.variables.start[count:]) for _, x in _different(ends, task, starts)[:8]]
    return min((run.cost for run in problem.fit_all(np.array(wholes), 200, 1e-8)), default=np.inf) if wholes else np.inf
