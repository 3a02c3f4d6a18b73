"""The joint spread along an insertion: public class."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from receptance import (
    CARBIDE,
    STEEL,
    Assembly,
    Coordinate,
    Part,
    PointJoint,
    Section,
    Segment,
    SingularInterfaceError,
    SpreadJoint,
)

SHANK = Section(outer_diameter=0.012, material=CARBIDE)
SLEEVE = Section(outer_diameter=0.04, inner_diameter=0.012, material=replace(STEEL, loss_factor=0.01))
TOOL = Part([Segment(length=0.05, outer_diameter=0.012, material=CARBIDE)], name="tool")
HOLDER = Part([Segment(length=0.08, outer_diameter=0.05, material=STEEL)], name="holder")
LINES = np.array([120.0, 900.0, 2500.0, 7000.0])
GOOD: dict[str, Any] = {
    "length": 0.04,
    "shank": SHANK,
    "sleeve": SLEEVE,
    "k_y": 5e8,
    "k_theta": 2e4,
    "c_y": 100.0,
    "c_theta": 0.05,
    "loss_factor": 0.02,
}


def make(**changes: Any) -> Assembly:
    return Assembly([TOOL, SpreadJoint(**{**GOOD, **changes}, name="joint"), HOLDER])


@pytest.mark.parametrize(("points", "slope"), [(None, 0.0), (5, 0.0), (4, -0.6)])
def test_every_parameter_has_its_derivative(points: int | None, slope: float) -> None:
    shank = Section(outer_diameter=0.012, inner_diameter=0.004, material=CARBIDE)
    assembly = make(points=points, slope=slope, shank=shank)
    names = [name for name in assembly.parameters if name.startswith("joint.")]
    assert {"joint.length", "joint.k_y", "joint.shank.outer_diameter", "joint.sleeve.youngs_modulus"} <= set(names)
    assert len(names) == 7 + 2 * 6
    ends = {"response": Coordinate("holder", "end", "y"), "excitation": Coordinate("tool", 0.0, "y")}
    for places in ({}, ends):
        h, slopes = assembly.derivatives(LINES, names, **places)
        np.testing.assert_array_equal(h, assembly.receptance(LINES, **places))
        for column, name in enumerate(names):
            value = assembly.get(name)
            if name == "joint.slope" and points is None:
                assert not slopes[:, column].any()  # a layer is uniform
                continue
            # a loss factor that is zero is moved by a share of one
            step = 1e-5 * (value or 1.0)
            down = value - step if value else 0.0
            sides = [assembly.replace({name: x}).receptance(LINES, **places) for x in (value + step, down)]
            expected = (sides[0] - sides[1]) / (value + step - down)
            # the difference of two receptances has an absolute error of rounding over the step
            allowed = (1e-6 if value else 1e-3) * np.abs(expected) + 1e-9 * np.abs(h) / abs(value or 1.0)
            assert np.all(np.abs(slopes[:, column] - expected) <= allowed), name


@pytest.mark.parametrize(
    "address", ["joint.shank", "joint.shank.length", "joint.bore.density", "joint.points", "joint.sleeve.core.density"]
)
def test_invalid_parameter_is_an_error(address: str) -> None:
    assembly = make()
    for call in (
        assembly.get,
        lambda name: assembly.replace({name: 1.0}),
        lambda name: assembly.derivatives(LINES, name),
    ):
        with pytest.raises(ValueError, match=r"there is no parameter .*SpreadJoint has length, shank.outer_diameter"):
            call(address)


@pytest.mark.parametrize(
    ("changes", "error", "words"),
    [
        ({"length": 0.0}, ValueError, "length is 0, expected more than zero m"),
        ({"shank": CARBIDE}, TypeError, "shank is Material.*, expected a Section"),
        ({"k_y": -1.0}, ValueError, "k_y is -1, expected zero or more N/m"),
        ({"k_y": 0.0, "c_y": 0.0}, ValueError, "k_y and c_y are both zero, so the translation is free"),
        ({"points": 1, "k_theta": 0.0, "c_theta": 0.0}, ValueError, "rotation about the one point is free"),
        ({"points": 2.0}, TypeError, "points is 2.0, expected a whole number"),
        ({"points": 4, "slope": -1.5}, ValueError, "slope is -1.5, expected"),
        ({"slope": 0.5}, ValueError, "slope is 0.5 and points is None"),
        ({"sleeve": replace(SLEEVE, core=CARBIDE)}, ValueError, "sleeve has a core, expected an open bore"),
        (
            {"sleeve": replace(SLEEVE, inner_diameter=0.01)},
            ValueError,
            "shank.outer_diameter is 0.012 m, expected at most",
        ),
    ],
)
def test_invalid_values_are_refused(changes: dict[str, Any], error: type[Exception], words: str) -> None:
    with pytest.raises(error, match=words):
        SpreadJoint(**{**GOOD, **changes}, name="joint")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"outer_diameter": 0.0}, "Section: outer_diameter is 0"),
        ({"inner_diameter": 0.5}, "Section: inner_diameter is 0.5 m, expected less than"),
        ({"core": STEEL}, "Section: core is given and inner_diameter is 0"),
        ({"shear": "none"}, "Section: shear is 'none'"),
    ],
)
def test_section_errors_describe_the_mistake(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        Section(**{"outer_diameter": 0.02, "material": STEEL, **changes})


def test_spread_joint_connects_two_parts() -> None:
    joint = SpreadJoint(**GOOD)
    with pytest.raises(ValueError, match="must begin and end with a Part"):
        Assembly([TOOL, joint])
    with pytest.raises(ValueError, match="both joints, expected a part between"):
        Assembly([TOOL, joint, PointJoint(k_y=1e8, k_theta=1e4), HOLDER])
    assert list(Assembly([TOOL, joint, HOLDER]).elements) == ["tool", "joint", "holder"]


def test_a_joint_that_only_dashpots_hold_has_no_modes() -> None:
    assembly = make(k_y=0.0)
    assert np.isfinite(assembly.receptance(LINES)).all()
    with pytest.raises(SingularInterfaceError, match="joint 'joint': the interface is singular"):
        assembly.natural_frequencies(1e4)


def test_spread_and_point_joints_in_one_assembly() -> None:
    """The point joint's reduction holds the overlap as it is."""
    spindle = Part([Segment(length=0.1, outer_diameter=0.06, material=STEEL)], name="spindle")
    taper = PointJoint(k_y=1e9, k_theta=1e6, name="taper")
    assembly = Assembly([TOOL, SpreadJoint(**GOOD, name="insertion"), HOLDER, taper, spindle])
    planes = assembly.reduced_to_joint("taper", LINES).planes()
    assert planes.shape == (16, LINES.size), "an overlap is no power series"
    np.testing.assert_allclose(planes[0] + 1j * planes[1], assembly.receptance(LINES), rtol=1e-9)
    with pytest.raises(ValueError, match="has no PointJoint 'insertion'"):
        assembly.reduced_to_joint("insertion", LINES)


def test_splitting_the_tool_leaves_results_unchanged() -> None:
    halves = Part([Segment(length=0.025, outer_diameter=0.012, material=CARBIDE)] * 2, name="tool")
    split = Assembly([halves, SpreadJoint(**GOOD, name="joint"), HOLDER])
    np.testing.assert_allclose(split.receptance(LINES), make().receptance(LINES), rtol=1e-10)
    np.testing.assert_allclose(split.natural_frequencies(2e4), make().natural_frequencies(2e4), rtol=1e-12)
