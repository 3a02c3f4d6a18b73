"""Weights of the lines of a receptance in a fit: measured or stated standard deviations, and a floor under them.

They are computed where a fit first needs them. The variance of the logarithm of a line has two parts.

One is the measured noise. Noise of the response is additive: its
variance a does not depend on the FRF, and that of the logarithm is a / |H|^2. Dividing by the measured |H|^2 would give
lines that noise has enlarged a larger weight: with the relative error e of a line, weights are proportional to
1 + 2 Re e, and the mean of weight times error is 2 instead of 0, on quiet and on noisy lines. Fits of hundreds of lines
would be biased by up to half a standard error. Therefore |H|^2 is estimated from neighbouring lines, without the line
itself. The part of the variance that is proportional to |H|^2 needs no division and is unchanged.

The other part is a floor for errors that noise models omit: a relative error, and a jitter of frequency, with
sd^2 = relative^2 + (frequency |d ln H / d ln f|)^2. Without it the lines around resonances dominate, and errors of the
model far below those of any measurement appear as effects.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from receptance import _checks
from receptance.errors import warn_user
from receptance.frf.plausibility import low_frequency_rise
from receptance.frf.variance import LINES_AT_ONCE, additive_share, lines_around, resolution

_FEW_DEGREES = 10.0
"""Below these degrees of freedom a standard deviation is uncertain by 25 % and more."""
_EXPLAINED = 4.0
"""Scatter of the lowest lines up to this multiple of the stated variance is noise."""
_SLOPE_LINES = 12
"""Largest number of lines to each side from which a slope is estimated."""
_SLOPE_NOISE = 0.2
"""Largest standard deviation from the noise of the slope, relative to that of the line."""
_HALF_WIDTHS = (3, 6, 12, 24)
"""Half widths of the local parabolas, in correlated lines."""
_PARABOLA_MISFIT = 2.0
"""Largest excess of chi-square per degree of freedom over 1, in its standard deviations."""
_LINE_MISFIT = 9.0
"""Largest squared deviation of the line from the parabola, in variances."""


@dataclass(frozen=True, kw_only=True)
class Floor:
    """Errors of a measured receptance that noise models omit, for `Observation.from_frf`.

    Every line has them as independent errors.

    Raises
    ------
    TypeError, ValueError
        A negative number.

    Examples
    --------
    >>> from receptance.fit import Floor
    >>> print(Floor())
    0.3 % of the receptance and 0.01 % of frequency
    """

    relative: float = 0.003
    """Standard deviation of the real and of the imaginary part of the logarithm, on every line."""
    frequency: float = 1e-4
    """Relative standard deviation of the frequency of a line."""

    def __post_init__(self) -> None:
        names = ("relative", "frequency")
        _checks.set_fields(self, {name: _checks.not_negative("Floor", name, getattr(self, name)) for name in names})

    def __bool__(self) -> bool:
        return self.relative > 0.0 or self.frequency > 0.0

    def __str__(self) -> str:
        if not self.frequency:
            return f"{self.relative:g}"
        return f"{100.0 * self.relative:g} % of the receptance and {100.0 * self.frequency:g} % of frequency"

    def variance(
        self,
        frequency_hz: NDArray[np.float64],
        receptance: NDArray[np.complex128],
        noise: NDArray[np.float64] | None = None,
    ) -> NDArray[np.float64]:
        """Return the variance `(n,)` of the real and of the imaginary part of the logarithm, each.

        Parameters
        ----------
        frequency_hz, receptance : ndarray
            `(n,)` each; NaN without values, which have no slope.
        noise : ndarray, optional
            `(n,)` variance of the measured noise. Noise enlarges the estimated slope: it is estimated over enough lines
            to keep this small, and the expected contribution is subtracted.
        """
        constant = np.full(frequency_hz.shape, self.relative**2)
        if not self.frequency or frequency_hz.size < 3 or np.isnan(receptance).any():
            return constant
        return constant + self.frequency**2 * _slope_squared(frequency_hz, receptance, noise, self.frequency)


def _slope_squared(
    lines: NDArray[np.float64], values: NDArray[np.complex128], noise: NDArray[np.float64] | None, frequency: float
) -> NDArray[np.float64]:
    """Return |d ln H / d ln f|^2 on every line, from linear regression over its neighbours."""
    n = lines.size
    x = np.log(lines)
    # The sum of the logarithms of ratios has no jumps of phase.
    y = np.concatenate([[0.0], np.cumsum(np.log(values[1:] / values[:-1]))])
    variance = np.zeros(n) if noise is None else noise
    result = np.zeros(n)
    pending = np.ones(n, dtype=np.bool_)
    at = np.arange(n)
    widest = min(_SLOPE_LINES, (n - 1) // 2)
    for half in range(1, widest + 1):
        near = np.clip(at[:, None] + np.arange(-half, half + 1), 0, n - 1)
        dx = x[near] - x[near].mean(axis=1, keepdims=True)
        power = np.sum(dx**2, axis=1)
        slope = np.sum(dx * y[near], axis=1) / power
        added = 2.0 * variance / power
        quiet = frequency**2 * added <= _SLOPE_NOISE**2 * 2.0 * variance
        done = pending & (quiet | (half == widest))
        result[done] = np.maximum(np.abs(slope) ** 2 - added, 0.0)[done]
        pending &= ~done
        if not pending.any():
            break
    return result


NO_FLOOR = Floor(relative=0.0, frequency=0.0)


def as_floor(owner: str, floor: float | Floor) -> Floor:
    """Return a floor; a number is its relative part."""
    if isinstance(floor, Floor):
        return floor
    return Floor(relative=_checks.not_negative(owner, "floor", floor), frequency=0.0) if floor else NO_FLOOR


@dataclass(frozen=True, eq=False)
class Noise:
    """Errors of the lines of an observation as they were stated or measured, and a floor."""

    deviation: NDArray[np.float64] | None = None
    """`(n,)` stated standard deviations, of lines that count as independent."""
    variance: NDArray[np.float64] | None = None
    """`(n,)` measured variance of the logarithm, of each line alone."""
    degrees_of_freedom: NDArray[np.float64] | None = None
    """`(n,)` of that variance."""
    floor: Floor = NO_FLOOR
    unused_coherence: str = ""
    """Why a measured coherence gives no variance, and what to do; empty without one."""

    def weigh(
        self,
        owner: str,
        lines: NDArray[np.float64],
        values: NDArray[np.complex128],
        correlated: NDArray[np.float64],
        *,
        drive_point: bool,
    ) -> tuple[NDArray[np.float64] | None, tuple[str, ...]]:
        """Return the standard deviations `(n,)` of lines that count as independent, and notes on them and on the lines.

        None without variance and floor.
        """
        deviation = self.deviation
        notes: list[str] = []
        if self.variance is not None:
            deviation, notes = self._measured(owner, self.variance, lines, values, correlated)
        elif self.floor:
            variance = self.floor.variance(lines, values)
            if deviation is None:
                notes = [f"there is no variance: the floor of {self.floor} is its standard deviation"]
            deviation = np.sqrt(variance if deviation is None else variance + deviation**2)
        if not np.isnan(values).any():
            notes += _low_frequency_notes(lines, values, deviation, drive_point)
        return deviation, tuple(notes)

    def _measured(
        self,
        owner: str,
        variance: NDArray[np.float64],
        lines: NDArray[np.float64],
        values: NDArray[np.complex128],
        correlated: NDArray[np.float64],
    ) -> tuple[NDArray[np.float64], list[str]]:
        notes: list[str] = []
        floor, freedoms = self.floor, self.degrees_of_freedom
        exact = variance == 0.0
        if exact.all():
            cause = "the variance is zero on all lines, as from a coherence of exactly 1 or a column of too few digits"
            if not floor:
                raise ValueError(
                    f"{owner}: {cause}, so they would have infinite weight; give a floor, floor=0.003 for example"
                )
            notes.append(f"{cause}: the floor of {floor} is the only standard deviation")
            warn_user(f"{owner}: {notes[-1]}")
        elif exact.any():
            variance = np.where(exact, least := resolution(variance), variance)
            notes.append(
                f"the variance is zero on {np.count_nonzero(exact)} of {exact.size} lines: half a unit of its last "
                f"digit, {least:.2g}, is used for them"
            )
        noise = smoothed_variance(lines, values, variance, correlated) * correlated
        if freedoms is not None:
            noise *= few_degrees_factor(freedoms)
        deviation: NDArray[np.float64] = np.sqrt(noise + floor.variance(lines, values, noise))
        if floor and not exact.all():
            share = float(np.median(noise / deviation**2))
            notes.append(f"floor of {floor} added to the noise, which is {100.0 * share:.0f} % of the median variance")
        if freedoms is not None and (freedom := float(np.median(freedoms))) < _FEW_DEGREES:
            notes.append(
                f"standard deviations from {freedom:.3g} degrees of freedom are uncertain: pool the variance over "
                "neighbouring lines"
            )
        return deviation, notes


def _low_frequency_notes(
    lines: NDArray[np.float64], values: NDArray[np.complex128], deviation: NDArray[np.float64] | None, drive_point: bool
) -> tuple[str, ...]:
    """Return a note on low-frequency lines that are integrated noise or drift beyond the standard deviations."""
    rise = low_frequency_rise(lines, values, drive_point=drive_point)
    if rise is None:
        return ()
    if deviation is not None and rise.noise_share > 0.0:
        lowest = lines <= rise.highest_hz
        power = np.abs(lines[lowest] ** 2 * values[lowest]) ** 2
        # Real and imaginary part of the logarithm have one variance each.
        stated = float(np.sum(2.0 * deviation[lowest] ** 2 * power) / np.sum(power))
        if _EXPLAINED * stated > rise.noise_share:
            return ()
    return (f"{rise}. A fit uses these lines unchanged: leave them out below about {rise.clear_hz:g} Hz",)


def smoothed_variance(
    frequency_hz: NDArray[np.float64],
    values: NDArray[np.complex128],
    log_variance: NDArray[np.float64],
    correlated_lines: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the variances of the logarithm with |H|^2 from neighbouring lines, `(n,)`.

    Where no parabola through the neighbours fits, beside sharp resonances with little noise, |H|^2 is that of the line.
    The values are not zero, the given variances those of each line alone.
    """
    result = log_variance.copy()
    values = values / np.abs(values).max()
    power = np.maximum(np.abs(values) ** 2, np.finfo(np.float64).tiny)
    stride = np.maximum(np.rint(correlated_lines), 1.0).astype(np.intp)
    share = additive_share(values, log_variance, correlated_lines)
    for first in range(0, values.size, LINES_AT_ONCE):
        lines = np.arange(first, min(first + LINES_AT_ONCE, values.size))
        # The caller checks variances of zero; no parabola fits such lines.
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = power[lines] / _smooth_power(lines, frequency_hz, values, 2.0 * log_variance * power, stride[lines])
        result[lines] *= 1.0 + share[lines] * (ratio - 1.0)
    return result


def few_degrees_factor(degrees_of_freedom: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the factor on variances that are estimated with few degrees of freedom, as weights of a fit.

    With weights 1 / v from estimated v the variance of a weighted mean is, to first order, 1 + 4 / nu times the one
    computed from the weights (Meier 1953); nu / (nu - 4) if all weights are independent. Below 8 degrees of freedom the
    factor is 2.
    """
    factor: NDArray[np.float64] = 1.0 / (1.0 - np.minimum(4.0 / degrees_of_freedom, 0.5))
    return factor


def _smooth_power(
    lines: NDArray[np.intp],
    frequency_hz: NDArray[np.float64],
    values: NDArray[np.complex128],
    noise: NDArray[np.float64],
    stride: NDArray[np.intp],
) -> NDArray[np.float64]:
    """Return |H|^2 from the widest parabola through neighbours that fits within the noise, else as measured."""
    power = np.abs(values[lines]) ** 2
    pending = np.arange(lines.size)
    for half in _HALF_WIDTHS:
        pending = pending[2 * half * stride[pending] < values.size]
        if not pending.size:
            break
        at, step = lines[pending], stride[pending]
        near = lines_around(at, half, step, values.size)
        others = np.abs(near - at[:, None]) >= step[:, None]
        x = frequency_hz[near] - frequency_hz[at, None]
        x /= np.abs(x).max(axis=1, keepdims=True)
        columns = np.stack([np.ones_like(x), x, x * x], axis=-1)
        # Products of three arrays in one `einsum` take three times as long.
        weighted = np.swapaxes(columns * others[:, :, None], 1, 2)
        inverse = np.linalg.inv(weighted @ columns)
        fitted = (inverse @ (weighted @ values[near][:, :, None]))[:, :, 0]
        left = np.abs(values[near] - (columns @ fitted[:, :, None])[:, :, 0]) ** 2
        freedom = np.count_nonzero(others, axis=1) - 3.0
        chi_square = np.sum(others * left / noise[near], axis=1) / freedom
        off = np.abs(values[at] - fitted[:, 0]) ** 2 / (noise[at] * (1.0 + inverse[:, 0, 0]))
        agrees = (chi_square < 1.0 + _PARABOLA_MISFIT / np.sqrt(freedom)) & (off < _LINE_MISFIT)
        pending = pending[agrees]
        power[pending] = np.abs(fitted[agrees, 0]) ** 2
    least: NDArray[np.float64] = np.maximum(power, np.finfo(np.float64).tiny)
    return least
