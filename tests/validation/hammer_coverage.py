"""Does the stated variance of an FRF cover the truth? `python tests/validation/hammer_coverage.py --seed S --runs 200`.

Every run draws a structure, hits and noise anew, estimates the FRF, takes one usable line at random, and counts whether
the 95 % intervals of the real and of the imaginary part of the logarithm contain the truth there, and whether the disc
of both does. Runs are independent, so the number of hits is binomial.
"""

from __future__ import annotations

import argparse
import json
import sys
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from scipy import stats

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import hammer
from receptance.errors import ReceptanceWarning
from receptance.hammer import HammerRecords, estimate_frf

LEVEL = 0.95
REJECTED_AT = 0.01
PARTS = ("magnitude", "phase", "both")


@dataclass(frozen=True)
class Case:
    """Drawn structure and settings of the estimate."""

    name: str
    estimator: str = "H1"
    hits: int = 10
    force_noise_db: tuple[float, float] = (-70.0, -40.0)
    response_noise_db: tuple[float, float] = (-70.0, -40.0)
    options: dict[str, Any] = field(default_factory=dict)
    careless: float | None = None
    """Factor on the standard deviation of someone who divides by n, to show what that does."""


CASES = (
    Case("H1, 10 hits, force noise -70 to -40 dB"),
    Case("H1, 3 hits, force noise -70 to -40 dB", hits=3),
    Case("Hv, 10 hits, force noise -40 to -25 dB", "Hv", force_noise_db=(-40.0, -25.0)),
    Case("H1, 10 hits, each line by itself", options={"pooled_lines": 1}, careless=0.9**0.5),
)


@dataclass(frozen=True)
class Outcome:
    """Result of one run on its line: the error of the logarithm over its stated standard deviation."""

    deviation: complex
    freedom: float
    line_hz: float

    def covered(self, factor: float = 1.0, normal: bool = False) -> dict[str, bool]:
        """Return which 95 % regions hold the truth, with standard deviations multiplied by a factor."""
        t = stats.norm.ppf(0.5 + LEVEL / 2.0) if normal else stats.t.ppf(0.5 + LEVEL / 2.0, self.freedom)
        disc = stats.chi2.ppf(LEVEL, 2.0) if normal else 2.0 * stats.f.ppf(LEVEL, 2.0, self.freedom)
        z = self.deviation / factor
        return {"magnitude": abs(z.real) <= t, "phase": abs(z.imag) <= t, "both": abs(z) ** 2 <= disc}


def draw_structure(generator: np.random.Generator) -> hammer.Structure:
    """Return a free body with two to five modes."""
    count = int(generator.integers(2, 6))
    frequency = np.sort(generator.uniform(250.0, 6000.0, count))
    damping = np.exp(generator.uniform(np.log(0.002), np.log(0.03), count))
    residue = generator.uniform(0.3, 3.0, count) * generator.choice([1.0, 1.0, -1.0], count)
    return hammer.Structure((0.0, *frequency), (0.0, *damping), (generator.uniform(0.2, 2.0), *residue), 25600.0)


def run_once(case: Case, seed: tuple[int, ...]) -> Outcome | None:
    """Return the outcome of one run, None where no line is usable."""
    generator = np.random.default_rng(seed)
    structure = draw_structure(generator)
    decay_rate = float(generator.choice([0.0, generator.uniform(5.0, 60.0)]))
    records = hammer.strike(
        structure,
        generator,
        hits=case.hits,
        duration_s=float(generator.uniform(0.25, 0.8)),
        contact_s=float(generator.uniform(2e-4, 6e-4)),
        force_noise_db=float(generator.uniform(*case.force_noise_db)),
        response_noise_db=float(generator.uniform(*case.response_noise_db)),
        shape=str(generator.choice(["half sine", "smooth"])),
        colour=float(generator.uniform(0.0, 0.6)),
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ReceptanceWarning)
        frf = estimate_frf(
            HammerRecords(
                force=records.force,
                response=records.response,
                sample_rate_hz=structure.sample_rate_hz,
                quantity=structure.quantity,
            ),
            estimator=case.estimator,
            decay_rate=decay_rate,
            **case.options,
        )
    usable = np.flatnonzero(frf.usable)
    if not usable.size:
        return None
    line = int(generator.choice(usable))
    error = np.log(frf.values[line, 0, 0] / structure.frf(frf.frequency_hz[[line]], decay_rate)[0])
    deviation = error / np.sqrt(frf.log_variance[line, 0, 0])
    return Outcome(complex(deviation), float(frf.degrees_of_freedom[line, 0, 0]), float(frf.frequency_hz[line]))


@dataclass
class Share:
    """How many of the intervals held the truth."""

    covered: int
    runs: int

    @property
    def interval(self) -> tuple[float, float]:
        """The exact 95 % interval of the share."""
        found = stats.binomtest(self.covered, self.runs, LEVEL).proportion_ci(0.95, "exact")
        return float(found.low), float(found.high)

    @property
    def p_value(self) -> float:
        """Of the exact two-sided binomial test of 95 %."""
        return float(stats.binomtest(self.covered, self.runs, LEVEL).pvalue)


@dataclass
class Report:
    """Coverage in one case."""

    case: Case
    seed: int
    outcomes: list[Outcome]
    without_line: int

    def shares(self, factor: float = 1.0, normal: bool = False) -> dict[str, Share]:
        """Return the shares of covered truths; arguments as in `Outcome.covered`."""
        found = [outcome.covered(factor, normal) for outcome in self.outcomes]
        return {part: Share(sum(one[part] for one in found), len(found)) for part in PARTS}

    @property
    def rejected(self) -> bool:
        """Whether the binomial test rejects 95 % for any part."""
        return any(share.p_value < REJECTED_AT for share in self.shares().values())

    def text(self) -> str:
        """Return the results as text."""
        lines = [f"{self.case.name}; seed {self.seed}, {self.without_line} runs had no usable line"]
        for part, share in self.shares().items():
            low, high = share.interval
            verdict = "rejected" if share.p_value < REJECTED_AT else "not rejected"
            lines.append(
                f"  {part:9s} {share.covered}/{share.runs} = {share.covered / share.runs:.3f}, "
                f"interval {low:.3f} to {high:.3f}; 95 % is {verdict} at the 1 % level (p = {share.p_value:.3f})"
            )
        if self.case.careless is not None:
            share = self.shares(self.case.careless, normal=True)["magnitude"]
            lines.append(
                f"  with n in place of n - 1 and normal quantiles: {share.covered}/{share.runs} = "
                f"{share.covered / share.runs:.3f} of the magnitudes"
            )
        z = np.array([outcome.deviation for outcome in self.outcomes])
        lines.append(
            f"  error over standard deviation: mean {z.real.mean():+.2f} and {z.imag.mean():+.2f}, "
            f"mean square {np.mean(z.real**2):.2f} and {np.mean(z.imag**2):.2f} (magnitude and phase)"
        )
        return "\n".join(lines)

    def as_json(self) -> dict[str, object]:
        """Return plain values."""
        shares = {
            part: {"covered": s.covered, "runs": s.runs, "interval": s.interval, "p": s.p_value}
            for part, s in self.shares().items()
        }
        return {"case": self.case.name, "seed": self.seed, "without_line": self.without_line, "shares": shares}


def outcomes(case: Case, seed: int, runs: int) -> Iterator[Outcome | None]:
    """Yield outcomes until `runs` of them had a usable line."""
    number, done = 0, 0
    while done < runs:
        found = run_once(case, (seed, CASES.index(case), number))
        number += 1
        done += found is not None
        if number > 20 * runs:
            raise RuntimeError(f"{case.name}: hardly any run has a usable line")
        yield found


def measure(case: Case, seed: int, runs: int) -> Report:
    """Return the coverage over some runs."""
    found = list(outcomes(case, seed, runs))
    good = [outcome for outcome in found if outcome is not None]
    return Report(case, seed, good, len(found) - len(good))


def main() -> None:
    """Measure, print, write JSON if requested; the exit code is 1 where 95 % is rejected."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--case", type=int, nargs="*", help="numbers of single cases, from 0")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    reports = []
    for number, case in enumerate(CASES):
        if options.case is None or number in options.case:
            reports.append(measure(case, options.seed, options.runs))
            sys.stdout.write(reports[-1].text() + "\n")
            sys.stdout.flush()
    if options.json:
        options.json.write_text(json.dumps([report.as_json() for report in reports], indent=2), encoding="utf-8")
    sys.exit(int(any(report.rejected for report in reports)))


if __name__ == "__main__":
    main()
