"""Stable depth of cut by the zeroth-order solution of milling (Altintas and Budak, CIRP Annals 44, 1995, 357).

With the mean of the periodic direction factors A, the cut closes the loop

    F = a k_t / 2 (1 - exp(-i w T)) A G(w) F,

T the tooth period. At a given speed the loop is on its limit where an eigenvalue of the product without the depth a is
real and positive; a is its inverse, and the limit is the least one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Cut:
    """A milling cut; coefficients in N/m^2."""

    teeth: int
    k_t: float
    k_n: float
    immersion: float
    """Width of cut over diameter."""
    feed: str
    """"down" or "up"."""

    def directions(self) -> NDArray[np.float64]:
        """Return the mean direction factors, teeth included."""
        swept = math.acos(1.0 - 2.0 * self.immersion)
        start, end = (math.pi - swept, math.pi) if self.feed == "down" else (0.0, swept)
        ratio = self.k_n / self.k_t

        def primitive(phi: float) -> NDArray[np.float64]:
            sine, cosine = math.sin(2.0 * phi), math.cos(2.0 * phi)
            return 0.5 * np.array(
                [
                    [cosine - 2.0 * ratio * phi + ratio * sine, -sine - 2.0 * phi + ratio * cosine],
                    [-sine + 2.0 * phi + ratio * cosine, -cosine - 2.0 * ratio * phi - ratio * sine],
                ]
            )

        return self.teeth / (2.0 * math.pi) * (primitive(end) - primitive(start))


def stable_limit(
    cut: Cut, frequency_hz: NDArray[np.float64], receptance: NDArray[np.complex128], speed_rpm: float
) -> tuple[float, float]:
    """Return the depth in m above which a cut chatters, and the frequency of the chatter in Hz.

    `receptance` is `(n, 2, 2)` over x, the direction of feed, and y, on lines so close that phases change little from
    one to the next.
    """
    period = 60.0 / (cut.teeth * speed_rpm)
    delayed = 1.0 - np.exp(-2j * np.pi * frequency_hz * period)
    loop = 0.5 * cut.k_t * delayed[:, None, None] * (cut.directions() @ receptance)
    values = _continued(np.linalg.eigvals(loop))
    a, b = values[:-1], values[1:]
    crossed = np.signbit(a.imag) != np.signbit(b.imag)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = a.imag / (a.imag - b.imag)
        real = a.real + share * (b.real - a.real)
        depth = np.where(crossed & (real > 0.0), 1.0 / real, np.inf)
    line, branch = np.unravel_index(np.argmin(depth), depth.shape)
    step = frequency_hz[line + 1] - frequency_hz[line]
    return float(depth[line, branch]), float(frequency_hz[line] + share[line, branch] * step)


def _continued(values: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Return pairs of eigenvalues in the order in which they continue from line to line."""
    a, b = values[:-1], values[1:]
    kept = np.abs(b - a).sum(axis=1)
    swapped = np.abs(b[:, ::-1] - a).sum(axis=1)
    turned = np.concatenate([[False], np.cumsum(swapped < kept) % 2 == 1])
    return np.where(turned[:, None], values[:, ::-1], values)
