"""A mass on a spring at a point of a part, against the equation of a vibration absorber."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from receptance import (
    CARBIDE,
    STEEL,
    Assembly,
    Coordinate,
    Observation,
    Part,
    PointJoint,
    Resonator,
    Segment,
    Unknown,
    campaign,
    damped_modes,
    identify,
)
from receptance.campaign.write import attachment_table

TOOL = Part([Segment(length=0.0623, outer_diameter=0.0127, material=CARBIDE)], name="tool")
HOLDER = Part([Segment(length=0.129, outer_diameter=0.045, material=STEEL)], name="holder")
JOINT = PointJoint(k_y=6e8, k_theta=1e5, c_y=300.0, c_theta=1.0, name="joint")
LINES = np.linspace(50.0, 9000.0, 400)
BARE = Assembly([TOOL, JOINT, HOLDER])
PLACES = [("tool", 0.0), ("tool", 0.02), ("holder", 0.04), ("holder", "end")]


def absorber(part: str, position: float | str, mass: float = 0.03, hz: float = 1800.0, c_y: float = 4.0) -> Resonator:
    stiffness = mass * (2.0 * np.pi * hz) ** 2
    return Resonator(mass=mass, k_y=stiffness, c_y=c_y, part=part, position=position, name="absorber")  # type: ignore[arg-type]


def coupled(one: Resonator, lines: np.ndarray) -> np.ndarray:
    """Receptance of the tip with the absorber's dynamic stiffness coupled to the bare assembly at one point."""
    tip, place = Coordinate("tool", 0.0), Coordinate(one.part, one.position)
    points = [tip, place]
    h = BARE.receptance(lines, response=points, excitation=points)
    w = 2.0 * np.pi * lines
    k = one.k_y + 1j * w * one.c_y
    d = -(w**2) * one.mass * k / (k - w**2 * one.mass)
    return h[:, 0, 0] - h[:, 0, 1] * d / (1.0 + h[:, 1, 1] * d) * h[:, 1, 0]


@pytest.mark.parametrize(("part", "position"), PLACES)
def test_receptance_is_that_of_an_absorber_coupled_to_the_bare_assembly(part: str, position: float | str) -> None:
    one = absorber(part, position)
    found = Assembly([TOOL, JOINT, HOLDER], [one]).receptance(LINES)
    np.testing.assert_allclose(found, coupled(one, LINES), rtol=1e-9)


@pytest.mark.parametrize(("part", "position"), PLACES)
def test_derivatives_are_difference_quotients(part: str, position: float | str) -> None:
    assembly = Assembly([TOOL, JOINT, HOLDER], [absorber(part, position)])
    addresses = ["absorber.mass", "absorber.k_y", "absorber.c_y"]
    _, slopes = assembly.derivatives(LINES, addresses)
    for i, address in enumerate(addresses):
        step = 1e-6 * assembly.get(address)
        ends = [assembly.replace({address: assembly.get(address) + x}).receptance(LINES) for x in (step, -step)]
        difference = (ends[0] - ends[1]) / (2.0 * step)
        np.testing.assert_allclose(slopes[:, i], difference, atol=1e-6 * np.abs(difference).max())


def test_natural_and_damped_frequencies_are_where_the_coupled_receptance_peaks() -> None:
    one = absorber("holder", "end", c_y=0.0)
    undamped = PointJoint(k_y=6e8, k_theta=1e5, name="joint")
    assembly = Assembly([TOOL, undamped, HOLDER], [one])
    bare = Assembly([TOOL, undamped, HOLDER])
    found = assembly.natural_frequencies(9e3)
    assert found.size == bare.natural_frequencies(9e3).size + 1
    for hz in found:
        low, high = assembly.receptance(hz * np.array([1.0 - 1e-7, 1.0 + 1e-7]))
        assert low.real * high.real < 0.0
    light = assembly.replace({"absorber.c_y": 1e-3})
    np.testing.assert_allclose(damped_modes(light, 9e3).frequency_hz, found, rtol=1e-6)


def test_axial_motion_includes_the_resonator() -> None:
    bar = Part([Segment(length=0.2, outer_diameter=0.02, material=STEEL)], name="bar")
    one = Resonator(mass=0.02, k_y=5e5, c_y=1.0, part="bar", position="end", name="absorber")
    assembly = Assembly([bar], [one], motion="axial")
    bare = Assembly([bar], motion="axial")
    end = Coordinate("bar", "end")
    h = bare.receptance(LINES, response=end, excitation=end)
    w = 2.0 * np.pi * LINES
    k = one.k_y + 1j * w * one.c_y
    d = -(w**2) * one.mass * k / (k - w**2 * one.mass)
    np.testing.assert_allclose(assembly.receptance(LINES, response=end, excitation=end), h / (1.0 + h * d), rtol=1e-9)


def test_mass_and_stiffness_are_identified() -> None:
    truth = Assembly([TOOL, JOINT, HOLDER], [absorber("holder", 0.04)])
    start = truth.replace({"absorber.mass": 0.02, "absorber.k_y": 2e6})
    measured = Observation(
        assembly=start, frequency_hz=LINES, receptance=truth.receptance(LINES), standard_deviation=0.01
    )
    unknowns = [
        Unknown(address="absorber.mass", lower=1e-3, upper=1.0, start=0.02),
        Unknown(address="absorber.k_y", lower=1e5, upper=1e8, start=2e6),
    ]
    found = identify(measured, unknowns)
    for one in unknowns:
        assert found.values[one.address] == pytest.approx(truth.get(one.address), rel=1e-6)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"k_y": 0.0}, r"Resonator 'absorber': k_y is 0"),
        ({"mass": -1.0}, r"Resonator 'absorber': mass is -1"),
        ({"c_y": -1.0}, r"Resonator 'absorber': c_y is -1"),
    ],
)
def test_invalid_values_are_refused(changes: dict[str, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Resonator(**{"mass": 0.03, "k_y": 1e6, "name": "absorber", **changes})


CAMPAIGN = """
title = "absorber"

[materials.steel]
youngs_modulus = "205 GPa"
density = "7850 kg/m^3"
poisson_ratio = 0.29

[parts.bar]
segments = [{ length = "200 mm", outer_diameter = "20 mm", material = "steel" }]

[attachments.absorber]
kind = "resonator"
part = "bar"
position = "50 mm"
mass = "20 g"
k_y = "5e5 N/m"
c_y = "1 N s/m"

[assemblies.free]
chain = ["bar"]
attachments = ["absorber"]

[measurements.free]
kind = "natural frequencies"
assembly = "free"
frequencies = ["760 Hz", "2600 Hz"]
standard_deviation = "1 Hz"

[unknowns]
"absorber.k_y" = { lower = "1e4 N/m", upper = "1e7 N/m" }
"""


def test_a_campaign_reads_and_writes_it(tmp_path: Path) -> None:
    (tmp_path / "campaign.toml").write_text(CAMPAIGN)
    point = campaign.load(tmp_path / "campaign.toml").assemblies["free"].attachments["absorber"]
    assert isinstance(point, Resonator)
    assert (point.mass, point.c_y, point.part, point.position) == (0.02, 1.0, "bar", 0.05)
    table = attachment_table(point)
    assert table["kind"] == "resonator"
    assert table["mass"] == "0.02 kg"
