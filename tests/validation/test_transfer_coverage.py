"""Prediction intervals of configurations that were not fitted, on fewer cases than the command beside this takes."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parent))

import transfer_coverage


@pytest.mark.slow
def test_prediction_intervals_contain_held_out_values(summarise):
    seed, cases = 30, 40
    p_value, text = transfer_coverage.report(seed, [transfer_coverage.measure(seed, case) for case in range(cases)])
    summarise("transfer coverage", text, p_value)
    assert p_value > transfer_coverage.REJECTED_AT, text


def test_prediction_intervals_of_few_campaigns():
    """A coarse watch: of ten intervals at 95 % six or fewer hold the truth once in 36,000."""
    outcomes = [transfer_coverage.measure(31, case, draws=20) for case in range(10)]
    assert sum(one.covered for one in outcomes) >= 7, [one.z for one in outcomes]
    assert all(0.0 < one.deviation_hz < 0.1 * one.true_hz for one in outcomes)
