"""Coverage of the intervals of held-out improvement: `python tests/validation/improvement_interval.py --seed S`.

Improvements of modes are drawn from a normal distribution, with a common part of the modes of each fold, and given to
`gain_of`. Counted is how often the 95 % interval contains the mean of the distribution. The jackknife over folds alone
is in the table for comparison.
"""

from __future__ import annotations

import argparse

import numpy as np
from scipy import stats

from receptance.diagnosis.held_out import Fold, Prediction, gain_of

MEAN = 1.0


def coverage(folds: int, modes: int, correlation: float, draws: int, seed: int) -> tuple[float, float, float, float]:
    """Return coverage and median width of the intervals, and those of the jackknife over folds."""
    rng = np.random.default_rng(seed)
    after = Prediction({"own": np.tile([10.0, 1.0], (modes, 1))})
    found = np.empty((draws, 2, 2))
    for draw in range(draws):
        common = rng.normal(size=(folds, 1)) * np.sqrt(correlation)
        own = MEAN + common + rng.normal(size=(folds, modes)) * np.sqrt(1.0 - correlation)
        before = [Prediction({"own": np.column_stack([10.0 + one, np.ones(modes)])}) for one in own]
        gain = gain_of("own", [Fold(f"{i}", "named", (), one, after) for i, one in enumerate(before)])
        assert gain is not None
        means = own.mean(axis=1)
        half = stats.t.ppf(0.975, folds - 1) * means.std(ddof=1) / np.sqrt(folds)
        found[draw] = gain.interval, (means.mean() - half, means.mean() + half)
    covered = ((found[:, :, 0] < MEAN) & (found[:, :, 1] > MEAN)).mean(axis=0)
    width = np.median(found[:, :, 1] - found[:, :, 0], axis=0)
    return float(covered[0]), float(width[0]), float(covered[1]), float(width[1])


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--draws", type=int, default=10000)
    parser.add_argument("--seed", type=int, default=20261127)
    given = parser.parse_args()
    print(f"seed {given.seed}, {given.draws} draws; width in standard deviations of the improvement of one mode")
    print("folds  modes  correlation  coverage  width   over folds alone: coverage  width")
    for folds, modes in ((3, 3), (4, 3), (4, 5)):
        for correlation in (0.0, 0.2, 0.5, 0.8):
            numbers = coverage(folds, modes, correlation, given.draws, given.seed)
            print(
                "{:5d}  {:5d}  {:11.1f}  {:8.3f}  {:5.2f}  {:26.3f}  {:5.2f}".format(
                    folds, modes, correlation, *numbers
                )
            )


if __name__ == "__main__":
    main()
