"""Limits that are known without the model: rigid and free joints, a rigid body, rods, similar structures."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from properties.strategies import assert_same, both_ends, first_mode, frequencies, logarithmic, parts, segments, springs
from receptance import Assembly, Coordinate, GroundSpring, Part, PointJoint, PointMass, Segment

FACTORS = st.floats(0.2, 5.0)


def matrix(assembly: Assembly, f: np.ndarray) -> np.ndarray:
    points = both_ends(assembly)
    return assembly.receptance(f, response=points, excitation=points)


@given(tool=parts(name="tool"), holder=parts(name="holder"), f=frequencies())
def test_an_infinitely_stiff_joint_is_a_rigid_connection(tool: Part, holder: Part, f: np.ndarray) -> None:
    rigid = matrix(Assembly([tool, holder]), f)
    whole = Part([*tool.segments, *holder.segments]).receptance(f)
    np.testing.assert_array_equal(rigid, whole)
    before = np.inf
    for exponent in (14, 18, 24):
        joint = PointJoint(k_y=10.0**exponent, k_theta=10.0 ** (exponent - 4), name="joint")
        found = matrix(Assembly([tool, joint, holder]), f)
        error = np.max(np.abs(found / rigid - 1.0))
        assert error <= before or error < 1e-9
        before = error
    assert_same(found, rigid, 1e-9)


@given(tool=parts(lossy=True, name="tool"), holder=parts(lossy=True, name="holder"), f=frequencies())
def test_a_very_soft_joint_leaves_the_tool_free(tool: Part, holder: Part, f: np.ndarray) -> None:
    joint = PointJoint(k_y=1e-13, k_theta=1e-17, name="joint")
    tip, end = [
        [Coordinate(name, x, way) for x in (0.0, "end") for way in ("y", "theta")] for name in ("tool", "holder")
    ]
    assembly = Assembly([tool, joint, holder])
    assert_same(assembly.receptance(f, response=tip, excitation=tip), tool.receptance(f), 1e-9)
    assert_same(assembly.receptance(f, response=end, excitation=end), holder.receptance(f), 1e-9)
    across = assembly.receptance(f, response=Coordinate("holder", "end"), excitation=Coordinate("tool"))
    assert np.all(np.abs(across) < 1e-9 * np.abs(tool.receptance(f)[:, 0, 0]))


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
    assert_same(part.receptance(f).real, expected[None], 1e-6, lever=part.length)


@given(part=parts(most=2), mass=logarithmic(1e-3, 1.0), inertia=logarithmic(1e-7, 1e-3), share=st.floats(0.0, 1.0))
def test_assembly_at_low_frequency_is_a_rigid_body(part: Part, mass: float, inertia: float, share: float) -> None:
    own, centre, own_inertia = rigid_body(part)
    place = share * part.length
    assembly = Assembly(
        [Part(part.segments, name="body")], [PointMass(mass=mass, inertia=inertia, part="body", position=place)]
    )
    f = np.array([1e-7 * first_mode(assembly)])
    total = own + mass
    middle = (own * centre + mass * place) / total
    about = own_inertia + own * (centre - middle) ** 2 + inertia + mass * (place - middle) ** 2
    expected = -(1 / total + middle**2 / about) / (2 * np.pi * f) ** 2
    np.testing.assert_allclose(assembly.receptance(f).real, expected, rtol=1e-6)


@given(part=parts(most=2), springs=springs(damped=True), share=logarithmic(1e-6, 1e-4))
def test_stiff_part_on_a_support_has_the_compliance_of_the_support(
    part: Part, springs: dict[str, float], share: float
) -> None:
    """Far below the first mode, the loaded end has the compliance of the support."""
    assembly = Assembly([Part(part.segments, name="body")], [GroundSpring(**springs, part="body", name="support")])
    f = share * first_mode(assembly)
    k = GroundSpring(**springs).stiffness([f])[0]
    points = both_ends(assembly)[:2]
    assert_same(assembly.receptance([f], response=points, excitation=points), np.linalg.inv(k)[None], 1e-5)


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


@given(tool=parts(name="tool"), holder=parts(name="holder"), joint=springs(), e=st.floats(-0.03, 0.03), f=frequencies())
def test_offset_joint_matches_explicit_coupling(
    tool: Part, holder: Part, joint: dict[str, float], e: float, f: np.ndarray
) -> None:
    """H = H11 - H12 (H22 + T^-1 K^-1 T^-T + H_holder)^-1 H21: the joint's compliance seen from e away."""
    here = PointJoint(**joint, name="joint")
    a, b = tool.receptance(f), holder.receptance(f)
    back = np.linalg.inv(np.array([[1.0, e], [0.0, 1.0]]))
    gap = a[:, 2:, 2:] + back @ np.linalg.inv(here.stiffness(f)) @ back.T + b[:, :2, :2]
    expected = a[:, :2, :2] - a[:, :2, 2:] @ np.linalg.solve(gap, a[:, 2:, :2])
    points = both_ends(Assembly([tool, holder]))[:2]
    found = Assembly([tool, here.moved(e), holder]).receptance(f, response=points, excitation=points)
    condition = np.abs(a[:, :2, :2]).max(axis=(1, 2)) / np.abs(expected).max(axis=(1, 2))
    assume(np.all(condition < 1e3))
    assert_same(found, expected, 1e-6)


@given(part=parts(), f=frequencies())
def test_a_mirrored_part_swaps_its_ends(part: Part, f: np.ndarray) -> None:
    mirrored = Part(part.segments[::-1]).receptance(f)
    turn = np.array([[0, 0, 1, 0], [0, 0, 0, -1], [1, 0, 0, 0], [0, -1, 0, 0]])
    expected = turn @ part.receptance(f) @ turn.T
    size = np.sqrt(np.abs(np.einsum("nii,njj->nij", expected, expected)))
    assert np.all(np.abs(mirrored - expected) <= 1e-9 * np.maximum(np.abs(expected), 1e-3 * size))


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
    expected = part.receptance(f) * factor
    found = other.receptance(f * speed)
    # The scaled frequencies are rounded, so that next to a resonance the last digits differ.
    h = np.abs(expected)
    nearby = np.abs(part.receptance(f * (1 + 1e-9)) * factor - expected)
    diagonal = np.sqrt(np.einsum("nii,njj->nij", h, h))
    assert np.all(np.abs(found - expected) <= 1e-8 * np.maximum(h, 1e-3 * diagonal) + 1e-4 * nearby)
    upper = 3.0 * first_mode(part)
    np.testing.assert_allclose(
        other.natural_frequencies(upper * speed), part.natural_frequencies(upper) * speed, rtol=1e-9
    )


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
    for stiffness, weight, found in (
        (rigidity, mass, part.axial_receptance(f)),
        (twist, inertia, part.torsional_receptance(f)),
    ):
        b = w * np.sqrt(weight / stiffness + 0j)
        same = -1 / (b * stiffness * np.tan(b * segment.length))
        cross = -1 / (b * stiffness * np.sin(b * segment.length))
        near = np.abs(np.cos(b * segment.length))
        expected = np.array([[same, cross], [cross, same]]).transpose(2, 0, 1)
        assume(np.all(near > 1e-3) and np.all(np.abs(np.sin(b * segment.length)) > 1e-9))
        np.testing.assert_allclose(found, expected, rtol=1e-8)
