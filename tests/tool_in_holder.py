"""A tool in a holder and its measurements, for the tests of identification."""

from dataclasses import replace

import numpy as np
import pytest

from receptance import CARBIDE, STEEL, Assembly, Part, PointJoint, Segment
from receptance.fit import Observation, Unknown

TRUE = {"joint.k_y": 6.3e8, "joint.k_theta": 1.0e5, "joint.c_y": 500.0, "joint.c_theta": 0.1}
STIFFNESSES = [
    Unknown(address="joint.k_y", lower=1e6, upper=1e11),
    Unknown(address="joint.k_theta", lower=1e2, upper=1e8),
]
DASHPOTS = [Unknown(address="joint.c_y", lower=1.0, upper=1e6), Unknown(address="joint.c_theta", lower=1e-4, upper=1e2)]
LINES = np.linspace(100.0, 15e3, 1200)


def make_assembly(overhang=0.0623, joint="joint", **changes):
    values = {address.split(".")[1]: value for address, value in TRUE.items()} | changes
    steel = replace(STEEL, loss_factor=0.002)
    tool = Part([Segment(length=overhang, outer_diameter=0.0127, material=CARBIDE)], name="tool")
    sections = [Segment(length=0.03, outer_diameter=d, material=steel) for d in (0.035, 0.047, 0.05, 0.042)]
    return Assembly([tool, PointJoint(**values, name=joint), Part(sections, name="holder")])


def simulate(assembly, lines=LINES, **options):
    places = {name: options[name] for name in ("response", "excitation") if name in options}
    return Observation(
        assembly=assembly, frequency_hz=lines, receptance=assembly.receptance(lines, **places), **options
    )


def simulate_modes(assembly, upper_hz=20e3, **options):
    return Observation.from_modes(assembly=assembly, frequency_hz=assembly.natural_frequencies(upper_hz), **options)


def assert_found(result, true, relative=1e-6):
    assert result.converged, result.advice
    assert list(result.values) == list(true)
    for address, value in true.items():
        assert result.values[address] == pytest.approx(value, rel=relative), address
