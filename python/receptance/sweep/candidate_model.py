"""Receptances, magnitudes and misfits of many candidates: values of some parameters of one assembly.

Two methods of the core give the same numbers. If only one point joint varies, the rest of the assembly is evaluated
once, and each candidate needs 2 x 2 algebra only. Other parameters are evaluated as whole models.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from math import tau
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from receptance import _checks, _core
from receptance.model.coordinates import as_coordinates
from receptance.model.joints import PointJoint

if TYPE_CHECKING:
    from receptance.model.assembly import Assembly
    from receptance.model.coordinates import Coordinate

Residual = Literal["logarithm", "complex"]
"""Residual on each line: weight ln(measured / H), as in fits, or weight (measured - H)."""

_CALL_S = 0.4
"""Approximate duration in s of one call of the core, on a thread that has half of a processor."""
_JOINT_S, _MODEL_S, _LINE_S = 5e-9, 1e-4, 5e-8
"""Approximate time in s for a line of a joint, for a model, and for a line of a model."""
_STIFF = 1e3
"""Ratio of the stiffness at which the rest of the assembly is evaluated to the stiffness of the joint."""
_RIGID = {"k_y": 1e12, "k_theta": 1e9}
"""Lower bounds of that stiffness. Relative to a stiff joint any other joint adds compliance in series, without loss of
digits."""


class CandidateModel(ABC):
    """An assembly as a function of some parameters, observed between two coordinates on some lines.

    Candidates are rows of values in SI units, one column per address. An infeasible candidate (an indefinite joint, a
    bore wider than the outer diameter, a singular interface) or one without a finite receptance has NaN in all results.
    The results of a candidate depend neither on the other candidates of a call nor on the number of threads.

    Attributes
    ----------
    method : {"joint", "models"}
        Method of evaluation.
    addresses : tuple of str
        Addresses of the columns.
    lines : int
        Number of frequency lines.
    per_call : int
        Number of candidates in one call of the core, which takes less than a second; signals are handled between calls.
    """

    method: ClassVar[str]

    def __init__(self, addresses: tuple[str, ...], lines: int, candidate_s: float) -> None:
        self.addresses = addresses
        self.lines = lines
        self.per_call = max(int(_CALL_S / candidate_s), 1)

    def receptance(self, values: ArrayLike) -> NDArray[np.complex128]:
        """Return the receptances `(m, n_freq)` of candidates `(m, p)`."""
        return self._filled(values, np.complex128)

    def magnitude(self, values: ArrayLike) -> NDArray[np.float64]:
        """Return the moduli of the receptances `(m, n_freq)` of candidates `(m, p)`."""
        return self._filled(values, np.float64)

    def misfit(
        self,
        values: ArrayLike,
        measured: ArrayLike,
        weights: ArrayLike | None = None,
        residual: Residual = "logarithm",
    ) -> NDArray[np.float64]:
        """Return the sums of squares `(m,)` of candidates `(m, p)` against a measured receptance `(n_freq,)`.

        `weights` has one value per line, by default 1; with the reciprocal standard deviations of the logarithm the
        result is twice the cost that `identify` minimises.
        """
        if residual not in ("logarithm", "complex"):
            raise ValueError(f"residual is {residual!r}, expected 'logarithm' or 'complex'")
        rows = self._rows(values)
        target = np.ascontiguousarray(measured, dtype=np.complex128)
        factor = np.ones(self.lines) if weights is None else np.ascontiguousarray(weights, dtype=np.float64)
        for name, array in (("measured", target), ("weights", factor)):
            if array.shape != (self.lines,) or not np.isfinite(array).all():
                raise ValueError(f"{name}: shape is {array.shape}, expected ({self.lines},) finite numbers")
        if residual == "logarithm" and not np.all(target):
            raise ValueError("measured: a receptance of zero has no logarithm")
        parts = [self._misfit(rows[chunk], target, factor, residual == "logarithm") for chunk in self._chunks(rows)]
        return np.concatenate([np.empty(0), *parts])

    def _filled(self, values: ArrayLike, dtype: type[np.complex128] | type[np.float64]) -> NDArray[Any]:
        rows = self._rows(values)
        out = np.empty((len(rows), self.lines), dtype)
        for chunk in self._chunks(rows):
            self._fill(rows[chunk], out[chunk])
        return out

    def _rows(self, values: ArrayLike) -> NDArray[np.float64]:
        rows = np.ascontiguousarray(values, dtype=np.float64)
        if rows.ndim != 2 or rows.shape[1] != len(self.addresses):
            raise ValueError(f"values: shape is {rows.shape}, expected (m, {len(self.addresses)})")
        if not np.isfinite(rows).all():
            row, column = np.argwhere(~np.isfinite(rows))[0]
            raise ValueError(
                f"values[{row}]: {self.addresses[column]} is {rows[row, column]}, expected a finite number"
            )
        return rows

    def _chunks(self, rows: NDArray[np.float64]) -> Iterator[slice]:
        return (slice(first, first + self.per_call) for first in range(0, len(rows), self.per_call))

    @abstractmethod
    def _fill(self, rows: NDArray[np.float64], out: NDArray[Any]) -> None:
        """Write receptances, or magnitudes if `out` is real."""

    @abstractmethod
    def _misfit(
        self, rows: NDArray[np.float64], measured: NDArray[np.complex128], weights: NDArray[np.float64], logarithm: bool
    ) -> NDArray[np.float64]:
        """Return the sums of squares."""


class _Joint(CandidateModel):
    """Candidates that differ in one point joint."""

    method = "joint"

    def __init__(
        self,
        assembly: Assembly,
        joint: str,
        addresses: tuple[str, ...],
        lines: NDArray[Any],
        points: list[Coordinate],
        threads: int,
    ) -> None:
        super().__init__(addresses, lines.size, _JOINT_S * lines.size)
        fields = PointJoint.columns_of
        values = [assembly.get(f"{joint}.{field}") for field in fields]
        stiff: dict[str, Any] = dict(zip(fields, values, strict=True))
        stiff |= {name: max(_STIFF * stiff[name], bound) for name, bound in _RIGID.items()}
        self._joint = np.array(values)
        self._columns = [fields.index(address.split(".", 1)[1]) for address in addresses]
        self._reduction = assembly.reduced_to_joint(
            joint, lines, response=points[0], excitation=points[1], at=PointJoint(**stiff), threads=threads
        )
        self._threads = threads

    def _joints(self, rows: NDArray[np.float64]) -> NDArray[np.float64]:
        joints = np.repeat(self._joint[None], len(rows), axis=0)
        joints[:, self._columns] = rows
        return joints

    def _fill(self, rows: NDArray[np.float64], out: NDArray[Any]) -> None:
        self._reduction.fill(self._joints(rows), out, self._threads)

    def _misfit(
        self, rows: NDArray[np.float64], measured: NDArray[np.complex128], weights: NDArray[np.float64], logarithm: bool
    ) -> NDArray[np.float64]:
        return self._reduction.misfit(self._joints(rows), measured, weights, logarithm, self._threads)


class _Models(CandidateModel):
    """Candidates that are evaluated as whole models."""

    method = "models"

    def __init__(self, model: _core.ModelSweep, addresses: tuple[str, ...], threads: int) -> None:
        super().__init__(addresses, len(model), _MODEL_S + _LINE_S * len(model))
        self._model, self._threads = model, threads

    def _fill(self, rows: NDArray[np.float64], out: NDArray[Any]) -> None:
        self._model.fill(rows, out, self._threads)

    def _misfit(
        self, rows: NDArray[np.float64], measured: NDArray[np.complex128], weights: NDArray[np.float64], logarithm: bool
    ) -> NDArray[np.float64]:
        return self._model.misfit(rows, measured, weights, logarithm, self._threads)


def candidate_model(
    assembly: Assembly,
    addresses: Sequence[str],
    frequency_hz: ArrayLike,
    response: Coordinate | None = None,
    excitation: Coordinate | None = None,
    threads: int | None = None,
) -> CandidateModel:
    """Return an assembly as a function of some parameters, with the fastest applicable method.

    Parameters
    ----------
    assembly : Assembly
        The assembly.
    addresses : sequence of str
        Addresses of the parameters that vary, the columns of the candidates.
    frequency_hz : array_like
        Lines `(n_freq,)`, real, or complex for an exponential window.
    response, excitation, threads
        As in `Assembly.receptance`.

    Raises
    ------
    ValueError
        An unknown address, or the same address twice.
    """
    names = tuple(addresses)
    if not names or len(set(names)) < len(names):
        raise ValueError(f"addresses is {list(names)}, expected at least one and all different")
    for name in names:
        assembly.get(name)
    lines, count = _checks.frequencies(frequency_hz), _checks.thread_count(threads)
    points = [as_coordinates(side)[0] for side in (response, excitation)]
    owners = {name.split(".", 1)[0] for name in names}
    owner = next(iter(owners))
    reducible = assembly.motion == "bending" and not assembly.flat().rows["slips"]
    if reducible and len(owners) == 1 and type(assembly.elements.get(owner)) is PointJoint:
        return _Joint(assembly, owner, names, lines, points, count)
    tied = assembly.tied(names, tuple(points))
    model = tied.model(_identity_map(len(names)), np.empty((0, 2)))
    properties = tied.flat.by_line(lines)
    return _Models(model.sweep(_core.Lines(lines, tau), tied.points, properties), names, count)


def _identity_map(count: int) -> NDArray[np.float64]:
    """Return the map in which each address is a separate unknown, in the form of `_core.Model.tied`."""
    table = np.zeros((count, 4 + 2 * count))
    table[:, 0] = np.arange(count)
    table[:, 1] = 1.0
    table[:, 2] = -1.0  # no second unknown
    return table
