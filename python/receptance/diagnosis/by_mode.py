"""Residuals by mode: frequency, damping, level and phase of each mode, and their bias over the configurations."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import special

from receptance.diagnosis.fitting import Fit
from receptance.diagnosis.model import Model
from receptance.diagnosis.thresholds import BIAS_CHANCE, BIAS_CONFIGURATIONS, CIRCLE_WIDTHS, LEAST_BIAS
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

    def on(self, lines: NDArray[np.bool_]) -> Curve:
        """Return a receptance on some of its lines."""
        names = ("frequency_hz", "measured", "modelled", "residual")
        return replace(self, **{name: getattr(self, name)[..., lines] for name in names})


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
    label = observation.label or observation.configuration
    configuration = observation.configuration or observation.label
    lines = observation.frequency_hz.real
    if observation.is_receptance:
        pair = residual.reshape(2, -1)
        logarithm = -(pair[0] + 1j * pair[1]) * observation.standard_deviations[: lines.size]
        receptance = observation.receptance
        return Curve(label, configuration, lines, receptance, receptance * np.exp(logarithm), pair)
    # Calculated minus measured.
    frequencies, damping = np.split(residual, [lines.size])
    unit = lines if observation.standard_deviation is None else observation.standard_deviation
    ratios = np.full(lines.size, np.nan)
    if observation.damping_ratio is not None:
        measured, deviation = observation.damping_ratio[observation.damped], observation.standard_deviation_damping
        scale = np.maximum(measured, 1e-4) if deviation is None else deviation[observation.damped]
        ratios[observation.damped] = measured + damping * scale
    return Curve(label, configuration, lines, lines, lines + frequencies * unit, frequencies[None], ratios)


def residuals_by_mode(fit: Fit, *, of_receptances: bool = True) -> tuple[ModeResidual, ...]:
    """Return the residuals of a fit at each mode that the data show.

    Modes of receptances, which may be left out, are the measured peaks. Frequency and damping are those of a circle
    fitted to the measured peak, and to the nearest modelled one.
    """
    pairs = zip(fit.model.observations, fit.parts, strict=True)
    return tuple(
        mode
        for observation, residual in pairs
        if of_receptances or not observation.is_receptance
        for mode in modes_of(observation, curve_of(observation, residual))
    )


def modes_of(observation: Observation, curve: Curve) -> list[ModeResidual]:
    """Return the residuals at each mode of one observation."""
    return _at_peaks(observation, curve) if observation.is_receptance else _at_frequencies(observation, curve)


def _at_frequencies(observation: Observation, curve: Curve) -> list[ModeResidual]:
    measured, modelled = curve.measured.real, curve.modelled.real
    damping = np.full(measured.size, math.nan)
    if observation.damping_ratio is not None and curve.damping_ratio is not None:
        ratio = np.where(observation.damping_ratio > 0.0, observation.damping_ratio, math.nan)
        damping = 100.0 * (curve.damping_ratio / ratio - 1.0)
    return [
        ModeResidual(curve.label, curve.configuration, mode, float(f), float(100.0 * (g - f) / f), float(d))
        for mode, f, g, d in zip(observation.modes, measured, modelled, damping, strict=True)
    ]


def measured_modes(observation: Observation) -> tuple[ModeEstimate, ...]:
    """Return the modes of a measured receptance, without peaks of noise in antiresonances."""
    deviation = observation.standard_deviation
    return _modes(
        observation.frequency_hz.real.tobytes(), observation.receptance.tobytes(), _decay(observation),
        b"" if deviation is None else deviation.tobytes(),
    )  # fmt: skip


def _decay(observation: Observation) -> float:
    return float(-2.0 * np.pi * np.median(np.imag(observation.frequency_hz)))


def _at_peaks(observation: Observation, curve: Curve) -> list[ModeResidual]:
    decay = _decay(observation)
    lines, deviation = curve.frequency_hz.tobytes(), observation.standard_deviation
    measured = _modes(lines, curve.measured.tobytes(), decay, b"" if deviation is None else deviation.tobytes())
    modelled = _modes(lines, curve.modelled.tobytes(), decay, b"")
    return [_compare(curve, number, mode, modelled) for number, mode in enumerate(measured, 1)]


@lru_cache(maxsize=1024)
def _modes(lines: bytes, receptance: bytes, decay_rate: float, deviation: bytes) -> tuple[ModeEstimate, ...]:
    """Return the modes of a receptance without peaks of noise, each from a circle fit where there are enough lines.

    A measured receptance is compared with the predictions of many explanations, so that its modes are kept. The
    arguments are those of arrays; without standard deviations the last one is empty.
    """
    frequency_hz, values = np.frombuffer(lines), np.frombuffer(receptance, dtype=np.complex128)
    standard_deviation = np.frombuffer(deviation) if deviation else None
    modes: list[ModeEstimate] = []
    with warnings.catch_warnings():
        # Warnings on drive points were given when the data were read.
        warnings.simplefilter("ignore", ReceptanceWarning)
        log_variance = None if standard_deviation is None else np.square(standard_deviation)
        frf = FRF(frequency_hz=frequency_hz, values=values, decay_rate=decay_rate, log_variance=log_variance)
        for peak in find_peaks(frf):
            half = CIRCLE_WIDTHS * peak.frequency_hz * (peak.damping_ratio if np.isfinite(peak.damping_ratio) else 0.01)
            try:
                modes.append(circle_fit(frf, low_hz=peak.frequency_hz - half, high_hz=peak.frequency_hz + half))
            except ValueError:
                modes.append(peak)
    if standard_deviation is None:
        return tuple(modes)
    # A peak within an antiresonance may be noise. At a resonance a large deviation is that of a discrepancy.
    is_noise = (standard_deviation > NOISIEST_LINE) & in_antiresonance(frequency_hz, np.abs(values))
    return tuple(mode for mode in modes if not is_noise[np.argmin(np.abs(frequency_hz - mode.frequency_hz))])


def _compare(curve: Curve, number: int, mode: ModeEstimate, modelled: Sequence[ModeEstimate]) -> ModeResidual:
    """Return the difference of the nearest modelled mode and a measured one."""
    missing = ModeResidual(curve.label, curve.configuration, number, mode.frequency_hz)
    near = min(modelled, key=lambda other: abs(other.frequency_hz - mode.frequency_hz), default=None)
    if near is None or abs(near.frequency_hz / mode.frequency_hz - 1.0) > SAME_MODE:
        return missing
    ratio = _highest(curve.frequency_hz, curve.modelled, near) / _highest(curve.frequency_hz, curve.measured, mode)
    return replace(
        missing,
        frequency_percent=100.0 * (near.frequency_hz - mode.frequency_hz) / mode.frequency_hz,
        damping_percent=100.0 * (near.damping_ratio / mode.damping_ratio - 1.0),
        level_db=float(20.0 * np.log10(abs(ratio))),
        phase_deg=float(np.degrees(np.angle(ratio))),
    )


def _highest(lines: NDArray[np.float64], values: NDArray[np.inexact], mode: ModeEstimate) -> complex:
    """Return the largest value within one percent of a natural frequency, or the nearest one."""
    distance = np.abs(lines - mode.frequency_hz)
    near = np.flatnonzero(distance <= max(0.01 * mode.frequency_hz, distance.min()))
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
    ratios: dict[str, float] = {}
    for name, observation, anatomy in zip(model.configuration_of, model.observations, model.anatomies, strict=True):
        if anatomy.joint and anatomy.tool:
            length = overhang_of(observation.assembly, anatomy)
            # Of a conical shank the diameter at the joint.
            (_, (diameter, _)) = observation.assembly.parts[anatomy.tool[-1]].segments[-1].ends
            ratios[name] = observation.assembly.get(length) / diameter
    return ratios


def bias_of(modes: Sequence[ModeResidual], slenderness: Mapping[str, float]) -> Bias | None:
    """Return the most significant common sign of errors: of all tools, or of a half or a third of them by slenderness.

    `slenderness` is that of the configurations, see `slenderness_of`.
    """
    errors: dict[int, dict[str, float]] = {}
    for mode in modes:
        if mode.configuration in slenderness and np.isfinite(mode.frequency_percent):
            errors.setdefault(mode.mode, {})[mode.configuration] = mode.frequency_percent
    order = sorted({name for of_mode in errors.values() for name in of_mode}, key=lambda name: slenderness[name])
    groups = [tuple(map(str, part)) for count in (1, 2, 3) for part in np.array_split(np.array(order, object), count)]
    tried: list[tuple[float, Bias]] = []
    for number, of_mode in sorted(errors.items()):
        for group in groups:
            in_group = {name: of_mode[name] for name in group if name in of_mode}
            if len(in_group) >= BIAS_CONFIGURATIONS:
                tried.append(_test(number, in_group, slenderness))
    chance, best = min(tried, key=lambda test: test[0], default=(1.0, None))
    # Bonferroni correction for the number of groups and modes.
    if best is None or chance * len(tried) >= BIAS_CHANCE or abs(best.mean_percent) < LEAST_BIAS:
        return None
    return best


def _test(number: int, errors: Mapping[str, float], slenderness: Mapping[str, float]) -> tuple[float, Bias]:
    """Return the probability of so significant a common sign by chance, and the bias."""
    values = np.array(list(errors.values()))
    mean, deviation = float(np.mean(values)), float(np.std(values, ddof=1))
    t = abs(mean) / max(deviation / np.sqrt(values.size), 1e-9)
    same_sign = np.all(np.sign(values) == np.sign(mean))
    chance = 2.0 * float(special.stdtr(values.size - 1, -t)) if same_sign else 1.0
    ratios = [slenderness[name] for name in errors]
    return chance, Bias(number, (min(ratios), max(ratios)), tuple(errors), mean, deviation)
