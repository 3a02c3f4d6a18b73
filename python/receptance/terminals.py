"""What an assembly ends with that is no beam: something known by its receptances at one plane, such as a spindle."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import tau
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from receptance import _checks
from receptance._interpolation import interpolated

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from receptance.frf import FRF

__all__ = ["MeasuredPart", "Terminal"]

RESIDUALS = ("residual_y", "residual_theta", "residual_ytheta")
"""Parameters that every terminal has, in the order of the entries of its receptance."""
_RESIDUAL_UNITS = dict(zip(RESIDUALS, ("m/N", "rad/(N m)", "m/(N m)"), strict=True))
ENTRIES = ((0, 0), (1, 1), (0, 1))
"""Where y over force, theta over moment and y over moment stand in the (y, theta) matrix."""


class Terminal(ABC):
    """Something known by its receptances at one plane; the last element of an assembly."""

    name: str
    residual_y: float
    residual_theta: float
    residual_ytheta: float

    @property
    def _owner(self) -> str:
        return f"{type(self).__name__} {self.name!r}" if self.name else type(self).__name__

    def check_residuals(self) -> None:
        """Refuse residuals that are not finite numbers."""
        for quantity, unit in _RESIDUAL_UNITS.items():
            object.__setattr__(
                self, quantity, _checks.number(self._owner, quantity, getattr(self, quantity), unit=unit)
            )

    @property
    def columns_of(self) -> tuple[str, ...]:
        """Names of its parameters."""
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

    def value(self, parameter: str) -> float:
        """Return the value of a parameter."""
        return float(getattr(self, parameter))

    def with_values(self, values: Mapping[str, float]) -> Self:
        """Return the same with other values of some parameters."""
        changes: dict[str, Any] = dict(values)
        return replace(self, **changes)  # type: ignore[type-var]

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
    decay_rate : float, optional
        Decay in 1/s of the exponential window that the table belongs to: its lines are f - i decay_rate / (2 pi).
    covariance : array_like, optional
        `(n, 3, 3)` Hermitian covariance of the errors of y/F, theta/M and y/M: that of the real parts, which the
        imaginary parts have as well.
    residual_y, residual_theta, residual_ytheta : float, optional
        Receptance added on all lines, in m/N, rad/(N m) and m/(N m): what is missing in series. Its derivative is that
        with respect to the entries of the table.
    name : str, optional
        First word of the addresses of its parameters, as in `spindle.residual_y`.

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
    decay_rate: float = 0.0
    covariance: NDArray[np.complex128] | None = None
    residual_y: float = 0.0
    residual_theta: float = 0.0
    residual_ytheta: float = 0.0
    name: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        owner = self._owner
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
        object.__setattr__(self, "decay_rate", _checks.not_negative(owner, "decay_rate", self.decay_rate, unit="1/s"))
        self.check_residuals()

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
                f"{self._owner}: it was measured with a decay rate of {self.decay_rate:g} 1/s, and is asked for with "
                f"{decay[0]:g} 1/s; identify a ModalPart, which has a value at any complex frequency"
            )
        return interpolated(self._owner, self.frequency_hz, table, np.ascontiguousarray(lines.real))

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
