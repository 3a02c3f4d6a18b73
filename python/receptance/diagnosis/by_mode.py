"""Residuals as people read them: frequency, damping, level and phase of each mode, by configuration."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from receptance.diagnosis.fitting import Fit
from receptance.errors import ReceptanceWarning
from receptance.frf import FRF
from receptance.identification.observations import MeasuredFrequencies, MeasuredFRF
from receptance.modal import ModeEstimate, circle_fit, find_peaks

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.identification.task import Observation

__all__ = ["Curve", "ModeResidual", "curve_of", "curves", "modes_of", "residuals_by_mode"]

_SAME_MODE = 0.06
"""Peaks further apart than this, relatively, are different modes."""
_AROUND = 4.0
"""A circle is fitted over so many half-power widths on each side."""


@dataclass(frozen=True, eq=False)
class Curve:
    """One observation as measured and as a fit has it.

    Attributes
    ----------
    label, configuration : str
        The observation's.
    frequency_hz : ndarray
        Lines or natural frequencies `(n,)`, the measured ones for those.
    measured, modelled : ndarray
        Receptances `(n,)`, complex, or natural frequencies in Hz.
    residual : ndarray
        In standard deviations: `(2, n)` real and imaginary part of the logarithm, or `(1, n)`.
    damping_ratio : ndarray or None
        `(n,)` modelled damping ratios of natural frequencies; not a number where none was measured.
    """

    label: str
    configuration: str
    frequency_hz: NDArray[np.float64]
    measured: NDArray[np.complex128] | NDArray[np.float64]
    modelled: NDArray[np.complex128] | NDArray[np.float64]
    residual: NDArray[np.float64]
    damping_ratio: NDArray[np.float64] | None = None


@dataclass(frozen=True)
class ModeResidual:
    """What is left at one mode of one observation: measured less modelled.

    Attributes
    ----------
    label, configuration : str
        The observation's.
    mode : int
        Its number: of the elastic modes where natural frequencies were measured, else among the peaks in the band.
    measured_hz : float
        The measured natural frequency.
    frequency_percent, damping_percent : float
        Of the measured frequency and of the modelled damping ratio; NaN where the lines do not show it.
    level_db, phase_deg : float
        At the peaks of both; NaN where only frequencies were observed.
    """

    label: str
    configuration: str
    mode: int
    measured_hz: float
    frequency_percent: float
    damping_percent: float
    level_db: float
    phase_deg: float


def curves(fit: Fit) -> list[Curve]:
    """Return every observation as measured and as fitted, from the residuals of the fit."""
    parts = fit.problem.parts(fit.residual)
    return [curve_of(one, part) for one, part in zip(fit.model.observations, parts, strict=True)]


def curve_of(one: Observation, residual: NDArray[np.float64]) -> Curve:
    """Return an observation as measured and as modelled, from its residual in standard deviations."""
    label, configuration = one.label or one.configuration, one.configuration or one.label
    if isinstance(one, MeasuredFrequencies):
        # Calculated minus measured.
        own, rest = np.split(residual, [one.frequency_hz.size])
        unit = one.frequency_hz if one.standard_deviation_hz is None else one.standard_deviation_hz
        modelled = one.frequency_hz + own * unit
        ratios = np.full(one.frequency_hz.size, np.nan)
        if one.damping_ratio is not None:
            given = one.damping_ratio[one.damped]
            known = one.standard_deviation_damping
            ratios[one.damped] = given + rest * (np.maximum(given, 1e-4) if known is None else known[one.damped])
        return Curve(label, configuration, one.frequency_hz, one.frequency_hz, modelled, own[None], ratios)
    pair = residual.reshape(2, -1)
    spread = np.ones(one.frequency_hz.size) if one.standard_deviation is None else one.standard_deviation
    modelled = one.receptance * np.exp(-(pair[0] + 1j * pair[1]) * spread)
    return Curve(label, configuration, one.frequency_hz.real, one.receptance, modelled, pair)


def residuals_by_mode(fit: Fit) -> tuple[ModeResidual, ...]:
    """Return what a fit leaves at each mode that stands out of the data.

    Modes of receptances are the measured peaks; frequency and damping come from a circle through each, and through the
    modelled one beside it.
    """
    found: list[ModeResidual] = []
    for one, curve in zip(fit.model.observations, curves(fit), strict=True):
        found += modes_of(one, curve)
    return tuple(found)


def modes_of(one: Observation, curve: Curve) -> list[ModeResidual]:
    """Return what is left at each mode of one observation."""
    return _at_peaks(one, curve) if isinstance(one, MeasuredFRF) else _at_frequencies(one, curve)


def _at_frequencies(one: MeasuredFrequencies, curve: Curve) -> list[ModeResidual]:
    measured, modelled = curve.measured.real, curve.modelled.real
    nothing = float("nan")
    damping = np.full(measured.size, nothing)
    if one.damping_ratio is not None and curve.damping_ratio is not None:
        damping = 100.0 * (one.damping_ratio / curve.damping_ratio - 1.0)
    return [
        ModeResidual(
            curve.label, curve.configuration, mode, float(f), float(100.0 * (f - g) / f), float(d), nothing, nothing
        )
        for mode, f, g, d in zip(one.modes, measured, modelled, damping, strict=True)
    ]


def _at_peaks(one: MeasuredFRF, curve: Curve) -> list[ModeResidual]:
    decay = float(-2.0 * np.pi * np.median(np.imag(one.frequency_hz)))
    with warnings.catch_warnings():
        # What a drive point should look like was said when the data came in.
        warnings.simplefilter("ignore", ReceptanceWarning)
        measured = FRF(
            frequency_hz=curve.frequency_hz,
            values=curve.measured,
            decay_rate=decay,
            log_variance=None if one.standard_deviation is None else np.square(one.standard_deviation),
        )
        modelled = FRF(frequency_hz=curve.frequency_hz, values=curve.modelled, decay_rate=decay)
        theirs = _modes(modelled)
        rows = []
        for number, mode in enumerate(_modes(measured)):
            near = min(theirs, key=lambda other: abs(other.frequency_hz - mode.frequency_hz), default=None)
            if near is not None and abs(near.frequency_hz / mode.frequency_hz - 1.0) > _SAME_MODE:
                near = None
            rows.append(_compared(curve, number + 1, mode, near))
    return rows


def _modes(frf: FRF) -> list[ModeEstimate]:
    """The peaks, each by a circle where there are lines enough."""
    found: list[ModeEstimate] = []
    for peak in find_peaks(frf):
        half = _AROUND * peak.frequency_hz * (peak.damping_ratio if np.isfinite(peak.damping_ratio) else 0.01)
        try:
            found.append(circle_fit(frf, low_hz=peak.frequency_hz - half, high_hz=peak.frequency_hz + half))
        except ValueError:
            found.append(peak)
    return found


def _compared(curve: Curve, number: int, mode: ModeEstimate, near: ModeEstimate | None) -> ModeResidual:
    if near is None:
        nothing = float("nan")
        return ModeResidual(
            curve.label, curve.configuration, number, mode.frequency_hz, nothing, nothing, nothing, nothing
        )
    own = _highest(curve.frequency_hz, curve.measured, mode.frequency_hz)
    other = _highest(curve.frequency_hz, curve.modelled, near.frequency_hz)
    return ModeResidual(
        label=curve.label,
        configuration=curve.configuration,
        mode=number,
        measured_hz=mode.frequency_hz,
        frequency_percent=100.0 * (mode.frequency_hz - near.frequency_hz) / mode.frequency_hz,
        damping_percent=100.0 * (mode.damping_ratio / near.damping_ratio - 1.0),
        level_db=float(20.0 * np.log10(abs(own / other))),
        phase_deg=float(np.degrees(np.angle(own / other))),
    )


def _highest(
    lines: NDArray[np.float64], values: NDArray[np.complex128] | NDArray[np.float64], frequency: float
) -> complex:
    """The value at the highest line within one percent of a natural frequency."""
    near = np.flatnonzero(np.abs(lines - frequency) <= 0.01 * frequency)
    if not near.size:
        near = np.array([np.argmin(np.abs(lines - frequency))])
    return complex(values[near[np.argmax(np.abs(values[near]))]])
