"""A least-squares problem of the core: observations and priors as a function of the fitted variables.

Residuals, normal matrices and fits are computed in the core. A receptance of which one joint is unknown is reduced to
that joint, so that the rest of the assembly is evaluated once.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from receptance import _checks, _core
from receptance.identification.observations import MeasuredFRF
from receptance.identification.residuals import CoreObservations, InfeasibleError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.identification.mapping import Placed
    from receptance.identification.observations import MeasuredFrequencies
    from receptance.identification.residuals import Unit
    from receptance.identification.unknowns import Unknown, Variables
    from receptance.model.coordinates import Coordinate

    _Rows = tuple[NDArray[np.float64], NDArray[np.float64]]

__all__ = ["End", "Normal", "Observed", "Problem", "prior_table"]

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


@dataclass(frozen=True, eq=False)
class Observed:
    """An observation with the parameters of its assembly and the meaning of its residuals.

    Attributes
    ----------
    observation : MeasuredFRF or MeasuredFrequencies
        The measured values.
    placed : Placed
        The parameters of its assembly as functions of the unknowns.
    unit : {"standard deviations", "percent", "logarithm", "relative"}
        Unit of the residuals.
    chosen : ndarray, optional
        Lines that are used, as a mask or as indices; by default all.
    """

    observation: MeasuredFRF | MeasuredFrequencies
    placed: Placed
    unit: Unit
    chosen: NDArray[Any] | None = None

    @property
    def points(self) -> tuple[Coordinate, ...]:
        """Response and excitation of a receptance."""
        one = self.observation
        return (one.response, one.excitation) if isinstance(one, MeasuredFRF) else ()


class Normal(NamedTuple):
    """Half the sum of squares, J^T r and J^T J."""

    cost: float
    slope: NDArray[np.float64]
    curvature: NDArray[np.float64]


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
        self._added = CoreObservations(core, self._observed, variables.unknowns, threads)
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

    @property
    def lines(self) -> int:
        """Lines of all receptances that the core evaluates."""
        return self.core.lines

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
        return self._some(x, np.zeros(x.size, dtype=np.bool_))[0]

    def slopes(self, x: NDArray[np.float64], free: NDArray[np.bool_]) -> NDArray[np.float64]:
        """Return the derivatives by some variables; raises `InfeasibleError` where the model has no value."""
        return self._some(x, free)[1]

    def normal(self, x: NDArray[np.float64]) -> Normal | None:
        """Return cost, slope and curvature at a point; None where the model has no value."""
        self.evaluations += 1
        matrix = self.core.normal_matrix(np.ascontiguousarray(x))
        if not np.isfinite(matrix).all():
            return None
        return Normal(0.5 * float(matrix[-1, -1]), matrix[:-1, -1], matrix[:-1, :-1])

    def curvature_root(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return a matrix R with R^T R = J^T J at a point.

        Where all observations are reduced to a joint and a fit has ended there, R follows from the normal matrix of
        that fit: it is small, and the derivatives of thousands of lines are not formed. Elsewhere it is J, whose
        singular values keep all digits.
        """
        if self._end is not None and self._added.reduced == len(self._observed) and np.array_equal(self._end.x, x):
            return _root(self._end.normal)[:, :-1]
        return self.jacobian(x)

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
        """Return the ends of fits from all starts.

        Parameters
        ----------
        starts : ndarray
            `(n, p)` within the bounds.
        most : int or ndarray, optional
            Most evaluations of each fit.
        free : ndarray of bool, optional
            Which variables are fitted; the others are held where they start. By default all.
        tolerance : float, optional
            Relative change of the cost and of the variables at which a fit has converged.
        least : float, optional
            A fit has also converged where the predicted decrease of the cost by the next step is at most this.
        of_all : bool, optional
            Whether the normal matrices have the rows and columns of held variables.
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
        ends = [self._against_bound(start, End(*one), kept) for start, one in zip(starts, numbers, strict=True)]
        self.evaluations += sum(end.evaluations for end in ends)
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
        matrix = self.core.normal_matrix(np.ascontiguousarray(start))
        cost = 0.5 * float(matrix[-1, -1])
        if not cost < end.cost:
            return end._replace(evaluations=end.evaluations + 1)
        own = np.ascontiguousarray(matrix[np.ix_(kept, kept)])
        return end._replace(x=start.copy(), cost=cost, evaluations=end.evaluations + 1, normal=own)

    def fit_one(self, start: NDArray[np.float64], most: int = 100, **settings: Any) -> End:
        """Return the end of the fit from one start, which may be outside of the bounds; `settings` as of `fit`."""
        (end,) = self.fit(np.clip(start, *self.variables.limits)[None], most, **settings)
        return end

    def reason(self, x: NDArray[np.float64]) -> str:
        """Return why the model has no value at a point."""
        values = self.variables.to_values(x)
        for one in self._observed:
            try:
                one.placed.apply(one.observation.assembly, values)
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
                self._rows = self._some(x, np.ones(x.size, dtype=np.bool_))
            except InfeasibleError:
                self._rows = np.full(self.size, np.inf), np.zeros((self.size, x.size))
            for array in self._rows:
                array.setflags(write=False)
            self._at = x.copy()
        return self._rows

    def _some(self, x: NDArray[np.float64], free: NDArray[np.bool_]) -> _Rows:
        found = self.core.rows(np.ascontiguousarray(x), free)
        if found is None:
            raise InfeasibleError(self.reason(x))
        if self._places is None:
            return found
        residual, slopes = np.empty_like(found[0]), np.empty_like(found[1])
        residual[self._places], slopes[self._places] = found
        return residual, slopes


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


def _root(normal: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return R with R^T R = N for a positive semidefinite N, singular ones included."""
    if not np.isfinite(normal).all():
        return np.full_like(normal, np.inf)
    scale = np.sqrt(np.diag(normal))
    divisor = np.where(scale > 0.0, scale, 1.0)
    squares, vectors = np.linalg.eigh(normal / np.outer(divisor, divisor))
    root: NDArray[np.float64] = np.sqrt(np.maximum(squares, 0.0))[:, None] * vectors.T * scale
    return root
