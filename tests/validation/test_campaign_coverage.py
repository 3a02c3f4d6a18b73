"""Intervals of a campaign hold the truth where dimensions, materials and sensor err by their tolerances."""

from __future__ import annotations

import os
from collections.abc import Callable

import pytest

from validation.campaign_coverage import LEVEL, measure

SEED = int(os.environ.get("RECEPTANCE_TEST_SEED", "2"))
DRAWS = 40


@pytest.mark.slow
def test_intervals_cover(summarise: Callable[[str, str, object], None]) -> None:
    found = measure(SEED, DRAWS)
    summary = {"covered": found.covered, "draws": DRAWS, "seed": SEED, "level": LEVEL}
    summarise("campaign: coverage under tolerances", f"seed {SEED}, {found.report()}", summary)
    for name in found.covered:
        assert found.p_value(name) > 0.01 / len(found.covered), found.report()
