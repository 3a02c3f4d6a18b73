"""Peaks of a measured and of a predicted response, side by side."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance.identification.spread import says_nothing

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Peak", "match_peaks"]

_PROMINENCE = 1.0
"""How far a peak stands above its surroundings, as natural logarithm."""
_FAR = 0.1
"""Peaks further apart than this share of their frequency are not the same."""


_STANDS_OUT = 8.0
"""Standard deviations of the lines around it that a measured peak has to stand above them. In 600 simulated responses
that end in noise, 2 peaks of noise passed with 8, 21 with 6; none of 900 true peaks was lost."""
_AROUND = 15
"""Lines to either side that the scatter from line to line is taken over."""
_QUARTILE = 0.6745
"""Median of the absolute value of a standard normal number."""


@dataclass(frozen=True, kw_only=True)
class Peak:
    """A peak of a measured response and the predicted one that belongs to it.

    Attributes
    ----------
    measured_hz, predicted_hz : float or None
        None where only the other has one.
    measured_deviation_hz : float
        Standard deviation of the measured one from the noise of the lines around it; 0 where that is not known.
    deviation_hz : float or None
        Standard deviation of the prediction.
    """

    measured_hz: float | None
    predicted_hz: float | None
    measured_deviation_hz: float = 0.0
    deviation_hz: float | None = None

    @property
    def matched(self) -> bool:
        """Whether both have it."""
        return self.measured_hz is not None and self.predicted_hz is not None

    @property
    def error_percent(self) -> float:
        """Predicted against measured; not a number where one of them has none."""
        if self.measured_hz is None or self.predicted_hz is None:
            return float("nan")
        return 100.0 * (self.predicted_hz / self.measured_hz - 1.0)

    def within(self, reach: float) -> bool | None:
        """Return whether the measured peak is where prediction and noise let it be.

        None where nothing is compared, or where the interval of the prediction is too wide to say anything.
        """
        if self.measured_hz is None or self.predicted_hz is None or self.deviation_hz is None:
            return None
        if says_nothing(self.predicted_hz, reach * self.deviation_hz):
            return None
        spread = float(np.hypot(self.deviation_hz, self.measured_deviation_hz))
        return abs(self.predicted_hz - self.measured_hz) <= reach * spread

    def with_deviation(self, deviation_hz: float | None) -> Peak:
        """Return the same with a standard deviation of the prediction."""
        return replace(self, deviation_hz=deviation_hz)


def match_peaks(
    frequency_hz: NDArray[Any],
    measured: NDArray[np.complex128],
    predicted: NDArray[np.complex128],
    noise: NDArray[np.float64] | None = None,
) -> list[Peak]:
    """Return the peaks of two responses on the same lines, side by side in order of frequency.

    Both are found in the same way, so what the spacing of the lines does to them is the same. `noise` is the standard
    deviation of the logarithm of the measured magnitude. A measured peak that does not stand out of the noise, the
    given one or the scatter from line to line, is none.
    """
    lines = frequency_hz.real
    given = np.zeros(lines.size) if noise is None else noise
    theirs = _peaks(lines, measured, given, np.maximum(given, _scatter(measured)))
    nothing = np.zeros(lines.size)
    free = [place for place, _ in _peaks(lines, predicted, nothing, nothing)]
    places = [place for place, _ in theirs]
    found: list[Peak] = []
    for measured_hz, deviation_hz in theirs:
        near = min(free, key=lambda f: abs(f - measured_hz), default=None)
        # A measured peak that is nearer has the better claim.
        if near is None or abs(near / measured_hz - 1.0) > _FAR or _nearest(places, near) != measured_hz:
            near = None
        else:
            free.remove(near)
        found.append(Peak(measured_hz=measured_hz, predicted_hz=near, measured_deviation_hz=deviation_hz))
    found += [Peak(measured_hz=None, predicted_hz=f) for f in free]
    return sorted(found, key=lambda peak: peak.measured_hz or peak.predicted_hz or 0.0)


def _nearest(places: list[float], wanted: float) -> float:
    return min(places, key=lambda place: abs(place - wanted))


def _scatter(values: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Return the standard deviation of the logarithm of the magnitude from line to line, over the lines around each."""
    if values.size < 2 * _AROUND + 3:
        return np.zeros(values.size)
    # The second difference of white noise has a variance of six times that of the noise; a few sharp peaks and
    # antiresonances do not move the median.
    bend = np.abs(np.diff(np.log(np.abs(values)), 2))
    found: NDArray[np.float64] = _running_median(np.pad(bend, 1, "edge"), _AROUND) / (_QUARTILE * np.sqrt(6.0))
    return found


def _running_median(values: NDArray[np.float64], reach: int) -> NDArray[np.float64]:
    """Return the median of each value and of so many to either side."""
    windows = np.lib.stride_tricks.sliding_window_view(np.pad(values, reach, "edge"), 2 * reach + 1)
    found: NDArray[np.float64] = np.median(windows, axis=1)
    return found


def _peaks(
    lines: NDArray[np.float64],
    values: NDArray[np.complex128],
    noise: NDArray[np.float64],
    scatter: NDArray[np.float64],
) -> list[tuple[float, float]]:
    """Return where the magnitude peaks and how well that is known, from parabolas through three lines in logarithms."""
    from scipy.signal import find_peaks, peak_prominences  # slow to import

    level = np.log(np.abs(values))
    found, _ = find_peaks(level, prominence=_PROMINENCE)
    if scatter.any() and found.size:
        # Between two lines that noise has made small, any line stands out: what counts is the level around them.
        around = _running_median(level, 2)
        around[found] = level[found]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # one that does not stand out at all
            height, _, _ = peak_prominences(around, found)
        found = found[height > np.maximum(_PROMINENCE, _STANDS_OUT * scatter[found])]
    places = []
    for index in found:
        near = slice(index - 1, index + 2)
        x = lines[near] - lines[index]
        # The parabola's coefficients are linear in the three levels, its vertex -b / 2a is so to first order.
        solve = np.linalg.inv(np.vander(x, 3))
        a, b, _ = solve @ level[near]
        weights = -solve[1] / (2.0 * a) + solve[0] * b / (2.0 * a * a)
        shift = float(np.clip(-b / (2.0 * a), x[0], x[2]))
        places.append((float(lines[index]) + shift, float(np.linalg.norm(weights * noise[near]))))
    return places
