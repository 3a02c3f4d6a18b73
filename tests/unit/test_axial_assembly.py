"""Axial assemblies, and ground springs that are shared out over a length."""

from __future__ import annotations

import numpy as np
import pytest

from receptance import (
    STEEL,
    Assembly,
    Coordinate,
    GroundSpring,
    Observation,
    Part,
    PointJoint,
    PointMass,
    Section,
    Segment,
    SpreadJoint,
    Unknown,
    identify,
)

ROD = Part(
    [
        Segment(length=0.06, outer_diameter=0.1, material=STEEL),
        Segment(length=0.1, outer_diameter=0.05, material=STEEL),
    ],
    name="rod",
)


def held(**changes: float) -> Assembly:
    spring = GroundSpring(k_y=4e9, c_y=1500.0, position=0.06, length=0.1, points=10, name="taper")
    return Assembly(
        [ROD], [spring, PointMass(mass=0.3, part="rod", position="end", name="stud")], motion="axial"
    ).replace(changes)


def test_uniform_rod_on_a_spring() -> None:
    """A rod of wave speed c on a spring k at one end: E A q tan(q L) = k with q = w / c."""
    length, diameter, k = 0.2, 0.03, 1e8
    rod = Part([Segment(length=length, outer_diameter=diameter, material=STEEL)], name="rod")
    found = Assembly([rod], [GroundSpring(k_y=k, position="end")], motion="axial").natural_frequencies(4e4)
    q = 2.0 * np.pi * found / np.sqrt(STEEL.youngs_modulus / STEEL.density)
    stiffness = STEEL.youngs_modulus * np.pi / 4.0 * diameter**2 * q * np.tan(q * length)
    assert len(found) == 4
    assert stiffness == pytest.approx(k, rel=1e-8)


def test_a_joint_of_rods_needs_no_rotational_stiffness() -> None:
    """Two nearly rigid rods of mass m on one spring k: w^2 = 2 k / m."""
    bar = [Segment(length=0.02, outer_diameter=0.03, material=STEEL)]
    joint = PointJoint(k_y=9106.0, name="joint")
    pair = Assembly([Part(bar, name="tool"), joint, Part(bar, name="holder")], motion="axial")
    mass = STEEL.density * 0.02 * np.pi / 4.0 * 0.03**2
    expected = np.sqrt(2.0 * joint.k_y / mass) / (2.0 * np.pi)
    np.testing.assert_allclose(pair.natural_frequencies(1e3), [expected], rtol=1e-5)


def test_a_rod_on_a_spring_is_fitted() -> None:
    """Its receptance in closed form, (k sin + E A q cos) / (k cos - E A q sin) / (E A q) at q L, and its modes."""
    length, diameter, k = 0.2, 0.03, 1e8 * (1.0 + 0.02j)
    rod = Part([Segment(length=length, outer_diameter=diameter, material=STEEL)], name="rod")
    start = Assembly([rod], [GroundSpring(k_y=3e7, loss_factor=0.01, position="end", name="seat")], motion="axial")
    lines = np.linspace(100.0, 20e3, 150)
    q = 2.0 * np.pi * lines * np.sqrt(STEEL.density / STEEL.youngs_modulus)
    wave = STEEL.youngs_modulus * np.pi / 4.0 * diameter**2 * q
    sine, cosine = np.sin(q * length), np.cos(q * length)
    h = (k * sine + wave * cosine) / (k * cosine - wave * sine) / wave
    modes = start.replace({"seat.k_y": k.real}).natural_frequencies(2e4)
    data = [
        Observation(assembly=start, frequency_hz=lines, receptance=h, standard_deviation=0.01),
        Observation.from_modes(assembly=start, frequency_hz=modes, standard_deviation_hz=1.0),
    ]
    unknowns = [
        Unknown(address="seat.k_y", lower=1e7, upper=1e9),
        Unknown(address="seat.loss_factor", lower=1e-3, upper=0.3),
    ]
    found = identify(data, unknowns, starts=6, seed=3)
    assert found.values["seat.k_y"] == pytest.approx(k.real, rel=1e-8)
    assert found.values["seat.loss_factor"] == pytest.approx(0.02, rel=1e-7)


def test_derivatives_and_frequencies_against_differences() -> None:
    lines = np.array([900.0, 4700.0, 15e3]) * (1.0 - 0.01j)
    addresses = ["taper.k_y", "taper.c_y", "stud.mass", "rod.segment[1].youngs_modulus", "rod.segment[0].length"]
    assembly = held()
    _, slope = assembly.derivatives(lines, addresses)
    _, of_modes = assembly.natural_frequency_derivatives(3e4, addresses)
    for i, address in enumerate(addresses):
        step = 1e-5 * assembly.get(address)
        up, down = (held(**{address: assembly.get(address) + sign * step}) for sign in (1.0, -1.0))
        np.testing.assert_allclose((up.receptance(lines) - down.receptance(lines)) / (2 * step), slope[:, i], rtol=1e-6)
        modes = (up.natural_frequencies(3e4) - down.natural_frequencies(3e4)) / (2 * step)
        np.testing.assert_allclose(modes, of_modes[:, i], rtol=1e-5, atol=1e-7 * np.abs(of_modes[:, i]).max())


def test_spread_spring_equals_its_point_springs() -> None:
    """In bending as well: the whole is shared out, losses are not."""
    lines = np.linspace(100.0, 9e3, 20)
    whole = GroundSpring(k_y=3e8, k_theta=2e4, c_y=200.0, loss_factor=0.02, position=0.02, length=0.03, points=3)
    places = (0.025, 0.035, 0.045)
    parts = [GroundSpring(k_y=1e8, k_theta=2e4 / 3, c_y=200.0 / 3, loss_factor=0.02, position=x) for x in places]
    assert whole.offsets == pytest.approx((0.005, 0.015, 0.025))
    np.testing.assert_allclose(
        Assembly([ROD], [whole]).receptance(lines), Assembly([ROD], parts).receptance(lines), rtol=1e-9
    )


def test_weights_share_a_spring_out() -> None:
    lines = np.linspace(100.0, 9e3, 20)
    whole = GroundSpring(k_y=6e8, c_y=60.0, position=0.02, length=0.03, weights=(1.0, 2.0, 3.0), name="held")
    shares = ((0.025, 1 / 6), (0.035, 2 / 6), (0.045, 3 / 6))
    parts = [GroundSpring(k_y=6e8 * share, c_y=60.0 * share, position=x) for x, share in shares]
    assembly = Assembly([ROD], [whole])
    assert whole.points == 3
    np.testing.assert_allclose(assembly.receptance(lines), Assembly([ROD], parts).receptance(lines), rtol=1e-9)
    _, slope = assembly.derivatives(lines * (1.0 - 0.01j), ["held.k_y"])
    up, down = (assembly.replace({"held.k_y": 6e8 * factor}) for factor in (1.00001, 0.99999))
    change = up.receptance(lines * (1.0 - 0.01j)) - down.receptance(lines * (1.0 - 0.01j))
    np.testing.assert_allclose(change / 1.2e4, slope[:, 0], rtol=1e-5)
    with pytest.raises(ValueError, match=r"weights\[1\] is -1"):
        GroundSpring(k_y=1.0, length=0.1, weights=(1.0, -1.0))
    with pytest.raises(ValueError, match="weights are all zero"):
        GroundSpring(k_y=1.0, length=0.1, weights=(0.0, 0.0))


def test_mistakes() -> None:
    with pytest.raises(ValueError, match="motion is 'sideways', expected one of bending, axial"):
        Assembly([ROD], motion="sideways")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="expected 'y' in axial motion"):
        held().receptance([100.0], response=Coordinate(direction="theta"))
    with pytest.raises(ValueError, match=r"position is 0\.165 m"):
        Assembly([ROD], [GroundSpring(k_y=1.0, position=0.1, length=0.08, points=8)])
    with pytest.raises(ValueError, match="points is 0"):
        GroundSpring(k_y=1.0, points=0)
    with pytest.raises(ValueError, match="expected a position before the end"):
        GroundSpring(k_y=1.0, position="end", length=0.1)
    joint = SpreadJoint(
        length=0.04,
        shank=Section(outer_diameter=0.02, material=STEEL),
        sleeve=Section(outer_diameter=0.05, inner_diameter=0.02, material=STEEL),
        k_y=1e8,
        k_theta=1e4,
    )
    with pytest.raises(ValueError, match="SpreadJoint, which has no axial motion"):
        Assembly([ROD, joint, ROD], motion="axial")
    with pytest.raises(ValueError, match="PointJoint, which has no torsion motion"):
        Assembly([ROD, PointJoint(k_y=1e8), ROD], motion="torsion")
    with pytest.raises(ValueError, match="attachments have no torsion motion"):
        Assembly([ROD], [GroundSpring(k_y=1.0)], motion="torsion")
