"""Whether data can show a hidden effect: an oracle with the model of the generator, to first order at the truth.

It fits joint and errors of the description, with the true spindle or with one whose numbers are unknown, to the change
of the records by the effect. What is left, in variances of the data, is the gain of chi-square by the right answer.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from machine_laboratory.generator import Effect, Machine
from machine_laboratory.generator.effects import recorded
from machine_laboratory.generator.machine import FLOOR, HITS_REPEAT, true_deviation
from machine_laboratory.generator.structure import Numbers

JOINT = ("joint.k_y", "joint.k_theta", "joint.c_y", "joint.c_theta")
SPINDLE = ("taper.", "shaft.", "front.", "rear.", "housing.")
STEP = 1e-4
GAIN = 30.0
"""Gain of chi-square from which on data show an effect."""
SAME = 6.0
"""Gain of chi-square, three nats, up to which two answers are the same."""
AVERAGES = 10
THINNED = 4
"""One of so many lines is used, with the weight of all."""

SMALL = 1e-3
"""Size of the effect, relative to its own, of which the change is compared with those of other answers."""
WHOLE = ("wrong_quantity", "reversed_polarity")
"""Effects without a size."""

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Oracle:
    """Gains of chi-square by the hidden effect."""

    gain: float
    """With the true spindle."""
    gain_unknown: float
    """With a spindle whose numbers are unknown."""


class Records:
    """The records of a machine as one vector, and its changes in standard deviations."""

    def __init__(self, machine: Machine) -> None:
        self.machine = machine
        self.groups: dict[tuple[int, tuple[str, float]], list[int]] = {}
        for i, record in enumerate(machine.records):
            self.groups.setdefault((record.overhang, record.response), []).append(i)
        self.exact = self.values(machine.truth, None)
        size = np.abs(self.exact)
        noise = HITS_REPEAT**2 * (1.0 + (np.median(size, axis=1)[:, None] / size) ** 2) / (2.0 * AVERAGES)
        self.deviation = np.sqrt((noise + FLOOR**2) / THINNED)

    def values(self, truth: Sequence[Numbers], effect: Effect | None) -> NDArray[np.complex128]:
        """Return all records `(records, n)`."""
        lines = self.machine.records[0].frequency_hz[::THINNED]
        found = np.zeros((len(self.machine.records), lines.size), dtype=np.complex128)
        for (number, response), members in self.groups.items():
            hits = [self.machine.records[i].hit for i in members]
            found[members] = recorded(truth[number], effect, number, response, hits, lines).T
        return found

    def change(self, truth: Sequence[Numbers], effect: Effect | None = None) -> FloatArray:
        """Return the change of the logarithms from the truth in standard deviations."""
        changed = np.log(self.values(truth, effect) / self.exact) / self.deviation
        return np.concatenate([changed.real.ravel(), changed.imag.ravel()])

    def slope(self, moved: Callable[[Numbers, int], Numbers], step: float) -> FloatArray:
        """Return the change per step of numbers that a function moves."""
        truth = [moved(p, number) for number, p in enumerate(self.machine.truth[:2])]
        return self.change(truth) / step


def consult(machine: Machine, answers: Sequence[str] = ()) -> tuple[Oracle, tuple[str, ...]]:
    """Return the gains of the hidden effect, and those of some other answers that would be the same with the data."""
    if machine.effect is None:
        return Oracle(0.0, 0.0), ()
    records = Records(machine)
    target = records.change(machine.truth[:2], machine.effect)
    small = SMALL if machine.effect.id not in WHOLE else 1.0
    tangent = records.change(machine.truth[:2], replace(machine.effect, size=small * machine.effect.size)) / small
    free = [_share_of(records, name) for name in JOINT]
    errors = [records.slope(moved, STEP) for moved in _errors(machine)]
    spindle = [_share_of(records, name) for name in machine.truth[0] if name.startswith(SPINDLE)]
    known = _left(target, free, errors)
    unknown = _left(target, [*free, *spindle], errors)
    same = tuple(
        id
        for id in answers
        if id in _ANSWERS and _left(tangent, [*free, *spindle, *_ANSWERS[id](records)], errors) < SAME
    )
    return Oracle(known, unknown), same


def _left(target: FloatArray, free: Sequence[FloatArray], errors: Sequence[FloatArray]) -> float:
    """Return the least chi-square of a change: free columns, and columns of standard normal errors."""
    columns = np.column_stack([*free, *errors])
    priors = np.hstack([np.zeros((len(errors), len(free))), np.eye(len(errors))])
    matrix = np.vstack([columns, priors])
    scale = np.maximum(np.linalg.norm(matrix, axis=0), 1e-300)
    whole = np.concatenate([target, np.zeros(len(errors))])
    found = np.linalg.lstsq(matrix / scale, whole, rcond=1e-10)[0]
    return float(np.sum((whole - matrix / scale @ found) ** 2))


def _share_of(records: Records, *names: str) -> FloatArray:
    def moved(p: Numbers, number: int) -> Numbers:
        return {**p, **{name: p[name] * (1.0 + STEP) for name in names}}

    return records.slope(moved, STEP)


def _errors(machine: Machine) -> list[Callable[[Numbers, int], Numbers]]:
    """Return a function for each error of the description that moves it by a step of its standard deviation."""

    def of(name: str) -> Callable[[Numbers, int], Numbers]:
        return lambda p, number: true_deviation(p, name, STEP * machine.deviations[name])

    def overhang(own: int) -> Callable[[Numbers, int], Numbers]:
        step = STEP * machine.overhang_deviation
        return lambda p, number: {**p, "overhang": p["overhang"] + step} if number == own else p

    return [*(of(name) for name in machine.deviations), overhang(0), overhang(1)]


def _by_effect(id: str, size: float, **fixed: float) -> Callable[[Records], list[FloatArray]]:
    """Return a function that gives the column of an effect of a small size."""
    plain = {"number": 0.0, "at_nose": 0.0, "quantity": 1.0, "exponent_y": 0.0, "axis": 0.0, "length": 0.024}

    def columns(records: Records) -> list[FloatArray]:
        effect = Effect(id, size, {**plain, **fixed})
        change = records.change(records.machine.truth[:2], effect)
        return [change / np.max(np.abs(change))]

    return columns


def _several(*makers: Callable[[Records], list[FloatArray]]) -> Callable[[Records], list[FloatArray]]:
    return lambda records: [column for maker in makers for column in maker(records)]


def _numbers(*names: str) -> Callable[[Records], list[FloatArray]]:
    return lambda records: [_share_of(records, name) for name in names]


_ANSWERS: dict[str, Callable[[Records], list[FloatArray]]] = {
    "sensor_mass": _by_effect("sensor_mass", 1e-6),
    "hammer_offset": _by_effect("hammer_offset", 1e-4),
    "calibration_gain": _by_effect("calibration_gain", 1e-4),
    "time_delay": _by_effect("time_delay", 1e-8),
    "exponential_window": _by_effect("exponential_window", 1e-2),
    "overhang_error": _several(*(_by_effect("overhang_error", 1e-7, number=number) for number in (0.0, 1.0))),
    "tool_modulus": _numbers("tool.modulus"),
    "tool_density": _numbers("tool.density"),
    "tool_material": _numbers("tool.modulus", "tool.density"),
    "holder_modulus": _numbers("holder.modulus"),
    "holder_inertia": _numbers("holder.density"),
    "fluted_part": _by_effect("fluted_part", 1e-4),
    "frequency_scale": _by_effect("frequency_scale", 1e-6),
    "joint_overhang_law": _several(*(_by_effect("joint_overhang_law", 1e-4, exponent_y=y) for y in (0.0, 1.0))),
    "spindle_mode": _by_effect("spindle_mode", 1e-4),
}
"""Columns of answers, to first order; those of which there are none here count as different."""
