"""Joints and point elements: invalid input, messages, and computed values."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from receptance import STEEL, Assembly, ColletJoint, GroundSpring, Part, PointJoint, PointMass, Segment

GOOD: dict[str, Any] = {"k_y": 1e8, "k_theta": 1e5, "k_ytheta": 1e6, "c_y": 10.0, "c_theta": 0.1, "loss_factor": 0.01}
QUANTITIES = ["k_y", "k_theta", "k_ytheta", "c_y", "c_theta", "c_ytheta", "loss_factor"]
UNITS = dict(zip(QUANTITIES, ["N/m", "N m/rad", "N/rad", "N s/m", "N m s/rad", "N s/rad", ""], strict=True))


@pytest.mark.parametrize("kind", [PointJoint, GroundSpring])
@pytest.mark.parametrize("quantity", QUANTITIES)
@pytest.mark.parametrize("value", [float("nan"), float("inf"), float("-inf")])
def test_numbers_must_be_finite(kind: type[PointJoint], quantity: str, value: float) -> None:
    with pytest.raises(ValueError, match=rf"{kind.__name__}: {quantity} is -?(nan|inf), expected a finite number"):
        kind(**{**GOOD, quantity: value})


@pytest.mark.parametrize("kind", [PointJoint, GroundSpring])
@pytest.mark.parametrize("quantity", [name for name in QUANTITIES if "ytheta" not in name])
def test_diagonals_must_not_be_negative(kind: type[PointJoint], quantity: str) -> None:
    unit = f" {UNITS[quantity]}" if UNITS[quantity] else ""
    with pytest.raises(ValueError, match=rf"{kind.__name__} 'joint': {quantity} is -2, expected zero or more{unit}"):
        kind(**{**GOOD, quantity: -2.0}, name="joint")


@pytest.mark.parametrize("kind", [PointJoint, GroundSpring])
@pytest.mark.parametrize("quantity", QUANTITIES)
@pytest.mark.parametrize("value", ["1e8", None, False, 1j, [1.0]])
def test_non_number_is_a_type_error(kind: type[PointJoint], quantity: str, value: object) -> None:
    if isinstance(value, list):
        value = [1.0, 2.0]
    with pytest.raises(TypeError, match=f"{kind.__name__}: {quantity} is "):
        kind(**{**GOOD, quantity: value})


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("coupling", "part"), [("k_ytheta", "real"), ("c_ytheta", "imaginary")])
def test_both_parts_must_be_semidefinite(coupling: str, part: str, sign: float) -> None:
    limit = np.sqrt(1e8 * 1e5) if coupling == "k_ytheta" else np.sqrt(10.0 * 0.1)
    with pytest.raises(
        ValueError, match=rf"{coupling} is .*sqrt\({coupling[0]}_y {coupling[0]}_theta\) = .*{part} part"
    ):
        PointJoint(**{**GOOD, coupling: sign * 1.001 * limit})
    assert getattr(PointJoint(**{**GOOD, coupling: sign * 0.999 * limit}), coupling) == sign * 0.999 * limit
    assert getattr(GroundSpring(**{**GOOD, coupling: sign * limit}), coupling) == sign * limit


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({}, "k_y and c_y are both zero"),
        ({"k_theta": 1e5}, "k_y and c_y are both zero, so the translation is free"),
    ],
)
def test_joint_without_stiffness_is_an_error(values: dict[str, float], words: str) -> None:
    with pytest.raises(ValueError, match=f"PointJoint 'clamp': {words}|{words}"):
        PointJoint(**values, name="clamp")


@pytest.mark.parametrize("more", [{}, {"loss_factor": 0.1}])
def test_joint_with_a_free_rotation_is_an_error_in_bending(more: dict[str, float]) -> None:
    bar = [Segment(length=0.1, outer_diameter=0.02, material=STEEL)]
    joint = PointJoint(k_y=1e8, **more, name="clamp")
    with pytest.raises(
        ValueError, match="PointJoint 'clamp': k_theta and c_theta are both zero, so the rotation is free"
    ):
        Assembly([Part(bar, name="tool"), joint, Part(bar, name="holder")])
    with pytest.raises(ValueError, match="give k_theta or c_theta"):
        ColletJoint(inner=joint, outer=PointJoint(k_y=1e8, k_theta=1e5), mass=0.1)


def test_a_joint_may_be_held_by_dashpots() -> None:
    joint = PointJoint(c_y=10.0, c_theta=0.1)
    np.testing.assert_allclose(joint.stiffness([10.0])[0], 20j * np.pi * np.diag([10.0, 0.1]))


def test_stiffness_follows_the_equation() -> None:
    f = np.array([10.0, 200.0])
    k = PointJoint(**GOOD, c_ytheta=0.5).stiffness(f)
    w = 2 * np.pi * f
    assert k.shape == (2, 2, 2)
    np.testing.assert_allclose(k[:, 0, 0], 1e8 * (1 + 0.01j) + 1j * w * 10.0)
    np.testing.assert_allclose(k[:, 1, 1], 1e5 * (1 + 0.01j) + 1j * w * 0.1)
    np.testing.assert_allclose(k[:, 0, 1], 1e6 * (1 + 0.01j) + 1j * w * 0.5)
    np.testing.assert_array_equal(k[:, 0, 1], k[:, 1, 0])
    assert GroundSpring(**GOOD).stiffness([1.0]).shape == (1, 2, 2)
    with pytest.raises(ValueError, match="not ascending"):
        PointJoint(**GOOD).stiffness([2.0, 1.0])


def test_a_moved_joint() -> None:
    joint = PointJoint(**GOOD, c_ytheta=0.5, name="joint")
    moved = joint.moved(0.02)
    assert moved.k_ytheta == pytest.approx(1e6 + 0.02 * 1e8)
    assert moved.k_theta == pytest.approx(1e5 + 2 * 0.02 * 1e6 + 0.02**2 * 1e8)
    assert moved.c_ytheta == pytest.approx(0.5 + 0.02 * 10.0)
    assert moved.c_theta == pytest.approx(0.1 + 2 * 0.02 * 0.5 + 0.02**2 * 10.0)
    assert (moved.k_y, moved.c_y, moved.loss_factor, moved.name) == (1e8, 10.0, 0.01, "joint")
    with pytest.raises(ValueError, match="PointJoint 'joint': distance is nan, expected a finite number of m"):
        joint.moved(float("nan"))
    with pytest.raises(TypeError, match="distance is '1 mm'"):
        joint.moved("1 mm")  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("quantity", "value", "words"),
    [
        ("mass", -1.0, "mass is -1, expected zero or more kg"),
        ("mass", float("nan"), "mass is nan"),
        ("inertia", -1e-9, "inertia is -1e-09, expected zero or more kg m\\^2"),
        ("inertia", float("inf"), "inertia is inf"),
    ],
)
def test_masses_without_meaning_are_named(quantity: str, value: float, words: str) -> None:
    with pytest.raises(ValueError, match=f"PointMass: {words}"):
        PointMass(**{"mass": 1.0, "inertia": 0.0, quantity: value})
    with pytest.raises(ValueError, match=f"PointMass 'sensor': {words}"):
        PointMass(**{"mass": 1.0, "inertia": 0.0, quantity: value}, name="sensor")
    with pytest.raises(TypeError, match=f"PointMass: {quantity} is '1 g'"):
        PointMass(**{"mass": 1.0, "inertia": 0.0, quantity: "1 g"})
