"""Hits as time records, and their evaluation by an analyser: H1 with coherence and the variance of its logarithm."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from . import rig

RATE = 25600.0
SPACING = 8.0
POOLED = 4
"""Neighbours to each side over which the analyser pools its noise."""
Signal = NDArray[np.float64]
Disturbance = Callable[[int, Signal, Signal], tuple[Signal, Signal]]
"""Returns force and response of a hit as they are recorded, from its number and what both channels should record."""


@dataclass(frozen=True, kw_only=True)
class Setup:
    """Settings of a record and of the analyser."""

    level: float
    hits: int
    low_hz: float
    high_hz: float
    pulse: float
    """Duration of the pulse in s."""
    noise: float
    """Wanted median of the standard deviation of the logarithm."""
    hammer_noise: float
    decay_rate: float = 0.0
    """Rate of an exponential window that the analyser reports."""
    spacing: float = SPACING
    """Of the reported lines in Hz, at least."""
    usual_pulse: float = 0.0
    """Duration in s of the pulse to which `noise` and `hammer_noise` refer, where it is not `pulse`."""


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """Output of the analyser, as receptance."""

    frequency_hz: NDArray[np.float64]
    receptance: NDArray[np.complex128]
    log_variance: NDArray[np.float64]
    degrees_of_freedom: float
    coherence: NDArray[np.float64]
    averages: int
    decay_rate: float
    correlated_lines: float


def _time_to_rest(p: Mapping[str, float], setup: Setup) -> float:
    """Return a time after which the structure is at rest, a multiple of a quarter second."""
    rates = rig.poles(p).rates
    low = 2.0 * np.pi * 30.0
    inside = rates[(np.abs(rates.imag) > low) & (rates.imag < 2.0 * np.pi * 1.2 * setup.high_hz) & (rates.imag > 0.0)]
    # A stiff blank in a free holder may have no mode there.
    slowest = float(np.min(-inside.real, initial=np.inf)) + setup.decay_rate + p.get("window", 0.0)
    return 0.25 * int(np.clip(np.ceil(4.0 * 13.0 / max(slowest, 1e-3)), 2, 16))


def _unit_hit(
    p: Mapping[str, float], setup: Setup, n: int, rest: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return force and acceleration of a hit of one newton, sampled through an ideal filter."""
    # Long enough that the response does not wrap around.
    whole = 2 * max(n, round(rest * RATE))
    lines = np.fft.rfftfreq(whole, 1.0 / RATE)[1:]
    s = 2j * np.pi * lines
    force = rig.pulse(s, setup.pulse)
    found = rig.poles(p).receptance(lines)
    response = found * s**2 * rig.chain({k: v for k, v in p.items() if k != "quantity"}, s) * force
    signals = []
    for spectrum, constant in ((force, 0.5 * setup.pulse), (response, 0.0)):
        signals.append(np.fft.irfft(np.concatenate([[constant], spectrum]) * RATE, whole)[:n])
    return signals[0], signals[1]


def measure(
    rng: np.random.Generator, p: Mapping[str, float], setup: Setup, disturb: Disturbance | None = None
) -> Estimate:
    """Return an FRF from hits in time, whose records may be disturbed before the analyser has them."""
    rest = _time_to_rest(p, setup)
    n = 2 * round(0.5 * (p.get("record", 0.0) or rest) * RATE)
    force, response = _unit_hit(p, setup, n, rest)
    window = np.exp(-(setup.decay_rate + p.get("window", 0.0)) * np.arange(n) / RATE)
    lines = np.fft.rfftfreq(n, 1.0 / RATE)
    step = max(1, round(setup.spacing / lines[1]))
    first, last = np.searchsorted(lines, [setup.low_hz, setup.high_hz])
    picked = np.arange(step * -(-first // step), last, step)
    band = slice(picked[0] - POOLED - step, picked[-1] + POOLED + step + 1)
    f1, a1 = (np.fft.rfft(signal * window)[band] for signal in (force, response))
    # White noise of the channels, from the specified scatter of the mean of all hits; input ranges follow the level.
    power = float(np.sum(window**2))
    low = setup.noise / np.sqrt(power / 2.0 / setup.hits)
    usual_f, usual_a = f1, a1
    if setup.usual_pulse:
        usual = _unit_hit(p, replace(setup, pulse=setup.usual_pulse), n, rest)
        usual_f, usual_a = (np.fft.rfft(signal * window)[band] for signal in usual)
    sensor = low * float(np.median(np.abs(usual_a))) * setup.level
    hammer = setup.hammer_noise / np.sqrt(power / 2.0 / setup.hits) * float(np.median(np.abs(usual_f))) * setup.level
    cross = np.zeros(f1.size, dtype=np.complex128)
    force_power, response_power = np.zeros(f1.size), np.zeros(f1.size)
    for number in range(setup.hits):
        strength = setup.level * rng.uniform(0.85, 1.15)
        noise = rng.normal(0.0, hammer, n), rng.normal(0.0, sensor, n)
        if disturb is None:
            f, a = (strength * h1 + np.fft.rfft(x * window)[band] for h1, x in zip((f1, a1), noise, strict=True))
        else:
            whole = disturb(number, strength * force + noise[0], strength * response + noise[1])
            f, a = (np.fft.rfft(signal * window)[band] for signal in whole)
        cross += a * f.conj()
        force_power += np.abs(f) ** 2
        response_power += np.abs(a) ** 2
    h = cross / force_power
    at = picked - band.start
    scatter = np.maximum(response_power - np.abs(cross) ** 2 / force_power, 0.0) / (setup.hits - 1)
    pooled = np.convolve(scatter, np.ones(2 * POOLED + 1) / (2 * POOLED + 1), mode="same")[at]
    variance = pooled / (2.0 * force_power[at] * np.abs(h[at]) ** 2)
    spectrum = np.abs(np.fft.rfft(window**2))[::step][1:40] / power
    alike = 1.0 + 2.0 * float(np.sum(spectrum**2))
    stated = 2j * np.pi * lines[picked] + setup.decay_rate
    return Estimate(
        frequency_hz=lines[picked],
        receptance=h[at] / stated**2 * (2j * np.pi * lines[picked]) ** p.get("quantity", 0.0),
        log_variance=variance,
        degrees_of_freedom=2.0 * (setup.hits - 1) * max(1.0, (2 * POOLED + 1) / max(alike, 1.0)),
        coherence=np.clip(np.abs(cross[at]) ** 2 / force_power[at] / response_power[at], 0.0, 1.0),
        averages=setup.hits,
        decay_rate=setup.decay_rate,
        correlated_lines=alike,
    )


def like(setup: Setup, level: float) -> Setup:
    """Return the same set-up at another force level."""
    return replace(setup, level=level)
