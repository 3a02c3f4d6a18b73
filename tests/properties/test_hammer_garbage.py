"""Arbitrary records: FRFs are estimated or refused without a crash, and all results are finite."""

import os
import warnings

import numpy as np
import pytest

from receptance.errors import ReceptanceWarning
from receptance.hammer import HammerRecords, estimate_frf, find_hits

SEED = int(os.environ.get("RECEPTANCE_TEST_SEED", "12"))


def wave(random, n):
    """Return silence, noise, drift, tones, spikes or pulses of any strength."""
    time = np.arange(n)
    noise = random.standard_normal(n)
    spike = np.zeros(n)
    spike[random.integers(0, n)] = random.normal() * 10.0 ** random.uniform(-28.0, 28.0)
    pulses = 1e-4 * noise
    for first in random.integers(0, n, random.integers(1, 6)):
        part = pulses[first : first + 8]
        part += np.hanning(10)[1 : 1 + part.size]
    return [
        np.zeros(n),
        np.full(n, random.normal()),
        noise,
        np.sin(time * random.uniform(1e-3, 3.0)),
        spike,
        np.round(noise),
        np.cumsum(noise),
        pulses,
        1e6 * pulses,
        -pulses,
    ][random.integers(10)]


def draw(random):
    """Return records and settings for the search and the estimate."""
    n = int(random.choice([16, 17, 31, 64, 100, 257, 1000, 4096]))
    count, channels = int(random.integers(1, 5)), int(random.integers(1, 3))
    shape = (count,) if random.random() < 0.5 else ()
    force = np.array([wave(random, n) for _ in range(count)]) if shape else wave(random, n)
    response = np.array([wave(random, n) for _ in range((count if shape else 1) * channels)])
    response = response.reshape(*shape, channels, n).swapaxes(-1, -2)
    rate = 10.0 ** random.uniform(0.0, 6.0)
    records = HammerRecords(
        force=force,
        response=response,
        sample_rate_hz=rate,
        quantity=str(random.choice(["acceleration", "velocity", "displacement"])),
        response_decay_rate=float(random.choice([0.0, 0.0, 5.0])),
        full_scale_force=float(random.choice([1.0, 1e3])),
    )
    long_s = n / rate
    search = {
        "duration_s": random.uniform(0.0, 1.2 * long_s),
        "pre_trigger_s": random.uniform(0.0, long_s),
        "trigger": 10.0 ** random.uniform(-4.0, 3.0),
        "one_per_record": bool(random.random() < 0.5),
    }
    options = {
        "force_window_s": random.uniform(0.0, long_s) if random.random() < 0.5 else None,
        "pooled_lines": int(random.choice([1, 3, 21])),
        "high_hz": random.uniform(0.1, 0.6) * rate,
    }
    some = [{name: value for name, value in each.items() if random.random() < 0.3} for each in (search, options)]
    some[0]["double_hit_loss_db"] = float(random.choice([0.0, 3.0, np.inf]))
    some[0]["deviating_hits"] = str(random.choice(["drop", "keep"]))
    some[1] |= {
        "estimator": str(random.choice(["H1", "H2", "Hv"])),
        "decay_rate": float(random.choice([0.0, 10.0, 1e3, 1e6])),
        "exponential_on": str(random.choice(["both", "both", "response"])),
    }
    return records, *some


@pytest.mark.parametrize("part", [0, *(pytest.param(part, marks=pytest.mark.slow) for part in (1, 2, 3))])
def test_arbitrary_records_are_refused_or_estimated(part):
    random = np.random.default_rng((SEED, part))
    estimated, refused = 0, []
    for _ in range(100):
        records, search, options = draw(random)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ReceptanceWarning)
            try:
                hits = find_hits(records, **search)
                assert [len(table.rows) for table in hits.tables()] == [len(hits.hits)]
                frf = estimate_frf(hits, **options)
            except ValueError as error:
                refused.append(str(error))
                continue
        estimated += 1
        assert np.isfinite(frf.values).all()
        assert frf.log_variance is None or np.all(frf.log_variance >= 0.0)
    assert estimated > 0
    # Words of our own, not NumPy's.
    assert [error for error in refused if not error.startswith(("find_hits: ", "estimate_frf: ", "FRF: "))] == []
