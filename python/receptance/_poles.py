"""Zeros of a determinant in a sector of the complex plane, with a count that tells whether any is missed.

The determinant is analytic there and known by its logarithm. Newton's method finds zeros from starts; each zero that is
known is divided out. The change of the argument of what is left around the sector is 2 pi times the number of zeros
that are not known yet (argument principle). Where that is not zero the sector is divided until each part holds one
zero, which the first moment of the logarithm locates well enough for Newton's method.

The sector is a rectangle in z = ln w, and all work is done in z: steps and distances are relative.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from math import tau
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    LogDeterminant = Callable[[NDArray[np.complex128]], NDArray[np.complex128]]

__all__ = ["Sector", "zeros"]

_ITERATIONS = 30
_CLOSE = 1e-11
"""Step in z at which a zero is found."""
_SAME = 1e-7
"""Distance in z within which zeros are one."""
_STEP = 1e-6
"""Distance in z of the points between which a slope is taken."""
_LONGEST = 0.3
"""Newton steps in z are no longer."""
_FIRST = 0.1
"""Spacing in z of the first points on a contour."""
_FINEST = 1e-9
"""Spacing in z at which a contour is given up: it runs through a zero."""
_TURN, _BEND = 0.8, 0.2
"""Between neighbouring points the logarithm changes by at most the first, and is straight to the second."""
_SPLITS = (0.47, 0.38, 0.59)
"""Where a part is divided; the next one where a zero lies on the dividing line."""
_SMALLEST = 1e-5
"""Parts of this size in z are not divided: two zeros this close are one to the search."""


class _OnContourError(Exception):
    """A zero on the contour."""


@dataclass(frozen=True)
class Sector:
    """Radii and angles from the real axis that a sector lies between."""

    inner: float
    outer: float
    below: float
    above: float

    def divided(self, share: float) -> tuple[Sector, Sector]:
        """Return two parts, divided across the longer side in z."""
        if np.log(self.outer / self.inner) >= self.above - self.below:
            radius = self.inner * (self.outer / self.inner) ** share
            return Sector(self.inner, radius, self.below, self.above), Sector(
                radius, self.outer, self.below, self.above
            )
        angle = self.below + share * (self.above - self.below)
        return Sector(self.inner, self.outer, self.below, angle), Sector(self.inner, self.outer, angle, self.above)

    @property
    def size(self) -> float:
        """Length of the longer side in z."""
        return max(float(np.log(self.outer / self.inner)), self.above - self.below)

    def corners(self) -> list[complex]:
        """Return the corners in z, anticlockwise, the first one again at the end."""
        low, high = np.log(self.inner), np.log(self.outer)
        ends = [(low, self.below), (high, self.below), (high, self.above), (low, self.above), (low, self.below)]
        return [complex(*end) for end in ends]

    def holds(self, w: NDArray[np.complex128]) -> NDArray[np.bool_]:
        """Return which numbers lie in it."""
        size, angle = np.abs(w), np.angle(w)
        return np.asarray((self.inner <= size) & (size <= self.outer) & (self.below <= angle) & (angle <= self.above))


def zeros(
    logarithm: LogDeterminant, sector: Sector, starts: NDArray[np.complex128]
) -> tuple[NDArray[np.complex128], int]:
    """Return the zeros in a sector, ascending by size, and how many there are besides that were not found.

    Parameters
    ----------
    logarithm : callable
        Of complex numbers with a positive real part, up to a constant and multiples of 2 pi i.
    sector : Sector
        Where zeros are wanted.
    starts : ndarray
        Where some may lie. Those outside the sector help as well.
    """
    search = _Search(logarithm)
    search.newton(starts)
    missed = search.complete(sector)
    known = search.known[sector.holds(search.known)]
    return known, missed


class _Search:
    def __init__(self, logarithm: LogDeterminant) -> None:
        self._logarithm = logarithm
        self.known = np.zeros(0, np.complex128)

    def newton(self, starts: NDArray[np.complex128]) -> int:
        """Add the zeros that Newton's method finds from the starts; return how many were new."""
        z = np.log(starts.astype(np.complex128))
        found = np.full(z.size, np.nan, np.complex128)
        left = np.arange(z.size)
        for _ in range(_ITERATIONS):
            if not left.size:
                break
            at = z[left]
            ends = self._logarithm(np.exp(np.concatenate([at - _STEP, at + _STEP]))).reshape(2, -1)
            # (d+ - d-) / (d+ + d-) from the logarithms, which holds at the zero itself.
            slope = np.tanh(0.5 * (ends[1] - ends[0])) / _STEP
            w = np.exp(at)
            slope -= np.sum(w[:, None] / (w[:, None] - self.known), axis=1)
            move = -1.0 / slope
            move *= np.minimum(1.0, _LONGEST / np.maximum(np.abs(move), 1e-300))
            z[left] = at + move
            done = np.abs(move) <= _CLOSE
            found[left[done]] = z[left[done]]
            left = left[~done & np.isfinite(move) & (np.abs(z[left].imag) < 0.49 * np.pi)]
        before = self.known.size
        both = np.concatenate([self.known, np.exp(found[np.isfinite(found)])])
        both = both[np.lexsort([both.imag, np.abs(both)])]
        kept: list[complex] = []
        for w in both:
            near = [other for other in kept[-8:] if abs(w - other) <= _SAME * abs(w)]
            if not near:
                kept.append(w)
        self.known = np.array(kept, np.complex128)
        return self.known.size - before

    def complete(self, sector: Sector) -> int:
        """Find the zeros that are not known yet; return how many of them were not found."""
        count, centre = self._unknown(sector)
        if count == 1 and self.newton(np.array([centre])):
            count, centre = self._unknown(sector)
        if count <= 0:
            return abs(count)
        if sector.size <= _SMALLEST:
            self.newton(np.array([centre]))
            return max(0, self._unknown(sector)[0])
        for share in _SPLITS:
            try:
                return sum(self.complete(part) for part in sector.divided(share))
            except _OnContourError:
                continue
        return count

    def _unknown(self, sector: Sector) -> tuple[int, complex]:
        """Return how many zeros are not known, and the mean of their places in z as a number w."""
        turns, moment = 0j, 0j
        corners = sector.corners()
        for start, end in pairwise(corners):
            z, change = self._edge(start, end)
            turns += change.sum()
            moment += (0.5 * (z[1:] + z[:-1]) * change).sum()
        count = round(turns.imag / tau)
        return count, complex(np.exp(moment / (1j * tau * count))) if count else 0j

    def _edge(self, start: complex, end: complex) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """Return points along an edge and the changes of the logarithm between them, the known zeros divided out."""
        count = 2 * int(np.ceil(abs(end - start) / _FIRST)) + 1
        z = np.asarray(start + (end - start) * np.linspace(0.0, 1.0, count), np.complex128)
        values = self._left(z)
        while True:
            change = _wrapped(np.diff(values))
            bend = np.abs(np.diff(change))
            rough = np.abs(change) > _TURN
            # A point is judged by its neighbours; both intervals beside it are divided.
            curved = np.concatenate([[False], bend > _BEND, [False]])
            rough |= curved[:-1] | curved[1:]
            rough |= ~np.isfinite(change)
            if not rough.any():
                return z, change
            if np.min(np.abs(np.diff(z))[rough]) < _FINEST:
                raise _OnContourError
            middle = np.asarray(0.5 * (z[:-1] + z[1:])[rough], np.complex128)
            at = np.flatnonzero(rough) + 1
            z = np.asarray(np.insert(z, at, middle), np.complex128)
            values = np.asarray(np.insert(values, at, self._left(middle)), np.complex128)

    def _left(self, z: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Return the logarithm without the known zeros."""
        w = np.exp(z)
        values = self._logarithm(w)
        with np.errstate(divide="ignore"):
            return np.asarray(values - np.sum(np.log(w[:, None] - self.known), axis=1))


def _wrapped(change: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Return differences of logarithms with imaginary parts between -pi and pi."""
    return np.asarray(change.real + 1j * ((change.imag + np.pi) % tau - np.pi))
