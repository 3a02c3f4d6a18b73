"""Modes of a predicted receptance from its lines, and how they move with it.

Around each peak a rational function with one pole, G (f - p) = a + b f + c f^2, goes through the lines, and errors of
lines, or derivatives of them, go through its least squares to first order. So a machine that is known only as a table
of receptances has modes as well, and the variance of each of its lines counts.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["LineModes", "line_modes"]

_STANDS_OUT = 1.05
"""Times a peak must be above the valleys beside it."""
_SHARE = 0.5
"""Lines around a peak count as long as they are above this share of it."""
_FEWEST, _MOST = 7, 41
"""Lines that a mode is fitted to."""


@dataclass(frozen=True)
class LineModes:
    """Modes seen as peaks of a receptance, ascending.

    Attributes
    ----------
    values : ndarray
        `(k, 3)`: natural frequency in Hz, damping ratio, dynamic stiffness 1 / |G| at the damped natural frequency.
    weights : tuple of ndarray
        For each mode `(3, m)` complex: a small change dG of its lines changes the logarithms of the three by Re(w dG).
    lines : tuple of slice
        Which lines these are.
    """

    values: NDArray[np.float64]
    weights: tuple[NDArray[np.complex128], ...]
    lines: tuple[slice, ...]

    def __len__(self) -> int:
        return len(self.values)

    def log_slopes(self, derivative: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return derivatives of the logarithms `(k, 3, p)` from those of the lines `(n, p)`."""
        found = [(w @ derivative[own]).real for w, own in zip(self.weights, self.lines, strict=True)]
        return np.array(found).reshape(len(self), 3, derivative.shape[1])

    def log_variances(self, variance: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return variances of the logarithms `(k, 3)` where the lines err independently.

        `variance` is that of the real and of the imaginary part, each, of each line `(n,)`.
        """
        found = [np.abs(w) ** 2 @ variance[own] for w, own in zip(self.weights, self.lines, strict=True)]
        return np.array(found).reshape(len(self), 3)


def line_modes(frequency_hz: NDArray[np.float64], receptance: NDArray[np.complex128]) -> LineModes:
    """Return the modes that stand out as peaks.

    Parameters
    ----------
    frequency_hz, receptance : ndarray
        `(n,)` ascending lines without noise, dense enough for some lines in the half-power band of each mode.
    """
    values, weights, lines = [], [], []
    for first, last in _windows(np.abs(receptance)):
        found = _fit(frequency_hz[first:last], receptance[first:last])
        if found is not None and frequency_hz[first] <= found[0][0] <= frequency_hz[last - 1]:
            values.append(found[0])
            weights.append(found[1])
            lines.append(slice(first, last))
    return LineModes(np.array(values).reshape(-1, 3), tuple(weights), tuple(lines))


def _windows(size: NDArray[np.float64]) -> list[tuple[int, int]]:
    """First and last line (exclusive) around each peak that stands out."""
    from scipy.signal import find_peaks

    peaks = find_peaks(np.log(size), prominence=np.log(_STANDS_OUT))[0]
    found = []
    for i, peak in enumerate(peaks.tolist()):
        low = peaks[i - 1] + int(np.argmin(size[peaks[i - 1] : peak])) if i else 0
        high = peak + int(np.argmin(size[peak : peaks[i + 1]])) if i + 1 < peaks.size else size.size - 1
        above = size >= _SHARE * size[peak]
        left = int(np.argmin(above[low : peak + 1][::-1])) or peak - low
        right = int(np.argmin(above[peak : high + 1])) or high - peak
        half = int(np.clip(min(left, right), _FEWEST // 2, _MOST // 2))
        first, last = max(peak - half, 0), min(peak + half + 1, size.size)
        if last - first >= _FEWEST - 2:
            found.append((first, last))
    return found


def _fit(
    frequency_hz: NDArray[np.float64], receptance: NDArray[np.complex128]
) -> tuple[tuple[float, float, float], NDArray[np.complex128]] | None:
    """The three values of a mode and the weights of its lines; None where the lines hold no damped mode."""
    middle, width = frequency_hz.mean(), 0.5 * np.ptp(frequency_hz)
    x, scale = (frequency_hz - middle) / width, float(np.abs(receptance).max())
    g = receptance / scale
    inverse = np.linalg.pinv(np.stack([g, np.ones_like(g), x, x * x], axis=1))
    pole, a, b, c = inverse @ (x * g)
    reach = pole.imag
    if not reach > 0.0:
        return None
    at = pole.real
    top = a + b * at + c * at * at
    p = middle + width * pole
    size = abs(p)
    damping = p.imag / size
    # d(pole, a, b, c) = inverse ((x - pole) dG), in units of the scaled receptance.
    moved = inverse * ((x - pole) / scale)
    relative = moved[0] * width / p
    # |G| at the damped natural frequency is |top| / Im pole; its place moves with the pole.
    slope = (b + 2.0 * c * at) / top
    own = (moved[1] + moved[2] * at + moved[3] * at * at) / top
    with_place = own + slope.real * moved[0]
    weights = np.stack(
        [
            relative,
            # Im(r dG) is the real part of -i r dG.
            -1j * relative * np.sqrt(1.0 - damping**2) / damping,
            -(with_place - (-1j * moved[0]) / reach),
        ]
    )
    return (float(size), float(damping), float(reach / (abs(top) * scale))), weights
