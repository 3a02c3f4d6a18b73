"""The spindle alone, as a holder sees it: its receptance and its modes, whose shapes dashpots make complex."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from blind.generator.elements import FloatArray, Poles, Structure

from .structure import MODES, REFINEMENT, Numbers, add_spindle

ABOVE, LOSS = 3.8, 0.29
"""Frequency of a mode above the lines, over that of the last one, and its damping ratio."""
OSCILLATING = 0.9
"""Largest damping ratio of a mode; what is damped more is left to the residual."""


def _poles(p: Numbers) -> Poles:
    """Return the poles of y and theta at the plane over force and moment."""
    s = Structure(REFINEMENT)
    plane = s.station()
    # The plane has no mass of its own: a thin disc, which is negligible, keeps the mass matrix definite.
    s.mass(plane, 1e-5, 1e-9)
    add_spindle(s, plane, p)
    ends = np.eye(s.size)[:, [2 * plane, 2 * plane + 1]]
    return s.poles(ends, ends, MODES)


def plane_receptance(p: Numbers, lines: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Return y over force, theta over moment and y over moment at the plane, `(n, 3)`."""
    found = _poles(p)
    return np.stack([found.receptance(lines, *pair) for pair in ((0, 0), (1, 1), (0, 1))], axis=1)


def spindle_modes(p: Numbers, count: int, lines: NDArray[np.float64]) -> tuple[FloatArray, FloatArray]:
    """Return modes that stand for the spindle on some lines, and the residual.

    A pole l = -zeta w + i v has the residue psi psi^T / (2 i v), psi the shape at the plane. The rows are w in Hz,
    zeta, the real parts of y and theta of psi, and their imaginary parts; the real part of y is positive. The lowest
    poles leave what the taper joint adds, springs with dashpots in series: two damped modes above the lines have their
    loss, one in y and one in theta. The residual, in the order of `plane_receptance`, is the rest.
    """
    found = _poles(p)
    size = np.abs(found.rates)
    ratios = -found.rates.real / size
    chosen = np.flatnonzero((found.rates.imag > 0.0) & (ratios < OSCILLATING))
    chosen = chosen[np.argsort(size[chosen])][: count - 2]
    turn = 2j * found.rates.imag[chosen]
    y = np.sqrt(turn * found.seen[0, chosen] * found.excited[chosen, 0])
    y = np.where(y.real < 0.0, -y, y)
    theta = turn * found.seen[0, chosen] * found.excited[chosen, 1] / y
    rows = np.column_stack([size[chosen] / (2.0 * np.pi), ratios[chosen], y.real, theta.real, y.imag, theta.imag])
    left = plane_receptance(p, lines) - summed_modes(rows, lines)
    above = np.zeros((2, 6))
    above[:, 0], above[:, 1] = ABOVE * lines[-1], LOSS
    # Of a compliance C above the lines the imaginary part is about -2 zeta C f / w.
    slopes = -(left.imag / lines[:, None])[lines > 0.5 * lines[-1], :2].mean(axis=0)
    compliance = np.maximum(slopes * above[:, 0] / (2.0 * LOSS), 0.0)
    above[[0, 1], [2, 3]] = 2.0 * np.pi * above[:, 0] * np.sqrt(compliance)
    rows = np.vstack([rows, above])
    rows = rows[np.argsort(rows[:, 0], kind="stable")]
    return rows, (plane_receptance(p, lines) - summed_modes(rows, lines)).real.mean(axis=0)


def summed_modes(rows: FloatArray, lines: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Return the receptance of modes without a residual, in the order of `plane_receptance`."""
    size, ratios = 2.0 * np.pi * rows[:, 0], rows[:, 1]
    turned = size * np.sqrt(1.0 - ratios**2)
    poles = -ratios * size + 1j * turned
    y, theta = rows[:, 2] + 1j * rows[:, 4], rows[:, 3] + 1j * rows[:, 5]
    residues = np.column_stack([y * y, theta * theta, y * theta]) / (2j * turned[:, None])
    s = 2j * np.pi * lines[:, None]
    return (1.0 / (s - poles)) @ residues + (1.0 / (s - poles.conj())) @ residues.conj()
