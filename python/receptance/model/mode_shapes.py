"""Shapes of the modes of an assembly with its damping: deflection and slope along its parts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import tau
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from receptance import _checks
from receptance.model.beams import Part
from receptance.model.complex_modes import circles, damped_modes
from receptance.model.coordinates import Coordinate
from receptance.model.distributed import SpreadJoint
from receptance.report import Column, Provenance, Result, Table

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from receptance.model.assembly import Assembly

__all__ = ["ModeShapes", "mode_shapes"]

_POINTS = 101
"""Number of points along an assembly by default."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ModeShapes(Result):
    """Shapes of the modes of an assembly, normalised to unit modal mass.

    Attributes
    ----------
    frequency_hz, damping_ratio : ndarray
        `(k,)` natural frequencies in Hz and damping ratios, as in `DampedModes`.
    part : tuple of str
        `(n,)` part of each point.
    position, distance : ndarray
        `(n,)` distance in m from the tip-side end of the part, and from the tip of the assembly. There are two points
        at a joint, one on each part.
    y, theta : ndarray
        `(k, n)` complex deflection in 1/kg^(1/2) and slope in rad/(m kg^(1/2)). The receptance between two points is
        the sum of y_i y_j / (w_r^2 - w^2 + 2 i zeta_r w_r w) over the modes. The largest deflection is close to the
        real axis and positive; imaginary parts are due to damping.

    Examples
    --------
    >>> from receptance import STEEL, Assembly, Part, Segment
    >>> bar = Assembly([Part([Segment(length=0.1, outer_diameter=0.02, material=STEEL)], name="bar")])
    >>> shapes = bar.mode_shapes(12e3)
    >>> f"{shapes.frequency_hz[0]:.0f} Hz, {shapes.y[0, 0].real:.2f} 1/kg^(1/2) at {shapes.distance[0]:.1f} m"
    '8389 Hz, 3.77 1/kg^(1/2) at 0.0 m'
    """

    heading: ClassVar[str] = "Mode shapes"
    assembly: Assembly = field(repr=False)
    frequency_hz: NDArray[np.float64]
    damping_ratio: NDArray[np.float64] = field(repr=False)
    part: tuple[str, ...] = field(repr=False)
    position: NDArray[np.float64] = field(repr=False)
    distance: NDArray[np.float64] = field(repr=False)
    y: NDArray[np.complex128] = field(repr=False)
    theta: NDArray[np.complex128] = field(repr=False)
    provenance: Provenance = field(default_factory=Provenance, repr=False)
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        return self.frequency_hz.size

    def tables(self) -> list[Table]:
        """Return frequency, damping ratio and largest deflection of each mode."""
        most = np.abs(self.y).argmax(axis=1)
        rows = [
            (
                number + 1,
                float(self.frequency_hz[number]),
                100.0 * float(self.damping_ratio[number]),
                float(abs(self.y[number, at])),
                f"{self.part[at]}, {1e3 * self.position[at]:.4g} mm",
            )
            for number, at in enumerate(most)
        ]
        columns = (
            Column("mode", form="d"),
            Column("frequency", "Hz", ".1f"),
            Column("damping ratio", "%", ".3g"),
            Column("largest deflection", "1/kg^0.5"),
            "at",
        )
        return [Table("Modes", columns, rows)]

    def data(self) -> dict[str, Any]:
        """Return frequencies, damping ratios, points and shapes."""
        names = ("frequency_hz", "damping_ratio", "part", "position", "distance", "y", "theta")
        return {name: getattr(self, name) for name in names}

    def plot(self, ax: Axes | None = None) -> Figure:
        """Draw the deflection of each mode over the assembly, with the outline of its parts to scale along the axis.

        Parameters
        ----------
        ax : Axes, optional
            As in `Result.plot`.
        """
        from receptance.model.figure import draw_mode_shapes

        return draw_mode_shapes(self, ax)


def mode_shapes(
    assembly: Assembly, upper_hz: float, *, points: int = _POINTS, threads: int | None = None
) -> ModeShapes:
    """Return the shapes of the modes of an assembly with its damping up to a frequency.

    The residues of the receptances at the poles are means over small circles around them, as in `damped_modes`. Of the
    ends of all parts the load acts where a mode responds most.

    Parameters
    ----------
    assembly : Assembly
        In bending.
    upper_hz : float
        Limit of the natural frequencies in Hz.
    points : int, optional
        Number of points along the assembly, ends of segments in addition.
    threads : int, optional
        As in `Assembly.receptance`.

    Raises
    ------
    ValueError
        A limit that is not positive, fewer than two points, or as `Assembly.receptance`.

    Examples
    --------
    >>> from receptance import STEEL, Assembly, GroundSpring, Part, Segment
    >>> bar = Part([Segment(length=0.1, outer_diameter=0.02, material=STEEL)], name="bar")
    >>> clamp = GroundSpring(part="bar", position=0.1, k_y=1e9, k_theta=1e6, name="clamp")
    >>> shapes = Assembly([bar], [clamp]).mode_shapes(15e3)
    >>> len(shapes), bool(abs(shapes.y[0, 0]) > 20.0 * abs(shapes.y[0, -1]))
    (2, True)
    """
    _checks.whole_number("mode_shapes", "points", points, least=2)
    names, positions, distances = _points(assembly, points)
    modes = damped_modes(assembly, upper_hz, threads=threads)
    responses = [Coordinate(part, at, way) for way in ("y", "theta") for part, at in zip(names, positions, strict=True)]
    ends = _ends(names, positions)
    poles = modes.poles_hz
    if not poles.size:
        empty = np.zeros((0, len(names)), np.complex128)
        y = theta = empty
    else:
        order, lines, offset = circles(poles)
        around = np.empty((lines.size, len(responses), len(ends)), np.complex128)
        around[order] = assembly.receptance(lines, response=responses, excitation=ends, threads=threads).reshape(
            lines.size, len(responses), len(ends)
        )
        around = around.reshape(*offset.shape, len(responses), len(ends))
        residues = np.mean(around * offset[:, :, None, None], axis=1) * tau
        constants = -2.0 * tau * poles.real[:, None, None] * residues
        shapes = np.stack([_normalised(one, responses, ends, len(names)) for one in constants])
        y, theta = shapes[:, : len(names)], shapes[:, len(names) :]
    return ModeShapes(
        assembly=assembly,
        frequency_hz=modes.frequency_hz,
        damping_ratio=modes.damping_ratio,
        part=tuple(names),
        position=np.array(positions),
        distance=np.array(distances),
        y=y,
        theta=theta,
        notes=(f"{modes.missed} modes were counted and not found",) if modes.missed else (),
    )


def _points(assembly: Assembly, count: int) -> tuple[list[str], list[float], list[float]]:
    """Return part, position and distance from the tip of points at all ends of segments and evenly between them."""
    lengths = {
        name: sum(segment.length for segment in element.segments) if isinstance(element, Part) else element.length
        for name, element in assembly.elements.items()
        if isinstance(element, (Part, SpreadJoint))
    }
    step = sum(lengths.values()) / (count - 1)
    names: list[str] = []
    positions: list[float] = []
    distances: list[float] = []
    start = 0.0
    for name, length in lengths.items():
        element = assembly.elements[name]
        if isinstance(element, Part):
            edges = np.concatenate([[0.0], np.cumsum([segment.length for segment in element.segments])])
            inside = np.linspace(0.0, length, max(int(np.ceil(length / step)), 1) + 1)
            # Points closer together than rounding would be one point.
            gap = np.abs(inside[:, None] - edges[None, :]).min(axis=1)
            own = np.sort(np.concatenate([edges, inside[gap > 1e-3 * step]]))
            names += [name] * own.size
            positions += own.tolist()
            distances += (start + own).tolist()
        start += length
    return names, positions, distances


def _ends(names: Sequence[str], positions: Sequence[float]) -> list[Coordinate]:
    """Return the ends of all parts."""
    found: dict[str, list[float]] = {}
    for name, at in zip(names, positions, strict=True):
        found.setdefault(name, []).append(at)
    return [Coordinate(name, at) for name, own in found.items() for at in (own[0], own[-1])]


def _normalised(
    constants: NDArray[np.complex128], responses: Sequence[Coordinate], ends: Sequence[Coordinate], count: int
) -> NDArray[np.complex128]:
    """Return a shape from the modal constants of responses (rows) and loads (columns)."""
    drives = np.array([constants[responses.index(end), column] for column, end in enumerate(ends)])
    column = int(np.abs(drives).argmax())
    shape = constants[:, column] / np.sqrt(drives[column])
    largest = shape[:count][np.abs(shape[:count]).argmax()]
    return np.asarray(shape if largest.real >= 0.0 else -shape)
