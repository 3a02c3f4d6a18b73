"""Uniform Timoshenko segment: constants, and the free-free receptance of both ends in closed form.

The closed form uses ``tanh(lambda h)`` of the half length ``h`` only: it neither overflows nor needs the
sign of ``lambda``, because ``tanh(lambda h) / lambda`` is even in ``lambda``. NumPy has vector instructions
for real ``tanh``, ``tan`` and ``sqrt`` but not for the complex ones (10 to 25 ns each), so the complex
functions are assembled from real ones.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]

BLOCK = 4096
# Taylor coefficients of (tanh(z)/z - 1)/z^2 in z^2; below |z|^2 = 0.1 these ten leave 1e-17.
_TANH_TAIL = (
    -1 / 3, 2 / 15, -17 / 315, 62 / 2835, -1382 / 155925, 21844 / 6081075, -929569 / 638512875,
    6404582 / 10854718875, -443861162 / 1856156927625, 18888466084 / 194896477400625,
    -113927491862 / 2900518163668125, 58870668456604 / 3698160658676859375,
)  # fmt: skip
_TAIL_LIMIT = 0.1


class Constants(NamedTuple):
    """Frequency-independent constants of segments, each of shape (n_segments,), SI units.

    Attributes
    ----------
    length : segment length [m].
    shear, bending : complex shear stiffness S [N] and bending stiffness B [N m2].
    mass, rotary : mass [kg/m] and rotary inertia [kg m] per length.
    """

    length: Real
    shear: Complex
    bending: Complex
    mass: Real
    rotary: Real


def segment_constants(segments: Real) -> Constants:
    """Constants of the rows of a segment table, (n_segments, 14), ring and bonded core summed."""
    table = np.atleast_2d(np.asarray(segments, dtype=np.float64))
    outer, bore = table[:, 3], table[:, 4]
    ring = _layer(outer, bore, *table[:, 5:9].T, table[:, 13])
    core_present = table[:, 10] != 0
    core = _layer(bore, np.zeros_like(bore), *table[:, 9:13].T, table[:, 13])
    total = [a + np.where(core_present, b, 0) for a, b in zip(ring, core, strict=True)]
    return Constants(table[:, 2].copy(), *total)


def _layer(
    outer: Real, inner: Real, modulus: Real, density: Real, poisson: Real, loss: Real, model: Real
) -> tuple[Complex, Complex, Real, Real]:
    area = np.pi / 4 * (outer**2 - inner**2)
    second = np.pi / 64 * (outer**4 - inner**4)
    # A layer of no diameter (no bore, so no core) must not divide by zero; its area removes it anyway.
    ratio2 = (inner / np.where(outer > 0, outer, 1.0)) ** 2
    nu, both = poisson, (1 + ratio2) ** 2
    cowper = 6 * (1 + nu) * both / ((7 + 6 * nu) * both + (20 + 12 * nu) * ratio2)
    q, q2 = ratio2, ratio2**2
    hutchinson_below = 7 + 34 * q + 7 * q2 + nu * (12 + 48 * q + 12 * q2) + nu**2 * (4 + 16 * q + 4 * q2)
    hutchinson = 6 * (1 + nu) ** 2 * both / hutchinson_below
    kappa = np.where(model == 1, hutchinson, cowper)
    lossy = modulus * (1 + 1j * loss)
    return kappa * lossy / (2 * (1 + nu)) * area, lossy * second, density * area, density * second


class Workspace:
    """Scratch lines of one block: a fresh temporary for an operation costs more than the operation."""

    def __init__(self, lines: int) -> None:
        # Rows a power of two apart fall on the same cache sets: a few lines more spread them.
        self.complex = np.empty((20, lines + 12), dtype=np.complex128)[:, :lines]
        self.real = np.empty((9, lines + 24))[:, :lines]
        self.planes = np.empty((16, lines + 12), dtype=np.complex128)[:, :lines]


@lru_cache(maxsize=4)
def workspace(lines: int) -> Workspace:
    """The workspace for a block size, kept between calls (not for several threads)."""
    return Workspace(lines)


def segment_receptance(
    angular_frequency: NDArray, segment: Real, out: Complex | None = None, block: int = BLOCK
) -> Complex:
    """Free-free receptance of a uniform segment over (y1, theta1, y2, theta2).

    Parameters
    ----------
    angular_frequency : (n,) real or complex, not zero [rad/s].
    segment : one row of the segment table, (14,).
    out : (n, 4, 4) complex, written in place when given.
    block : lines worked on at once.

    Returns
    -------
    (n, 4, 4) complex receptance [m/N, rad/N, m/(N m), rad/(N m)].
    """
    w = np.asarray(angular_frequency)
    constants = segment_constants(segment)
    scalars = tuple(field[0] for field in constants)
    result = np.empty((w.size, 4, 4), dtype=np.complex128) if out is None else out
    work = workspace(min(block, w.size))
    for start in range(0, w.size, block):
        stop = min(start + block, w.size)
        halves = half_receptances(w[start:stop], scalars, work)
        _write_both_ends(halves, result[start:stop], work)
    return result


def waves(w: NDArray, scalars: tuple, work: Workspace) -> bool:
    """Fill workspace rows 0-6 with alpha, beta, lambda1^2, lambda2^2, alpha - beta, T1, T2, row 9 with w^2.

    Returns
    -------
    bool
        Whether the block is of such low frequency that T holds its tail U = (T - h) / lambda^2.
    """
    length, shear, bending, mass, rotary = scalars
    half, real = length / 2, work.real[:, : w.size]
    alpha, beta, z1, z2, gap, t1, t2, _, root, square, scratch = work.complex[:11, : w.size]
    np.multiply(w, w, out=square)
    # gap = 2 root, root^2 = w^2 (m/B + w^2 c^2).
    spread = (rotary / bending - mass / shear) / 2
    np.multiply(square, spread**2, out=scratch)
    scratch += mass / bending
    scratch *= square
    complex_sqrt(scratch, root, real)
    np.multiply(square, -spread, out=scratch)
    np.add(scratch, root, out=alpha)
    np.subtract(scratch, root, out=beta)
    np.multiply(square, -(rotary / bending + mass / shear) / 2, out=scratch)
    np.add(scratch, root, out=z1)
    np.subtract(scratch, root, out=z2)
    np.add(root, root, out=gap)
    low = bool(np.abs(z2).max() * half**2 < _TAIL_LIMIT)
    for number, t in ((z1, t1), (z2, t2)):
        if low:
            _tanh_tail(number, half, t, scratch)
        else:
            tanh_over(number, half, t, real)
    return low


def half_receptances(w: NDArray, scalars: tuple, work: Workspace) -> Complex:
    """Rows yy, y-theta, theta-theta of half the symmetric, then of half the antisymmetric receptance.

    The ends move alike (y1 = y2, theta1 = -theta2) or opposite; each half has two waves and two loads, solved
    by hand. With alpha, beta = lambda^2 + m w^2 / S of the two waves, T = tanh(lambda h) / lambda and P =
    lambda^2 T: symmetric  yy = -(alpha - beta) / (m w^2 Q),  y-theta = (T2 - T1) / (B Q),  theta-theta = T1
    T2 (alpha - beta) / (B Q), antisymm.  yy = -(alpha - beta) P1 P2 / (m w^2 R),  y-theta = (P1 - P2) / (B
    R),  theta-theta = (alpha - beta) / (B R), Q = alpha T2 - beta T1, R = alpha P1 - beta P2.
    """
    bending, mass, rotary, half = *scalars[2:], scalars[0] / 2
    c = work.complex[:, : w.size]
    square, product, scratch, u1, u2 = c[9], c[10], c[19], c[17], c[18]
    alpha, beta, z1, z2, gap, t1, t2 = c[:7]
    halves = c[11:17]
    low = waves(w, scalars, work)
    if low:
        u1[:], u2[:] = t1, t2
        for tail, number in ((t1, z1), (t2, z2)):
            tail *= number
            tail += half
    p1, p2 = c[7], c[8]
    np.multiply(z1, t1, out=p1)
    np.multiply(z2, t2, out=p2)
    # Symmetric half.
    np.multiply(alpha, t2, out=product)
    np.multiply(beta, t1, out=scratch)
    product -= scratch
    np.reciprocal(product, out=product)
    product *= 0.5 / bending
    sym_yy, sym_yt, sym_tt, anti_yy, anti_yt, anti_tt = halves
    if low:
        # T2 - T1 and R cancel at low frequency: write them with the tails U = (T - h) / lambda^2.
        np.multiply(z2, u2, out=sym_yt)
        np.multiply(z1, u1, out=scratch)
        sym_yt -= scratch
    else:
        np.subtract(t2, t1, out=sym_yt)
    np.multiply(gap, product, out=sym_tt)
    np.divide(sym_tt, square, out=sym_yy)
    sym_yy *= -bending / mass
    sym_yt *= product
    t1 *= t2
    sym_tt *= t1
    # Antisymmetric half.
    if low:
        np.multiply(gap, square, out=product)
        product *= -half * rotary / bending
        for wave, number, tail, sign in ((alpha, z1, u1, 1), (beta, z2, u2, -1)):
            np.multiply(number, number, out=scratch)
            scratch *= tail
            scratch *= wave
            if sign > 0:
                product += scratch
            else:
                product -= scratch
    else:
        np.multiply(alpha, p1, out=product)
        np.multiply(beta, p2, out=scratch)
        product -= scratch
    np.reciprocal(product, out=product)
    product *= 0.5 / bending
    np.subtract(p1, p2, out=anti_yt)
    anti_yt *= product
    np.multiply(gap, product, out=anti_tt)
    p1 *= p2
    np.multiply(anti_tt, p1, out=anti_yy)
    anti_yy /= square
    anti_yy *= -bending / mass
    return halves


def _write_both_ends(halves: Complex, out: Complex, work: Workspace) -> None:
    """Superpose the halves: a load on one end is half a symmetric and half an antisymmetric pair."""
    n = out.shape[0]
    # Sixteen planes and one transposing copy: sixteen strided writes take twice as long.
    planes = work.planes[:, :n]
    yy, yt, tt = halves[3:]
    sym_yy, sym_yt, sym_tt = halves[:3]
    np.add(yy, sym_yy, out=planes[0])
    np.add(yt, sym_yt, out=planes[11])
    np.add(tt, sym_tt, out=planes[5])
    np.subtract(sym_yy, yy, out=planes[2])
    np.subtract(sym_yt, yt, out=planes[3])
    np.subtract(tt, sym_tt, out=planes[7])
    np.negative(planes[11], out=planes[1])
    np.negative(planes[3], out=planes[6])
    planes[10], planes[15], planes[4] = planes[0], planes[5], planes[1]
    planes[14], planes[8], planes[12] = planes[11], planes[2], planes[3]
    planes[9], planes[13] = planes[6], planes[7]
    np.copyto(out.reshape(n, 16), planes.T)


def complex_sqrt(z: Complex, out: Complex, real: Real) -> None:
    """Root of ``z`` from real roots (5 ns instead of 12), up to its sign; exact zeros are moved by 1e-150."""
    _split_sqrt(z, out.real, out.imag, real)


def _split_sqrt(z: Complex, re: Real, im: Real, real: Real) -> Real:
    a, b, modulus, large, small = real[:5]
    a[:], b[:] = z.real, z.imag
    np.multiply(a, a, out=modulus)
    np.multiply(b, b, out=large)
    modulus += large
    np.sqrt(modulus, out=modulus)
    modulus += 1e-300
    np.abs(a, out=large)
    large += modulus
    large *= 0.5
    np.sqrt(large, out=large)
    np.divide(b, large, out=small)
    small *= 0.5
    lowest = a.min()
    if lowest >= 0:
        re[:], im[:] = large, small
    elif a.max() < 0:
        re[:], im[:] = small, large
    else:
        positive = a >= 0
        re[:], im[:] = np.where(positive, large, small), np.where(positive, small, large)
    return modulus


def tanh_over(z: Complex, half: float, out: Complex, real: Real) -> None:
    """``tanh(lambda h) / lambda`` for ``lambda^2 = z``; even in lambda, so either root will do."""
    x, y = real[5], real[6]
    modulus = _split_sqrt(z, x, y, real)
    hyperbolic, circular, one, other = real[0], real[1], real[3], real[4]
    np.multiply(x, half, out=hyperbolic)
    np.tanh(hyperbolic, out=hyperbolic)
    np.multiply(y, half, out=circular)
    np.tan(circular, out=circular)
    # tanh(a + ib) = (X (1 + Y^2) + i Y (1 - X^2)) / (1 + X^2 Y^2), X = tanh a, Y = tan b, then times
    # conj(lambda).
    x2, y2 = real[7], real[8]
    np.multiply(hyperbolic, hyperbolic, out=x2)
    np.multiply(circular, circular, out=y2)
    np.multiply(x2, y2, out=one)
    one += 1
    one *= modulus
    np.divide(1.0, one, out=one)
    y2 += 1
    hyperbolic *= y2
    hyperbolic *= one
    np.subtract(1.0, x2, out=x2)
    circular *= x2
    circular *= one
    np.multiply(hyperbolic, x, out=one)
    np.multiply(circular, y, out=other)
    np.add(one, other, out=out.real)
    circular *= x
    hyperbolic *= y
    np.subtract(circular, hyperbolic, out=out.imag)


def _tanh_tail(z: Complex, half: float, out: Complex, scratch: Complex) -> None:
    """``(tanh(lambda h) / lambda - h) / lambda^2`` by its Taylor series, for small ``lambda h``."""
    np.multiply(z, half**2, out=scratch)
    out[:] = _TANH_TAIL[-1]
    for coefficient in _TANH_TAIL[-2::-1]:
        out *= scratch
        out += coefficient
    out *= half**3
