"""Systematic errors of estimated FRFs: noise on the force, truncated responses, and force outside the force window."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from receptance.measurement.windows import Windows

_MAX_SAMPLES = 1024
"""Most samples of a transformed stretch of silence; enough to resolve hum."""
_MIN_SAMPLES = 16
"""Least samples of a stretch of silence."""
_MIN_STRETCHES = 8
"""Least number of stretches for an estimate of the noise."""
_PADDING = 4
"""Lines of the noise spectrum per independent line, for linear interpolation between them."""


def force_noise_power(
    force: NDArray[np.float64], windows: Windows, frequency_hz: NDArray[np.float64], sample_rate_hz: float
) -> NDArray[np.float64] | None:
    """Return the power |M|^2 of the noise in the force spectrum, per unit of the window energy sum w^2.

    Stretches of silence of the length of the force window are transformed through it, so that coloured noise is spread
    over the lines as in the spectra. The median over the stretches excludes bounces. Noise that occurs only during the
    contact is not included.

    Parameters
    ----------
    force : ndarray
        `(n_hits, n_samples)` without offset and windows.
    windows : Windows
        Windows of the force.
    frequency_hz : ndarray
        `(n_lines,)` in Hz.
    sample_rate_hz : float
        Samples per second.

    Returns
    -------
    ndarray or None
        `(n_lines,)`; None if there is too little silence, or exact zeros from a force window of the recorder.
    """
    from scipy.fft import next_fast_len, rfft, rfftfreq
    from scipy.signal.windows import hann

    stretches = [row[part] for row, parts in zip(force, windows.silence, strict=True) for part in parts]
    longest = max((stretch.size for stretch in stretches), default=0)
    length = min(windows.force_window.size or _MAX_SAMPLES, _MAX_SAMPLES, max(longest, 1))
    pieces = [
        stretch[begin : begin + length]
        for stretch in stretches
        for begin in range(0, stretch.size - length + 1, max(1, length // 2))
    ]
    if length < _MIN_SAMPLES or len(pieces) < _MIN_STRETCHES or not np.any(pieces):
        return None
    shape = windows.force_window if windows.force_window.size == length else hann(length, sym=False)
    n_fft = next_fast_len(_PADDING * length, real=True)
    powers = np.abs(rfft(np.array(pieces) * shape, n_fft, axis=1)) ** 2 / np.sum(shape**2)
    # |M|^2 of Gaussian noise is exponentially distributed, with the median ln 2.
    power = np.median(powers, axis=0) / np.log(2.0)
    return np.asarray(np.interp(frequency_hz, rfftfreq(n_fft, 1.0 / sample_rate_hz), power))


_PARTS = 8
"""Number of parts of a block in which amplitudes are estimated."""
_CHANCE = 1e-4
"""Accepted probability that noise passes for a repeated signal."""
_SMOOTHED_LINES = 17
"""Lines averaged for the force outside the window."""
_NOISE_MARGIN = 1.5
"""Factor by which noise may exceed its estimate from the silence."""
_WEAK_DB = 40.0
"""Level of the force spectrum below its largest under which lines are not evaluated."""


@dataclass(frozen=True)
class Truncation:
    """Truncation of a response at the end of its block, `(n_lines,)` over all lines of the transform.

    `share` is the amplitude at the end relative to that at the beginning, `error` the resulting error of the FRF in its
    unit. Both are 0 where the signal is noise.
    """

    share: NDArray[np.float64]
    error: NDArray[np.float64]


def estimate_truncation(
    response: NDArray[np.float64], spectra: NDArray[np.complex128], first: int, onset: int
) -> Truncation:
    """Return the amplitude of a response at the end of its block, and the error of the FRF from its truncation.

    A block of length T truncates the response. For a mode at w_m the truncated part is A(T) / (i (w - w_m) + a), with A
    the amplitude. Relative to the mode it is A(T) / A(0), but it may exceed the FRF far from w_m, where that is small.
    Amplitudes are estimated at the beginning and in the middle of the block, where they exceed the noise, and
    extrapolated to the end.

    Parameters
    ----------
    response : ndarray
        `(n_hits, n_samples)` after the windows.
    spectra : ndarray
        `(n_hits, n_samples // 2 + 1)` of the windowed force.
    first : int
        First sample after all contacts.
    onset : int
        Sample at which the contacts begin.
    """
    from scipy.fft import irfft, rfft
    from scipy.signal.windows import hann

    hits, n_samples = response.shape
    length = (n_samples - first) // _PARTS
    zero = np.zeros(spectra.shape[1])
    if hits < 2 or length < 2 * _PARTS:
        return Truncation(zero, zero)
    window = hann(length, sym=False)
    middle = (first + n_samples) // 2
    gains = []
    for begin in (first, middle - length // 4):
        part = np.zeros_like(response)
        part[:, begin : begin + length] = response[:, begin : begin + length] * window
        gains.append(_coherent_part(rfft(part, axis=1), spectra))
    power = np.sum(np.abs(spectra) ** 2, axis=0)
    exceeds = gains[1].clear & (power > power.max() * 10.0 ** (-_WEAK_DB / 10.0))
    halfway = np.where(exceeds, np.abs(gains[1].value) / np.maximum(np.abs(gains[0].value), 1e-300), 0.0)
    halfway = np.minimum(halfway, 1.0)
    # The truncated part has the shape of the second half of the middle part, with the amplitude of the end.
    end_response = irfft(gains[1].value * halfway, n_samples)
    step = np.zeros(n_samples)
    centre = middle - length // 4 + length // 2 - onset
    step[centre : centre + length // 2] = 1.0
    return Truncation(halfway**2, np.abs(rfft(end_response * step)))


def force_outside_window(
    unwindowed: NDArray[np.complex128], spectra: NDArray[np.complex128], noise: NDArray[np.float64], correlated: float
) -> NDArray[np.float64]:
    """Return the force removed by the force window relative to the rest, `(n_lines,)`; 0 where it is noise.

    A bounce or the ringing of a sensor has a broad spectrum, so neighbouring lines are averaged.

    Parameters
    ----------
    unwindowed, spectra : ndarray
        `(n_hits, n_lines)` of the force without and with its window.
    noise : ndarray
        `(n_lines,)` power of the noise in the removed part.
    correlated : float
        Number of neighbouring lines per independent value of that noise.
    """
    from scipy.special import chdtri

    hits, n_lines = spectra.shape
    width = min(_SMOOTHED_LINES, n_lines)
    count = np.convolve(np.ones(n_lines), np.ones(width), "same")
    power, removed, expected = (
        np.convolve(values, np.ones(width), "same") / count
        for values in (np.mean(np.abs(spectra) ** 2, axis=0), np.mean(np.abs(unwindowed - spectra) ** 2, axis=0), noise)
    )
    freedom = 2.0 * hits * max(1.0, width / correlated)
    clear = removed > _NOISE_MARGIN * chdtri(freedom, _CHANCE) / freedom * expected
    return np.where(clear, np.sqrt(np.maximum(removed - expected, 0.0) / power), 0.0)


@dataclass(frozen=True)
class _Gain:
    """FRF from the force to a part of a signal, its noise variance, and the lines on which it exceeds the noise."""

    value: NDArray[np.complex128]
    noise: NDArray[np.float64]
    clear: NDArray[np.bool_]


def _coherent_part(part: NDArray[np.complex128], spectra: NDArray[np.complex128]) -> _Gain:
    """Regress a part of a signal on the force; only repeated signals are coherent with it."""
    from scipy.special import fdtri

    hits = len(part)
    power = np.maximum(np.sum(np.abs(spectra) ** 2, axis=0), 1e-300)
    gain = np.sum(np.conj(spectra) * part, axis=0) / power
    noise = np.sum(np.abs(part - gain * spectra) ** 2, axis=0) / (hits - 1) / power
    clear = np.abs(gain) ** 2 > fdtri(2.0, 2.0 * (hits - 1), 1.0 - _CHANCE) * noise
    return _Gain(gain, noise, clear)
