"""Natural frequency and damping of one mode against its amplitude, from a free decay."""

from __future__ import annotations

import itertools
import warnings
from dataclasses import dataclass, field, fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from receptance import _checks
from receptance.errors import ReceptanceWarning
from receptance.frf.variance import interval_factor
from receptance.report import Column, Provenance, Result, Table

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["RingDown", "ring_down"]

TAPS_PER_WIDTH = 4.0
"""Length of the filter times the width of the band: half of the amplitude passes at the ends of the band."""
PER_BLOCK = 8.0
"""Shortest block times the width of the band, which leaves residuals of a quadratic to estimate the scatter."""
_SAMPLES_PER_WIDTH = 3.0
_KAISER_BETA = 8.0
"""Shape parameter of the Kaiser window (80 dB)."""


@dataclass(frozen=True)
class Demodulation:
    """Complex amplitude z(t) of a band, whose part of the record is Re z exp(2 pi i middle t).

    Attributes
    ----------
    time_s : ndarray
        `(k,)` evenly spaced.
    log : ndarray
        `(k,)` complex log z, with unwrapped phase.
    middle_hz, width_hz : float
        Middle and width of the band.
    taps : ndarray
        Coefficients of the filter.
    sample_rate_hz : float
        Sample rate of the record.
    correlation : ndarray
        Correlation of filtered white noise at 0, 1, 2, ... steps of `time_s`.
    """

    time_s: NDArray[np.float64]
    log: NDArray[np.complex128]
    middle_hz: float
    width_hz: float
    taps: NDArray[np.float64]
    sample_rate_hz: float
    correlation: NDArray[np.float64]

    def until(self, count: int) -> Demodulation:
        """Return the first samples."""
        return replace(self, time_s=self.time_s[:count], log=self.log[:count])

    def log_gain(self, slope: complex) -> complex:
        """Return the log of the gain of the filter for exp(slope t)."""
        place = np.arange(self.taps.size) - 0.5 * (self.taps.size - 1)
        return complex(np.log(np.sum(self.taps * np.exp(-slope * place / self.sample_rate_hz))))


@dataclass(frozen=True)
class Block:
    """Estimates of one block of time."""

    time_s: float
    duration_s: float
    amplitude: float
    amplitude_standard_error: float
    frequency_hz: float
    frequency_standard_error_hz: float
    damping_ratio: float
    damping_standard_error: float
    relative_scatter: float
    degrees_of_freedom: float


def demodulate(
    record: NDArray[np.float64], sample_rate_hz: float, low_hz: float, high_hz: float, start_s: float
) -> Demodulation:
    """Shift a record down by the middle of a band and low-pass filter it, without the transients at its ends."""
    from scipy.signal import firwin, oaconvolve

    middle, width = 0.5 * (low_hz + high_hz), high_hz - low_hz
    half = int(np.ceil(0.5 * TAPS_PER_WIDTH * sample_rate_hz / width))
    taps = firwin(2 * half + 1, 0.5 * width, window=("kaiser", _KAISER_BETA), fs=sample_rate_hz)
    time = start_s + np.arange(record.size) / sample_rate_hz
    shifted = 2.0 * record * np.exp(-2j * np.pi * middle * time)
    step = max(int(sample_rate_hz / (_SAMPLES_PER_WIDTH * width)), 1)
    z = oaconvolve(shifted, taps, mode="valid")[::step]
    # Limited for records with zeros.
    size = np.maximum(np.abs(z), np.finfo(np.float64).tiny)
    log = np.log(size) + 1j * np.unwrap(np.angle(z))
    correlation = oaconvolve(taps, taps[::-1])[taps.size - 1 :: step]
    return Demodulation(
        time[half : half + shifted.size - 2 * half : step],
        log,
        middle,
        width,
        taps,
        sample_rate_hz,
        correlation / correlation[0],
    )


def split_blocks(signal: Demodulation, count: int) -> list[slice]:
    """Return blocks with equal decrease of the log amplitude, smoothed by a cubic."""
    time = signal.time_s - signal.time_s[0]
    share = time / time[-1]
    smooth = np.polynomial.Polynomial.fit(share, signal.log.real, min(3, share.size - 1))(share)
    falling = np.minimum.accumulate(smooth)
    # Without a decrease the blocks have equal length.
    course = (falling[0] - falling) + 1e-3 * share
    edges = np.searchsorted(course, np.linspace(0.0, course[-1], count + 1)[1:-1])
    ends = [0, *(int(edge) for edge in edges), time.size]
    return [slice(first, last) for first, last in itertools.pairwise(ends)]


def fit_block(signal: Demodulation, part: slice) -> Block:
    """Fit a quadratic to the log of the complex amplitude, weighted by the squared amplitude."""
    time, log = signal.time_s[part], signal.log[part]
    size = np.exp(log.real)
    middle = float(np.sum(size**2 * time) / np.sum(size**2))
    reach = 0.5 * float(time[-1] - time[0])
    x = (time - middle) / reach
    q, r = np.linalg.qr(np.stack([np.ones_like(x), x, 0.5 * x**2], axis=1) * size[:, None])
    inside = q.T @ (size * log)
    value, slope = np.linalg.solve(r, inside)[:2]
    slope = complex(slope) / reach
    residual = size * log - q @ inside

    step = float(time[1] - time[0])
    turned = signal.correlation * np.cos(slope.imag * step * np.arange(signal.correlation.size))
    spread = _correlated(turned, q)
    projected = q.T @ spread
    free = x.size - float(np.trace(projected))
    variance = float(np.sum(np.abs(residual) ** 2)) / (2.0 * free)
    lags = turned[1 : x.size]
    square = x.size + 2.0 * float(np.sum(lags**2 * (x.size - 1 - np.arange(lags.size))))
    square += -2.0 * float(np.sum(spread**2)) + float(np.sum(projected**2))
    back = np.linalg.inv(r)
    covariance = variance * back @ projected @ back.T

    decay, turn = -slope.real, slope.imag + 2.0 * np.pi * signal.middle_hz
    natural = float(np.hypot(decay, turn))
    error = float(np.sqrt(covariance[1, 1])) / reach
    amplitude = float(np.exp(value.real - signal.log_gain(slope).real))
    return Block(
        time_s=middle,
        duration_s=float(time[-1] - time[0]) + step,
        amplitude=amplitude,
        amplitude_standard_error=amplitude * float(np.sqrt(covariance[0, 0])),
        frequency_hz=natural / (2.0 * np.pi),
        frequency_standard_error_hz=error / (2.0 * np.pi),
        damping_ratio=decay / natural,
        damping_standard_error=error / natural,
        relative_scatter=float(np.sqrt(variance) / np.exp(value.real)),
        degrees_of_freedom=2.0 * free**2 / square,
    )


def _correlated(correlation: NDArray[np.float64], columns: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the product of the symmetric Toeplitz matrix of a short correlation with columns."""
    total: NDArray[np.float64] = correlation[0] * columns
    for lag in range(1, min(correlation.size, len(columns))):
        total[lag:] += correlation[lag] * columns[:-lag]
        total[:-lag] += correlation[lag] * columns[lag:]
    return total


_MAX_BLOCKS = 40
_MAX_SCATTER = 0.1
"""Largest scatter relative to the amplitude, above which the logarithm is biased."""
_MAX_INITIAL_SCATTER = 0.05
"""Largest relative scatter at the start of the decay without a warning of other contents of the band."""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class RingDown(Result):
    """Natural frequency and damping of one mode during its decay, one value per block of time.

    Attributes
    ----------
    time_s : ndarray
        `(k,)` middle of each block, from the record's first sample, weighted by amplitude squared.
    duration_s : ndarray
        `(k,)` length of each block.
    amplitude, amplitude_standard_error : ndarray
        `(k,)` amplitude (half of peak to peak) of the mode at this time, in the unit of the samples.
    frequency_hz, frequency_standard_error_hz : ndarray
        `(k,)` undamped natural frequency.
    damping_ratio, damping_standard_error : ndarray
        `(k,)` ratio of the decay rate of the amplitude to the natural frequency.
    relative_scatter : ndarray
        `(k,)` residuals of the smooth decay in the band, relative to the amplitude.
    degrees_of_freedom : ndarray
        `(k,)` degrees of freedom of the standard errors.
    band_hz : (float, float)
        Frequencies at which the filter passes half of the amplitude.
    notes : tuple of str
        Notes for the user.
    provenance : Provenance
        Versions of the software.
    """

    time_s: NDArray[np.float64]
    duration_s: NDArray[np.float64]
    amplitude: NDArray[np.float64]
    amplitude_standard_error: NDArray[np.float64]
    frequency_hz: NDArray[np.float64]
    frequency_standard_error_hz: NDArray[np.float64]
    damping_ratio: NDArray[np.float64]
    damping_standard_error: NDArray[np.float64]
    relative_scatter: NDArray[np.float64]
    degrees_of_freedom: NDArray[np.float64]
    band_hz: tuple[float, float]
    notes: tuple[str, ...]
    provenance: Provenance = field(default_factory=Provenance, repr=False)

    heading = "Ring-down"

    def at(self, amplitude: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return natural frequency in Hz and damping ratio at given amplitudes, interpolated in the log amplitude.

        Raises
        ------
        ValueError
            An amplitude outside the middles of the blocks.
        """
        amplitudes = _checks.unmasked("ring-down", "amplitude", amplitude, np.float64)
        low, high = self.amplitude.min(), self.amplitude.max()
        outside = ~((amplitudes >= low) & (amplitudes <= high))
        if outside.any():
            raise ValueError(
                f"ring-down: amplitude is {np.atleast_1d(amplitudes)[np.atleast_1d(outside)][0]:g}, expected between "
                f"{low:g} and {high:g}, the amplitudes in the middle of the last and of the first block"
            )
        order = np.argsort(self.amplitude)
        place, known = np.log(amplitudes), np.log(self.amplitude[order])
        return np.interp(place, known, self.frequency_hz[order]), np.interp(place, known, self.damping_ratio[order])

    def frequency_interval_hz(self, level: float = 0.95) -> NDArray[np.float64]:
        """Return the confidence intervals `(k, 2)` of the natural frequencies."""
        return self._interval(self.frequency_hz, self.frequency_standard_error_hz, level)

    def damping_interval(self, level: float = 0.95) -> NDArray[np.float64]:
        """Return the confidence intervals `(k, 2)` of the damping ratios."""
        return self._interval(self.damping_ratio, self.damping_standard_error, level)

    def _interval(self, value: NDArray[np.float64], error: NDArray[np.float64], level: float) -> NDArray[np.float64]:
        reach = error * interval_factor(level, self.degrees_of_freedom)
        return np.stack([value - reach, value + reach], axis=1)

    def tables(self) -> list[Table]:
        """Return frequency and damping of each block."""
        columns = (
            Column("time", "s", ".4g"),
            Column("amplitude", form=".4g"),
            Column("frequency", "Hz", ".4f"),
            Column("standard error", "Hz", ".2g"),
            Column("damping", "%", ".4f"),
            Column("standard error", "%", ".2g"),
        )
        cells = (
            self.time_s,
            self.amplitude,
            self.frequency_hz,
            self.frequency_standard_error_hz,
            100.0 * self.damping_ratio,
            100.0 * self.damping_standard_error,
        )
        return [Table("Blocks of the decay", columns, np.stack(cells, axis=1).tolist())]

    def data(self) -> dict[str, Any]:
        """Return all values of the blocks."""
        names = [one.name for one in fields(self) if one.name not in ("notes", "provenance")]
        return {name: getattr(self, name) for name in names}

    def plot(self, ax: Axes | None = None) -> Figure:
        """Draw natural frequency and damping against amplitude; see `Result.plot`."""
        from receptance.modal.figure import draw_ring_down

        return draw_ring_down(self, ax)

    def __repr__(self) -> str:
        return (
            f"RingDown({self.time_s.size} blocks: {self.frequency_hz[0]:.6g} to {self.frequency_hz[-1]:.6g} Hz, "
            f"damping {100.0 * self.damping_ratio[0]:.3g} to {100.0 * self.damping_ratio[-1]:.3g} %, as the amplitude "
            f"falls from {self.amplitude[0]:.4g} to {self.amplitude[-1]:.4g})"
        )


def ring_down(
    samples: ArrayLike,
    sample_rate_hz: float,
    *,
    low_hz: float,
    high_hz: float,
    start_s: float | None = None,
    end_s: float | None = None,
    blocks: int | None = None,
) -> RingDown:
    """Natural frequency and damping of one mode against amplitude, from a record of its free decay.

    The record is shifted by the middle of the band and low-passed (a linear-phase filter; of a decay it changes
    neither frequency nor rate), which gives the mode's complex amplitude z(t). In each of some blocks of equal drop in
    amplitude a quadratic is fitted to log z: the slope of its real part is the decay rate, that of its imaginary part
    the frequency. A quadratic, so that the slope in the middle of a block is not pulled by a frequency that drifts with
    the amplitude. Standard errors come from the residuals of the quadratic, with the correlation that the
    filter gives to white noise.

    A linear mode gives the same numbers in every block. A joint that slips more at larger amplitude gives a lower
    frequency and a higher damping there.

    Parameters
    ----------
    samples : array_like
        `(n,)` displacement, velocity or acceleration; may begin before the hit.
    sample_rate_hz : float
        Samples per second.
    low_hz, high_hz : float
        A band with one mode inside. Its width decides what can be resolved: a block is at least 8 / width long, and
        the first one begins 2 / width after the hit.
    start_s, end_s : float, optional
        The part of the record that is a free decay, from its first sample; by default from the largest sample on to
        the end.
    blocks : int, optional
        How many; by default as many as are long enough, at most 40. The end of the record, where the
        scatter is more than a tenth of the amplitude, is left out, with a note.

    Returns
    -------
    RingDown
        The curve as arrays, in order of time.

    Warns
    -----
    ReceptanceWarning
        Other signals than one decaying mode in the band.

    Raises
    ------
    TypeError, ValueError
        Invalid samples or settings, or a decay too short for a block.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance.modal import ring_down
    >>> t = np.arange(4096) / 1024.0
    >>> x = np.exp(-0.005 * 2 * np.pi * 80.0 * t) * np.cos(2 * np.pi * 80.0 * np.sqrt(1 - 0.005**2) * t)
    >>> decay = ring_down(x, 1024.0, low_hz=60.0, high_hz=100.0, blocks=3)
    >>> [f"{f:.3f} Hz, {100 * z:.3f} %" for f, z in zip(decay.frequency_hz, decay.damping_ratio)]
    ['80.000 Hz, 0.500 %', '80.000 Hz, 0.500 %', '80.000 Hz, 0.500 %']
    """
    owner = "ring_down"
    record = _record(owner, samples)
    rate = _checks.positive(owner, "sample_rate_hz", sample_rate_hz, unit="Hz")
    low, high = _band(owner, low_hz, high_hz, rate)
    first, last = _part(owner, record, rate, start_s, end_s)
    if blocks is not None:
        _checks.whole_number(owner, "blocks", blocks)
    signal = demodulate(record[first : last + 1], rate, low, high, first / rate)
    signal, notes = _until_scatter(owner, signal)
    found = [fit_block(signal, part) for part in _blocks(owner, signal, blocks)]
    if found[0].relative_scatter > _MAX_INITIAL_SCATTER:
        text = (
            f"{100.0 * found[0].relative_scatter:.2g} % of the amplitude at the start of the decay is not one decaying "
            f"mode between {low:g} and {high:g} Hz: another mode in the band, or the hit itself; narrow the band or "
            "start later"
        )
        warnings.warn(f"{owner}: {text}", ReceptanceWarning, stacklevel=2)
        notes.append(text)
    columns: dict[str, Any] = {
        one.name: np.array([getattr(block, one.name) for block in found]) for one in fields(Block)
    }
    return RingDown(
        **columns,
        band_hz=(low, high),
        notes=tuple(notes),
    )


def _record(owner: str, samples: ArrayLike) -> NDArray[np.float64]:
    record = _checks.numbers(owner, "samples", samples, "iuf", "real numbers")
    if record.ndim != 1:
        raise ValueError(
            f"{owner}: samples has shape {record.shape}, expected one dimension: one channel of one record"
        )
    bad = np.flatnonzero(~np.isfinite(record))
    if bad.size:
        raise ValueError(f"{owner}: samples[{bad[0]}] is {record[bad[0]]}, expected a finite number")
    if not record.any():
        raise ValueError(f"{owner}: samples has {record.size} values, all zero or none; expected a decay")
    return record.astype(np.float64)


def _band(owner: str, low_hz: float, high_hz: float, rate: float) -> tuple[float, float]:
    low = _checks.positive(owner, "low_hz", low_hz, unit="Hz")
    high = _checks.positive(owner, "high_hz", high_hz, unit="Hz")
    if low >= high:
        raise ValueError(f"{owner}: low_hz is {low:g} and high_hz {high:g}, expected low_hz below high_hz")
    # The filter then blocks the image of the band at negative frequencies, and that at the sample rate.
    if low < 0.25 * high or high > 0.4 * rate:
        raise ValueError(
            f"{owner}: the band reaches from {low:g} to {high:g} Hz, expected low_hz to be at least a quarter of "
            f"high_hz, and high_hz at most 0.4 times the {rate:g} samples per second, {0.4 * rate:g} Hz"
        )
    return low, high


def _part(
    owner: str, record: NDArray[np.float64], rate: float, start_s: float | None, end_s: float | None
) -> tuple[int, int]:
    length = (record.size - 1) / rate
    # The median removes an offset of the sensor.
    first, last = int(np.argmax(np.abs(record - np.median(record)))), record.size - 1
    if start_s is not None:
        first = round(_checks.not_negative(owner, "start_s", start_s, unit="s") * rate)
    if end_s is not None:
        last = min(round(_checks.positive(owner, "end_s", end_s, unit="s") * rate), last)
    if first >= last:
        raise ValueError(
            f"{owner}: the decay would reach from {first / rate:g} to {last / rate:g} s of a record of {length:g} s"
        )
    return first, last


def _until_scatter(owner: str, signal: Demodulation) -> tuple[Demodulation, list[str]]:
    """Truncate the record where the scatter is no longer small relative to the amplitude."""
    size = _shortest_block(signal)
    if signal.time_s.size < size:
        raise ValueError(
            f"{owner}: the decay is {signal.time_s.size * _step(signal):.3g} s long beyond the filter's ends, expected "
            f"at least {size * _step(signal):.3g} s ({PER_BLOCK:g} over the width of the band); widen the band"
        )
    noisy = [
        fit_block(signal, slice(first, first + size)).relative_scatter > _MAX_SCATTER
        for first in range(0, signal.time_s.size - size + 1, size)
    ]
    # A single block may be a disturbance; two in succession are the end.
    end = next((index for index in range(len(noisy)) if all(noisy[index : index + 2])), len(noisy))
    if end == len(noisy):
        return signal, []
    if end == 0:
        raise ValueError(
            f"{owner}: between {signal.middle_hz - 0.5 * signal.width_hz:g} and "
            f"{signal.middle_hz + 0.5 * signal.width_hz:g} Hz the record does not begin with the decay of one "
            f"mode: the residuals are more than {100.0 * _MAX_SCATTER:g} % of the amplitude"
        )
    note = (
        f"the record is used up to {signal.time_s[end * size]:.4g} s; after it the scatter is more than "
        f"{100.0 * _MAX_SCATTER:g} % of the amplitude"
    )
    return signal.until(end * size), [note]


def _blocks(owner: str, signal: Demodulation, number: int | None) -> list[slice]:
    least = _shortest_block(signal)
    for count in range(_MAX_BLOCKS, 0, -1) if number is None else [number]:
        parts = split_blocks(signal, count)
        shortest = min(part.stop - part.start for part in parts)
        if shortest >= least:
            return parts
    raise ValueError(
        f"{owner}: {number} blocks of equal drop in amplitude are as short as {shortest * _step(signal):.3g} s, "
        f"expected at least {least * _step(signal):.3g} s ({PER_BLOCK:g} over the width of the band); take fewer, or "
        "widen the band"
    )


def _step(signal: Demodulation) -> float:
    return float(np.diff(signal.time_s[:2])[0]) if signal.time_s.size > 1 else 0.0


def _shortest_block(signal: Demodulation) -> int:
    """Return the number of samples of the shortest block."""
    return int(np.ceil(PER_BLOCK / signal.width_hz / max(_step(signal), 1e-12)))
