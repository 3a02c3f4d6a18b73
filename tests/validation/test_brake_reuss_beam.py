"""The Brake-Reuss beam, a lap joint with three bolts: github.com/mattiacenedese/BRBtesting, GPL-3.0.

Hammer record HammerImpact.mat: three accelerometers in m/s^2 at 12.8 kHz, without the force. The authors ask to cite
Mech. Syst. Signal Process. 166 (2022) 108401 and 108402. The file is read in place and is not part of the project.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from receptance.modal import RingDown, ring_down

RECORD = Path(__file__).resolve().parents[3] / "shared" / "measured" / "brb_jointed_beam" / "HammerImpact.mat"
RATE = 12800.0


@pytest.fixture(scope="module")
def channels() -> dict[str, np.ndarray]:
    if not RECORD.is_file():
        pytest.skip(f"the measured record is not at {RECORD}")
    from scipy.io import loadmat

    record = loadmat(RECORD, squeeze_me=True, struct_as_record=False)["HIdata"]
    assert np.allclose(np.diff(record.time), 1.0 / RATE)
    return {name: np.asarray(getattr(record, name)) for name in ("acc1", "acc2", "acc3")}


@pytest.fixture(scope="module")
def first_mode(channels) -> RingDown:
    return ring_down(channels["acc1"], RATE, low_hz=60.0, high_hz=100.0)


def test_frequency_and_damping_against_amplitude(first_mode):
    """80.36 to 80.58 Hz and 0.25 to 0.14 % as the amplitude falls from 28.6 to 1.1 m/s^2."""
    frequency, damping = first_mode.at([28.6, 1.1])
    print(first_mode, frequency, damping)
    np.testing.assert_allclose(frequency, [80.36, 80.58], atol=0.02)
    np.testing.assert_allclose(damping, [0.0025, 0.0014], rtol=0.15)


def test_the_joint_softens_and_loses_more_at_larger_amplitude(first_mode):
    """Monotonous over more than a decade, by far more than the standard errors."""
    chosen = first_mode.amplitude > 1.0
    assert np.all(np.diff(first_mode.frequency_hz[chosen]) > 0.0)
    assert np.all(np.diff(first_mode.damping_ratio[chosen]) < 0.0)
    steps = np.diff(first_mode.frequency_hz[chosen])
    assert np.all(steps > 3.0 * first_mode.frequency_standard_error_hz[chosen][1:])


def test_sensors_agree(channels, first_mode):
    """Three sensors on one structure: the curves agree where time, and so the state of the joint, is the same."""
    for name in ("acc2", "acc3"):
        other = ring_down(channels[name], RATE, low_hz=60.0, high_hz=100.0)
        chosen = (other.time_s > 0.5) & (other.time_s < 4.0)
        # Linear between blocks of a curve that bends, and four standard errors.
        for field, error, bend in (
            ("frequency_hz", "frequency_standard_error_hz", 0.002),
            ("damping_ratio", "damping_standard_error", 2e-5),
        ):
            mine, theirs = (
                np.interp(other.time_s[chosen], first_mode.time_s, getattr(first_mode, each)) for each in (field, error)
            )
            away = np.abs(getattr(other, field)[chosen] - mine)
            allowed = bend + 4.0 * np.hypot(theirs, getattr(other, error)[chosen])
            print(name, field, (away / allowed).round(2))
            assert np.all(away < allowed)


def test_result_is_independent_of_band_width(channels, first_mode):
    """Half the band has half the blocks; the curve is the same where it does not bend within one of these."""
    narrow = ring_down(channels["acc1"], RATE, low_hz=70.0, high_hz=90.0)
    assert narrow.time_s.size < first_mode.time_s.size
    amplitudes = np.geomspace(1.0, 12.0, 8)
    for mine, theirs, tolerance in zip(narrow.at(amplitudes), first_mode.at(amplitudes), (0.006, 4e-5), strict=True):
        np.testing.assert_allclose(mine, theirs, atol=tolerance)
