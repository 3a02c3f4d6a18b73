"""Properties of a cross-section of any outline, about its principal axes: exact ones, and those of the warping."""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

import numpy as np

from receptance.errors import MissingExtraError, warn_user
from receptance.model.meshing import MeshError, mesh_by_sectionproperties, mesh_of, spacing_for
from receptance.model.outlines import Moments, Outline, moments, signed_area
from receptance.model.warping import Flexibility, Warping, mean_of_planes, warping

_ISOTROPIC = 1e-7
"""Relative difference of the principal second moments below which they are taken for equal."""


class Solution(NamedTuple):
    """Properties in SI units; planes are those of the principal axes, the first at `angle` in rad to x."""

    area: float
    centroid: tuple[float, float]
    moments: tuple[float, float]
    angle: float
    torsion: float
    cowper: tuple[Flexibility, Flexibility]
    hutchinson: tuple[Flexibility, Flexibility]


def solution_of(outline: Outline) -> Solution:
    """Return the properties of an outline with its holes; equal outlines are solved once.

    Where no mesh is made, as with very sharp corners, torsion and shear are approximations, with a warning:
    Saint-Venant's torsion constant A^4 / (40 I_p) of the outline less those of the holes, and Cowper's coefficient of a
    rectangle or, with holes, that of the ring with the same ratio of areas.

    Examples
    --------
    >>> from receptance.model.outlines import checked_outline
    >>> from receptance.model.section_solutions import solution_of
    >>> triangle = checked_outline("bar", [(0, 0), (0.01, 0), (0.005, 0.01 * 0.75**0.5)])
    >>> f"{solution_of(triangle).torsion:.4g}"  # 3**0.5 / 80 of the fourth power of the side
    '2.165e-10'
    """
    return _solution(tuple(ring.tobytes() for ring in outline.rings))


@functools.lru_cache(maxsize=256)
def _solution(rings: tuple[bytes, ...]) -> Solution:
    points, *holes = (np.frombuffer(ring).reshape(-1, 2) for ring in rings)
    outline = Outline(points, tuple(holes))
    exact = moments(outline)
    half, mean = 0.5 * (exact.xx - exact.yy), 0.5 * (exact.xx + exact.yy)
    radius = math.hypot(half, exact.xy)
    isotropic = radius <= _ISOTROPIC * mean
    # The principal axis that is closer to x, so that a drawing along the axes keeps them.
    angle = 0.0 if isotropic else 0.5 * math.atan2(exact.xy, half) if half > 0.0 else -0.5 * math.atan2(exact.xy, -half)
    if abs(angle) < 1e-10:
        angle = 0.0
    centred = Outline(points - exact.centroid, tuple(hole - exact.centroid for hole in holes))
    principal = (mean + math.copysign(radius, half), mean - math.copysign(radius, half))
    result = _warping(centred.turned(-angle), exact)
    cowper, hutchinson = result.cowper, result.hutchinson
    if isotropic:
        principal = (mean, mean)
        cowper, hutchinson = mean_of_planes(cowper), mean_of_planes(hutchinson)
    return Solution(exact.area, exact.centroid, principal, angle, result.torsion, cowper, hutchinson)


def _warping(outline: Outline, exact: Moments) -> Warping:
    """Return torsion and shear by finite elements, or by approximations with a warning."""
    spacing = spacing_for(outline)
    try:
        return warping(mesh_of(outline, spacing))
    except MeshError:
        try:
            return warping(mesh_by_sectionproperties(outline, spacing))
        except MissingExtraError as error:
            warn_user(
                "SectionShape: torsion and shear are those of a compact section with the same area and second moments, "
                f"which may be wrong by 10 % and more; {error}; or round very sharp corners of the outline"
            )
    return approximation(outline, exact)


def approximation(outline: Outline, exact: Moments) -> Warping:
    """Return approximations of torsion and shear for compact sections, see `solution_of`."""
    torsion = 0.0
    for ring in outline.rings:
        ring_moments = moments(Outline(ring if signed_area(ring) > 0.0 else ring[::-1], ()))
        torsion += math.copysign(1.0, signed_area(ring)) * (
            ring_moments.area**4 / (40.0 * (ring_moments.xx + ring_moments.yy))
        )
    share = sum(-signed_area(hole) for hole in outline.holes) / signed_area(outline.points)
    ring_part = 20.0 * share / (1.0 + share) ** 2
    # Cowper's Eq. for the ring: 1/kappa = ((7 + 6 nu) (1 + m^2)^2 + (20 + 12 nu) m^2) / (6 (1 + nu) (1 + m^2)^2).
    first, second = (7.0 + ring_part) / 6.0, (6.0 + 0.6 * ring_part) / 6.0
    flexibility = (first, second - first, 0.0) if share else (6 / 5, -1 / 10, 0.0)
    pair = (flexibility, flexibility)
    return Warping(max(torsion, 1e-6 * (exact.xx + exact.yy)), pair, pair, pair)
