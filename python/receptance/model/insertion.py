"""A shank in the bore of a holder: parts as drawn become what protrudes, and the holder with a core in its nose."""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

from receptance import _checks
from receptance.model.addresses import edges_of
from receptance.model.assembly import Assembly
from receptance.model.beams import Material, Part, Segment

FIT = 0.01
"""Largest difference of the diameters of shank and bore, relative to that of the shank."""
_STEP = 1e-3
"""Largest relative difference of diameters in one place that is no step."""
_SHORTEST = 1e-9
"""Length in m below which there is no piece."""
_ADDRESS = re.compile(r"segment\[(\d+)\]\.(.+)")
_DIAMETER = re.compile(r"(?P<end>end_)?(?P<side>outer|inner)_diameter")


@dataclass(frozen=True)
class Piece:
    """A piece of a segment as drawn, between two shares of its length, and the segment that it is after the insertion.

    A piece of the shank in the bore is the core of a segment of the holder.
    """

    drawn: tuple[str, int]
    """Name of the part and number of the segment as drawn."""
    start: float
    end: float
    made: tuple[str, int]
    """Name of the part and number of the segment after the insertion."""
    is_core: bool = False
    """Whether it is a piece of the shank in the bore."""
    around_shank: bool = False
    """Whether it is a piece of the holder with the shank in its bore."""
    solidity: float = 1.0
    """Share of the area of the shank that its own bore leaves."""


@dataclass(frozen=True)
class Insertion:
    """Tool and holder with the shank in the bore; `insert` makes it.

    Attributes
    ----------
    tool : Part
        What protrudes from the holder.
    holder : Part
        The holder with the shank as core of its nose, bonded to it.
    length : float
        Length of the insertion in m.
    pieces : tuple of Piece
        What has become of every segment as drawn.
    edges : tuple of (str, int)
        Ends of the segments of the holder, as name of a part as drawn and number of an end of its segments; the end of
        the shank is the last one of the tool.
    """

    tool: Part
    holder: Part
    length: float
    pieces: tuple[Piece, ...]
    edges: tuple[tuple[str, int], ...]

    @property
    def divided(self) -> int | None:
        """Number of the segment of the holder in which the insertion ends; None where it ends between two segments.

        Behind it the numbers of the segments are larger by one in the holder with the shank.
        """
        cut = (piece for piece in self.pieces if piece.drawn[0] == self.holder.name and piece.start > 0.0)
        return next((piece.drawn[1] for piece in cut if not piece.around_shank), None)

    def moved(self, address: str) -> dict[str, float]:
        """Return the parameters that change with a parameter of the parts as drawn, and their change per unit of it.

        A modulus of the shank is one of the tool and of the core, a diameter of the holder one of both pieces of a
        divided segment. A length changes what is not in the bore, because the insertion is as stated; the diameters of
        a cone at a cut remain.

        Examples
        --------
        >>> from receptance import CARBIDE, STEEL, Part, Segment
        >>> from receptance.model.insertion import insert
        >>> tool = Part([Segment(length=0.1, outer_diameter=0.012, material=CARBIDE)], name="tool")
        >>> nose = Segment(length=0.08, outer_diameter=0.04, inner_diameter=0.012, material=STEEL)
        >>> inserted = insert(tool, Part([nose], name="holder"), 0.03)
        >>> inserted.moved("tool.segment[0].density")
        {'tool.segment[0].density': 1.0, 'holder.segment[0].core.density': 1.0}
        >>> inserted.moved("holder.segment[0].length")
        {'holder.segment[1].length': 1.0}
        """
        owner, _, rest = address.partition(".")
        match = _ADDRESS.fullmatch(rest)
        if match is None or owner not in (self.tool.name, self.holder.name):
            return {address: 1.0}
        field, number = match[2], int(match[1])
        pieces = [piece for piece in self.pieces if piece.drawn == (owner, number)]
        if field == "length":
            return self._moved_by_length(owner, number)
        moves: dict[str, float] = {}
        for piece in pieces:
            moves |= self._moved_field(piece, field)
        return moves

    def _moved_by_length(self, owner: str, number: int) -> dict[str, float]:
        """Return the lengths that change with the length of a segment as drawn; the insertion remains as stated."""
        moves: dict[str, float] = {}
        if owner == self.tool.name:
            # Where the segment is in the bore, its end or all of it, what protrudes is longer.
            moves[f"{owner}.segment[{min(number, len(self.tool.segments) - 1)}].length"] = 1.0
        shifts = [self._shift(edge, owner, number) for edge in self.edges]
        for index, (near, far) in enumerate(pairwise(shifts)):
            if far != near:
                moves[f"{self.holder.name}.segment[{index}].length"] = far - near
        return moves

    def _shift(self, edge: tuple[str, int], owner: str, number: int) -> float:
        """Return how far an end of a segment of the holder moves with the length of a segment as drawn."""
        part, index = edge
        if part != owner:
            return 0.0
        behind = 1.0 if index > number else 0.0
        return behind - 1.0 if part == self.tool.name else behind  # the end of the shank does not move

    def _moved_field(self, piece: Piece, field: str) -> dict[str, float]:
        part, number = piece.made
        first = f"{part}.segment[{number}]."
        match = _DIAMETER.fullmatch(field)
        if match is None:
            if not piece.is_core:
                return {f"{first}{field}": 1.0}
            scale = {"youngs_modulus": _bending(piece.solidity), "density": piece.solidity}.get(field, 1.0)
            return {f"{first}core.{field}": scale} if field in Material.columns_of else {}
        # The bore around the shank has the diameter of the shank, in which its own bore is no dimension.
        if match["side"] == "inner" and (piece.is_core or piece.around_shank):
            return {}
        name = "inner_diameter" if piece.is_core else f"{match['side']}_diameter"
        made = (self.tool if part == self.tool.name else self.holder).segments[number]
        if getattr(made, f"end_{name}") is None:
            return {} if match["end"] else {f"{first}{name}": 1.0}
        near, far = (share if match["end"] else 1.0 - share for share in (piece.start, piece.end))
        return {f"{first}{key}": share for key, share in ((name, near), (f"end_{name}", far)) if share}


def insert(tool: Part, holder: Part, length: float, *, bore_solid: bool = False) -> Insertion:
    """Put the shank of a tool into the bore of a holder.

    Both parts are those of their drawings: the tool with its whole shank, the holder with its empty bore. The end of
    the shank is divided off and becomes the core of the nose of the holder, whose segments are divided where the shank
    ends; a bore behind it remains empty. Shank and bore may be conical. The shank is the end of the tool up to the
    first step of its diameter, so that flutes or a neck in front of it may be thicker or thinner. A bore in the shank
    is represented by a core with less stiffness and density, right in bending and in mass.

    Parameters
    ----------
    tool, holder : Part
        The parts, which touch at the end of the tool and the first segment of the holder.
    length : float
        Length of the shank in the bore in m, more than zero.
    bore_solid : bool, default False
        Give segments of the holder without a bore that of the shank, as far as it reaches: for holders that are
        described without their bore.

    Raises
    ------
    ValueError, TypeError
        A shank that does not fit its bore within 1 %, an insertion longer than the bore or than the shank; the message
        states the diameters and lengths.

    Examples
    --------
    >>> from receptance import CARBIDE, STEEL, Part, Segment, insert
    >>> flutes = Segment(length=0.03, outer_diameter=0.0096, material=CARBIDE)
    >>> shank = Segment(length=0.053, outer_diameter=0.012, material=CARBIDE)
    >>> nose = Segment(
    ...     length=0.05, outer_diameter=0.03, end_outer_diameter=0.04, inner_diameter=0.012, material=STEEL
    ... )
    >>> inserted = insert(Part([flutes, shank], name="tool"), Part([nose], name="holder"), 0.04)
    >>> [f"{1e3 * segment.length:g} mm" for segment in (*inserted.tool.segments, *inserted.holder.segments)]
    ['30 mm', '13 mm', '40 mm', '10 mm']
    >>> [segment.core is not None for segment in inserted.holder.segments]
    [True, False]
    """
    for name, part in (("tool", tool), ("holder", holder)):
        if not isinstance(part, Part):
            raise TypeError(f"insert: {name} is {part!r}, expected a Part")
    length = _checks.positive("insert", "length", length, unit="m")
    names = (tool.name or "tool", holder.name or "holder")
    if names[0] == names[1]:
        raise ValueError(f"insert: tool and holder have the same name {names[0]!r}, expected two")
    _check_shank(tool, names[0], length)
    cut = tool.length - length
    _check_bore(tool, holder, names, length, bore_solid=bore_solid)
    pieces: list[Piece] = []
    front: list[Segment] = []
    for number, (start, end) in enumerate(_between(tool, 0.0, cut)):
        if end > start:
            front.append(tool.segments[number].between(start, end) if end < 1.0 else tool.segments[number])
            pieces.append(Piece((names[0], number), start, end, (names[0], len(front) - 1)))
    ends = [edge - cut for edge in edges_of(tool)] + edges_of(holder)
    places = _distinct([0.0, *sorted(end for end in ends if _SHORTEST < end < length - _SHORTEST), length])
    nose: list[Segment] = []
    for begin, end in pairwise(places):
        number, near, far = _piece_of(holder, begin, end)
        shank_number, shank_near, shank_far = _piece_of(tool, cut + begin, cut + end)
        shank = tool.segments[shank_number].between(shank_near, shank_far)
        place = (names[1], len(nose))
        nose.append(_filled(holder.segments[number].between(near, far), shank))
        pieces.append(Piece((names[1], number), near, far, place, around_shank=True))
        solidity = _solidity(shank)
        pieces.append(Piece((names[0], shank_number), shank_near, shank_far, place, is_core=True, solidity=solidity))
    for number, (near, far) in enumerate(_between(holder, length, holder.length)):
        if far > near:
            pieces.append(Piece((names[1], number), near, far, (names[1], len(nose))))
            segment = holder.segments[number]
            nose.append(segment.between(near, far) if near > 0.0 else segment)
    made = Part(nose, name=names[1])
    drawn = [(names[1], number, edge) for number, edge in enumerate(edges_of(holder))]
    drawn += [(names[0], number, edge - cut) for number, edge in enumerate(edges_of(tool))]
    # Where ends of both parts are in one place, it is that of the holder, so that no segment of no length begins there.
    nearest = [min(drawn, key=lambda other: abs(other[2] - edge) > 2.0 * _SHORTEST) for edge in edges_of(made)]
    edges = tuple((part, number) for part, number, _ in nearest)
    return Insertion(Part(front, name=names[0]), made, length, tuple(pieces), edges)


def fits_bore(shank: float, bore: float) -> bool:
    """Return whether a shank fits a bore by their diameters in m, within 1 % of that of the shank.

    Examples
    --------
    >>> from receptance.model.insertion import fits_bore
    >>> fits_bore(0.012, 0.01205), fits_bore(0.012, 0.0127)
    (True, False)
    """
    return abs(bore - shank) <= FIT * shank


def fitting_bore(assembly: Assembly) -> tuple[Part, Part, float] | None:
    """Return tool, holder and depth in m of an empty bore which the shank fits, None without one.

    Parts and places are those of `with_insertion`. A joint that has the insertion itself has no such bore.

    Examples
    --------
    >>> from receptance import CARBIDE, STEEL, Assembly, Part, PointJoint, Segment
    >>> from receptance.model.insertion import fitting_bore
    >>> tool = Part([Segment(length=0.1, outer_diameter=0.012, material=CARBIDE)], name="tool")
    >>> nose = Segment(length=0.05, outer_diameter=0.04, inner_diameter=0.012, material=STEEL)
    >>> joint = PointJoint(k_y=5e8, k_theta=1e5, name="joint")
    >>> fitting_bore(Assembly([tool, joint, Part([nose], name="holder")]))[2]
    0.05
    """
    chain = list(assembly.elements.values())
    before, behind = _sides(chain)
    pair = [element for element in chain[before : behind + 1] if isinstance(element, Part)]
    if len(pair) < 2 or any(hasattr(element, "length") for element in chain[before + 1 : behind]):
        return None
    tool, holder = pair
    end, depth = tool.segments[-1], 0.0
    if end.shape is not None or end.core is not None:
        return None
    shank = end.at(1.0)[0]
    for segment in holder.segments:
        if segment.core is not None or not all(fits_bore(shank, segment.at(share)[1]) for share in (0.0, 1.0)):
            break
        depth += segment.length
    return (tool, holder, depth) if depth else None


def _sides(chain: Sequence[Any]) -> tuple[int, int]:
    """Return the places of tool and holder in a chain: around the first joint, or the first two without joints."""
    joint = next((index for index, element in enumerate(chain) if element.role == "joint"), None)
    return (0, 1) if joint is None else (joint - 1, joint + 1)


def with_insertion(assembly: Assembly, length: float) -> tuple[Assembly, Insertion]:
    """Return an assembly with the shank of its tool in the bore of its holder, both as drawn, and the insertion.

    Tool and holder are the parts before and behind the first joint, or the first two parts of a chain without joints.

    Parameters
    ----------
    assembly : Assembly
        Parts as drawn, and a joint without length between them, which acts at the mouth of the bore.
    length : float
        Length of the shank in the bore in m.

    Raises
    ------
    ValueError, TypeError
        No two such parts, a joint that has the insertion itself, an attachment on the shank in the bore, or a shank
        that `insert` refuses.

    Examples
    --------
    >>> from receptance import CARBIDE, STEEL, Assembly, Part, PointJoint, Segment
    >>> from receptance.model.insertion import with_insertion
    >>> tool = Part([Segment(length=0.1, outer_diameter=0.012, material=CARBIDE)], name="tool")
    >>> nose = Segment(length=0.08, outer_diameter=0.04, inner_diameter=0.012, material=STEEL)
    >>> joint = PointJoint(k_y=5e8, k_theta=1e5, name="joint")
    >>> assembly, _ = with_insertion(Assembly([tool, joint, Part([nose], name="holder")]), 0.03)
    >>> f"{assembly.length:g} m", assembly.get("holder.segment[0].core.density")
    ('0.15 m', 14500.0)
    """
    chain = list(assembly.elements.items())
    before, behind = _sides([element for _, element in chain])
    joint = before + 1 if behind - before > 1 else None
    pair = [element for _, element in chain[before : behind + 1] if isinstance(element, Part)]
    if len(pair) < 2:
        names = ", ".join(assembly.elements)
        raise ValueError(f"the chain is {names}, expected the tool and the holder as parts on both sides of a joint")
    if joint is not None and hasattr(chain[joint][1], "length"):
        name, element = chain[joint]
        raise ValueError(
            f"the joint {name!r} is a {type(element).__name__}, which has the shank and the sleeve of the insertion "
            "itself; expected a joint without length, or no insertion"
        )
    made = insert(replace(pair[0], name=chain[before][0]), replace(pair[1], name=chain[behind][0]), length)
    chain[before], chain[behind] = (made.tool.name, made.tool), (made.holder.name, made.holder)
    elements = [element for _, element in chain]
    return Assembly(elements, assembly.attachments.values(), motion=assembly.motion), made


def _distinct(places: Sequence[float]) -> list[float]:
    """Return ascending places without those that are the same as the one before."""
    return [
        places[0],
        *(place for before, place in pairwise(places) if place - before > _SHORTEST),
    ]


def _between(part: Part, begin: float, end: float) -> list[tuple[float, float]]:
    """Return the shares of each segment of a part that are between two places in m; equal ones where there is none."""
    shares = []
    edges = edges_of(part)
    for near, far in pairwise(edges):
        first = 0.0 if begin <= near + _SHORTEST else min((begin - near) / (far - near), 1.0)
        last = 1.0 if end >= far - _SHORTEST else max((end - near) / (far - near), 0.0)
        empty = far <= begin + _SHORTEST or near >= end - _SHORTEST
        shares.append((0.0, 0.0) if empty else (first, last))
    return shares


def _piece_of(part: Part, begin: float, end: float) -> tuple[int, float, float]:
    """Return the segment between two places in m that no edge separates, and their shares of its length."""
    edges = edges_of(part)
    number = min(bisect_right(edges, 0.5 * (begin + end)) - 1, len(part.segments) - 1)
    near, size = edges[number], part.segments[number].length
    shares = [(place - near) / size for place in (begin, end)]
    first, last = (round(share) if abs(share - round(share)) * size < _SHORTEST else share for share in shares)
    return number, max(float(first), 0.0), min(float(last), 1.0)


def _filled(piece: Segment, shank: Segment) -> Segment:
    """Return a piece of the holder with a piece of the shank in its bore."""
    conical = shank.end_outer_diameter is not None
    changes: dict[str, Any] = {
        "inner_diameter": shank.outer_diameter,
        "end_inner_diameter": shank.end_outer_diameter if conical else None,
    }
    return replace(piece, **changes, core=_core(shank))


def _core(shank: Segment) -> Material:
    """Return the material of a solid core with the stiffness in bending and the mass of a shank with a bore."""
    solidity = _solidity(shank)
    if solidity == 1.0:
        return shank.material
    of_shank = shank.material
    modulus, density = _bending(solidity) * of_shank.youngs_modulus, solidity * of_shank.density
    return replace(of_shank, youngs_modulus=modulus, density=density)


def _solidity(shank: Segment) -> float:
    """Return the share of the area of a shank that its bore leaves, in the middle of a cone."""
    outer, inner = shank.at(0.5)
    return 1.0 - (inner / outer) ** 2


def _bending(solidity: float) -> float:
    """Return the second moment of area of a ring over that of the full circle, 1 - (d/D)^4."""
    return 1.0 - (1.0 - solidity) ** 2


# Errors ---------------------------------------------------------------------------------------------------------------


def _check_shank(tool: Part, name: str, length: float) -> None:
    """Raise if an insertion is longer than the shank, the end of the tool without a step."""
    shank, problem = 0.0, "and is the whole tool"
    behind: Segment | None = None
    for number in reversed(range(len(tool.segments))):
        segment = tool.segments[number]
        near = segment.ends[1][0]
        if behind is not None and abs(near - behind.outer_diameter) > _STEP * near:
            problem = f"in front of it is a step from {_mm(near)} to {_mm(behind.outer_diameter)}"
            break
        if segment.shape is not None:
            problem = f"in front of it {name}.segment[{number}] is not round"
            break
        if segment.core is not None:
            problem = f"in front of it {name}.segment[{number}] has a core"
            break
        shank, behind = shank + segment.length, segment
    if length > shank + _SHORTEST:
        raise ValueError(
            f"insert: the insertion is {_mm(length)}, longer than the shank of {name}, which is {_mm(shank)} long, "
            f"{problem}; expected at most its length"
        )
    if length > tool.length - _SHORTEST:
        raise ValueError(
            f"insert: the insertion is {_mm(length)}, the whole length of {name}, expected a part that protrudes"
        )


def _check_bore(tool: Part, holder: Part, names: tuple[str, str], length: float, *, bore_solid: bool) -> None:
    """Raise if the shank does not fit the bore, or the bore is not as deep as the insertion."""
    edges, cut, depth = edges_of(holder), tool.length - length, 0.0
    for number, (segment, begin) in enumerate(zip(holder.segments, edges, strict=False)):
        if begin >= length - _SHORTEST:
            return
        place = f"{names[1]}.segment[{number}]"
        if segment.core is not None:
            raise ValueError(f"insert: {place} has a core already, expected an empty bore for the shank of {names[0]}")
        end = min(edges[number + 1], length)
        for x in (begin, end):
            outer, bore = segment.at((x - begin) / segment.length)
            shank_number, near, _ = _piece_of(tool, cut + min(x, length), cut + min(x, length))
            shank = tool.segments[shank_number].at(near)[0]
            fits = fits_bore(shank, bore) and outer > shank
            if not fits and not (bore_solid and bore == 0.0 and outer > shank):
                _raise_misfit(names, place, length, depth, (shank, bore, outer))
        depth = end
    if length > holder.length + _SHORTEST:
        raise ValueError(
            f"insert: the insertion is {_mm(length)}, longer than the bore of {names[1]}, which is "
            f"{_mm(holder.length)} deep, through the whole part"
        )


def _raise_misfit(
    names: tuple[str, str], place: str, length: float, depth: float, diameters: tuple[float, float, float]
) -> None:
    """Raise for a place of the holder that does not fit the shank; up to `depth` in m it does."""
    shank, bore, outer = diameters
    there = f"a bore of {_mm(bore)}" if bore else "no bore"
    if outer <= shank:
        there = f"an outer diameter of {_mm(outer)}"
    if depth > _SHORTEST:
        raise ValueError(
            f"insert: the insertion is {_mm(length)}, longer than the bore of {names[1]} for the shank of "
            f"{_mm(shank)}, which is {_mm(depth)} deep; behind it {place} has {there}"
        )
    raise ValueError(
        f"insert: the shank of {names[0]} has {_mm(shank)} and {place} has {there}, expected a bore of the diameter "
        f"of the shank within {100.0 * FIT:g} %; a collet or sleeve around the shank counts as holder"
    )


def _mm(length: float) -> str:
    return f"{1e3 * length:.6g} mm"
