"""Frequency and damping against amplitude, from decays with known laws."""

from __future__ import annotations

import os

import numpy as np
import pytest
from scipy.stats import binomtest

from receptance import ReceptanceWarning
from receptance.modal import ring_down

SEED = int(os.environ.get("RECEPTANCE_TEST_SEED", "5"))
RATE = 2048.0
REJECTED_AT = 1e-4
"""As in test_modal_global."""
BAND = {"low_hz": 60.0, "high_hz": 100.0}


def decay(frequency, damping, *, start=10.0, seconds=4.0):
    """A decay whose natural frequency (Hz) and damping ratio are functions of the amplitude (Runge-Kutta)."""
    count, step = int(seconds * RATE), 1.0 / RATE
    log, phase = np.empty(count), np.empty(count)
    log[0], phase[0] = np.log(start), 0.3

    def slopes(value):
        amplitude = np.exp(value)
        w, zeta = 2.0 * np.pi * frequency(amplitude), damping(amplitude)
        return -zeta * w, w * np.sqrt(1.0 - zeta**2)

    for k in range(count - 1):
        half = log[k] + 0.5 * step * slopes(log[k])[0]
        down, turn = slopes(half)
        log[k + 1], phase[k + 1] = log[k] + step * down, phase[k] + step * turn
    return np.exp(log) * np.cos(phase)


def softening(amplitude):
    return 80.0 - 0.3 * np.log10(10.0 * amplitude)


def slipping(amplitude):
    return 0.0015 + 0.0006 * np.log10(1.0 + 10.0 * amplitude)


def test_a_linear_mode_has_constant_parameters():
    found = ring_down(decay(lambda a: 80.0, lambda a: 0.003), RATE, **BAND)
    np.testing.assert_allclose(found.frequency_hz, 80.0, rtol=1e-7)
    np.testing.assert_allclose(found.damping_ratio, 0.003, rtol=1e-5)
    # The filter's gain at the mode and on a decay is taken off.
    expected = 10.0 * np.exp(-0.003 * 2.0 * np.pi * 80.0 * found.time_s)
    np.testing.assert_allclose(found.amplitude, expected, rtol=1e-5)
    assert found.notes == ()
    drops = -np.diff(np.log(found.amplitude))
    np.testing.assert_allclose(drops, drops.mean(), rtol=0.15)


def test_mode_off_the_middle_of_the_band():
    x = decay(lambda a: 88.0, lambda a: 0.005)
    found = ring_down(x, RATE, **BAND)
    np.testing.assert_allclose(found.frequency_hz, 88.0, rtol=1e-6)
    np.testing.assert_allclose(found.amplitude, 10.0 * np.exp(-0.005 * 2.0 * np.pi * 88.0 * found.time_s), rtol=1e-4)


def test_heavy_damping_gives_the_undamped_frequency():
    found = ring_down(decay(lambda a: 80.0, lambda a: 0.03, seconds=0.6), RATE, **BAND, blocks=1)
    assert found.frequency_hz[0] == pytest.approx(80.0, rel=1e-4)
    assert found.damping_ratio[0] == pytest.approx(0.03, rel=1e-2)


def test_law_of_a_joint():
    found = ring_down(decay(softening, slipping), RATE, **BAND)
    np.testing.assert_allclose(found.frequency_hz, softening(found.amplitude), atol=2e-4)
    np.testing.assert_allclose(found.damping_ratio, slipping(found.amplitude), rtol=5e-4)
    frequency, damping = found.at([5.0, 0.5])
    np.testing.assert_allclose(frequency, softening(np.array([5.0, 0.5])), atol=2e-3)
    np.testing.assert_allclose(damping, slipping(np.array([5.0, 0.5])), rtol=5e-3)
    with pytest.raises(ValueError, match="amplitude is 100, expected between"):
        found.at(100.0)


def test_intervals_cover():
    print(f"seed {SEED}")
    exact, covered = decay(softening, slipping), []
    for number in range(60):
        noise = 0.05 * np.random.default_rng([SEED, number]).normal(size=exact.size)
        found = ring_down(exact + noise, RATE, **BAND, blocks=8, start_s=0.0)
        for interval, true in (
            (found.frequency_interval_hz(), softening(found.amplitude)),
            (found.damping_interval(), slipping(found.amplitude)),
        ):
            covered.append((interval[:, 0] < true) & (true < interval[:, 1]))
    inside = int(np.sum(covered))
    print(f"{inside} of {np.size(covered)} intervals of 95 % hold the truth")
    assert binomtest(inside, int(np.size(covered)), 0.95).pvalue > REJECTED_AT


def test_the_part_before_the_hit_and_the_noisy_end_are_left_out():
    rng = np.random.default_rng(SEED)
    x = np.concatenate([np.zeros(300), decay(lambda a: 80.0, lambda a: 0.006)])
    found = ring_down(x + 0.5 + 0.02 * rng.normal(size=x.size), RATE, **BAND)
    assert "the record is used up to" in found.notes[0]
    assert found.time_s[0] > 300.0 / RATE
    assert found.amplitude[-1] > 0.02
    assert np.all(np.abs(found.damping_ratio - 0.006) < 5.0 * found.damping_standard_error)
    # At a tenth of the amplitude the scatter leaves a fifth of the damping; at the beginning almost none.
    assert np.all(found.damping_standard_error < 0.2 * 0.006)
    assert found.damping_standard_error[0] < 0.005 * 0.006
    early = ring_down(x, RATE, **BAND, start_s=0.5, end_s=1.5)
    assert early.time_s[0] > 0.5
    assert early.time_s[-1] < 1.5


def test_two_modes_in_the_band_are_detected():
    x = decay(lambda a: 78.0, lambda a: 0.002) + 0.1 * decay(lambda a: 86.0, lambda a: 0.002)
    with pytest.warns(ReceptanceWarning, match="is not that of a single decaying mode between 60 and 100 Hz"):
        ring_down(x, RATE, **BAND)
    beating = decay(lambda a: 78.0, lambda a: 0.002) + decay(lambda a: 86.0, lambda a: 0.002)
    with pytest.raises(ValueError, match="does not begin with the decay of a single mode"):
        ring_down(beating, RATE, **BAND)


def test_mistakes():
    x = decay(lambda a: 80.0, lambda a: 0.005, seconds=1.0)
    cases = (
        ({"samples": x + 1j}, TypeError, "dtype complex128"),
        ({"samples": np.stack([x, x])}, ValueError, "one channel of one record"),
        ({"samples": np.zeros(100)}, ValueError, "none other than zero"),
        ({"samples": np.where(np.arange(x.size) == 7, np.nan, x)}, ValueError, r"samples\[7\] is nan"),
        ({"sample_rate_hz": 0.0}, ValueError, "sample_rate_hz"),
        ({"low_hz": 100.0, "high_hz": 60.0}, ValueError, "low_hz below high_hz"),
        ({"low_hz": 1.0}, ValueError, "at least a quarter of high_hz"),
        ({"high_hz": 1100.0, "low_hz": 500.0}, ValueError, r"2048 samples per second, 819\.2 Hz"),
        ({"start_s": 0.9, "end_s": 0.5}, ValueError, "would reach from 0.899902 to 0.5 s"),
        ({"end_s": 0.2}, ValueError, "widen the band"),
        ({"blocks": 0}, ValueError, "blocks is 0"),
        ({"blocks": 30}, ValueError, "of 30 blocks of equal decrease"),
    )
    for change, kind, message in cases:
        arguments = {"samples": x, "sample_rate_hz": RATE, **BAND, **change}
        with pytest.raises(kind, match=message):
            ring_down(arguments.pop("samples"), arguments.pop("sample_rate_hz"), **arguments)
