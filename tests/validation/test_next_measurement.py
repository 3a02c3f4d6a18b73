"""Expected gain of a measurement, against refits with that measurement, over random campaigns."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from receptance import identify
from receptance.fit import Observation
from receptance.predict import Candidate, next_measurement
from simulated_campaigns import PARAMETERS, simulate_campaign

SEED = 20261121
CAMPAIGNS = 20
KNOWN = 0.15
"""Deviations (of log10, or of a coupling relative to sqrt(k_y k_theta)) beyond which nothing Gaussian is expected."""
Summarise = Callable[[str, str, object], None]


def compared(seed: int) -> list[tuple[str, float, float]]:
    """Return parameter, expected and refitted deviation, of a second overhang beside a first one."""
    rng = np.random.default_rng([SEED, seed])
    campaign = simulate_campaign(rng, overhangs=2)
    first, second = campaign.observations
    shared = [t for t in campaign.tolerances if t.configurations != ("1",)]
    starts = {name: value for name, value in campaign.truth.items() if name in PARAMETERS or ".c_" in name}
    unknowns = campaign.unknowns({k: v for k, v in starts.items() if k != "joint.c_ytheta"})
    found = identify(first, unknowns, tolerances=shared, starts=1)
    observation = Observation(
        label="second",
        assembly=second.assembly,
        frequency_hz=second.frequency_hz,
        standard_deviation=campaign.noise,
        configuration="1",
    )
    own = tuple(t for t in campaign.tolerances if t.configurations == ("1",))
    candidate = Candidate(observation=observation, tolerances=own)
    expected = next_measurement(found, candidate, targets=list(PARAMETERS)).best.expected
    both = identify([first, second], unknowns, tolerances=campaign.tolerances, starts=1)
    size = {"joint.k_ytheta": np.sqrt(campaign.truth["joint.k_y"] * campaign.truth["joint.k_theta"])}
    rows = []
    for name in PARAMETERS:
        i = both.addresses.index(name)
        refit = float(np.sqrt(both.covariance[i, i]))
        if refit / size.get(name, 1.0) < KNOWN:
            rows.append((name, expected[name].deviation, refit))
    return rows


@pytest.mark.slow
def test_expected_deviations_are_those_of_refits(summarise: Summarise) -> None:
    rows = [row for seed in range(CAMPAIGNS) for row in compared(seed)]
    ratio = np.array([expected / refit for _, expected, refit in rows])
    within = float(np.mean(np.abs(np.log(ratio)) < np.log(1.3)))
    low, middle, high = np.quantile(ratio, [0.05, 0.5, 0.95])
    text = (
        f"expected over refitted deviation, {len(rows)} parameters of {CAMPAIGNS} campaigns, seed {SEED}: median "
        f"{middle:.2f}, 90 % from {low:.2f} to {high:.2f}, {100.0 * within:.0f} % within 30 %"
    )
    print(text)
    for name, expected, refit in rows:
        print(f"  {name} {expected:.3g} {refit:.3g} {expected / refit:.2f}")
    summarise("next measurement", text, {"median": middle, "low": low, "high": high, "within": within})
    assert 0.95 < middle < 1.05
    assert within >= 0.95
