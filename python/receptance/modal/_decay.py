"""The complex amplitude of one band of a record, and its course within a block of time."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

TAPS_PER_WIDTH = 4.0
"""Length of the filter times the width of the band: half of the amplitude passes at its ends, none a width further."""
PER_BLOCK = 8.0
"""Shortest block times the width of the band, so that a quadratic leaves something to tell the scatter from."""
_SAMPLES_PER_WIDTH = 3.0
_SHAPE = 8.0
"""Of the Kaiser window: 80 dB."""


@dataclass(frozen=True)
class Demodulated:
    """Complex amplitude z(t) of a band: the record is Re z exp(2 pi i middle t) as far as it lies in the band.

    Attributes
    ----------
    time_s : ndarray
        `(k,)` evenly spaced.
    log : ndarray
        `(k,)` complex log z, the phase without jumps.
    middle_hz, width_hz : float
        Of the band.
    taps : ndarray
        The filter.
    sample_rate_hz : float
        Of the record.
    correlation : ndarray
        What the filter makes of white noise: correlation at 0, 1, 2, ... steps of `time_s`.
    """

    time_s: NDArray[np.float64]
    log: NDArray[np.complex128]
    middle_hz: float
    width_hz: float
    taps: NDArray[np.float64]
    sample_rate_hz: float
    correlation: NDArray[np.float64]

    def until(self, count: int) -> Demodulated:
        """Return the first samples alone."""
        return replace(self, time_s=self.time_s[:count], log=self.log[:count])

    def log_gain(self, slope: complex) -> complex:
        """Log of what the filter makes of exp(slope t)."""
        place = np.arange(self.taps.size) - 0.5 * (self.taps.size - 1)
        return complex(np.log(np.sum(self.taps * np.exp(-slope * place / self.sample_rate_hz))))


@dataclass(frozen=True)
class Block:
    """What a block of time says; each standard error below its value."""

    time_s: float
    duration_s: float
    amplitude: float
    amplitude_standard_error: float
    frequency_hz: float
    frequency_standard_error_hz: float
    damping_ratio: float
    damping_standard_error: float
    relative_scatter: float
    degrees_of_freedom: float


def demodulated(
    record: NDArray[np.float64], sample_rate_hz: float, low_hz: float, high_hz: float, start_s: float
) -> Demodulated:
    """Shift a record down by the middle of a band and low-pass it, keeping only what the whole filter has seen."""
    from scipy.signal import firwin, oaconvolve

    middle, width = 0.5 * (low_hz + high_hz), high_hz - low_hz
    half = int(np.ceil(0.5 * TAPS_PER_WIDTH * sample_rate_hz / width))
    taps = firwin(2 * half + 1, 0.5 * width, window=("kaiser", _SHAPE), fs=sample_rate_hz)
    time = start_s + np.arange(record.size) / sample_rate_hz
    shifted = 2.0 * record * np.exp(-2j * np.pi * middle * time)
    step = max(int(sample_rate_hz / (_SAMPLES_PER_WIDTH * width)), 1)
    z = oaconvolve(shifted, taps, mode="valid")[::step]
    # A record of zeros has no logarithm; it has no mode either.
    size = np.maximum(np.abs(z), np.finfo(np.float64).tiny)
    log = np.log(size) + 1j * np.unwrap(np.angle(z))
    correlation = oaconvolve(taps, taps[::-1])[taps.size - 1 :: step]
    return Demodulated(
        time[half : half + shifted.size - 2 * half : step],
        log,
        middle,
        width,
        taps,
        sample_rate_hz,
        correlation / correlation[0],
    )


def blocks_of(signal: Demodulated, count: int) -> list[slice]:
    """Return blocks of equal drop of the amplitude's logarithm, as a cubic smooths it."""
    time = signal.time_s - signal.time_s[0]
    share = time / time[-1]
    smooth = np.polynomial.Polynomial.fit(share, signal.log.real, min(3, share.size - 1))(share)
    falling = np.minimum.accumulate(smooth)
    # Where nothing falls, time itself divides the record.
    course = (falling[0] - falling) + 1e-3 * share
    edges = np.searchsorted(course, np.linspace(0.0, course[-1], count + 1)[1:-1])
    ends = [0, *(int(edge) for edge in edges), time.size]
    return [slice(first, last) for first, last in itertools.pairwise(ends)]


def fit_block(signal: Demodulated, part: slice) -> Block:
    """Fit a quadratic to the log of the complex amplitude, each sample with the weight of its amplitude squared."""
    time, log = signal.time_s[part], signal.log[part]
    size = np.exp(log.real)
    middle = float(np.sum(size**2 * time) / np.sum(size**2))
    reach = 0.5 * float(time[-1] - time[0])
    x = (time - middle) / reach
    q, r = np.linalg.qr(np.stack([np.ones_like(x), x, 0.5 * x**2], axis=1) * size[:, None])
    inside = q.T @ (size * log)
    value, slope = np.linalg.solve(r, inside)[:2]
    slope = complex(slope) / reach
    left = size * log - q @ inside

    step = float(time[1] - time[0])
    turned = signal.correlation * np.cos(slope.imag * step * np.arange(signal.correlation.size))
    spread = _correlated(turned, q)
    seen = q.T @ spread
    free = x.size - float(np.trace(seen))
    variance = float(np.sum(np.abs(left) ** 2)) / (2.0 * free)
    lags = turned[1 : x.size]
    square = x.size + 2.0 * float(np.sum(lags**2 * (x.size - 1 - np.arange(lags.size))))
    square += -2.0 * float(np.sum(spread**2)) + float(np.sum(seen**2))
    back = np.linalg.inv(r)
    covariance = variance * back @ seen @ back.T

    decay, turn = -slope.real, slope.imag + 2.0 * np.pi * signal.middle_hz
    natural = float(np.hypot(decay, turn))
    error = float(np.sqrt(covariance[1, 1])) / reach
    amplitude = float(np.exp(value.real - signal.log_gain(slope).real))
    return Block(
        time_s=middle,
        duration_s=float(time[-1] - time[0]) + step,
        amplitude=amplitude,
        amplitude_standard_error=amplitude * float(np.sqrt(covariance[0, 0])),
        frequency_hz=natural / (2.0 * np.pi),
        frequency_standard_error_hz=error / (2.0 * np.pi),
        damping_ratio=decay / natural,
        damping_standard_error=error / natural,
        relative_scatter=float(np.sqrt(variance) / np.exp(value.real)),
        degrees_of_freedom=2.0 * free**2 / square,
    )


def _correlated(correlation: NDArray[np.float64], columns: NDArray[np.float64]) -> NDArray[np.float64]:
    """Product of the symmetric Toeplitz matrix of a short correlation with some columns."""
    total: NDArray[np.float64] = correlation[0] * columns
    for lag in range(1, min(correlation.size, len(columns))):
        total[lag:] += correlation[lag] * columns[:-lag]
        total[:-lag] += correlation[lag] * columns[lag:]
    return total
