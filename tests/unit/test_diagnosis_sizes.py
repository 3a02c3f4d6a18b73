"""Sizes of causes: their intervals hold the truth between the places that are tried, and end at their bounds."""

from __future__ import annotations

import re
from itertools import pairwise

import numpy as np
import pytest

from blind.seeds import fresh_seed
from finite_elements import receptance
from receptance import STEEL, Assembly, Coordinate, Observation, Part, Segment, Unknown, campaign
from receptance.diagnosis import CATALOGUE, Model, Verdict, diagnose
from receptance.fit import Tolerance, constrained_fit

LENGTH, DIAMETER = 0.6, 0.02
HITS = (0.0, 0.17, 0.44)
LINES = np.linspace(40.0, 1500.0, 150)
NOISE = 0.03
CASES = 6


def on_a_spring(share: float, stiffness: float, damping: float, random: np.random.Generator) -> list[Observation]:
    """Return records of a free bar that hangs on a spring which the model does not have; foreign finite elements."""
    places = sorted({*HITS, share * LENGTH, LENGTH})
    pieces = [(high - low, DIAMETER, 0.0) for low, high in pairwise(places)]
    spring = (places.index(share * LENGTH), stiffness, damping)
    values = receptance(pieces, [spring], LINES, [2 * places.index(hit) for hit in HITS])
    bar = Assembly([Part([Segment(length=LENGTH, outer_diameter=DIAMETER, material=STEEL)], name="bar")])
    observations = []
    for number, hit in enumerate(HITS):
        noise = NOISE * (random.normal(size=LINES.size) + 1j * random.normal(size=LINES.size))
        observations.append(
            Observation(
                assembly=bar,
                frequency_hz=LINES,
                receptance=values[:, 0, number] * np.exp(noise),
                standard_deviation=NOISE,
                response=Coordinate("bar", 0.0),
                excitation=Coordinate("bar", hit),
                label=f"hit at {hit:g} m",
                configuration="bar",
            )
        )
    return observations


def test_a_spring_between_the_places_of_the_grid_has_its_size_in_the_interval() -> None:
    seed = fresh_seed()
    print(f"RECEPTANCE_TEST_SEED={seed}")
    inside = 0
    for case in range(CASES):
        random = np.random.default_rng([seed, case])
        # Half way between two places of the grid, and anywhere between the second and the third hit.
        share = 0.5 if case % 2 else float(random.uniform(0.33, 0.67))
        stiffness, damping = float(10.0 ** random.uniform(4.0, 5.0)), float(10.0 ** random.uniform(0.5, 1.0))
        verdict = diagnose(
            on_a_spring(share, stiffness, damping, random),
            Unknown(address="bar.segment[*].loss_factor", lower=1e-7, upper=1e-2),
            tolerances=Tolerance(name="modulus", moves={"bar.segment[*].youngs_modulus": 0.003}, relative=True),
            causes=["suspension"],
        )
        assert [cause.id for cause in verdict.causes] == ["suspension"], (share, stiffness, damping, verdict)
        parameters = verdict.causes[0].parameters
        place = float(verdict.causes[0].variant.split(" ")[1]) / 100.0 * LENGTH
        for name, true in (("stiffness", stiffness), ("distance", share * LENGTH - place)):
            value, low, high = parameters[f"suspension.{name}"]
            inside += low <= true <= high
            # A quarter of the distance between places of the grid, which alone leave 40 % of the stiffness.
            assert abs(value - true) < (0.2 * stiffness if name == "stiffness" else 0.03), (name, share, stiffness)
    # Of twelve 95 % intervals more than four miss by chance in one of 5000 cases.
    assert inside >= 2 * CASES - 4


def test_a_suspension_has_a_value_for_any_error_of_the_length() -> None:
    """The step of the rope may be close to the end of a segment, whose length has a tolerance."""
    observations = on_a_spring(0.5, 1e4, 3.0, np.random.default_rng(1))
    unknown = Unknown(address="bar.segment[*].loss_factor", lower=1e-7, upper=1e-2, start=1e-3)
    tolerance = Tolerance(name="length", moves={"bar.segment[0].length": 2e-4})
    model = Model(tuple(observations), (unknown,), (tolerance,))
    extensions = CATALOGUE["suspension"].extensions(model)
    assert len(extensions) == 18
    for variant, extended in extensions:
        values = {u.name: u.start for u in extended.unknowns if u.start is not None}
        for error in (-4.0, 4.0):
            start = extended.task.variables.from_values(
                np.array([{**values, "length": error}[name] for name in extended.task.variables.names])
            )
            assert np.isfinite(extended.problem.residual(start)).all(), variant.name


STRIP = """
format = 1
[materials.alu]
youngs_modulus = "1.67113e+12 Pa"
density = "64457.8 kg/m^3"
poisson_ratio = 0.33
loss_factor = 0.002
tolerance = { youngs_modulus = "2 %", density = "0.5 %" }
[[parts.strip.segments]]
length = "300 mm"
outer_diameter = "2.309401 mm"
material = "alu"
tolerance = { outer_diameter = "1 %" }
[materials.steel]
youngs_modulus = "210 GPa"
density = "7850 kg/m^3"
poisson_ratio = 0.3
[[parts.vice.segments]]
length = "100 mm"
outer_diameter = "120 mm"
material = "steel"
[joints.clamp]
k_y = "1e8 N/m"
[attachments.bench]
kind = "ground"
part = "vice"
position = "50 mm"
k_y = "1e9 N/m"
k_theta = "1e7 N m/rad"
[unknowns]
"clamp.k_theta" = { lower = "1 N m/rad", upper = "1e5 N m/rad" }
"""
"""A strip of 50 x 2 mm in a vice, as a round one of the same mass and stiffness."""
WITH_A_BOARD = {300: (14.961, 96.696), 400: (8.81192, 55.9582), 500: (5.81484, 36.8405), 600: (4.10105, 26.017)}
"""First natural frequencies in Hz with a board of 5 g at the tip, by free length in mm, from finite elements."""


@pytest.fixture(scope="module")
def strip(tmp_path_factory: pytest.TempPathFactory) -> Verdict:
    """The diagnosis of natural frequencies at four free lengths; the campaign does not state the board."""
    tables = [STRIP]
    for length, frequencies in WITH_A_BOARD.items():
        tables.append(
            f"""
[assemblies.L{length}]
chain = ["strip", "clamp", "vice"]
attachments = ["bench"]
set = {{ "strip.segment[0].length" = "{length} mm" }}
tolerance = {{ "strip.segment[0].length" = "1 mm" }}
[measurements.L{length}]
kind = "natural frequencies"
assembly = "L{length}"
frequencies = ["{frequencies[0]} Hz", "{frequencies[1]} Hz"]
modes = [1, 2]
standard_deviation = "0.3 %"
"""
        )
    file = tmp_path_factory.mktemp("strip") / "campaign.toml"
    file.write_text("".join(tables))
    return campaign.load(file).diagnose()


def test_an_interval_beyond_the_bounds_is_that_of_the_profile_likelihood(strip: Verdict) -> None:
    """The clamp compensates a board of any mass to first order: the linear interval is -1900 to 1900 g."""
    (sensor,) = (cause for cause in strip.causes if cause.id == "sensor_mass")
    fit = sensor.explanation.fit.identification
    ((name, (value, low, high)),) = sensor.parameters.items()
    linear = fit.interval(name)
    assert linear[0] < -1.0
    assert linear[1] > 1.0
    assert low < value < high
    assert low < 5e-3 < high
    for end in (low, high):
        # The 95 % quantile of chi-squared with one degree of freedom.
        assert constrained_fit(fit, {name: end}).rise == pytest.approx(3.84, rel=0.02)
    assert sensor.sizes == "mass 4.6 g (95 %: 1.5 to 7.1 g)"


def test_a_size_of_exactly_zero_has_a_text(strip: Verdict) -> None:
    """Causes that promise nothing are listed at size zero, where intervals have no width, or no end."""
    zero = {
        candidate.id: candidate.sizes
        for candidate in strip.candidates
        if any(value == 0.0 for value, *_ in candidate.parameters.values())
    }
    assert zero
    for sizes in zero.values():
        assert re.search(r" 0(\.0+)? ", sizes)
    assert strip.summary()
    assert strip.to_html()
