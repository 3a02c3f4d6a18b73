"""Natural frequencies by hierarchic finite elements in float64, independent of the wave solution.

Everything is kept as factors: strain energy is |G u|^2 / 2 and kinetic energy |N v|^2 / 2, and natural
frequencies are singular values of G N^-1. A Jacobi SVD gives them with digits relative to each row, so that
stiff joints and very short segments, whose rows are larger by ten orders, do not cost the low modes their
digits. Eigenvalues of K and M would have an error of eps times the largest one and lose them.
"""

from __future__ import annotations

import math
from fractions import Fraction
from itertools import pairwise

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray
from scipy import linalg

from .tables import HUTCHINSON, Tables

FloatArray = NDArray[np.float64]

DEGREE = 8
"""Of y; the slope has one less, so that y' - theta can vanish and nothing locks."""
WAVE_PER_ELEMENT = 3.0
"""Largest wave number times element length."""
MOST_UNKNOWNS = 3000
SNAP = 8 * np.finfo(np.float64).eps
"""A joint's second principal stiffness is taken as zero when it is below rounding of its entries."""


def natural_frequencies(tables: Tables, limit_hz: float, refinement: float = 1.0) -> FloatArray:
    """Return the elastic natural frequencies of the undamped model below a limit.

    Parameters
    ----------
    tables : Tables
        The model; loss factors and damping are ignored. Nodes need not be numbered along the chain.
    limit_hz : float
        Upper end of the range [Hz].
    refinement : float, optional
        Factor on the number of elements, to see that they suffice.

    Returns
    -------
    ndarray
        Ascending [Hz], without the zero frequencies of rigid-body motion.

    Raises
    ------
    ValueError
        The model would need too many unknowns, or a motion has neither stiffness nor mass.
    """
    strain, inertia = _factors(tables, 2.0 * np.pi * limit_hz, refinement)
    heavy = np.any(inertia != 0.0, axis=0)
    massless = strain[:, ~heavy]
    strain, inertia = strain[:, heavy], inertia[:, heavy]
    if massless.shape[1]:
        scale = np.linalg.norm(massless, axis=0)
        if np.any(scale == 0.0):
            raise ValueError("a node has a motion with neither stiffness nor mass")
        # a massless motion follows the others at the least energy: project it out of the strains
        basis, _ = np.linalg.qr(massless / scale)
        strain = strain - basis @ (basis.T @ strain)
    scale = np.linalg.norm(inertia, axis=0)
    triangular = np.linalg.qr(inertia / scale, mode="r")
    dynamic = linalg.solve_triangular(triangular, (strain / scale).T, trans="T").T
    frequencies = np.sort(_singular_values(dynamic))[rigid_modes(tables) :] / (2.0 * np.pi)
    return frequencies[frequencies < limit_hz]


def complex_frequencies(tables: Tables, limit_hz: float, refinement: float = 1.0) -> NDArray[np.complex128]:
    """Return the complex natural frequencies below a limit with the dashpots of joints and grounds.

    Parameters
    ----------
    tables : Tables
        The model, with mass at every node; loss factors are ignored.
    limit_hz : float
        Largest magnitude [Hz].
    refinement : float, optional
        As in `natural_frequencies`.

    Returns
    -------
    ndarray
        Those with a positive real part, ascending by magnitude [Hz]. With x the strains times the root of the
        stiffness, x' = G v and v' = -G^T x - C v: the eigenvalues of this matrix are i w themselves, not their squares,
        so that low modes keep their digits.
    """
    strain, inertia = _factors(tables, 2.0 * np.pi * limit_hz, refinement)
    dampers = np.zeros((strain.shape[1],) * 2)
    for row in tables.joints:
        index = np.array([2 * int(row[0]), 2 * int(row[0]) + 1, 2 * int(row[1]), 2 * int(row[1]) + 1])
        c = np.array([[row[5], row[7]], [row[7], row[6]]])
        dampers[np.ix_(index, index)] += np.block([[c, -c], [-c, c]])
    for row in tables.grounds:
        index = np.array([2 * int(row[0]), 2 * int(row[0]) + 1])
        dampers[np.ix_(index, index)] += [[row[4], row[6]], [row[6], row[5]]]
    triangular = np.linalg.qr(inertia, mode="r")
    dynamic = np.linalg.qr(linalg.solve_triangular(triangular, strain.T, trans="T").T, mode="r")
    half = linalg.solve_triangular(triangular, dampers, trans="T")
    damping = linalg.solve_triangular(triangular, half.T, trans="T")
    whole = np.block([[np.zeros((len(dynamic),) * 2), dynamic], [-dynamic.T, -damping]])
    w = -1j * linalg.eigvals(whole) / (2.0 * np.pi)
    w = w[(w.real > 1e-6 * np.abs(w)) & (np.abs(w) < limit_hz) & (np.abs(w) > 1e-6 * limit_hz)]
    return np.asarray(w[np.argsort(np.abs(w))])


def _singular_values(matrix: FloatArray) -> FloatArray:
    """Return one singular value a column, of a matrix whose rows may differ by many orders of magnitude."""
    n_rows, n_columns = matrix.shape
    # LAPACK's Jacobi SVD, which keeps digits relative to each row, takes no fewer rows than columns
    padded = np.zeros((max(n_rows, n_columns), n_columns))
    padded[:n_rows] = matrix
    values, _, _, work, _, info = linalg.lapack.dgejsv(padded, joba=3, jobu=3, jobv=3, jobr=0, jobt=1, jobp=1)
    if info != 0:
        raise ValueError(f"the singular values did not converge ({info})")
    return values * (work[0] / work[1])


def rigid_modes(tables: Tables) -> int:
    """Return the number of motions without strain, exactly (in rational arithmetic).

    Such a motion leaves every segment straight and every joint and ground unstretched: a linear system for
    the motions of all nodes, whose nullity is counted.
    """
    n_unknowns = 2 * tables.n_nodes
    rows: list[list[Fraction]] = []

    def constrain(terms: dict[int, Fraction]) -> None:
        rows.append([terms.get(i, Fraction(0)) for i in range(n_unknowns)])

    one = Fraction(1)
    for a, b, length, *_ in tables.segments.tolist():
        i, j = 2 * int(a), 2 * int(b)
        constrain({i: -one, j: one, i + 1: -Fraction(length)})
        constrain({i + 1: -one, j + 1: one})
    for a, b, k_y, k_theta, k_ytheta, *_ in tables.joints.tolist():
        i, j = 2 * int(a), 2 * int(b)
        for factor in _spring_factor(k_y, k_theta, k_ytheta):
            y, theta = map(Fraction, factor)
            constrain({i: -y, i + 1: -theta, j: y, j + 1: theta})
    for node, k_y, k_theta, k_ytheta, *_ in tables.grounds.tolist():
        i = 2 * int(node)
        for factor in _spring_factor(k_y, k_theta, k_ytheta):
            constrain({i: Fraction(factor[0]), i + 1: Fraction(factor[1])})
    return n_unknowns - _rank(rows)


def _rank(rows: list[list[Fraction]]) -> int:
    rank = 0
    for column in range(len(rows[0]) if rows else 0):
        pivot = next((i for i in range(rank, len(rows)) if rows[i][column] != 0), None)
        if pivot is None:
            continue
        rows[rank], rows[pivot] = rows[pivot], rows[rank]
        for i in range(rank + 1, len(rows)):
            if rows[i][column] != 0:
                factor = rows[i][column] / rows[rank][column]
                rows[i] = [x - factor * y for x, y in zip(rows[i], rows[rank], strict=True)]
        rank += 1
    return rank


def _spring_factor(k_y: float, k_theta: float, k_ytheta: float) -> list[tuple[float, float]]:
    """Return rows f with sum of f^T f = [[k_y, k_ytheta], [k_ytheta, k_theta]], zero rows left out."""
    if k_y == 0.0:
        return [(0.0, math.sqrt(k_theta))] if k_theta > 0.0 else []
    first = (math.sqrt(k_y), k_ytheta / math.sqrt(k_y))
    rest = k_theta - k_ytheta * k_ytheta / k_y
    return [first] if rest <= SNAP * k_theta else [first, (0.0, math.sqrt(rest))]


def _section(row: FloatArray) -> tuple[float, float, float, float]:
    """Return shear stiffness, bending stiffness, mass and rotary inertia per length, without losses."""
    outer, inner = row[3], row[4]
    layers = [(outer, inner, row[5], row[6], row[7])]
    if row[10] != 0.0:
        layers.append((inner, 0.0, row[9], row[10], row[11]))
    totals = np.zeros(4)
    for big, small, modulus, density, nu in layers:
        if big == 0.0:
            continue
        area = np.pi / 4.0 * (big - small) * (big + small)
        area_moment = area * (big**2 + small**2) / 16.0
        q = (small / big) ** 2
        if row[13] == HUTCHINSON:
            below = 7 + 34 * q + 7 * q**2 + nu * (12 + 48 * q + 12 * q**2) + nu**2 * (4 + 16 * q + 4 * q**2)
            kappa = 6 * (1 + nu) ** 2 * (1 + q) ** 2 / below
        else:
            kappa = 6 * (1 + nu) * (1 + q) ** 2 / ((7 + 6 * nu) * (1 + q) ** 2 + (20 + 12 * nu) * q)
        shear = kappa * modulus / (2 * (1 + nu)) * area
        totals += (shear, modulus * area_moment, density * area, density * area_moment)
    return totals[0], totals[1], totals[2], totals[3]


def wave_number_bound(row: FloatArray, w: float) -> float:
    """Return a wave number that neither wave of a segment exceeds at a real frequency w, nor is far below."""
    shear, bending, mass, rotary = _section(row)
    # bending, shear and rotary inertia each add to the square
    return math.sqrt(w * math.sqrt(mass / bending) + w * w * (mass / shear + rotary / bending))


def _factors(tables: Tables, w_limit: float, refinement: float) -> tuple[FloatArray, FloatArray]:
    """Return the factors of the stiffness and the mass matrix, one column an unknown."""
    n_unknowns = 2 * tables.n_nodes
    strains: list[tuple[FloatArray, FloatArray]] = []
    inertias: list[tuple[FloatArray, FloatArray]] = []
    for row in tables.segments:
        section = _section(row)
        waves = wave_number_bound(row, w_limit) * row[2]
        n_elements = max(1, math.ceil(refinement * waves / WAVE_PER_ELEMENT))
        n_inner = 2 * (n_elements - 1)
        ends = 2 * int(row[0]), 2 * int(row[1])
        chain = [ends[0], *range(n_unknowns, n_unknowns + n_inner, 2), ends[1]]
        n_unknowns += n_inner
        n_bubbles = 2 * DEGREE - 3
        if n_unknowns + n_elements * n_bubbles > MOST_UNKNOWNS:
            raise ValueError(f"the limit needs more than {MOST_UNKNOWNS} unknowns")
        strain, inertia = _element(row[2] / n_elements, section)
        for left, right in pairwise(chain):
            bubbles = range(n_unknowns, n_unknowns + n_bubbles)
            n_unknowns += n_bubbles
            index = np.array([left, left + 1, right, right + 1, *bubbles])
            strains.append((index, strain))
            inertias.append((index, inertia))
    for a, b, k_y, k_theta, k_ytheta, *_ in tables.joints.tolist():
        index = np.array([2 * int(a), 2 * int(a) + 1, 2 * int(b), 2 * int(b) + 1])
        for y, theta in _spring_factor(k_y, k_theta, k_ytheta):
            strains.append((index, np.array([[-y, -theta, y, theta]])))
    for node, k_y, k_theta, k_ytheta, *_ in tables.grounds.tolist():
        for factor in _spring_factor(k_y, k_theta, k_ytheta):
            strains.append((np.array([2 * int(node), 2 * int(node) + 1]), np.array([factor])))
    for node, mass, inertia_about_node in tables.masses.tolist():
        index = np.array([2 * int(node), 2 * int(node) + 1])
        inertias.append((index, np.diag(np.sqrt([mass, inertia_about_node]))))
    return _stack(strains, n_unknowns), _stack(inertias, n_unknowns)


def _stack(blocks: list[tuple[FloatArray, FloatArray]], n_unknowns: int) -> FloatArray:
    whole = np.zeros((sum(len(block) for _, block in blocks), n_unknowns))
    top = 0
    for index, block in blocks:
        whole[top : top + len(block), index] = block
        top += len(block)
    return whole


def _element(length: float, section: tuple[float, float, float, float]) -> tuple[FloatArray, FloatArray]:
    """Return the factors of one element in (y_a, theta_a, y_b, theta_b, bubbles of y, bubbles of theta)."""
    shear, bending, mass, rotary = section
    # exact for the products: y has DEGREE, theta DEGREE - 1
    few, few_weights = legendre.leggauss(DEGREE)
    many, many_weights = legendre.leggauss(DEGREE + 1)
    n = 4 + 2 * DEGREE - 3

    def spread(y: FloatArray | None, theta: FloatArray | None, n_points: int) -> FloatArray:
        out = np.zeros((n_points, n))
        if y is not None:
            out[:, [0, 2, *range(4, 3 + DEGREE)]] = y
        if theta is not None:
            out[:, [1, 3, *range(3 + DEGREE, n)]] = theta
        return out

    jacobian = length / 2.0
    _, slope_y = _shapes(DEGREE, few)
    value_theta, slope_theta = _shapes(DEGREE - 1, few)
    value_y, _ = _shapes(DEGREE, many)
    inertia_theta, _ = _shapes(DEGREE - 1, many)
    weights = np.sqrt(few_weights * jacobian)[:, None]
    mass_weights = np.sqrt(many_weights * jacobian)[:, None]
    strain = np.vstack([
        math.sqrt(shear) * weights * spread(slope_y / jacobian, -value_theta, len(few)),
        math.sqrt(bending) * weights * spread(None, slope_theta / jacobian, len(few)),
    ])  # fmt: skip
    inertia = np.vstack([
        math.sqrt(mass) * mass_weights * spread(value_y, None, len(many)),
        math.sqrt(rotary) * mass_weights * spread(None, inertia_theta, len(many)),
    ])  # fmt: skip
    return strain, inertia


def _shapes(degree: int, x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return values and slopes of the two linear shapes and the integrated Legendre bubbles, points first."""
    values = [(1.0 - x) / 2.0, (1.0 + x) / 2.0]
    slopes = [np.full_like(x, -0.5), np.full_like(x, 0.5)]
    for k in range(2, degree + 1):
        norm = math.sqrt((2 * k - 1) / 2.0)
        above, below, inner = np.zeros(k + 1), np.zeros(k - 1), np.zeros(k)
        above[k], below[k - 2], inner[k - 1] = 1.0, 1.0, 1.0
        values.append(norm / (2 * k - 1) * (legendre.legval(x, above) - legendre.legval(x, below)))
        slopes.append(norm * legendre.legval(x, inner))
    return np.array(values).T, np.array(slopes).T
