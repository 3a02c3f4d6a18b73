"""Chains segment by segment: the far end's impedance carried to the tip, one explicit 2x2 step a segment.

Two of these: dynamic stiffnesses in closed form (any span, but digits are lost on short segments at low
frequency) and transfer matrices as series (neighbours merged, long segments cut). Both are slower than the
whole-chain series in ``chain``; they are what remains when the chain is too long for one series.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .chain import TipSeries
from .segment import Complex, Real, Workspace, segment_constants, waves, workspace
from .series import SPAN_LIMIT, degree_for, generators, powers_of, propagate, wave_span

STIFFNESS_BLOCK = 4096
TRANSFER_BLOCK = 1024
# Measured on ten-segment chains, 1 Hz to 10 kHz: up to 5 only the rounding of the frequency is lost
# (1e-11).
TRANSFER_LIMIT = 5.0


def tip_by_stiffness(angular_frequency: NDArray, segments: Real, block: int = STIFFNESS_BLOCK) -> Complex:
    """Tip receptance (n, 2, 2) of a chain of segments (rows from the tip on), by closed-form stiffnesses."""
    w = np.asarray(angular_frequency)
    result = np.empty((w.size, 2, 2), dtype=np.complex128)
    table = list(zip(*segment_constants(segments), strict=True))[::-1]
    size = min(block, w.size)
    work, impedance, steps = workspace(size), np.empty((3, size), complex), np.empty((13, size), complex)
    for start in range(0, w.size, block):
        line = w[start : start + block]
        n = line.size
        z = impedance[:, :n]
        z[:] = 0
        for scalars in table:
            _stiffness_step(line, scalars, work, z, steps[:, :n])
        over = 1 / (z[0] * z[2] - z[1] * z[1])
        part = result[start : start + n]
        part[:, 0, 0], part[:, 1, 1] = z[2] * over, z[0] * over
        part[:, 0, 1] = part[:, 1, 0] = -z[1] * over
    return result


def _stiffness_step(w: NDArray, scalars: tuple, work: Workspace, z: Complex, s: Complex) -> None:
    """Z1 = J (P - N (P + Z2)^-1 N) J; P, N: half the halves' sum and difference, J = diag(1, -1)."""
    length, _, bending, mass, _ = scalars
    low = waves(w, scalars, work)
    alpha, beta, z1, z2, gap, t1, t2, p1, p2, square, scratch = work.complex[:11, : w.size]
    if low:
        for t, number in ((t1, z1), (t2, z2)):
            t *= number
            t += length / 2
    sym, anti, summed = s[:3], s[3:6], s[6:9]
    np.multiply(z1, t1, out=p1)
    np.multiply(z2, t2, out=p2)
    square *= mass
    over = s[9]
    # Symmetric half, over beta T2 - alpha T1.
    np.multiply(beta, t2, out=over)
    over -= np.multiply(alpha, t1, out=scratch)
    np.reciprocal(over, out=over)
    over *= 0.5
    np.multiply(gap, over, out=sym[2])
    np.multiply(sym[2], square, out=sym[0])
    sym[0] *= np.multiply(t1, t2, out=scratch)
    np.subtract(t1, t2, out=sym[1])
    sym[1] *= square
    sym[1] *= over
    sym[2] *= -bending
    # Antisymmetric half, over beta P1 - alpha P2.
    np.multiply(beta, p1, out=over)
    over -= np.multiply(alpha, p2, out=scratch)
    np.reciprocal(over, out=over)
    over *= 0.5
    np.multiply(gap, over, out=anti[2])
    np.multiply(anti[2], square, out=anti[0])
    anti[2] *= np.multiply(p1, p2, out=scratch)
    np.subtract(p2, p1, out=anti[1])
    anti[1] *= square
    anti[1] *= over
    anti[2] *= -bending
    np.add(sym, anti, out=summed)
    np.subtract(sym, anti, out=sym)
    np.add(summed, z, out=anti)
    # (P + Z)^-1 by its adjugate, then N adj N.
    a, b, d = anti
    n0, n1, n2 = sym
    over, e0, e1, e2 = s[9], s[10], s[11], s[12]
    np.multiply(a, d, out=over)
    np.multiply(b, b, out=e0)
    over -= e0
    np.reciprocal(over, out=over)
    anti *= over
    np.multiply(n0, d, out=e0)
    np.multiply(n1, b, out=scratch)
    e0 -= scratch
    np.multiply(n1, a, out=e1)
    np.multiply(n0, b, out=scratch)
    e1 -= scratch
    np.multiply(e0, n0, out=z[0])
    np.multiply(e1, n1, out=scratch)
    z[0] += scratch
    np.multiply(e0, n1, out=z[1])
    np.multiply(e1, n2, out=scratch)
    z[1] += scratch
    np.multiply(n1, d, out=e0)
    np.multiply(n2, b, out=scratch)
    e0 -= scratch
    np.multiply(n2, a, out=e2)
    np.multiply(n1, b, out=scratch)
    e2 -= scratch
    np.multiply(e0, n1, out=z[2])
    np.multiply(e2, n2, out=scratch)
    z[2] += scratch
    np.subtract(summed, z, out=z)
    np.negative(z[1], out=z[1])


class TransferChain:
    """Tip receptance by transfer matrices as series in w^2, neighbours merged up to a wave span of ``limit``.

    Parameters
    ----------
    segments : rows in order from the tip.
    highest : largest requested |w| [rad/s].
    limit : largest wave span of one transfer matrix.
    merge : whether short neighbours become one matrix.
    """

    def __init__(self, segments: Real, highest: float, limit: float = TRANSFER_LIMIT, merge: bool = True) -> None:
        constants = segment_constants(segments)
        spans = wave_span(constants, highest)
        pieces = []
        for fixed, inertial, span in zip(*generators(constants, highest), spans, strict=True):
            parts = int(np.ceil(span / limit))
            pieces += [(fixed / parts, inertial / parts, span / parts)] * parts
        groups: list[list] = [[]]
        filled = 0.0
        for piece in pieces[::-1]:
            if groups[-1] and (not merge or filled + piece[2] > limit):
                groups.append([])
                filled = 0.0
            groups[-1].append(piece)
            filled += piece[2]
        self.reference = highest
        self.transfers = [_transfer_series(group) for group in groups]

    def __call__(self, angular_frequency: NDArray, block: int = TRANSFER_BLOCK) -> Complex:
        """Tip receptance (n, 2, 2)."""
        w = np.asarray(angular_frequency)
        result = np.empty((w.size, 2, 2), dtype=np.complex128)
        size, powers = min(block, w.size), max(t.shape[1] for t in self.transfers)
        table = np.empty((powers, size), dtype=np.complex128)
        real = np.empty((powers, size), dtype=w.dtype)
        flat = np.empty(16 * size, dtype=np.complex128)
        columns, scratch = np.empty((2, 4, size), complex), np.empty((4, size), complex)
        for start in range(0, w.size, block):
            square = w[start : start + block] / self.reference
            square *= square
            n = square.size
            # A complex product straight into planes: cheaper than a real one and its transpose.
            table[:, :n] = powers_of(square, powers, real[:, :n])
            z = np.zeros((3, n), dtype=np.complex128)
            for k, coefficients in enumerate(self.transfers):
                values = flat[: 16 * n].reshape(16, n)
                np.matmul(coefficients, table[: coefficients.shape[1], :n], out=values)
                values = values.reshape(4, 4, n)
                if k == 0:
                    first, second = values[0], values[1]
                else:
                    first, second, part = columns[0][:, :n], columns[1][:, :n], scratch[:, :n]
                    np.multiply(values[2], z[0], out=first)
                    first += values[0]
                    first += np.multiply(values[3], z[1], out=part)
                    np.multiply(values[2], z[1], out=second)
                    second += values[1]
                    second += np.multiply(values[3], z[2], out=part)
                if k + 1 == len(self.transfers):
                    break
                over = np.reciprocal(first[0] * second[1] - second[0] * first[1])
                np.multiply(first[2], second[1], out=z[0])
                z[0] -= second[2] * first[1]
                np.multiply(second[2], first[0], out=z[1])
                z[1] -= first[2] * second[0]
                np.multiply(second[3], first[0], out=z[2])
                z[2] -= first[3] * second[0]
                z *= over
            over = np.reciprocal(first[2] * second[3] - second[2] * first[3])
            rows = result[start : start + n]
            rows[:, 0, 0] = (first[0] * second[3] - second[0] * first[3]) * over
            rows[:, 0, 1] = (second[0] * first[2] - first[0] * second[2]) * over
            rows[:, 1, 0] = rows[:, 0, 1]
            rows[:, 1, 1] = (second[1] * first[2] - first[1] * second[2]) * over
        return result


def _transfer_series(group: list) -> Complex:
    """Coefficients of a group's transfer matrix, its columns one after the other, (16, n_powers)."""
    states = np.zeros((4, degree_for(sum(piece[2] for piece in group)), 4), dtype=np.complex128)
    states[:, 0] = np.eye(4)
    for fixed, inertial, _ in group:
        states = propagate(fixed, inertial, states)
    coefficients = states.transpose(2, 0, 1).reshape(16, -1)
    size = np.abs(coefficients)
    needed = np.flatnonzero((size > 1e-18 * size.max(axis=1, keepdims=True)).any(axis=0))
    return np.ascontiguousarray(coefficients[:, : needed[-1] + 1])


def chain_tip_receptance(angular_frequency: NDArray, segments: Real) -> Complex:
    """Tip receptance (n, 2, 2) of a chain of segments, set-up included, the fastest way its span allows."""
    w = np.asarray(angular_frequency)
    highest = float(np.abs(w).max())
    span = float(wave_span(segment_constants(segments), highest).sum())
    return (TipSeries if span <= SPAN_LIMIT else TransferChain)(segments, highest)(w)
