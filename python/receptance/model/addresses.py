"""Names, addresses of parameters and positions along the parts of a chain of elements."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, get_args

from receptance import _checks
from receptance.model.beams import Material, Part, Segment, SpreadJoint
from receptance.model.coordinates import Coordinate
from receptance.model.joints import ColletJoint, GroundSpring, MicroslipJoint, PointJoint, PointMass, Resonator
from receptance.model.terminals import MeasuredPart, ModalPart, Mode

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
_OF_MOTION: dict[str, type | tuple[type, ...]] = {"axial": (Part, PointJoint), "torsion": Part}
"""Elements of a chain that have a motion; all have bending."""
_SEGMENT = re.compile(r"segment\[(\d+|\*)\]\.((?:core\.)?\w+)")


class MotionError(ValueError):
    """A motion does not have some elements; `reason` is the message without the place of these elements."""

    def __init__(self, message: str, reason: str) -> None:
        super().__init__(message)
        self.reason = reason


def check_motion(kind: type, motion: str, place: str) -> None:
    """Raise if a motion does not have elements of a kind in a chain; `place` is the subject of the message."""
    if not issubclass(kind, _OF_MOTION.get(motion, object)):
        element = f"a {kind.__name__}"
        raise MotionError(f"{place} is {element}, which has no {motion} motion", f"{element} has no {motion} motion")


def check_chain(elements: Sequence[ChainElement], points: Sequence[Attachment], motion: str) -> None:
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
        check_motion(type(element), motion, f"Assembly: chain[{index}]")
        if isinstance(element, PointJoint):
            element.check_motion(motion)
    if points and motion == "torsion":
        raise MotionError("Assembly: attachments have no torsion motion", "attachments have no torsion motion")
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
    names = [column.address for column in Segment.layout if column.address]
    if name not in names:
        raise ValueError(f"there is no parameter {address!r}; a segment has {', '.join(names)}")
    pairs = [(i, name) for i in indices if name in part.segments[i].places]
    if not pairs:
        raise ValueError(f"there is no parameter {address!r}: the segment has no core")
    return pairs


def names_of(elements: Sequence[ChainElement | Attachment]) -> list[str]:
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


def place_on(elements: Mapping[str, ChainElement], owner: str, part: str, position: float | str) -> tuple[str, float]:
    """Return the name of the part and the position along it in m, rounded to an end of a segment within 1e-9 of it."""
    name = part or next(iter(elements))
    element = elements.get(name)
    if not isinstance(element, Part):
        parts = ", ".join(repr(key) for key, value in elements.items() if isinstance(value, Part))
        raise ValueError(f"{owner}: there is no part {name!r}; the parts are {parts}")
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


def points_of(elements: Mapping[str, ChainElement], name: str, attachment: Attachment) -> tuple[str, list[float]]:
    """Return the name of the part and the positions in m at which an attachment acts."""
    owner = f"attachment {name!r}"
    part, x = place_on(elements, owner, attachment.part, attachment.position)
    return part, [place_on(elements, owner, part, x + offset)[1] for offset in attachment.offsets]


def moved_coordinate(
    coordinate: Coordinate, elements: Mapping[str, ChainElement], others: Mapping[str, ChainElement]
) -> Coordinate:
    """Return a coordinate on elements as one on others with other lengths; it stays at an end of a segment."""
    part, x = place_on(elements, "coordinate", coordinate.part, coordinate.position)
    edges = edges_of(elements[part])
    if coordinate.position == "end" or x not in edges:
        return coordinate
    return replace(coordinate, position=edges_of(others[part])[edges.index(x)])


def listed(addresses: str | Sequence[str]) -> tuple[str, ...]:
    """Return addresses as a tuple; a single address becomes a tuple of one."""
    return (addresses,) if isinstance(addresses, str) else tuple(addresses)
