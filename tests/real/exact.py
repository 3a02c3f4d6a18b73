"""Exact changes of measured FRFs, with NumPy alone.

Conventions: e^{+i w t}; accelerance A = s^2 H with the receptance H = x / F, at s = sigma + i w where an exponential
window exp(-sigma t) was applied to force and response, and s = i w otherwise. All formulas hold at complex s.

A body on a point b, a mass m and a spring k to ground, has the force (m + k / s^2) a_b at the acceleration a_b. The
structure gets it reversed, so with L = m + k / s^2

    A_ij' = A_ij - A_ib L A_bj / (1 + L A_bb),

and for i = b, where the motion is measured at the body, A_bj' = A_bj / (1 + L A_bb). Without a window and a spring this
is H / (1 - w^2 m H).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Lines = NDArray[np.float64]
Values = NDArray[np.complex128]

BEFORE = 5.0
"""The end of the period that counts as the time before the hit, in periods of the highest line: a limited band spreads
the hit to both sides. More of it would amplify noise, which is everywhere in the period."""


def laplace(frequency_hz: Lines, decay_rate: float = 0.0) -> Values:
    """Return s = sigma + i w on the lines of an FRF with an exponential window."""
    return decay_rate + 2j * np.pi * frequency_hz


def with_body(accelerance: Values, drive: Values, s: Values, mass: float = 0.0, stiffness: float = 0.0) -> Values:
    """Return accelerances measured at the drive point with a mass and a spring to ground there.

    Parameters
    ----------
    accelerance : ndarray
        `(..., n)` of the drive point to loads anywhere.
    drive : ndarray
        `(n,)` accelerance of the drive point to loads there.
    s : ndarray
        `(n,)`; not zero.
    mass, stiffness : float
        In kg and N/m.
    """
    return accelerance / (1.0 + (mass + stiffness / s**2) * drive)


def with_body_elsewhere(
    accelerance: Values,
    to_body: Values,
    from_body: Values,
    drive: Values,
    s: Values,
    mass: float = 0.0,
    stiffness: float = 0.0,
) -> Values:
    """Return A_ij with a body at another point b, from A_ij, A_ib, A_bj and A_bb."""
    load = mass + stiffness / s**2
    return accelerance - to_body * load * from_body / (1.0 + load * drive)


def with_gain(values: Values, share: float) -> Values:
    """Return an FRF that reads too large by a share."""
    return (1.0 + share) * values


def with_delay(values: Values, delay: float, s: Values) -> Values:
    """Return an FRF whose response arrives late; the window begins with the record, so it acts at complex s."""
    return values * np.exp(-s * delay)


def reversed_polarity(values: Values) -> Values:
    """Return an FRF with one channel reversed."""
    return -values


def as_quantity(values: Values, order: int, s: Values) -> Values:
    """Return an FRF integrated `order` times, or differentiated for negative numbers."""
    return values / s**order


def impulse_response(values: Values, spacing_hz: float) -> Lines:
    """Return the response to a unit impulse over one period, from an FRF on all multiples of a spacing from 0 Hz."""
    size = 2 * (values.shape[-1] - 1)
    return np.fft.irfft(values, size, axis=-1) * size * spacing_hz


def windowed(values: Values, spacing_hz: float, decay_rate: float, end: float | None = None) -> Values:
    """Return an FRF on the same lines after a window on its impulse response.

    Parameters
    ----------
    values : ndarray
        `(..., n)` on all multiples of the spacing, from 0 Hz.
    spacing_hz : float
        Distance of the lines.
    decay_rate : float
        Of exp(-decay_rate t).
    end : float, optional
        Time in s at which the record ends; it is padded with zeros to its period.

    Notes
    -----
    The window of all times shifts the FRF to s + decay_rate. A band that ends at once would spread the hit over all
    times, so the FRF is continued beyond the band first; see `continued`. What is left before the hit, at the end of
    the period, keeps its negative times.
    """
    longer = continued(values, spacing_hz)
    response = impulse_response(longer, spacing_hz)
    period = 1.0 / spacing_hz
    time = np.arange(response.shape[-1]) * period / response.shape[-1]
    before = time >= period - BEFORE / (spacing_hz * (values.shape[-1] - 1))
    window = np.exp(-decay_rate * np.where(before, time - period, time))
    if end is not None:
        window[(time > end) & ~before] = 0.0
    changed = np.fft.rfft(response * window, axis=-1) / (response.shape[-1] * spacing_hz)
    return changed[..., : values.shape[-1]]


def continued(values: Values, spacing_hz: float) -> Values:
    """Return an FRF with as many lines more, on which it goes on as a single mode and fades.

    The mode is fitted to the last 5 % of the band, so that value and slope have no step there: a mode just below its
    end, as the beam's fourth, would ring before the hit otherwise.
    """
    count = values.shape[-1]
    hz = spacing_hz * np.arange(2 * count - 1)  # 2^n times small primes stay so: the transforms are fast
    own, more = hz[int(0.95 * count) : count], hz[count:]
    fade = 0.5 * (1.0 + np.cos(np.pi * (more - more[0]) / (more[-1] - more[0])))
    rows = []
    for row in np.atleast_2d(values):
        p, c0, c1 = local_mode(own, row[int(0.95 * count) :], own[0], own[-1])
        s2 = laplace(more) ** 2
        rows.append(np.concatenate([row, fade * (c0 + c1 * s2) / (s2 - p)]))
    return np.array(rows).reshape(*values.shape[:-1], hz.size)


def on_wrong_axis(frequency_hz: Lines, share: float) -> Lines:
    """Return the frequencies that an axis states that is too large by a share; the values stay as they are."""
    return (1.0 + share) * frequency_hz


def local_mode(frequency_hz: Lines, drive: Values, low_hz: float, high_hz: float) -> Values:
    """Return p, c0, c1 of A (s^2 - p) = c0 + c1 s^2, the accelerance around one mode, by reweighted least squares."""
    own = (frequency_hz >= low_hz) & (frequency_hz <= high_hz)
    s2 = laplace(frequency_hz[own]) ** 2
    scale = np.mean(np.abs(s2))
    x, values = s2 / scale, drive[own]
    weight = np.ones(x.size)
    found = np.zeros(3, dtype=np.complex128)
    for _ in range(6):
        columns = np.stack([np.ones_like(x), x, values], axis=1)
        found = np.linalg.lstsq(columns * weight[:, None], weight * values * x, rcond=None)[0]
        weight = 1.0 / np.abs(x - found[2])
    return np.array([found[2] * scale, found[0] * scale, found[1]])


def shifted_mode(mode: Values, mass: float = 0.0, stiffness: float = 0.0) -> tuple[float, float]:
    """Return the natural frequency in Hz of a local mode, without and with a body on the drive point."""
    p, c0, c1 = mode
    # (s^2 - p) s^2 + (m s^2 + k) (c0 + c1 s^2) = 0
    roots = np.roots([1.0 + mass * c1, -p + mass * c0 + stiffness * c1, stiffness * c0])
    nearest = roots[np.argmin(np.abs(roots - p))]
    return tuple(float(np.abs(np.sqrt(-one + 0j))) / (2.0 * np.pi) for one in (p, nearest))  # type: ignore[return-value]
