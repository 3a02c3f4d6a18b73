"""Local maxima and their prominences.

They are those of `scipy.signal.find_peaks`. Importing `scipy.signal` takes longer than a typical fit.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray


def local_maxima(values: NDArray[np.float64], prominence: float = 0.0) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Return the indices of the local maxima with at least a prominence, and their prominences.

    A maximum of several equal values is at their middle, rounded down. The first and the last value are no maxima.
    """
    first = np.concatenate([[0], np.flatnonzero(np.diff(values)) + 1])
    last = np.append(first[1:], values.size) - 1
    level = values[first]
    at = np.flatnonzero((level[1:-1] > level[:-2]) & (level[1:-1] > level[2:])) + 1
    places = (first[at] + last[at]) // 2
    if not places.size:
        return places, np.empty(0)
    heights = values[places].tolist()
    between = np.minimum.reduceat(values, np.concatenate([[0], places])).tolist()
    left = _bases(heights, between[:-1])
    right = _bases(heights[::-1], between[:0:-1])[::-1]
    prominences = np.array(heights) - np.maximum(left, right)
    kept = prominences >= prominence
    return places[kept], prominences[kept]


def nearest_peak(frequency_hz: NDArray[np.float64], peaks_hz: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return for each frequency the number of the nearest peak.

    Peaks are in ascending order; a frequency in the middle between two belongs to the upper one.
    """
    return np.searchsorted(0.5 * (peaks_hz[1:] + peaks_hz[:-1]), frequency_hz, side="right")


def _bases(heights: Iterable[float], between: Iterable[float]) -> list[float]:
    """Return the lowest value between each maximum and the next higher one before it.

    `between` are the lowest values from one maximum to the next, the first one from the beginning.
    """
    bases: list[float] = []
    higher: list[tuple[float, float]] = []
    for height, lowest in zip(heights, between, strict=True):
        while higher and higher[-1][0] <= height:
            lowest = min(lowest, higher.pop()[1])
        higher.append((height, lowest))
        bases.append(lowest)
    return bases
