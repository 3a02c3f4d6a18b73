"""The result of a transfer: predictions beside measurements, by split."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance.identification.spread import SAYS_NOTHING, says_nothing
from receptance.report import Column, Provenance, Result, Table

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from receptance.identification.prediction import PredictedReceptance
    from receptance.identification.result import Identification
    from receptance.report.table import Cell

__all__ = ["Split", "Transfer", "TransferredFRF", "TransferredMode"]

_DECIBEL = 20.0 / np.log(10.0)
_MISFIT = 1.5
"""Residuals this many times their standard deviation, as rms, say that model or standard deviations are wrong."""


@dataclass(frozen=True, kw_only=True)
class TransferredMode:
    """A natural frequency of a configuration that the fit did not see.

    Attributes
    ----------
    configuration, label : str
        Of the measurement.
    mode : int or None
        Elastic mode from 1; None for a measured peak that nothing was predicted for.
    measured_hz : float
        As given, or where the measured receptance peaks.
    predicted_hz : float or None
        None where a measured peak has no predicted one near it.
    deviation_hz : float or None
        Standard deviation of the prediction.
    reading_hz : float
        Standard deviation of the measurement.
    reach : float
        How many standard deviations the interval reaches.
    """

    configuration: str
    label: str
    mode: int | None
    measured_hz: float
    predicted_hz: float | None
    deviation_hz: float | None
    reading_hz: float
    reach: float

    @property
    def error_percent(self) -> float | None:
        """Predicted against measured."""
        return None if self.predicted_hz is None else 100.0 * (self.predicted_hz / self.measured_hz - 1.0)

    @property
    def interval_hz(self) -> tuple[float, float] | None:
        """Where prediction and reading let the measured one be."""
        if self.predicted_hz is None or self.deviation_hz is None:
            return None
        half = self.reach * float(np.hypot(self.deviation_hz, self.reading_hz))
        return max(self.predicted_hz - half, 0.0), self.predicted_hz + half

    @property
    def says_nothing(self) -> bool:
        """Whether the interval of the prediction is too wide to say anything."""
        if self.predicted_hz is None or self.deviation_hz is None:
            return False
        return bool(says_nothing(self.predicted_hz, self.reach * self.deviation_hz))

    @property
    def inside(self) -> bool | None:
        """Whether it is there; a peak that was not predicted is not. None without an interval that says something."""
        if self.predicted_hz is not None and self.deviation_hz is None:
            return None
        ends = self.interval_hz
        if self.says_nothing:
            return None
        return ends is not None and ends[0] <= self.measured_hz <= ends[1]


@dataclass(frozen=True, kw_only=True)
class TransferredFRF:
    """A receptance of a configuration that the fit did not see.

    Attributes
    ----------
    configuration, label : str
        Of the measurement.
    measured : ndarray
        `(n,)` complex.
    noise : ndarray
        `(n,)` standard deviation of its logarithm.
    predicted : PredictedReceptance
        On the same lines.
    level : float
        Level of the band.
    """

    configuration: str
    label: str
    measured: NDArray[np.complex128] = field(repr=False)
    noise: NDArray[np.float64] = field(repr=False)
    predicted: PredictedReceptance
    level: float

    @property
    def distance_decibel(self) -> float:
        """Log-spectral distance: root mean square over the lines of measured over predicted magnitude, in dB."""
        ratio = np.log(np.abs(self.measured / self.predicted.receptance))
        return float(_DECIBEL * np.sqrt(np.mean(ratio**2)))

    @property
    def share_inside(self) -> float:
        """Share of the lines whose measured magnitude is in the band, noise included."""
        low, high = self.predicted.band(self.level, self.noise)
        size = np.abs(self.measured)
        return float(np.mean((low <= size) & (size <= high)))


@dataclass(frozen=True, kw_only=True)
class Split:
    """One fit, and what it predicts.

    Attributes
    ----------
    held_out, fitted : tuple of str
        Configurations.
    identified : Identification or None
        The fit; None where none of the unknowns is in what is left.
    modes : tuple of TransferredMode
        Natural frequencies and peaks.
    frfs : tuple of TransferredFRF
        Receptances.
    not_predicted : tuple of str
        What could not be predicted, and why.
    notes : tuple of str
        What a person should know of it.
    """

    held_out: tuple[str, ...]
    fitted: tuple[str, ...]
    identified: Identification | None = field(repr=False)
    modes: tuple[TransferredMode, ...]
    frfs: tuple[TransferredFRF, ...]
    not_predicted: tuple[str, ...]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Transfer(Result):
    """Predictions of configurations that were not fitted, beside their measurements.

    Attributes
    ----------
    splits : tuple of Split
        One fit each.
    level : float
        Level of the intervals.
    seed : int
        Of starts and draws.
    campaign_notes : tuple of str
        Notes of the campaign.
    provenance : Provenance
        Campaign and versions of the software.
    """

    splits: tuple[Split, ...]
    level: float
    seed: int
    campaign_notes: tuple[str, ...] = field(default=(), repr=False)
    provenance: Provenance = field(default_factory=Provenance, repr=False)

    heading = "Transfer"

    @property
    def modes(self) -> tuple[TransferredMode, ...]:
        """Natural frequencies and peaks of all splits."""
        return tuple(mode for split in self.splits for mode in split.modes)

    @property
    def frfs(self) -> tuple[TransferredFRF, ...]:
        """Receptances of all splits."""
        return tuple(frf for split in self.splits for frf in split.frfs)

    @property
    def not_predicted(self) -> tuple[str, ...]:
        """What could not be predicted, and why."""
        return tuple(dict.fromkeys(reason for split in self.splits for reason in split.not_predicted))

    @property
    def advice(self) -> dict[str, int]:
        """What the fits advise, and in how many splits."""
        said = [text for split in self.splits if split.identified is not None for text in split.identified.advice]
        return {text: said.count(text) for text in dict.fromkeys(said)}

    @property
    def narrow(self) -> tuple[str, ...]:
        """Held-out groups whose fit leaves residuals well above the stated standard deviations.

        The model lacks something there, or the standard deviations are too small; intervals are then too narrow.
        """
        return tuple(
            ", ".join(split.held_out)
            for split in self.splits
            if split.identified is not None
            and split.identified.known_scatter
            and split.identified.rms > _MISFIT * split.identified.noise_factor
        )

    @property
    def rms_percent(self) -> float | None:
        """Root mean square error of the natural frequencies; None where none was predicted."""
        errors = [mode.error_percent for mode in self.modes if mode.error_percent is not None]
        return float(np.sqrt(np.mean(np.square(errors)))) if errors else None

    @property
    def bias_percent(self) -> float | None:
        """Mean error of the natural frequencies."""
        errors = [mode.error_percent for mode in self.modes if mode.error_percent is not None]
        return float(np.mean(errors)) if errors else None

    @property
    def inside(self) -> tuple[int, int]:
        """How many natural frequencies are in their intervals, of how many whose interval says something."""
        told = [mode.inside for mode in self.modes if mode.inside is not None]
        return sum(told), len(told)

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes of the campaign, of the splits and on the intervals."""
        own = tuple(dict.fromkeys([*self.campaign_notes, *(note for split in self.splits for note in split.notes)]))
        factors = [split.identified.noise_factor for split in self.splits if split.identified is not None]
        raised = [factor for factor in factors if factor > 1.0]
        if raised:
            own += (
                f"in {len(raised)} of {len(self.splits)} splits the model does not explain the data within standard "
                f"deviations and tolerances; the fit takes the former up to {max(raised):.2g} times as large",
            )
        if not self.narrow:
            return own
        most = max(split.identified.rms for split in self.splits if split.identified is not None)
        return (
            *own,
            f"in {len(self.narrow)} of {len(self.splits)} splits the residuals of the fit are up to {most:.2g} times "
            "what the standard deviations explain: the model lacks something, or they are too small, and the "
            "intervals are then too narrow",
        )

    @property
    def identified(self) -> dict[str, list[float | None]]:
        """Identified values by name, one for each split; errors of tolerances left out, None where it has none."""
        fits = [split.identified for split in self.splits]
        names = dict.fromkeys(name for fit in fits if fit for name in fit.values if name not in fit.errors)
        return {name: [None if fit is None else fit.values.get(name) for fit in fits] for name in names}

    def tables(self) -> list[Table]:
        """Return natural frequencies and receptances beside measured ones, and identified values over the splits."""
        tables = [self._mode_table(), self._frf_table(), self._value_table()]
        return [table for table in tables if table.rows]

    def sentences(self) -> list[str]:
        """Return errors, the share of intervals that hold the measured values, and what could not be predicted."""
        return [f"{self._headline()}.", *(f"not predicted: {reason}." for reason in self.not_predicted)]

    def warnings(self) -> list[str]:
        """Return the advice of the fits, with the number of splits."""
        return [f"{text} (in {count} of {len(self.splits)} splits)" for text, count in self.advice.items()]

    def data(self) -> dict[str, Any]:
        """Return all predictions beside their measurements, by split."""
        return {
            "level": self.level,
            "seed": self.seed,
            "rms_percent": self.rms_percent,
            "bias_percent": self.bias_percent,
            "inside": self.inside[0],
            "modes": len(self.modes),
            "intervals_that_say_nothing": len(self.modes) - self.inside[1],
            "splits": [_split_as_dict(split, self.level) for split in self.splits],
        }

    def plot(self, ax: Axes | None = None) -> Figure:
        """Draw errors of natural frequencies with their intervals, and receptances with bands; see `Result.plot`."""
        from receptance.identification.figures.transfer import draw_transfer

        return draw_transfer(self, ax)

    def _mode_table(self) -> Table:
        columns = (
            "held out",
            Column("mode", form="d"),
            Column("measured", "Hz", ".1f"),
            Column("predicted", "Hz", ".1f"),
            Column("error", "%", "+.2f"),
            Column("interval", "Hz", ".1f"),
            Column("inside"),
        )
        rows: list[list[Cell]] = [
            [
                mode.label or mode.configuration,
                "-" if mode.mode is None else mode.mode,
                mode.measured_hz,
                "none" if mode.predicted_hz is None else mode.predicted_hz,
                mode.error_percent,
                SAYS_NOTHING if mode.says_nothing else mode.interval_hz,
                mode.inside,
            ]
            for mode in self.modes
        ]
        return Table(f"Natural frequencies held out, {100.0 * self.level:g} % intervals", columns, rows)

    def _frf_table(self) -> Table:
        columns = ("held out", Column("log-spectral\ndistance", "dB", ".2f"), Column("lines in\nthe band", "%", ".0f"))
        rows = [(frf.label or frf.configuration, frf.distance_decibel, 100.0 * frf.share_inside) for frf in self.frfs]
        return Table("Frequency responses held out", columns, rows)

    def _value_table(self) -> Table:
        rows: list[list[Cell]] = []
        for name, values in self.identified.items():
            known = sorted(value for value in values if value is not None)
            apart = 100.0 * (known[-1] / known[0] - 1.0) if known[0] > 0.0 else None
            rows.append([name, len(known), known[0], known[-1], apart])
        spread = (Column("least"), Column("most"), Column("apart", "%", ".2g"))
        return Table("Identified over the splits, SI units", ("parameter", Column("splits", form="d"), *spread), rows)

    def __repr__(self) -> str:
        return f"Transfer({self._headline()})"

    def _headline(self) -> str:
        parts = [f"{len(self.splits)} splits"]
        if self.rms_percent is not None:
            hits, count = self.inside
            parts.append(f"{len(self.modes)} modes predicted to {self.rms_percent:.3g} % rms")
            parts.append(f"{self.bias_percent:+.2f} % on average")
            parts.append(f"{hits} of {count} in their {100.0 * self.level:g} % intervals")
            if len(self.modes) > count:
                parts.append(f"{len(self.modes) - count} without an interval, or with one too wide to be useful")
        if self.frfs:
            worst = max(frf.distance_decibel for frf in self.frfs)
            parts.append(f"{len(self.frfs)} FRFs at most {worst:.3g} dB off")
        return ", ".join(parts)


def _split_as_dict(split: Split, level: float) -> dict[str, Any]:
    fit = split.identified
    return {
        "held_out": split.held_out,
        "fitted": split.fitted,
        "identified": None
        if fit is None
        else {name: {"value": value, "interval": fit.interval(name, level)} for name, value in fit.values.items()},
        "converged": None if fit is None else fit.converged,
        "rms": None if fit is None else fit.rms,
        "advice": [] if fit is None else fit.advice,
        "modes": [
            {
                "configuration": mode.configuration,
                "label": mode.label,
                "mode": mode.mode,
                "measured_hz": mode.measured_hz,
                "predicted_hz": mode.predicted_hz,
                "standard_error_hz": mode.deviation_hz,
                "reading_deviation_hz": mode.reading_hz,
                "interval_hz": mode.interval_hz,
                "error_percent": mode.error_percent,
                "inside": mode.inside,
            }
            for mode in split.modes
        ],
        "frfs": [_frf_as_dict(frf) for frf in split.frfs],
        "not_predicted": split.not_predicted,
    }


def _frf_as_dict(frf: TransferredFRF) -> dict[str, Any]:
    low, high = frf.predicted.band(frf.level)
    return {
        "configuration": frf.configuration,
        "label": frf.label,
        "log_spectral_distance_db": frf.distance_decibel,
        "share_inside": frf.share_inside,
        "frequency_hz": frf.predicted.frequency_hz.real,
        "measured_magnitude": np.abs(frf.measured),
        "predicted_magnitude": np.abs(frf.predicted.receptance),
        "interval": (low, high),
    }
