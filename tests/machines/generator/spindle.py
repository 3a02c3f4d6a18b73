"""The spindle alone, as a holder sees it: its receptance, its undamped modes, and real modes fitted to it.

Dashpots at bearings and taper make the true shapes complex. A description with real shapes is an approximation.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from blind.generator.elements import FloatArray, Structure

from .structure import MODES, REFINEMENT, Numbers, add_spindle

LEVER = 0.1
"""Length in m by which rotations are compared with displacements."""


def _alone(p: Numbers) -> tuple[Structure, int]:
    s = Structure(REFINEMENT)
    plane = s.station()
    # The plane has no mass of its own: a thin disc, which is negligible, keeps the mass matrix definite.
    s.mass(plane, 1e-5, 1e-9)
    add_spindle(s, plane, p)
    return s, plane


def plane_receptance(p: Numbers, lines: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Return y over force, theta over moment and y over moment at the plane, `(n, 3)`."""
    s, plane = _alone(p)
    ends = np.eye(s.size)[:, [2 * plane, 2 * plane + 1]]
    found = s.poles(ends, ends, MODES)
    return np.stack([found.receptance(lines, *pair) for pair in ((0, 0), (1, 1), (0, 1))], axis=1)


def spindle_modes(p: Numbers, count: int) -> tuple[FloatArray, FloatArray]:
    """Return the undamped modes of the spindle in the order of their frequencies.

    The rows are natural frequency in Hz, damping ratio, and y and theta of the mass-normalised shape at the plane; y is
    positive. The second array is the static receptance of all further modes, in the order of `plane_receptance`.
    """
    s, plane = _alone(p)
    _, _, damping = s.matrices()
    squares, shapes, ratios = s.modes()
    w = np.sqrt(squares)
    ratios = ratios + 0.5 * np.einsum("ij,ik,kj->j", shapes, damping, shapes) / w
    y, theta = shapes[2 * plane], shapes[2 * plane + 1]
    turned = np.where(y < 0.0, -1.0, 1.0)
    rows = np.column_stack([w / (2.0 * np.pi), ratios, turned * y, turned * theta])
    static = np.array([a[count:] @ (b[count:] / squares[count:]) for a, b in ((y, y), (theta, theta), (y, theta))])
    return rows[:count], static


def real_modes(
    p: Numbers, count: int, lines: NDArray[np.float64], rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Return modes with real shapes that are fitted to the spindle on some lines, as `spindle_modes` does.

    Two modes with almost the same frequency are nearly one with a complex shape. The fit begins with the undamped modes
    in the band and the next one above; what is left of the count are copies of drawn ones in the band.
    """
    rows, _ = spindle_modes(p, count)
    inside = int(np.sum(rows[:, 0] < lines[-1]))
    kept = min(inside + 1, count)
    copies = rows[rng.choice(inside, count - kept, replace=count - kept > inside)]
    begun = np.vstack([rows[:kept], copies * [1.05, 1.5, 0.3, -0.3]])
    some = lines[:: max(lines.size // 300, 1)]
    true = plane_receptance(p, some)
    levers = np.array([1.0, LEVER**-2, 1.0 / LEVER])
    weights = 1.0 / (levers * np.linalg.norm(true / levers, axis=1)[:, None])
    w = 2.0 * np.pi * some[:, None]
    _, rest = spindle_modes(p, kept)
    sizes = np.array([0.1, 0.1, *np.abs(rows[:, 2:]).mean(axis=0)])

    def modes(x: FloatArray) -> tuple[FloatArray, FloatArray]:
        moved = x[: 4 * count].reshape(count, 4) * sizes
        scaled = begun[:, :2] * np.exp(moved[:, :2])
        static = rest + x[4 * count :] * (np.abs(rest) + 1e-13)
        return np.hstack([scaled, begun[:, 2:] + moved[:, 2:]]), static

    def residuals(x: FloatArray) -> FloatArray:
        (f, zeta, y, theta), static = modes(x)[0].T, modes(x)[1]
        own = 2.0 * np.pi * f
        near = 1.0 / (own**2 - w**2 + 2j * zeta * own * w)
        difference = (near @ np.column_stack([y * y, theta * theta, y * theta]) + static - true) * weights
        return np.concatenate([difference.real.ravel(), difference.imag.ravel()])

    fitted = least_squares(residuals, np.zeros(4 * count + 3), max_nfev=100)
    found, static = modes(fitted.x)
    found[:, 2:] *= np.where(found[:, 2:3] < 0.0, -1.0, 1.0)
    return found[np.argsort(found[:, 0])], static
