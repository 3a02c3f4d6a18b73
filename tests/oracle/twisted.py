"""Twisted beams by finite elements: bending in two planes, which the twist of the principal axes couples.

A beam is a row of short elements, each of a section whose principal axes are turned a little against those of the one
before. No code of the package is used. An element has linear displacements and slopes, the shear strain in its middle,
and the flexibility h^2 / (12 E I) added to that of shear, with which it is exact for loads at its ends (MacNeal,
Computers & Structures 8, 1978, 175). The far end is clamped.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import eigsh, splu

FloatArray = NDArray[np.float64]
PER_TURN = 240
"""Elements of a turn of the section by 180 degrees."""
LEAST = 60
"""Least number of elements of a piece."""


@dataclass(frozen=True)
class Piece:
    """A piece of a beam: `twist` is the angle by which the section turns along it, `start` its angle before."""

    length: float
    area: float
    moments: tuple[float, float]
    """Second moments in m^4 for deflections along both principal axes."""
    kappas: tuple[float, float]
    """Shear coefficients for the same."""
    twist: float = 0.0
    start: float = 0.0


@dataclass(frozen=True)
class Material:
    """Modulus in Pa, density in kg/m^3 and Poisson's ratio."""

    modulus: float
    density: float
    poisson: float


def _matrices(pieces: Sequence[Piece], material: Material) -> tuple[sparse.csc_matrix, sparse.csc_matrix]:
    """Return stiffness and mass over (x, slope of x, y, slope of y) at each node, without the clamped one."""
    rows, columns, stiff, heavy = [], [], [], []
    first = 0
    for piece in pieces:
        count = max(LEAST, int(np.ceil(PER_TURN * abs(piece.twist) / np.pi)))
        h = piece.length / count
        shear_modulus = material.modulus / (2.0 * (1.0 + material.poisson))
        strain, curvature = np.array([-1.0 / h, -0.5, 1.0 / h, -0.5]), np.array([0.0, -1.0 / h, 0.0, 1.0 / h])
        k, m = np.zeros((8, 8)), np.zeros((8, 8))
        for plane, (moment, kappa) in enumerate(zip(piece.moments, piece.kappas, strict=True)):
            bending = material.modulus * moment
            shear = 1.0 / (1.0 / (kappa * shear_modulus * piece.area) + h**2 / (12.0 * bending))
            own = np.array([0, 1, 4, 5]) + 2 * plane
            k[np.ix_(own, own)] = h * (shear * np.outer(strain, strain) + bending * np.outer(curvature, curvature))
            for place, inertia in ((0, piece.area), (1, moment)):
                both = own[[place, place + 2]]
                m[np.ix_(both, both)] = material.density * inertia * h / 6.0 * np.array([[2.0, 1.0], [1.0, 2.0]])
        for number in range(count):
            angle = piece.start + piece.twist * (number + 0.5) / count
            turn = np.kron([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]], np.eye(2))
            both = np.kron(np.eye(2), turn)
            places = 4 * first + np.arange(8)
            rows.append(np.repeat(places, 8))
            columns.append(np.tile(places, 8))
            stiff.append((both.T @ k @ both).ravel())
            heavy.append((both.T @ m @ both).ravel())
            first += 1
    size, where = 4 * (first + 1), (np.concatenate(rows), np.concatenate(columns))
    free = slice(0, size - 4)
    k_all, m_all = (sparse.csc_matrix((np.concatenate(v), where), shape=(size, size)) for v in (stiff, heavy))
    return k_all[free, free].tocsc(), m_all[free, free].tocsc()


def tip_compliances(pieces: Sequence[Piece], material: Material) -> FloatArray:
    """Return the smallest and the largest static compliance of the tip over all directions, in m/N."""
    stiffness, _ = _matrices(pieces, material)
    load = np.zeros((stiffness.shape[0], 2))
    load[0, 0] = load[2, 1] = 1.0
    moved = splu(stiffness).solve(load)
    return np.linalg.eigvalsh(moved[[0, 2]])


def frequencies(pieces: Sequence[Piece], material: Material, count: int) -> FloatArray:
    """Return the lowest natural frequencies in Hz, ascending, those of both directions."""
    stiffness, mass = _matrices(pieces, material)
    squares = eigsh(stiffness, count, mass, sigma=0.0, return_eigenvectors=False)
    return np.sort(np.sqrt(squares)) / (2.0 * np.pi)
