"""Receptances, magnitudes and misfits of many candidates: values of some parameters of one assembly.

Two methods of the core give the same numbers. If only one point joint varies, the rest of the assembly is evaluated
once, and each candidate needs 2 x 2 algebra only. Other parameters are evaluated as whole models.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import tau
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from receptance import _checks, _core
from receptance.model.assembly import Assembly
from receptance.model.coordinates import Coordinate, as_coordinates
from receptance.model.joints import PointJoint

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


class ParametricReceptance:
    """An assembly as a function of some parameters, observed between two coordinates on some lines.

    Candidates are rows of values in SI units, one column for each of `addresses`. An infeasible candidate (an
    indefinite joint, a bore wider than the outer diameter, a singular interface) or one without a finite receptance has
    NaN in all results. The results of a candidate depend neither on the other candidates of a call nor on the number of
    threads.
    """

    def __init__(
        self,
        method: Literal["joint", "models"],
        addresses: tuple[str, ...],
        core: _core.JointReduction | _core.ModelSweep,
        nominal: ArrayLike,
        columns: Sequence[int],
        threads: int,
    ) -> None:
        """Keep the handle of the core, and the columns of the candidates in its rows, whose others are `nominal`."""
        self.method, self.addresses, self.lines = method, addresses, len(core)
        candidate_s = _JOINT_S * self.lines if method == "joint" else _MODEL_S + _LINE_S * self.lines
        # A call takes less than a second; signals are handled between calls.
        self.per_call = max(int(_CALL_S / candidate_s), 1)
        self._core, self._nominal, self._columns, self._threads = core, np.asarray(nominal), columns, threads

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
        _checks.one_of("", "residual", residual, Residual)
        rows = self._rows(values)
        target = np.ascontiguousarray(measured, dtype=np.complex128)
        factor = np.ones(self.lines) if weights is None else np.ascontiguousarray(weights, dtype=np.float64)
        for name, array in (("measured", target), ("weights", factor)):
            if array.shape != (self.lines,) or not np.isfinite(array).all():
                raise ValueError(f"{name}: shape is {array.shape}, expected ({self.lines},) finite numbers")
        if residual == "logarithm" and not np.all(target):
            raise ValueError("measured: a receptance of zero has no logarithm")
        logarithmic = residual == "logarithm"
        parts = [
            self._core.misfit(values, target, factor, logarithmic, self._threads) for _, values in self._calls(rows)
        ]
        return np.concatenate([np.empty(0), *parts])

    def _filled(self, values: ArrayLike, dtype: type[np.complex128] | type[np.float64]) -> NDArray[Any]:
        rows = self._rows(values)
        out: NDArray[Any] = np.empty((len(rows), self.lines), dtype)
        for chunk, complete in self._calls(rows):
            self._core.fill(complete, out[chunk], self._threads)
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

    def _calls(self, rows: NDArray[np.float64]) -> Iterator[tuple[slice, NDArray[np.float64]]]:
        """Yield the candidates of each call of the core, and its rows."""
        for first in range(0, len(rows), self.per_call):
            chunk = slice(first, first + self.per_call)
            values = np.repeat(self._nominal[None], len(rows[chunk]), axis=0)
            values[:, self._columns] = rows[chunk]
            yield chunk, values


def parametric_receptance(
    assembly: Assembly,
    addresses: Sequence[str],
    frequency_hz: ArrayLike,
    response: Coordinate | None = None,
    excitation: Coordinate | None = None,
    threads: int | None = None,
) -> ParametricReceptance:
    """Return an assembly as a function of the parameters at some addresses, with the fastest applicable method.

    The lines are real, or complex for an exponential window; the other arguments are those of `Assembly.receptance`. An
    unknown address, or the same one twice, is a ValueError.
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
        fields = PointJoint.columns_of
        nominal = [assembly.get(f"{owner}.{field}") for field in fields]
        stiff: dict[str, Any] = dict(zip(fields, nominal, strict=True))
        stiff |= {name: max(_STIFF * stiff[name], bound) for name, bound in _RIGID.items()}
        reduced = assembly.reduced_to_joint(
            owner, lines, response=points[0], excitation=points[1], at=PointJoint(**stiff), threads=count
        )
        columns = [fields.index(name.split(".", 1)[1]) for name in names]
        return ParametricReceptance("joint", names, reduced, nominal, columns, count)
    tied = assembly.tied(names, tuple(points))
    # The map in which each address is a separate unknown, and there is no second one; see `_core.Model.tied`.
    separate = np.zeros((len(names), 4 + 2 * len(names)))
    separate[:, :3] = np.stack([np.arange(len(names)), np.ones(len(names)), -np.ones(len(names))], axis=1)
    model = tied.model(separate, np.empty((0, 2)))
    core = model.sweep(_core.Lines(lines, tau), tied.points, tied.flat.by_line(lines))
    return ParametricReceptance("models", names, core, np.zeros(len(names)), range(len(names)), count)
