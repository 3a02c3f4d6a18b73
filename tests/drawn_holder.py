"""A holder as a DXF drawing, made with `ezdxf` alone: cones, arcs, two bores, three layers; lengths are in mm.

The nose is a cone, a fillet of radius 6 leads to a flange, and behind it is a steep taper. The axis is a line in the
layer AXIS, the profile is in NOCUT, as a whole or a half, and the bores are closed contours in the layer BORE.
"""

from __future__ import annotations

import math
from pathlib import Path

import ezdxf

BULGE = math.tan(math.pi / 8.0)
"""Bulge of a quarter of a circle."""
PROFILE = (
    (0.0, 0.0, 0.0),
    (0.0, 13.5, 0.0),
    (40.0, 16.5, 0.0),
    (64.0, 16.5, BULGE),
    (70.0, 22.5, 0.0),
    (70.0, 31.5, 0.0),
    (90.0, 31.5, 0.0),
    (90.0, 20.0, 0.0),
    (140.0, 12.5, 0.0),
    (140.0, 0.0, 0.0),
)
"""Half profile: x, radius, and bulge of the arc to the next point; a positive one turns to the left."""
BORES = (
    ((0.0, 6.0), (38.0, 6.0), (42.0, 4.0), (60.0, 4.0)),
    ((110.0, 4.0), (140.0, 8.0)),
)
"""Bores: x and radius, from end to end."""


def polyline(
    points: tuple[tuple[float, float, float], ...], *, below: bool = False
) -> list[tuple[float, float, float]]:
    """Return points with bulges, mirrored at the axis if `below`."""
    return [(x, -y, -bulge) if below else (x, y, bulge) for x, y, bulge in points]


def new(unit: int = 4) -> ezdxf.document.Drawing:
    """Return an empty drawing; the unit is a code of $INSUNITS, 4 for mm and 0 for none."""
    document = ezdxf.new("R2010")
    document.header["$INSUNITS"] = unit
    for layer in ("NOCUT", "BORE", "AXIS"):
        document.layers.add(layer)
    return document


def holder(*, half: bool = False, axis: float = 0.0, unit: int = 4) -> ezdxf.document.Drawing:
    """Return the drawing of the holder about y = `axis`."""
    document = new(unit)
    space = document.modelspace()
    space.add_line((-10.0, axis), (150.0, axis), dxfattribs={"layer": "AXIS"})
    sides = (False,) if half else (False, True)
    for below in sides:
        points = [(x, y + axis, bulge) for x, y, bulge in polyline(PROFILE, below=below)]
        space.add_lwpolyline(points, format="xyb", dxfattribs={"layer": "NOCUT"})
    for bore in BORES:
        ends = [(bore[0][0], 0.0), *bore, (bore[-1][0], 0.0)]
        mirrored = [(x, -y) for x, y in reversed(bore)]
        closed = ends if half else [*bore, *mirrored]
        moved = [(x, y + axis) for x, y in closed]
        space.add_lwpolyline(moved, close=True, dxfattribs={"layer": "BORE"})
    return document


def write(path: Path, **options: object) -> Path:
    """Write the drawing of the holder and return its path."""
    holder(**options).saveas(path)  # type: ignore[arg-type]
    return path


if __name__ == "__main__":
    print(write(Path("holder.dxf")))
