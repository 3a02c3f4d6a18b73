"""Where points of an assembly are, and which table entries its addresses move."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from receptance._addresses import place_on
from receptance._flatten import Element, Flat, constant, flatten

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.coordinates import Coordinate
    from receptance.joints import GroundSpring, PointMass, Resonator

__all__ = ["distinct", "flattened", "places_of", "rows_of"]


def places_of(
    elements: Mapping[str, Element], name: str, attachment: PointMass | GroundSpring | Resonator
) -> tuple[str, list[float]]:
    """Return the name of the part and the points along it at which an attachment acts."""
    owner = f"attachment {name!r}"
    part, x = place_on(elements, owner, attachment.part, attachment.position)
    return part, [place_on(elements, owner, part, x + offset)[1] for offset in attachment.offsets]


def flattened(
    elements: Mapping[str, Element],
    attachments: Mapping[str, PointMass | GroundSpring | Resonator],
    points: tuple[Coordinate, ...],
) -> Flat:
    """Return the tables of an assembly with a node at each of some coordinates and wherever something acts."""
    positions: dict[str, set[float]] = {}
    attached = []
    for point in points:
        part, x = place_on(elements, "coordinate", point.part, point.position)
        positions.setdefault(part, set()).add(x)
    for name, attachment in attachments.items():
        part, places = places_of(elements, name, attachment)
        positions.setdefault(part, set()).update(places)
        attached.append((name, attachment, part, places))
    return flatten(list(elements.items()), attached, positions)


def rows_of(elements: Mapping[str, Element], flat: Flat, side: tuple[Coordinate, ...]) -> NDArray[np.float64]:
    """Return node and direction of coordinates, `(n, 2)`, as the core takes them; found once for each table."""
    if side not in flat.points:
        nodes = [flat.nodes[place_on(elements, "coordinate", point.part, point.position)] for point in side]
        rows = [(node, point.direction == "theta") for node, point in zip(nodes, side, strict=True)]
        flat.points[side] = constant(np.array(rows, float))
    return flat.points[side]


def distinct(
    entries: Sequence[Sequence[tuple[int, int, int, float]]],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the distinct table entries `(k, 3)` that addresses move, and the matrix from them to the addresses."""
    found: dict[tuple[int, int, int], int] = {}
    weights = []
    for column, own in enumerate(entries):
        for table, row, field, weight in own:
            weights.append((found.setdefault((table, row, field), len(found)), column, weight))
    matrix = np.zeros((len(found), len(entries)))
    for index, column, weight in weights:
        matrix[index, column] += weight
    return np.array(list(found), dtype=np.float64).reshape(-1, 3), matrix
