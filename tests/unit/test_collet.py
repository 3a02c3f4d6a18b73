"""A collet: two springs in series with its mass between: public class."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from receptance import (
    CARBIDE,
    STEEL,
    Assembly,
    ColletJoint,
    Coordinate,
    Observation,
    Part,
    PointJoint,
    Segment,
    SingularInterfaceError,
    Unknown,
    identify,
)
from receptance.fit import profile_likelihoods

TOOL = Part([Segment(length=0.0623, outer_diameter=0.0127, material=CARBIDE)], name="tool")
HOLDER = Part([Segment(length=0.129, outer_diameter=0.045, material=STEEL)], name="holder")
INNER = PointJoint(k_y=9e8, k_theta=1.5e5, k_ytheta=2e6, c_y=30.0, c_theta=0.02, loss_factor=0.01)
OUTER = PointJoint(k_y=2.1e9, k_theta=3e5, k_ytheta=-4e6, c_y=60.0, c_theta=0.03, loss_factor=0.02)
LINES = np.linspace(50.0, 9000.0, 60)
ENDS = {"response": Coordinate("holder", "end", "y"), "excitation": Coordinate("tool", 0.0, "y")}


def make(**changes: Any) -> Assembly:
    given: dict[str, Any] = {"inner": INNER, "outer": OUTER, "mass": 0.15, "inertia": 2e-5, "name": "joint"}
    return Assembly([TOOL, ColletJoint(**{**given, **changes}), HOLDER])


@pytest.mark.parametrize("places", [{}, ENDS])
def test_without_mass_it_is_two_springs_in_series(places: dict[str, Coordinate]) -> None:
    """Eq. 15 for stiffnesses without coupling, for which one spring can stand."""
    inner, outer = PointJoint(k_y=9e8, k_theta=1.5e5), PointJoint(k_y=2.1e9, k_theta=3e5)
    series = {
        k: getattr(inner, k) * getattr(outer, k) / (getattr(inner, k) + getattr(outer, k)) for k in ("k_y", "k_theta")
    }
    both = make(inner=inner, outer=outer, mass=0.0, inertia=0.0)
    one = Assembly([TOOL, PointJoint(**series, name="joint"), HOLDER])
    np.testing.assert_allclose(both.receptance(LINES, **places), one.receptance(LINES, **places), rtol=1e-12)
    np.testing.assert_allclose(both.natural_frequencies(20e3), one.natural_frequencies(20e3), rtol=1e-12)
    expected = np.diag([series["k_y"], series["k_theta"]])
    np.testing.assert_allclose(ColletJoint(inner=inner, outer=outer).stiffness([700.0])[0], expected, rtol=1e-12)


def test_full_lossy_springs_in_series_line_by_line() -> None:
    """The complex 2 x 2 stiffness of both, put where one point joint of that stiffness at that frequency would be."""
    collet = ColletJoint(inner=INNER, outer=OUTER)
    for f in (60.0, 900.0, 2600.0, 7000.0):
        stiffness = collet.stiffness([f])[0]
        compliance = np.linalg.inv(INNER.stiffness([f])[0]) + np.linalg.inv(OUTER.stiffness([f])[0])
        np.testing.assert_allclose(stiffness, np.linalg.inv(compliance), rtol=1e-12)
        w = 2.0 * np.pi * f
        k, c = stiffness.real, stiffness.imag / w
        point = PointJoint(
            k_y=k[0, 0], k_theta=k[1, 1], k_ytheta=k[0, 1], c_y=c[0, 0], c_theta=c[1, 1], c_ytheta=c[0, 1]
        )
        one = Assembly([TOOL, point, HOLDER])
        np.testing.assert_allclose(make(mass=0.0, inertia=0.0).receptance([f]), one.receptance([f]), rtol=1e-11)


def test_its_mass_is_that_of_a_short_rigid_part() -> None:
    """A part short, stiff and heavy, with the same mass and inertia, comes to it as its length goes to zero."""
    diameter, errors = 0.03, []
    for length in (1e-4, 1e-5):
        stiff = replace(STEEL, youngs_modulus=1e17, density=300.0 / length, loss_factor=0.0)
        body = Part([Segment(length=length, outer_diameter=diameter, material=stiff)], name="body")
        mass = 300.0 * np.pi / 4 * diameter**2
        point = make(mass=mass, inertia=mass * (diameter**2 / 16 + length**2 / 12))
        expected = Assembly([TOOL, INNER, body, OUTER, HOLDER]).natural_frequencies(15e3)
        errors.append(np.max(np.abs(point.natural_frequencies(15e3) / expected - 1.0)))
    assert errors[1] < 5e-5
    assert errors[0] / errors[1] == pytest.approx(10.0, rel=0.05)
    without = make(mass=0.0, inertia=0.0)
    assert abs(point.natural_frequencies(15e3)[0] / without.natural_frequencies(15e3)[0] - 1.0) > 0.01


def test_every_parameter_has_its_derivative() -> None:
    assembly = make()
    names = [name for name in assembly.parameters if name.startswith("joint.")]
    assert set(names) == {
        *(f"joint.{which}.{field}" for which in ("inner", "outer") for field in PointJoint.columns_of),
        "joint.mass",
        "joint.inertia",
    }
    for places in ({}, ENDS):
        h, slope = assembly.derivatives(LINES, names, **places)
        for column, name in enumerate(names):
            value = assembly.get(name)
            step = 1e-5 * value if value else 1e-3
            sides = [assembly.replace({name: x}).receptance(LINES, **places) for x in (value + step, value - step)]
            expected = (sides[0] - sides[1]) / (2.0 * step)
            allowed = 1e-6 * np.abs(expected).max() + 1e-9 * np.abs(h).max() / abs(value or 1.0)
            assert np.max(np.abs(slope[:, column] - expected)) <= allowed, name
    found, slope = assembly.natural_frequency_derivatives(15e3, names)
    for column, name in enumerate(names):
        value = assembly.get(name)
        if "k_" in name or "mass" in name or "inertia" in name:
            step = 1e-5 * value
            up, down = (assembly.replace({name: x}).natural_frequencies(15e3) for x in (value + step, value - step))
            np.testing.assert_allclose(
                slope[:, column], (up - down) / (2 * step), rtol=1e-4, atol=1e-6 * found[0] / abs(value)
            )
        else:
            np.testing.assert_array_equal(slope[:, column], 0.0)


def test_errors_name_the_mistake() -> None:
    with pytest.raises(TypeError, match=r"ColletJoint 'joint': inner is 3, expected a PointJoint"):
        make(inner=3)
    with pytest.raises(ValueError, match=r"ColletJoint 'joint': mass is -1, expected zero or more kg"):
        make(mass=-1.0)
    with pytest.raises(ValueError, match=r"no parameter 'joint.k_y'; ColletJoint has inner.k_y, inner.k_theta"):
        make().get("joint.k_y")
    with pytest.raises(ValueError, match=r"no parameter 'joint.middle.k_y'"):
        make().replace({"joint.middle.k_y": 1.0})
    loose = make(outer=PointJoint(k_y=1e8, k_theta=1e5, k_ytheta=np.sqrt(1e13)))
    with pytest.raises(SingularInterfaceError, match=r"joint 'joint\.outer'"):
        loose.natural_frequencies(5e3)
    with pytest.raises(ValueError, match="into one PointJoint or a ColletJoint"):
        Assembly([TOOL, INNER, OUTER, HOLDER])


def test_springs_are_undetermined_from_one_massless_assembly() -> None:
    """Only their series is observable, so the data bound each from below only, as the note states."""
    inner, outer = PointJoint(k_y=1e10, k_theta=3e5), PointJoint(k_y=1e10, k_theta=2e5)
    light = make(inner=inner, outer=outer, mass=0.0, inertia=0.0)
    modes = light.natural_frequencies(10e3)[:2]
    measured = Observation.from_modes(assembly=light, frequency_hz=modes, standard_deviation_hz=1e-3 * modes)
    names = ["joint.inner.k_theta", "joint.outer.k_theta"]
    found = identify(measured, [Unknown(address=name, lower=1e3, upper=1e9) for name in names], starts=3)
    series = 1.0 / sum(1.0 / found.values[name] for name in names)
    assert series == pytest.approx(1.2e5, rel=0.02)
    profiles = profile_likelihoods(found)
    for name in names:
        assert profiles[name].upper_open
        assert "determined to" not in profiles[name].statement, profiles[name].statement
    assert found.advice


def test_collet_stiffnesses_are_identified_with_mass_effect() -> None:
    """Up to the mode of the collet between its springs, its mass separates them."""
    true = make(
        inner=PointJoint(k_y=4e8, k_theta=1e5, loss_factor=0.05),
        outer=PointJoint(k_y=8e8, k_theta=2e5, loss_factor=0.05),
    )
    lines = np.linspace(300.0, 16000.0, 500)
    rng = np.random.default_rng(11)
    noise = 0.02 * (rng.normal(size=lines.size) + 1j * rng.normal(size=lines.size))
    measured = Observation(
        assembly=true, frequency_hz=lines, receptance=true.receptance(lines) * np.exp(noise), standard_deviation=0.02
    )
    names = {f"joint.{w}.{k}": true.get(f"joint.{w}.{k}") for w in ("inner", "outer") for k in ("k_y", "k_theta")}
    unknowns = [Unknown(address=n, lower=v / 5, upper=v * 5, start=1.2 * v) for n, v in names.items()]
    found = identify(measured, unknowns, starts=1, strategy="staged")
    assert found.rms == pytest.approx(1.0, abs=0.1)
    for name, value in names.items():
        low, high = found.interval(name, 0.999)
        assert low <= value <= high, (name, found.values[name])
        assert (high - low) / value < 0.2, name
