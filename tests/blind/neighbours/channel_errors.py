"""Errors of sensor, hammer and amplifiers: mass, mounting and place of the sensor, gains, filters, axes of frequency.

Sizes are from no change to:

- the frequency axis of one record off by its spacing of 8 Hz;
- a clock that drifts by 0.6 %, and a gain that grows by 8 %, from the first configuration to the last one;
- a resonance of the sensor at 15 kHz;
- a level that changes by a power of the frequency of 0.06 (22 % from 200 to 6000 Hz); a phase off by 4 degrees;
- a filter against aliasing of fourth order with its corner at 20 kHz; AC coupling with a corner of 40 Hz;
- a sensitivity that falls by 8 % about 800 Hz; a moving mean over 4 ms that is removed from the sensor's record;
- a gain of 8 % at the higher force level; directions of hit and sensor off by up to 25 degrees;
- longer tools hit with another tip of the hammer: a gain of 6 %, a pulse longer by 60 %;
- hits 35 degrees off the plane, with a joint that is half to twice as stiff in the other plane;
- a cable with 1.5 g and 2 N s/m at the tip;
- a sensor on wax with a resonance at 5 kHz; a loose one with 3 kHz and a damping ratio of 0.1 to 0.4; one on a magnet
  of 6 g with a resonance at 6 kHz;
- a sensor whose centre is 8 mm beyond the tip; hits and sensor 8 mm behind it; the hits of a record at places from the
  tip to 8 mm behind it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from blind.generator import rig
from blind.generator.effects import Numbers, Where
from blind.generator.records import Estimate, Setup

from .kind import Change, Draw, Kind, added, filtered, point

HIGHEST_HZ = 5e5
"""Resonance of a mounting that is rigid."""
SENSOR = (5e-4, 1.5e-3)
"""Masses of sensors in kg."""
Lines = NDArray[np.float64]


def _shifted_axis_of_one_record(d: Draw) -> Change:
    shift, here = 8.0 * d.u * d.sign(), d.record()

    def analysis(e: Estimate, p: Numbers, where: Where) -> Estimate:
        return replace(e, frequency_hz=e.frequency_hz + shift) if here(where) else e

    return Change(analysis=analysis)


def _drifting_clock(d: Draw) -> Change:
    order, most = d.order(), 6e-3 * d.u * d.sign()

    def analysis(e: Estimate, p: Numbers, where: Where) -> Estimate:
        # The analyser divides accelerations by the frequencies that it states.
        scale = 1.0 + most * order[where.configuration]
        return replace(e, frequency_hz=e.frequency_hz / scale, receptance=e.receptance * scale**2)

    return Change(analysis=analysis)


def _drifting_gain(d: Draw) -> Change:
    order, most = d.order(), 0.08 * d.u * d.sign()

    def analysis(e: Estimate, p: Numbers, where: Where) -> Estimate:
        return replace(e, receptance=e.receptance * (1.0 + most * order[where.configuration]))

    return Change(analysis=analysis)


def _resonant_sensor(d: Draw) -> Change:
    return Change(analysis=filtered(lambda f: 1.0 / (1.0 - (d.u * f / 15e3) ** 2 + 0.04j * d.u * f / 15e3)))


def _sloping_level(d: Draw) -> Change:
    power = 0.06 * d.u * d.sign()
    return Change(analysis=filtered(lambda f: (f / 1000.0) ** power))


def _constant_phase(d: Draw) -> Change:
    phase = np.deg2rad(4.0 * d.u) * d.sign()
    return Change(analysis=filtered(lambda f: np.full(f.shape, np.exp(1j * phase))))


def _anti_alias_filter(d: Draw) -> Change:
    def response(f: Lines) -> NDArray[np.complex128]:
        x = 1j * d.u * f / 20e3
        # Butterworth of fourth order.
        return 1.0 / ((1.0 + 0.765367 * x + x**2) * (1.0 + 1.847759 * x + x**2))

    return Change(analysis=filtered(response))


def _ac_coupling(d: Draw) -> Change:
    return Change(analysis=filtered(lambda f: f / (f - 40j * d.u)))


def _shelf_of_sensitivity(d: Draw) -> Change:
    most = 0.08 * d.u * d.sign()
    return Change(analysis=filtered(lambda f: 1.0 + most / (1.0 + 1j * f / 800.0)))


def _moving_mean_removed(d: Draw) -> Change:
    # So long that no line sees it, where nothing is removed.
    duration = 4e-3 / max(d.u, 1e-9)
    return Change(analysis=filtered(lambda f: 1.0 - np.sinc(duration * f)))


def _other_hammer_tip(d: Draw) -> Change:
    middle = float(np.median([c.overhang for c in d.bench.nominal.configurations]))
    gain = 1.0 + 0.06 * d.u * d.sign()

    def setup(usual: Setup, where: Where) -> Setup:
        if where.overhang <= middle:
            return usual
        return replace(usual, pulse=usual.pulse * (1.0 + 0.6 * d.u), usual_pulse=usual.pulse)

    return Change(setup=setup, analysis=filtered(lambda f: gain, lambda where: where.overhang > middle))


def _gain_of_range(d: Draw) -> Change:
    gain = 1.0 + 0.08 * d.u * d.sign()
    return Change(analysis=filtered(lambda f: gain, lambda where: where.level == d.upper))


def _oblique_directions(d: Draw) -> Change:
    # Each hit series by hand has an angle of its own.
    angles = {key: np.deg2rad(25.0 * d.u) * d.rng.uniform(-1.0, 1.0, 2) for key in _keys(d)}

    def analysis(e: Estimate, p: Numbers, where: Where) -> Estimate:
        hit, sensor = np.cos(angles[where.configuration, where.level, where.plane])
        return replace(e, receptance=e.receptance * hit * sensor)

    return Change(analysis=analysis)


def _keys(d: Draw) -> list[tuple[str, float, int]]:
    return [(c.name, level, plane) for c, plane, level in d.bench.series()]


def _mixed_planes(d: Draw) -> Change:
    share = float(np.sin(np.deg2rad(35.0 * d.u)) ** 2)
    ratio = d.within(1.5, 2.0) ** d.sign()

    def analysis(e: Estimate, p: Numbers, where: Where) -> Estimate:
        # Hit and sensor are in one oblique plane, in which the two receptances add by their squared cosines.
        other = {**p, "joint.k_y": p["joint.k_y"] * ratio, "joint.k_theta": p["joint.k_theta"] * ratio}
        pair = [rig.recorded(numbers, e.frequency_hz, e.decay_rate) for numbers in (p, other)]
        return replace(e, receptance=e.receptance + share * (pair[1] - pair[0]))

    return Change(analysis=analysis)


def _cable(d: Draw) -> Change:
    return Change(structure=added(point("cable", "tool", 0.0, mass=1.5e-3 * d.u, c=2.0 * d.u)))


def _on_spring(d: Draw, mass: float, extra: float, hz: float, zeta: float) -> Change:
    limited = min(hz / max(d.u, 1e-9), HIGHEST_HZ)

    def structure(p: Numbers, where: Where) -> None:
        p["sensor.mass"] += extra
        p |= {"wax.hz": limited, "wax.zeta": zeta}

    return Change(common={"sensor.mass": mass}, structure=structure)


def _wax(d: Draw) -> Change:
    return _on_spring(d, d.within(*SENSOR), 0.0, 5000.0, d.within(0.01, 0.05))


def _loose_sensor(d: Draw) -> Change:
    return _on_spring(d, d.within(*SENSOR), 0.0, 3000.0, d.within(0.1, 0.4))


def _magnet(d: Draw) -> Change:
    return _on_spring(d, d.within(*SENSOR), 6e-3 * d.u, 6000.0, d.within(0.01, 0.05))


def _sensor_beyond_tip(d: Draw) -> Change:
    mass = d.within(*SENSOR)
    return Change(common={"sensor.mass": mass}, structure=added({"sensor.arm": -8e-3 * d.u}))


def _both_behind_tip(d: Draw) -> Change:
    return Change(common={"sensor.mass": 0.0}, structure=added({"both.offset": 8e-3 * d.u}))


def _scattered_hit_places(d: Draw) -> Change:
    setups = d.bench.truth.setups
    places = {key: 8e-3 * d.u * d.rng.random(setups[key[1]].hits) for key in _keys(d)}

    def analysis(e: Estimate, p: Numbers, where: Where) -> Estimate:
        offsets = places[where.configuration, where.level, where.plane]
        hits = [rig.recorded({**p, "hit.offset": float(x)}, e.frequency_hz, e.decay_rate) for x in offsets]
        mean = np.mean(hits, axis=0)
        moved = e.receptance + mean - rig.recorded(p, e.frequency_hz, e.decay_rate)
        # The analyser takes the differences between the places for noise.
        power = np.abs(mean) ** 2
        scatter = np.mean(np.abs(hits - mean) ** 2, axis=0)
        variance = e.log_variance + scatter / power / 2.0 / (e.averages - 1)
        coherence = e.coherence * power / (power + scatter)
        return replace(e, receptance=moved, log_variance=variance, coherence=coherence)

    return Change(analysis=analysis)


CHANNEL_ERRORS = (
    Kind("shifted_axis_of_one_record", "measurement", "The frequency axis of one record is off by up to a line.",
         _shifted_axis_of_one_record, right=("frequency_scale",)),
    Kind("drifting_clock", "measurement", "The clock of the analyser drifts between configurations.", _drifting_clock,
         right=("frequency_scale",)),
    Kind("drifting_gain", "measurement", "The amplifier warms up, so that the gain drifts between configurations.",
         _drifting_gain, right=("calibration_gain",)),
    Kind("resonant_sensor", "measurement", "The sensor's own resonance is not far above the band.", _resonant_sensor),
    Kind("sloping_level", "measurement", "The level of an amplifier changes slowly with the frequency.",
         _sloping_level),
    Kind("constant_phase", "measurement", "An amplifier turns the phase by the same angle at all frequencies.",
         _constant_phase),
    Kind("anti_alias_filter", "measurement", "One channel has a filter against aliasing, the other has none.",
         _anti_alias_filter, right=("time_delay",)),
    Kind("ac_coupling", "measurement", "One channel is coupled by a capacitor.", _ac_coupling),
    Kind("gain_of_range", "measurement", "The gain of an input range is off, that of the higher force level.",
         _gain_of_range, right=("calibration_gain",)),
    Kind("shelf_of_sensitivity", "measurement", "The sensitivity at low frequencies is not that of the upper band.",
         _shelf_of_sensitivity),
    Kind("moving_mean_removed", "measurement", "A moving mean was removed from the sensor's record to end its drift.",
         _moving_mean_removed),
    Kind("other_hammer_tip", "measurement", "The longer tools were hit with a tip for which the hammer has another "
         "sensitivity.", _other_hammer_tip, right=("calibration_gain",)),
    Kind("oblique_directions", "measurement", "Hits and sensor are some degrees off, in each record anew.",
         _oblique_directions, right=("calibration_gain",)),
    Kind("mixed_planes", "measurement", "Hits and sensor lie between the two planes of a keyway.", _mixed_planes,
         right=("xy_asymmetry",)),
    Kind("cable", "measurement", "The cable weighs on the tip and rubs.", _cable, right=("sensor_mass",)),
    Kind("wax", "measurement", "The sensor sits on a thick layer of wax.", _wax),
    Kind("loose_sensor", "measurement", "The sensor is not tightened.", _loose_sensor),
    Kind("magnet", "measurement", "The sensor sits on a magnet that is not stated.", _magnet, right=("sensor_mass",)),
    Kind("sensor_beyond_tip", "measurement", "An adapter holds the sensor beyond the tip.", _sensor_beyond_tip),
    Kind("both_behind_tip", "measurement", "Hits and laser are at the same place behind the tip.", _both_behind_tip,
         right=("hammer_offset",)),
    Kind("scattered_hit_places", "measurement", "The hits of a record are at several places behind the tip.",
         _scattered_hit_places, right=("hammer_offset",)),
)  # fmt: skip
