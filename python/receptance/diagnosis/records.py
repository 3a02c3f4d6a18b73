"""Whether records broke off while the structure still rang, as far as the measured lines show it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from receptance.identification.observations import MeasuredFRF

__all__ = ["visible_end"]

_STEP = 2.5
"""A ringing has broken off where it is so many times stronger (in power) before than after."""
_WINDOW = 0.05
"""Length of the stretches that are compared, as a share of the period."""
_FIRST = 0.3
_POINTS = 400
_UNEVEN = 0.02


def visible_end(records: Sequence[MeasuredFRF]) -> float | None:
    """Return the time after the hit at which records broke off, None where none is seen to.

    The lines of a record of the length T are multiples of 1 / T, and the response that belongs to them goes over one
    such period. Where the record ended too early it rings up to the end and is silent from there on.
    """
    found = [one for one in map(_power, records) if one is not None]
    periods = [period for period, _ in found]
    if not found or max(periods) > (1.0 + 1e-6) * min(periods):
        return None
    # Each counts by what it does late.
    power = np.sum([one / np.mean(one[int(_FIRST * _POINTS) :]) for _, one in found], axis=0)
    width = int(_WINDOW * _POINTS)
    best, at = 0.0, 0
    for i in range(int(_FIRST * _POINTS), _POINTS - 4):
        before, after = np.mean(power[i - width : i]), np.mean(power[i : min(i + width, _POINTS - 2)])
        # What it would have lost in any case is no end.
        decay = max(float(np.mean(power[i - 2 * width : i - width]) / before), 1.0)
        step = float(before / after) / decay
        if step > best:
            best, at = step, i
    return at / _POINTS * periods[0] if best > _STEP else None


def _power(one: MeasuredFRF) -> tuple[float, NDArray[np.float64]] | None:
    """Return the period that the lines have, and the power of the acceleration after a unit impulse along it."""
    lines = one.frequency_hz.real
    if lines.size < 3:
        return None
    numbers = lines / float(np.min(np.diff(lines)))
    spacing = float(np.polyfit(np.round(numbers), lines, 1)[0])
    numbers = np.round(lines / spacing)
    if np.max(np.abs(lines / spacing - numbers)) > _UNEVEN:
        return None
    every = np.arange(numbers[0], numbers[-1] + 1)
    angular = 2j * np.pi * one.frequency_hz
    accelerance = np.interp(every, numbers, one.receptance * angular**2)
    # Faded out to both sides, so that the hit at zero does not ring over the whole period.
    accelerance = accelerance * np.hanning(every.size)
    size = 8 * _POINTS * (1 + int(every[-1]) // (4 * _POINTS))
    spectrum = np.zeros(size // 2 + 1, dtype=np.complex128)
    spectrum[every.astype(int)] = accelerance
    signal = np.fft.irfft(spectrum, size) ** 2
    return 1.0 / spacing, signal.reshape(_POINTS, -1).mean(axis=1)
