"""Which measurement next: expected intervals against those of refits, shared errors, and rankings of known cases."""

from __future__ import annotations

import json
import pickle

import numpy as np
import pytest

from receptance import STEEL, Assembly, Coordinate, Observation, Part, Segment, identify
from receptance.fit import Floor, Law, Power, Tolerance, Unknown, profile_likelihoods
from receptance.fit.observation import altered
from receptance.predict import Candidate, Menu, next_measurement
from tool_in_holder import LINES, STIFFNESSES, make_assembly
from tool_in_holder import simulate_modes as modes_of
from tool_in_machine import clamped, make_machine, measure, tolerances, unknowns

STIFF = ["joint.k_y", "joint.k_theta"]
WIDE = np.linspace(200.0, 8000.0, 300)
IN_BAND = np.linspace(200.0, 3000.0, 400)
NOSE = Coordinate("holder", 0.0)


def hypothetical(*, tolerances=(), cost=1.0, **fields):
    make = Observation.from_modes if "modes" in fields else Observation
    return Candidate(observation=make(**fields), tolerances=tolerances, cost=cost)


@pytest.fixture(scope="module")
def rng():
    return np.random.default_rng(1)


@pytest.fixture(scope="module")
def in_the_machine(rng):
    """The tip's FRF in the machine, and the fit of it."""
    data = measure(make_machine(), IN_BAND, 0.02, rng, "machine")
    return data, identify(data, unknowns(), tolerances=tolerances(), starts=1)


def menu():
    return {
        "tip again": hypothetical(
            label="tip again",
            assembly=make_machine(),
            frequency_hz=IN_BAND,
            standard_deviation=0.02,
            configuration="machine",
        ),
        "nose": hypothetical(
            label="nose",
            assembly=make_machine(),
            frequency_hz=WIDE,
            standard_deviation=0.03,
            response=NOSE,
            configuration="machine",
        ),
        "short": hypothetical(
            label="short",
            assembly=make_machine(0.045),
            frequency_hz=WIDE,
            standard_deviation=0.03,
            tolerances=clamped("short"),
        ),
        "free": hypothetical(
            label="free",
            assembly=make_machine(free=True),
            frequency_hz=WIDE,
            standard_deviation=0.01,
            tolerances=clamped("free"),
        ),
    }


def test_ranking_of_a_known_case(in_the_machine):
    """From the tip in the machine alone: free-free and a shorter overhang have more information than a repetition."""
    found = next_measurement(in_the_machine[1], list(menu().values()), targets=STIFF)
    order = [one.label for one in found.ranking]
    assert order[0] == "free"
    assert order[-1] == "tip again"
    assert found.best.label == "free"
    shrinks = [one.shrink for one in found.ranking]
    assert shrinks == sorted(shrinks)
    assert 0.0 < shrinks[0] < shrinks[-1] < 1.0


@pytest.mark.parametrize("label", ["nose", "short", "free"])
def test_the_interval_is_that_of_a_refit(in_the_machine, rng, label):
    data, fit = in_the_machine
    candidate = menu()[label]
    expected = next_measurement(fit, candidate, targets=STIFF).best.expected
    extra = [t for t in candidate.tolerances if t.name not in fit.errors]
    refits = []
    for _ in range(3):
        new = candidate.observation
        deviation = float(new.standard_deviation[0])
        again = measure(new.assembly, new.frequency_hz, deviation, rng, label, response=new.response)
        again = altered(again, configuration=new.configuration)
        both = identify([data, again], unknowns(fit.values), tolerances=[*tolerances(), *extra], starts=1)
        refits.append([np.sqrt(both.covariance[i, i]) for i in range(2)])
    for spread, name in zip(np.mean(refits, axis=0), STIFF, strict=True):
        assert expected[name].deviation == pytest.approx(spread, rel=0.3), name
        low, high = expected[name].lower, expected[name].upper
        assert np.log10(high / low) == pytest.approx(2.0 * 1.96 * expected[name].deviation, rel=1e-3)


def test_repeated_measurement_reduces_deviation_by_root_two(rng):
    true = make_assembly()
    data = measure(true, LINES, 0.01, rng, "tip")
    fit = identify(data, STIFFNESSES, starts=1)
    again = hypothetical(label="again", assembly=true, frequency_hz=LINES, standard_deviation=0.01)
    expected = next_measurement(fit, again).best.expected
    for name in STIFF:
        i = fit.addresses.index(name)
        # The fit has the measured receptance in its derivative, the candidate the calculated one.
        assert expected[name].deviation_now == pytest.approx(np.sqrt(fit.covariance[i, i]), rel=1e-6)
        assert expected[name].shrink == pytest.approx(np.sqrt(0.5), rel=2e-3)
        assert expected[name].now == pytest.approx(fit.interval(name), rel=1e-6)


def test_a_hypothetical_measurement_is_an_observation_without_values():
    """With values it has the floor of these, and only then it can be fitted."""
    assembly = make_assembly()
    floor = Floor(relative=0.01, frequency=1e-3)
    h = assembly.receptance(LINES)
    blank = Observation(label="tip", assembly=assembly, frequency_hz=LINES, standard_deviation=0.02, floor=floor)
    assert not blank.has_values
    with pytest.raises(ValueError, match=r"Observation\('tip'.*has no values"):
        identify(blank, STIFFNESSES)
    measured = blank.with_values(h)
    assert measured.has_values
    assert np.array_equal(measured.receptance, h)
    assert measured.standard_deviation**2 == pytest.approx(0.02**2 + floor.variance(LINES, h), rel=1e-12)
    assert (measured.label, measured.configuration) == ("tip", "tip")
    modes = Observation.from_modes(label="modes", assembly=assembly, modes=(1, 3), standard_deviation_hz=[2.0, 3.0])
    assert repr(modes) == "Observation('modes', natural frequencies of modes 1, 3)"
    again = modes.with_values([500.0, 4000.0])
    assert again.modes == (1, 3)
    assert again.frequency_hz.tolist() == [500.0, 4000.0]
    assert again.standard_deviation.tolist() == [2.0, 3.0]


def test_a_candidate_has_the_measuring_chain_of_the_fit(rng):
    """A calibration gain that all measurements share is an unknown of the candidate as well."""
    true = make_assembly()
    data = measure(true, LINES, 0.01, rng, "tip")
    gain = Unknown(address="observation.log_gain", lower=-0.5, upper=0.5)
    fit = identify(data, [*STIFFNESSES, gain], starts=1)
    again = hypothetical(label="again", assembly=true, frequency_hz=LINES, standard_deviation=0.01)
    expected = next_measurement(fit, again).best.expected
    for name in (*STIFF, "observation.log_gain"):
        assert expected[name].shrink == pytest.approx(np.sqrt(0.5), rel=2e-3)


def test_an_error_of_one_name_is_one_error(rng):
    """Clamping error: a repetition in the same clamping does not help, another clamping does."""
    true = make_assembly()
    k_theta = Unknown(address="joint.k_theta", lower=1e2, upper=1e8, start=1e5)

    def error(name):
        return Tolerance(name=name, moves={"joint.k_y": 0.2}, relative=True)

    data = modes_of(true, 4e3, standard_deviation_hz=0.01)
    fit = identify(data, k_theta, tolerances=error("this clamping"), starts=1)
    options = {"assembly": true, "modes": (1,), "standard_deviation_hz": 0.01}
    same = hypothetical(label="same", tolerances=error("this clamping"), **options)
    other = hypothetical(label="other", tolerances=error("other clamping"), **options)
    silent = hypothetical(label="silent", configuration="elsewhere", **options)
    found = {one.label: one for one in next_measurement(fit, [same, other, silent]).ranking}
    # The fit's own error belongs to all that it does not exclude.
    assert found["same"].shrink == pytest.approx(found["silent"].shrink, rel=1e-9)
    assert found["same"].shrink > 0.99
    with_own = Tolerance(name="this clamping", moves={"joint.k_y": 0.2}, relative=True, configurations="observation 0")
    apart = identify(data, k_theta, tolerances=with_own, starts=1)
    found = {one.label: one for one in next_measurement(apart, [same, other]).ranking}
    assert found["same"].shrink > 0.99
    assert found["other"].shrink == pytest.approx(np.sqrt(0.5), rel=0.02)


def test_estimated_scatter(rng):
    """Without standard deviations the residuals give the information of the measurements."""
    true = make_assembly()
    data = measure(true, LINES, 0.01, rng, "tip")
    bare = Observation(assembly=true, frequency_hz=LINES, receptance=data.receptance)
    again = hypothetical(label="again", assembly=true, frequency_hz=LINES, standard_deviation=0.01)
    expected = next_measurement(identify(bare, STIFFNESSES, starts=1), again).best.expected
    known = next_measurement(identify(data, STIFFNESSES, starts=1), again).best.expected
    for name in STIFF:
        assert expected[name].shrink == pytest.approx(known[name].shrink, rel=0.05)
        assert expected[name].deviation_now == pytest.approx(known[name].deviation_now, rel=0.05)


def test_dimension_errors_limit_the_gain_of_data(rng):
    true = make_assembly()
    data = measure(true, LINES, 0.01, rng, "tip")
    fit = identify(data, STIFFNESSES, starts=1)
    error = Tolerance(name="carbide", moves={"tool.segment[*].youngs_modulus": 0.01}, relative=True)
    candidate = hypothetical(label="again", assembly=true, frequency_hz=LINES, standard_deviation=0.01)
    exact = next_measurement(fit, candidate).best.expected["joint.k_theta"]
    fitted = identify(data, STIFFNESSES, tolerances=error, starts=1)
    less = next_measurement(fitted, candidate).best.expected["joint.k_theta"]
    assert less.deviation > 1.5 * exact.deviation


def test_predictions_as_targets(rng):
    true, other = make_assembly(), make_assembly(0.09)
    data = measure(true, LINES, 0.01, rng, "tip")
    fit = identify(data, STIFFNESSES, starts=1)
    modes = hypothetical(label="90 mm", assembly=other, modes=(1, 2))
    lines = np.linspace(500.0, 5000.0, 50)
    curve = hypothetical(label="90 mm", assembly=other, frequency_hz=lines)
    candidate = hypothetical(label="90 mm", assembly=other, frequency_hz=lines, standard_deviation=0.001)
    found = next_measurement(fit, candidate, targets=[modes, curve, "joint.k_y"])
    assert found.targets == ("90 mm: mode 1 [Hz]", "90 mm: mode 2 [Hz]", "90 mm: log receptance", "joint.k_y")
    predicted = fit.at(other).natural_frequencies(10e3)
    frequencies, spreads = predicted.predicted_hz, predicted.standard_error_hz
    for mode in (1, 2):
        one = found.best.expected[f"90 mm: mode {mode} [Hz]"]
        assert one.value == pytest.approx(frequencies[mode - 1], rel=1e-9)
        assert one.deviation_now == pytest.approx(spreads[mode - 1], rel=1e-6)
        assert one.shrink < 1.0
    h, dh = fit.at(other).assembly.derivatives(lines, STIFF)
    slopes = dh / h[:, None] * np.array([fit.values[name] for name in STIFF]) * np.log(10.0)
    parts = np.concatenate([slopes.real, slopes.imag])
    rms = np.sqrt(np.mean(np.einsum("ni,ij,nj->n", parts, fit.covariance, parts)))
    assert found.best.expected["90 mm: log receptance"].deviation_now == pytest.approx(rms, rel=1e-6)


def test_open_parameters_are_evaluated_at_several_points(rng):
    """One mode seen once bounds neither stiffness above: one point would mislead, as the note states."""
    true = make_assembly()
    mode = modes_of(true, 4e3, standard_deviation_hz=5.0)
    fit = identify([mode, mode], STIFFNESSES, starts=2)
    candidates = [
        hypothetical(label="all modes", assembly=true, modes=(1, 2, 3), standard_deviation_hz=5.0),
        hypothetical(label="nearly nothing", assembly=true, modes=(1,), standard_deviation_hz=500.0),
    ]
    found = next_measurement(fit, candidates)
    assert found.best.label == "all modes"
    assert found.profiled == ("joint.k_y", "joint.k_theta")
    assert len(found.points) == 10
    assert "would mislead" in found.notes[0]
    first, last = (one.expected["joint.k_y"] for one in found.ranking)
    assert np.isinf(first.now[1])
    assert first.range[0] < first.deviation < first.range[1]
    assert 0.0 < first.stays_open <= last.stays_open <= 1.0
    given = next_measurement(fit, candidates, profiles=profile_likelihoods(fit))
    assert given.best.shrink == pytest.approx(found.best.shrink, rel=1e-3)


def test_a_law_and_the_conditions_of_a_candidate(rng):
    """An exponent is best determined far from the reference, and an individual deviation is a new error."""
    law = Law(
        address="joint.k_theta",
        lower=1e3,
        upper=1e7,
        start=1e5,
        powers=Power(of="insertion", reference=0.04),
        individual=0.05,
    )
    measured_data = [
        altered(measure(make_assembly(), LINES[::4], 0.01, rng, f"{insertion}"), conditions={"insertion": insertion})
        for insertion in (0.04, 0.035)
    ]
    fit = identify(measured_data, law, starts=1)
    options = {"assembly": make_assembly(), "frequency_hz": LINES[::4], "standard_deviation": 0.01}
    candidates = [
        hypothetical(label=f"{insertion}", conditions={"insertion": insertion}, **options)
        for insertion in (0.035, 0.03, 0.02)
    ]
    exponent = "joint.k_theta ~ insertion"
    found = next_measurement(fit, candidates, targets=exponent)
    assert [one.label for one in found.ranking] == ["0.02", "0.03", "0.035"]
    # A candidate of the name of a configuration is that one again, with the part that it had; the bounds count for 3 %.
    assert found.ranking[-1].shrink > 0.95
    # Two individual deviations of 5 % give the exponent to 0.05 sqrt(2) / ln(0.04 / 0.035), or over a larger distance.
    distances = np.log(0.04 / np.array([0.035, 0.02]))
    assert found.best.expected[exponent].deviation_now == pytest.approx(0.05 * np.sqrt(2.0) / distances[0], rel=0.05)
    x = np.array([0.0, distances[0], distances[1]])
    spread = 0.05 / np.sqrt(np.sum((x - x.mean()) ** 2))
    assert found.best.expected[exponent].deviation == pytest.approx(spread, rel=0.05)
    with pytest.raises(ValueError, match="has no condition 'insertion'"):
        next_measurement(fit, hypothetical(label="unknown", **options))


def test_the_cost_decides(in_the_machine):
    options = menu()
    dear = hypothetical(
        label="free",
        assembly=options["free"].observation.assembly,
        frequency_hz=WIDE,
        standard_deviation=0.01,
        tolerances=clamped("free"),
        cost=50.0,
    )
    found = next_measurement(in_the_machine[1], [dear, options["nose"]], targets=STIFF)
    assert found.best.label == "nose"
    assert "for the square root of the cost" in " ".join(found.notes)


def test_menu_is_made_from_what_was_measured(rng):
    """Own errors of a clamping are those of a repetition, and new ones at another overhang."""
    forces = (10.0, 20.0)
    data = tuple(
        altered(measure(make_machine(), IN_BAND, 0.02, rng, "machine"), label=f"{x} N", conditions={"force": x})
        for x in forces
    )
    menu = Menu(data, tuple(unknowns()), tuple(tolerances()))
    again, nose, longer, harder, tool, holder = (candidate.observation for candidate in menu.candidates())
    assert np.array_equal(again.frequency_hz, IN_BAND)
    assert again.standard_deviation == pytest.approx(np.hypot(0.02, 0.003))
    assert (nose.response, nose.excitation) == (NOSE, NOSE)
    address = "tool.segment[0].length"
    assert longer.assembly.get(address) == pytest.approx(1.3 * make_machine().get(address))
    assert harder.conditions == {"force": 60.0}
    assert (list(tool.assembly.elements), list(holder.assembly.elements)) == (["tool"], ["holder"])
    assert tool.modes == holder.modes == (1,)
    names = [{error.name for error in candidate.tolerances} for candidate in menu.candidates()]
    assert "overhang machine" in names[0]
    assert names[2] - names[0] == {"overhang machine, at a longer overhang"}
    stepped = altered(data[0], conditions={}, force=np.full(IN_BAND.size, 5.0))
    harder = Menu((stepped,), tuple(unknowns()), ()).higher_force()
    assert harder is not None
    assert harder.observation.force == pytest.approx(15.0)
    frequencies = Menu((modes_of(make_assembly(), 4e3, standard_deviation_hz=5.0),), tuple(STIFFNESSES), ())
    labels = [candidate.label.split(",")[0] for candidate in frequencies.candidates()]
    assert labels == ["observation 0 again", "at a longer overhang", "tool alone", "holder alone"]


def test_menu_is_ranked_without_candidates(in_the_machine):
    found = next_measurement(in_the_machine[1], targets=STIFF)
    labels = {one.label for one in found.ranking}
    assert {"machine again", "at the nose of holder", "at a longer overhang"} <= labels
    scores = [one.score for one in found.ranking]
    assert scores == sorted(scores, reverse=True)
    assert all(one.score == pytest.approx(-np.log(one.shrink) / np.sqrt(one.candidate.cost)) for one in found.ranking)
    assert any("those of the menu" in note for note in found.notes)


def test_menu_names_what_is_not_ranked(rng):
    """Without tolerances the parts alone show no unknown; without standard deviations the scatter is the noise."""
    data = measure(make_assembly(), LINES, 0.01, rng, "tip")
    bare = Observation(assembly=make_assembly(), frequency_hz=LINES, receptance=data.receptance, label="tip")
    found = next_measurement(identify(bare, STIFFNESSES, starts=1))
    assert "tip again" in [one.label for one in found.ranking]
    assert any(note.startswith('"tool alone, free-free" is not ranked: ') for note in found.notes)
    again = next(one for one in found.ranking if one.label == "tip again").candidate.observation
    assert again.standard_deviation == pytest.approx(0.01, rel=0.1)


def test_floor_limits_the_gain(in_the_machine):
    """A tenth of the noise on the same lines has ten times the benefit, but not with a floor of the previous noise."""
    fit = in_the_machine[1]
    options = {"assembly": make_machine(free=True), "frequency_hz": WIDE, "tolerances": clamped("free")}
    noisy = hypothetical(label="noisy", standard_deviation=0.01, **options)
    floored = hypothetical(label="floored", standard_deviation=1e-6, floor=0.01, **options)
    clean = hypothetical(label="clean", standard_deviation=1e-3, **options)
    found = {one.label: one.shrink for one in next_measurement(fit, [noisy, floored, clean], targets=STIFF).ranking}
    assert found["floored"] == pytest.approx(found["noisy"], rel=1e-3)
    assert found["clean"] < 0.5 * found["noisy"]


def test_result_object(in_the_machine):
    found = next_measurement(in_the_machine[1], list(menu().values()), targets=STIFF)
    again = pickle.loads(pickle.dumps(found))
    assert [one.shrink for one in again.ranking] == [one.shrink for one in found.ranking]
    assert repr(found).startswith("NextMeasurement(free (")
    assert "best: free; deviations to " in found.summary()
    written = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert written["ranking"][0]["candidate"] == "free"
    assert len(found.plot().axes) == 2


def test_mistakes_give_messages(in_the_machine):
    fit, options = in_the_machine[1], menu()
    with pytest.raises(ValueError, match="candidates is empty"):
        next_measurement(fit, [])
    with pytest.raises(ValueError, match="two candidates have the label 'nose'"):
        next_measurement(fit, [options["nose"], options["nose"]])
    with pytest.raises(TypeError, match="expected a Candidate"):
        next_measurement(fit, ["nose"])
    with pytest.raises(ValueError, match=r"'joint\.k_x' was not identified, only joint\.k_y"):
        next_measurement(fit, options["nose"], targets="joint.k_x")
    bar = Assembly([Part([Segment(length=0.1, outer_diameter=0.02, material=STEEL)], name="bar")])
    with pytest.raises(ValueError, match="has none of the identified parameters"):
        next_measurement(fit, hypothetical(label="x", assembly=bar, frequency_hz=WIDE, standard_deviation=0.01))
    with pytest.raises(ValueError, match="neither frequency_hz nor modes"):
        Observation.from_modes(label="x", assembly=make_assembly())
    with pytest.raises(ValueError, match="has no standard deviation"):
        next_measurement(fit, hypothetical(label="x", assembly=make_assembly(), modes=(1,)))
    with pytest.raises(ValueError, match=r"modes is \(2, 1\), expected ascending numbers"):
        hypothetical(label="x", assembly=make_assembly(), modes=(2, 1))
    with pytest.raises(ValueError, match=r"standard_deviation\[0\] is 0, expected a finite number above zero"):
        hypothetical(label="x", assembly=make_assembly(), frequency_hz=WIDE, standard_deviation=0.0)
    with pytest.raises(ValueError, match=r"Observation 'x': frequency_hz\[1\]"):
        hypothetical(label="x", assembly=make_assembly(), frequency_hz=[10.0, np.inf])
    with pytest.raises(ValueError, match="has no label"):
        hypothetical(label="", assembly=make_assembly(), frequency_hz=WIDE)
    data = measure(make_assembly(), LINES, 0.01, np.random.default_rng(0), "tip")
    percent = identify(data, STIFFNESSES, objective="percentage", starts=1)
    with pytest.raises(ValueError, match="no likelihood"):
        next_measurement(percent, options["nose"])


def test_interval_of_an_open_parameter_equals_that_of_refits():
    """In a low band k_y is open above. With each of the likely truths behind the new data the deviations agree."""
    rng = np.random.default_rng(1)
    lines = np.linspace(200.0, 900.0, 150)
    data = measure(make_machine(), lines, 0.05, rng, "machine")
    fit = identify(data, unknowns(), tolerances=tolerances(), strategy="staged", starts=2)
    candidate = menu()["free"]
    found = next_measurement(fit, candidate, targets="joint.k_y")
    expected = found.best.expected["joint.k_y"]
    assert expected.now[1] == np.inf
    modulus = candidate.observation.assembly.get("tool.segment[0].youngs_modulus")
    refits = []
    for likely in found.points:
        values = {name: value for name, value in likely.items() if name.startswith("joint.")}
        values["tool.segment[0].youngs_modulus"] = modulus * np.exp(0.015 * likely["carbide"])
        true = candidate.observation.assembly.replace(values)
        again = measure(true, WIDE, 0.01, rng, "free", described=candidate.observation.assembly)
        both = identify([data, again], unknowns(values), tolerances=[*tolerances(), clamped("free")], starts=1)
        refits.append(np.sqrt(both.covariance[0, 0]))
    assert expected.deviations[:4] == pytest.approx(refits[:4], rel=0.3)
    # The last one has almost no information on k_y; bounds and noise determine the interval.
    assert min(refits[4], expected.deviations[4]) > 0.25
    assert expected.stays_open == pytest.approx(0.2)
