"""Windows on force and response of every hit, and their effect on noise."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from receptance import _checks

if TYPE_CHECKING:
    from receptance.measurement.hits import Hits

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
        from scipy.fft import fft

        n_samples = self.force.shape[1]
        squares = fft(self.force**2, axis=1)
        twice = squares[:, (2 * np.arange(n_samples // 2 + 1)[lines]) % n_samples]
        power = np.sum(np.abs(spectra) ** 2, axis=0)
        ratio: NDArray[np.float64] = np.abs(np.sum(np.conj(spectra) ** 2 * twice, axis=0)) / power / self.force_energy
        return np.minimum(ratio, 1.0)


def correlated_lines(weights: NDArray[np.float64]) -> float:
    """Return the number of lines per independent value of white noise through windows `(n_hits, n_samples)`."""
    energy = np.mean(weights**2, axis=0)
    return float(energy.size * np.sum(energy**2) / np.sum(energy) ** 2)


def noncircularity(weights: NDArray[np.float64], lines: slice) -> NDArray[np.float64]:
    """Return the noncircularity `(n_lines,)` of white noise through windows `(n_hits, n_samples)`, from 0 to 1."""
    from scipy.fft import fft

    energy = np.mean(weights**2, axis=0)
    twice = 2 * np.arange(energy.size // 2 + 1)[lines] % energy.size
    return np.asarray(np.abs(fft(energy)[twice]) / np.sum(energy))


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
            force[row] *= _window_at(force_window, first, n_samples)
        silence.append((slice(0, max(0, first)), slice(min(stop, n_samples), n_samples)))
    return Windows(force, response, force_window, force_without_window, tuple(silence))


def _force_window(
    contact: int, rate: float, length_s: float | Literal["auto"] | None
) -> tuple[NDArray[np.float64], int]:
    """Return the force window, and its number of samples before the contact."""
    from scipy.signal.windows import hann

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
    ramp = hann(2 * fall + 1)[:fall]
    return np.concatenate([ramp, np.ones(margin + after), ramp[::-1]]), margin + fall


def _window_at(shape: NDArray[np.float64], first: int, n_samples: int) -> NDArray[np.float64]:
    window = np.zeros(n_samples)
    begin, end = max(0, first), min(n_samples, first + shape.size)
    window[begin:end] = shape[begin - first : end - first]
    return window
