"""Finite elements of two beams side by side with a layer or springs between them, for one chain with an overlap.

Tool segments in front, the overlap, holder segments behind: the beams are the hierarchic elements of `elements`,
the layer is integrated over them. Independent of the core and of the matrix exponential.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray
from scipy import linalg

from . import elements
from .tables import segment

FloatArray = NDArray[np.float64]
Beam = Sequence[float]
"""Length, outer diameter, bore, E, rho, nu."""


def chain(
    tool: Sequence[Beam], overlap: Sequence[float], holder: Sequence[Beam], cells: int = 4, layer_cells: int = 8
) -> tuple[FloatArray, FloatArray]:
    """Return the factors of stiffness and mass of a chain without losses; unknowns 0, 1 are y and theta at the tip.

    Unknowns 2 and 3 are those at the far end. `overlap` is a row of `overlaps`; a layer is cut into
    `layer_cells` elements, each stretch between two points into two, each other beam into `cells`.
    """
    length, slope, points = overlap[2], overlap[30], int(overlap[31])
    k = [overlap[25], overlap[26]]
    tool = [(beam[0] / cells, *beam[1:]) for beam in tool for _ in range(cells)]
    holder = [(beam[0] / cells, *beam[1:]) for beam in holder for _ in range(cells)]
    lengths = [length / (2 * points)] * (2 * points) if points else [length / layer_cells] * layer_cells
    shank = [[each, *overlap[3:5], *overlap[5:8]] for each in lengths]
    bore = [[each, *overlap[14:16], *overlap[16:19]] for each in lengths]
    inner, outer = [*tool, *shank], [*bore, *holder]
    # nodes: tip 0, far end 1, then the rest of the inner and of the outer beam
    n_inner, n_outer = len(inner), len(outer)
    inner_nodes = [0, *range(2, 2 + n_inner)]
    outer_nodes = [*range(2 + n_inner, 2 + n_inner + n_outer), 1]
    n_unknowns = 2 * (2 + n_inner + n_outer)
    strains: list[tuple[FloatArray, FloatArray]] = []
    inertias: list[tuple[FloatArray, FloatArray]] = []
    n_bubbles = 2 * elements.DEGREE - 3
    unknowns = {}
    for which, beams, nodes in ((0, inner, inner_nodes), (1, outer, outer_nodes)):
        for number, beam in enumerate(beams):
            row = np.array(segment(0, 1, beam[0], beam[1], tuple(beam[3:6]), inner_diameter=beam[2]))
            strain, inertia = elements._element(beam[0], elements._section(row))
            left, right = 2 * nodes[number], 2 * nodes[number + 1]
            index = np.array([left, left + 1, right, right + 1, *range(n_unknowns, n_unknowns + n_bubbles)])
            n_unknowns += n_bubbles
            unknowns[which, number] = index
            strains.append((index, strain))
            inertias.append((index, inertia))
    if points:
        for number in range(points):
            a, b = 2 * inner_nodes[len(tool) + 1 + 2 * number], 2 * outer_nodes[2 * number + 1]
            share = (1.0 + slope * ((2 * number + 1) / points - 1.0)) / points
            for direction in (0, 1):
                spring = math.sqrt(k[direction] * share) * np.array([[1.0, -1.0]])
                strains.append((np.array([a + direction, b + direction]), spring))
    else:
        for cell in range(layer_cells):
            shapes = _layer(lengths[cell], [value / length for value in k])
            index = np.concatenate([unknowns[0, len(tool) + cell], unknowns[1, cell]])
            strains.append((index, np.hstack([shapes, -shapes])))
    return elements._stack(strains, n_unknowns), elements._stack(inertias, n_unknowns)


def _layer(length: float, k: Sequence[float]) -> FloatArray:
    """Return the factor of the layer's energy over the unknowns of one element of one beam."""
    points, weights = legendre.leggauss(elements.DEGREE + 1)
    n = 4 + 2 * elements.DEGREE - 3
    y, _ = elements._shapes(elements.DEGREE, points)
    theta, _ = elements._shapes(elements.DEGREE - 1, points)
    out = np.zeros((2 * len(points), n))
    scale = np.sqrt(weights * length / 2.0)[:, None]
    out[: len(points), [0, 2, *range(4, 3 + elements.DEGREE)]] = math.sqrt(k[0]) * scale * y
    out[len(points) :, [1, 3, *range(3 + elements.DEGREE, n)]] = math.sqrt(k[1]) * scale * theta
    return out


def receptance(strain: FloatArray, inertia: FloatArray, w: float) -> FloatArray:
    """Return the 4x4 receptance over (tip y, theta, far end y, theta)."""
    stiffness, mass = strain.T @ strain, inertia.T @ inertia
    matrix = stiffness - w * w * mass
    size = np.sqrt(np.abs(np.diag(stiffness)) + w * w * np.diag(mass))
    loads = np.zeros((len(matrix), 4))
    loads[range(4), range(4)] = 1.0
    solution = linalg.solve(matrix / np.outer(size, size), loads / size[:, None], assume_a="sym")
    return (solution / size[:, None])[:4]


def natural_frequencies(strain: FloatArray, inertia: FloatArray, limit_hz: float) -> FloatArray:
    """Return the elastic natural frequencies of the free chain below a limit, the two rigid-body modes left out."""
    scale = np.linalg.norm(inertia, axis=0)
    triangular = np.linalg.qr(inertia / scale, mode="r")
    dynamic = linalg.solve_triangular(triangular, (strain / scale).T, trans="T").T
    hz = np.sort(elements._singular_values(dynamic))[2:] / (2.0 * np.pi)
    return hz[hz < limit_hz]
