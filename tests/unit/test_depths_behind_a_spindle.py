"""Depths of cut of a tool behind a spindle that was identified with it: lines of the tip, and modes above them."""

from __future__ import annotations

import numpy as np
import pytest

from receptance.fit.discrepancy import Discrepancy
from receptance.stability import Lobes, Milling, TipModes, stability_lobes
from receptance.stability.lobes import limited_above

SEED = 20261129
CUT = Milling(teeth=3, k_t=8e8, k_n=2.5e8)
SPEEDS = np.arange(4000.0, 20000.0, 40.0)
LINES = np.arange(300.0, 1500.0, 0.5)


def lobes(uncertain: bool = True) -> Lobes:
    """Return lobes of a tip with one mode, with 5 % of error of its receptance."""
    tip = TipModes(frequency_hz=[700.0], damping_ratio=[0.03], shapes=[[3.0, 3.0]]).receptance(LINES)
    factors = np.exp(0.05 * np.random.default_rng(SEED).standard_normal(200))
    draws = factors[:, None, None, None] * tip if uncertain else None
    return stability_lobes(CUT, LINES, tip, speeds_rpm=SPEEDS, draws=draws)


@pytest.mark.parametrize("uncertain", [True, False])
def test_a_mode_above_the_lines_limits_deep_lobes(uncertain: bool) -> None:
    plain = lobes(uncertain)
    cap = float(np.median(plain.depth))
    found = limited_above(plain, cap, 2400.0, 1500.0, SEED)
    deep = plain.depth > cap
    assert found.depth[deep] == pytest.approx(cap)
    assert (found.chatter_hz[deep] == 2400.0).all()
    assert (found.depth[~deep] == plain.depth[~deep]).all()
    assert (found.chatter_hz[~deep] == plain.chatter_hz[~deep]).all()
    assert "above the lines, which end at 1500 Hz, the model chatters from" in found.notes[-1]
    if uncertain:
        # Nothing was measured of this mode, so that the depth with 95 % is well below its limit.
        assert (found.stable_depth(0.95) <= plain.stable_depth(0.95)).all()
        assert found.stable_depth(0.95).max() < 0.8 * cap


def test_a_mode_that_chatters_later_changes_nothing() -> None:
    plain = lobes()
    found = limited_above(plain, 100.0 * float(plain.depth[np.isfinite(plain.depth)].max()), 2400.0, 1500.0, SEED)
    assert not np.isfinite(plain.depth).all() or found.notes == plain.notes
    finite = np.isfinite(plain.depth)
    assert (found.depth[finite] == plain.depth[finite]).all()


def test_no_standard_deviation_becomes_smaller_than_the_estimate() -> None:
    found = Discrepancy(2e-4, 0.01).at_least(Discrepancy(1e-4, 0.03, 0.1))
    assert found == Discrepancy(2e-4, 0.03, 0.1)
    assert Discrepancy(2e-4, None).at_least(Discrepancy(1e-4, None)) == Discrepancy(2e-4, None)
