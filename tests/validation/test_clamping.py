"""docs/studies/clamping.py: torque is decided for every diameter; the virtual studies have controls."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import clamping
import er32_joints
import er32_tables
import study_scripts
from receptance import Observation

DIAMETERS = (7.94, 9.53, 11.11, 12.7, 16.0)


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    return study_scripts.run("clamping", tmp_path_factory.mktemp("study"))


@pytest.mark.slow
def test_torque_is_decided_for_every_diameter(study: dict[str, Any]) -> None:
    assert tuple(one["diameter_mm"] for one in study["torque"]) == DIAMETERS
    for one in study["torque"]:
        low, high = one["interval_of_resolution"]
        assert low < one["change_percent"] < high
        # The scatter of the states can only widen what the resolution leaves open.
        change, least, most = one["law"]["change_percent"]
        assert most - least > 0.5 * (high - low)
        assert change == pytest.approx(one["change_percent"], abs=2.0)


def test_coarse_resolution_withdraws_the_verdict() -> None:
    """Printed ten times more coarsely, table 4 does not resolve the growth of the thinnest tool."""
    coarse = er32_joints.Resolution(fine_hz=10.0, coarse_hz=100.0)
    trends = er32_joints.find_trends(er32_joints.identify_joints(er32_tables.load(), coarse, starts=1, seed=0), 135.0)
    exceeds = {t["diameter_mm"]: t["exceeds"] for t in trends["torque"] if t["quantity"] == "k_y"}
    assert exceeds[7.94] is False
    assert exceeds[9.53] is True


def _law_of(exponent: float, rng: np.random.Generator) -> clamping.FittedLaw:
    """Fit four states that scatter by 1 % about a law of the torque."""
    states = []
    for torque in (95.0, 115.0, 135.0, 155.0):
        k_y = 4e8 * (torque / 135.0) ** exponent * np.exp(0.01 * rng.standard_normal())
        true = er32_tables.assembly(9.53, 62.6, k_y, 4e4)
        frequency = true.natural_frequencies(15e3)[:2].round()
        states.append(
            Observation.from_modes(
                assembly=true,
                frequency_hz=frequency,
                standard_deviation_hz=er32_joints.Resolution().standard_deviation(frequency),
                configuration=f"{torque:g}",
                conditions={"torque": torque},
            )
        )
    return clamping.fit_law(states, "k_y", "torque", 135.0, reclamped=False)


@pytest.mark.slow
def test_only_an_existing_law_is_found() -> None:
    rng = np.random.default_rng(23)
    hits = 0
    for exponent in (0.0, 0.3):
        laws = [_law_of(exponent, rng) for _ in range(10)]
        hits += sum(law.interval[0] < exponent < law.interval[1] for law in laws)
        significant = sum(law.significant for law in laws)
        assert significant >= 9 if exponent else significant <= 2
    # Three of twenty outside a 95 % interval happen in 7.5 %, four in 1.6 %.
    assert hits >= 17


def test_torque_of_one_tool_is_judged() -> None:
    """Eleven millimetres, the largest growth of table 4: more than the resolution, and more than its states scatter."""
    resolution = er32_joints.Resolution()
    joints = er32_joints.identify_joints(er32_tables.load(), resolution, starts=1, seed=0)
    one = clamping.study_torque(joints, er32_joints.find_trends(joints, 135.0), resolution, 11.11)
    assert one["more_than_resolution"]
    assert one["law"]["significant"]
    assert one["law"]["change_percent"][0] == pytest.approx(one["change_percent"], abs=2.0)


def test_one_ratio_of_the_springs_in_series() -> None:
    found = clamping.study_insertion(5.0, 0.03, np.random.default_rng([4, 0]))
    assert found["found"] == clamping.SERIES
    share, deviation = found["compliance_of_outer"]["k_y"]
    assert abs(share - 5.0 / 6.0) < 4.0 * deviation


@pytest.mark.slow
def test_insertion_finds_the_springs_in_series_and_has_a_control(study: dict[str, Any]) -> None:
    control, *cases = study["insertion"]["cases"]
    assert control["ratio"] < 0.01
    best = control["hypotheses"][0]["log_evidence"]
    behind = {one["name"]: best - one["log_evidence"] for one in control["hypotheses"]}
    assert behind[clamping.ONE] < 3.0, "where only one spring is simulated, one spring must do"
    assert behind[clamping.CONSTANT] > 10.0
    for case in cases:
        first, second = case["hypotheses"][:2]
        assert case["found"] == first["name"] == clamping.SERIES
        assert first["adequate"]
        assert first["log_evidence"] - second["log_evidence"] > 10.0
        single = [one for one in case["hypotheses"] if one["name"] in (clamping.ONE, clamping.CONSTANT)]
        assert not any(one["adequate"] for one in single)
        for share, deviation in case["compliance_of_outer"].values():
            assert abs(share - case["ratio"] / (1.0 + case["ratio"])) < 4.0 * deviation + 1e-3
    # Eq. 15 for k2 = 5 k1, the inner spring halved.
    assert cases[1]["change_percent"]["k_y"] == pytest.approx(100 * ((1 / 1.2) ** -1 / (1 + 1 / 2.5) - 1))


@pytest.mark.parametrize(("exponent", "ratio"), [(1.0, 8), (3.0, 62)])
def test_data_required_by_eq_15(exponent: float, ratio: int) -> None:
    needed = clamping.needed_ratio(exponent)
    assert round(needed) == ratio
    whole, half = needed / (1.0 + needed), needed * 0.5**exponent / (1.0 + needed * 0.5**exponent)
    assert half / whole == pytest.approx(0.9)


@pytest.mark.slow
def test_material_has_a_control_and_every_error_an_effect(study: dict[str, Any]) -> None:
    material = study["material"]
    assert material["control_percent"] < 1e-6
    assert {one["diameter_mm"] for one in material["changes"]} == set(DIAMETERS)
    largest = max(material["changes"], key=lambda one: abs(one["k_theta_percent"]))
    assert largest["slip"].startswith("modulus")
    assert all(3.0 < abs(percent) < 10.0 for percent in material["modulus_percent"].values())


@pytest.mark.slow
def test_damping_is_significant_only_free_free(study: dict[str, Any]) -> None:
    for test, allowed in study["damping"]["allowed_factor"].items():
        errors = [case["real_percent"] for case in study["damping"]["cases"] if case["test"] == test]
        machine = test.startswith("in the machine")
        assert errors == sorted(errors)
        assert (errors[0] < clamping.WORTH_PERCENT) is machine
        assert (study_scripts.number(allowed) > 1.0) is machine


def test_every_study_quotes_published_statements() -> None:
    assert set(clamping.CLAIMS) == {"insertion", "material", "damping", "torque", "diameter"}
