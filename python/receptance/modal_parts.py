"""Parts known by their modes, as seen at one plane: spindles, and fixtures."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from math import tau
from typing import TYPE_CHECKING, Annotated, Any, Self

import numpy as np

from receptance import _checks, _core, units
from receptance.fields import Element, Number
from receptance.terminals import RESIDUALS, Terminal

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

    def columns(self) -> tuple[float, ...]:
        """Return its numbers as the core takes them: the frequency in rad/s, then the others."""
        return tau * self.frequency_hz, *(getattr(self, quantity) for quantity in self.columns_of[1:])

    def entries(self, lines: NDArray[Any]) -> NDArray[np.complex128]:
        """Return what it adds to y/F, theta/M and y/M on lines in Hz, `(n, 3)`."""
        return modal_entries((self,), lines)


def modal_entries(modes: Iterable[Mode], lines: NDArray[Any]) -> NDArray[np.complex128]:
    """Return y/F, theta/M and y/M of a sum of modes on lines in Hz, `(n, 3)`.

    Raises
    ------
    ResonanceError
        A line that meets a mode without damping exactly.
    """
    return _core.modal_receptance(
        _core.Lines(np.ascontiguousarray(lines), tau), np.array([mode.columns() for mode in modes])
    )


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

    def entries(self, lines: NDArray[Any]) -> NDArray[np.complex128]:
        """Return y/F, theta/M and y/M on checked lines in Hz, `(n, 3)`."""
        self.check_band(lines)
        return modal_entries(self.modes, lines) + self._residual()

    def check_band(self, lines: NDArray[Any]) -> None:
        """Raise `ValueError` for a line in Hz outside the band."""
        if self.band_hz is None:
            return
        low, high = self.band_hz
        bad = np.flatnonzero((lines.real < low * (1.0 - 1e-9)) | (lines.real > high * (1.0 + 1e-9)))
        if bad.size:
            raise ValueError(
                f"{self.owner} is known from {low:g} to {high:g} Hz, and the line at {lines[bad[0]].real:g} Hz is "
                "outside; nothing is extrapolated"
            )

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
