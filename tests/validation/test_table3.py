"""docs/studies/table3.py on simulated measurements: the four sets, what is determined, and the next test."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import study_scripts
import table3

STIFFNESSES = ("joint.k_y", "joint.k_theta")


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    return study_scripts.run("table3", tmp_path_factory.mktemp("study"))


def _sets(study: dict[str, Any], *, free: bool) -> list[dict[str, Any]]:
    return [one for one in study["sets"] if (one["test"] == table3.FREE.name) is free]


def _half_widths(profiles: dict[str, Any]) -> dict[str, float]:
    return {name: profiles[name]["half_width_percent"] for name in STIFFNESSES}


def test_manual_check_rejects_wrong_sets_only_free_free() -> None:
    """The paper's figures 7 and 8, without a fit."""
    tests = {
        test.free: table3.judge_sets(table3.measure(test, table3.Measuring(), table3.TRUTH), None)
        for test in (table3.MACHINE, table3.FREE)
    }
    assert all(one["over_all_modes_percent"] < 4.0 for one in tests[False])
    assert all(abs(one["modes"][0]["percent"]) < 4.0 for one in tests[True]), "the first mode still fits"
    assert [one["passes_by_hand_from_percent"] > 3.0 for one in tests[True]] == [False, True, True, True]
    assert all(one["rejected"] is None for one in tests[True])


@pytest.mark.slow
def test_the_machine_alone_leaves_the_joint_open(study: dict[str, Any]) -> None:
    alone = study["machine_alone"]
    widths = _half_widths(alone)
    assert widths["joint.k_y"] > 50.0
    assert widths["joint.k_theta"] > 10.0
    assert None in alone["joint.c_y"]["interval"]
    assert all(one["statement"] for one in alone.values())


@pytest.mark.slow
def test_intervals_contain_the_simulated_values(study: dict[str, Any]) -> None:
    for key in ("machine_alone", "with_free_free", "with_best"):
        assert all(study[key][name]["inside"] for name in STIFFNESSES)


@pytest.mark.slow
def test_machine_data_reject_wrong_sets_only_at_noise_level(study: dict[str, Any]) -> None:
    sets = _sets(study, free=False)
    assert [one["name"] for one in sets] == ["curve_fitted", "manual_1", "manual_2", "manual_3"]
    # By hand, as the paper tuned them: within a few per cent of every mode of the band.
    assert all(one["over_all_modes_percent"] < 4.0 for one in sets)
    assert [one["rejected"] for one in sets] == [False, True, True, True]
    for one in sets:
        read = [abs(mode["percent"]) for mode in one["modes"] if mode["shows_as_peak"]]
        assert read, "some mode shows as a peak"
        assert one["passes_by_hand_from_percent"] == max(read)


@pytest.mark.slow
def test_manual_sets_fail_free_free(study: dict[str, Any]) -> None:
    """The paper's figure 8: the first mode still fits all of them, the others only the curve-fitted set."""
    fitted, *manual = _sets(study, free=True)
    for one in manual:
        assert abs(one["modes"][0]["percent"]) < 4.0
        assert one["passes_by_hand_from_percent"] > 3.0
    assert fitted["passes_by_hand_from_percent"] < 1e-6


@pytest.mark.slow
def test_proposed_free_free_test_closes_the_intervals(study: dict[str, Any]) -> None:
    worst = {
        one["name"]: max(map(study_scripts.number, one["half_width_percent"].values())) for one in study["expected"]
    }
    assert study["expected"][0]["free"]
    assert min(worst.values()) < 10.0
    assert list(worst.values()) == sorted(worst.values())
    assert worst["the same once more"] > 50.0, "the same test once more does not help"
    assert study["closes"]
    promised = next(one for one in study["expected"] if one["name"] == table3.FREE.name)["half_width_percent"]
    for name, width in _half_widths(study["with_free_free"]).items():
        assert width < 10.0
        # The expectation is over joints that the data allow, so the truth may differ.
        assert width < 2.0 * promised[name]


def test_dampings_are_within_a_physical_bound() -> None:
    bounds = {unknown.address: unknown for unknown in table3.unknowns()}
    w = 2.0 * math.pi * 720.0
    for y in ("y", "theta"):
        own = bounds[f"joint.c_{y}"]
        assert own.upper * w / table3.TRUTH[f"joint.k_{y}"] == pytest.approx(0.12)
        assert own.lower < table3.TRUTH[f"joint.c_{y}"] < own.upper


def test_noise_follows_from_coherence_and_averages() -> None:
    measuring = table3.Measuring(coherence=0.98, averages=10)
    assert measuring.noise == pytest.approx(math.sqrt(0.02 / (2 * 9 * 0.98)))
    one = table3.measure(table3.MACHINE, measuring, table3.TRUTH, np.random.default_rng(5))
    clean = table3.MACHINE.assembly.receptance(one.frequency_hz)
    ratio = np.log(one.receptance / clean) / one.standard_deviation
    assert np.std(ratio.real) == pytest.approx(1.0, abs=0.1)
    assert np.std(ratio.imag) == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize(("coherence", "averages"), [(1.0, 10), (0.98, 1)])
def test_invalid_noise_is_refused(coherence: float, averages: int) -> None:
    with pytest.raises(ValueError, match="expected"):
        table3.Measuring(coherence=coherence, averages=averages)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [101, 102])
def test_other_errors_and_noise(seed: int) -> None:
    """Whether a nearly rigid joint (manual 2) is rejected in the machine depends on the draw; free it is."""
    found = table3.study(seed=seed)
    assert found["closes"]
    assert found["expected"][0]["free"]
    verdicts = {one["name"]: one["rejected"] for one in _sets(found, free=False)}
    assert verdicts["manual_1"]
    assert verdicts["manual_3"]
    if found["machine_alone"]["joint.k_y"]["interval"][1] is None:
        worst = max(found["expected"][0]["half_width_percent"].values())
        assert worst == math.inf, "no test bounds a joint that may be rigid"
    assert all(one["rejected"] for one in _sets(found, free=True)[1:])
    assert found["rms"] < 1.1
