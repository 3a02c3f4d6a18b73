"""Conical holders and fluted tools as the package describes them: crudely, by cylinders, or as they are.

crude
    Two cylinders for each cone, each of the mean diameter of its half; a groove is left out; flutes are a cylinder of
    0.8 of their diameter. This is what is written down without cones and sections, and it is stated as exact.
right
    Cones by the diameters of both ends, a groove as a segment of its own, and flutes by the points of their outline,
    with the average of both planes for two.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import replace

from blind.generator import Nominal
from blind.generator.flutes import outline
from blind.generator.geometry import ends_of, is_conical
from receptance import Material, SectionShape, Segment
from receptance.model.sections import Shear

EFFECTIVE = 0.8
"""Effective diameter of flutes over that of their cutting edges, after Kops and Vo (1990)."""
DRAWN = 0.01
"""Diameter in m with which outlines are drawn; a shape has no size."""


def tool_segments(nominal: Nominal, overhang: float, material: Material, shear: Shear) -> list[Segment]:
    """Return the segments of a fluted tool."""
    p = nominal.numbers
    diameter = p["tool.diameter"] * p["flute.ratio"]
    flutes = Segment(length=p["flute.length"], outer_diameter=EFFECTIVE * diameter, material=material, shear=shear)
    if nominal.geometry == "right":
        shape = _shape(round(p["flute.number"]), p["flute.core"], p["flute.opening"])
        flutes = replace(flutes, outer_diameter=diameter, shape=shape)
    rest = overhang - p["flute.length"]
    return [flutes, Segment(length=rest, outer_diameter=p["tool.diameter"], material=material, shear=shear)]


@functools.cache
def _shape(number: int, core: float, opening: float) -> SectionShape:
    shape = SectionShape.polygon(DRAWN * outline(number, core, opening), name=f"{number} flutes")
    return shape.averaged() if number == 2 else shape


def holder_segments(nominal: Nominal, materials: Mapping[str, Material], shear: Shear) -> list[Segment]:
    """Return the segments of a conical holder; those that hold the shank have a core."""
    p = nominal.numbers
    segments: list[Segment] = []
    begin = 0.0
    for i in range(3):
        steel = materials["holder"]
        if i == 2 and "holder.stiffer" in p:
            steel = replace(steel, youngs_modulus=steel.youngs_modulus * 10.0 ** p["holder.stiffer"])
        outer, inner = ends_of(p, i)
        length = p[f"holder.{i}.length"]
        whole = Segment(
            length=length, outer_diameter=outer[0], inner_diameter=p["tool.diameter"] if i == 0 else inner[0],
            material=steel, core=materials["tool"] if i == 0 else None, shear=shear,
        )  # fmt: skip
        if not is_conical(p, i):
            groove = nominal.geometry == "right" and i == 1 and "patch.groove.start" in p
            segments += _grooved(whole, p, begin) if groove else [whole]
        elif nominal.geometry == "right":
            # The bore that holds the shank is a cylinder.
            bore = None if i == 0 else inner[1]
            segments.append(replace(whole, end_outer_diameter=outer[1], end_inner_diameter=bore))
        else:
            for share in (0.25, 0.75):
                mean = outer[0] + share * (outer[1] - outer[0])
                bore = whole.inner_diameter if i == 0 else inner[0] + share * (inner[1] - inner[0])
                segments.append(replace(whole, length=0.5 * length, outer_diameter=mean, inner_diameter=bore))
        begin += length
    return segments


def _grooved(whole: Segment, p: Mapping[str, float], begin: float) -> list[Segment]:
    """Return a segment in three pieces, the middle one with the diameter of the groove."""
    start, end = (p[f"patch.groove.{name}"] - begin for name in ("start", "end"))
    thin = whole.outer_diameter * p["patch.groove.outer"]
    return [
        replace(whole, length=start),
        replace(whole, length=end - start, outer_diameter=thin),
        replace(whole, length=whole.length - end),
    ]


def geometry_addresses(nominal: Nominal, number: str) -> list[str]:
    """Return the addresses of a number of the tool; cones are stated as exact and have no tolerance."""
    if number == "tool.overhang":
        return ["tool.segment[1].length"]
    halves = 2 if nominal.geometry == "crude" and is_conical(nominal.numbers, 0) else 1
    if number == "tool.diameter":
        # The shank fills the bore.
        return ["tool.segment[*].outer_diameter", *(f"holder.segment[{i}].inner_diameter" for i in range(halves))]
    field = {"tool.modulus": "youngs_modulus", "tool.density": "density"}[number]
    return [f"tool.segment[*].{field}", *(f"holder.segment[{i}].core.{field}" for i in range(halves))]
