"""Assemblies: invalid input and its messages; names, positions, addresses."""

from __future__ import annotations

import copy
import pickle
from typing import Any

import numpy as np
import pytest

from properties.test_invariance import rich
from receptance import (
    CARBIDE,
    STEEL,
    Assembly,
    Coordinate,
    GroundSpring,
    Part,
    PointJoint,
    PointMass,
    ReceptanceError,
    ResonanceError,
    Segment,
    SingularInterfaceError,
)

BAR = Segment(length=0.1, outer_diameter=0.02, material=STEEL)
TOOL, HOLDER = Part([BAR], name="tool"), Part([BAR, BAR], name="holder")
JOINT = PointJoint(k_y=1e8, k_theta=1e5, name="joint")
PAIR = Assembly([TOOL, JOINT, HOLDER])


@pytest.mark.parametrize(
    ("chain", "error", "words"),
    [
        ([TOOL, JOINT], ValueError, "must begin and end with a Part"),
        (
            [TOOL, JOINT, PointJoint(k_y=1.0, k_theta=1.0), HOLDER],
            ValueError,
            r"chain\[1\] and chain\[2\] are both joints",
        ),
        ([TOOL, BAR], TypeError, r"chain\[1\] is Segment.*, expected a Part or one of PointJoint"),
        ([TOOL, TOOL], ValueError, "the name 'tool' is given to two elements"),
        ([Part([BAR], name="my tool")], ValueError, "the name 'my tool' must be one word"),
    ],
)
def test_invalid_chains(chain: Any, error: type[Exception], words: str) -> None:
    with pytest.raises(error, match=words):
        Assembly(chain)


@pytest.mark.parametrize(
    ("attachments", "error", "words"),
    [
        ([JOINT], TypeError, r"attachments\[0\] is PointJoint.*, expected a PointMass, a GroundSpring or a Resonator"),
        (
            [PointMass(mass=1.0, part="spindle")],
            ValueError,
            "attachment 'mass': there is no part 'spindle'; the parts are 'tool', 'holder'",
        ),
        (
            [PointMass(mass=1.0, part="tool", position=0.11)],
            ValueError,
            "position is 0.11 m, expected from 0 to the length 0.1 m",
        ),
        ([PointMass(mass=1.0, part="tool", position=float("nan"))], ValueError, "position is nan"),
        ([PointMass(mass=1.0, part="tool", position="start")], TypeError, "position is 'start'"),  # type: ignore[arg-type]
        ([PointMass(mass=1.0, name="joint")], ValueError, "the name 'joint' is given to two elements"),
    ],
)
def test_invalid_attachment_positions(attachments: Any, error: type[Exception], words: str) -> None:
    with pytest.raises(error, match=words):
        Assembly([TOOL, JOINT, HOLDER], attachments)


@pytest.mark.parametrize(
    ("point", "error", "words"),
    [
        (lambda: Coordinate("spindle"), ValueError, "coordinate: there is no part 'spindle'"),
        (lambda: Coordinate("tool", 0.2), ValueError, "coordinate: position is 0.2 m"),
        (lambda: Coordinate("tool", 0.0, "x"), ValueError, "direction is 'x', expected one of y, theta"),  # type: ignore[arg-type]
        (lambda: "tip", TypeError, "coordinate.* 't.*expected .*Coordinate"),
        (lambda: [], ValueError, "coordinates is empty, expected at least one Coordinate"),
        (lambda: [Coordinate(), 3], TypeError, r"coordinates\[1\] is 3"),
    ],
)
def test_invalid_coordinates(point: Any, error: type[Exception], words: str) -> None:
    with pytest.raises(error, match=words):
        PAIR.receptance([100.0], response=point())
    with pytest.raises(error, match=words):
        PAIR.receptance([100.0], excitation=point())


@pytest.mark.parametrize("lines", [[], [0.0], [-1.0], [2.0, 1.0], [1.0, 1.0], [np.nan], [np.inf], [[1.0]]], ids=str)
def test_frequencies_are_checked(lines: Any) -> None:
    for call in (lambda: PAIR.receptance(lines), lambda: PAIR.derivatives(lines, ["joint.k_y"])):
        with pytest.raises(ValueError, match="frequency_hz"):
            call()


@pytest.mark.parametrize(
    ("address", "words"),
    [
        ("", "its first word must be one of tool, joint, holder"),
        ("tool.length", "a part has parameters such as"),
        ("tool.segment[1].length", r"the part has 1 segment\(s\), counted from 0"),
        ("tool.segment[0].colour", "a segment has length"),
        ("tool.segment[0].core.density", "the segment has no core"),
        ("tool.segment[0].core.length", "a segment has length, outer_diameter"),
        ("joint.k_x", "PointJoint has k_y, k_theta"),
    ],
)
def test_invalid_addresses(address: str, words: str) -> None:
    for call in (PAIR.get, lambda name: PAIR.replace({name: 1.0}), lambda name: PAIR.derivatives([1.0], [name]),
                 lambda name: PAIR.natural_frequency_derivatives(1e3, [name])):  # fmt: skip
        with pytest.raises(ValueError, match=words):
            call(address)


@pytest.mark.parametrize("address", rich().parameters)
def test_every_listed_address_can_be_read_and_replaced(address: str) -> None:
    assembly = rich()
    value = assembly.get(address)
    assert isinstance(value, float)
    assert assembly.replace({address: value}) == assembly
    if value > 0.0:
        changed = assembly.replace({address: 0.999 * value})
        assert changed != assembly
        assert changed.get(address) == 0.999 * value
        assert [name for name in assembly.parameters if changed.get(name) != assembly.get(name)] == [address]
        assert not np.array_equal(changed.receptance([1500.0]), assembly.receptance([1500.0]))


def test_shared_addresses_are_read_and_replaced_together() -> None:
    changed = PAIR.replace({"holder.segment[*].outer_diameter": 0.03, "joint.k_y": 2e8})
    assert [changed.get(f"holder.segment[{i}].outer_diameter") for i in (0, 1)] == [0.03, 0.03]
    assert changed.get("holder.segment[*].outer_diameter") == 0.03
    assert changed.get("tool.segment[0].outer_diameter") == 0.02
    assert changed.get("joint.k_y") == 2e8
    assert PAIR.get("joint.k_y") == 1e8
    uneven = changed.replace({"holder.segment[1].outer_diameter": 0.04})
    with pytest.raises(ValueError, match=r"different values in the segments: 0.03, 0.04"):
        uneven.get("holder.segment[*].outer_diameter")


def test_replaced_values_are_checked_together() -> None:
    with pytest.raises(ValueError, match="outer_diameter is -1"):
        PAIR.replace({"tool.segment[0].outer_diameter": -1.0})
    with pytest.raises(ValueError, match=r"joint.*k_y is nan"):
        PAIR.replace({"joint.k_y": float("nan")})
    with pytest.raises(ValueError, match=r"k_ytheta is 1e.07"):
        PAIR.replace({"joint.k_ytheta": 1e7})
    changed = PAIR.replace({"joint.k_ytheta": 1e7, "joint.k_theta": 1e7})
    assert changed.get("joint.k_ytheta") == 1e7
    both = PAIR.replace({"tool.segment[0].inner_diameter": 0.05, "tool.segment[0].outer_diameter": 0.06})
    assert both.get("tool.segment[0].inner_diameter") == 0.05


def test_unnamed_elements_are_numbered() -> None:
    part, joint = Part([BAR]), PointJoint(k_y=1e8, k_theta=1e5)
    assembly = Assembly(
        [part, joint, part, joint, part], [PointMass(mass=1.0), GroundSpring(k_y=1.0), PointMass(mass=2.0)]
    )
    assert list(assembly.elements) == ["part_0", "joint_0", "part_1", "joint_1", "part_2"]
    assert list(assembly.attachments) == ["mass_0", "ground", "mass_1"]
    assert list(Assembly([part, joint, TOOL]).elements) == ["part", "joint", "tool"]
    assert assembly.replace({"joint_1.k_y": 3.0}).get("joint_1.k_y") == 3.0


def test_one_part_is_an_assembly_and_positions_snap_to_steps() -> None:
    f = [100.0, 2000.0]
    alone = Assembly(HOLDER)
    assert alone == Assembly([HOLDER])
    ends = [alone.receptance(f, response=Coordinate("holder", position)) for position in ("end", HOLDER.length)]
    np.testing.assert_array_equal(*ends)
    step = alone.receptance(f, response=Coordinate("holder", 0.1))
    np.testing.assert_array_equal(step, alone.receptance(f, response=Coordinate("holder", 0.1 + 1e-13)))


def test_shapes_and_units_of_results() -> None:
    f = np.linspace(10.0, 20.0, 7)
    one, two = Coordinate(), [Coordinate(), Coordinate("holder", "end")]
    assert PAIR.receptance(f).shape == (7,)
    assert PAIR.receptance(f, response=two).shape == (7, 2, 1)
    assert PAIR.receptance(f, response=[one], excitation=[one]).shape == (7, 1, 1)
    assert PAIR.receptance(f).dtype == np.complex128
    h, slope = PAIR.derivatives(f, [], response=two, excitation=two)
    assert h.shape == (7, 2, 2)
    assert slope.shape == (7, 2, 2, 0)
    assert PAIR.derivatives(f, ["joint.k_y", "joint.k_y"])[1].shape == (7, 2)
    mass = Assembly(TOOL).receptance([1e-3]).real[0] * -((2 * np.pi * 1e-3) ** 2)
    # the effective mass at the end of a free uniform bar is a quarter of its mass, slightly more with rotary inertia
    assert 1 / mass == pytest.approx(TOOL.mass / 4, rel=0.05)


def test_a_singular_interface_names_the_joint() -> None:
    degenerate = PointJoint(k_y=1e8, k_theta=1e5, k_ytheta=np.sqrt(1e13), name="clamp")
    assembly = Assembly([TOOL, JOINT, HOLDER, degenerate, Part([BAR], name="spindle")])
    with pytest.raises(SingularInterfaceError, match="singular") as caught:
        assembly.receptance([100.0])
    assert isinstance(caught.value, ReceptanceError)
    # Users identify it by its name, not by its row in a table.
    assert "clamp" in str(caught.value)
    with pytest.raises(SingularInterfaceError, match="clamp"):
        assembly.natural_frequencies(1e3)
    held = assembly.replace({"clamp.c_theta": 1.0})
    assert np.isfinite(held.receptance([100.0])).all()


def test_an_infinite_receptance_is_a_resonance_error() -> None:
    with pytest.raises(ResonanceError, match=r"not finite at .* Hz \(line 0\)"):
        PAIR.receptance([1e-200, 100.0])
    with pytest.raises(ReceptanceError):
        PAIR.receptance([1e-200, 100.0])


def test_objects_are_equal_and_portable() -> None:
    assembly = rich()
    for again in (pickle.loads(pickle.dumps(assembly)), copy.copy(assembly), copy.deepcopy(assembly)):
        assert again == assembly
        assert again.parameters == assembly.parameters
        np.testing.assert_array_equal(again.receptance([100.0, 900.0]), assembly.receptance([100.0, 900.0]))
    assert assembly != PAIR
    assert assembly != "assembly"
    assert assembly.replace({"joint.k_y": 1.0, "joint.k_ytheta": 0.0}) != assembly
    for word in ("Assembly", "tool: Part", "joint: PointJoint", "holder", "sensor", "spindle"):
        assert word in repr(assembly)
    with pytest.raises(TypeError, match="unhashable"):
        hash(assembly)


def test_elements_are_copies() -> None:
    PAIR.elements.clear()
    PAIR.attachments["x"] = PointMass(mass=1.0)
    assert list(PAIR.elements) == ["tool", "joint", "holder"]
    assert PAIR.attachments == {}
    assert Coordinate("tool", "end") == pickle.loads(pickle.dumps(Coordinate("tool", "end")))
    assert CARBIDE.name == "carbide"


def test_parts_in_another_order_make_another_assembly() -> None:
    """Their names alone are the same: a spacer of 20 mm and one of 16 mm change places."""
    first, second = (
        Part([Segment(length=0.03, outer_diameter=size, material=STEEL)], name=name)
        for name, size in (("first", 0.02), ("second", 0.016))
    )
    one, other = Assembly([first, second]), Assembly([second, first])
    lines = np.linspace(100.0, 5000.0, 20)
    assert not np.allclose(one.receptance(lines), other.receptance(lines))
    assert one != other
    assert one == Assembly([first, second])
