"""The stated variance of FRFs from simulated hits covers the truth, in one of the cases of `hammer_coverage.py`."""

import os

import pytest

from validation import hammer_coverage as coverage

SEED = int(os.environ.get("RECEPTANCE_TEST_SEED", "20"))
RUNS = 150


@pytest.mark.slow
def test_intervals_cover_the_truth(summarise):
    """An exact binomial test at the 1 % level does not reject 95 %, for magnitude, phase and both together."""
    case = coverage.CASES[0]
    report = coverage.measure(case, SEED, RUNS)
    summarise(f"coverage: {case.name}", report.text(), report.as_json())
    assert len(report.outcomes) == RUNS
    for part, share in report.shares().items():
        assert share.p_value >= coverage.REJECTED_AT, f"{part}: {report.text()}"
    # The test has the power to see a variance that is wrong by a factor of two.
    for factor in (0.5**0.5, 2.0**0.5):
        assert report.shares(factor)["both"].p_value < coverage.REJECTED_AT
