"""Frequency and damping of one mode against its amplitude, from a free decay."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance import _checks
from receptance.errors import ReceptanceWarning
from receptance.modal._decay import PER_BLOCK, Block, Demodulated, blocks_of, demodulated, fit_block
from receptance.modal.estimate import quantile
from receptance.report import Column, Provenance, Result, Table

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike, NDArray

__all__ = ["RingDown", "ring_down"]

_MOST = 40
_LOST = 0.1
"""Above this scatter relative to the amplitude the logarithm is biased."""
_CLEAN = 0.05
"""A relative scatter above this at the start of the decay is no noise but something else in the band."""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class RingDown(Result):
    """Natural frequency and damping of one mode while its amplitude falls, one value per block of time.

    Attributes
    ----------
    time_s : ndarray
        `(k,)` middle of each block, from the record's first sample, weighted by amplitude squared.
    duration_s : ndarray
        `(k,)` length of each block.
    amplitude, amplitude_standard_error : ndarray
        `(k,)` amplitude (half of peak to peak) of the mode at that time, in the unit of the samples.
    frequency_hz, frequency_standard_error_hz : ndarray
        `(k,)` undamped natural frequency.
    damping_ratio, damping_standard_error : ndarray
        `(k,)` ratio of the decay rate of the amplitude to the natural frequency.
    relative_scatter : ndarray
        `(k,)` what is left in the band around the smooth decay, relative to the amplitude.
    degrees_of_freedom : ndarray
        `(k,)` of the standard errors.
    band_hz : (float, float)
        Where the filter passes half of the amplitude.
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
        """Natural frequency in Hz and damping ratio at some amplitudes, linear in the logarithm between blocks.

        Raises
        ------
        ValueError
            An amplitude outside the blocks' middles.
        """
        wanted = _checks.unmasked("ring-down", "amplitude", amplitude, np.float64)
        low, high = self.amplitude.min(), self.amplitude.max()
        outside = ~((wanted >= low) & (wanted <= high))
        if outside.any():
            raise ValueError(
                f"ring-down: amplitude is {np.atleast_1d(wanted)[np.atleast_1d(outside)][0]:g}, expected between "
                f"{low:g} and {high:g}, the amplitudes in the middle of the last and of the first block"
            )
        order = np.argsort(self.amplitude)
        place, known = np.log(wanted), np.log(self.amplitude[order])
        return np.interp(place, known, self.frequency_hz[order]), np.interp(place, known, self.damping_ratio[order])

    def frequency_interval_hz(self, level: float = 0.95) -> NDArray[np.float64]:
        """`(k, 2)` intervals that hold the natural frequencies, each with this probability."""
        return self._interval(self.frequency_hz, self.frequency_standard_error_hz, level)

    def damping_interval(self, level: float = 0.95) -> NDArray[np.float64]:
        """`(k, 2)` intervals that hold the damping ratios, each with this probability."""
        return self._interval(self.damping_ratio, self.damping_standard_error, level)

    def _interval(self, value: NDArray[np.float64], error: NDArray[np.float64], level: float) -> NDArray[np.float64]:
        reach = error * np.array([quantile(level, freedom) for freedom in self.degrees_of_freedom])
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
    the amplitude. Standard errors come from what is left around the quadratic, with the correlation that the
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
        Something else than one decaying mode in the band.

    Raises
    ------
    TypeError, ValueError
        Unusable samples or settings, or a decay too short for a block.

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
    if blocks is not None and (isinstance(blocks, bool) or not isinstance(blocks, (int, np.integer)) or blocks < 1):
        raise ValueError(f"{owner}: blocks is {blocks!r}, expected a whole number of at least 1")
    signal = demodulated(record[first : last + 1], rate, low, high, first / rate)
    signal, notes = _above_scatter(owner, signal)
    found = [fit_block(signal, part) for part in _blocks(owner, signal, blocks)]
    if found[0].relative_scatter > _CLEAN:
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
    record = _checks.unmasked(owner, "samples", samples)
    if record.dtype.kind not in "iuf":
        raise TypeError(f"{owner}: samples has dtype {record.dtype}, expected real numbers")
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
    # The mirror image of the band at negative frequencies, and that at the sample rate, are then where nothing passes.
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
    # An offset of the sensor is no motion.
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


def _above_scatter(owner: str, signal: Demodulated) -> tuple[Demodulated, list[str]]:
    """Cut the record off where the scatter is no longer small against the amplitude."""
    size = _shortest(signal)
    if signal.time_s.size < size:
        raise ValueError(
            f"{owner}: the decay is {signal.time_s.size * _step(signal):.3g} s long beyond the filter's ends, expected "
            f"at least {size * _step(signal):.3g} s ({PER_BLOCK:g} over the width of the band); widen the band"
        )
    lost = [
        fit_block(signal, slice(first, first + size)).relative_scatter > _LOST
        for first in range(0, signal.time_s.size - size + 1, size)
    ]
    # One bad block may be a disturbance; two are the end.
    end = next((index for index in range(len(lost)) if all(lost[index : index + 2])), len(lost))
    if end == len(lost):
        return signal, []
    if end == 0:
        raise ValueError(
            f"{owner}: between {signal.middle_hz - 0.5 * signal.width_hz:g} and "
            f"{signal.middle_hz + 0.5 * signal.width_hz:g} Hz the record does not decay like one mode from its start "
            f"on: what is left is more than {100.0 * _LOST:g} % of the amplitude"
        )
    note = (
        f"the record is used up to {signal.time_s[end * size]:.4g} s; from there on the scatter is more than "
        f"{100.0 * _LOST:g} % of the amplitude"
    )
    return signal.until(end * size), [note]


def _blocks(owner: str, signal: Demodulated, wanted: int | None) -> list[slice]:
    least = _shortest(signal)
    for count in range(_MOST, 0, -1) if wanted is None else [wanted]:
        parts = blocks_of(signal, count)
        shortest = min(part.stop - part.start for part in parts)
        if shortest >= least:
            return parts
    raise ValueError(
        f"{owner}: {wanted} blocks of equal drop in amplitude are as short as {shortest * _step(signal):.3g} s, "
        f"expected at least {least * _step(signal):.3g} s ({PER_BLOCK:g} over the width of the band); take fewer, or "
        "widen the band"
    )


def _step(signal: Demodulated) -> float:
    return float(np.diff(signal.time_s[:2])[0]) if signal.time_s.size > 1 else 0.0


def _shortest(signal: Demodulated) -> int:
    """Samples of the shortest block."""
    return int(np.ceil(PER_BLOCK / signal.width_hz / max(_step(signal), 1e-12)))
