"""The input of a fit, and its least-squares problem: observations and priors as functions of the fitted variables.

The core computes residuals, derivatives, normal matrices and fits of receptances, truncated records, natural
frequencies and damping ratios. A receptance of which one joint is unknown is reduced to that joint, so that the rest of
the assembly is evaluated once.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from receptance import _checks, _core
from receptance.errors import ReceptanceError
from receptance.fit.observation import Observation, Unit
from receptance.fit.parameters import FACTORS, ParameterMap, Parameters
from receptance.fit.peaks import Bands, find_bands, within
from receptance.fit.unknowns import Law, Unknown, Variables
from receptance.model.assembly import Assembly
from receptance.model.core_tables import Tied
from receptance.model.joints import PointJoint

_Rows = tuple[NDArray[np.float64], NDArray[np.float64]]


COST_TOLERANCE = 1e-6
"""Decrease of the cost at which a fit has converged whose cost is compared with that of another fit."""
_LEAST_SQUARE = 1e-8
"""Smallest ratio of two squared singular values that a normal matrix of columns of unit length tells to six digits."""
_LEAST_DAMPING = 1e-4
"""Damping ratios below this are compared relative to it, where they have no standard deviation."""
_STATUS = {
    -1: "the model has no value there",
    0: "the evaluations were used up",
    1: "no slope is left",
    2: "the cost changes no more",
    3: "the variables change no more",
}
"""Why a fit ended, by its status in the core."""
_TOLERANCE = 1e-10
"""Relative change at which a fit from one start has converged."""


class InfeasibleError(ReceptanceError):
    """A point at which the model has no value; a fit keeps away from it."""


class Observed(NamedTuple):
    """An observation on the lines that are used, the parameters of its assembly, and the unit of its residuals."""

    observation: Observation
    mapping: ParameterMap
    unit: Unit


@dataclass(frozen=True, eq=False)
class Task:
    """Observations, unknown parameters and units of the residuals.

    Attributes
    ----------
    observed : tuple of Observation
        The observations.
    parameters : Parameters
        The unknowns and their map to parameters of the assemblies.
    units : tuple of str
        Unit of the residuals of each observation.
    bands : list of (float, float) or None
        Bands of the lines that are used, in Hz; by default all.
    band_width_percent : float
        Half width of bands around peaks, with percentages.
    threads : int or None
        As in `Assembly.receptance`.
    noise_factor : float
        Factor of the standard deviations of `observed` over the stated ones, see `noisier`.
    """

    observed: tuple[Observation, ...]
    parameters: Parameters
    units: tuple[Unit, ...]
    bands: Bands | None = None
    band_width_percent: float = 5.0
    threads: int | None = None
    noise_factor: float = 1.0

    @cached_property
    def variables(self) -> Variables:
        """The fitted vector."""
        return Variables(self.parameters.unknowns)

    @cached_property
    def mappings(self) -> list[ParameterMap]:
        """Parameters of each observation's assembly as functions of the unknowns."""
        return self.parameters.of([observation.site(i) for i, observation in enumerate(self.observed)])

    @cached_property
    def selected(self) -> tuple[Observation, ...]:
        """The observations on the lines within the bands."""
        return tuple(
            self._in_bands(observation, unit) for observation, unit in zip(self.observed, self.units, strict=True)
        )

    @property
    def independent_values(self) -> float:
        """Effective number of independent real numbers that are fitted."""
        return sum(one.independent_values for one in self.selected)

    def problem(self, selected: Sequence[Observation] | None = None, smoothing: float | None = None) -> Problem:
        """Return the residuals as a problem of the core.

        Parameters
        ----------
        selected : sequence of Observation, optional
            The observations on some of their lines; by default on all in bands.
        smoothing : float, optional
            As of `Problem`.
        """
        chosen = self.selected if selected is None else selected
        observed = [Observed(*one) for one in zip(chosen, self.mappings, self.units, strict=True)]
        return Problem(self.variables, observed, self.threads, smoothing=smoothing)

    def approach(self) -> Problem:
        """Return a problem whose fit is a start for percentages: logarithms on all lines.

        Percentages in bands around measured peaks do not depend on calculated peaks outside of them.
        """
        return replace(
            self, units=tuple(observation.unit for observation in self.observed), band_width_percent=0.0
        ).problem()

    def noisier(self, factor: float) -> Task:
        """Return the task with the stated standard deviations times a factor."""
        more = factor / self.noise_factor
        return replace(
            self, observed=tuple(observation.noisier(more) for observation in self.observed), noise_factor=factor
        )

    def without_errors(self) -> Task:
        """Return the task with exact dimensions and materials; its vector is the first part of that of this task."""
        exact = [replace(one, individual=0.0) if isinstance(one, Law) else one for one in self.parameters.given]
        sites = [observation.site(i) for i, observation in enumerate(self.observed)]
        return replace(self, parameters=Parameters(exact, (), sites))

    def on(self, observed: Sequence[Observation]) -> Task:
        """Return the task with other data, one observation for each, all with standard deviations."""
        units: list[Unit] = ["standard deviations"] * len(observed)
        return replace(self, observed=tuple(observed), units=tuple(units), bands=None)

    def _in_bands(self, observation: Observation, unit: Unit) -> Observation:
        if not observation.is_receptance:
            return observation
        bands = self.bands
        if bands is None and unit == "percent":
            bands = find_bands(observation, width_percent=self.band_width_percent)
        return observation if bands is None else observation.select(within(observation, bands))


class End(NamedTuple):
    """The end of one fit.

    Attributes
    ----------
    x : ndarray
        `(p,)` the fitted variables.
    cost, first : float
        Half the sum of squares at the end and at the start; infinite where the model has no value.
    evaluations : int
        Evaluations of all observations.
    status : int
        As of SciPy's `least_squares`; -1 where the model has no value at the start.
    normal : ndarray
        `(p + 1, p + 1)` A^T A of A = [J | r], at the end or a step from it that lowers the cost by less than the
        tolerance.
    """

    x: NDArray[np.float64]
    cost: float
    first: float
    evaluations: int
    status: int
    normal: NDArray[np.float64]

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

    Parameters
    ----------
    variables : Variables
        The fitted vector.
    observed : sequence of Observed
        The observations.
    threads : int, optional
        As in `Assembly.receptance`.
    smoothing : float, optional
        Residuals well above it count by their absolute value; not for logarithms of receptances.
    known : tuple of ndarray, optional
        R and c of the residuals R (x - c), in the place of the priors of the unknowns.

    Attributes
    ----------
    sizes : tuple of int
        Number of residuals of each observation.
    evaluations : int
        How often all observations were evaluated.
    """

    def __init__(
        self,
        variables: Variables,
        observed: Sequence[Observed],
        threads: int | None = None,
        *,
        smoothing: float | None = None,
        known: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None,
    ) -> None:
        self.variables = variables
        self.evaluations = 0
        self._observed, self._threads = tuple(observed), threads
        priors = prior_table(variables.unknowns) if known is None else np.zeros((0, 3))
        core = _core.Problem(
            variables.logarithmic,
            np.ascontiguousarray(variables.limits),
            priors,
            _checks.thread_count(threads),
            smoothing,
        )
        self._added = _CoreObservations(core, self._observed, variables.unknowns, threads)
        self.core = core
        self.sizes = self._added.sizes
        self.size = sum(self.sizes) + (len(priors) if known is None else known[1].size)
        if known is not None:
            core.add_linear(*(np.ascontiguousarray(array, dtype=np.float64) for array in known))
        places = np.append(self._added.places, np.arange(sum(self.sizes), self.size))
        self._places = None if np.array_equal(places, np.arange(self.size)) else places
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
        found = self.core.rows(np.ascontiguousarray(x), free)
        if found is None:
            raise InfeasibleError(self.reason(x))
        if self._places is None:
            return found
        residual, slopes = np.empty_like(found[0]), np.empty_like(found[1])
        residual[self._places], slopes[self._places] = found
        return residual, slopes

    def cost(self, x: NDArray[np.float64]) -> float:
        """Return half the sum of squares; infinite where the model has no value."""
        self.evaluations += 1
        if self._smoothing is not None:
            # Only the normal matrix has the weights of the smoothing.
            matrix = self.core.normal_matrix(np.ascontiguousarray(x))
            return 0.5 * float(matrix[-1, -1]) if np.isfinite(matrix).all() else np.inf
        found = self.core.rows(np.ascontiguousarray(x), np.zeros(x.size, dtype=np.bool_))
        return np.inf if found is None else 0.5 * float(found[0] @ found[0])

    def curvature_root(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return a matrix R with R^T R = J^T J at a point.

        R follows from the normal matrix, which is small: derivatives of thousands of lines are not formed. Where the
        squares of its singular values would lose digits, R is J itself. So it is with a smoothing, which weighs the
        rows of the normal matrix. Where the model has no value, R is zero. Where all observations are reduced to a
        joint and a fit has ended there, its normal matrix is used, which is close enough.
        """
        if self._smoothing is not None:
            return self.jacobian(x)
        if self._end is not None and self._added.reduced == len(self._observed) and np.array_equal(self._end.x, x):
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
        found = object.__new__(Problem)
        found.__dict__.update(self.__dict__)
        found.core, found.evaluations = fewer, 0
        return found

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
        decrease of the cost by the next step is at most `least`. `of_all` keeps the rows and columns of held variables
        in normal matrices.
        """
        moving = np.ones(starts.shape[1], dtype=np.bool_) if free is None else free
        limits = np.array(np.broadcast_to(most, len(starts)), dtype=np.int64)
        found = self.core.fit(np.ascontiguousarray(starts), moving, limits, tolerance, least, of_all)
        numbers = zip(
            found.x,
            found.cost.tolist(),
            found.first.tolist(),
            found.evaluations.tolist(),
            found.status.tolist(),
            found.normal,
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
        for item in self._observed:
            try:
                item.mapping.apply(item.observation.assembly, values)
            except ValueError as error:
                return str(error)
        found = self.core.reason(np.ascontiguousarray(x))
        if found is None:
            return "a residual or its derivative is not finite"
        number, text = found
        return self._added.assemblies[number].flat().with_joint_name(text)

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


@dataclass(eq=False)
class _Receptance:
    """Records of one receptance of one model on the same lines."""

    model: _core.TiedModel
    lines: _core.Lines
    points: NDArray[np.float64]
    percent: bool
    end: float | None
    by_line: _core.ByLine | None
    assembly: Assembly
    indices: list[int] = field(default_factory=list)
    measured: list[NDArray[np.complex128]] = field(default_factory=list)
    weights: list[NDArray[np.float64]] = field(default_factory=list)


class _CoreObservations:
    """Adds observations to a problem of the core.

    Without `unknowns`, whose bounds a reduction to one joint needs, there is no reduction. `sizes` are the numbers of
    residuals of the observations. `places` are the positions of the residuals of the core in the order of the
    observations, and `assemblies` are the assemblies in the order of the core.
    """

    def __init__(
        self, core: _core.Problem, observed: Sequence[Observed], unknowns: Sequence[Unknown], threads: int | None
    ) -> None:
        self._core, self._unknowns, self._threads = core, unknowns, threads
        self._order: list[int] = []
        self._receptances: dict[tuple[bytes, ...], _Receptance] = {}
        self.assemblies: list[Assembly] = []
        self.reduced = 0
        found: list[int] = []
        for index, item in enumerate(observed):
            add = self._add_receptance if item.observation.is_receptance else self._add_frequencies
            found.append(add(index, item, item.observation))
        self.sizes = tuple(found)
        for each in self._receptances.values():
            records = _core.Records(np.stack(each.measured), np.stack(each.weights), each.percent, each.end)
            core.add_receptance(each.model, each.lines, each.points, records, each.by_line)
            self._order += each.indices
            self.assemblies.append(each.assembly)
        begins = np.cumsum([0, *self.sizes])
        self.places = np.concatenate([np.arange(begins[i], begins[i + 1]) for i in self._order] or [np.arange(0)])

    def _add_receptance(self, index: int, item: Observed, frf: Observation) -> int:
        """Add a receptance; those of one model on the same lines are records of one observation of the core."""
        percent = item.unit == "percent"
        measured = np.ascontiguousarray(frf.receptance)
        weights = np.ones(measured.size)
        if item.unit == "standard deviations" and frf.standard_deviation is not None:
            weights = 1.0 / frf.standard_deviation
        size = measured.size if percent else 2 * measured.size
        if not percent and frf.ends is None and self._add_reduced(index, item, frf, weights):
            return size
        model, addresses, factors = _tied(item)
        w = np.ascontiguousarray(2.0 * np.pi * frf.frequency_hz, dtype=np.complex128)
        lines, end = _core.Lines(w), b"" if frf.ends is None else np.float64(frf.ends).tobytes()
        forces = b"" if frf.force is None else frf.force.tobytes()
        key = (item.unit.encode(), w.tobytes(), forces, end, addresses.tobytes(), factors.tobytes(), *model.key)
        if key not in self._receptances:
            evaluated = _core.Records(measured[None], weights[None], percent, frf.ends).evaluated(lines)
            try:
                given = model.flat.by_line(evaluated / math.tau, frf.force)
            except ValueError as error:
                raise InfeasibleError(str(error)) from None
            tied, assembly = model.model(addresses, factors), item.observation.assembly
            self._receptances[key] = _Receptance(tied, lines, model.points, percent, frf.ends, given, assembly)
        own = self._receptances[key]
        own.indices.append(index)
        own.measured.append(measured)
        own.weights.append(weights)
        return size

    def _add_reduced(self, index: int, item: Observed, frf: Observation, weights: NDArray[np.float64]) -> bool:
        """Add a receptance as that of a model reduced to its one unknown joint, if it is one."""
        joint = only_joint(item)
        if joint is None or not self._unknowns:
            return False
        fields = [address.split(".", 1)[1] for address in item.mapping.addresses]
        columns = [PointJoint.columns_of.index(name) for name in fields]
        bounds = [self._unknowns[i] for i in item.mapping.base]
        try:
            stiff = _stiffest(frf, joint, dict(zip(fields, bounds, strict=True)))
            reduction = frf.assembly.reduced_to_joint(
                joint,
                frf.frequency_hz,
                response=frf.response,
                excitation=frf.excitation,
                at=stiff,
                threads=self._threads,
            )
        except (ReceptanceError, ValueError):
            # The joint at the bounds has no value; the fit itself may never go there.
            return False
        measured = np.ascontiguousarray(frf.receptance)
        numbers = np.full(len(PointJoint.columns_of), -1.0)
        numbers[columns] = item.mapping.base
        self._core.add_joint_receptance(reduction, np.array(stiff.columns), numbers, measured, weights)
        self._order.append(index)
        self.assemblies.append(frf.assembly)
        self.reduced += 1
        return True

    def _add_frequencies(self, index: int, item: Observed, measured: Observation) -> int:
        """Add natural frequencies and the damping ratios that are known."""
        model, addresses, factors = _tied(item)
        frequency, deviation = measured.frequency_hz.real, measured.standard_deviation
        weighed = item.unit == "standard deviations" and deviation is not None
        share = 0.01 if item.unit == "percent" else 1.0
        unit = deviation if weighed and deviation is not None else frequency * share
        damping: tuple[NDArray[np.float64], ...] = ()
        ratio, known = measured.damping_ratio, measured.standard_deviation_damping
        if ratio is not None:
            unit_damping = known if weighed and known is not None else np.maximum(ratio, _LEAST_DAMPING) * share
            damping = np.ascontiguousarray(ratio), 1.0 / unit_damping
        modes = np.array(measured.modes, dtype=np.float64) - 1.0
        self._core.add_frequencies(
            model.model(addresses, factors), modes, 2.0 * np.pi * frequency, 0.5 / (np.pi * unit), *damping
        )
        self._order.append(index)
        self.assemblies.append(measured.assembly)
        return frequency.size + measured.damped.size


def slopes_at(observed: Sequence[Observed], threads: int | None) -> NDArray[np.float64]:
    """Return the derivatives of the residuals of observations where all unknowns of their maps are zero, `(n, p)`."""
    count = observed[0].mapping.shifts.shape[1]
    core = _unbounded(count, threads)
    added = _CoreObservations(core, observed, (), threads)
    found = core.rows(np.zeros(count), np.ones(count, dtype=np.bool_))
    if found is None:
        raise InfeasibleError("the model has no value, or a residual or its derivative is not finite")
    slopes = np.empty_like(found[1])
    slopes[added.places] = found[1]
    return slopes


def _unbounded(count: int, threads: int | None) -> _core.Problem:
    limits = np.array([[-np.inf], [np.inf]]) * np.ones(count)
    return _core.Problem(np.zeros(count, dtype=np.bool_), limits, np.zeros((0, 3)), _checks.thread_count(threads))


def residuals_at(item: Observed, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the residuals of an observation at rows of values of the unknowns, `(n, p)`; NaN where it has no value."""
    count = values.shape[1]
    core = _unbounded(count, 1)
    (size,) = _CoreObservations(core, [item], (), None).sizes
    result, none = np.full((len(values), size), np.nan), np.zeros(count, dtype=np.bool_)
    for row, found in zip(result, map(np.ascontiguousarray, values), strict=True):
        rows = core.rows(found, none)
        if rows is not None:
            row[:] = rows[0]
    return result


def only_joint(item: Observed) -> str | None:
    """Return the joint whose terms are the only unknowns of an observation, each by itself; None if there is none."""
    mapping = item.mapping
    owners = {name.split(".", 1)[0] for name in mapping.addresses}
    name = owners.pop() if len(owners) == 1 else ""
    if type(item.observation.assembly.elements.get(name)) is not PointJoint:
        return None
    alone = np.all(mapping.base >= 0) and np.all(mapping.scale == 1.0) and np.all(mapping.second < 0)
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


def _tied(item: Observed) -> tuple[Tied, NDArray[np.float64], NDArray[np.float64]]:
    """Return the model as a function of addresses, these as functions of the unknowns, and factors of the record."""
    mapping = item.mapping
    factors = [(FACTORS.index(name), i) for i, name in enumerate(mapping.addresses) if name in FACTORS]
    observation = item.observation
    tied = observation.assembly.tied(mapping.addresses, observation.coordinates, others=FACTORS)
    start = np.where(mapping.base >= 0, mapping.scale, mapping.fixed)
    columns = [mapping.base, start, mapping.second, mapping.share, mapping.exponents, mapping.shifts]
    addresses = np.ascontiguousarray(np.column_stack(columns), dtype=np.float64)
    return tied, addresses, np.array(factors, dtype=np.float64).reshape(-1, 2)


def prior_table(unknowns: Sequence[Unknown]) -> NDArray[np.float64]:
    """Return the priors as residuals a x - b of variables x: rows of the variable's number, a and b, `(k, 3)`."""
    rows = []
    for index, unknown in enumerate(unknowns):
        if unknown.prior is None:
            continue
        deviation, mean = unknown.prior.standard_deviation, unknown.prior.mean
        if unknown.scale == "log":
            rows.append((index, math.log(10.0) / deviation, math.log(mean) / deviation))
        else:
            rows.append((index, 1.0 / deviation, mean / deviation))
    return np.array(rows, dtype=np.float64).reshape(-1, 3)


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
