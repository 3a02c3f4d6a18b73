"""Spectra of the hits, and what they say of one response channel."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np

from receptance import _checks
from receptance.frf.variance import pool_variance
from receptance.measurement.band import BIAS_SHARE, NEGLIGIBLE, force_band
from receptance.measurement.leakage import cut_off, left_over
from receptance.measurement.noise import force_noise
from receptance.measurement.windows import alike_lines, one_phase

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.measurement.hits import Hits
    from receptance.measurement.windows import Windows

__all__ = ["Channel", "Estimator", "Limits", "Spectra"]

Estimator = Literal["H1", "H2", "Hv"]
_ALIAS_FREE = 1.0 / 2.56
"""Of the sampling rate: where recorders' filters still keep out what is above half of it."""
_OFFSET_SAMPLES = 32
"""Samples before a hit from which an offset can be told."""
_CLEAR = 2
"""Samples left out before the contact: its foot is below the edge that was found."""
_ROUNDING = 1e-28
"""Relative variance of a transform's own rounding, so that records without noise do not claim to be exact."""


@dataclass(frozen=True)
class Limits:
    """What a usable line may at most have, and over how many lines to pool."""

    force_drop_db: float
    largest_deviation: float
    half_width: int | None


@dataclass(frozen=True)
class Channel:
    """One FRF with its variance, `(n_lines,)` each; `refused` has the lines that are not usable by reason."""

    values: NDArray[np.complex128]
    coherence: NDArray[np.float64] | None
    log_variance: NDArray[np.float64] | None
    degrees_of_freedom: NDArray[np.float64] | None
    alike_lines: NDArray[np.float64]
    left: NDArray[np.float64]
    refused: dict[str, NDArray[np.bool_]]


class Spectra:
    """Windowed spectra of all kept hits.

    Attributes
    ----------
    frequency_hz : ndarray
        `(n_lines,)` without 0 Hz and half the sampling rate.
    force : ndarray
        `(n_hits, n_lines)`.
    response : ndarray
        `(n_hits, n_lines, n_channels)`.
    noise_share : ndarray or None
        `(n_lines,)` share of noise in the force's power, None where it could not be measured.
    """

    def __init__(self, hits: Hits, windows: Windows, low_hz: float | None, high_hz: float | None) -> None:
        from scipy.fft import rfft

        self.hits, self.windows = hits, windows
        self.lines = _lines(hits, low_hz, high_hz)
        self.frequency_hz = np.arange(hits.n_samples // 2 + 1)[self.lines] / hits.duration_s
        force, response = _without_offset(hits)
        self._time_force, self._time_response = force, response * windows.response[:, :, None]
        self._all_force = rfft(force * windows.force, axis=1)
        self.force = self._all_force[:, self.lines]
        self.response = rfft(self._time_response, axis=1)[:, self.lines]
        self.power = np.sum(np.abs(self.force) ** 2, axis=0)
        self._check_alive(self.power, "the force")
        self.noise = force_noise(force, windows, self.frequency_hz, hits.sample_rate_hz)
        self.noise_share = None
        if self.noise is not None:
            self.noise_share = np.minimum(len(force) * self.noise * windows.force_energy / self.power, 1.0)

    @cached_property
    def skew(self) -> NDArray[np.float64]:
        """Share of the force's noise that is in one phase; see `Windows.skew`."""
        return self.windows.skew(self.force, self.lines)

    @cached_property
    def response_skew(self) -> NDArray[np.float64]:
        """Share of the response's noise that is in one phase: of lines as low as an exponential window decays."""
        return one_phase(self.windows.response, self.lines)

    @cached_property
    def cut(self) -> NDArray[np.float64]:
        """What the force's window takes away; see `leakage.cut_off`."""
        from scipy.fft import rfft

        if not self.windows.shape.size or self.noise is None:
            return np.zeros(self.frequency_hz.size)
        whole = rfft(self._time_force * self.windows.around, axis=1)[:, self.lines]
        outside = self.windows.around - self.windows.force
        energy = float(np.mean(np.sum(outside**2, axis=1)))
        return cut_off(whole, self.force, self.noise * energy, alike_lines(outside))

    def outside(self, limits: Limits) -> dict[str, NDArray[np.bool_]]:
        """Return the lines that the force does not reach, and those that the recorder's filter does not guard."""
        return {
            f"where the recorder's filter ends (sampling rate / {1 / _ALIAS_FREE:g})": self.frequency_hz
            > _ALIAS_FREE * self.hits.sample_rate_hz,
            f"where the force's spectrum is over {limits.force_drop_db:g} dB down (force_drop_db)": ~force_band(
                self.power, limits.force_drop_db
            ),
        }

    def channel(self, index: int, estimator: Estimator, limits: Limits) -> Channel:
        """Return the FRF of one response channel."""
        x = self.response[:, :, index]
        hits = len(x)
        cross = np.sum(np.conj(self.force) * x, axis=0)
        motion = np.sum(np.abs(x) ** 2, axis=0)
        self._check_alive(motion, f"response channel {index}")
        first = cross / self.power
        self._check_alive(np.abs(first) ** 2, f"the FRF of response channel {index}")
        refused = self.outside(limits)
        if hits == 1:
            alike = self.windows.alike_lines(np.zeros(x.shape[1]))
            return Channel(first, None, None, None, alike, np.zeros(x.shape[1]), refused)
        coherence = np.clip(np.abs(cross) ** 2 / (self.power * motion), 0.0, 1.0)
        # From the residuals themselves: 1 - g^2 has no digits left where there is little noise.
        scatter = np.sum(np.abs(x - first * self.force) ** 2, axis=0) / (hits - 1)
        relative = hits * scatter / (self.power * np.abs(first) ** 2) + _ROUNDING
        share = self._force_share(relative)
        variance, freedom = pool_variance(
            first,
            relative / (2.0 * hits),
            2.0 * (hits - 1) / (1.0 + (self.skew * share) ** 2),
            correlated_lines=self.windows.alike_lines(share),
            half_width=limits.half_width,
        )
        relative = 2.0 * hits * variance
        share = self._force_share(relative)
        variance = variance * (1.0 + self.skew * share + self.response_skew * (1.0 - share))
        factor, bias = self._correction(estimator, coherence, relative)
        left = left_over(self._time_response[:, :, index], self._all_force, self.over, self.onset)
        lost = np.maximum(left.share[self.lines], left.error[self.lines] / np.abs(first))
        deviation = np.sqrt(variance)
        wrong = {
            f"where noise makes {estimator} wrong": bias,
            "where the response has not died away when the block ends": lost,
            "where the force's window cuts off force": self.cut,
        }
        limit = np.maximum(BIAS_SHARE * deviation, NEGLIGIBLE)
        refused |= {
            f"where the scatter is large (standard deviation of the log over {limits.largest_deviation:g})": deviation
            > limits.largest_deviation,
            **{reason: error > limit for reason, error in wrong.items()},
        }
        # An error that is kept is small; the interval is to hold it all the same.
        variance = variance + sum(np.minimum(error, limit) ** 2 for error in wrong.values())
        return Channel(
            values=first * factor,
            coherence=coherence,
            log_variance=variance,
            degrees_of_freedom=freedom,
            alike_lines=self.windows.alike_lines(share),
            left=left.share[self.lines],
            refused=refused,
        )

    def _check_alive(self, power: NDArray[np.float64], name: str) -> None:
        if not np.any(power):
            raise ValueError(f"estimate_frf: {name} is zero in all hits; is the sensor connected?")
        if not np.all(power):
            line = self.frequency_hz[np.flatnonzero(power == 0.0)[0]]
            raise ValueError(
                f"estimate_frf: {name} is exactly zero at {line:g} Hz, which no recorder gives; leave such lines out "
                "with low_hz and high_hz"
            )

    def _force_share(self, relative: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the share of the scatter that is noise on the force, as far as it is known."""
        if self.noise_share is None:
            return np.zeros_like(relative)
        share: NDArray[np.float64] = np.minimum(self.noise_share / relative, 1.0)
        return share

    def _correction(
        self, estimator: Estimator, coherence: NDArray[np.float64], relative: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the factor from H1 to the estimator, and the bias of its logarithm, as far as it is known.

        `relative` is the scatter of one hit over |H|^2 |F|^2: noise on the force and on the response, together.
        """
        on_force = np.zeros_like(relative) if self.noise_share is None else self.noise_share
        if estimator == "H1":
            return np.ones_like(relative), on_force
        if estimator == "H2":
            return 1.0 / coherence, np.maximum(relative - on_force, 0.0)
        if self.noise_share is None:
            return 1.0 / np.sqrt(coherence), np.zeros_like(relative)
        # There cannot be more noise on the force than there is scatter.
        return 1.0 / (1.0 - np.minimum(on_force, relative / (1.0 + relative))), np.zeros_like(relative)

    @property
    def onset(self) -> int:
        """Sample of the blocks at which the hits begin, in the middle of them."""
        return int(np.median([hit.onset - hit.start for hit in self.hits.kept]))

    @property
    def over(self) -> int:
        """Sample of the blocks from which on no hammer touches."""
        return max(hit.release - hit.start for hit in self.hits.kept)


def _lines(hits: Hits, low_hz: float | None, high_hz: float | None) -> slice:
    low = 0.0 if low_hz is None else _checks.not_negative("estimate_frf", "low_hz", low_hz, unit="Hz")
    high = np.inf if high_hz is None else _checks.positive("estimate_frf", "high_hz", high_hz, unit="Hz")
    numbers = np.arange(1, (hits.n_samples - 1) // 2 + 1)
    # A limit that was meant to be on a line is on it, whatever rounding does.
    slack = 1e-6
    chosen = numbers[(numbers >= low * hits.duration_s - slack) & (numbers <= high * hits.duration_s + slack)]
    if not chosen.size:
        raise ValueError(
            f"estimate_frf: there is no line between {low:g} and {high:g} Hz; lines are {1.0 / hits.duration_s:g} Hz "
            f"apart, up to {hits.sample_rate_hz / 2.0:g} Hz"
        )
    return slice(int(chosen[0]), int(chosen[-1]) + 1)


def _without_offset(hits: Hits) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the blocks less their mean before the hit; of a force with little before it, less its median."""
    force, response = hits.blocks()
    recorded = hits.records[0].response_decay_rate > 0.0
    for row, hit in enumerate(hits.kept):
        before = max(0, hit.onset - hit.start - _CLEAR)
        enough = before >= _OFFSET_SAMPLES
        force[row] -= np.mean(force[row, :before]) if enough else np.median(force[row])
        if enough and not recorded:
            response[row] -= np.mean(response[row, :before], axis=0)
    return force, response
