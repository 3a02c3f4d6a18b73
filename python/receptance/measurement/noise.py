"""Noise on the force, from the time in which no hammer touches."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.measurement.windows import Windows

__all__ = ["force_noise"]

_LONGEST = 1024
"""Samples of a stretch of noise that is transformed; enough to see hum beside a pulse."""
_SHORTEST = 16
_LEAST_STRETCHES = 8
"""Fewer stretches do not say how strong the noise is."""
_PADDING = 4
"""Lines of the noise's spectrum per independent one, so that straight lines between them are good enough."""


def force_noise(
    force: NDArray[np.float64], windows: Windows, frequency_hz: NDArray[np.float64], sample_rate_hz: float
) -> NDArray[np.float64] | None:
    """Return the power |M|^2 of the noise in the force's spectrum, per unit of the windows' energy sum w^2.

    Stretches of silence are cut to the length of the force's window and go through it as the pulse does, so that noise
    of any colour is spread over the lines as it is there. A median over the stretches keeps a bounce out. Nothing is
    known of noise that comes with the contact.

    Parameters
    ----------
    force : ndarray
        `(n_hits, n_samples)` without offset and windows.
    windows : Windows
        What the force goes through.
    frequency_hz : ndarray
        `(n_lines,)` in Hz.
    sample_rate_hz : float
        Samples per second.

    Returns
    -------
    ndarray or None
        `(n_lines,)`; None where there is too little silence, or where it is exactly zero: a window that the recorder
        has applied.
    """
    from scipy.fft import next_fast_len, rfft, rfftfreq
    from scipy.signal.windows import hann

    stretches = [row[part] for row, parts in zip(force, windows.silent, strict=True) for part in parts]
    longest = max((stretch.size for stretch in stretches), default=0)
    length = min(windows.shape.size or _LONGEST, _LONGEST, max(longest, 1))
    pieces = [
        stretch[begin : begin + length]
        for stretch in stretches
        for begin in range(0, stretch.size - length + 1, max(1, length // 2))
    ]
    if length < _SHORTEST or len(pieces) < _LEAST_STRETCHES or not np.any(pieces):
        return None
    shape = windows.shape if windows.shape.size == length else hann(length, sym=False)
    n_fft = next_fast_len(_PADDING * length, real=True)
    powers = np.abs(rfft(np.array(pieces) * shape, n_fft, axis=1)) ** 2 / np.sum(shape**2)
    # |M|^2 of Gaussian noise is exponentially distributed.
    power = np.median(powers, axis=0) / np.log(2.0)
    found: NDArray[np.float64] = np.interp(frequency_hz, rfftfreq(n_fft, 1.0 / sample_rate_hz), power)
    return found
