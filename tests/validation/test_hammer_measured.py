"""A real hammer's force: one pulse of two samples, and a recorder's filter that rings before and after it."""

from pathlib import Path

import numpy as np
import pytest

from receptance.hammer import HammerRecords, find_hits
from receptance.hammer.spectra import make_windows
from receptance.io import read_time_series

FILE = Path(__file__).resolve().parents[3] / "shared" / "measured" / "uff_io" / "UFFFiles.jl" / "dataset58_time.unv"


@pytest.fixture
def hits():
    if not FILE.is_file():
        pytest.skip(f"measured data of others are absent: {FILE}")
    series = read_time_series(FILE)
    # The file has no response; noise stands in for it, which is not looked at here.
    response = np.random.default_rng(1).standard_normal(len(series.values))
    return find_hits(
        HammerRecords(
            force=series.values[:, 0],
            response=response,
            sample_rate_hz=series.sample_rate_hz,
            quantity="acceleration",
        )
    )


def test_ringing_of_one_hit_is_not_a_double_hit(hits):
    assert len(hits.hits) == len(hits.kept) == 1
    hit = hits.kept[0]
    assert hit.peak == pytest.approx(114.8, abs=0.3)  # as recorded; less an offset of -0.15 N
    assert hit.time_s == pytest.approx(123 / 2048.0, abs=1 / 2048.0)
    assert hit.release - hit.onset <= 3


def test_the_force_window_leaves_the_ringing_in(hits):
    """It is in the response as well: cut out of one channel alone it would be an error."""
    force = hits.blocks()[0][0]
    force = force - np.median(force)
    weights = make_windows(hits, 0.0, "auto", "both").force[0]
    cut = force * (1.0 - weights)
    assert np.abs(cut).max() < 0.01 * np.abs(force).max()
    spectra = [np.abs(np.fft.rfft(one)) for one in (cut - np.median(cut[weights == 0.0]) * (1.0 - weights), force)]
    band = slice(round(20.0 * 2.0), round(800.0 * 2.0))
    assert np.median(spectra[0][band] / spectra[1][band]) < 0.01
