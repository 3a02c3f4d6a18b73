"""Curves, layers and unit of a DXF file, read with `ezdxf`."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from receptance._files import open_file
from receptance._text import did_you_mean, one_of, printable
from receptance.drawing.curves import Curve, Points, simplified, wrong
from receptance.errors import require
from receptance.io import FileFormatError
from receptance.units import COORDINATE, parse

LARGEST_FILE = 50 << 20
"""Largest DXF file in bytes: 50 MiB. The drawing of a part takes less than one."""
MOST_ENTITIES = 100_000
"""Largest number of entities of a DXF file; the drawing of a part has some hundreds."""
MOST_POINTS = 200_000
"""Largest number of points of all curves of a drawing."""
_DEEPEST = 8
"""Most blocks inside of each other."""
_UNITS = {1: "in", 2: "ft", 4: "mm", 5: "cm", 6: "m", 8: "microinch", 9: "mil", 13: "um", 14: "dm"}
"""Units of $INSUNITS that a part may be drawn in, see the DXF reference of Autodesk, HEADER section."""
_TAG = re.compile(rb"(?m)^[ \t]*0[ \t]*\r?\n[ \t]*[A-Z]")
"""Beginning of an entity, a table or a section in a text file."""
_BINARY = b"AutoCAD Binary DXF"
_SMALLER = (
    "export only the contour of the part: delete other views, hatches and texts, or copy the contour to a new drawing, "
    "and save that as DXF"
)
_READ = ("LINE", "ARC", "CIRCLE", "ELLIPSE", "SPLINE", "LWPOLYLINE", "POLYLINE")
"""Types of entities that are curves."""


@dataclass
class Sheet:
    """The curves of a drawing by layer, in the unit of the drawing."""

    unit: str
    factor: float
    """Length of the unit in m."""
    layers: dict[str, list[Curve]] = field(default_factory=dict)
    hidden: set[str] = field(default_factory=set)
    """Layers that are off or frozen."""
    notes: list[str] = field(default_factory=list)

    def layer(self, name: str) -> str:
        """Return the name of a layer as the file writes it; DXF does not distinguish small letters and capitals."""
        for layer in self.layers:
            if layer.casefold() == name.casefold():
                return layer
        raise FileFormatError(
            f'there is no layer "{name}" with lines, expected {one_of(self.layers)}{did_you_mean(name, self.layers)}',
            option="layer",
        )


def read_sheet(file: Path, *, unit: str = "", tolerance: float) -> Sheet:
    """Return the curves of the model space of a DXF file, simplified within a tolerance in m.

    Parameters
    ----------
    file : Path
        A DXF file of any version, text or binary.
    unit : str, optional
        Unit of the coordinates, if the file does not state it.
    tolerance : float
        Largest distance in m between a curve and its polyline.

    Raises
    ------
    FileFormatError
        The file is no DXF, too large or damaged, states no unit, or has a curve that is not in its plane.
    MissingExtraError
        The package `ezdxf` is not installed.
    """
    require("drawing", "a DXF file")
    _check_size(file)
    document, notes = _document(file)
    name, unit_notes = _unit(document, unit)
    factor = parse(f"1 {name}", COORDINATE)
    sheet = Sheet(name, factor, notes=[*notes, *unit_notes])
    sheet.hidden = {layer.dxf.name for layer in document.layers if layer.is_off() or layer.is_frozen()}
    distance = tolerance / factor
    ignored: Counter[str] = Counter()
    count = points = 0
    for entity, owner in _entities(document.modelspace()):
        count += 1
        if count > MOST_ENTITIES:
            raise FileFormatError(f"the drawing has more than {MOST_ENTITIES} entities with its blocks; {_SMALLER}")
        kind = entity.dxftype()
        if kind not in _READ or (kind == "POLYLINE" and (entity.is_poly_face_mesh or entity.is_polygon_mesh)):
            ignored[kind] += 1
            continue
        called = f"{kind} #{entity.dxf.handle}" if entity.dxf.handle else f"{kind} of {owner}"
        layer = printable(entity.dxf.layer)
        path = _flat(_points(entity, 0.05 * distance), distance, layer, called)
        points += len(path)
        if points > MOST_POINTS:
            raise FileFormatError(
                f"the curves of the drawing have more than {MOST_POINTS} points; {_SMALLER}, with arcs as arcs, or "
                "give a larger tolerance"
            )
        sheet.layers.setdefault(layer, []).append(Curve(simplified(path, 0.45 * distance), called, layer))
    if ignored:
        listed = ", ".join(f"{number} {kind}" for kind, number in sorted(ignored.items()))
        sheet.notes.append(f"entities that are no lines are left out: {listed}")
    if not sheet.layers:
        raise FileFormatError(
            f"there is no line in the model space, expected {', '.join(_READ)}"
            + (f"; it has {', '.join(sorted(ignored))}" if ignored else "")
        )
    return sheet


def _check_size(file: Path) -> None:
    """Raise if a file is no DXF, or larger than a drawing of a part; it is not parsed."""
    with open_file(file) as stream:
        size = stream.seek(0, 2)
        if size > LARGEST_FILE:
            raise FileFormatError(
                f"the file has {size / 2**20:.0f} MiB, expected at most {LARGEST_FILE >> 20} MiB for the drawing of a "
                f"part; {_SMALLER}"
            )
        stream.seek(0)
        data = stream.read(LARGEST_FILE)
    if data.startswith(b"AC10"):
        raise FileFormatError('is a DWG file, expected DXF; the CAD program writes it with "save as" or "export"')
    if not data.startswith(_BINARY):
        if b"SECTION" not in data[:65536]:
            raise FileFormatError("is no DXF file: it has no SECTION")
        if not data.rstrip(b"\x00\x1a \t\r\n").endswith(b"EOF"):
            raise FileFormatError("the DXF file is damaged: it has no EOF at its end, so that entities may be missing")
        entities = data[max(data.find(b"ENTITIES"), 0) :]
        count = sum(1 for _ in _TAG.finditer(entities))
        if count > MOST_ENTITIES:
            raise FileFormatError(
                f"the drawing has about {count} entities, expected at most {MOST_ENTITIES} for a part; {_SMALLER}"
            )


def _document(file: Path) -> tuple[Any, list[str]]:
    """Return the document of a DXF file, repaired if it is damaged, and notes on that."""
    # An extra, which takes a third of a second.
    from ezdxf import recover
    from ezdxf.filemanagement import readfile
    from ezdxf.lldxf.const import DXFError

    try:
        return readfile(file), []
    except (DXFError, OSError, UnicodeDecodeError, ValueError, KeyError, TypeError, IndexError, AttributeError):
        pass  # a damaged file is read again, slower
    try:
        document, auditor = recover.readfile(file)
    except Exception as error:  # the reader of damaged files raises errors of many kinds
        raise FileFormatError(f"the DXF file is damaged: {error}; save it again with the CAD program") from None
    if auditor.has_errors:
        first = auditor.errors[0].message
        raise FileFormatError(
            f"the DXF file is damaged, {len(auditor.errors)} errors, the first: {first}; save it again with the CAD "
            "program"
        )
    return document, [f"the DXF file is damaged and was read with repairs ({len(auditor.fixes)} of entities)"]


def _unit(document: Any, unit: str) -> tuple[str, list[str]]:
    """Return the unit of the coordinates, of the file or as stated, and notes on it."""
    code = int(document.header.get("$INSUNITS", 0))
    stated = _UNITS.get(code, "")
    if not unit and not stated:
        says = "states no unit ($INSUNITS is 0)" if code == 0 else f"states the unit {code} ($INSUNITS)"
        raise FileFormatError(f'the drawing {says}, expected one; give it as `unit`, such as "mm"', option="unit")
    if not unit:
        return stated, []
    try:
        metres = parse(f"1 {unit}", COORDINATE)
    except ValueError:
        raise FileFormatError(f'the unit is "{unit}", expected one of length such as "mm"', option="unit") from None
    if not stated:
        return unit, [f"the unit is {unit}, as stated; the drawing states none"]
    if abs(parse(f"1 {stated}", COORDINATE) / metres - 1.0) > 1e-9:
        return unit, [f"the unit is {unit}, as stated; the drawing states {stated}"]
    return unit, []


def _entities(space: Any) -> Iterator[tuple[Any, str]]:
    """Yield the entities of a space, those of blocks included, and what inserts the block."""
    waiting = [(iter(space), "", 0)]
    while waiting:
        entities, owner, depth = waiting[-1]
        entity = next(entities, None)
        if entity is None:
            waiting.pop()
        elif entity.dxftype() != "INSERT":
            yield entity, owner
        elif depth >= _DEEPEST:
            raise FileFormatError(f"blocks are inserted more than {_DEEPEST} deep; {_SMALLER}")
        else:
            inserted = entity.multi_insert() if entity.mcount > 1 else [entity]
            name = f'block "{printable(entity.dxf.name)}" (INSERT #{entity.dxf.handle})'
            inner = (part for insert in inserted for part in _of_block(insert))
            waiting.append((inner, name, depth + 1))


def _of_block(insert: Any) -> Iterator[Any]:
    """Yield the entities of an inserted block; those on layer 0 are on the layer of the insertion."""
    for entity in insert.virtual_entities():
        if entity.dxf.layer == "0":
            entity.dxf.layer = insert.dxf.layer
        yield entity


def _points(entity: Any, distance: float) -> list[Any]:
    """Return the points of a curve in the coordinates of the drawing, three numbers each."""
    kind = entity.dxftype()
    if kind == "LINE":
        return [entity.dxf.start, entity.dxf.end]
    if kind in ("ARC", "CIRCLE"):
        # Below a fourth of the radius a full circle has at least five points.
        points = list(entity.flattening(min(distance, 0.25 * abs(entity.dxf.radius) or distance)))
        return [*points, points[0]] if kind == "CIRCLE" else points
    if kind in ("ELLIPSE", "SPLINE"):
        return list(entity.flattening(distance))
    if entity.has_arc:
        points = []
        for part in entity.virtual_entities():
            arc = _points(part, distance)
            if points and arc[0].distance(points[-1]) > arc[-1].distance(points[-1]):
                arc.reverse()
            elif not points and entity.has_arc:
                arc = _towards_next(arc, entity)
            points += arc[1 if points else 0 :]
        return points
    points = list(entity.vertices_in_wcs() if kind == "LWPOLYLINE" else entity.points_in_wcs())
    closed = entity.closed if kind == "LWPOLYLINE" else entity.is_closed
    return [*points, points[0]] if closed and points else points


def _towards_next(points: list[Any], polyline: Any) -> list[Any]:
    """Return the points of the first part of a polyline in its direction; an arc is drawn counterclockwise."""
    vertices = polyline.vertices_in_wcs() if polyline.dxftype() == "LWPOLYLINE" else polyline.points_in_wcs()
    first = next(iter(vertices))
    return points[::-1] if points[-1].distance(first) < points[0].distance(first) else points


def _flat(points: list[Any], distance: float, layer: str, entity: str) -> Points:
    """Return points in the plane of the drawing."""
    if len(points) < 2:
        return np.zeros((1, 2))
    array = np.array([(point[0], point[1], point[2] if len(point) > 2 else 0.0) for point in points], dtype=np.float64)
    if not np.isfinite(array).all():
        raise wrong("has coordinates that are no finite numbers", layer, entity)
    if np.ptp(array[:, 2]) > distance:
        low, high = array[:, 2].min(), array[:, 2].max()
        raise wrong(
            f"is not in the plane of the drawing: z is from {low:.6g} to {high:.6g}, expected a contour in x and y",
            layer,
            entity,
        )
    return array[:, :2]
