"""Names of elements and the fields behind the addresses of their parameters."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

from receptance import _checks
from receptance._flatten import Flat
from receptance.beams import Part, Segment
from receptance.collet import ColletJoint
from receptance.errors import SingularInterfaceError
from receptance.joints import GroundSpring, PointJoint, PointMass, Resonator
from receptance.microslip import MicroslipJoint
from receptance.modal_parts import ModalPart
from receptance.spread import SpreadJoint
from receptance.terminals import MeasuredPart

_JOINTS = (PointJoint, SpreadJoint, ColletJoint, MicroslipJoint)
_TERMINALS = (MeasuredPart, ModalPart)
_KIND: dict[type, str] = {
    Part: "part",
    **dict.fromkeys(_JOINTS, "joint"),
    **dict.fromkeys(_TERMINALS, "spindle"),
    PointMass: "mass",
    GroundSpring: "ground",
    Resonator: "resonator",
}
_SEGMENT = re.compile(r"segment\[(\d+|\*)\]\.((?:core\.)?\w+)")


def check_chain(elements: Sequence[Any], points: Sequence[Any], motion: str) -> None:
    """Raise where elements do not make a chain from the tip on, or points are none."""
    for index, element in enumerate(elements):
        if not isinstance(element, (Part, *_JOINTS, *_TERMINALS)):
            *kinds, last = (kind.__name__ for kind in (*_JOINTS, *_TERMINALS))
            raise TypeError(
                f"Assembly: chain[{index}] is {element!r}, expected a Part or one of {', '.join(kinds)} and {last}"
            )
        if isinstance(element, _TERMINALS) and index != len(elements) - 1:
            raise ValueError(
                f"Assembly: chain[{index}] is a {type(element).__name__}, which is known at one plane only, so that "
                "nothing can follow it"
            )
        if motion != "bending" and isinstance(element, (*_JOINTS, *_TERMINALS)) and type(element) is not PointJoint:
            raise ValueError(f"Assembly: chain[{index}] is a {type(element).__name__}, which there is for bending only")
    for index, point in enumerate(points):
        if not isinstance(point, (PointMass, GroundSpring, Resonator)):
            raise TypeError(
                f"Assembly: attachments[{index}] is {point!r}, expected a PointMass, a GroundSpring or a Resonator"
            )
    if not elements or not isinstance(elements[0], Part) or not isinstance(elements[-1], (Part, *_TERMINALS)):
        raise ValueError(
            "Assembly: the chain must begin and end with a Part, or end with a MeasuredPart or a ModalPart"
        )
    for index in range(1, len(elements)):
        if isinstance(elements[index - 1], _JOINTS) and isinstance(elements[index], _JOINTS):
            raise ValueError(
                f"Assembly: chain[{index - 1}] and chain[{index}] are both joints, with nothing between them; "
                "springs in series are one PointJoint, or a ColletJoint"
            )


def segment_fields(address: str, part: Part, rest: str) -> list[tuple[int, str]]:
    """Return the (segment, field) pairs of an address."""
    match = _SEGMENT.fullmatch(rest)
    count = len(part.segments)
    if match is None:
        raise ValueError(
            f"there is no parameter {address!r}; a part's are like segment[0].length or segment[*].density"
        )
    which, field = match.groups()
    indices = range(count) if which == "*" else [int(which)]
    if indices[0] >= count:
        raise ValueError(f"there is no parameter {address!r}: the part has {count} segment(s), counted from 0")
    known = [column.address for column in Segment.layout if column.address]
    if field not in known:
        raise ValueError(f"there is no parameter {address!r}; a segment has {', '.join(known)}")
    found = [(i, field) for i in indices if field in part.segments[i].places()]
    if not found:
        raise ValueError(f"there is no parameter {address!r}: the segment has no core")
    return found


def names_of(elements: Sequence[Any]) -> list[str]:
    """Name the unnamed; refuse what is named twice or cannot be part of an address."""
    kinds = [_KIND[type(element)] for element in elements if not element.name]
    names: list[str] = []
    counter: dict[str, int] = {}
    for element in elements:
        kind = _KIND[type(element)]
        index = counter.setdefault(kind, 0)
        if not element.name:
            counter[kind] += 1
        name = element.name or (kind if kinds.count(kind) == 1 else f"{kind}_{index}")
        if re.fullmatch(r"[^\W\d]\w*", name) is None:
            raise ValueError(f"Assembly: the name {name!r} must be one word of letters, digits and underscores")
        if name in names:
            raise ValueError(f"Assembly: the name {name!r} is given to two elements")
        names.append(name)
    return names


def edges_of(part: Any) -> list[float]:
    """Return where the segments of a part begin and end, summed term by term as the flattening does."""
    edges = [0.0]
    for segment in part.segments:
        edges.append(edges[-1] + segment.length)
    return edges


def place_on(elements: Mapping[str, Any], what: str, part: str, position: float | str) -> tuple[str, float]:
    """Name of the part and position along it, on the step between segments where it is within rounding."""
    name = part or next(iter(elements))
    element = elements.get(name)
    if not isinstance(element, Part):
        known = ", ".join(repr(key) for key, value in elements.items() if isinstance(value, Part))
        raise ValueError(f"{what}: there is no part {name!r}; the parts are {known}")
    edges = edges_of(element)
    if position == "end":
        return name, edges[-1]
    x = _checks.number(what, "position", position, unit="m")
    nearest = min(edges, key=lambda edge: abs(edge - x))
    if abs(nearest - x) <= 1e-9 * edges[-1]:
        return name, nearest
    if not 0.0 < x < edges[-1]:
        raise ValueError(f"{what}: position is {x:g} m, expected from 0 to the length {edges[-1]:g} m of part {name!r}")
    return name, x


def named(element: Any, name: str) -> Any:
    if element.name == name:
        return element
    return Part(element.segments, name=name) if isinstance(element, Part) else replace(element, name=name)


def listed(addresses: str | Sequence[str]) -> tuple[str, ...]:
    """Return addresses as a tuple; one address alone is a list of one."""
    return (addresses,) if isinstance(addresses, str) else tuple(addresses)


@contextmanager
def interfaces_by_name(flat: Flat) -> Iterator[None]:
    """Call a singular interface by the joint's name: the core knows only its row."""
    try:
        yield
    except SingularInterfaceError as error:
        titles = flat.titles
        text = re.sub(r"^(joint|overlap) (\d+)", lambda found: f"joint {titles[found[1], int(found[2])]!r}", str(error))
        raise SingularInterfaceError(text) from None
