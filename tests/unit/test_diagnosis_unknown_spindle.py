"""Causes beside a spindle whose modes are unknowns: compared whatever the spindle is, and a spindle that differs."""

from __future__ import annotations

import numpy as np
import pytest

from receptance import (
    STEEL,
    Assembly,
    Coordinate,
    ModalPart,
    Mode,
    Observation,
    Part,
    PointJoint,
    PointMass,
    Segment,
    Tolerance,
)
from receptance.coupling.unknown_modes import ModeChoice, bounds_of_modes
from receptance.diagnosis import CATALOGUE, Model
from receptance.diagnosis.causes import parameters_of, transfer
from receptance.diagnosis.fitting import evaluate
from receptance.diagnosis.model import UndecidableError
from receptance.diagnosis.text import sizes
from receptance.diagnosis.unknown_spindle import fit_unstrained, with_any_spindle
from receptance.fit import Unknown
from receptance.fit.observation import altered
from variant_of_cause import variant_of

SEED = 20261128
LINES = np.linspace(200.0, 2500.0, 100)
NOISE = 0.005
TIP, MIDDLE, NOSE = Coordinate("tool", 0.0), Coordinate("tool", 0.03), Coordinate("holder", 0.02)
HITS = ((TIP, TIP), (TIP, MIDDLE), (TIP, NOSE), (NOSE, NOSE), (NOSE, TIP))
LENGTHS = {"short": 0.07, "long": 0.09}
MODES = (
    Mode(frequency_hz=520.0, damping_ratio=0.04, y=0.25, theta=1.2),
    Mode(frequency_hz=1500.0, damping_ratio=0.03, y=0.35, theta=-2.5),
)


def machine(length: float, *points: PointMass) -> Assembly:
    """Return tool, joint and holder on a spindle."""
    tool = Part([Segment(length=length, outer_diameter=0.016, material=STEEL)], name="tool")
    holder = Part([Segment(length=0.09, outer_diameter=0.045, material=STEEL)], name="holder")
    spindle = ModalPart(modes=MODES, residual_y=2e-9, residual_theta=3e-7, name="spindle")
    return Assembly(
        [tool, PointJoint(k_y=2e8, k_theta=4e4, c_y=100.0, c_theta=1.0, name="joint"), holder, spindle], points
    )


def measured(*configurations: str, sensor: float = 0.0) -> Model:
    """Return the model of records with a sensor of a mass that it does not have; all modes are unknowns."""
    rng = np.random.default_rng(SEED)
    observations = []
    for name in configurations:
        for response, excitation in HITS:
            true = machine(LENGTHS[name], PointMass(mass=sensor, part=response.part, position=response.position))
            h = true.receptance(LINES, response=response, excitation=excitation)
            error = NOISE * (rng.standard_normal(LINES.size) + 1j * rng.standard_normal(LINES.size))
            observations.append(
                Observation(
                    assembly=machine(LENGTHS[name]),
                    frequency_hz=LINES,
                    receptance=h * np.exp(error),
                    response=response,
                    excitation=excitation,
                    standard_deviation=NOISE,
                    configuration=name,
                    label=f"{name} {response.part} {excitation.part} {excitation.position}",
                )
            )
    joint = [
        Unknown(address="joint.k_y", lower=1e7, upper=1e10, start=1e9),
        Unknown(address="joint.k_theta", lower=1e3, upper=1e6, start=1e5),
    ]
    modes = bounds_of_modes("spindle", [{}, {}], {}, observations)
    return Model(tuple(observations), (*joint, *modes), threads=1).with_witnesses()


def test_the_right_cause_explains_the_records_whatever_the_spindle_is() -> None:
    model = measured("short", "long", sensor=0.02)
    without = with_any_spindle(model)
    assert without is not None
    assert without.chi_square > 3.0 * without.expected, SEED
    extensions = [pair for id in ("sensor_mass", "calibration_gain") for pair in CATALOGUE[id].extensions(model)]
    ends = {variant.id: with_any_spindle(extended, without) for variant, extended in extensions}
    right = ends["sensor_mass", "all"]
    assert right.chi_square == pytest.approx(right.expected, rel=0.15), SEED
    assert right.values["sensor_mass.mass"] == pytest.approx(0.02, rel=0.05), SEED
    assert right.values["joint.k_theta"] == pytest.approx(4e4, rel=0.02), SEED
    assert min(ends, key=lambda id: ends[id].chi_square) == ("sensor_mass", "all")


def test_a_reversed_channel_explains_the_records_whatever_the_spindle_is() -> None:
    model = measured("short", "long")
    turned = model.map(lambda one: altered(one, receptance=-one.receptance) if one.response == NOSE else one)
    ends = {one.name: with_any_spindle(model) for one, model in CATALOGUE["reversed_polarity"].extensions(turned)}
    assert {"all", "response channel tool 0 mm", "response channel holder 20 mm"} <= set(ends)
    right = ends.pop("response channel holder 20 mm")
    assert right.chi_square == pytest.approx(right.expected, rel=0.15), SEED
    assert min(end.chi_square for end in ends.values()) > 1e3 * right.chi_square


def test_of_one_record_only_that_of_the_reversed_channel_is_turned() -> None:
    """As an extended campaign and held-out measurements need it."""
    model = measured("short")
    variant = variant_of(model, "reversed_polarity", "response channel holder 20 mm")
    for observation, changed in zip(model.observations, variant.apply(model).observations, strict=True):
        sign = -1.0 if observation.response == NOSE else 1.0
        np.testing.assert_array_equal(changed.receptance, sign * observation.receptance)
        alone = Model((observation,), model.unknowns, witnesses=model.witnesses)
        (same,) = transfer(alone, [variant]).observations
        np.testing.assert_array_equal(same.receptance, changed.receptance)


def test_records_that_do_not_separate_the_spindle_compare_nothing() -> None:
    model = measured("short")
    assert with_any_spindle(Model(model.observations[:3], model.unknowns, threads=1)) is None


def test_unknown_modes_differ_in_one_configuration() -> None:
    model = measured("short", "long")
    ((variant, extended),) = CATALOGUE["spindle_mode"].extensions(model)
    assert variant.name == "all modes, long"
    assert "in long than in the other configurations" in variant.meaning
    start = {unknown.name: unknown.start for unknown in model.unknowns}
    before = evaluate(model, start)
    assert evaluate(extended, start).chi_square == pytest.approx(before.chi_square)
    moved = evaluate(extended, {**start, "spindle_mode.log_frequency mode[0] @ long": 0.05})
    changes = [np.abs(after - now).max() for after, now in zip(moved.parts, before.parts, strict=True)]
    assert max(changes[: len(HITS)]) == 0.0
    assert min(changes[len(HITS) :]) > 0.1
    # The spindle of one configuration has no meaning without its modes.
    assert with_any_spindle(extended) is None


def test_unknown_modes_of_one_configuration_are_those_of_the_spindle() -> None:
    with pytest.raises(UndecidableError, match="there is one configuration"):
        CATALOGUE["spindle_mode"].variants(measured("short"))


def test_of_many_sizes_the_most_significant_ones_are_shown() -> None:
    ((_, extended),) = CATALOGUE["spindle_mode"].extensions(measured("short", "long"))
    parameters = parameters_of(extended.unknowns)
    values = {name: (0.01, 0.01 - width, 0.01 + width) for name, width in zip(parameters, range(1, 9), strict=True)}
    text = sizes(values, parameters)
    assert [name in text for name in ("frequency mode[0]", "shape mode[1] @", "slope mode[1]")] == [True, False, False]
    assert text.count("95 %") == 6
    assert text.endswith(", and 2 less significant ones")


@pytest.mark.parametrize(("error", "counts"), [(0.0, [1]), (0.05, [1, 1, 2])])
def test_other_modes_are_chosen_where_errors_make_up_for_missing_ones(error: float, counts: list[int]) -> None:
    """A modulus with a tolerance of 1 % makes up for a density, which here stands for the further mode."""
    bar = Assembly([Part([Segment(length=0.2, outer_diameter=0.02, material=STEEL)], name="bar")])
    heavier = bar.replace({"bar.segment[0].density": STEEL.density * (1.0 + error)})
    rng = np.random.default_rng(SEED)
    observations = tuple(
        Observation.from_modes(
            assembly=bar,
            frequency_hz=heavier.natural_frequencies(2e4)[:3] + rng.normal(scale=20.0, size=3),
            standard_deviation_hz=20.0,
        )
        for _ in range(60)
    )
    modulus = Tolerance(name="modulus", moves={"bar.segment[0].youngs_modulus": 0.01}, relative=True)
    diameter = Unknown(address="bar.segment[0].outer_diameter", lower=0.0199, upper=0.0201)
    density = Unknown(address="bar.segment[0].density", lower=5e3, upper=1e4, start=STEEL.density)
    asked = []

    def choose(model: Model, choice: ModeChoice) -> Model:
        asked.append(choice.further)
        return Model(observations, (diameter, density)[: choice.further], (modulus,), threads=1)

    chosen, fit = fit_unstrained(Model(observations, (diameter,), (modulus,), threads=1), choose)
    assert asked == counts, SEED
    assert len(chosen.unknowns) == counts[-1]
    assert fit.adequacy.passed
