"""Fits that run in the core: whole models, their normal matrices, many starts in one call.

What is left to Python is the order of things: starts run on some of the lines first, and only the best different ends
on all of them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from receptance import _checks, _core
from receptance._ties import tie
from receptance.identification.factors import DECAY_RATES, FACTORS, frequency_powers
from receptance.identification.frequency_residuals import FrequencyResidual
from receptance.identification.observations import MeasuredFrequencies
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
        One for each observation, see `receptance._core.fit_models`; receptances of one model on the same lines are
        records of one observation, so that the model is evaluated once for all of them.
    rows : ndarray
        Where the residuals of the core are among those of the task.
    priors : ndarray
        `(k, 3)` variable, one over its standard deviation, mean times that.
    logarithmic, limits : ndarray
        Of the variables.
    threads : int
        Zero for all that the process may use.
    """

    receptances: list[tuple[Any, ...]]
    frequencies: list[tuple[Any, ...]]
    rows: NDArray[np.intp]
    priors: NDArray[np.float64]
    logarithmic: NDArray[np.bool_]
    limits: NDArray[np.float64]
    threads: int

    @classmethod
    def of(cls, task: Task, problem: Problem, lines: Sequence[NDArray[np.intp] | None] | None = None) -> Models | None:
        """Return what the core needs of a task and its residuals; None where it cannot run the fit.

        `lines` are those of each observation that are taken; by default all.
        """
        receptances: dict[tuple[Any, ...], tuple[list[Any], list[Any], list[int], tuple[Any, ...]]] = {}
        frequencies: list[tuple[int, tuple[Any, ...]]] = []
        sizes = []
        for index, (observation, placed, residual) in enumerate(
            zip(task.observed, task.placed, problem.residuals, strict=False)
        ):
            inner = getattr(residual, "inner", residual)
            points: tuple[Coordinate, ...] = ()
            if not isinstance(observation, MeasuredFrequencies):
                points = (observation.response, observation.excitation)
            tied = _tied(observation.assembly, placed, points)
            if tied is None or not isinstance(inner, (FRFResidual, FrequencyResidual)):
                return None
            arrays = inner.arrays()
            if arrays is None:
                return None
            places, ties = tied
            chosen = None if lines is None else lines[index]
            if not points:
                frequencies.append((index, (*arrays, ties)))
                sizes.append(arrays[0].size)
                continue
            w, measured, weights = arrays if chosen is None else (values[chosen] for values in arrays)
            sizes.append(2 * w.size)
            key = tuple(array.tobytes() for array in (w, places, *ties[0], *ties[1:]))
            own = receptances.setdefault(key, ([], [], [], (w, places, ties)))
            own[0].append(measured)
            own[1].append(weights)
            own[2].append(index)
        variables = problem.variables
        order = [i for *_, own, _ in receptances.values() for i in own] + [i for i, _ in frequencies]
        begins = np.cumsum([0, *sizes])
        return cls(
            receptances=[
                (w, np.stack(measured), np.stack(weights), places, ties)
                for measured, weights, _, (w, places, ties) in receptances.values()
            ],
            frequencies=[one for _, one in frequencies],
            rows=np.concatenate([np.arange(begins[i], begins[i + 1]) for i in order]),
            priors=_priors(variables.unknowns),
            logarithmic=variables.logarithmic,
            limits=np.ascontiguousarray(variables.limits),
            threads=_checks.thread_count(task.threads),
        )

    @property
    def lines(self) -> int:
        """Lines of all receptances."""
        return sum(one[1].size for one in self.receptances)

    def thinned(self, lines: int) -> Models:
        """Return the same on every so many of the lines, so that about `lines` are left of each receptance."""
        fewer = []
        for w, measured, weights, *rest in self.receptances:
            stride = max(w.size // lines, 1)
            fewer.append((*(np.ascontiguousarray(a[..., ::stride]) for a in (w, measured, weights)), *rest))
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

    def residual_and_slopes(self, x: NDArray[np.float64], free: NDArray[np.bool_]) -> Pair | None:
        """Return the residuals without priors and their derivatives by the free variables; None where there is none."""
        found = _core.models_rows(
            self.receptances,
            self.frequencies,
            self.logarithmic,
            self.limits,
            free,
            np.ascontiguousarray(x),
            self.threads,
        )
        if found is None:
            return None
        residual, slopes = np.empty_like(found[0]), np.empty_like(found[1])
        residual[self.rows], slopes[self.rows] = found
        return residual, slopes

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
        known = self.residuals[len(self.residuals) - (self.models.priors.size > 0) :]
        values = self.variables.to_values(x)
        slopes = self.variables.slopes(values)
        parts = [found, *((a, b[:, free]) for a, b in (prior.evaluate(values, slopes) for prior in known))]
        return np.concatenate([part[0] for part in parts]), np.concatenate([part[1] for part in parts])

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


def _tied(
    assembly: Assembly, placed: Placed, points: tuple[Coordinate, ...]
) -> tuple[NDArray[np.float64], tuple[Any, ...]] | None:
    """Return the places of the coordinates, and the tables as functions of the unknowns."""
    factors = [(FACTORS.index(name), i) for i, name in enumerate(placed.addresses) if name in FACTORS]
    windowed = not set(DECAY_RATES).isdisjoint(placed.addresses)
    powers = frequency_powers(assembly) if windowed else {}
    tied = tie(assembly, placed.addresses, points, others=FACTORS, powers=powers)
    if tied is None:
        return None
    start = np.where(placed.base >= 0, placed.scale, placed.fixed)
    addresses = np.column_stack([placed.base, start, placed.exponents, placed.shifts]).astype(np.float64)
    between = np.array(factors, dtype=np.float64).reshape(-1, 2)
    return tied.points, (tied.tables, tied.rates, np.ascontiguousarray(addresses), between, tied.powers)


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
