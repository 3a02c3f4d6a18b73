"""Fits that allow for a discrepancy, and the estimate of its size.

The standard deviations are those of largest likelihood in a linear mixed model of the errors e of a fit
(symbols as in `discrepancy`),

    e(f) = a_mk + d_m (ln H(f (1 + s)) - ln H(f (1 - s))) / (2 s) + g(f)^(1/2) b(f) + noise,

with the error of level a_mk of mode m in record k, the relative error d_m of its frequency in all records of a
configuration, and a remainder b of each line; all are normal with mean zero, and r^2 is the variance of a_mk and b
together. In the fits both grow between the peaks, which gives lines there less weight than the estimate does. The
likelihood is maximised by expectation and maximisation (Laird and Ware, Biometrics 38, 1982, 963-974).
Intervals of a fit that allows for the discrepancy include it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from receptance._peaks import nearest_peak
from receptance.errors import ReceptanceError
from receptance.fit.adequacy import MISFIT_LIMIT, strain_of
from receptance.fit.discrepancy import DISCREPANCIES, Discrepancy, curve_of
from receptance.fit.observation import Observation
from receptance.fit.problem import CONVERGED, End, Task

FREQUENCY, LEVEL, DAMPING, REMAINDER = range(4)
"""Kinds of errors: of natural frequencies, of the level of a mode, of damping ratios, and of each line."""
SAME_MODE = 0.06
"""Relative difference of two peak frequencies up to which they are the same mode."""
EVALUATIONS = 200
"""Most evaluations of a fit."""
_ROUNDS = 6
"""Most repetitions of the estimate and of the fit."""
_STEPS = 60
_CHANGE = 0.02
"""Most steps of the estimate of the standard deviations, and the change of the logarithm of a variance that ends it."""
_HALVINGS = 6
"""Halvings of the range in which the smallest discrepancy is searched for."""


@dataclass(frozen=True, eq=False)
class DiscrepancyFit:
    """A fit that allows for the discrepancy of its model."""

    task: Task
    """The model, with the discrepancy."""
    end: End
    """The end of the fit."""
    deviance: float
    """Minus twice the logarithm of the likelihood of the errors of modes and of their noise, up to a constant that
    models of the same data share. Lines do not count: neighbouring ones have the same error."""
    errors: int
    """Number of these errors."""

    @property
    def discrepancy(self) -> Discrepancy:
        """The discrepancy, estimated with the fit."""
        assert self.task.discrepancy is not None
        return self.task.discrepancy


def fit_discrepancy(task: Task, start: NDArray[np.float64]) -> DiscrepancyFit:
    """Return the fit of a model that allows for its discrepancy; each is estimated with the other in turn.

    Parameters
    ----------
    task : Task
        The model, with the standard deviations of the noise.
    start : ndarray
        Variables from which the fit starts.

    Raises
    ------
    ReceptanceError
        The model has no value at the start.
    """
    residual = task.problem().residual(start)
    if not np.isfinite(residual).all():
        raise ReceptanceError("the model cannot be evaluated at the start of a fit with a discrepancy")
    found, deviance, errors = _most_likely(task, task.selected, residual, DISCREPANCIES[0])
    end = None
    for _ in range(_ROUNDS):
        allowed = task.allow(found)
        end = _refit(allowed, start if end is None else end.x)
        residual = allowed.problem().value(end.x)
        before = found
        found, deviance, errors = _most_likely(task, allowed.selected, residual, before.frequency)
        if found.is_close(before):
            break
    assert end is not None
    priors = task.variables.priors.shape[0]
    deviance += float(np.sum(np.square(residual[residual.size - priors :])))
    # Lines and priors may agree less with these parameters than their likelihood expects.
    misfit = 2.0 * end.cost / expected_chi_square(allowed)
    allowed = task.allow(before.times(math.sqrt(max(misfit, 1.0))))
    return DiscrepancyFit(allowed, _refit(allowed, end.x), deviance, errors)


def sufficient(task: Task, found: DiscrepancyFit) -> DiscrepancyFit:
    """Return the fit with the smallest discrepancy that explains residuals and errors of the tolerances.

    Errors of tolerances can absorb an error of the model, so that no line shows it, and the estimate is that of the
    noise. The model with nominal dimensions and materials shows it: the discrepancy is a multiple of that of this
    model, and the smallest one is found by halvings of the logarithm of the factor. None is smaller than the estimate.

    Parameters
    ----------
    task : Task
        The model, with the standard deviations of the noise.
    found : DiscrepancyFit
        Its fit by `fit_discrepancy`.
    """
    if _is_explained(found):
        return found
    is_error = np.array([unknown.name in task.parameters.errors for unknown in task.variables.unknowns])
    nominal = np.where(is_error, 0.0, found.end.x)
    end = task.problem().fit_one(nominal, EVALUATIONS, free=~is_error, least=CONVERGED)
    residual = task.problem().residual(end.x)
    if not np.isfinite(residual).all():
        return found
    unit, _, _ = _most_likely(task, task.selected, residual, found.discrepancy.frequency)
    low, high = min(math.log(found.discrepancy.largest / unit.largest), -math.log(2.0)), 0.0
    least = found.discrepancy
    best = _with(task, unit.at_least(least), end.x, found)
    while not _is_explained(best) and best.discrepancy.largest < DISCREPANCIES[1]:
        low, high = high, high + math.log(2.0)
        best = _with(task, unit.times(math.exp(high)).at_least(least), best.end.x, found)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        tried = _with(task, unit.times(math.exp(middle)).at_least(least), best.end.x, found)
        if _is_explained(tried):
            best, high = tried, middle
        else:
            low = middle
    return best


def _is_explained(fit: DiscrepancyFit) -> bool:
    """Return whether residuals and errors of the tolerances are those of an adequate model."""
    problem, end = fit.task.problem(), fit.end
    if 2.0 * end.cost > MISFIT_LIMIT * expected_chi_square(fit.task):
        return False
    return strain_of(fit.task, problem.value(end.x), problem.curvature_root(end.x)).passed


def expected_chi_square(task: Task) -> float:
    """Return the expectation of chi-square from noise and floor: the degrees of freedom, at least one."""
    free = sum(unknown.prior is None for unknown in task.parameters.unknowns)
    return max(task.independent_values - free, 1.0)


def _with(task: Task, discrepancy: Discrepancy, start: NDArray[np.float64], found: DiscrepancyFit) -> DiscrepancyFit:
    allowed = task.allow(discrepancy)
    return replace(found, task=allowed, end=_refit(allowed, start))


def _refit(task: Task, start: NDArray[np.float64]) -> End:
    problem = task.problem()
    end = problem.fit_one(start, EVALUATIONS, least=CONVERGED)
    if not np.isfinite(end.cost):
        raise ReceptanceError(f"the model cannot be evaluated at any start of the fit: {problem.reason(end.x)}")
    return end


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


def _most_likely(
    task: Task, fitted: Sequence[Observation], residual: NDArray[np.float64], shift: float
) -> tuple[Discrepancy, float, int]:
    """Return the discrepancy with the largest likelihood of the errors of a fit, the deviance and number of those.

    `fitted` are the observations with the standard deviations of the fit, and `residual` all its residuals. The effect
    of an error of frequency is the secant over plus and minus `shift`, a relative error.
    """
    errors = _join(_errors(task, fitted, residual, shift))
    numbers = np.bincount(errors.kinds, minlength=REMAINDER)
    numbers[FREQUENCY] += errors.count
    remainders = np.sum(errors.sizes[errors.has_remainder])
    smallest, largest = np.square(DISCREPANCIES)
    # Of the three kinds, and of the remainder.
    variances = np.array([1e-6, 1e-2, 1e-2, 1e-2])
    expectation = _Expectation(errors)
    for _ in range(_STEPS):
        squares = expectation.squares(variances) / np.maximum([*numbers, remainders], 1)
        before, variances = variances, np.clip(squares, smallest, largest)
        if np.all(np.abs(np.log(variances / before)) < _CHANGE):
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


def _errors(task: Task, fitted: Sequence[Observation], residual: NDArray[np.float64], shift: float) -> list[_Errors]:
    """Return the errors of a fit: those of natural frequencies and damping ratios, and of each configuration."""
    found: list[_Errors] = []
    records: dict[str, list[tuple[Observation, NDArray[np.float64]]]] = {}
    triples = zip(task.selected, fitted, task.problem().parts(residual), strict=True)
    for name, (observation, weighed, part) in zip(task.configurations, triples, strict=True):
        if observation.is_receptance:
            records.setdefault(name, []).append(
                (observation, part.reshape(2, -1) * weighed.standard_deviations[: part.size // 2])
            )
        elif not weighed.is_receptance:
            found += _errors_of_frequencies(observation, weighed, part)
    return [*found, *(_errors_of_records(record, shift) for record in records.values())]


def _join(errors: Sequence[_Errors]) -> _Errors:
    """Return all errors together."""
    count = sum(group.count for group in errors)
    before = np.cumsum([0, *(group.count for group in errors)])
    modes = [
        np.where(error.modes < error.count, i + error.modes, count) for i, error in zip(before, errors, strict=False)
    ]
    names = ("values", "noise", "slopes", "factors", "sizes", "kinds", "has_remainder")
    joined: dict[str, Any] = {name: np.concatenate([getattr(group, name) for group in errors]) for name in names}
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
    curves = [curve_of(record) for record, _ in records]
    peaks = [curve.peaks_hz for curve in curves]
    every = np.sort(np.concatenate(peaks))
    # Peaks of several records close to each other are one mode of the configuration.
    first = every[np.concatenate([[True], np.diff(np.log(every)) > SAME_MODE])] if every.size else every
    slopes, noise, sizes, modes, growths = [], [], [], [], []
    for curve, peak, (one, _) in zip(curves, peaks, records, strict=True):
        down, at_rest, up = curve.moved(shift)
        # The square of a normal error has a mean square of 3; each part has half of what the secant does not describe.
        curved = 3.0 / 8.0 * np.square(np.abs(up - 2.0 * at_rest + down))
        noise.append(np.square(one.standard_deviations.reshape(2, -1)[0]) / one.correlated_lines + curved)
        slopes.append((up - down) / (2.0 * shift))
        growths.append(curve.growth)
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
