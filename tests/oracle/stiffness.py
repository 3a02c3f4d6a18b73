"""Dynamic stiffness of one element, from the tables' rows as numbers of any precision.

A segment's motion is a sum of four waves. About the middle of the segment they split into motions with y even
and with y odd, two of each; the end loads follow from the end motions by a 2x2 solve for each half. Written
with cosh(lambda x) and sinh(lambda x)/lambda, nothing is divided by a lambda that vanishes at the cut-off;
with exp(-lambda L/2) taken out, nothing overflows. Digits that cancel are made up for by more precision.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from .arithmetic import Arithmetic, Scalar
from .tables import HUTCHINSON

Matrix = list[list[Scalar]]


class Section(NamedTuple):
    """Constants of a uniform segment: shear and bending stiffness, mass and rotary inertia per length."""

    shear: Scalar
    bending: Scalar
    mass: Scalar
    rotary: Scalar


class Half(NamedTuple):
    """End values at x = +L/2 of the two waves of one symmetry, a tuple of two a quantity."""

    y: tuple[Scalar, Scalar]
    theta: tuple[Scalar, Scalar]
    force: tuple[Scalar, Scalar]
    moment: tuple[Scalar, Scalar]


def shear_coefficient(ratio: Scalar, poisson: Scalar, model: float) -> Scalar:
    """Return Cowper's or Hutchinson's shear coefficient of a ring with inner/outer diameter `ratio`."""
    m2 = ratio * ratio
    outer = (1 + m2) * (1 + m2)
    if model == HUTCHINSON:
        below = (
            (7 + 34 * m2 + 7 * m2 * m2)
            + poisson * (12 + 48 * m2 + 12 * m2 * m2)
            + poisson * poisson * (4 + 16 * m2 + 4 * m2 * m2)
        )
        return 6 * (1 + poisson) * (1 + poisson) * outer / below
    return 6 * (1 + poisson) * outer / ((7 + 6 * poisson) * outer + (20 + 12 * poisson) * m2)


def section(row: Sequence[Scalar], model: float, has_core: bool, ar: Arithmetic) -> Section:
    """Return the constants of a segment.

    Whether there is a core is decided by the caller from the unperturbed table: a core is there or not, it
    does not appear when its density is moved off zero to take a derivative.
    """
    outer, inner = row[3], row[4]
    layers = [(outer, inner, *row[5:9])]
    if has_core:
        layers.append((inner, 0 * inner, *row[9:13]))
    shear: Scalar = 0
    bending: Scalar = 0
    mass: Scalar = 0
    rotary: Scalar = 0
    for big, small, modulus, density, poisson, loss in layers:
        big2, small2 = big * big, small * small
        area = ar.pi() / 4 * (big2 - small2)
        area_moment = ar.pi() / 64 * (big2 * big2 - small2 * small2)
        # the core's own hole is zero: do not divide by a bore that may be zero too
        ratio = small / big if small != 0 else small
        lossy = ar.complex(1 + 0 * loss, loss)
        coefficient = shear_coefficient(ratio, poisson, model)
        shear += coefficient * modulus / (2 * (1 + poisson)) * area * lossy
        bending += modulus * area_moment * lossy
        mass += density * area
        rotary += density * area_moment
    return Section(shear, bending, mass, rotary)


def wave_numbers_squared(s: Section, w2: Scalar, ar: Arithmetic) -> tuple[Scalar, Scalar]:
    """Return lambda^2 of the wave that turns at the cut-off, then of the one that always propagates."""
    half = w2 * (s.rotary / s.bending + s.mass / s.shear) / 2
    product = s.mass * w2 / s.bending * (1 - s.rotary * w2 / s.shear)
    root = ar.sqrt(half * half + product)
    # product/(half + root) is -half + root without its cancellation at the cut-off
    return product / (half + root), -(half + root)


def halves(s: Section, length: Scalar, w2: Scalar, ar: Arithmetic, *, standing: bool = False) -> tuple[Half, Half]:
    """Return the even and the odd half (by the symmetry of y) of a segment's motion at its right-hand end.

    Each wave is scaled by exp(-lambda L/2), or only by its modulus if `standing`: then every value is real
    for a lossless segment at a real frequency, so that determinants can be searched for a change of sign.
    """
    even: list[tuple[Scalar, ...]] = []
    odd: list[tuple[Scalar, ...]] = []
    inertia = s.mass * w2
    for square in wave_numbers_squared(s, w2, ar):
        wave = ar.sqrt(square)
        decay = ar.exp(-wave * length)
        cosh = (1 + decay) / 2
        sinh = (1 - decay) / (2 * wave) if wave != 0 else length / 2
        if standing:
            turn = ar.exp(ar.complex(0 * wave.imag, wave.imag * length / 2))
            cosh, sinh = cosh * turn, sinh * turn
        slope = square + inertia / s.shear
        even.append((cosh, slope * sinh, -inertia * sinh, s.bending * slope * cosh))
        odd.append((square * sinh, slope * cosh, -inertia * cosh, s.bending * slope * square * sinh))
    return Half(*zip(*even, strict=True)), Half(*zip(*odd, strict=True))


def _half_stiffness(half: Half) -> tuple[Scalar, Scalar, Scalar, Scalar]:
    """Return ((force, moment) of (y, theta)) of one half, row by row."""
    (y1, y2), (t1, t2), (f1, f2), (m1, m2) = half
    determinant = y1 * t2 - y2 * t1
    if determinant == 0:
        raise ArithmeticError("a segment at its clamped resonance, or with two equal wave numbers")
    inverse = 1 / determinant
    return (
        (f1 * t2 - f2 * t1) * inverse,
        (f2 * y1 - f1 * y2) * inverse,
        (m1 * t2 - m2 * t1) * inverse,
        (m2 * y1 - m1 * y2) * inverse,
    )


def segment(row: Sequence[Scalar], model: float, has_core: bool, w: Scalar, ar: Arithmetic) -> Matrix:
    """Return the 4x4 dynamic stiffness of a segment in (y_a, theta_a, y_b, theta_b)."""
    even, odd = halves(section(row, model, has_core, ar), row[2], w * w, ar)
    e = _half_stiffness(even)
    o = _half_stiffness(odd)
    p11, p12, p21, p22 = ((x + y) / 2 for x, y in zip(e, o, strict=True))
    q11, q12, q21, q22 = ((x - y) / 2 for x, y in zip(e, o, strict=True))
    # mirroring the segment keeps y and turns the sign of theta and of the moment
    return [
        [p11, -p12, q11, q12],
        [-p21, p22, -q21, -q22],
        [q11, -q12, p11, p12],
        [q21, -q22, p21, p22],
    ]


def spring(row: Sequence[Scalar], w: Scalar, ar: Arithmetic) -> Matrix:
    """Return the 2x2 complex stiffness of (k_y, k_theta, k_ytheta, c_y, c_theta, c_ytheta, loss factor)."""
    k_y, k_theta, k_ytheta, c_y, c_theta, c_ytheta, loss = row
    lossy = ar.complex(1 + 0 * loss, loss)
    rate = w * ar.complex(0 * loss, 1 + 0 * loss)
    coupling = lossy * k_ytheta + rate * c_ytheta
    return [[lossy * k_y + rate * c_y, coupling], [coupling, lossy * k_theta + rate * c_theta]]


def joint(row: Sequence[Scalar], w: Scalar, ar: Arithmetic) -> Matrix:
    """Return the 4x4 dynamic stiffness of a joint between two nodes."""
    k = spring(row[2:], w, ar)
    signs = (1, 1, -1, -1)
    return [[signs[i] * signs[j] * k[i % 2][j % 2] for j in range(4)] for i in range(4)]


def mass(row: Sequence[Scalar], w: Scalar) -> Matrix:
    """Return the 2x2 dynamic stiffness of a point mass."""
    return [[-w * w * row[1], 0 * w], [0 * w, -w * w * row[2]]]
