"""Timoshenko beams by finite elements, in NumPy and SciPy: data that share no code with the package.

Elements of Friedman and Kosmatka (1993), with Cowper's shear coefficient, integrated by Gauss's rule.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_banded

E, RHO, NU = 210e9, 7850.0, 0.3


def element(
    length: float, outer: float, inner: float = 0.0, young: float = E, density: float = RHO, nu: float = NU
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return stiffness and mass `(4, 4)` over (y, theta) of both ends of a round bar or tube."""
    area, inertia = np.pi / 4.0 * (outer**2 - inner**2), np.pi / 64.0 * (outer**4 - inner**4)
    m2 = (1.0 + (inner / outer) ** 2) ** 2
    kappa = 6.0 * (1.0 + nu) * m2 / ((7.0 + 6.0 * nu) * m2 + (20.0 + 12.0 * nu) * (inner / outer) ** 2)
    phi = 12.0 * young * inertia / (kappa * young / (2.0 * (1.0 + nu)) * area * length**2)
    a, b, c = 6.0 * length, (4.0 + phi) * length**2, (2.0 - phi) * length**2
    k = np.array([[12, a, -12, a], [a, b, -a, c], [-12, -a, 12, -a], [a, c, -a, b]])
    k *= young * inertia / ((1.0 + phi) * length**3)
    m = np.zeros((4, 4))
    for point, weight in zip(*np.polynomial.legendre.leggauss(5), strict=True):
        x = 0.5 * (1.0 + point)
        y = [
            2 * x**3 - 3 * x**2 - phi * x + 1 + phi,
            length * (x**3 - (2 + phi / 2) * x**2 + (1 + phi / 2) * x),
            -(2 * x**3 - 3 * x**2 - phi * x),
            length * (x**3 - (1 - phi / 2) * x**2 - phi / 2 * x),
        ]
        theta = [
            6 / length * (x**2 - x),
            3 * x**2 - (4 + phi) * x + 1 + phi,
            -6 / length * (x**2 - x),
            3 * x**2 - (2 - phi) * x,
        ]
        shapes = np.array([y, theta]) / (1.0 + phi)
        m += 0.5 * weight * length * density * (area * np.outer(*shapes[[0, 0]]) + inertia * np.outer(*shapes[[1, 1]]))
    return k, m


def cone(
    length: float, near: tuple[float, float], far: tuple[float, float], count: int = 100
) -> list[tuple[float, float, float]]:
    """Return thin cylinders for a cone from outer and inner diameter at one end to those at the other end."""
    shares = (np.arange(count) + 0.5) / count
    outer, inner = ((1.0 - shares) * a + shares * b for a, b in zip(near, far, strict=True))
    return [(length / count, float(d), float(i)) for d, i in zip(outer, inner, strict=True)]


def coupled(
    tool: list[tuple[float, float, float]],
    holder: list[tuple[float, float, float]],
    joint: tuple[float, float, float, float],
    lines: NDArray[np.float64],
    loss: float = 0.0,
) -> NDArray[np.complex128]:
    """Return y at the tip due to a force there, of a tool on a joint (k_y, k_theta, c_y, c_theta) in a free holder."""
    w = 2.0 * np.pi * lines
    k_y, k_theta, c_y, c_theta = joint
    spring = np.zeros((len(lines), 2, 2), np.complex128)
    spring[:, 0, 0], spring[:, 1, 1] = 1.0 / (k_y + 1j * w * c_y), 1.0 / (k_theta + 1j * w * c_theta)
    end = 2 * len(tool)
    of_tool = receptance(tool, [], lines, [0, end, end + 1], loss=loss)
    of_holder = receptance(holder, [], lines, [0, 1], loss=loss)
    inner = np.linalg.solve(of_tool[:, 1:, 1:] + of_holder + spring, of_tool[:, 1:, :1])
    return of_tool[:, 0, 0] - (of_tool[:, :1, 1:] @ inner)[:, 0, 0]


def receptance(
    pieces: list[tuple[float, float, float]],
    springs: list[tuple[int, float, float]],
    lines: NDArray[np.float64],
    ends: list[int],
    each: float = 0.0025,
    loss: float = 0.0,
) -> NDArray[np.complex128]:
    """Return the receptance `(n, k, k)` between degrees of freedom of the ends of pieces.

    Parameters
    ----------
    pieces : list of (length, outer diameter, inner diameter)
        In a row from the tip.
    springs : list of (end, k, c)
        To ground across, at the end of so many pieces, 0 the tip.
    ends : list of int
        Twice the number of the end for y, one more for theta.
    loss : float
        Loss factor of the material.
    """
    count = [max(2, int(np.ceil(length / each))) for length, _, _ in pieces]
    places = np.concatenate([[0], np.cumsum(count)])
    size = 2 * (places[-1] + 1)
    k, m, c = (np.zeros((size, size)) for _ in range(3))
    for start, number, (length, outer, inner) in zip(places, count, pieces, strict=False):
        own = element(length / number, outer, inner)
        for i in range(start, start + number):
            k[2 * i : 2 * i + 4, 2 * i : 2 * i + 4] += own[0]
            m[2 * i : 2 * i + 4, 2 * i : 2 * i + 4] += own[1]
    k = k * (1.0 + 1j * loss)
    for end, stiffness, damping in springs:
        k[2 * places[end], 2 * places[end]] += stiffness
        c[2 * places[end], 2 * places[end]] += damping
    free = [2 * places[i // 2] + i % 2 for i in ends]
    w = 2.0 * np.pi * lines
    load = np.eye(size)[:, free]
    bands = [np.stack([np.pad(np.diag(a, i), (max(i, 0), max(-i, 0))) for i in range(3, -4, -1)]) for a in (k, c, m)]
    return np.stack([solve_banded((3, 3), bands[0] + 1j * x * bands[1] - x * x * bands[2], load)[free] for x in w])
