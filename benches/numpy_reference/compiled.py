"""Closed forms line by line in scalar loops that numba compiles: the fastest plain implementation.

Needs numba; `missing` gives a message if it is not installed. The same formulas as `segment` and `riccati`, with
tanh(z) = (1 - e) / (1 + e), e = exp(-2 z), the fastest of several ways that were tried.
"""

from __future__ import annotations

import cmath
from functools import cache
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .segment import Complex, Real, segment_constants


def missing() -> str:
    """Return why there is no compiled reference; empty if there is one."""
    return "" if find_spec("numba") else "numba is not installed (pip install numba)"


def _waves(square, half, spread, mean, ratio):
    """Return alpha, beta, lambda1^2, lambda2^2, T1, T2 of a line; see `segment`."""
    shift = square * spread
    root = cmath.sqrt(square * ratio + shift * shift)
    z1, z2 = root - square * mean, -root - square * mean
    lambda1, lambda2 = cmath.sqrt(z1), cmath.sqrt(z2)
    e1, e2 = cmath.exp(-2 * half * lambda1), cmath.exp(-2 * half * lambda2)
    t1 = (1 - e1) / ((1 + e1) * lambda1)
    t2 = (1 - e2) / ((1 + e2) * lambda2)
    return root - shift, -root - shift, z1, z2, t1, t2


def _stiffness(square, half, bending, mass, spread, mean, ratio, waves):
    """Return the stiffnesses of the symmetric and of the antisymmetric half."""
    alpha, beta, z1, z2, t1, t2 = waves(square, half, spread, mean, ratio)
    p1, p2, gap, inertia = z1 * t1, z2 * t2, alpha - beta, mass * square
    over = 0.5 / (beta * t2 - alpha * t1)
    s0, s1, s2 = gap * over * inertia * t1 * t2, (t1 - t2) * inertia * over, -bending * gap * over
    over = 0.5 / (beta * p1 - alpha * p2)
    a0, a1, a2 = gap * over * inertia, (p2 - p1) * inertia * over, -bending * gap * over * p1 * p2
    return s0, s1, s2, a0, a1, a2


def _chain(w, real, constants, out, stiffness, waves):
    for line in range(w.size):
        square = w[line] * w[line]
        z0, z1, z2 = 0j, 0j, 0j
        for row in range(constants.shape[0] - 1, -1, -1):
            (half, mass), (bending, spread, mean, ratio) = real[row], constants[row]
            s0, s1, s2, a0, a1, a2 = stiffness(square, half, bending, mass, spread, mean, ratio, waves)
            p0, p1, p2 = s0 + a0, s1 + a1, s2 + a2
            n0, n1, n2 = s0 - a0, s1 - a1, s2 - a2
            a, b, d = p0 + z0, p1 + z1, p2 + z2
            over = 1 / (a * d - b * b)
            e0, e1 = (n0 * d - n1 * b) * over, (n1 * a - n0 * b) * over
            f0, f2 = (n1 * d - n2 * b) * over, (n2 * a - n1 * b) * over
            z0, z1, z2 = p0 - e0 * n0 - e1 * n1, e0 * n1 + e1 * n2 - p1, p2 - f0 * n1 - f2 * n2
        over = 1 / (z0 * z2 - z1 * z1)
        out[line, 0, 0], out[line, 1, 1] = z2 * over, z0 * over
        out[line, 0, 1] = out[line, 1, 0] = -z1 * over


def _segment(w, real, constants, out, waves):
    (half, mass), (bending, spread, mean, ratio) = real[0], constants[0]
    flexibility, share = 0.5 / bending, bending / mass
    for line in range(w.size):
        square = w[line] * w[line]
        alpha, beta, z1, z2, t1, t2 = waves(square, half, spread, mean, ratio)
        p1, p2, gap, inertia = z1 * t1, z2 * t2, alpha - beta, share / square
        over = flexibility / (alpha * t2 - beta * t1)
        s0, s1, s2 = -gap * over * inertia, (t2 - t1) * over, gap * over * t1 * t2
        over = flexibility / (alpha * p1 - beta * p2)
        a0, a1, a2 = -gap * over * p1 * p2 * inertia, (p1 - p2) * over, gap * over
        h = out[line]
        h[0, 0] = h[2, 2] = s0 + a0
        h[1, 1] = h[3, 3] = s2 + a2
        h[0, 2] = h[2, 0] = s0 - a0
        h[1, 3] = h[3, 1] = a2 - s2
        h[2, 3] = h[3, 2] = s1 + a1
        h[0, 1] = h[1, 0] = -s1 - a1
        h[0, 3] = h[3, 0] = s1 - a1
        h[1, 2] = h[2, 1] = a1 - s1


@cache
def _compiled() -> tuple[Any, ...]:
    import numba

    return tuple(numba.njit(function, error_model="numpy") for function in (_chain, _segment, _stiffness, _waves))


def _constants(table: Real) -> tuple[Real, Complex]:
    """Return the constants of all lines: half length, mass; bending stiffness, the parts of the wave numbers."""
    length, shear, bending, mass, rotary = segment_constants(table)
    slow, fast = mass / shear, rotary / bending
    real = np.column_stack([length / 2, mass])
    return real, np.column_stack([bending, (fast - slow) / 2, (fast + slow) / 2, mass / bending])


def compiled_tip(angular_frequency: NDArray, table: Real) -> Complex:
    """Tip receptance (n, 2, 2) of a chain, as `tip_by_stiffness`."""
    out = np.empty((angular_frequency.size, 2, 2), dtype=np.complex128)
    chain, _, stiffness, waves = _compiled()
    chain(angular_frequency, *_constants(table), out, stiffness, waves)
    return out


def compiled_segment(angular_frequency: NDArray, row: Real) -> Complex:
    """Receptance (n, 4, 4) of both ends of a segment, as `segment_receptance`."""
    out = np.empty((angular_frequency.size, 4, 4), dtype=np.complex128)
    _, segment, _, waves = _compiled()
    segment(angular_frequency, *_constants(row[None]), out, waves)
    return out
