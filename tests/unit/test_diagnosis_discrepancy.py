"""The discrepancy of a model: its estimate, fits that allow for it, and causes that explain data partly.

The wrong model is made without the program: the frequency axis of its receptance is stretched smoothly, by
another share at each mode, and its level is changed smoothly.
"""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np
import pytest

from receptance import CARBIDE, STEEL, Assembly, Material, Observation, Part, PointJoint, PointMass, Segment
from receptance.diagnosis import Model, diagnose
from receptance.diagnosis.fitting import fit_base, fit_discrepancy
from receptance.diagnosis.judgement import conclude, confirmed
from receptance.diagnosis.thresholds import MARGIN
from receptance.fit import Tolerance, Unknown, identify
from receptance.fit.adequacy import Strain
from receptance.fit.discrepancy import Discrepancy, curve_of
from receptance.fit.observation import altered

LINES = np.linspace(200.0, 8000.0, 600)
OVERHANGS = (0.05, 0.065, 0.08, 0.095)
SEED = 20261123
CAUSES = ("sensor_mass", "calibration_gain", "time_delay", "tool_modulus", "hammer_offset", "suspension")


def assembled(overhang: float, *masses: PointMass, carbide: Material = CARBIDE) -> Assembly:
    """Return a tool in a holder."""
    tool = Part([Segment(length=overhang, outer_diameter=0.016, material=carbide)], name="tool")
    holder = Part(
        [
            Segment(length=0.04, outer_diameter=0.05, inner_diameter=0.016, material=STEEL, core=CARBIDE),
            Segment(length=0.09, outer_diameter=0.044, material=STEEL),
        ],
        name="holder",
    )
    joint = PointJoint(k_y=4e8, k_theta=9e4, c_y=250.0, c_theta=0.3, name="joint")
    return Assembly([tool, joint, holder], masses)


def wrong(exact, modes_hz, frequency: float, level: float, rng: np.random.Generator):
    """Return a receptance whose modes have errors of frequency and of level with standard deviations."""
    shift = np.interp(LINES, modes_hz, frequency * rng.normal(size=len(modes_hz)))
    factor = rng.normal(size=len(modes_hz)) + 1j * rng.normal(size=len(modes_hz))
    return exact(LINES * (1.0 + shift)) * np.exp(level * np.interp(LINES, modes_hz, factor))


def observed(frequency: float, level: float, *masses: PointMass, seed: int = SEED, noise: float = 0.005):
    """Return the four overhangs, measured on a structure that no parameter of the model describes."""
    print("seed", seed)
    rng = np.random.default_rng(seed)
    found = []
    for overhang in OVERHANGS:
        true = assembled(overhang, *masses)
        data = wrong(true.receptance, true.natural_frequencies(9e3), frequency, level, rng)
        data *= np.exp(noise * (rng.normal(size=LINES.size) + 1j * rng.normal(size=LINES.size)))
        name = f"{1e3 * overhang:.0f} mm"
        found.append(
            Observation(
                assembly=assembled(overhang),
                frequency_hz=LINES,
                receptance=data,
                standard_deviation=noise,
                label=name,
                configuration=name,
            )
        )
    return tuple(found)


JOINT = (
    Unknown(address="joint.k_y", lower=1e6, upper=1e11, start=1e8),
    Unknown(address="joint.k_theta", lower=1e2, upper=1e8, start=3e4),
    Unknown(address="joint.c_y", lower=1e-1, upper=1e6, start=100.0),
    Unknown(address="joint.c_theta", lower=1e-4, upper=1e3, start=0.1),
)
TOLERANCES = (
    Tolerance(name="tool modulus", moves={"tool.segment[*].youngs_modulus": 0.01}, relative=True),
    Tolerance(name="holder modulus", moves={"holder.segment[*].youngs_modulus": 0.01}, relative=True),
)


@pytest.mark.parametrize(("frequency", "level"), [(0.003, 0.03), (0.01, 0.03), (0.003, 0.15)])
def test_the_estimate_is_close_to_the_errors_that_were_made(frequency, level):
    model = Model(observed(frequency, level), JOINT, TOLERANCES, threads=1).resonant()
    estimate = fit_discrepancy(model, fit_base(model).values)
    found, fit = estimate.discrepancy, estimate.fit
    print(found, "made", frequency, level)
    assert found.relative is not None
    # Some ten modes show each of them, and the joint absorbs a part.
    assert 0.4 < found.frequency / frequency < 2.5
    assert 0.4 < found.relative / level < 2.5
    assert 0.5 < fit.misfit < 2.0


def test_errors_within_a_mode_are_no_errors_of_natural_frequencies():
    """Ripples of 900 Hz: level and frequency of each mode do not describe them, and must not take them either."""
    observations = [
        altered(one, receptance=one.receptance * np.exp(0.2 * (np.sin(phase + k) + 1j * np.cos(phase + 2 * k))))
        for phase in [2.0 * np.pi * LINES / 900.0]
        for k, one in enumerate(observed(0.001, 0.01))
    ]
    model = Model(tuple(observations), JOINT, TOLERANCES, threads=1).resonant()
    found = fit_discrepancy(model, fit_base(model).values).discrepancy
    print(found)
    assert 0.1 < found.relative < 0.2
    assert found.frequency < 0.004


def test_intervals_of_the_joint_include_the_discrepancy():
    """Without it the joint misses the truth by many standard errors, with it by a few."""
    model = Model(observed(0.005, 0.05), JOINT, TOLERANCES, threads=1).resonant()
    base = fit_base(model)
    fit = fit_discrepancy(model, base.values).fit
    true = {"joint.k_y": 4e8, "joint.k_theta": 9e4}
    away = [
        max(
            abs(np.log(one.identification.values[name] / value))
            * one.identification.values[name]
            / one.identification.standard_errors[name]
            for name, value in true.items()
        )
        for one in (base, fit)
    ]
    print("standard errors away, without and with the discrepancy:", away)
    assert away[0] > 8.0
    assert away[1] < 4.0


def test_identify_and_diagnose_state_the_same_intervals():
    data = observed(0.005, 0.05)
    fit = identify(data, JOINT, tolerances=TOLERANCES, starts=1, strategy="staged")
    base = diagnose(data, JOINT, tolerances=TOLERANCES, causes=["time_delay"], fast=True).base
    assert fit.rejection.widened
    assert base.discrepancy.is_close(fit.discrepancy)
    assert base.scatter_freedom == pytest.approx(fit.scatter_freedom, rel=0.05)
    for unknown in JOINT:
        assert base.values[unknown.address] == pytest.approx(fit.values[unknown.address], rel=2e-3)
        assert base.interval(unknown.address) == pytest.approx(fit.interval(unknown.address), rel=0.02)


def test_lines_of_a_mode_count_once():
    model = Model(observed(0.005, 0.05), JOINT, TOLERANCES, threads=1)
    large = model.allow(Discrepancy(0.01, 0.05))
    small = model.allow(Discrepancy(1e-9, 1e-9))
    modes = [one.assembly.natural_frequencies(8e3).size for one in model.observations]
    for one, few, same, count in zip(model.observations, large.observations, small.observations, modes, strict=True):
        # Two numbers of level, and one of frequency, for each mode; a mode has some lines of either kind.
        assert few.independent_values == pytest.approx(3 * count, rel=0.01)
        assert same.independent_values == pytest.approx(one.independent_values, rel=1e-3)
        np.testing.assert_allclose(same.standard_deviation, one.standard_deviation, rtol=1e-3)
        assert np.all(few.standard_deviation > one.standard_deviation)


@functools.cache
def with_sensor(seed):
    """Diagnose data of a wrong model with a sensor that is not stated, held-out configurations included."""
    sensor = PointMass(mass=6e-3, part="tool", position=0.0)
    return diagnose(
        observed(0.001, 0.01, sensor, seed=seed), JOINT, tolerances=TOLERANCES, causes=CAUSES, held_out=True
    )


@pytest.mark.slow
def test_a_cause_takes_at_least_half_of_the_misfit():
    selection = with_sensor(1).selection
    best = selection.explanations[0]

    def answer(*explanations):
        return conclude(replace(selection, explanations=list(explanations), alternatives=[])).answer

    assert selection.share(best) > 0.5
    assert answer(best) == "partly explained"
    half = best.with_gain(0.6 * selection.beside.errors)
    assert selection.share(half) < 0.5
    assert answer(replace(half, evidence=best.evidence)) == "unexplained"
    # Partly explained claims less than named, so that evidence just above the threshold suffices.
    just_above = replace(best, evidence=selection.threshold + 0.1)
    assert answer(just_above) == "partly explained"
    assert answer(replace(best, evidence=selection.threshold - 0.1)) == "unexplained"
    # A plausible rival within the margin counts, although it is below the threshold itself.
    rival = replace(selection.explanations[1], evidence=selection.threshold - 1.0)
    assert answer(just_above, rival) == "unexplained"
    assert answer(just_above, replace(rival, evidence=selection.threshold - MARGIN)) == "partly explained"
    # Another structural error may look the same.
    (variant,) = best.variants
    vague = replace(best, variants=(variant.of(replace(variant.cause, unspecific=True)),))
    assert answer(vague, *selection.explanations[1:]) == "unexplained"
    # In some records alone a discrepancy and many errors of them look the same.
    model = best.fit.model
    labels = tuple(one.label for one in model.observations[:2])
    unknowns = tuple(replace(one, labels=labels) if one.name in best.parameters else one for one in model.unknowns)
    some = replace(best, fit=replace(best.fit, model=replace(model, unknowns=unknowns)))
    judgement = conclude(replace(selection, explanations=[some], alternatives=[]))
    assert (judgement.answer, judgement.reasons[0].code) == ("unexplained", "share_of_some")
    # Without a discrepancy the cause must be in the best explanation, alone or beside others.
    other = selection.explanations[1]
    partly = conclude(replace(selection, explanations=[best], alternatives=[]))
    both = replace(best, variants=(*other.variants, *best.variants))
    for plain, expected in ((best, "partly explained"), (both, "partly explained"), (other, "unexplained")):
        judgement = confirmed(partly, replace(selection, discrepancy=None, explanations=[plain]))
        assert judgement.answer == expected
    assert (judgement.reported, judgement.reasons[-1].code) == ((), "share_unconfirmed")
    assert str(judgement.reasons[-1]).endswith(f", but without a discrepancy {other.title} explains the data best")
    # Tolerances absorb a part of a discrepancy: their strain is no objection.
    strained = replace(best, fit=replace(best.fit))
    strained.fit.__dict__["adequacy"] = replace(best.adequacy, strain=Strain((("modulus", 9.0),), chance=1e-9))
    assert answer(strained, *selection.explanations[1:]) == "partly explained"


def test_wrong_damping_ratios_are_a_discrepancy_of_their_own():
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    observations = []
    for overhang in OVERHANGS:
        frequencies = assembled(overhang).natural_frequencies(8e3)
        ratios = np.full(frequencies.size, 0.01)
        observations.append(
            Observation.from_modes(
                assembly=assembled(overhang),
                frequency_hz=frequencies * (1.0 + 0.005 * rng.normal(size=frequencies.size)),
                standard_deviation_hz=1.0,
                damping_ratio=ratios * np.exp(0.5 * rng.normal(size=ratios.size)),
                standard_deviation_damping=0.02 * ratios,
                label=f"{overhang}",
            )
        )
    model = Model(tuple(observations), JOINT, TOLERANCES, threads=1)
    estimate = fit_discrepancy(model, fit_base(model).values)
    found, fit = estimate.discrepancy, estimate.fit
    print(found, fit.misfit)
    assert found.frequency < 0.02
    assert 0.1 < found.damping < 1.0
    assert str(found).endswith("in damping ratios")
    for one, wide in zip(observations, fit.model.observations, strict=True):
        expected = np.hypot(one.standard_deviation_damping, found.damping * one.damping_ratio)
        np.testing.assert_allclose(wide.standard_deviation_damping, expected)


def test_wrong_shares_of_modes_have_the_stated_growth_beside_peaks():
    """Three modes without the program; each has an error of 1 %, which is larger where they nearly cancel."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    modes = np.array([700.0, 2400.0, 5100.0])[:, None]
    shares = np.array([3.0, 2.0, 4.0])[:, None] / (modes**2 - LINES**2 + 0.02j * modes**2)
    wrong = 1.0 + 0.01 * (rng.normal(size=(4000, 3)) + 1j * rng.normal(size=(4000, 3)))
    error = (wrong @ shares) / shares.sum(axis=0) - 1.0
    one = altered(observed(0.0, 0.0)[0], receptance=1e-3 * shares.sum(axis=0))
    growth = curve_of(one).growth
    made = np.mean(np.square(np.abs(error)), axis=0) / (2.0 * 0.01**2)
    # At the peaks, between them and in dips, up to a growth of the variance of some hundreds.
    assert np.max(made) > 100.0
    ratio = growth / made
    print(f"stated over made: {ratio.min():.2f} to {ratio.max():.2f}, median {np.median(ratio):.2f}")
    assert np.all((ratio > 0.8) & (ratio < 2.5))
    assert 0.95 < np.median(ratio) < 1.1
    peaks = np.searchsorted(LINES, modes.ravel())
    assert growth[peaks] == pytest.approx(1.0, abs=0.01)


@pytest.mark.slow
def test_a_cause_that_takes_most_of_the_misfit_explains_the_data_partly():
    hidden = with_sensor(1)
    print(hidden)
    assert hidden.verdict == "partly explained"
    assert [one.id for one in hidden.causes] == ["sensor_mass"]
    ((mass, low, high),) = hidden.causes[0].parameters.values()
    print(f"{mass:.4f} kg ({low:.4f} to {high:.4f})")
    assert low < 6e-3 < high
    assert hidden.adequacy.misfit > 10.0
    assert hidden.discrepancy.frequency > 2.0 * hidden.discrepancy_after.frequency
    assert hidden.gains[0].held_out_after < hidden.gains[0].held_out_before
    assert hidden.facts()[0].texts[0].startswith("partly explained: ")
    predicted = hidden.at(assembled(0.07)).natural_frequencies(8e3)
    frequencies, errors = predicted.predicted_hz, predicted.standard_error_hz
    assert np.all(errors >= hidden.discrepancy_after.frequency * frequencies)


@pytest.mark.slow
def test_a_partial_cause_that_held_out_records_contradict_is_not_reported():
    """The held-out records are as the model without the sensor predicts them."""
    sensor = PointMass(mass=6e-3, part="tool", position=0.0)
    fitted, base = observed(0.001, 0.01, sensor, seed=1), with_sensor(1).base
    predicted = [altered(one, receptance=base.at(one.assembly).assembly.receptance(LINES)) for one in fitted]
    held_out = Model(tuple(predicted), JOINT, TOLERANCES)
    found = diagnose(fitted, JOINT, tolerances=TOLERANCES, causes=CAUSES, held_out=held_out)
    print(found)
    assert (found.verdict, found.causes, found.explanation) == ("unexplained", (), None)
    assert found.gains[0].held_out_after > found.gains[0].held_out_before
    assert "not_better" in [reason.code for reason in found.reasons]
    assert found.discrepancy.frequency == with_sensor(1).discrepancy.frequency
    assert found.discrepancy_after is None


@pytest.mark.slow
def test_nothing_hidden_in_a_wrong_model_is_unexplained_with_its_discrepancy():
    found = diagnose(observed(0.005, 0.05), JOINT, tolerances=TOLERANCES, causes=CAUSES)
    print(found)
    assert found.verdict == "unexplained"
    assert not found.causes
    assert 0.002 < found.discrepancy.frequency < 0.02
    assert found.discrepancy_after is None
    predicted = found.at(assembled(0.07)).natural_frequencies(8e3)
    frequencies, errors = predicted.predicted_hz, predicted.standard_error_hz
    assert np.all(np.isfinite(errors) & (errors >= found.discrepancy.frequency * frequencies))
    assert found.base.standard_errors["joint.k_theta"] > 0.0
    assert "model discrepancy, natural frequencies" in {row[0] for row in found.tables()[0].rows}


def test_an_interruption_keeps_the_answer_without_a_discrepancy(monkeypatch):
    def interrupt(*arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr("receptance.diagnosis.discrepancy_search.extend", interrupt)
    found = diagnose(observed(0.005, 0.05), JOINT, tolerances=TOLERANCES, causes=CAUSES[:2], max_causes=1)
    assert (found.verdict, found.final) == ("unexplained", False)
    assert found.discrepancy is not None
    assert found.reasons[0].code == "interrupted"
    assert "not final" in found.notes[0]
