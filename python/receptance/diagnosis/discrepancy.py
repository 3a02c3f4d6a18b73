"""Discrepancy: the error of a model that remains beside the noise of the data.

No beam model agrees with a real structure down to the noise of ten hits. The remaining error is smooth in frequency:
natural frequency and level of each mode are slightly wrong. Its variance in the logarithm of a receptance H, for the
real and the imaginary part each, is

    v(f) = r^2 + u(f),    u(f) = (|ln H(f (1 + s)) - ln H(f)|^2 + |ln H(f (1 - s)) - ln H(f)|^2) / 4,

with the standard deviation r of level and phase, and s of the relative error of natural frequencies. Differences stand
in place of derivatives because s may exceed the width of a resonance. H is the measured receptance, so that the weights
are the same for all models. Errors are common to lines: those of a mode where u > r^2 have its error of frequency, one
real number in all records of a configuration; the others have its error of level, one complex number in each record. A
mode has the lines from one midpoint between peaks to the next. Antiresonances are left out: they are small differences
of modes, and a small error of one mode moves them far. A measured natural frequency has the relative error s. These
parameters have the largest likelihood of the residuals. Intervals of a fit that allows for the discrepancy include it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from receptance._peaks import local_maxima, nearest_peak
from receptance.diagnosis.fitting import Fit, evaluate, refit
from receptance.diagnosis.line_selection import thin
from receptance.diagnosis.model import Model
from receptance.diagnosis.thresholds import (
    DIP_RATIO,
    DIP_WIDTH,
    DISCREPANCIES,
    DISCREPANCY_LINES,
    DISCREPANCY_ROUNDS,
    MODE_NOISE,
    MODE_PROMINENCE,
)
from receptance.identification.observations import MeasuredFrequencies, MeasuredFRF, Observation, altered

__all__ = ["Discrepancy", "fit_discrepancy", "resonant"]


@dataclass(frozen=True)
class Discrepancy:
    """Standard deviations of the error of a model.

    Attributes
    ----------
    frequency : float
        Of natural frequencies, relative.
    relative : float or None
        Of the real and of the imaginary part of the logarithm of receptances; None without receptances.
    damping : float or None
        Of damping ratios, relative; None where none was measured.
    """

    frequency: float
    relative: float | None
    damping: float | None = None

    def __str__(self) -> str:
        level = "" if self.relative is None else f" and {100.0 * self.relative:.2g} % in level"
        damping = "" if self.damping is None else f" and {100.0 * self.damping:.2g} % in damping ratios"
        return f"{100.0 * self.frequency:.2g} % in natural frequencies{level}{damping}"

    def times(self, factor: float) -> Discrepancy:
        """Return a discrepancy that is larger by a factor, up to the largest one that is tried."""
        largest = DISCREPANCIES[1]
        level = None if self.relative is None else min(factor * self.relative, largest)
        damping = None if self.damping is None else factor * self.damping
        return Discrepancy(min(factor * self.frequency, largest), level, damping)

    def is_close(self, other: Discrepancy) -> bool:
        """Return whether another discrepancy is the same to a tenth."""
        pairs = ((getattr(self, name), getattr(other, name)) for name in ("frequency", "relative", "damping"))
        return all(own == one or (own and one and abs(math.log(own / one)) < 0.1) for own, one in pairs)

    def allow(self, model: Model) -> Model:
        """Return the model with observations whose variance includes the discrepancy."""
        own = {id(one): records for one, records in zip(model.observations, _records(model), strict=True)}
        return model.map(lambda one: self._enlarge(one, own.get(id(one), 1)))

    def _enlarge(self, one: Observation, records: int) -> Observation:
        if isinstance(one, MeasuredFrequencies):
            spread = np.hypot(np.asarray(one.standard_deviation_hz), self.frequency * one.frequency_hz)
            changed = altered(one, standard_deviation_hz=spread)
            if self.damping is None or not one.damped.size:
                return changed
            ratios = np.nan_to_num(np.asarray(one.damping_ratio))
            of_damping = np.hypot(np.asarray(one.standard_deviation_damping), self.damping * ratios)
            return altered(changed, standard_deviation_damping=of_damping)
        level, shift = np.square(self.relative or 0.0), _variance_of_shift(one, self.frequency)
        noise, lines = (
            np.square(one.standard_deviations[: shift.size]),
            _common_lines(_modes(one), shift > level, records),
        )
        # `standard_deviation` is that of independent lines with the information of the correlated ones.
        share = (level + shift) / (level + shift + noise / one.correlated_lines)
        correlated = np.maximum(one.correlated_lines + share * (lines - one.correlated_lines), 1.0)
        return altered(one, standard_deviation=np.sqrt(noise + lines * (level + shift)), correlated_lines=correlated)


def resonant(model: Model) -> Model:
    """Return the model on few lines of each receptance, without those of antiresonances."""

    def select(one: Observation) -> Observation:
        return one.select(~_in_dip(one)) if isinstance(one, MeasuredFRF) else one

    return thin(model.map(select), DISCREPANCY_LINES)


def _in_dip(one: MeasuredFRF) -> NDArray[np.bool_]:
    """Return the lines with much larger receptances on both sides nearby."""
    lines, size = one.frequency_hz.real, np.abs(one.receptance)
    low, high = (np.searchsorted(lines, lines * (1.0 + width)) for width in (-DIP_WIDTH, DIP_WIDTH))
    deep = [
        min(size[i : k + 1].max(), size[k:j].max()) > DIP_RATIO * own
        for k, (i, j, own) in enumerate(zip(low, high, size, strict=True))
    ]
    return np.array(deep, dtype=np.bool_)


def fit_discrepancy(model: Model, start: Mapping[str, float]) -> tuple[Discrepancy, Fit]:
    """Return the discrepancy of a model, and the fit that allows for it; each is estimated with the other in turn.

    Parameters
    ----------
    model : Model
        The model, with the standard deviations of the noise.
    start : mapping of str to float
        Values from which the fit starts.
    """
    fit = evaluate(model, start)
    found = _most_likely(model, fit)
    for _ in range(DISCREPANCY_ROUNDS):
        fit = refit(found.allow(model), fit.values)
        before, found = found, _most_likely(model, fit)
        if found == before:
            break
    # Lines and priors may agree less with these parameters than their likelihood expects.
    larger = before.times(math.sqrt(max(fit.misfit, 1.0)))
    return larger, refit(larger.allow(model), fit.values)


def _errors(fit: Fit) -> list[NDArray[np.complex128]]:
    """Return the errors of each observation: of logarithms, or relative ones of natural frequencies."""
    found = []
    for one, residual in zip(fit.model.observations, fit.parts, strict=True):
        if isinstance(one, MeasuredFrequencies):
            spread = np.asarray(one.standard_deviation_hz)
            own = residual[: one.frequency_hz.size] * spread / one.frequency_hz
            found.append(own.astype(np.complex128))
        else:
            real, imaginary = (residual * one.standard_deviations).reshape(2, -1)
            found.append(real + 1j * imaginary)
    return found


def _most_likely(model: Model, fit: Fit) -> Discrepancy:
    """Return the discrepancy with the largest likelihood of the errors of a fit.

    Common errors of lines are one independent value. The variance of the noise is that of `model`.
    """
    grid = np.geomspace(DISCREPANCIES[0], DISCREPANCIES[1], int(DISCREPANCIES[2]))
    # Minus twice the logarithm of the likelihood, over the level (rows) and the frequency (columns).
    deviance = np.zeros((grid.size, grid.size))
    has_level = False
    for one, error, records in zip(model.observations, _errors(fit), _records(model), strict=True):
        power = np.square(np.abs(error))
        if isinstance(one, MeasuredFrequencies):
            noise = np.square(np.asarray(one.standard_deviation_hz) / one.frequency_hz)
            variance = np.square(grid)[:, None] + noise
            deviance += np.sum(power / variance + np.log(variance), axis=1)
            continue
        has_level = True
        modes, noise = _modes(one), np.square(one.standard_deviations[: power.size])
        for column, frequency in enumerate(grid):
            shift = _variance_of_shift(one, frequency)
            for row, level in enumerate(np.square(grid)):
                lines = _common_lines(modes, shift > level, records)
                variance = level + shift + noise / lines
                deviance[row, column] += np.sum((power / variance + 2.0 * np.log(variance)) / lines)
    row, best = divmod(int(np.argmin(deviance)), grid.size)
    return Discrepancy(float(grid[best]), float(grid[row]) if has_level else None, _of_damping(model, fit))


def _of_damping(model: Model, fit: Fit) -> float | None:
    """Return the standard deviation of damping ratios, relative, with the largest likelihood."""
    grid = np.geomspace(1e-3, 3.0, int(DISCREPANCIES[2]))
    deviance = np.zeros(grid.size)
    known = False
    for one, fitted, residual in zip(model.observations, fit.model.observations, fit.parts, strict=True):
        if (
            not isinstance(one, MeasuredFrequencies)
            or not isinstance(fitted, MeasuredFrequencies)
            or not one.damped.size
        ):
            continue
        known = True
        ratios, own = np.asarray(one.damping_ratio)[one.damped], residual[one.frequency_hz.size :]
        errors = own * np.asarray(fitted.standard_deviation_damping)[one.damped] / ratios
        variance = np.square(grid)[:, None] + np.square(np.asarray(one.standard_deviation_damping)[one.damped] / ratios)
        deviance += np.sum(np.square(errors) / variance + np.log(variance), axis=1)
    return float(grid[np.argmin(deviance)]) if known else None


def _variance_of_shift(one: MeasuredFRF, frequency: float) -> NDArray[np.float64]:
    """Return the variance of the logarithm by an error of frequency, for the real and the imaginary part each."""
    lines = one.frequency_hz.real
    logarithm = np.log(np.abs(one.receptance)) + 1j * np.unwrap(np.angle(one.receptance))
    moved = [np.interp(lines * (1.0 + shift), lines, logarithm) for shift in (frequency, -frequency)]
    return np.asarray(sum(np.square(np.abs(each - logarithm)) for each in moved) / 4.0)


def _records(model: Model) -> list[int]:
    """Return for each observation the number of receptances of its configuration."""
    receptances = [isinstance(one, MeasuredFRF) for one in model.observations]
    names = [name for name, is_one in zip(model.configuration_of, receptances, strict=True) if is_one]
    return [max(names.count(name), 1) for name in model.configuration_of]


def _modes(one: MeasuredFRF) -> NDArray[np.intp]:
    """Return for each line the number of its mode."""
    least = max(MODE_PROMINENCE, MODE_NOISE * float(np.median(one.standard_deviations)))
    lines = one.frequency_hz.real
    peaks, _ = local_maxima(np.log(np.abs(one.receptance) * lines), least)
    return nearest_peak(lines, lines[peaks])


def _common_lines(modes: NDArray[np.intp], shifted: NDArray[np.bool_], records: int) -> NDArray[np.float64]:
    """Return for each line the number of lines that share its two independent values."""
    groups = 2 * modes + shifted
    counts = np.bincount(groups).astype(np.float64)
    # One error of frequency, a real number, for all records.
    counts[1::2] *= 2 * records
    return counts[groups]
