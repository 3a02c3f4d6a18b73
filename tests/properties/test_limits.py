"""Limits that are known without the model: a moved joint is a rigid offset, and rods have closed forms."""

from __future__ import annotations

import numpy as np
from hypothesis import assume, given
from hypothesis import strategies as st

from properties.strategies import frequencies, segments, springs
from receptance import Assembly, Coordinate, Part, PointJoint, Segment


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
