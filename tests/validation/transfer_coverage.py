"""Do prediction intervals hold what was not fitted? `python tests/validation/transfer_coverage.py --seed S --cases N`.

Every case draws a campaign of three overhangs: joint, tolerances (from their priors) and noise. One of the three is
held out, the joint and the tolerances are identified on the other two, and the third is predicted. Counted is how often
the 95 % interval holds the true natural frequency of one mode, drawn for each case (the modes of a case err together),
against 95 % by an exact binomial test at the 1 % level, and which share of the measured lines is in the band of the
receptance, drawn and linear. The fits start at the truth: whether it is reached from afar is measured by
joint_global_optimum.py.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy import stats

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from receptance import Assembly
from receptance.fit.parameters import Parameters
from receptance.predict import transfer
from simulated_campaigns import SimulatedCampaign, simulate_campaign

LEVEL = 0.95
REJECTED_AT = 0.01


@dataclass(frozen=True)
class Outcome:
    """One held-out configuration."""

    case: int
    true_hz: float
    predicted_hz: float
    deviation_hz: float
    drawn_share: float
    linear_share: float
    decibel: float

    @property
    def z(self) -> float:
        return (self.true_hz - self.predicted_hz) / self.deviation_hz

    @property
    def covered(self) -> bool:
        return abs(self.z) <= stats.norm.ppf(0.5 + 0.5 * LEVEL)


def true_assembly(campaign: SimulatedCampaign, index: int) -> Assembly:
    """Return what was measured, with its true joint and errors."""
    data = campaign.observations
    parameters = Parameters(campaign.unknowns(), campaign.tolerances, [o.site(i) for i, o in enumerate(data)])
    vector = [campaign.truth.get(u.name, campaign.errors.get(u.name)) for u in parameters.unknowns]
    return parameters.at(data[index].site(index)).apply(data[index].assembly, np.array(vector))


def measure(seed: int, case: int, draws: int = 100) -> Outcome:
    """Return the coverage of the intervals of one campaign."""
    rng = np.random.default_rng([seed, case])
    campaign = simulate_campaign(rng, overhangs=3)
    index = int(rng.integers(3))
    held_out = campaign.observations[index]
    found = transfer(
        campaign.observations,
        campaign.unknowns(campaign.truth),
        tolerances=campaign.tolerances,
        splits=[[held_out.configuration]],
        draws=draws,
        seed=case,
        starts=1,
        threads=1,
    )
    split, frf = found.splits[0], found.frfs[0]
    # Far enough that the first three modes are among them.
    upper = 6.0 * float(held_out.frequency_hz[-1])
    true = true_assembly(campaign, index).natural_frequencies(upper)
    there = split.identified.at(held_out.assembly, configuration=held_out.configuration, tolerances=campaign.tolerances)
    frequencies = there.natural_frequencies(upper)
    predicted, deviation = frequencies.predicted_hz, frequencies.standard_error_hz
    mode = int(rng.integers(3))
    linear = replace(frf, drawn=frf.drawn[:0])
    return Outcome(
        case,
        float(true[mode]),
        float(predicted[mode]),
        float(deviation[mode]),
        frf.share_within(LEVEL) or 0.0,
        linear.share_within(LEVEL) or 0.0,
        frf.rms_decibel,
    )


def report(seed: int, outcomes: list[Outcome]) -> tuple[float, str]:
    """Return the p-value of the coverage, and all as text."""
    hits = sum(one.covered for one in outcomes)
    test = stats.binomtest(hits, len(outcomes), LEVEL)
    low, high = test.proportion_ci(0.95)
    z = np.array([one.z for one in outcomes])
    drawn, linear = (np.mean([getattr(one, f"{kind}_share") for one in outcomes]) for kind in ("drawn", "linear"))
    return test.pvalue, (
        f"seed {seed}, {len(outcomes)} campaigns: natural frequencies {hits} of {len(outcomes)} = "
        f"{100 * hits / len(outcomes):.1f} % ({100 * low:.1f} to {100 * high:.1f} %), binomial p = {test.pvalue:.3f}, "
        f"rms of z {np.sqrt(np.mean(z**2)):.2f}; lines in the drawn band {100 * drawn:.1f} %, in the linear one "
        f"{100 * linear:.1f} %; log-spectral distance {np.median([one.decibel for one in outcomes]):.2f} dB (median)"
    )


def main() -> None:
    """Measure and print; the exit code is 1 where the coverage is rejected."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--cases", type=int, default=100)
    options = parser.parse_args()
    begun = time.perf_counter()
    p_value, text = report(options.seed, [measure(options.seed, case) for case in range(options.cases)])
    sys.stdout.write(f"{text}; {time.perf_counter() - begun:.0f} s\n")
    sys.exit(int(p_value < REJECTED_AT))


if __name__ == "__main__":
    main()
