"""Conical holders and fluted tools as the truth: beams whose section varies, and how cones and flutes are drawn.

Numbers of a configuration that has them:

holder.N.cone, holder.N.funnel
    Outer diameter and bore of a section of the holder at its far end, divided by those at its near end; between the
    ends both are linear.
patch.groove.*
    A groove for the gripper, in the notation of `rig`.
flute.number, flute.core, flute.opening
    What `flutes.outline` needs; `flute.length` and `flute.ratio` are those of a thinner end.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.polynomial import legendre

from .elements import ComplexArray, FloatArray, Ring, Structure, rigidities, shape_functions
from .flutes import CORES_AND_OPENINGS, section_of

Rings = Callable[[float], Sequence[Ring]]
"""Returns the rings of a section from its place in m behind the start of a beam."""
GEOMETRIES = ("crude", "right")
"""How cones and flutes may be described: by cylinders that are stated as exact, or as they are."""
GEOMETRY_STREAM = 88
"""Stream of random numbers of cones and flutes; all else of a case is drawn as without them."""
DEGREE, LONGEST, POINTS = 5, 0.0125, 12
"""Degree of the polynomials, the longest element in m, and its points of integration."""
BOTH_CONES, FUNNEL = 0.5, 0.5
"""Shares of holders with two cones, and of those with a conical bore; the others have a groove."""


def varying(structure: Structure, start: int, length: float, rings_at: Rings) -> int:
    """Add a beam whose section varies, and return the station at its other end.

    The section enters the integrals of an element at each of their points, so that nothing is taken as a cylinder.
    """
    count = max(1, math.ceil(structure.refinement * length / LONGEST))
    part = length / count
    points, _ = legendre.leggauss(POINTS)

    def matrices(number: int) -> tuple[ComplexArray, FloatArray]:
        places = part * (number + 0.5 * (points + 1.0))
        return _element(part, [rigidities(rings_at(float(place))) for place in places])

    return structure.elements(start, count, DEGREE, matrices)


def _element(
    length: float, sections: Sequence[tuple[complex, complex, float, float]]
) -> tuple[ComplexArray, FloatArray]:
    """Return stiffness and mass of an element from its sections at the points of integration."""
    weights, values, slopes = shape_functions(DEGREE, POINTS)
    shear, bending, mass, rotary = (weights * np.array(one) for one in zip(*sections, strict=True))
    half, n = 0.5 * length, DEGREE + 1
    stiffness = np.zeros((2 * n, 2 * n), dtype=np.complex128)
    inertia = np.zeros((2 * n, 2 * n))
    mixed = -slopes.T @ (shear[:, None] * values)
    stiffness[:n, :n] = slopes.T @ (shear[:, None] * slopes) / half
    stiffness[:n, n:], stiffness[n:, :n] = mixed, mixed.T
    stiffness[n:, n:] = half * values.T @ (shear[:, None] * values)
    stiffness[n:, n:] += slopes.T @ (bending[:, None] * slopes) / half
    inertia[:n, :n] = half * values.T @ (mass.real[:, None] * values)
    inertia[n:, n:] = half * values.T @ (rotary.real[:, None] * values)
    return stiffness, inertia


def ends_of(p: Mapping[str, float], section: int) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the outer diameter of a section of the holder at both ends, and its bore at both ends, in m."""
    outer, inner = p[f"holder.{section}.outer"], p[f"holder.{section}.inner"]
    ratios = p.get(f"holder.{section}.cone", 1.0), p.get(f"holder.{section}.funnel", 1.0)
    return (outer, outer * ratios[0]), (inner, inner * ratios[1])


def is_conical(p: Mapping[str, float], section: int) -> bool:
    """Return whether a section of the holder varies along its length."""
    return f"holder.{section}.cone" in p or f"holder.{section}.funnel" in p


def fluted(ring: Ring, p: Mapping[str, float]) -> Ring:
    """Return the section of the fluted part from that of the cylinder around it."""
    section = section_of(round(p["flute.number"]), p["flute.core"], p["flute.opening"])
    return Ring(
        ring.outer, ring.inner, ring.modulus, ring.density, ring.poisson, ring.loss,
        section.coefficient(ring.poisson) * p.get("shear.scale", 1.0), section.area, section.moment, section.inertia,
    )  # fmt: skip


def draw_geometry(rng: np.random.Generator, p: Mapping[str, float]) -> dict[str, float]:
    """Return the numbers of cones and flutes of a holder and a tool, and the diameters that go with them.

    The nose is a cone, in half of the holders the last section as well. Half of the holders have a conical bore in the
    last section, the others a groove in the middle one.
    """
    diameter = p["tool.diameter"]
    found = {
        "holder.0.outer": round(diameter + float(rng.uniform(0.009, 0.014)), 4),
        "holder.0.cone": float(rng.uniform(1.2, 1.5)),
    }
    if rng.random() < BOTH_CONES:
        found["holder.2.cone"] = float(rng.uniform(0.7, 0.85))
    if rng.random() < FUNNEL:
        found["holder.2.funnel"] = float(rng.uniform(0.5, 0.75))
    else:
        width, depth = float(rng.uniform(0.006, 0.009)), float(rng.uniform(0.003, 0.006))
        middle = p["holder.0.length"] + 0.5 * p["holder.1.length"]
        ends = {"start": middle - 0.5 * width, "end": middle + 0.5 * width}
        fields = {"part": 1.0, **ends, "outer": 1.0 - 2.0 * depth / p["holder.1.outer"]}
        found |= {f"patch.groove.{name}": value for name, value in fields.items()}
    number = int(rng.choice(list(CORES_AND_OPENINGS)))
    cores, openings = CORES_AND_OPENINGS[number]
    found |= {
        "flute.number": float(number),
        "flute.core": float(rng.uniform(*cores)),
        "flute.opening": float(rng.uniform(*openings)),
        "flute.length": round(float(rng.uniform(1.6, 2.4)) * diameter, 4),
        "flute.ratio": 1.0,
    }
    return found
