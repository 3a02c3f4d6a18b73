"""Peaks of receptances: bands around them, and measured peaks beside predicted ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from receptance import _checks
from receptance._peaks import local_maxima
from receptance.fit.covariance import NORMAL_QUARTILE, confidence_multiplier, is_uninformative
from receptance.fit.observation import Observation

_PROMINENCE = 1.0
"""Least prominence of a peak, as natural logarithm of the magnitude."""
_MATCH_DISTANCE = 0.1
"""Largest relative distance of a predicted peak from the measured one."""
_NOISE_PROMINENCE = 8.0
"""Least prominence of a measured peak in standard deviations of the lines around it. In 600 simulated responses that
end in noise, 2 peaks of noise passed with 8, 21 with 6; none of 900 true peaks was lost."""
_HALF_WINDOW = 15
"""Lines to either side over which the scatter from line to line is estimated."""

Bands = list[tuple[float, float]]


def find_bands(frf: Observation, *, width_percent: float = 5.0) -> Bands:
    """Find bands around the peaks of a measured receptance.

    Parameters
    ----------
    frf : Observation
        The measurement.
    width_percent : float, optional
        Distance of the ends of a band from its peak, in percent of the peak's frequency.

    Returns
    -------
    list of (float, float)
        Lower and upper end of each band in Hz, ascending; overlapping bands are merged.

    Raises
    ------
    ValueError
        No peak with a prominence of a factor of 2.7, or a width of 100 % or more.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance import STEEL, Assembly, Observation, Part, Segment, find_bands
    >>> bar = Assembly([Part([Segment(length=0.2, outer_diameter=0.02, material=STEEL)], name="bar")])
    >>> lines = np.linspace(100.0, 8000.0, 400)
    >>> frf = Observation(assembly=bar, frequency_hz=lines, receptance=bar.receptance(lines))
    >>> [(round(low), round(high)) for low, high in find_bands(frf)]
    [(2126, 2350), (5625, 6217)]
    """
    width = _checks.positive("find_bands", "width_percent", width_percent, unit="percent")
    if width >= 100.0:
        raise ValueError(f"find_bands: width_percent is {width:g}, expected less than 100")
    peaks = peak_indices(frf.receptance)
    if not peaks.size:
        factor = np.exp(_PROMINENCE)
        raise ValueError(f"{frf!r} has no peak with a prominence of a factor of {factor:.3g}: give the bands")
    bands: Bands = []
    for peak in frf.frequency_hz[peaks].real:
        low, high = float(peak * (1.0 - width / 100.0)), float(peak * (1.0 + width / 100.0))
        if bands and low <= bands[-1][1]:
            low = bands.pop()[0]
        bands.append((low, high))
    return bands


def peak_indices(values: NDArray[np.complex128]) -> NDArray[np.intp]:
    """Return the indices of the peaks of a magnitude."""
    return local_maxima(np.log(np.abs(values)), _PROMINENCE)[0]


def check_bands(bands: Sequence[tuple[float, float]]) -> Bands:
    """Return bands as pairs of numbers, or raise."""
    checked: Bands = []
    for index, band in enumerate(bands):
        owner = f"bands[{index}]"
        if isinstance(band, (str, int, float)) or len(band) != 2:
            raise ValueError(f"{owner} is {band!r}, expected its lower and upper end in Hz")
        low = _checks.number(owner, "the lower end", band[0], unit="Hz")
        high = _checks.number(owner, "the upper end", band[1], unit="Hz")
        if not 0.0 <= low < high:
            raise ValueError(f"{owner} is {low:g} to {high:g} Hz, expected the lower end first")
        checked.append((low, high))
    if not checked:
        raise ValueError("bands is empty, expected at least one band")
    return checked


def within(frf: Observation, bands: Bands) -> NDArray[np.bool_]:
    """Return which lines lie in any band; raise if a band contains no line."""
    chosen = np.zeros(frf.frequency_hz.shape, dtype=np.bool_)
    lines = frf.frequency_hz.real
    for low, high in bands:
        inside = (lines >= low) & (lines <= high)
        if not inside.any():
            raise ValueError(f"no line of {frf!r} lies in the band {low:g} to {high:g} Hz")
        chosen |= inside
    return chosen


@dataclass(frozen=True, kw_only=True)
class PredictedMode:
    """A natural frequency or the peak of a response, predicted, measured or both."""

    configuration: str = ""
    """Configuration of the measurement."""
    label: str = ""
    """Label of the measurement."""
    mode: int | None = None
    """Number of the predicted elastic mode from 1; None for a peak without one."""
    predicted_hz: float | None = None
    """None if no predicted peak is near the measured one."""
    deviation_hz: float | None = None
    """Standard deviation of the prediction; None if it is unknown."""
    measured_hz: float | None = None
    """The natural frequency, or the peak of a response; None if it was not measured."""
    measured_deviation_hz: float = 0.0
    """Standard deviation of the measurement, for a peak from the noise of the lines around it; 0 if unknown."""
    degrees_of_freedom: float | None = None
    """Of the standard deviations, if the fit has estimated them; None if they are known."""

    @property
    def error_percent(self) -> float | None:
        """Relative error of the predicted frequency; None unless predicted and measured."""
        if self.measured_hz is None or self.predicted_hz is None:
            return None
        return 100.0 * (self.predicted_hz / self.measured_hz - 1.0)

    def interval_hz(self, level: float = 0.95, noise: float = 0.0) -> tuple[float, float] | None:
        """Return the interval of the frequency; None without a prediction or its standard deviation.

        With the standard deviation `noise` of a measurement in Hz it holds the measured frequency.
        """
        if self.predicted_hz is None or self.deviation_hz is None:
            return None
        half = self._multiplier(level) * float(np.hypot(self.deviation_hz, noise))
        return max(self.predicted_hz - half, 0.0), self.predicted_hz + half

    def uninformative(self, level: float = 0.95) -> bool:
        """Return whether the interval of the prediction is too wide to be useful; False without an interval."""
        if self.predicted_hz is None or self.deviation_hz is None:
            return False
        return bool(is_uninformative(self.predicted_hz, self._multiplier(level) * self.deviation_hz))

    def within(self, level: float = 0.95) -> bool | None:
        """Return whether the measured frequency lies in the interval of prediction and measurement.

        None if it was not predicted or not measured, or if there is no useful interval.
        """
        ends = self.interval_hz(level, self.measured_deviation_hz)
        if self.measured_hz is None or ends is None or self.uninformative(level):
            return None
        return ends[0] <= self.measured_hz <= ends[1]

    def _multiplier(self, level: float) -> float:
        return confidence_multiplier(level, self.degrees_of_freedom)


def match_peaks(
    frequency_hz: NDArray[np.inexact],
    measured: NDArray[np.complex128],
    predicted: NDArray[np.complex128],
    noise: NDArray[np.float64] | None = None,
) -> list[PredictedMode]:
    """Match the peaks of a measured and of a predicted response on `(n,)` lines, in order of frequency.

    Peaks of both are interpolated in the same way, so the spacing of the lines affects both alike. Measured peaks are
    ignored if their prominence is small compared with the noise, the given standard deviation of the logarithm or the
    scatter from line to line.
    """
    lines = frequency_hz.real
    stated = np.zeros(lines.size) if noise is None else noise
    measured_peaks = _peaks(lines, measured, stated, np.maximum(stated, _scatter(measured)))
    zero = np.zeros(lines.size)
    unmatched = [frequency for frequency, _ in _peaks(lines, predicted, zero, zero)]
    matched: list[PredictedMode] = []
    for measured_hz, deviation_hz in measured_peaks:
        near = min(unmatched, key=lambda f: abs(f - measured_hz), default=None)
        # A predicted peak is matched with the nearest measured one only.
        if near is not None:
            distances = [abs(frequency - near) for frequency, _ in measured_peaks]
            if abs(near / measured_hz - 1.0) > _MATCH_DISTANCE or abs(measured_hz - near) > min(distances):
                near = None
            else:
                unmatched.remove(near)
        matched.append(PredictedMode(measured_hz=measured_hz, predicted_hz=near, measured_deviation_hz=deviation_hz))
    matched += [PredictedMode(predicted_hz=f) for f in unmatched]
    return sorted(matched, key=lambda peak: peak.measured_hz or peak.predicted_hz or 0.0)


def _scatter(values: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Return the local standard deviation of the logarithm of the magnitude, from its scatter between lines."""
    if values.size < 2 * _HALF_WINDOW + 3:
        return np.zeros(values.size)
    # The second difference of white noise has six times its variance. The median is robust to sharp peaks.
    difference = np.abs(np.diff(np.log(np.abs(values)), 2))
    deviation: NDArray[np.float64] = _running_median(np.pad(difference, 1, "edge"), _HALF_WINDOW) / (
        NORMAL_QUARTILE * np.sqrt(6.0)
    )
    return deviation


def _running_median(values: NDArray[np.float64], half: int) -> NDArray[np.float64]:
    """Return the median over windows of `2 half + 1` values."""
    windows = np.lib.stride_tricks.sliding_window_view(np.pad(values, half, "edge"), 2 * half + 1)
    medians: NDArray[np.float64] = np.median(windows, axis=1)
    return medians


def _peaks(
    lines: NDArray[np.float64],
    values: NDArray[np.complex128],
    noise: NDArray[np.float64],
    scatter: NDArray[np.float64],
) -> list[tuple[float, float]]:
    """Return frequencies of peaks and their standard deviations, from parabolas through three logarithms each."""
    level = np.log(np.abs(values))
    indices = peak_indices(values)
    if scatter.any() and indices.size:
        # Between two lines that noise has made small any line has prominence; the level around them is compared.
        around = _running_median(level, 2)
        around[indices] = level[indices]
        prominences = np.zeros(level.size)
        places, sizes = local_maxima(around)
        prominences[places] = sizes
        indices = indices[prominences[indices] > np.maximum(_PROMINENCE, _NOISE_PROMINENCE * scatter[indices])]
    result = []
    for index in indices:
        near = slice(index - 1, index + 2)
        x = lines[near] - lines[index]
        # The coefficients are linear in the three levels, and so is the vertex -b / 2a to first order.
        solve = np.linalg.inv(np.vander(x, 3))
        a, b, _ = solve @ level[near]
        weights = -solve[1] / (2.0 * a) + solve[0] * b / (2.0 * a * a)
        shift = float(np.clip(-b / (2.0 * a), x[0], x[2]))
        result.append((float(lines[index]) + shift, float(np.linalg.norm(weights * noise[near]))))
    return result
