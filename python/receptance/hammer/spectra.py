"""Windows and spectra of the hits, and the FRF of each response channel with its variance, errors and usable lines."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal, NamedTuple, TypeAlias

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy import special

from receptance import _checks
from receptance.frf.variance import pool_variance
from receptance.hammer.hits import CLEAR, Hits

ExponentialOn = Literal["both", "response"]
_PLATEAU = 1.0
"""Length of the force window's plateau before and after a contact, relative to the contact,"""
_MIN_PLATEAU = 24
"""and at least in samples, because the ringing of a recorder's filter must be kept in both channels."""
_FALL = 1.0
"""Length of the half-cosine slopes of the force window, relative to the contact,"""
_MIN_FALL = 8
"""and at least in samples."""


@dataclass(frozen=True)
class Windows:
    """Weights of force and response, `(n_hits, n_samples)` each."""

    force: NDArray[np.float64]
    response: NDArray[np.float64]
    force_window: NDArray[np.float64]
    """The force window without the zeros around it; empty if there is none."""
    force_without_window: NDArray[np.float64]
    """Weights of the force without the force window."""
    silence: tuple[tuple[slice, ...], ...]
    """Samples of each block outside contacts."""

    def correlated_lines(self, force_share: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the number of neighbouring lines per independent value, `(n_lines,)`, by the share of force noise.

        This is the sum of |R|^2 over all lags of the correlation R between lines. R is the transform of the
        distribution g(t) of the noise energy in time, with sum 1, so that the sum is N sum g^2.
        """
        x, f = (np.mean(weights**2, axis=0) for weights in (self.response, self.force))
        x, f = x / np.sum(x), f / np.sum(f)
        n, s = x.size, force_share
        count: NDArray[np.float64] = n * ((1 - s) ** 2 * (x @ x) + 2 * s * (1 - s) * (x @ f) + s**2 * (f @ f))
        return np.maximum(count, 1.0)

    @property
    def force_energy(self) -> float:
        """Sum of squares of the force weights, mean over the hits."""
        return float(np.mean(np.sum(self.force**2, axis=1)))

    def force_noncircularity(self, spectra: NDArray[np.complex128], lines: slice) -> NDArray[np.float64]:
        """Return the noncircularity of the noise on the force relative to the pulse, `(n_lines,)`, from 0 to 1.

        Below about 1 / T, with T the length of the window, windowed noise is real except for the phase of the position
        of the window, which is also that of the pulse. It then changes magnitudes and not phases, with twice the
        variance of circular noise. With M the windowed noise, E[M^2] = sum w^2 e^(-2iwt).
        """
        n_samples = self.force.shape[1]
        squares = scipy.fft.fft(self.force**2, axis=1)
        twice = squares[:, (2 * np.arange(n_samples // 2 + 1)[lines]) % n_samples]
        power = np.sum(np.abs(spectra) ** 2, axis=0)
        ratio: NDArray[np.float64] = np.abs(np.sum(np.conj(spectra) ** 2 * twice, axis=0)) / power / self.force_energy
        return np.minimum(ratio, 1.0)


def correlated_lines(weights: NDArray[np.float64]) -> float:
    """Return the number of lines per independent value of white noise through windows `(n_hits, n_samples)`."""
    energy = np.mean(weights**2, axis=0)
    if not energy.any():
        return 1.0
    return float(energy.size * np.sum(energy**2) / np.sum(energy) ** 2)


def noncircularity(weights: NDArray[np.float64], lines: slice) -> NDArray[np.float64]:
    """Return the noncircularity `(n_lines,)` of white noise through windows `(n_hits, n_samples)`, from 0 to 1."""
    energy = np.mean(weights**2, axis=0)
    twice = 2 * np.arange(energy.size // 2 + 1)[lines] % energy.size
    return np.asarray(np.abs(scipy.fft.fft(energy)[twice]) / np.sum(energy))


def make_windows(
    hits: Hits, decay_rate: float, force_window_s: float | Literal["auto"] | None, exponential_on: ExponentialOn
) -> Windows:
    """Return the windows of all kept hits; parameters as in `estimate_frf`."""
    rate, n_samples = hits.sample_rate_hz, hits.n_samples
    kept = hits.kept
    time = np.arange(n_samples) / rate
    # With the same origin in both channels, the ratio of their spectra is the FRF at w - i sigma for any time of a hit.
    exponential = np.exp(-decay_rate * time)
    response = np.tile(exponential, (len(kept), 1))
    force = response.copy() if exponential_on == "both" else np.ones_like(response)
    recorded = hits.records[0].response_decay_rate
    if recorded > 0.0:
        starts = np.array([hit.start for hit in kept]) / rate
        force = force * np.exp(-recorded * (time + starts[:, None]))
    force_without_window = force.copy()
    contact = max(hit.release - hit.onset for hit in kept)
    force_window, before = _force_window(contact, rate, force_window_s)
    silence = []
    for row, hit in enumerate(kept):
        first = hit.onset - hit.start - before
        stop = first + (force_window.size or contact + 2 * before)
        if force_window.size:
            begin, end = max(0, first), min(n_samples, first + force_window.size)
            window = np.zeros(n_samples)
            window[begin:end] = force_window[begin - first : end - first]
            force[row] *= window
        silence.append((slice(0, max(0, first)), slice(min(stop, n_samples), n_samples)))
    return Windows(force, response, force_window, force_without_window, tuple(silence))


def _force_window(
    contact: int, rate: float, length_s: float | Literal["auto"] | None
) -> tuple[NDArray[np.float64], int]:
    """Return the force window, and its number of samples before the contact."""
    fall = max(_MIN_FALL, round(_FALL * contact))
    margin = max(_MIN_PLATEAU, round(_PLATEAU * contact))
    after = contact + margin
    if length_s is not None and length_s != "auto":
        after = round(_checks.positive("estimate_frf", "force_window_s", length_s, unit="s") * rate)
        if after < contact:
            raise ValueError(
                f"estimate_frf: force_window_s is {length_s:g} s, expected at least the longest contact of "
                f"{contact / rate:.3g} s"
            )
    if length_s is None:
        return np.empty(0), margin + fall
    ramp = scipy.signal.windows.hann(2 * fall + 1)[:fall]
    return np.concatenate([ramp, np.ones(margin + after), ramp[::-1]]), margin + fall


BIAS_SHARE = 0.25
"""Largest known error of a usable line, in standard deviations; the variance is increased by its square."""
NEGLIGIBLE = 1e-3
"""Relative error that never excludes a line."""
_BAND_SMOOTHING = 5
"""Lines over which the force's power is averaged, so that noise does not end the band."""

Estimator = Literal["H1", "H2", "Hv"]
_ALIAS_FREE = 1.0 / 2.56
"""Share of the sampling rate up to which recorders' filters prevent aliasing."""
_OFFSET_SAMPLES = 32
"""Least samples before a hit for an estimate of the offset."""
_ROUNDING = 1e-28
"""Relative variance of the rounding of a transform, for records without noise."""


class Reason(NamedTuple):
    """Why a line is not usable."""

    kind: Literal["filter", "force", "scatter", "noise", "truncation", "window", "exponential"]
    text: str


Exclusions: TypeAlias = dict[Reason, "NDArray[np.bool_]"]
"""Lines `(n_lines,)` that are not usable, by reason."""


@dataclass(frozen=True)
class Limits:
    """Limits of usable lines, and the number of pooled lines."""

    force_drop_db: float
    largest_deviation: float
    half_width: int | None


@dataclass(frozen=True)
class Channel:
    """FRF of a response channel with its variance, `(n_lines,)` each, and the lines excluded for each reason."""

    values: NDArray[np.complex128]
    coherence: NDArray[np.float64] | None
    log_variance: NDArray[np.float64] | None
    degrees_of_freedom: NDArray[np.float64] | None
    correlated_lines: NDArray[np.float64]
    remainder: NDArray[np.float64]
    """Amplitude at the end of the block relative to that at the beginning."""
    excluded: Exclusions


class Spectra:
    """Windowed spectra of all kept hits on lines `(n_lines,)` without 0 Hz and half the sampling rate.

    `force` is `(n_hits, n_lines)`, `response` `(n_hits, n_lines, n_channels)`; `noise_share` `(n_lines,)` is the share
    of noise in the power of the force, None if it could not be estimated.
    """

    def __init__(self, hits: Hits, windows: Windows, low_hz: float | None, high_hz: float | None) -> None:
        self.hits, self.windows = hits, windows
        self.lines = _lines(hits, low_hz, high_hz)
        self.frequency_hz = np.arange(hits.n_samples // 2 + 1)[self.lines] / hits.duration_s
        force, response = _without_offset(hits)
        self._time_force, self._time_response = force, response * windows.response[:, :, None]
        self._all_force = scipy.fft.rfft(force * windows.force, axis=1)
        self.force = self._all_force[:, self.lines]
        self.response = scipy.fft.rfft(self._time_response, axis=1)[:, self.lines]
        self.power = np.sum(np.abs(self.force) ** 2, axis=0)
        self._check_not_zero(self.power, "the force")
        self.noise = force_noise_power(force, windows, self.frequency_hz, hits.sample_rate_hz)
        self.noise_share = None
        if self.noise is not None:
            self.noise_share = np.minimum(len(force) * self.noise * windows.force_energy / self.power, 1.0)

    @cached_property
    def force_noncircularity(self) -> NDArray[np.float64]:
        """Noncircularity of the noise on the force; see `Windows.force_noncircularity`."""
        return self.windows.force_noncircularity(self.force, self.lines)

    @cached_property
    def response_noncircularity(self) -> NDArray[np.float64]:
        """Noncircularity of the noise on the response, for lines as low as the decay rate of an exponential window."""
        return noncircularity(self.windows.response, self.lines)

    @cached_property
    def force_removed(self) -> NDArray[np.float64]:
        """Force removed by the force window; see `bias.force_outside_window`."""
        if not self.windows.force_window.size or self.noise is None:
            return np.zeros(self.frequency_hz.size)
        unwindowed = scipy.fft.rfft(self._time_force * self.windows.force_without_window, axis=1)[:, self.lines]
        outside = self.windows.force_without_window - self.windows.force
        energy = float(np.mean(np.sum(outside**2, axis=1)))
        return force_outside_window(unwindowed, self.force, self.noise * energy, correlated_lines(outside))

    def out_of_range(self, limits: Limits) -> Exclusions:
        """Return the lines not excited by the force, and those not protected by the recorder's filter."""
        ratio = 1.0 / _ALIAS_FREE
        filtered = Reason("filter", f"above the range of the recorder's filter (sampling rate / {ratio:g})")
        weak = Reason("force", f"where the force spectrum is over {limits.force_drop_db:g} dB down (force_drop_db)")
        return {
            filtered: self.frequency_hz > _ALIAS_FREE * self.hits.sample_rate_hz,
            weak: ~force_band(self.power, limits.force_drop_db),
        }

    def channel(self, index: int, estimator: Estimator, limits: Limits) -> Channel:
        """Return the FRF of one response channel."""
        x = self.response[:, :, index]
        hits = len(x)
        cross = np.sum(np.conj(self.force) * x, axis=0)
        motion = np.sum(np.abs(x) ** 2, axis=0)
        self._check_not_zero(motion, f"response channel {index}")
        h1 = cross / self.power
        self._check_not_zero(np.abs(h1) ** 2, f"the FRF of response channel {index}")
        excluded = self.out_of_range(limits)
        if hits == 1:
            correlated = self.windows.correlated_lines(np.zeros(x.shape[1]))
            return Channel(h1, None, None, None, correlated, np.zeros(x.shape[1]), excluded)
        coherence = np.clip(np.abs(cross) ** 2 / (self.power * motion), 0.0, 1.0)
        # From the residuals, because 1 - g^2 is dominated by rounding if there is little noise.
        scatter = np.sum(np.abs(x - h1 * self.force) ** 2, axis=0) / (hits - 1)
        relative = hits * scatter / (self.power * np.abs(h1) ** 2) + _ROUNDING
        share = self._force_share(relative)
        variance, freedom = pool_variance(
            h1,
            relative / (2.0 * hits),
            2.0 * (hits - 1) / (1.0 + (self.force_noncircularity * share) ** 2),
            correlated_lines=self.windows.correlated_lines(share),
            half_width=limits.half_width,
        )
        relative = 2.0 * hits * variance
        share = self._force_share(relative)
        variance = variance * (1.0 + self.force_noncircularity * share + self.response_noncircularity * (1.0 - share))
        factor, bias = self._correction(estimator, coherence, relative)
        onset = int(np.median([hit.onset - hit.start for hit in self.hits.kept]))
        remainder, error = (
            values[self.lines]
            for values in estimate_truncation(self._time_response[:, :, index], self._all_force, self.release, onset)
        )
        truncated = np.maximum(remainder, error / np.abs(h1))
        deviation = np.sqrt(variance)
        errors = {
            Reason("noise", f"where noise biases {estimator}"): bias,
            Reason("truncation", "where the response has not decayed at the end of the block"): truncated,
            Reason("window", "where the force window removes force"): self.force_removed,
        }
        limit = np.maximum(BIAS_SHARE * deviation, NEGLIGIBLE)
        scattered = Reason(
            "scatter", f"where the scatter is large (standard deviation of the log over {limits.largest_deviation:g})"
        )
        excluded |= {scattered: deviation > limits.largest_deviation}
        excluded |= {reason: error > limit for reason, error in errors.items()}
        # Remaining errors are small, but must be covered by the interval.
        variance = variance + sum(np.minimum(error, limit) ** 2 for error in errors.values())
        return Channel(
            values=h1 * factor,
            coherence=coherence,
            log_variance=variance,
            degrees_of_freedom=freedom,
            correlated_lines=self.windows.correlated_lines(share),
            remainder=remainder,
            excluded=excluded,
        )

    def _check_not_zero(self, power: NDArray[np.float64], name: str) -> None:
        if not np.any(power):
            raise ValueError(f"estimate_frf: {name} is zero in all hits; is the sensor connected?")
        if not np.all(power):
            line = self.frequency_hz[np.flatnonzero(power == 0.0)[0]]
            raise ValueError(
                f"estimate_frf: {name} is exactly zero at {line:g} Hz, unlike recorded data; exclude such lines with "
                "low_hz and high_hz"
            )

    def _force_share(self, relative: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the known share of noise on the force in the scatter."""
        if self.noise_share is None:
            return np.zeros_like(relative)
        share: NDArray[np.float64] = np.minimum(self.noise_share / relative, 1.0)
        return share

    def _correction(
        self, estimator: Estimator, coherence: NDArray[np.float64], relative: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the factor from H1 to the estimator, and the known bias of its logarithm.

        `relative` is the scatter of a hit over |H|^2 |F|^2, from noise on force and response.
        """
        on_force = np.zeros_like(relative) if self.noise_share is None else self.noise_share
        if estimator == "H1":
            return np.ones_like(relative), on_force
        if estimator == "H2":
            return 1.0 / coherence, np.maximum(relative - on_force, 0.0)
        if self.noise_share is None:
            return 1.0 / np.sqrt(coherence), np.zeros_like(relative)
        # Noise on the force cannot exceed the scatter.
        return 1.0 / (1.0 - np.minimum(on_force, relative / (1.0 + relative))), np.zeros_like(relative)

    @property
    def release(self) -> int:
        """First sample of the blocks after all contacts."""
        return max(hit.release - hit.start for hit in self.hits.kept)


def _lines(hits: Hits, low_hz: float | None, high_hz: float | None) -> slice:
    low = 0.0 if low_hz is None else _checks.not_negative("estimate_frf", "low_hz", low_hz, unit="Hz")
    high = np.inf if high_hz is None else _checks.positive("estimate_frf", "high_hz", high_hz, unit="Hz")
    numbers = np.arange(1, (hits.n_samples - 1) // 2 + 1)
    # A limit on a line must include this line in spite of rounding.
    rounding = 1e-6
    inside = (numbers >= low * hits.duration_s - rounding) & (numbers <= high * hits.duration_s + rounding)
    if not inside.any():
        raise ValueError(
            f"estimate_frf: there is no line between {low:g} and {high:g} Hz; lines are {1.0 / hits.duration_s:g} Hz "
            f"apart, up to {hits.sample_rate_hz / 2.0:g} Hz"
        )
    low_line, high_line = numbers[inside][[0, -1]].tolist()
    return slice(low_line, high_line + 1)


def _without_offset(hits: Hits) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the blocks without offset: the mean before the hit, or the median of a force with few samples there."""
    force, response = hits.blocks()
    recorded = hits.records[0].response_decay_rate > 0.0
    for row, hit in enumerate(hits.kept):
        before = max(0, hit.onset - hit.start - CLEAR)
        has_mean = before >= _OFFSET_SAMPLES
        force[row] -= np.mean(force[row, :before]) if has_mean else np.median(force[row])
        if has_mean and not recorded:
            response[row] -= np.mean(response[row, :before], axis=0)
    return force, response


def force_band(power: NDArray[np.float64], drop_db: float) -> NDArray[np.bool_]:
    """Return the lines around the maximum of the force spectrum, up to the first on each side that is `drop_db` lower.

    The band is contiguous: the frequencies of a pulse's side lobes vary from hit to hit, so these are excluded.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance.hammer.spectra import force_band
    >>> force_band(np.array([1.0, 1.0, 0.9, 0.5, 1e-3, 1e-3, 0.1, 0.1]), 20.0)
    array([ True,  True,  True,  True, False, False, False, False])
    """
    width = min(_BAND_SMOOTHING, power.size)
    ones = np.ones(width)
    level = np.convolve(power, ones, "same") / np.convolve(np.ones_like(power), ones, "same")
    # The average reaches beyond the edges of the band, so that each line must be strong as well.
    weak = np.minimum(level, power) < level.max() * 10.0 ** (-drop_db / 10.0)
    top = int(np.argmax(level))
    below, above = np.flatnonzero(weak[:top]), np.flatnonzero(weak[top:])
    inside = np.zeros(power.size, dtype=bool)
    inside[int(below[-1]) + 1 if below.size else 0 : top + int(above[0]) if above.size else None] = True
    return inside


_MAX_SAMPLES = 1024
"""Most samples of a transformed stretch of silence; enough to resolve hum."""
_MIN_SAMPLES = 16
"""Least samples of a stretch of silence."""
_MIN_STRETCHES = 8
"""Least number of stretches for an estimate of the noise."""
_PADDING = 4
"""Lines of the noise spectrum per independent line, for linear interpolation between them."""


def force_noise_power(
    force: NDArray[np.float64], windows: Windows, frequency_hz: NDArray[np.float64], sample_rate_hz: float
) -> NDArray[np.float64] | None:
    """Return the power |M|^2 `(n_lines,)` of the noise in the force spectrum, per unit of the window energy sum w^2.

    The force is `(n_hits, n_samples)` without offset and windows. Stretches of silence of the length of the force
    window are transformed through it, so that coloured noise is spread over the lines as in the spectra. The median
    over the stretches excludes bounces. Noise that occurs only during the contact is not included. The result is None
    if there is too little silence, or exact zeros from a force window of the recorder.
    """
    stretches = [row[part] for row, parts in zip(force, windows.silence, strict=True) for part in parts]
    longest = max((stretch.size for stretch in stretches), default=0)
    length = min(windows.force_window.size or _MAX_SAMPLES, _MAX_SAMPLES, max(longest, 1))
    pieces = [
        stretch[begin : begin + length]
        for stretch in stretches
        for begin in range(0, stretch.size - length + 1, max(1, length // 2))
    ]
    if length < _MIN_SAMPLES or len(pieces) < _MIN_STRETCHES or not np.any(pieces):
        return None
    shape = (
        windows.force_window if windows.force_window.size == length else scipy.signal.windows.hann(length, sym=False)
    )
    n_fft = scipy.fft.next_fast_len(_PADDING * length, real=True)
    powers = np.abs(scipy.fft.rfft(np.array(pieces) * shape, n_fft, axis=1)) ** 2 / np.sum(shape**2)
    # |M|^2 of Gaussian noise is exponentially distributed, with the median ln 2.
    power = np.median(powers, axis=0) / np.log(2.0)
    return np.asarray(np.interp(frequency_hz, scipy.fft.rfftfreq(n_fft, 1.0 / sample_rate_hz), power))


_PARTS = 8
"""Number of parts of a block in which amplitudes are estimated."""
_CHANCE = 1e-4
"""Accepted probability that noise passes for a repeated signal."""
_SMOOTHED_LINES = 17
"""Lines averaged for the force outside the window."""
_NOISE_MARGIN = 1.5
"""Factor by which noise may exceed its estimate from the silence."""
_WEAK_DB = 40.0
"""Level of the force spectrum below its largest under which lines are not evaluated."""


def estimate_truncation(
    response: NDArray[np.float64], spectra: NDArray[np.complex128], first: int, onset: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the amplitude of a response at the end of its block, and the error of the FRF from its truncation.

    The amplitude is relative to that at the beginning, the error in the unit of the FRF; both are `(n_lines,)` over all
    lines of the transform, and 0 where the signal is noise.

    The response is `(n_hits, n_samples)` after the windows, the spectra of the windowed force `(n_hits, n_samples // 2
    + 1)`; contacts begin at the sample `onset` and have ended at `first`.

    A block of length T truncates the response. For a mode at w_m the truncated part is A(T) / (i (w - w_m) + a), with A
    the amplitude. Relative to the mode it is A(T) / A(0), but it may exceed the FRF far from w_m, where that is small.
    Amplitudes are estimated at the beginning and in the middle of the block, where they exceed the noise, and
    extrapolated to the end.
    """
    hits, n_samples = response.shape
    length = (n_samples - first) // _PARTS
    zero = np.zeros(spectra.shape[1])
    if hits < 2 or length < 2 * _PARTS:
        return zero, zero
    window = scipy.signal.windows.hann(length, sym=False)
    middle = (first + n_samples) // 2
    gains = []
    for begin in (first, middle - length // 4):
        part = np.zeros_like(response)
        part[:, begin : begin + length] = response[:, begin : begin + length] * window
        gains.append(_coherent_part(scipy.fft.rfft(part, axis=1), spectra))
    (first_gain, _), (middle_gain, clear) = gains
    power = np.sum(np.abs(spectra) ** 2, axis=0)
    exceeds = clear & (power > power.max() * 10.0 ** (-_WEAK_DB / 10.0))
    halfway = np.where(exceeds, np.abs(middle_gain) / np.maximum(np.abs(first_gain), 1e-300), 0.0)
    halfway = np.minimum(halfway, 1.0)
    # The truncated part has the shape of the second half of the middle part, with the amplitude of the end.
    end_response = scipy.fft.irfft(middle_gain * halfway, n_samples)
    step = np.zeros(n_samples)
    centre = middle - length // 4 + length // 2 - onset
    step[centre : centre + length // 2] = 1.0
    return halfway**2, np.abs(scipy.fft.rfft(end_response * step))


def force_outside_window(
    unwindowed: NDArray[np.complex128], spectra: NDArray[np.complex128], noise: NDArray[np.float64], correlated: float
) -> NDArray[np.float64]:
    """Return the force removed by the force window relative to the rest, `(n_lines,)`; 0 where it is noise.

    The force without and with its window is `(n_hits, n_lines)`. `noise` is the power of the noise in the removed part,
    with `correlated` neighbouring lines per independent value. A bounce or the ringing of a sensor has a broad
    spectrum, so neighbouring lines are averaged.
    """
    hits, n_lines = spectra.shape
    width = min(_SMOOTHED_LINES, n_lines)
    count = np.convolve(np.ones(n_lines), np.ones(width), "same")
    power, removed, expected = (
        np.convolve(values, np.ones(width), "same") / count
        for values in (np.mean(np.abs(spectra) ** 2, axis=0), np.mean(np.abs(unwindowed - spectra) ** 2, axis=0), noise)
    )
    freedom = 2.0 * hits * max(1.0, width / correlated)
    clear = removed > _NOISE_MARGIN * special.chdtri(freedom, _CHANCE) / freedom * expected
    return np.where(clear, np.sqrt(np.maximum(removed - expected, 0.0) / power), 0.0)


def _coherent_part(
    part: NDArray[np.complex128], spectra: NDArray[np.complex128]
) -> tuple[NDArray[np.complex128], NDArray[np.bool_]]:
    """Return the FRF from the force to a part of a signal, and the lines on which it exceeds the noise."""
    hits = len(part)
    power = np.maximum(np.sum(np.abs(spectra) ** 2, axis=0), 1e-300)
    gain = np.sum(np.conj(spectra) * part, axis=0) / power
    noise = np.sum(np.abs(part - gain * spectra) ** 2, axis=0) / (hits - 1) / power
    clear = np.abs(gain) ** 2 > special.fdtri(2.0, 2.0 * (hits - 1), 1.0 - _CHANCE) * noise
    return gain, clear
