"""What blocks and windows cut off: responses that have not died away, force outside the force's window."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["LeftOver", "cut_off", "left_over"]

_PARTS = 8
"""The block is looked at in parts of this share."""
_CHANCE = 1e-4
"""Of taking noise for something that repeats."""
_TOGETHER = 17
"""Lines that are looked at together for what the force's window cuts off."""
_UNSURE = 1.5
"""How far noise may be above what the silence says."""
_WEAK_DB = 40.0
"""Below its largest the force's spectrum tells nothing of what the structure does."""


@dataclass(frozen=True)
class LeftOver:
    """What is left of a response when its block ends, `(n_lines,)` over all lines of the transform.

    `share` is the amplitude over that at the beginning, frequency by frequency; `error` the error of the FRF that the
    end of the block causes, in the FRF's unit. Both are 0 where all is noise.
    """

    share: NDArray[np.float64]
    error: NDArray[np.float64]


def left_over(response: NDArray[np.float64], spectra: NDArray[np.complex128], first: int, onset: int) -> LeftOver:
    """Return what is left of a response at the end of its block, and the error that this makes.

    A block that ends at T leaves out the rest of the response. For a mode at w_m that is A(T) / (i (w - w_m) + a), A
    its amplitude at T: as a share of the mode just A(T) / A(0), but far from w_m, where the FRF itself may be small, a
    larger one. Amplitudes are seen half-way, where they stand out of the noise, in a part of the block and at its
    beginning, frequency by frequency; their ratio leads on to the end.

    Parameters
    ----------
    response : ndarray
        `(n_hits, n_samples)` after the windows.
    spectra : ndarray
        `(n_hits, n_samples // 2 + 1)` of the windowed force.
    first : int
        Sample from which on all hits are over.
    onset : int
        Sample at which they begin.
    """
    from scipy.fft import irfft, rfft
    from scipy.signal.windows import hann

    hits, n_samples = response.shape
    length = (n_samples - first) // _PARTS
    nothing = np.zeros(spectra.shape[1])
    if hits < 2 or length < 2 * _PARTS:
        return LeftOver(nothing, nothing)
    window = hann(length, sym=False)
    middle = (first + n_samples) // 2
    gains = []
    for begin in (first, middle - length // 4):
        part = np.zeros_like(response)
        part[:, begin : begin + length] = response[:, begin : begin + length] * window
        gains.append(_repeated(rfft(part, axis=1), spectra))
    power = np.sum(np.abs(spectra) ** 2, axis=0)
    seen = gains[1].clear & (power > power.max() * 10.0 ** (-_WEAK_DB / 10.0))
    halfway = np.where(seen, np.abs(gains[1].value) / np.maximum(np.abs(gains[0].value), 1e-300), 0.0)
    halfway = np.minimum(halfway, 1.0)
    # What goes on beyond the end looks as what was seen half-way does from its middle on, with the end's amplitude.
    rest = irfft(gains[1].value * halfway, n_samples)
    step = np.zeros(n_samples)
    centre = middle - length // 4 + length // 2 - onset
    step[centre : centre + length // 2] = 1.0
    return LeftOver(halfway**2, np.abs(rfft(rest * step)))


def cut_off(
    whole: NDArray[np.complex128], spectra: NDArray[np.complex128], noise: NDArray[np.float64], alike: float
) -> NDArray[np.float64]:
    """Return what the force's window takes away over what it leaves, `(n_lines,)`; 0 where it is noise.

    A bounce or the ringing of a sensor has a broad spectrum, so neighbouring lines are looked at together.

    Parameters
    ----------
    whole, spectra : ndarray
        `(n_hits, n_lines)` of the force without and with its window.
    noise : ndarray
        `(n_lines,)` power of the noise in what is taken away.
    alike : float
        How many neighbouring lines share one independent value of that noise.
    """
    from scipy.special import chdtri

    hits, n_lines = spectra.shape
    width = min(_TOGETHER, n_lines)
    count = np.convolve(np.ones(n_lines), np.ones(width), "same")
    power, taken, expected = (
        np.convolve(values, np.ones(width), "same") / count
        for values in (np.mean(np.abs(spectra) ** 2, axis=0), np.mean(np.abs(whole - spectra) ** 2, axis=0), noise)
    )
    freedom = 2.0 * hits * max(1.0, width / alike)
    clear = taken > _UNSURE * chdtri(freedom, _CHANCE) / freedom * expected
    return np.where(clear, np.sqrt(np.maximum(taken - expected, 0.0) / power), 0.0)


@dataclass(frozen=True)
class _Gain:
    """An FRF from the force to some part of a signal, the variance of noise in it, and where it stands out of that."""

    value: NDArray[np.complex128]
    noise: NDArray[np.float64]
    clear: NDArray[np.bool_]


def _repeated(part: NDArray[np.complex128], spectra: NDArray[np.complex128]) -> _Gain:
    """Regress a part on the force, as an FRF: only what repeats from hit to hit is something that was cut off."""
    from scipy.special import fdtri

    hits = len(part)
    power = np.maximum(np.sum(np.abs(spectra) ** 2, axis=0), 1e-300)
    gain = np.sum(np.conj(spectra) * part, axis=0) / power
    noise = np.sum(np.abs(part - gain * spectra) ** 2, axis=0) / (hits - 1) / power
    clear = np.abs(gain) ** 2 > fdtri(2.0, 2.0 * (hits - 1), 1.0 - _CHANCE) * noise
    return _Gain(gain, noise, clear)
