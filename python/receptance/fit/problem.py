"""The input of a fit, and its least-squares problem: observations and priors as functions of the fitted variables.

The core computes residuals, derivatives, normal matrices and fits of receptances, truncated records, natural
frequencies and damping ratios. A receptance of which one joint is unknown is reduced to that joint, so that the rest of
the assembly is evaluated once.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from receptance import _checks, _core
from receptance.errors import ReceptanceError
from receptance.fit.discrepancy import Discrepancy
from receptance.fit.line_selection import FEWEST_LINES, resonant_lines, usable_lines
from receptance.fit.observation import Observation, Unit
from receptance.fit.parameters import FACTORS, ParameterMap, Parameters
from receptance.fit.peaks import Bands, find_bands, within
from receptance.fit.unknowns import Law, Unknown, Variables
from receptance.model.assembly import Assembly
from receptance.model.core_tables import Tied
from receptance.model.joints import PointJoint

_Rows = tuple[NDArray[np.float64], NDArray[np.float64]]


CONVERGED = 1e-3
"""Decrease of the cost below which a fit has converged whose end is judged, see `Problem.fit`."""
COST_TOLERANCE = 1e-6
"""Decrease of the cost at which a fit has converged whose cost is compared with that of another fit."""
_LEAST_SQUARE = 1e-8
"""Smallest ratio of two squared singular values that a normal matrix of columns of unit length tells to six digits."""
_LEAST_DAMPING = 1e-4
"""Damping ratios below this are compared relative to it, where they have no standard deviation."""
UNFINISHED, COST_SETTLED = 0, 2
"""Status of a fit whose evaluations were used up, and of one whose cost changes no more."""
_STATUS = {
    -1: "the model has no value there",
    UNFINISHED: "the evaluations were used up",
    1: "no slope is left",
    COST_SETTLED: "the cost changes no more",
    3: "the variables change no more",
}
"""Why a fit ended, by its status in the core."""
_TOLERANCE = 1e-10
"""Relative change at which a fit from one start has converged."""


class InfeasibleError(ReceptanceError):
    """A point at which the model has no value; a fit keeps away from it."""


@dataclass(frozen=True, eq=False)
class Task:
    """Observations, unknown parameters and units of the residuals."""

    observed: tuple[Observation, ...]
    parameters: Parameters
    units: tuple[Unit, ...]
    """Unit of the residuals of each observation."""
    bands: Bands | None = None
    """Bands of the lines that are used, in Hz; by default all."""
    band_width_percent: float = 5.0
    """Half width of bands around peaks, with percentages."""
    threads: int | None = None
    discrepancy: Discrepancy | None = None
    """The discrepancy that the fit allows for, see `allow`."""
    allowing: tuple[Observation, ...] | None = None
    """The observations that are fitted in place of `observed`: on few lines, with variances that include it."""

    @cached_property
    def variables(self) -> Variables:
        """The fitted vector."""
        return Variables(self.parameters.unknowns)

    @cached_property
    def mappings(self) -> list[ParameterMap]:
        """Parameters of each observation's assembly as functions of the unknowns."""
        return self.parameters.of([observation.site(i) for i, observation in enumerate(self.observed)])

    @cached_property
    def configurations(self) -> tuple[str, ...]:
        """Name of the configuration of each observation."""
        return tuple(observation.site(i).configuration for i, observation in enumerate(self.observed))

    @cached_property
    def selected(self) -> tuple[Observation, ...]:
        """The observations on the lines that are fitted: within the bands, or those that allow for a discrepancy."""
        if self.allowing is not None:
            return self.allowing
        return tuple(
            self._in_bands(observation, unit) for observation, unit in zip(self.observed, self.units, strict=True)
        )

    @property
    def independent_values(self) -> float:
        """Effective number of independent real numbers that are fitted."""
        return sum(observation.independent_values for observation in self.selected)

    def problem(self, selected: Sequence[Observation] | None = None, smoothing: float | None = None) -> Problem:
        """Return the residuals as a problem of the core: of all lines in bands, or of observations on other lines."""
        observations = self.selected if selected is None else selected
        return Problem(self.variables, observations, self.mappings, self.units, self.threads, smoothing=smoothing)

    def approach(self) -> Problem:
        """Return a problem whose fit is a start for percentages: logarithms on all lines.

        Percentages in bands around measured peaks do not depend on calculated peaks outside of them.
        """
        return replace(
            self, units=tuple(observation.unit for observation in self.observed), band_width_percent=0.0
        ).problem()

    def allow(self, discrepancy: Discrepancy) -> Task:
        """Return the task with variances that include a discrepancy, on the lines of this task."""
        return replace(self, discrepancy=discrepancy, allowing=discrepancy.allow(self.selected, self.configurations))

    @property
    def resonant(self) -> Task:
        """The task on few lines of each receptance: those that can be judged, without antiresonances."""
        masks = usable_lines(self.selected, self.configurations)
        usable = [
            observation if mask is None or mask.sum() < min(FEWEST_LINES, mask.size) else observation.select(mask)
            for observation, mask in zip(self.selected, masks, strict=True)
        ]
        return replace(self, allowing=resonant_lines(usable, self.configurations))

    @property
    def stated(self) -> Task:
        """The task with the stated standard deviations on all lines within the bands."""
        return self if self.allowing is None else replace(self, discrepancy=None, allowing=None)

    def without_errors(self) -> Task:
        """Return the task with exact dimensions and materials; its vector is the first part of that of this task."""
        exact = [
            replace(unknown, individual=0.0) if isinstance(unknown, Law) else unknown
            for unknown in self.parameters.given
        ]
        sites = [observation.site(i) for i, observation in enumerate(self.observed)]
        return replace(self, parameters=Parameters(exact, (), sites))

    def on(self, observed: Sequence[Observation]) -> Task:
        """Return the task with other data, one observation for each, all with standard deviations."""
        units: list[Unit] = ["standard deviations"] * len(observed)
        return replace(self, observed=tuple(observed), units=tuple(units), bands=None, discrepancy=None, allowing=None)

    def _in_bands(self, observation: Observation, unit: Unit) -> Observation:
        if not observation.is_receptance:
            return observation
        bands = self.bands
        if bands is None and unit == "percent":
            bands = find_bands(observation, width_percent=self.band_width_percent)
        return observation if bands is None else observation.select(within(observation, bands))


class End(NamedTuple):
    """The end of one fit."""

    x: NDArray[np.float64]
    """`(p,)` the fitted variables."""
    cost: float
    """Half the sum of squares; infinite where the model has no value."""
    first: float
    """That of the start."""
    evaluations: int
    """Evaluations of all observations."""
    status: int
    """As of SciPy's `least_squares`; -1 where the model has no value at the start."""
    normal: NDArray[np.float64]
    """`(p + 1, p + 1)` A^T A of A = [J | r], at the end or a step from it that lowers the cost by less than the
    tolerance."""

    @property
    def converged(self) -> bool:
        """Whether the fit stopped because cost or variables no longer changed."""
        return self.status > 0

    @property
    def message(self) -> str:
        """Why the fit ended."""
        return _STATUS[self.status]

    @property
    def curvature(self) -> NDArray[np.float64]:
        """J^T J, `(p, p)`."""
        return self.normal[:-1, :-1]


class Problem:
    """All residuals as a function of the fitted variables.

    Each observation, on the lines that are used, has a map of parameters and a unit of its residuals. Residuals well
    above `smoothing` count by their absolute value, which is not for logarithms of receptances. `information`, R and c
    of the residuals R (x - c), takes the place of the priors of the unknowns.
    """

    def __init__(
        self,
        variables: Variables,
        observations: Sequence[Observation],
        mappings: Sequence[ParameterMap],
        units: Sequence[Unit],
        threads: int | None = None,
        *,
        smoothing: float | None = None,
        information: _Rows | None = None,
    ) -> None:
        self.variables = variables
        self.evaluations = 0
        self._observations, self._mappings = tuple(observations), tuple(mappings)
        priors = variables.priors if information is None else np.zeros((0, 3))
        core = _core.Problem(
            variables.logarithmic,
            np.ascontiguousarray(variables.limits),
            priors,
            _checks.thread_count(threads),
            smoothing,
        )
        self._added = _add(core, self._observations, self._mappings, units, variables.unknowns, threads)
        self.core = core
        # Number of residuals of each observation, and of all with priors.
        self.sizes = tuple(map(_residual_count, self._observations, units))
        self.size = sum(self.sizes) + (len(priors) if information is None else information[1].size)
        if information is not None:
            core.add_linear(*(np.ascontiguousarray(array, dtype=np.float64) for array in information))
        self._at: NDArray[np.float64] | None = None
        self._rows: _Rows = np.empty(0), np.empty((0, 0))
        self._end: End | None = None
        self._smoothing = smoothing

    def named(self, x: NDArray[np.float64]) -> dict[str, float]:
        """Return the values in SI units by name."""
        return dict(zip(self.variables.names, self.variables.to_values(x).tolist(), strict=True))

    def parts(self, residual: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        """Return the residuals of each observation, without those of priors."""
        return np.split(residual, np.cumsum(self.sizes))[:-1]

    def residual(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the residuals, priors last; all infinite where the model has no value."""
        return self._evaluate(x)[0]

    def jacobian(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivatives of the residuals with respect to the variables; zero where the model has no value."""
        return self._evaluate(x)[1]

    def value(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the residuals at a point where the model has a value, without their derivatives."""
        if self._at is not None and np.array_equal(self._at, x) and np.isfinite(self._rows[0]).all():
            return self._rows[0]
        return self.rows(x, np.zeros(x.size, dtype=np.bool_))[0]

    def rows(self, x: NDArray[np.float64], free: NDArray[np.bool_]) -> _Rows:
        """Return the residuals and their derivatives by some variables; raise where the model has no value."""
        rows = self.core.rows(np.ascontiguousarray(x), free)
        if rows is None:
            raise InfeasibleError(self.reason(x))
        return rows

    def cost(self, x: NDArray[np.float64]) -> float:
        """Return half the sum of squares; infinite where the model has no value."""
        self.evaluations += 1
        if self._smoothing is not None:
            # Only the normal matrix has the weights of the smoothing.
            matrix = self.core.normal_matrix(np.ascontiguousarray(x))
            return 0.5 * float(matrix[-1, -1]) if np.isfinite(matrix).all() else np.inf
        rows = self.core.rows(np.ascontiguousarray(x), np.zeros(x.size, dtype=np.bool_))
        return np.inf if rows is None else 0.5 * float(rows[0] @ rows[0])

    def curvature_root(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return a matrix R with R^T R = J^T J at a point.

        R follows from the normal matrix, which is small: derivatives of thousands of lines are not formed. Where the
        squares of its singular values would lose digits, R is J itself. So it is with a smoothing, which weighs the
        rows of the normal matrix. Where the model has no value, R is zero. Where all observations are reduced to a
        joint and a fit has ended there, its normal matrix is used, which is close enough.
        """
        if self._smoothing is not None:
            return self.jacobian(x)
        reduced = all(added.reduced for added in self._added)
        if self._end is not None and reduced and np.array_equal(self._end.x, x):
            normal = self._end.normal
        else:
            normal = self.core.normal_matrix(np.ascontiguousarray(x))
        root = _root(normal[:-1, :-1])
        return self.jacobian(x) if root is None else root

    def thinned(self, lines: int) -> Problem | None:
        """Return the same problem with about so many lines of each receptance, for fits; None if it has no more."""
        fewer = self.core.thinned(lines)
        if fewer.lines == self.core.lines:
            return None
        problem = copy.copy(self)
        problem.core, problem.evaluations = fewer, 0
        return problem

    def fit(
        self,
        starts: NDArray[np.float64],
        most: int | NDArray[np.int64] = 100,
        *,
        free: NDArray[np.bool_] | None = None,
        tolerance: float = _TOLERANCE,
        least: float = 0.0,
        of_all: bool = False,
    ) -> list[End]:
        """Return the ends of fits from all starts `(n, p)` within the bounds.

        `most` is the largest number of evaluations of each fit, `free` the mask of fitted variables; the others are
        held. A fit has converged at a relative change of cost and variables of `tolerance`, and where the predicted
        decrease of the cost by the next step is at most `least`. With a `least` of `CONVERGED` or less it has converged
        as well where ten evaluations lower the cost by less than 250 times `least`: in a long curved valley it would go
        on for hundreds. `of_all` keeps the rows and columns of held variables in normal matrices.
        """
        moving = np.ones(starts.shape[1], dtype=np.bool_) if free is None else free
        limits = np.array(np.broadcast_to(most, len(starts)), dtype=np.int64)
        core_ends = self.core.fit(np.ascontiguousarray(starts), moving, limits, tolerance, least, of_all)
        numbers = zip(
            core_ends.x,
            core_ends.cost.tolist(),
            core_ends.first.tolist(),
            core_ends.evaluations.tolist(),
            core_ends.status.tolist(),
            core_ends.normal,
            strict=True,
        )
        kept = np.append(moving | of_all, True)
        ends = [End(*number) for number in numbers]
        self.evaluations += sum(end.evaluations for end in ends)
        ends = [self._against_bound(start, end, kept) for start, end in zip(starts, ends, strict=True)]
        self._end = min(ends, key=lambda end: end.cost, default=None)
        return ends

    def _against_bound(self, start: NDArray[np.float64], end: End, kept: NDArray[np.bool_]) -> End:
        """Return the start itself where it lies on a bound and fits better than the end.

        The engine works inside of the bounds. A model may jump at one: a spring of zero stiffness leaves a free body
        its rigid-body modes, and any stiffness makes modes of them.
        """
        low, high = self.variables.limits
        if not ((start <= low) | (start >= high)).any():
            return end
        end = end._replace(evaluations=end.evaluations + 1)
        cost = self.cost(start)
        if not cost < end.cost:
            return end
        matrix = self.core.normal_matrix(np.ascontiguousarray(start))
        if not np.isfinite(matrix).all():
            return end
        return end._replace(x=start.copy(), cost=cost, normal=np.ascontiguousarray(matrix[np.ix_(kept, kept)]))

    def fit_one(self, start: NDArray[np.float64], most: int = 100, **settings: Any) -> End:
        """Return the end of the fit from one start, which may be outside of the bounds; `settings` as of `fit`."""
        (end,) = self.fit(np.clip(start, *self.variables.limits)[None], most, **settings)
        return end

    def reason(self, x: NDArray[np.float64]) -> str:
        """Return why the model has no value at a point."""
        values = self.variables.to_values(x)
        for observation, mapping in zip(self._observations, self._mappings, strict=True):
            try:
                mapping.apply(observation.assembly, values)
            except ValueError as error:
                return str(error)
        reason = self.core.reason(np.ascontiguousarray(x))
        if reason is None:
            return "a residual or its derivative is not finite"
        number, text = reason
        return self._added[number].assembly.flat().with_joint_name(text)

    def _evaluate(self, x: NDArray[np.float64]) -> _Rows:
        if self._at is None or not np.array_equal(self._at, x):
            self.evaluations += 1
            try:
                self._rows = self.rows(x, np.ones(x.size, dtype=np.bool_))
            except InfeasibleError:
                self._rows = np.full(self.size, np.inf), np.zeros((self.size, x.size))
            for array in self._rows:
                array.setflags(write=False)
            self._at = x.copy()
        return self._rows


class _Added(NamedTuple):
    """An observation of the core: its assembly, and whether its model is reduced to the only unknown joint."""

    assembly: Assembly
    reduced: bool


def _residual_count(observation: Observation, unit: Unit) -> int:
    """Return the number of residuals of an observation."""
    lines = observation.frequency_hz.size
    if observation.is_receptance:
        return lines if unit == "percent" else 2 * lines
    return lines + observation.damped.size


def _add(
    core: _core.Problem,
    observations: Sequence[Observation],
    mappings: Sequence[ParameterMap],
    units: Sequence[Unit],
    unknowns: Sequence[Unknown],
    threads: int | None,
) -> list[_Added]:
    """Add observations to a problem of the core in their order, and return what was added.

    Successive receptances of one model on the same lines are records of one observation of the core, so that the model
    is evaluated once. Without `unknowns`, whose bounds a reduction to one joint needs, there is no reduction.
    """
    added = []
    first = 0
    for end in range(1, len(observations) + 1):
        pair = slice(end - 1, end + 1)
        if end < len(observations) and _are_records(observations[pair], mappings[pair], units[pair]):
            continue
        records, mapping, unit = observations[first:end], mappings[first], units[first]
        first, assembly = end, records[0].assembly
        if not records[0].is_receptance:
            _add_frequencies(core, records[0], mapping, unit)
        elif _add_reduced(core, records, mapping, unit, unknowns, threads):
            added += [_Added(assembly, reduced=True)] * len(records)
            continue
        else:
            _add_receptance(core, records, mapping, unit)
        added.append(_Added(assembly, reduced=False))
    return added


def _are_records(observations: Sequence[Observation], mappings: Sequence[ParameterMap], units: Sequence[Unit]) -> bool:
    """Return whether two observations are receptances of one model on the same lines."""
    (first, second), (mapping, other_mapping) = observations, mappings
    return (
        first.is_receptance
        and second.is_receptance
        and units[0] == units[1]
        and first.coordinates == second.coordinates
        and first.ends == second.ends
        and np.array_equal(first.frequency_hz, second.frequency_hz)
        and _equal(first.force, second.force)
        and (
            mapping is other_mapping
            or (mapping.addresses == other_mapping.addresses and _equal(mapping.table, other_mapping.table))
        )
        and (first.assembly is second.assembly or first.assembly == second.assembly)
    )


def _add_receptance(core: _core.Problem, records: Sequence[Observation], mapping: ParameterMap, unit: Unit) -> None:
    """Add records of one receptance."""
    observation = records[0]
    model, factors = _tied(observation, mapping)
    lines = _core.Lines(np.ascontiguousarray(2.0 * np.pi * observation.frequency_hz, dtype=np.complex128))
    measured = np.stack([record.receptance for record in records])
    weights = np.stack([_weights(record, unit) for record in records])
    core_records = _core.Records(measured, weights, unit == "percent", observation.ends)
    try:
        by_line = model.flat.by_line(core_records.evaluated(lines) / math.tau, observation.force)
    except ValueError as error:
        raise InfeasibleError(str(error)) from None
    core.add_receptance(model.model(mapping.table, factors), lines, model.points, core_records, by_line)


def _add_reduced(
    core: _core.Problem,
    records: Sequence[Observation],
    mapping: ParameterMap,
    unit: Unit,
    unknowns: Sequence[Unknown],
    threads: int | None,
) -> bool:
    """Add records of one receptance as those of a model that is reduced to its one unknown joint, if it is one."""
    observation = records[0]
    joint = only_joint(observation, mapping)
    if joint is None or not unknowns or unit == "percent" or observation.ends is not None:
        return False
    names = [address.split(".", 1)[1] for address in mapping.addresses]
    try:
        stiff = _stiffest(
            observation, joint, {name: unknowns[i] for name, i in zip(names, mapping.bases[:, 0], strict=True)}
        )
        reduction = observation.assembly.reduced_to_joint(
            joint,
            observation.frequency_hz,
            response=observation.response,
            excitation=observation.excitation,
            at=stiff,
            threads=threads,
        )
    except (ReceptanceError, ValueError):
        # The joint at the bounds has no value; the fit itself may never go there.
        return False
    numbers = np.full(len(PointJoint.columns_of), -1.0)
    numbers[[PointJoint.columns_of.index(name) for name in names]] = mapping.bases[:, 0]
    for record in records:
        measured = np.ascontiguousarray(record.receptance)
        core.add_joint_receptance(reduction, np.array(stiff.columns), numbers, measured, _weights(record, unit))
    return True


def _weights(frf: Observation, unit: Unit) -> NDArray[np.float64]:
    """Return the weights of the lines of a receptance."""
    if unit != "standard deviations" or frf.standard_deviation is None:
        return np.ones(frf.frequency_hz.size)
    return 1.0 / frf.standard_deviation


def _add_frequencies(core: _core.Problem, measured: Observation, mapping: ParameterMap, unit: Unit) -> None:
    """Add natural frequencies and the damping ratios that are known."""
    model, factors = _tied(measured, mapping)
    frequency, deviation = measured.frequency_hz.real, measured.standard_deviation
    ratio, damping_deviation = measured.damping_ratio, measured.standard_deviation_damping
    if unit != "standard deviations" or deviation is None:
        share = 0.01 if unit == "percent" else 1.0
        deviation = frequency * share
        damping_deviation = None if ratio is None else np.maximum(ratio, _LEAST_DAMPING) * share
    damping = () if ratio is None or damping_deviation is None else (ratio, 1.0 / damping_deviation)
    modes = np.array(measured.modes, dtype=np.float64) - 1.0
    core.add_frequencies(
        model.model(mapping.table, factors), modes, 2.0 * np.pi * frequency, 0.5 / (np.pi * deviation), *damping
    )


def _equal(first: NDArray[np.float64] | None, second: NDArray[np.float64] | None) -> bool:
    """Return whether two arrays are equal, or both are None."""
    return first is second or (first is not None and second is not None and np.array_equal(first, second))


def slopes_at(
    observations: Sequence[Observation], mappings: Sequence[ParameterMap], units: Sequence[Unit], threads: int | None
) -> NDArray[np.float64]:
    """Return the derivatives of the residuals of observations where all unknowns of their maps are zero, `(n, p)`."""
    count = mappings[0].shifts.shape[1]
    core = _unbounded(count, threads)
    _add(core, observations, mappings, units, (), threads)
    rows = core.rows(np.zeros(count), np.ones(count, dtype=np.bool_))
    if rows is None:
        raise InfeasibleError("the model has no value, or a residual or its derivative is not finite")
    return rows[1]


def _unbounded(count: int, threads: int | None) -> _core.Problem:
    limits = np.array([[-np.inf], [np.inf]]) * np.ones(count)
    return _core.Problem(np.zeros(count, dtype=np.bool_), limits, np.zeros((0, 3)), _checks.thread_count(threads))


def residuals_at(
    observation: Observation, mapping: ParameterMap, unit: Unit, values: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the residuals of an observation at rows of values of the unknowns, `(n, p)`; NaN where it has no value."""
    count = values.shape[1]
    core = _unbounded(count, 1)
    _add(core, [observation], [mapping], [unit], (), None)
    result = np.full((len(values), _residual_count(observation, unit)), np.nan)
    for residual, point in zip(result, map(np.ascontiguousarray, values), strict=True):
        rows = core.rows(point, np.zeros(count, dtype=np.bool_))
        if rows is not None:
            residual[:] = rows[0]
    return result


def only_joint(observation: Observation, mapping: ParameterMap) -> str | None:
    """Return the joint whose terms are the only unknowns of an observation, each by itself; None if there is none."""
    owners = {name.split(".", 1)[0] for name in mapping.addresses}
    name = owners.pop() if len(owners) == 1 else ""
    if type(observation.assembly.elements.get(name)) is not PointJoint:
        return None
    (first, second), total = mapping.bases.T, mapping.multiples.sum(axis=1)
    alone = np.all(first >= 0) and np.all(second < 0) and np.all(total == 1.0)
    return name if alone and not mapping.exponents.any() and not mapping.shifts.any() else None


def _stiffest(frf: Observation, joint: str, unknowns: dict[str, Unknown]) -> PointJoint:
    """Return the joint as stiff as the bounds allow: any other one adds compliance to it, which costs no digits."""
    values: dict[str, Any] = {name: getattr(frf.assembly.elements[joint], name) for name in PointJoint.columns_of}
    for name, unknown in unknowns.items():
        values[name] = unknown.upper if name in ("k_y", "k_theta") else max(0.0, unknown.lower)
    for kind in "kc":
        limit = np.sqrt(values[f"{kind}_y"] * values[f"{kind}_theta"])
        values[f"{kind}_ytheta"] = float(np.clip(values[f"{kind}_ytheta"], -0.5 * limit, 0.5 * limit))
    return PointJoint(**values)


def _tied(observation: Observation, mapping: ParameterMap) -> tuple[Tied, NDArray[np.float64]]:
    """Return the model as a function of the addresses of a map, and factors of the record."""
    factors = [(FACTORS.index(name), i) for i, name in enumerate(mapping.addresses) if name in FACTORS]
    tied = observation.assembly.tied(mapping.addresses, observation.coordinates, others=FACTORS)
    return tied, np.array(factors, dtype=np.float64).reshape(-1, 2)


def _root(normal: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Return R with R^T R = N for a positive definite N; None where it has too few digits, or no value."""
    diagonal = np.diag(normal)
    if not (np.isfinite(normal).all() and np.all(diagonal > 0.0)):
        return None
    scale = np.sqrt(diagonal)
    squares, vectors = np.linalg.eigh(normal / np.outer(scale, scale))
    if squares[0] < _LEAST_SQUARE * squares[-1]:
        return None
    root: NDArray[np.float64] = np.sqrt(squares)[:, None] * vectors.T * scale
    return root


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Limit BLAS to one thread within the block, or within a function that has this as a decorator.

    The matrices of fits are small: threads of BLAS wait for each other longer than they compute, and they compete with
    the threads of the core. On two processors `receptance diagnose` takes up to twice as long with them. SciPy has a
    BLAS of its own, which fits do not use: it is not loaded for this.
    """
    try:
        from threadpoolctl import threadpool_limits
    except ImportError:  # scripts that have NumPy and SciPy alone
        yield
        return
    with threadpool_limits(1, user_api="blas"):
        yield
