"""Reading of drawings: the contour of a part, and the outline of a section."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from os import PathLike
from pathlib import Path
from typing import Literal, TypedDict, Unpack

import numpy as np

from receptance import _checks
from receptance._text import did_you_mean, join_names, shown
from receptance.drawing import csv_points
from receptance.drawing.curves import Curve, Frame, Loop, closed_loops, wrong
from receptance.drawing.dxf_entities import Sheet, read_sheet
from receptance.drawing.revolution import Revolved, Ring, revolve
from receptance.io import FileFormatError
from receptance.io.errors import error_location
from receptance.model.contour import TOLERANCE, Contour
from receptance.report.table import amount
from receptance.units import COORDINATE, parse

Tip = Literal["left", "right", "bottom", "top"]
TIPS: tuple[Tip, ...] = ("left", "right", "bottom", "top")
"""Ends of a drawing at which the tip may be."""
_FIRST = ("left", "bottom")
_AXIS_LAYERS = frozenset({"axis", "axes", "centerline", "centreline", "center", "centre", "achse", "mittellinie"})
"""Names of layers whose line is the axis."""
_BORE_LAYERS = frozenset({"bore", "bores", "hole", "holes", "bohrung", "bohrungen"})
"""Names of layers whose contours are bores."""
_CUTTING, _NOT_CUTTING = "cut", "nocut"
"""Layers of the cutting and the non-cutting part, as commonly named in tool drawings.

ISO/TS 13399-70 separates both in layers; it was not at hand, so that its names are not checked."""
_AXIS = re.compile(r"\s*(?P<name>[xy])\s*=\s*(?P<at>.+?)\s*")
_ROUND = ("CIRCLE", "ELLIPSE")
_LONGEST, _THICKEST = 0.6, 0.4
"""Largest usual length and diameter of a tool or a holder in m."""


class DrawingOptions(TypedDict, total=False):
    """Options of reading a drawing."""

    layer: str | Sequence[str]
    """Layers of the profile, DXF only; by default the only one, or CUT and NOCUT."""
    bore_layer: str | Sequence[str]
    """Layers of the bores, DXF only; by default those named BORE, BORES, HOLE or HOLES."""
    unit: str
    """Unit of the coordinates, if the file does not state it."""
    axis: str
    """Axis of revolution, "x", "y", "y = 12 mm" or "x = 3 mm"; by default the line in the layer AXIS, else "x"."""
    tip: Tip
    """End of the drawing at which the tip is; by default that of the layer CUT, else left or bottom."""
    tolerance: float
    """Largest distance in m between a curve and the cones that replace it."""


@dataclass(frozen=True)
class DrawnContour:
    """A contour that was read from a drawing, and what was assumed."""

    contour: Contour
    assumptions: tuple[str, ...]
    """Sentences on what the file does not state, and on what was left out."""


@dataclass(frozen=True)
class DrawnOutline:
    """The outline of a section that was read from a drawing, and what was assumed."""

    points: tuple[tuple[float, float], ...]
    """Corners of the outer outline in m, counterclockwise, without repetition of the first."""
    holes: tuple[tuple[tuple[float, float], ...], ...]
    """Corners of each hole in m, clockwise."""
    assumptions: tuple[str, ...]


def read_contour(file: str | PathLike[str], **options: Unpack[DrawingOptions]) -> DrawnContour:
    r"""Return the contour of a part in a CSV or DXF file.

    A CSV file has the columns `x [mm]` and `diameter [mm]` or `radius [mm]`, perhaps `arc [mm]`, the radius of the arc
    that leads to a point, and `bore [mm]` or `bore radius [mm]`. In a DXF file the contour is a closed one or one that
    begins and ends on the axis, as a half or a symmetric profile.

    Parameters
    ----------
    file : path
        A file with the ending .csv or .dxf.
    layer, bore_layer, unit, axis, tip, tolerance : optional
        See `DrawingOptions`.

    Returns
    -------
    DrawnContour
        The contour, and what was assumed.

    Raises
    ------
    FileFormatError
        The file has a mistake, or what it shows is no body of revolution; the message names entity, layer and place. It
        is a ValueError.
    MissingExtraError
        A DXF file is read without the package `ezdxf`.
    OSError
        The file cannot be opened.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from receptance import drawing
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder) / "nose.csv"
    ...     _ = file.write_text("x [mm],diameter [mm]\n0,20\n50,30\n")
    ...     drawing.read_contour(file).contour.outer
    ((0.0, 0.02), (0.05, 0.03))
    """
    path = Path(file)
    tolerance = _checks.positive("read_contour", "tolerance", options.get("tolerance", TOLERANCE), unit="m")
    tip, unit = options.get("tip"), options.get("unit", "")
    if tip is not None:
        _checks.one_of("read_contour", "tip", tip, TIPS)
    with error_location(file=path.name):
        if _ending(path) == ".csv":
            for option in ("layer", "bore_layer", "axis"):
                if options.get(option):
                    raise FileFormatError(f"`{option}` is for DXF files; a CSV file has tables", option=option)
            contour = csv_points.read_csv(path, unit=unit, tolerance=tolerance)
            if tip in ("right", "top"):
                contour = _reflected(contour)
            return DrawnContour(contour, (*contour.notes, *_notes_on_size(contour)))
        sheet = read_sheet(path, unit=unit, tolerance=tolerance)
        try:
            drawn = _drawn(sheet, options, tolerance)
            return replace(drawn, assumptions=(*_notes_on_size(drawn.contour), *drawn.assumptions))
        except FileFormatError:
            raise
        except ValueError as error:
            raise FileFormatError(str(error).removeprefix("contour: ")) from None


def outline(
    file: str | PathLike[str], *, layer: str | Sequence[str] = (), unit: str = "", tolerance: float = TOLERANCE
) -> DrawnOutline:
    r"""Return the outline of a section in a CSV or DXF file: a closed contour, and holes in it.

    Parameters
    ----------
    file : path
        A DXF file with closed contours, or a CSV file with the columns `x [mm]` and `y [mm]`; a line of empty cells
        (`,`) there begins a hole.
    layer : str or sequence of str, optional
        Layers of the contours, DXF only; by default the only one.
    unit : str, optional
        Unit of the coordinates, if the file does not state it.
    tolerance : float, optional
        Largest distance in m between a curve and the polygon.

    Raises
    ------
    FileFormatError
        A contour is open or crosses another one, or there are several that are no holes. It is a ValueError.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from receptance import drawing
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder) / "strip.csv"
    ...     _ = file.write_text("x [mm],y [mm]\n0,0\n50,0\n50,2\n0,2\n")
    ...     drawing.outline(file).points
    ((0.0, 0.0), (0.05, 0.0), (0.05, 0.002), (0.0, 0.002))
    """
    path = Path(file)
    tolerance = _checks.positive("outline", "tolerance", tolerance, unit="m")
    with error_location(file=path.name):
        notes: list[str] = []
        if _ending(path) == ".csv":
            loops = [
                Loop(np.array(points), ("the outline",) * len(points), "the file")
                for points in map(_open, csv_points.read_outline(path, unit=unit))
            ]
            if any(len(loop.points) < 3 for loop in loops) or not loops:
                raise FileFormatError("an outline has fewer than three points, expected a closed contour")
            factor, frame = 1.0, Frame(unit="m")
        else:
            sheet = read_sheet(path, unit=unit, tolerance=tolerance)
            factor, frame = sheet.factor, Frame(unit=sheet.unit)
            names = _profile_layers(sheet, _names(layer), set(), notes)
            curves = [curve for name in names for curve in sheet.layers[name]]
            loops, more = closed_loops(curves, frame, tolerance / factor, axis=False)
            notes += [*sheet.notes, *more]
        outer, holes = _nested(loops, frame, tolerance / factor)
    return DrawnOutline(
        _corners(outer, factor, 1.0), tuple(_corners(hole, factor, -1.0) for hole in holes), tuple(notes)
    )


def _notes_on_size(contour: Contour) -> list[str]:
    """Return a note on the unit for a part that is far larger than tools and holders are."""
    if contour.length <= _LONGEST and contour.largest_diameter <= _THICKEST:
        return []
    size = f"{amount(contour.length, 'm', 4)} long and {amount(contour.largest_diameter, 'm', 4)} in diameter"
    return [f"the part is {size}: check the unit of the drawing, `unit` states another one"]


def _ending(path: Path) -> str:
    """Return the ending of a file of a known kind."""
    ending = path.suffix.casefold()
    if ending not in (".csv", ".dxf"):
        hint = '; the CAD program writes DXF with "save as" or "export"' if ending == ".dwg" else ""
        raise FileFormatError(f"has the ending {shown(path.suffix)}, expected .csv or .dxf{hint}")
    return ending


def _names(layers: str | Sequence[str]) -> list[str]:
    return [layers] if isinstance(layers, str) and layers else list(layers)


def _reflected(contour: Contour) -> Contour:
    """Return a contour with the tip at its other end."""

    def turned(chain: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
        return [(contour.outer[-1][0] - x, diameter) for x, diameter in reversed(chain)]

    return Contour(turned(contour.outer), [turned(bore) for bore in contour.bores], owner="contour")


# Contours of DXF files ------------------------------------------------------------------------------------------------


def _drawn(sheet: Sheet, options: DrawingOptions, tolerance: float) -> DrawnContour:
    """Return the contour in the layers of a drawing."""
    notes: list[str] = []
    bores = [sheet.layer(name) for name in _names(options.get("bore_layer", ()))]
    are_stated = bool(bores)
    if not are_stated:
        bores = [name for name in sheet.layers if name.casefold() in _BORE_LAYERS and name not in sheet.hidden]
    profiles = _profile_layers(sheet, _names(options.get("layer", ())), set(bores), notes)
    bores = [name for name in bores if name not in profiles]
    if bores and not are_stated:
        notes.append(f"the bores are those of layer {_quoted(bores)}")
    frame, assumed = _axis(sheet, options.get("axis", ""), notes)
    across = tolerance / sheet.factor
    loops: dict[str, list[Loop]] = {}
    touches = False
    for name in (*profiles, *bores):
        curves = sheet.layers[name]
        if all(curve.entity.startswith(_ROUND) for curve in curves):
            raise wrong(
                "has only circles, which are a section across the axis, not a profile along it; give the profile, or "
                "the section of a segment",
                name,
                curves[0].entity,
            )
        moved = [Curve(frame.inside(curve.points), curve.entity, name) for curve in curves]
        touches |= any(np.abs(curve.points[:, 1]).min() <= across for curve in moved)
        loops[name], more = closed_loops(moved, frame, across, axis=True)
        notes += more
        if not loops[name]:
            raise wrong("has no contour beside the axis", name, curves[0].entity)
    body = revolve({name: loops[name] for name in profiles}, {name: loops[name] for name in bores}, frame, across)
    if assumed and not touches:
        _check_assumed_axis(body, frame, across)
    if body.sides != "both":
        side = "above" if body.sides == "above" else "below"
        notes.append(f"a half profile: only the side {side} the axis is drawn")
    tip = options.get("tip") or _assumed_tip(loops, frame, notes)
    return _contour(body, tip, sheet, (*sheet.notes, *notes), tolerance)


def _quoted(names: Sequence[str]) -> str:
    return join_names([f'"{name}"' for name in names])


def _profile_layers(sheet: Sheet, wanted: Sequence[str], bores: set[str], notes: list[str]) -> list[str]:
    """Return the layers of the profile: those wanted, the only one, or those of the cutting and non-cutting part."""
    if wanted:
        return list(dict.fromkeys(sheet.layer(name) for name in wanted))
    visible = [
        name
        for name in sheet.layers
        if name not in bores and name not in sheet.hidden and name.casefold() not in _AXIS_LAYERS
    ]
    tool = [name for name in visible if name.casefold() in (_CUTTING, _NOT_CUTTING)]
    chosen = tool or visible
    if len(chosen) != 1 and not tool:
        counts = (
            join_names([f'"{name}" ({len(sheet.layers[name])} curves)' for name in chosen]) or "none that is visible"
        )
        raise FileFormatError(
            f"the drawing has the layers {counts}, expected one with the profile; give its name as `layer`",
            option="layer",
        )
    if len(sheet.layers) > 1:
        notes.append(f"the profile is that of layer {_quoted(chosen)}")
        left = [name for name in sheet.layers if name not in chosen and name not in bores]
        left = [name for name in left if name.casefold() not in _AXIS_LAYERS]
        if left:
            likely = [name for name in left if did_you_mean(name.casefold(), sorted(_BORE_LAYERS))]
            hint = f"; a bore? put {_quoted(likely)} into the layer BORE, or state `bore_layer`" if likely else ""
            notes.append(f"layers that are left out: {_quoted(left)}{hint}")
    return chosen


def _axis(sheet: Sheet, written: str, notes: list[str]) -> tuple[Frame, bool]:
    """Return the frame of the axis, as written, of a layer of its own or y = 0, and whether it was assumed."""
    if written:
        return _written_axis(sheet, written), False
    names = [name for name in sheet.layers if name.casefold() in _AXIS_LAYERS]
    lines = [curve for name in names for curve in sheet.layers[name] if curve.is_straight]
    if not lines:
        notes.append(f"the axis is y = 0 {sheet.unit}: no layer AXIS and no `axis` states another one")
        return Frame(unit=sheet.unit), True
    longest = max(lines, key=lambda line: float(np.hypot(*(line.points[1] - line.points[0]))))
    start, end = longest.points
    direction = (end - start) / np.hypot(*(end - start))
    # From the left to the right, or from the bottom to the top.
    if direction[0] < -1e-9 or (abs(direction[0]) <= 1e-9 and direction[1] < 0.0):
        direction = -direction
    frame = Frame((float(start[0]), float(start[1])), (float(direction[0]), float(direction[1])), sheet.unit)
    size = float(np.hypot(*(end - start)))
    for line in lines:
        if np.abs(frame.inside(line.points)[:, 1]).max() > 1e-6 * size:
            raise wrong(
                f"is no part of the axis {longest.entity}, expected one axis in this layer; give it as `axis`, such as "
                '"y = 0 mm"',
                line.layer,
                line.entity,
            )
    notes.append(f'the axis is {longest.entity} in layer "{longest.layer}"')
    return frame, False


def _written_axis(sheet: Sheet, written: str) -> Frame:
    """Return the frame of an axis such as "y" or "y = 12 mm"."""
    plain = {"x": (0.0, "y"), "y": (0.0, "x")}
    match = _AXIS.fullmatch(written)
    try:
        at, name = plain[written.strip()] if match is None else (parse(match["at"], COORDINATE), match["name"])
    except (KeyError, ValueError):
        raise FileFormatError(
            f'`axis` is {shown(written)}, expected "x" or "y" through the origin, or a line such as "y = 12 mm"',
            option="axis",
        ) from None
    at /= sheet.factor
    if name == "y":
        return Frame((0.0, at), (1.0, 0.0), sheet.unit)
    return Frame((at, 0.0), (0.0, 1.0), sheet.unit)


def _check_assumed_axis(body: Revolved, frame: Frame, tolerance: float) -> None:
    """Raise if a profile beside the assumed axis is symmetric about another one, which may be meant."""
    middles = [
        0.5 * (inner + outer) for ring in body.rings for inner, outer in zip(ring.inner, ring.outer, strict=True)
    ]
    if body.sides == "both" or max(middles) - min(middles) > 2.0 * tolerance:
        return
    sign = 1.0 if body.sides == "above" else -1.0
    at = frame.place((0.0, sign * middles[0])).split(", ")[1].replace(")", "")
    raise FileFormatError(
        f'the axis y = 0 is outside of the profile, which is symmetric about y = {at}; give `axis`, "y = {at}", or '
        '"x" for a tube about y = 0',
        option="axis",
    )


def _assumed_tip(loops: dict[str, list[Loop]], frame: Frame, notes: list[str]) -> Tip:
    """Return the end at which the cutting part is, else the first one."""
    along_x = abs(frame.direction[0]) > abs(frame.direction[1])
    ends: tuple[Tip, Tip] = ("left", "right") if along_x else ("bottom", "top")
    cutting = [loop.points[:, 0] for name, own in loops.items() if name.casefold() == _CUTTING for loop in own]
    others = [loop.points[:, 0] for name, own in loops.items() if name.casefold() == _NOT_CUTTING for loop in own]
    if cutting and others:
        x, rest = np.concatenate(cutting), np.concatenate(others)
        tip = ends[0] if x.min() + x.max() < rest.min() + rest.max() else ends[1]
        notes.append(f"the tip is at the {tip}, where the layer CUT is")
        return tip
    notes.append(f'the tip is assumed at the {ends[0]}; `tip` states another end, "{ends[1]}"')
    return ends[0]


def _contour(body: Revolved, tip: Tip, sheet: Sheet, notes: Sequence[str], tolerance: float) -> DrawnContour:
    """Return the contour of rings in m, from the tip on."""
    first, last = body.rings[0].start, body.rings[-1].end
    rings = body.rings
    if tip not in _FIRST:
        rings = tuple(
            Ring(first + last - ring.end, first + last - ring.start, ring.inner[::-1], ring.outer[::-1])
            for ring in reversed(rings)
        )

    def metres(x: float, radius: float) -> tuple[float, float]:
        # Digits beyond a picometre are those of conversion and rotation.
        return round(sheet.factor * (x - first), 12), round(2.0 * sheet.factor * radius, 12)

    outer: list[tuple[float, float]] = []
    bores: list[list[tuple[float, float]]] = []
    for before, ring in pairwise((None, *rings)):
        assert ring is not None
        outer += [metres(ring.start, ring.outer[0]), metres(ring.end, ring.outer[1])]
        if max(ring.inner) > 0.0:
            if before is None or max(before.inner) == 0.0:
                bores.append([])
            bores[-1] += [metres(ring.start, ring.inner[0]), metres(ring.end, ring.inner[1])]
    contour = Contour(_smoothed(outer), [_smoothed(bore) for bore in bores], tolerance=tolerance, owner="contour")
    return DrawnContour(contour, (*notes, *contour.notes))


def _smoothed(points: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return a profile without points on the straight line between their neighbours."""
    kept: list[tuple[float, float]] = []
    for point in points:
        if kept and max(abs(a - b) for a, b in zip(point, kept[-1], strict=True)) < 1e-9:
            continue
        while len(kept) > 1 and _between(kept[-2], kept[-1], point):
            kept.pop()
        kept.append(point)
    return kept


def _between(before: tuple[float, float], point: tuple[float, float], after: tuple[float, float]) -> bool:
    """Return whether a point is on the line between two others within a nanometre."""
    length = after[0] - before[0]
    if not before[0] < point[0] < after[0]:
        return False
    on_line = before[1] + (after[1] - before[1]) * (point[0] - before[0]) / length
    return abs(on_line - point[1]) < 1e-9


# Outlines -------------------------------------------------------------------------------------------------------------


def _open(points: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return the corners of an outline without repetition of the first."""
    return list(points[:-1]) if len(points) > 1 and points[0] == points[-1] else list(points)


def _area(points: np.ndarray) -> float:
    """Return the area in a polygon, positive if it is counterclockwise."""
    x, y = points.T
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


def _nested(loops: Sequence[Loop], frame: Frame, tolerance: float) -> tuple[Loop, list[Loop]]:
    """Return the outer one of closed contours and those in it; raise if they cross, or if one is outside."""
    ordered = sorted(loops, key=lambda loop: -abs(_area(loop.points)))
    for loop in ordered:
        _check_crossings(loop, ordered, frame, tolerance)
    outer, *holes = ordered
    for hole in holes:
        if not _contains(outer.points, hole.points[0]):
            raise wrong(
                f"is outside of the contour of {outer.entities[0]}, expected one contour, and holes in it",
                hole.layer,
                hole.entities[0],
                frame.place(hole.points[0]),
            )
        for other in holes:
            if other is not hole and _contains(other.points, hole.points[0]):
                raise wrong(
                    f"is a contour in the hole of {other.entities[0]}, expected holes beside each other",
                    hole.layer,
                    hole.entities[0],
                    frame.place(hole.points[0]),
                )
    return outer, holes


def _check_crossings(loop: Loop, others: Sequence[Loop], frame: Frame, tolerance: float) -> None:
    """Raise if an edge of a contour crosses one of these contours."""
    for index, (p, q) in enumerate(zip(loop.points, np.roll(loop.points, -1, axis=0), strict=True)):
        along = q - p
        for other in others:
            start, end = other.points, np.roll(other.points, -1, axis=0)
            side = [along[0] * (ends[:, 1] - p[1]) - along[1] * (ends[:, 0] - p[0]) for ends in (start, end)]
            edge = end - start
            other_side = [
                edge[:, 0] * (point[1] - start[:, 1]) - edge[:, 1] * (point[0] - start[:, 0]) for point in (p, q)
            ]
            least = tolerance * np.hypot(*along), tolerance * np.hypot(edge[:, 0], edge[:, 1])
            crossing = (side[0] * side[1] < 0.0) & (np.minimum(np.abs(side[0]), np.abs(side[1])) > least[0])
            crossing &= (other_side[0] * other_side[1] < 0.0) & (
                np.minimum(np.abs(other_side[0]), np.abs(other_side[1])) > least[1]
            )
            if crossing.any():
                second = int(np.flatnonzero(crossing)[0])
                raise wrong(
                    f"crosses {other.entities[second]}, expected a contour that crosses none",
                    loop.layer,
                    loop.entities[index],
                    frame.place(0.5 * (p + q)),
                )


def _contains(polygon: np.ndarray, point: np.ndarray) -> bool:
    """Return whether a point is in a polygon, by the number of edges above it."""
    start, end = polygon, np.roll(polygon, -1, axis=0)
    spans = (start[:, 0] <= point[0]) != (end[:, 0] <= point[0])
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = (end[:, 1] - start[:, 1]) / (end[:, 0] - start[:, 0])
    above = start[:, 1] + slope * (point[0] - start[:, 0]) > point[1]
    return bool(np.count_nonzero(spans & above) % 2)


def _corners(loop: Loop, factor: float, sign: float) -> tuple[tuple[float, float], ...]:
    """Return the corners of a contour in m, counterclockwise if the sign is positive."""
    points = loop.points if sign * _area(loop.points) > 0.0 else loop.points[::-1]
    return tuple((float(x), float(y)) for x, y in factor * points)
