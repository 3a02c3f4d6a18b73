"""Do intervals hold where noise is estimated? `python tests/validation/coherence_coverage.py --seed S --cases N`.

Every case draws a joint. Finite elements (not the model that is fitted) give the accelerance at the tip; hits of
different strength with noise on the response give H1 and coherence. The variance is that of the coherence: pooled over
neighbouring lines, as campaigns do it, or of each line alone. Counted is how often the 95 % interval of each number of
the joint holds the truth, by an exact binomial test at the 1 % level, and how the standard scores scatter.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import hammer_joint
from receptance import FRF, Assembly, Coordinate, Material, Observation, Part, PointJoint, Segment, Unknown, identify
from receptance.frf.variance import pool_variance, variance_from_coherence

LEVEL = 0.95
REJECTED_AT = 0.01
LINES = np.linspace(300.0, 7000.0, 600)
NAMES = ("k_y", "k_theta", "c_y", "c_theta")
VARIANCES = ("pooled", "alone")


def model(joint: dict[str, float]) -> Assembly:
    """Return the fitted assembly, of the same parts as the finite elements."""
    carbide, steel = (
        Material(youngs_modulus=e, density=rho, poisson_ratio=nu)
        for e, rho, nu in (hammer_joint.CARBIDE, hammer_joint.STEEL)
    )
    length, diameter = hammer_joint.TOOL
    tool = Part([Segment(length=length, outer_diameter=diameter, material=carbide)], name="tool")
    sections = [Segment(length=x, outer_diameter=d, material=steel) for x, d in hammer_joint.SECTIONS]
    return Assembly([tool, PointJoint(**joint, name="joint"), Part(sections, name="holder")])


def draw_joint(rng: np.random.Generator) -> dict[str, float]:
    """Return a joint with a loss of half a per cent to five at 2 kHz."""
    k_y, k_theta = 10.0 ** rng.uniform(7.5, 8.8), 10.0 ** rng.uniform(4.3, 5.2)
    losses = 10.0 ** rng.uniform(-2.3, -1.3, 2) / (4000.0 * np.pi)
    return {"k_y": k_y, "k_theta": k_theta, "c_y": k_y * losses[0], "c_theta": k_theta * losses[1]}


def measure_frfs(rng: np.random.Generator, joint: dict[str, float], averages: int) -> tuple[FRF, FRF]:
    """Return the accelerance of an analyser, with the variance from coherence and averages, pooled and alone."""
    exact = hammer_joint.Structure(**joint).receptance(LINES) * (2j * np.pi * LINES) ** 2
    level = 10.0 ** (rng.uniform(-40.0, -20.0) / 20.0) * float(np.median(np.abs(exact)))
    force = rng.uniform(0.4, 1.0, averages)[:, None] * np.exp(-((LINES / 9000.0) ** 2))
    noise = rng.standard_normal((2, averages, LINES.size))
    motion = force * exact + level * (noise[0] + 1j * noise[1])
    power = np.sum(force**2, axis=0)
    h1 = np.sum(motion * force, axis=0) / power
    coherence = np.minimum(np.abs(h1) ** 2 * power / np.sum(np.abs(motion) ** 2, axis=0), 1.0)
    variance, freedom = variance_from_coherence(coherence, averages)
    pooled, alone = (
        FRF(
            frequency_hz=LINES,
            values=h1,
            form="accelerance",
            responses=Coordinate(),
            excitations=Coordinate(),
            log_variance=own,
            degrees_of_freedom=known,
        )
        for own, known in (pool_variance(h1, variance, freedom), (variance, freedom))
    )
    return pooled, alone


def scores(seed: int, case: int, averages: int = 10) -> NDArray[np.float64]:
    """Return the errors of the fitted logarithms over their standard errors, by `VARIANCES` and `NAMES`."""
    rng = np.random.default_rng([seed, case])
    joint = draw_joint(rng)
    assembly = model(joint)
    unknowns = [
        Unknown(address=f"joint.{name}", lower=1e-2 * joint[name], upper=1e2 * joint[name], start=joint[name])
        for name in NAMES
    ]
    own = []
    for frf in measure_frfs(rng, joint, averages):
        found = identify(Observation.from_frf(assembly, frf), unknowns, starts=1, threads=1)
        errors = [np.log10(found.values[f"joint.{name}"] / joint[name]) for name in NAMES]
        own.append(np.asarray(errors) / np.sqrt(np.diag(found.covariance)))
    return np.array(own)


def report(found: NDArray[np.float64]) -> tuple[list[dict[str, Any]], str]:
    """Return coverage and scatter of scores `(n_cases, 4)` as plain values and as text."""
    rows, lines = [], []
    inside = np.abs(found) <= stats.norm.ppf(0.5 + 0.5 * LEVEL)
    for name, held, own in zip(NAMES, inside.T, found.T, strict=True):
        test = stats.binomtest(int(held.sum()), held.size, LEVEL)
        low, high = test.proportion_ci(0.95)
        rows.append(
            {
                "parameter": name,
                "cases": held.size,
                "covered": int(held.sum()),
                "p_value": test.pvalue,
                "mean": own.mean(),
                "spread": own.std(),
            }
        )
        lines.append(
            f"{name:8s} {held.sum()} of {held.size} = {100 * held.mean():.1f} % ({100 * low:.1f} to {100 * high:.1f} "
            f"%), binomial p = {test.pvalue:.3f}; scores: mean {own.mean():+.2f}, spread {own.std():.3f}"
        )
    return rows, "\n".join(lines)


def main() -> None:
    """Measure, print, write JSON if requested; the exit code is 1 where a coverage is rejected."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--cases", type=int, default=800)
    parser.add_argument("--averages", type=int, default=10)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    begun = time.perf_counter()
    found = np.array([scores(options.seed, case, options.averages) for case in range(options.cases)])
    seconds = time.perf_counter() - begun
    sys.stdout.write(f"seed {options.seed}, {options.cases} cases, {seconds:.0f} s\n")
    rows = {}
    for name, own in zip(VARIANCES, found.swapaxes(0, 1), strict=True):
        rows[name], text = report(own)
        sys.stdout.write(f"{name}\n{text}\n")
    if options.json:
        options.json.write_text(json.dumps({"seed": options.seed, "rows": rows}), encoding="utf-8")
    sys.exit(int(any(row["p_value"] < REJECTED_AT for own in rows.values() for row in own)))


if __name__ == "__main__":
    main()
