"""Variance from coherence: the formula, its quantiles over runs, pooling of neighbours."""

import os

import numpy as np
import pytest
from scipy import stats

from receptance import FRF
from receptance.frf.variance import pool_variance, variance_from_coherence

SEED = int(os.environ.get("RECEPTANCE_TEST_SEED", "7"))
LINES = np.linspace(100.0, 1000.0, 600)


def modes(f):
    w = 2 * np.pi * f
    return sum(
        1e6 / ((2 * np.pi * r) ** 2 - w**2 + 2j * z * (2 * np.pi * r) * w)
        for r, z in ((200.0, 0.01), (430.0, 0.005), (800.0, 0.01))
    )


TRUE = modes(LINES)


def measure(rng, averages, power):
    """Return H1 and coherence of hits of different strength with noise of some power on the response."""
    force = rng.uniform(0.5, 2.0, size=(averages, 1)) * np.exp(2j * np.pi * rng.random((averages, 1)))
    noise = rng.normal(size=(averages, LINES.size)) + 1j * rng.normal(size=(averages, LINES.size))
    response = TRUE * force + np.sqrt(power / 2.0) * noise
    cross, auto = np.sum(force.conj() * response, axis=0), np.sum(np.abs(force) ** 2)
    h1 = cross / auto
    return h1, np.abs(cross) ** 2 / (auto * np.sum(np.abs(response) ** 2, axis=0)), auto


def test_formula_and_limits():
    variance, freedom = variance_from_coherence([0.0, 0.5, 0.9, 1.0], 10)
    np.testing.assert_allclose(variance, [np.inf, 1.0 / 18.0, 0.1 / 16.2, 0.05 / (18.0 * 0.95)])
    assert freedom == 18.0
    assert variance_from_coherence(np.full((3, 2, 1), 0.5), 2)[0].shape == (3, 2, 1)


@pytest.mark.parametrize(
    ("coherence", "least"),
    [
        ([1.0, 0.99, 1.0, 0.87], 0.005),
        (np.float32([1.0, 0.99, 1.0, 0.87]).astype(float), 0.005),
        ([1.0, 0.85], 0.005),
        ([1.0, 0.991, 0.0123], 0.0005),  # three digits
        ([1.0, 0.99998, 0.5], 5e-6),
        ([1.0, 254.0 / 255.0, 3.0 / 255.0], 0.5 / 255.0),
        ([1.0, 0.98765432123456, 0.7], 0.5 * (1.0 - 0.98765432123456)),
        ([1.0, 1.0], 0.0),
    ],
    ids=["two decimals", "single precision", "without 0.99", "three digits", "five", "8 bits", "all digits", "all one"],
)
def test_a_coherence_of_one_is_no_better_than_its_last_digit(coherence, least):
    variance, _ = variance_from_coherence(coherence, 10)
    assert variance[0] == pytest.approx(least / (18.0 * (1.0 - least)), rel=1e-9)
    alone, _ = variance_from_coherence(coherence[1:], 10)
    np.testing.assert_array_equal(variance[1:][np.less(coherence[1:], 1.0)], alone[np.less(coherence[1:], 1.0)])


@pytest.mark.parametrize(
    ("coherence", "averages", "error", "words"),
    [
        (0.9, 1, ValueError, "averages is 1, expected at least 2: the coherence of one record is always 1"),
        (0.9, None, TypeError, "averages is None"),
        (0.9, 2.0, TypeError, "averages is 2.0"),
        ([0.9, 1.1], 5, ValueError, "coherence is 1.1, expected from 0 to 1"),
        ([np.nan], 5, ValueError, "coherence is nan"),
        ("high", 5, TypeError, "coherence has dtype"),
    ],
)
def test_bad_input(coherence, averages, error, words):
    with pytest.raises(error, match=words):
        variance_from_coherence(coherence, averages)


@pytest.mark.slow
@pytest.mark.parametrize(("averages", "runs"), [(3, 250), (10, 250)])
@pytest.mark.parametrize("kind", ["relative", "white", "both"])
def test_intervals_have_their_nominal_coverage(averages, runs, kind):
    """Of each run one line well apart from the others counts, so that an exact binomial test applies."""
    print(f"seed {SEED}")
    rng = np.random.default_rng([SEED, averages, len(kind)])
    white, relative = 0.02**2 * np.abs(TRUE).max() ** 2 * 1e-3, 0.02**2 * np.abs(TRUE) ** 2
    power = {"white": white + 0.0 * relative, "relative": relative, "both": white + relative}[kind]
    inside = {True: 0, False: 0}
    for _ in range(runs):
        h1, coherence, _ = measure(rng, averages, power)
        frf = FRF(frequency_hz=LINES, values=h1, coherence=coherence, averages=averages)
        line = rng.integers(LINES.size)
        error = np.log(h1[line] / TRUE[line])
        part = error.real if rng.random() < 0.5 else error.imag
        for pool in (True, False):
            half = frf.with_coherence_variance(pool=pool).log_interval()[line, 0, 0]
            inside[pool] += bool(abs(part) <= half)
    for pool, count in inside.items():
        chance = stats.binomtest(count, runs, 0.95).pvalue
        assert chance > 0.001, (pool, count, runs)


@pytest.mark.parametrize("kind", ["white", "relative", "both"])
def test_pooling_is_unbiased_and_reduces_the_scatter(kind):
    rng = np.random.default_rng(SEED)
    print(f"seed {SEED}")
    white, relative = 0.02**2 * np.abs(TRUE).max() ** 2 * 1e-3, 0.02**2 * np.abs(TRUE) ** 2
    power = {"white": white + 0.0 * relative, "relative": relative, "both": white + relative}[kind]
    ratios = {"alone": [], "pooled": []}
    for _ in range(80):
        h1, coherence, auto = measure(rng, 5, power)
        alone, freedom = variance_from_coherence(coherence, 5)
        pooled, more = pool_variance(h1, alone, freedom)
        expected = power / (2.0 * auto) / np.abs(h1) ** 2
        ratios["alone"].append(alone / expected)
        ratios["pooled"].append(pooled / expected)
    spread = {name: np.std(values) for name, values in ratios.items()}
    assert np.mean(ratios["pooled"]) == pytest.approx(1.0, abs=0.05)
    assert spread["pooled"] < 0.6 * spread["alone"]
    assert np.median(more) > 60.0
    assert np.all(more >= freedom)
    # The estimate has the stated degrees of freedom f: variance 2 / f of a scaled chi-square.
    assert np.var(ratios["pooled"], axis=0).mean() == pytest.approx(np.mean(2.0 / more), rel=0.5)


def test_hum_affects_one_line():
    rng = np.random.default_rng(SEED)
    power = np.full(LINES.size, 1e-4 * np.median(np.abs(TRUE)) ** 2)
    power[300] *= 1e4
    h1, coherence, _ = measure(rng, 10, power)
    alone, freedom = variance_from_coherence(coherence, 10)
    pooled, more = pool_variance(h1, alone, freedom)
    assert pooled[300] == pytest.approx(alone[300], rel=1e-12)
    assert more[300] == freedom


def test_correlated_lines_reduce_the_degrees_of_freedom():
    rng = np.random.default_rng(SEED)
    scatter = 1e-4 * rng.chisquare(8.0, 500) / 8.0
    values = np.ones(500, dtype=complex)
    _, independent = pool_variance(values, scatter, 8.0, half_width=10)
    _, correlated = pool_variance(values, scatter, 8.0, half_width=10, correlated_lines=4.0)
    assert np.median(independent / correlated) == pytest.approx(4.0, rel=1e-9)


def test_lines_that_cannot_be_pooled_are_unchanged():
    values = np.ones(50, dtype=complex)
    values[3] = 0.0
    variance = np.full(50, 1e-4)
    variance[7] = np.inf
    pooled, freedom = pool_variance(values, variance, 18.0)
    assert pooled[7] == np.inf
    assert (pooled[3], freedom[3], freedom[7]) == (1e-4, 18.0, 18.0)
    np.testing.assert_allclose(np.delete(pooled, 7), 1e-4)
    exact, _ = pool_variance(values, np.zeros(50), 18.0)
    np.testing.assert_array_equal(exact, 0.0)
    for n in (1, 2):
        few, freedom = pool_variance(values[:n], variance[:n], 18.0)
        np.testing.assert_array_equal(few, variance[:n])
    narrow, _ = pool_variance(values, variance, 18.0, half_width=0)
    np.testing.assert_array_equal(narrow, variance)
    with pytest.raises(ValueError, match="half_width is -1"):
        pool_variance(values, variance, 18.0, half_width=-1)


def test_with_coherence_variance():
    frf = FRF(frequency_hz=LINES, values=TRUE, coherence=0.9, averages=5, form="mobility")
    known = frf.with_coherence_variance(pool=False)
    np.testing.assert_allclose(known.log_variance, 0.1 / (8.0 * 0.9))
    np.testing.assert_array_equal(known.degrees_of_freedom, 8.0)
    assert frf.with_coherence_variance(averages=9).averages == 9
    np.testing.assert_allclose(frf.with_coherence_variance().log_variance, known.log_variance, rtol=1e-9)
    with pytest.raises(ValueError, match="has no coherence"):
        frf.with_(coherence=None).with_coherence_variance()
    with pytest.raises(ValueError, match="give averages"):
        frf.with_(averages=None).with_coherence_variance()
