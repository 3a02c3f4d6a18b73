"""Receptances, magnitudes and misfits of many candidates: other values of some parameters of one assembly.

Three roads give the same numbers. Where only one joint differs, everything else is evaluated once, and the 2 x 2
algebra that is left runs in the core. Other parameters that the core's tables tell all of run there as whole models.
The rest is evaluated assembly by assembly.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from math import tau
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np

from receptance import _checks, _core
from receptance._evaluation import by_line
from receptance._ties import tie
from receptance.coordinates import as_coordinates
from receptance.errors import ReceptanceError
from receptance.joints import PointJoint

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from receptance.assembly import Assembly
    from receptance.coordinates import Coordinate

__all__ = ["Candidates", "Misfit", "candidates_of"]

Misfit = Literal["logarithm", "complex"]
"""What is squared and summed over the lines: weight ln(measured / H), as fits have it, or weight (measured - H)."""

_CALL_S = 0.4
"""About how long one call of the core may take on a thread that has the processor half of the time."""
_JOINT_S, _MODEL_S, _LINE_S = 5e-9, 1e-4, 5e-8
"""What one line takes with another joint, what a model takes, and what one of its lines does."""
_STIFF = 1e3
"""How many times stiffer than the assembly's own the joint is at which everything else is evaluated."""
_RIGID = {"k_y": 1e12, "k_theta": 1e9}
"""As stiff it is at least: from a stiff joint every other one adds compliance in series, which costs no digits."""


class Candidates(ABC):
    """Other values of some parameters of an assembly, observed between two coordinates on some lines.

    Candidates are rows of values in SI units, a column an address. One that is no model (an indefinite joint, a bore
    wider than its outside, a singular interface) or has no finite receptance has NaN in all its numbers. What comes out
    for a candidate depends neither on the others of a call nor on the number of threads.

    Attributes
    ----------
    road : {"joint", "models", "assemblies"}
        How they are evaluated.
    addresses : tuple of str
        What the columns are.
    lines : int
        Number of frequency lines.
    per_call : int
        Candidates that one call of the core takes, so that it ends well within a second; between calls the interpreter
        sees signals.
    """

    road: ClassVar[str]

    def __init__(self, addresses: tuple[str, ...], lines: int, a_candidate_s: float) -> None:
        self.addresses = addresses
        self.lines = lines
        self.per_call = max(int(_CALL_S / a_candidate_s), 1)

    def receptance(self, values: ArrayLike) -> NDArray[np.complex128]:
        """Return the receptances `(m, n_freq)` of candidates `(m, p)`."""
        rows = self._rows(values)
        out = np.empty((len(rows), self.lines), dtype=np.complex128)
        for chunk in self._chunks(rows):
            self._fill(rows[chunk], out[chunk])
        return out

    def magnitude(self, values: ArrayLike) -> NDArray[np.float64]:
        """Return the moduli of the receptances `(m, n_freq)` of candidates `(m, p)`."""
        rows = self._rows(values)
        out = np.empty((len(rows), self.lines))
        for chunk in self._chunks(rows):
            self._fill(rows[chunk], out[chunk])
        return out

    def misfit(
        self,
        values: ArrayLike,
        measured: ArrayLike,
        weights: ArrayLike | None = None,
        residual: Misfit = "logarithm",
    ) -> NDArray[np.float64]:
        """Return the sums of squares `(m,)` of candidates `(m, p)` against a measured receptance `(n_freq,)`.

        `weights` are one a line, 1 if not given; one over the standard deviations of the logarithm where it is
        what `identify` minimises (whose cost is half of it).
        """
        if residual not in ("logarithm", "complex"):
            raise ValueError(f"residual is {residual!r}, expected 'logarithm' or 'complex'")
        rows = self._rows(values)
        seen = np.ascontiguousarray(measured, dtype=np.complex128)
        factor = np.ones(self.lines) if weights is None else np.ascontiguousarray(weights, dtype=np.float64)
        for name, array in (("measured", seen), ("weights", factor)):
            if array.shape != (self.lines,) or not np.isfinite(array).all():
                raise ValueError(f"{name}: shape is {array.shape}, expected ({self.lines},) finite numbers")
        if residual == "logarithm" and not np.all(seen):
            raise ValueError("measured: a receptance of zero has no logarithm")
        parts = [self._misfit(rows[chunk], seen, factor, residual == "logarithm") for chunk in self._chunks(rows)]
        return np.concatenate([np.empty(0), *parts])

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
        """Write receptances, or magnitudes where `out` is real."""

    @abstractmethod
    def _misfit(
        self, rows: NDArray[np.float64], measured: NDArray[np.complex128], weights: NDArray[np.float64], logarithm: bool
    ) -> NDArray[np.float64]:
        """Return the sums of squares."""


class _Joint(Candidates):
    """One joint differs."""

    road = "joint"

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
        own = np.array([assembly.get(f"{joint}.{field}") for field in PointJoint.columns_of])
        fields = PointJoint.columns_of
        stiff: dict[str, Any] = dict(zip(fields, own.tolist(), strict=True))
        stiff |= {name: max(_STIFF * stiff[name], least) for name, least in _RIGID.items()}
        self._own = own
        self._columns = [fields.index(address.split(".", 1)[1]) for address in addresses]
        self._reduction = assembly.reduced_to_joint(
            joint, lines, response=points[0], excitation=points[1], at=PointJoint(**stiff), threads=threads
        )
        self._threads = threads

    def _joints(self, rows: NDArray[np.float64]) -> NDArray[np.float64]:
        joints = np.repeat(self._own[None], len(rows), axis=0)
        joints[:, self._columns] = rows
        return joints

    def _fill(self, rows: NDArray[np.float64], out: NDArray[Any]) -> None:
        self._reduction.fill(self._joints(rows), out, self._threads)

    def _misfit(
        self, rows: NDArray[np.float64], measured: NDArray[np.complex128], weights: NDArray[np.float64], logarithm: bool
    ) -> NDArray[np.float64]:
        return self._reduction.misfit(self._joints(rows), measured, weights, logarithm, self._threads)


class _Models(Candidates):
    """Whole models differ."""

    road = "models"

    def __init__(self, model: _core.ModelSweep, addresses: tuple[str, ...], threads: int) -> None:
        super().__init__(addresses, len(model), _MODEL_S + _LINE_S * len(model))
        self._model, self._threads = model, threads

    def _fill(self, rows: NDArray[np.float64], out: NDArray[Any]) -> None:
        self._model.fill(rows, out, self._threads)

    def _misfit(
        self, rows: NDArray[np.float64], measured: NDArray[np.complex128], weights: NDArray[np.float64], logarithm: bool
    ) -> NDArray[np.float64]:
        return self._model.misfit(rows, measured, weights, logarithm, self._threads)


class _Assemblies(Candidates):
    """Assembly by assembly."""

    road = "assemblies"

    def __init__(
        self,
        assembly: Assembly,
        addresses: tuple[str, ...],
        lines: NDArray[Any],
        points: list[Coordinate],
        threads: int,
    ) -> None:
        # One after the other, so that signals are seen in between.
        super().__init__(addresses, lines.size, _CALL_S)
        # Brings all that fits need.
        from receptance._stepped_place import SteppedPlace

        self._assembly, self._lines, self._threads = assembly, lines, threads
        self._places = [SteppedPlace(assembly, point) for point in points]
        # What is wrong with the assembly itself is said, where a candidate's own fault is only NaN.
        assembly.receptance(lines, response=points[0], excitation=points[1], threads=threads)

    def _receptance(self, row: NDArray[np.float64]) -> NDArray[np.complex128] | None:
        try:
            assembly = self._assembly.replace(dict(zip(self.addresses, row.tolist(), strict=True)))
            response, excitation = (place.on(assembly) for place in self._places)
            return assembly.receptance(self._lines, response=response, excitation=excitation, threads=self._threads)
        except (ReceptanceError, ValueError):
            return None

    def _fill(self, rows: NDArray[np.float64], out: NDArray[Any]) -> None:
        for row, into in zip(rows, out, strict=True):
            found = self._receptance(row)
            into[:] = np.nan if found is None else found if np.iscomplexobj(out) else np.abs(found)

    def _misfit(
        self, rows: NDArray[np.float64], measured: NDArray[np.complex128], weights: NDArray[np.float64], logarithm: bool
    ) -> NDArray[np.float64]:
        sums = np.full(len(rows), np.nan)
        for i, row in enumerate(rows):
            found = self._receptance(row)
            if found is not None:
                residual = np.log(measured / found) if logarithm else measured - found
                sums[i] = np.sum(np.abs(weights * residual) ** 2)
        return sums


def candidates_of(
    assembly: Assembly,
    addresses: Sequence[str],
    frequency_hz: ArrayLike,
    response: Coordinate | None = None,
    excitation: Coordinate | None = None,
    threads: int | None = None,
) -> Candidates:
    """Return what evaluates other values of some parameters of an assembly, on the fastest road that serves.

    Parameters
    ----------
    assembly : Assembly
        The assembly.
    addresses : sequence of str
        The parameters that differ, the columns of the candidates.
    frequency_hz : array_like
        Lines `(n_freq,)`, real, or complex for an exponential window.
    response, excitation, threads
        As in `Assembly.receptance`.

    Raises
    ------
    ValueError
        An address that the assembly does not have, or one that is there twice.
    """
    names = tuple(addresses)
    if not names or len(set(names)) < len(names):
        raise ValueError(f"addresses are {list(names)}, expected different ones, at least one")
    for name in names:
        assembly.get(name)
    lines, count = _checks.frequencies(frequency_hz), _checks.thread_count(threads)
    points = [as_coordinates(side)[0] for side in (response, excitation)]
    # A joint in micro-slip depends on the force, and the tables do not tell.
    if assembly._flatten(tuple(points)).microslips:
        return _Assemblies(assembly, names, lines, points, count)
    owners = {name.split(".", 1)[0] for name in names}
    owner = next(iter(owners))
    if assembly.motion == "bending" and len(owners) == 1 and type(assembly.elements.get(owner)) is PointJoint:
        return _Joint(assembly, owner, names, lines, points, count)
    tied = tie(assembly, names, tuple(points))
    if tied is None:
        return _Assemblies(assembly, names, lines, points, count)
    model = tied.model(_plain(len(names)), np.empty((0, 2)))
    given = by_line(tied.flat, lines)
    return _Models(model.sweep(_core.Lines(lines, tau), tied.points, given), names, count)


def _plain(count: int) -> NDArray[np.float64]:
    """Return addresses as the core takes them (see `_core`), each one an unknown of its own."""
    table = np.zeros((count, 2 + 2 * count))
    table[:, 0] = np.arange(count)
    table[:, 1] = 1.0  # times itself
    return table
