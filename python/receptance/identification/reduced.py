"""A receptance of which only one joint is unknown: the rest of the assembly is evaluated once.

The core then returns the normal matrix of residuals and derivatives instead of both, so that a fit costs little
more than the small algebra of the joint, and SciPy works on a handful of numbers. Same residuals, same
derivatives: any factor of the normal matrix has the same sum of squares, gradient and curvature.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from receptance import _checks, _core
from receptance.errors import ReceptanceError
from receptance.identification.residuals import InfeasibleError, Pair, Unit
from receptance.identification.unknowns import Variables, covered
from receptance.joints import PointJoint

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.identification.observations import MeasuredFRF

__all__ = ["JointResidual", "only_joint"]


def only_joint(frf: MeasuredFRF, variables: Variables) -> str | None:
    """Return the name of the joint that all unknowns of the observation belong to, if there is just one."""
    owners = {name.split(".", 1)[0] for name in variables.addresses if covered(name, frf.assembly)}
    name = owners.pop() if len(owners) == 1 else ""
    return name if isinstance(frf.assembly.elements.get(name), PointJoint) else None


class JointResidual:
    """The complex log residual of a receptance, compressed to as many numbers as there are unknowns, and one.

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
        self._fields = np.array([PointJoint.columns_of.index(field) for field in fields], dtype=np.float64)
        self._reference = np.array(self._stiff(frf, joint, fields, variables).columns())
        assembly = frf.assembly.replace({f"{joint}.{f}": self._reference[int(i)] for f, i in self._pairs(fields)})
        self._planes = assembly.reduced_to_joint(
            joint,
            np.ascontiguousarray(frf.frequency_hz[select]),
            response=frf.response,
            excitation=frf.excitation,
            threads=threads,
        )
        self._log_measured = np.log(frf.receptance[select])
        self._weights = np.ones(self._log_measured.size)
        if unit == "standard deviations" and frf.standard_deviation is not None:
            self._weights = np.ascontiguousarray(1.0 / frf.standard_deviation[select])

    def _pairs(self, fields: list[str]) -> list[tuple[str, float]]:
        return list(zip(fields, self._fields.tolist(), strict=True))

    @staticmethod
    def _stiff(frf: MeasuredFRF, joint: str, fields: list[str], variables: Variables) -> PointJoint:
        """Return the joint at which the reduction starts: as stiff as the bounds allow.

        From a stiff joint every other one adds compliance in series, which costs no digits.
        """
        values: dict[str, Any] = {name: frf.assembly.get(f"{joint}.{name}") for name in PointJoint.columns_of}
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
        joint = self._reference.copy()
        joint[self._fields.astype(int)] = values[self._columns]
        columns: dict[str, Any] = dict(zip(PointJoint.columns_of, joint.tolist(), strict=True))
        try:
            PointJoint(**columns)  # says what is indefinite or holds nothing
            normal = _core.joint_normal_matrix(
                self._planes,
                self._log_measured,
                self._weights,
                self._reference,
                joint,
                self._fields,
                np.ascontiguousarray(slopes[self._columns]),
                self._threads,
            )
        except (ReceptanceError, ValueError) as error:
            raise InfeasibleError(str(error)) from None
        factor = _factor(normal)
        jacobian = np.zeros((self.size, len(self._variables.addresses)))
        jacobian[:, self._columns] = factor[:, :-1]
        return factor[:, -1].copy(), jacobian

    def value(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return compressed residuals alone; see `residuals.Residual`."""
        return self.evaluate(values, np.zeros(values.size))[0]


def _factor(normal: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return C with C^T C = N for a positive semidefinite N, singular ones included."""
    if not np.isfinite(normal).all():
        return np.full_like(normal, np.inf)
    scale = np.sqrt(np.diag(normal))
    divisor = np.where(scale > 0.0, scale, 1.0)
    squares, vectors = np.linalg.eigh(normal / np.outer(divisor, divisor))
    root: NDArray[np.float64] = np.sqrt(np.maximum(squares, 0.0))[:, None] * vectors.T * scale
    return root
