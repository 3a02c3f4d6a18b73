"""Triangles of a cross-section, for the warping functions: Delaunay's triangulation of points on and within an outline.

Points on the outline at even distances and a lattice of equilateral triangles within it are triangulated, and triangles
outside are dropped. An edge of the outline that is not a side of a triangle is halved, until the triangles cover the
section: their area is compared with that of the polygon, so that a wrong mesh is never returned.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from receptance.errors import require
from receptance.model.outlines import Outline, Points, contains, signed_area

_CLEARANCE = 0.6
"""Smallest distance of a point of the lattice from the points of the outline, relative to the local spacing."""
_ROUNDS = 12
"""Largest number of times that missing edges are halved."""
_COVERED = 1e-9
"""Largest difference of the area of the triangles from that of the section."""


_ACROSS, _ACROSS_WALL = 25.0, 4.0
"""Triangles across a compact section, and across a wall."""
_MOST_CELLS = 8000
"""Largest number of squares of the spacing within the area."""


class Mesh(NamedTuple):
    """Nodes in m, `(n, 2)`, and triangles, `(m, 6)`: three corners counter-clockwise, and the middles of 01, 12, 20."""

    nodes: Points
    triangles: NDArray[np.intp]


class MeshError(ValueError):
    """No mesh of an outline was made."""


def spacing_for(outline: Outline) -> float:
    """Return a spacing in m that resolves the walls of a section and keeps the number of nodes below some 40 000."""
    area = sum(signed_area(ring) for ring in outline.rings)
    border = sum(float(np.sum(np.linalg.norm(np.roll(ring, -1, axis=0) - ring, axis=1))) for ring in outline.rings)
    return max(min(math.sqrt(area) / _ACROSS, 2.0 * area / border / _ACROSS_WALL), math.sqrt(area / _MOST_CELLS))


def mesh_by_sectionproperties(outline: Outline, spacing: float) -> Mesh:
    """Return triangles by the mesher of the package `sectionproperties`, an extra, which manages sharp corners."""
    require("sections", "a mesh of this outline")
    from sectionproperties.pre import Geometry  # slow to import
    from shapely import Polygon

    geometry = Geometry(Polygon(outline.points, outline.holes))
    mesh = geometry.create_mesh(mesh_sizes=[0.5 * spacing**2]).mesh
    points = np.asarray(mesh["vertices"], dtype=float)
    corners = np.asarray(mesh["triangles"], dtype=np.intp)[:, :3]
    turned = _doubled_areas(points, corners) < 0.0
    return _quadratic(points, np.where(turned[:, None], corners[:, [0, 2, 1]], corners))


def mesh_of(outline: Outline, spacing: float) -> Mesh:
    """Return quadratic triangles of an outline with sides of about `spacing` in m.

    Raises
    ------
    MeshError
        The triangles do not cover the section, as with very sharp corners.

    Examples
    --------
    >>> from receptance.model.meshing import mesh_of
    >>> from receptance.model.outlines import checked_outline
    >>> square = checked_outline("bar", [(0, 0), (0.02, 0), (0.02, 0.02), (0, 0.02)])
    >>> mesh = mesh_of(square, 0.005)
    >>> mesh.triangles.shape[1]
    6
    """
    area = sum(signed_area(ring) for ring in outline.rings)
    rings = [_divided(ring, spacing) for ring in outline.rings]
    lattice = _lattice(outline, spacing)
    for _ in range(_ROUNDS):
        border = np.concatenate(rings)
        sizes = np.concatenate([_local_spacing(ring) for ring in rings])
        distance, nearest = scipy.spatial.cKDTree(border).query(lattice)
        points = np.concatenate([border, lattice[distance > _CLEARANCE * np.minimum(sizes[nearest], spacing)]])
        corners = _triangulated(points)
        inside = _inside(outline, points[corners].mean(axis=1))
        corners = corners[inside]
        sides = {tuple(side) for side in np.sort(corners[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1).tolist()}
        halved, start = [], 0
        missing = 0
        for ring in rings:
            count = len(ring)
            index = start + np.arange(count)
            following = start + (np.arange(count) + 1) % count
            absent = np.array(
                [(min(pair), max(pair)) not in sides for pair in zip(index.tolist(), following.tolist(), strict=True)]
            )
            missing += int(np.count_nonzero(absent))
            middles = 0.5 * (ring + np.roll(ring, -1, axis=0))
            halved.append(np.insert(ring, np.flatnonzero(absent) + 1, middles[absent], axis=0))
            start += count
        if not missing:
            covered = float(np.sum(_doubled_areas(points, corners))) / 2.0
            if math.isclose(covered, area, rel_tol=_COVERED):
                return _quadratic(points, corners)
            break
        rings = halved
    raise MeshError("no mesh covers the section")


def _divided(ring: Points, spacing: float) -> Points:
    """Return a ring with its edges divided into equal parts of at most the spacing."""
    parts = []
    for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True):
        count = max(1, math.ceil(math.dist(a, b) / spacing - 1e-9))
        parts.append(a + (b - a) * np.arange(count)[:, None] / count)
    return np.concatenate(parts)


def _local_spacing(ring: Points) -> NDArray[np.float64]:
    """Return the mean length of both edges at each point."""
    lengths = np.linalg.norm(np.roll(ring, -1, axis=0) - ring, axis=1)
    mean: NDArray[np.float64] = 0.5 * (lengths + np.roll(lengths, 1))
    return mean


def _lattice(outline: Outline, spacing: float) -> Points:
    """Return the points of a lattice of equilateral triangles within an outline."""
    low, high = outline.points.min(axis=0), outline.points.max(axis=0)
    row = spacing * math.sqrt(0.75)
    ys = np.arange(low[1] + 0.5 * row, high[1], row)
    xs = np.arange(low[0], high[0] + spacing, spacing)
    x = xs[None] + np.where(np.arange(len(ys)) % 2, 0.5 * spacing, 0.0)[:, None]
    points = np.column_stack([x.ravel(), np.repeat(ys, len(xs))])
    within: Points = points[_inside(outline, points)]
    return within


def _inside(outline: Outline, points: Points) -> NDArray[np.bool_]:
    inside = contains(outline.points, points)
    for hole in outline.holes:
        inside &= ~contains(hole, points)
    return inside


def _triangulated(points: Points) -> NDArray[np.intp]:
    """Return Delaunay's triangles counter-clockwise, without those of no area on the outline."""
    corners: NDArray[np.intp] = scipy.spatial.Delaunay(points).simplices.astype(np.intp)
    areas = _doubled_areas(points, corners)
    corners = np.where((areas < 0.0)[:, None], corners[:, [0, 2, 1]], corners)
    sides = points[corners] - points[np.roll(corners, -1, axis=1)]
    solid: NDArray[np.intp] = corners[np.abs(areas) > 1e-10 * np.max(np.sum(sides**2, axis=-1), axis=-1)]
    return solid


def _doubled_areas(points: Points, corners: NDArray[np.intp]) -> NDArray[np.float64]:
    a, b, c = (points[corners[:, index]] for index in range(3))
    doubled: NDArray[np.float64] = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    return doubled


def _quadratic(points: Points, corners: NDArray[np.intp]) -> Mesh:
    """Return the mesh with nodes in the middles of the sides, and without points that no triangle has."""
    used, corners = np.unique(corners, return_inverse=True)
    corners = corners.reshape(-1, 3)
    points = points[used]
    sides = np.sort(corners[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    different, index = np.unique(sides, axis=0, return_inverse=True)
    middles = points[different].mean(axis=1)
    triangles = np.hstack([corners, len(points) + index.reshape(-1, 3)])
    return Mesh(np.concatenate([points, middles]), triangles)
