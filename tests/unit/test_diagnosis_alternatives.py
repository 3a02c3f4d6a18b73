"""Alternatives outside the catalogue that a cause must exceed to be named."""

from __future__ import annotations

import contextlib
from dataclasses import replace

import numpy as np
import pytest

from receptance import (
    CARBIDE,
    STEEL,
    Assembly,
    Coordinate,
    Material,
    Observation,
    Part,
    PointJoint,
    PointMass,
    Segment,
    Unknown,
)
from receptance.diagnosis import CATALOGUE, Cause, Model, UndecidableError, diagnose
from receptance.diagnosis.catalogue import ALTERNATIVES
from receptance.diagnosis.explanation import Selection
from receptance.diagnosis.fitting import refit
from receptance.diagnosis.judgement import conclude
from receptance.diagnosis.thresholds import MARGIN, MARGIN_OF_ALTERNATIVE
from receptance.fit import Tolerance
from receptance.fit.observation import altered

LINES = np.linspace(200.0, 5000.0, 400)
JOINT = [
    Unknown(address="joint.k_y", lower=1e6, upper=1e11),
    Unknown(address="joint.k_theta", lower=1e2, upper=1e8),
    Unknown(address="joint.c_y", lower=1e-1, upper=1e6),
    Unknown(address="joint.c_theta", lower=1e-4, upper=1e3),
]
TOLERANCES = [Tolerance(name="carbide", moves={"tool.segment[*].youngs_modulus": 0.005}, relative=True)]
HEAVY = Material(youngs_modulus=1e13, density=4e3, poisson_ratio=0.3)
SWINGING = Part([Segment(length=0.002, outer_diameter=0.006, material=HEAVY)], name="body")
SPRING = PointJoint(k_y=2.3e-4 * (2 * np.pi * 1500.0) ** 2, k_theta=1e4, c_y=0.1, c_theta=1e-3, name="spring")


def chain(overhang: float, *points: PointMass, diameters: tuple[float, ...] = (0.012,)) -> Assembly:
    each = overhang / len(diameters)
    tool = Part([Segment(length=each, outer_diameter=d, material=CARBIDE) for d in diameters], name="tool")
    holder = Part([Segment(length=0.13, outer_diameter=0.045, material=STEEL)], name="holder")
    return Assembly([tool, PointJoint(k_y=6e8, k_theta=1e5, c_y=300.0, c_theta=1.0, name="joint"), holder], points)


def swinging(overhang: float, *, at_tip: bool) -> Assembly:
    parts = list(chain(overhang).elements.values())
    return Assembly([SWINGING, SPRING, *parts] if at_tip else [*parts, SPRING, SWINGING])


def make_observations(true: Assembly, overhang: float, seed: int = 1) -> Observation:
    rng = np.random.default_rng([seed, round(1e4 * overhang)])
    tip = Coordinate("tool", 0.0)
    noise = 0.01 * (rng.normal(size=LINES.size) + 1j * rng.normal(size=LINES.size))
    return Observation(
        assembly=chain(overhang),
        frequency_hz=LINES,
        receptance=true.receptance(LINES, excitation=tip, response=tip) * np.exp(noise),
        standard_deviation=0.01,
        label=f"{overhang}",
    )


OVERHANGS = (0.05, 0.07, 0.09)


@pytest.mark.parametrize(
    "at_tip", [False, pytest.param(True, marks=pytest.mark.slow)], ids=["behind the holder", "on the tip"]
)
def test_a_body_on_the_tip_is_no_mode_of_a_fixture(at_tip: bool) -> None:
    data = [make_observations(swinging(x, at_tip=at_tip), x) for x in OVERHANGS]
    verdict = diagnose(data, JOINT, tolerances=TOLERANCES, causes=["missing_mode", "collet_mass"], max_causes=1)
    if at_tip:
        assert verdict.verdict == "unexplained"
        assert not any(one.plausible and one.misfit < 1.0 for one in verdict.candidates)
    else:
        assert [one.id for one in verdict.causes] == ["missing_mode"]
        assert verdict.verdict == "named"


def test_a_better_alternative_is_reported() -> None:
    # A gram on the shank: a sensor at the tip takes up nearly all of it.
    data = [make_observations(chain(x, PointMass(mass=4e-4, part="tool", position=0.02)), x) for x in OVERHANGS]
    verdict = diagnose(data, JOINT, tolerances=TOLERANCES, causes=["sensor_mass", "joint_cross_term"])
    assert verdict.verdict == "unexplained"
    assert not verdict.causes
    (reason,) = [one for one in verdict.reasons if one.code == "alternative_preferred"]
    assert reason.values["alternative"] == "a mass at 20 mm of tool"
    assert reason.values["evidence"] > MARGIN
    assert verdict.alternative is verdict.alternatives[0]
    assert verdict.alternative.parameters["mass_somewhere.mass"][0] == pytest.approx(4e-4, rel=0.1)
    facts = {fact.label: fact.texts[0] for fact in verdict.facts()}
    assert facts["Place"].startswith("A mass at 20 mm of tool explains the data; it is not a known cause")
    assert facts["Size"].startswith("mass 0.4")
    assert facts["Place"] in verdict.to_html()
    assert verdict.to_dict()["alternative"]["id"] == "mass_somewhere"
    assert any("but a mass at 20 mm of tool, a single change, is at least as likely" in note for note in verdict.notes)


def test_a_mass_during_the_stronger_hits_is_no_joint_that_depends_on_the_amplitude() -> None:
    data = []
    for seed, (force, mass) in enumerate(((100.0, 0.0), (300.0, 3e-4))):
        for x in OVERHANGS:
            true = chain(x, PointMass(mass=mass, part="tool", position=0.02))
            measured = make_observations(true, x, seed)
            changes = {"label": f"{x} at {force:g} N", "configuration": f"{x}", "conditions": {"force": force}}
            data.append(altered(measured, **changes))
    verdict = diagnose(data, JOINT, tolerances=TOLERANCES, causes=["joint_amplitude", "sensor_mass"])
    assert verdict.verdict == "unexplained"
    assert verdict.alternative is not None
    assert verdict.alternative.variant == "at 20 mm of tool, force level 300"
    ((mass, _, _),) = verdict.alternative.parameters.values()
    assert mass == pytest.approx(3e-4, rel=0.1)


def test_a_mass_near_the_tip_is_located() -> None:
    data = [make_observations(chain(x, PointMass(mass=6e-4, part="tool", position=0.007)), x) for x in OVERHANGS]
    verdict = diagnose(data, JOINT, tolerances=TOLERANCES, causes=["tip_diameter", "sensor_mass"])
    assert verdict.verdict not in ("named", "partly explained")
    (near,) = [other for other in verdict.alternatives if other.id == "mass_near_tip"]
    assert near.parameters["mass_near_tip.mass"][0] == pytest.approx(6e-4, rel=0.2)
    # It starts half way to the first of the other places, a fifth of the shortest tool.
    assert 0.5 * 0.2 * 0.05 + near.parameters["mass_near_tip.distance"][0] == pytest.approx(0.007, abs=1e-3)


def test_a_tool_that_was_clamped_otherwise_has_no_other_frequencies() -> None:
    data = []
    for seed, x in enumerate((*OVERHANGS, OVERHANGS[1])):
        true = chain(x)
        if seed == len(OVERHANGS):
            true = true.replace({"joint.k_theta": 9.8e4})
        measured = make_observations(true, x, seed)
        data.append(altered(measured, label=f"hit {seed}", configuration=f"{x}"))
    verdict = diagnose(data, JOINT, tolerances=TOLERANCES, causes=["frequency_scale", "tool_modulus"])
    assert verdict.verdict != "named"
    other = verdict.alternatives[0]
    assert (other.id, other.variant) == ("other_joint", "of other stiffnesses in the record hit 3")
    (ratio,) = [np.exp(value) for name, (value, _, _) in other.parameters.items() if "log_k_theta" in name]
    assert ratio == pytest.approx(0.98, abs=0.003)


@pytest.fixture(scope="module")
def selection() -> Selection:
    data = [make_observations(chain(x, PointMass(mass=2e-3)), x) for x in OVERHANGS]
    verdict = diagnose(data, JOINT, tolerances=TOLERANCES, causes=["sensor_mass", "tool_density"])
    assert [one.id for one in verdict.causes] == ["sensor_mass"]
    assert verdict.verdict == "named"
    assert verdict.selection is not None
    return verdict.selection


@pytest.mark.parametrize(
    ("more", "alone", "together"),
    [
        (1.1 * MARGIN, "unexplained", "unexplained"),
        (0.9 * MARGIN, "suspected", "unexplained"),
        (-0.9 * MARGIN_OF_ALTERNATIVE, "suspected", "unexplained"),
        (-1.1 * MARGIN_OF_ALTERNATIVE, "named", "unexplained"),
        (-1.1 * MARGIN, "named", "named"),
    ],
)
def test_an_alternative_withholds_a_name(selection: Selection, more: float, alone: str, together: str) -> None:
    best = selection.singles[0]
    somewhere = next(each for each in selection.alternatives if each.variants[0].cause.id == "mass_somewhere")
    other_change = replace(somewhere, evidence=best.evidence + more)
    judgement = conclude(replace(selection, explanations=[best], alternatives=[other_change]))
    assert judgement.answer == alone
    other = next(one for one in selection.singles if one is not best)
    pair = replace(best, variants=(*best.variants, *other.variants))
    judgement = conclude(replace(selection, explanations=[pair], alternatives=[other_change]))
    assert judgement.answer == together


def test_what_contains_a_cause_raises_no_doubt_about_it(selection: Selection) -> None:
    best = selection.singles[0]
    for alternative in selection.alternatives:
        for more, doubtful in ((0.5 * MARGIN, "suspected"), (2.0 * MARGIN, "unexplained")):
            better = replace(alternative, evidence=best.evidence + more)
            judgement = conclude(replace(selection, explanations=[best], alternatives=[better]))
            contained = alternative.variants[0].cause.id == "mass_near_tip"
            assert judgement.answer == ("named" if contained and more < MARGIN else doubtful)
    assert "mass_near_tip" in [alternative.variants[0].cause.id for alternative in selection.alternatives]


def test_an_alternative_withholds_a_cause_with_an_unusual_size(selection: Selection) -> None:
    best = selection.singles[0]
    large = replace(best)
    large.__dict__["parameters"] = {name: replace(one, plausible=(0.0, 1e-4)) for name, one in best.parameters.items()}
    for more, answer in ((1.1 * MARGIN, "unexplained"), (-1.1 * MARGIN, "suspected")):
        better = replace(selection.alternatives[0], evidence=best.evidence + more)
        found = conclude(replace(selection, explanations=[large], alternatives=[better]))
        assert found.answer == answer
        assert (found.alternative is better) == (answer == "unexplained")


@pytest.mark.parametrize("alternative", ALTERNATIVES, ids=lambda one: one.id)
def test_every_alternative_has_an_effect_only_off_its_null(alternative: Cause) -> None:
    data = [make_observations(chain(x), x) for x in OVERHANGS]
    model = Model(tuple(data), tuple(JOINT), tuple(TOLERANCES))
    problem = model.task.problem()
    before = problem.residual(problem.variables.start).copy()
    extensions = alternative.extensions(model)
    assert extensions
    for _, extended in extensions:
        task = extended.task
        there = task.problem()
        start = there.variables.start
        after = there.residual(start).copy()[: before.size]
        # An absent swinging body keeps a negligible mass.
        assert np.median(np.abs(after - before)) < 1e-3
        assert np.abs(after - before).max() < 0.2
        names = [u.name for u in task.parameters.unknowns]
        own = [i for i, name in enumerate(names) if name.startswith(alternative.id)]
        assert own
        moved = start.copy()
        moved[own[0]] += (
            0.05
            * (there.variables.limits[1] - there.variables.limits[0])[own[0]]
            * (1.0 if alternative.id != "soft_place" else -1.0)
        )
        assert np.abs(there.residual(moved)[: before.size] - before).max() > 1.0


@pytest.mark.parametrize("cause", ["joint_spread", "collet_mass", "sensor_mass", "frequency_scale", "overhang_error"])
@pytest.mark.parametrize("alternative", ALTERNATIVES, ids=lambda one: one.id)
def test_alternative_acts_on_a_model_with_a_cause(cause: str, alternative: Cause) -> None:
    """A pair of a cause and an alternative; the variants are those of the model without the cause."""
    data = [make_observations(chain(x), x) for x in OVERHANGS]
    base = Model(tuple(data), tuple(JOINT), tuple(TOLERANCES)).with_witnesses()
    (_, model), *_ = CATALOGUE[cause].extensions(base)
    problem = model.task.problem()
    lines = 2 * sum(one.frequency_hz.size for one in data)
    before = problem.residual(problem.variables.start)[:lines]
    acting = 0
    for variant in alternative.variants(base):
        with contextlib.suppress(UndecidableError):
            there = variant.apply(model).task.problem()
            after = there.residual(there.variables.start)[:lines]
            assert np.median(np.abs(after - before)) < 1e-3
            acting += 1
    assert acting


def test_competing_explanation_is_fitted() -> None:
    """A cone that is described by hand."""
    cone = tuple(0.012 * (1.0 + 0.03 * (1.0 - (i + 0.5) / 6)) for i in range(6))
    data = [make_observations(chain(x, diameters=cone), x) for x in OVERHANGS]
    model = Model(tuple(data), tuple(JOINT), tuple(TOLERANCES))
    (rival,) = [one for one in ALTERNATIVES if one.id == "cone"]
    ((_, conical),) = rival.extensions(model)
    values = {"joint.k_y": 6e8, "joint.k_theta": 1e5, "joint.c_y": 300.0, "joint.c_theta": 1.0}
    fit = refit(conical, values)
    assert fit.misfit == pytest.approx(1.0, abs=0.1)
    assert fit.values["cone.log_diameter"] == pytest.approx(0.03, abs=0.003)
