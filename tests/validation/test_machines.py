"""docs/studies/machines.py: results on two virtual machines, and failures of prediction."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import machines
import study_scripts
from machines_report import close_and_far

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    return study_scripts.run("machines", tmp_path_factory.mktemp("study"))


def test_spindles_and_tools(study: dict[str, Any]) -> None:
    """Nine tenths of the lines are usable; frequencies within the paper's 2 %, heights within the stated deviation."""
    for case in study["virtual"]:
        peaks = [peak for one in case["tools"] for peak in one["peaks"]]
        assert case["usable"] >= 0.9
        assert case["median_error"] < 0.03
        assert case["median_error_of_modes"] < case["median_error"]
        assert all(abs(peak["frequency_percent"]) < 2.0 for peak in peaks)
        heights = np.array([peak["magnitude_percent"] for peak in peaks])
        assert np.median(np.abs(heights)) < 3.0
        z = np.log1p(0.01 * heights) / [0.01 * peak["deviation_percent"] for peak in peaks]
        assert np.sqrt(np.mean(np.square(z))) < 2.5
        assert [one["tool"] for one in case["tools_line_by_line"]] == [one["tool"] for one in case["tools"]]


def test_short_tools_fail_with_an_unknown_spindle(study: dict[str, Any]) -> None:
    for case in study["virtual"]:
        assert min(one["true_hz"] for one in case["short"]) > machines.BAND_HZ[1]
        below = [one["usable"] for one in case["reach"] if 1000.0 <= one["low_hz"] < 5000.0]
        above = [one["usable"] for one in case["reach"] if one["low_hz"] >= 7000.0]
        assert min(below) > 0.9
        assert max(above) < 0.8
        assert any(not one["known"] for one in case["short"])
        for one in case["short"]:
            if one["known"]:
                assert abs(one["magnitude_percent"]) < 4.0 * one["deviation_percent"] + 5.0


def test_close_modes_and_the_diagnosis(study: dict[str, Any]) -> None:
    height, frequency, far = close_and_far(study)
    assert height > 15.0
    assert height > 4.0 * far
    assert frequency < 3.0
    assert study["diagnosis"]["verdict"] == "named"
    (cause,) = study["diagnosis"]["causes"]
    assert cause["id"] == "spindle_mode"
    found = cause["parameters"]["spindle_mode.log_frequency"]
    moved = -np.log1p(0.01 * machines.MOVED_PERCENT)
    assert found["lower"] - 3e-4 < moved < found["upper"] + 3e-4
    assert found["value"] == pytest.approx(moved, rel=0.02)
