"""The advised measurement: simulated, compared with refits of all data, including the predicted resolution."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from receptance import CARBIDE, STEEL, Assembly, Observation, Part, PointJoint, PointMass, Segment, Unknown
from receptance.diagnosis import Model, diagnose
from receptance.diagnosis.advice import MENU, Hypothesis, MenuItem, advise
from receptance.diagnosis.causes import transfer
from receptance.diagnosis.explanation import Explanation, Selection
from receptance.diagnosis.fitting import evaluate, refit
from receptance.diagnosis.judgement import Judgement
from receptance.fit import Tolerance
from receptance.fit.observation import altered
from receptance.predict import Menu
from variant_of_cause import variant_of

LINES = np.linspace(200.0, 6000.0, 300)
TRUE = PointJoint(k_y=6e8, k_theta=1e5, c_y=300.0, c_theta=1.0, name="joint")
JOINT = (
    Unknown(address="joint.k_y", lower=1e6, upper=1e11, start=6e8),
    Unknown(address="joint.k_theta", lower=1e2, upper=1e8, start=1e5),
    Unknown(address="joint.c_y", lower=1e-1, upper=1e6, start=300.0),
    Unknown(address="joint.c_theta", lower=1e-4, upper=1e3, start=1.0),
)
TOLERANCES = (Tolerance(name="carbide", moves={"tool.segment[*].youngs_modulus": 0.005}, relative=True),)


def make_assembly(overhang: float, *masses: PointMass) -> Assembly:
    tool = Part([Segment(length=overhang, outer_diameter=0.012, material=CARBIDE)], name="tool")
    holder = Part([Segment(length=0.13, outer_diameter=0.045, material=STEEL)], name="holder")
    return Assembly([tool, TRUE, holder], masses)


def make_observations(mass: float, overhangs: tuple[float, ...] = (0.06, 0.09)) -> Model:
    rng = np.random.default_rng(4)
    data = []
    for x in overhangs:
        noise = 0.01 * (rng.normal(size=LINES.size) + 1j * rng.normal(size=LINES.size))
        values = make_assembly(x, PointMass(mass=mass)).receptance(LINES) * np.exp(noise)
        one = Observation(
            assembly=make_assembly(x), frequency_hz=LINES, receptance=values, standard_deviation=0.01, label=f"{x}"
        )
        data.append(one)
    return Model(tuple(data), JOINT, TOLERANCES)


@pytest.fixture(scope="module")
def selection() -> Selection:
    """A sensor of half a gram, and a cause that explains it nearly as well."""
    model = make_observations(5e-4)
    base = refit(model, {})
    selection = Selection(base, 7.0, 0.0, [], {})
    for cause, name in (
        ("sensor_mass", "all"),
        ("hammer_offset", "on tool at 0 mm"),
        ("tip_diameter", "from the tip"),
    ):
        variant = variant_of(model, cause, name)
        changed = variant.apply(model)
        starts = [{}, {"sensor_mass.mass": 5e-4, "hammer_offset.distance": 3e-4, "tip_diameter.log_diameter": 0.01}]
        fit = min((refit(changed, start) for start in starts), key=lambda one: one.chi_square)
        gain = base.chi_square - fit.chi_square
        selection.add(Explanation((variant,), fit, gain, gain - 7.0))
    return selection


def of(selection: Selection, name: str) -> Explanation:
    return next(one for one in selection.singles if name in one.ids)


def hypothesis(selection: Selection, name: str) -> Hypothesis:
    return Hypothesis(of(selection, name), selection.base.model)


@pytest.mark.parametrize("describe", [Menu.at_the_nose, Menu.longer_overhang])
def test_expected_gain_equals_that_of_refits(selection: Selection, describe: object) -> None:
    """Growth of chi-square of the wrong explanation with noise, against the expectation without noise."""
    truth, other = of(selection, "sensor_mass"), of(selection, "tip_diameter")
    model = selection.base.model
    requested = describe(Menu(model.observations, model.unknowns, model.tolerances)).observation  # type: ignore[operator]
    hypotheses = (hypothesis(selection, "sensor_mass"), hypothesis(selection, "tip_diameter"))
    expected = MenuItem("", 1.0, describe=describe).discriminate(*hypotheses)  # type: ignore[arg-type]
    # The sensor is at the response, with the fitted mass.
    at = requested.response
    mass = truth.fit.values["sensor_mass.mass"]
    values = {name: truth.fit.values[name] for name in ("joint.k_y", "joint.k_theta", "joint.c_y", "joint.c_theta")}
    moved = requested.assembly.replace(
        {
            **values,
            "tool.segment[0].youngs_modulus": CARBIDE.youngs_modulus * np.exp(0.005 * truth.fit.values["carbide"]),
        }
    )
    sensed = Assembly(moved.elements.values(), [PointMass(mass=mass, part=at.part, position=at.position)])
    clean = sensed.receptance(LINES, response=requested.response, excitation=requested.excitation)
    found = []
    for seed in range(3):
        rng = np.random.default_rng(seed)
        noise = 0.01 * (rng.normal(size=LINES.size) + 1j * rng.normal(size=LINES.size))
        new = altered(requested.with_values(clean * np.exp(noise)), standard_deviation=np.full(LINES.size, 0.0105))
        growth = []
        for one in (truth, other):
            whole = transfer(replace(model, observations=(*model.observations, new)), one.variants)
            again = refit(replace(one.fit.model, observations=whole.observations), one.fit.values)
            growth.append(again.chi_square - one.fit.chi_square)
        found.append(growth[1] - growth[0])
    assert expected > 0.0
    # Fewer lines and the floor make it cautious; noise is 2 sqrt(expected).
    assert 0.1 * np.mean(found) - 10.0 < expected < 1.5 * np.mean(found) + 4.0 * np.sqrt(expected) + 10.0


def test_explanation_is_not_refuted_by_its_data(selection: Selection) -> None:
    for one in (Hypothesis(single, selection.base.model) for single in selection.singles):
        for describe in (Menu.at_the_nose, Menu.longer_overhang, Menu.tool_alone, Menu.holder_alone):
            assert MenuItem("", 1.0, describe=describe).discriminate(one, one) < 0.01


def test_weights_and_marked_places(selection: Selection) -> None:
    sensor, offset, flutes = (hypothesis(selection, name) for name in ("sensor_mass", "hammer_offset", "tip_diameter"))
    mass, _ = sensor.sizes["sensor_mass.mass"]
    weighed = MenuItem("", 1.0, {"sensor_mass.mass": 2e-5})
    assert weighed.discriminate(sensor, offset) == pytest.approx((mass / 2e-5) ** 2)
    # In the other direction the fitted mass is uncertain itself.
    assert 50.0 < weighed.discriminate(offset, sensor) < weighed.discriminate(sensor, offset)
    assert weighed.discriminate(offset, flutes) == 0.0
    marked = MenuItem("", 1.0, describe=Menu.again, without=frozenset({"hammer_offset"}))
    assert marked.discriminate(sensor, offset) > 30.0
    assert marked.discriminate(sensor, flutes) == 0.0


def test_advised_measurement_resolves_the_verdict(selection: Selection) -> None:
    pair = (of(selection, "sensor_mass"), of(selection, "hammer_offset"))
    close = tuple(replace(one, evidence=100.0 - i) for i, one in enumerate(pair))
    found = advise(selection, Judgement("ambiguous", close, ("sensor_mass", "hammer_offset"), ()))
    assert found is not None
    assert found.action == "weigh the sensor and state its mass"
    assert set(found.separates) == {"sensor_mass", "hammer_offset"}
    assert found.resolves == 1.0
    alone = advise(selection, Judgement("suspected", (replace(pair[1], evidence=12.0),), (), ()))
    assert alone is not None
    assert "hammer_offset" in alone.separates
    assert advise(selection, Judgement("named", (pair[0],), (), ())) is None


def test_two_measurements_resolve_an_open_verdict(selection: Selection) -> None:
    three = tuple(replace(one, evidence=100.0 - i) for i, one in enumerate(selection.singles))
    ids = tuple(next(iter(one.ids)) for one in three)
    found = advise(selection, Judgement("ambiguous", three, ids, ()))
    assert found is not None
    assert found.resolves == 1.0
    assert set(found.separates) == set(ids)
    assert ", and " in found.action
    assert "weigh the sensor" in found.action
    assert found.cost > 1.0


def test_indistinguishable_losses_are_listed(selection: Selection) -> None:
    """A window or a rope of that size costs little in a further record, and can be measured by itself."""
    model = selection.base.model
    close = []
    for cause, name in (
        ("joint_hysteretic_loss", "all stiffnesses"),
        ("exponential_window", "on accelerations"),
        ("suspension", "near 100 % of the holder, with a loss"),
    ):
        variant = variant_of(model, cause, name)
        start = {"suspension.stiffness": 2e4, "suspension.damping": 20.0, "exponential_window.decay_rate": 2.0}
        fit = evaluate(variant.apply(model), selection.base.values)
        values = {**fit.values, **{key: value for key, value in start.items() if key in fit.values}}
        fit = replace(fit, x=fit.task.variables.from_values(np.array(list(values.values()))))
        close.append(Explanation((variant,), fit, 40.0, 30.0))
    found = advise(selection, Judgement("ambiguous", tuple(close), tuple(next(iter(one.ids)) for one in close), ()))
    assert found is not None
    assert found.resolves == 1.0
    assert "exponential window" in found.action
    assert "swing" in found.action


def test_verdict_contains_the_advice() -> None:
    model = make_observations(5e-4)
    verdict = diagnose(
        model.observations, JOINT, tolerances=TOLERANCES, causes=["sensor_mass", "hammer_offset"], max_causes=1
    )
    if verdict.verdict == "ambiguous":
        assert verdict.next_measurement is not None
        assert verdict.next_measurement.cost == 1.0
        assert "identifies each of the remaining explanations" in verdict.summary(1000)


def test_every_choice_can_be_simulated(selection: Selection) -> None:
    for choice in MENU:
        hypotheses = [Hypothesis(one, selection.base.model) for one in selection.singles]
        for truth, other in itertools.pairwise(hypotheses):
            found = choice.discriminate(truth, other)
            assert np.isfinite(found)
            assert found >= 0.0
