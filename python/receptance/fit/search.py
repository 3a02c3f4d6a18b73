"""Global search: direct fits from several starts, and staged fits by continuation.

A direct fit runs from every start on some of the lines first. The best distinct ends are refined on all lines.

The squared logarithmic residual of a lightly damped receptance has a narrow valley: a start whose resonances are off by
more than their width converges to another optimum. A staged fit is a continuation through problems with wider valleys:
peaks as natural frequencies, then receptances with damping added to data and model (`smeared`) that is reduced step by
step, then the complex logarithmic residual itself. The first stages use few lines and exact dimensions and materials;
their ends are starts of the problem itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from receptance import units
from receptance.fit.observation import Observation, altered
from receptance.fit.peaks import peak_indices
from receptance.fit.problem import COST_TOLERANCE, End, Problem, Task
from receptance.fit.unknowns import Unknown, Variables
from receptance.model.addresses import QUANTITIES

START_LOSS_FACTOR = 0.02
"""Loss factor of dampings before they are fitted."""
_DIRECT_LINES = 400
"""Lines of each receptance in the first stage of a direct fit."""
_DIRECT_COST = 2.0
"""Largest cost of an end of that stage that is refined, relative to the least cost."""
_KEPT = 4
"""Largest number of distinct ends that are refined on all lines."""
_SAME = 0.02
"""Ends closer than this share of the range are one optimum."""
_WIDTHS = (0.3, 0.1, 0.03, 0.01)
"""Relative widths of the resonances in the stages of a continuation."""
_BROAD = 2
"""Number of the first stages, which fit stiffness alone: they are insensitive to damping."""
_STAGE_LINES = 80
"""Lines of each receptance in these stages."""
_STAGE_EVALUATIONS = 40
"""Largest number of evaluations in a stage."""
_STAGE_TOLERANCE = 1e-4
"""Tolerance of all fits before the last one."""
_PEAK_DEVIATION = 0.003
"""Relative standard deviation of a peak as a natural frequency."""
_DASHPOTS = (units.DAMPING, units.ROTATIONAL_DAMPING, units.COUPLING_DAMPING)
_DRAWN = 15
"""Starts that are drawn in addition to the given ones."""
_TRIAL_EVALUATIONS = 60
"""Evaluations on all lines before the best ends are selected."""
_SELECTED = 3
"""Number of ends that are selected then."""
_FINISHED = 2
"""Number of the best ends that are continued if they have not converged, with as many times the evaluations."""
_MARGIN = 2.0
"""Distance of smeared lines from the upper end, in widths."""
_MIN_LINES = 8
"""Least number of lines for a stage."""


@dataclass(frozen=True, kw_only=True)
class Start:
    """One start and its end."""

    start: dict[str, float]
    """Values at the start, in SI units by address."""
    values: dict[str, float]
    """Values at the end."""
    variables: NDArray[np.float64]
    """Fitted variables at the end."""
    cost: float
    """Half the sum of the squared residuals, or of the smoothed absolute values; infinite if the model has no value at
    the start."""
    evaluations: int
    """Evaluations of the model."""
    converged: bool
    """Whether cost or variables converged."""
    message: str
    """Why the fit ended."""


def fit_direct(
    problem: Problem, starts: NDArray[np.float64], most: int, tolerance: float, easier: Problem | None = None
) -> list[Start]:
    """Fit from all starts `(n, p)` on some of the lines, and refine the best distinct ends on all lines.

    `most` is the largest number of evaluations from each start. Ends of `easier` replace the starts. The result has one
    run for each start; ends that are not refined are reported with their cost on all lines.
    """
    spent, at = np.zeros(len(starts), dtype=np.int64), np.array(starts)
    if easier is not None:
        spent, at = _continued(easier.fit(at, most, tolerance=_STAGE_TOLERANCE), at)
    few = problem.thinned(_DIRECT_LINES)
    first: list[End] = []
    owners = {i: i for i in range(len(starts))}
    if few is not None:
        first = few.fit(at, np.maximum(most - spent, 1), tolerance=max(tolerance, _STAGE_TOLERANCE))
        more, at = _continued(first, at)
        spent = spent + more
        problem.evaluations += few.evaluations
        largest_cost = _DIRECT_COST * min(end.cost for end in first)
        owners = _owners([(end.cost, end.x) for end in first], problem.variables.limits, _KEPT, largest_cost)
    leaders = list(dict.fromkeys(owners.values()))
    ends = problem.fit(at[leaders], np.maximum(most - spent[leaders], 1), tolerance=tolerance) if leaders else []
    last = dict(zip(leaders, ends, strict=True))
    runs = []
    for i, start in enumerate(starts):
        owner = owners.get(i)
        run = _run(problem, start, first[i] if owner is None else last[owner])
        if owner is None and np.isfinite(run.cost):
            run = replace(
                run,
                cost=problem.cost(run.variables),
                converged=False,
                message="left on fewer lines, where other starts fit better",
            )
        runs.append(replace(run, evaluations=max(int(spent[i]) + (last[i].evaluations if i in last else 0), 1)))
    return runs


def _run(problem: Problem, start: NDArray[np.float64], end: End) -> Start:
    """Return a start with its end."""
    return Start(
        start=problem.named(start),
        values=problem.named(end.x),
        variables=end.x,
        cost=end.cost,
        evaluations=end.evaluations,
        converged=end.converged,
        message=problem.reason(end.x) if end.status < 0 else end.message,
    )


def _continued(ends: Sequence[End], starts: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the evaluations of fits, and the starts of the next ones: ends, or starts without a value."""
    reached = np.array([end.x if np.isfinite(end.cost) else x for end, x in zip(ends, starts, strict=True)])
    return np.array([end.evaluations for end in ends], dtype=np.int64), reached.reshape(starts.shape)


def _owners(
    ends: Sequence[tuple[float, NDArray[np.float64]]],
    limits: NDArray[np.float64],
    most: int,
    largest_cost: float = np.inf,
) -> dict[int, int]:
    """Return for ends with their costs the number of the best one at the same optimum, of the `most` best optima."""
    leaders: list[int] = []
    owners: dict[int, int] = {}
    for i in sorted((i for i, (cost, _) in enumerate(ends) if np.isfinite(cost)), key=lambda i: ends[i][0]):
        cost, x = ends[i]
        near = [j for j in leaders if np.max(np.abs(x - ends[j][1]) / (limits[1] - limits[0])) <= _SAME]
        if near:
            owners[i] = near[0]
        elif len(leaders) < most and cost <= largest_cost:
            leaders.append(i)
            owners[i] = i
    return owners


def fit_staged(task: Task, problem: Problem, starts: int, seed: int, most: int, tolerance: float) -> list[Start]:
    """Return the best end of the continuation from each of a number of starts; see `fit_direct`."""
    continuation = Continuation(task)
    begun = task.variables.draw(starts, seed)
    drawn = task.variables.draw(1 + _DRAWN, seed)[1:]
    count = continuation.count
    # All starts form one batch. Each road through the broad stages gives one end per start.
    roads = continuation.fit_stiffness(np.vstack([begun, drawn])[:, :count])
    costs = [continuation.costs(road) for road in roads]
    shared = range(starts, starts + len(drawn))
    runs = []
    for number, x in enumerate(begun):
        ends = [(cost[i], road[i]) for road, cost in zip(roads, costs, strict=True) for i in (number, *shared)]
        before = problem.evaluations
        chosen = np.array([end for _, end in different_ends(ends, task, 2 * _KEPT)]).reshape(-1, count)
        errors = task.variables.start[count:]
        refined = different_ends(continuation.fit_all(chosen), task, _KEPT)
        with_errors = different_ends(continuation.fit_all_with_errors(chosen, errors), task, _KEPT)
        better = [*(np.append(end, errors) for _, end in refined), *(end for _, end in with_errors)]
        runs.append(_best_run(problem, x, better, before, most, tolerance))
    return runs


class Continuation:
    """The sequence of easier problems on the way to a task."""

    def __init__(self, task: Task) -> None:
        exact = task.without_errors()
        self.variables = exact.variables
        self.count = len(exact.variables.unknowns)
        self._damping = is_damping(exact.variables)
        self._coupling = np.array([_last(unknown).endswith("_ytheta") for unknown in exact.variables.unknowns])
        self._angular = (
            2.0 * np.pi * float(np.median([np.median(observation.frequency_hz.real) for observation in task.observed]))
        )
        self.peaks = _peak_problem(exact)
        steps = [
            [broad for observation in task.observed if (broad := smeared(observation, width))] for width in _WIDTHS
        ]
        usable = [len(step) == len(task.observed) for step in steps]
        problems = [exact.on(step).problem() if use else None for step, use in zip(steps, usable, strict=True)]
        self.broad = [problem for problem in problems[:_BROAD] if problem is not None]
        self.narrow = [problem for problem in problems[_BROAD:] if problem is not None]
        # A large error of a dimension can mislead the stages with exact dimensions.
        has_errors = len(task.variables.unknowns) > self.count
        self.with_errors = [
            task.on(step).problem() for step, use in zip(steps[1:], usable[1:], strict=True) if use and has_errors
        ]

    def with_damping(self, starts: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the variables `(n, p)` with dampings that correspond to the stiffnesses."""
        return with_damping(self.variables, starts, self._angular)

    def fit_stiffness(self, starts: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        """Fit stiffnesses with damping held: through broad resonances, and through peaks.

        Coupling terms start at their given values and are fitted after the others.
        """
        alone = ~(self._damping | self._coupling)
        starts = np.where(self._coupling & ~self.variables.logarithmic, self.variables.start, starts)
        roads = [self.broad] if self.peaks is None else [self.broad, [self.peaks, *self.broad[1:]]]
        ends = []
        for road in roads:
            x = self.with_damping(starts)
            for stage in road:
                for free in (alone, ~self._damping):
                    x, _ = _fit_stage(stage, self.with_damping(x), free=free)
            ends.append(x)
        return ends

    def costs(self, ends: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the costs of stiffnesses in the narrowest of the broad stages."""
        stage = (self.broad or self.narrow)[-1:] or ([self.peaks] if self.peaks is not None else [])
        if not stage:
            return np.zeros(len(ends))
        return np.array([stage[0].cost(x) for x in self.with_damping(ends)])

    def fit_all(self, ends: NDArray[np.float64]) -> list[tuple[float, NDArray[np.float64]]]:
        """Fit all unknowns in the narrow stages; return costs and ends."""
        return _fit_stages(self.narrow, self.with_damping(ends), self.costs(ends))

    def fit_all_with_errors(
        self, ends: NDArray[np.float64], errors: NDArray[np.float64]
    ) -> list[tuple[float, NDArray[np.float64]]]:
        """Fit all unknowns and the errors of dimensions and materials; return costs and ends."""
        if not self.with_errors or not len(ends):
            return []
        starts = np.hstack([self.with_damping(ends), np.tile(errors, (len(ends), 1))])
        return _fit_stages(self.with_errors, starts, np.full(len(ends), np.inf))


def _last(unknown: Unknown) -> str:
    """Return the last word of the address."""
    return unknown.address.split(" ")[0].rsplit(".", 1)[-1]


def is_damping(variables: Variables) -> NDArray[np.bool_]:
    """Return the mask of loss factors and dashpots."""
    quantities = [QUANTITIES.get(_last(unknown)) for unknown in variables.unknowns]
    return np.array([quantity is units.LOSS_FACTOR or quantity in _DASHPOTS for quantity in quantities], dtype=np.bool_)


def with_damping(variables: Variables, starts: NDArray[np.float64], angular: float) -> NDArray[np.float64]:
    """Return the variables `(n, p)` with dampings that correspond to the stiffnesses at an angular frequency."""
    values = variables.to_values(starts)
    columns = {name: column for column, name in enumerate(variables.names)}
    for column in np.flatnonzero(is_damping(variables)).tolist():
        unknown = variables.unknowns[column]
        stiffness = columns.get(unknown.name.replace(".c_", ".k_"))
        if QUANTITIES.get(_last(unknown)) is units.LOSS_FACTOR:
            values[:, column] = START_LOSS_FACTOR
        elif stiffness is not None:
            values[:, column] = START_LOSS_FACTOR * values[:, stiffness] / angular
    return variables.from_values(np.clip(values, *variables.bounds))


def _fit_stage(
    stage: Problem,
    starts: NDArray[np.float64],
    *,
    most: int = _STAGE_EVALUATIONS,
    free: NDArray[np.bool_] | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the ends of fits and their costs; starts without a value keep their place, with infinite cost."""
    ends = stage.fit(starts, most, tolerance=_STAGE_TOLERANCE, free=free)
    costs = np.array([end.cost for end in ends])
    reached = np.array([end.x for end in ends]).reshape(starts.shape)
    return np.where(np.isfinite(costs)[:, None], reached, starts), costs


def _fit_stages(
    stages: Sequence[Problem], x: NDArray[np.float64], costs: NDArray[np.float64]
) -> list[tuple[float, NDArray[np.float64]]]:
    """Return costs and ends after all stages; a start without a value in a stage keeps its cost."""
    for stage in stages:
        x, reached = _fit_stage(stage, x)
        costs = np.where(np.isfinite(reached), reached, costs)
    return list(zip(costs.tolist(), x, strict=True))


def _peak_problem(task: Task) -> Problem | None:
    """Return the problem with the peaks of receptances as natural frequencies, numbered from the lowest."""
    if not all(observation.assembly.countable for observation in task.observed):
        return None
    frequencies: list[Observation] = []
    for observation in task.observed:
        if not observation.is_receptance:
            frequencies.append(observation)
            continue
        frequency = observation.frequency_hz.real[peak_indices(observation.receptance)]
        if not frequency.size:
            return None
        frequencies.append(
            Observation.from_modes(
                assembly=observation.assembly,
                frequency_hz=frequency,
                standard_deviation_hz=_PEAK_DEVIATION * frequency,
                label=observation.label,
                configuration=observation.configuration,
                conditions=observation.conditions,
            )
        )
    return task.on(frequencies).problem()


def _best_run(
    problem: Problem,
    start: NDArray[np.float64],
    begun: list[NDArray[np.float64]],
    before: int,
    most: int,
    tolerance: float,
) -> Start:
    """Return the best end of the problem itself, from the ends of the continuation from one start."""
    runs: list[Start] = []
    if begun:
        ends, costs = _fit_stage(problem, np.array(begun), most=_TRIAL_EVALUATIONS)
        order = [i for i in np.argsort(costs)[:_SELECTED] if np.isfinite(costs[i])]
        runs = fit_direct(problem, ends[order] if order else np.array(begun[:1]), most, tolerance)
    runs = sorted(runs, key=lambda run: run.cost)[:_FINISHED]
    runs = [run if run.converged or not np.isfinite(run.cost) else _finish(problem, run, most) for run in runs]
    best = min(runs, key=lambda run: run.cost, default=None)
    evaluations = problem.evaluations - before
    if best is None or not np.isfinite(best.cost):
        return _run(problem, start, End(start, np.inf, np.inf, evaluations, -1, np.empty((0, 0))))
    return replace(best, start=problem.named(start), evaluations=evaluations)


def _finish(problem: Problem, run: Start, most: int) -> Start:
    """Continue a run that has used up its evaluations, which happens along curved narrow valleys."""
    end = problem.fit_one(run.variables, _FINISHED * most, least=COST_TOLERANCE)
    if not end.cost < run.cost:
        return run
    message = end.message if end.converged else run.message
    return replace(_run(problem, run.variables, end), start=run.start, evaluations=run.evaluations, message=message)


def different_ends(
    ends: Sequence[tuple[float, NDArray[np.float64]]], task: Task, most: int
) -> list[tuple[float, NDArray[np.float64]]]:
    """Return the best distinct ends and their costs; errors do not distinguish ends."""
    count = task.parameters.count
    owners = _owners([(cost, x[:count]) for cost, x in ends], task.variables.limits[:, :count], most)
    return [ends[i] for i in dict.fromkeys(owners.values())]


def smeared(observation: Observation, width: float) -> Observation | None:
    """Return an observation with added damping: resonances have the relative width `width`.

    A causal response is analytic below the real axis, so its value at the complex line f (1 - i b) is the mean of its
    values on the real lines under a Lorentzian of half-width b f (Poisson's integral). The model is evaluated at the
    complex line. The mean is that of the accelerance, which is finite at both ends. Standard deviations become half the
    width. None if the lines are too far apart, the band is too narrow, or the assembly ends with a table, which has no
    value at complex lines.
    """
    if not observation.is_receptance:
        deviation = 0.5 * width * observation.frequency_hz
        return altered(observation, standard_deviation=deviation, damping_ratio=None, standard_deviation_damping=None)
    f = observation.frequency_hz.real
    if f.size < _MIN_LINES or observation.assembly.tabulated:
        return None
    steps = np.gradient(f)
    # The mean needs lines above the upper end, which are missing, so lines near it are excluded; below zero the
    # response follows by symmetry.
    top = float(f[-1]) / (1.0 + _MARGIN * width)
    if top <= f[0]:
        return None
    centres = np.geomspace(float(f[0]), top, _STAGE_LINES)
    centres = centres[width * centres >= np.interp(centres, f, steps)]
    if centres.size < _MIN_LINES:
        return None
    accelerance = observation.receptance * observation.frequency_hz**2
    half = width * centres[:, None]
    weights = steps * half / ((f - centres[:, None]) ** 2 + half**2)
    mirrored = steps * half / ((f + centres[:, None]) ** 2 + half**2)
    total = weights.sum(axis=1) + mirrored.sum(axis=1)
    at = centres * (1.0 - 1j * width) + 1j * np.interp(centres, f, observation.frequency_hz.imag)
    values = (weights @ accelerance + mirrored @ accelerance.conj()) / total / at**2
    return altered(
        observation,
        frequency_hz=at,
        receptance=values,
        standard_deviation=np.full(at.size, 0.5 * width),
        correlated_lines=np.ones(at.size),
        force=None,
        ends=None,
    )
