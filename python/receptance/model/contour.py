"""Contours of bodies of revolution: outer profile and bores, divided into cylinders and cones.

A profile is a chain of points in the direction of x. Two points at one x are a step, different diameters at different x
a cone, and an arc is divided into cones that deviate from it by no more than a tolerance.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

from receptance import _checks
from receptance.report.table import amount

Points = Sequence[Sequence[float]]
"""Points (x, diameter) or (x, diameter, radius of the arc that leads to it) in m."""
Chain = tuple[tuple[float, float], ...]
"""Points (x, diameter) in m, without arcs; x does not decrease."""

TOLERANCE = 2e-5
"""Default of the largest distance between an arc and the cones that replace it, in m."""
MOST_PIECES = 300
"""Largest number of pieces of a contour; every piece is computed on every frequency line."""
_SAME = 1e-9
"""Distance in m within which two points are at one x."""
_BLUNT = 0.2
"""Diameter of the face that replaces a point at an end, relative to the largest diameter."""
_COMMON = 10.0
"""Largest usual length in m; a longer contour is probably in mm."""


def millimetres(value: float) -> str:
    """Return a length in m as text in mm, with up to seven digits.

    Examples
    --------
    >>> from receptance.model.contour import millimetres
    >>> millimetres(0.0127)
    '12.7 mm'
    """
    return f"{1e3 * value:.7g} mm"


class PointError(ValueError):
    """A wrong point of a profile, whose `index` tells a reader its place in a file."""

    def __init__(self, profile: str, index: int, problem: str) -> None:
        super().__init__(profile, index, problem)
        self.profile, self.index, self.problem = profile, index, problem

    def __str__(self) -> str:
        return f"{self.profile}[{self.index}] {self.problem}"


@dataclass(frozen=True)
class Piece:
    """A frustum with a conical bore between two planes: a cylinder, a tube or a cone. Lengths are in m."""

    start: float
    """Distance of the near end from the tip-side end of the contour."""
    length: float
    outer_diameter: float
    end_outer_diameter: float
    inner_diameter: float = 0.0
    end_inner_diameter: float = 0.0

    @property
    def is_cylindrical(self) -> bool:
        """Whether both diameters are the same at both ends."""
        same = self.outer_diameter == self.end_outer_diameter
        return same and self.inner_diameter == self.end_inner_diameter

    @property
    def _ends(self) -> tuple[tuple[float, float, float], ...]:
        """Diameters of body and bore at both ends, with the sign of what they enclose."""
        outer, inner = (self.outer_diameter, self.end_outer_diameter), (self.inner_diameter, self.end_inner_diameter)
        return (*outer, 1.0), (*inner, -1.0)

    @property
    def volume(self) -> float:
        """Volume in m3, of the frustum less that of the bore: pi length (a^2 + a b + b^2) / 12 of each."""
        ends = (
            (self.outer_diameter, self.end_outer_diameter, 1.0),
            (self.inner_diameter, self.end_inner_diameter, -1.0),
        )
        return math.pi * self.length / 12.0 * sum(sign * (a * a + a * b + b * b) for a, b, sign in ends)

    @property
    def first_moment(self) -> float:
        """First moment of volume about the tip-side end of the contour in m4.

        That of a frustum about its near end is pi length^2 (a^2 + 2 a b + 3 b^2) / 48.
        """
        ends = (
            (self.outer_diameter, self.end_outer_diameter, 1.0),
            (self.inner_diameter, self.end_inner_diameter, -1.0),
        )
        moment = sum(sign * (a * a + 2.0 * a * b + 3.0 * b * b) for a, b, sign in ends)
        return math.pi * self.length**2 / 48.0 * moment + self.start * self.volume


@dataclass(frozen=True)
class Contour:
    """The contour of a body of revolution along x: an outer profile, and bores.

    Parameters
    ----------
    outer : sequence of points
        Points (x, diameter) in m, from the tip-side end to the far end. Two points at one x are a step, other ones the
        ends of a cylinder or a cone. A point (x, diameter, r) ends an arc of the radius |r| from the point before it,
        the shorter one of the two: with r > 0 it bulges away from the axis, with r < 0 towards it. An end in a point,
        of a drill or a ball nose, is replaced by a face of a fifth of the largest diameter, and `notes` tell it,
        because the flexibility of a pointed beam at its point is unbounded.
    bores : sequence of sequences of points, optional
        The profile of each bore, in the same form; a bore may end in a point. Bores do not overlap.
    radii : bool, optional
        Whether the points are a half profile, (x, radius).
    tolerance : float, optional
        Largest distance in m between an arc and the cones that replace it.
    owner : str, optional
        Beginning of the messages of errors.

    Raises
    ------
    ValueError, TypeError
        A profile goes back in x or has no length, a bore is larger than the body or outside of it, or there are more
        than 300 pieces; the message names the place.

    Notes
    -----
    Steps need no face: at one x the first point ends what is before, the last one begins what is behind.

    Examples
    --------
    A holder with a conical nose, a flange and a bore:

    >>> from receptance.model.contour import Contour
    >>> holder = Contour(
    ...     [(0.0, 0.027), (0.05, 0.033), (0.05, 0.063), (0.07, 0.063)],
    ...     bores=[[(0.0, 0.012), (0.04, 0.012)]],
    ... )
    >>> [(round(1e3 * piece.length), piece.inner_diameter) for piece in holder.pieces]
    [(40, 0.012), (10, 0.0), (20, 0.0)]
    """

    outer: Chain
    bores: tuple[Chain, ...]
    notes: tuple[str, ...]

    def __init__(
        self,
        outer: Points,
        bores: Iterable[Points] = (),
        *,
        radii: bool = False,
        tolerance: float = TOLERANCE,
        owner: str = "Contour",
    ) -> None:
        tolerance = _checks.positive(owner, "tolerance", tolerance, unit="m")
        factor = 2.0 if radii else 1.0
        body = _chain(f"{owner}: outer", outer, factor, tolerance)
        body, notes = _with_faces(f"{owner}: outer", body)
        holes = [_chain(f"{owner}: bores[{index}]", bore, factor, tolerance) for index, bore in enumerate(bores)]
        _check_bores(owner, body, holes)
        _checks.set_fields(self, {"outer": body, "bores": tuple(holes), "notes": notes})
        breaks = self._breaks
        if len(breaks) - 1 > MOST_PIECES:
            raise ValueError(
                f"{owner}: has {len(breaks) - 1} pieces, expected at most {MOST_PIECES}; give a larger tolerance than "
                f"{millimetres(tolerance)}, or fewer points{_unit_hint(self.length)}"
            )
        _check_pieces(owner, body[0][0], self.pieces)

    @property
    def length(self) -> float:
        """Length in m."""
        return self.outer[-1][0] - self.outer[0][0]

    @property
    def largest_diameter(self) -> float:
        """Largest outer diameter in m."""
        return max(diameter for _, diameter in self.outer)

    @property
    def volume(self) -> float:
        """Volume in m3, without the bores."""
        return sum(piece.volume for piece in self.pieces)

    @property
    def centre_of_gravity(self) -> float:
        """Distance of the centre of gravity of a homogeneous body from its tip-side end, in m."""
        return sum(piece.first_moment for piece in self.pieces) / self.volume

    @cached_property
    def pieces(self) -> tuple[Piece, ...]:
        """Cylinders and cones from the tip-side end on, divided where the profile or a bore changes."""
        start = self.outer[0][0]
        pieces = []
        for low, high in pairwise(self._breaks):
            outer, end_outer = _ends(self.outer, low, high)
            bore = next((bore for bore in self.bores if bore[0][0] - _SAME < low and high < bore[-1][0] + _SAME), None)
            inner, end_inner = (0.0, 0.0) if bore is None else _ends(bore, low, high)
            pieces.append(Piece(low - start, high - low, outer, end_outer, inner, end_inner))
        return tuple(pieces)

    @property
    def _breaks(self) -> list[float]:
        """Positions along x at which the profile or a bore changes."""
        ordered = sorted(x for chain in (self.outer, *self.bores) for x, _ in chain)
        breaks = ordered[:1]
        for x in ordered[1:]:
            if x - breaks[-1] > _SAME:
                breaks.append(x)
        return breaks


def _unit_hint(length: float) -> str:
    """Return a hint at a wrong unit for a contour that is unusually long."""
    return f"; it is {amount(length, 'm')} long: give lengths in metres, not in millimetres" if length > _COMMON else ""


# Points of a profile --------------------------------------------------------------------------------------------------


def _chain(owner: str, points: Points, factor: float, tolerance: float) -> Chain:
    """Return the points of a profile with arcs divided, in diameters; the diameters given are times `factor`."""
    chain: list[tuple[float, float]] = []
    for index, point in enumerate(_checked(owner, points)):
        x, diameter = point[0], factor * point[1]
        if chain and x < chain[-1][0] - _SAME:
            problem = (
                f"goes back from x = {millimetres(chain[-1][0])} to {millimetres(x)}, expected x that does not "
                "decrease; a step is two points at one x"
            )
            raise PointError(owner, index, problem)
        if len(point) > 2 and point[2] and chain:
            radius = point[2]
            try:
                chain += _arc(chain[-1], (x, diameter), radius, tolerance)
            except ValueError as error:
                raise PointError(owner, index, f"ends an arc {error}") from None
        elif len(chain) > 1 and abs(x - chain[-2][0]) < _SAME and abs(x - chain[-1][0]) < _SAME:
            chain[-1] = (chain[-2][0], diameter)  # a step has two points
        else:
            chain.append((x, diameter))
    length = chain[-1][0] - chain[0][0]
    if length < _SAME:
        raise ValueError(f"{owner} has no length: it begins and ends at x = {millimetres(chain[0][0])}")
    # Steps at an end are faces.
    first = max(index for index, (x, _) in enumerate(chain) if x - chain[0][0] < _SAME)
    last = min(index for index, (x, _) in enumerate(chain) if chain[-1][0] - x < _SAME)
    return _without_repeats(chain[first : last + 1])


def _checked(owner: str, points: Any) -> list[tuple[float, ...]]:
    """Return the points as tuples of finite numbers."""
    checked: list[tuple[float, ...]] = []
    for index, point in enumerate(points):
        try:
            numbers = tuple(float(number) for number in point)
        except (TypeError, ValueError):
            numbers = ()
        if len(numbers) not in (2, 3):
            raise TypeError(
                f"{owner}[{index}] is {point!r}, expected a point (x, diameter) or (x, diameter, radius of an arc)"
            )
        if not all(map(math.isfinite, numbers)):
            raise PointError(owner, index, f"is {point!r}, expected finite numbers")
        if numbers[1] < 0.0:
            raise PointError(owner, index, f"has the diameter {millimetres(numbers[1])}, expected zero or more")
        checked.append(numbers)
    if len(checked) < 2:
        raise ValueError(f"{owner} has {len(checked)} points, expected two or more")
    return checked


def _arc(
    start: tuple[float, float], end: tuple[float, float], radius: float, tolerance: float
) -> list[tuple[float, float]]:
    """Return the points of an arc behind its start; diameters are twice the distance from the axis.

    The messages of errors continue "ends an arc".
    """
    (x0, r0), (x1, r1) = (start[0], 0.5 * start[1]), (end[0], 0.5 * end[1])
    chord = math.hypot(x1 - x0, r1 - r0)
    if chord > 2.0 * abs(radius) * (1.0 + 1e-6):
        raise ValueError(
            f"of the radius {millimetres(abs(radius))}, but its ends are {millimetres(chord)} apart, expected at most "
            "twice the radius"
        )
    if chord < _SAME:
        return [end]
    height = math.sqrt(max(radius * radius - 0.25 * chord * chord, 0.0))
    side = math.copysign(1.0, radius)
    along, across = (x1 - x0) / chord, (r1 - r0) / chord
    centre_x = 0.5 * (x0 + x1) + side * height * across
    centre_r = 0.5 * (r0 + r1) - side * height * along
    sweep = -side * 2.0 * math.asin(min(0.5 * chord / abs(radius), 1.0))
    first = math.atan2(r0 - centre_r, x0 - centre_x)
    # A chord over the angle a is radius (1 - cos(a / 2)) away from its arc.
    step = 2.0 * math.acos(max(1.0 - tolerance / abs(radius), 0.0)) if tolerance < abs(radius) else math.pi
    count = max(math.ceil(abs(sweep) / step - 1e-9), 1)
    if count > MOST_PIECES:
        raise ValueError(
            f"that needs {count} cones, expected at most {MOST_PIECES}; give a larger tolerance than "
            f"{millimetres(tolerance)}{_unit_hint(chord)}"
        )
    angles = [first + sweep * number / count for number in range(1, count)]
    points = [(centre_x + abs(radius) * math.cos(a), 2.0 * (centre_r + abs(radius) * math.sin(a))) for a in angles]
    for before, after in pairwise([start, *points, end]):
        if after[0] < before[0] - _SAME:
            raise ValueError(
                f"that goes back at x = {millimetres(before[0])}, an undercut, expected x that does not decrease; give "
                "another radius"
            )
        if after[1] < 0.0:
            raise ValueError(f"that crosses the axis at x = {millimetres(after[0])}")
    return [*points, end]


def _without_repeats(chain: list[tuple[float, float]]) -> Chain:
    """Return a chain without repeated points, and without points between two others of one diameter."""
    kept: list[tuple[float, float]] = []
    for point in chain:
        if kept and abs(point[0] - kept[-1][0]) < _SAME and abs(point[1] - kept[-1][1]) < _SAME:
            continue
        if len(kept) > 1 and kept[-2][1] == kept[-1][1] == point[1]:
            kept.pop()
        kept.append(point)
    return tuple(kept)


def _with_faces(owner: str, chain: Chain) -> tuple[Chain, tuple[str, ...]]:
    """Return an outer profile with a face in place of a point at an end, and the notes that tell it."""
    face = _BLUNT * max(diameter for _, diameter in chain)
    if face == 0.0:
        raise ValueError(f"{owner} has no diameter above zero")
    notes = []
    for place, sign in (("tip-side", 1.0), ("far", -1.0)):
        if chain[0][1] < _SAME:
            x = chain[0][0]
            index = next(i for i, (_, diameter) in enumerate(chain) if diameter > face)
            (x0, d0), (x1, d1) = chain[index - 1], chain[index]
            reached = x0 + (x1 - x0) * (face - d0) / (d1 - d0)
            chain = ((x, face), (reached, face), *chain[index:])
            chain = _without_repeats(list(chain))
            notes.append(
                f"the {place} end is a point at x = {millimetres(sign * x)}; a face of the diameter "
                f"{millimetres(face)} replaces it over {millimetres(abs(reached - x))}"
            )
        # The far end is the near one of the reflected profile.
        chain = tuple((-x, diameter) for x, diameter in reversed(chain))
    for x, diameter in chain:
        if diameter < _SAME:
            raise ValueError(
                f"{owner} has the diameter 0 at x = {millimetres(x)}, expected a body that is in one piece"
            )
    return chain, tuple(notes)


# Pieces ---------------------------------------------------------------------------------------------------------------


def _ends(chain: Chain, low: float, high: float) -> tuple[float, float]:
    """Return the diameters of a profile at the ends of an interval in which it is a cylinder or a cone."""
    # The edge that contains the middle is no step.
    index = bisect_right([x for x, _ in chain], 0.5 * (low + high))
    (x0, d0), (x1, d1) = chain[index - 1], chain[index]
    if d0 == d1:
        return d0, d0
    slope = (d1 - d0) / (x1 - x0)

    def at(x: float) -> float:
        return d0 if abs(x - x0) < _SAME else d1 if abs(x - x1) < _SAME else d0 + slope * (x - x0)

    return at(low), at(high)


def _check_bores(owner: str, body: Chain, bores: Sequence[Chain]) -> None:
    """Raise if a bore is outside of the body, or if two overlap."""
    low, high = body[0][0], body[-1][0]
    for index, bore in enumerate(bores):
        ends = bore[0][0], bore[-1][0]
        if ends[0] < low - _SAME or ends[1] > high + _SAME:
            raise ValueError(
                f"{owner}: bores[{index}] is from x = {millimetres(ends[0])} to {millimetres(ends[1])}, expected a "
                f"bore inside of the body, which is from {millimetres(low)} to {millimetres(high)}"
            )
    ordered = sorted(range(len(bores)), key=lambda index: bores[index][0][0])
    for before, after in pairwise(ordered):
        end, begin = bores[before][-1][0], bores[after][0][0]
        if begin < end - _SAME:
            raise ValueError(
                f"{owner}: bores[{after}] begins at x = {millimetres(begin)}, where bores[{before}], which ends at "
                f"{millimetres(end)}, still is; expected bores that do not overlap, or one profile"
            )


def _check_pieces(owner: str, start: float, pieces: Sequence[Piece]) -> None:
    """Raise where a bore is as large as the body."""
    for piece in pieces:
        ends = (
            (piece.start, piece.outer_diameter, piece.inner_diameter),
            (piece.start + piece.length, piece.end_outer_diameter, piece.end_inner_diameter),
        )
        for x, outer, inner in ends:
            if inner >= outer:
                raise ValueError(
                    f"{owner}: at x = {millimetres(start + x)} the outer diameter is {millimetres(outer)} and that of "
                    f"the bore {millimetres(inner)}, expected a bore that is smaller"
                )
