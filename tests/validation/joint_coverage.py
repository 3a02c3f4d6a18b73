"""Do 95 % intervals hold the truth? `python tests/validation/joint_coverage.py --seed S --cases N`.

Every case draws a campaign: joint, tolerances (from their priors) and noise. Its parameters are fitted together with
the tolerances and profiled. Counted is how often the profile interval of k_y, k_theta and k_ytheta holds the truth,
against 95 % by an exact binomial test at the 1 % level. Rank statistics: the signed root of the profile's rise at the
truth, as a probability, is uniform if the whole confidence distribution is right (Kolmogorov and Smirnov's test).
The fit starts at the truth here: whether it is reached from afar is measured by joint_global_optimum.py.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy import stats

from receptance.fit import profile_likelihoods

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from receptance.fit import identify
from simulated_campaigns import PARAMETERS, confidence, simulate_campaign

LEVEL = 0.95
REJECTED_AT = 0.01


@dataclass(frozen=True)
class Outcome:
    """One parameter of one case."""

    case: int
    name: str
    truth: float
    value: float
    lower: float
    upper: float
    rank: float
    statement: str

    @property
    def covered(self) -> bool:
        return self.lower <= self.truth <= self.upper


def measure(seed: int, case: int) -> list[Outcome]:
    """Return the coverage of the intervals of one campaign."""
    campaign = simulate_campaign(np.random.default_rng([seed, case]))
    found = identify(
        campaign.observations,
        campaign.unknowns(campaign.truth),
        tolerances=campaign.tolerances,
        starts=1,
        threads=1,
    )
    outcomes = []
    for name, profile in profile_likelihoods(found, PARAMETERS, level=LEVEL).items():
        truth = campaign.truth[name]
        outcomes.append(
            Outcome(
                case,
                name,
                truth,
                profile.value,
                profile.lower,
                profile.upper,
                rank=confidence(profile, truth),
                statement=profile.statement,
            )
        )
    return outcomes


def report(outcomes: list[Outcome]) -> tuple[list[dict[str, Any]], str]:
    """Return the results as plain values and as text."""
    rows, lines = [], []
    for name in PARAMETERS:
        own = [one for one in outcomes if one.name == name]
        hits = sum(one.covered for one in own)
        test = stats.binomtest(hits, len(own), LEVEL)
        low, high = test.proportion_ci(0.95)
        ranks = [one.rank for one in own if np.isfinite(one.rank)]
        uniform = stats.kstest(ranks, "uniform").pvalue
        open_ = sum(not (np.isfinite(one.upper) and one.lower not in (0.0, -np.inf)) for one in own)
        rows.append(
            {
                "parameter": name,
                "cases": len(own),
                "covered": hits,
                "interval": (low, high),
                "p_value": test.pvalue,
                "rank_p_value": uniform,
                "open": open_,
            }
        )
        lines.append(
            f"{name:15s} {hits} of {len(own)} = {100 * hits / len(own):.1f} % ({100 * low:.1f} to {100 * high:.1f} %), "
            f"binomial p = {test.pvalue:.3f}; ranks uniform p = {uniform:.3f}; {open_} open"
        )
    return rows, "\n".join(lines)


def main() -> None:
    """Measure, print, write JSON if requested; the exit code is 1 where a coverage or a rank statistic is rejected."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--cases", type=int, default=100)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    begun = time.perf_counter()
    outcomes, lost = [], 0
    for case in range(options.cases):
        try:
            outcomes += measure(options.seed, case)
        except Exception as error:  # a lost case is reported, and is a failure
            lost += 1
            sys.stdout.write(f"case {case} is lost: {error}\n")
    rows, text = report(outcomes)
    seconds = time.perf_counter() - begun
    sys.stdout.write(f"seed {options.seed}, {options.cases} campaigns, {lost} lost, {seconds:.0f} s\n{text}\n")
    if options.json:
        options.json.write_text(json.dumps({"seed": options.seed, "lost": lost, "rows": rows}), encoding="utf-8")
    bad = any(row["p_value"] < REJECTED_AT or row["rank_p_value"] < REJECTED_AT for row in rows)
    sys.exit(int(bad or lost > 0))


if __name__ == "__main__":
    main()
