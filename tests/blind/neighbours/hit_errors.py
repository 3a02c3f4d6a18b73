"""Errors of the hits and of their records in time: overload, gates and windows, mains, drift, a coarse converter.

Sizes are from no change to:

- the hammer's channel clipped at 60 % of the peak, the sensor's at 70 %, at the higher force level;
- every second hit double, the second one half as strong, 5 to 25 ms later, and cut from the force record by a gate;
- a gate on the force that decays by a third within the pulse;
- mains and its odd harmonics up to 950 Hz, at the lower level as large as the quietest of these lines;
- a zero shift of the sensor by 0.5 % of the peak acceleration that decays in 0.1 to 1 s;
- a range of the converter that leaves eight bits for the strongest hit;
- a tip so soft that the pulse is ten times as long at the same peak, with the noise of the channels unchanged;
- a sensor's channel that loses a sample after every 512 ones; a laser without a signal for 3 ms of every second hit;
- crosstalk from the hammer's channel of 3 % of the ratio of the peaks; from the estimator H1 to H2.

A trigger after 5 to 40 % of the pulse with nothing before it, a Hamming window in place of none, and exchanged channels
have no size.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from blind.generator import rig
from blind.generator.effects import Numbers, Where
from blind.generator.records import RATE, Estimate, Setup, Signal

from .kind import Change, Draw, Kind

MAINS_HZ = 50.0
HARMONICS = np.arange(1, 20, 2)
Channels = tuple[Signal, Signal]


def _clipped_force(d: Draw) -> Change:
    limit = (1.25 - 0.65 * d.u) * d.upper

    def hits(rng: np.random.Generator, number: int, force: Signal, response: Signal, where: Where) -> Channels:
        return (np.minimum(force, limit) if where.level == d.upper else force), response

    return Change(hits=hits)


def _clipped_response(d: Draw) -> Change:
    def hits(rng: np.random.Generator, number: int, force: Signal, response: Signal, where: Where) -> Channels:
        limit = (1.0 - 0.3 * d.u) * float(np.abs(response).max())
        return force, (np.clip(response, -limit, limit) if where.level == d.upper else response)

    return Change(hits=hits)


def _double_hits(d: Draw) -> Change:
    later = round(d.within(0.005, 0.025) * RATE)

    def hits(rng: np.random.Generator, number: int, force: Signal, response: Signal, where: Where) -> Channels:
        second = np.concatenate([np.zeros(later), response[:-later]])
        return force, response + (0.5 * d.u * second if number % 2 else 0.0)

    return Change(hits=hits)


def _force_gate(d: Draw) -> Change:
    def hits(rng: np.random.Generator, number: int, force: Signal, response: Signal, where: Where) -> Channels:
        since = np.maximum(np.arange(force.size) / RATE - rig.HIT, 0.0)
        return force * np.exp(-4000.0 * d.u * since), response

    return Change(hits=hits)


def _no_pretrigger(d: Draw) -> Change:
    begin = (rig.HIT + d.within(0.05, 0.4) * d.bench.truth.setups[d.upper].pulse) * RATE

    def hits(rng: np.random.Generator, number: int, force: Signal, response: Signal, where: Where) -> Channels:
        # A part of the first sample stands for a trigger between two of them.
        kept = np.clip(np.arange(force.size) - begin + 1.0, 0.0, 1.0)
        return force * kept, response * kept

    return Change(hits=hits)


def _hum(d: Draw) -> Change:
    # The mains are never at 50 Hz exactly, or all of it would be in single lines of the analyser.
    mains = MAINS_HZ * (1.0 + 1e-3 * d.sign() * d.within(0.5, 2.0))
    shares = np.exp(d.rng.normal(0.0, 0.5, HARMONICS.size))

    def hits(rng: np.random.Generator, number: int, force: Signal, response: Signal, where: Where) -> Channels:
        times = np.arange(response.size) / RATE
        # The same volts at either level: the spectrum of the lower one at the mains is what they are compared with.
        spectrum = np.abs(np.fft.rfft(response)) / force.max() * min(d.bench.truth.setups)
        lines = np.fft.rfftfreq(response.size, 1.0 / RATE)
        quiet = float(np.median(spectrum[(lines > 100.0) & (lines < 1000.0)]))
        phases = rng.uniform(0.0, 2.0 * np.pi, HARMONICS.size)
        hum = np.sin(2.0 * np.pi * mains * HARMONICS[:, None] * times + phases[:, None])
        return force, response + d.u * 2.0 * quiet / response.size * (shares @ hum)

    return Change(hits=hits)


def _zero_shift(d: Draw) -> Change:
    shift, decay = 0.005 * d.u * d.sign(), d.within(0.1, 1.0)

    def hits(rng: np.random.Generator, number: int, force: Signal, response: Signal, where: Where) -> Channels:
        since = np.arange(response.size) / RATE - rig.HIT
        peak = float(np.abs(response).max())
        return force, response + shift * peak * np.where(since > 0.0, np.exp(-since / decay), 0.0)

    return Change(hits=hits)


def _coarse_converter(d: Draw) -> Change:
    # For the strongest hit, from 24 bits, which nobody sees, to 8.
    bits = 24.0 - 16.0 * d.u

    def hits(rng: np.random.Generator, number: int, force: Signal, response: Signal, where: Where) -> Channels:
        stronger = 1.2 * d.upper / force.max()
        steps = [float(np.abs(signal).max()) * stronger / 2.0**bits for signal in (force, response)]
        return steps[0] * np.round(force / steps[0]), steps[1] * np.round(response / steps[1])

    return Change(hits=hits)


def _soft_tip(d: Draw) -> Change:
    name = d.configuration() if d.rng.random() < 0.5 else ""

    def setup(usual: Setup, where: Where) -> Setup:
        if name not in ("", where.configuration):
            return usual
        return replace(usual, pulse=usual.pulse * (1.0 + 9.0 * d.u), usual_pulse=usual.pulse)

    return Change(setup=setup)


def _hamming_window(d: Draw) -> Change:
    def hits(rng: np.random.Generator, number: int, force: Signal, response: Signal, where: Where) -> Channels:
        window = np.hamming(force.size)
        return force * window, response * window

    return Change(hits=hits)


def _lost_samples(d: Draw) -> Change:
    # Longer than any record, where nothing is lost.
    buffer = round(512.0 / max(d.u, 1e-6))

    def hits(rng: np.random.Generator, number: int, force: Signal, response: Signal, where: Where) -> Channels:
        written = np.arange(response.size)
        read = written + written // buffer
        # The structure is at rest at the end.
        return force, np.where(read < response.size, response[np.minimum(read, response.size - 1)], 0.0)

    return Change(hits=hits)


def _signal_dropouts(d: Draw) -> Change:
    length = 3e-3 * d.u

    def hits(rng: np.random.Generator, number: int, force: Signal, response: Signal, where: Where) -> Channels:
        since = np.arange(response.size) / RATE - rig.HIT - rng.uniform(0.002, 0.02)
        lost = (since >= 0.0) & (since < length) & bool(number % 2)
        return force, np.where(lost, 0.0, response)

    return Change(hits=hits)


def _crosstalk(d: Draw) -> Change:
    share = 0.03 * d.u * d.sign()

    def hits(rng: np.random.Generator, number: int, force: Signal, response: Signal, where: Where) -> Channels:
        return force, response + share * force * np.abs(response).max() / force.max()

    return Change(hits=hits)


def _other_estimator(d: Draw) -> Change:
    def analysis(e: Estimate, p: Numbers, where: Where) -> Estimate:
        # H2 is H1 over the coherence.
        return replace(e, receptance=e.receptance / e.coherence**d.u)

    return Change(analysis=analysis)


def _exchanged_channels(d: Draw) -> Change:
    def analysis(e: Estimate, p: Numbers, where: Where) -> Estimate:
        s = 2j * np.pi * e.frequency_hz + e.decay_rate
        # H1 of the exchanged channels: the conjugate cross spectrum over the power of the response.
        return replace(e, receptance=e.coherence / (e.receptance * s**2) / s**2)

    return Change(analysis=analysis)


HIT_ERRORS = (
    Kind("clipped_force", "measurement", "The hammer's channel is overloaded at the higher force level.",
         _clipped_force),
    Kind("clipped_response", "measurement", "The sensor's channel is overloaded at the higher force level.",
         _clipped_response),
    Kind("double_hits", "measurement", "Every second hit bounces, and a gate takes the second one from the force.",
         _double_hits),
    Kind("force_gate", "measurement", "The gate on the force decays within the pulse.", _force_gate,
         right=("calibration_gain",)),
    Kind("no_pretrigger", "measurement", "The records begin within the pulse.", _no_pretrigger, sized=False),
    Kind("hum", "measurement", "The sensor's channel picks up the mains.", _hum),
    Kind("zero_shift", "measurement", "The sensor's zero jumps at the hit and returns slowly.", _zero_shift),
    Kind("coarse_converter", "measurement", "The input range is far too large, so that few bits are left.",
         _coarse_converter),
    Kind("soft_tip", "measurement", "The hammer has a soft tip, and the upper lines are noise.", _soft_tip,
         slight="the coherence tells which lines are noise"),
    Kind("hamming_window", "measurement", "The analyser has a Hamming window from the last job.", _hamming_window,
         sized=False),
    Kind("lost_samples", "measurement", "The sensor's channel loses a sample at the end of every buffer.",
         _lost_samples),
    Kind("signal_dropouts", "measurement", "In every second hit the laser loses its signal for a short time.",
         _signal_dropouts),
    Kind("crosstalk", "measurement", "A share of the hammer's signal is in the sensor's channel.", _crosstalk),
    Kind("other_estimator", "measurement", "The estimator is H2, which noise of the sensor makes too large.",
         _other_estimator),
    Kind("exchanged_channels", "measurement", "The cables of hammer and sensor are exchanged.", _exchanged_channels,
         sized=False),
)  # fmt: skip
