"""Tables of the core for an assembly, the entries that belong to its addresses, and their evaluation."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from math import tau
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np

from receptance import _checks, _core
from receptance.model.addresses import Element, interfaces_by_name, place_on, points_of
from receptance.model.beams import Part, Segment
from receptance.model.distributed import SpreadJoint
from receptance.model.joints import WIDTHS, ColletJoint, GroundSpring, MicroslipJoint, PointJoint, PointMass, Resonator
from receptance.model.terminals import ENTRIES, RESIDUALS, MeasuredPart, ModalPart, Mode, Terminal

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from receptance.model.assembly import Assembly
    from receptance.model.coordinates import Coordinate

__all__ = ["by_line", "complex_modes", "modes", "responses"]


SEGMENTS, JOINTS, MASSES, GROUNDS, OVERLAPS, TERMINALS, MODES, SLIPS = range(8)
"""Numbers of the tables in the core."""
_SPRING = len(PointJoint.columns_of)
Motion = Literal["bending", "axial"]
MOTIONS: dict[Motion, int] = {"bending": 0, "axial": 1}

Entry = tuple[int, int, int, float]
"""Table, row, column and rate: the derivative of the entry with respect to the parameter."""


class Tables(NamedTuple):
    """Tables of the core, read only; their columns are documented in `_core`."""

    segments: NDArray[np.float64]
    joints: NDArray[np.float64]
    masses: NDArray[np.float64]
    grounds: NDArray[np.float64]
    overlaps: NDArray[np.float64]
    terminals: NDArray[np.float64]
    modes: NDArray[np.float64]
    slips: NDArray[np.float64]

    def model(self, motion: int = 0) -> _core.Model:
        """Return the validated model of the core for a motion."""
        model = _core.Model(motion, *self[:5])
        if len(self.terminals):
            model = model.with_terminals(self.terminals, self.modes)
        return model.with_slips(self.slips) if len(self.slips) else model


_COLUMNS = {
    "segments": 2 + len(Segment.layout),
    **dict(zip(("joints", "masses", "grounds"), WIDTHS, strict=True)),
    "overlaps": 2 + len(SpreadJoint.layout),
    "terminals": 1 + len(RESIDUALS),
    "modes": 1 + len(Mode.layout),
    "slips": 1 + len(MicroslipJoint.amplitude_of),
}
"""Number of columns of each table: nodes or rows, then the columns of the element."""


@dataclass
class Flat:
    """Tables of an assembly that are being built, and the entries of each address.

    Attributes
    ----------
    tabled : list of (int, MeasuredPart)
        Rows of `terminals` that have a table of receptances.
    banded : list of ModalPart
        Modal parts, whose bands limit the frequency lines.
    titles : dict
        Name of the joint in each row of "joint" and "overlap", for messages.
    nodes : dict
        Node at each position of each part.
    points : dict
        Nodes and directions of coordinates that were requested before.
    """

    segments: list[list[float]] = field(default_factory=list)
    joints: list[list[float]] = field(default_factory=list)
    masses: list[list[float]] = field(default_factory=list)
    grounds: list[list[float]] = field(default_factory=list)
    overlaps: list[list[float]] = field(default_factory=list)
    slips: list[list[float]] = field(default_factory=list)
    terminals: list[list[float]] = field(default_factory=list)
    modes: list[list[float]] = field(default_factory=list)
    tabled: list[tuple[int, MeasuredPart]] = field(default_factory=list)
    banded: list[ModalPart] = field(default_factory=list)
    titles: dict[tuple[str, int], str] = field(default_factory=dict)
    entries: dict[str, list[Entry]] = field(default_factory=dict)
    nodes: dict[tuple[str, float], int] = field(default_factory=dict)
    points: dict[tuple[Coordinate, ...], NDArray[np.float64]] = field(default_factory=dict)
    count: int = 1
    _models: dict[int, _core.Model] = field(default_factory=dict, repr=False, compare=False)

    def model(self, motion: int = 0) -> _core.Model:
        """Return the model of the core for a motion; it is built and validated once."""
        if motion not in self._models:
            self._models[motion] = self.tables.model(motion)
        return self._models[motion]

    def __getstate__(self) -> dict[str, Any]:
        # Handles of the core cannot be pickled.
        return {**self.__dict__, "_models": {}}

    @cached_property
    def tables(self) -> Tables:
        """Tables of the core, read only because all calls share them."""
        each = {name: np.array(getattr(self, name), dtype=np.float64) for name in _COLUMNS}
        return Tables(**{name: constant(array.reshape(-1, _COLUMNS[name])) for name, array in each.items()})

    def new_node(self) -> int:
        """Return the number of a new node."""
        self.count += 1
        return self.count - 1


def constant(array: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the array, made read only."""
    array.flags.writeable = False
    return array


def flatten(
    elements: Mapping[str, Element],
    attachments: Mapping[str, PointMass | GroundSpring | Resonator],
    coordinates: tuple[Coordinate, ...],
) -> Flat:
    """Return the tables of an assembly, with a node at each coordinate and at each point of an attachment."""
    positions: dict[str, set[float]] = {}
    attached = []
    for coordinate in coordinates:
        part, x = place_on(elements, "coordinate", coordinate.part, coordinate.position)
        positions.setdefault(part, set()).add(x)
    for name, attachment in attachments.items():
        part, along = points_of(elements, name, attachment)
        positions.setdefault(part, set()).update(along)
        attached.append((name, attachment, part, along))
    flat = Flat()
    node = 0
    for name, element in elements.items():
        if isinstance(element, Part):
            node = _add_part(flat, name, element, node, sorted(positions.get(name, ())))
        elif isinstance(element, SpreadJoint):
            node = _add_spread(flat, name, element, node)
        elif isinstance(element, (MeasuredPart, ModalPart)):
            _add_terminal(flat, name, element, node)
        elif isinstance(element, ColletJoint):
            node = _add_collet(flat, name, element, node)
        else:
            node = _add_joint(flat, name, element, node)
    for name, attachment, part, along in attached:
        nodes = [flat.nodes[part, x] for x in along]
        if isinstance(attachment, Resonator):
            _add_resonator(flat, name, attachment, nodes[0])
        else:
            _add_attachment(flat, name, attachment, nodes)
    return flat


def _add_joint(flat: Flat, name: str, joint: PointJoint | MicroslipJoint, node: int) -> int:
    far = flat.new_node()
    row = len(flat.joints)
    flat.titles["joint", row] = name
    flat.joints.append([float(node), float(far), *joint.columns()[:_SPRING]])
    for i, quantity in enumerate(joint.columns_of[:_SPRING]):
        flat.entries[f"{name}.{quantity}"] = [(JOINTS, row, 2 + i, 1.0)]
    if isinstance(joint, MicroslipJoint):
        for i, quantity in enumerate(joint.amplitude_of):
            flat.entries[f"{name}.{quantity}"] = [(SLIPS, len(flat.slips), 1 + i, 1.0)]
        flat.slips.append([float(row), *(getattr(joint, quantity) for quantity in joint.amplitude_of)])
    return far


def _add_collet(flat: Flat, name: str, joint: ColletJoint, node: int) -> int:
    middle = _add_joint(flat, f"{name}.inner", joint.inner, node)
    for i, quantity in enumerate(joint.columns_of):
        flat.entries[f"{name}.{quantity}"] = [(MASSES, len(flat.masses), 1 + i, 1.0)]
    flat.masses.append([float(middle), joint.mass, joint.inertia])
    return _add_joint(flat, f"{name}.outer", joint.outer, middle)


def _add_spread(flat: Flat, name: str, joint: SpreadJoint, node: int) -> int:
    far = flat.new_node()
    row = len(flat.overlaps)
    flat.titles["overlap", row] = name
    flat.overlaps.append([float(node), float(far), *joint.columns()])
    for address, column in joint.places().items():
        flat.entries[f"{name}.{address}"] = [(OVERLAPS, row, 2 + column, 1.0)]
    return far


def _add_terminal(flat: Flat, name: str, terminal: Terminal, node: int) -> None:
    row = len(flat.terminals)
    flat.terminals.append([float(node), *(getattr(terminal, quantity) for quantity in RESIDUALS)])
    if isinstance(terminal, MeasuredPart):
        flat.tabled.append((row, terminal))
    if isinstance(terminal, ModalPart):
        flat.banded.append(terminal)
        for index, mode in enumerate(terminal.modes):
            for i, quantity in enumerate(mode.columns_of):
                rate = tau if quantity == "frequency_hz" else 1.0
                flat.entries[f"{name}.mode[{index}].{quantity}"] = [(MODES, len(flat.modes), 1 + i, rate)]
            flat.modes.append([float(row), *mode.columns()])
    for i, quantity in enumerate(RESIDUALS):
        flat.entries[f"{name}.{quantity}"] = [(TERMINALS, row, 1 + i, 1.0)]


def _add_attachment(flat: Flat, name: str, attachment: PointMass | GroundSpring, nodes: list[int]) -> None:
    """Add a point element; several nodes share its values."""
    table = MASSES if isinstance(attachment, PointMass) else GROUNDS
    rows = flat.masses if table == MASSES else flat.grounds
    for i, quantity in enumerate(attachment.columns_of):
        # The loss factor is the same for every share.
        shares = (1.0,) * len(nodes) if quantity == "loss_factor" else attachment.shares
        flat.entries[f"{name}.{quantity}"] = [(table, len(rows) + n, 1 + i, share) for n, share in enumerate(shares)]
    for node, share in zip(nodes, attachment.shares, strict=True):
        columns = zip(attachment.columns_of, attachment.columns(), strict=True)
        rows.append([float(node), *(value if name == "loss_factor" else value * share for name, value in columns)])


def _add_resonator(flat: Flat, name: str, resonator: Resonator, node: int) -> None:
    """Add a joint to a new node, and the mass at that node."""
    # The mass has no moment of inertia, so the rotational stiffness transmits no moment; its value is arbitrary.
    joint = PointJoint(k_y=resonator.k_y, k_theta=1.0, c_y=resonator.c_y)
    row, far = len(flat.joints), flat.new_node()
    flat.titles["joint", row] = name
    flat.joints.append([float(node), float(far), *joint.columns()])
    for quantity in ("k_y", "c_y"):
        flat.entries[f"{name}.{quantity}"] = [(JOINTS, row, 2 + PointJoint.columns_of.index(quantity), 1.0)]
    flat.entries[f"{name}.mass"] = [(MASSES, len(flat.masses), 1, 1.0)]
    flat.masses.append([float(far), resonator.mass, 0.0])


def _add_part(flat: Flat, name: str, part: Part, node: int, positions: list[float]) -> int:
    """Add the segments of a part; a segment is split at the positions inside it."""
    start = 0.0
    flat.nodes[name, start] = node
    pieces: list[list[int]] = []
    for segment in part.segments:
        end = start + segment.length
        inside = [x for x in positions if start < x < end]
        cuts = [start, *inside, end]
        columns = list(segment.columns())
        pieces.append([])
        for left, right in pairwise(cuts):
            far = flat.new_node()
            pieces[-1].append(len(flat.segments))
            # The length of a segment that is not split is not rounded.
            columns[0] = right - left if inside else segment.length
            flat.segments.append([float(node), float(far), *columns])
            flat.nodes[name, right] = node = far
        start = end
    for i, segment in enumerate(part.segments):
        for address, place in segment.places().items():
            column = 2 + place
            entries = [(SEGMENTS, row, column, 1.0) for row in pieces[i]]
            if address == "length":
                # Positions are measured from the start of the part, so the cuts do not move: the last piece of this
                # segment grows, and in each later segment the first piece shrinks and the last one grows.
                entries = [(SEGMENTS, pieces[i][-1], column, 1.0)]
                for later in pieces[i + 1 :]:
                    if len(later) > 1:
                        entries += [(SEGMENTS, later[0], column, -1.0), (SEGMENTS, later[-1], column, 1.0)]
            flat.entries[f"{name}.segment[{i}].{address}"] = entries
    return node


def rows_of(elements: Mapping[str, Element], flat: Flat, side: tuple[Coordinate, ...]) -> NDArray[np.float64]:
    """Return node and direction of coordinates, `(n, 2)`; the result is kept in `flat.points`."""
    if side not in flat.points:
        nodes = [flat.nodes[place_on(elements, "coordinate", point.part, point.position)] for point in side]
        rows = [(node, point.direction == "theta") for node, point in zip(nodes, side, strict=True)]
        flat.points[side] = constant(np.array(rows, float))
    return flat.points[side]


def distinct(
    entries: Sequence[Sequence[Entry]],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the distinct table entries `(k, 3)` of addresses, and the matrix `(k, m)` of their rates."""
    found: dict[tuple[int, int, int], int] = {}
    weights = []
    for column, own in enumerate(entries):
        for table, row, place, weight in own:
            weights.append((found.setdefault((table, row, place), len(found)), column, weight))
    matrix = np.zeros((len(found), len(entries)))
    for index, column, weight in weights:
        matrix[index, column] += weight
    return np.array(list(found), dtype=np.float64).reshape(-1, 3), matrix


class Tied(NamedTuple):
    """A model of the core as a function of addresses, for fits and sweeps that run in the core.

    Attributes
    ----------
    flat : Flat
        The tables of the assembly.
    motion : int
        The core's number of the motion.
    rates : ndarray
        `(k, 5)` table, row, column, number of the address, and derivative of the entry.
    present : ndarray
        `(m,)` value of each address in the assembly; zero for addresses of observations, which are in no table.
    points : ndarray
        `(n, 2)` node and direction of the coordinates.
    """

    flat: Flat
    motion: int
    rates: NDArray[np.float64]
    present: NDArray[np.float64]
    points: NDArray[np.float64]

    def model(self, addresses: NDArray[np.float64], factors: NDArray[np.float64]) -> _core.TiedModel:
        """Return the model as a function of unknowns; `addresses` and `factors` are those of `_core.Model.tied`."""
        with interfaces_by_name(self.flat):
            return self.flat.model(self.motion).tied(self.rates, self.present, addresses, factors)

    @property
    def key(self) -> tuple[bytes, ...]:
        """Key that equal models share."""
        tables = [array for _, part in self.flat.tabled for array in (part.frequency_hz, part.matrix)]
        arrays = (*self.flat.tables, self.rates, self.present, self.points, *tables)
        return (bytes([self.motion]), *(array.tobytes() for array in arrays))


def tie(
    assembly: Assembly,
    addresses: Sequence[str],
    points: tuple[Coordinate, ...] = (),
    *,
    others: Collection[str] = (),
) -> Tied:
    """Return the model of an assembly as a function of addresses.

    Parameters
    ----------
    assembly : Assembly
        The assembly.
    addresses : sequence of str
        Addresses of the assembly and of observations.
    points : tuple of Coordinate, optional
        Coordinates of responses and excitations.
    others : collection of str, optional
        The addresses of observations, which are in no table.
    """
    flat = assembly._flatten(points)
    rates = [
        (*entry[:3], index, entry[3])
        for index, address in enumerate(addresses)
        if address not in others
        for entry in assembly._entries(address, flat)
    ]
    present = [0.0 if address in others else assembly.get(address) for address in addresses]
    return Tied(
        flat=flat,
        motion=MOTIONS[assembly.motion],
        rates=np.array(rates, dtype=np.float64).reshape(-1, 5),
        present=np.array(present, dtype=np.float64),
        points=assembly._points(flat, points),
    )


def by_line(flat: Flat, lines: NDArray[Any], force: NDArray[np.float64] | None = None) -> _core.ByLine | None:
    """Return the properties of a model that depend on the line, or None.

    These are the tables of measured parts and the amplitudes of the force, on checked lines in Hz.

    Raises
    ------
    ValueError
        A line outside the table of a measured part or the band of a modal part; a force on a joint in micro-slip
        without reference amplitudes.
    """
    for modal in flat.banded:
        modal.check_band(lines)
    if force is None or not flat.slips:
        force = None
    else:
        _check_references(flat)
    if not flat.tabled:
        return None if force is None else _core.ByLine(force=force)
    beyond = np.zeros((lines.size, len(flat.terminals), len(ENTRIES)), dtype=np.complex128)
    for row, measured in flat.tabled:
        beyond[:, row] = measured.table_entries(lines)
    return _core.ByLine(beyond.reshape(-1), force)


def _check_references(flat: Flat) -> None:
    for joint, slip_y, slip_theta, _, _, reference_y, reference_theta in flat.slips:
        for direction, slip, reference in (("y", slip_y, reference_y), ("theta", slip_theta, reference_theta)):
            if slip > 0.0 and reference == 0.0:
                name = flat.titles["joint", int(joint)]
                raise ValueError(
                    f"{name}.reference_{direction} is zero, expected the amplitude at level 1, which a force requires"
                )


def _force_amplitudes(force: ArrayLike | None, lines: NDArray[Any], excitations: int) -> NDArray[np.float64] | None:
    """Return the amplitudes of the force in N on each line, or None.

    Raises
    ------
    ValueError
        Forces that are not positive numbers, a wrong number of forces, several excitations, or complex lines.
    """
    if force is None:
        return None
    array = _checks.unmasked("", "force", force)
    if array.dtype.kind not in "iuf":
        raise TypeError(f"force has dtype {array.dtype}, expected real numbers in N")
    if array.shape not in ((), lines.shape):
        raise ValueError(f"force has shape {array.shape}, expected one number or {lines.shape}")
    if excitations != 1:
        raise ValueError(f"force needs exactly one excitation, and there are {excitations}")
    if np.any(lines.imag):
        raise ValueError("frequency_hz is complex, expected real lines for a stepped sine of given force")
    for value in array.reshape(-1)[~(array.reshape(-1) > 0.0) | ~np.isfinite(array.reshape(-1))]:
        _checks.positive("receptance", "force", value, unit="N")
    return np.ascontiguousarray(np.broadcast_to(array.astype(np.float64), lines.shape))


def responses(
    flat: Flat,
    lines: NDArray[Any],
    points: list[NDArray[np.float64]],
    rows: NDArray[np.float64],
    threads: int,
    force: ArrayLike | None,
    motion: int = 0,
) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Return receptances `(n, r, e)` and their derivatives `(n, r, e, m)` with respect to table entries.

    `lines` are checked lines in Hz, real or complex; the core scales them without a copy.
    """
    properties = by_line(flat, lines, _force_amplitudes(force, lines, len(points[1])))
    with interfaces_by_name(flat):
        return flat.model(motion).receptance(_core.Lines(lines, tau), points[1], points[0], rows, threads, properties)


def modes(
    flat: Flat, upper: float | None, most: int, rows: NDArray[np.float64], motion: int = 0
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the lowest natural angular frequencies, at most `most` and up to `upper`, and derivatives `(n, m)`.

    Joints in micro-slip have their stated levels.
    """
    if flat.terminals:
        raise ValueError(
            "natural frequencies are not available for an assembly with a MeasuredPart or a ModalPart; use the peaks "
            "of a receptance"
        )
    with interfaces_by_name(flat):
        return flat.model(motion).natural_frequencies(upper, most, rows)


def complex_modes(
    flat: Flat, undamped: NDArray[np.float64], rows: NDArray[np.float64], motion: int = 0
) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Return the complex natural angular frequencies that undamped ones become, and derivatives `(n, m)`.

    Joints in micro-slip are at their stated levels.
    """
    with interfaces_by_name(flat):
        return flat.model(motion).complex_frequencies(undamped, rows)
