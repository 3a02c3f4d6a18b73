"""Comparison of the hits of a test with each other: a hit with another sign, gain or cable stands out.

Every hit gives an FRF of its own, X_i / F_i. On lines where the hits agree, the ratio of a hit's FRF to the median over
all hits is 1 but for noise, whatever the strength of the hit. Its median over the lines is robust against resonances
that shift with the force, and the median over hits against a minority of bad ones.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

_FORCE_DROP = 0.1
"""Least force on a compared line, relative to the largest of the spectrum."""
_AGREEMENT = 0.5
"""Median deviation of the hits on a compared line, relative to the median FRF."""
_LEAST_LINES = 8
"""Least number of compared lines."""
_GAIN = 0.25
"""Least relative deviation of a hit's gain; hits some millimetres beside the place differ by less."""
_SPREAD = 6.0
"""Least deviation of a hit's gain (logarithm) in median deviations of all hits."""


class Fault(Enum):
    """How a hit deviates from the others."""

    REVERSED = "reversed"
    GAIN = "gain"
    UNRELATED = "unrelated"


@dataclass(frozen=True)
class HitDeviation:
    """HitDeviation of a hit from the others: the fault, the ratio of FRFs, and the response channel."""

    fault: Fault
    gain: float
    channel: int


def deviating_hits(force: NDArray[np.float64], response: NDArray[np.float64]) -> dict[int, HitDeviation]:
    """Return the hits that deviate from the majority, by index.

    Parameters
    ----------
    force : ndarray
        `(n_hits, n_samples)` blocks of the force, without offset.
    response : ndarray
        `(n_hits, n_samples, n_channels)` blocks of the response.

    Returns
    -------
    dict
        Empty if all hits agree, if there are fewer than two, or if no majority agrees. Of two hits that contradict each
        other both are returned.
    """
    if len(force) < 2:
        return {}
    spectra = np.fft.rfft(force, axis=1)
    magnitude = np.abs(spectra)
    lines = np.all(magnitude >= _FORCE_DROP * magnitude.max(axis=1, keepdims=True), axis=0)
    lines[0] = False
    deviations: dict[int, HitDeviation] = {}
    for channel in range(response.shape[2]):
        frfs = np.fft.rfft(response[:, :, channel], axis=1)[:, lines] / spectra[:, lines]
        for hit, (fault, gain) in _deviating_frfs(frfs).items():
            deviations.setdefault(hit, HitDeviation(fault, gain, channel))
    return deviations if len(force) == 2 or 2 * len(deviations) < len(force) else {}


def _deviating_frfs(frfs: NDArray[np.complex128]) -> dict[int, tuple[Fault, float]]:
    """Return fault and ratio of the FRFs `(n_hits, n_lines)` that deviate from the median."""
    pair = len(frfs) == 2
    # Of two hits there is no median: the first stands for it.
    reference = frfs[0] if pair else np.median(frfs.real, axis=0) + 1j * np.median(frfs.imag, axis=0)
    compared = reference != 0.0
    if not pair:
        compared &= np.median(np.abs(frfs - reference), axis=0) < _AGREEMENT * np.abs(reference)
    if np.count_nonzero(compared) < _LEAST_LINES:
        return {}
    ratios = frfs[:, compared] / reference[compared]
    # Medians of both parts: noise on a weak hit increases the magnitudes, not these.
    gains = np.median(ratios.real, axis=1) + 1j * np.median(ratios.imag, axis=1)
    levels = np.log(np.maximum(np.abs(gains), np.finfo(float).tiny))
    largest = max(np.log1p(_GAIN), 0.0 if pair else _SPREAD * float(np.median(np.abs(levels - np.median(levels)))))
    faults: dict[int, tuple[Fault, float]] = {}
    for hit, (ratio, level) in enumerate(zip(ratios, levels, strict=True)):
        # Phases of a response that does not belong to the force are spread evenly.
        direction = float(np.abs(np.mean(ratio / np.maximum(np.abs(ratio), np.finfo(float).tiny))))
        if direction < _AGREEMENT:
            if not pair:
                faults[hit] = (Fault.UNRELATED, float(np.exp(level)))
        elif gains[hit].real < 0.0:
            faults[hit] = (Fault.REVERSED, float(-np.exp(level)))
        elif abs(level) > largest:
            faults[hit] = (Fault.GAIN, float(np.exp(level)))
    return dict.fromkeys((0, 1), faults[1]) if pair and faults else faults
