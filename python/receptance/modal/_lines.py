"""The lines of an FRF that an estimate is made from."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from receptance import _checks
from receptance.frf.variance import additive_share
from receptance.units import FORMS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.frf import FRF


@dataclass(frozen=True)
class Lines:
    """Usable lines of a band as plain arrays; m entries are the responses by the excitations, one row after the other.

    Attributes
    ----------
    frf : FRF
        The same lines, as they were measured.
    frequency_hz : ndarray
        `(n,)` real.
    s : ndarray
        `(n,)` complex, i (w - i sigma): an exponential window moves the lines to the right of the imaginary axis.
    values : ndarray
        `(n, m)` in the form they were measured in, because that is the form their noise is simplest in.
    power : int
        Receptance times s to this power is that form.
    relative : ndarray or None
        `(n, m)` standard deviation of the real and of the imaginary part of the logarithm; may be infinite.
    freedom : float
        Degrees of freedom of those standard deviations; infinite where they are exact or not stated.
    shared : float
        How many neighbouring lines share one independent value.
    notes : tuple of str
        What a person should know of them.
    """

    frf: FRF
    frequency_hz: NDArray[np.float64]
    s: NDArray[np.complex128]
    values: NDArray[np.complex128]
    power: int
    relative: NDArray[np.float64] | None
    freedom: float
    shared: float
    notes: tuple[str, ...]

    @property
    def receptance(self) -> NDArray[np.complex128]:
        """`(n, m)` receptance on the complex lines."""
        return self.values / self.s[:, None] ** self.power

    @cached_property
    def additive(self) -> NDArray[np.float64] | None:
        """`(n, m)` share of additive noise in each variance; None where no variance is stated."""
        if self.relative is None:
            return None
        share = np.ones_like(self.relative)
        for entry in range(self.values.shape[1]):
            known = np.isfinite(self.relative[:, entry]) & (self.values[:, entry] != 0.0)
            if known.any():
                variance = self.relative[known, entry] ** 2
                share[known, entry] = additive_share(self.values[known, entry], variance, self.shared)
        return share

    @property
    def spacing_hz(self) -> float:
        """Distance between neighbouring lines; the median where it varies."""
        return float(np.median(np.diff(self.frequency_hz)))

    def spacing_at(self, place: int) -> float:
        """Distance of the lines around one inside the band."""
        return float(self.frequency_hz[place + 1] - self.frequency_hz[place - 1]) / 2.0

    def thinned(self, most: int) -> Lines:
        """Return fewer lines where there are more: evenly spread ones, and as many of the highest."""
        n = self.frequency_hz.size
        if n <= most:
            return self
        # Peaks are what modes are found from; even thinning alone could step over them.
        level = np.mean(np.abs(self.values) ** 2, axis=0)
        size = np.sum(np.abs(self.values) ** 2 / np.where(level > 0.0, level, 1.0), axis=1)
        kept = np.union1d(np.linspace(0, n - 1, most // 2).astype(np.int64), np.argsort(size)[-(most // 2) :])
        relative = None if self.relative is None else self.relative[kept]
        return replace(
            self, frequency_hz=self.frequency_hz[kept], s=self.s[kept], values=self.values[kept], relative=relative
        )


def lines_of(owner: str, frf: FRF, low_hz: float | None, high_hz: float | None, least: int) -> Lines:
    """Return the usable lines between two frequencies, both included, without 0 Hz.

    Raises
    ------
    TypeError, ValueError
        Something else than an FRF, a band the wrong way round, or fewer than `least` lines in it.
    """
    from receptance.frf import FRF

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
    # The smallest positive number keeps a line at 0 Hz out.
    part = frf.masked().select(low_hz=max(low, float(np.nextafter(0.0, 1.0))), high_hz=high_hz)
    lines, values = part.frequency_hz, part.values.reshape(part.shape[0], -1)
    relative, notes = _relative(owner, part)
    shared = float(np.median(part.correlated_lines))
    s = (2j * np.pi * lines + part.decay_rate).astype(np.complex128)
    # Of the errors that follow, too: to average many lines would give more, were these not estimated together.
    freedom = float("inf") if part.degrees_of_freedom is None else float(np.median(part.degrees_of_freedom))
    return Lines(part, lines, s, values, FORMS.index(part.form), relative, freedom, shared, notes)


def one_entry(owner: str, lines: Lines) -> None:
    """Raise if the FRF has several responses or excitations."""
    entries = lines.values.shape[1]
    if entries != 1:
        raise ValueError(
            f"{owner}: the FRF has {entries} entries, expected one response and one excitation; "
            "take one with frf.select(responses=..., excitations=...), or use fit_modes for all of them together"
        )


def _relative(owner: str, part: FRF) -> tuple[NDArray[np.float64] | None, tuple[str, ...]]:
    if part.log_variance is None:
        return None, ()
    variance = part.log_variance.reshape(part.shape[0], -1)
    lost = np.flatnonzero(~np.isfinite(variance).any(axis=0))
    if lost.size:
        row, column = divmod(int(lost[0]), part.shape[2])
        raise ValueError(
            f"{owner}: the log_variance of response {row} by excitation {column} is infinite on every line between "
            f"{part.frequency_hz[0]:g} and {part.frequency_hz[-1]:g} Hz: nothing is known there; leave the entry out"
        )
    positive = variance > 0.0
    if not positive.any():
        return None, ("the stated variance is zero on all lines: the scatter is taken from the residuals instead",)
    if positive.all():
        return np.sqrt(variance), ()
    # A coherence of exactly one says that the noise was too small to be seen, not that there was none.
    floor = float(variance[positive].min())
    count = int(np.count_nonzero(~positive))
    note = f"{count} values have a stated variance of zero; they count as the smallest above zero, {floor:.2g}"
    return np.sqrt(np.where(positive, variance, floor)), (note,)
