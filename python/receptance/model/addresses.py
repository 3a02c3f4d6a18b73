"""Addresses of parameters and positions along parts, and the tables of the core with the entries behind them."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from receptance import _checks, _core
from receptance.errors import GrossSlipError, SingularInterfaceError
from receptance.model.beams import Material, Part, Segment, SpreadJoint
from receptance.model.joints import WIDTHS, ColletJoint, GroundSpring, MicroslipJoint, PointJoint, PointMass, Resonator
from receptance.model.terminals import ENTRIES, RESIDUALS, MeasuredPart, ModalPart, Mode

if TYPE_CHECKING:
    from receptance.model.assembly import Assembly
    from receptance.model.coordinates import Coordinate

ChainElement = Part | PointJoint | SpreadJoint | ColletJoint | MicroslipJoint | MeasuredPart | ModalPart
Attachment = PointMass | GroundSpring | Resonator
QUANTITIES = {
    name: quantity
    for element in (
        PointJoint,
        MicroslipJoint,
        SpreadJoint,
        ColletJoint,
        Segment,
        Material,
        PointMass,
        Mode,
        ModalPart,
    )
    for name, quantity in element.quantities.items()
}
"""Quantities of parameters by the last word of their addresses; ground springs and resonators add no names."""
_SEGMENT = re.compile(r"segment\[(\d+|\*)\]\.((?:core\.)?\w+)")


def check_chain(elements: Sequence[Any], points: Sequence[Any], motion: str) -> None:
    """Raise if the elements are not a chain from the tip to the far end, or a point is not a point element."""
    for index, element in enumerate(elements):
        if not isinstance(element, ChainElement):
            *kinds, last = (kind.__name__ for kind in get_args(ChainElement)[1:])
            raise TypeError(
                f"Assembly: chain[{index}] is {element!r}, expected a Part or one of {', '.join(kinds)} and {last}"
            )
        if element.role == "spindle" and index != len(elements) - 1:
            raise ValueError(
                f"Assembly: chain[{index}] is a {type(element).__name__}, which is known at one plane only; it must "
                "be the last element"
            )
        if motion != "bending" and not isinstance(element, (Part, PointJoint)):
            raise ValueError(f"Assembly: chain[{index}] is a {type(element).__name__}, which supports bending only")
        if isinstance(element, PointJoint):
            element.check_motion(motion)
    for index, point in enumerate(points):
        if not isinstance(point, Attachment):
            raise TypeError(
                f"Assembly: attachments[{index}] is {point!r}, expected a PointMass, a GroundSpring or a Resonator"
            )
    roles = [element.role for element in elements]
    if not roles or roles[0] != "part" or roles[-1] == "joint":
        raise ValueError(
            "Assembly: the chain must begin and end with a Part, or end with a MeasuredPart or a ModalPart"
        )
    for index in range(1, len(elements)):
        if roles[index - 1] == roles[index] == "joint":
            raise ValueError(
                f"Assembly: chain[{index - 1}] and chain[{index}] are both joints, expected a part between them; "
                "combine springs in series into one PointJoint or a ColletJoint"
            )


def segment_fields(address: str, part: Part, rest: str) -> list[tuple[int, str]]:
    """Return the (segment, field) pairs of an address in a part."""
    match = _SEGMENT.fullmatch(rest)
    count = len(part.segments)
    if match is None:
        raise ValueError(
            f"there is no parameter {address!r}; a part has parameters such as segment[0].length or segment[*].density"
        )
    number, name = match.groups()
    indices = range(count) if number == "*" else [int(number)]
    if indices[0] >= count:
        raise ValueError(f"there is no parameter {address!r}: the part has {count} segment(s), counted from 0")
    known = [column.address for column in Segment.layout if column.address]
    if name not in known:
        raise ValueError(f"there is no parameter {address!r}; a segment has {', '.join(known)}")
    pairs = [(i, name) for i in indices if name in part.segments[i].places]
    if not pairs:
        raise ValueError(f"there is no parameter {address!r}: the segment has no core")
    return pairs


def names_of(elements: Sequence[Any]) -> list[str]:
    """Return the names of elements, with default names for unnamed ones; raise for names that are no words or equal."""
    roles = [element.role for element in elements if not element.name]
    names: list[str] = []
    counts: dict[str, int] = {}
    for element in elements:
        name = element.name
        if not name:
            index = counts.setdefault(element.role, 0)
            counts[element.role] += 1
            name = element.role if roles.count(element.role) == 1 else f"{element.role}_{index}"
        if re.fullmatch(r"[^\W\d]\w*", name) is None:
            raise ValueError(f"Assembly: the name {name!r} must be one word of letters, digits and underscores")
        if name in names:
            raise ValueError(f"Assembly: the name {name!r} is given to two elements")
        names.append(name)
    return names


def edges_of(part: Any) -> list[float]:
    """Return the ends of the segments of a part in m, with the rounding of the nodes in the tables."""
    edges = [0.0]
    for segment in part.segments:
        edges.append(edges[-1] + segment.length)
    return edges


def place_on(elements: Mapping[str, Any], owner: str, part: str, position: float | str) -> tuple[str, float]:
    """Return the name of the part and the position along it in m, rounded to an end of a segment within 1e-9 of it."""
    name = part or next(iter(elements))
    element = elements.get(name)
    if not isinstance(element, Part):
        known = ", ".join(repr(key) for key, value in elements.items() if isinstance(value, Part))
        raise ValueError(f"{owner}: there is no part {name!r}; the parts are {known}")
    edges = edges_of(element)
    if position == "end":
        return name, edges[-1]
    x = _checks.number(owner, "position", position, unit="m")
    nearest = min(edges, key=lambda edge: abs(edge - x))
    if abs(nearest - x) <= 1e-9 * edges[-1]:
        return name, nearest
    if not 0.0 < x < edges[-1]:
        raise ValueError(
            f"{owner}: position is {x:g} m, expected from 0 to the length {edges[-1]:g} m of part {name!r}"
        )
    return name, x


def points_of(elements: Mapping[str, Any], name: str, attachment: Attachment) -> tuple[str, list[float]]:
    """Return the name of the part and the positions in m at which an attachment acts."""
    owner = f"attachment {name!r}"
    part, x = place_on(elements, owner, attachment.part, attachment.position)
    return part, [place_on(elements, owner, part, x + offset)[1] for offset in attachment.offsets]


class MovingCoordinate:
    """A coordinate of an assembly that stays at an end of a segment when a length changes, elsewhere in place."""

    def __init__(self, assembly: Assembly, coordinate: Coordinate) -> None:
        self._coordinate = coordinate
        self._edge: int | None = None
        part, x = place_on(assembly.elements, "coordinate", coordinate.part, coordinate.position)
        edges = edges_of(assembly.elements[part])
        if coordinate.position != "end" and x in edges:
            self._edge = edges.index(x)

    def on(self, assembly: Assembly) -> Coordinate:
        """Return the coordinate on an assembly with other lengths."""
        if self._edge is None:
            return self._coordinate
        part = self._coordinate.part or next(iter(assembly.elements))
        return replace(self._coordinate, position=edges_of(assembly.elements[part])[self._edge])


def listed(addresses: str | Sequence[str]) -> tuple[str, ...]:
    """Return addresses as a tuple; a single address becomes a tuple of one."""
    return (addresses,) if isinstance(addresses, str) else tuple(addresses)


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
    motion : int
        The core's number of the motion.
    rows : dict
        Rows of each table of `Tables`.
    positions : dict
        Positions along each part at which a node is needed, ascending.
    tabled : list of (int, MeasuredPart)
        Rows of `terminals` that have a table of receptances.
    banded : list of ModalPart
        Modal parts, whose bands limit the frequency lines.
    titles : dict
        Name of the joint in each row of "joint" and "overlap", for messages.
    entries : dict
        Table entries of each parameter by address.
    values : dict
        Value of each parameter by address.
    nodes : dict
        Node at each position of each part.
    points : dict
        Nodes and directions of coordinates that were requested before.
    """

    motion: int
    rows: dict[str, list[list[float]]] = field(default_factory=lambda: {name: [] for name in Tables._fields})
    positions: dict[str, list[float]] = field(default_factory=dict)
    tabled: list[tuple[int, MeasuredPart]] = field(default_factory=list)
    banded: list[ModalPart] = field(default_factory=list)
    titles: dict[tuple[str, int], str] = field(default_factory=dict)
    entries: dict[str, list[Entry]] = field(default_factory=dict)
    values: dict[str, float] = field(default_factory=dict)
    nodes: dict[tuple[str, float], int] = field(default_factory=dict)
    points: dict[tuple[Coordinate, ...], NDArray[np.float64]] = field(default_factory=dict)
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
        arrays = {name: np.array(self.rows[name], dtype=np.float64) for name in _COLUMNS}
        return Tables(**{name: constant(array.reshape(-1, _COLUMNS[name])) for name, array in arrays.items()})

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
        node = element.add_to(flat, name, node)
    for name, attachment, part, along in attached:
        attachment.attach_to(flat, name, [flat.nodes[part, x] for x in along])
    return flat


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
        present = np.array([self.flat.values[own[0]] if own else 0.0 for own in self.names], dtype=np.float64)
        with self.flat.joints_by_name():
            return self.flat.model.tied(self._rates, present, addresses, factors)

    @cached_property
    def _rates(self) -> NDArray[np.float64]:
        """`(k, 5)` table, row, column, number of the address, and derivative of the entry."""
        numbered = [(index, name) for index, own in enumerate(self.names) for name in own]
        rates = [(*entry[:3], index, entry[3]) for index, name in numbered for entry in self.flat.entries[name]]
        return np.array(rates, dtype=np.float64).reshape(-1, 5)


def force_amplitudes(force: ArrayLike, lines: NDArray[np.inexact], excitations: int) -> NDArray[np.float64]:
    """Return the amplitudes `(n,)` of the force in N; raise unless they are positive, with one load and real lines."""
    if excitations != 1:
        raise ValueError(f"force needs exactly one excitation, and there are {excitations}")
    if np.any(lines.imag):
        raise ValueError("frequency_hz is complex, expected real lines for a stepped sine of given force")
    return _checks.by_line("receptance", "force", force, lines.shape)
