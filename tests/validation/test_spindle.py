"""A spindle from blanks: what comes back without noise, and whether the stated variance covers with it."""

from __future__ import annotations

import os
from collections.abc import Callable

import numpy as np
from scipy.stats import binomtest

from machine_spindle import LINES, at_two_places, make_blank, make_spindle, seen_at_the_plane
from receptance.spindle import identify_spindle

SEED = int(os.environ.get("RECEPTANCE_TEST_SEED", "21"))
EVERY_SECOND = LINES[::2]
DRAWS = 4
TERMS = {"y/F": (0, 0), "theta/M": (1, 1), "y/M": (0, 1)}


def test_without_noise_the_spindle_comes_back(summarise: Callable[[str, str, object], None]) -> None:
    """To 1e-6 where the condition number allows, with the rest masked: of 12 digits that the responses have, say."""
    true = seen_at_the_plane(make_spindle(), LINES)
    size = np.sqrt(np.abs(true[:, [0, 1], [0, 1]]))
    size = size[:, :, None] * size[:, None, :]
    worst = 0.0
    for length, near in ((0.1, 0.07), (0.2, 0.15), (0.35, 0.3)):
        found = identify_spindle(at_two_places(make_blank(length), near, sd=1e-12), limit=1e-6)
        off = (np.abs(found.matrix - true) / size)[found.usable]
        worst = max(worst, float(off.max()))
        assert found.usable.mean() >= 0.9
        assert off.max() < 1e-6
    # One that has next to no digits to spare is masked where they do not suffice, and right elsewhere.
    poor = identify_spindle(at_two_places(make_blank(0.35), 0.3, sd=1e-8), limit=1e-6)
    assert 0.0 < poor.usable.mean() < 0.9
    text = f"largest error of a usable line {worst:.1e}; with 8 digits {100.0 * poor.usable.mean():.0f} % usable"
    summarise("a spindle from blanks, without noise", text, {"worst": worst, "usable": float(poor.usable.mean())})


def test_the_variance_covers(summarise: Callable[[str, str, object], None]) -> None:
    """1 % noise: 95 % intervals of each term's real and imaginary part, all lines of some draws."""
    true = seen_at_the_plane(make_spindle(), EVERY_SECOND)
    rng = np.random.default_rng(SEED)
    found = [
        identify_spindle(at_two_places(make_blank(), 0.07, sd=0.01, rng=rng, lines=EVERY_SECOND)) for _ in range(DRAWS)
    ]
    count = sum(int(one.usable.sum()) for one in found)
    said, shares = [], {}
    for name, (i, j) in TERMS.items():
        for part in ("real", "imag"):
            hits = 0
            for one in found:
                off = getattr((one.matrix - true)[:, i, j], part) / one.standard_deviation[:, i, j]
                hits += int(np.sum(np.abs(off[one.usable]) < 1.959964))
            test = binomtest(hits, count, 0.95)
            ends = test.proportion_ci(0.99, "exact")
            said.append(f"{name} {part}: {hits / count:.4f} ({ends.low:.4f} to {ends.high:.4f})")
            shares[f"{name} {part}"] = hits / count
            assert test.pvalue > 0.01, said[-1]
    usable = count / (DRAWS * EVERY_SECOND.size)
    text = f"seed {SEED}, {count} lines, {100.0 * usable:.1f} % usable: " + "; ".join(said)
    summarise("coverage of a spindle's 95 % intervals under 1 % noise", text, shares)
    assert usable > 0.9
