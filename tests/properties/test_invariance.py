"""Invariance under splitting of a segment, order of lines and requests, and number of threads."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from properties.strategies import assemblies, assert_same, both_ends, frequencies
from receptance import CARBIDE, STEEL, Assembly, Coordinate, GroundSpring, Part, PointJoint, PointMass, Segment

LINES = np.linspace(5.0, 9000.0, 2311)


def rich() -> Assembly:
    """Return an assembly with every element and losses."""
    steel = replace(STEEL, loss_factor=0.003)
    tool = Part(
        [
            Segment(length=0.03, outer_diameter=0.011, material=CARBIDE),
            Segment(length=0.032, outer_diameter=0.0127, inner_diameter=0.004, material=CARBIDE, shear="hutchinson"),
        ],
        name="tool",
    )
    holder = Part(
        [
            Segment(length=0.04, outer_diameter=0.045, inner_diameter=0.0127, material=steel, core=CARBIDE),
            Segment(length=0.09, outer_diameter=0.05, inner_diameter=0.02, material=steel),
        ],
        name="holder",
    )
    joint = PointJoint(k_y=6e8, k_theta=1e5, k_ytheta=1e6, c_y=30.0, c_theta=0.01, loss_factor=0.02, name="joint")
    points = [
        PointMass(mass=0.6e-3, inertia=1e-8, part="tool", position=0.011, name="sensor"),
        GroundSpring(k_y=2e8, k_theta=3e5, c_y=200.0, part="holder", position="end", name="spindle"),
    ]
    return Assembly([tool, joint, holder], points)


@given(assembly=assemblies(), f=frequencies(), share=st.floats(0.01, 0.99))
def test_internal_coordinates_do_not_change_other_receptances(assembly: Assembly, f: np.ndarray, share: float) -> None:
    tool = assembly.elements["tool"]
    assert isinstance(tool, Part)
    points = both_ends(assembly)
    inside = [*points, Coordinate("tool", share * tool.length)]
    plain = assembly.receptance(f, response=points, excitation=points)
    cut = assembly.receptance(f, response=inside, excitation=inside)[:, :4, :4]
    nearby = np.abs(assembly.receptance(f * (1 + 1e-9), response=points, excitation=points) - plain)
    diagonal = np.sqrt(np.abs(np.einsum("nii,njj->nij", plain, plain)))
    assert np.all(np.abs(cut - plain) <= 1e-9 * np.maximum(np.abs(plain), 1e-3 * diagonal) + 1e-4 * nearby)


@pytest.mark.parametrize(
    "parameters", [(), ("joint.k_y", "tool.segment[0].length", "holder.segment[*].youngs_modulus", "sensor.mass")]
)
def test_results_are_bitwise_independent_of_threads(parameters: tuple[str, ...]) -> None:
    assembly = rich()
    points = [*both_ends(assembly), Coordinate("tool", 0.02), Coordinate("holder", 0.0, "theta")]
    assert len(LINES) > 2000
    alone = assembly.derivatives(LINES, parameters, response=points, excitation=points, threads=1)
    for threads in (2, 3, 8):
        found = assembly.derivatives(LINES, parameters, response=points, excitation=points, threads=threads)
        np.testing.assert_array_equal(found[0], alone[0])
        np.testing.assert_array_equal(found[1], alone[1])
    part = assembly.elements["holder"]
    assert isinstance(part, Part)
    for motion in ("axial", "torsion"):
        rod = Assembly([part], motion=motion)
        np.testing.assert_array_equal(rod.receptance(LINES, threads=1), rod.receptance(LINES, threads=3))


@settings(max_examples=20)
@given(assembly=assemblies(), seed=st.integers(0, 2**32 - 1))
def test_lines_are_independent_of_each_other(assembly: Assembly, seed: int) -> None:
    """A line in a batch is that line alone, within rounding: blocks of lines share only their code."""
    rng = np.random.default_rng(seed)
    f = np.sort(np.exp(rng.uniform(np.log(10.0), np.log(2e4), 37)))
    points = both_ends(assembly)
    names = assembly.parameters[:6]
    batch, slopes = assembly.derivatives(f, names, response=points, excitation=points)
    for index in rng.choice(len(f), 5, replace=False):
        line = f[index : index + 1]
        one, slope = assembly.derivatives(line, names, response=points, excitation=points)
        nearby = np.abs(assembly.receptance(line * (1 + 1e-9), response=points, excitation=points) - one).max()
        assert_same(batch[index : index + 1], one, 1e-10 + 1e-5 * nearby / np.abs(one).max())
        size = np.abs(slope).max(axis=(0, 1, 2))
        excess = np.abs(slopes[index] - slope[0]) / np.where(size > 0.0, size, 1.0)
        assert np.all(excess <= 1e-8 + 1e-3 * nearby / np.abs(one).max())
