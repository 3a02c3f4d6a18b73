"""Discrepancy: the error of a model that remains beside the noise of the data.

No beam model agrees with a real structure down to the noise of ten hits. What remains is smooth in frequency and common
to the lines of a mode, whose natural frequency and level are slightly wrong. Its variance in the logarithm of a
receptance H, for the real and the imaginary part each, has two parameters: the standard deviation s of the relative error
of natural frequencies, and the standard deviation r of level and phase,

    v(f) = r^2 + (|ln H(f (1 + s)) - ln H(f)|^2 + |ln H(f (1 - s)) - ln H(f)|^2) / 4.

Differences stand in place of derivatives because s may exceed the width of a resonance. H is the measured receptance, so
that the weights are the same for all models. The lines of one mode have one independent error. A natural frequency has
the relative error s. The parameters have the largest likelihood of the residuals. A fit that allows for the discrepancy
has intervals that include it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from receptance._peaks import local_maxima
from receptance.diagnosis.fitting import Fit, evaluate, refit
from receptance.diagnosis.model import Model
from receptance.diagnosis.thresholds import DISCREPANCIES, DISCREPANCY_ROUNDS, MODE_NOISE, MODE_PROMINENCE
from receptance.identification.observations import MeasuredFrequencies, MeasuredFRF, Observation, altered

__all__ = ["Discrepancy", "fit_discrepancy"]


@dataclass(frozen=True)
class Discrepancy:
    """Standard deviations of the error of a model.

    Attributes
    ----------
    frequency : float
        Of natural frequencies, relative.
    relative : float or None
        Of the real and of the imaginary part of the logarithm of receptances; None without receptances.
    """

    frequency: float
    relative: float | None

    def __str__(self) -> str:
        level = "" if self.relative is None else f" and {100.0 * self.relative:.2g} % in level"
        return f"{100.0 * self.frequency:.2g} % in natural frequencies{level}"

    def allow(self, model: Model) -> Model:
        """Return the model with observations whose variance includes the discrepancy."""
        return model.map(self._enlarge)

    def _enlarge(self, one: Observation) -> Observation:
        if isinstance(one, MeasuredFrequencies):
            spread = np.hypot(np.asarray(one.standard_deviation_hz), self.frequency * one.frequency_hz)
            return altered(one, standard_deviation_hz=spread)
        own = np.square(self.relative or 0.0) + _variance_of_shift(one, self.frequency)
        noise, lines = np.square(one.standard_deviations[: own.size]), _lines_of_mode(one)
        # `standard_deviation` is that of independent lines with the information of the correlated ones.
        share = own / (own + noise / one.correlated_lines)
        correlated = np.maximum(one.correlated_lines + share * (lines - one.correlated_lines), 1.0)
        return altered(one, standard_deviation=np.sqrt(noise + lines * own), correlated_lines=correlated)


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
    found = _most_likely(model, _errors(fit))
    for _ in range(DISCREPANCY_ROUNDS):
        fit = refit(found.allow(model), fit.values)
        before, found = found, _most_likely(model, _errors(fit))
        if found == before:
            break
    return before, fit


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


def _most_likely(model: Model, errors: Sequence[NDArray[np.complex128]]) -> Discrepancy:
    """Return the discrepancy with the largest likelihood of errors, those of a mode as one independent value."""
    grid = np.geomspace(DISCREPANCIES[0], DISCREPANCIES[1], int(DISCREPANCIES[2]))
    # Minus twice the logarithm of the likelihood, over the level (rows) and the frequency (columns).
    deviance = np.zeros((grid.size, grid.size))
    has_level = False
    for one, error in zip(model.observations, errors, strict=True):
        power = np.square(np.abs(error))
        if isinstance(one, MeasuredFrequencies):
            noise = np.square(np.asarray(one.standard_deviation_hz) / one.frequency_hz)
            variance = np.square(grid)[:, None] + noise
            deviance += np.sum(power / variance + np.log(variance), axis=1)
            continue
        has_level = True
        lines = _lines_of_mode(one)
        noise = np.square(one.standard_deviations[: power.size]) / lines
        for column, frequency in enumerate(grid):
            variance = np.square(grid)[:, None] + (_variance_of_shift(one, frequency) + noise)
            deviance[:, column] += np.sum((power / variance + 2.0 * np.log(variance)) / lines, axis=1)
    row, best = divmod(int(np.argmin(deviance)), grid.size)
    return Discrepancy(float(grid[best]), float(grid[row]) if has_level else None)


def _variance_of_shift(one: MeasuredFRF, frequency: float) -> NDArray[np.float64]:
    """Return the variance of the logarithm by an error of frequency, for the real and the imaginary part each."""
    lines = one.frequency_hz.real
    logarithm = np.log(np.abs(one.receptance)) + 1j * np.unwrap(np.angle(one.receptance))
    moved = [np.interp(lines * (1.0 + shift), lines, logarithm) for shift in (frequency, -frequency)]
    return np.asarray(sum(np.square(np.abs(each - logarithm)) for each in moved) / 4.0)


def _lines_of_mode(one: MeasuredFRF) -> NDArray[np.float64]:
    """Return for each line the number of lines of its mode, from one midpoint between peaks to the next."""
    least = max(MODE_PROMINENCE, MODE_NOISE * float(np.median(one.standard_deviations)))
    peaks, _ = local_maxima(np.log(np.abs(one.receptance) * one.frequency_hz.real), least)
    ends = [0, *((peaks[1:] + peaks[:-1] + 1) // 2), one.frequency_hz.size]
    counts = np.diff(ends)
    return np.repeat(counts, counts).astype(np.float64)
