"""Sections of end mills with flutes, by the laboratory's own outline and its own integration.

The outline is a circle of diameter 1 from which a disc is cut for each flute. A disc touches the core from outside and
opens a share of its sector at the circumference; the lands between are the circle itself. Area and second moments are
those of the polygon, by Green's theorem. Cowper's shear coefficient (J. Appl. Mech. 33, 1966, 335, Eq. 24) needs a
harmonic function with a stated flux through the outline. It is found on a square grid of bilinear elements whose
integrals count only what is within the outline, so that the outline needs no mesh of its own.

Two flutes are taken with the averages over a pitch of the helix: of the bending and the shear compliance, and of the
rotary inertia.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import spsolve

ARC_POINTS = 60
"""Points of a flute, and of a land."""
CORES_AND_OPENINGS = {
    2: ((0.50, 0.60), (0.45, 0.52)),
    3: ((0.50, 0.62), (0.64, 0.74)),
    4: ((0.50, 0.65), (0.70, 0.80)),
}
"""Usual ratios of core diameter and diameter, and shares of the circumference that flutes take, by their number."""
CELLS, SAMPLES = 72, 8
"""Cells of the grid along the diameter, and samples along the side of a cell."""

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Section:
    """Factors of a section relative to the solid circle of its diameter, and its shear flexibility.

    1/kappa = `shear[0]` + `shear[1]` s with s = nu / (1 + nu).
    """

    area: float
    moment: float
    inertia: float
    shear: tuple[float, float]

    def coefficient(self, nu: float) -> float:
        """Return the shear coefficient kappa for a Poisson's ratio."""
        return 1.0 / (self.shear[0] + self.shear[1] * nu / (1.0 + nu))


def outline(number: int, core: float, opening: float) -> FloatArray:
    """Return the corners of a section of diameter 1, counter-clockwise, `(n, 2)`.

    Parameters
    ----------
    number : int
        Number of flutes.
    core : float
        Core diameter divided by the diameter.
    opening : float
        Share of the circumference that the flutes take.
    """
    outer, inner = 0.5, 0.5 * core
    half = np.pi * opening / number
    reach = outer * np.cos(half)
    if reach <= inner:
        raise ValueError(f"{number} flutes that open {opening:g} of the circumference reach no core of {core:g}")
    # The disc through the edges of both lands that touches the core.
    radius = (outer**2 + inner**2 - 2.0 * inner * reach) / (2.0 * (reach - inner))
    centre = inner + radius
    away = np.arctan2(outer * np.sin(half), centre - reach)
    turn = np.linspace(-away, away, ARC_POINTS)
    flute = np.column_stack([centre - radius * np.cos(turn), radius * np.sin(turn)])
    angle = np.linspace(half, 2.0 * np.pi / number - half, ARC_POINTS)[1:-1]
    land = outer * np.column_stack([np.cos(angle), np.sin(angle)])
    tooth = np.concatenate([flute, land])
    turns = 2.0 * np.pi * np.arange(number) / number
    cosine, sine = np.cos(turns)[:, None], np.sin(turns)[:, None]
    x, y = tooth.T
    return np.stack([cosine * x - sine * y, sine * x + cosine * y], axis=-1).reshape(-1, 2)


def moments(corners: FloatArray) -> tuple[float, float, float]:
    """Return the area of a polygon, and the integrals of x^2 and of y^2 over it, by Green's theorem."""
    x, y = corners.T
    u, v = np.roll(x, -1), np.roll(y, -1)
    cross = x * v - u * y
    area = 0.5 * float(cross.sum())
    squares = (float((cross * (a * a + a * b + b * b)).sum() / 12.0) for a, b in ((x, u), (y, v)))
    return (area, *squares)  # type: ignore[return-value]


def shear_flexibility(corners: FloatArray, cells: int = CELLS) -> tuple[float, float]:
    """Return both numbers of Cowper's shear flexibility for a deflection along x.

    The polygon has its centroid in the origin, from which all corners are seen, and x is a principal axis.

    With the load along x, chi is harmonic with the flux F n through the outline, F = -(nu x^2 / 2 + (1 - nu / 2) y^2,
    (2 + nu) x y); in weak form, int grad chi grad v = int F grad v + v div F. Then 1/kappa = (nu / 2 (I_x - I_y) -
    A / I_y int x (chi + x y^2)) / (2 (1 + nu) I_y), with I_y the integral of x^2. It is linear in s, so two Poisson's
    ratios are enough.
    """
    size = float(np.max(np.abs(corners)))
    step = 2.0 * size / cells
    local = (np.arange(SAMPLES) + 0.5) / SAMPLES
    fine = -size + step * (np.arange(cells)[:, None] + local).ravel()
    x, y = (one.ravel() for one in np.meshgrid(fine, fine, indexing="ij"))

    def by_cell(values: FloatArray) -> FloatArray:
        blocks = values.reshape(cells, SAMPLES, cells, SAMPLES).transpose(0, 2, 1, 3)
        return blocks.reshape(cells**2, SAMPLES**2)

    x, y, inside = by_cell(x), by_cell(y), by_cell(_inside(corners, x, y).astype(float))
    weight = inside * (step / SAMPLES) ** 2
    a, b = (one.ravel() for one in np.meshgrid(local, local, indexing="ij"))
    # The four shapes of a cell, their slopes along x and y, at its samples.
    shapes = np.stack([(1 - a) * (1 - b), a * (1 - b), a * b, (1 - a) * b])
    along_x = np.stack([b - 1, 1 - b, b, -b]) / step
    along_y = np.stack([a - 1, -a, a, 1 - a]) / step
    i, j = (one.ravel() for one in np.meshgrid(np.arange(cells), np.arange(cells), indexing="ij"))
    nodes = np.stack([i * (cells + 1) + j, (i + 1) * (cells + 1) + j, (i + 1) * (cells + 1) + j + 1,
                      i * (cells + 1) + j + 1], axis=1)  # fmt: skip
    products = along_x[:, None] * along_x[None] + along_y[:, None] * along_y[None]
    blocks = np.einsum("cs,ijs->cij", weight, products)
    count = (cells + 1) ** 2
    rows, columns = np.repeat(nodes, 4, axis=1).ravel(), np.tile(nodes, (1, 4)).ravel()
    stiffness = sparse.coo_matrix((blocks.ravel(), (rows, columns)), shape=(count, count)).tocsr()
    # Nodes of covered cells; the function is free up to a constant, so one of them is held.
    covered = np.unique(nodes[weight.sum(axis=1) > 0.0])[1:]
    area, second, other = (float((weight * f).sum()) for f in (np.ones_like(x), x * x, y * y))
    results = []
    for nu in (0.0, 1.0):
        flux_x, flux_y = -(0.5 * nu * x**2 + (1.0 - 0.5 * nu) * y**2), -(2.0 + nu) * x * y
        divergence = -2.0 * (1.0 + nu) * x
        load = (weight * flux_x) @ along_x.T + (weight * flux_y) @ along_y.T + (weight * divergence) @ shapes.T
        force = np.bincount(nodes.ravel(), load.ravel(), count)
        chi = np.zeros(count)
        chi[covered] = spsolve(stiffness[covered][:, covered].tocsc(), force[covered])
        warp = np.einsum("cn,ns->cs", chi[nodes], shapes)
        integral = float((weight * x * (warp + x * y**2)).sum())
        results.append((0.5 * nu * (other - second) - area / second * integral) / (2.0 * (1.0 + nu) * second))
    return results[0], 2.0 * (results[1] - results[0])


def _inside(corners: FloatArray, x: FloatArray, y: FloatArray) -> NDArray[np.bool_]:
    """Return which points are within a polygon all of whose corners are seen from the origin, counter-clockwise."""
    angles = np.arctan2(corners[:, 1], corners[:, 0])
    first = int(np.argmin(angles))
    ring = np.roll(corners, -first, axis=0)
    edge = np.searchsorted(np.sort(angles), np.arctan2(y, x), side="right") - 1
    a, b = ring[edge], ring[(edge + 1) % len(ring)]
    return (b[:, 0] - a[:, 0]) * (y - a[:, 1]) - (b[:, 1] - a[:, 1]) * (x - a[:, 0]) >= 0.0  # type: ignore[no-any-return]


@cache
def section_of(number: int, core: float, opening: float) -> Section:
    """Return the section of an end mill; with two flutes its averages over a pitch."""
    corners = outline(number, core, opening)
    area, second_x, second_y = moments(corners)
    shear = shear_flexibility(corners)
    if number == 2:
        turned = shear_flexibility(np.column_stack([-corners[:, 1], corners[:, 0]]))
        shear = (0.5 * (shear[0] + turned[0]), 0.5 * (shear[1] + turned[1]))
    circle_area, circle = np.pi / 4.0, np.pi / 64.0
    stiff = 2.0 / (1.0 / second_x + 1.0 / second_y)
    return Section(area / circle_area, stiff / circle, 0.5 * (second_x + second_y) / circle, shear)
