"""Predicted tools against virtual machines, fewer than `catalogue_coverage.py` takes by itself."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from scipy import stats

sys.path.insert(0, str(Path(__file__).resolve().parent))

from catalogue_coverage import LEVEL, REJECTED_AT, WITHIN, measure, report

SEED = 20261121


@pytest.mark.slow
def test_natural_frequencies_and_their_intervals(summarise: Callable[..., None]) -> None:
    print(f"seed {SEED}")
    outcomes = [measure(SEED, case) for case in range(12)]
    found, text = report(outcomes)
    summarise("tools of a catalogue in virtual machines", text, found)
    assert sum(max(map(abs, one.errors)) <= WITHIN for one in outcomes) >= LEVEL * len(outcomes)
    for index in range(3):
        hits = sum(one.covered[index] for one in outcomes)
        assert stats.binomtest(hits, len(outcomes), LEVEL).pvalue > REJECTED_AT
