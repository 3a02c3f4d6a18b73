"""The tables of the core for a chain of elements, with the entries behind each address."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from math import tau
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from receptance import _checks, _core
from receptance.errors import GrossSlipError, SingularInterfaceError
from receptance.model.addresses import Attachment, ChainElement, place_on, points_of
from receptance.model.beams import Part, Segment, SpreadJoint
from receptance.model.coordinates import Coordinate
from receptance.model.joints import ColletJoint, GroundSpring, MicroslipJoint, PointJoint, PointMass, Resonator
from receptance.model.sections import Factors, Plane
from receptance.model.terminals import ENTRIES, RESIDUALS, MeasuredPart, ModalPart, Mode
from receptance.units import LOSS_FACTOR

Motion = Literal["bending", "axial", "torsion"]
MOTIONS: dict[Motion, int] = {"bending": 0, "axial": 1, "torsion": 2}

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


_SEGMENTS = Tables._fields.index("segments")
_END_OF = {"outer_diameter": "end_outer_diameter", "inner_diameter": "end_inner_diameter"}
"""The diameters at the far end of a cone, by those at its near end."""
_PLACES = {column.address: 2 + index for index, column in enumerate(Segment.layout) if column.address}
"""Columns of a segment's row by address."""
_DIAMETERS = {*_END_OF, *_END_OF.values()}
_UNIFORM = _PLACES["end_outer_diameter"] - 2
"""Number of columns of a circular cylinder, without nodes."""
_WHOLE = (0.0, 1.0)
"""Ends of a segment that is not divided, as shares of its length."""
_COLUMNS = {
    "segments": 2 + len(Segment.layout) + len(Factors._fields),
    "joints": 2 + len(PointJoint.layout),
    "masses": 1 + len(PointMass.layout),
    "grounds": 1 + len(GroundSpring.layout),
    "overlaps": 2 + len(SpreadJoint.layout),
    "terminals": 1 + len(RESIDUALS),
    "modes": 1 + len(Mode.layout),
    "slips": 1 + len(MicroslipJoint.amplitude_of),
}
"""Number of columns of each table: nodes or rows, then the columns of the element."""


@dataclass
class Flat:
    """Tables of an assembly that are being built, and the entries of each address."""

    motion: int
    """The core's number of the motion."""
    rows: dict[str, list[list[float]]] = field(default_factory=lambda: {name: [] for name in Tables._fields})
    """Rows of each table of `Tables`."""
    positions: dict[str, list[float]] = field(default_factory=dict)
    """Positions along each part at which a node is needed, ascending."""
    tabled: list[tuple[int, MeasuredPart]] = field(default_factory=list)
    """Rows of `terminals` that have a table of receptances."""
    banded: list[ModalPart] = field(default_factory=list)
    """Modal parts, whose bands limit the frequency lines."""
    titles: dict[tuple[str, int], str] = field(default_factory=dict)
    """Name of the joint in each row of "joint" and "overlap", for messages."""
    entries: dict[str, list[Entry]] = field(default_factory=dict)
    """Table entries of each parameter by address."""
    values: dict[str, float] = field(default_factory=dict)
    """Value of each parameter by address."""
    nodes: dict[tuple[str, float], int] = field(default_factory=dict)
    """Node at each position of each part."""
    points: dict[tuple[Coordinate, ...], NDArray[np.float64]] = field(default_factory=dict)
    """Nodes and directions of coordinates that were requested before."""
    count: int = 1

    @cached_property
    def model(self) -> _core.Model:
        """Model of the core; it is built and validated once."""
        return self.tables.model(self.motion)

    def __getstate__(self) -> dict[str, Any]:
        # Handles of the core cannot be pickled.
        return {name: value for name, value in self.__dict__.items() if name != "model"}

    @cached_property
    def tables(self) -> Tables:
        """Tables of the core, read only because all calls share them."""
        segments = self.rows["segments"]
        # The rows of circular cylinders are shorter, which stay so where there are no others.
        columns = max(map(len, segments), default=_COLUMNS["segments"])
        if columns > min(map(len, segments), default=columns):
            segments = [row + [0.0] * (columns - len(row)) for row in segments]
        arrays = [constant(np.array(rows, dtype=np.float64).reshape(-1, _COLUMNS[name]))
                  for name, rows in self.rows.items() if name != "segments"]  # fmt: skip
        return Tables(constant(np.array(segments, dtype=np.float64).reshape(-1, columns)), *arrays)

    def add(
        self,
        table: str,
        nodes: Sequence[int],
        values: Sequence[float],
        columns: Mapping[str, int] | None = None,
        rates: Sequence[float] | None = None,
    ) -> int:
        """Add a row to a table of `Tables` and return its number.

        The row has nodes, or the row of another table, then the values of an element. `columns` are the addresses of
        parameters with their numbers in the values, `rates` factors from these values to those in the table, by default
        1.
        """
        rows, number = self.rows[table], Tables._fields.index(table)
        for address, column in (columns or {}).items():
            rate = 1.0 if rates is None else rates[column]
            self.entries.setdefault(address, []).append((number, len(rows), len(nodes) + column, rate))
            self.values[address] = values[column]
        if rates is not None:
            values = [value * rate for value, rate in zip(values, rates, strict=True)]
        rows.append([*nodes, *values])
        return len(rows) - 1

    def new_node(self) -> int:
        """Return the number of a new node."""
        self.count += 1
        return self.count - 1

    def by_line(self, lines: NDArray[np.inexact], force: NDArray[np.float64] | None = None) -> _core.ByLine | None:
        """Return the properties of the model that depend on the line, or None.

        These are the tables of measured parts and the amplitudes of the force, on checked lines in Hz. A line outside a
        table or the band of a modal part is a ValueError, and so is a force on a joint in micro-slip without reference
        amplitudes.
        """
        for modal in self.banded:
            modal.check_band(lines)
        if not self.rows["slips"]:
            force = None
        elif force is not None:
            self._check_references()
        if not self.tabled:
            return None if force is None else _core.ByLine(force=force)
        beyond = np.zeros((lines.size, len(self.rows["terminals"]), len(ENTRIES)), dtype=np.complex128)
        for row, measured in self.tabled:
            beyond[:, row] = measured.table_entries(lines)
        return _core.ByLine(beyond.reshape(-1), force)

    def _check_references(self) -> None:
        for joint, slip_y, slip_theta, _, _, reference_y, reference_theta in self.rows["slips"]:
            for direction, slip, reference in (("y", slip_y, reference_y), ("theta", slip_theta, reference_theta)):
                if slip > 0.0 and reference == 0.0:
                    name = self.titles["joint", int(joint)]
                    raise ValueError(
                        f"{name}.reference_{direction} is zero, expected the amplitude at level 1, which a force "
                        "requires"
                    )

    @contextmanager
    def joints_by_name(self) -> Iterator[None]:
        """Replace the row of a joint in errors of the core by its name."""
        try:
            yield
        except (SingularInterfaceError, GrossSlipError) as error:
            raise type(error)(self.with_joint_name(str(error))) from None

    def with_joint_name(self, text: str) -> str:
        """Return an error of the core with the name of the joint instead of its row."""
        pattern = r"^(joint|overlap) (\d+)"
        return re.sub(pattern, lambda match: f"joint {self.titles[match[1], int(match[2])]!r}", text)


def constant(array: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the array, made read only."""
    array.flags.writeable = False
    return array


def flatten(
    elements: Mapping[str, ChainElement],
    attachments: Mapping[str, Attachment],
    coordinates: tuple[Coordinate, ...],
    motion: Motion,
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
    flat = Flat(MOTIONS[motion], positions={part: sorted(along) for part, along in positions.items()})
    node = 0
    for name, element in elements.items():
        node = _add_element(flat, name, element, node)
    for name, attachment, part, along in attached:
        _add_attachment(flat, name, attachment, [flat.nodes[part, x] for x in along])
    return flat


def _add_element(flat: Flat, name: str, element: ChainElement, node: int) -> int:
    """Add the rows of an element of the chain that begins at a node, and return the node at which it ends."""
    match element:
        case Part():
            return _add_part(flat, name, element, node)
        case SpreadJoint():
            far = flat.new_node()
            columns = {f"{name}.{address}": column for address, column in element.places.items()}
            flat.titles["overlap", flat.add("overlaps", (node, far), element.columns, columns)] = name
            return far
        case ColletJoint():
            middle = _add_spring(flat, f"{name}.inner", element.inner, node)
            flat.add("masses", (middle,), (element.mass, element.inertia), _columns(name, element.columns_of))
            return _add_spring(flat, f"{name}.outer", element.outer, middle)
        case MicroslipJoint():
            joint, far = len(flat.rows["joints"]), _add_spring(flat, name, element, node)
            values = [getattr(element, quantity) for quantity in element.amplitude_of]
            flat.add("slips", (joint,), values, _columns(name, element.amplitude_of))
            return far
        case PointJoint():
            return _add_spring(flat, name, element, node)
    row = len(flat.rows["terminals"])
    if isinstance(element, MeasuredPart):
        flat.tabled.append((row, element))
    else:
        flat.banded.append(element)
        rates = [tau if quantity == "frequency_hz" else 1.0 for quantity in Mode.columns_of]
        for index, mode in enumerate(element.modes):
            values = [getattr(mode, quantity) for quantity in Mode.columns_of]
            flat.add("modes", (row,), values, _columns(f"{name}.mode[{index}]", Mode.columns_of), rates)
    flat.add("terminals", (node,), [getattr(element, quantity) for quantity in RESIDUALS], _columns(name, RESIDUALS))
    return node


def _add_attachment(flat: Flat, name: str, attachment: Attachment, nodes: Sequence[int]) -> None:
    """Add the rows of an attachment that acts at some nodes."""
    columns = _columns(name, attachment.columns_of)
    match attachment:
        case PointMass():
            flat.add("masses", nodes, attachment.columns, columns)
        case GroundSpring():
            # Each point has its share of the spring; the loss factor is that of the whole.
            for node, share in zip(nodes, attachment.shares, strict=True):
                rates = [1.0 if quantity is LOSS_FACTOR else share for quantity in attachment.quantities.values()]
                flat.add("grounds", (node,), attachment.columns, columns, rates)
        case Resonator():
            # The mass has no moment of inertia, so the rotational stiffness is arbitrary: it transmits no moment.
            spring = PointJoint(k_y=attachment.k_y, k_theta=1.0, c_y=attachment.c_y)
            far = flat.new_node()
            columns = {f"{name}.{quantity}": PointJoint.columns_of.index(quantity) for quantity in ("k_y", "c_y")}
            flat.titles["joint", flat.add("joints", (*nodes, far), spring.columns, columns)] = name
            flat.add("masses", (far,), (attachment.mass, 0.0), {f"{name}.mass": 0})


def _columns(name: str, quantities: Iterable[str]) -> dict[str, int]:
    """Return the numbers of parameters by address."""
    return {f"{name}.{quantity}": number for number, quantity in enumerate(quantities)}


def _add_spring(flat: Flat, name: str, joint: PointJoint | MicroslipJoint, node: int) -> int:
    far = flat.new_node()
    columns = _columns(name, PointJoint.columns_of)
    flat.titles["joint", flat.add("joints", (node, far), joint.columns[: len(columns)], columns)] = name
    return far


def _add_part(flat: Flat, name: str, part: Part, node: int) -> int:
    """Add the rows of the segments; a segment is split at the positions inside it."""
    # In torsion the rotary inertia is half the polar one: the mean of both planes.
    plane: Plane = "mean" if flat.motion == MOTIONS["torsion"] else "y"
    start = 0.0
    flat.nodes[name, start] = node
    pieces: list[_Pieces] = []
    positions = flat.positions.get(name, ())
    for segment in part.segments:
        end = start + segment.length
        inside = [x for x in positions if start < x < end]
        conical = segment.is_conical
        if not inside and not conical and segment.shape is None:
            # The common case, without what divided segments need; the length is not rounded.
            far = flat.new_node()
            row = flat.add("segments", (node, far), segment.columns[:_UNIFORM])
            pieces.append(_Pieces(segment, conical, [row], _WHOLE))
            flat.nodes[name, end] = node = far
            start = end
            continue
        cuts = [start, *inside, end]
        shares = [(x - start) / segment.length for x in cuts[:-1]] + [1.0] if inside else _WHOLE
        piece = _Pieces(segment, conical, [], shares)
        pieces.append(piece)
        for number, (left, right) in enumerate(pairwise(cuts)):
            far = flat.new_node()
            length = right - left if inside else segment.length
            piece.rows.append(flat.add("segments", (node, far), piece.columns(number, length, plane)))
            flat.nodes[name, right] = node = far
        start = end
    shifted = [(number, piece.entries_of_start()) for number, piece in enumerate(pieces) if len(piece.rows) > 1]
    for i, (segment, conical, rows, _) in enumerate(pieces):
        numbers = segment.columns
        for address, column in segment.places.items():
            parameter = f"{name}.segment[{i}].{address}"
            if conical:
                entries = pieces[i].entries(address)
            else:
                # A longer cylinder has a longer last piece; everything else changes all pieces.
                changed = rows[-1:] if address == "length" else rows
                entries = [(_SEGMENTS, row, 2 + column, 1.0) for row in changed]
            if address == "length" and shifted:
                # Positions are measured from the start of the part, so the cuts do not move: the last piece of this
                # segment grows, and in each later segment the first piece shrinks and the last one grows.
                for number, later in shifted:
                    if number > i:
                        entries += later
            flat.entries[parameter], flat.values[parameter] = entries, numbers[column]
    return node


class _Pieces(NamedTuple):
    """The rows of a segment that is split at some places."""

    segment: Segment
    conical: bool
    rows: list[int]
    """Row of each piece in the table of segments."""
    shares: Sequence[float]
    """Ends of the pieces as shares of the length, from 0 to 1."""

    def columns(self, number: int, length: float, plane: Plane) -> list[float]:
        """Return the columns of a piece, without nodes."""
        segment = self.segment
        if segment.shape is None and not self.conical:
            return [length, *segment.columns[1:_UNIFORM]]
        columns = [length, *segment.columns[1:]]
        columns += segment.shape_columns(plane)
        if self.conical:
            for shift, share in enumerate(self.shares[number : number + 2]):
                diameters = segment.at(share)
                for (near, far), diameter in zip(_END_OF.items(), diameters, strict=True):
                    columns[_PLACES[(near, far)[shift]] - 2] = diameter
        return columns

    def entries(self, address: str) -> list[Entry]:
        """Return the entries of the table that a parameter of a cone changes, the cuts staying in place."""
        column = _PLACES[address]
        if address == "length":
            # A cut lies at a smaller share of a longer segment.
            moved = self._moved([-share / self.segment.length for share in self.shares[:-1]] + [0.0])
            return [(_SEGMENTS, self.rows[-1], column, 1.0), *moved]
        if address not in _DIAMETERS:
            return [(_SEGMENTS, row, column, 1.0) for row in self.rows]
        near = address if address in _END_OF else next(key for key, end in _END_OF.items() if end == address)
        # The diameter at each cut is (1 - share) that of the near end + share that of the far end; where no diameter is
        # stated for the far end, both are one parameter.
        uniform = getattr(self.segment, _END_OF[near]) is None
        weights = [1.0 if uniform else 1.0 - share if address == near else share for share in self.shares]
        return self._at_cuts(near, weights)

    def entries_of_start(self) -> list[Entry]:
        """Return the entries that a shift of the start of the split segment changes, its cuts being fixed."""
        column = _PLACES["length"]
        entries: list[Entry] = [(_SEGMENTS, self.rows[0], column, -1.0), (_SEGMENTS, self.rows[-1], column, 1.0)]
        if self.conical:
            entries += self._moved([0.0, *[-1.0 / self.segment.length] * (len(self.shares) - 2), 0.0])
        return entries

    def _moved(self, rates: Sequence[float]) -> list[Entry]:
        """Return the entries of the diameters at cuts of a cone whose shares change at some rates."""
        entries = []
        for near, start, end in zip(_END_OF, *self.segment.ends, strict=True):
            entries += self._at_cuts(near, [rate * (end - start) for rate in rates])
        return entries

    def _at_cuts(self, near: str, weights: Sequence[float]) -> list[Entry]:
        """Return the entries of a diameter at the ends of all pieces, of those weights that are not zero."""
        entries = []
        for row, ends in zip(self.rows, pairwise(weights), strict=True):
            for address, weight in zip((near, _END_OF[near]), ends, strict=True):
                if weight != 0.0:
                    entries.append((_SEGMENTS, row, _PLACES[address], weight))
        return entries


def rows_of(elements: Mapping[str, ChainElement], flat: Flat, side: tuple[Coordinate, ...]) -> NDArray[np.float64]:
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
    numbers: dict[tuple[int, int, int], int] = {}
    weights = []
    for address, address_entries in enumerate(entries):
        for table, row, column, weight in address_entries:
            weights.append((numbers.setdefault((table, row, column), len(numbers)), address, weight))
    matrix = np.zeros((len(numbers), len(entries)))
    for number, address, weight in weights:
        matrix[number, address] += weight
    return np.array(list(numbers), dtype=np.float64).reshape(-1, 3), matrix


@dataclass(frozen=True, eq=False)
class Tied:
    """A model of the core as a function of addresses, for fits and sweeps that run in the core.

    `names` are the parameters of each address, all of one value; none for an address of an observation, which is in no
    table. `points` are node and direction of the coordinates, `(n, 2)`.
    """

    flat: Flat
    names: list[list[str]]
    points: NDArray[np.float64]

    def model(self, addresses: NDArray[np.float64], factors: NDArray[np.float64]) -> _core.TiedModel:
        """Return the model as a function of unknowns; `addresses` and `factors` are those of `_core.Model.tied`."""
        present = np.array([self.flat.values[name[0]] if name else 0.0 for name in self.names], dtype=np.float64)
        with self.flat.joints_by_name():
            return self.flat.model.tied(self._rates, present, addresses, factors)

    @cached_property
    def _rates(self) -> NDArray[np.float64]:
        """`(k, 5)` table, row, column, number of the address, and derivative of the entry."""
        numbered = [(index, name) for index, parameters in enumerate(self.names) for name in parameters]
        rates = [(*entry[:3], index, entry[3]) for index, name in numbered for entry in self.flat.entries[name]]
        return np.array(rates, dtype=np.float64).reshape(-1, 5)


def force_amplitudes(force: ArrayLike, lines: NDArray[np.inexact], excitations: int) -> NDArray[np.float64]:
    """Return the amplitudes `(n,)` of the force in N; raise unless they are positive, with one load and real lines."""
    if excitations != 1:
        raise ValueError(f"force needs exactly one excitation, and there are {excitations}")
    if np.any(lines.imag):
        raise ValueError("frequency_hz is complex, expected real lines for a stepped sine of given force")
    return _checks.by_line("receptance", "force", force, lines.shape)
