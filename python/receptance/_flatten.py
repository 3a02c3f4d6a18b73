"""From parts, joints and point elements to the core's tables, and from addresses to their entries."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from math import tau
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np

from receptance import _core
from receptance.beams import Part, Segment
from receptance.collet import ColletJoint
from receptance.joints import WIDTHS, GroundSpring, PointJoint, PointMass, Resonator
from receptance.microslip import MicroslipJoint
from receptance.modal_parts import ModalPart, Mode
from receptance.spread import SpreadJoint
from receptance.terminals import RESIDUALS, MeasuredPart, Terminal

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.coordinates import Coordinate

SEGMENTS, JOINTS, MASSES, GROUNDS, OVERLAPS, TERMINALS, MODES, MICROSLIP = range(8)
"""The core's tables, and last what it does not know: parameters of joints in micro-slip."""
MICROSLIP_FIELDS = ("k_y", "k_theta", *MicroslipJoint.amplitude_of)
_SPRING = len(PointJoint.columns_of)
Motion = Literal["bending", "axial"]
MOTIONS: dict[Motion, int] = {"bending": 0, "axial": 1}

Entry = tuple[int, int, int, float]
"""Table, row, column and weight: how fast the entry grows with the parameter."""


Element = Part | PointJoint | ColletJoint | MicroslipJoint | SpreadJoint | MeasuredPart | ModalPart


class Tables(NamedTuple):
    """The core's tables, read only; rows as in `_core.Model` and `_core.Model.with_terminals`."""

    segments: NDArray[np.float64]
    joints: NDArray[np.float64]
    masses: NDArray[np.float64]
    grounds: NDArray[np.float64]
    overlaps: NDArray[np.float64]
    terminals: NDArray[np.float64]
    modes: NDArray[np.float64]

    def model(self, motion: int = 0) -> _core.Model:
        """Return the core's model for a motion, checked."""
        model = _core.Model(motion, *self[:5])
        return model.with_terminals(self.terminals, self.modes) if len(self.terminals) else model


_COLUMNS = {
    "segments": 2 + len(Segment.layout),
    **dict(zip(("joints", "masses", "grounds"), WIDTHS, strict=True)),
    "overlaps": 2 + len(SpreadJoint.layout),
    "terminals": 1 + len(RESIDUALS),
    "modes": 1 + len(Mode.layout),
}
"""Columns of the core's tables: nodes or rows, then those of the elements."""


@dataclass
class Flat:
    """The tables, and which entries each address moves."""

    segments: list[list[float]] = field(default_factory=list)
    joints: list[list[float]] = field(default_factory=list)
    masses: list[list[float]] = field(default_factory=list)
    grounds: list[list[float]] = field(default_factory=list)
    overlaps: list[list[float]] = field(default_factory=list)
    microslips: list[tuple[int, str, MicroslipJoint]] = field(default_factory=list)
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
        """Return the core's model for a motion, built and checked once."""
        if motion not in self._models:
            self._models[motion] = self.tables.model(motion)
        return self._models[motion]

    def __getstate__(self) -> dict[str, Any]:
        # Handles of the core stay in their process.
        return {**self.__dict__, "_models": {}}

    @cached_property
    def tables(self) -> Tables:
        """The core's tables."""
        # Made once for all calls, so nobody may write to them.
        each = {name: np.array(getattr(self, name), dtype=np.float64) for name in _COLUMNS}
        return Tables(**{name: constant(array.reshape(-1, _COLUMNS[name])) for name, array in each.items()})

    def new_node(self) -> int:
        """Number a new node."""
        self.count += 1
        return self.count - 1


def constant(array: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the array, which cannot be written to any more."""
    array.flags.writeable = False
    return array


def flatten(
    chain: Sequence[tuple[str, Element]],
    attachments: Sequence[tuple[str, PointMass | GroundSpring | Resonator, str, list[float]]],
    positions: dict[str, set[float]],
) -> Flat:
    """Flatten a chain from the tip on.

    `attachments` come with their own name, the part's name and the positions that share them; `positions` are places
    along each part, besides its ends and the steps between its segments, that need a node of their own.
    """
    flat = Flat()
    node = 0
    for name, element in chain:
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
    for name, attachment, part, places in attachments:
        nodes = [flat.nodes[part, position] for position in places]
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
        for i, quantity in enumerate(MICROSLIP_FIELDS):
            flat.entries[f"{name}.{quantity}"] = [(MICROSLIP, len(flat.microslips), i, 1.0)]
        flat.microslips.append((row, name, joint))
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
    """Add a point element, shared out where it has several nodes."""
    table = MASSES if isinstance(attachment, PointMass) else GROUNDS
    rows = flat.masses if table == MASSES else flat.grounds
    for i, quantity in enumerate(attachment.columns_of):
        # A loss factor is a property of each share, not a sum of them.
        shares = (1.0,) * len(nodes) if quantity == "loss_factor" else attachment.shares
        flat.entries[f"{name}.{quantity}"] = [(table, len(rows) + n, 1 + i, share) for n, share in enumerate(shares)]
    for node, share in zip(nodes, attachment.shares, strict=True):
        columns = zip(attachment.columns_of, attachment.columns(), strict=True)
        rows.append([float(node), *(value if name == "loss_factor" else value * share for name, value in columns)])


def _add_resonator(flat: Flat, name: str, resonator: Resonator, node: int) -> None:
    """Add a joint to a node of its own, and the mass on that node."""
    # The mass has no moment of inertia, so the rotational stiffness transmits nothing, whatever its value.
    joint = PointJoint(k_y=resonator.k_y, k_theta=1.0, c_y=resonator.c_y)
    row, far = len(flat.joints), flat.new_node()
    flat.titles["joint", row] = name
    flat.joints.append([float(node), float(far), *joint.columns()])
    for quantity in ("k_y", "c_y"):
        flat.entries[f"{name}.{quantity}"] = [(JOINTS, row, 2 + PointJoint.columns_of.index(quantity), 1.0)]
    flat.entries[f"{name}.mass"] = [(MASSES, len(flat.masses), 1, 1.0)]
    flat.masses.append([float(far), resonator.mass, 0.0])


def _add_part(flat: Flat, name: str, part: Part, node: int, positions: list[float]) -> int:
    """Add the segments of a part, split where a position falls inside one."""
    start = 0.0
    flat.nodes[name, start] = node
    rows_of: list[list[int]] = []
    for segment in part.segments:
        end = start + segment.length
        inside = [x for x in positions if start < x < end]
        cuts = [start, *inside, end]
        columns = list(segment.columns())
        rows_of.append([])
        for left, right in pairwise(cuts):
            far = flat.new_node()
            rows_of[-1].append(len(flat.segments))
            # A segment that is not split keeps its length to the last digit.
            columns[0] = right - left if inside else segment.length
            flat.segments.append([float(node), float(far), *columns])
            flat.nodes[name, right] = node = far
        start = end
    for i, segment in enumerate(part.segments):
        for address, place in segment.places().items():
            column = 2 + place
            entries = [(SEGMENTS, row, column, 1.0) for row in rows_of[i]]
            if address == "length":
                # Positions are measured from the part's start: the cuts stay where they are, so the last
                # piece takes the change, and in the segments behind the first piece shrinks as the last grows.
                entries = [(SEGMENTS, rows_of[i][-1], column, 1.0)]
                for behind in rows_of[i + 1 :]:
                    if len(behind) > 1:
                        entries += [(SEGMENTS, behind[0], column, -1.0), (SEGMENTS, behind[-1], column, 1.0)]
            flat.entries[f"{name}.segment[{i}].{address}"] = entries
    return node
