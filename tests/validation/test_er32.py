"""The ER32 study against Matthias et al. 2016 (doi 10.1016/j.cirpj.2016.02.005): tables 1 to 5 and figures 8 to 10.

The holder is inferred from frequencies of tables 2 and 4 with the stiffnesses of table 5, so agreement in those is
consistency. No number here comes from our own output: they are the paper's, or the tolerances that were asked for.
"""

from __future__ import annotations

import dataclasses
import json
import math
from typing import Any

import numpy as np
import pytest

from receptance.identification import MeasuredFrequencies, Unknown, identify
from receptance.studies.er32 import (
    ChanceModel,
    ER32Settings,
    ER32Study,
    Resolution,
    as_dict,
    findings,
    load,
    load_holder,
    run,
)
from receptance.studies.er32.bias import propagate, sign_test
from receptance.studies.er32.determination import overhang_scatter
from receptance.studies.er32.holder import JOINT, mode_slopes
from receptance.studies.er32.joints import follow_joint, identify_joints, joint_of
from receptance.studies.er32.trends import find_trends

TORQUE = 135.0  # recommended by the manufacturer
DIAMETERS = (7.94, 9.53, 11.11, 12.7, 16.0)
DRAWS = 60


@pytest.fixture(scope="module")
def study() -> ER32Study:
    return run(ER32Settings(draws=DRAWS))


@pytest.fixture(scope="module")
def form(study: ER32Study) -> dict[str, Any]:
    loaded: dict[str, Any] = json.loads(json.dumps(as_dict(study), allow_nan=False))
    return loaded


def test_tables_are_as_printed() -> None:
    published = load()
    assert tuple(mount.diameter_mm for mount in published.mounts) == DIAMETERS
    assert len(published.readings) == 20
    assert sum(len(transfer.measured_hz) for transfer in published.transfers) == 20
    assert published.reading(11.11, 155.0).frequency_hz == (2311.0, 10170.0)
    assert published.setup(16.0).overhang_long_mm is None
    assert published.recommended_torque_nm == TORQUE
    assert [long.overhang_mm for long in published.long_tools] == [113.5, 114.2, 114.9, 113.2]


def test_published_predictions(study: ER32Study, form: dict[str, Any]) -> None:
    """Table 2's predicted frequencies with table 5's stiffnesses."""
    assert len(study.published_predictions) == 20
    assert form["published_predictions"]["rms_percent"] < 0.5


@pytest.mark.parametrize("diameter", DIAMETERS)
@pytest.mark.parametrize("torque", [95.0, 115.0, 135.0, 155.0])
def test_identified_joint_is_the_papers(study: ER32Study, diameter: float, torque: float) -> None:
    """Table 4; at 135 N m table 5 has the same stiffnesses."""
    joint = joint_of(study.identified, diameter, torque)
    printed = study.published.reading(diameter, torque)
    assert joint.converged
    assert joint.k_theta == pytest.approx(printed.k_theta, rel=0.10)
    assert joint.k_y == pytest.approx(printed.k_y, rel=0.15)
    if torque == TORQUE:
        setup = study.published.setup(diameter)
        assert joint.k_theta == pytest.approx(setup.k_theta, rel=0.10)
        assert joint.k_y == pytest.approx(setup.k_y, rel=0.15)


def test_identified_joint_gives_the_frequencies_back(study: ER32Study) -> None:
    for joint in study.identified:
        mount = study.published.mount(joint.diameter_mm)
        assembly = study.model.assembly(
            mount.diameter_mm, mount.overhang_mm, mount.holder_length_mm, joint.k_y, joint.k_theta
        )
        printed = study.published.reading(joint.diameter_mm, joint.torque_nm).frequency_hz
        np.testing.assert_allclose(assembly.natural_frequencies(15e3)[:2], printed, rtol=1e-6)


def test_intervals_hold_what_would_be_printed_alike(study: ER32Study) -> None:
    random = np.random.default_rng(4)
    for joint in study.identified[::5]:
        mount = study.published.mount(joint.diameter_mm)
        printed = np.array(study.published.reading(joint.diameter_mm, joint.torque_nm).frequency_hz)
        half = np.where(printed < 10e3, 0.5, 5.0)
        for _ in range(5):
            frequency = printed + half * random.uniform(-1.0, 1.0, 2)
            assembly = study.model.assembly(mount.diameter_mm, mount.overhang_mm, mount.holder_length_mm, 1e9, 1e5)
            found = identify(
                MeasuredFrequencies(assembly=assembly, frequency_hz=frequency),
                [Unknown(address=a, lower=low, upper=1e4 * low) for a, low in zip(JOINT, (1e7, 1e3), strict=True)],
                starts=2,
            )
            for address, interval in zip(JOINT, (joint.k_y_interval, joint.k_theta_interval), strict=True):
                assert interval[0] is not None
                assert interval[1] is not None
                assert interval[0] <= found.values[address] <= interval[1]


def test_an_interval_may_be_open() -> None:
    """With readings this coarse a rigid joint would do as well."""
    published = load()
    few = dataclasses.replace(published, readings=(published.reading(12.7, TORQUE),))
    (joint,) = identify_joints(load_holder(), few, Resolution(fine_hz=1.0, coarse_hz=4000.0), starts=1, seed=0)
    assert joint.k_y_interval[1] is None
    assert joint.k_y_interval[0] is not None
    assert joint.k_y_interval[0] < joint.k_y
    states = [
        dataclasses.replace(joint, diameter_mm=diameter, torque_nm=torque)
        for diameter in (12.7, 16.0, 20.0)
        for torque in (95.0, TORQUE)
    ]
    trends = find_trends(states, TORQUE)
    for trend in trends.torque:
        assert trend.quantity == "k_theta" or trend.interval == (None, None)
        assert not trend.exceeds
    form = json.loads(json.dumps([dataclasses.asdict(joint), dataclasses.asdict(trends)], allow_nan=False))
    assert form[0]["k_y_interval"][1] is None


def test_transfer(study: ER32Study, form: dict[str, Any]) -> None:
    """Table 2's measured frequencies; the paper says of its own predictions that all but one are within 2 %."""
    errors = [row["error_percent"] for row in form["transfer"]["rows"]]
    assert form["transfer"]["rms_percent"] == pytest.approx(math.sqrt(sum(e * e for e in errors) / 20.0))
    assert form["transfer"]["rms_percent"] == pytest.approx(1.0, abs=0.15)
    assert sum(abs(row.published_error_percent) > 2.0 for row in study.transfers) == 1
    assert {row.mode for row in study.transfers} == {1, 2, 3}


def test_parameter_sets(form: dict[str, Any]) -> None:
    """Figures 8 to 10: what the paper says of each of table 3's sets at 114, 63 and 24 mm."""
    sets = {item["set"]: item for item in form["parameter_sets"]}
    error = {
        (name, row["overhang_mm"], row["mode"]): abs(row["error_percent"])
        for name, item in sets.items()
        for row in item["errors"]
    }
    assert all(error[name, 114.2, 1] < 3.0 for name in sets)
    assert not sets["curve_fitted"]["betrayed"]
    assert [name for name, item in sets.items() if item["betrayed"]] == ["manual_1", "manual_2", "manual_3"]
    # Set 3 fails at 63 mm even in the first mode, set 1 misses the second mode there, set 2 is lost at 24 mm.
    assert sets["manual_3"]["first_betrayal_of_first_mode"]["overhang_mm"] == 62.6
    betrayed = {(name, row["overhang_mm"], row["mode"]) for name, item in sets.items() for row in item["betrayed_by"]}
    assert ("manual_1", 62.6, 2) in betrayed
    assert ("manual_1", 62.6, 1) not in betrayed
    assert sets["manual_2"]["first_betrayal_of_first_mode"]["overhang_mm"] == 23.8
    for item in sets.values():
        assert abs(item["worst_error_percent"]) == max(abs(row["error_percent"]) for row in item["errors"])


def test_trends(study: ER32Study) -> None:
    """Table 4: k_y and k_theta grow with torque for every tool; section "Clamping torque" says so of 11.11 mm."""
    for trend in study.trends.torque:
        printed = [getattr(r, trend.quantity) for r in study.published.readings if r.diameter_mm == trend.diameter_mm]
        low, high = trend.interval
        assert low is not None
        assert high is not None
        assert low < trend.change_percent < high
        assert trend.exceeds
        assert trend.change_percent == pytest.approx(100.0 * (printed[-1] / printed[0] - 1.0), abs=4.0)
        found = [getattr(j, trend.quantity) for j in study.identified if j.diameter_mm == trend.diameter_mm]
        whole = trend.end_values
        assert (whole.start, whole.end) == study.trends.torque_range_nm
        assert whole.percent == pytest.approx(100.0 * (found[-1] / found[0] - 1.0))
        assert None not in whole.interval
        assert any(f"{whole.percent:+.1f} %) at {trend.diameter_mm:g} mm" in text for _, text in findings(study))
    (thickest,) = (t for t in study.trends.torque if t.quantity == "k_y" and t.diameter_mm == 16.0)
    assert thickest.change_percent == pytest.approx(6.4, abs=0.05)
    assert thickest.end_values.percent == pytest.approx(7.6, abs=0.05)
    for law in study.trends.diameter:
        assert law.exponent > 0.0
        assert law.exceeds


def test_trends_within_a_coarse_resolution() -> None:
    """With readings in steps of 50 Hz nothing of the torque is left."""
    published = load()
    joints = identify_joints(load_holder(), published, Resolution(50.0, 500.0), starts=1, seed=0)
    assert not any(trend.exceeds for trend in find_trends(joints, TORQUE).torque if trend.quantity == "k_theta")


def test_bias_of_the_long_tools(study: ER32Study, form: dict[str, Any]) -> None:
    bias = form["long_first_mode_bias_percent"]
    assert bias == pytest.approx([-1.55, -1.58, -1.49, -1.94], abs=0.02)
    assert form["long_first_mode_bias"]["sign_test_p_value"] == 0.125
    assert 0.0 <= form["long_first_mode_bias_p_value"] <= 1.0
    z = study.bias.mean_percent / study.bias.mean_deviation_percent
    assert study.bias.p_value == pytest.approx(math.erfc(abs(z) / math.sqrt(2.0)))
    # What is shared does not average out; readings and overhangs alone leave no room for chance.
    assert study.bias.p_value_without_shared < 1e-6 < study.bias.p_value
    assert study.bias.mean_correlation > 0.5
    # The paper's own predictions, from table 2.
    assert study.bias.published_percent == pytest.approx([-0.64, -1.41, -1.17, -1.91], abs=0.01)


def test_simulation_agrees_with_propagation(study: ER32Study) -> None:
    """The whole procedure done again by chance scatters as the slopes say, within what the draws can tell."""
    ratio = study.simulation.deviation_percent / study.bias.mean_deviation_percent
    assert ratio == pytest.approx(1.0, abs=4.0 / math.sqrt(2.0 * DRAWS))


def test_slopes_are_those_of_the_model(study: ER32Study) -> None:
    """Each shared quantity by finite differences, with the joint identified anew."""
    slopes = propagate(study.model, study.published, study.identified, TORQUE)
    long = study.published.long_tools[1]
    mount = study.published.mount(long.diameter_mm)
    reading = study.published.reading(long.diameter_mm, TORQUE)
    joint = joint_of(study.identified, long.diameter_mm, TORQUE)

    def predict(name: str, factor: float) -> float:
        model = study.model.varied({name: factor})
        start = model.assembly(mount.diameter_mm, mount.overhang_mm, mount.holder_length_mm, joint.k_y, joint.k_theta)
        found = follow_joint(start, reading.frequency_hz).tolist()
        assembly = model.assembly(mount.diameter_mm, long.overhang_mm, mount.holder_length_mm, *found)
        return math.log(assembly.natural_frequencies(1e3)[0])

    h = 1e-4
    for i, name in enumerate(slopes.names):
        finite = (predict(name, 1.0 + h) - predict(name, 1.0 - h)) / (2.0 * h)
        assert slopes.shared[1, i] == pytest.approx(finite, rel=1e-3, abs=1e-6), name


def test_overhang_slope_is_that_of_the_model(study: ER32Study) -> None:
    arguments = (129.0, 6.28e8, 1.04e5)
    _, _, _, slope = mode_slopes(study.model, study.model.assembly(12.7, 62.3, *arguments), (1, 2), ())
    up, down = (study.model.assembly(12.7, 62.3 + h, *arguments).natural_frequencies(15e3)[:2] for h in (1e-3, -1e-3))
    np.testing.assert_allclose(slope, np.log(up / down) / 2e-3, rtol=1e-5)


def test_inference_is_called_what_it_is(study: ER32Study, form: dict[str, Any]) -> None:
    assert form["inferred"]["frequencies"] == 30
    assert form["inferred"]["rms_percent"] < 0.5
    # Twelve quantities from thirty frequencies: most of the shape is not determined, and it is said.
    assert form["inferred"]["combinations_known"] < 12
    said = " ".join(text for _, text in findings(study))
    assert "not published" in said
    assert "consistency, not validation" in said


def test_the_paper_disagrees_with_itself(study: ER32Study) -> None:
    """Text beside figure 6 against tables 4 and 5, tables 1 and 2 against table 5."""
    found = {(item.what, item.diameter_mm, item.first, item.second) for item in study.disagreements}
    assert {
        ("k_y", 7.94, 3.44e8, 3.36e8),
        ("k_theta", 7.94, 2.54e4, 2.34e4),
        ("k_y", 16.0, 1.43e9, 1.35e9),
        ("k_theta", 16.0, 2.45e5, 2.53e5),
        ("overhang", 11.11, 114.9, 114.6),
        ("overhang", 16.0, 75.4, 75.7),
    } <= found
    # Nine overhangs are printed twice, four of them differently: by 0.2, 0.1, 0.3 and 0.3 mm.
    assert overhang_scatter(study.published) == pytest.approx(math.sqrt((0.04 + 0.01 + 0.09 + 0.09) / 9.0 / 2.0))


def test_same_seed_same_result(study: ER32Study, form: dict[str, Any]) -> None:
    again = json.loads(json.dumps(as_dict(run(ER32Settings(draws=DRAWS))), allow_nan=False))
    assert again == form
    other = run(ER32Settings(draws=DRAWS, seed=1))
    assert other.simulation != study.simulation
    assert other.bias.percent == pytest.approx(study.bias.percent, abs=1e-4)


def test_json_has_the_promised_keys(form: dict[str, Any]) -> None:
    assert {"settings", "seed", "versions", "inferred", "trends", "disagreements", "findings"} <= form.keys()
    assert len(form["identified"]) == 20
    for row in form["identified"]:
        assert {"diameter_mm", "torque_nm", "k_y", "k_theta", "k_y_interval", "k_theta_interval"} <= row.keys()
        for name in ("k_y", "k_theta"):
            low, high = row[f"{name}_interval"]
            assert low < row[name] < high
    assert len(form["transfer"]["rows"]) == 20
    assert len(form["long_first_mode_bias_percent"]) == 4


@pytest.mark.parametrize(("negative", "p_value"), [(4, 0.125), (3, 0.625), (2, 1.0), (0, 0.125)])
def test_sign_test(negative: int, p_value: float) -> None:
    assert sign_test([-1.0] * negative + [1.0] * (4 - negative)) == p_value


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"draws": 0}, "draws is 0"),
        ({"seed": -1}, "seed is -1"),
        ({"starts": 1.5}, "starts is 1.5"),
        ({"resolution": Resolution(fine_hz=0.0)}, "fine_hz is 0"),
        ({"chance": ChanceModel(overhang_mm=math.nan)}, "overhang_mm is nan"),
    ],
)
def test_settings_without_meaning(settings: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        ER32Settings(**settings)
