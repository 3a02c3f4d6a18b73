"""Natural frequency and damping of one mode against its amplitude, from a free decay."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from receptance import _checks
from receptance.errors import warn_user
from receptance.modal.estimate import ModeIntervals
from receptance.report import Column, Provenance, Result, Table
from receptance.report.table import percent

TAPS_PER_WIDTH = 4.0
"""Length of the filter times the width of the band: half of the amplitude passes at the ends of the band."""
PER_BLOCK = 8.0
"""Length of the shortest block times the width of the band; the residuals of a quadratic then determine the scatter."""
_SAMPLES_PER_WIDTH = 3.0
_KAISER_BETA = 8.0
"""Shape parameter of the Kaiser window (80 dB)."""


@dataclass(frozen=True)
class Demodulation:
    """Complex amplitude z(t) of a band, whose part of the record is Re z exp(2 pi i middle t).

    `log` `(k,)` is complex log z with unwrapped phase, at evenly spaced times `(k,)`; `taps` are the coefficients of
    the filter, `correlation` that of filtered white noise at 0, 1, 2, ... steps of `time_s`.
    """

    time_s: NDArray[np.float64]
    log: NDArray[np.complex128]
    middle_hz: float
    width_hz: float
    taps: NDArray[np.float64]
    sample_rate_hz: float
    correlation: NDArray[np.float64]

    @property
    def step_s(self) -> float:
        """Distance of the samples; zero for a single sample."""
        return float(self.time_s[1] - self.time_s[0]) if self.time_s.size > 1 else 0.0

    @property
    def shortest_block(self) -> int:
        """Number of samples of the shortest block."""
        return int(np.ceil(PER_BLOCK / self.width_hz / max(self.step_s, 1e-12)))

    def log_gain(self, slope: complex) -> complex:
        """Return the log of the gain of the filter for exp(slope t)."""
        taps_from_middle = np.arange(self.taps.size) - 0.5 * (self.taps.size - 1)
        return complex(np.log(np.sum(self.taps * np.exp(-slope * taps_from_middle / self.sample_rate_hz))))


def demodulate(
    record: NDArray[np.float64], sample_rate_hz: float, low_hz: float, high_hz: float, start_s: float
) -> Demodulation:
    """Shift a record down by the middle of a band and low-pass filter it, without the transients at its ends."""
    middle, width = 0.5 * (low_hz + high_hz), high_hz - low_hz
    half = int(np.ceil(0.5 * TAPS_PER_WIDTH * sample_rate_hz / width))
    taps = scipy.signal.firwin(2 * half + 1, 0.5 * width, window=("kaiser", _KAISER_BETA), fs=sample_rate_hz)
    time = start_s + np.arange(record.size) / sample_rate_hz
    shifted = 2.0 * record * np.exp(-2j * np.pi * middle * time)
    step = max(int(sample_rate_hz / (_SAMPLES_PER_WIDTH * width)), 1)
    z = scipy.signal.oaconvolve(shifted, taps, mode="valid")[::step]
    # Limited for records with zeros.
    size = np.maximum(np.abs(z), np.finfo(np.float64).tiny)
    log = np.log(size) + 1j * np.unwrap(np.angle(z))
    correlation = scipy.signal.oaconvolve(taps, taps[::-1])[taps.size - 1 :: step]
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
    decrease = (falling[0] - falling) + 1e-3 * share
    edges = np.searchsorted(decrease, np.linspace(0.0, decrease[-1], count + 1)[1:-1])
    return [slice(first, last) for first, last in itertools.pairwise([0, *edges.tolist(), time.size])]


def fit_block(signal: Demodulation, part: slice) -> dict[str, float]:
    """Return the values of a block in `RingDown`: a quadratic in the log amplitude, weighted by its square."""
    time, log = signal.time_s[part], signal.log[part]
    size = np.exp(log.real)
    middle = float(np.sum(size**2 * time) / np.sum(size**2))
    half_length = 0.5 * float(time[-1] - time[0])
    x = (time - middle) / half_length
    q, r = np.linalg.qr(np.stack([np.ones_like(x), x, 0.5 * x**2], axis=1) * size[:, None])
    projection = q.T @ (size * log)
    value, slope = np.linalg.solve(r, projection)[:2]
    slope = complex(slope) / half_length
    residual = size * log - q @ projection

    # Correlation of the noise between samples, relative to the phase of the mode.
    correlation = np.zeros(x.size)
    lags = np.arange(min(signal.correlation.size, x.size))
    correlation[lags] = signal.correlation[lags] * np.cos(slope.imag * signal.step_s * lags)
    noise_columns = np.asarray(scipy.linalg.matmul_toeplitz(correlation, q))
    projected = q.T @ noise_columns
    residual_freedom = x.size - float(np.trace(projected))
    variance = float(np.sum(np.abs(residual) ** 2)) / (2.0 * residual_freedom)
    square = x.size + 2.0 * float(np.sum(correlation[1:] ** 2 * (x.size - np.arange(1, x.size))))
    square += -2.0 * float(np.sum(noise_columns**2)) + float(np.sum(projected**2))
    r_inverse = np.linalg.inv(r)
    covariance = variance * r_inverse @ projected @ r_inverse.T

    decay, damped = -slope.real, slope.imag + 2.0 * np.pi * signal.middle_hz
    natural = float(np.hypot(decay, damped))
    error = float(np.sqrt(covariance[1, 1])) / half_length
    amplitude = float(np.exp(value.real - signal.log_gain(slope).real))
    return {
        "time_s": middle,
        "duration_s": float(time[-1] - time[0]) + signal.step_s,
        "amplitude": amplitude,
        "amplitude_standard_error": amplitude * float(np.sqrt(covariance[0, 0])),
        "frequency_hz": natural / (2.0 * np.pi),
        "frequency_standard_error_hz": error / (2.0 * np.pi),
        "damping_ratio": decay / natural,
        "damping_standard_error": error / natural,
        "relative_scatter": float(np.sqrt(variance) / np.exp(value.real)),
        "degrees_of_freedom": 2.0 * residual_freedom**2 / square,
    }


_MAX_BLOCKS = 40
_MAX_SCATTER = 0.1
"""Largest scatter relative to the amplitude, above which the logarithm is biased."""
_MAX_INITIAL_SCATTER = 0.05
"""Largest relative scatter at the start of the decay without a warning of other contents of the band."""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class RingDown(ModeIntervals, Result):
    """Natural frequency and damping of one mode during its decay, one value per block of time."""

    time_s: NDArray[np.float64]
    """`(k,)` middle of each block, from the record's first sample, weighted by amplitude squared."""
    duration_s: NDArray[np.float64]
    """`(k,)` length of each block."""
    amplitude: NDArray[np.float64]
    """`(k,)` amplitude (half of peak to peak) of the mode at this time, in the unit of the samples."""
    amplitude_standard_error: NDArray[np.float64]
    frequency_hz: NDArray[np.float64]
    """`(k,)` undamped natural frequency."""
    frequency_standard_error_hz: NDArray[np.float64]
    damping_ratio: NDArray[np.float64]
    """`(k,)` ratio of the decay rate of the amplitude to the natural frequency."""
    damping_standard_error: NDArray[np.float64]
    relative_scatter: NDArray[np.float64]
    """`(k,)` residuals of the smooth decay in the band, relative to the amplitude."""
    degrees_of_freedom: NDArray[np.float64]
    """`(k,)` degrees of freedom of the standard errors."""
    band_hz: tuple[float, float]
    """Frequencies at which the filter passes half of the amplitude."""
    notes: tuple[str, ...]
    provenance: Provenance = field(default_factory=Provenance, repr=False)

    heading = "Ring-down"
    plotted_by = "receptance.modal.figure:draw_ring_down"

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
        x, blocks = np.log(amplitudes), np.log(self.amplitude[order])
        return np.interp(x, blocks, self.frequency_hz[order]), np.interp(x, blocks, self.damping_ratio[order])

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
        names = [column.name for column in fields(self) if column.name not in ("notes", "provenance")]
        return {name: getattr(self, name) for name in names}

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
    """Estimate natural frequency and damping of a mode against its amplitude, from a record of its free decay.

    The record is shifted down by the middle of the band and low-pass filtered, which gives the complex amplitude z(t)
    of the mode; the filter has a linear phase and changes neither the frequency nor the rate of a decay. The record is
    divided into blocks of equal decrease of the amplitude, and a quadratic is fitted to log z in each block. The slope
    of its real part is the decay rate, that of its imaginary part the frequency; the quadratic term prevents a bias of
    the slope in the middle of a block if the frequency drifts with the amplitude. Standard errors follow from the
    residuals of the quadratic, with the correlation of filtered white noise.

    A linear mode has the same values in every block. With a joint that slips at large amplitudes the frequency is lower
    and the damping higher there.

    Parameters
    ----------
    samples : array_like
        `(n,)` displacement, velocity or acceleration; may begin before the hit.
    sample_rate_hz : float
        Samples per second.
    low_hz, high_hz : float
        Band that contains a single mode. Its width determines the resolution: a block has at least the length
        8 / width, and the first block begins 2 / width after the hit.
    start_s, end_s : float, optional
        Beginning and end of the free decay, from the first sample of the record; by default the largest sample and the
        end of the record.
    blocks : int, optional
        Number of blocks; by default as many as are long enough, at most 40. The end of the record, where the scatter is
        more than a tenth of the amplitude, is left out, with a note.

    Returns
    -------
    RingDown
        Estimates of the blocks in order of time.

    Warns
    -----
    ReceptanceWarning
        Signals in the band that are not part of a single decaying mode.

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
    fits = [fit_block(signal, part) for part in _blocks(owner, signal, blocks)]
    initial = fits[0]["relative_scatter"]
    if initial > _MAX_INITIAL_SCATTER:
        text = (
            f"{percent(fits[0]['relative_scatter'])} of the amplitude at the start of the decay is not that of a "
            f"single decaying mode between {low:g} and {high:g} Hz: there is another mode in the band, or the hit; "
            "narrow the band or start later"
        )
        warn_user(f"{owner}: {text}")
        notes.append(text)
    columns: dict[str, Any] = {name: np.array([fit[name] for fit in fits]) for name in fits[0]}
    return RingDown(**columns, band_hz=(low, high), notes=tuple(notes))


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
        raise ValueError(f"{owner}: samples has {record.size} values and none other than zero, expected a decay")
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
    size = signal.shortest_block
    if signal.time_s.size < size:
        raise ValueError(
            f"{owner}: the decay is {signal.time_s.size * signal.step_s:.3g} s long without the transients of the "
            f"filter, expected at least {size * signal.step_s:.3g} s ({PER_BLOCK:g} over the width of the band); widen "
            "the band"
        )
    noisy = [
        fit_block(signal, slice(first, first + size))["relative_scatter"] > _MAX_SCATTER
        for first in range(0, signal.time_s.size - size + 1, size)
    ]
    # A single block may be a disturbance; two in succession are the end.
    end = next((index for index in range(len(noisy)) if all(noisy[index : index + 2])), len(noisy))
    if end == len(noisy):
        return signal, []
    if end == 0:
        raise ValueError(
            f"{owner}: between {signal.middle_hz - 0.5 * signal.width_hz:g} and "
            f"{signal.middle_hz + 0.5 * signal.width_hz:g} Hz the record does not begin with the decay of a single "
            f"mode: the residuals are more than {100.0 * _MAX_SCATTER:g} % of the amplitude"
        )
    note = (
        f"the record is used up to {signal.time_s[end * size]:.4g} s; after it the scatter is more than "
        f"{100.0 * _MAX_SCATTER:g} % of the amplitude"
    )
    return replace(signal, time_s=signal.time_s[: end * size], log=signal.log[: end * size]), [note]


def _blocks(owner: str, signal: Demodulation, number: int | None) -> list[slice]:
    for count in range(_MAX_BLOCKS, 0, -1) if number is None else [number]:
        parts = split_blocks(signal, count)
        shortest = min(part.stop - part.start for part in parts)
        if shortest >= signal.shortest_block:
            return parts
    raise ValueError(
        f"{owner}: of {number} blocks of equal decrease of the amplitude the shortest has "
        f"{shortest * signal.step_s:.3g} s, expected at least {signal.shortest_block * signal.step_s:.3g} s "
        f"({PER_BLOCK:g} over the width of the band); give fewer blocks, or widen the band"
    )
