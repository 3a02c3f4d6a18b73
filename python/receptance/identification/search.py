"""From starts to optima: straight into the problem, or by way of easier problems.

A direct fit runs from every start on some of the lines first; the best different ends go on to all lines.

The squared log residual of a lightly damped receptance has a narrow valley: a start whose resonances are off by more
than their width leads to another optimum. A staged fit therefore goes through problems with broader valleys: the peaks
as natural frequencies, the receptance with damping added to data and model alike (`smearing`) and reduced step by step,
and only then the whitened complex log residual itself. The early stages use few lines and exact dimensions and
materials; their ends are starts of the problem itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from receptance.identification.observations import MeasuredFrequencies
from receptance.identification.result import Start
from receptance.identification.smearing import smeared

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.identification.problem import End, Problem
    from receptance.identification.task import Observation, Task

__all__ = ["different_ends", "fit_direct", "fit_staged"]

_FEW = 400
"""Lines of each receptance in the first stage of a direct fit."""
_ROUGH = 1e-4
"""Tolerance of that stage."""
_WORSE = 2.0
"""Ends of that stage with more than this many times the least cost are left there."""
_WIDTHS = (0.3, 0.1, 0.03, 0.01)
"""Relative widths of the resonances, step by step."""
_STIFFNESS = 2
"""Of these steps, the first ones find stiffness alone; damping is invisible there."""
_LINES = 80
"""Lines of each receptance in the early stages."""
_MORE = 15
"""Starts that are drawn besides each given one."""
_KEPT = 4
"""How many different ends go on to all lines."""
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
_LEAST = 1e-6
"""Decrease of the cost that is not worth another step."""
_PEAK = 0.003
"""Relative standard deviation of a peak as a natural frequency."""


def fit_direct(
    problem: Problem, starts: NDArray[np.float64], most: int, tolerance: float, begun: Sequence[End] | None = None
) -> list[Start]:
    """Return the ends of all starts: on some of the lines first, the best different ones on all.

    Parameters
    ----------
    problem : Problem
        The residuals.
    starts : ndarray
        `(n, p)`.
    most : int
        Most evaluations from each start.
    tolerance : float
        Relative change of the cost and of the variables at which a fit has converged.
    begun : sequence of End, optional
        Ends of an easier problem at which the fits begin instead.
    """
    spent, at = np.zeros(len(starts), dtype=np.int64), np.array(starts)
    if begun is not None:
        spent, at = _continued(begun, at)
    few = problem.thinned(_FEW)
    first: list[End] = []
    owners = {i: i for i in range(len(starts))}
    if few is not None:
        first = few.fit(at, np.maximum(most - spent, 1), tolerance=max(tolerance, _ROUGH))
        more, at = _continued(first, at)
        spent = spent + more
        problem.evaluations += few.evaluations
        owners = _owners(first, problem.variables.limits)
    leaders = list(dict.fromkeys(owners.values()))
    ends = problem.fit(at[leaders], np.maximum(most - spent[leaders], 1), tolerance=tolerance) if leaders else []
    last = dict(zip(leaders, ends, strict=True))
    runs = []
    for i, start in enumerate(starts):
        owner = owners.get(i)
        end = first[i] if owner is None else last[owner]
        cost, message = end.cost, end.message
        if owner is None and np.isfinite(cost):
            there = problem.normal(end.x)
            cost = np.inf if there is None else there.cost
            message = "left on fewer lines, where other starts fit better"
        runs.append(
            Start(
                start=problem.named(start),
                values=problem.named(end.x),
                variables=end.x,
                cost=cost,
                evaluations=max(int(spent[i]) + (last[i].evaluations if i in last else 0), 1),
                converged=owner is not None and end.converged,
                message=problem.reason(end.x) if end.status < 0 else message,
            )
        )
    return runs


def _continued(ends: Sequence[End], starts: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the evaluations of fits, and where the next ones begin: at their ends, or at starts without a value."""
    found = np.array([end.x if np.isfinite(end.cost) else x for end, x in zip(ends, starts, strict=True)])
    return np.array([end.evaluations for end in ends], dtype=np.int64), found.reshape(starts.shape)


def _owners(ends: Sequence[End], limits: NDArray[np.float64]) -> dict[int, int]:
    """Return for every end that is fitted further the first and best of those at the same place, itself included."""
    leaders: list[int] = []
    owners: dict[int, int] = {}
    order = sorted((i for i, end in enumerate(ends) if np.isfinite(end.cost)), key=lambda i: ends[i].cost)
    for i in order:
        near = [j for j in leaders if np.max(np.abs(ends[i].x - ends[j].x) / (limits[1] - limits[0])) <= _NEAR]
        if near:
            owners[i] = near[0]
        elif len(leaders) < _KEPT and ends[i].cost <= _WORSE * ends[order[0]].cost:
            leaders.append(i)
            owners[i] = i
    return owners


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
        chosen = np.array([end for _, end in different_ends(ends, task, 2 * _KEPT)]).reshape(-1, count)
        errors = task.variables.start[count:]
        wholes = [np.append(end, errors) for _, end in different_ends(ladder.descend(chosen), task, _KEPT)]
        wholes += [end for _, end in different_ends(ladder.descend_with_errors(chosen, errors), task, _KEPT)]
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
    """Return the ends of fits and their cost."""
    ends = stage.fit(starts, most, tolerance=tolerance, free=free)
    return np.array([end.x for end in ends]).reshape(starts.shape), np.array([end.cost for end in ends])


def _with(task: Task, observed: Sequence[Observation]) -> Problem:
    return task.on(observed, ["standard deviations"] * len(observed)).problem()


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
    runs = fit_direct(problem, np.array(_ahead(problem, wholes)), most, tolerance) if wholes else []
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
            message=problem.reason(start),
        )
    return replace(best, start=first, evaluations=problem.evaluations - before)


def _ahead(problem: Problem, wholes: list[NDArray[np.float64]]) -> list[NDArray[np.float64]]:
    """Return the ends that are best after some steps on all lines, where there are many."""
    there, cost = _ends(problem, np.array(wholes), _SOME, _EASY)
    order = np.argsort(cost)[:_AHEAD]
    return [there[i] for i in order if np.isfinite(cost[i])] or wholes[:1]


def _finished(problem: Problem, run: Start, most: int) -> Start:
    """Return where a run leads that its evaluations did not take to the end.

    Along a bent narrow valley, stiffness against coupling, the trust region creeps, most of all where an error was
    thrown far off on the way; steps from the normal matrix with bounds left out of it are longer there.
    """
    end = problem.fit_one(run.variables, _LONGER * most, least=_LEAST)
    if not end.cost < run.cost:
        return run
    message = end.message if end.converged else run.message
    values = problem.named(end.x)
    return replace(run, variables=end.x, values=values, cost=end.cost, converged=end.converged, message=message)


def different_ends(
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
