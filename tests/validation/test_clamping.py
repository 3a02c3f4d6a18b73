"""docs/studies/clamping.py: torque is decided for every diameter; the virtual studies have controls."""

from __future__ import annotations

from typing import Any

import pytest

import study_scripts
from clamping_errors import WORTH_PERCENT
from clamping_insertion import CONSTANT, ONE, SERIES

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


@pytest.mark.slow
def test_insertion_finds_the_springs_in_series_and_has_a_control(study: dict[str, Any]) -> None:
    control, *cases = study["insertion"]["cases"]
    assert control["ratio"] < 0.01
    best = control["hypotheses"][0]["log_evidence"]
    behind = {one["name"]: best - one["log_evidence"] for one in control["hypotheses"]}
    assert behind[ONE] < 3.0, "where only one spring is simulated, one spring must do"
    assert behind[CONSTANT] > 10.0
    for case in cases:
        first, second = case["hypotheses"][:2]
        assert case["found"] == first["name"] == SERIES
        assert first["adequate"]
        assert first["log_evidence"] - second["log_evidence"] > 10.0
        single = [one for one in case["hypotheses"] if one["name"] in (ONE, CONSTANT)]
        assert not any(one["adequate"] for one in single)
        for share, deviation in case["compliance_of_outer"].values():
            assert abs(share - case["ratio"] / (1.0 + case["ratio"])) < 4.0 * deviation + 1e-3
    # Eq. 15 for k2 = 5 k1, the inner spring halved.
    assert cases[1]["change_percent"]["k_y"] == pytest.approx(100 * ((1 / 1.2) ** -1 / (1 + 1 / 2.5) - 1))


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
        assert (errors[0] < WORTH_PERCENT) is machine
        assert (study_scripts.number(allowed) > 1.0) is machine
