"""Discrepancy: the error of a model that remains beside the noise of the data.

No beam model agrees with a real structure down to the noise of ten hits. The remaining error is smooth in frequency:
natural frequency and level of each mode are slightly wrong. Its variance in the logarithm of a receptance H, for the
real and the imaginary part each, is

    v(f) = r^2 g(f) + u(f),    u(f) = (|ln H(f (1 + s)) - ln H(f)|^2 + |ln H(f (1 - s)) - ln H(f)|^2) / 4,
    g(f) = max(1, sum_m |H_m(f)|^2 / |H(f)|^2),

with the standard deviation r of level and phase, and s of the relative error of natural frequencies. Differences stand
in place of derivatives because s may exceed the width of a resonance. H is the measured receptance, so that the weights
are the same for all models. An error of level is a share of its mode, and H may be much smaller than its modes H_m, of
the size of the peaks and with their widths: it then has a larger relative error, g times in variance.

Errors are common to lines: those of a mode where u > r^2 g have its error of frequency, one real number in all records
of a configuration; the others have its error of level, one complex number in each record, to which each line adds
in proportion to 1 / g. A mode has the lines from one midpoint between peaks to the next. Antiresonances are left out: a
small error of one mode moves them far. A measured natural frequency has the relative error s.

In predictions H is the predicted receptance, of assemblies that were measured as well. Draws have an independent error
of frequency and of level for each mode: the axis of frequency is stretched smoothly from peak to peak, and the
receptance is multiplied by a positive factor, so that that of a drive point remains passive.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from receptance._peaks import local_maxima, nearest_peak
from receptance.fit.observation import Observation, altered
from receptance.report.table import percent

DISCREPANCIES = (1e-4, 0.3)
"""Smallest and largest standard deviation of an error."""
_LEAST_FACTOR = 0.5
"""Least ratio of the discrepancy of an explanation to the one that its fit allows for."""
_MODE_PROMINENCE = math.log(4.0)
_MODE_NOISE = 10.0
"""Least prominence of the peak of a mode in the logarithm of the mobility: absolute, and as a multiple of the noise."""


@dataclass(frozen=True)
class Discrepancy:
    """Standard deviations of the error of a model."""

    frequency: float
    """Of natural frequencies, relative."""
    relative: float | None
    """Of the real and of the imaginary part of the logarithm of receptances; None without receptances."""
    damping: float | None = None
    """Of damping ratios, relative; None where none was measured."""

    def __str__(self) -> str:
        level = "" if self.relative is None else f" and {percent(self.relative)} in level"
        damping = "" if self.damping is None else f" and {percent(self.damping)} in damping ratios"
        return f"{percent(self.frequency)} in natural frequencies{level}{damping}"

    @property
    def largest(self) -> float:
        """The larger one of the standard deviations of frequency and level."""
        return max(self.frequency, self.relative or 0.0)

    def times(self, factor: float) -> Discrepancy:
        """Return a discrepancy that is larger by a factor, up to the largest one that is tried."""
        largest = DISCREPANCIES[1]
        level = None if self.relative is None else min(factor * self.relative, largest)
        damping = None if self.damping is None else factor * self.damping
        return Discrepancy(min(factor * self.frequency, largest), level, damping)

    def at_least(self, other: Discrepancy) -> Discrepancy:
        """Return a discrepancy whose standard deviations are no smaller than those of another one."""
        names = ("frequency", "relative", "damping")
        pairs = ((getattr(self, name), getattr(other, name)) for name in names)
        return Discrepancy(*(own if least is None else max(own or 0.0, least) for own, least in pairs))

    def deviance(self, chi_square: ArrayLike, values: float) -> NDArray[np.float64]:
        """Return minus twice the logarithm of the likelihood of fits that allow for it, for its most likely size.

        The size is a common factor of the standard deviations. The factor is at most that which leads to the largest
        discrepancy that is tried, and at least `_LEAST_FACTOR`: few values may agree with a model by chance.

        Parameters
        ----------
        chi_square : array_like
            Chi-square of the fits.
        values : float
            Number of independent values.
        """
        most = DISCREPANCIES[1] / (self.frequency if self.relative is None else self.relative)
        chi_square = np.asarray(chi_square, dtype=np.float64)
        square = np.clip(chi_square / values, _LEAST_FACTOR**2, max(most, 1.0) ** 2)
        return np.asarray(values * np.log(square) + chi_square / square)

    def is_close(self, other: Discrepancy) -> bool:
        """Return whether another discrepancy is the same to a tenth."""
        pairs = ((getattr(self, name), getattr(other, name)) for name in ("frequency", "relative", "damping"))
        return all(own == one or (own and one and abs(math.log(own / one)) < 0.1) for own, one in pairs)

    def allow(self, observations: Sequence[Observation], configurations: Sequence[str]) -> tuple[Observation, ...]:
        """Return the observations of these configurations with variances that include the discrepancy."""
        measured = [
            name for name, observation in zip(configurations, observations, strict=True) if observation.is_receptance
        ]
        pairs = zip(observations, configurations, strict=True)
        return tuple(self.enlarge(observation, max(measured.count(name), 1)) for observation, name in pairs)

    def enlarge(self, observation: Observation, records: int = 1) -> Observation:
        """Return an observation with variances that include the discrepancy, one of so many of its configuration."""
        if not observation.is_receptance:
            spread = np.hypot(np.asarray(observation.standard_deviation), self.frequency * observation.frequency_hz)
            changed = altered(observation, standard_deviation=spread)
            if self.damping is None or not observation.damped.size:
                return changed
            ratios = np.nan_to_num(np.asarray(observation.damping_ratio))
            of_damping = np.hypot(np.asarray(observation.standard_deviation_damping), self.damping * ratios)
            return altered(changed, standard_deviation_damping=of_damping)
        curve = curve_of(observation)
        growth = curve.growth
        level, shift = np.square(self.relative or 0.0) * growth, curve.variance_of_shift(self.frequency)
        noise = np.square(observation.standard_deviations[: shift.size])
        is_shifted = shift > level
        weights = np.where(is_shifted, 1.0, 1.0 / growth)
        lines = _common_lines(nearest_peak(curve.frequency_hz, curve.peaks_hz), is_shifted, records, weights)
        # `standard_deviation` is that of independent lines with the information of the correlated ones.
        share = (level + shift) / (level + shift + noise / observation.correlated_lines)
        correlated = observation.correlated_lines + share * (lines / weights - observation.correlated_lines)
        return altered(
            observation,
            standard_deviation=np.sqrt(noise + lines * (level + shift)),
            correlated_lines=np.maximum(correlated, 1.0),
        )

    def log_variance(self, curve: Curve) -> NDArray[np.float64]:
        """Return the variance of the real and of the imaginary part, each, of the logarithm of a receptance, `(n,)`."""
        level = np.square(self.relative or 0.0) * curve.growth
        return np.asarray(level + curve.variance_of_shift(self.frequency))

    def data(self) -> dict[str, float | None]:
        """Return the standard deviations by name."""
        return {"frequency": self.frequency, "level": self.relative, "damping": self.damping}


@dataclass(frozen=True, eq=False)
class Curve:
    """A receptance on `(n,)` ascending lines in Hz, and the frequencies of the peaks of its modes in Hz."""

    frequency_hz: NDArray[np.float64]
    receptance: NDArray[np.complex128]
    peaks_hz: NDArray[np.float64]

    @classmethod
    def of(cls, frequency_hz: NDArray[np.float64], receptance: NDArray[np.complex128], noise: float = 0.0) -> Curve:
        """Return the curve of lines whose logarithm has a standard deviation."""
        least = max(_MODE_PROMINENCE, _MODE_NOISE * noise)
        peaks = local_maxima(np.log(np.abs(receptance) * frequency_hz), least)[0]
        return cls(frequency_hz, receptance, np.asarray(frequency_hz[peaks]))

    @property
    def growth(self) -> NDArray[np.float64]:
        """Factor by which the variance of errors of level is larger than at the peaks, `(n,)`.

        Each peak is taken as that of a mode with its height and its width, which is measured at half of the height.
        """
        lines, size = self.frequency_hz, np.abs(self.receptance)
        squares = np.zeros(lines.size)
        for peak in np.searchsorted(lines, self.peaks_hz):
            away = np.abs(np.square(lines / lines[peak]) - 1.0)
            is_lower = size <= 0.5 * size[peak]
            sides = [*np.flatnonzero(is_lower[:peak])[-1:], *(peak + np.flatnonzero(is_lower[peak:])[:1])]
            if sides:
                # |H_m|^2 = |H_peak|^2 / (1 + (away / loss)^2).
                loss = np.mean([away[i] / math.sqrt(np.square(size[peak] / size[i]) - 1.0) for i in sides])
                squares += np.square(size[peak]) / (1.0 + np.square(away / loss))
        return np.asarray(np.maximum(squares / np.square(size), 1.0))

    def variance_of_shift(self, frequency: float) -> NDArray[np.float64]:
        """Return the variance of the logarithm by an error of frequency, for real and imaginary part each, `(n,)`."""
        down, at_rest, up = self.moved(frequency)
        return np.asarray((np.square(np.abs(up - at_rest)) + np.square(np.abs(down - at_rest))) / 4.0)

    def moved(self, shift: float) -> list[NDArray[np.complex128]]:
        """Return the logarithm at frequencies that are smaller by a share, the same, and larger."""
        lines = self.frequency_hz
        logarithm = np.log(np.abs(self.receptance)) + 1j * np.unwrap(np.angle(self.receptance))
        return [np.asarray(np.interp(lines * (1.0 + way * shift), lines, logarithm)) for way in (-1.0, 0.0, 1.0)]

    @property
    def modes(self) -> int:
        """Number of modes that have errors; one without a peak."""
        return max(self.peaks_hz.size, 1)

    def moved_by(self, shift: NDArray[np.float64], level: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return the receptance with errors of the logarithms of frequency and level of each mode, `(n,)`.

        Between the peaks both are interpolated. The dynamic stiffness is interpolated between the lines: it has no
        peaks at resonances, and its imaginary part keeps its sign.
        """
        lines = self.frequency_hz
        centres = self.peaks_hz if self.peaks_hz.size else np.array([lines.mean()])
        at = lines * np.exp(-np.interp(lines, centres, shift))
        stiffness = np.interp(at, lines, 1.0 / self.receptance)
        return np.asarray(np.exp(np.interp(lines, centres, level)) / stiffness)


def curve_of(observation: Observation) -> Curve:
    """Return the curve of a measured receptance."""
    noise = float(np.median(observation.standard_deviations))
    return Curve.of(observation.frequency_hz.real, observation.receptance, noise)


def _common_lines(
    modes: NDArray[np.intp], shifted: NDArray[np.bool_], records: int, weights: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return for each line the sum of the weights of the lines that share its two independent values."""
    groups = 2 * modes + shifted
    counts = np.bincount(groups, weights)
    # One error of frequency, a real number, for all records.
    counts[1::2] *= 2 * records
    return np.asarray(counts[groups])
