"""Bodies of revolution from closed contours: the profile and the bores, or why there is no such body.

The contours are cut across the axis at all their corners. In each interval between two cuts the edges are straight
lines in a fixed order, so the material of a layer is between every second pair of them (even-odd rule).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from receptance.drawing.curves import Frame, Loop, Points, wrong
from receptance.io import FileFormatError

_LEAST = 4.0
"""Intervals shorter than this many tolerances are not compared with the other side of the axis."""


@dataclass(frozen=True)
class Band:
    """Material in an interval: distances from the axis at its ends, of the inner and the outer edge."""

    inner: tuple[float, float]
    outer: tuple[float, float]
    edges: tuple[int, int]
    """Numbers of the edges inside and outside."""

    @property
    def middle(self) -> tuple[float, float]:
        """Distances in the middle of the interval."""
        return 0.5 * sum(self.inner), 0.5 * sum(self.outer)


@dataclass(frozen=True)
class Ring:
    """The one ring of material in an interval of x: inner and outer radius at its ends."""

    start: float
    end: float
    inner: tuple[float, float]
    outer: tuple[float, float]


@dataclass(frozen=True)
class Revolved:
    """Rings from the lower end on, and which sides of the axis are drawn: "both", "above" or "below"."""

    rings: tuple[Ring, ...]
    sides: str


class _Edges:
    """The edges of all contours, with their layers and entities; corners that nearly have one x have the same.

    Of the tolerance this takes one half; the other one is that of the polylines.
    """

    def __init__(self, layers: Mapping[str, Sequence[Loop]], tolerance: float) -> None:
        starts: list[Points] = []
        ends: list[Points] = []
        self.layers: list[str] = []
        self.entities: list[str] = []
        self.loops: list[int] = []
        number = 0
        for layer, loops in layers.items():
            for loop in loops:
                starts.append(loop.points)
                ends.append(np.roll(loop.points, -1, axis=0))
                self.layers += [layer] * len(loop.points)
                self.entities += loop.entities
                self.loops += [number] * len(loop.points)
                number += 1
        self.start, self.end = _snapped(np.concatenate(starts), np.concatenate(ends), 0.5 * tolerance)
        self.layer = np.array(self.layers)

    def name(self, edge: int) -> tuple[str, str]:
        """Return layer and entity of an edge."""
        return self.layers[edge], self.entities[edge]


def _snapped(start: Points, end: Points, tolerance: float) -> tuple[Points, Points]:
    """Return the ends of edges with one x where the difference is within the tolerance."""
    both = np.concatenate([start, end])
    order = np.argsort(both[:, 0], kind="stable")
    x = both[order, 0]
    first = 0
    for index in range(1, len(x)):
        if x[index] - x[first] > tolerance:
            first = index
        else:
            x[index] = x[first]
    # The far end keeps its length.
    x[x == x[-1]] = both[order[-1], 0]
    both[order, 0] = x
    return both[: len(start)], both[len(start) :]


def revolve(
    profiles: Mapping[str, Sequence[Loop]], bores: Mapping[str, Sequence[Loop]], frame: Frame, tolerance: float
) -> Revolved:
    """Return the rings of the body whose profile is drawn in some layers, and its bores in others.

    Lengths are in the unit of the drawing, in its frame.

    Raises
    ------
    FileFormatError
        Lines cross, a layer has several profiles, the two sides of the axis differ, or the material is no single ring;
        the message names entity, layer and place.
    """
    edges = _Edges({**profiles, **bores}, tolerance)
    breaks = _breaks(edges, frame, tolerance)
    cuts = [_bands(edges, low, high, tolerance) for low, high in pairwise(breaks)]
    sides = _check_sides(edges, breaks, cuts, frame, tolerance)
    rings: list[Ring] = []
    for (low, high), bands in zip(pairwise(breaks), cuts, strict=True):
        folded = {
            layer: next((bands[layer, side] for side in (1, -1) if bands.get((layer, side))), [])
            for layer in (*profiles, *bores)
        }
        _check_single(edges, {layer: folded[layer] for layer in profiles}, (low, high), frame, tolerance)
        body = _joined([band for layer in profiles for band in folded[layer]], tolerance)
        holes = _joined([band for layer in bores for band in folded[layer]], tolerance)
        if (ring := _ring(edges, body, holes, (low, high), frame, tolerance)) is not None:
            if rings and low - rings[-1].end > tolerance:
                edge = body[0].edges[1]
                raise wrong(
                    f"the body is in two pieces: there is nothing between {frame.place((rings[-1].end, 0.0))} and "
                    f"{frame.place((low, 0.0))}; give one profile, or its `layer`",
                    *edges.name(edge),
                )
            rings.append(ring)
    if not rings:
        raise FileFormatError("the contour has no area, expected the profile of a body")
    return Revolved(tuple(rings), sides)


# Cuts -----------------------------------------------------------------------------------------------------------------


def _breaks(edges: _Edges, frame: Frame, tolerance: float) -> list[float]:
    """Return the positions of all corners, of crossings of layers and of crossings of the axis.

    Lines of one layer that cross raise.
    """
    positions = list(np.unique(np.concatenate([edges.start[:, 0], edges.end[:, 0]])))
    extra: list[float] = []
    for first in range(len(edges.start)):
        others, places = _crossings(edges, first, tolerance)
        for second, place in zip(others, places, strict=True):
            layer, entity = edges.name(first)
            if edges.layers[second] == layer:
                hint = ""
                if edges.loops[first] != edges.loops[second]:
                    hint = "; put a bore into a layer BORE, or a layer that `bore_layer` names"
                raise wrong(
                    f"crosses {edges.entities[second]}, expected a contour that does not cross itself or another one"
                    f"{hint}",
                    layer,
                    entity,
                    frame.place(place),
                )
            extra.append(float(place[0]))
    (x0, y0), (x1, y1) = edges.start.T, edges.end.T
    through = (y0 * y1 < 0.0) & (np.minimum(np.abs(y0), np.abs(y1)) > tolerance)
    with np.errstate(divide="ignore", invalid="ignore"):
        extra += (x0 + (x1 - x0) * y0 / (y0 - y1))[through].tolist()
    for x in extra:
        if all(abs(x - other) > 0.5 * tolerance for other in positions):
            positions.append(x)
    return sorted(float(x) for x in positions)


def _crossings(edges: _Edges, first: int, tolerance: float) -> tuple[NDArray[np.int64], Points]:
    """Return the later edges that an edge crosses between their ends, and the places."""
    p, r = edges.start[first], edges.end[first] - edges.start[first]
    q, s = edges.start[first + 1 :], edges.end[first + 1 :] - edges.start[first + 1 :]
    cross = r[0] * s[:, 1] - r[1] * s[:, 0]
    offset = q - p
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (offset[:, 0] * s[:, 1] - offset[:, 1] * s[:, 0]) / cross
        u = (offset[:, 0] * r[1] - offset[:, 1] * r[0]) / cross
    length, lengths = math.hypot(*r), np.hypot(s[:, 0], s[:, 1])
    # Ends that touch an edge within the tolerance do not cross it.
    inside = (t * length > tolerance) & ((1.0 - t) * length > tolerance)
    inside &= (u * lengths > tolerance) & ((1.0 - u) * lengths > tolerance)
    crossed = np.flatnonzero(inside & (cross != 0.0))
    return first + 1 + crossed, p + t[crossed, None] * r


def _bands(edges: _Edges, low: float, high: float, tolerance: float) -> dict[tuple[str, int], list[Band]]:
    """Return the material between two positions by layer and side of the axis (1 above, -1 below), from the axis on."""
    x0, x1 = edges.start[:, 0], edges.end[:, 0]
    spans = np.flatnonzero((np.minimum(x0, x1) <= low) & (np.maximum(x0, x1) >= high) & (x0 != x1))
    slope = (edges.end[spans, 1] - edges.start[spans, 1]) / (x1[spans] - x0[spans])
    at_low = edges.start[spans, 1] + slope * (low - x0[spans])
    at_high = edges.start[spans, 1] + slope * (high - x0[spans])
    bands_of: dict[tuple[str, int], list[Band]] = {}
    for layer in dict.fromkeys(edges.layers):
        of_layer = np.flatnonzero(edges.layer[spans] == layer)
        ordered = of_layer[np.argsort(at_low[of_layer] + at_high[of_layer], kind="stable")]
        for below, above in zip(ordered[::2], ordered[1::2], strict=True):
            lower = (float(at_low[below]), float(at_high[below]))
            upper = (float(at_low[above]), float(at_high[above]))
            numbers = (int(spans[below]), int(spans[above]))
            for side, inner, outer, pair in (
                (1, lower, upper, numbers),
                (-1, (-upper[0], -upper[1]), (-lower[0], -lower[1]), numbers[::-1]),
            ):
                if 0.5 * sum(outer) > tolerance:
                    # Negative distances are beyond the axis, and those within the tolerance are on it.
                    near, far = (value if value > tolerance else 0.0 for value in inner)
                    outside = (max(outer[0], 0.0), max(outer[1], 0.0))
                    if 0.5 * (sum(outside) - near - far) > 0.0:
                        bands_of.setdefault((layer, side), []).append(Band((near, far), outside, pair))
    for bands in bands_of.values():
        bands.sort(key=lambda band: band.middle)
    return bands_of


# Checks ---------------------------------------------------------------------------------------------------------------


def _check_sides(
    edges: _Edges,
    breaks: Sequence[float],
    cuts: Sequence[Mapping[tuple[str, int], list[Band]]],
    frame: Frame,
    tolerance: float,
) -> str:
    """Return the sides of the axis that are drawn; raise if both are and they differ."""
    drawn = {key for bands in cuts for key in bands}
    sides = set()
    for layer in dict.fromkeys(edges.layers):
        sides_of_layer = [side for side in (1, -1) if (layer, side) in drawn]
        sides.update(sides_of_layer)
        if len(sides_of_layer) < 2:
            continue
        for (low, high), bands in zip(pairwise(breaks), cuts, strict=True):
            if high - low < _LEAST * tolerance:
                continue
            above, below = bands.get((layer, 1), []), bands.get((layer, -1), [])
            pairs = [
                (a, b, edge, direction)
                for upper, lower in zip(above, below, strict=False)
                for a, b, edge, direction in (
                    (upper.middle[0], lower.middle[0], upper.edges[0], upper.inner),
                    (upper.middle[1], lower.middle[1], upper.edges[1], upper.outer),
                )
            ]
            for a, b, edge, (y0, y1) in pairs:
                slope = (y1 - y0) / (high - low)
                if abs(a - b) > 2.0 * tolerance * math.hypot(1.0, slope):
                    raise wrong(
                        f"is {a:.6g} {frame.unit} above the axis, where the other side is {b:.6g} {frame.unit} below "
                        "it, expected a profile that is symmetric about the axis; give the axis, or draw one half",
                        *edges.name(edge),
                        frame.place((0.5 * (low + high), a)),
                    )
            if len(above) != len(below):
                side = 1 if len(above) > len(below) else -1
                band = (above if side == 1 else below)[min(len(above), len(below))]
                raise wrong(
                    "is on one side of the axis only, expected a profile that is symmetric about the axis; give the "
                    "axis, or draw one half",
                    *edges.name(band.edges[1]),
                    frame.place((0.5 * (low + high), side * band.middle[1])),
                )
    return "both" if len(sides) == 2 else "above" if 1 in sides else "below"


def _check_single(
    edges: _Edges, bands: Mapping[str, list[Band]], ends: tuple[float, float], frame: Frame, tolerance: float
) -> None:
    """Raise if a layer has material of several contours in an interval."""
    if ends[1] - ends[0] < _LEAST * tolerance:
        return
    for of_layer in bands.values():
        loops = {edges.loops[band.edges[1]] for band in of_layer}
        if len(of_layer) > 1 and len(loops) > 1:
            x, first = 0.5 * sum(ends), edges.entities[of_layer[0].edges[1]]
            raise wrong(
                f"the layer has several profiles: beside this one that of {first}, expected "
                "one; put each part into a layer of its own, and give its `layer`",
                *edges.name(of_layer[-1].edges[1]),
                frame.place((x, of_layer[-1].middle[1])),
            )


def _joined(bands: Sequence[Band], tolerance: float) -> list[Band]:
    """Return bands with those that touch or overlap as one."""
    ordered = sorted(bands, key=lambda band: band.middle)
    joined = ordered[:1]
    for band in ordered[1:]:
        last = joined[-1]
        if band.middle[0] > last.middle[1] + tolerance:
            joined.append(band)
            continue
        farther = band.middle[1] > last.middle[1]
        outer, edge = (band.outer, band.edges[1]) if farther else (last.outer, last.edges[1])
        joined[-1] = Band(last.inner, outer, (last.edges[0], edge))
    return joined


def _ring(
    edges: _Edges,
    body: Sequence[Band],
    holes: Sequence[Band],
    ends: tuple[float, float],
    frame: Frame,
    tolerance: float,
) -> Ring | None:
    """Return the ring of material in an interval, None if there is none."""
    x = 0.5 * sum(ends)
    narrow = ends[1] - ends[0] < _LEAST * tolerance
    if not body:
        if holes and not narrow:
            raise wrong(
                "is a bore outside of the body, expected one inside of it",
                *edges.name(holes[0].edges[1]),
                frame.place((x, holes[0].middle[1])),
            )
        return None
    if len(body) > 1:
        if narrow:
            return None
        raise wrong(
            f"there is an undercut: at this place the material from {body[1].middle[0]:.6g} {frame.unit} on is beyond "
            f"a gap that begins at {body[0].middle[1]:.6g} {frame.unit}, expected one ring around the axis",
            *edges.name(body[1].edges[0]),
            frame.place((x, body[1].middle[0])),
        )
    inner, outer = body[0].inner, body[0].outer
    if holes:
        hole = holes[0]
        if hole.middle[0] > body[0].middle[0] + tolerance or len(holes) > 1:
            wrong_hole = holes[-1]
            raise wrong(
                f"is a bore from {wrong_hole.middle[0]:.6g} {frame.unit} off the axis on, expected a bore around the "
                "axis: the body would be no body of revolution",
                *edges.name(wrong_hole.edges[0]),
                frame.place((x, wrong_hole.middle[0])),
            )
        if hole.middle[1] >= body[0].middle[1] - tolerance and not narrow:
            raise wrong(
                f"is a bore of the diameter {2.0 * hole.middle[1]:.6g} {frame.unit}, where the outer diameter is "
                f"{2.0 * body[0].middle[1]:.6g} {frame.unit} ({edges.entities[body[0].edges[1]]} in layer "
                f'"{edges.layers[body[0].edges[1]]}"), expected a bore that is smaller',
                *edges.name(hole.edges[1]),
                frame.place((x, hole.middle[1])),
            )
        inner = (max(inner[0], hole.outer[0]), max(inner[1], hole.outer[1]))
    return Ring(*ends, inner, outer)
