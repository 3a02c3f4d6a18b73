"""Ordinary errors that the catalogue of causes contains by now; they were neighbours of it before.

Sizes are from no change to:

- a stated sensor of 2 g where a laser measured; a stated mass of two and a half times the sensor's;
- a frequency axis off by 6 Hz;
- a stated exponential window of 20 1/s that was not applied;
- loss factors of 0.01 in the tool, for 0.001, and of 0.014 in the holder, for 0.002;
- a stated Poisson's ratio of the tool of 0.42, for 0.22.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from blind.generator.effects import Numbers, Where
from blind.generator.records import Estimate

from .channel_errors import SENSOR
from .kind import Change, Draw, Kind, stated, times


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


COVERED_ERRORS = (
    Kind("laser", "measurement", "A sensor's mass is stated, although a laser measured.", _laser,
         right=("sensor_mass",)),
    Kind("overstated_sensor", "measurement", "The stated mass of the sensor is too large, or is stated twice.",
         _overstated_sensor, right=("sensor_mass",)),
    Kind("shifted_axis", "measurement", "The frequency axis is off by a constant.", _shifted_axis,
         right=("frequency_scale",)),
    Kind("window_not_applied", "measurement", "An exponential window is stated that was not applied.",
         _window_not_applied, right=("exponential_window",)),
    Kind("tool_loss", "description", "The tool's loss factor is wrong in the file.", _tool_loss,
         right=("material_loss",)),
    Kind("holder_loss", "description", "The holder's loss factor is wrong in the file.", _holder_loss,
         right=("material_loss",)),
    Kind("tool_poisson", "description", "Poisson's ratio of the tool is wrong in the file.", _tool_poisson,
         right=("shear_neglected",)),
)  # fmt: skip
