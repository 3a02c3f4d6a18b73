"""Truncated records: the time at which they end, from their lines alone."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from receptance.diagnosis.thresholds import (
    TRUNCATION_FROM,
    TRUNCATION_POINTS,
    TRUNCATION_STEP,
    TRUNCATION_WINDOW,
    UNEVEN_LINES,
)
from receptance.fit.observation import Observation

ALL_RECORDS = ""
"""Key of all records together among the ends of records."""


def record_ends(records: Sequence[Observation]) -> dict[str, float]:
    """Return the times in s after the hit at which records were truncated, where their lines show it.

    They are those of each record by its label, and that of all together under `ALL_RECORDS`.
    """
    groups = {ALL_RECORDS: tuple(records), **{record.label: (record,) for record in records if record.label}}
    ends = {name: _truncation_time(members) for name, members in groups.items()}
    return {name: end for name, end in ends.items() if end is not None}


def _truncation_time(records: Sequence[Observation]) -> float | None:
    """Return the time in s after the hit at which records were truncated; None where they do not show it.

    The lines of a record of the length T are multiples of 1 / T, and the corresponding response covers one period T.
    A truncated record rings up to its end and is silent from there on.
    """
    # A stepped sine has no end.
    known = [(record, power) for record in records if record.force is None and (power := _power(record)) is not None]
    found = [power for _, power in known]
    periods = [period for period, _ in found]
    if not found or max(periods) > (1.0 + 1e-6) * min(periods):
        return None
    first = int(TRUNCATION_FROM * TRUNCATION_POINTS)
    # Each record is normalised by its late power.
    power = np.sum([one / np.mean(one[first:]) for _, one in found], axis=0)
    width = int(TRUNCATION_WINDOW * TRUNCATION_POINTS)
    largest, at = 0.0, 0
    for i in range(first, TRUNCATION_POINTS - 4):
        before, after = np.mean(power[i - width : i]), np.mean(power[i : min(i + width, TRUNCATION_POINTS - 2)])
        # The ordinary decay over one window is not part of the step.
        decay = max(float(np.mean(power[i - 2 * width : i - width]) / before), 1.0)
        step = float(before / after) / decay
        if step > largest:
            largest, at = step, i
    # The power of few records varies more: every eighth record without an end has a step of 2.5 by chance.
    if largest <= TRUNCATION_STEP ** max(2.0 / math.sqrt(len(found)), 1.0):
        return None
    # The window over the band spreads the response by 2 / band, so that it seems to end that much later. A fit that
    # starts late ends in another optimum: over a period of a mode the phase of its end turns once.
    spread = 2.0 / min(float(np.ptp(one.frequency_hz.real)) for one, _ in known)
    return at / TRUNCATION_POINTS * periods[0] - spread


def _power(observation: Observation) -> tuple[float, NDArray[np.float64]] | None:
    """Return the period of the lines in s, and the power of the acceleration after a unit impulse along it."""
    lines = observation.frequency_hz.real
    if lines.size < 3:
        return None
    numbers = lines / float(np.min(np.diff(lines)))
    spacing = float(np.polyfit(np.round(numbers), lines, 1)[0])
    numbers = np.round(lines / spacing)
    if np.max(np.abs(lines / spacing - numbers)) > UNEVEN_LINES:
        return None
    every = np.arange(numbers[0], numbers[-1] + 1)
    angular = 2j * np.pi * observation.frequency_hz
    accelerance = np.interp(every, numbers, observation.receptance * angular**2)
    # A window over the band keeps the hit at time zero from ringing over the whole period.
    accelerance = accelerance * np.hanning(every.size)
    size = 8 * TRUNCATION_POINTS * (1 + int(every[-1]) // (4 * TRUNCATION_POINTS))
    spectrum = np.zeros(size // 2 + 1, dtype=np.complex128)
    spectrum[every.astype(int)] = accelerance
    signal = np.fft.irfft(spectrum, size) ** 2
    return 1.0 / spacing, signal.reshape(TRUNCATION_POINTS, -1).mean(axis=1)
