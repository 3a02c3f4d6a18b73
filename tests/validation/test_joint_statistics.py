"""Coverage of profile intervals and the best optimum from afar, on fewer cases than the commands beside this take."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parent))

import joint_coverage
import joint_global_optimum

SEED = 20


@pytest.mark.slow
def test_intervals_hold_the_truth(summarise):
    outcomes = [one for case in range(60) for one in joint_coverage.measure(SEED, case)]
    rows, text = joint_coverage.report(outcomes)
    summarise("joint coverage", f"seed {SEED}, 60 campaigns\n{text}", rows)
    for row in rows:
        assert row["p_value"] > joint_coverage.REJECTED_AT, text
        assert row["rank_p_value"] > joint_coverage.REJECTED_AT, text


@pytest.mark.slow
def test_the_best_optimum_is_reached_from_three_decades_off(summarise):
    outcomes = [joint_global_optimum.measure(SEED, case) for case in range(20)]
    text = joint_global_optimum.report(SEED, outcomes)
    summarise("joint optimum", text, [one.reached(one.staged) for one in outcomes])
    # One of twenty may end in a flat valley a hundredth of log-likelihood away; the command measures the share.
    assert np.sum([one.reached(one.staged) for one in outcomes]) >= 19, text
