"""Tip block of a chain of elements, and the receptance of both ends of a free chain, as ratios of series.

All of the chain is hoisted out of the frequency loop; ``riccati`` has the formulations that work segment by
segment.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from .segment import Complex, Real, segment_constants
from .series import (
    PAIRS,
    SPAN_LIMIT,
    Series,
    degree_for,
    generators,
    minors_generator,
    propagate,
    wave_span,
)

SERIES_BLOCK = 4096
BOTH_ENDS_BLOCK = 2048
EMPTY = np.empty((0, 0))


def chain_generators(
    segments: Real, reference: float, joints: Real = EMPTY, masses: Real = EMPTY, grounds: Real = EMPTY
) -> tuple[list[tuple[Complex, Complex]], float]:
    """Generators of a chain's elements from the tip to the far end, and the chain's wave span.

    Raises
    ------
    ValueError
        For a viscous joint or ground, which is not a function of w^2, and for tables that are no chain.
    """
    segments = np.atleast_2d(segments)
    constants = segment_constants(segments)
    fixed, inertial = generators(constants, reference)
    found: dict[tuple[float, int], tuple[Complex, Complex]] = {}
    links = [(row[0], row[1]) for row in (*segments, *joints)]
    if sorted(links) != [(float(i), float(i + 1)) for i in range(len(links))]:
        raise ValueError("the elements do not form one chain 0-1-2-...")
    for row, a, b in zip(segments, fixed, inertial, strict=True):
        found[row[0], 2] = (a, b)
    for row in joints:
        found[row[0], 2] = (
            _quarter(np.linalg.inv(_stiffness(row[2:])), 0, 2),
            _quarter(np.zeros((2, 2)), 0, 2),
        )
    for node in {row[0] for row in (*masses, *grounds)}:
        held = sum((_stiffness(row[1:]) for row in grounds if row[0] == node), np.zeros((2, 2), dtype=complex))
        moved = sum((np.diag(row[1:3]) for row in masses if row[0] == node), np.zeros((2, 2)))
        found[node, 1] = (_quarter(held, 2, 0), _quarter(-(reference**2) * moved, 2, 0))
    return [found[key] for key in sorted(found)], float(wave_span(constants, reference).sum())


def _quarter(block: NDArray, row: int, column: int) -> Complex:
    result = np.zeros((4, 4), dtype=np.complex128)
    result[row : row + 2, column : column + 2] = block
    return result


def _stiffness(row: Real) -> Complex:
    """Complex stiffness of [k_y, k_theta, k_ytheta, c_y, c_theta, c_ytheta, loss_factor]."""
    if np.any(row[3:6]):
        raise ValueError(f"viscous terms {row[3:6]} are no function of w^2")
    return (1 + 1j * row[6]) * np.array([[row[0], row[2]], [row[2], row[1]]])


class TipSeries:
    """Tip block of a chain as three ratios of entire functions of w^2; a line is left with powers of w^2.

    The minors of the two solutions that leave the far end free are carried to the tip as series. With p_ij
    the minor of states i and j, H_yy = p_yM / p_VM, H_ytheta = -p_yV / p_VM, H_thetatheta = -p_thetaV / p_VM.

    Parameters
    ----------
    segments, joints, masses, grounds : tables of a chain, nodes in order from the tip; no viscous terms.
    highest : largest requested |w| [rad/s].
    """

    def __init__(
        self,
        segments: Real,
        highest: float,
        joints: Real = EMPTY,
        masses: Real = EMPTY,
        grounds: Real = EMPTY,
    ) -> None:
        elements, span = chain_generators(segments, highest, joints, masses, grounds)
        if span > SPAN_LIMIT:
            raise ValueError(f"wave span {span:.1f} beyond {SPAN_LIMIT}: the series would lose digits")
        minors = np.zeros((6, degree_for(span), 1), dtype=np.complex128)
        minors[0, 0] = 1
        for fixed, inertial in reversed(elements):
            minors = propagate(minors_generator(fixed), minors_generator(inertial), minors)
        minors = minors[:, :, 0]
        self.series = Series(np.stack([minors[2], -minors[1], -minors[3], minors[5]]), highest)

    def __call__(self, angular_frequency: NDArray, out: Complex | None = None, block: int = SERIES_BLOCK) -> Complex:
        """Tip receptance (n, 2, 2) over (y, theta) at (n,) real or complex angular frequencies [rad/s]."""
        w = np.asarray(angular_frequency)
        result = np.empty((w.size, 2, 2), dtype=np.complex128) if out is None else out
        scratch, values, inverse = self.series.buffers(min(block, w.size), w.dtype)
        for start in range(0, w.size, block):
            part = result[start : start + block]
            n = part.shape[0]
            square = w[start : start + n] / self.series.reference
            square *= square
            rows = self.series.lines(square, scratch, out=values[:n])
            np.reciprocal(rows[:, 3], out=inverse[:n])
            np.multiply(rows[:, 0], inverse[:n], out=part[:, 0, 0])
            np.multiply(rows[:, 1], inverse[:n], out=part[:, 0, 1])
            part[:, 1, 0] = part[:, 0, 1]
            np.multiply(rows[:, 2], inverse[:n], out=part[:, 1, 1])
        return result


class BothEndsSeries:
    """Receptance of both ends of a free chain as ten ratios of entire functions of w^2.

    Parameters
    ----------
    segments : table of a chain, nodes in order from the tip.
    highest : largest requested |w| [rad/s].
    """

    # The ten distinct entries, in the order of the planes.
    ENTRIES = ((0, 0), (0, 1), (1, 1), (2, 2), (2, 3), (3, 3), (2, 0), (2, 1), (3, 0), (3, 1))

    def __init__(self, segments: Real, highest: float) -> None:
        elements, span = chain_generators(segments, highest)
        if span > SPAN_LIMIT:
            raise ValueError(f"wave span {span:.1f} beyond {SPAN_LIMIT}: the series would lose digits")
        degree = degree_for(span)
        minors, states = (np.zeros((d, degree, d), dtype=np.complex128) for d in (6, 4))
        minors[:, 0], states[:, 0] = np.eye(6), np.eye(4)
        for fixed, inertial in reversed(elements):
            states = propagate(fixed, inertial, states)
            minors = propagate(minors_generator(fixed), minors_generator(inertial), minors)
        # Near end: minors of the columns (y, theta). Far end: minors of the rows (V, M).
        yt, yv, ym, tv, _, vm = range(len(PAIRS))
        near = [minors[ym, :, yt], -minors[yv, :, yt], -minors[tv, :, yt]]
        far = [-minors[vm, :, tv], minors[vm, :, yv], minors[vm, :, ym]]
        across = [states[3, :, 1], -states[2, :, 1], -states[3, :, 0], states[2, :, 0]]
        self.series = Series(np.stack([*near, *far, *across, minors[vm, :, yt]]), highest)
        entries = np.zeros((4, 4, degree), dtype=np.complex128)
        for (i, j), coefficients in zip(self.ENTRIES, (*near, *far, *across), strict=True):
            entries[i, j] = entries[j, i] = coefficients
        self.numerators = Series(entries.reshape(16, degree), highest, self.series.powers)
        self.determinant = Series(minors[vm, None, :, yt], highest, self.series.powers)

    def planes(self, angular_frequency: NDArray, out: Complex | None = None, block: int = BOTH_ENDS_BLOCK) -> Complex:
        """The ten distinct entries, (10, n), in the order of ``ENTRIES``."""
        w = np.asarray(angular_frequency)
        result = np.empty((10, w.size), dtype=np.complex128) if out is None else out
        for start, n, rows, inverse in self._blocks(w, block):
            for k in range(10):
                np.multiply(rows[:, k], inverse, out=result[k, start : start + n])
        return result

    def __call__(self, angular_frequency: NDArray, out: Complex | None = None, block: int = BOTH_ENDS_BLOCK) -> Complex:
        """Receptance (n, 4, 4) over (y1, theta1, y2, theta2)."""
        w = np.asarray(angular_frequency)
        result = np.empty((w.size, 4, 4), dtype=np.complex128) if out is None else out
        size = min(block, w.size)
        scratch, _, _ = self.series.buffers(size, w.dtype)
        for start in range(0, w.size, block):
            # All sixteen numerators in the output's own layout: the product writes them where they belong.
            rows = result[start : start + block].reshape(-1, 16)
            square = w[start : start + block] / self.series.reference
            square *= square
            self.numerators.lines(square, scratch, out=rows)
            determinant = self.determinant.again(scratch, square.size)
            np.reciprocal(determinant, out=determinant)
            rows *= determinant
        return result

    def _blocks(self, w: NDArray, block: int) -> Iterator[tuple[int, int, Complex, Complex]]:
        size = min(block, w.size)
        scratch, values, inverse = self.series.buffers(size, w.dtype)
        for start in range(0, w.size, block):
            square = w[start : start + block] / self.series.reference
            square *= square
            n = square.size
            rows = self.series.lines(square, scratch, out=values[:n])
            np.reciprocal(rows[:, 10], out=inverse[:n])
            yield start, n, rows, inverse[:n]
