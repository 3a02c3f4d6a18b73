"""What an assembly ends with that is no beam: something known by its receptances at one plane, such as a spindle."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from math import tau
from typing import TYPE_CHECKING, Annotated, Any, Self

import numpy as np
from numpy.typing import NDArray

from receptance import _checks, units
from receptance._interpolation import interpolated
from receptance.fields import Element, Field, Number

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from receptance.frf import FRF

__all__ = ["MeasuredPart", "Terminal"]

RESIDUALS = ("residual_y", "residual_theta", "residual_ytheta")
"""Parameters that every terminal has, in the order of the entries of its receptance."""
ENTRIES = ((0, 0), (1, 1), (0, 1))
"""Where y over force, theta over moment and y over moment stand in the (y, theta) matrix."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Terminal(Element, ABC):
    """Something known by its receptances at one plane; the last element of an assembly."""

    toleranced = False

    residual_y: Annotated[float, Number(units.RECEPTANCE, "receptance added to y over force")] = 0.0
    residual_theta: Annotated[float, Number(units.ROTATIONAL_RECEPTANCE, "receptance added to theta over moment")] = 0.0
    residual_ytheta: Annotated[float, Number(units.COUPLING_RECEPTANCE, "receptance added to y over moment")] = 0.0
    name: Annotated[str, Field("first word of the addresses of its parameters, as in `spindle.residual_y`")] = field(
        default="", compare=False
    )

    @property
    def addresses(self) -> tuple[str, ...]:
        """Addresses of its parameters within it."""
        return RESIDUALS

    def receptance(self, frequency_hz: ArrayLike) -> NDArray[np.complex128]:
        """Receptance at the plane, `(n, 2, 2)` over (y, theta): y/F, y/M, theta/F and theta/M.

        Raises
        ------
        ValueError
            A line at which it is not known.
        """
        entries = self.entries(_checks.frequencies(frequency_hz))
        result = np.empty((len(entries), 2, 2), dtype=np.complex128)
        for column, (i, j) in enumerate(ENTRIES):
            result[:, i, j] = result[:, j, i] = entries[:, column]
        return result

    @abstractmethod
    def entries(self, lines: NDArray[Any]) -> NDArray[np.complex128]:
        """Return y/F, theta/M and y/M on checked lines in Hz, `(n, 3)`."""

    def _residual(self) -> NDArray[np.complex128]:
        return np.array([getattr(self, quantity) for quantity in RESIDUALS], dtype=np.complex128)


@dataclass(frozen=True, kw_only=True, eq=False)
class MeasuredPart(Terminal):
    """A part known by a table of its receptances at one plane: a spindle as it was measured or identified.

    It is the last element of an assembly, rigidly connected to the part before it, or through a joint. Only lines of
    the table and those between them, where the table says that it can be interpolated, can be asked for; nothing is
    extrapolated.

    Parameters
    ----------
    frequency_hz : array_like
        `(n,)` ascending lines.
    matrix : array_like
        `(n, 2, 2)` complex receptance over (y, theta): y/F [m/N], y/M, theta/F and theta/M [rad/(N m)]; symmetric.
    covariance : array_like, optional
        `(n, 3, 3)` Hermitian covariance of the errors of y/F, theta/M and y/M: that of the real parts, which the
        imaginary parts have as well.
    {fields}

    Raises
    ------
    TypeError, ValueError
        Arrays that do not fit together, numbers that are not finite, or a matrix that is not symmetric: a reciprocal
        structure has y/M = theta/F.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance import MeasuredPart
    >>> lines = np.linspace(100.0, 1000.0, 10)
    >>> spindle = MeasuredPart(frequency_hz=lines, matrix=np.ones((10, 1, 1)) * np.diag([2e-8, 1e-6]), name="spindle")
    >>> spindle.receptance([200.0])[0, 0, 0]
    np.complex128(2e-08+0j)
    """

    frequency_hz: NDArray[np.float64]
    matrix: NDArray[np.complex128]
    decay_rate: Annotated[
        float,
        Number(
            units.DECAY_RATE,
            "decay rate of the exponential window of the table; its lines are f - i decay_rate / (2 pi)",
            parameter=False,
        ),
    ] = 0.0
    covariance: NDArray[np.complex128] | None = None

    def __post_init__(self) -> None:
        owner = self.owner
        lines = _checks.frequencies(self.frequency_hz)
        if lines.dtype.kind == "c":
            raise TypeError(f"{owner}: frequency_hz is complex, expected real lines and decay_rate")
        matrix = _checks.unmasked(owner, "matrix", self.matrix, np.complex128).copy()
        if matrix.shape != (lines.size, 2, 2):
            raise ValueError(f"{owner}: matrix has shape {matrix.shape}, expected ({lines.size}, 2, 2)")
        _check_finite(owner, "matrix", matrix)
        size = np.sqrt(np.abs(matrix[:, 0, 0] * matrix[:, 1, 1])) + np.abs(matrix[:, 0, 1])
        off = np.abs(matrix[:, 0, 1] - matrix[:, 1, 0])
        if np.any(off > 1e-6 * size):
            line = int(np.argmax(off - 1e-6 * size))
            raise ValueError(
                f"{owner}: at {lines[line]:g} Hz y/M is {matrix[line, 0, 1]:.3g} and theta/F {matrix[line, 1, 0]:.3g}, "
                "expected the same (reciprocity); where both were measured give their mean"
            )
        arrays: dict[str, NDArray[Any]] = {"frequency_hz": lines.astype(np.float64), "matrix": matrix}
        if self.covariance is not None:
            arrays["covariance"] = _checks.unmasked(owner, "covariance", self.covariance, np.complex128).copy()
            if arrays["covariance"].shape != (lines.size, 3, 3):
                raise ValueError(
                    f"{owner}: covariance has shape {arrays['covariance'].shape}, expected ({lines.size}, 3, 3)"
                )
            _check_finite(owner, "covariance", arrays["covariance"])
        for quantity, array in arrays.items():
            array.flags.writeable = False
            object.__setattr__(self, quantity, array)
        self.check()

    @classmethod
    def from_frf(cls, frf: FRF, *, name: str = "") -> Self:
        """Return the part that an FRF describes: responses y and theta, excitations force and moment, in that order.

        Lines outside the usable band are left out.
        """
        owner = f"{cls.__name__} {name!r}" if name else cls.__name__
        given = tuple(tuple(point.direction for point in side) for side in (frf.responses, frf.excitations))
        if given != (("y", "theta"), ("y", "theta")):
            raise ValueError(
                f"{owner}: the FRF has the responses {', '.join(given[0])} and the excitations {', '.join(given[1])}, "
                "expected y, theta and y, theta: a spindle needs its full receptance matrix"
            )
        found = frf.to("receptance").masked()
        mean = 0.5 * (found.values + found.values.transpose(0, 2, 1))
        return cls(frequency_hz=found.frequency_hz, matrix=mean, decay_rate=found.decay_rate, name=name)

    def entries(self, lines: NDArray[Any]) -> NDArray[np.complex128]:
        """Return y/F, theta/M and y/M on checked lines in Hz, `(n, 3)`."""
        return self.table_entries(lines) + self._residual()

    def table_entries(self, lines: NDArray[Any]) -> NDArray[np.complex128]:
        """Return the entries without the residuals."""
        table = np.stack([self.matrix[:, i, j] for i, j in ENTRIES], axis=1)
        decay = 0.0 - lines.imag * tau
        if np.any(np.abs(decay - self.decay_rate) > 1e-9 * (np.abs(lines) + self.decay_rate)):
            raise ValueError(
                f"{self.owner}: it was measured with a decay rate of {self.decay_rate:g} 1/s, and is asked for with "
                f"{decay[0]:g} 1/s; identify a ModalPart, which has a value at any complex frequency"
            )
        return interpolated(self.owner, self.frequency_hz, table, np.ascontiguousarray(lines.real))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, MeasuredPart):
            return NotImplemented
        mine, theirs = self.covariance, other.covariance
        return (
            np.array_equal(self.frequency_hz, other.frequency_hz)
            and np.array_equal(self.matrix, other.matrix)
            and self.decay_rate == other.decay_rate
            and all(getattr(self, quantity) == getattr(other, quantity) for quantity in RESIDUALS)
            and (theirs is None if mine is None else theirs is not None and np.array_equal(mine, theirs))
        )

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        low, high = self.frequency_hz[0], self.frequency_hz[-1]
        return f"MeasuredPart(name={self.name!r}, {self.frequency_hz.size} lines from {low:g} to {high:g} Hz)"


def _check_finite(owner: str, what: str, array: NDArray[Any]) -> None:
    if (bad := np.argwhere(~np.isfinite(array))).size:
        place = ", ".join(str(index) for index in bad[0])
        raise ValueError(f"{owner}: {what}[{place}] is {array[tuple(bad[0])]}, expected finite numbers")
