"""Torsion constant and shear coefficients of a cross-section by finite elements for its warping functions.

All are integrals of functions that are harmonic on the section. With x and y about the centroid and n the normal of the
outline, the function of torsion has d omega/dn = y n_x - x n_y, and the torsion constant is
J = int (x^2 + y^2 + x d omega/dy - y d omega/dx) dA. The flexure function chi of Saint-Venant for a load in x has
d chi/dn = -g n with the vector g = (nu x^2 / 2 + (1 - nu / 2) y^2, (2 + nu) x y), and the shear stress is proportional
to D = grad chi + g, of which div D = 2 (1 + nu) x. With I_x = int x^2 dA and I_y = int y^2 dA:

- Cowper (The shear coefficient in Timoshenko's beam theory, J. Appl. Mech. 33, 1966, 335):
  1/kappa = [nu (I_y - I_x) / 2 - A / I_x int x (chi + x y^2) dA] / (2 (1 + nu) I_x)
- energy of the shear stress (Pilkey, Analysis and Design of Elastic Beams, 2002):
  1/kappa = A / I_x^2 int D D dA / (4 (1 + nu)^2)
- Hutchinson (Shear coefficients for Timoshenko beam theory, J. Appl. Mech. 68, 2001, 87):
  1/kappa = energy - A / I_x^2 nu int h D dA / (2 (1 + nu)^2) - nu (1 - I_y / I_x) / (2 (1 + nu)) with
  h = ((x^2 - y^2) / 2, x y)

The function chi is linear in nu, so each is exactly a polynomial of s = nu / (1 + nu). For circles and rectangles
Cowper's is the mean of the other two.

The papers and the book were not at hand, so that no equation numbers are given: the formulas are checked by the closed
forms of circle, ring and rectangle, and that of the energy by another program; see "Shear and torsion" in the
documentation.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from receptance.model.meshing import Mesh

Array = NDArray[np.float64]
Flexibility = tuple[float, float, float]
"""Polynomial p0, p1, p2 of 1/kappa in s = nu / (1 + nu)."""

# Quadrature of fourth order with six points: D. A. Dunavant, Int. J. Numer. Meth. Eng. 21, 1985, 1129.
_A, _B = 0.445948490915965, 0.091576213509771
_WEIGHTS = np.repeat([0.223381589678011, 0.109951743655322], 3) / 2.0
_PLACES = np.array([[_A, _A], [1 - 2 * _A, _A], [_A, 1 - 2 * _A], [_B, _B], [1 - 2 * _B, _B], [_B, 1 - 2 * _B]])


class Warping(NamedTuple):
    """Torsion constant in m^4, and polynomials of 1/kappa for loads in x and in y."""

    torsion: float
    cowper: tuple[Flexibility, Flexibility]
    hutchinson: tuple[Flexibility, Flexibility]
    energy: tuple[Flexibility, Flexibility]


def warping(mesh: Mesh) -> Warping:
    """Return torsion constant and shear coefficients of a section.

    Parameters
    ----------
    mesh : Mesh
        The section; x and y should be its principal axes.

    Examples
    --------
    The square has the torsion constant 0.1406 a^4 and, after Cowper, 1/kappa = 6/5 - s/10:

    >>> from receptance.model.meshing import mesh_of
    >>> from receptance.model.outlines import checked_outline
    >>> from receptance.model.warping import warping
    >>> square = checked_outline("square", [(0, 0), (1, 0), (1, 1), (0, 1)])
    >>> result = warping(mesh_of(square, 0.1))
    >>> round(result.torsion, 4), [round(p, 3) + 0.0 for p in result.cowper[0]]
    (0.1406, [1.2, -0.1, 0.0])
    """
    # Lengths of the order of one keep the equations well scaled.
    size = float(np.max(np.ptp(mesh.nodes, axis=0)))
    nodes = mesh.nodes / size
    weight, value, gradient, place = _integration(nodes, mesh.triangles)
    area = float(np.sum(weight))
    x, y = place[..., 0], place[..., 1]
    x, y = x - np.sum(weight * x) / area, y - np.sum(weight * y) / area
    xx, yy = float(np.sum(weight * x * x)), float(np.sum(weight * y * y))
    zero = np.zeros_like(x)
    # Right sides int (v grad w) dA + int (f w) dA, from Green's theorem, without integrals along the outline: for
    # torsion v = (y, -x), for flexure v = -g and f = -div g. Load in x, then in y, each without and with nu.
    parts_x = (np.stack([y * y, 2 * x * y], -1), np.stack([(x * x - y * y) / 2, x * y], -1))
    parts_y = (np.stack([2 * x * y, x * x], -1), np.stack([x * y, (y * y - x * x) / 2], -1))
    fields = [np.stack([y, -x], -1), *(-part for part in (*parts_x, *parts_y))]
    sources = [zero, -2 * x, -2 * x, -2 * y, -2 * y]
    right = np.stack(
        [
            np.einsum("eq,eqnk,eqk->en", weight, gradient, v) + np.einsum("eq,qn,eq->en", weight, value, f)
            for v, f in zip(fields, sources, strict=True)
        ],
        axis=-1,
    )
    solutions = _solved(mesh.triangles, len(nodes), np.einsum("eq,eqnk,eqmk->enm", weight, gradient, gradient), right)
    local = solutions[mesh.triangles]
    values = np.einsum("qn,enr->eqr", value, local)
    gradients = np.einsum("eqnk,enr->eqkr", gradient, local)
    torsion = xx + yy + float(np.sum(weight * (x * gradients[..., 1, 0] - y * gradients[..., 0, 0])))
    planes = []
    for column, parts, along, across, moment, other in ((1, parts_x, x, y, xx, yy), (3, parts_y, y, x, yy, xx)):
        chi = values[..., column], values[..., column + 1]
        stress = gradients[..., column] + parts[0], gradients[..., column + 1] + parts[1]
        planes.append(
            _coefficients(weight, area, along, across, moment, other, chi=chi, stress=stress, poisson_part=parts[1])
        )
    (cowper_x, hutchinson_x, energy_x), (cowper_y, hutchinson_y, energy_y) = planes
    return Warping(torsion * size**4, (cowper_x, cowper_y), (hutchinson_x, hutchinson_y), (energy_x, energy_y))


def mean_of_planes(pair: tuple[Flexibility, Flexibility]) -> tuple[Flexibility, Flexibility]:
    """Return the mean of the flexibilities of both planes, twice.

    Examples
    --------
    >>> from receptance.model.warping import mean_of_planes
    >>> mean_of_planes(((1.2, 0.0, 0.0), (1.0, 0.0, 0.0)))[0]
    (1.1, 0.0, 0.0)
    """
    p0, p1, p2 = (0.5 * (x + y) for x, y in zip(*pair, strict=True))
    return ((p0, p1, p2), (p0, p1, p2))


def _coefficients(
    weight: Array,
    area: float,
    along: Array,
    across: Array,
    moment: float,
    other: float,
    *,
    chi: tuple[Array, Array],
    stress: tuple[Array, Array],
    poisson_part: Array,
) -> tuple[Flexibility, Flexibility, Flexibility]:
    """Return the polynomials of Cowper, Hutchinson and of the energy for a load in the direction `along`."""

    def integral(integrand: Array) -> float:
        return float(np.sum(weight * integrand))

    # Numerators a + b nu over 1 + nu are a + (b - a) s, and a + b nu + c nu^2 over (1 + nu)^2 are
    # a + (b - 2 a) s + (a - b + c) s^2.
    a = -area / moment * integral(along * (chi[0] + along * across**2)) / (2.0 * moment)
    b = (0.5 * (other - moment) - area / moment * integral(along * chi[1])) / (2.0 * moment)
    cowper = (a, b - a, 0.0)
    ratio = area / (4.0 * moment**2)
    a = ratio * integral(np.sum(stress[0] ** 2, axis=-1))
    b = ratio * integral(np.sum(2.0 * stress[0] * stress[1], axis=-1))
    c = ratio * integral(np.sum(stress[1] ** 2, axis=-1))
    energy = (a, b - 2.0 * a, a - b + c)
    b -= 2.0 * ratio * integral(np.sum(poisson_part * stress[0], axis=-1))
    c -= 2.0 * ratio * integral(np.sum(poisson_part * stress[1], axis=-1))
    hutchinson = (a, b - 2.0 * a - 0.5 * (1.0 - other / moment), a - b + c)
    return cowper, hutchinson, energy


def _integration(nodes: Array, triangles: NDArray[np.intp]) -> tuple[Array, Array, Array, Array]:
    """Return weights `(e, q)`, shape functions `(q, 6)`, their gradients `(e, q, 6, 2)` and places `(e, q, 2)`."""
    b, c = _PLACES.T
    a = 1.0 - b - c
    value = np.stack([a * (2 * a - 1), b * (2 * b - 1), c * (2 * c - 1), 4 * a * b, 4 * b * c, 4 * c * a], axis=-1)
    zero = np.zeros_like(a)
    by_b = np.stack([1 - 4 * a, 4 * b - 1, zero, 4 * (a - b), 4 * c, -4 * c], axis=-1)
    by_c = np.stack([1 - 4 * a, zero, 4 * c - 1, -4 * b, 4 * b, 4 * (a - c)], axis=-1)
    # The sides are straight, so the Jacobian is that of the corners.
    corners = nodes[triangles[:, :3]]
    jacobian = np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], axis=1)
    gradient = np.einsum("ekj,qnj->eqnk", np.linalg.inv(jacobian), np.stack([by_b, by_c], axis=-1))
    weight = np.abs(np.linalg.det(jacobian))[:, None] * _WEIGHTS
    return weight, value, gradient, np.einsum("qn,enk->eqk", value, nodes[triangles])


def _solved(triangles: NDArray[np.intp], count: int, stiffness: Array, right: Array) -> Array:
    """Return the solutions `(nodes, right sides)`, which are zero at the first node: each is free up to a constant."""
    rows = np.repeat(triangles, 6, axis=1).ravel()
    columns = np.tile(triangles, (1, 6)).ravel()
    matrix = scipy.sparse.csc_matrix((stiffness.ravel(), (rows, columns)), shape=(count, count))
    vectors = np.zeros((count, right.shape[-1]))
    np.add.at(vectors, triangles, right)
    solutions = np.zeros_like(vectors)
    factors = scipy.sparse.linalg.splu(matrix[1:, 1:], permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
    solutions[1:] = factors.solve(vectors[1:])
    return solutions
