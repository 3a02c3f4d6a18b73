"""Substructures described at one plane, by tables of receptances or by modes, at the end of an assembly."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import tau
from typing import Annotated, Any, ClassVar, Self

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from receptance import _checks, _core, units
from receptance.model.fields import Element, Field, Name, Number
from receptance.report.table import percent

RESIDUALS = ("residual_y", "residual_theta", "residual_ytheta")
"""Parameters that every terminal has, in the order of the entries of its receptance."""
ENTRIES = ((0, 0), (1, 1), (0, 1))
"""Indices of y over force, theta over moment and y over moment in the (y, theta) matrix."""


EQUAL_LINES = 1e-9
"""Relative difference of the frequencies of equal lines: rounding of written frequencies."""
_MAX_ERROR = 0.01
"""Largest interpolation error, relative to the values around it."""
_ERROR_RATIO = 16.0
"""Ratio of the errors of a cubic spline for double and single spacing."""
_GAP = 2.5
"""Ratio of an interval to its neighbours from which it is a gap without interpolation."""
_NEIGHBOURS = 4
"""Lines or intervals to each side from which the usual value and spacing are taken."""
_MIN_LINES = 8
"""Least lines of a table that is interpolated."""
DISCREPANCY_WIDTH = 0.25
"""Width in the logarithm of frequency over which the discrepancy of modes is one error."""
_FEW, _IN_GAP, _INEXACT = 1, 2, 3
"""Why a table has no value between its lines."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Terminal(Element, ABC):
    """A substructure described by its receptances at one plane; the last element of an assembly."""

    toleranced = False
    role = "spindle"

    residual_y: Annotated[float, Number(units.RECEPTANCE, "receptance added to y over force")] = 0.0
    residual_theta: Annotated[float, Number(units.ROTATIONAL_RECEPTANCE, "receptance added to theta over moment")] = 0.0
    residual_ytheta: Annotated[float, Number(units.COUPLING_RECEPTANCE, "receptance added to y over moment")] = 0.0
    name: Name = field(default="", compare=False)

    def receptance(self, frequency_hz: ArrayLike) -> NDArray[np.complex128]:
        """Return the receptance at the plane, `(n, 2, 2)` over (y, theta): y/F, y/M, theta/F and theta/M, SI units.

        Raises
        ------
        ValueError
            A line at which the receptance is not known.
        """
        entries = self.entries(_checks.frequencies(frequency_hz))
        result = np.empty((len(entries), 2, 2), dtype=np.complex128)
        for column, (i, j) in enumerate(ENTRIES):
            result[:, i, j] = result[:, j, i] = entries[:, column]
        return result

    @abstractmethod
    def entries(self, lines: NDArray[np.inexact]) -> NDArray[np.complex128]:
        """Return y/F, theta/M and y/M on checked lines in Hz, `(n, 3)`."""

    @property
    @abstractmethod
    def edges_hz(self) -> tuple[float, float]:
        """Lowest and highest frequency at which the part is known; infinite for modes without a band."""

    independent_lines: ClassVar[bool]
    """Whether the errors of `error_root` are independent between lines; if not, all lines share them."""

    @abstractmethod
    def error_root(self, lines: NDArray[np.inexact]) -> NDArray[np.complex128] | None:
        """Return the errors of y/F, theta/M and y/M that no parameter describes; None if there are none.

        R of shape `(n, 3, 3)`: the errors are R z with independent complex z of unit variance of real and imaginary
        part, so that R R^H is their covariance on each line.
        """

    @abstractmethod
    def error_groups(self, lines_hz: NDArray[np.float64]) -> NDArray[np.intp]:
        """Return a number for each line `(n,)`; lines of one number share one draw of the errors of `error_root`.

        Errors of modes are smooth: they are one draw over a quarter in the logarithm of frequency.
        """

    @abstractmethod
    def covers(self, frequency_hz: ArrayLike) -> NDArray[np.bool_]:
        """Return on which real lines in Hz the part has a value, `(n,)`."""

    def _residual(self) -> NDArray[np.complex128]:
        return np.array([getattr(self, quantity) for quantity in RESIDUALS], dtype=np.complex128)


@dataclass(frozen=True, kw_only=True, eq=False)
class MeasuredPart(Terminal):
    """A part described by a table of receptances at one plane, such as a measured or identified spindle.

    It is the last element of an assembly, connected to the part before it rigidly or by a joint. It has a value at the
    lines of the table, and between them if the interpolation error estimated from the table is below 1 %. It is never
    extrapolated.

    Parameters
    ----------
    frequency_hz : array_like
        `(n,)` ascending lines.
    matrix : array_like
        `(n, 2, 2)` complex receptance over (y, theta): y/F [m/N], y/M, theta/F and theta/M [rad/(N m)]; symmetric.
    covariance : array_like, optional
        `(n, 3, 3)` Hermitian covariance of the errors of y/F, theta/M and y/M, for the real and for the imaginary
        parts.
    {fields}

    Raises
    ------
    TypeError, ValueError
        Arrays whose shapes do not match, values that are not finite, or a matrix that is not symmetric, although
        reciprocity requires y/M = theta/F.

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
    source: Annotated[str, Field("file that it was read from, for messages")] = field(default="", compare=False)
    independent_lines: ClassVar[bool] = True

    def __post_init__(self) -> None:
        owner = self.owner
        lines = _checks.frequencies(self.frequency_hz)
        if lines.dtype.kind == "c":
            raise TypeError(f"{owner}: frequency_hz is complex, expected real lines and decay_rate")
        matrix = _checks.unmasked(owner, "matrix", self.matrix, np.complex128)
        if matrix.shape != (lines.size, 2, 2):
            raise ValueError(f"{owner}: matrix has shape {matrix.shape}, expected ({lines.size}, 2, 2)")
        _check_finite(owner, "matrix", matrix)
        size = np.sqrt(np.abs(matrix[:, 0, 0] * matrix[:, 1, 1])) + np.abs(matrix[:, 0, 1])
        off = np.abs(matrix[:, 0, 1] - matrix[:, 1, 0])
        if np.any(off > 1e-6 * size):
            line = int(np.argmax(off - 1e-6 * size))
            raise ValueError(
                f"{owner}: at {lines[line]:g} Hz y/M is {matrix[line, 0, 1]:.3g} and theta/F {matrix[line, 1, 0]:.3g}, "
                "expected equal values (reciprocity); if both were measured, give their mean"
            )
        arrays: dict[str, NDArray[np.inexact]] = {"frequency_hz": lines.astype(np.float64), "matrix": matrix}
        if self.covariance is not None:
            covariance = _checks.unmasked(owner, "covariance", self.covariance, np.complex128)
            if covariance.shape != (lines.size, 3, 3):
                raise ValueError(f"{owner}: covariance has shape {covariance.shape}, expected ({lines.size}, 3, 3)")
            _check_finite(owner, "covariance", covariance)
            arrays["covariance"] = covariance
        _checks.set_fields(self, arrays)
        super().__post_init__()

    def entries(self, lines: NDArray[np.inexact]) -> NDArray[np.complex128]:
        """Return y/F, theta/M and y/M on checked lines in Hz, `(n, 3)`."""
        return self.table_entries(lines) + self._residual()

    @cached_property
    def _table(self) -> NDArray[np.complex128]:
        """The entries on the lines of the table, `(n, 3)`."""
        return np.stack([self.matrix[:, i, j] for i, j in ENTRIES], axis=1)

    def table_entries(self, lines: NDArray[np.inexact]) -> NDArray[np.complex128]:
        """Return the entries without the residuals: exact at the lines of the table, by a cubic spline between them.

        A line outside the table, in a gap, or where the table is too coarse or too noisy is a ValueError.
        """
        decay = 0.0 - lines.imag * tau
        if np.any(np.abs(decay - self.decay_rate) > 1e-9 * (np.abs(lines) + self.decay_rate)):
            raise ValueError(
                f"{self.owner}: the lines have a decay rate of {decay[0]:g} 1/s, expected that of the table, "
                f"{self.decay_rate:g} 1/s; fit a ModalPart, which is defined at any complex frequency"
            )
        owner = f"{self.owner} ({self.source})" if self.source else self.owner
        real = np.ascontiguousarray(lines.real)
        outside = np.flatnonzero(self._outside(real))
        if outside.size:
            low, high = self.frequency_hz[[0, -1]]
            raise ValueError(
                f"{owner} is known from {low:g} to {high:g} Hz, and the line at {real[outside[0]]:g} Hz is outside; "
                f"it is not extrapolated: leave out the {outside.size} of {real.size} lines outside, "
                f"`low_hz={low:g}, high_hz={high:g}` of `Observation.from_frf`, or measure the part in the whole band"
            )
        nearest, same = nearest_lines(self.frequency_hz, real)
        result = self._table[nearest]
        if not same.all():
            self._check_between(owner, real[~same])
            result[~same] = _spline(self.frequency_hz, self._table, real[~same])
        return result

    @property
    def edges_hz(self) -> tuple[float, float]:
        """First and last line of the table."""
        return float(self.frequency_hz[0]), float(self.frequency_hz[-1])

    @cached_property
    def gaps_hz(self) -> tuple[tuple[float, float], ...]:
        """Intervals between lines that are much wider than those around, without a value inside."""
        lines = self.frequency_hz
        wide = np.flatnonzero(np.diff(lines) > _GAP * self._usual_spacing)
        return tuple((float(lines[i]), float(lines[i + 1])) for i in wide)

    @cached_property
    def _usual_spacing(self) -> NDArray[np.float64]:
        """Median spacing around each interval of the table."""
        spacing, n = np.diff(self.frequency_hz), _NEIGHBOURS
        return np.array([np.median(spacing[max(i - n, 0) : i + n + 1]) for i in range(spacing.size)])

    @cached_property
    def _root(self) -> NDArray[np.complex128] | None:
        """The root of the covariance on the lines of the table, `(n, 3, 3)`."""
        if self.covariance is None:
            return None
        # Terms in units of their deviation: those of y/F and theta/M differ by many orders.
        deviation = np.sqrt(np.einsum("nii->ni", self.covariance).real.clip(0.0))
        scale = np.where(deviation > 0.0, deviation, 1.0)
        values, vectors = np.linalg.eigh(self.covariance / (scale[:, :, None] * scale[:, None, :]))
        return np.asarray(scale[:, :, None] * vectors * np.sqrt(values.clip(0.0))[:, None, :])

    def error_root(self, lines: NDArray[np.inexact]) -> NDArray[np.complex128] | None:
        """Return the root of the covariance of the nearest line of the table, `(n, 3, 3)`; None without covariance."""
        return None if self._root is None else self._root[nearest_lines(self.frequency_hz, lines.real)[0]]

    def error_groups(self, lines_hz: NDArray[np.float64]) -> NDArray[np.intp]:
        """Return the number of the nearest line of the table, `(n,)`."""
        middles = 0.5 * (self.frequency_hz[1:] + self.frequency_hz[:-1])
        return np.asarray(np.searchsorted(middles, lines_hz))

    def covers(self, frequency_hz: ArrayLike) -> NDArray[np.bool_]:
        """Return on which real lines in Hz the part has a value, `(n,)`: within its band, and not in a gap.

        The others of a measured FRF are left out by `frf.with_(usable=part.covers(frf.frequency_hz))`.
        """
        lines = np.ascontiguousarray(_checks.frequencies(frequency_hz).real, dtype=np.float64)
        result = ~self._outside(lines)
        between = np.flatnonzero(result & ~nearest_lines(self.frequency_hz, lines)[1])
        if between.size:
            result[between] = self._doubts(lines[between])[0] == 0
        return result

    def _outside(self, lines_hz: NDArray[np.float64]) -> NDArray[np.bool_]:
        low, high = self.frequency_hz[0] * (1.0 - EQUAL_LINES), self.frequency_hz[-1] * (1.0 + EQUAL_LINES)
        return np.asarray((lines_hz < low) | (lines_hz > high))

    def _doubts(self, lines_hz: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Return why the table has no value at lines between its own, 0 where it has one, and the relative error."""
        lines = self.frequency_hz
        if lines.size < _MIN_LINES:
            return np.full(lines_hz.size, _FEW), np.zeros(lines_hz.size)
        after = _after(lines, lines_hz)
        error = self._error
        worst = np.max(np.maximum(error[after - 1], error[after]), axis=1)
        gap = (np.diff(lines) > _GAP * self._usual_spacing)[after - 1]
        return np.where(gap, _IN_GAP, np.where(worst > _MAX_ERROR, _INEXACT, 0)), worst

    def _check_between(self, owner: str, lines_hz: NDArray[np.float64]) -> None:
        """Raise where the table has no value at lines between its own."""
        doubts, worst = self._doubts(lines_hz)
        if not doubts.any():
            return
        # The first doubt in the order of the list, of which the first line.
        kind = min(doubts[doubts > 0].tolist())
        at = int(np.flatnonzero(doubts == kind)[0])
        line, lines = lines_hz[at], self.frequency_hz
        if kind == _FEW:
            raise ValueError(f"{owner} has {lines.size} lines, too few to interpolate to {line:g} Hz; use its lines")
        leave_out = "leave the line out, `frf.with_(usable=part.covers(frf.frequency_hz))`"
        if kind == _IN_GAP:
            after = _after(lines, lines_hz)[at]
            raise ValueError(
                f"{owner} is not known between {lines[after - 1]:g} and {lines[after]:g} Hz, at the line at "
                f"{line:g} Hz; {leave_out}, or fit a ModalPart"
            )
        raise ValueError(
            f"{owner}: interpolation to {line:g} Hz has an error of about {percent(worst[at])}: the lines are too "
            f"far apart or too noisy; use its lines, {leave_out}, or fit a ModalPart"
        )

    @cached_property
    def _error(self) -> NDArray[np.float64]:
        """The relative error of the spline around each line, `(n, 3)`.

        The prediction of each line from every second other line has double spacing, so its error is 16 times that of
        the spline.
        """
        lines, table = self.frequency_hz, self._table
        off = np.zeros(table.shape)
        for start in (0, 1):
            kept, other = slice(start, None, 2), slice(1 - start, None, 2)
            inside = (lines[other] >= lines[kept][0]) & (lines[other] <= lines[kept][-1])
            rows = np.arange(lines.size)[other][inside]
            off[rows] = np.abs(_spline(lines[kept], table[kept], lines[rows]) - table[rows]) / _ERROR_RATIO
        window = np.ones(2 * _NEIGHBOURS + 1) / (2 * _NEIGHBOURS + 1)
        sizes = (np.pad(column, _NEIGHBOURS, "edge") for column in np.abs(table).T)
        local = np.stack([np.convolve(size, window, "valid") for size in sizes], axis=1)
        result: NDArray[np.float64] = off / np.maximum(local, 1e-300)
        return result

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


def _check_finite(owner: str, name: str, array: NDArray[np.inexact]) -> None:
    if (bad := np.argwhere(~np.isfinite(array))).size:
        position = ", ".join(str(index) for index in bad[0])
        raise ValueError(f"{owner}: {name}[{position}] is {array[tuple(bad[0])]}, expected a finite number")


def _after(known_hz: NDArray[np.float64], lines_hz: NDArray[np.float64]) -> NDArray[np.intp]:
    return np.asarray(np.clip(np.searchsorted(known_hz, lines_hz), 1, max(known_hz.size - 1, 1)))


def nearest_lines(
    known_hz: NDArray[np.inexact], lines_hz: NDArray[np.inexact]
) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Return which of ascending known lines is nearest to each line, and whether it is the same but for rounding."""
    after = np.minimum(_after(known_hz.real, lines_hz.real), known_hz.size - 1)
    before = np.maximum(after - 1, 0)
    nearest = np.where(np.abs(known_hz[after] - lines_hz) < np.abs(known_hz[before] - lines_hz), after, before)
    return nearest, np.abs(known_hz[nearest] - lines_hz) <= EQUAL_LINES * np.abs(lines_hz)


def _spline(
    known_hz: NDArray[np.float64], table: NDArray[np.complex128], lines_hz: NDArray[np.float64]
) -> NDArray[np.complex128]:
    return np.asarray(scipy.interpolate.CubicSpline(known_hz, table)(lines_hz), dtype=np.complex128)


MODE_ADDRESS = re.compile(r"(.+)\.mode\[(\d+)\]\.(\w+)")
"""Address of a number of a mode: the name of the part, the index of the mode and the number."""
_MODE = re.compile(r"mode\[(\d+)\]\.(\w+)")


@dataclass(frozen=True, kw_only=True)
class Mode(Element):
    """A mode of a part at one plane.

    With s = i w, phi = (y, theta) and chi = (y_imaginary, theta_imaginary) its contribution to the receptance over (y,
    theta) is

        (phi phi^T - chi chi^T + (phi chi^T + chi phi^T) (s + zeta w_r) / w_d) / (w_r^2 + 2 zeta w_r s + s^2),

    w_d = w_r sqrt(1 - zeta^2): the pair of poles of a structure with viscous damping. For real shapes (chi = 0), if
    damping does not couple the modes, it is phi phi^T / (w_r^2 - w^2 + 2 i zeta w_r w).

    Parameters
    ----------
    {fields}

    Raises
    ------
    ValueError
        A negative frequency or damping, or a complex shape of a mode that does not oscillate.

    Examples
    --------
    >>> from receptance import Mode
    >>> bending = Mode(frequency_hz=650.0, damping_ratio=0.03, y=0.25, theta=1.1)
    """

    toleranced = False

    frequency_hz: Annotated[
        float,
        Number(units.FREQUENCY_OR_ZERO, "undamped natural frequency with a free plane; zero for a rigid-body mode"),
    ]
    damping_ratio: Annotated[float, Number(units.DAMPING_RATIO, "share of critical damping")]
    y: Annotated[float, Number(units.MODE_SHAPE, "mass-normalised mode shape at the plane")]
    theta: Annotated[float, Number(units.MODE_SLOPE, "rotation of the mode shape at the plane")]
    y_imaginary: Annotated[
        float, Number(units.MODE_SHAPE, "imaginary part of the shape, if damping couples the modes")
    ] = 0.0
    theta_imaginary: Annotated[float, Number(units.MODE_SLOPE, "imaginary part of the rotation of the shape")] = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if (self.y_imaginary or self.theta_imaginary) and (self.frequency_hz == 0.0 or self.damping_ratio >= 1.0):
            raise ValueError(
                f"Mode: at {self.frequency_hz:g} Hz with a damping ratio of {self.damping_ratio:g} the mode does "
                "not oscillate, expected a shape without imaginary parts"
            )

    @cached_property
    def columns(self) -> tuple[float, ...]:
        """Row of the table of modes: the frequency in rad/s, then the other parameters."""
        return tau * self.frequency_hz, *(getattr(self, quantity) for quantity in self.columns_of[1:])

    def entries(self, lines: NDArray[np.inexact]) -> NDArray[np.complex128]:
        """Return the contributions to y/F, theta/M and y/M on lines in Hz, `(n, 3)`."""
        return modal_entries((self,), lines)


def modal_entries(modes: Iterable[Mode], lines: NDArray[np.inexact]) -> NDArray[np.complex128]:
    """Return y/F, theta/M and y/M of a sum of modes on lines in Hz, `(n, 3)`."""
    return _core.modal_receptance(
        _core.Lines(np.ascontiguousarray(lines), tau), np.array([mode.columns for mode in modes])
    )


@dataclass(frozen=True, kw_only=True)
class ModalPart(Terminal):
    """A part described by its modes at one plane, such as a spindle or a fixture.

    Its receptance over (y, theta) is the sum over its modes (see `Mode`) and a residual R, the contribution of modes
    above the band. It is the last element of an assembly.

    Parameters
    ----------
    modes : iterable of Mode
        At least one.
    band_hz : (float, float), optional
        Band of validity in Hz; lines outside it raise an error.
    {fields}

    Raises
    ------
    TypeError, ValueError
        No modes, values out of their bounds, a band that does not ascend.

    Examples
    --------
    >>> from receptance import STEEL, Assembly, ModalPart, Mode, Part, PointJoint, Segment
    >>> spindle = ModalPart(modes=[Mode(frequency_hz=650.0, damping_ratio=0.03, y=0.25, theta=1.1)], residual_y=2e-9,
    ...     residual_theta=2e-7, name="spindle")
    >>> blank = Part([Segment(length=0.12, outer_diameter=0.04, material=STEEL)], name="blank")
    >>> machine = Assembly([blank, PointJoint(k_y=1e9, k_theta=2e6), spindle])
    >>> h, slope = machine.derivatives([300.0, 600.0], ["spindle.mode[0].frequency_hz", "spindle.residual_y"])
    """

    modes: tuple[Mode, ...]
    band_hz: tuple[float, float] | None = None
    discrepancy: Annotated[
        float,
        Number(
            units.SHARE,
            "relative standard deviation of what the modes cannot represent, of y over force, theta over moment and "
            "y over moment",
            parameter=False,
        ),
    ] = 0.0
    independent_lines: ClassVar[bool] = False

    def __post_init__(self) -> None:
        _checks.set_fields(self, {"modes": _checks.items(f"{self.owner}: modes", self.modes, Mode)})
        super().__post_init__()
        if self.band_hz is not None:
            low, high = (_checks.not_negative(self.owner, "band_hz", value, unit="Hz") for value in self.band_hz)
            if not low < high:
                raise ValueError(f"{self.owner}: band_hz is {low:g} to {high:g} Hz, expected an ascending pair")
            _checks.set_fields(self, {"band_hz": (low, high)})

    @property
    def addresses(self) -> tuple[str, ...]:
        """Addresses of the parameters within the element."""
        modal = [f"mode[{index}].{quantity}" for index in range(len(self.modes)) for quantity in Mode.columns_of]
        return (*modal, *RESIDUALS)

    def entries(self, lines: NDArray[np.inexact]) -> NDArray[np.complex128]:
        """Return y/F, theta/M and y/M on checked lines in Hz, `(n, 3)`."""
        self.check_band(lines)
        return modal_entries(self.modes, lines) + self._residual()

    @property
    def edges_hz(self) -> tuple[float, float]:
        """The band."""
        return self.band_hz or (0.0, np.inf)

    def error_root(self, lines: NDArray[np.inexact]) -> NDArray[np.complex128] | None:
        """Return the discrepancy times the magnitudes of the entries, `(n, 3, 3)` diagonal; None without one.

        A magnitude is the root sum of squares of the contributions of modes and residual, because at an antiresonance
        the contributions cancel and their errors do not.
        """
        if not self.discrepancy:
            return None
        terms = [np.abs(mode.entries(lines)[:, :2]) for mode in self.modes]
        terms.append(np.tile(np.abs([self.residual_y, self.residual_theta]), (lines.size, 1)))
        sizes = np.sqrt(np.sum(np.square(terms), axis=0))
        coupling = np.sqrt(np.sum([np.prod(term, axis=1) for term in terms], axis=0))
        size = np.concatenate([sizes, coupling[:, None]], axis=1)
        return np.asarray(self.discrepancy * size[:, :, None] * np.eye(3), dtype=np.complex128)

    def error_groups(self, lines_hz: NDArray[np.float64]) -> NDArray[np.intp]:
        """Return the number of the quarter in the logarithm of frequency, `(n,)`."""
        return np.floor(np.log1p(lines_hz) / DISCREPANCY_WIDTH).astype(np.intp)

    def covers(self, frequency_hz: ArrayLike) -> NDArray[np.bool_]:
        """Return which real lines in Hz are within the band, `(n,)`."""
        lines = _checks.frequencies(frequency_hz).real
        if self.band_hz is None:
            return np.ones(lines.size, dtype=np.bool_)
        low, high = self.band_hz
        return np.asarray((lines >= low * (1.0 - EQUAL_LINES)) & (lines <= high * (1.0 + EQUAL_LINES)))

    def check_band(self, lines: NDArray[np.inexact]) -> None:
        """Raise `ValueError` for a line in Hz outside the band."""
        if self.band_hz is None:
            return
        low, high = self.band_hz
        bad = np.flatnonzero(~self.covers(lines.real))
        if bad.size:
            raise ValueError(
                f"{self.owner} is known from {low:g} to {high:g} Hz, and the line at {lines[bad[0]].real:g} Hz is "
                f"outside; it is not extrapolated: leave out the {bad.size} of {lines.size} lines outside, "
                f"`low_hz={low:g}, high_hz={high:g}` of `Observation.from_frf`, or give modes of the whole band"
            )

    def with_values(self, values: Mapping[str, float]) -> Self:
        """Return the part with new values of some parameters, replaced together."""
        residuals: dict[str, Any] = {name: value for name, value in values.items() if name in RESIDUALS}
        modes = list(self.modes)
        for name in values.keys() - residuals.keys():
            match = _MODE.fullmatch(name)
            if match is None or int(match[1]) >= len(modes):
                raise ValueError(f"{self.owner} has no parameter {name!r}")
            modes[int(match[1])] = modes[int(match[1])].with_values({match[2]: values[name]})
        return replace(self, modes=tuple(modes), **residuals)

    def __repr__(self) -> str:
        modes = ", ".join(f"{mode.frequency_hz:g}" for mode in self.modes)
        return f"ModalPart(name={self.name!r}, modes at {modes} Hz)"
