"""The frequency-independent part of a chain: Taylor series in ``w^2``, evaluated as one matrix product.

The transfer matrix of a segment, its 2x2 minors and those of a whole chain are entire functions of ``w^2``.
A minor computed from the transfer matrix cancels like exp(lambda L); the minors of a product are the product
of the minors, so they are propagated themselves (the second compound matrix) and nothing cancels. A sweep is
then one real matrix product per block of lines, (coefficients) @ (powers of w^2), at about a nanosecond a
function and line.

State in this package: (y, theta, -V, -M), carried from the right end to the left: a free end has -V = -M = 0
and the last two entries are the loads on the left end.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from .segment import Complex, Constants, Real

# Pairs of states whose minors are propagated; PAIR[i, j] finds one.
PAIRS = tuple(combinations(range(4), 2))
PAIR = {pair: k for k, pair in enumerate(PAIRS)}
# The series of a span with sum(|lambda| L) beyond this has lost four digits (growth exp(0.41 sum)): split it.
SPAN_LIMIT = 20.0
_TINY = 1e-18


def generators(constants: Constants, reference: float) -> tuple[Complex, Complex]:
    """Matrices A, B of d(state)/d(-x) = (A + (w/reference)^2 B) state, times length, (n_segments, 4, 4)."""
    count = constants.length.size
    fixed = np.zeros((count, 4, 4), dtype=np.complex128)
    inertial = np.zeros((count, 4, 4), dtype=np.complex128)
    fixed[:, 0, 1] = -1
    fixed[:, 0, 2] = 1 / constants.shear
    fixed[:, 1, 3] = 1 / constants.bending
    fixed[:, 3, 2] = 1
    inertial[:, 2, 0] = -constants.mass * reference**2
    inertial[:, 3, 1] = -constants.rotary * reference**2
    length = constants.length[:, None, None]
    return fixed * length, inertial * length


def _minors_map() -> Real:
    """The linear map behind ``minors_generator``: a 4x4 matrix's entries to a 6x6 one's, (36, 16)."""
    result = np.zeros((6, 6, 4, 4))
    for row, (i, j) in enumerate(PAIRS):
        for k in range(4):
            for entry, (first, second) in (((i, k), (k, j)), ((j, k), (i, k))):
                if first != second:
                    sign = 1 if first < second else -1
                    result[row, PAIR[min(first, second), max(first, second)], *entry] += sign
    return result.reshape(36, 16)


_MINORS_MAP = _minors_map()


def minors_generator(matrix: Complex) -> Complex:
    """Second additive compound: how the six minors of two columns move when ``matrix`` moves the columns."""
    return (matrix.reshape(-1, 16) @ _MINORS_MAP.T).reshape(*matrix.shape[:-2], 6, 6)


def wave_span(constants: Constants, angular_frequency: float) -> Real:
    """Largest |lambda| L of each segment at the highest frequency: how long its series is."""
    w2 = abs(angular_frequency) ** 2
    bending, shear = abs(constants.bending), abs(constants.shear)
    half_sum = w2 * (constants.rotary / bending + constants.mass / shear) / 2
    root = np.sqrt(
        (w2 * (constants.rotary / bending - constants.mass / shear) / 2) ** 2 + w2 * constants.mass / bending
    )
    return np.sqrt(half_sum + root) * constants.length


def degree_for(span: float) -> int:
    """Powers of (w/reference)^2 to start with for a wave span, generous; ``Series`` trims."""
    # cosh cos grows like a wave of sqrt(2) the span; the tail of exp(x) is negligible beyond about e x + 30
    # terms.
    return 10 + int((np.e * np.sqrt(2) * span + 30) / 4)


def propagate(fixed: Complex, inertial: Complex, start: Complex) -> Complex:
    """exp(fixed + s inertial) applied to columns whose entries are series in s.

    Parameters
    ----------
    fixed, inertial : (d, d)
    start : (d, n_powers, n_columns) coefficients.

    Returns
    -------
    (d, n_powers, n_columns) coefficients of the product, the powers beyond cut.
    """
    size, powers, columns = start.shape
    width = powers * columns
    # The lower half holds the upper one times s (one power further right), so a term of the series is one
    # product.
    term = np.zeros((2 * size, width), dtype=start.dtype)
    upper, lower, source = term[:size], term[size:, columns:], term[:size, : width - columns]
    upper[:] = start.reshape(size, -1)
    total, new = upper.copy(), np.empty((size, width), dtype=start.dtype)
    both = np.hstack([fixed, inertial])
    for order in range(1, 500):
        lower[:] = source
        np.matmul(both * (1.0 / order), term, out=new)
        total += new
        # Row by row: displacements and moments differ by powers of ten.
        if order % 6 == 0 and (np.abs(new).max(axis=1) <= _TINY * np.abs(total).max(axis=1)).all():
            break
        upper[:] = new
    return total.reshape(start.shape)


def powers_of(square: NDArray, count: int, out: NDArray) -> NDArray:
    """Rows 1, s, s^2, ... of the scaled squared frequency, each a product of near-equal powers."""
    out[0] = 1
    if count > 1:
        out[1] = square
    for k in range(2, count):
        np.multiply(out[k // 2], out[k - k // 2], out=out[k])
    return out


class Series:
    """Entire functions of w^2 by their coefficients, evaluated together.

    Parameters
    ----------
    coefficients : (n_functions, n_powers) complex, in powers of (w / reference)^2.
    reference : the highest |w| they are meant for [rad/s].
    powers : how many to keep; as many as matter when not given.
    """

    def __init__(self, coefficients: Complex, reference: float, powers: int | None = None) -> None:
        largest = np.abs(coefficients).max(axis=1, keepdims=True)
        needed = np.flatnonzero((np.abs(coefficients) > _TINY * largest).any(axis=0))
        if needed[-1] + 2 > coefficients.shape[1]:
            raise ArithmeticError(f"{coefficients.shape[1]} powers leave the series unfinished")
        kept = coefficients[:, : powers or needed[-1] + 1]
        self.reference = reference
        self._buffers: tuple[NDArray, Complex, Complex] | None = None
        self.functions, self.powers = kept.shape
        self.complex = np.ascontiguousarray(kept)
        # Real lines: rows (powers) by columns (re, im, re, im, ...), so the product is complex without a
        # copy.
        self.interleaved = np.ascontiguousarray(self.complex.T).view(np.float64)

    def buffers(self, lines: int, dtype: np.dtype) -> tuple[NDArray, Complex, Complex]:
        """Scratch for powers, values and one more line of the block, kept between calls.

        Fresh ones are large enough for malloc to map them, and faulting them in costs as much as the work.
        """
        if self._buffers is None or self._buffers[1].shape[0] != lines or self._buffers[0].dtype != dtype:
            self._buffers = (
                np.empty((self.powers, lines), dtype=dtype),
                np.empty((lines, self.functions), dtype=np.complex128),
                np.empty(lines, dtype=np.complex128),
            )
        return self._buffers

    def lines(self, square: NDArray, scratch: NDArray, out: NDArray | None = None) -> Complex:
        """Values for scaled squares (n,), as (n, n_functions) complex; ``scratch`` is (>= n_powers, >= n)."""
        table = powers_of(square, self.powers, scratch[: self.powers, : square.size])
        if np.iscomplexobj(table):
            return np.matmul(table.T, self.complex.T, out=out)
        target = None if out is None else out.view(np.float64)
        return np.matmul(table.T, self.interleaved, out=target).view(np.complex128)

    def again(self, scratch: NDArray, count: int) -> Complex:
        """Values (n, n_functions) from the powers another series of as many powers left in ``scratch``."""
        table = scratch[: self.powers, :count].T
        if np.iscomplexobj(table):
            return table @ self.complex.T
        return (table @ self.interleaved).view(np.complex128)
