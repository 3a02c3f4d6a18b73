"""A blank of 12 mm in a plain holder, and noisy measurements of it, for the tests of the diagnosis."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from receptance import (
    CARBIDE,
    STEEL,
    Assembly,
    GroundSpring,
    Material,
    Observation,
    Part,
    PointJoint,
    PointMass,
    Segment,
    Unknown,
)
from receptance.fit import Tolerance

JOINT = PointJoint(k_y=6e8, k_theta=1e5, c_y=300.0, c_theta=1.0, name="joint")
UNKNOWNS = [
    Unknown(address="joint.k_y", lower=1e6, upper=1e11),
    Unknown(address="joint.k_theta", lower=1e2, upper=1e8),
    Unknown(address="joint.c_y", lower=1e-1, upper=1e6),
    Unknown(address="joint.c_theta", lower=1e-4, upper=1e3),
]
STARTED = [
    Unknown(address=one.address, lower=one.lower, upper=one.upper, start=getattr(JOINT, one.address.split(".")[1]))
    for one in UNKNOWNS
]
TOLERANCES = [Tolerance(name="carbide", moves={"tool.segment[*].youngs_modulus": 0.005}, relative=True)]


def make_assembly(
    overhang: float, *points: GroundSpring | PointMass, material: Material = CARBIDE, joint: PointJoint = JOINT
) -> Assembly:
    tool = Part([Segment(length=overhang, outer_diameter=0.012, material=material)], name="tool")
    holder = Part([Segment(length=0.13, outer_diameter=0.045, material=STEEL)], name="holder")
    return Assembly([tool, joint, holder], points)


def observe(
    described: Assembly,
    lines: NDArray[np.float64],
    receptance: NDArray[np.complex128],
    rng: np.random.Generator,
    label: str,
    sd: float = 0.01,
) -> Observation:
    """Return a tip FRF of a described assembly, with noise in magnitude and phase."""
    noise = sd * (rng.normal(size=lines.size) + 1j * rng.normal(size=lines.size))
    values = receptance * np.exp(noise)
    return Observation(assembly=described, frequency_hz=lines, receptance=values, standard_deviation=sd, label=label)
