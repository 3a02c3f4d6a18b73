"""Fits that run in the core: whole models, their normal matrices, many starts in one call.

What is left to Python is the order of things: starts run on some of the lines first, and only the best different ends
on all of them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from receptance import _checks, _core
from receptance._evaluation import by_line
from receptance._ties import Tied, tie
from receptance.identification.factors import DECAY_RATES, FACTORS, frequency_powers
from receptance.identification.frequency_residuals import FrequencyResidual
from receptance.identification.observations import MeasuredFrequencies
from receptance.identification.priors import PriorResidual
from receptance.identification.problem import Normal, Problem, split_normal
from receptance.identification.reduced import ENDED
from receptance.identification.residuals import FRFResidual, InfeasibleError, Pair
from receptance.identification.result import Start

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.assembly import Assembly
    from receptance.coordinates import Coordinate
    from receptance.identification.mapping import Placed
    from receptance.identification.task import Task
    from receptance.identification.unknowns import Unknown

    _Reals = NDArray[np.float64]

__all__ = ["ModelledProblem", "Models", "ModelsEnd"]

_FEW = 400
"""Lines of each receptance on the way to an optimum."""
_ROUGH = 1e-4
"""Tolerance on the way."""
_KEPT = 4
"""How many different ends of the way go on to all lines."""
_NEAR = 0.02
"""Ends closer than this share of the range are the same."""
_WORSE = 2.0
"""Ends with so many times the best cost do not go on."""
_CALL = 2e6
"""Lines times evaluations of one call of the core, so that it lasts about a second."""
_TYPICAL = 40
"""Evaluations of one fit."""


class ModelsEnd(NamedTuple):
    """Where one fit ended: the variables, half the sum of squares, evaluations, SciPy's status, last A^T A."""

    x: NDArray[np.float64]
    cost: float
    evaluations: int
    status: int
    normal: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Models:
    """Everything that is fitted, as a problem of the core.

    Attributes
    ----------
    problem : _core.Problem
        Observations, priors and bounds. Receptances of one model on the same lines are records of one observation, so
        that the model is evaluated once for all of them.
    rows : ndarray
        Places of the core's residuals among those of the task.
    threads : int
        Zero for all that the process may use.
    """

    problem: _core.Problem
    rows: NDArray[np.intp]
    threads: int

    @classmethod
    def of(cls, task: Task, problem: Problem, lines: Sequence[NDArray[np.intp] | None] | None = None) -> Models | None:
        """Return the problem of the core for a task and its residuals; None where the core cannot run the fit.

        `lines` are those of each observation that are taken; by default all.
        """
        receptances: dict[tuple[bytes, ...], _Receptance] = {}
        frequencies: list[tuple[int, _core.TiedModel, tuple[_Reals, _Reals, _Reals]]] = []
        sizes = []
        for index, (observation, placed, residual) in enumerate(
            zip(task.observed, task.placed, problem.residuals, strict=False)
        ):
            inner = getattr(residual, "inner", residual)
            points: tuple[Coordinate, ...] = ()
            if not isinstance(observation, MeasuredFrequencies):
                points = (observation.response, observation.excitation)
            tied = _tied(observation.assembly, placed, points)
            if tied is None:
                return None
            model, addresses, factors = tied
            if isinstance(inner, FrequencyResidual):
                numbers = inner.arrays()
                if numbers is None:
                    return None
                frequencies.append((index, model.model(addresses, factors), numbers))
                sizes.append(numbers[0].size)
                continue
            if not isinstance(inner, FRFResidual):
                return None
            arrays = inner.arrays()
            if arrays is None:
                return None
            chosen = None if lines is None else lines[index]
            w, measured, weights = arrays
            if chosen is not None:
                w, measured, weights = w[chosen], measured[chosen], weights[chosen]
            sizes.append(2 * w.size)
            try:
                own_lines = by_line(model.flat, w / math.tau)
            except ValueError:
                return None
            key = (w.tobytes(), addresses.tobytes(), factors.tobytes(), *model.key)
            if key not in receptances:
                receptances[key] = _Receptance(w, model.model(addresses, factors), model.points, own_lines)
            receptances[key].add(index, measured, weights)
        variables = problem.variables
        whole = _core.Problem(
            variables.logarithmic, np.ascontiguousarray(variables.limits), _priors(variables.unknowns)
        )
        for one in receptances.values():
            whole.add_receptance(
                one.model, _core.Lines(one.w), one.points, np.stack(one.measured), np.stack(one.weights), one.by_line
            )
        for _, tied_model, (modes, measured_w, weights) in frequencies:
            whole.add_frequencies(tied_model, modes, measured_w, weights)
        order = [i for one in receptances.values() for i in one.indices] + [i for i, *_ in frequencies]
        begins = np.cumsum([0, *sizes])
        rows = np.concatenate([np.arange(begins[i], begins[i + 1]) for i in order])
        return cls(whole, rows, _checks.thread_count(task.threads))

    def normal(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return A^T A of A = [J | r], `(p + 1, p + 1)`; NaN where a model has no value."""
        return self.problem.normal_matrix(np.ascontiguousarray(x), self.threads)

    def residual_and_slopes(self, x: NDArray[np.float64], free: NDArray[np.bool_]) -> Pair | None:
        """Return the residuals without priors and their derivatives by the free variables; None where there is none."""
        found = self.problem.rows(np.ascontiguousarray(x), free, self.threads)
        if found is None:
            return None
        residual, slopes = np.empty_like(found[0]), np.empty_like(found[1])
        residual[self.rows], slopes[self.rows] = found
        return residual, slopes

    def fit(
        self,
        starts: NDArray[np.float64],
        most: int | NDArray[np.int64],
        tolerance: float,
        free: NDArray[np.bool_] | None = None,
    ) -> list[ModelsEnd]:
        """Return where the fits from all starts end, with variables that are not free held."""
        return fit_in_core(self.problem, starts, most, tolerance, self.threads, free)


@dataclass(eq=False)
class _Receptance:
    """Records of one receptance of one model."""

    w: NDArray[np.complex128]
    model: _core.TiedModel
    points: NDArray[np.float64]
    by_line: _core.ByLine | None
    indices: list[int] = field(default_factory=list)
    measured: list[NDArray[np.complex128]] = field(default_factory=list)
    weights: list[NDArray[np.float64]] = field(default_factory=list)

    def add(self, index: int, measured: NDArray[np.complex128], weights: NDArray[np.float64]) -> None:
        self.indices.append(index)
        self.measured.append(measured)
        self.weights.append(weights)


def fit_in_core(
    problem: _core.Problem,
    starts: NDArray[np.float64],
    most: int | NDArray[np.int64],
    tolerance: float,
    threads: int,
    free: NDArray[np.bool_] | None = None,
) -> list[ModelsEnd]:
    """Return where the fits of a problem of the core from all starts end, with variables that are not free held.

    `most` are the evaluations from each start, one number or `(n_starts,)`.
    """
    moving = np.ones(starts.shape[1], dtype=np.bool_) if free is None else free
    limits = np.array(np.broadcast_to(most, len(starts)), dtype=np.int64)
    # Several calls where there is much to do: between them the interpreter sees signals.
    chunk = max(int(_CALL / (_TYPICAL * max(problem.lines, 100))), 2)
    ends: list[ModelsEnd] = []
    for first in range(0, len(starts), chunk):
        some = slice(first, first + chunk)
        found = problem.fit(np.ascontiguousarray(starts[some]), moving, tolerance, limits[some], threads)
        numbers = zip(found.x, found.cost, found.evaluations, found.status, found.normal, strict=True)
        ends += [ModelsEnd(x, float(cost), int(n), int(why), normal) for x, cost, n, why, normal in numbers]
    return ends


class ModelledProblem(Problem):
    """The same residuals, with fits and normal matrices in the core."""

    def __init__(self, whole: Problem, models: Models) -> None:
        super().__init__(whole.residuals, whole.variables)
        self.models = models

    def normal(self, x: NDArray[np.float64]) -> Normal | None:
        """Return cost, slope and curvature; see `Problem.normal`."""
        self.evaluations += 1
        return split_normal(self.models.normal(x))

    def value(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the residuals without their derivatives; see `Problem.value`."""
        return self._with_priors(x, np.zeros(x.size, dtype=np.bool_))[0]

    def slopes(self, x: NDArray[np.float64], free: NDArray[np.bool_]) -> NDArray[np.float64]:
        """Return the derivatives of the residuals by some variables; see `Problem.slopes`."""
        return self._with_priors(x, free)[1]

    def _parts(self, x: NDArray[np.float64]) -> Pair:
        return self._with_priors(x, np.ones(x.size, dtype=np.bool_))

    def _with_priors(self, x: NDArray[np.float64], free: NDArray[np.bool_]) -> Pair:
        found = self.models.residual_and_slopes(x, free)
        if found is None:
            super()._parts(x)  # which knows why not
            raise InfeasibleError("a residual or its derivative is not finite")
        known = [residual for residual in self.residuals if isinstance(residual, PriorResidual)]
        values = self.variables.to_values(x)
        slopes = self.variables.slopes(values)
        parts = [found, *((a, b[:, free]) for a, b in (prior.evaluate(values, slopes) for prior in known))]
        return np.concatenate([part[0] for part in parts]), np.concatenate([part[1] for part in parts])

    def fit_all(self, starts: NDArray[np.float64], most: int, tolerance: float) -> list[Start]:
        """Run the fits from all starts: on some lines first, the best different ends on all."""
        few = self.models.problem.thinned(_FEW)
        begun = [ModelsEnd(x, np.inf, 0, -1, np.empty(0)) for x in starts]
        leaders = list(range(len(starts)))
        owners = dict(zip(leaders, leaders, strict=True))
        if few.lines < self.models.problem.lines:
            begun = fit_in_core(few, starts, most, max(tolerance, _ROUGH), self.models.threads)
            leaders, owners = self._chosen(begun)
        ends: dict[int, ModelsEnd] = {}
        if leaders:
            found = self.models.fit(np.array([begun[i].x for i in leaders]), most, tolerance)
            ends = dict(zip(leaders, found, strict=True))
        self.evaluations += sum(one.evaluations for one in [*begun, *ends.values()])
        return [self._told(i, x, begun[i], owners.get(i), ends) for i, x in enumerate(starts)]

    def _chosen(self, begun: list[ModelsEnd]) -> tuple[list[int], dict[int, int]]:
        """Return which ends go on, and for every start that ended at one of them, which."""
        low, high = self.variables.limits
        leaders: list[int] = []
        owners: dict[int, int] = {}
        order = sorted((i for i, one in enumerate(begun) if np.isfinite(one.cost)), key=lambda i: begun[i].cost)
        for i in order:
            near = [j for j in leaders if np.max(np.abs(begun[i].x - begun[j].x) / (high - low)) <= _NEAR]
            if near:
                owners[i] = near[0]
            elif len(leaders) < _KEPT and begun[i].cost <= _WORSE * begun[order[0]].cost:
                leaders.append(i)
                owners[i] = i
        return leaders, owners

    def _told(
        self, index: int, x: NDArray[np.float64], begun: ModelsEnd, owner: int | None, ends: dict[int, ModelsEnd]
    ) -> Start:
        own = ends.get(index)
        end = begun if owner is None else ends[owner]
        cost, message = end.cost, ENDED[end.status]
        if owner is None and np.isfinite(cost):
            there = self.normal(end.x)
            cost = np.inf if there is None else there.cost
            message = "left on the way, where other starts fit better"
        if end.status < 0:
            self._evaluate(x)
            message = self.reason
        return Start(
            start=self.named(x),
            values=self.named(end.x),
            variables=end.x,
            cost=cost,
            evaluations=max(begun.evaluations + (own.evaluations if own is not None else 0), 1),
            converged=owner is not None and end.status > 0,
            message=message,
        )


def _tied(
    assembly: Assembly, placed: Placed, points: tuple[Coordinate, ...]
) -> tuple[Tied, NDArray[np.float64], NDArray[np.float64]] | None:
    """Return the model as a function of addresses, these as functions of the unknowns, and factors of the record."""
    factors = [(FACTORS.index(name), i) for i, name in enumerate(placed.addresses) if name in FACTORS]
    windowed = not set(DECAY_RATES).isdisjoint(placed.addresses)
    powers = frequency_powers(assembly) if windowed else {}
    tied = tie(assembly, placed.addresses, points, others=FACTORS, powers=powers)
    if tied is None:
        return None
    start = np.where(placed.base >= 0, placed.scale, placed.fixed)
    addresses = np.column_stack([placed.base, start, placed.exponents, placed.shifts]).astype(np.float64)
    return tied, np.ascontiguousarray(addresses), np.array(factors, dtype=np.float64).reshape(-1, 2)


def _priors(unknowns: tuple[Unknown, ...]) -> NDArray[np.float64]:
    rows = []
    for index, unknown in enumerate(unknowns):
        if unknown.prior is None:
            continue
        spread, mean = unknown.prior.standard_deviation, unknown.prior.mean
        if unknown.scale == "log":
            rows.append((index, math.log(10.0) / spread, math.log(mean) / spread))
        else:
            rows.append((index, 1.0 / spread, mean / spread))
    return np.array(rows, dtype=np.float64).reshape(-1, 3)
