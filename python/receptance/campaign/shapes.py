"""Shapes of sections in campaign files: the key `shape` of a segment, read and written."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from receptance import drawing, units
from receptance.campaign.keys import KeyTable, ListOf, Place, Value, data_file, flag, one_or_list, text
from receptance.model.beams import Segment
from receptance.model.fields import Choice, Count, Number
from receptance.model.flutes import MOST_FLUTES, spread_of_directions
from receptance.model.sections import SectionShape

_USUAL_HELIX = 30.0
"""Helix angle in degrees of flutes for which none is stated."""
_SAME_SIZE = 0.01
"""Largest relative difference of a stated outer diameter and the size of a shape."""


def _read_point(written: Any, _: Place) -> tuple[float, float]:
    """Return the two coordinates of a point in the unit of the table."""
    numbers = isinstance(written, list) and all(
        isinstance(value, (int, float)) and not isinstance(value, bool) for value in written
    )
    if not numbers or len(written) != 2:
        raise ValueError(f"is {written!r}, expected two numbers such as [12.5, 0]")
    return float(written[0]), float(written[1])


_POINT = Value("a point", _read_point, {"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 2})


class ShapeTable(KeyTable):
    """A section that is neither a circle nor a ring: flutes, a rectangle, an outline in a file, or its corners."""

    flutes = Count("number of flutes of an end mill of the outer diameter of the segment", 2, MOST_FLUTES).default(None)
    core_diameter = Number(units.LENGTH, "core of the flutes, the largest circle within the section").default(None)
    straight = flag("whether the flutes are straight, so that two of them bend differently in x and y").default(False)
    width = Number(units.LENGTH, "width of a rectangle, across the deflection").default(None)
    height = Number(units.LENGTH, "height of a rectangle, in the direction of the deflection").default(None)
    outline = data_file(
        "closed contour of the section, with holes in it: CSV with `x [mm]` and `y [mm]`, or DXF"
    ).default(None)
    layer: str | list[str] | None = one_or_list(
        "layers of a DXF file with the contours; by default the only one",
        text(),
        "the name of a layer, or a list of them",
    ).default(None)
    points = ListOf("corners of the section, in order, such as `[[0, 0], [50, 0], [50, 2], [0, 2]]`", _POINT).default(
        None
    )
    holes = ListOf("corners of holes", ListOf("corners of a hole", _POINT)).default(())
    unit = text("unit of the points; of an outline, if its file does not state it").default(None)
    plane = Choice(
        "direction of the deflection in the axes of the section, or the mean of both", ("y", "x", "mean")
    ).default("y")


_KINDS = {"flutes": ("core_diameter",), "width": ("height",), "outline": (), "points": ("unit",)}
"""The key that tells the kind of a shape, with those that it needs."""
_ONLY_FOR = {
    "core_diameter": ("flutes",),
    "straight": ("flutes",),
    "height": ("width",),
    "layer": ("outline",),
    "holes": ("points",),
    "unit": ("outline", "points"),
}
"""The keys that belong to some kinds only."""


def shape_of(table: ShapeTable, outer_diameter: float | None, folder: Path | None) -> SectionShape:
    """Return the shape of a table; the text of a ValueError is a predicate of the key `shape`.

    Parameters
    ----------
    table : ShapeTable
        The table.
    outer_diameter : float or None
        Outer diameter of the segment in m, if it is stated.
    folder : Path or None
        Folder of the campaign file; None if data files are not read.

    Raises
    ------
    ValueError
        Keys that do not belong together, a shape that does not exist, or one of another size than the diameter.
    """
    kinds = [key for key in _KINDS if key in table.written]
    if len(kinds) != 1:
        stated = " and ".join(f"`{key}`" for key in kinds) or "none of them"
        raise ValueError(
            f"has {stated}, expected one of `flutes`, `width` and `height`, `outline` and `points`, for example "
            'shape = { flutes = 4, core_diameter = "7 mm" }'
        )
    (kind,) = kinds
    if missing := [key for key in _KINDS[kind] if key not in table.written]:
        raise ValueError(f"has `{kind}` without `{missing[0]}`, expected both")
    for key, others in _ONLY_FOR.items():
        if key in table.written and kind not in others:
            raise ValueError(
                f"has `{key}` beside `{kind}`, but it is only for {' and '.join(f'`{k}`' for k in others)}"
            )
    if table.flutes is not None and table.core_diameter is not None:
        if outer_diameter is None:
            raise ValueError("has `flutes`, expected `outer_diameter` of the segment as well")
        core = table.core_diameter
        shape = SectionShape.fluted(table.flutes, diameter=outer_diameter, core_diameter=core, straight=table.straight)
    elif table.width is not None and table.height is not None:
        shape = SectionShape.rectangle(table.width, table.height)
    elif table.points is not None:
        shape = SectionShape.polygon(table.points, table.holes, unit=table.unit or "m")
    else:
        if folder is None or table.outline is None:
            raise ValueError("has an `outline` in a file, which is not read here, expected `points`")
        drawn = drawing.outline(folder / table.outline, layer=table.layer or (), unit=table.unit or "")
        shape = SectionShape.polygon(drawn.points, drawn.holes)
    if outer_diameter is not None and abs(shape.diameter / outer_diameter - 1.0) > _SAME_SIZE:
        raise ValueError(
            f"is {1e3 * shape.diameter:.4g} mm across (twice the largest distance from the centroid), but "
            f"outer_diameter is {1e3 * outer_diameter:.4g} mm; expected the same, or no outer_diameter"
        )
    return shape.turned() if table.plane == "x" else shape.averaged() if table.plane == "mean" else shape


def note_on_directions(
    shape: SectionShape, length: float, *, helix: float | None = None, shank: tuple[float, float] = (0.0, 1.0)
) -> str:
    """Return what a user should know of two flutes, which bend differently in x and y; empty for other shapes.

    Parameters
    ----------
    shape : SectionShape
        The section of the flutes.
    length : float
        Length of the flutes in m.
    helix : float, optional
        Helix angle in degrees; that of usual tools where it is not known.
    shank : tuple of 2 floats, optional
        Length in m and diameter over that of the flutes of the cylinder behind them.

    Examples
    --------
    >>> from receptance import SectionShape
    >>> from receptance.campaign.shapes import note_on_directions
    >>> mill = SectionShape.fluted(2, diameter=0.012, core_diameter=0.0072)
    >>> print(note_on_directions(mill, 0.03))  # doctest: +ELLIPSIS
    has two flutes, which ... up to 22 % more or less (helix of 30 deg); hit it in two directions at right angles
    """
    arguments = dict(shape.recipe)
    is_straight = "straight" in arguments
    if arguments.get("flutes") != 2 or (is_straight and shape.is_isotropic):
        return ""
    core = float(arguments["core_diameter"])
    straight = SectionShape.fluted(2, diameter=shape.diameter, core_diameter=core, straight=True)
    degrees = _USUAL_HELIX if helix is None else helix
    half_pitch = math.inf if is_straight else 0.5 * math.pi * shape.diameter / math.tan(math.radians(abs(degrees)))
    spread = spread_of_directions(straight.moment, length, length / half_pitch, (shank[0], shank[1] ** 4))
    if not is_straight:
        return (
            "has two flutes, which bend differently in x and y; the model has the mean, and in one direction a tip "
            f"that is clamped behind the {'shank' if shank[0] else 'flutes'} yields up to {100.0 * spread:.0f} % more "
            f"or less (helix of {degrees:g} deg); hit it in two directions at right angles"
        )
    stiff_over_soft = (1.0 - spread) / (1.0 + spread)
    in_y = stiff_over_soft if shape.moment[1] > shape.moment[0] else 1.0 / stiff_over_soft
    return (
        "has two straight flutes; the model has the plane y of the section, in which a clamped tip yields "
        f"{in_y:.2f} times as much as in x"
    )


def shape_keys(segment: Segment) -> dict[str, Any]:
    """Return the keys `shape` of a segment as a file states them, none for a circle or ring.

    Raises
    ------
    ValueError
        The shape has neither an outline nor a recipe.
    """
    shape = segment.shape
    if shape is None:
        return {}
    scale = segment.outer_diameter / shape.diameter
    table: dict[str, Any] = {}
    for key, value in shape.recipe:
        table[key] = units.LENGTH.text(scale * value) if isinstance(value, float) else value
    if not table.keys() & _KINDS.keys():
        if not shape.outline:
            raise ValueError(f"{shape!r} has no outline and cannot be written as a table of a campaign")

        def corners(line: tuple[tuple[float, float], ...]) -> list[list[float]]:
            return [[1e3 * segment.outer_diameter * x, 1e3 * segment.outer_diameter * y] for x, y in line]

        table |= {"points": corners(shape.outline), "unit": "mm"}
        if shape.holes:
            table["holes"] = [corners(hole) for hole in shape.holes]
    return {"shape": table}
