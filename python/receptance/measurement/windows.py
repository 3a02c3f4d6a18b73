"""Windows on the two channels of every hit, and what they do to noise."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from receptance import _checks

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.measurement.hits import Hits

__all__ = ["ExponentialOn", "Windows", "alike_lines", "make_windows", "one_phase"]

ExponentialOn = Literal["both", "response"]
_PLATEAU = 1.0
"""Contacts that the force's window stays open before and after the hammer touches: a pulse has a foot;"""
_LEAST_OPEN = 24
"""in samples at least: a recorder's filter rings for about so many, and both channels must keep that."""
_FALL = 1.0
"""Contacts over which the window rises and falls, as half a cosine;"""
_LEAST_FALL = 8
"""in samples at least."""


@dataclass(frozen=True)
class Windows:
    """Weights of force and response, `(n_hits, n_samples)` each, and the length of the force's window alone."""

    force: NDArray[np.float64]
    response: NDArray[np.float64]
    shape: NDArray[np.float64]
    """The force's window alone, without zeros around it; empty where there is none."""
    around: NDArray[np.float64]
    """Weights of the force without its own window."""
    silent: tuple[tuple[slice, ...], ...]
    """Samples of each block in which no hammer touches."""

    def alike_lines(self, force_share: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return how many neighbouring lines share one independent value, `(n_lines,)`.

        That is sum |R|^2 over all lags of the correlation R between lines. R is the transform of how the noise's energy
        lies in time, g(t) with sum 1, so the sum is N sum g^2.

        Parameters
        ----------
        force_share : ndarray
            `(n_lines,)` share of the scatter that is noise on the force.
        """
        x, f = (np.mean(weights**2, axis=0) for weights in (self.response, self.force))
        x, f = x / np.sum(x), f / np.sum(f)
        n, s = x.size, force_share
        found: NDArray[np.float64] = n * ((1 - s) ** 2 * (x @ x) + 2 * s * (1 - s) * (x @ f) + s**2 * (f @ f))
        return np.maximum(found, 1.0)

    @property
    def force_energy(self) -> float:
        """Sum of squares of the force's weights, mean over the hits."""
        return float(np.mean(np.sum(self.force**2, axis=1)))

    def skew(self, spectra: NDArray[np.complex128], lines: slice) -> NDArray[np.float64]:
        """Return how much of the force's noise is in phase with the pulse, `(n_lines,)`, from 0 to 1.

        Through a window of length T noise below about 1 / T looks the same to all lines: real, but for the phase of
        the time at which the window sits, as the pulse does. So it changes magnitudes and not phases (or the other
        way round), twice as much as noise that is alike in both. With M the windowed noise E[M^2] = sum w^2 e^(-2iwt).
        """
        from scipy.fft import fft

        n_samples = self.force.shape[1]
        squares = fft(self.force**2, axis=1)
        twice = squares[:, (2 * np.arange(n_samples // 2 + 1)[lines]) % n_samples]
        power = np.sum(np.abs(spectra) ** 2, axis=0)
        found: NDArray[np.float64] = np.abs(np.sum(np.conj(spectra) ** 2 * twice, axis=0)) / power / self.force_energy
        return np.minimum(found, 1.0)


def alike_lines(weights: NDArray[np.float64]) -> float:
    """Return how many lines share one independent value of white noise through windows `(n_hits, n_samples)`."""
    energy = np.mean(weights**2, axis=0)
    return float(energy.size * np.sum(energy**2) / np.sum(energy) ** 2)


def one_phase(weights: NDArray[np.float64], lines: slice) -> NDArray[np.float64]:
    """Return how much of white noise through windows `(n_hits, n_samples)` is in one phase, `(n_lines,)`, 0 to 1."""
    from scipy.fft import fft

    energy = np.mean(weights**2, axis=0)
    twice = 2 * np.arange(energy.size // 2 + 1)[lines] % energy.size
    found: NDArray[np.float64] = np.abs(fft(energy)[twice]) / np.sum(energy)
    return found


def make_windows(
    hits: Hits, decay_rate: float, force_window_s: float | Literal["auto"] | None, exponential_on: ExponentialOn
) -> Windows:
    """Return the windows of all kept hits; parameters as in `estimate_frf`."""
    rate, n_samples = hits.sample_rate_hz, hits.n_samples
    kept = hits.kept
    time = np.arange(n_samples) / rate
    # One origin for both channels: the ratio of their spectra then is the FRF at w - i sigma, wherever the hit lies.
    exponential = np.exp(-decay_rate * time)
    response = np.tile(exponential, (len(kept), 1))
    force = response.copy() if exponential_on == "both" else np.ones_like(response)
    recorded = hits.records[0].response_decay_rate
    if recorded > 0.0:
        starts = np.array([hit.start for hit in kept]) / rate
        force = force * np.exp(-recorded * (time + starts[:, None]))
    around = force.copy()
    contact = max(hit.release - hit.onset for hit in kept)
    shape, before = _force_window(contact, rate, force_window_s)
    silent = []
    for row, hit in enumerate(kept):
        first = hit.onset - hit.start - before
        stop = first + (shape.size or contact + 2 * before)
        if shape.size:
            force[row] *= _placed(shape, first, n_samples)
        silent.append((slice(0, max(0, first)), slice(min(stop, n_samples), n_samples)))
    return Windows(force, response, shape, around, tuple(silent))


def _force_window(
    contact: int, rate: float, length_s: float | Literal["auto"] | None
) -> tuple[NDArray[np.float64], int]:
    """Return the force's window and how many samples of it lie before the contact."""
    from scipy.signal.windows import hann

    fall = max(_LEAST_FALL, round(_FALL * contact))
    margin = max(_LEAST_OPEN, round(_PLATEAU * contact))
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


def _placed(shape: NDArray[np.float64], first: int, n_samples: int) -> NDArray[np.float64]:
    window = np.zeros(n_samples)
    begin, end = max(0, first), min(n_samples, first + shape.size)
    window[begin:end] = shape[begin - first : end - first]
    return window
