"""Complex modes of an assembly: frequencies, damping ratios, dynamic stiffness with derivatives, and mode shapes.

The poles of the receptances are the zeros of a determinant. The core finds them by Newton's method from the undamped
natural frequencies, moved by the losses to first order, and by a count with the argument principle. Residues and
derivatives are means over a small circle around the pole: G = R / (w - w_r) + ...,
dG/dp = R w_r' / (w - w_r)^2 + R' / (w - w_r) + ....
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import tau
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from receptance import _checks
from receptance.model.addresses import edges_of, listed
from receptance.model.assembly import Assembly
from receptance.model.coordinates import Coordinate
from receptance.report import Column, Provenance, Result, Table

_STEP = 1e-6
"""Relative distance of the points between which a slope is taken."""
_CIRCLE = 8
"""Points around a pole: the regular part cancels to the power of their number."""
_RADIUS = 0.05
"""Radius of the circle over the distance to the nearest other pole."""
_START_RANGE = 1.2
"""Largest undamped natural frequency of a start over the limit: damping moves poles down."""
_LARGEST_RATIO = 0.9
"""Damping ratio above which modes are left out."""
_LOWEST = 1e-3
"""Poles are counted from this share of the lowest start on; rigid-body motion is at zero."""
_BELOW = -0.5
"""Angle from the real axis at which the sector of the count begins: passive structures have no poles below the axis,
and far from poles few points suffice."""


@dataclass(frozen=True, kw_only=True)
class DampedModes:
    """Modes between two coordinates of an assembly, ascending."""

    frequency_hz: NDArray[np.float64]
    """`(k,)` natural frequencies |w_r| / 2 pi, which damping lowers to `frequency_hz * sqrt(1 - damping_ratio^2)`."""
    damping_ratio: NDArray[np.float64]
    """`(k,)` viscous damping ratios Im w_r / |w_r|."""
    dynamic_stiffness: NDArray[np.float64]
    """`(k,)` 1 / |G| in N/m at the damped natural frequency, where the response is approximately largest, with the
    contribution of the other modes."""
    residue: NDArray[np.complex128]
    """`(k,)` complex R of G = sum over modes of R / (w - w_r), in m/N rad/s."""
    log_slopes: NDArray[np.float64]
    """`(k, 3, p)` derivatives of the logarithms of frequency, damping ratio and dynamic stiffness, per SI unit of the
    requested parameters."""
    missed: int = 0
    """Number of modes that were counted by the argument principle and not found; 0 unless poles coincide."""

    @property
    def poles_hz(self) -> NDArray[np.complex128]:
        """`(k,)` complex frequencies w_r / 2 pi."""
        damping = self.damping_ratio
        return np.asarray(self.frequency_hz * (np.sqrt(1.0 - damping**2) + 1j * damping))

    @property
    def modal_constant(self) -> NDArray[np.complex128]:
        """`(k,)` C of C / (w_r^2 - w^2 + 2 i zeta_r w_r w), in 1/kg; real where damping does not couple modes."""
        return np.asarray(-2.0 * tau * self.poles_hz.real * self.residue)

    def __len__(self) -> int:
        return self.frequency_hz.size


def damped_modes(
    assembly: Assembly,
    upper_hz: float,
    parameters: Sequence[str] = (),
    *,
    response: Coordinate | None = None,
    excitation: Coordinate | None = None,
    threads: int | None = None,
) -> DampedModes:
    """Return the modes of an assembly with its damping up to a frequency, as seen between two coordinates.

    Parameters
    ----------
    assembly : Assembly
        In bending.
    upper_hz : float
        Limit of the natural frequencies in Hz.
    parameters : sequence of str, optional
        Addresses of parameters to differentiate by, see `Assembly.parameters`.
    response, excitation : Coordinate, optional
        By default y over force at the tip.
    threads : int, optional
        As in `Assembly.receptance`.

    Returns
    -------
    DampedModes
        Modes with a damping ratio above 0.9 are excluded. All others are included, also those of strong dashpots
        far from every undamped mode.

    Raises
    ------
    ValueError
        A limit that is not positive, or as `Assembly.receptance`.

    Examples
    --------
    >>> from receptance import STEEL, Assembly, GroundSpring, Part, Segment, damped_modes
    >>> bar = Part([Segment(length=0.1, outer_diameter=0.02, material=STEEL)], name="bar")
    >>> clamp = GroundSpring(part="bar", position=0.1, k_y=1e8, k_theta=1e5, c_theta=0.5, name="clamp")
    >>> modes = damped_modes(Assembly([bar], [clamp]), 5e3, ["clamp.k_theta"])
    >>> f"{modes.frequency_hz[0]:.0f} Hz, {100 * modes.damping_ratio[0]:.2f} %, {modes.dynamic_stiffness[0]:.2g} N/m"
    '1061 Hz, 0.61 %, 4e+04 N/m'
    """
    limit = _checks.positive("damped_modes", "upper_hz", upper_hz, unit="Hz")
    addresses = listed(parameters)
    starts = _starts(assembly, _START_RANGE * limit)
    lowest = _LOWEST * float(np.abs(starts).min(initial=limit))
    poles, missed = assembly.poles(starts, (lowest, limit), (_BELOW, float(np.arcsin(_LARGEST_RATIO))))
    return _modes_of_poles(assembly, poles, addresses, (response, excitation), threads, missed)


def _starts(assembly: Assembly, limit: float) -> NDArray[np.complex128]:
    """Return the undamped natural frequencies in Hz, moved by i (eta k + w c) of every stiffness to first order."""
    parameters = set(assembly.parameters)
    stiffnesses, losses, dashpots = [], [], []
    for address in assembly.parameters:
        owner, _, field = address.rpartition(".")
        if field in ("k_y", "k_theta", "k_ytheta", "youngs_modulus"):
            loss_factor, dashpot = f"{owner}.loss_factor", f"{owner}.c_{field[2:]}"
            stiffnesses.append(address)
            losses.append(assembly.get(loss_factor) * assembly.get(address) if loss_factor in parameters else 0.0)
            dashpots.append(assembly.get(dashpot) if dashpot in parameters else 0.0)
    undamped, slope = assembly.natural_frequency_derivatives(limit, stiffnesses)
    shift = slope @ np.array(losses) + tau * undamped * (slope @ np.array(dashpots))
    return np.asarray(undamped + 1j * np.minimum(shift, 2.0 * undamped))


def _ascending(lines: NDArray[np.complex128]) -> tuple[NDArray[np.intp], NDArray[np.complex128]]:
    """Return the order of lines by their real part, and the sorted lines; equal lines are separated by rounding."""
    order = np.argsort(lines.real, kind="stable")
    ascending = lines[order]
    return order, ascending + 1e-15 * np.arange(ascending.size) * ascending.real


def _circles(
    poles: NDArray[np.complex128], more: NDArray[np.float64] | None = None
) -> tuple[NDArray[np.intp], NDArray[np.complex128], NDArray[np.complex128]]:
    """Return lines on small circles around poles, and more lines: their order, the ascending lines and the offsets.

    A mean over the offsets `(k, m)` of a circle times a function is its residue at the pole.
    """
    # The distance to the mirror image of a pole counts as well, so the circle stays in the upper half.
    others = np.concatenate([poles, -poles.conj()])
    distance = np.abs(poles[:, None] - others[None, :])
    distance[np.arange(poles.size), np.arange(poles.size)] = np.inf
    radius = _RADIUS * np.minimum(distance.min(axis=1, initial=np.inf), np.abs(poles))
    offset = radius[:, None] * np.exp(1j * tau * (0.3 + np.arange(_CIRCLE)) / _CIRCLE)
    lines = (poles[:, None] + offset).ravel()
    order, ascending = _ascending(lines if more is None else np.concatenate([lines, more]))
    return order, ascending, offset


def _modes_of_poles(
    assembly: Assembly,
    poles: NDArray[np.complex128],
    parameters: tuple[str, ...],
    coordinates: tuple[Coordinate | None, Coordinate | None],
    threads: int | None,
    missed: int,
) -> DampedModes:
    peaks = np.repeat(poles.real, 2) * np.tile([1.0 - _STEP, 1.0 + _STEP], poles.size)
    order, ascending, offset = _circles(poles, peaks)
    g = np.empty(ascending.size, np.complex128)
    dg = np.empty((ascending.size, len(parameters)), np.complex128)
    if poles.size:
        g[order], dg[order] = assembly.derivatives(
            ascending, parameters, response=coordinates[0], excitation=coordinates[1], threads=threads
        )
    count = poles.size * _CIRCLE
    around, slopes = g[:count].reshape(poles.size, _CIRCLE), dg[:count].reshape(poles.size, _CIRCLE, len(parameters))
    residue = np.mean(around * offset, axis=1)
    pole_slopes = np.mean(slopes * offset[:, :, None] ** 2, axis=1) / residue[:, None]
    size = np.abs(poles)
    # w_r = |w_r| (sqrt(1 - zeta^2) + i zeta), so ln w_r = ln |w_r| + i arcsin(zeta).
    relative = pole_slopes / poles[:, None]
    damping = poles.imag / size
    at_peak, at_peak_slopes = g[count:].reshape(-1, 2), dg[count:].reshape(poles.size, 2, len(parameters))
    stiffness = 1.0 / np.abs(at_peak.mean(axis=1))
    fixed_line = np.mean(at_peak_slopes / at_peak[:, :, None], axis=1).real
    along_lines = np.diff(np.log(np.abs(at_peak)), axis=1)[:, 0] / (2.0 * _STEP * poles.real)
    log_slopes = np.stack(
        [
            relative.real,
            relative.imag * (np.sqrt(1.0 - damping**2) / np.maximum(damping, 1e-300))[:, None],
            -(fixed_line + along_lines[:, None] * pole_slopes.real),
        ],
        axis=1,
    )
    return DampedModes(
        frequency_hz=size,
        damping_ratio=damping,
        dynamic_stiffness=stiffness,
        residue=residue * tau,
        log_slopes=log_slopes,
        missed=missed,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class ModeShapes(Result):
    """Shapes of the modes of an assembly, normalised to unit modal mass.

    Examples
    --------
    >>> from receptance import STEEL, Assembly, Part, Segment, mode_shapes
    >>> bar = Assembly([Part([Segment(length=0.1, outer_diameter=0.02, material=STEEL)], name="bar")])
    >>> shapes = mode_shapes(bar, 12e3)
    >>> f"{shapes.frequency_hz[0]:.0f} Hz, {shapes.y[0, 0].real:.2f} 1/kg^(1/2) at {shapes.distance[0]:.1f} m"
    '8389 Hz, 3.77 1/kg^(1/2) at 0.0 m'
    """

    heading: ClassVar[str] = "Mode shapes"
    plotted_by = "receptance.model.figure:draw_mode_shapes"
    assembly: Assembly = field(repr=False)
    frequency_hz: NDArray[np.float64]
    """`(k,)` natural frequencies."""
    damping_ratio: NDArray[np.float64] = field(repr=False)
    """`(k,)` as in `DampedModes`."""
    part: tuple[str, ...] = field(repr=False)
    """`(n,)` part of each point."""
    position: NDArray[np.float64] = field(repr=False)
    """`(n,)` distance in m from the tip-side end of the part. There are two points at a joint, one on each part."""
    distance: NDArray[np.float64] = field(repr=False)
    """`(n,)` distance in m from the tip of the assembly."""
    y: NDArray[np.complex128] = field(repr=False)
    """`(k, n)` complex deflection in 1/kg^(1/2). The receptance between two points is the sum of y_i y_j / (w_r^2 - w^2
    + 2 i zeta_r w_r w) over the modes. The largest deflection is close to the real axis and positive; imaginary parts
    are due to damping."""
    theta: NDArray[np.complex128] = field(repr=False)
    """`(k, n)` slope in rad/(m kg^(1/2))."""
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


def mode_shapes(assembly: Assembly, upper_hz: float, *, points: int = 101, threads: int | None = None) -> ModeShapes:
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

    Examples
    --------
    >>> from receptance import STEEL, Assembly, Part, Segment, mode_shapes
    >>> bar = Assembly([Part([Segment(length=0.1, outer_diameter=0.02, material=STEEL)], name="bar")])
    >>> mode_shapes(bar, 12e3, points=11).y.shape
    (1, 11)
    """
    _checks.whole_number("mode_shapes", "points", points, least=2)
    names, positions, distances = _points(assembly, points)
    modes = damped_modes(assembly, upper_hz, threads=threads)
    responses = [Coordinate(part, at, way) for way in ("y", "theta") for part, at in zip(names, positions, strict=True)]
    ends = _ends(names, positions)
    poles = modes.poles_hz
    order, lines, offset = _circles(poles)
    around = np.empty((lines.size, len(responses), len(ends)), np.complex128)
    if poles.size:
        receptance = assembly.receptance(lines, response=responses, excitation=ends, threads=threads)
        around[order] = receptance.reshape(around.shape)
    around = around.reshape(*offset.shape, len(responses), len(ends))
    residues = np.mean(around * offset[:, :, None, None], axis=1) * tau
    constants = -2.0 * tau * poles.real[:, None, None] * residues
    shapes = np.array(
        [_normalised(constant, responses, ends, len(names)) for constant in constants], dtype=np.complex128
    )
    y, theta = shapes.reshape(poles.size, 2, len(names)).transpose(1, 0, 2)
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
    lengths = {name: float(getattr(element, "length", 0.0)) for name, element in assembly.elements.items()}
    step = sum(lengths.values()) / (count - 1)
    names: list[str] = []
    positions: list[float] = []
    distances: list[float] = []
    start = 0.0
    for name, length in lengths.items():
        if name in assembly.parts:
            edges = np.array(edges_of(assembly.parts[name]))
            inside = np.linspace(0.0, length, max(int(np.ceil(length / step)), 1) + 1)
            # Points closer together than rounding would be one point.
            gap = np.abs(inside[:, None] - edges[None, :]).min(axis=1)
            along = np.sort(np.concatenate([edges, inside[gap > 1e-3 * step]]))
            names += [name] * along.size
            positions += along.tolist()
            distances += (start + along).tolist()
        start += length
    return names, positions, distances


def _ends(names: Sequence[str], positions: Sequence[float]) -> list[Coordinate]:
    """Return the ends of all parts."""
    places: dict[str, list[float]] = {}
    for name, at in zip(names, positions, strict=True):
        places.setdefault(name, []).append(at)
    return [Coordinate(name, at) for name, along in places.items() for at in (along[0], along[-1])]


def _normalised(
    constants: NDArray[np.complex128], responses: Sequence[Coordinate], ends: Sequence[Coordinate], count: int
) -> NDArray[np.complex128]:
    """Return a shape from the modal constants of responses (rows) and loads (columns)."""
    drives = np.array([constants[responses.index(end), column] for column, end in enumerate(ends)])
    column = int(np.abs(drives).argmax())
    shape = constants[:, column] / np.sqrt(drives[column])
    largest = shape[:count][np.abs(shape[:count]).argmax()]
    return np.asarray(shape if largest.real >= 0.0 else -shape)
