"""Other overhangs (table 2) and other parameter sets (table 3) against what was measured."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from receptance.studies.er32.holder import HolderModel
from receptance.studies.er32.tables import ParameterSet, Published

__all__ = ["ModeError", "SetVerdict", "TransferRow", "judge_sets", "predict_transfers", "rms"]

Stiffness = tuple[float, float]


@dataclass(frozen=True)
class TransferRow:
    """One natural frequency of table 2: measured, the paper's prediction, ours."""

    diameter_mm: float
    overhang_mm: float
    mode: int
    measured_hz: float
    published_hz: float
    predicted_hz: float

    @property
    def error_percent(self) -> float:
        """Our prediction against the measurement."""
        return 100.0 * (self.predicted_hz / self.measured_hz - 1.0)

    @property
    def published_error_percent(self) -> float:
        """The paper's prediction against the measurement."""
        return 100.0 * (self.published_hz / self.measured_hz - 1.0)

    @property
    def against_published_percent(self) -> float:
        """Our prediction against the paper's."""
        return 100.0 * (self.predicted_hz / self.published_hz - 1.0)


def predict_transfers(
    model: HolderModel, published: Published, stiffness: Mapping[float, Stiffness]
) -> tuple[TransferRow, ...]:
    """Predict the natural frequencies of table 2; `stiffness` is (k_y, k_theta) by diameter in mm."""
    rows = []
    for transfer in published.transfers:
        length = published.mount(transfer.diameter_mm).holder_length_mm
        joint = stiffness[transfer.diameter_mm]
        assembly = model.assembly(transfer.diameter_mm, transfer.overhang_mm, length, *joint)
        ours = assembly.lowest_natural_frequencies(len(transfer.measured_hz))[0]
        for mode, (measured, paper) in enumerate(zip(transfer.measured_hz, transfer.predicted_hz, strict=True), 1):
            rows.append(
                TransferRow(transfer.diameter_mm, transfer.overhang_mm, mode, measured, paper, float(ours[mode - 1]))
            )
    return tuple(rows)


def rms(values: Sequence[float]) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


@dataclass(frozen=True)
class ModeError:
    """How far a parameter set puts one mode at one overhang from its measurement."""

    overhang_mm: float
    mode: int
    measured_hz: float
    predicted_hz: float

    @property
    def percent(self) -> float:
        """Predicted against measured."""
        return 100.0 * (self.predicted_hz / self.measured_hz - 1.0)


@dataclass(frozen=True)
class SetVerdict:
    """One parameter set of table 3 at all overhangs, the longest first."""

    name: str
    k_y: float
    k_theta: float
    errors: tuple[ModeError, ...]
    threshold_percent: float

    @property
    def worst(self) -> ModeError:
        """The mode that is furthest off."""
        return max(self.errors, key=lambda error: abs(error.percent))

    @property
    def betrayed_by(self) -> tuple[ModeError, ...]:
        """The modes that are further off than the threshold."""
        return tuple(error for error in self.errors if abs(error.percent) > self.threshold_percent)

    def first_betrayal(self, mode: int | None = None) -> ModeError | None:
        """Return the betraying mode with the longest overhang, of all modes or of the given one.

        A joint is usually matched to the first mode of a long tool: this is how far the overhang must shrink
        before that very mode gives the set away.
        """
        return next((error for error in self.betrayed_by if mode in (None, error.mode)), None)


def judge_sets(model: HolderModel, published: Published, threshold_percent: float) -> tuple[SetVerdict, ...]:
    """Compare table 3's sets with the measured modes at every overhang of their tool.

    Measured are table 2's overhangs and, at the recommended torque, the one of table 4.
    """
    return tuple(_judge(model, published, chosen, threshold_percent) for chosen in published.parameter_sets)


def _judge(model: HolderModel, published: Published, chosen: ParameterSet, threshold: float) -> SetVerdict:
    mount = published.mount(chosen.diameter_mm)
    reading = published.reading(chosen.diameter_mm, published.recommended_torque_nm)
    measured = {mount.overhang_mm: tuple(reading.frequency_hz)}
    measured |= {t.overhang_mm: t.measured_hz for t in published.transfers if t.diameter_mm == chosen.diameter_mm}
    errors = []
    for overhang in sorted(measured, reverse=True):
        frequencies = measured[overhang]
        assembly = model.assembly(chosen.diameter_mm, overhang, mount.holder_length_mm, chosen.k_y, chosen.k_theta)
        ours = assembly.lowest_natural_frequencies(len(frequencies))[0]
        errors += [ModeError(overhang, mode, value, float(ours[mode - 1])) for mode, value in enumerate(frequencies, 1)]
    return SetVerdict(chosen.name, chosen.k_y, chosen.k_theta, tuple(errors), threshold)
