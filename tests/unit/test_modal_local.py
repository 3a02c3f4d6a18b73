"""Peaks, half-power points and circles of single modes."""

from __future__ import annotations

import os
import warnings

import numpy as np
import pytest
from scipy.stats import binomtest

from known_modes import FORMS, frf_of
from receptance import FRF, ReceptanceWarning
from receptance.frf.variance import interval_factor
from receptance.modal import circle_fit, find_peaks, half_power

SEED = int(os.environ.get("RECEPTANCE_TEST_SEED", "3"))
REJECTED_AT = 1e-4
"""As in test_modal_global."""
METHODS = (find_peaks, half_power, circle_fit)


def highest(method, frf, **band):
    """The mode that a method finds at the highest peak."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ReceptanceWarning)
        found = method(frf, **band)
    if isinstance(found, tuple):
        return max(found, key=lambda mode: np.nan_to_num(abs(mode.modal_constant) / abs(mode.damping_ratio)))
    return found


@pytest.mark.parametrize(
    ("lines", "bias_percent", "peak_percent", "tolerance"),
    [(10, 0.5, -0.2, 0.05), (5, 2.0, -0.65, 0.05), (3, 5.6, -1.8, 0.1), (2, 11.0, -3.8, 0.2), (1, 41.0, -12.0, 1.5)],
)
def test_half_power_bias(lines, bias_percent, peak_percent, tolerance):
    """The known bias of linear interpolation at zeta = 1 %, averaged over where the lines lie.

    Bias of the damping and the first and last of the peaks are published numbers of this project (physics.md).
    """
    zeta, f = 0.01, 1000.0
    step = 2.0 * zeta * f / lines
    damping, peak, counted = [], [], []
    for shift in (np.arange(40) + 0.5) / 40.0:
        frf = frf_of(f + step * (np.arange(-30, 31) + shift), [f], [zeta], [[1.0]])
        mode = highest(half_power, frf)
        damping.append(mode.damping_ratio / zeta - 1.0)
        peak.append(abs(mode.modal_constant) / (mode.damping_ratio / zeta) - 1.0)
        counted.append(mode.lines_in_band)
    assert 100.0 * np.mean(damping) == pytest.approx(bias_percent, abs=tolerance)
    assert 100.0 * np.mean(peak) == pytest.approx(peak_percent, abs=max(tolerance, 0.06))
    assert np.mean(counted) == pytest.approx(lines * (1.0 + bias_percent / 100.0), rel=0.03)


def test_half_power_warns_under_five_lines():
    f = np.arange(900.0, 1100.0, 5.0)
    with pytest.warns(ReceptanceWarning, match=r"only 4\.\d lines in the half-power band .* is overestimated by .* %"):
        mode = half_power(frf_of(f, [1001.0], [0.0099], [[1.0]]))
    assert "use circle_fit or fit_modes" in mode.notes[-1]
    # No warning with six lines.
    assert half_power(frf_of(f, [1001.0], [0.016], [[1.0]])).notes == ()


def test_half_power_errors_from_the_position_of_lines():
    """Without noise the error is the resolution's, and the standard error is its scatter over all places."""
    zeta, f = 0.01, 1000.0
    ratios = []
    for shift in (np.arange(40) + 0.5) / 40.0:
        mode = highest(half_power, frf_of(f + 4.0 * (np.arange(-30, 31) + shift), [f], [zeta], [[1.0]]))
        ratios.append(
            (
                (mode.damping_ratio - 1.02 * zeta) / mode.damping_standard_error,
                (mode.frequency_hz - f) / mode.frequency_standard_error_hz,
            )
        )
    np.testing.assert_allclose(np.std(ratios, axis=0), 1.0, atol=0.4)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("decay_rate", [0.0, 25.0])
@pytest.mark.parametrize("method", METHODS)
def test_exact_mode(method, decay_rate, form):
    """The effect of an exponential window is removed for any form; half-power within its interpolation error."""
    f = np.arange(600.0, 1000.0, 0.25)
    mode = highest(method, frf_of(f, [797.3], [0.004], [[-2.0]], form=form, decay_rate=decay_rate))
    interpolated = method is half_power
    assert mode.frequency_hz == pytest.approx(797.3, rel=1e-5 if interpolated else 1e-12)
    assert mode.damping_ratio == pytest.approx(0.004, rel=2e-3 if interpolated else 1e-9)
    assert mode.modal_constant == pytest.approx(-2.0, rel=2e-3 if interpolated else 1e-9)
    assert mode.lines_in_band == pytest.approx((2 * 0.004 * 797.3 + decay_rate / np.pi) / 0.25, rel=3e-3)
    assert mode.pole.real == pytest.approx(-0.004 * 2 * np.pi * mode.frequency_hz, rel=3e-3)


@pytest.mark.slow
@pytest.mark.parametrize(("lines", "stated"), [(20, False), (8, True), (3, False)])
@pytest.mark.parametrize("method", METHODS)
def test_intervals_cover(method, lines, stated):
    """Of so many noisy FRFs as many intervals of 95 % hold the truth as should; the known bias of half-power apart."""
    runs = 150
    print(f"seed {SEED}")
    zeta, step = 0.01, 2.0 * 0.01 * 800.0 / lines
    f = np.arange(700.0, 900.0, step)
    covered = []
    for number in range(runs):
        true = 797.0 + step * np.random.default_rng([SEED, number]).uniform()
        frf = frf_of(f, [true], [zeta], [[2.0]], noise=0.01, seed=[SEED, number, 1], stated=stated)
        mode = highest(method, frf, low_hz=740.0, high_hz=860.0)
        reach = interval_factor(0.95, mode.degrees_of_freedom)
        low, high = mode.damping_interval()
        covered.append(
            (
                abs(mode.frequency_hz - true) <= reach * mode.frequency_standard_error_hz,
                abs(mode.modal_constant.imag) <= reach * mode.modal_constant_standard_error.imag,
                low <= zeta <= high,
                abs(mode.modal_constant.real - 2.0) <= reach * mode.modal_constant_standard_error.real,
            )
        )
    found = np.sum(covered, axis=0)
    print(method.__name__, lines, stated, found)
    for count in found[:2] if method is half_power else found:
        assert binomtest(int(count), runs, 0.95).pvalue > REJECTED_AT, found


def test_circle_with_other_modes():
    """The circle is moved off the origin by what other modes add, and the estimate is not."""
    f = np.arange(700.0, 900.0, 0.5)
    frf = frf_of(f, [500.0, 800.0, 1200.0], [0.01, 0.004, 0.01], [[4.0], [1.0], [-6.0]])
    circle, power = circle_fit(frf, low_hz=780.0, high_hz=820.0), half_power(frf, low_hz=780.0, high_hz=820.0)
    assert abs(circle.damping_ratio / 0.004 - 1.0) < 2e-3
    assert abs(power.damping_ratio - 0.004) > 2.0 * abs(circle.damping_ratio - 0.004)
    assert abs(abs(circle.centre) - circle.radius) > 0.01 * circle.radius
    assert circle.radius == pytest.approx(1.0 / (4.0 * 0.004 * 2.0 * np.pi * 800.0), rel=1e-2)
    assert circle.arc > 4.0
    assert circle.off_circle < 1e-3


def test_circle_with_less_than_one_line_in_the_band():
    f = np.arange(700.0, 900.0, 4.0)
    mode = circle_fit(frf_of(f, [801.3], [0.001], [[1.0]]))
    assert mode.lines_in_band < 0.5
    assert mode.damping_ratio == pytest.approx(0.001, rel=1e-9)


def test_circle_warns_of_a_short_arc():
    """A band that ends beside the peak leaves a short arc."""
    rng = np.random.default_rng(SEED)
    f = np.arange(797.0, 803.0, 0.5)
    frf = frf_of(f, [800.0], [0.02], [[1.0]])
    frf = frf.with_(values=frf.values * (1.0 + 1e-3 * rng.normal(size=frf.shape)))
    with pytest.warns(ReceptanceWarning, match="degrees of the circle"):
        circle_fit(frf)


def test_circle_refuses_a_straight_line():
    f = np.arange(700.0, 900.0, 4.0)
    undamped = 1.0 / ((2.0 * np.pi * 801.0) ** 2 - (2.0 * np.pi * f) ** 2)
    for turn in (1.0, np.exp(0.3j)):
        with pytest.raises(ValueError, match="straight line in the complex plane"):
            circle_fit(FRF(frequency_hz=f, values=turn * undamped + 0j))


def test_peaks_between_lines_and_of_several_modes():
    f = np.arange(10.0, 1000.0, 2.0)
    modes = [101.1, 333.4, 700.7]
    found = find_peaks(frf_of(f, modes, [0.02, 0.01, 0.004], [[1.0], [-1.0], [1.0]]))
    assert [round(mode.frequency_hz, 1) for mode in found] == pytest.approx(modes, abs=0.2)
    assert find_peaks(frf_of(f, modes, [0.02, 0.01, 0.004], [[1.0], [-1.0], [1.0]]), low_hz=400.0, high_hz=600.0) == ()


def test_unresolved_peak_has_no_damping():
    """A mode so narrow that the lines cover only its skirts: the parabola has no depth, with a note."""
    f = np.arange(700.0, 900.0, 4.0)
    frf = frf_of(f, [801.3], [1e-9], [[1.0]], noise=1e-3, seed=5)
    mode = highest(find_peaks, frf)
    assert mode.frequency_hz == pytest.approx(801.3, abs=0.1)
    if not np.isnan(mode.damping_ratio):
        assert abs(mode.damping_ratio) < 3.0 * mode.damping_standard_error
    window = highest(half_power, frf_of(f, [800.0], [0.01], [[1.0]]).with_(decay_rate=60.0))
    assert "no wider than the exponential window" in window.notes[-1]


def test_correlated_lines_enlarge_the_errors():
    f = np.arange(700.0, 900.0, 1.0)
    frf = frf_of(f, [800.0], [0.01], [[1.0]], noise=0.01, seed=SEED, stated=True)
    shared = frf.with_(correlated_lines=9.0)
    for method in (find_peaks, circle_fit):
        one, nine = highest(method, frf), highest(method, shared)
        # The factor is larger the closer an estimate is to a mean over lines.
        assert 1.2 < nine.damping_standard_error / one.damping_standard_error <= 3.01
    assert highest(half_power, shared).damping_standard_error > highest(half_power, frf).damping_standard_error


def test_lines_with_infinite_variance():
    """An infinite variance leaves a line out of a circle, and gives points at it an infinite error."""
    f = np.arange(700.0, 900.0, 1.0)
    frf = frf_of(f, [800.0], [0.01], [[1.0]], noise=0.001, seed=SEED, stated=True)
    variance = frf.log_variance.copy()
    variance[95:106] = np.inf
    with_gap = frf.with_(log_variance=variance)
    circle = circle_fit(with_gap)
    assert circle.damping_ratio == pytest.approx(0.01, abs=4.0 * circle.damping_standard_error)
    assert np.isinf(half_power(with_gap).modal_constant_standard_error.real)
    variance[60:140] = np.inf
    with pytest.raises(ValueError, match="fewer than 5 lines around the peak at 800 Hz is finite"):
        circle_fit(frf.with_(log_variance=variance))
    assert find_peaks(frf.with_(log_variance=variance)) == ()
    with pytest.raises(ValueError, match="infinite on all lines"):
        circle_fit(frf.with_(log_variance=np.inf))
    zero = circle_fit(frf.with_(log_variance=0.0))
    assert "stated variance is zero on all lines" in zero.notes[0]


def test_mistakes():
    f = np.arange(700.0, 900.0, 1.0)
    frf = frf_of(f, [800.0], [0.01], [[1.0, 2.0]])
    for method in METHODS:
        with pytest.raises(ValueError, match="the FRF has 2 entries"):
            method(frf)
        with pytest.raises(TypeError, match="expected an FRF"):
            method(f)
        with pytest.raises(ValueError, match="low_hz is 900 and high_hz 700"):
            method(frf, low_hz=900.0, high_hz=700.0)
        with pytest.raises(ValueError, match=r"2 lines of FRF.*between 799 and 800.5 Hz, expected at least"):
            method(frf, low_hz=799.0, high_hz=800.5)
    one = frf.select(responses=0)
    for method in (half_power, circle_fit):
        with pytest.raises(ValueError, match=r"at 790 Hz, the last line of the band"):
            method(one, low_hz=720.0, high_hz=790.0)
    with pytest.raises(ValueError, match="half-power point below the peak at 800 Hz"):
        half_power(one, low_hz=797.0, high_hz=850.0)
    with pytest.raises(ValueError, match=r"1 lines of FRF.* \(and 20 outside its usable band\), expected at least 3"):
        half_power(one.with_(usable=f < 790.5), low_hz=790.0, high_hz=810.0)
    with pytest.raises(ValueError, match="level is 2"):
        circle_fit(one).damping_interval(2.0)


def test_zero_hertz_is_left_out():
    f = np.arange(0.0, 900.0, 1.0)
    values = np.ones(f.size, dtype=complex)
    values[1:] = frf_of(f[1:], [800.0], [0.01], [[1.0]], form="accelerance").values[:, 0, 0]
    mode = circle_fit(FRF(frequency_hz=f, values=values, form="accelerance"), low_hz=600.0)
    assert mode.frequency_hz == pytest.approx(800.0)
    assert find_peaks(FRF(frequency_hz=f, values=values, form="accelerance"))[-1].frequency_hz == pytest.approx(800.0)


def test_degrees_of_freedom_of_a_variance_from_few_hits():
    """Nine degrees of freedom widen the interval from 1.96 to 2.26 standard errors."""
    f = np.arange(700.0, 900.0, 1.0)
    frf = frf_of(f, [800.0], [0.01], [[1.0]], noise=0.01, seed=SEED, stated=True)
    few = frf.with_(degrees_of_freedom=9.0)
    for method in METHODS:
        exact, wide = highest(method, frf), highest(method, few)
        assert (exact.degrees_of_freedom, wide.degrees_of_freedom) == (np.inf, 9.0)
        low, high = wide.damping_interval()
        assert (high - low) / wide.damping_standard_error == pytest.approx(2.0 * 2.262, rel=1e-3)


def test_too_few_lines_for_the_scatter():
    """Three lines give half-power points and no estimate of their scatter."""
    with pytest.warns(ReceptanceWarning, match="half-power band"):
        mode = half_power(frf_of([790.0, 800.0, 810.0], [801.0], [0.004], [[1.0]]))
    assert np.isinf(mode.damping_standard_error)
    assert any("too few to estimate their scatter" in note for note in mode.notes)
