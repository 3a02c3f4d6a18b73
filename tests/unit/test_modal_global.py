"""Global modal fit: close modes, several entries, complex lines, standard errors and warnings."""

from __future__ import annotations

import os
import tracemalloc
import warnings

import numpy as np
import pytest
from scipy.stats import binomtest

from known_modes import FORMS, frf_of, values_of
from receptance import CARBIDE, FRF, STEEL, Assembly, Part, PointJoint, ReceptanceWarning, Segment
from receptance.modal import fit_modes

SEED = int(os.environ.get("RECEPTANCE_TEST_SEED", "11"))
REJECTED_AT = 1e-4
"""Level of an exact binomial test, so that the hundred such tests together fail by chance once in a hundred."""
F = np.arange(160.0, 240.0, 0.5)
ZETA = np.array([0.01, 0.012])
CONSTANTS = np.array([[1.0, 0.6], [-0.7, 0.9]])


def without_warnings(*arguments, **options):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ReceptanceWarning)
        return fit_modes(*arguments, **options)


@pytest.mark.slow
@pytest.mark.parametrize(("separation", "stated"), [(0.5, True), (0.25, False)])
def test_close_modes_and_their_intervals(separation, stated):
    """Modes as near as a quarter of their half-power band are resolved, and intervals contain the true values."""
    runs = 20
    print(f"seed {SEED}")
    true = np.array([200.0, 200.0 + 4.0 * separation])
    covered, scatter, stated_errors = [], [], []
    for number in range(runs):
        frf = frf_of(F, true, ZETA, CONSTANTS, form="accelerance", noise=0.01, seed=[SEED, number], stated=stated)
        fit = without_warnings(frf, 2)
        frequency, damping = fit.frequency_interval_hz(), fit.damping_interval()
        covered.append(
            np.concatenate(
                [
                    (frequency[:, 0] < true) & (true < frequency[:, 1]),
                    (damping[:, 0] < ZETA) & (damping[:, 1] > ZETA),
                ]
            )
        )
        errors = (fit.modal_constant[:, :, 0] - CONSTANTS) / fit.modal_constant_standard_error.real[:, :, 0]
        scatter.append(errors.real.ravel())
        stated_errors.append(fit.damping_standard_error / ZETA)
    found, size = np.sum(covered, axis=0), np.sqrt(np.mean(np.square(scatter), axis=0))
    print(separation, stated, found, size, np.mean(stated_errors, axis=0))
    for count in found:
        assert binomtest(int(count), runs, 0.95).pvalue > REJECTED_AT, found
    assert np.all(np.abs(size - 1.0) < 0.1 + 3.0 / np.sqrt(2.0 * runs)), size


def test_scatter_is_that_of_the_noise():
    frf = frf_of(F, [200.0, 202.0], ZETA, CONSTANTS, noise=0.02, seed=SEED)
    fit = without_warnings(frf, 2)
    largest = np.abs(values_of(F, [200.0, 202.0], ZETA, CONSTANTS)).max(axis=0)
    np.testing.assert_allclose(fit.scatter[:, 0], 0.02 * largest, rtol=0.15)
    assert not fit.known_scatter
    rng = np.random.default_rng(SEED)
    factor = 1.0 + 0.02 * (rng.normal(size=frf.shape) + 1j * rng.normal(size=frf.shape))
    exact = frf_of(F, [200.0, 202.0], ZETA, CONSTANTS)
    relative = without_warnings(exact.with_(values=exact.values * factor), 2, scatter="relative")
    np.testing.assert_allclose(relative.scatter, 0.02, rtol=0.15)
    np.testing.assert_allclose(relative.frequency_hz, [200.0, 202.0], atol=0.1)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("decay_rate", [0.0, 15.0])
def test_complex_lines(form, decay_rate):
    """The damping added by an exponential window is removed exactly."""
    constants = [[1.0 + 0.2j, 2.0], [-0.5, 1.0 - 0.1j], [3.0, 0.5]]
    frf = frf_of(F, [190.0, 191.0, 220.0], [0.005, 0.004, 0.01], constants, form=form, decay_rate=decay_rate)
    fit = without_warnings(frf, 3)
    np.testing.assert_allclose(fit.frequency_hz, [190.0, 191.0, 220.0], rtol=1e-10)
    np.testing.assert_allclose(fit.damping_ratio, [0.005, 0.004, 0.01], rtol=1e-7)
    np.testing.assert_allclose(fit.modal_constant[:, :, 0], constants, rtol=1e-6)
    np.testing.assert_allclose(fit.synthesised(), frf.values, rtol=1e-6)
    apparent = 2.0 * fit.damping_ratio * fit.frequency_hz + decay_rate / np.pi
    np.testing.assert_allclose(fit.lines_in_band, apparent / 0.5, rtol=1e-4)
    # The poles are those of the structure: off the lines the fit is the structure's receptance.
    other = values_of(F, [190.0, 191.0, 220.0], [0.005, 0.004, 0.01], constants)
    np.testing.assert_allclose(fit.receptance(F)[:, :, 0], other, rtol=1e-6)


def test_an_unstated_window_adds_damping():
    frf = frf_of(F, [200.0], [0.01], [[1.0]], decay_rate=15.0).with_(decay_rate=0.0)
    assert fit_modes(frf, 1).damping_ratio[0] == pytest.approx(0.01 + 15.0 / (2.0 * np.pi * 200.0), rel=1e-3)


def test_number_of_modes_is_found():
    print(f"seed {SEED}")
    for number in range(8):
        frf = frf_of(
            F,
            [180.0, 200.0, 203.0],
            [0.004, 0.01, 0.01],
            [[0.1, 1.0], [1.0, 2.0], [-1.0, 1.0]],
            noise=0.003,
            seed=[SEED, number],
        )
        fit = fit_modes(frf)
        assert len(fit.frequency_hz) == 3, fit.summary()
        np.testing.assert_allclose(fit.frequency_hz, [180.0, 200.0, 203.0], atol=0.2)


def test_matrix_of_responses_and_excitations():
    """Residues of a jointed assembly are those of its receptance, reciprocal, and the poles are common."""
    tool = Part([Segment(length=0.09, outer_diameter=0.02, material=CARBIDE)], name="tool")
    holder = Part([Segment(length=0.12, outer_diameter=0.05, material=STEEL)], name="holder")
    assembly = Assembly([tool, PointJoint(k_y=2e8, k_theta=6e4, c_y=300.0, c_theta=0.3), holder])
    from receptance import Coordinate

    places = [Coordinate("tool"), Coordinate("holder", 0.0)]
    f = np.arange(1500.0, 3200.0, 4.0)
    values = assembly.receptance(f, response=places, excitation=places)
    frf = FRF(frequency_hz=f, values=values, responses=places, excitations=places)
    fit = without_warnings(frf)
    undamped = assembly.natural_frequencies(3200.0)
    inside = undamped[undamped > 1500.0]
    np.testing.assert_allclose(fit.frequency_hz, inside, rtol=3e-4)
    np.testing.assert_allclose(
        fit.residue, fit.residue.transpose(0, 2, 1), rtol=1e-3, atol=1e-5 * np.abs(fit.residue).max()
    )
    np.testing.assert_allclose(fit.synthesised(), values, rtol=2e-3)
    mode = fit.mode(0, 1, 0)
    assert mode.modal_constant == fit.modal_constant[0, 1, 0]
    assert mode.method == "global"


def test_modes_near_given_frequencies():
    frf = frf_of(F, [180.0, 200.0, 202.0], [0.01] * 3, [[1.0], [1.0], [-1.0]], noise=1e-3, seed=SEED)
    for low in (None, 190.0):
        two = fit_modes(frf, [200.3, 201.8], low_hz=low)
        np.testing.assert_allclose(two.frequency_hz, [200.0, 202.0], atol=0.2)
        # The third is fitted as well, in the band or outside.
        np.testing.assert_allclose(np.abs(two.outside_poles) / (2.0 * np.pi), [180.0], atol=0.5)
        assert any("contains further modes" in note for note in two.notes) == (low is None)
        np.testing.assert_allclose(two.synthesised(), two.frf.values, atol=0.01 * np.abs(two.frf.values).max())
    with pytest.warns(ReceptanceWarning, match=r"no mode was found within 6\.6 Hz of 220 Hz"):
        fit_modes(frf.with_(values=values_of(F, [200.0], [0.01], [[1.0]])[:, :, None]), [200.0, 220.0])
    three = fit_modes(frf, [179.0, 199.5, 202.3])
    np.testing.assert_allclose(three.frequency_hz, [180.0, 200.0, 202.0], atol=0.1)


def test_a_mode_just_outside_the_band():
    frf = frf_of(F, [200.0, 260.0], [0.01, 0.01], [[1.0], [5.0]])
    fit = fit_modes(frf, 1)
    assert fit.damping_ratio[0] == pytest.approx(0.01, rel=1e-6)
    np.testing.assert_allclose(np.abs(fit.outside_poles) / (2.0 * np.pi), [260.0], rtol=1e-6)
    assert fit_modes(frf, 1, background="none").outside_poles.size == 0


@pytest.mark.slow
def test_intervals_of_a_broad_mode_near_an_outside_mode():
    """A damping ratio of 7 % and a mode half a half-power band above the last line, as on the virtual BT50 rig."""
    runs = 20
    print(f"seed {SEED}")
    f = np.arange(500.0, 6200.0, 20.0)
    true, zeta = np.array([1293.0, 4687.0]), np.array([0.0177, 0.0741])
    covered, off = [], []
    for number in range(runs):
        frf = frf_of(
            f,
            [*true, 6735.0, 11900.0],
            [*zeta, 0.02, 0.021],
            [[0.5, 0.4], [1.0, -0.6], [0.4, 0.5], [1.0, 1.0]],
            noise=0.003,
            seed=[SEED, number],
            stated=True,
            form="accelerance",
        )
        fit = without_warnings(frf, 2)
        frequency, damping = fit.frequency_interval_hz(), fit.damping_interval()
        covered.append(
            np.concatenate(
                [
                    (frequency[:, 0] < true) & (true < frequency[:, 1]),
                    (damping[:, 0] < zeta) & (zeta < damping[:, 1]),
                ]
            )
        )
        off.append(np.concatenate([fit.frequency_hz / true - 1.0, fit.damping_ratio / zeta - 1.0]))
    print(np.sum(covered, axis=0), np.mean(off, axis=0), np.std(off, axis=0))
    for count in np.sum(covered, axis=0):
        assert binomtest(int(count), runs, 0.95).pvalue > REJECTED_AT, count
    assert np.all(np.abs(np.mean(off, axis=0)) < [1e-3, 5e-3, 0.01, 0.03])


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "correlated"), [("force", 6.0), ("response", 1.0), ("separate", 6.0)])
def test_noise_common_to_several_responses(correlated, kind):
    """Noise of the force is the same in all responses relative to the FRF, also between lines; noise of a response not.

    "separate" is in proportion to the FRF but independent between the entries: the errors must not grow for it.
    """
    runs = 20
    print(f"seed {SEED}")
    f = np.arange(500.0, 2500.0, 20.0)
    true, zeta, constants = np.array([1300.0]), np.array([0.015]), np.array([[1.0, 0.8, -0.6]])
    decay_rate = 0.0 if correlated == 1.0 else 2.0 * 20.0 * correlated / 2.0
    exact = values_of(f, true, zeta, constants, form="accelerance", decay_rate=decay_rate)
    held, scores = [], []
    for number in range(runs):
        rng = np.random.default_rng([SEED, number])

        def noise(rng=rng):
            """Complex, of unit variance in each part, under the window that correlates the lines."""
            if correlated == 1.0:
                return rng.normal(size=f.size) + 1j * rng.normal(size=f.size)
            time = np.arange(8192) / (8192 * 20.0)
            record = (rng.normal(size=time.size) + 1j * rng.normal(size=time.size)) * np.exp(-decay_rate * time)
            lines = np.fft.fft(record)[np.rint(f / 20.0).astype(int)]
            return lines / np.sqrt(np.sum(np.exp(-2.0 * decay_rate * time)))

        if kind == "response":
            size = np.broadcast_to(0.01 * np.abs(exact).max(axis=0), exact.shape)
            error = np.stack([noise() for _ in range(3)], axis=1) * size
        else:
            size = 0.01 * np.abs(exact)
            force = [noise()] * 3 if kind == "force" else [noise() for _ in range(3)]
            error = 0.01 * exact * np.stack(force, axis=1)
        frf = FRF(
            frequency_hz=f,
            values=(exact + error)[:, :, None],
            log_variance=(size / np.abs(exact))[:, :, None] ** 2,
            form="accelerance",
            decay_rate=decay_rate,
            correlated_lines=correlated,
        )
        fit = without_warnings(frf, 1)
        frequency, damping = fit.frequency_interval_hz()[0], fit.damping_interval()[0]
        held.append([frequency[0] < true[0] < frequency[1], damping[0] < zeta[0] < damping[1]])
        off = [fit.frequency_hz[0] - true[0], fit.damping_ratio[0] - zeta[0]]
        scores.append(np.array(off) / [fit.frequency_standard_error_hz[0], fit.damping_standard_error[0]])
    spread = np.sqrt(np.mean(np.square(scores), axis=0))
    print(kind, correlated, np.sum(held, axis=0), spread)
    for count in np.sum(held, axis=0):
        assert binomtest(int(count), runs, 0.95).pvalue > REJECTED_AT, count
    assert np.all(np.abs(spread - 1.0) < 0.15 + 3.0 / np.sqrt(2.0 * runs)), spread


def pairs_that_move(seed):
    """Eight modes of which two pairs are close, some weakly excited, each entry's a little elsewhere; one outside."""
    rng = np.random.default_rng(seed)
    f = np.linspace(100.0, 1000.0, 600)
    places, zeta = np.sort(rng.uniform(120.0, 980.0, 6)), 10.0 ** rng.uniform(-3.0, -1.7, 6)
    first = rng.choice(6, 2, replace=False)
    places = np.append(places, places[first] * (1.0 + rng.uniform(0.8, 1.5, 2) * 2.0 * zeta[first]))
    zeta = np.append(zeta, zeta[first])
    order = np.argsort(places)
    places, zeta = np.append(places[order], 1015.0), np.append(zeta[order], 0.01)
    size = rng.normal(size=(9, 4)) * 10.0 ** rng.uniform(-1.0, 0.3, (9, 1)) * zeta[:, None]
    moved = places[:, None] * (1.0 + 2e-4 * rng.normal(size=(9, 4)))
    entries = [values_of(f, moved[:, e], zeta, size[:, [e]], form="accelerance") for e in range(4)]
    values = np.concatenate(entries, axis=1)
    noise = 1e-3 * np.sqrt(np.mean(np.abs(values) ** 2, axis=0))
    values = values + noise * (rng.normal(size=values.shape) + 1j * rng.normal(size=values.shape))
    inside = places < 1000.0
    return FRF(frequency_hz=f, values=values[:, :, None], form="accelerance"), places[inside], zeta[inside]


@pytest.mark.parametrize("given", ["count", "frequencies"])
@pytest.mark.parametrize("seed", [0, *(pytest.param(n, marks=pytest.mark.slow) for n in (1, 2))])
def test_close_and_weak_modes_are_all_found(seed, given):
    """Each pole once, none outside the band, though the misfit is larger than the noise."""
    frf, places, zeta = pairs_that_move(seed)
    fit = without_warnings(frf, places.size if given == "count" else list(places))
    assert fit.frequency_hz.size == places.size, fit.summary()
    assert np.all((fit.frequency_hz > 100.0) & (fit.frequency_hz < 1000.0))
    away = np.abs(fit.frequency_hz - places) / (zeta * places)
    assert np.all(away < 1.0), fit.summary()


def test_many_entries_need_little_memory():
    """Memory does not grow with lines times entries times modes."""
    f = np.linspace(100.0, 400.0, 600)
    rng = np.random.default_rng(SEED)
    constants = rng.normal(size=(3, 60))
    frf = frf_of(f, np.linspace(120.0, 380.0, 3), [0.005] * 3, constants, noise=0.003, seed=SEED)
    without_warnings(frf.select(responses=[0]), 1)
    tracemalloc.start()
    try:
        fit = without_warnings(frf)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    np.testing.assert_allclose(fit.frequency_hz, np.linspace(120.0, 380.0, 3), rtol=1e-4)
    print(f"{peak / 2**20:.0f} MB for {frf.values.nbytes / 2**20:.1f} MB of values")
    assert peak < 30 * frf.values.nbytes


def test_excess_residuals_enlarge_the_errors():
    frf = frf_of(F, [200.0], [0.01], [[1.0]], noise=0.01, seed=SEED, stated=True)
    honest, boasting = fit_modes(frf, 1), fit_modes(frf.with_(log_variance=frf.log_variance / 9.0), 1)
    assert boasting.damping_standard_error[0] == pytest.approx(honest.damping_standard_error[0], rel=0.15)
    assert any("times as large as stated by the variance" in note for note in boasting.notes)
    assert np.isinf(honest.degrees_of_freedom)
    assert np.isfinite(boasting.degrees_of_freedom)
    # Stated as larger than it is: kept, because a deliberate floor is not to be scaled away.
    careful = fit_modes(frf.with_(log_variance=frf.log_variance * 9.0), 1)
    assert careful.damping_standard_error[0] == pytest.approx(3.0 * honest.damping_standard_error[0], rel=0.1)


@pytest.mark.slow
def test_inconsistent_entries_enlarge_the_errors():
    """A natural frequency that drifts from hit to hit, as with temperature, is the larger part of the uncertainty."""
    runs = 12
    rng = np.random.default_rng(SEED)
    print(f"seed {SEED}")
    inside = 0
    for _ in range(runs):
        drift = 200.0 + 0.05 * rng.normal(size=8)
        entries = [values_of(F, [f], [0.01], [[1.0]])[:, 0] for f in drift]
        values = np.stack(entries, axis=1)
        values = values + 1e-4 * np.abs(values).max() * (
            rng.normal(size=values.shape) + 1j * rng.normal(size=values.shape)
        )
        fit = fit_modes(FRF(frequency_hz=F, values=values[:, :, None]), 1)
        assert any("poles of the entries differ" in note for note in fit.notes)
        assert fit.frequency_standard_error_hz[0] == pytest.approx(0.05 / np.sqrt(8.0), rel=0.9)
        low, high = fit.frequency_interval_hz()[0]
        inside += low < 200.0 < high
    assert binomtest(inside, runs, 0.95).pvalue > REJECTED_AT, inside


def test_correlated_residuals_enlarge_the_errors():
    """Lines interpolated between those that were measured hold no more than these."""
    rng = np.random.default_rng(SEED)
    frf = frf_of(F, [200.0], [0.02], [[1.0]])
    independent = rng.normal(size=(2, F.size))
    smooth = np.stack([np.convolve(row, np.ones(4) / 2.0, mode="same") for row in independent])
    size = 0.01 * np.abs(frf.values).max()
    one = fit_modes(frf.with_(values=frf.values + size * (independent[0] + 1j * independent[1])[:, None, None]), 1)
    four = fit_modes(frf.with_(values=frf.values + size * (smooth[0] + 1j * smooth[1])[:, None, None]), 1)
    assert four.correlation > 0.5
    assert 1.4 < four.damping_standard_error[0] / one.damping_standard_error[0] < 4.0


def smooth_noise(rng, lines, entries):
    """Complex noise of unit variance in each part, smoothed over the lines by a Gaussian of four lines."""
    kernel = np.exp(-0.5 * (np.arange(-16, 17) / 4.0) ** 2)
    independent = rng.normal(size=(2, lines + 40, entries))
    columns = (independent[0] + 1j * independent[1]).T
    smooth = [np.convolve(column, kernel / np.sqrt(np.sum(kernel**2)), mode="same")[20:-20] for column in columns]
    return np.stack(smooth, axis=1)


def test_errors_smooth_over_lines_are_not_taken_for_modes():
    """One mode in twelve responses, errors of 1 % smooth over several lines; each step is reported."""
    f = np.arange(655.0, 679.0, 1.0 / 3.0)
    steps = []
    for seed in range(2):
        rng = np.random.default_rng([SEED, seed])
        exact = values_of(f, [667.3], [0.008], rng.normal(size=(1, 12)))
        values = exact * (1.0 + 0.01 * smooth_noise(rng, f.size, 12))
        fit = fit_modes(FRF(frequency_hz=f, values=values[:, :, None]), progress=steps.append)
        assert fit.frequency_hz.size == 1
        assert abs(fit.frequency_hz[0] - 667.3) < 4.0 * fit.frequency_standard_error_hz[0] < 2.0
        assert any("smooth over" in note for note in fit.notes)
    assert any("search for pole 1" in step for step in steps)
    assert any("removal of one of" in step for step in steps)


def test_the_search_ends_where_poles_follow_smooth_errors():
    """Many lines would hold a pole for every few of them."""
    f, rng = np.arange(100.0, 500.0, 0.5), np.random.default_rng(SEED)
    exact = values_of(f, [200.0, 300.0], [0.01, 0.01], [[1.0, 0.6], [-0.7, 0.9]])
    values = exact + 0.01 * np.abs(exact).max(axis=0) * smooth_noise(rng, f.size, 2)
    steps = []
    fit = fit_modes(FRF(frequency_hz=f, values=values[:, :, None]), progress=steps.append)
    np.testing.assert_allclose(fit.frequency_hz, [200.0, 300.0], rtol=2e-3)
    assert len(steps) < 30


@pytest.mark.slow
def test_intervals_with_errors_smooth_over_lines():
    """Intervals of one mode and of two contain the true frequency, with five independent values in a band."""
    runs = 6
    print(f"seed {SEED}")
    inside, total = 0, 0
    for modes in (1, 2):
        f = np.arange(655.0, 679.0, 1.0 / 3.0) if modes == 1 else np.arange(640.0, 700.0, 1.0 / 3.0)
        true = np.array([667.3]) if modes == 1 else np.array([660.3, 674.6])
        for number in range(2 * runs // modes):
            rng = np.random.default_rng([SEED, modes, number])
            exact = values_of(f, true, np.full(modes, 0.008), rng.normal(size=(modes, 2)))
            values = exact + 0.01 * np.abs(exact).max(axis=0) * smooth_noise(rng, f.size, 2)
            fit = without_warnings(FRF(frequency_hz=f, values=values[:, :, None]), modes)
            low, high = fit.frequency_interval_hz().T
            inside, total = inside + int(np.sum((low < true) & (true < high))), total + modes
    print(f"{inside} of {total} intervals contain the true frequency")
    assert binomtest(inside, total, 0.95).pvalue > REJECTED_AT, (inside, total)


@pytest.mark.slow
@pytest.mark.parametrize(("width", "stated"), [(0.3, False), (1.0, True), (3.0, False)])
def test_noise_under_an_exponential_window(width, stated):
    """Noise exp(-sigma t) correlates lines; intervals cover, be that over less or more than a half-power band.

    Where the variance is not stated and 75 lines share their noise, the residual's own variance counts as known from as
    few as five independent numbers. That is careful: 99 % of those intervals hold the truth.
    """
    runs = 20
    careful = width == 3.0 and not stated
    print(f"seed {SEED}")
    f = np.arange(150.0, 250.0, 0.5)
    decay_rate = width * 2.0 * np.pi * 2.0
    exact = values_of(f, [200.0], [0.01], [[1.0, -0.5]], decay_rate=decay_rate)
    n, period = 4096, 2.0
    time = np.arange(n) * period / n
    shared = decay_rate * period
    covered, sizes = [], []
    for number in range(runs):
        rng = np.random.default_rng([SEED, number])
        noise = np.fft.fft(rng.normal(size=(n, 2)) * np.exp(-decay_rate * time)[:, None], axis=0)[300 : 300 + f.size]
        deviation = 0.003 * np.abs(exact).max()
        values = exact + deviation * noise / np.sqrt(np.sum(np.exp(-2.0 * decay_rate * time)) / 2.0)
        frf = FRF(
            frequency_hz=f,
            values=values[:, :, None],
            decay_rate=decay_rate,
            log_variance=((deviation / np.abs(exact)) ** 2)[:, :, None] if stated else None,
            correlated_lines=shared,
        )
        fit = without_warnings(frf, 1)
        low, high = fit.damping_interval()[0]
        first, last = fit.frequency_interval_hz()[0]
        covered.append([low < 0.01 < high, first < 200.0 < last])
        sizes.append(
            [
                (fit.damping_ratio[0] - 0.01) / fit.damping_standard_error[0],
                (fit.modal_constant[0, 0, 0].real - 1.0) / fit.modal_constant_standard_error[0, 0, 0].real,
            ]
        )
    size = np.sqrt(np.mean(np.square(sizes), axis=0))
    print(width, stated, shared, np.sum(covered, axis=0), size)
    for count in np.sum(covered, axis=0):
        assert binomtest(int(count), runs, 0.95, "less" if careful else "two-sided").pvalue > REJECTED_AT
    assert np.all(np.abs(size - 1.0) < 0.15 + 3.0 / np.sqrt(2.0 * runs)), size


def test_uneven_lines_and_gaps():
    rng = np.random.default_rng(SEED)
    f = np.sort(rng.uniform(160.0, 240.0, 150))
    frf = frf_of(f, [195.0, 205.0], [0.01, 0.01], [[1.0], [2.0]]).with_(usable=(f < 197.0) | (f > 200.0))
    fit = without_warnings(frf, 2)
    np.testing.assert_allclose(fit.frequency_hz, [195.0, 205.0], rtol=1e-8)
    assert fit.frf.frequency_hz.size == np.count_nonzero(frf.usable)


def test_warnings_and_notes():
    narrow = fit_modes(frf_of(np.arange(100.0, 300.0, 2.0), [201.0], [0.001], [[1.0]]), 1)
    assert "of the distance of the lines" in narrow.notes[-1]
    close = without_warnings(frf_of(F, [200.0, 201.0], [0.01, 0.01], [[1.0], [2.0]], noise=1e-4, seed=1), 2)
    assert any("two close modes, or one mode that changed" in note for note in close.notes)
    rng = np.random.default_rng(SEED)
    noise = FRF(frequency_hz=F, values=rng.normal(size=F.size) + 1j * rng.normal(size=F.size))
    with pytest.raises(ValueError, match=r"no mode between 160 and 239\.5 Hz exceeds the scatter"):
        fit_modes(noise)
    window = frf_of(F, [200.0], [0.001], [[1.0]], decay_rate=5.0).with_(decay_rate=8.0)
    with pytest.warns(ReceptanceWarning, match="is -0.*, not above zero"):
        fit_modes(window, 1)


def test_mistakes():
    frf = frf_of(F, [200.0], [0.01], [[1.0]])
    for wrong, message in (
        (0, "modes is 0"),
        ([], "modes is empty"),
        ([200.0, 199.0], "expected ascending"),
        ([500.0], r"modes\[0\] is 500 Hz, outside"),
        (100, "the lines suffice for at most"),
    ):
        with pytest.raises(ValueError, match=message):
            fit_modes(frf, wrong)
    for wrong in (True, "two", 2.0):
        with pytest.raises(TypeError, match="expected their number or a list"):
            fit_modes(frf, wrong)
    with pytest.raises(ValueError, match="background is 'all'"):
        fit_modes(frf, 1, background="all")
    with pytest.raises(ValueError, match="scatter is 'none'"):
        fit_modes(frf, 1, scatter="none")
    with pytest.raises(ValueError, match="order is 0"):
        fit_modes(frf, 1, order=0)


def test_zero_entry_has_no_effect():
    """A point at a node of every mode, or a channel that was not connected."""
    one = frf_of(F, [200.0, 210.0], [0.01, 0.01], [[1.0], [2.0]], noise=1e-3, seed=SEED)
    values = np.concatenate([one.values, np.zeros_like(one.values)], axis=1)
    for scatter in ("absolute", "relative"):
        alone = fit_modes(one, 2, scatter=scatter)
        both = fit_modes(FRF(frequency_hz=F, values=values), 2, scatter=scatter)
        np.testing.assert_allclose(both.frequency_hz, alone.frequency_hz, rtol=1e-6)
        np.testing.assert_allclose(both.modal_constant[:, 1], 0.0, atol=1e-12)


def test_few_lines():
    f = np.arange(190.0, 210.0, 2.0)
    frf = frf_of(f, [200.5], [0.01], [[1.0]])
    np.testing.assert_allclose(without_warnings(frf, 1).damping_ratio, 0.01, rtol=1e-6)
    with pytest.raises(ValueError, match="3 lines of FRF"):
        fit_modes(frf, 1, low_hz=195.0, high_hz=201.0)
