"""Diagnosis: causes, verdicts and what is said where data cannot decide, on the package's own simulator."""

from __future__ import annotations

import json

import numpy as np
import pytest

from receptance import (
    CARBIDE,
    FRF,
    STEEL,
    Assembly,
    Coordinate,
    MeasuredFrequencies,
    MeasuredFRF,
    Part,
    PointJoint,
    PointMass,
    Segment,
    Unknown,
)
from receptance.diagnosis import CATALOGUE, Model, UndecidableError, diagnose
from receptance.identification import Move, Tolerance
from receptance.identification.mapping import Parameters
from receptance.identification.observations import altered
from receptance.identification.task import Task, place_of

LINES = np.linspace(200.0, 6000.0, 300)
FEW = ("sensor_mass", "tool_modulus", "calibration_gain")
JOINT = [
    Unknown(address="joint.k_y", lower=1e6, upper=1e11),
    Unknown(address="joint.k_theta", lower=1e2, upper=1e8),
    Unknown(address="joint.c_y", lower=1e-1, upper=1e6),
    Unknown(address="joint.c_theta", lower=1e-4, upper=1e3),
]
TOLERANCES = [Tolerance(name="carbide", moves={"tool.segment[*].youngs_modulus": 0.005}, relative=True)]


def assembled(overhang: float, *masses: PointMass) -> Assembly:
    tool = Part([Segment(length=overhang, outer_diameter=0.012, material=CARBIDE)], name="tool")
    holder = Part([Segment(length=0.13, outer_diameter=0.045, material=STEEL)], name="holder")
    joint = PointJoint(k_y=6e8, k_theta=1e5, c_y=300.0, c_theta=1.0, name="joint")
    return Assembly([tool, joint, holder], masses)


def observed(
    *masses: PointMass, factor: np.ndarray | float = 1.0, overhangs: tuple[float, ...] = (0.05, 0.07, 0.09)
) -> list[MeasuredFRF]:
    rng = np.random.default_rng(11)
    return [
        MeasuredFRF(
            assembly=assembled(x),
            frequency_hz=LINES,
            receptance=assembled(x, *masses).receptance(LINES)
            * factor
            * np.exp(0.01 * (rng.normal(size=LINES.size) + 1j * rng.normal(size=LINES.size))),
            standard_deviation=0.01,
            label=f"{x}",
        )
        for x in overhangs
    ]


def test_nothing_hidden_is_adequate() -> None:
    verdict = diagnose(observed(), JOINT, tolerances=TOLERANCES, causes=FEW)
    assert verdict.verdict == "adequate"
    assert verdict.causes == ()
    assert verdict.extended is None


def alike(share: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return standard normal numbers of which as many neighbours are alike as it says."""
    total = np.cumsum(np.pad(rng.normal(size=share.size + int(share.max())), (1, 0)))
    first = np.arange(share.size)
    return np.asarray((total[first + share] - total[first]) / np.sqrt(share))


def test_lines_that_are_correlated_unequally_are_adequate() -> None:
    # A third of the lines err as one of 24 neighbours, the others alone: 2 sum(1 / c) is expected of chi-square.
    rng = np.random.default_rng(3)
    correlated = np.where(np.arange(LINES.size) < 100, 24, 1)
    data = []
    for x in (0.05, 0.07, 0.09):
        noise = 0.01 * (alike(correlated, rng) + 1j * alike(correlated, rng))
        values = assembled(x).receptance(LINES) * np.exp(noise)
        frf = FRF(frequency_hz=LINES, values=values, log_variance=1e-4, correlated_lines=correlated)
        data.append(MeasuredFRF.from_frf(assembled(x), frf, label=f"{x}"))
    assert [one.independent_lines for one in data] == pytest.approx([200.0 + 100.0 / 24.0] * 3)
    verdict = diagnose(data, JOINT, tolerances=TOLERANCES, causes=FEW, most=1)
    assert verdict.verdict == "adequate"
    assert verdict.adequacy.misfit == pytest.approx(1.0, abs=0.15)
    assert verdict.adequacy.smooth < 1.25
    assert verdict.base.independent_lines == pytest.approx(612.5)
    worst = verdict.adequacy.worst[0]
    assert worst.misfit < 6.0, worst


def test_too_few_numbers_judge_nothing() -> None:
    true = assembled(0.07)
    found = true.natural_frequencies(60e3)
    for count, answer in ((2, "undecided"), (4, "adequate")):
        seen = MeasuredFrequencies(assembly=true, frequency_hz=found[:count], standard_deviation_hz=5.0)
        verdict = diagnose(seen, JOINT[1], tolerances=TOLERANCES, causes=["tool_density", "sensor_mass"], most=1)
        assert verdict.verdict == answer
    seen = MeasuredFrequencies(assembly=true, frequency_hz=found[:2], standard_deviation_hz=5.0)
    verdict = diagnose(seen, JOINT[1], causes=["tool_density", "sensor_mass"], most=1)
    assert verdict.adequacy.misfit < 1e-3
    assert "1 degree of freedom is left, fewer than the 3 it takes" in verdict.summary()
    assert "Nothing can be judged" in verdict.summary()
    assert verdict.next_measurement is not None
    # What one degree of freedom is enough to refute is refuted, but no cause is named for it.
    seen = MeasuredFrequencies(assembly=true, frequency_hz=found[:2] * [1.0, 0.9], standard_deviation_hz=5.0)
    verdict = diagnose(seen, JOINT[1], causes=["tool_density", "sensor_mass"], most=1)
    assert verdict.verdict in ("unexplained", "suspected", "ambiguous")


def test_a_gain_is_named_with_its_size_and_kept_out_of_predictions() -> None:
    verdict = diagnose(observed(factor=1.05), JOINT, tolerances=TOLERANCES, causes=FEW)
    assert [one.id for one in verdict.causes] == ["calibration_gain"]
    assert verdict.verdict == "named"
    value, low, high = verdict.causes[0].parameters["calibration_gain.log_gain"]
    assert low < np.log(1.05) < high
    assert value == pytest.approx(np.log(1.05), abs=2e-3)
    found, _ = verdict.predict_natural_frequencies(assembled(0.06), 6000.0)
    np.testing.assert_allclose(found, assembled(0.06).natural_frequencies(6000.0), rtol=2e-3)
    assert json.loads(json.dumps(verdict.to_dict(), allow_nan=False))["verdict"] == "named"
    assert "calibration_gain" in verdict.summary()


def test_causes_of_the_chain_are_of_the_frfs_alone_beside_natural_frequencies() -> None:
    frequencies = [
        MeasuredFrequencies(
            assembly=assembled(x),
            frequency_hz=assembled(x).natural_frequencies(6000.0),
            standard_deviation_hz=2.0,
            label=f"{x}",
        )
        for x in (0.06, 0.08)
    ]
    chain = ["calibration_gain", "time_delay", "exponential_window", "hammer_offset", "wrong_quantity", "sensor_mass"]
    for seen in (observed(factor=1.05, overhangs=(0.07,)), observed(factor=1.05)):
        verdict = diagnose([*seen, *frequencies], JOINT, tolerances=TOLERANCES, causes=chain, most=1)
        assert [one.id for one in verdict.causes] == ["calibration_gain"]
        (_, low, high), *_ = verdict.causes[0].parameters.values()
        assert low < np.log(1.05) < high
        assert any("by the FRFs alone" in note for note in verdict.notes)


def test_hits_beside_the_tip_are_found_beside_hits_at_the_nose() -> None:
    """An offset belongs to the place where it was hit; with another FRF it is still looked for."""
    rng = np.random.default_rng(2)
    nose = Coordinate("holder", 0.0)

    def seen(overhang: float, place: Coordinate, hit: Coordinate) -> MeasuredFRF:
        noise = 0.01 * (rng.normal(size=LINES.size) + 1j * rng.normal(size=LINES.size))
        values = assembled(overhang).receptance(LINES, response=place, excitation=hit) * np.exp(noise)
        return MeasuredFRF(
            assembly=assembled(overhang),
            frequency_hz=LINES,
            receptance=values,
            response=place,
            excitation=place,
            standard_deviation=0.0105,
            label=f"{overhang} {place.part}",
            configuration=f"{overhang}",
        )

    tip, beside = Coordinate("tool", 0.0), Coordinate("tool", 4e-4)
    observations = [seen(x, tip, beside) for x in (0.05, 0.07)] + [seen(0.05, nose, nose)]
    causes = ["hammer_offset", "sensor_mass", "fluted_part"]
    verdict = diagnose(observations, JOINT, tolerances=TOLERANCES, causes=causes, most=1)
    assert verdict.verdict == "named"
    assert [(one.id, one.variant) for one in verdict.causes] == [("hammer_offset", "on tool at 0 mm")]
    _, low, high = verdict.causes[0].parameters["hammer_offset.distance"]
    assert low < 4e-4 < high


def test_one_configuration_convicts_no_part() -> None:
    # The same blank has another modulus than any tolerance would allow, and only one overhang was measured.
    stiffer = [
        MeasuredFRF(
            assembly=one.assembly,
            frequency_hz=LINES,
            receptance=one.assembly.replace(
                {"tool.segment[0].youngs_modulus": 1.15 * CARBIDE.youngs_modulus}
            ).receptance(LINES)
            * np.exp(0.01 * np.random.default_rng(5).normal(size=LINES.size)),
            standard_deviation=0.01,
            label="only one",
        )
        for one in observed(overhangs=(0.08,))
    ]
    verdict = diagnose(stiffer, JOINT, tolerances=TOLERANCES, causes=["tool_modulus"], most=1)
    assert verdict.verdict != "named"
    assert any("one configuration" in note for note in verdict.notes)


@pytest.mark.parametrize("listed", [False, True])
def test_one_mode_convicts_no_part(listed: bool) -> None:
    """Of each overhang only the first mode was measured: lines around it, or its frequency alone."""
    rng = np.random.default_rng(6)
    seen: list[MeasuredFRF | MeasuredFrequencies] = []
    for x in (0.05, 0.06, 0.07, 0.08, 0.09):
        true = assembled(x).replace({"tool.segment[0].density": 1.1 * CARBIDE.density})
        first, second = true.natural_frequencies(12000.0)[:2]
        if listed:
            own = first * (1.0 + 3e-4 * rng.normal())
            spread = 3e-4 * own
            seen.append(MeasuredFrequencies(assembly=assembled(x), frequency_hz=[own], standard_deviation_hz=spread))
            continue
        lines = np.linspace(0.6 * first, min(1.4 * first, 0.9 * second), 120)
        noise = 0.01 * (rng.normal(size=lines.size) + 1j * rng.normal(size=lines.size))
        values = true.receptance(lines) * np.exp(noise)
        seen.append(
            MeasuredFRF(assembly=assembled(x), frequency_hz=lines, receptance=values, standard_deviation=0.0105)
        )
    seen = [altered(one, label=f"{i}") for i, one in enumerate(seen)]
    verdict = diagnose(seen, JOINT, tolerances=TOLERANCES, causes=["tool_density"], most=1)
    assert verdict.verdict != "named"
    assert any("one mode" in note for note in verdict.notes)
    if verdict.verdict != "adequate":
        assert "second mode" in str(verdict.next_measurement)
    several = diagnose(observed(), JOINT, tolerances=TOLERANCES, causes=["tool_density"], most=1)
    assert not any("one mode" in note for note in several.notes)


def test_what_data_cannot_decide_says_what_is_missing() -> None:
    model = Model(tuple(observed()), tuple(JOINT))
    with pytest.raises(UndecidableError, match="force"):
        CATALOGUE["joint_amplitude"].variants(model)
    verdict = diagnose(observed(), JOINT, tolerances=TOLERANCES, causes=["joint_amplitude", "sensor_mass"], most=1)
    assert "force" in verdict.undecidable["joint_amplitude"]


def test_implausible_sizes_are_vetoed_aloud() -> None:
    verdict = diagnose(observed(PointMass(mass=0.06)), JOINT, tolerances=TOLERANCES, causes=["sensor_mass"], most=1)
    assert verdict.verdict == "unexplained"
    assert any("vetoed" in note for note in verdict.notes)


@pytest.mark.parametrize("threads", [1, 2])
def test_the_same_seed_gives_the_same_answer(threads: int) -> None:
    first = diagnose(observed(factor=1.02), JOINT, tolerances=TOLERANCES, causes=FEW, most=1, threads=1)
    again = diagnose(observed(factor=1.02), JOINT, tolerances=TOLERANCES, causes=FEW, most=1, threads=threads)
    assert first.to_dict() == again.to_dict()


def test_bad_input_is_told() -> None:
    with pytest.raises(ValueError, match="no cause 'gremlins'"):
        diagnose(observed(), JOINT, causes=["gremlins"])
    bare = MeasuredFRF(assembly=assembled(0.05), frequency_hz=LINES, receptance=assembled(0.05).receptance(LINES))
    with pytest.raises(ValueError, match="no standard deviation"):
        diagnose([bare], JOINT)


def test_derivatives_of_gain_delay_window_moves_and_multiples() -> None:
    observations = observed(overhangs=(0.05, 0.07))
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
    parameters = Parameters(unknowns, (), [place_of(one, i) for i, one in enumerate(observations)])
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


@pytest.mark.parametrize("name", sorted(set(CATALOGUE) - ELSEWHERE))
def test_every_cause_is_nothing_at_its_null(name: str) -> None:
    model = Model(tuple(observed()), tuple(JOINT), tuple(TOLERANCES))
    problem = model.task().problem()
    before = problem.residual(problem.variables.start).copy()
    for variant in CATALOGUE[name].variants(model):
        if variant.fresh or "insertion" in variant.name or name in ("joint_spread", "fluted_part"):
            continue
        there = variant.model.task().problem()
        after = there.residual(there.variables.start)
        # A hit or a collet has to be somewhere, so that there is a trace of it at sharp resonances.
        change = np.abs(after[: before.size - 1] - before[:-1])
        assert np.median(change) < 0.02
        assert change.max() < 2.0
