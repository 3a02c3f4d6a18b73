"""A tool in a holder, in a spindle or hanging free, for the tests of the next measurement."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from receptance import CARBIDE, STEEL, Assembly, GroundSpring, Observation, Part, PointJoint, Segment, Unknown
from receptance.fit import Tolerance

TRUE = {"joint.k_y": 2e8, "joint.k_theta": 6e4, "joint.c_y": 400.0, "joint.c_theta": 0.15}
BOUNDS = {
    "joint.k_y": (1e6, 1e11),
    "joint.k_theta": (1e3, 1e8),
    "joint.c_y": (50.0, 3e3),
    "joint.c_theta": (0.02, 1.0),
}
STEEL_WITH_LOSS = replace(STEEL, loss_factor=0.002)


def make_machine(overhang: float = 0.07, *, free: bool = False) -> Assembly:
    """Return tool, joint and holder, in a spindle on two bearings or free."""
    tool = Part([Segment(length=overhang, outer_diameter=0.012, material=CARBIDE)], name="tool")
    sections = [
        Segment(length=0.04, outer_diameter=0.035, material=STEEL_WITH_LOSS),
        Segment(length=0.06, outer_diameter=0.05, material=STEEL_WITH_LOSS),
    ]
    joint = PointJoint(**{name.split(".")[1]: value for name, value in TRUE.items()}, name="joint")
    chain = [tool, joint, Part(sections, name="holder")]
    if free:
        return Assembly(chain)
    spindle = Part([Segment(length=0.25, outer_diameter=0.07, material=STEEL_WITH_LOSS)], name="spindle")
    taper = PointJoint(k_y=5e8, k_theta=8e5, c_y=3000.0, c_theta=5.0, name="taper")
    bearings = [
        GroundSpring(k_y=k, c_y=2000.0, part="spindle", position=x, name=name)
        for name, k, x in (("front", 2e8, 0.05), ("rear", 1.5e8, 0.2))
    ]
    return Assembly([*chain, taper, spindle], bearings)


def unknowns(start: dict[str, float] | None = None) -> list[Unknown]:
    """Return the joint's stiffnesses and dashpots, starting at the truth by default."""
    values = TRUE | (start or {})
    return [
        Unknown(address=a, lower=low, upper=high, start=float(np.clip(values[a], low, high)))
        for a, (low, high) in BOUNDS.items()
    ]


def clamped(name: str) -> Tolerance:
    """Return the error of the overhang in one clamping."""
    return Tolerance(name=f"overhang {name}", moves={"tool.segment[0].length": 2e-4}, configurations=name)


def tolerances() -> list[Tolerance]:
    """Return the tolerances of the measurement in the machine."""
    return [
        Tolerance(name="carbide", moves={"tool.segment[*].youngs_modulus": 0.015}, relative=True),
        Tolerance(name="taper", moves={"taper.k_y": 0.1, "taper.k_theta": 0.1}, relative=True),
        clamped("machine"),
    ]


def measure(
    assembly: Assembly,
    lines: np.ndarray,
    sd: float,
    rng: np.random.Generator,
    name: str,
    described: Assembly | None = None,
    **places: object,
) -> Observation:
    """Return an FRF of an assembly with noise."""
    noise = sd * (rng.normal(size=lines.size) + 1j * rng.normal(size=lines.size))
    return Observation(
        assembly=described or assembly,
        frequency_hz=lines,
        receptance=assembly.receptance(lines, **places) * np.exp(noise),
        standard_deviation=sd,
        label=name,
        **places,
    )
