"""Fits that run in the core: whole models, their normal matrices, many starts in one call.

What is left to Python is the order of things: starts run on some of the lines first, and only the best different ends
on all of them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from receptance import _checks, _core
from receptance._ties import tie
from receptance.identification.factors import FACTORS
from receptance.identification.observations import MeasuredFrequencies
from receptance.identification.problem import Normal, Problem, split_normal
from receptance.identification.reduced import ENDED
from receptance.identification.residuals import FrequencyResidual, FRFResidual
from receptance.identification.result import Start

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.coordinates import Coordinate
    from receptance.identification.task import Task
    from receptance.identification.unknowns import Unknown

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
    """Where one fit ended: the variables, half the sum of squares, evaluations, SciPy's status."""

    x: NDArray[np.float64]
    cost: float
    evaluations: int
    status: int


@dataclass(frozen=True, eq=False)
class Models:
    """Everything that is fitted, as the core takes it.

    Attributes
    ----------
    receptances, frequencies : list of tuple
        One for each observation, see `receptance._core.fit_models`.
    priors : ndarray
        `(k, 3)` variable, one over its standard deviation, mean times that.
    logarithmic, limits : ndarray
        Of the variables.
    threads : int
        Zero for all that the process may use.
    """

    receptances: list[tuple[Any, ...]]
    frequencies: list[tuple[Any, ...]]
    priors: NDArray[np.float64]
    logarithmic: NDArray[np.bool_]
    limits: NDArray[np.float64]
    threads: int

    @classmethod
    def of(cls, task: Task, problem: Problem) -> Models | None:
        """Return what the core needs of a task and its residuals; None where it cannot run the fit."""
        receptances, frequencies = [], []
        for observation, placed, residual in zip(task.observed, task.placed, problem.residuals, strict=False):
            inner = getattr(residual, "inner", residual)
            if isinstance(observation, MeasuredFrequencies):
                points: tuple[Coordinate, ...] = ()
            else:
                points = (observation.response, observation.excitation)
            # What stands between structure and record, and multiples of one unknown, are Python's.
            if not set(FACTORS).isdisjoint(placed.addresses) or np.any(placed.scale[placed.base >= 0] != 1.0):
                return None
            tied = tie(observation.assembly, placed.addresses, points)
            if tied is None or not isinstance(inner, (FRFResidual, FrequencyResidual)):
                return None
            arrays = inner.arrays()
            if arrays is None:
                return None
            addresses = np.column_stack([placed.base, placed.fixed, placed.exponents, placed.shifts])
            ties = (tied.tables, tied.rates, np.ascontiguousarray(addresses, dtype=np.float64))
            if not points:
                frequencies.append((*arrays, ties))
            else:
                receptances.append((*arrays, tied.points, ties))
        variables = problem.variables
        return cls(
            receptances=receptances,
            frequencies=frequencies,
            priors=_priors(variables.unknowns),
            logarithmic=variables.logarithmic,
            limits=np.ascontiguousarray(variables.limits),
            threads=_checks.thread_count(task.threads),
        )

    @property
    def lines(self) -> int:
        """Lines of all receptances."""
        return sum(one[0].size for one in self.receptances)

    def thinned(self, lines: int) -> Models:
        """Return the same on every so many of the lines, so that about `lines` are left of each receptance."""
        fewer = []
        for w, measured, weights, *rest in self.receptances:
            stride = max(w.size // lines, 1)
            fewer.append((*(np.ascontiguousarray(values[::stride]) for values in (w, measured, weights)), *rest))
        return replace(self, receptances=fewer)

    def normal(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return A^T A of A = [J | r], `(p + 1, p + 1)`; NaN where a model has no value."""
        return _core.models_normal_matrix(
            self.receptances,
            self.frequencies,
            self.priors,
            self.logarithmic,
            self.limits,
            np.ascontiguousarray(x),
            self.threads,
        )

    def fit(
        self,
        starts: NDArray[np.float64],
        most: int,
        tolerance: float,
        free: NDArray[np.bool_] | None = None,
    ) -> list[ModelsEnd]:
        """Return where the fits from all starts end, with variables that are not free held."""
        moving = np.ones(starts.shape[1], dtype=np.bool_) if free is None else free
        # Several calls where there is much to do: between them the interpreter sees signals.
        chunk = max(int(_CALL / (_TYPICAL * max(self.lines, 100))), 2)
        ends: list[ModelsEnd] = []
        for first in range(0, len(starts), chunk):
            found = _core.fit_models(
                self.receptances,
                self.frequencies,
                self.priors,
                self.logarithmic,
                self.limits,
                moving,
                np.ascontiguousarray(starts[first : first + chunk]),
                tolerance,
                most,
                self.threads,
            )
            ends += [ModelsEnd(x, float(cost), int(n), int(why)) for x, cost, n, why in zip(*found, strict=True)]
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

    def fit_all(self, starts: NDArray[np.float64], most: int, tolerance: float) -> list[Start]:
        """Run the fits from all starts: on some lines first, the best different ends on all."""
        few = self.models.thinned(_FEW)
        begun = [ModelsEnd(x, np.inf, 0, -1) for x in starts]
        leaders = list(range(len(starts)))
        owners = dict(zip(leaders, leaders, strict=True))
        if few.lines < self.models.lines:
            begun = few.fit(starts, most, max(tolerance, _ROUGH))
            leaders, owners = self._chosen(begun)
        ends: dict[int, ModelsEnd] = {}
        if leaders:
            found = self.models.fit(np.array([begun[i].x for i in leaders]), most, tolerance)
            ends = dict(zip(leaders, found, strict=True))
        self.evaluations += sum(one.evaluations for one in [*begun, *ends.values()])
        return [self._told(i, x, begun[i], owners.get(i), ends) for i, x in enumerate(starts)]

    def _chosen(self, begun: list[ModelsEnd]) -> tuple[list[int], dict[int, int]]:
        """Return which ends go on, and for every start that ended at one of them, which."""
        low, high = self.models.limits
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
