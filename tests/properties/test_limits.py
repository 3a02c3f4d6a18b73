"""Limits that are known without the model: rigid and free joints, a rigid body, rods, similar structures."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from properties.strategies import (
    assert_same,
    between_ends,
    both_ends,
    first_mode,
    frequencies,
    parts,
    segments,
    springs,
)
from receptance import Assembly, Coordinate, Part, PointJoint, Segment

FACTORS = st.floats(0.2, 5.0)


def matrix(assembly: Assembly, f: np.ndarray) -> np.ndarray:
    points = both_ends(assembly)
    return assembly.receptance(f, response=points, excitation=points)


@given(tool=parts(name="tool"), holder=parts(name="holder"), f=frequencies())
def test_an_infinitely_stiff_joint_is_a_rigid_connection(tool: Part, holder: Part, f: np.ndarray) -> None:
    rigid = matrix(Assembly([tool, holder]), f)
    whole = between_ends(Part([*tool.segments, *holder.segments]), f)
    np.testing.assert_array_equal(rigid, whole)
    before = np.inf
    for exponent in (14, 18, 24):
        joint = PointJoint(k_y=10.0**exponent, k_theta=10.0 ** (exponent - 4), name="joint")
        found = matrix(Assembly([tool, joint, holder]), f)
        error = np.max(np.abs(found / rigid - 1.0))
        assert error <= before or error < 1e-9
        before = error
    assert_same(found, rigid, 1e-9)


def rigid_body(part: Part) -> tuple[float, float, float]:
    """Return mass, place of the centre and inertia about it, from the dimensions."""
    mass = moment = second = start = 0.0
    for s in part.segments:
        layers = [(s.outer_diameter, s.inner_diameter, s.material)] + (
            [(s.inner_diameter, 0.0, s.core)] if s.core else []
        )
        for outer, inner, material in layers:
            own = material.density * np.pi / 4 * (outer**2 - inner**2) * s.length
            centre = start + s.length / 2
            mass += own
            moment += own * centre
            second += own * (s.length**2 / 12 + (outer**2 + inner**2) / 16 + centre**2)
        start += s.length
    return mass, moment / mass, second - moment**2 / mass


@given(part=parts())
def test_a_rigid_body_at_low_frequency(part: Part) -> None:
    # A thin stub on a heavy body bends under its own end's load far below the first mode of the whole.
    f = np.array([1e-7 * first_mode(part)])
    mass, centre, inertia = rigid_body(part)
    assert part.mass == pytest.approx(mass, rel=1e-12)
    arms = np.array([[1.0, 0.0 - centre], [0.0, 1.0], [1.0, part.length - centre], [0.0, 1.0]])
    expected = -arms @ np.diag([1 / mass, 1 / inertia]) @ arms.T / (2 * np.pi * f[0]) ** 2
    assert_same(between_ends(part, f).real, expected[None], 1e-6, lever=part.length)


@given(joint=springs(), e=st.floats(-0.1, 0.1), f=frequencies())
def test_a_moved_joint_is_a_rigid_offset(joint: dict[str, float], e: float, f: np.ndarray) -> None:
    here = PointJoint(**joint)
    t = np.array([[1.0, e], [0.0, 1.0]])
    np.testing.assert_allclose(
        here.moved(e).stiffness(f), t.T @ here.stiffness(f) @ t, rtol=1e-9, atol=1e-12 * here.k_theta
    )
    there = here.moved(e).moved(-e)
    size = here.k_theta + e * e * here.k_y
    np.testing.assert_allclose(there.stiffness(f).real, here.stiffness(f).real, rtol=1e-12, atol=1e-12 * size)
    assert here.moved(0.0) == here


def similar(s: Segment, *, size: float = 1.0, modulus: float = 1.0, density: float = 1.0) -> Segment:
    """Return a segment with every length, modulus and density multiplied."""
    change = [
        None if m is None else replace(m, youngs_modulus=m.youngs_modulus * modulus, density=m.density * density)
        for m in (s.material, s.core)
    ]
    return replace(
        s, length=s.length * size, outer_diameter=s.outer_diameter * size, inner_diameter=s.inner_diameter * size,
        material=change[0], core=change[1],
    )  # fmt: skip


@given(part=parts(), f=frequencies(), size=FACTORS, modulus=FACTORS, density=FACTORS)
def test_similar_parts_have_similar_receptances(
    part: Part, f: np.ndarray, size: float, modulus: float, density: float
) -> None:
    """Frequencies go with sqrt(E/rho)/size, y/F with 1/(E size), each rotation with one more 1/size."""
    other = Part([similar(s, size=size, modulus=modulus, density=density) for s in part.segments])
    speed = np.sqrt(modulus / density) / size
    power = np.array([0, 1, 0, 1])
    factor = size ** -(1.0 + power[:, None] + power) / modulus
    expected = between_ends(part, f) * factor
    found = between_ends(other, f * speed)
    # The scaled frequencies are rounded, so that next to a resonance the last digits differ.
    h = np.abs(expected)
    nearby = np.abs(between_ends(part, f * (1 + 1e-9)) * factor - expected)
    diagonal = np.sqrt(np.einsum("nii,njj->nij", h, h))
    assert np.all(np.abs(found - expected) <= 1e-8 * np.maximum(h, 1e-3 * diagonal) + 1e-4 * nearby)
    upper = 3.0 * first_mode(part)
    found, expected = (
        Assembly([model]).natural_frequencies(limit) for model, limit in ((other, upper * speed), (part, upper))
    )
    np.testing.assert_allclose(found, expected * speed, rtol=1e-9)


@given(segment=segments(), f=frequencies())
def test_rods_have_their_closed_forms(segment: Segment, f: np.ndarray) -> None:
    """-cot(b L)/(b E A) at the loaded end and -1/(b E A sin(b L)) at the other, b = w sqrt(m/(E A))."""
    part = Part([segment])
    w = 2 * np.pi * f
    layers = [(segment.outer_diameter, segment.inner_diameter, segment.material)]
    if segment.core:
        layers.append((segment.inner_diameter, 0.0, segment.core))
    rigidity = mass = twist = inertia = 0.0
    for outer, inner, material in layers:
        area, polar = np.pi / 4 * (outer**2 - inner**2), np.pi / 32 * (outer**4 - inner**4)
        loss = 1 + 1j * material.loss_factor
        rigidity += material.youngs_modulus * loss * area
        twist += material.shear_modulus * loss * polar
        mass += material.density * area
        inertia += material.density * polar
    ends = [Coordinate(), Coordinate(position="end")]
    for stiffness, weight, motion in ((rigidity, mass, "axial"), (twist, inertia, "torsion")):
        found = Assembly([part], motion=motion).receptance(f, response=ends, excitation=ends)
        b = w * np.sqrt(weight / stiffness + 0j)
        same = -1 / (b * stiffness * np.tan(b * segment.length))
        cross = -1 / (b * stiffness * np.sin(b * segment.length))
        near = np.abs(np.cos(b * segment.length))
        expected = np.array([[same, cross], [cross, same]]).transpose(2, 0, 1)
        assume(np.all(near > 1e-3) and np.all(np.abs(np.sin(b * segment.length)) > 1e-9))
        np.testing.assert_allclose(found, expected, rtol=1e-8)
