"""Outlines of cross-sections: checks of polygons with holes, their area, centroid and second moments."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from receptance import _checks, units

Points = NDArray[np.float64]
"""Points in m, `(n, 2)`."""

MOST_POINTS = 2000
"""Largest number of points of an outline; arcs of a hundred points are exact to 1e-4."""
_SMALLEST, _LARGEST = 1e-4, 2.0
"""Usual sizes of a section in m; others are probably errors of the unit."""
_SAME = 1e-9
"""Distance, relative to the size, of points that are taken for the same."""
_PAIRS_AT_ONCE = 500
"""Edges that are compared with all others in a step, which limits the memory."""


class Moments(NamedTuple):
    """Area in m^2, centroid in m, and int x^2, int y^2 and int x y about the centroid in m^4."""

    area: float
    centroid: tuple[float, float]
    xx: float
    yy: float
    xy: float


class Outline(NamedTuple):
    """A polygon, counter-clockwise, and its holes, clockwise, without repeated points."""

    points: Points
    holes: tuple[Points, ...]

    @property
    def rings(self) -> tuple[Points, ...]:
        """The outline and the holes."""
        return (self.points, *self.holes)

    def turned(self, angle: float) -> Outline:
        """Return the outline turned counter-clockwise about the origin by an angle in rad."""
        if angle == 0.0:
            return self
        matrix = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
        return Outline(self.points @ matrix, tuple(hole @ matrix for hole in self.holes))


def checked_outline(owner: str, points: Any, holes: Any = (), *, unit: str = "m") -> Outline:
    """Return an outline in m from points in a unit; errors name the point and its coordinates in that unit.

    Parameters
    ----------
    owner : str
        Beginning of the messages.
    points : array_like
        `(n, 2)` corners in order, in either direction; the last may repeat the first.
    holes : sequence of array_like, optional
        Corners of holes.
    unit : str, default "m"
        Unit of length of the points.

    Raises
    ------
    ValueError, TypeError
        Fewer than three or more than 2000 points, crossing or touching edges, repeated points, a hole outside or two
        holes that overlap, or a size that suggests another unit.

    Examples
    --------
    >>> from receptance.model.outlines import checked_outline
    >>> checked_outline("tool", [(0, 0), (0, 2), (1, 2), (1, 0)], unit="mm").points[0].tolist()
    [0.001, 0.0]
    """
    scale = _scale(owner, unit)
    if isinstance(holes, str) or not isinstance(holes, Sequence | np.ndarray):
        raise TypeError(f"{owner}: holes is {holes!r}, expected a list of lists of points (x, y)")
    outer = _ring(f"{owner}: points", points, unit)
    inner = [_ring(f"{owner}: holes[{index}]", hole, unit) for index, hole in enumerate(holes)]
    size = float(np.max(np.ptp(outer, axis=0))) * scale
    if not _SMALLEST <= size <= _LARGEST:
        other = "mm" if unit == "m" and size > _LARGEST else "m" if size < _SMALLEST else "mm"
        raise ValueError(
            f"{owner}: points extend over {size / scale:g} {unit}, expected a section of 0.1 mm to 2 m; state the unit "
            f'of the points, for example unit="{other}"'
        )
    rings = [outer, *inner]
    names = ["points", *(f"holes[{index}]" for index in range(len(inner)))]
    for name, ring in zip(names, rings, strict=True):
        _refuse_crossings(owner, (name, ring), (name, ring), unit)
    for index, hole in enumerate(inner):
        _refuse_crossings(owner, (names[index + 1], hole), ("points", outer), unit)
        if not contains(outer, hole[:1])[0]:
            raise ValueError(f"{owner}: holes[{index}] is outside the outline: {_text(hole[0], unit)} is not within it")
        for other_index, other_hole in enumerate(inner[:index]):
            _refuse_crossings(owner, (names[index + 1], hole), (names[other_index + 1], other_hole), unit)
            if contains(other_hole, hole[:1])[0] or contains(hole, other_hole[:1])[0]:
                raise ValueError(f"{owner}: holes[{index}] and holes[{other_index}] overlap, expected separate holes")
    oriented = [ring if signed_area(ring) > 0.0 else ring[::-1] for ring in rings]
    return Outline(oriented[0] * scale, tuple(ring[::-1] * scale for ring in oriented[1:]))


def moments(outline: Outline) -> Moments:
    """Return area, centroid and second moments of an outline without its holes, exactly for straight edges.

    Green's theorem, for example int x^2 dA = sum_i (x_i^2 + x_i x_j + x_j^2) (x_i y_j - x_j y_i) / 12.

    Examples
    --------
    >>> from receptance.model.outlines import checked_outline, moments
    >>> square = moments(checked_outline("bar", [(0, 0), (0.02, 0), (0.02, 0.02), (0, 0.02)]))
    >>> square.area, square.centroid, round(square.xx * 1e9, 3)
    (0.0004, (0.01, 0.01), 13.333)
    """
    shift = outline.points.mean(axis=0)
    sums = np.zeros(6)
    for ring in outline.rings:
        x, y = (ring - shift).T
        u, v = np.roll(x, -1), np.roll(y, -1)
        cross = x * v - u * y
        sums += [
            np.sum(cross) / 2.0,
            np.sum(cross * (x + u)) / 6.0,
            np.sum(cross * (y + v)) / 6.0,
            np.sum(cross * (x * x + x * u + u * u)) / 12.0,
            np.sum(cross * (y * y + y * v + v * v)) / 12.0,
            np.sum(cross * (x * v + 2.0 * x * y + 2.0 * u * v + u * y)) / 24.0,
        ]
    area, first_x, first_y, xx, yy, xy = (float(value) for value in sums)
    x, y = first_x / area, first_y / area
    return Moments(
        area,
        (float(shift[0]) + x, float(shift[1]) + y),
        xx - area * x * x,
        yy - area * y * y,
        xy - area * x * y,
    )


def contains(ring: Points, points: Points) -> NDArray[np.bool_]:
    """Return which points are inside of a ring: a ray in the direction of x crosses it an odd number of times."""
    inside = np.zeros(len(points), dtype=np.bool_)
    for (x, y), (u, v) in zip(ring, np.roll(ring, -1, axis=0), strict=True):
        if y == v:
            continue
        across = (points[:, 1] < y) != (points[:, 1] < v)
        inside ^= across & (points[:, 0] < x + (points[:, 1] - y) * (u - x) / (v - y))
    return inside


def signed_area(ring: Points) -> float:
    """Return the area of a ring, negative if its points go clockwise."""
    x, y = (ring - ring.mean(axis=0)).T
    return float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y) / 2.0)


def _ring(owner: str, points: Any, unit: str) -> Points:
    """Return the points of a ring in their unit, without the last point if it repeats the first."""
    array = _checks.numbers(owner.rsplit(": ", 1)[0], owner.rsplit(": ", 1)[1], points, "iuf", "numbers").astype(float)
    if array.ndim != 2 or array.shape[1] != 2:
        raise ValueError(f"{owner} has the shape {array.shape}, expected (n, 2): points (x, y)")
    wrong = np.flatnonzero(~np.isfinite(array).all(axis=1))
    if wrong.size:
        raise ValueError(f"{owner}[{wrong[0]}] is {tuple(array[wrong[0]].tolist())}, expected finite numbers in {unit}")
    size = float(np.max(np.ptp(array, axis=0), initial=0.0))
    if len(array) > 1 and math.dist(array[0], array[-1]) <= _SAME * size:
        array = array[:-1]
    if len(array) < 3:
        raise ValueError(f"{owner} has {len(array)} different points, expected at least 3")
    if len(array) > MOST_POINTS:
        raise ValueError(
            f"{owner} has {len(array)} points, expected at most {MOST_POINTS}; take one point in "
            f"{math.ceil(len(array) / MOST_POINTS)}, a hundred points of an arc are exact to 1e-4"
        )
    steps = np.linalg.norm(np.roll(array, -1, axis=0) - array, axis=1)
    same = np.flatnonzero(steps <= _SAME * size)
    if same.size:
        index = int(same[0])
        raise ValueError(f"{owner}[{index + 1}] repeats the point before it, {_text(array[index], unit)}; leave it out")
    if np.linalg.svd(array - array.mean(axis=0), compute_uv=False)[1] <= _SAME * size:
        raise ValueError(f"{owner} enclose no area: all are on a line")
    return array


def _refuse_crossings(owner: str, first: tuple[str, Points], second: tuple[str, Points], unit: str) -> None:
    """Raise if an edge of a ring crosses or touches an edge of the other, or of itself that is no neighbour."""
    (name, ring), (other_name, other) = first, second
    itself = ring is other
    starts, ends = other, np.roll(other, -1, axis=0)
    for offset in range(0, len(ring), _PAIRS_AT_ONCE):
        a = ring[offset : offset + _PAIRS_AT_ONCE, None]
        b = np.roll(ring, -1, axis=0)[offset : offset + _PAIRS_AT_ONCE, None]
        c, d = starts[None], ends[None]
        # An edge touches another if the ends of each are not strictly on the same side of the other, and the boxes
        # around both overlap, which decides for edges on the same line.
        apart = (_side(a, b, c) * _side(a, b, d) > 0.0) | (_side(c, d, a) * _side(c, d, b) > 0.0)
        apart |= np.any((np.minimum(a, b) > np.maximum(c, d)) | (np.minimum(c, d) > np.maximum(a, b)), axis=-1)
        if itself:
            count = len(ring)
            index = np.arange(offset, offset + len(a))
            distance = (np.arange(count)[None] - index[:, None]) % count
            # Neighbours have a point in common; they overlap where the second turns back on the first.
            back = np.abs(_side(a, b, d)) <= 0.0
            back &= np.sum((b - a) * (d - c), axis=-1) < 0.0
            apart = np.where(distance == 1, ~back, apart | (distance == 0) | (distance == count - 1))
        touching = np.argwhere(~apart)
        if touching.size:
            i, j = int(touching[0][0]) + offset, int(touching[0][1])
            raise ValueError(
                f"{owner}: {name}[{i}] to [{(i + 1) % len(ring)}], {_text(ring[i], unit)} to "
                f"{_text(ring[(i + 1) % len(ring)], unit)}, crosses or touches {other_name}[{j}] to "
                f"[{(j + 1) % len(other)}], {_text(other[j], unit)} to {_text(other[(j + 1) % len(other)], unit)}; "
                "expected an outline that does not meet itself" + ("" if itself else " and holes inside of it")
            )


def _side(a: Points, b: Points, c: Points) -> Any:
    """Return twice the area of the triangles a, b, c: positive if c is to the left of the line from a to b."""
    return (b[..., 0] - a[..., 0]) * (c[..., 1] - a[..., 1]) - (b[..., 1] - a[..., 1]) * (c[..., 0] - a[..., 0])


def _scale(owner: str, unit: str) -> float:
    try:
        return units.parse(f"1 {unit}", units.LENGTH)
    except ValueError:
        raise ValueError(f'{owner}: unit is {unit!r}, expected a unit of length such as "mm"') from None


def _text(point: Points, unit: str) -> str:
    return f"({point[0]:g}, {point[1]:g}) {unit}"
