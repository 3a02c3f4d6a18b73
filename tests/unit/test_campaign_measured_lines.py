"""All lines of a measured FRF, and the reasons why some are not used."""

from __future__ import annotations

import numpy as np
import pytest

from receptance import FRF, Observation, campaign, examples
from receptance.campaign import MeasuredLines

NAME = "40 mm"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("sensor")
    examples.write("forgotten-sensor", made)
    return made


@pytest.fixture(scope="module")
def whole(folder):
    return campaign.load(folder, threads=1)


def with_keys(folder, tmp_path, keys):
    """Return the campaign whose first measurement has more keys."""
    for file in folder.iterdir():
        (tmp_path / file.name).write_bytes(file.read_bytes())
    file = tmp_path / "campaign.toml"
    line = 'file = "tool_40mm.csv"'
    file.write_text(file.read_text().replace(line, f"{line}\n{keys}"))
    return campaign.load(tmp_path, threads=1)


def test_all_lines_are_used_where_nothing_leaves_any_out(whole):
    lines, used = whole.measured_lines(NAME), whole.measurements[NAME]
    assert lines.unused == {}
    np.testing.assert_array_equal(lines.frequency_hz, used.frequency_hz)
    np.testing.assert_allclose(lines.receptance, used.receptance, rtol=1e-12)
    assert lines.coherence.shape == lines.frequency_hz.shape
    assert 0.0 <= lines.coherence.min() <= lines.coherence.max() <= 1.0


def test_lines_outside_of_bands_have_that_reason_and_their_values(folder, whole, tmp_path):
    inside = with_keys(folder, tmp_path, 'bands = [["500 Hz", "2 kHz"], ["3 kHz", "5 kHz"]]')
    lines = inside.measured_lines(NAME)
    ((reason, unused),) = lines.unused.items()
    assert reason == "outside the bands of the campaign"
    f = lines.frequency_hz
    np.testing.assert_array_equal(unused, ~(((f >= 500.0) & (f <= 2e3)) | ((f >= 3e3) & (f <= 5e3))))
    np.testing.assert_array_equal(f[~unused], inside.measurements[NAME].frequency_hz)
    np.testing.assert_allclose(lines.receptance, whole.measured_lines(NAME).receptance, rtol=1e-12)


def test_motions_of_a_record_are_integrated_on_all_lines(folder, whole, tmp_path):
    lines = with_keys(folder, tmp_path, 'bands = [["500 Hz", "2 kHz"]]\nintegrate = -1').measured_lines(NAME)
    factor = 2j * np.pi * lines.frequency_hz
    np.testing.assert_allclose(lines.receptance, whole.measured_lines(NAME).receptance * factor, rtol=1e-12)


def test_a_line_has_the_first_reason_that_holds(whole):
    used = whole.measurements[NAME]
    f, n = used.frequency_hz, used.frequency_hz.size
    usable, variance = np.ones(n, bool), np.full(n, 1e-4)
    usable[:100], variance[[50, 200]] = False, np.inf
    frf = FRF(
        frequency_hz=np.append(0.0, f), values=np.append(1.0, used.receptance), usable=np.append(True, usable),
        log_variance=np.append(1e-4, variance),
    )  # fmt: skip
    kept = usable & np.isfinite(variance) & (f <= 5e3)
    observation = Observation(assembly=used.assembly, frequency_hz=f[kept], receptance=used.receptance[kept])
    unused = MeasuredLines.of(frf, observation, [(f[0], 5e3)], 0).unused
    assert list(unused) == [
        "outside the usable band of the FRF",
        "outside the bands of the campaign",
        "infinite variance",
    ]
    assert [int(which.sum()) for which in unused.values()] == [100, int((f > 5e3).sum()), 1]
    np.testing.assert_array_equal(np.sum(list(unused.values()), axis=0), ~kept)
