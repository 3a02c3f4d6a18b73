"""Predicted beside measured: natural frequencies and frequency responses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance.identification.peaks import Peak
from receptance.identification.spread import says_nothing

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.coordinates import Coordinate
    from receptance.identification.prediction import Scatter

__all__ = ["Peak", "PredictedFRF", "PredictedFrequencies"]

_DECIBEL = 20.0 / np.log(10.0)
_FACTOR = 10.0
"""By which a magnitude may be larger or smaller before its band says nothing."""


@dataclass(frozen=True, kw_only=True)
class PredictedFrequencies:
    """Natural frequencies of one assembly, predicted, and measured where they were.

    Attributes
    ----------
    name : str
        Of the held-out measurement, or of the assembly that was not measured.
    assembly : str
        Name of the assembly.
    modes : tuple of int
        Elastic modes from 1.
    predicted_hz : ndarray
        `(m,)`.
    scatter : Scatter
        Of the predictions in Hz.
    measured_hz, measured_deviation_hz : ndarray or None
        What was measured, with its standard deviation.
    """

    name: str
    assembly: str
    modes: tuple[int, ...]
    predicted_hz: NDArray[np.float64]
    scatter: Scatter
    measured_hz: NDArray[np.float64] | None = None
    measured_deviation_hz: NDArray[np.float64] | None = None

    @property
    def errors_percent(self) -> NDArray[np.float64]:
        """Predicted against measured, `(m,)` or empty."""
        return np.empty(0) if self.measured_hz is None else 100.0 * (self.predicted_hz / self.measured_hz - 1.0)

    def interval_hz(self, reach: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return lower and upper ends of where the natural frequencies are, `reach` standard deviations away."""
        half = reach * self.scatter.total
        return np.maximum(self.predicted_hz - half, 0.0), self.predicted_hz + half

    def says_nothing(self, reach: float) -> NDArray[np.bool_]:
        """Return which intervals are too wide to say anything, `(m,)`."""
        return says_nothing(self.predicted_hz, reach * self.scatter.total)

    def within(self, reach: float) -> NDArray[np.bool_]:
        """Return whether the measured ones are where predictions and readings let them be; empty if not measured.

        Where `says_nothing`, the answer has no meaning.
        """
        if self.measured_hz is None:
            return np.empty(0, dtype=np.bool_)
        reading = 0.0 if self.measured_deviation_hz is None else self.measured_deviation_hz
        far: NDArray[np.bool_] = np.abs(self.predicted_hz - self.measured_hz) <= reach * np.hypot(
            self.scatter.total, reading
        )
        return far

    def as_dict(self, reach: float) -> dict[str, Any]:
        """Return the numbers by name."""
        low, high = self.interval_hz(reach)
        nothing = self.says_nothing(reach)
        found: dict[str, Any] = {
            "name": self.name,
            "assembly": self.assembly,
            "modes": self.modes,
            "predicted_hz": self.predicted_hz,
            "interval_hz": [low, high],
            "interval_says_nothing": nothing,
            "standard_error_hz": self.scatter.total,
            "standard_error_of_fit_hz": self.scatter.data,
            "change_for_one_deviation_hz": self.scatter.errors,
        }
        if self.measured_hz is not None:
            found |= {
                "measured_hz": self.measured_hz,
                "measured_deviation_hz": self.measured_deviation_hz,
                "error_percent": self.errors_percent,
                "within": [None if wide else bool(yes) for wide, yes in zip(nothing, self.within(reach), strict=True)],
            }
        return found


@dataclass(frozen=True, kw_only=True)
class PredictedFRF:
    """A frequency response, predicted, and measured where it was.

    Attributes
    ----------
    name, assembly : str
        As in `PredictedFrequencies`.
    response, excitation : Coordinate
        Where motion is seen and where the load acts.
    frequency_hz : ndarray
        `(n,)` lines, complex where both channels had an exponential window.
    receptance : ndarray
        `(n,)` complex prediction.
    scatter, phase_scatter : Scatter
        Of the real and of the imaginary part of its logarithm.
    measured : ndarray or None
        `(n,)` complex.
    measured_deviation : ndarray or None
        `(n,)`, of the real and of the imaginary part of its logarithm.
    peaks : tuple of Peak
        Peaks of measurement and prediction.
    """

    name: str
    assembly: str
    response: Coordinate
    excitation: Coordinate
    frequency_hz: NDArray[Any]
    receptance: NDArray[np.complex128]
    scatter: Scatter
    phase_scatter: Scatter
    measured: NDArray[np.complex128] | None = None
    measured_deviation: NDArray[np.float64] | None = None
    peaks: tuple[Peak, ...] = ()

    def band(self, reach: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return lower and upper magnitude of where the response is."""
        with np.errstate(over="ignore"):
            factor = np.exp(reach * self.scatter.total)
        size = np.abs(self.receptance)
        return size / factor, size * factor

    @property
    def log_ratio(self) -> NDArray[np.complex128]:
        """Logarithm of measured over predicted: factor and phase, `(n,)` or empty."""
        return np.empty(0, dtype=np.complex128) if self.measured is None else np.log(self.measured / self.receptance)

    @property
    def rms_decibel(self) -> float | None:
        """Root mean square of measured over predicted magnitude in dB."""
        if self.measured is None:
            return None
        return float(_DECIBEL * np.sqrt(np.mean(self.log_ratio.real**2)))

    def share_within(self, reach: float) -> float | None:
        """Return the share of lines on which the magnitude is where prediction and noise let it be.

        Of the lines whose band says something; None without any.
        """
        if self.measured is None:
            return None
        noise = 0.0 if self.measured_deviation is None else self.measured_deviation
        inside = np.abs(self.log_ratio.real) <= reach * np.hypot(self.scatter.total, noise)
        told = ~self.says_nothing(reach)
        return float(np.mean(inside[told])) if told.any() else None

    def says_nothing(self, reach: float) -> NDArray[np.bool_]:
        """Return on which lines the band is too wide to say anything: a factor of ten to either side, `(n,)`."""
        wide: NDArray[np.bool_] = ~(reach * self.scatter.total < np.log(_FACTOR))
        return wide

    def as_dict(self, reach: float) -> dict[str, Any]:
        """Return the numbers by name."""
        nothing = self.says_nothing(reach)
        low, high = (np.where(nothing, np.nan, side) for side in self.band(reach))
        found: dict[str, Any] = {
            "name": self.name,
            "assembly": self.assembly,
            "response": _place(self.response),
            "excitation": _place(self.excitation),
            "frequency_hz": self.frequency_hz.real,
            "receptance": self.receptance,
            "magnitude_interval": [low, high],
            "standard_error_of_log": [self.scatter.total, self.phase_scatter.total],
        }
        if np.iscomplexobj(self.frequency_hz):
            found["decay_rate"] = -2.0 * np.pi * float(self.frequency_hz[0].imag)
        if self.measured is not None:
            found |= {
                "measured": self.measured,
                "rms_decibel": self.rms_decibel,
                "share_within": self.share_within(reach),
                "share_of_lines_where_the_band_says_nothing": float(np.mean(nothing)),
                "peaks": [
                    {
                        "measured_hz": peak.measured_hz,
                        "measured_deviation_hz": peak.measured_deviation_hz,
                        "predicted_hz": peak.predicted_hz,
                        "standard_error_hz": peak.deviation_hz,
                        "error_percent": peak.error_percent,
                        "within": peak.within(reach),
                        "interval_says_nothing": peak.predicted_hz is not None
                        and peak.deviation_hz is not None
                        and bool(says_nothing(peak.predicted_hz, reach * peak.deviation_hz)),
                    }
                    for peak in self.peaks
                ],
            }
        return found


def _place(at: Coordinate) -> dict[str, Any]:
    return {"part": at.part, "position_m": at.position, "direction": at.direction}
