"""Diagnosis: causes, verdicts and undecidable cases, on the package's own simulator."""

from __future__ import annotations

import html
import json
import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from blank_in_holder import STARTED, TOLERANCES, make_assembly, observe
from blank_in_holder import UNKNOWNS as JOINT
from receptance import (
    CARBIDE,
    FRF,
    STEEL,
    Assembly,
    Coordinate,
    Material,
    Observation,
    Part,
    PointJoint,
    PointMass,
    Section,
    Segment,
    SpreadJoint,
    Unknown,
)
from receptance.diagnosis import CATALOGUE, Model, UndecidableError, diagnose
from receptance.fit import Move
from receptance.fit.observation import altered
from receptance.fit.parameters import Parameters
from receptance.fit.problem import Task
from variant_of_cause import extended_by

LINES = np.linspace(200.0, 6000.0, 300)
FEW = ("sensor_mass", "tool_modulus", "calibration_gain")


def make_observations(
    *masses: PointMass, factor: np.ndarray | float = 1.0, overhangs: tuple[float, ...] = (0.05, 0.07, 0.09)
) -> list[Observation]:
    rng = np.random.default_rng(11)
    return [
        observe(make_assembly(x), LINES, make_assembly(x, *masses).receptance(LINES) * factor, rng, f"{x}")
        for x in overhangs
    ]


def test_correct_model_is_adequate() -> None:
    verdict = diagnose(make_observations(), JOINT, tolerances=TOLERANCES, causes=FEW)
    assert verdict.verdict == "adequate"
    assert verdict.final
    assert verdict.causes == ()
    assert verdict.extended is None


def correlated_noise(share: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return standard normal numbers with the given number of correlated neighbours."""
    total = np.cumsum(np.pad(rng.normal(size=share.size + int(share.max())), (1, 0)))
    first = np.arange(share.size)
    return np.asarray((total[first + share] - total[first]) / np.sqrt(share))


def test_unequally_correlated_lines_are_adequate() -> None:
    # A third of the lines err as one of 24 neighbours, the others alone: 2 sum(1 / c) is expected of chi-square.
    rng = np.random.default_rng(3)
    correlated = np.where(np.arange(LINES.size) < 100, 24, 1)
    data = []
    for x in (0.05, 0.07, 0.09):
        noise = 0.01 * (correlated_noise(correlated, rng) + 1j * correlated_noise(correlated, rng))
        values = make_assembly(x).receptance(LINES) * np.exp(noise)
        frf = FRF(frequency_hz=LINES, values=values, log_variance=1e-4, correlated_lines=correlated)
        data.append(Observation.from_frf(make_assembly(x), frf, label=f"{x}"))
    assert [one.independent_values for one in data] == pytest.approx([2.0 * (200.0 + 100.0 / 24.0)] * 3)
    verdict = diagnose(data, JOINT, tolerances=TOLERANCES, causes=FEW, max_causes=1)
    assert verdict.verdict == "adequate"
    assert verdict.adequacy.misfit == pytest.approx(1.0, abs=0.15)
    assert verdict.adequacy.smooth < 1.25
    assert verdict.base.task.independent_values == pytest.approx(1225.0)
    worst = verdict.adequacy.worst[0]
    assert worst.misfit < 6.0, worst


def test_no_verdict_from_too_few_numbers() -> None:
    true = make_assembly(0.07)
    found = true.natural_frequencies(60e3)
    for count, answer in ((2, "undecided"), (4, "adequate")):
        data = Observation.from_modes(assembly=true, frequency_hz=found[:count], standard_deviation_hz=5.0)
        verdict = diagnose(data, JOINT[1], tolerances=TOLERANCES, causes=["tool_density", "sensor_mass"], max_causes=1)
        assert verdict.verdict == answer
    data = Observation.from_modes(assembly=true, frequency_hz=found[:2], standard_deviation_hz=5.0)
    verdict = diagnose(data, JOINT[1], causes=["tool_density", "sensor_mass"], max_causes=1)
    assert verdict.adequacy.misfit < 1e-3
    assert "degrees of freedom: 1, expected at least 3" in verdict.summary(1000)
    assert "the model cannot be judged" in verdict.summary(1000)
    assert verdict.next_measurement is not None
    # One degree of freedom can refute the model, but no cause is named.
    data = Observation.from_modes(assembly=true, frequency_hz=found[:2] * [1.0, 0.9], standard_deviation_hz=5.0)
    verdict = diagnose(data, JOINT[1], causes=["tool_density", "sensor_mass"], max_causes=1)
    assert verdict.verdict in ("unexplained", "suspected", "ambiguous")


def test_a_gain_is_named_with_its_size_and_kept_out_of_predictions() -> None:
    verdict = diagnose(make_observations(factor=1.05), JOINT, tolerances=TOLERANCES, causes=FEW)
    assert [one.id for one in verdict.causes] == ["calibration_gain"]
    assert verdict.verdict == "named"
    value, low, high = verdict.causes[0].parameters["calibration_gain.log_gain"]
    assert low < np.log(1.05) < high
    assert value == pytest.approx(np.log(1.05), abs=2e-3)
    predicted = verdict.at(make_assembly(0.06)).natural_frequencies(6000.0)
    found = predicted.predicted_hz
    np.testing.assert_allclose(found, make_assembly(0.06).natural_frequencies(6000.0), rtol=2e-3)
    assert json.loads(json.dumps(verdict.to_dict(), allow_nan=False))["verdict"] == "named"
    assert "Calibration gain: the calibration of hammer or sensor is off" in verdict.summary(1000)


def test_a_fast_diagnosis_names_no_cause() -> None:
    """The fits are the same; what tests the cause is left out, and the answer says so."""
    observations = make_observations(factor=1.05)
    fast = diagnose(observations, JOINT, tolerances=TOLERANCES, causes=FEW, held_out=True, fast=True)
    assert fast.verdict == "suspected"
    assert [one.id for one in fast.causes] == ["calibration_gain"]
    assert not fast.gains
    assert not fast.alternatives
    assert fast.settings["fast"] is True
    assert any("--fast" in note for note in fast.notes)
    whole = diagnose(observations, JOINT, tolerances=TOLERANCES, causes=FEW)
    assert "fast" not in whole.settings
    assert fast.causes[0].parameters == whole.causes[0].parameters


@pytest.mark.slow
def test_causes_of_the_chain_apply_to_frfs_only() -> None:
    frequencies = [
        Observation.from_modes(
            assembly=make_assembly(x),
            frequency_hz=make_assembly(x).natural_frequencies(6000.0),
            standard_deviation_hz=2.0,
            label=f"{x}",
        )
        for x in (0.06, 0.08)
    ]
    chain = ["calibration_gain", "time_delay", "exponential_window", "hammer_offset", "wrong_quantity", "sensor_mass"]
    for data in (make_observations(factor=1.05, overhangs=(0.07,)), make_observations(factor=1.05)):
        verdict = diagnose([*data, *frequencies], JOINT, tolerances=TOLERANCES, causes=chain, max_causes=1)
        assert [one.id for one in verdict.causes] == ["calibration_gain"]
        (_, low, high), *_ = verdict.causes[0].parameters.values()
        assert low < np.log(1.05) < high
        assert "frequencies_and_frfs" in [reason.code for reason in verdict.reasons]


def test_hit_offsets_are_found_at_tip_and_nose() -> None:
    """An offset belongs to the place where it was hit; with another FRF it is still looked for."""
    rng = np.random.default_rng(2)
    nose = Coordinate("holder", 0.0)

    def measured_at(overhang: float, place: Coordinate, hit: Coordinate) -> Observation:
        noise = 0.01 * (rng.normal(size=LINES.size) + 1j * rng.normal(size=LINES.size))
        values = make_assembly(overhang).receptance(LINES, response=place, excitation=hit) * np.exp(noise)
        return Observation(
            assembly=make_assembly(overhang),
            frequency_hz=LINES,
            receptance=values,
            response=place,
            excitation=place,
            standard_deviation=0.0105,
            label=f"{overhang} {place.part}",
            configuration=f"{overhang}",
        )

    tip, beside = Coordinate("tool", 0.0), Coordinate("tool", 4e-4)
    observations = [measured_at(x, tip, beside) for x in (0.05, 0.07)] + [measured_at(0.05, nose, nose)]
    causes = ["hammer_offset", "sensor_mass", "fluted_part"]
    verdict = diagnose(observations, JOINT, tolerances=TOLERANCES, causes=causes, max_causes=1)
    assert verdict.verdict == "named"
    assert [(one.id, one.variant) for one in verdict.causes] == [("hammer_offset", "on tool at 0 mm")]
    _, low, high = verdict.causes[0].parameters["hammer_offset.distance"]
    assert low < 4e-4 < high


def test_no_cause_is_named_from_one_configuration() -> None:
    # The same blank has another modulus than any tolerance would allow, and only one overhang was measured.
    stiffer = [
        Observation(
            assembly=one.assembly,
            frequency_hz=LINES,
            receptance=one.assembly.replace(
                {"tool.segment[0].youngs_modulus": 1.15 * CARBIDE.youngs_modulus}
            ).receptance(LINES)
            * np.exp(0.01 * np.random.default_rng(5).normal(size=LINES.size)),
            standard_deviation=0.01,
            label="only one",
        )
        for one in make_observations(overhangs=(0.08,))
    ]
    verdict = diagnose(stiffer, JOINT, tolerances=TOLERANCES, causes=["tool_modulus"], max_causes=1)
    assert verdict.verdict != "named"
    assert any("one configuration does not distinguish the joint from the parts" in note for note in verdict.notes)
    assert "single_configuration" in [reason.code for reason in verdict.reasons]
    assert verdict.next_measurement is not None
    assert verdict.next_measurement.action == "measure another overhang"


def test_notes_on_one_configuration_mention_a_joint_only_if_there_is_one() -> None:
    """A free bar that is heavier than its material implies."""
    bar = Assembly([Part([Segment(length=0.3, outer_diameter=0.02, material=STEEL)], name="bar")])
    noise = np.random.default_rng(7).normal(size=(2, LINES.size))
    heavier = bar.replace({"bar.segment[0].density": 1.1 * STEEL.density}).receptance(LINES)
    measured = Observation(
        assembly=bar,
        frequency_hz=LINES,
        receptance=heavier * np.exp(0.01 * (noise[0] + 1j * noise[1])),
        standard_deviation=0.01,
        label="bar",
    )
    unknowns = [Unknown(address="bar.segment[0].loss_factor", lower=1e-5, upper=0.1)]
    verdict = diagnose(measured, unknowns, causes=["tool_density", "tool_modulus"], max_causes=1)
    assert verdict.verdict == "suspected"
    assert any("one configuration does not distinguish one error of the parts" in note for note in verdict.notes)
    assert verdict.next_measurement is not None
    assert verdict.next_measurement.action == "measure another configuration"
    assert not any("joint" in text for text in (*verdict.notes, verdict.next_measurement.reason))


@pytest.mark.parametrize("listed", [False, True])
def test_no_cause_is_named_from_one_mode(listed: bool) -> None:
    """Of each overhang only the first mode was measured: lines around it, or its frequency alone."""
    rng = np.random.default_rng(6)
    data: list[Observation] = []
    for x in (0.05, 0.06, 0.07, 0.08, 0.09):
        true = make_assembly(x).replace({"tool.segment[0].density": 1.1 * CARBIDE.density})
        first, second = true.natural_frequencies(12000.0)[:2]
        if listed:
            own = first * (1.0 + 3e-4 * rng.normal())
            spread = 3e-4 * own
            data.append(
                Observation.from_modes(assembly=make_assembly(x), frequency_hz=[own], standard_deviation_hz=spread)
            )
            continue
        lines = np.linspace(0.6 * first, min(1.4 * first, 0.9 * second), 120)
        noise = 0.01 * (rng.normal(size=lines.size) + 1j * rng.normal(size=lines.size))
        values = true.receptance(lines) * np.exp(noise)
        data.append(
            Observation(assembly=make_assembly(x), frequency_hz=lines, receptance=values, standard_deviation=0.0105)
        )
    data = [altered(one, label=f"{i}") for i, one in enumerate(data)]
    verdict = diagnose(data, JOINT, tolerances=TOLERANCES, causes=["tool_density"], max_causes=1)
    assert verdict.verdict != "named"
    assert "single_mode" in [reason.code for reason in verdict.reasons]
    if verdict.verdict != "adequate":
        assert "second mode" in str(verdict.next_measurement)
    several = diagnose(make_observations(), JOINT, tolerances=TOLERANCES, causes=["tool_density"], max_causes=1)
    assert not {"single_mode", "one_mode"} & {reason.code for reason in several.reasons}


def test_undecidable_verdict_names_missing_measurements() -> None:
    model = Model(tuple(make_observations()), tuple(JOINT))
    with pytest.raises(UndecidableError, match="force"):
        CATALOGUE["joint_amplitude"].variants(model)
    verdict = diagnose(
        make_observations(), JOINT, tolerances=TOLERANCES, causes=["joint_amplitude", "sensor_mass"], max_causes=1
    )
    assert "force" in verdict.undecidable["joint_amplitude"]


@pytest.mark.slow
def test_an_unusual_size_is_suspected_and_shown() -> None:
    verdict = diagnose(
        make_observations(PointMass(mass=0.06)), JOINT, tolerances=TOLERANCES, causes=["sensor_mass"], max_causes=1
    )
    assert (verdict.verdict, [one.id for one in verdict.causes]) == ("suspected", ["sensor_mass"])
    assert verdict.vetoed == ()
    size = f"mass {1e3 * verdict.causes[0].parameters['sensor_mass.mass'][0]:.1f} g (plausible: 0.0 to 30.0 g)"
    note = f"its size is unusual: {size}; check the drawing or the stated value"
    assert note in verdict.summary(1000)
    assert verdict.to_dict()["causes"][0]["vetoed"] == size
    assert note in html.unescape(verdict.to_html())
    # The reported model counts in predictions, with a finite error.
    predicted = verdict.at(make_assembly(0.06)).natural_frequencies(6000.0)
    errors = predicted.standard_error_hz
    assert (errors < 50.0).all()


GRADE = Material(youngs_modulus=610e9, density=14300.0, poisson_ratio=0.22)
MATERIALS = ("tool_material", "tool_modulus", "tool_density", "fluted_part")


def of_material(stated: Material, true: Material) -> list[Observation]:
    """Tools of one material in models of another one; 1 % of noise, seed 5."""
    rng = np.random.default_rng(5)

    def with_tool(overhang: float, material: Material) -> Assembly:
        plain = make_assembly(overhang)
        tool = Part([Segment(length=overhang, outer_diameter=0.012, material=material)], name="tool")
        return Assembly([tool, plain.elements["joint"], plain.elements["holder"]])

    return [
        Observation(
            assembly=with_tool(x, stated),
            frequency_hz=LINES,
            receptance=with_tool(x, true).receptance(LINES)
            * np.exp(0.01 * (rng.normal(size=LINES.size) + 1j * rng.normal(size=LINES.size))),
            standard_deviation=0.0105,
            label=f"{x}",
        )
        for x in (0.05, 0.07, 0.09)
    ]


@pytest.mark.parametrize(
    ("stated", "true", "name"),
    [pytest.param(STEEL, GRADE, "cemented carbide", marks=pytest.mark.slow), (CARBIDE, STEEL, "steel")],
    ids=["carbide", "steel"],
)
def test_another_material_is_named(stated: Material, true: Material, name: str) -> None:
    verdict = diagnose(of_material(stated, true), JOINT, tolerances=TOLERANCES, causes=MATERIALS)
    assert verdict.verdict == "named"
    (cause,) = verdict.causes
    assert (cause.id, cause.variant) == ("tool_material", name)
    assert f"the tool is of {name}" in cause.meaning
    for size, field in (("log_modulus", "youngs_modulus"), ("log_density", "density")):
        _, low, high = cause.parameters[f"tool_material.{size}"]
        assert low < np.log(getattr(true, field) / getattr(stated, field)) < high
    assert {"tool_modulus", "tool_density"} <= set(cause.look_alikes)


@pytest.mark.slow
def test_impossible_material_is_vetoed_and_heavier_grade_is_accepted() -> None:
    heavier = replace(CARBIDE, density=1.06 * CARBIDE.density)
    verdict = diagnose(of_material(CARBIDE, heavier), JOINT, tolerances=TOLERANCES, causes=MATERIALS, max_causes=1)
    assert (verdict.verdict, [one.id for one in verdict.causes]) == ("named", ["tool_density"])
    odd = replace(STEEL, youngs_modulus=1.5 * STEEL.youngs_modulus, density=1.5 * STEEL.density)
    verdict = diagnose(of_material(STEEL, odd), JOINT, tolerances=TOLERANCES, causes=MATERIALS, max_causes=1)
    assert verdict.verdict == "unexplained"
    assert "tool_material" in [one.id for one in verdict.vetoed]


def test_a_material_is_only_tried_where_the_model_is_not_adequate() -> None:
    verdict = diagnose(
        make_observations(), JOINT, tolerances=TOLERANCES, causes=["tool_material", "sensor_mass"], max_causes=1
    )
    assert verdict.verdict == "adequate"
    assert [one.id for one in verdict.candidates] == ["sensor_mass"]


def test_the_same_seed_gives_the_same_answer() -> None:
    first, parallel = (
        diagnose(
            make_observations(factor=1.02), JOINT, tolerances=TOLERANCES, causes=FEW, max_causes=1, threads=threads
        )
        for threads in (1, 2)
    )
    assert first.to_dict() == parallel.to_dict()


def stopping(what: str, times: int = 1) -> tuple[list[str], Callable[[str], None]]:
    """The lines of progress, and what interrupts as Ctrl-C does at a line that has some words for the n-th time."""
    lines: list[str] = []

    def progress(text: str) -> None:
        lines.append(text)
        if sum(what in line for line in lines) == times and what in text:
            raise KeyboardInterrupt

    return lines, progress


def test_progress_counts_steps_and_names_the_leading_cause() -> None:
    lines: list[str] = []
    diagnose(
        make_observations(factor=1.05), JOINT, tolerances=TOLERANCES, causes=FEW, held_out=True, progress=lines.append
    )
    steps = [
        re.match(r"step (\d+) of about (\d+)(, about [\d.]+ (s|min|h) left)?(, leading so far: \w+)?", x) for x in lines
    ]
    assert all(steps)
    numbers = [int(one[1]) for one in steps if one]
    assert numbers == list(range(1, len(lines) + 1))
    assert all(int(one[2]) >= int(one[1]) for one in steps if one)
    assert all(one[3] for one in steps[3:] if one)
    assert any("leading so far: calibration gain, misfit 1." in line or "gain, misfit 0.9" in line for line in lines)
    # The count of the folds is known beforehand: the estimate at the first of them is near the end.
    first = next(i for i, line in enumerate(lines) if "held out" in line)
    assert int(steps[first][2]) == pytest.approx(len(lines), rel=0.4)  # type: ignore[index]


@pytest.mark.parametrize(
    ("what", "times", "tried"),
    [("the model as it is", 1, 0), ("no cause: ", 3, 3)],
)
def test_interruption_returns_a_preliminary_result(what: str, times: int, tried: int) -> None:
    """In the base fit, and beside the alternatives."""
    lines, progress = stopping(what, times)
    verdict = diagnose(
        make_observations(factor=1.05), JOINT, tolerances=TOLERANCES, causes=FEW, max_causes=1, progress=progress
    )
    assert not verdict.final
    assert verdict.verdict in ("undecided", "suspected", "ambiguous")
    assert len({one.id for one in verdict.candidates}) >= tried
    assert (verdict.candidates == ()) == (tried == 0)
    if tried == 3:
        assert (verdict.verdict, [one.id for one in verdict.causes]) == ("suspected", ["calibration_gain"])
    text = verdict.summary(1000)
    assert f"{verdict.verdict}, not final: " in text
    assert verdict.reasons[0].code == "causes_not_tried"
    assert f" in step {len(lines)} of about" in text
    assert ("not fitted yet" in text) == (tried == 0)
    written = json.loads(json.dumps(verdict.to_dict(), allow_nan=False))
    assert written["final"] is False
    assert verdict.modes == verdict.modes_after == ()
    assert written["settings"]["interrupted"]["step"] == len(lines)
    if tried in (0, 3):  # without a cause and with one
        assert "not final" in verdict.to_html()


def test_an_interruption_of_the_folds_keeps_the_verdict() -> None:
    _, progress = stopping("held out: 0.09")
    verdict = diagnose(
        make_observations(factor=1.05),
        JOINT,
        tolerances=TOLERANCES,
        causes=FEW,
        max_causes=1,
        held_out=True,
        progress=progress,
    )
    assert (verdict.final, verdict.verdict, [one.id for one in verdict.causes]) == (
        False,
        "named",
        ["calibration_gain"],
    )
    assert [one["configuration"] for one in verdict.gains[0].folds] == ["0.05", "0.07"]
    assert verdict.reasons[0].code == "interrupted"
    assert any("all causes were tried" in note for note in verdict.notes)


def test_invalid_input_is_an_error() -> None:
    with pytest.raises(ValueError, match='no cause "gremlins"'):
        diagnose(make_observations(), JOINT, causes=["gremlins"])
    bare = Observation(
        assembly=make_assembly(0.05), frequency_hz=LINES, receptance=make_assembly(0.05).receptance(LINES)
    )
    with pytest.raises(ValueError, match="no standard deviation"):
        diagnose([bare], JOINT)


def test_derivatives_of_gain_delay_window_moves_and_multiples() -> None:
    observations = make_observations(overhangs=(0.05, 0.07))
    unknowns = [
        Unknown(address="joint.k_y", lower=1e6, upper=1e11, start=5e8),
        Unknown(address="joint.k_theta", lower=1e2, upper=1e8, start=8e4, multiple=0.5, also={"joint.c_theta": 1e-5}),
        Unknown(address="observation.log_gain", lower=-1.0, upper=1.0, start=0.02),
        Unknown(address="observation.delay", lower=-1e-3, upper=1e-3, start=1e-5),
        Unknown(address="observation.decay_rate", lower=0.0, upper=100.0, start=12.0, scale="linear"),
        Move(
            address="shift",
            lower=-1.0,
            upper=1.0,
            start=0.1,
            moves={"tool.segment[0].density": 1.0, "joint.k_y": -1.0},
            relative=True,
        ),
    ]
    parameters = Parameters(unknowns, (), [one.site(i) for i, one in enumerate(observations)])
    problem = Task(tuple(observations), parameters, ("standard deviations",) * 2).problem()
    x = problem.variables.start
    slopes = problem.jacobian(x).copy()
    for column, step in enumerate((1e-5, 1e-5, 1e-6, 1e-10, 1e-3, 1e-5)):
        e = np.zeros(x.size)
        e[column] = step
        difference = (problem.value(x + e) - problem.value(x - e)) / (2.0 * step)
        np.testing.assert_allclose(slopes[:, column], difference, atol=1e-6 * np.abs(slopes[:, column]).max())


ELSEWHERE = {
    "flexible_body",
    "contact_distribution",
    "joint_amplitude",
    "xy_asymmetry",
    "coarse_resolution",
    "spindle_mode",
}
"""They need other models than a tool in a free holder at one level, or records that break off."""
SIZED = sorted(id for id, one in CATALOGUE.items() if id not in ELSEWHERE and not one.changes_data)


DECAYING = LINES - 1j * 60.0
"""Lines of a window that decays fast: no resonance is so sharp that a trace of something shows there."""
PLACES = (
    Coordinate("tool", 0.0),
    Coordinate("tool", 0.02),
    Coordinate("holder", 0.03),
    Coordinate("holder", 0.1),
    Coordinate("holder", "end"),
)


def make_stepped_assembly(
    overhang: float, *, tool: tuple[Segment, ...] = (), joint: Any = None, cut: float = 0.0
) -> Assembly:
    """A tool in a holder of two sections, with masses on both; `cut` is taken off the holder's beginning."""
    blank = tool or (Segment(length=overhang, outer_diameter=0.012, material=CARBIDE),)
    sections = [
        Segment(length=0.05 - cut, outer_diameter=0.045, material=STEEL),
        Segment(length=0.08, outer_diameter=0.06, material=STEEL),
    ]
    point = joint or PointJoint(k_y=6e8, k_theta=1e5, c_y=300.0, c_theta=1.0, name="joint")
    masses = [
        PointMass(mass=0.02, part="holder", position=0.06 - cut, name="screw"),
        PointMass(mass=0.002, part="tool", position=0.015, name="ring"),
    ]
    return Assembly([Part(blank, name="tool"), point, Part(sections, name="holder")], masses)


def of_places(truth: Assembly, response: Coordinate, excitation: Coordinate, cut: float = 0.0) -> Observation:
    """Return an FRF of a truth whose holder begins later by `cut`, stated as of the plain assembly of 50 mm."""

    def shifted(place: Coordinate) -> Coordinate:
        fixed = place.part != "holder" or place.position == "end"
        return place if fixed else replace(place, position=place.position - cut)

    return Observation(
        assembly=make_stepped_assembly(0.05),
        frequency_hz=DECAYING,
        receptance=truth.receptance(DECAYING, response=shifted(response), excitation=shifted(excitation)),
        response=response,
        excitation=excitation,
        standard_deviation=0.01,
        label=f"{response} {excitation}",
        configuration="short",
    )


def relative_error(model: Model, values: Mapping[str, float]) -> np.ndarray:
    """Residuals in standard deviations, without priors."""
    problem = model.task.problem()
    names = problem.variables.names
    start = dict(zip(names, problem.variables.to_values(problem.variables.start), strict=True))
    assert set(values) <= set(start), (set(values), set(start))
    x = problem.variables.from_values(np.array([{**start, **values}[name] for name in names]))
    return problem.residual(x)[: 2 * DECAYING.size * len(model.observations)]


@pytest.mark.parametrize("name", sorted(set(SIZED) - {"joint_spread"}))
@pytest.mark.parametrize("witnessed", [True, False])
def test_cause_of_zero_size_moves_no_position(name: str, witnessed: bool) -> None:
    """Responses, hits and masses on tool and holder keep their positions if a cause changes lengths.

    A spread joint begins with a tenth of a millimetre, which the next test compares exactly.
    """
    pairs = [(one, PLACES[0]) for one in PLACES] + [(one, one) for one in PLACES[1:]]
    model = Model(tuple(of_places(make_stepped_assembly(0.05), *pair) for pair in pairs), tuple(STARTED))
    model = model.with_witnesses() if witnessed else model
    try:
        extensions = CATALOGUE[name].extensions(model)
    except UndecidableError:
        assert name == "joint_overhang_law"  # one overhang
        return
    for variant, extended in extensions:
        assert np.abs(relative_error(extended, {})).max() < 0.3, variant.name


LAYER = SpreadJoint(
    length=0.02,
    shank=Section(outer_diameter=0.012, material=CARBIDE),
    sleeve=Section(outer_diameter=0.045, inner_diameter=0.012, material=STEEL),
    k_y=6e8,
    k_theta=1e5,
    c_y=300.0,
    c_theta=1.0,
    name="joint",
)


def make_fluted_tool(length: float) -> tuple[Segment, ...]:
    return (
        Segment(length=length, outer_diameter=0.011, material=CARBIDE),
        Segment(length=0.05 - length, outer_diameter=0.012, material=CARBIDE),
    )


@pytest.mark.parametrize(
    ("cause", "variant", "values", "truth", "cut"),
    [
        (
            "joint_spread",
            "2 points",
            {"length": 0.0},
            {"joint": replace(LAYER, length=1e-4, points=2), "cut": 1e-4},
            1e-4,
        ),
        ("joint_spread", "layer", {"length": 0.0199}, {"joint": LAYER, "cut": 0.02}, 0.02),
        (
            "joint_spread",
            "4 points, uneven",
            {"length": 0.0199, "slope": -0.6},
            {"joint": replace(LAYER, points=4, slope=-0.6), "cut": 0.02},
            0.02,
        ),
        ("overhang_error", "all", {"length": 1e-3}, {"overhang": 0.051}, 0.0),
        (
            "fluted_part",
            "from the tip",
            {"length": 0.01 - 1e-5, "log_diameter": np.log(11 / 12)},
            {"tool": make_fluted_tool(0.01)},
            0.0,
        ),
        (
            "fluted_part",
            "from the tip, ending beyond 20 mm",
            {"length beyond 20 mm": 0.01 - 1e-5, "log_diameter": np.log(11 / 12)},
            {"tool": make_fluted_tool(0.03)},
            0.0,
        ),
    ],
)
def test_places_stay_where_they_are_as_a_length_changes(
    cause: str, variant: str, values: dict[str, float], truth: dict[str, Any], cut: float
) -> None:
    """The model with the cause equals the assembly written with it, at the same coordinates."""
    pairs = [(one, PLACES[0]) for one in PLACES] + [(one, one) for one in PLACES[1:]]
    data = make_stepped_assembly(truth.pop("overhang", 0.05), **truth)
    model = Model(tuple(of_places(data, *pair, cut=cut) for pair in pairs), tuple(STARTED))
    extended = extended_by(model, cause, variant)
    requested = {f"{cause}.{name}": value for name, value in values.items()}
    bounds = {unknown.name: (unknown.lower, unknown.upper) for unknown in extended.unknowns}
    assert all(bounds[name][0] <= value <= bounds[name][1] for name, value in requested.items())
    assert any(values.values()) == (np.abs(relative_error(extended, {})).max() > 1.0)
    assert np.abs(relative_error(extended, requested)).max() < 1e-4


@pytest.mark.parametrize(
    ("part", "position", "moved"), [("tool", 0.02, 3e-3), ("tool", 0.02, -3e-3), ("holder", 0.05, 4e-3)]
)
def test_only_hits_move(part: str, position: float, moved: float) -> None:
    """Neither the response at the same place nor a real step between two sections goes with the hammer."""
    place = Coordinate(part, position)
    data = [
        replace_excitation(of_places(make_stepped_assembly(0.05), response, Coordinate(part, position + moved)), place)
        for response in (PLACES[0], place)
    ]
    model = Model(tuple(data), tuple(STARTED))
    side = "farther from the tip" if moved > 0.0 else "nearer to the tip"
    name = f"on {part} at {1e3 * position:g} mm, {side}"
    extended = extended_by(model, "hammer_offset", name)
    small = 5e-6 if moved > 0.0 else -5e-6
    assert np.abs(relative_error(extended, {})).max() > 1.0
    assert np.abs(relative_error(extended, {"hammer_offset.distance": moved - small})).max() < 1e-4


def replace_excitation(one: Observation, place: Coordinate) -> Observation:
    return altered(one, excitation=place)


def test_hits_move_along_flutes() -> None:
    """Hits with an offset from the tip, of a tool with unmodelled flutes: two lengths at once."""
    hit = Coordinate("tool", 2e-3)
    data = replace_excitation(
        of_places(make_stepped_assembly(0.05, tool=make_fluted_tool(0.01)), PLACES[0], hit), PLACES[0]
    )
    model = Model((data,), tuple(STARTED))
    for cause, variant in (("fluted_part", "from the tip"), ("hammer_offset", "on tool at 0 mm")):
        model = extended_by(model, cause, variant)
    values = {
        "fluted_part.length": 0.01 - 1e-5,
        "fluted_part.log_diameter": np.log(11 / 12),
        "hammer_offset.distance": 2e-3 - 5e-6,
    }
    assert np.abs(relative_error(model, values)).max() < 1e-4


@pytest.mark.slow
def test_a_spread_joint_is_named_with_a_response_on_the_holder() -> None:
    rng = np.random.default_rng(3)
    far, lines = Coordinate("holder", 0.1), LINES[::2]

    def measured_at(overhang: float, response: Coordinate) -> Observation:
        truth = make_stepped_assembly(overhang, joint=replace(LAYER, k_theta=1e4), cut=0.02)
        there = response if response.part == "tool" else replace(response, position=0.08)
        noise = 0.01 * (rng.normal(size=lines.size) + 1j * rng.normal(size=lines.size))
        return Observation(
            assembly=make_stepped_assembly(overhang),
            frequency_hz=lines,
            receptance=truth.receptance(lines, response=there, excitation=PLACES[0]) * np.exp(noise),
            response=response,
            standard_deviation=0.0105,
            label=f"{overhang} {response.part}",
            configuration=f"{overhang}",
        )

    observations = [measured_at(x, place) for x in (0.05, 0.07, 0.09) for place in (PLACES[0], far)]
    few = ["joint_spread", "sensor_mass", "overhang_error", "hammer_offset"]
    verdict = diagnose(observations, JOINT, tolerances=TOLERANCES, causes=few, max_causes=1)
    assert (verdict.verdict, [one.id for one in verdict.causes]) == ("named", ["joint_spread"])
    _, low, high = verdict.causes[0].parameters["joint_spread.length"]
    assert low < 0.02 < high
    # A tool with another overhang, without a measurement on the holder.
    predicted = verdict.at(make_stepped_assembly(0.06)).natural_frequencies(6000.0)
    found = predicted.predicted_hz
    truth = make_stepped_assembly(0.06, joint=replace(LAYER, k_theta=1e4), cut=0.02)
    np.testing.assert_allclose(found, truth.natural_frequencies(6000.0), rtol=2e-3)


def test_response_within_the_contact_excludes_a_spread_joint() -> None:
    nose = Coordinate("holder", 0.0)
    observations = [
        of_places(make_stepped_assembly(0.05), PLACES[0], PLACES[0]),
        of_places(make_stepped_assembly(0.05), nose, nose),
    ]
    with pytest.raises(UndecidableError, match="holder at 0 mm"):
        CATALOGUE["joint_spread"].extensions(Model(tuple(observations), tuple(STARTED)))
    verdict = diagnose(observations, STARTED, causes=["joint_spread", "calibration_gain"], max_causes=1)
    assert "holder at 0 mm" in verdict.undecidable["joint_spread"]
