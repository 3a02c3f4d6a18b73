"""Modes of a receptance from its frequency lines, with their derivatives and variances.

Around each peak the dynamic stiffness 1 / G = (f - p) / (a + b f + c f^2), with the pole p, is fitted to the lines by
weighted least squares. Errors and derivatives of the lines are propagated through the same least squares to first
order. Modes are thus found also for a machine that is given as a table of receptances. The fit is of 1 / G, because the
relative error of G may exceed one at a resonance where that of 1 / G is small.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from receptance._peaks import local_maxima

_PROMINENCE = 1.05
"""Smallest ratio of a peak to its prominence base."""
_NOISE_PROMINENCE = 3.0
"""Smallest prominence of a peak, in standard deviations of its noise."""
_SHARE = 0.5
"""Lines around a peak are used down to this share of its height."""
_LINES, _NOISY_LINES = (7, 41), (15, 81)
"""Smallest and largest number of lines for a mode, without and with noise."""
_MODEL_ERROR = 1e-3
"""Relative error added to the noise, so that the weights of lines without noise are finite."""
_ITERATIONS, _TOLERANCE = 30, 1e-9
"""Largest number of iterations, and relative step of convergence."""


@dataclass(frozen=True)
class LineModes:
    """Modes that are peaks of a receptance, in ascending order."""

    values: NDArray[np.float64]
    """`(k, 3)`: natural frequency in Hz, damping ratio, dynamic stiffness 1 / |G| at the damped natural frequency."""
    weights: tuple[NDArray[np.complex128], ...]
    """For each mode `(3, m)` complex: a small change dG of its lines changes the logarithms of the values by Re(w
    dG)."""
    lines: tuple[NDArray[np.intp], ...]
    """Indices of the lines of each mode."""

    def __len__(self) -> int:
        return len(self.values)

    def log_slopes(self, derivative: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return derivatives of the logarithms `(k, 3, p)` from those of the lines `(n, p)`."""
        slopes = [(w @ derivative[lines]).real for w, lines in zip(self.weights, self.lines, strict=True)]
        return np.array(slopes).reshape(len(self), 3, derivative.shape[1])

    def log_variances(self, errors: NDArray[np.complex128], *, independent: bool) -> NDArray[np.float64]:
        """Return variances of the logarithms `(k, 3)` by errors of the lines.

        `errors` are the changes of the lines `(n, q)` by complex errors of unit variance of real and imaginary part,
        which are `independent` between lines, or shared by all.
        """
        if independent:
            variance = np.sum(np.abs(errors) ** 2, axis=1)
            variances = [np.abs(w) ** 2 @ variance[lines] for w, lines in zip(self.weights, self.lines, strict=True)]
        else:
            moved = [w @ errors[lines] for w, lines in zip(self.weights, self.lines, strict=True)]
            variances = [np.sum(np.abs(change) ** 2, axis=1) for change in moved]
        return np.array(variances).reshape(len(self), 3)


def line_modes(
    frequency_hz: NDArray[np.float64],
    receptance: NDArray[np.complex128],
    variance: NDArray[np.float64] | None = None,
) -> LineModes:
    """Return the modes that are distinct peaks of a receptance.

    Parameters
    ----------
    frequency_hz, receptance : ndarray
        `(n,)` ascending lines, of which several are in the half-power band of each mode.
    variance : ndarray, optional
        `(n,)` variance of real and imaginary part, each, for independent errors of the lines.
    """
    size = np.abs(receptance)
    noise = np.zeros(size.size) if variance is None else np.sqrt(variance)
    values: list[tuple[float, float, float]] = []
    weights: list[NDArray[np.complex128]] = []
    lines: list[NDArray[np.intp]] = []
    for windows in _windows(size, noise):
        # Dense lines over a small part of a resonance may not determine its pole.
        for window in windows:
            mode = _fit(frequency_hz[window], receptance[window], noise[window])
            if mode is not None:
                break
        else:
            continue
        # Several noise peaks of one resonance give the same pole.
        if all(abs(mode[0][0] - old[0]) > old[0] * old[1] for old in values):
            values.append(mode[0])
            weights.append(mode[1])
            lines.append(window)
    return LineModes(np.array(values).reshape(-1, 3), tuple(weights), tuple(lines))


def _windows(size: NDArray[np.float64], noise: NDArray[np.float64]) -> list[list[NDArray[np.intp]]]:
    """Return the indices of lines around each distinct peak: the nearest ones, and those over a range that is wider."""
    all_peaks, prominence = local_maxima(np.log(size), np.log(_PROMINENCE))
    peaks = all_peaks[prominence > _NOISE_PROMINENCE * (noise / size)[all_peaks]]
    fewest, most = _NOISY_LINES if noise.any() else _LINES
    windows = []
    for i, peak in enumerate(peaks.tolist()):
        low = peaks[i - 1] + int(np.argmin(size[peaks[i - 1] : peak])) if i else 0
        high = peak + int(np.argmin(size[peak : peaks[i + 1]])) if i + 1 < peaks.size else size.size - 1
        above = size >= _SHARE * size[peak]
        left = int(np.argmin(above[low : peak + 1][::-1])) or peak - low
        right = int(np.argmin(above[peak : high + 1])) or high - peak
        half = max(min(left, right), fewest // 2)
        around = []
        for step in sorted({1, -(-half // (most // 2))}):
            count = min(half // step, most // 2)
            lines = peak + step * np.arange(-count, count + 1)
            lines = lines[(lines >= 0) & (lines < size.size)]
            around += [lines] if lines.size >= fewest - 2 else []
        windows.append(around)
    return windows


def _fit(
    frequency_hz: NDArray[np.float64], receptance: NDArray[np.complex128], noise: NDArray[np.float64]
) -> tuple[tuple[float, float, float], NDArray[np.complex128]] | None:
    """Return the values of a mode and the weights of its lines; None if the lines have no damped mode."""
    middle, width = frequency_hz.mean(), 0.5 * np.ptp(frequency_hz)
    x, scale = (frequency_hz - middle) / width, float(np.abs(receptance).max())
    stiffness = scale / receptance
    weight = 1.0 / np.hypot(noise / scale * np.abs(stiffness) ** 2, _MODEL_ERROR * np.abs(stiffness))
    quotient = _fit_quotient(x, stiffness, weight / weight.max())
    if quotient is None:
        return None
    (root, a, b, c), inverse = quotient
    # d(root, a, b, c) = inverse d(1 / G).
    slopes = -(inverse * stiffness**2) / scale
    pole = middle + width * root
    damping = pole.imag / abs(pole)
    frequency_weights = slopes[0] * width / pole
    # Im(r dG) is the real part of -i r dG.
    damping_weights = -1j * frequency_weights * np.sqrt(1.0 - damping**2) / damping
    # The stiffness at the damped natural frequency is -i Im(root) / denominator; this frequency changes with the pole.
    at = root.real
    denominator = a + b * at + c * at * at
    direct = (slopes[1] + slopes[2] * at + slopes[3] * at * at) / denominator
    through_pole = ((b + 2.0 * c * at) / denominator).real * slopes[0] + 1j * slopes[0] / root.imag
    values = float(abs(pole)), float(damping), float(root.imag / (abs(denominator) * scale))
    return values, np.stack([frequency_weights, damping_weights, -(direct + through_pole)])


def _fit_quotient(
    x: NDArray[np.float64], stiffness: NDArray[np.complex128], weight: NDArray[np.float64]
) -> tuple[NDArray[np.complex128], NDArray[np.complex128]] | None:
    """Fit p, a, b, c of (x - p) / (a + b x + c x^2) to the lines; return them and their derivatives `(4, m)`."""
    parabola = np.linalg.lstsq(np.vander(x, 3) * weight[:, None], stiffness * weight, rcond=None)[0]
    roots = np.roots(parabola)
    root = roots[np.argmin(np.abs(roots))]
    constant = np.sum(weight**2 * stiffness.conj() * (x - root)) / np.sum((weight * np.abs(stiffness)) ** 2)
    values = np.array([root, constant, 0.0, 0.0], dtype=np.complex128)
    inverse = np.zeros((4, x.size), np.complex128)
    for _ in range(_ITERATIONS):
        denominator = values[1] + x * (values[2] + x * values[3])
        model = (x - values[0]) / denominator
        slope = -np.stack([np.ones_like(model), model, model * x, model * x * x], axis=1) / denominator[:, None]
        q, r = np.linalg.qr(slope * weight[:, None])
        if not np.abs(np.diag(r)).min() > 1e-14 * np.abs(np.diag(r)).max():
            return None
        inverse = np.asarray(np.linalg.solve(r, q.conj().T) * weight)
        step = inverse @ (stiffness - model)
        values = values + step
        if not (np.isfinite(values).all() and abs(values[0]) < 4.0):
            return None
        if np.abs(step).max() < _TOLERANCE * np.abs(values).max():
            break
    return (values, inverse) if values[0].imag > 0.0 and abs(values[0].real) <= 1.0 else None
