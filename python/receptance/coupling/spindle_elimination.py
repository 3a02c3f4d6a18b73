"""Parameters of tool, joint and holder from records on an unknown spindle, which is eliminated line by line.

Let H_0, r, e and Y be the receptances of tool, joint and holder alone: between the coordinates of a record, from the
connection plane to each of them, and at the plane. On a spindle with the receptance S the record is

    H = H_0 - r^T (S + Y)^-1 e.

On each line S has three complex numbers, whatever the spindle is. Four or more records leave equations that contain the
parameters before the plane alone. They are solved by variable projection (Golub and Pereyra, SIAM J. Numer. Anal. 10,
1973; with Kaufman's Jacobian, BIT 15, 1975), in two steps:

1. Each configuration by itself. Its records are linear in (S + Y)^-1, so that no start for S is needed, and residuals
   that count as large errors as 30 % have few local optima over decades of the joint's stiffnesses.
2. All configurations, which have the same S, with errors of dimensions and materials and their priors: on some of the
   lines, then on all.

The cost of a line may have several minima in S. A line with a poor one starts again from S on a line beside it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import special
from scipy.optimize import least_squares

from receptance import _checks, _core
from receptance.coupling.blanks import blank_equations
from receptance.coupling.common_lines import common_lines
from receptance.coupling.line_equations import TERMS, Equations, linear_solution, refine
from receptance.coupling.mode_growth import SpindleLines
from receptance.errors import ReceptanceError
from receptance.fit.observation import Observation, Unit, altered
from receptance.fit.parameters import FACTORS, Parameters
from receptance.fit.problem import Problem, Task
from receptance.fit.search import is_damping, with_damping
from receptance.fit.unknowns import Tolerance, Unknown
from receptance.model.assembly import Assembly
from receptance.model.terminals import MeasuredPart

_LINES = 1000
"""Largest number of lines."""
_THINNED = 150
"""Largest number of lines of the first fits."""
_FIRST_LINES = 40
"""Number of these lines in the first step."""
_ERROR = 0.3
"""Relative error of the records that the first step allows for."""
_STARTS = 3
"""Starts of the first step: the given one, and drawn ones."""
_EVALUATIONS = 60
"""Largest number of evaluations of each fit."""
_TOLERANCE = 1e-6
"""Relative change at which a fit has converged."""
_LEAST = 1e-2
"""Decrease of the cost at which the second step has converged."""
_ENTRY_TOLERANCE = 1e-8
"""Relative change at which the spindle on a line has converged."""
_CHANCE = 1e-4
"""Probability with which noise alone makes the cost of a line a poor one."""


class SpindleRecords:
    """Records on common lines of assemblies that end with one spindle, and the variables before its plane.

    `lines_hz` are the lines, and `terminal` is the spindle as described. Other observations have a part in the
    variables only.
    """

    @classmethod
    def of(
        cls,
        observed: Sequence[Observation],
        unknowns: Sequence[Unknown],
        name: str,
        tolerances: Sequence[Tolerance] = (),
        threads: int | None = None,
    ) -> SpindleRecords | None:
        """Return the records of assemblies that end with the element `name`; None without common lines.

        The unknowns are those before the plane; all observations have standard deviations.
        """
        records = [o for o in observed if o.is_receptance and name in o.assembly.elements]
        others = [o for o in observed if o not in records]
        try:
            common, lines, rows, _ = common_lines(tuple(records))
        except ValueError:
            return None
        chosen = few(lines.size, _LINES)
        lines = lines[chosen]
        records = [
            altered(_thinned(record.select(row), chosen), frequency_hz=lines)
            for record, row in zip(common, rows, strict=True)
        ]
        return cls(records, others, unknowns, name, tolerances, threads)

    def thinned(self) -> SpindleRecords:
        """Return the records on some of the lines."""
        chosen = few(self.lines_hz.size, _THINNED)
        records = [_thinned(record, chosen) for record in self._records]
        return SpindleRecords(records, self._others, self._unknowns, self._name, self._tolerances, self._threads)

    def __init__(
        self,
        records: Sequence[Observation],
        others: Sequence[Observation],
        unknowns: Sequence[Unknown],
        name: str,
        tolerances: Sequence[Tolerance],
        threads: int | None,
    ) -> None:
        self.lines_hz, self.terminal = records[0].frequency_hz, records[0].assembly.elements[name]
        self._records, self._others, self._name, self._threads = tuple(records), tuple(others), name, threads
        self._unknowns, self._tolerances = tuple(unknowns), tuple(tolerances)
        observed = (*records, *others)
        parameters = Parameters(unknowns, tolerances, [o.site(i) for i, o in enumerate(observed)])
        units: list[Unit] = ["standard deviations"] * len(observed)
        self._task = Task(observed, parameters, tuple(units), threads=threads)
        self._exact = self._task.without_errors()
        self._same = [self._first_like(i) for i in range(len(records))]
        names = dict.fromkeys(record.configuration for record in records)
        groups = [[i for i, record in enumerate(records) if record.configuration == at] for at in names]
        self._configurations = [indices for indices in groups if len(indices) > len(TERMS) and self._separates(indices)]
        self._entries: NDArray[np.complex128] | None = None

    def named(self, x: NDArray[np.float64]) -> dict[str, float]:
        """Return the values of variables by name, in SI units."""
        variables = self._task.variables
        return dict(zip(variables.names, variables.to_values(x).tolist(), strict=True))

    def starts(self, count: int, seed: int) -> NDArray[np.float64]:
        """Return starts of the variables `(count, p)`, drawn but for the first, with dampings that match."""
        variables = self._task.variables
        drawn = with_damping(variables, variables.draw(count, seed), self._angular)
        drawn[:, self._exact.variables.start.size :] = variables.start[self._exact.variables.start.size :]
        drawn[0] = variables.start
        return drawn

    def equations(self, x: NDArray[np.float64]) -> Equations:
        """Return the equations of all records for the spindle, with these variables."""
        return self._equations(self._task, x)

    @property
    def count(self) -> int:
        """Number of real numbers of the records."""
        return 2 * len(self._records) * self.lines_hz.size

    @property
    def independent_values(self) -> float:
        """Effective number of independent real numbers of the records."""
        return sum(record.independent_values for record in self._records)

    @property
    def share_of_residuals(self) -> float:
        """Share of the real numbers that is left where each line has a spindle of its own."""
        return 1.0 - len(TERMS) / len(self._records)

    def eliminated(self, seed: int, start: Mapping[str, float] | None = None) -> SpindleLines | None:
        """Return spindle and variables that explain the records best.

        `start` has values of variables by name from which the second step begins, without the first one. None is
        returned where no configuration has more than three records that separate the terms of the spindle.
        """
        if not self._configurations:
            return None
        thinned = self.thinned()
        x = thinned._each_configuration(seed) if start is None else self._task.variables.vector_of(start)
        ends = thinned._all_configurations(x)
        if ends is not None and thinned.lines_hz.size < self.lines_hz.size:
            ends = self._all_configurations(ends)
        return None if ends is None else self._about_best(ends)

    def _separates(self, indices: Sequence[int]) -> bool:
        """Return whether records determine all terms of the spindle, with the start values."""
        equations = self._equations(self._exact, self._exact.variables.start, indices)
        with np.errstate(all="ignore"):
            _, rank = equations.determined(linear_solution(equations))
        return bool(np.median(rank) == len(TERMS))

    def _first_like(self, index: int) -> int:
        """Return the first record of the same assembly with the same errors."""
        record, mapping = self._records[index], self._task.mappings[index]
        for i in range(index):
            other = self._task.mappings[i]
            same = other.addresses == mapping.addresses and np.array_equal(other.table, mapping.table)
            if same and self._records[i].assembly == record.assembly:
                return i
        return index

    def _each_configuration(self, seed: int) -> NDArray[np.float64]:
        """Return the variables after the first step, of which stiffnesses are fitted and dampings are typical."""
        variables = self._exact.variables
        low, high = variables.limits
        rows = few(self.lines_hz.size, _FIRST_LINES)
        free = np.array([unknown.prior is None for unknown in variables.unknowns])
        free &= ~(is_damping(variables) | np.isin(variables.names, FACTORS))
        starts = np.where(free, variables.draw(_STARTS if free.any() else 1, seed), variables.start)
        starts = with_damping(variables, starts, self._angular)

        def residual(share: NDArray[np.float64], start: NDArray[np.float64]) -> NDArray[np.float64]:
            x = start.copy()
            x[free] = low[free] + share * (high - low)[free]
            return np.concatenate(
                [unexplained(self._equations(self._exact, x, indices, rows)) for indices in self._configurations]
            )

        best, least = starts[0], np.inf
        for start in starts if free.any() else ():
            begun = np.clip((start - low)[free] / (high - low)[free], 1e-6, 1.0 - 1e-6)
            try:
                end = least_squares(residual, begun, args=(start,), bounds=(0.0, 1.0), max_nfev=_EVALUATIONS, ftol=1e-6)
            except (ValueError, ReceptanceError):
                continue  # no model at this start
            if end.cost < least:
                least, best = float(end.cost), start.copy()
                best[free] = low[free] + end.x * (high - low)[free]
        exact = with_damping(variables, best[None], self._angular)[0]
        return np.append(exact, self._task.variables.start[exact.size :])

    def _all_configurations(self, x: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Return the variables after the second step, in which all are fitted; None without a value at the start."""
        variables = self._task.variables
        core = _core.Problem(
            variables.logarithmic, np.ascontiguousarray(variables.limits), variables.priors, _checks.thread_count(1)
        )
        core.add_function(self._rows)
        free = np.ones(x.size, dtype=np.bool_)
        ends = core.fit(np.ascontiguousarray(x[None]), free, np.array([_EVALUATIONS]), _TOLERANCE, _LEAST)
        return np.asarray(ends.x[0]) if np.isfinite(ends.cost[0]) else None

    @property
    def _angular(self) -> float:
        return 2.0 * np.pi * float(np.median(self.lines_hz.real))

    def _equations(
        self,
        task: Task,
        x: NDArray[np.float64],
        indices: Sequence[int] | None = None,
        rows: NDArray[np.intp] | None = None,
    ) -> Equations:
        """Return the equations for the spindle of some records on some lines."""
        values = task.variables.to_values(x)
        chosen = range(len(self._records)) if indices is None else indices
        before: dict[int, Assembly] = {}
        free = []
        for i in chosen:
            first = self._same[i]
            if first not in before:
                assembly = task.mappings[first].apply(self._records[first].assembly, values)
                elements = [element for title, element in assembly.elements.items() if title != self._name]
                before[first] = Assembly(elements, list(assembly.attachments.values()))
            free.append(altered(self._records[i], assembly=before[first]))
        lines = self.lines_hz if rows is None else self.lines_hz[rows]
        at = np.arange(self.lines_hz.size) if rows is None else rows
        return blank_equations(tuple(free), lines, [at] * len(free), self._threads)

    def _solved(self, equations: Equations) -> tuple[NDArray[np.complex128], NDArray[np.float64]]:
        """Return the spindle of least cost on each line, and the costs."""
        with np.errstate(all="ignore"):
            starts = [linear_solution(equations.of_pairs(indices)) for indices in self._configurations]
            starts += [] if self._entries is None else [self._entries]
            ends = np.stack([refine(equations, start, _ENTRY_TOLERANCE) for start in starts])
            costs = np.stack([equations.cost(end) for end in ends])
            best = np.argmin(np.where(np.isfinite(costs), costs, np.inf), axis=0)
            lines = np.arange(best.size)
            entries, cost = ends[best, lines], costs[best, lines]
            self._improve(equations, entries, cost)
        return entries, cost

    def _improve(self, equations: Equations, entries: NDArray[np.complex128], cost: NDArray[np.float64]) -> None:
        """Replace poor solutions of lines by better ones from the lines beside them."""
        freedom = 2 * (len(self._records) - len(TERMS))
        # The scatter may differ from the stated one.
        scale = np.median(cost) / special.chdtri(freedom, 0.5)
        is_poor = ~(cost <= scale * special.chdtri(freedom, _CHANCE))
        poor, good = np.flatnonzero(is_poor), np.flatnonzero(~is_poor)
        if not (poor.size and good.size):
            return
        after = np.searchsorted(good, poor)
        lines = equations.select(is_poor)
        for beside in (good[np.maximum(after - 1, 0)], good[np.minimum(after, good.size - 1)]):
            other = refine(lines, entries[beside], _ENTRY_TOLERANCE)
            lower = lines.cost(other)
            better = lower < cost[poor]
            entries[poor[better]], cost[poor[better]] = other[better], lower[better]

    def about(self, x: NDArray[np.float64], entries: NDArray[np.complex128]) -> SpindleLines | None:
        """Return the records about a spindle with these entries `(n, 3)` and the variables within their bounds.

        None where the model has no value there: a linear effect may lead to a negative length.
        """
        x = np.clip(x, *self._task.variables.limits)
        try:
            equations = self.equations(x)
            return self._about(x, equations, entries, np.isfinite(equations.cost(entries)))
        except (ReceptanceError, ValueError):
            return None

    def _about_best(self, x: NDArray[np.float64]) -> SpindleLines:
        """Return the records about the spindle that explains them best; raise where the model has no value."""
        equations = self.equations(x)
        entries, cost = self._solved(equations)
        solved = np.isfinite(cost)
        before = np.ones_like(entries) if self._entries is None else self._entries
        self._entries = np.where(solved[:, None], entries, before)
        return self._about(x, equations, self._entries, solved)

    def _about(
        self, x: NDArray[np.float64], equations: Equations, entries: NDArray[np.complex128], solved: NDArray[np.bool_]
    ) -> SpindleLines:
        problem = self._on_table(entries)
        residual, jacobian = problem.rows(x, np.ones(x.size, dtype=np.bool_))
        weight = 1.0 / equations.deviation
        with np.errstate(all="ignore"):
            h, slope = equations.evaluate(entries)
        # A line without a spindle has the residual of a receptance of zero.
        ratio = np.where(solved[:, None], h / equations.measured, 0.0)
        columns = np.where(solved[:, None, None], slope * (weight / equations.measured)[..., None], 0.0)
        count, size = len(self._records), sum(problem.sizes[: len(self._records)])
        # The problem's residuals are logarithms of measured over calculated receptances. Those of the equations, ratios
        # of calculated over measured ones less one, are bounded where a calculated receptance vanishes.
        real, imaginary = jacobian[:size].reshape(count, 2, -1, x.size).transpose(1, 2, 0, 3)
        slopes = -ratio[..., None] * (real + 1j * imaginary)
        others = residual[size:], jacobian[size:]
        return SpindleLines(
            x, entries, np.asarray((ratio - 1.0) * weight, dtype=np.complex128), columns, slopes, others
        )

    def _rows(self, x: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
        """Return the residuals with the spindle that explains them best, and their projected derivatives."""
        try:
            spindle = self._about_best(x)
        except (ValueError, ReceptanceError):
            return None
        basis, _ = np.linalg.qr(spindle.columns)
        slopes = spindle.slopes - basis @ (basis.conj().transpose(0, 2, 1) @ spindle.slopes)
        flat, wide = spindle.residual.reshape(-1), slopes.reshape(-1, x.size)
        # The problem that is fitted has the priors itself.
        residual, jacobian = (rows[: rows.shape[0] - len(self._task.variables.priors)] for rows in spindle.others)
        return np.concatenate([flat.real, flat.imag, residual]), np.concatenate([wide.real, wide.imag, jacobian])

    def _on_table(self, entries: NDArray[np.complex128]) -> Problem:
        """Return the problem of all observations on a spindle with these receptances."""
        y, theta, both = entries.T
        table = MeasuredPart(
            frequency_hz=self.lines_hz.real,
            matrix=np.stack([np.stack([y, both], axis=-1), np.stack([both, theta], axis=-1)], axis=-2),
            decay_rate=-2.0 * np.pi * float(self.lines_hz.imag[0]),
            name=self._name,
        )
        ended: dict[int, Assembly] = {}
        observed = list(self._task.observed)
        for i, first in enumerate(self._same):
            if first not in ended:
                assembly = self._records[first].assembly
                elements = [table if name == self._name else part for name, part in assembly.elements.items()]
                ended[first] = Assembly(elements, list(assembly.attachments.values()))
            observed[i] = altered(self._records[i], assembly=ended[first])
        return self._task.problem(observed)


def _thinned(record: Observation, chosen: NDArray[np.intp]) -> Observation:
    """Return a record on some of its lines, which are correlated the less the wider they are apart."""
    correlated = np.maximum(record.correlated_lines * (chosen.size / record.frequency_hz.size), 1.0)
    return altered(record, correlated_lines=correlated).select(chosen)


def few(count: int, most: int) -> NDArray[np.intp]:
    """Return at most so many indices, evenly spaced."""
    return np.unique(np.linspace(0, count - 1, min(most, count)).round().astype(np.intp))


def unexplained(equations: Equations) -> NDArray[np.float64]:
    """Return the part of the records of one configuration that no spindle explains, in units of the allowed error."""
    weight = 1.0 / (np.abs(equations.measured) * np.hypot(equations.deviation, _ERROR))
    columns = equations.products * weight[..., None]
    size = np.linalg.norm(columns, axis=1, keepdims=True)
    basis, _ = np.linalg.qr(columns / np.where(size > 0.0, size, 1.0))
    residual = (equations.measured - equations.rigid) * weight
    residual = residual - (basis @ (basis.conj().transpose(0, 2, 1) @ residual[..., None]))[..., 0]
    return np.concatenate([residual.real.reshape(-1), residual.imag.reshape(-1)])
