"""Prediction intervals of configurations that were not fitted, on fewer cases than the command beside this takes."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parent))

import transfer_coverage


@pytest.mark.slow
def test_prediction_intervals_contain_held_out_values(summarise):
    seed, cases = 30, 20
    p_value, text = transfer_coverage.report(seed, [transfer_coverage.measure(seed, case) for case in range(cases)])
    summarise("transfer coverage", text, p_value)
    assert p_value > transfer_coverage.REJECTED_AT, text
