"""Predicted beside measured: natural frequencies and frequency responses."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance.identification.peaks import Peak
from receptance.identification.spread import SAYS_NOTHING, quantile, says_nothing
from receptance.report import Column, Provenance, Result, Table

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from receptance.coordinates import Coordinate
    from receptance.identification import Identification
    from receptance.identification.prediction import Scatter
    from receptance.report.table import Cell

__all__ = ["Peak", "PredictedFRF", "PredictedFrequencies", "Prediction"]

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

    def data(self, reach: float) -> dict[str, Any]:
        """Return the numbers by name, with intervals of `reach` standard deviations to either side."""
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

    def data(self, reach: float) -> dict[str, Any]:
        """Return the numbers by name, with intervals of `reach` standard deviations to either side."""
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


@dataclass(frozen=True, kw_only=True)
class Prediction(Result):
    """Predictions of a campaign with their intervals.

    Attributes
    ----------
    identified : Identification or None
        The fit that the predictions rest on; None where nothing is unknown.
    frequencies : tuple of PredictedFrequencies
        Natural frequencies, of held-out measurements first.
    frfs : tuple of PredictedFRF
        Frequency responses, of held-out measurements first.
    level : float
        Level of the intervals.
    not_predicted : dict of str to str
        By name of the measurement or assembly, the reason why it could not be predicted.
    notes : tuple of str
        Notes for the user.
    provenance : Provenance
        Campaign and versions of the software.
    """

    identified: Identification | None
    frequencies: tuple[PredictedFrequencies, ...]
    frfs: tuple[PredictedFRF, ...]
    level: float
    not_predicted: dict[str, str]
    notes: tuple[str, ...]
    provenance: Provenance = field(default_factory=Provenance, repr=False)

    heading = "Prediction"

    @property
    def reach(self) -> float:
        """How many standard deviations an interval reaches to either side."""
        return quantile(self.level, None) if self.identified is None else self.identified.reach(self.level)

    @property
    def errors_percent(self) -> list[float]:
        """Predicted against measured, of every held-out natural frequency and peak, in percent."""
        listed = [float(e) for p in self.frequencies if p.measured_hz is not None for e in p.errors_percent]
        return listed + [peak.error_percent for frf in self.frfs for peak in frf.peaks if peak.matched]

    @property
    def rms_percent(self) -> float | None:
        """Root mean square of `errors_percent`; None where nothing is compared."""
        errors = self.errors_percent
        return float(np.sqrt(np.mean(np.square(errors)))) if errors else None

    def tables(self) -> list[Table]:
        """Return predictions beside measurements, those of assemblies that were not measured, and parameters."""
        held_out = [one for one in self.frequencies if one.measured_hz is not None]
        unmeasured = [one for one in self.frequencies if one.measured_hz is None]
        tables = [
            self._frequency_table("Natural frequencies held out", held_out),
            self._peak_table(),
            self._frf_table(),
            self._frequency_table("Assemblies that were not measured", unmeasured),
            *(self.identified.tables() if self.identified is not None else ()),
        ]
        return [table for table in tables if table.rows]

    def sentences(self) -> list[str]:
        """Return the errors of held-out natural frequencies and peaks, and how the fit ended."""
        fit = [] if self.identified is None else self.identified.sentences()
        if self.rms_percent is None:
            return fit
        inside = [
            bool(yes)
            for one in self.frequencies
            if one.measured_hz is not None
            for yes in one.within(self.reach)[~one.says_nothing(self.reach)]
        ]
        inside += [yes for frf in self.frfs for peak in frf.peaks if (yes := peak.within(self.reach)) is not None]
        rest = len(self.errors_percent) - len(inside)
        wide = f"; {rest} intervals are too wide to be useful" if rest else ""
        return [
            f"held out: {len(self.errors_percent)} natural frequencies and peaks, predicted {self.rms_percent:.2f} % "
            f"rms off; {sum(inside)} of {len(inside)} within the {100.0 * self.level:g} % intervals{wide}.",
            *fit,
        ]

    def warnings(self) -> list[str]:
        """Return the advice of the fit."""
        return [] if self.identified is None else self.identified.warnings()

    def data(self) -> dict[str, Any]:
        """Return all predictions beside their measurements, and the fit."""
        return {
            "level": self.level,
            "rms_percent": self.rms_percent,
            "natural_frequencies": [one.data(self.reach) for one in self.frequencies],
            "frfs": [one.data(self.reach) for one in self.frfs],
            "not_predicted": self.not_predicted,
            "identified": None if self.identified is None else self.identified.to_dict(),
        }

    def plot(self, ax: Axes | None = None) -> Figure:
        """Draw predictions with their intervals, over the measurements; see `Result.plot`."""
        from receptance.identification.figures.fit import draw_prediction

        return draw_prediction(self, ax)

    def __repr__(self) -> str:
        counts = f"{len(self.frequencies)} sets of natural frequencies, {len(self.frfs)} FRFs"
        rms = "" if self.rms_percent is None else f", rms {self.rms_percent:.3g} %"
        return f"Prediction({self.provenance.title!r}, {counts}{rms})"

    def _interval(self) -> Column:
        return Column(f"{100.0 * self.level:g} % interval", "Hz", ".1f")

    def _frequency_table(self, title: str, several: list[PredictedFrequencies]) -> Table:
        columns = (
            "name",
            Column("mode", form="d"),
            Column("measured", "Hz", ".1f"),
            Column("predicted", "Hz", ".1f"),
            self._interval(),
            Column("error", "%", "+.2f"),
            Column("within"),
            "mostly from",
        )
        rows: list[list[Cell]] = []
        for one in several:
            low, high = one.interval_hz(self.reach)
            inside, nothing = one.within(self.reach), one.says_nothing(self.reach)
            for i, mode in enumerate(one.modes):
                measured = None if one.measured_hz is None else float(one.measured_hz[i])
                known = measured is not None and not nothing[i]
                rows.append(
                    [
                        one.name if i == 0 else None,
                        mode,
                        measured,
                        float(one.predicted_hz[i]),
                        SAYS_NOTHING if nothing[i] else (float(low[i]), float(high[i])),
                        None if measured is None else float(one.errors_percent[i]),
                        bool(inside[i]) if known else None,
                        _largest(one.scatter, i),
                    ]
                )
        return Table(title, columns, rows).without_empty()

    def _peak_table(self) -> Table:
        columns = (
            "measurement",
            Column("measured", "Hz", ".1f"),
            Column("predicted", "Hz", ".1f"),
            self._interval(),
            Column("error", "%", "+.2f"),
            Column("within"),
        )
        rows: list[list[Cell]] = [
            [
                frf.name if i == 0 else None,
                "none" if peak.measured_hz is None else peak.measured_hz,
                "none" if peak.predicted_hz is None else peak.predicted_hz,
                self._peak_interval(peak),
                peak.error_percent if peak.matched else None,
                peak.within(self.reach),
            ]
            for frf in self.frfs
            if frf.measured is not None
            for i, peak in enumerate(frf.peaks)
        ]
        return Table("Peaks of FRFs held out", columns, rows)

    def _peak_interval(self, peak: Peak) -> Cell:
        if peak.predicted_hz is None or peak.deviation_hz is None:
            return None
        half = self.reach * peak.deviation_hz
        wide = says_nothing(peak.predicted_hz, half)
        return SAYS_NOTHING if wide else (peak.predicted_hz - half, peak.predicted_hz + half)

    def _frf_table(self) -> Table:
        columns = (
            "measurement",
            Column("lines", form="d"),
            Column("magnitude off", "dB rms", ".2f"),
            Column(f"lines within {100.0 * self.level:g} %\nof band and noise", "%", ".1f"),
            Column("lines without a\nuseful band", "%", ".1f"),
        )
        rows: list[list[Cell]] = []
        for frf in self.frfs:
            if frf.measured is None:
                continue
            share, nothing = frf.share_within(self.reach), float(np.mean(frf.says_nothing(self.reach)))
            rows.append(
                [
                    frf.name,
                    frf.frequency_hz.size,
                    frf.rms_decibel,
                    SAYS_NOTHING if share is None else 100.0 * share,
                    100.0 * nothing if nothing else None,
                ]
            )
        return Table("FRFs held out", columns, rows).without_empty()


def _largest(scatter: Scatter, index: int) -> str:
    """Return the error, or the noise, that has the largest share of a variance, and its share."""
    total = float(scatter.total[index])
    if not np.isfinite(total) or total == 0.0:
        return "not determined" if total else ""
    shares = {name: float(own[index]) for name, own in scatter.shares.items()}
    shares["scatter of the data"] = float(scatter.data[index] / total) ** 2
    name = max(shares, key=lambda one: shares[one])
    # The section of the campaign file is left out; `to_dict` has the whole name.
    words = re.sub(r"^(materials|parts|joints|sensors|attachments)\.", "", name)
    words = re.sub(r"^assemblies\.(.+?)\.(set|tolerance)\.", r"\1: ", words).replace('"', "")
    return f"{words} {100.0 * shares[name]:.0f} %"
