"""Parts of an estimate, each against an independent reference."""

import numpy as np
import pytest

import hammer
from receptance.hammer import HammerRecords, find_hits
from receptance.hammer.spectra import correlated_lines, estimate_truncation, force_noise_power, make_windows

RATE = 25600.0
STRUCTURE = hammer.Structure((0.0, 900.0, 2500.0), (0.0, 0.008, 0.01), (2.0, 3.0, -1.0), RATE)


def hits_of(made, **options):
    return find_hits(
        HammerRecords(force=made.force, response=made.response, sample_rate_hz=RATE, quantity="acceleration", **options)
    )


@pytest.fixture(scope="module")
def made():
    return hammer.strike(
        STRUCTURE, np.random.default_rng(5), hits=6, duration_s=0.3, force_noise_db=-50.0, response_noise_db=-60.0
    )


def test_the_force_window_spans_the_contact(made):
    hits = hits_of(made)
    windows = make_windows(hits, 0.0, "auto", "both")
    for weights, true, hit in zip(windows.force, made.true_force, hits.kept, strict=True):
        assert np.all(weights[true != 0.0] == 1.0)
        assert np.sum(weights > 0.0) < 10 * (hit.release - hit.onset)
        assert weights.max() == 1.0
        assert np.all(np.diff(weights[: hit.onset]) >= 0.0)
    np.testing.assert_array_equal(windows.response, 1.0)
    for parts, true in zip(windows.silence, made.true_force, strict=True):
        assert not any(np.any(true[part]) for part in parts)


@pytest.mark.parametrize("decay_rate", [0.0, 15.0, 60.0])
def test_correlated_lines_agree_with_simulated_noise(decay_rate):
    """Mean of the squared correlation of |M|^2 over all pairs of lines, by simulation."""
    n = 512
    weights = np.exp(-decay_rate * np.arange(n) / 1000.0)[None]
    random = np.random.default_rng(2)
    noise = (random.standard_normal((4000, n)) + 1j * random.standard_normal((4000, n))) * weights
    power = np.abs(np.fft.fft(noise, axis=1)) ** 2
    total = power.sum(axis=1)
    found = np.var(total) / np.mean(total) ** 2 * n
    assert correlated_lines(weights) == pytest.approx(found, rel=0.1)


@pytest.mark.parametrize("colour", [0.0, 0.9])
@pytest.mark.parametrize("window", ["auto", None])
def test_force_noise_is_estimated_from_silence(colour, window):
    random = np.random.default_rng(8)
    made = hammer.strike(STRUCTURE, random, hits=8, duration_s=0.5, force_noise_db=-300.0)
    noise = hammer.coloured(random, made.force.shape, 0.5, colour)
    records = HammerRecords(
        force=made.true_force + noise, response=made.response, sample_rate_hz=RATE, quantity="acceleration"
    )
    hits = find_hits(records)
    windows = make_windows(hits, 0.0, window, "both")
    frequency = np.arange(50.0, 10e3, 50.0)
    found = force_noise_power(records.force, windows, frequency, RATE)
    many = hammer.coloured(random, (400, made.force.shape[1]), 0.5, colour) * windows.force[0]
    lines = np.round(frequency * 0.5).astype(int)
    true = np.mean(np.abs(np.fft.rfft(many, axis=1)[:, lines]) ** 2, axis=0) / windows.force_energy
    ratio = found / true
    assert np.mean(ratio) == pytest.approx(1.0, abs=0.12)
    assert 0.5 < ratio.min() < ratio.max() < 2.0


def test_truncation_error_of_a_decaying_response():
    """Known: a mode of decay a rings down to e^(-a T), and its FRF is wrong by that."""
    one = hammer.Structure((800.0,), (0.004,), (2.0,), RATE)
    made = hammer.strike(
        one, np.random.default_rng(1), hits=5, duration_s=0.2, force_noise_db=-300.0, response_noise_db=-70.0
    )
    force, response = made.true_force, made.response
    spectra = np.fft.rfft(force, axis=1)
    onset = int(np.median([np.flatnonzero(row)[0] for row in force]))
    share, error = estimate_truncation(response, spectra, onset + 12, onset)
    after = 0.2 - onset / RATE
    line = round(800.0 * 0.2)
    assert share[line] == pytest.approx(np.exp(-0.004 * 2 * np.pi * 800.0 * after), rel=0.3)
    clean = one.respond(force)
    true = np.abs(np.sum(np.conj(spectra) * np.fft.rfft(clean, axis=1), axis=0) / np.sum(np.abs(spectra) ** 2, axis=0)
                  - one.frf(np.fft.rfftfreq(force.shape[1], 1.0 / RATE)))  # fmt: skip
    for low, high in ((20.0, 400.0), (1200.0, 2000.0)):
        lines = slice(round(low * 0.2), round(high * 0.2))
        ratio = error[lines] / true[lines]
        assert 0.3 < np.median(ratio) < 3.0
