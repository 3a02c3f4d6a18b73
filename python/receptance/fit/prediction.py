"""Results of predictions: standard deviations with their shares, natural frequencies and frequency responses.

They are made by `identification.predictor`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from receptance import _checks
from receptance.fit.covariance import confidence_multiplier
from receptance.fit.peaks import PredictedMode
from receptance.model.coordinates import Coordinate

DECIBEL = 20.0 / math.log(10.0)
"""Decibels of a factor of e."""
_FACTOR = 10.0
"""Factor to either side from which the band of a magnitude is too wide to be useful."""


@dataclass(frozen=True)
class Scatter:
    """Standard deviations of results, `(n,)` each, and the share of the tolerances in them."""

    total: NDArray[np.float64]
    """By the posterior; infinite where the result depends on a parameter that is not determined."""
    data: NDArray[np.float64]
    """By the noise of the data alone, if every error of a dimension or material were known."""
    errors: dict[str, NDArray[np.float64]]
    """By error: signed change of the result for one posterior standard deviation of the error, with the other variables
    at their conditional means. Its square is the variance that would vanish if the error were known."""

    def widened(self, deviation: NDArray[np.float64]) -> Scatter:
        """Return the scatter with further independent errors of these standard deviations, `(n,)`."""
        return replace(self, total=np.hypot(self.total, deviation)) if deviation.any() else self

    def of(self, rows: slice, factor: NDArray[np.float64]) -> Scatter:
        """Return the scatter of some of the results, each multiplied by a positive factor."""
        errors = {name: factor * change[rows] for name, change in self.errors.items()}
        return Scatter(factor * self.total[rows], factor * self.data[rows], errors)

    @property
    def shares(self) -> dict[str, NDArray[np.float64]]:
        """Share of each error in the variance, `(n,)`; shares of correlated errors overlap."""
        whole = np.where(self.total > 0.0, self.total, 1.0) ** 2
        return {name: change**2 / whole for name, change in self.errors.items()}


@dataclass(frozen=True, kw_only=True)
class PredictedFrequencies:
    """Predicted natural frequencies of an assembly, with measured ones if there are any."""

    name: str = ""
    """Name of the measurement, or of the assembly without one."""
    assembly: str = ""
    modes: tuple[PredictedMode, ...]
    """The natural frequencies."""
    scatter: Scatter = field(repr=False)
    """Of the predictions in Hz."""

    @property
    def predicted_hz(self) -> NDArray[np.float64]:
        """Predicted natural frequencies, `(m,)`."""
        return np.array([mode.predicted_hz for mode in self.modes], dtype=np.float64)

    @property
    def standard_error_hz(self) -> NDArray[np.float64]:
        """Standard errors of the predictions, `(m,)`; infinite if a relevant parameter is not determined."""
        return self.scatter.total

    @property
    def measured_hz(self) -> NDArray[np.float64] | None:
        """Measured natural frequencies, `(m,)`; None if they were not measured."""
        measured = [mode.measured_hz for mode in self.modes]
        return None if None in measured else np.array(measured, dtype=np.float64)

    def data(self, level: float = 0.95) -> dict[str, Any]:
        """Return the numbers by name, with intervals of a level."""
        values: dict[str, Any] = {
            "name": self.name,
            "assembly": self.assembly,
            "modes": [mode.mode for mode in self.modes],
            "predicted_hz": self.predicted_hz,
            "interval_hz": list(zip(*(mode.interval_hz(level) or () for mode in self.modes), strict=True)),
            "interval_uninformative": [mode.uninformative(level) for mode in self.modes],
            "standard_error_hz": self.scatter.total,
            "standard_error_of_fit_hz": self.scatter.data,
            "change_for_one_deviation_hz": self.scatter.errors,
        }
        if self.measured_hz is not None:
            deviations = [mode.measured_deviation_hz for mode in self.modes]
            values |= {
                "measured_hz": self.measured_hz,
                "measured_deviation_hz": deviations if any(deviations) else None,
                "error_percent": [mode.error_percent for mode in self.modes],
                "within": [mode.within(level) for mode in self.modes],
            }
        return values


@dataclass(frozen=True, kw_only=True)
class PredictedFRF:
    """A predicted frequency response with its band, and the measured one where there is one."""

    name: str = ""
    """Name of the measurement, or of the assembly without one."""
    assembly: str = ""
    """Name of the assembly."""
    response: Coordinate
    """Coordinate of the motion."""
    excitation: Coordinate
    """Coordinate of the load."""
    frequency_hz: NDArray[np.inexact]
    """`(n,)` lines, complex where both channels had an exponential window."""
    receptance: NDArray[np.complex128] = field(repr=False)
    """`(n,)` complex, with the identified values."""
    scatter: Scatter = field(repr=False)
    """Of the real part of its logarithm, to first order."""
    phase_scatter: Scatter | None = field(repr=False)
    """Of the imaginary part; None if not computed."""
    drawn: NDArray[np.complex128] = field(repr=False)
    """`(draws, n)` complex receptances of vectors drawn from the posterior; `(0, n)` without draws."""
    undrawn_deviation: NDArray[np.float64] | None = field(default=None, repr=False)
    """`(n,)` standard deviation of the real part of its logarithm by what draws leave out: the error of the model where
    modes nearly cancel. None if they leave out nothing."""
    degrees_of_freedom: float | None = None
    """Of the scatter, where it was estimated; None where it was known."""
    measured: NDArray[np.complex128] | None = field(default=None, repr=False)
    """`(n,)` complex."""
    measured_deviation: NDArray[np.float64] | None = field(default=None, repr=False)
    """`(n,)` standard deviation of the real and of the imaginary part of its logarithm."""
    peaks: tuple[PredictedMode, ...] = ()
    """Peaks of measurement and prediction."""

    def band(self, level: float = 0.95, noise: ArrayLike = 0.0) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the lower and upper end of the interval of the magnitude on each line.

        Parameters
        ----------
        level : float, optional
            Probability that the magnitude of a line lies in its interval.
        noise : array_like, optional
            Standard deviation of the logarithm of a measurement; the band then holds the measured magnitude.

        Raises
        ------
        ValueError
            A level not between 0 and 1.
        """
        multiplier = confidence_multiplier(level, self.degrees_of_freedom)
        noise = _checks.unmasked("band", "noise", noise, np.float64)
        middle = np.log(np.abs(self.receptance))
        if len(self.drawn):
            ends = [0.5 - 0.5 * level, 0.5 + 0.5 * level]
            low, high = np.quantile(np.log(np.abs(self.drawn)), ends, axis=0)
            low, high = np.minimum(low, middle), np.maximum(high, middle)
            # These errors and the noise of a measurement are added as if each side were that of a normal distribution.
            beside = noise if self.undrawn_deviation is None else np.hypot(noise, self.undrawn_deviation)
            low = middle - np.hypot(middle - low, multiplier * beside)
            high = middle + np.hypot(high - middle, multiplier * beside)
        else:
            half = multiplier * np.hypot(self.scatter.total, noise)
            low, high = middle - half, middle + half
        with np.errstate(over="ignore"):
            return np.exp(low), np.exp(high)

    def uninformative(self, level: float = 0.95) -> NDArray[np.bool_]:
        """Return the lines on which the band is too wide to be useful, a factor of ten to either side, `(n,)`."""
        size = np.abs(self.receptance)
        low, high = self.band(level)
        useful: NDArray[np.bool_] = (high < _FACTOR * size) & (size < _FACTOR * low)
        return ~useful

    @property
    def log_ratio(self) -> NDArray[np.complex128]:
        """Logarithm of measured over predicted: factor and phase, `(n,)`; empty if not measured."""
        return np.empty(0, dtype=np.complex128) if self.measured is None else np.log(self.measured / self.receptance)

    @property
    def rms_decibel(self) -> float | None:
        """Root mean square over the lines of measured over predicted magnitude in dB; None if not measured."""
        return None if self.measured is None else float(DECIBEL * np.sqrt(np.mean(self.log_ratio.real**2)))

    def share_within(self, level: float = 0.95) -> float | None:
        """Return the share of the lines whose measured magnitude is in the band, noise included.

        Of the lines whose band is useful; None without any, or if not measured.
        """
        useful = ~self.uninformative(level)
        if self.measured is None or not useful.any():
            return None
        low, high = self.band(level, 0.0 if self.measured_deviation is None else self.measured_deviation)
        size = np.abs(self.measured)
        return float(np.mean(((low <= size) & (size <= high))[useful]))

    def data(self, level: float = 0.95) -> dict[str, Any]:
        """Return the numbers by name, with the band and intervals of a level."""
        nothing = self.uninformative(level)
        low, high = (np.where(nothing, np.nan, side) for side in self.band(level))
        values: dict[str, Any] = {
            "name": self.name,
            "assembly": self.assembly,
            "response": _coordinate(self.response),
            "excitation": _coordinate(self.excitation),
            "frequency_hz": self.frequency_hz.real,
            "receptance": self.receptance,
            "magnitude_interval": [low, high],
            "standard_error_of_log": [part.total for part in (self.scatter, self.phase_scatter) if part is not None],
        }
        if np.iscomplexobj(self.frequency_hz):
            values["decay_rate"] = -2.0 * np.pi * float(self.frequency_hz[0].imag)
        if self.measured is not None:
            values |= {
                "measured": self.measured,
                "rms_decibel": self.rms_decibel,
                "share_within": self.share_within(level),
                "share_of_lines_with_uninformative_band": float(np.mean(nothing)),
                "peaks": [
                    {
                        "measured_hz": peak.measured_hz,
                        "measured_deviation_hz": peak.measured_deviation_hz,
                        "predicted_hz": peak.predicted_hz,
                        "standard_error_hz": peak.deviation_hz,
                        "error_percent": peak.error_percent,
                        "within": peak.within(level),
                        "interval_uninformative": peak.uninformative(level),
                    }
                    for peak in self.peaks
                ],
            }
        return values

    def __repr__(self) -> str:
        low, high = self.frequency_hz[[0, -1]].real
        return f"PredictedFRF({self.frequency_hz.size} lines from {low:g} to {high:g} Hz)"


def _coordinate(at: Coordinate) -> dict[str, str | float]:
    return {"part": at.part, "position_m": at.position, "direction": at.direction}
