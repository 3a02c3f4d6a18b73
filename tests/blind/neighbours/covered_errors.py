"""Ordinary errors that the catalogue of causes contains by now; most were neighbours of it before.

Sizes are from no change to:

- a stated sensor of 2 g where a laser measured; a stated mass of two and a half times the sensor's;
- a frequency axis off by 6 Hz;
- one record with a gain of 15 %, with an exponential window of 15 1/s that is not stated, or with one channel late by
  one sample of 25.6 kHz;
- two ropes on which the holder bounces at 90 Hz each; a coolant tube of 80 g in the holder that swings at 0.8 to 3 kHz;
- a stated exponential window of 20 1/s that was not applied;
- loss factors of 0.01 in the tool, for 0.001, and of 0.014 in the holder, for 0.002;
- a stated Poisson's ratio of the tool of 0.42, for 0.22.

A reversed record, a record of another quantity, one that ends while the structure rings, after 40 to 150 ms,
conjugated files, and files of two configurations exchanged have no size.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from blind.generator import Record
from blind.generator.effects import Numbers, Where
from blind.generator.records import RATE, Estimate

from .channel_errors import SENSOR
from .clamping_errors import bouncing_stiffness, length_of_holder, springs
from .file_errors import in_file, pair
from .kind import Change, Draw, Kind, added, filtered, point, stated, times


def _laser(d: Draw) -> Change:
    return Change(common={"sensor.mass": 0.0}, describe=stated(sensor__mass=2e-3 * d.u))


def _overstated_sensor(d: Draw) -> Change:
    mass = d.within(*SENSOR)
    return Change(common={"sensor.mass": mass}, describe=stated(sensor__mass=mass * (1.0 + 1.5 * d.u)))


def _shifted_axis(d: Draw) -> Change:
    shift = 6.0 * d.u * d.sign()

    def analysis(e: Estimate, p: Numbers, where: Where) -> Estimate:
        return replace(e, frequency_hz=e.frequency_hz + shift)

    return Change(analysis=analysis)


def _tool_loss(d: Draw) -> Change:
    return Change(structure=times({"tool.loss": 1.0 + 9.0 * d.u}))


def _holder_loss(d: Draw) -> Change:
    return Change(structure=times({"holder.loss": 1.0 + 6.0 * d.u}))


def _tool_poisson(d: Draw) -> Change:
    return Change(describe=stated(tool__poisson=d.numbers["tool.poisson"] + 0.2 * d.u))


def _window_not_applied(d: Draw) -> Change:
    rate = 20.0 * d.u

    def analysis(e: Estimate, p: Numbers, where: Where) -> Estimate:
        # The file holds accelerances, which the stated rate makes another receptance.
        s = 2j * np.pi * e.frequency_hz + e.decay_rate
        return replace(e, receptance=e.receptance * (s / (s + rate)) ** 2, decay_rate=e.decay_rate + rate)

    return Change(analysis=analysis)


def _gain_of_one_record(d: Draw) -> Change:
    gain = 1.0 + 0.15 * d.u * d.sign()
    return Change(analysis=filtered(lambda f: gain, d.record()))


def _reversed_record(d: Draw) -> Change:
    return Change(analysis=filtered(lambda f: -1.0, d.record()))


def _window_of_one_record(d: Draw) -> Change:
    here = d.record()

    def structure(p: Numbers, where: Where) -> None:
        if here(where):
            p["window"] = p.get("window", 0.0) + 15.0 * d.u

    return Change(structure=structure)


def _late_channel(d: Draw) -> Change:
    delay = d.u / RATE * d.sign()
    return Change(analysis=filtered(lambda f: np.exp(-2j * np.pi * f * delay), d.record()))


def _two_ropes(d: Draw) -> Change:
    return springs(d, [d.within(0.15, 0.45), d.within(0.6, 0.95)], bouncing_stiffness(90.0 * d.u), 0.03)


def _other_quantity(d: Draw) -> Change:
    power, here = d.sign(), d.record()

    def analysis(e: Estimate, p: Numbers, where: Where) -> Estimate:
        s = 2j * np.pi * e.frequency_hz + e.decay_rate
        return replace(e, receptance=e.receptance * s**power) if here(where) else e

    return Change(analysis=analysis)


def _short_record(d: Draw) -> Change:
    here, end = d.record(), 2.0 * round(0.5 * RATE * d.within(0.04, 0.15)) / RATE

    def structure(p: Numbers, where: Where) -> None:
        if here(where):
            p["record"] = end

    return Change(structure=structure)


def _coolant_tube(d: Draw) -> Change:
    numbers = {"hz": float(np.exp(d.within(np.log(800.0), np.log(3000.0)))), "zeta": d.within(0.01, 0.05)}
    place = d.within(0.6, 0.8) * length_of_holder(d)
    # A tube so light that it is negligible, where there is none.
    return Change(structure=added(point("tube", "holder", place, mass=max(0.08 * d.u, 1e-7), **numbers)))


def _exchanged_files(d: Draw) -> Change:
    first, second = pair(d)
    other = {first: second, second: first}

    def files(records: list[Record]) -> list[Record]:
        every = {(r.configuration, r.level, r.plane): r.estimate for r in records}
        return [
            replace(r, estimate=every[other.get(r.configuration, r.configuration), r.level, r.plane]) for r in records
        ]

    return Change(files=files)


def _conjugated(d: Draw) -> Change:
    return Change(analysis=in_file(d, np.conj))


COVERED_ERRORS = (
    Kind("laser", "measurement", "A sensor's mass is stated, although a laser measured.", _laser,
         right=("sensor_mass",)),
    Kind("overstated_sensor", "measurement", "The stated mass of the sensor is too large, or is stated twice.",
         _overstated_sensor, right=("sensor_mass",)),
    Kind("shifted_axis", "measurement", "The frequency axis is off by a constant.", _shifted_axis,
         right=("frequency_scale",)),
    Kind("gain_of_one_record", "measurement", "One record was taken with another sensitivity.", _gain_of_one_record,
         right=("calibration_gain",)),
    Kind("reversed_record", "measurement", "In one record the sensor points the other way.", _reversed_record,
         right=("reversed_polarity",), sized=False),
    Kind("window_of_one_record", "measurement", "One record has an exponential window that is not stated.",
         _window_of_one_record, right=("exponential_window",)),
    Kind("late_channel", "measurement", "In one record one channel is late.", _late_channel, right=("time_delay",)),
    Kind("window_not_applied", "measurement", "An exponential window is stated that was not applied.",
         _window_not_applied, right=("exponential_window",)),
    Kind("tool_loss", "description", "The tool's loss factor is wrong in the file.", _tool_loss,
         right=("material_loss",)),
    Kind("holder_loss", "description", "The holder's loss factor is wrong in the file.", _holder_loss,
         right=("material_loss",)),
    Kind("tool_poisson", "description", "Poisson's ratio of the tool is wrong in the file.", _tool_poisson,
         right=("shear_neglected",)),
    Kind("two_ropes", "clamping", "The holder hangs in two ropes that are too stiff.", _two_ropes,
         right=("suspension",)),
    Kind("coolant_tube", "clamping", "A coolant tube swings in the holder.", _coolant_tube, right=("missing_mode",)),
    Kind("other_quantity", "file", "One file holds another quantity.", _other_quantity, right=("wrong_quantity",),
         sized=False),
    Kind("short_record", "file", "One record ends while the structure still rings.", _short_record,
         right=("coarse_resolution",), sized=False),
    Kind("conjugated", "file", "The files have the other sign of the exponent in time.", _conjugated,
         right=("wrong_quantity",), sized=False),
    Kind("exchanged_files", "file", "The files of two configurations are exchanged.", _exchanged_files,
         right=("exchanged_files",), sized=False),
)  # fmt: skip
