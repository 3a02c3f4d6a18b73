"""Coverage of a joint's intervals behind a spindle that was identified from a blank, through files and campaign."""

from __future__ import annotations

import os
from collections.abc import Callable

import pytest
from scipy.stats import binomtest

from joint_on_measured_spindle import coverage
from spindle_campaign import TRUE

SEED = int(os.environ.get("RECEPTANCE_TEST_SEED", "100"))


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "cases"), [("table", 30), ("modes", 6)])
def test_the_intervals_of_the_joint_cover(kind: str, cases: int, summarise: Callable[[str, str, object], None]) -> None:
    """1 % noise of all records. The errors of the spindle are an upper bound, so coverage may be above 95 %."""
    found = coverage(range(SEED, SEED + cases), 0.01, kind)
    inside = {address: sum(case["inside"][address] for case in found) for address in TRUE}
    text = f"seeds {SEED} to {SEED + cases - 1}: " + ", ".join(f"{a} {n} of {cases}" for a, n in inside.items())
    summarise(f"coverage of a joint's 95 % intervals, spindle as {kind}", text, inside)
    for address, count in inside.items():
        assert binomtest(count, cases, 0.95, alternative="less").pvalue > 0.01, text
        assert max(abs(case["off"][address]) for case in found) < 5.0
