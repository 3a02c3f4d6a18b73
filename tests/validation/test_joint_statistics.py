"""Coverage of profile intervals and the best optimum from afar, on fewer cases than the commands beside this take."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from receptance.fit import profile_likelihoods, sample_posterior

sys.path.insert(0, str(Path(__file__).resolve().parent))

import coherence_coverage
import joint_coverage
import joint_global_optimum

from receptance import CARBIDE, STEEL, Assembly, Observation, Part, PointJoint, Segment, Unknown
from receptance.fit import Identification, Tolerance, identify
from simulated_campaigns import confidence

SEED = 20
LINES = np.linspace(300.0, 6000.0, 40)
BOUNDS = (3e4, 3e5)


def drawn_from_the_prior(
    rng: np.random.Generator, stated: float = 1.0, *, blank_drawn: bool = True
) -> tuple[float, Identification]:
    """Return a joint drawn from its bounds, and the fit of its measured FRF, with a blank drawn as well.

    `stated` is the stated standard deviation of the noise over the true one. Without `blank_drawn` the blank is exact.
    """
    k_theta, error = 10.0 ** rng.uniform(*np.log10(BOUNDS)), rng.standard_normal() * blank_drawn

    def assembled(k_theta: float, diameter: float) -> Assembly:
        tool = Part([Segment(length=0.0623, outer_diameter=diameter, material=CARBIDE)], name="tool")
        holder = Part([Segment(length=0.129, outer_diameter=0.045, material=STEEL)], name="holder")
        return Assembly([tool, PointJoint(k_y=6.3e8, k_theta=k_theta, c_theta=3.0, name="joint"), holder])

    true = assembled(k_theta, 0.0127 * np.exp(0.002 * error))
    noise = 0.05 * rng.standard_normal((2, LINES.size))
    frf = Observation(
        assembly=assembled(1e5, 0.0127),
        frequency_hz=LINES,
        receptance=true.receptance(LINES) * np.exp(noise[0] + 1j * noise[1]),
        standard_deviation=0.05 * stated,
    )
    blank = Tolerance(name="blank", moves={"tool.segment[0].outer_diameter": 0.002}, relative=True)
    unknown = Unknown(address="joint.k_theta", lower=BOUNDS[0], upper=BOUNDS[1], start=k_theta)
    return k_theta, identify(frf, unknown, tolerances=blank if blank_drawn else (), starts=1, threads=1)


@pytest.mark.parametrize(
    ("stated", "blank_drawn", "calibrated"),
    [(1.0, True, True), (1.0, False, True), (0.25, False, False)],
)
def test_profile_ranks_are_uniform_only_for_calibrated_profiles(stated, blank_drawn, calibrated):
    rng = np.random.default_rng(SEED)
    ranks = []
    for _ in range(30):
        truth, found = drawn_from_the_prior(rng, stated, blank_drawn=blank_drawn)
        ranks.append(confidence(profile_likelihoods(found, "joint.k_theta")["joint.k_theta"], truth))
    assert (stats.kstest(ranks, "uniform").pvalue > 0.01) == calibrated, ranks


def test_understated_noise_does_not_reduce_the_coverage_of_a_fit_with_tolerances():
    """It counts as an error of the model, so that intervals are wider than those of the true noise."""
    rng = np.random.default_rng(SEED)
    inside = []
    for _ in range(30):
        truth, fit = drawn_from_the_prior(rng, 0.25)
        rank = confidence(profile_likelihoods(fit, "joint.k_theta")["joint.k_theta"], truth)
        inside.append(abs(rank - 0.5) < 0.475)
    assert np.mean(inside) > 0.9


@pytest.mark.slow
def test_simulation_based_calibration_of_posterior_draws(summarise):
    """Truth from the prior, data from the truth, draws from the posterior: ranks are uniform (Talts et al. 2018)."""
    rng = np.random.default_rng(SEED)
    ranks = []
    for case in range(24):
        truth, found = drawn_from_the_prior(rng)
        draws = sample_posterior(found, steps=300, seed=case)
        ranks.append(float(np.mean(draws.of("joint.k_theta") < truth)))
    p_value = stats.kstest(ranks, "uniform").pvalue
    counts = np.histogram(ranks, bins=6, range=(0.0, 1.0))[0]
    text = f"seed {SEED}, 24 draws of joint and blank from their priors: ranks in six bins {counts}, p = {p_value:.3f}"
    summarise("posterior calibration", text, ranks)
    assert p_value > 0.01, text
    assert stats.chisquare(counts).pvalue > 0.01, text


@pytest.mark.slow
def test_intervals_contain_the_truth(summarise):
    outcomes = [one for case in range(20) for one in joint_coverage.measure(SEED, case)]
    rows, text = joint_coverage.report(outcomes)
    summarise("joint coverage", f"seed {SEED}, 20 campaigns\n{text}", rows)
    for row in rows:
        assert row["p_value"] > joint_coverage.REJECTED_AT, text
        assert row["rank_p_value"] > joint_coverage.REJECTED_AT, text


@pytest.mark.slow
def test_intervals_contain_the_truth_with_estimated_noise(summarise):
    """Data of finite elements; variances from coherence, pooled over neighbouring lines or as they are."""
    both = np.array([coherence_coverage.scores(SEED, case) for case in range(40)]).swapaxes(0, 1)
    for name, found in zip(coherence_coverage.VARIANCES, both, strict=True):
        rows, text = coherence_coverage.report(found)
        summarise(f"coherence coverage, {name}", f"seed {SEED}, 40 cases\n{text}", rows)
        for row in rows:
            assert row["p_value"] > coherence_coverage.REJECTED_AT, f"{name}: {text}"
        assert np.all(np.abs(found.mean(axis=0)) < 3.0 / np.sqrt(len(found))), f"{name}: {text}"


@pytest.mark.slow
def test_the_best_optimum_is_reached_from_three_decades_off(summarise):
    outcomes = [joint_global_optimum.measure(SEED, case) for case in range(6)]
    text = joint_global_optimum.report(SEED, outcomes)
    summarise("joint optimum", text, [one.reached(one.staged) for one in outcomes])
    # One of six may end in a flat valley a hundredth of log-likelihood away; the command measures the share.
    assert np.sum([one.reached(one.staged) for one in outcomes]) >= 5, text
