"""Residuals by mode: frequency, damping, level and phase of each mode, and their bias over the configurations."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import special

from receptance.diagnosis.fitting import Fit
from receptance.diagnosis.model import Model
from receptance.diagnosis.thresholds import (
    BIAS_CHANCE,
    BIAS_CONFIGURATIONS,
    CIRCLE_WIDTHS,
    LEAST_BIAS,
)
from receptance.errors import ReceptanceWarning
from receptance.fit.discrepancy_fit import SAME_MODE
from receptance.fit.line_selection import NOISIEST_LINE, in_antiresonance
from receptance.fit.observation import Observation
from receptance.frf import FRF
from receptance.modal import ModeEstimate, circle_fit, find_peaks
from receptance.model.anatomy import overhang_of


@dataclass(frozen=True, eq=False)
class Curve:
    """One observation, measured and modelled."""

    label: str
    configuration: str
    frequency_hz: NDArray[np.float64]
    """`(n,)` lines, or measured natural frequencies, in Hz."""
    measured: NDArray[np.complex128] | NDArray[np.float64]
    """`(n,)` complex receptances, or natural frequencies in Hz."""
    modelled: NDArray[np.complex128] | NDArray[np.float64]
    """The same of the model."""
    residual: NDArray[np.float64]
    """In standard deviations: `(2, n)` real and imaginary part of the logarithm, or `(1, n)`."""
    damping_ratio: NDArray[np.float64] | None = None
    """`(n,)` modelled damping ratios of natural frequencies; NaN where none was measured."""


@dataclass(frozen=True)
class ModeResidual:
    """Error of one mode of one observation: modelled less measured, as everywhere in results."""

    label: str
    """Label of the observation."""
    configuration: str
    """Configuration of the observation."""
    mode: int
    """Number of the elastic mode where natural frequencies were measured, else of the peak in the band."""
    measured_hz: float
    """The measured natural frequency."""
    frequency_percent: float = math.nan
    """In percent of the measured frequency; NaN where the lines do not show it."""
    damping_percent: float = math.nan
    """In percent of the measured damping ratio; NaN where the lines do not show it."""
    level_db: float = math.nan
    """At the peaks of both; NaN for natural frequencies."""
    phase_deg: float = math.nan
    """At the peaks of both; NaN for natural frequencies."""


def curves(fit: Fit) -> list[Curve]:
    """Return every observation, measured and fitted."""
    return [curve_of(observation, part) for observation, part in zip(fit.model.observations, fit.parts, strict=True)]


def curve_of(observation: Observation, residual: NDArray[np.float64]) -> Curve:
    """Return an observation, measured and modelled, from its residual in standard deviations."""
    label, configuration = (
        observation.label or observation.configuration,
        observation.configuration or observation.label,
    )
    if not observation.is_receptance:
        # Calculated minus measured.
        own, rest = np.split(residual, [observation.frequency_hz.size])
        measured = observation.frequency_hz.real
        unit = measured if observation.standard_deviation is None else observation.standard_deviation
        modelled = measured + own * unit
        ratios = np.full(measured.size, np.nan)
        if observation.damping_ratio is not None:
            given = observation.damping_ratio[observation.damped]
            known = observation.standard_deviation_damping
            ratios[observation.damped] = given + rest * (
                np.maximum(given, 1e-4) if known is None else known[observation.damped]
            )
        return Curve(label, configuration, measured, measured, modelled, own[None], ratios)
    pair = residual.reshape(2, -1)
    deviation = (
        np.ones(observation.frequency_hz.size)
        if observation.standard_deviation is None
        else observation.standard_deviation
    )
    receptance = observation.receptance * np.exp(-(pair[0] + 1j * pair[1]) * deviation)
    return Curve(label, configuration, observation.frequency_hz.real, observation.receptance, receptance, pair)


def residuals_by_mode(fit: Fit) -> tuple[ModeResidual, ...]:
    """Return the residuals of a fit at each mode that the data show.

    Modes of receptances are the measured peaks. Frequency and damping are those of a circle fitted to the measured
    peak, and to the nearest modelled one.
    """
    pairs = zip(fit.model.observations, curves(fit), strict=True)
    return tuple(mode for observation, curve in pairs for mode in modes_of(observation, curve))


def residuals_of_frequencies(fit: Fit) -> list[ModeResidual]:
    """Return the residuals of a fit at each measured natural frequency, without those of receptances."""
    pairs = zip(fit.model.observations, fit.parts, strict=True)
    return [
        mode
        for observation, residual in pairs
        if not observation.is_receptance
        for mode in _at_frequencies(observation, curve_of(observation, residual))
    ]


def modes_of(observation: Observation, curve: Curve) -> list[ModeResidual]:
    """Return the residuals at each mode of one observation."""
    return _at_peaks(observation, curve) if observation.is_receptance else _at_frequencies(observation, curve)


def _at_frequencies(observation: Observation, curve: Curve) -> list[ModeResidual]:
    measured, modelled = curve.measured.real, curve.modelled.real
    damping = np.full(measured.size, math.nan)
    if observation.damping_ratio is not None and curve.damping_ratio is not None:
        given = np.where(observation.damping_ratio > 0.0, observation.damping_ratio, math.nan)
        damping = 100.0 * (curve.damping_ratio / given - 1.0)
    return [
        ModeResidual(curve.label, curve.configuration, mode, float(f), float(100.0 * (g - f) / f), float(d))
        for mode, f, g, d in zip(observation.modes, measured, modelled, damping, strict=True)
    ]


def _at_peaks(observation: Observation, curve: Curve) -> list[ModeResidual]:
    decay = float(-2.0 * np.pi * np.median(np.imag(observation.frequency_hz)))
    measured = _Record(curve.frequency_hz, curve.measured, decay, observation.standard_deviation)
    others = _Record(curve.frequency_hz, curve.modelled, decay, None).modes()
    rows = []
    for number, mode in enumerate(_modes_of_measured(measured)):
        near = min(others, key=lambda other: abs(other.frequency_hz - mode.frequency_hz), default=None)
        if near is not None and abs(near.frequency_hz / mode.frequency_hz - 1.0) > SAME_MODE:
            near = None
        rows.append(_compare(curve, number + 1, mode, near))
    return rows


@dataclass(frozen=True, eq=False)
class _Record:
    """A receptance on real lines with the decay rate of its window; equal where all of its numbers are."""

    frequency_hz: NDArray[np.float64]
    values: NDArray[Any]
    decay_rate: float
    standard_deviation: NDArray[np.float64] | None

    def modes(self) -> tuple[ModeEstimate, ...]:
        """Return its modes, without peaks of noise."""
        with warnings.catch_warnings():
            # Warnings on drive points were given when the data were read.
            warnings.simplefilter("ignore", ReceptanceWarning)
            frf = FRF(
                frequency_hz=self.frequency_hz,
                values=self.values,
                decay_rate=self.decay_rate,
                log_variance=None if self.standard_deviation is None else np.square(self.standard_deviation),
            )
            modes = _modes(frf)
        if self.standard_deviation is None:
            return modes
        # A peak within an antiresonance may be noise. At a resonance a large deviation is that of a discrepancy.
        is_noisy = self.standard_deviation > NOISIEST_LINE
        is_noise = is_noisy & in_antiresonance(self.frequency_hz, np.abs(self.values))
        nearest = [int(np.argmin(np.abs(self.frequency_hz - mode.frequency_hz))) for mode in modes]
        return tuple(mode for mode, line in zip(modes, nearest, strict=True) if not is_noise[line])

    @cached_property
    def _key(self) -> tuple[float, tuple[bytes, ...]]:
        arrays = (self.frequency_hz, self.values, self.standard_deviation)
        return self.decay_rate, tuple(array.tobytes() for array in arrays if array is not None)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Record) and self._key == other._key

    def __hash__(self) -> int:
        return hash(self._key)


@lru_cache(maxsize=256)
def _modes_of_measured(record: _Record) -> tuple[ModeEstimate, ...]:
    """Return the modes of a measured receptance, which is compared with the predictions of many explanations."""
    return record.modes()


def _modes(frf: FRF) -> tuple[ModeEstimate, ...]:
    """Return the peaks, each from a circle fit where there are enough lines."""
    modes: list[ModeEstimate] = []
    for peak in find_peaks(frf):
        half = CIRCLE_WIDTHS * peak.frequency_hz * (peak.damping_ratio if np.isfinite(peak.damping_ratio) else 0.01)
        try:
            modes.append(circle_fit(frf, low_hz=peak.frequency_hz - half, high_hz=peak.frequency_hz + half))
        except ValueError:
            modes.append(peak)
    return tuple(modes)


def _compare(curve: Curve, number: int, mode: ModeEstimate, near: ModeEstimate | None) -> ModeResidual:
    if near is None:
        return ModeResidual(curve.label, curve.configuration, number, mode.frequency_hz)
    measured = _highest(curve.frequency_hz, curve.measured, mode.frequency_hz)
    modelled = _highest(curve.frequency_hz, curve.modelled, near.frequency_hz)
    return ModeResidual(
        label=curve.label,
        configuration=curve.configuration,
        mode=number,
        measured_hz=mode.frequency_hz,
        frequency_percent=100.0 * (near.frequency_hz - mode.frequency_hz) / mode.frequency_hz,
        damping_percent=100.0 * (near.damping_ratio / mode.damping_ratio - 1.0),
        level_db=float(20.0 * np.log10(abs(modelled / measured))),
        phase_deg=float(np.degrees(np.angle(modelled / measured))),
    )


def _highest(
    lines: NDArray[np.float64], values: NDArray[np.complex128] | NDArray[np.float64], frequency: float
) -> complex:
    """Return the largest value within one percent of a natural frequency."""
    near = np.flatnonzero(np.abs(lines - frequency) <= 0.01 * frequency)
    if not near.size:
        near = np.array([np.argmin(np.abs(lines - frequency))])
    return complex(values[near[np.argmax(np.abs(values[near]))]])


@dataclass(frozen=True)
class Bias:
    """A common sign of the errors of one natural frequency in a group of tools."""

    mode: int
    """Number of the mode."""
    slenderness: tuple[float, float]
    """Smallest and largest ratio of overhang and diameter in the group."""
    configurations: tuple[str, ...]
    """The group."""
    mean_percent: float
    """Mean of modelled less measured, in percent of measured."""
    deviation_percent: float
    """Standard deviation of a single error."""

    def __str__(self) -> str:
        low, high = self.slenderness
        count = len(self.configurations)
        way = "low" if self.mean_percent < 0.0 else "high"
        return (
            f"mode {self.mode} of the {count} tools with overhangs of {low:.1f} to {high:.1f} diameters is calculated "
            f"{abs(self.mean_percent):.2g} % too {way} on average, with the same sign in all of them"
        )


def slenderness_of(model: Model) -> dict[str, float]:
    """Return the ratio of overhang and diameter of each configuration with a tool in a joint."""
    found: dict[str, float] = {}
    for name, observation, anatomy in zip(model.configuration_of, model.observations, model.anatomies, strict=True):
        if anatomy.joint and anatomy.tool:
            length = overhang_of(observation.assembly, anatomy)
            diameter = observation.assembly.get(f"{length.rpartition('.')[0]}.outer_diameter")
            found[name] = observation.assembly.get(length) / diameter
    return found


def bias_of(modes: Sequence[ModeResidual], slenderness: Mapping[str, float]) -> Bias | None:
    """Return the most significant common sign of errors: of all tools, or of a half or a third of them by slenderness.

    Parameters
    ----------
    modes : sequence of ModeResidual
        Residuals by mode.
    slenderness : mapping of str to float
        Of the configurations, see `slenderness_of`.
    """
    known = [one for one in modes if one.configuration in slenderness and np.isfinite(one.frequency_percent)]
    order = sorted({one.configuration for one in known}, key=lambda name: slenderness[name])
    names = np.array(order, dtype=object)
    groups = [tuple(map(str, part)) for count in (1, 2, 3) for part in np.array_split(names, count)]
    tried: list[tuple[float, Bias]] = []
    for number in sorted({one.mode for one in known}):
        errors = {one.configuration: one.frequency_percent for one in known if one.mode == number}
        for group in groups:
            own = {name: errors[name] for name in group if name in errors}
            if len(own) >= BIAS_CONFIGURATIONS:
                tried.append(_test(number, own, slenderness))
    if not tried:
        return None
    chance, best = min(tried, key=lambda one: one[0])
    # Bonferroni correction for the number of groups and modes.
    return best if chance * len(tried) < BIAS_CHANCE and abs(best.mean_percent) >= LEAST_BIAS else None


def _test(number: int, errors: Mapping[str, float], slenderness: Mapping[str, float]) -> tuple[float, Bias]:
    """Return the probability of so significant a common sign by chance, and the bias."""
    values = np.array(list(errors.values()))
    mean, deviation = float(np.mean(values)), float(np.std(values, ddof=1))
    same_sign = bool(np.all(np.sign(values) == np.sign(mean)))
    t = abs(mean) / max(deviation / np.sqrt(values.size), 1e-9)
    ratios = [slenderness[name] for name in errors]
    bias = Bias(number, (min(ratios), max(ratios)), tuple(errors), mean, deviation)
    return (2.0 * float(special.stdtr(values.size - 1, -t)) if same_sign else 1.0), bias
