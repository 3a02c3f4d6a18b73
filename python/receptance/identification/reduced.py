"""A receptance of which only one joint is unknown: the rest of the assembly is evaluated once.

The core then works with the normal matrix of residuals and derivatives instead of both, so that a fit costs little
more than the small algebra of the joint. Where other observations are fitted as well, SciPy works on a factor of that
matrix, a handful of numbers with the same sum of squares, gradient and curvature; where there are none, the core runs
the whole fit, many starts in one call.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from receptance import _checks, _core
from receptance.identification.residuals import InfeasibleError, Pair, Unit
from receptance.identification.unknowns import Variables, covered
from receptance.joints import PointJoint

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.identification.observations import MeasuredFRF

__all__ = ["ENDED", "JointResidual", "only_joint"]

_FEW = 1500
"""Lines of each receptance on the way to an optimum."""
_ROUGH = 1e-4
"""Tolerance on the way."""

ENDED = {
    -1: "the model has no value there",
    0: "the evaluations were used up",
    1: "no slope is left",
    2: "the cost changes no more",
    3: "the variables change no more",
}
"""Why a fit in the core ended, by its status."""


def only_joint(frf: MeasuredFRF, variables: Variables) -> str | None:
    """Return the name of the joint that all unknowns of the observation belong to, if there is just one."""
    owners = {name.split(".", 1)[0] for name in variables.addresses if covered(name, frf.assembly)}
    name = owners.pop() if len(owners) == 1 else ""
    return name if isinstance(frf.assembly.elements.get(name), PointJoint) else None


class JointResidual:
    """The complex log residual of a receptance of which one joint is unknown.

    For a fit it is compressed to as many numbers as there are unknowns, and one.

    Parameters
    ----------
    frf : MeasuredFRF
        What was measured.
    variables : Variables
        All unknowns of the fit.
    unit : {"logarithm", "standard deviations"}
        What a residual of 1 means.
    chosen : ndarray of bool, optional
        Lines that count.
    joint : str
        Name of the joint, see `only_joint`.
    threads : int, optional
        As in `Assembly.receptance`.
    """

    def __init__(
        self,
        frf: MeasuredFRF,
        variables: Variables,
        unit: Unit,
        chosen: NDArray[np.bool_] | None,
        joint: str,
        threads: int | None,
    ) -> None:
        select: NDArray[np.bool_] | slice = slice(None) if chosen is None else chosen
        self.unit = unit
        self._threads = _checks.thread_count(threads)
        self._variables = variables
        self._columns = [i for i, name in enumerate(variables.addresses) if covered(name, frf.assembly)]
        fields = [variables.addresses[i].split(".", 1)[1] for i in self._columns]
        self._fields = np.array([PointJoint.columns_of.index(field) for field in fields], dtype=np.intp)
        stiff = self._stiff(frf, joint, fields, variables)
        self._reference = np.array(stiff.columns())
        self._reduction = frf.assembly.reduced_to_joint(
            joint,
            np.ascontiguousarray(frf.frequency_hz[select]),
            response=frf.response,
            excitation=frf.excitation,
            at=stiff,
            threads=threads,
        )
        self._measured = np.ascontiguousarray(frf.receptance[select])
        self._weights = np.ones(self._measured.size)
        if unit == "standard deviations" and frf.standard_deviation is not None:
            self._weights = np.ascontiguousarray(1.0 / frf.standard_deviation[select])

    @cached_property
    def _alone(self) -> _core.Problem:
        """The receptance alone, as a function of the values of all unknowns; fits do not need it."""
        count = len(self._variables.addresses)
        limits = np.repeat([[-np.inf], [np.inf]], count, axis=1)
        problem = _core.Problem(np.zeros(count, dtype=np.bool_), limits, np.zeros((0, 3)))
        self.add_to(problem)
        return problem

    def add_to(self, problem: _core.Problem) -> None:
        """Add the receptance to a problem of the core with the same variables."""
        numbers = np.full(len(PointJoint.columns_of), -1.0)
        numbers[self._fields] = self._columns
        problem.add_joint_receptance(self._reduction, self._reference, numbers, self._measured, self._weights)

    @staticmethod
    def _stiff(frf: MeasuredFRF, joint: str, fields: list[str], variables: Variables) -> PointJoint:
        """Return the joint at which the reduction starts: as stiff as the bounds allow.

        From a stiff joint every other one adds compliance in series, which costs no digits.
        """
        values: dict[str, Any] = {name: getattr(frf.assembly.elements[joint], name) for name in PointJoint.columns_of}
        unknowns = {unknown.address: unknown for unknown in variables.unknowns}
        for field in fields:
            unknown = unknowns[f"{joint}.{field}"]
            values[field] = unknown.upper if field in ("k_y", "k_theta") else max(0.0, unknown.lower)
        for kind in "kc":
            limit = np.sqrt(values[f"{kind}_y"] * values[f"{kind}_theta"])
            values[f"{kind}_ytheta"] = float(np.clip(values[f"{kind}_ytheta"], -0.5 * limit, 0.5 * limit))
        return PointJoint(**values)

    @property
    def size(self) -> int:
        """Number of residuals after compression."""
        return len(self._columns) + 1

    def evaluate(self, values: NDArray[np.float64], slopes: NDArray[np.float64]) -> Pair:
        """Return compressed residuals and their derivatives; see `residuals.Residual`."""
        self._check(values)
        normal = self._alone.normal_matrix(np.ascontiguousarray(values), self._threads)
        if not np.isfinite(normal).all():
            raise InfeasibleError("a residual or its derivative is not finite")
        kept = [*self._columns, -1]
        scale = np.append(slopes[self._columns], 1.0)
        factor = _factor(normal[np.ix_(kept, kept)] * np.outer(scale, scale))
        jacobian = np.zeros((self.size, len(self._variables.addresses)))
        jacobian[:, self._columns] = factor[:, :-1]
        return factor[:, -1].copy(), jacobian

    def value(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the residuals of all lines, not compressed, as `residuals.FRFResidual` does."""
        self._check(values)
        none = np.zeros(len(self._variables.addresses), dtype=np.bool_)
        found = self._alone.rows(np.ascontiguousarray(values), none, self._threads)
        if found is None:
            raise InfeasibleError("a residual is not finite")
        return found[0]

    def _check(self, values: NDArray[np.float64]) -> None:
        joint = self._reference.copy()
        joint[self._fields] = values[self._columns]
        columns: dict[str, Any] = dict(zip(PointJoint.columns_of, joint.tolist(), strict=True))
        try:
            PointJoint(**columns)  # says what is indefinite or holds nothing
        except ValueError as error:
            raise InfeasibleError(str(error)) from None

    @staticmethod
    def fit_together(
        residuals: Sequence[JointResidual],
        variables: Variables,
        starts: NDArray[np.float64],
        most: int,
        tolerance: float,
    ) -> list[Ending]:
        """Fit the joint from every start, in the core; the least sum of squares within the bounds."""
        problem = _core.Problem(variables.logarithmic, np.ascontiguousarray(variables.limits), np.zeros((0, 3)))
        for one in residuals:
            one.add_to(problem)
        x, threads = np.array(starts), residuals[0]._threads
        free = np.ones(x.shape[1], dtype=np.bool_)
        before = np.zeros(len(x), dtype=np.int64)
        fewer = problem.thinned(_FEW)
        if fewer.lines < problem.lines:
            way = fewer.fit(x, free, max(tolerance, _ROUGH), np.full(len(x), most), threads)
            x = np.where(np.isfinite(way.cost)[:, None], way.x, x)
            before = way.evaluations
        left = np.maximum(most - before, 1)
        found = problem.fit(np.ascontiguousarray(x), free, tolerance, left, threads)
        numbers = zip(found.x, found.cost, before + found.evaluations, found.status, found.normal, strict=True)
        return [Ending(end, float(cost), int(n), int(status), normal) for end, cost, n, status, normal in numbers]


class Ending(NamedTuple):
    """Where a fit in the core ended: the variables, half the sum of squares, evaluations, SciPy's status, A^T A."""

    x: NDArray[np.float64]
    cost: float
    evaluations: int
    status: int
    normal: NDArray[np.float64]

    @property
    def factor(self) -> NDArray[np.float64]:
        """As few numbers as there are variables, and one, as residuals (last column) and their derivatives."""
        return _factor(self.normal)

    @property
    def message(self) -> str:
        """Why it ended, in words."""
        return ENDED[self.status]


def _factor(normal: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return C with C^T C = N for a positive semidefinite N, singular ones included."""
    if not np.isfinite(normal).all():
        return np.full_like(normal, np.inf)
    scale = np.sqrt(np.diag(normal))
    divisor = np.where(scale > 0.0, scale, 1.0)
    squares, vectors = np.linalg.eigh(normal / np.outer(divisor, divisor))
    root: NDArray[np.float64] = np.sqrt(np.maximum(squares, 0.0))[:, None] * vectors.T * scale
    return root
