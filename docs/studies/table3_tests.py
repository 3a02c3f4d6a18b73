"""The tests of `table3.py`: tool, holder and spindle, their tolerances, and simulated measurements. VIRTUAL."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

import er32_tables
import receptance as rc
from receptance.fit import Floor, Tolerance

DIAMETER_MM = 9.53
OVERHANGS_MM = (114.2, 62.6, 23.8)
"""Overhangs of this tool in tables 1 and 2; the first one is used in the machine."""
STEEL_LOSS, CARBIDE_LOSS = 0.002, 0.001
JOINT = ("joint.k_y", "joint.k_theta", "joint.c_y", "joint.c_theta")
STIFFNESSES = JOINT[:2]
TRUE_C_Y = 200.0
"""N s/m, assumed: the paper prints c_theta for the curve-fitted set, but no c_y."""
LARGEST_LOSS_FACTOR, TOOL_MODE_HZ = 0.12, 720.0
"""No metallic interface has a larger loss factor; with the mode of the tool it bounds the dampings."""
BANDS_HZ = {False: (100.0, 2000.0), True: (200.0, 12500.0)}
"""Band of a test in the machine and of a free-free test."""
STEP_HZ = 5.0

SETS = er32_tables.load().parameter_sets
TRUE_SET = next(one for one in SETS if one.name == "curve_fitted")
TRUTH: dict[str, float] = dict(
    zip(JOINT, (TRUE_SET.k_y, TRUE_SET.k_theta, TRUE_C_Y, TRUE_SET.c_theta or 0.0), strict=True)
)

TOLERANCES = (
    Tolerance(name="carbide E", moves={"tool.segment[0].youngs_modulus": 0.01}, relative=True),
    Tolerance(name="carbide density", moves={"tool.segment[0].density": 0.005}, relative=True),
    Tolerance(name="blank diameter", moves={"tool.segment[0].outer_diameter": 5e-6}),
    Tolerance(name="steel E", moves={"holder.segment[*].youngs_modulus": 0.01}, relative=True),
    Tolerance(name="holder turned", moves={"holder.segment[*].outer_diameter": 1e-4}),
    Tolerance(name="taper k_y", moves={"taper.k_y": 0.1}, relative=True),
    Tolerance(name="taper k_theta", moves={"taper.k_theta": 0.1}, relative=True),
    Tolerance(name="front bearing", moves={"front.k_y": 0.1}, relative=True),
    Tolerance(name="rear bearing", moves={"rear.k_y": 0.1}, relative=True),
)


@dataclass(frozen=True)
class Test:
    """A test of the tool at an overhang, free-free or in the machine."""

    name: str
    overhang_mm: float
    free: bool

    @property
    def assembly(self) -> rc.Assembly:
        """The assembly with the true joint."""
        return assembly(self.overhang_mm, free=self.free)


MACHINE = Test("in the machine", OVERHANGS_MM[0], free=False)
FREE = Test(f"free-free at {OVERHANGS_MM[0]:g} mm", OVERHANGS_MM[0], free=True)
MENU = (
    Test("the same once more", OVERHANGS_MM[0], free=False),
    *(Test(f"in the machine at {mm:g} mm", mm, free=False) for mm in OVERHANGS_MM[1:]),
    *(Test(f"free-free at {mm:g} mm", mm, free=True) for mm in OVERHANGS_MM),
)


@dataclass(frozen=True)
class Measuring:
    """Coherence and number of averages of every line of the simulated tests."""

    coherence: float = 0.98
    averages: int = 10

    def __post_init__(self) -> None:
        if not 0.0 < self.coherence < 1.0:
            raise ValueError(f"coherence is {self.coherence:g}, expected between 0 and 1")
        if self.averages < 2:
            raise ValueError(f"averages is {self.averages}, expected at least 2")

    @property
    def noise(self) -> float:
        """Standard deviation of real and imaginary part of the log response."""
        return float(np.sqrt((1.0 - self.coherence) / (2.0 * (self.averages - 1) * self.coherence)))


def assembly(overhang_mm: float, *, free: bool) -> rc.Assembly:
    """Return the tool in the holder with the true joint, free or in the simulated spindle."""
    own = er32_tables.assembly(DIAMETER_MM, overhang_mm).replace(
        {**TRUTH, "holder.segment[*].loss_factor": STEEL_LOSS, "tool.segment[0].loss_factor": CARBIDE_LOSS}
    )
    if free:
        return own
    steel = replace(er32_tables.parts()[1].segments[-1].material, loss_factor=STEEL_LOSS)
    shaft = [
        rc.Segment(length=length, outer_diameter=outer, inner_diameter=0.03, material=steel)
        for length, outer in ((0.08, 0.07), (0.25, 0.065))
    ]
    taper = rc.PointJoint(k_y=1.5e9, k_theta=2e6, loss_factor=0.02, name="taper")
    bearings = [
        rc.GroundSpring(k_y=3e8, k_theta=5e4, c_y=2e3, part="spindle", position=0.08, name="front"),
        rc.GroundSpring(k_y=2e8, c_y=2e3, part="spindle", position=0.30, name="rear"),
    ]
    return rc.Assembly([*own.elements.values(), taper, rc.Part(shaft, name="spindle")], bearings)


def damping_bounds() -> dict[str, tuple[float, float]]:
    """Return bounds of the dampings, from a thousandth of a per cent to the largest loss factor of the stiffness."""
    w = 2.0 * np.pi * TOOL_MODE_HZ
    return {
        c: (1e-5 * TRUTH[k] / w, LARGEST_LOSS_FACTOR * TRUTH[k] / w) for k, c in zip(JOINT[:2], JOINT[2:], strict=True)
    }


def unknowns(near: Mapping[str, float] | None = None) -> list[rc.Unknown]:
    """Return the joint within the range of table 3, its start near some values."""
    bounds = {"joint.k_y": (1e6, 1e13), "joint.k_theta": (1e2, 1e13), **damping_bounds()}
    return [
        rc.Unknown(address=a, lower=low, upper=high, start=None if near is None else float(np.clip(near[a], low, high)))
        for a, (low, high) in bounds.items()
    ]


def deviations_of(tolerance: Tolerance, own: rc.Assembly) -> dict[str, float]:
    """Return the parameters of an assembly that an error changes, with their standard deviations."""
    return {
        address: deviation
        for pattern, deviation in tolerance.moves.items()
        for address in own.parameters
        if address == pattern or re.sub(r"segment\[\d+\]", "segment[*]", address) == pattern
    }


def tolerances(tests: Mapping[str, rc.Assembly]) -> list[Tolerance]:
    """Return the errors of some tests; every clamping has an error of the overhang of its own."""
    shared = [one for one in TOLERANCES if any(deviations_of(one, own) for own in tests.values())]
    return shared + [
        Tolerance(name=f"overhang, {name}", moves={"tool.segment[0].length": 1e-4}, configurations=(name,))
        for name in tests
    ]


def measure(
    test: Test, measuring: Measuring, values: Mapping[str, float], random: np.random.Generator | None = None
) -> rc.Observation:
    """Simulate a measured tip response.

    Parameters
    ----------
    test : Test
        Name of the configuration, and assembly.
    measuring : Measuring
        Noise.
    values : mapping of str to float
        The joint by address, and errors by name of the tolerance in standard deviations (0 where absent).
    random : Generator, optional
        Source of noise; without it there is none, but the standard deviations are the same.
    """
    nominal = test.assembly
    true = nominal.replace({a: values[a] for a in JOINT})
    for tolerance in tolerances({test.name: nominal}):
        error = values.get(tolerance.name, 0.0)
        true = true.replace(
            {
                a: true.get(a) * np.exp(sd * error) if tolerance.relative else true.get(a) + sd * error
                for a, sd in deviations_of(tolerance, nominal).items()
            }
        )
    low, high = BANDS_HZ[test.free]
    lines = np.arange(low, high + 0.5 * STEP_HZ, STEP_HZ)
    response = true.receptance(lines)
    deviation = np.sqrt(measuring.noise**2 + Floor().variance(lines, response))
    if random is not None:
        scatter = random.standard_normal(lines.size) + 1j * random.standard_normal(lines.size)
        response = response * np.exp(deviation * scatter)
    return rc.Observation(
        assembly=nominal,
        frequency_hz=lines,
        receptance=response,
        standard_deviation=deviation,
        label=test.name,
        configuration=test.name,
    )
