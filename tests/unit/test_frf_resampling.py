"""Resampling: exact on measured lines, no finer resolution, warnings at sharp peaks."""

import warnings

import numpy as np
import pytest

from receptance import FRF, ReceptanceWarning

LINES = np.linspace(10.0, 110.0, 101)


def mode(f, lines_in_band=20.0, centre=60.3):
    """Return a mode with so many lines (of 1 Hz) in its half-power band, and a residual."""
    return 1.0 / (f - centre - 0.5j * lines_in_band) + 0.01


def make(**changes):
    return FRF(**({"frequency_hz": LINES, "values": mode(LINES)} | changes))


def test_measured_lines_keep_their_values():
    frf = make(coherence=LINES / 200.0, log_variance=1.0 / LINES, usable=LINES > 20.0, degrees_of_freedom=LINES)
    same = frf.resample(LINES)
    for name in ("frequency_hz", "values", "coherence", "log_variance", "degrees_of_freedom", "usable"):
        np.testing.assert_array_equal(getattr(same, name), getattr(frf, name))
    assert same.notes == ()
    coarse = frf.resample(LINES[::7] * (1.0 + 1e-13))
    np.testing.assert_array_equal(coarse.values, frf.values[::7])
    np.testing.assert_array_equal(coarse.log_variance, frf.log_variance[::7])


@pytest.mark.parametrize(("band", "error"), [(20.0, 1e-4), (10.0, 5e-4), (5.0, 5e-3)])
def test_error_between_the_lines_of_a_mode(band, error):
    frf = make(values=mode(LINES, band))
    new = LINES[5:-6] + 0.5
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = frf.resample(new)
    exact = mode(new, band)
    np.testing.assert_allclose(found.values.ravel(), exact, rtol=error)
    assert found.notes == (f"resampled: {new.size} lines are interpolated",)


@pytest.mark.parametrize("band", [1.0, 2.0, 3.0])
def test_a_warning_for_peaks_with_few_lines(band):
    with pytest.warns(ReceptanceWarning, match=r"around (59|60)\.5 Hz the lines are too far apart"):
        found = make(values=mode(LINES, band)).resample(LINES[5:-6] + 0.5)
    assert any(".5 Hz the lines are" in note for note in found.notes)


def test_noise_gives_no_warning():
    rng = np.random.default_rng(5)
    noise = 0.05 * (rng.normal(size=LINES.size) + 1j * rng.normal(size=LINES.size))
    frf = make(values=mode(LINES) * (1.0 + noise), log_variance=0.05**2)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        frf.resample(LINES[:-1] + 0.5)


def test_interpolation_does_not_reduce_the_variance():
    frf = make(log_variance=np.where(LINES == 50.0, np.inf, 0.01), usable=LINES != 70.0, correlated_lines=6.0)
    half = frf.resample(LINES[:-1] + 0.5)
    known = np.isfinite(half.log_variance.ravel())
    np.testing.assert_allclose(half.log_variance.ravel()[known], 0.01, rtol=1e-12)
    np.testing.assert_array_equal(half.frequency_hz[~known], [49.5, 50.5])
    np.testing.assert_array_equal(half.frequency_hz[~half.usable], [69.5, 70.5])
    np.testing.assert_array_equal(half.correlated_lines, 6.0)
    # The neighbour of an unknown line is known.
    assert frf.resample([49.0, 51.0]).log_variance.ravel().tolist() == [0.01, 0.01]
    np.testing.assert_allclose(frf.resample(LINES[::4]).correlated_lines, 1.5)
    np.testing.assert_array_equal(frf.resample(LINES[::8]).correlated_lines, 1.0)


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        (np.linspace(10.0, 110.0, 201), r"resampled to 10 and 10.5 Hz, 0.5 Hz apart where the measured lines are 1 Hz"),
        ([20.5, 21.4], "0.9 Hz apart where the measured lines are 1 Hz"),
        ([9.0, 20.0], r"at 9 Hz, outside the measured band \(10 to 110 Hz\)"),
        ([20.0, 110.1], "at 110.1 Hz, outside"),
        ([], "frequency_hz is empty"),
        ([20.0, 20.0], "not ascending"),
    ],
)
def test_extrapolation_and_finer_lines_are_refused(lines, words):
    with pytest.raises(ValueError, match=words):
        make().resample(lines)


def test_uneven_lines_have_local_spacings():
    lines = np.r_[np.arange(10.0, 20.0, 1.0), np.arange(20.0, 100.0, 10.0)]
    frf = make(frequency_hz=lines, values=np.ones(lines.size))
    frf.resample([12.5, 13.5, 35.0, 45.0])
    with pytest.raises(ValueError, match=r"5 Hz apart where the measured lines are 10 Hz"):
        frf.resample([12.5, 13.5, 35.0, 40.0])


def test_few_lines():
    one = FRF(frequency_hz=[5.0], values=[2.0])
    assert one.resample([5.0]).values.item() == 2.0
    with pytest.raises(ValueError, match="outside the measured band"):
        one.resample([5.1])
    two = FRF(frequency_hz=[4.0, 6.0], values=[2.0, 4.0])
    assert two.resample([5.0]).values.item() == 3.0
    three = FRF(frequency_hz=[4.0, 6.0, 8.0], values=[2.0, 4.0, 6.0])
    np.testing.assert_allclose(three.resample([5.0, 7.0]).values.ravel(), [3.0, 5.0])


def test_several_entries_are_resampled_together():
    values = np.stack([mode(LINES), 3.0 * mode(LINES, 30.0, 40.0)], axis=1)[:, :, None]
    both = FRF(frequency_hz=LINES, values=values)
    new = np.array([20.25, 43.0, 62.5])
    for index in range(2):
        one = both.select(responses=index)
        np.testing.assert_array_equal(both.resample(new).values[:, [index]], one.resample(new).values)
