"""Selection of the lines of an FRF for an estimate."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from receptance import _checks
from receptance.frf import FRF
from receptance.frf.variance import additive_share, resolution
from receptance.units import FORMS


@dataclass(frozen=True)
class Lines:
    """Usable lines of a band as plain arrays; the m entries are ordered by response, then by excitation."""

    frf: FRF
    """The FRF on these lines."""
    frequency_hz: NDArray[np.float64]
    """`(n,)` real lines."""
    s: NDArray[np.complex128]
    """`(n,)` complex ones i (w - i sigma), to the right of the imaginary axis under a window."""
    values: NDArray[np.complex128]
    """`(n, m)` in the measured form, in which the noise is simplest: the receptance times s to the `power`."""
    power: int
    relative: NDArray[np.float64] | None
    """`(n, m)` standard deviation of real and imaginary part of the logarithm; may be infinite."""
    freedom: float
    """Degrees of freedom of these standard deviations; infinite if exact or not stated."""
    correlated_lines: float
    """Number of neighbouring lines per independent value."""
    notes: tuple[str, ...]

    @property
    def receptance(self) -> NDArray[np.complex128]:
        """`(n, m)` receptance on the complex lines."""
        return self.values / self.s[:, None] ** self.power

    @cached_property
    def additive(self) -> NDArray[np.float64] | None:
        """`(n, m)` share of additive noise in each variance; None if no variance is stated."""
        if self.relative is None:
            return None
        share = np.ones_like(self.relative)
        for entry in range(self.values.shape[1]):
            finite = np.isfinite(self.relative[:, entry]) & (self.values[:, entry] != 0.0)
            if finite.any():
                variance = self.relative[finite, entry] ** 2
                share[finite, entry] = additive_share(self.values[finite, entry], variance, self.correlated_lines)
        return share

    @property
    def spacing_hz(self) -> float:
        """Median distance between neighbouring lines."""
        return float(np.median(np.diff(self.frequency_hz)))

    def spacing_at(self, index: int) -> float:
        """Mean distance of a line to its two neighbours."""
        return float(self.frequency_hz[index + 1] - self.frequency_hz[index - 1]) / 2.0

    def thinned(self, most: int) -> Lines:
        """Return at most `most` lines: half of them evenly distributed, half with the largest magnitudes."""
        n = self.frequency_hz.size
        if n <= most:
            return self
        # Even thinning alone could skip peaks.
        level = np.mean(np.abs(self.values) ** 2, axis=0)
        size = np.sum(np.abs(self.values) ** 2 / np.where(level > 0.0, level, 1.0), axis=1)
        kept = np.union1d(np.linspace(0, n - 1, most // 2).astype(np.int64), np.argsort(size)[-(most // 2) :])
        relative = None if self.relative is None else self.relative[kept]
        return replace(
            self, frequency_hz=self.frequency_hz[kept], s=self.s[kept], values=self.values[kept], relative=relative
        )


def select_lines(owner: str, frf: FRF, low_hz: float | None, high_hz: float | None, least: int) -> Lines:
    """Return the usable lines between two frequencies, both included, without 0 Hz; at least `least` or raise."""
    if not isinstance(frf, FRF):
        raise TypeError(f"{owner}: frf is {type(frf).__name__}, expected an FRF")
    low = 0.0 if low_hz is None else _checks.not_negative(owner, "low_hz", low_hz, unit="Hz")
    high = np.inf if high_hz is None else _checks.positive(owner, "high_hz", high_hz, unit="Hz")
    if low >= high:
        raise ValueError(f"{owner}: low_hz is {low:g} and high_hz {high:g}, expected low_hz below high_hz")
    f = frf.frequency_hz
    inside = (f >= low) & (f <= high) & (f > 0.0)
    usable = inside if frf.usable is None else inside & frf.usable
    if np.count_nonzero(usable) < least:
        unusable = np.count_nonzero(inside) - np.count_nonzero(usable)
        raise ValueError(
            f"{owner}: {np.count_nonzero(usable)} lines of {frf!r} are between {low:g} and {min(high, f[-1]):g} Hz"
            + (f" (and {unusable} outside its usable band)" if unusable else "")
            + f", expected at least {least}"
        )
    # The smallest positive number excludes a line at 0 Hz.
    part = frf.masked().select(low_hz=max(low, float(np.nextafter(0.0, 1.0))), high_hz=high_hz)
    lines, values = part.frequency_hz, part.values.reshape(part.shape[0], -1)
    relative, notes = _relative(owner, part)
    correlated_lines = float(np.median(part.correlated_lines))
    s = (2j * np.pi * lines + part.decay_rate).astype(np.complex128)
    # Averaging over lines adds no degrees of freedom, because the variances of the lines are pooled.
    freedom = float("inf") if part.degrees_of_freedom is None else float(np.median(part.degrees_of_freedom))
    return Lines(part, lines, s, values, FORMS.index(part.form), relative, freedom, correlated_lines, notes)


def _relative(owner: str, part: FRF) -> tuple[NDArray[np.float64] | None, tuple[str, ...]]:
    if part.log_variance is None:
        return None, ()
    variance = part.log_variance.reshape(part.shape[0], -1)
    without = np.flatnonzero(~np.isfinite(variance).any(axis=0))
    if without.size:
        row, column = divmod(int(without[0]), part.shape[2])
        raise ValueError(
            f"{owner}: the log_variance of response {row} by excitation {column} is infinite on all lines between "
            f"{part.frequency_hz[0]:g} and {part.frequency_hz[-1]:g} Hz; leave the entry out"
        )
    positive = variance > 0.0
    if not positive.any():
        return None, ("the stated variance is zero on all lines: the scatter is estimated from the residuals",)
    if positive.all():
        return np.sqrt(variance), ()
    # A zero among others is a rounded number.
    least = resolution(variance)
    count = int(np.count_nonzero(~positive))
    note = (
        f"{count} values have a stated variance of zero; half a unit of its last digit, {least:.2g}, is used for them"
    )
    return np.sqrt(np.where(positive, variance, least)), (note,)
