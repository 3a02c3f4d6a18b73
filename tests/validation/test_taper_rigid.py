"""The rigid holder of Xu et al. 2012 (seed 000): corrected matrices, both solutions, dampings, and their accuracy."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pytest

from receptance import STEEL, Assembly, Coordinate, GroundSpring, Part, Segment
from receptance.coupling import Body, RadialJoint, Shape, axial_from_mode, body_of, radial_from_modes

SEED = int(os.environ.get("RECEPTANCE_TEST_SEED", "20261121"))
CASES = 300


def draw(seed: int, damping: tuple[float, float] = (0.004, 0.018)) -> Iterator[tuple[RadialJoint, float]]:
    """Return joints and the relative differences of A1 K1 and A2 K2, zero at the double root."""
    random = np.random.default_rng(seed)
    print(f"seed {seed}")
    for _ in range(CASES):
        body = Body(mass=random.uniform(2.0, 8.0), inertia=random.uniform(0.005, 0.03))
        z1 = random.uniform(-0.02, 0.06)
        z2 = z1 - random.uniform(0.06, 0.14)
        k1, k2 = 10.0 ** random.uniform(8.3, 9.6, size=2)
        joint = RadialJoint(body=body, z1=z1, z2=z2, k_x1=k1, k_x2=k2)
        c = [2.0 * random.uniform(*damping) * k / (2 * np.pi * 3000.0) for k in (k1, k2)]
        apart = k1 * (1 / body.mass + z1**2 / body.inertia), k2 * (1 / body.mass + z2**2 / body.inertia)
        yield replace(joint, c_x1=c[0], c_x2=c[1]), abs(apart[0] - apart[1]) / sum(apart)


def receptance(joint: RadialJoint, lines: np.ndarray, response: float, excitation: float) -> np.ndarray:
    """Receptance in m/N between two places of the rigid body, from its matrices."""
    w = 2.0 * np.pi * lines[:, None, None]
    mass, damping, stiffness = joint.matrices()
    force = np.array([1.0, excitation])[:, None]
    motion = np.linalg.solve(stiffness + 1j * w * damping - w**2 * mass, force)
    return (motion[:, 0] + response * motion[:, 1])[:, 0]


def test_corrected_matrices_are_positive_definite_and_reciprocal() -> None:
    for joint, _ in draw(SEED):
        _, damping, stiffness = joint.matrices()
        assert np.array_equal(stiffness, stiffness.T)
        assert np.linalg.eigvalsh(stiffness)[0] > 0.0
        assert np.linalg.eigvalsh(damping)[0] > 0.0
        there = receptance(joint, np.array([800.0, 4100.0]), 0.05, -0.03)
        back = receptance(joint, np.array([800.0, 4100.0]), -0.03, 0.05)
        np.testing.assert_allclose(there, back, rtol=1e-9)


def test_modes_and_receptance_agree() -> None:
    """Poles of the state matrix are poles of the receptance."""
    for joint, _ in list(draw(SEED))[:50]:
        modes = joint.modes()
        lines = np.linspace(200.0, 9000.0, 40)
        total = np.zeros(lines.size, dtype=complex)
        mass, damping, _ = joint.matrices()
        for f, zeta, shape in zip(modes.frequency_hz, modes.damping_ratio, modes.shapes.T, strict=True):
            pole = 2 * np.pi * f * (-zeta + 1j * np.sqrt(1 - zeta**2))
            norm = shape @ (2.0 * pole * mass + damping) @ shape
            residue = (shape[0] + 0.05 * shape[1]) * (shape[0] - 0.03 * shape[1]) / norm
            s = 2j * np.pi * lines
            total += residue / (s - pole) + residue.conj() / (s - np.conj(pole))
        direct = receptance(joint, lines, 0.05, -0.03)
        np.testing.assert_allclose(total, direct, atol=1e-8 * np.abs(direct).max())


def test_the_forward_model_with_a_stiff_part_is_the_rigid_model() -> None:
    stiff = replace(STEEL, youngs_modulus=STEEL.youngs_modulus * 1e9)
    part = Part(
        [
            Segment(length=0.05, outer_diameter=0.1, inner_diameter=0.03, material=stiff),
            Segment(length=0.1, outer_diameter=0.055, material=stiff),
        ],
        name="holder",
    )
    body = body_of(part)
    places = (0.05, 0.15)
    joint = RadialJoint(
        body=body,
        z1=body.position(places[0]),
        z2=body.position(places[1]),
        k_x1=1.2e9,
        k_x2=9e8,
        c_x1=900.0,
        c_x2=500.0,
    )
    springs = [
        GroundSpring(k_y=k, c_y=c, position=x) for k, c, x in zip((1.2e9, 9e8), (900.0, 500.0), places, strict=True)
    ]
    lines = np.linspace(50.0, 8000.0, 60)
    there = Assembly([part], springs).receptance(
        lines, response=Coordinate(position=0.02), excitation=Coordinate(position="end")
    )
    rigid = receptance(joint, lines, body.position(0.02), body.position(0.15))
    np.testing.assert_allclose(there, rigid, rtol=1e-7)
    axial = Assembly([part], [GroundSpring(k_y=5e9, c_y=1500.0, position=0.05)], motion="axial").receptance(lines)
    w = 2.0 * np.pi * lines
    np.testing.assert_allclose(axial, 1.0 / (5e9 + 1j * w * 1500.0 - w**2 * body.mass), rtol=1e-7)


def test_body_follows_its_sections() -> None:
    """A hollow cylinder, L^2 / 12 + (D^2 + d^2) / 16, independent of splitting; a core adds its contribution."""
    whole = Segment(length=0.1, outer_diameter=0.08, inner_diameter=0.03, material=STEEL)
    body = body_of(Part([whole]))
    assert body.inertia == pytest.approx(whole.mass * (0.01 / 12 + (0.08**2 + 0.03**2) / 16), rel=1e-12)
    cut = body_of(Part([replace(whole, length=0.03), replace(whole, length=0.07)]))
    assert (cut.mass, cut.centre, cut.inertia) == pytest.approx((body.mass, body.centre, body.inertia), rel=1e-12)
    filled = body_of(Part([replace(whole, core=STEEL)]))
    solid = body_of(Part([replace(whole, inner_diameter=0.0)]))
    assert filled.inertia == pytest.approx(solid.inertia, rel=1e-12)


def test_stiffnesses_are_recovered_with_both_solutions() -> None:
    """From exact undamped eigenvalues, away from a double root, to 1e-9."""
    worst = 0.0
    for joint, apart in draw(SEED + 1):
        if apart < 0.05:
            continue
        f = joint.undamped_modes().frequency_hz
        found = radial_from_modes(joint.body, joint.z1, joint.z2, f)
        assert len(found.solutions) == 2
        errors = [abs(s.joint.k_x1 / joint.k_x1 - 1.0) + abs(s.joint.k_x2 / joint.k_x2 - 1.0) for s in found.solutions]
        worst = max(worst, min(errors))
        for other in found.solutions:
            np.testing.assert_allclose(other.joint.undamped_modes().frequency_hz, f, rtol=1e-11)
        ratios = joint.undamped_modes().ratio(0.1, -0.05)
        shape = Shape(first=0.1, second=-0.05, ratio=(complex(ratios[0]), complex(ratios[1])))
        chosen = radial_from_modes(joint.body, joint.z1, joint.z2, f, shape=shape)
        assert len(chosen.solutions) == 1
        assert chosen.solutions[0].joint.k_x1 == pytest.approx(joint.k_x1, rel=1e-9)
    print(f"worst relative error {worst:.1e}")
    assert worst < 1e-9


@pytest.mark.parametrize("damping", [(0.004, 0.018), (0.02, 0.07)])
def test_dampings(damping: tuple[float, float], summarise: Callable[[str, str, object], None]) -> None:
    """First order: an error of at most 5 zeta^2 of the larger damping; from complex eigenvalues: all four to 1e-9."""
    first, exact = 0.0, 0.0
    for joint, apart in draw(SEED + 2, damping):
        if apart < 0.2:
            continue
        modes = joint.modes()
        zeta = float(modes.damping_ratio.max())
        # Stiffness by the undamped equations, of the undamped frequencies; damping ratios as they are.
        undamped = radial_from_modes(
            joint.body, joint.z1, joint.z2, joint.undamped_modes().frequency_hz, modes.damping_ratio
        )
        best = min(undamped.solutions, key=lambda s: abs(s.joint.k_x1 / joint.k_x1 - 1.0))
        error = max(abs(best.joint.c_x1 - joint.c_x1), abs(best.joint.c_x2 - joint.c_x2)) / max(joint.c_x1, joint.c_x2)
        first = max(first, error / zeta**2)
        damped = radial_from_modes(joint.body, joint.z1, joint.z2, modes.frequency_hz, modes.damping_ratio)
        all_four = [s.exact for s in damped.solutions if s.exact is not None]
        names = ("k_x1", "k_x2", "c_x1", "c_x2")
        errors = [max(abs(getattr(one, n) / getattr(joint, n) - 1.0) for n in names) for one in all_four]
        exact = max(exact, min(errors))
    text = f"zeta {damping}: first order off by {first:.2f} zeta^2 at most, exact to {exact:.1e} (seed {SEED + 2})"
    summarise(f"dampings of the taper at {damping}", text, {"first_order_over_zeta_squared": first, "exact": exact})
    assert first < 5.0
    assert exact < 1e-9


@pytest.mark.slow
def test_no_real_joint_within_the_noise() -> None:
    """At the double root noise makes the discriminant negative in about half of the draws, as the note states."""
    body = Body(mass=4.5, inertia=0.01)
    z1, z2 = 0.02, -0.08
    k1 = 1e9
    k2 = k1 * (1 / body.mass + z1**2 / body.inertia) / (1 / body.mass + z2**2 / body.inertia)
    joint = RadialJoint(body=body, z1=z1, z2=z2, k_x1=k1, k_x2=k2)
    f = joint.undamped_modes().frequency_hz
    random = np.random.default_rng(SEED)
    error = 1e-3 * f
    none, held = 0, 0
    for _ in range(200):
        found = radial_from_modes(
            body, z1, z2, f + error * random.standard_normal(2), frequency_standard_error_hz=error
        )
        spans = found.within_noise
        if not found.solutions:
            none += 1
            assert found.discriminant < 0.0
            assert "no real joint" in found.statement
        else:
            spans = found.solutions[0].intervals
        held += bool(spans) and spans["k_x1"][0] <= k1 <= spans["k_x1"][1]
    print(f"seed {SEED}: no real joint in {none} of 200 draws, an interval holds the truth in {held}")
    assert 70 < none < 130
    # 0.01 quantiles of the binomial distribution with 200 draws of 0.95.
    assert 181 <= held <= 198
    # Frequencies that no rigid holder on these springs can have are not called noise.
    far = radial_from_modes(body, z1, z2, [f[0], f[0] * 1.02], frequency_standard_error_hz=[1.0, 1.0])
    assert far.solutions == ()
    assert far.within_noise == {}
    assert "not even within their noise" in far.statement
    assert "standard errors" in radial_from_modes(body, z1, z2, [f[0], f[0] * 1.02]).statement


@pytest.mark.slow
def test_intervals_cover_away_from_the_double_root() -> None:
    random = np.random.default_rng(SEED + 3)
    body = Body(mass=4.5, inertia=0.01)
    joint = RadialJoint(body=body, z1=0.02, z2=-0.08, k_x1=1e9, k_x2=9e8, c_x1=900.0, c_x2=500.0)
    modes = joint.modes()
    of_f, of_zeta = 5e-4 * modes.frequency_hz, 0.03 * modes.damping_ratio
    held = dict.fromkeys(("k_x1", "k_x2", "c_x1", "c_x2"), 0)
    for _ in range(200):
        found = radial_from_modes(
            body,
            joint.z1,
            joint.z2,
            modes.frequency_hz + of_f * random.standard_normal(2),
            modes.damping_ratio + of_zeta * random.standard_normal(2),
            frequency_standard_error_hz=of_f,
            damping_standard_error=of_zeta,
        )
        best = min(found.solutions, key=lambda s: abs(s.joint.k_x1 / joint.k_x1 - 1.0))
        for name, (low, high) in best.intervals.items():
            held[name] += low <= getattr(joint, name) <= high
    print(f"seed {SEED + 3}: held {held} of 200")
    # 0.01 quantiles of the binomial distribution with 200 draws of 0.95: 181 to 198.
    assert all(181 <= count <= 198 for count in held.values())


def test_axial_stiffness_and_damping() -> None:
    """Eqs. 14 and 15."""
    body = Body(mass=4.5, inertia=0.01)
    frequency = np.sqrt(4.9e9 / body.mass) / (2.0 * np.pi)
    damping = 1500.0 / (2.0 * np.sqrt(4.9e9 * body.mass))
    found = axial_from_mode(body, frequency, damping, frequency_standard_error_hz=5.0, damping_standard_error=1e-4)
    assert found.k_z1 == pytest.approx(4.9e9, rel=1e-12)
    assert found.c_z1 == pytest.approx(1500.0, rel=1e-12)
    low, high = found.intervals["k_z1"]
    assert (high - low) / 4.9e9 == pytest.approx(4 * 1.96 * 5.0 / frequency, rel=1e-3)


def test_mistakes() -> None:
    body = Body(mass=4.5, inertia=0.01)
    with pytest.raises(ValueError, match="expected two ascending frequencies"):
        radial_from_modes(body, 0.02, -0.08, [3000.0, 2000.0])
    with pytest.raises(ValueError, match="expected two positions"):
        radial_from_modes(body, 0.02, 0.02, [2000.0, 3000.0])
    with pytest.raises(ValueError, match="two positive finite numbers"):
        radial_from_modes(body, 0.02, -0.08, [2000.0])
    with pytest.raises(ValueError, match="k_x1 is 0"):
        RadialJoint(body=body, z1=0.02, z2=-0.08, k_x1=0.0, k_x2=1e9)
    with pytest.raises(ValueError, match="a mode is overdamped"):
        RadialJoint(body=body, z1=0.02, z2=-0.08, k_x1=1e9, k_x2=1e9, c_x1=1e7, c_x2=1e7).modes()
