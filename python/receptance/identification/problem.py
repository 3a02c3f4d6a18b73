"""Least squares over several residuals: the part that knows SciPy, and nothing of assemblies."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from receptance.identification.reduced import JointResidual
from receptance.identification.residuals import InfeasibleError, Pair, Residual
from receptance.identification.result import Start

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.identification.unknowns import Variables

__all__ = ["Normal", "Problem", "split_normal"]

_APPROACH_TOLERANCE = 1e-4
"""An approach only has to end near."""


class Normal(NamedTuple):
    """Half the sum of squares, J^T r and J^T J."""

    cost: float
    slope: NDArray[np.float64]
    curvature: NDArray[np.float64]


def split_normal(matrix: NDArray[np.float64]) -> Normal | None:
    """Return the parts of A^T A of A = [J | r]; None where it is not finite."""
    if not np.isfinite(matrix).all():
        return None
    return Normal(0.5 * float(matrix[-1, -1]), matrix[:-1, -1], matrix[:-1, :-1])


class Problem:
    """All residuals as a function of the fitted variables, evaluated once for value and derivative."""

    def __init__(self, residuals: Sequence[Residual], variables: Variables) -> None:
        self.residuals = residuals
        self.variables = variables
        self.size = sum(residual.size for residual in residuals)
        self.evaluations = 0
        self._at: NDArray[np.float64] | None = None
        self._residual = np.empty(0)
        self._jacobian = np.empty((0, 0))
        self.reason = ""

    def residual(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the residuals, all infinite where the model has no value: SciPy then takes a shorter step."""
        self._evaluate(x)
        return self._residual

    def value(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the residuals at a point where the model has a value, without their derivatives."""
        values = self.variables.to_values(x)
        return np.concatenate([residual.value(values) for residual in self.residuals])

    def jacobian(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivatives of the residuals with respect to the variables."""
        self._evaluate(x)
        return self._jacobian

    def slopes(self, x: NDArray[np.float64], free: NDArray[np.bool_]) -> NDArray[np.float64]:
        """Return the derivatives by some variables; raises `InfeasibleError` where the model has no value."""
        return self._parts(x)[1][:, free]

    def normal(self, x: NDArray[np.float64]) -> Normal | None:
        """Return what a step needs to know of a point; None where the model has no value."""
        residual, jacobian = self.residual(x), self.jacobian(x)
        if not np.isfinite(residual).all():
            return None
        return Normal(0.5 * float(residual @ residual), jacobian.T @ residual, jacobian.T @ jacobian)

    def _evaluate(self, x: NDArray[np.float64]) -> None:
        if self._at is not None and np.array_equal(self._at, x):
            return
        self._at = None
        self.evaluations += 1
        self.reason = "a residual or its derivative is not finite"
        try:
            self._residual, self._jacobian = self._parts(x)
        except InfeasibleError as error:
            self.reason = str(error)
            self._residual, self._jacobian = np.full(self.size, np.inf), np.zeros((self.size, x.size))
        if not (np.isfinite(self._jacobian).all() and np.isfinite(self._residual).all()):
            self._residual = np.full(self.size, np.inf)
        self._residual.setflags(write=False)
        self._jacobian.setflags(write=False)
        self._at = x.copy()

    def _parts(self, x: NDArray[np.float64]) -> Pair:
        values = self.variables.to_values(x)
        slopes = self.variables.slopes(values)
        parts = [residual.evaluate(values, slopes) for residual in self.residuals]
        if len(parts) == 1:
            return parts[0]
        return np.concatenate([part[0] for part in parts]), np.concatenate([part[1] for part in parts])

    def fit(
        self,
        x: NDArray[np.float64],
        smoothing: float | None,
        most: int,
        tolerance: float,
        approach: Problem | None,
    ) -> Start:
        """Run one fit from a start, by way of the optimum of another problem if there is one."""
        first = self.named(x)
        before = 0
        if approach is not None:
            end = approach.fit(x, None, most, _APPROACH_TOLERANCE, None)
            x, before = end.variables, end.evaluations
        fresh = self.evaluations
        if not np.isfinite(self.residual(x)).all():
            return Start(
                start=first,
                values=self.named(x),
                variables=x,
                cost=np.inf,
                evaluations=before + 1,
                converged=False,
                message=self.reason,
            )
        found = self._minimise(x, smoothing, most, tolerance)
        return Start(
            start=first,
            values=self.named(found.x),
            variables=found.x,
            cost=float(found.cost),
            evaluations=before + self.evaluations - fresh,
            converged=bool(found.status > 0),
            message=str(found.message),
        )

    def fit_all(self, starts: NDArray[np.float64], most: int, tolerance: float) -> list[Start]:
        """Run the fits from all starts, in the core where it knows all residuals."""
        joints = [residual for residual in self.residuals if isinstance(residual, JointResidual)]
        if len(joints) < len(self.residuals):
            return [self.fit(x, None, most, tolerance, None) for x in starts]
        ends = JointResidual.fit_together(joints, self.variables, starts, most, tolerance)
        best = min(ends, key=lambda end: end.cost)
        if np.isfinite(best.cost):
            # The curvature there was found on the way.
            factor = best.factor
            self._at, self._residual, self._jacobian = best.x.copy(), factor[:, -1], factor[:, :-1]
        return [
            Start(
                start=self.named(x),
                values=self.named(end.x),
                variables=end.x,
                cost=end.cost,
                evaluations=end.evaluations,
                converged=end.status > 0,
                message=self._why_not(x) if end.status < 0 else end.message,
            )
            for x, end in zip(starts, ends, strict=True)
        ]

    def _why_not(self, x: NDArray[np.float64]) -> str:
        self._evaluate(x)
        return self.reason

    def _minimise(self, x: NDArray[np.float64], smoothing: float | None, most: int, tolerance: float) -> Any:
        from scipy.optimize import least_squares  # slow to import

        residual, jacobian = self.residual, self.jacobian
        options: dict[str, Any] = {}
        if smoothing is not None:
            options = {"loss": "soft_l1", "f_scale": smoothing}

            # With a loss SciPy scales what it is given in place.
            def residual(x: NDArray[np.float64]) -> NDArray[np.float64]:
                return self.residual(x).copy()

            def jacobian(x: NDArray[np.float64]) -> NDArray[np.float64]:
                return self.jacobian(x).copy()

        return least_squares(
            residual,
            x,
            jac=jacobian,
            bounds=tuple(self.variables.limits),
            method="trf",
            x_scale="jac",
            ftol=tolerance,
            xtol=tolerance,
            gtol=tolerance,
            max_nfev=most,
            **options,
        )

    def named(self, x: NDArray[np.float64]) -> dict[str, float]:
        """Return the values in SI units by name."""
        return dict(zip(self.variables.names, self.variables.to_values(x).tolist(), strict=True))
