"""Discrepancy: the error of a model that remains beside the noise of the data.

No beam model agrees with a real structure down to the noise of ten hits. The remaining error is smooth in frequency:
natural frequency and level of each mode are slightly wrong. Its variance in the logarithm of a receptance H, for the
real and the imaginary part each, is

    v(f) = r^2 g(f) + u(f),    u(f) = (|ln H(f (1 + s)) - ln H(f)|^2 + |ln H(f (1 - s)) - ln H(f)|^2) / 4,
    g(f) = max(1, sum_m |H_m(f)|^2 / |H(f)|^2),

with the standard deviation r of level and phase, and s of the relative error of natural frequencies. Differences stand
in place of derivatives because s may exceed the width of a resonance. H is the measured receptance, so that the weights
are the same for all models. An error of level is a share of its mode, and H may be much smaller than its modes H_m, of
the size of the peaks and with their widths: it then has a larger relative error, g times in variance.

Errors are common to lines: those of a mode where u > r^2 g have its error of frequency, one real number in all records
of a configuration; the others have its error of level, one complex number in each record, to which each line adds
in proportion to 1 / g. A mode has the lines from one midpoint between peaks to the next. Antiresonances are left out: a
small error of one mode moves them far. A measured natural frequency has the relative error s.

The standard deviations are those of largest likelihood in a linear mixed model of the errors e of a fit,

    e(f) = a_mk + d_m (ln H(f (1 + s)) - ln H(f (1 - s))) / (2 s) + g(f)^(1/2) b(f) + noise,

with the error of level a_mk of mode m in record k, the relative error d_m of its frequency in all records of a
configuration, and a remainder b of each line; all are normal with mean zero, and r^2 is the variance of a_mk and b
together. In the fits both grow between the peaks, which gives lines there less weight than the estimate does. The
likelihood is maximised by expectation and maximisation (Laird and Ware, Biometrics 38, 1982, 963-974).
Intervals of a fit that allows for the discrepancy include it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

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
    LEAST_FACTOR,
    MIXED_MODEL_CHANGE,
    MIXED_MODEL_STEPS,
    MODE_NOISE,
    MODE_PROMINENCE,
    SAME_MODE,
)
from receptance.errors import ReceptanceError
from receptance.fit.observation import Observation, altered
from receptance.report.table import percent

FREQUENCY, LEVEL, DAMPING, REMAINDER = range(4)
"""Kinds of errors: of natural frequencies, of the level of a mode, of damping ratios, and of each line."""


@dataclass(frozen=True)
class Discrepancy:
    """Standard deviations of the error of a model."""

    frequency: float
    """Of natural frequencies, relative."""
    relative: float | None
    """Of the real and of the imaginary part of the logarithm of receptances; None without receptances."""
    damping: float | None = None
    """Of damping ratios, relative; None where none was measured."""

    def __str__(self) -> str:
        level = "" if self.relative is None else f" and {percent(self.relative)} in level"
        damping = "" if self.damping is None else f" and {percent(self.damping)} in damping ratios"
        return f"{percent(self.frequency)} in natural frequencies{level}{damping}"

    def times(self, factor: float) -> Discrepancy:
        """Return a discrepancy that is larger by a factor, up to the largest one that is tried."""
        largest = DISCREPANCIES[1]
        level = None if self.relative is None else min(factor * self.relative, largest)
        damping = None if self.damping is None else factor * self.damping
        return Discrepancy(min(factor * self.frequency, largest), level, damping)

    def deviance(self, chi_square: ArrayLike, values: float) -> NDArray[np.float64]:
        """Return minus twice the logarithm of the likelihood of fits that allow for it, for its most likely size.

        The size is a common factor of the standard deviations. The factor is at most that which leads to the largest
        discrepancy that is tried, and at least `LEAST_FACTOR`: few values may agree with a model by chance.

        Parameters
        ----------
        chi_square : array_like
            Chi-square of the fits.
        values : float
            Number of independent values.
        """
        most = DISCREPANCIES[1] / (self.frequency if self.relative is None else self.relative)
        chi_square = np.asarray(chi_square, dtype=np.float64)
        square = np.clip(chi_square / values, LEAST_FACTOR**2, max(most, 1.0) ** 2)
        return np.asarray(values * np.log(square) + chi_square / square)

    def is_close(self, other: Discrepancy) -> bool:
        """Return whether another discrepancy is the same to a tenth."""
        pairs = ((getattr(self, name), getattr(other, name)) for name in ("frequency", "relative", "damping"))
        return all(own == one or (own and one and abs(math.log(own / one)) < 0.1) for own, one in pairs)

    def allow(self, model: Model) -> Model:
        """Return the model with observations whose variance includes the discrepancy."""
        own = {
            id(observation): records for observation, records in zip(model.observations, _records(model), strict=True)
        }
        return model.map(lambda one: self._enlarge(one, own.get(id(one), 1)))

    def _enlarge(self, observation: Observation, records: int) -> Observation:
        if not observation.is_receptance:
            spread = np.hypot(np.asarray(observation.standard_deviation), self.frequency * observation.frequency_hz)
            changed = altered(observation, standard_deviation=spread)
            if self.damping is None or not observation.damped.size:
                return changed
            ratios = np.nan_to_num(np.asarray(observation.damping_ratio))
            of_damping = np.hypot(np.asarray(observation.standard_deviation_damping), self.damping * ratios)
            return altered(changed, standard_deviation_damping=of_damping)
        growth = growth_beside_peaks(observation)
        level, shift = np.square(self.relative or 0.0) * growth, _variance_of_shift(observation, self.frequency)
        noise = np.square(observation.standard_deviations[: shift.size])
        is_shifted = shift > level
        weights = np.where(is_shifted, 1.0, 1.0 / growth)
        lines = _common_lines(
            nearest_peak(observation.frequency_hz.real, _peaks(observation)), is_shifted, records, weights
        )
        # `standard_deviation` is that of independent lines with the information of the correlated ones.
        share = (level + shift) / (level + shift + noise / observation.correlated_lines)
        correlated = observation.correlated_lines + share * (lines / weights - observation.correlated_lines)
        return altered(
            observation,
            standard_deviation=np.sqrt(noise + lines * (level + shift)),
            correlated_lines=np.maximum(correlated, 1.0),
        )


def resonant(model: Model) -> Model:
    """Return the model on few lines of each receptance, without those of antiresonances."""

    def select(observation: Observation) -> Observation:
        if not observation.is_receptance:
            return observation
        return observation.select(~in_antiresonance(observation.frequency_hz.real, np.abs(observation.receptance)))

    return thin(model.map(select), DISCREPANCY_LINES)


def in_antiresonance(lines: NDArray[np.float64], size: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return whether lines in Hz have much larger receptances on both sides nearby, from their magnitudes."""
    low, high = (np.searchsorted(lines, lines * (1.0 + width)) for width in (-DIP_WIDTH, DIP_WIDTH))
    deep = [
        min(size[i : k + 1].max(), size[k:j].max()) > DIP_RATIO * own
        for k, (i, j, own) in enumerate(zip(low, high, size, strict=True))
    ]
    return np.array(deep, dtype=np.bool_)


@dataclass(frozen=True, eq=False)
class DiscrepancyFit:
    """A fit that allows for the discrepancy of its model."""

    model: Model
    """The model, with the standard deviations of the noise."""
    discrepancy: Discrepancy
    """The discrepancy, estimated with the fit."""
    fit: Fit
    deviance: float
    """Minus twice the logarithm of the likelihood of the errors of modes and of their noise, up to a constant that
    models of the same data share. Lines do not count: neighbouring ones have the same error."""
    errors: int
    """Number of these errors."""


def fit_discrepancy(model: Model, start: Mapping[str, float]) -> DiscrepancyFit:
    """Return the fit of a model that allows for its discrepancy; each is estimated with the other in turn.

    Parameters
    ----------
    model : Model
        The model, with the standard deviations of the noise.
    start : mapping of str to float
        Values from which the fit starts.

    Raises
    ------
    ReceptanceError
        The model has no value at the start.
    """
    fit = evaluate(model, start)
    if not np.isfinite(fit.chi_square):
        raise ReceptanceError("the model cannot be evaluated at the start of a fit with a discrepancy")
    found, deviance, errors = _most_likely(model, fit, DISCREPANCIES[0])
    for _ in range(DISCREPANCY_ROUNDS):
        fit = refit(found.allow(model), fit.values)
        before = found
        found, deviance, errors = _most_likely(model, fit, before.frequency)
        if found.is_close(before):
            break
    priors = sum(unknown.prior is not None for unknown in fit.task.parameters.unknowns)
    deviance += float(np.sum(np.square(fit.residual[fit.residual.size - priors :])))
    # Lines and priors may agree less with these parameters than their likelihood expects.
    larger = before.times(math.sqrt(max(fit.misfit, 1.0)))
    return DiscrepancyFit(model, larger, refit(larger.allow(model), fit.values), deviance, errors)


@dataclass(frozen=True, eq=False)
class _Errors:
    """Errors in groups: those of a mode in one part of a record, or a single error of a measured frequency.

    The errors of a group have multiples of one effect in common, and of an error of frequency. Several groups share
    an error of frequency, and no group has two, so that the effects are correlated in pairs only.
    """

    values: NDArray[np.float64]
    """`(n,)` errors, of real and imaginary parts of logarithms, or relative ones."""
    noise: NDArray[np.float64]
    """`(n,)` variances of the noise, and of the part that is not linear in the effects."""
    slopes: NDArray[np.float64]
    """`(n,)` errors by a unit of the error of frequency."""
    factors: NDArray[np.float64]
    """`(n,)` errors by a unit of the effect of the group."""
    sizes: NDArray[np.intp]
    """`(g,)` number of errors of each group."""
    kinds: NDArray[np.intp]
    """`(g,)` kind of the effect of each group."""
    modes: NDArray[np.intp]
    """`(g,)` number of the error of frequency of each group; that after the last one has no effect."""
    count: int
    """Number of errors of frequency that groups share."""
    has_remainder: NDArray[np.bool_]
    """`(g,)` whether each error has a part of its own beside the effects and the noise."""


def _most_likely(model: Model, fit: Fit, shift: float) -> tuple[Discrepancy, float, int]:
    """Return the discrepancy with the largest likelihood of the errors of a fit, the deviance and number of those.

    The effect of an error of frequency is the secant over plus and minus `shift`, a relative error.
    """
    errors = _join(_errors(model, fit, shift))
    numbers = np.bincount(errors.kinds, minlength=REMAINDER)
    numbers[FREQUENCY] += errors.count
    remainders = np.sum(errors.sizes[errors.has_remainder])
    smallest, largest = np.square(DISCREPANCIES)
    # Of the three kinds, and of the remainder.
    variances = np.array([1e-6, 1e-2, 1e-2, 1e-2])
    expectation = _Expectation(errors)
    for _ in range(MIXED_MODEL_STEPS):
        squares = expectation.squares(variances) / np.maximum([*numbers, remainders], 1)
        before, variances = variances, np.clip(squares, smallest, largest)
        if np.all(np.abs(np.log(variances / before)) < MIXED_MODEL_CHANGE):
            break
    # An error of level includes the remainder.
    squares[LEVEL] += squares[REMAINDER]
    squares = squares[:REMAINDER]
    own = np.clip(squares, smallest, largest)
    frequency, level, damping = np.sqrt(own).tolist()
    found = Discrepancy(frequency, level if numbers[LEVEL] else None, damping if numbers[DAMPING] else None)
    # With the noise, because errors far below it are not smaller than others below it.
    noise = expectation.noise
    deviance = numbers @ (np.log(own + noise) + (squares + noise) / (own + noise))
    return found, float(deviance), int(numbers.sum())


class _Expectation:
    """Expected squares of effects and remainders, given the errors and the variances."""

    def __init__(self, errors: _Errors) -> None:
        self._errors = errors
        self._first = np.cumsum(errors.sizes) - errors.sizes
        self._remainder = np.repeat(errors.has_remainder, errors.sizes)
        one, s, y = errors.factors, errors.slopes, errors.values
        self._products = np.array([one * one, one * s, s * s, one * y, s * y, y * y])
        self._weighted = np.empty_like(self._products)

    @property
    def noise(self) -> NDArray[np.float64]:
        """Variance of an effect that is estimated from the noise alone, for each kind, `(3,)`."""
        errors = self._errors
        ones, _, ss, *_ = self._sums(self._products, 1.0 / errors.noise)
        precision = np.bincount(errors.kinds, ones, REMAINDER)
        number = np.bincount(errors.kinds, minlength=REMAINDER)
        precision[FREQUENCY] += np.sum(ss[errors.modes < errors.count])
        number[FREQUENCY] += errors.count
        # The inverse of the mean precision.
        return np.asarray(number / np.maximum(precision, np.finfo(float).tiny))

    def squares(self, variances: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the sums of the expected squares of each kind of effects, and of the remainders, `(4,)`."""
        errors = self._errors
        own = variances[REMAINDER]
        weight = 1.0 / (errors.noise + own * self._remainder)
        ones, s, ss, y, sy, _ = self._sums(self._products, weight)
        # The errors of frequency follow after an elimination of the effects of their groups, which are independent.
        precision = ones + 1.0 / variances[errors.kinds]
        ratio = s / precision
        of_modes = errors.count + 1
        variance = 1.0 / (1.0 / variances[FREQUENCY] + np.bincount(errors.modes, ss - ratio * s, of_modes))
        shift = variance * np.bincount(errors.modes, sy - ratio * y, of_modes)
        of_shift, shift_variance = shift[errors.modes], variance[errors.modes]
        effect = (y - s * of_shift) / precision
        square = np.square(effect) + 1.0 / precision + np.square(ratio) * shift_variance
        square_of_shift = np.square(of_shift) + shift_variance
        sums = np.asarray(np.bincount(errors.kinds, square, REMAINDER + 1), dtype=np.float64)
        sums[FREQUENCY] += np.sum((np.square(shift) + variance)[: errors.count])
        both = effect * of_shift - ratio * shift_variance
        coefficients = np.array(
            [square, 2.0 * both, square_of_shift, -2.0 * effect, -2.0 * of_shift, np.ones(square.size)]
        )
        # Of the squares of what the effects leave, each divided by the square of its variance.
        left = np.sum(coefficients * self._sums(self._weighted, weight), axis=0)
        total = np.add.reduceat(weight, self._first)
        sums[REMAINDER] = own * np.sum((errors.sizes - own * total + own * left)[errors.has_remainder])
        return sums

    def _sums(self, products: NDArray[np.float64], weight: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the sums over each group of weighted products, which are kept, `(6, g)`."""
        np.multiply(products, weight, out=self._weighted)
        return np.add.reduceat(self._weighted, self._first, axis=1)


def _errors(model: Model, fit: Fit, shift: float) -> list[_Errors]:
    """Return the errors of a fit: those of natural frequencies and damping ratios, and of each configuration."""
    found: list[_Errors] = []
    records: dict[str, list[tuple[Observation, NDArray[np.float64]]]] = {}
    triples = zip(model.observations, fit.model.observations, fit.parts, strict=True)
    for name, (observation, fitted, residual) in zip(model.configuration_of, triples, strict=True):
        if observation.is_receptance:
            records.setdefault(name, []).append(
                (observation, residual.reshape(2, -1) * fitted.standard_deviations[: residual.size // 2])
            )
        elif not observation.is_receptance and not fitted.is_receptance:
            found += _errors_of_frequencies(observation, fitted, residual)
    return [*found, *(_errors_of_records(record, shift) for record in records.values())]


def _join(errors: Sequence[_Errors]) -> _Errors:
    """Return all errors together."""
    count = sum(one.count for one in errors)
    before = np.cumsum([0, *(one.count for one in errors)])
    modes = [
        np.where(error.modes < error.count, i + error.modes, count) for i, error in zip(before, errors, strict=False)
    ]
    names = ("values", "noise", "slopes", "factors", "sizes", "kinds", "has_remainder")
    joined: dict[str, Any] = {name: np.concatenate([getattr(one, name) for one in errors]) for name in names}
    return _Errors(**joined, modes=np.concatenate(modes), count=count)


def _errors_of_frequencies(
    observation: Observation, fitted: Observation, residual: NDArray[np.float64]
) -> Iterator[_Errors]:
    """Yield relative errors of natural frequencies, and of damping ratios; each is an effect of its own."""
    of_frequency, of_damping = np.split(residual, [observation.frequency_hz.size])
    own, now = (np.asarray(each.standard_deviation) for each in (observation, fitted))
    yield _separate(of_frequency * now / observation.frequency_hz, own / observation.frequency_hz, FREQUENCY)
    if of_damping.size:
        own, now = (np.asarray(each.standard_deviation_damping)[observation.damped] for each in (observation, fitted))
        ratios = np.asarray(observation.damping_ratio)[observation.damped]
        yield _separate(of_damping * now / ratios, own / ratios, DAMPING)


def _separate(values: NDArray[np.float64], spread: NDArray[np.float64], kind: int) -> _Errors:
    none = np.zeros(values.size, dtype=np.intp)
    return _Errors(
        values=values,
        noise=np.square(spread),
        slopes=np.zeros(values.size),
        factors=np.ones(values.size),
        sizes=none + 1,
        kinds=none + kind,
        modes=none,
        count=0,
        has_remainder=none > 0,
    )


def _errors_of_records(records: Sequence[tuple[Observation, NDArray[np.float64]]], shift: float) -> _Errors:
    """Return the errors of the receptances of a configuration: the real parts of all, then the imaginary parts."""
    peaks = [_peaks(one) for one, _ in records]
    every = np.sort(np.concatenate(peaks))
    # Peaks of several records close to each other are one mode of the configuration.
    first = every[np.concatenate([[True], np.diff(np.log(every)) > SAME_MODE])] if every.size else every
    slopes, noise, sizes, modes, growths = [], [], [], [], []
    for peak, (one, _) in zip(peaks, records, strict=True):
        down, at_rest, up = _moved(one, shift)
        # The square of a normal error has a mean square of 3; each part has half of what the secant does not describe.
        curved = 3.0 / 8.0 * np.square(np.abs(up - 2.0 * at_rest + down))
        noise.append(np.square(one.standard_deviations.reshape(2, -1)[0]) / one.correlated_lines + curved)
        slopes.append((up - down) / (2.0 * shift))
        growths.append(growth_beside_peaks(one))
        # The lines of a mode are neighbours. A record without a peak has no error of frequency.
        sizes.append(np.bincount(nearest_peak(one.frequency_hz.real, peak)))
        modes.append(np.searchsorted(first, peak, side="right") - 1 if peak.size else np.array([first.size]))
    slope, size, mode = np.concatenate(slopes), np.concatenate(sizes), np.concatenate(modes)
    growth = np.tile(np.concatenate(growths), 2)
    # Divided by the growth of the remainder, which then has one variance.
    scale = 1.0 / np.sqrt(growth)
    values = np.concatenate([part for row in (0, 1) for part in (error[row] for _, error in records)])
    return _Errors(
        values=values * scale,
        noise=np.concatenate([*noise, *noise]) / growth,
        slopes=np.concatenate([slope.real, slope.imag]) * np.tile(np.repeat(mode < first.size, size), 2) * scale,
        factors=scale,
        sizes=np.tile(size, 2),
        kinds=np.full(2 * size.size, LEVEL),
        modes=np.tile(mode, 2),
        count=first.size,
        has_remainder=np.ones(2 * size.size, dtype=np.bool_),
    )


def growth_beside_peaks(observation: Observation) -> NDArray[np.float64]:
    """Return the factor by which the variance of errors of level is larger than at the peaks, `(n,)`.

    Each peak is taken as that of a mode with its height and its width, which is measured at half of the height.
    """
    lines, size = observation.frequency_hz.real, np.abs(observation.receptance)
    squares = np.zeros(lines.size)
    for peak in np.searchsorted(lines, _peaks(observation)):
        away = np.abs(np.square(lines / lines[peak]) - 1.0)
        is_lower = size <= 0.5 * size[peak]
        sides = [*np.flatnonzero(is_lower[:peak])[-1:], *(peak + np.flatnonzero(is_lower[peak:])[:1])]
        if sides:
            # |H_m|^2 = |H_peak|^2 / (1 + (away / loss)^2).
            loss = np.mean([away[i] / math.sqrt(np.square(size[peak] / size[i]) - 1.0) for i in sides])
            squares += np.square(size[peak]) / (1.0 + np.square(away / loss))
    return np.asarray(np.maximum(squares / np.square(size), 1.0))


def _variance_of_shift(observation: Observation, frequency: float) -> NDArray[np.float64]:
    """Return the variance of the logarithm by an error of frequency, for the real and the imaginary part each."""
    down, at_rest, up = _moved(observation, frequency)
    return np.asarray((np.square(np.abs(up - at_rest)) + np.square(np.abs(down - at_rest))) / 4.0)


def _moved(observation: Observation, shift: float) -> list[NDArray[np.complex128]]:
    """Return the logarithm of the receptance at frequencies that are smaller by a share, the same, and larger."""
    lines = observation.frequency_hz.real
    logarithm = np.log(np.abs(observation.receptance)) + 1j * np.unwrap(np.angle(observation.receptance))
    return [np.asarray(np.interp(lines * (1.0 + way * shift), lines, logarithm)) for way in (-1.0, 0.0, 1.0)]


def _records(model: Model) -> list[int]:
    """Return for each observation the number of receptances of its configuration."""
    receptances = [observation.is_receptance for observation in model.observations]
    names = [name for name, is_one in zip(model.configuration_of, receptances, strict=True) if is_one]
    return [max(names.count(name), 1) for name in model.configuration_of]


def _peaks(observation: Observation) -> NDArray[np.float64]:
    """Return the frequencies of the peaks of modes in Hz."""
    least = max(MODE_PROMINENCE, MODE_NOISE * float(np.median(observation.standard_deviations)))
    lines = observation.frequency_hz.real
    return np.asarray(lines[local_maxima(np.log(np.abs(observation.receptance) * lines), least)[0]])


def _common_lines(
    modes: NDArray[np.intp], shifted: NDArray[np.bool_], records: int, weights: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return for each line the sum of the weights of the lines that share its two independent values."""
    groups = 2 * modes + shifted
    counts = np.bincount(groups, weights)
    # One error of frequency, a real number, for all records.
    counts[1::2] *= 2 * records
    return np.asarray(counts[groups])
