"""Parts known by their modes, as seen at one plane: spindles, and fixtures."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from math import tau
from typing import TYPE_CHECKING, Annotated, Any, Self

import numpy as np

from receptance import _checks, units
from receptance.fields import Element, Number
from receptance.terminals import ENTRIES, RESIDUALS, Terminal

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["ModalPart", "Mode"]

_MODE = re.compile(r"mode\[(\d+)\]\.(\w+)")


@dataclass(frozen=True, kw_only=True)
class Mode(Element):
    """A mode of a part, seen at one plane.

    With s = i w, phi = (y, theta) and chi = (y_imaginary, theta_imaginary) it adds to the receptance over (y, theta)

        (phi phi^T - chi chi^T + (phi chi^T + chi phi^T) (s + zeta w_r) / w_d) / (w_r^2 + 2 zeta w_r s + s^2),

    w_d = w_r sqrt(1 - zeta^2): the pair of poles of any structure with viscous damping. Without chi, where damping does
    not couple the modes, that is phi phi^T / (w_r^2 - w^2 + 2 i zeta w_r w).

    Parameters
    ----------
    {fields}

    Raises
    ------
    ValueError
        A negative frequency or damping, or a complex shape of a mode that does not swing.

    Examples
    --------
    >>> from receptance import Mode
    >>> bending = Mode(frequency_hz=650.0, damping_ratio=0.03, y=0.25, theta=1.1)
    """

    toleranced = False

    frequency_hz: Annotated[
        float,
        Number(units.FREQUENCY_OR_ZERO, "undamped natural frequency with the plane free; zero for a rigid-body mode"),
    ]
    damping_ratio: Annotated[float, Number(units.DAMPING_RATIO, "share of critical damping")]
    y: Annotated[float, Number(units.MODE_SHAPE, "mass-normalised mode shape at the plane")]
    theta: Annotated[float, Number(units.MODE_SLOPE, "rotation of the mode shape at the plane")]
    y_imaginary: Annotated[
        float, Number(units.MODE_SHAPE, "imaginary part of the shape, where dampers couple the modes of a spindle")
    ] = 0.0
    theta_imaginary: Annotated[float, Number(units.MODE_SLOPE, "imaginary part of the rotation of the shape")] = 0.0

    def __post_init__(self) -> None:
        self.check()
        if (self.y_imaginary or self.theta_imaginary) and (self.frequency_hz == 0.0 or self.damping_ratio >= 1.0):
            raise ValueError(
                f"Mode: at {self.frequency_hz:g} Hz with a damping ratio of {self.damping_ratio:g} nothing swings, "
                "expected a shape without imaginary parts"
            )

    def entries(self, lines: NDArray[Any]) -> NDArray[np.complex128]:
        """Return what it adds to y/F, theta/M and y/M on lines in Hz, `(n, 3)`."""
        s, below = self._below(lines)
        result: NDArray[np.complex128] = self._above(s) / below[:, None]
        return result

    def slope(self, lines: NDArray[Any], quantity: str) -> NDArray[np.complex128]:
        """Return its derivative with respect to one of its numbers, `(n, 3)`."""
        s, below = self._below(lines)
        zeta, own = self.damping_ratio, tau * self.frequency_hz
        y, theta, turned_y, turned_theta = self.y, self.theta, self.y_imaginary, self.theta_imaginary
        shapes = {
            "y": ((2.0 * y, 0.0, theta), (2.0 * turned_y, 0.0, turned_theta)),
            "theta": ((0.0, 2.0 * theta, y), (0.0, 2.0 * turned_theta, turned_y)),
            "y_imaginary": ((-2.0 * turned_y, 0.0, -turned_theta), (2.0 * y, 0.0, theta)),
            "theta_imaginary": ((0.0, -2.0 * turned_theta, -turned_y), (0.0, 2.0 * theta, y)),
        }
        above: NDArray[np.complex128]
        if quantity in shapes:
            straight, turned = (np.array(shape) for shape in shapes[quantity])
            above = straight + self._lag(s)[:, None] * turned if own else straight + 0j * s[:, None]
            return above / below[:, None]
        steeper = 2.0 * own * s if quantity == "damping_ratio" else tau * (2.0 * own + 2.0 * zeta * s)
        above = -self._above(s) * (steeper / below)[:, None]
        if turned_y or turned_theta:
            root = np.sqrt(1.0 - zeta**2)
            lag = -tau * s / (own**2 * root)
            if quantity == "damping_ratio":
                lag = 1.0 / root + (s / own + zeta) * zeta / root**3
            above = above + lag[:, None] * self._turned
        return above / below[:, None]

    @property
    def _turned(self) -> NDArray[np.float64]:
        cross = self.y * self.theta_imaginary + self.theta * self.y_imaginary
        return np.array([2.0 * self.y * self.y_imaginary, 2.0 * self.theta * self.theta_imaginary, cross])

    def _lag(self, s: NDArray[np.complex128]) -> NDArray[np.complex128]:
        lag = s / (tau * self.frequency_hz) + self.damping_ratio
        result: NDArray[np.complex128] = lag / np.sqrt(max(1.0 - self.damping_ratio**2, 1e-12))
        return result

    def _above(self, s: NDArray[np.complex128]) -> NDArray[np.complex128]:
        turned_y, turned_theta = self.y_imaginary, self.theta_imaginary
        straight = np.array(
            [self.y**2 - turned_y**2, self.theta**2 - turned_theta**2, self.y * self.theta - turned_y * turned_theta]
        )
        if not (turned_y or turned_theta):
            return np.broadcast_to(straight + 0j, (s.size, straight.size))
        result: NDArray[np.complex128] = straight + self._lag(s)[:, None] * self._turned
        return result

    def _below(self, lines: NDArray[Any]) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        s, own = 1j * tau * np.asarray(lines, dtype=np.complex128), tau * self.frequency_hz
        below = own * own + s * s + 2.0 * self.damping_ratio * own * s
        if (bad := np.flatnonzero(below == 0.0)).size:
            raise ValueError(f"the line at {lines[bad[0]].real:g} Hz meets a mode without damping exactly")
        return s, below


@dataclass(frozen=True, kw_only=True)
class ModalPart(Terminal):
    """A part known by its modes, as seen at one plane: a spindle, or a fixture.

    Its receptance over (y, theta) is that of its modes, phi phi^T / (w_r^2 - w^2 + 2 i zeta_r w_r w) each where their
    shapes are real, and a residual R: what modes above the band add. It is the last element of an assembly.

    Parameters
    ----------
    modes : iterable of Mode
        At least one.
    band_hz : (float, float), optional
        Lines outside this band are refused: a fit says nothing beyond its data.
    {fields}

    Raises
    ------
    TypeError, ValueError
        No modes, numbers without meaning, a band that does not ascend.

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

    def __post_init__(self) -> None:
        modes = tuple(self.modes) if isinstance(self.modes, Iterable) else (self.modes,)
        for index, mode in enumerate(modes):
            if not isinstance(mode, Mode):
                raise TypeError(f"{self.owner}: modes[{index}] is {mode!r}, expected a Mode")
        if not modes:
            raise ValueError(f"{self.owner}: there are no modes, expected at least one")
        object.__setattr__(self, "modes", modes)
        self.check()
        if self.band_hz is not None:
            low, high = (_checks.not_negative(self.owner, "band_hz", value, unit="Hz") for value in self.band_hz)
            if not low < high:
                raise ValueError(f"{self.owner}: band_hz is {low:g} to {high:g} Hz, expected an ascending pair")
            object.__setattr__(self, "band_hz", (low, high))

    @property
    def addresses(self) -> tuple[str, ...]:
        """Addresses of its parameters within it."""
        own = [f"mode[{index}].{quantity}" for index in range(len(self.modes)) for quantity in Mode.columns_of]
        return (*own, *RESIDUALS)

    def _entries(self, lines: NDArray[Any]) -> NDArray[np.complex128]:
        self._check_band(lines)
        result = np.zeros((lines.size, len(ENTRIES)), dtype=np.complex128)
        for mode in self.modes:
            result += mode.entries(lines)
        return result

    def _check_band(self, lines: NDArray[Any]) -> None:
        if self.band_hz is None:
            return
        low, high = self.band_hz
        bad = np.flatnonzero((lines.real < low * (1.0 - 1e-9)) | (lines.real > high * (1.0 + 1e-9)))
        if bad.size:
            raise ValueError(
                f"{self.owner} is known from {low:g} to {high:g} Hz, and the line at {lines[bad[0]].real:g} Hz is "
                "outside; nothing is extrapolated"
            )

    def _slope(self, lines: NDArray[Any], parameter: str) -> NDArray[np.complex128]:
        index, quantity = self._place(parameter)
        return self.modes[index].slope(lines, quantity)

    def _place(self, parameter: str) -> tuple[int, str]:
        match = _MODE.fullmatch(parameter)
        if match is None or parameter not in self.addresses:
            raise ValueError(f"{self.owner} has no parameter {parameter!r}")
        return int(match[1]), match[2]

    def value(self, parameter: str) -> float:
        """Return the value of a parameter."""
        if parameter in RESIDUALS:
            return super().value(parameter)
        index, quantity = self._place(parameter)
        return float(getattr(self.modes[index], quantity))

    def with_values(self, values: Mapping[str, float]) -> Self:
        """Return the same with other values of some parameters."""
        own: dict[str, Any] = {name: value for name, value in values.items() if name in RESIDUALS}
        modes = list(self.modes)
        for name in values.keys() - own.keys():
            index, quantity = self._place(name)
            change: dict[str, Any] = {quantity: values[name]}
            modes[index] = replace(modes[index], **change)
        return replace(self, modes=tuple(modes), **own)

    def __repr__(self) -> str:
        modes = ", ".join(f"{mode.frequency_hz:g}" for mode in self.modes)
        return f"ModalPart(name={self.name!r}, modes at {modes} Hz)"
