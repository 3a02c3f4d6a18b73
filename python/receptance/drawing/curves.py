"""Curves of a drawing, and the closed contours that they form.

A curve is an entity of the drawing as a polyline. Its points are in a frame: along an axis and across it. Messages name
places in the coordinates and the unit of the drawing.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from receptance.io import FileFormatError

Points = NDArray[np.float64]
"""Points of a curve, shape (n, 2)."""
MOST_EDGES = 3000
"""Largest number of edges of all contours after curves were simplified."""
_LONG = 4.0
"""Ratio from which on an edge is long beside the next one, and beside the tolerance."""
_STRAIGHT = 1e-9
"""Sine of the angle between two edges of one straight line."""
_NAMED = 4
"""Most entities that a message names."""


@dataclass(frozen=True)
class Frame:
    """A frame in a drawing: its origin, the direction of its first axis, and the unit."""

    origin: tuple[float, float] = (0.0, 0.0)
    direction: tuple[float, float] = (1.0, 0.0)
    unit: str = "mm"

    def inside(self, points: Points) -> Points:
        """Return points of the drawing as distances along the axis and across it."""
        c, s = self.direction
        moved: Points = (points - np.array(self.origin)) @ np.array([[c, -s], [s, c]])
        return moved

    def place(self, point: Iterable[float]) -> str:
        """Return the coordinates of a point of the frame in the drawing as text."""
        along, across = point
        c, s = self.direction
        x, y = self.origin[0] + c * along - s * across, self.origin[1] + s * along + c * across
        return f"({_tidy(x)}, {_tidy(y)}) {self.unit}"


def _tidy(value: float) -> str:
    return f"{value if abs(value) > 1e-9 else 0.0:.6g}"


@dataclass(frozen=True, eq=False)
class Curve:
    """An entity of a drawing as a polyline."""

    points: Points
    entity: str
    """Type and handle of the entity, such as "LINE #2F"."""
    layer: str

    @property
    def ends(self) -> Points:
        """First and last point."""
        return self.points[[0, -1]]

    @property
    def is_straight(self) -> bool:
        """Whether it is one line."""
        return len(self.points) == 2


@dataclass(frozen=True, eq=False)
class Loop:
    """A closed contour: its points without repetition of the first, and the entity of the edge behind each."""

    points: Points
    entities: tuple[str, ...]
    layer: str


def wrong(problem: str, layer: str, entity: str = "", at: str = "") -> FileFormatError:
    """Return the error about an entity of a layer at a place."""
    parts = [f'layer "{layer}"', *([entity] if entity else []), *([f"at {at}"] if at else [])]
    return FileFormatError(problem, place=", ".join(parts))


# Simplification -------------------------------------------------------------------------------------------------------


def simplified(points: Points, tolerance: float) -> Points:
    """Return the points of a polyline without those that are not needed within a tolerance.

    From each point on the longest chord is taken that is no farther than the tolerance from all points between its
    ends; its length is found by doubling and bisection. The ends stay, and so do the points where a long edge meets the
    short ones of a curve, so that a cylinder before a fillet stays one.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance.drawing.curves import simplified
    >>> simplified(np.array([[0.0, 0.0], [1.0, 0.001], [2.0, 0.0], [2.0, 1.0]]), 0.01).tolist()
    [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0]]
    """
    corners = _ends_of_long_edges(points, tolerance)
    pieces = [_simplified(points[start : end + 1], tolerance) for start, end in pairwise(corners)]
    return np.concatenate([points[:1], *(piece[1:] for piece in pieces)])


def _ends_of_long_edges(points: Points, tolerance: float) -> list[int]:
    """Return the numbers of the ends of a polyline, and of the points between a long edge and much shorter ones."""
    edges = np.diff(points, axis=0)
    lengths = np.hypot(*edges.T)
    shorter, longer = np.minimum(lengths[1:], lengths[:-1]), np.maximum(lengths[1:], lengths[:-1])
    turn = np.abs(edges[:-1, 0] * edges[1:, 1] - edges[:-1, 1] * edges[1:, 0])
    bent = turn > _STRAIGHT * lengths[1:] * lengths[:-1]
    inner = np.flatnonzero(bent & (longer > _LONG * shorter) & (longer > _LONG * tolerance)) + 1
    return [0, *(int(number) for number in inner), len(points) - 1]


def _simplified(points: Points, tolerance: float) -> Points:
    last = len(points) - 1
    kept = [0]
    while kept[-1] < last:
        first = kept[-1]
        good, step = first + 1, 2
        while first + step <= last and _is_chord(points[first : first + step + 1], tolerance):
            good, step = first + step, 2 * step
        bad = min(first + step, last + 1)
        if bad == last + 1 and good < last and _is_chord(points[first:], tolerance):
            good, bad = last, last + 1
        while bad - good > 1:
            middle = (good + bad) // 2
            if _is_chord(points[first : middle + 1], tolerance):
                good = middle
            else:
                bad = middle
        kept.append(good)
    return points[kept]


def _is_chord(points: Points, tolerance: float) -> bool:
    """Return whether all points are within a tolerance of the chord from the first to the last one."""
    chord = points[-1] - points[0]
    inner = points[1:-1] - points[0]
    length = math.hypot(*chord)
    # The distance from the chord, not from its line: a curve may return beside its ends.
    along = np.clip(inner @ chord / length**2, 0.0, 1.0) if length > 0.0 else np.zeros(len(inner))
    return bool(np.hypot(*(inner - along[:, None] * chord).T).max(initial=0.0) <= tolerance)


# Contours -------------------------------------------------------------------------------------------------------------


class _Net:
    """Curves of a layer, and the nodes at which their ends meet."""

    def __init__(self, curves: Sequence[Curve], tolerance: float) -> None:
        self.curves, self.tolerance = list(curves), tolerance
        self._number()

    def _number(self) -> None:
        """Number the nodes; ends within the tolerance of each other are one node."""
        ends = np.concatenate([curve.ends for curve in self.curves]) if self.curves else np.empty((0, 2))
        nodes = np.arange(len(ends))
        if len(ends):
            for first, second in sorted(cKDTree(ends).query_pairs(self.tolerance)):
                low, high = sorted((nodes[first], nodes[second]))
                nodes[nodes == high] = low
        self.nodes = [(int(nodes[2 * i]), int(nodes[2 * i + 1])) for i in range(len(self.curves))]
        self.places = ends

    def at(self, node: int) -> list[int]:
        """Return the curves with an end at a node, one with both ends twice."""
        return [index for index, ends in enumerate(self.nodes) for end in ends if end == node]

    def keep(self, kept: Sequence[int]) -> None:
        """Leave out all other curves."""
        self.curves = [self.curves[index] for index in kept]
        self._number()

    @property
    def degrees(self) -> dict[int, int]:
        """Number of ends at each node."""
        counts: dict[int, int] = {}
        for ends in self.nodes:
            for end in ends:
                counts[end] = counts.get(end, 0) + 1
        return counts


def closed_loops(
    curves: Sequence[Curve], frame: Frame, tolerance: float, *, axis: bool
) -> tuple[list[Loop], list[str]]:
    """Return the closed contours that curves of one layer form, and notes on curves that were left out.

    With an `axis`, the first axis of the frame, lines on it are left out, and a contour that begins and ends on it is
    closed along it.

    Raises
    ------
    FileFormatError
        A contour is open, or more than two curves meet; the message names entity, layer and place.
    """
    notes: list[str] = []
    long = [curve for curve in curves if np.ptp(curve.points, axis=0).max() > tolerance]
    if axis:
        kept = [curve for curve in long if np.abs(curve.points[:, 1]).max() > tolerance]
        if len(kept) < len(long):
            notes.append(f'{len(long) - len(kept)} lines on the axis in layer "{curves[0].layer}" are left out')
        long = [part for curve in kept for part in _beside_axis(curve, tolerance)]
    net = _Net(long, tolerance)
    notes += _drop_repeated(net)
    if axis:
        _divide_faces(net)
        notes += _drop_visible_edges(net)
    _check_nodes(net, frame, axis)
    loops = [_traced(net, chain) for chain in _chains(net)]
    loops = [loop for loop in loops if len(loop.points) > 2]
    if sum(len(loop.points) for loop in loops) > MOST_EDGES:
        edges = sum(len(loop.points) for loop in loops)
        raise wrong(
            f"has {edges} edges within the tolerance of {tolerance:.3g} {frame.unit}, expected at most {MOST_EDGES}; "
            "give a larger tolerance, or check the unit",
            curves[0].layer,
        )
    return loops, notes


def _beside_axis(curve: Curve, tolerance: float) -> list[Curve]:
    """Return the parts of a polyline between its edges on the axis, as if these were lines of their own."""
    on_axis = np.abs(curve.points[:, 1]) <= tolerance
    edges = on_axis[:-1] & on_axis[1:]
    if not edges.any():
        return [curve]
    cuts = np.flatnonzero(edges)
    starts, stops = [0, *(cuts + 1)], [*(cuts + 1), len(curve.points)]
    parts = [curve.points[i:j] for i, j in zip(starts, stops, strict=True) if j - i > 1]
    # Where a closed polyline begins beside the axis, its last part goes on with the first.
    if len(parts) > 1 and not on_axis[0] and math.hypot(*(parts[-1][-1] - parts[0][0])) <= tolerance:
        parts = [np.concatenate([parts[-1], parts[0][1:]]), *parts[1:-1]]
    return [replace(curve, points=points) for points in parts]


def _drop_repeated(net: _Net) -> list[str]:
    """Leave out lines that are drawn twice."""
    seen: set[tuple[int, ...]] = set()
    kept, repeated = [], []
    for index, (curve, ends) in enumerate(zip(net.curves, net.nodes, strict=True)):
        key = tuple(sorted(ends))
        if curve.is_straight and key in seen:
            repeated.append(curve.entity)
        else:
            kept.append(index)
        if curve.is_straight:
            seen.add(key)
    if not repeated:
        return []
    layer = net.curves[0].layer
    net.keep(kept)
    return [f'lines that are drawn twice in layer "{layer}" count once: {_listed(repeated)}']


def _divide_faces(net: _Net) -> None:
    """Divide curves at straight edges across the axis on which another curve ends.

    That is a shoulder with a visible edge, or the face in which a bore begins.
    """
    degrees = net.degrees
    free = [net.places[2 * i + side] for i, ends in enumerate(net.nodes) for side in (0, 1) if degrees[ends[side]] == 1]
    divided: list[Curve] = []
    for curve in net.curves:
        (x0, y0), (x1, y1) = curve.points[:-1].T, curve.points[1:].T
        low, high = np.minimum(y0, y1) + net.tolerance, np.maximum(y0, y1) - net.tolerance
        places: dict[int, list[float]] = {}
        for x, y in free:
            across = (np.maximum(np.abs(x0 - x), np.abs(x1 - x)) <= net.tolerance) & (low < y) & (y < high)
            for edge in np.flatnonzero(across).tolist():
                places.setdefault(edge, []).append(float(y))
        begun = 0
        before: list[Points] = []
        for edge, heights in sorted(places.items()):
            before += list(curve.points[begun : edge + 1])
            begun = edge + 1
            for y in sorted(set(heights), reverse=bool(y1[edge] < y0[edge])):
                place = np.array((x0[edge], y))
                divided.append(replace(curve, points=np.array([*before, place])))
                before = [place]
        divided.append(replace(curve, points=np.array([*before, *curve.points[begun:]])) if places else curve)
    if len(divided) > len(net.curves):
        net.curves = divided
        net.keep(range(len(divided)))


def _drop_visible_edges(net: _Net) -> list[str]:
    """Leave out lines across the axis that are no part of a contour: edges that the drawing shows within it."""
    dropped: list[str] = []
    degrees = net.degrees
    kept = []
    for index, (curve, ends) in enumerate(zip(net.curves, net.nodes, strict=True)):
        across = curve.is_straight and abs(curve.points[1, 0] - curve.points[0, 0]) <= net.tolerance
        inner = [degrees[end] > 2 for end in ends]
        on_axis = [abs(y) <= net.tolerance and degrees[end] == 1 for end, y in zip(ends, curve.ends[:, 1], strict=True)]
        if across and any(inner) and all(a or b for a, b in zip(inner, on_axis, strict=True)):
            dropped.append(curve.entity)
            for end in ends:
                degrees[end] -= 1
        else:
            kept.append(index)
    if not dropped:
        return []
    layer = net.curves[0].layer
    net.keep(kept)
    return [f'edges within the contour in layer "{layer}" are left out: {_listed(dropped)}']


def _check_nodes(net: _Net, frame: Frame, axis: bool) -> None:
    """Raise at a node where a contour is open, or where it is not clear how it goes on."""
    degrees = net.degrees
    ends = [(node, index, side) for index, pair in enumerate(net.nodes) for side, node in enumerate(pair)]
    for node, index, side in ends:
        if degrees[node] > 2:
            curve = net.curves[index]
            names = _listed([net.curves[i].entity for i in dict.fromkeys(net.at(node))])
            raise wrong(
                f"{degrees[node]} lines meet here, expected two: {names}; put edges that are no part of the contour "
                "into another layer",
                curve.layer,
                curve.entity,
                frame.place(net.places[2 * index + side]),
            )
    free = [(index, 2 * index + side) for node, index, side in ends if degrees[node] == 1]
    if axis:
        free = [(index, end) for index, end in free if abs(net.places[end, 1]) > net.tolerance]
    if not free:
        return
    index, end = free[0]
    curve, here = net.curves[index], net.places[end]
    raise wrong(_open_end(net, free, frame, axis), curve.layer, curve.entity, frame.place(here))


def _open_end(net: _Net, free: Sequence[tuple[int, int]], frame: Frame, axis: bool) -> str:
    """Return what is wrong with the first of the free ends: it is near another end, near the axis, or on a line."""
    index, end = free[0]
    here, unit = net.places[end], frame.unit
    others = [(math.hypot(*(net.places[o] - here)), net.curves[i].entity, o) for i, o in free if i != index]
    opposite = 2 * index + 1 - end % 2
    if not others and len(net.curves[index].points) > 2 and any(o == opposite for _, o in free):
        others = [(math.hypot(*(net.places[opposite] - here)), "the same entity", opposite)]
    gap, entity, other = min(others, default=(math.inf, "", end))
    lines = [(_distance(curve.points, here), curve.entity) for i, curve in enumerate(net.curves) if i != index]
    beside, line = min(lines, default=(math.inf, ""))
    from_axis = abs(here[1]) if axis else math.inf
    if beside <= net.tolerance:
        return (
            f"this end is on {line}, whose contour does not begin there; put a bore into a layer BORE, or a layer that "
            "`bore_layer` names, and what is no part of the contour into another one"
        )
    if from_axis < min(gap, beside):
        ends = [o for i, o in free if i == index]
        both = len(ends) > 1 and abs(net.places[ends[0], 1] - net.places[ends[1], 1]) <= net.tolerance
        return (
            f"the profile misses the axis: it ends {from_axis:.4g} {unit} from it{' at both ends' if both else ''}, "
            "expected an end on it, or a closed contour; move the end in the drawing, or state the axis with `axis`"
        )
    if beside < gap:
        return f"the contour is open: the nearest line is {line}, {beside:.4g} {unit} away; close it in the drawing"
    if not others:
        return "the contour is open: this end touches no other line; close it in the drawing"
    near = frame.place(net.places[other])
    return (
        f"the contour is open: the nearest free end is that of {entity} at {near}, {gap:.4g} {unit} away; close it in "
        "the drawing"
    )


def _distance(points: Points, place: Points) -> float:
    """Return the distance of a place from a polyline."""
    start, along = points[:-1], np.diff(points, axis=0)
    length = np.maximum((along**2).sum(axis=1), np.finfo(float).tiny)
    share = np.clip(((place - start) * along).sum(axis=1) / length, 0.0, 1.0)
    return float(np.hypot(*(start + share[:, None] * along - place).T).min())


def _chains(net: _Net) -> list[list[tuple[int, bool]]]:
    """Return the curves of each contour in order, and whether they are reversed."""
    by_node: dict[int, list[int]] = {}
    for index, ends in enumerate(net.nodes):
        for end in dict.fromkeys(ends):
            by_node.setdefault(end, []).append(index)
    degrees = net.degrees
    left = set(range(len(net.curves)))
    chains = []
    # Contours that begin on the axis are followed from there.
    starts = sorted(left, key=lambda index: all(degrees[end] == 2 for end in net.nodes[index]))
    for start in starts:
        if start not in left:
            continue
        left.discard(start)
        first, node = net.nodes[start]
        reverse = degrees[first] == 2 and degrees[node] == 1
        if reverse:
            node = first
        chain = [(start, reverse)]
        while True:
            following = next((index for index in by_node[node] if index in left), None)
            if following is None:
                break
            left.discard(following)
            begin, end = net.nodes[following]
            chain.append((following, begin != node))
            node = end if begin == node else begin
        chains.append(chain)
    return chains


def _traced(net: _Net, chain: Sequence[tuple[int, bool]]) -> Loop:
    """Return the closed contour of curves in order; ends that are one node within the tolerance become one point."""
    points: list[Points] = []
    entities: list[str] = []
    for index, reverse in chain:
        curve = net.curves[index]
        ordered = curve.points[::-1] if reverse else curve.points
        points += list(ordered[:-1])
        entities += [curve.entity] * (len(ordered) - 1)
    last_index, last_reverse = chain[-1]
    last = net.curves[last_index].ends[0 if last_reverse else 1]
    if math.hypot(*(last - points[0])) > net.tolerance:  # closed along the axis
        points.append(last)
        entities.append("the axis")
    return Loop(np.array(points), tuple(entities), net.curves[last_index].layer)


def _listed(entities: Sequence[str]) -> str:
    """Return the first of many entities, and how many more there are."""
    rest = len(entities) - _NAMED
    return ", ".join(entities[:_NAMED]) + (f" and {rest} more" if rest > 0 else "")
