"""Selection of modes among the candidates, added in turn while each reduces the misfit by more than noise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
import scipy
from numpy.typing import NDArray

from receptance.modal._least_squares import PoleFit, PoleModel, PoleProblem
from receptance.modal._lines import Lines

Scatter = Literal["absolute", "relative"]

_MAX_TRIES = 8
"""Candidates tried before the search for modes ends."""
_MIN_GAIN = 0.2
"""Least reduction of the misfit by a candidate before the fit of the poles, relative to its penalty."""
EXACT = 1e-22
"""Share of the sum of squares below which residuals are rounding errors."""
_SEARCH_TOLERANCE, _SEARCH_STEPS = 1e-6, 30
"""Tolerance and most steps of fits during the search."""
_MIN_MEDIAN_LINES = 30
"""Least number of lines for an estimate of the noise by a median."""
_LAST_POLES, _MAX_DECREASE = 4, 0.2
"""The search ends if so many poles reduced the misfit by less than this share and than smooth errors explain."""
_WEAKEST = 3
"""Poles of least effect of which one may be removed."""
_REWEIGHTINGS = 3
"""Fits with weights from the previous residuals; the weights have converged after these."""
_OUTSIDE_DISTANCES = (0.02, 0.06, 0.15, 0.4, 1.0)
"""Start values of poles outside the band: distances to it in widths of the band."""
_MAX_OUTSIDE = 2
"""Most poles above the band, and below."""
_NARROWEST = 1e-3
"""Least half-power band relative to the distance of the lines, and least distance of poles relative to their band."""
_MIN_SEPARATION = 0.1
"""Least distance of poles in half-power bands if no number of modes is given; closer ones are one changing mode."""


@dataclass(frozen=True)
class Poles:
    """Poles `(M,)` in rad/s with the bounds of their real and of their imaginary parts.

    The role is the number of the given frequency, 0 for all modes if none are given, -1 for background: poles outside
    the band, and between given frequencies.
    """

    values: NDArray[np.complex128]
    low: NDArray[np.complex128]
    high: NDArray[np.complex128]
    role: NDArray[np.int64]

    @classmethod
    def none(cls) -> Poles:
        """Return no poles."""
        empty = np.empty(0, dtype=np.complex128)
        return cls(empty, empty, empty, np.empty(0, dtype=np.int64))

    def joined_with(self, other: Poles) -> Poles:
        """Return the poles of both."""
        return Poles(
            np.concatenate([self.values, other.values]),
            np.concatenate([self.low, other.low]),
            np.concatenate([self.high, other.high]),
            np.concatenate([self.role, other.role]),
        )

    def subset(self, selection: NDArray[np.bool_] | NDArray[np.int64]) -> Poles:
        """Return a selection of the poles."""
        return Poles(self.values[selection], self.low[selection], self.high[selection], self.role[selection])

    def fitted(self, problem: PoleProblem, *, loose: bool = False) -> tuple[Poles, PoleFit]:
        """Return the fitted poles, and the fit."""
        options = {"tolerance": _SEARCH_TOLERANCE, "steps": _SEARCH_STEPS} if loose else {}
        fit = problem.fit(self.values, low=self.low, high=self.high, **options)  # type: ignore[arg-type]
        return Poles(fit.poles, self.low, self.high, self.role), fit

    def plausible(self, sigma: float, highest_damping: float, apart: float = _NARROWEST) -> NDArray[np.bool_]:
        """Return which poles are within their bounds, have the damping of modes, and are not duplicates."""
        width = sigma - self.values.real
        inside = (self.values.real > self.low.real) & (self.values.real < self.high.real)
        inside &= (self.values.imag > self.low.imag) & (self.values.imag < self.high.imag)
        inside &= -self.values.real <= highest_damping * np.abs(self.values)
        close = np.abs(self.values[:, None] - self.values) <= 2.0 * apart * np.minimum(width[:, None], width)
        return inside & ~np.tril(close, -1).any(axis=1)


@dataclass(frozen=True)
class ModeSearch:
    """Search for modes among candidates, which are poles in the band in rad/s.

    `terms` is the background of `PoleModel`, `scatter` the distribution of the noise over the lines if the FRF states
    no variance. `modes` is their number, or their frequencies in Hz; None for all significant ones, at most `most`.
    `progress` is called with a line of text at each step.
    """

    lines: Lines
    terms: tuple[int, ...]
    scatter: Scatter
    candidates: NDArray[np.complex128]
    highest_damping: float
    modes: int | tuple[float, ...] | None
    most: int
    progress: Callable[[str], None]

    def poles(self) -> Poles:
        """Return the poles of the requested modes, and those of the background.

        Requested modes are added as long as there is a candidate. All others, outside the band or between given
        frequencies, must reduce the misfit by more than the penalty of their parameters (Schwarz 1978).
        """
        poles = Poles.none()
        fit = poles.fitted(self._problem(None))[1]
        previous = [fit]
        while poles.values.size < self.most:
            self.progress(f"modal fit, search for pole {poles.values.size + 1}")
            enlarged = self._add_pole(poles, fit) or self._add_all_given(poles, fit)
            if enlarged is None:
                break
            poles, fit = self.assigned(enlarged[0]), enlarged[1]
            if fit.chi_square <= EXACT * self._problem(fit).square:
                return poles
            previous = [*previous[-_LAST_POLES:], fit]
            if not self._missing_count(poles) and self._follows_errors(previous):
                break
        return self._without_insignificant(poles, fit)

    def _follows_errors(self, fits: list[PoleFit]) -> bool:
        """Return whether the last poles reduced the misfit by little, and by less than errors so smooth explain.

        Such errors would be fitted by one pole after another. Few strong modes that are missing leave smooth residuals
        as well, but each of them is a large share of the misfit.
        """
        if len(fits) <= _LAST_POLES:
            return False
        problem = self._problem(fits[-1])
        fit = problem.with_smooth_errors(fits[-1])
        before = float(np.sum(np.abs((problem.values - fits[0].fitted) * problem.weights) ** 2))
        after = float(np.sum(np.abs((problem.values - fit.fitted) * problem.weights) ** 2))
        most = min(_MAX_DECREASE * before, 0.5 * _LAST_POLES * self._penalty(fit))
        return fit.smooth_lines > 1.0 and before - after < most

    def _without_insignificant(self, poles: Poles, fit: PoleFit) -> Poles:
        """Return the poles that reduce the misfit by more than their penalty for errors as smooth as the residuals.

        The smoothness is that of the residuals of the larger model, because missing modes leave smooth residuals.
        """
        required = poles.role >= 0 if self.modes is not None else np.zeros(poles.values.size, dtype=bool)
        while not required.all():
            problem = self._problem(fit)
            poles, fit = poles.fitted(problem, loose=True)
            fit = problem.with_smooth_errors(fit)
            if fit.smooth_lines <= 1.0:
                break
            self.progress(f"modal fit, removal of one of {poles.values.size} poles")
            every = np.arange(poles.values.size)
            # With the other poles unchanged the misfit increases more than with all fitted again.
            gains = [problem.gains(poles.values[every != index], poles.values[[index]])[0] for index in every]
            increase = np.where(required, np.inf, gains)
            tries = 1 if increase.min() <= self._penalty(fit) else min(_WEAKEST, np.count_nonzero(~required))
            weakest = np.argsort(increase)[:tries]
            smaller = [poles.subset(every != index).fitted(problem, loose=True) for index in weakest]
            least = int(np.argmin([fewer.chi_square for _, fewer in smaller]))
            if smaller[least][1].chi_square - fit.chi_square > self._penalty(fit):
                break
            required = np.delete(required, weakest[least])
            poles, fit = smaller[least]
        return poles

    def assigned(self, poles: Poles) -> Poles:
        """Return the poles with the given frequencies assigned to them at the smallest total distance."""
        if not isinstance(self.modes, tuple):
            return poles
        f = self.lines.frequency_hz
        inside = np.flatnonzero((poles.values.imag >= 2.0 * np.pi * f[0]) & (poles.values.imag <= 2.0 * np.pi * f[-1]))
        distance = np.abs(poles.values[inside].imag[:, None] / (2.0 * np.pi) - np.array(self.modes))
        largest = np.array([search_range(given_hz, self.lines) for given_hz in self.modes])
        role = np.full(poles.values.size, -1)
        # The penalty exceeds every sum of permitted distances.
        rows, columns = scipy.optimize.linear_sum_assignment(np.where(distance > largest, 1e6 * f[-1], distance))
        permitted = distance[rows, columns] <= largest[columns]
        role[inside[rows[permitted]]] = columns[permitted]
        return replace(poles, role=role)

    def _missing_count(self, poles: Poles) -> int:
        """Return the number of requested modes without a pole."""
        if self.modes is None:
            return 0
        if isinstance(self.modes, int):
            return self.modes - int(np.count_nonzero(poles.role >= 0))
        return len(self._missing_frequencies(poles))

    def _missing_frequencies(self, poles: Poles) -> list[int]:
        """Return the given frequencies without a pole."""
        assert isinstance(self.modes, tuple)
        return [index for index in range(len(self.modes)) if index not in poles.role]

    @cached_property
    def _given(self) -> Poles:
        """Start values at the given frequencies, with their bounds."""
        assert isinstance(self.modes, tuple)
        f = self.lines.frequency_hz
        given_hz = np.array(self.modes)
        largest = np.array([search_range(frequency, self.lines) for frequency in self.modes])
        guesses = 2j * np.pi * given_hz + (self._sigma - 2.0 * np.pi * self.lines.spacing_hz)
        low, high = np.maximum(given_hz - largest, f[0]), np.minimum(given_hz + largest, f[-1])
        return self._bounded(guesses, low, high, np.arange(given_hz.size))

    def _bounded(
        self,
        poles: NDArray[np.complex128],
        low_hz: NDArray[np.float64],
        high_hz: NDArray[np.float64],
        role: NDArray[np.int64],
    ) -> Poles:
        w = 2.0 * np.pi * np.stack([low_hz, high_hz])
        most = self.highest_damping / np.sqrt(1.0 - self.highest_damping**2) if self.highest_damping < 1.0 else np.inf
        narrowest = self._sigma - _NARROWEST * np.pi * self.lines.spacing_hz
        return Poles(poles, -most * w[1] + 1j * w[0], np.full(poles.size, narrowest) + 1j * w[1], role)

    @cached_property
    def _inside(self) -> Poles:
        f = self.lines.frequency_hz
        low, high = np.full((2, self.candidates.size), [[f[0]], [f[-1]]])
        role = np.full(self.candidates.size, -1 if isinstance(self.modes, tuple) else 0)
        return self._bounded(self.candidates, low, high, role)

    @cached_property
    def _outside(self) -> Poles:
        """Start values of poles outside the band."""
        first, last = self.lines.frequency_hz[[0, -1]]
        width = last - first
        distance = width * np.array(_OUTSIDE_DISTANCES)
        above = last + distance if 0 in self.terms else np.empty(0)
        below = first - distance[distance < 0.9 * first] if -2 in self.terms else np.empty(0)
        f = np.concatenate([above, below])
        low = np.where(f > last, last, max(first - 3.0 * width, 0.05 * first))
        high = np.where(f > last, last + 3.0 * width, first)
        edge_distance = np.where(f > last, f - last, first - f)
        poles = Poles.none()
        for share in (0.1, 0.5):
            guesses = 2j * np.pi * f + self._sigma - 2.0 * np.pi * share * edge_distance
            poles = poles.joined_with(self._bounded(guesses, low, high, np.full(f.size, -1)))
        return poles

    def _plausible(self, poles: Poles) -> NDArray[np.bool_]:
        apart = _MIN_SEPARATION if self.modes is None else _NARROWEST
        return poles.plausible(self._sigma, self.highest_damping, apart)

    @property
    def _sigma(self) -> float:
        return float(self.lines.frf.decay_rate)

    def _penalty(self, fit: PoleFit) -> float:
        """Return the penalty of a further mode, larger for correlated lines.

        Of errors that are smooth over S lines, n lines contain n / S independent values. A column that is wider than
        S removes S times as much of their sum of squares as of that of independent errors.
        """
        shared = max(self.lines.correlated_lines, fit.smooth_lines)
        entries = self.lines.values.shape[1]
        lines = max(2.0 * self.lines.frequency_hz.size / fit.smooth_lines, 2.0)
        penalty = 2.0 * np.log(lines * entries) + 2.0 * entries * np.log(lines)
        variance = fit.chi_square / max(fit.degrees_of_freedom, 1.0)
        return float(penalty * shared * max(variance, self._stated))

    @cached_property
    def _stated(self) -> float:
        """Mean square of the stated noise in units of the weights of the search; zero if none is stated."""
        if self.lines.relative is None:
            return 0.0
        weights = weights_of(self.lines, self.scatter, None)
        common = self._common(weights)
        weighted = common > 0.0
        return float(np.mean((common[weighted] / weights[weighted]) ** 2))

    @staticmethod
    def _common(weights: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the nearest weights that are a product of one per line and one per entry.

        With these all entries share one factorisation during the search; the last fit uses the original weights. Lines
        with an entry of unknown variance are left out, unless few lines would remain.
        """
        stated = np.all(weights > 0.0, axis=1)
        if np.count_nonzero(stated) < 0.5 * stated.size:
            return weights
        size = np.log(weights[stated])
        lines = size.mean(axis=1, keepdims=True)
        common = np.zeros_like(weights)
        common[stated] = np.exp(lines + (size - lines).mean(axis=0))
        return common

    def _problem(self, fit: PoleFit | None) -> PoleProblem:
        return _problem(self.lines, self.terms, self._common(weights_of(self.lines, self.scatter, fit)))

    def _candidates_for_next(self, poles: Poles) -> tuple[Poles, NDArray[np.bool_]]:
        """Return the candidates for the next pole, and which of them are requested."""
        inside, missing = self._inside, self._missing_count(poles)
        requested = np.full(inside.values.size, missing > 0)
        if isinstance(self.modes, int):
            inside, requested = (inside, requested) if missing > 0 else (Poles.none(), requested[:0])
        elif self.modes is not None:
            starts, missing_indices = self._given, self._missing_frequencies(poles)
            frequency = inside.values.imag[:, None]
            near = (frequency >= starts.low.imag) & (frequency <= starts.high.imag)
            others = inside.subset(np.logical_not(near.any(axis=1)))
            inside, requested = others, np.zeros(others.values.size, dtype=bool)
            for index in missing_indices:
                # Candidates belong to the nearest given frequency without a pole.
                distance = np.abs(frequency - starts.values.imag[missing_indices])
                nearest = np.array(missing_indices)[np.argmin(distance, axis=1)]
                candidates = self.candidates[near[:, index] & (nearest == index)]
                guesses = np.append(candidates, starts.values[index])
                low, high = (np.full(guesses.size, bounds[index]) for bounds in (starts.low, starts.high))
                inside = inside.joined_with(Poles(guesses, low, high, np.full(guesses.size, index)))
                requested = np.append(requested, np.ones(guesses.size, dtype=bool))
        f = self.lines.frequency_hz
        above = np.count_nonzero(poles.low.imag >= 2.0 * np.pi * f[-1])
        below = np.count_nonzero(poles.high.imag <= 2.0 * np.pi * f[0])
        outside_hz = self._outside.values.imag / (2.0 * np.pi)
        outside = self._outside.subset(
            ((outside_hz > f[-1]) & (above < _MAX_OUTSIDE)) | ((outside_hz < f[0]) & (below < _MAX_OUTSIDE))
        )
        return inside.joined_with(outside), np.append(requested, np.zeros(outside.values.size, dtype=bool))

    def _add_pole(self, poles: Poles, fit: PoleFit) -> tuple[Poles, PoleFit] | None:
        """Return the fitted poles with one more, if a candidate is requested or exceeds its penalty."""
        candidates, requested = self._candidates_for_next(poles)
        if candidates.values.size == 0:
            return None
        problem = self._problem(fit)
        penalty = self._penalty(fit)
        gains = problem.gains(poles.values, candidates.values)
        tried: list[complex] = []
        # The number of tries is limited per given frequency.
        tries = dict.fromkeys(candidates.role.tolist(), _MAX_TRIES)
        for index in np.argsort(-gains):
            role = int(candidates.role[index])
            if tries[role] == 0:
                continue
            if not requested[index] and gains[index] < _MIN_GAIN * penalty:
                continue
            # A start value close to a previous one would have the same result.
            pole = complex(candidates.values[index])
            if any(abs(pole - other) <= 0.5 * abs(self._sigma - other.real) for other in tried):
                continue
            tried.append(pole)
            tries[role] -= 1
            candidate = candidates.subset(np.array([index]))
            enlarged, larger_fit = self._fit_plausible(poles.joined_with(candidate), problem)
            if not self._plausible(enlarged).all() or self._missing_count(enlarged) > self._missing_count(poles):
                continue
            if self._missing_count(enlarged) < self._missing_count(poles) and enlarged.values.size > poles.values.size:
                return enlarged, larger_fit
            # Both are compared with the weights of the larger model, which estimates the scatter best.
            problem_after = self._problem(larger_fit)
            _, before = poles.fitted(problem_after, loose=True)
            enlarged, after = enlarged.fitted(problem_after, loose=True)
            # Replacing a pole has no penalty, but must reduce the misfit.
            least = max(enlarged.values.size - poles.values.size, 0.1) * self._penalty(after)
            if self._plausible(enlarged).all() and before.chi_square - after.chi_square > least:
                return enlarged, after
        return None

    def _fit_plausible(self, poles: Poles, problem: PoleProblem) -> tuple[Poles, PoleFit]:
        """Return the fit of poles, without those that are not plausible, which may still be an improvement."""
        poles, fit = poles.fitted(problem, loose=True)
        plausible = self._plausible(poles)
        if not plausible.all():
            poles, fit = poles.subset(plausible).fitted(problem, loose=True)
        return self.assigned(poles), fit

    def _add_all_given(self, poles: Poles, fit: PoleFit) -> tuple[Poles, PoleFit] | None:
        """Return the fit of poles at all given frequencies at once, if adding single ones fails.

        A pole that represents two close modes prevents each of them from being added alone.
        """
        if not isinstance(self.modes, tuple) or not self._missing_count(poles):
            return None
        problem = self._problem(fit)
        enlarged, larger_fit = self._fit_plausible(self._given.joined_with(poles.subset(poles.role < 0)), problem)
        if not self._plausible(enlarged).all() or self._missing_count(enlarged) >= self._missing_count(poles):
            return None
        return enlarged, larger_fit


def search_range(frequency_hz: float, lines: Lines) -> float:
    """Return the largest distance in Hz of a mode to its given frequency."""
    return max(0.03 * frequency_hz, 5.0 * lines.spacing_hz)


def refine(
    lines: Lines, terms: tuple[int, ...], scatter: Scatter, poles: Poles, highest_damping: float
) -> tuple[Poles, PoleFit]:
    """Fit the poles to all lines with weights from the residuals, and remove those that are not plausible."""
    sigma = float(lines.frf.decay_rate)
    poles, fit = poles.fitted(_problem(lines, terms, weights_of(lines, scatter, None)), loose=True)
    for remaining in reversed(range(_REWEIGHTINGS)):
        poles = poles.subset(poles.plausible(sigma, highest_damping))
        problem = _problem(lines, terms, weights_of(lines, scatter, fit, smooth=True))
        if remaining == 0:
            # It affects only the covariance, which is that of the last fit.
            additive = lines.additive if lines.relative is not None or scatter == "absolute" else 0.0 * problem.weights
            problem = replace(problem, additive=additive, excitations=lines.frf.values.shape[2])
        poles, fit = poles.fitted(problem)
    return poles, problem.with_smooth_errors(fit)


def _problem(lines: Lines, terms: tuple[int, ...], weights: NDArray[np.float64]) -> PoleProblem:
    return PoleProblem(PoleModel(lines.s, lines.power, terms), lines.values, weights, lines.correlated_lines)


def weights_of(lines: Lines, scatter: Scatter, fit: PoleFit | None, *, smooth: bool = False) -> NDArray[np.float64]:
    """Return the inverse standard deviations `(n, m)` of real and imaginary part of each value.

    If the FRF states no variance, the scatter is equal on all lines, or proportional to the magnitude; the weights of
    an entry then follow from the residuals of the previous fit, and only the ratio of the weights of different entries
    is meaningful. Without a fit, all entries have equal weight relative to their magnitude. With `smooth` magnitudes
    are averaged with those of the fit, so that lines reduced by noise do not weigh too much.
    """
    size = np.abs(lines.values)
    level = np.sqrt(np.mean(size**2, axis=0))
    # The weight of an entry of zeros, a node of all modes, is finite.
    floor = np.where(level > 0.0, 1e-12 * level, 1.0)
    if smooth and fit is not None:
        size = np.sqrt(0.5 * (size**2 + np.abs(fit.fitted) ** 2))
    size = np.maximum(size, floor)
    if lines.relative is not None:
        return np.asarray(1.0 / (lines.relative * size))
    unit = size if scatter == "relative" else np.ones_like(size)
    residuals = lines.values if fit is None else lines.values - fit.fitted
    deviation = np.sqrt(_noise(residuals / unit) if fit is not None else np.mean(np.abs(residuals / unit) ** 2, axis=0))
    least = 1e-12 if scatter == "relative" else floor
    return np.asarray(1.0 / (unit * np.maximum(deviation, least)))


def _noise(residuals: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Return the noise variance `(m,)` in the residuals of each entry, up to one factor.

    It is estimated from the median difference of a line to the mean of its neighbours, because a mode at another
    frequency in one entry leaves large residuals on a few lines, which as noise would reduce the weight of this entry.
    For few lines the mean square is used.
    """
    if len(residuals) < _MIN_MEDIAN_LINES:
        return np.asarray(np.mean(np.abs(residuals) ** 2, axis=0) / 2.0)
    step = residuals[1:-1] - 0.5 * (residuals[:-2] + residuals[2:])
    # |step|^2 is 1.5 times the variance times chi-square of two degrees of freedom, whose median is 2 ln 2.
    return np.asarray(np.median(np.abs(step) ** 2, axis=0) / (3.0 * np.log(2.0)))
