"""Lobes where the tip or the cut is uncertain: bands, probabilities, recommended speeds."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from scipy import stats

from receptance import FRF
from receptance.modal import circle_fit
from receptance.stability import (
    Milling,
    TipModes,
    Turning,
    critical_depths,
    receptance_draws,
    semi_discretised_limit,
    semi_discretised_lobes,
    stability_lobes,
)

SEED = 20261121
TIP = TipModes(frequency_hz=[922.0, 1400.0], damping_ratio=[0.03, 0.02], shapes=[[5.0, 0.0], [0.0, 4.0]])
CUT = Milling(teeth=3, k_t=6e8, k_n=2e8, immersion=0.5, feed="up")
LINES = np.arange(500.0, 2500.0, 1.0)
SPEEDS = np.arange(4000.0, 30000.0, 100.0)


def test_limits_against_one_speed_at_a_time() -> None:
    """Reference: all pairs of neighbouring lines between which the tooth period is whole waves plus the phase."""
    depth, phase = critical_depths(CUT, LINES, TIP.receptance(LINES))
    found = stability_lobes(CUT, LINES, TIP.receptance(LINES), speeds_rpm=SPEEDS).depth
    for speed, limit in zip(SPEEDS[::9], found[::9], strict=True):
        waves = LINES[:, None] * 60.0 / (CUT.teeth * speed) - phase / (2.0 * np.pi)
        turn = np.floor(waves)
        step = np.diff(waves, axis=0)
        # A whole number is between the lines, and the phase does not jump by a turn.
        passed = (np.diff(turn, axis=0) != 0) & (np.abs(step) < 0.5)
        line, column = np.nonzero(passed)
        whole = np.maximum(turn[line, column], turn[line + 1, column])
        share = (whole - waves[line, column]) / step[line, column]
        inverse = 1.0 / depth[line, column] * (1.0 - share) + 1.0 / depth[line + 1, column] * share
        assert limit == pytest.approx(1.0 / inverse.max(), rel=1e-6)


def test_relative_spread_of_the_limit_equals_that_of_the_coefficient() -> None:
    cut = Turning(k=1e9)
    cuts = cut.drawn(400, k=0.1, seed=1)
    g = TIP.receptance(LINES)[:, 0, 0]
    lobes = stability_lobes(cut, LINES, g, speeds_rpm=[6000.0, 9000.0], cuts=cuts)
    assert lobes.draws is not None
    np.testing.assert_allclose(lobes.draws, lobes.depth * 1e9 / np.array([one.k for one in cuts])[:, None], rtol=1e-12)
    expected = lobes.depth * np.exp(-0.1 * stats.norm.ppf(0.95))
    np.testing.assert_allclose(lobes.stable_depth(0.95), expected, rtol=0.03)
    assert {one.teeth for one in CUT.drawn(5, k_t=0.1)} == {3}
    assert len({one.k_n for one in CUT.drawn(5, k_t=0.1)}) == 1


def test_probability_and_depth_are_inverse_functions() -> None:
    cuts = CUT.drawn(200, k_t=0.1, k_n=0.2, seed=2)
    lobes = stability_lobes(CUT, LINES, TIP.receptance(LINES), speeds_rpm=SPEEDS, cuts=cuts)
    for probability in (0.5, 0.9, 0.99):
        depth = lobes.stable_depth(probability)
        assert (lobes.stable_probability(0.999999 * depth) >= probability).all()
        assert (lobes.stable_probability(1.000001 * depth) <= probability).all()
    grid = lobes.stable_probability(np.array([[0.0], [1e-4], [1.0]]))
    assert grid.shape == (3, SPEEDS.size)
    assert (grid[0] == 1.0).all()
    assert (np.diff(grid, axis=0) <= 0.0).all()


def test_recommended_speeds() -> None:
    cuts = CUT.drawn(100, k_t=0.1, k_n=0.1, seed=3)
    # The order of the speeds does not matter.
    speeds = np.random.default_rng(SEED).permutation(SPEEDS)
    lobes = stability_lobes(CUT, LINES, TIP.receptance(LINES), speeds_rpm=speeds, cuts=cuts)
    stable = lobes.stable_depth(0.9)
    found = lobes.recommended(probability=0.9, count=4)
    assert len(found) == 4
    assert (found[0].speed_rpm, found[0].depth) == lobes.best(probability=0.9)
    assert [cut.depth for cut in found] == sorted((cut.depth for cut in found), reverse=True)
    for cut in found:
        around = (speeds >= cut.lowest_rpm) & (speeds <= cut.highest_rpm)
        assert cut.lowest_rpm <= cut.speed_rpm <= cut.highest_rpm
        assert cut.depth == stable[speeds == cut.speed_rpm][0] == stable[around].max()
        assert (stable[around] >= 0.9 * cut.depth).all()
    # Each is on a separate lobe.
    first, second = sorted(found, key=lambda cut: cut.speed_rpm)[:2]
    between = stable[(speeds > first.speed_rpm) & (speeds < second.speed_rpm)].min()
    assert between < 0.85 * min(first.depth, second.depth)
    assert lobes.recommended(probability=None, count=1)[0].depth == lobes.best()[1]


def test_labels_of_recommended_speeds_cover_neither_curves_nor_labels() -> None:
    cuts = CUT.drawn(100, k_t=0.1, k_n=0.1, seed=3)
    lobes = stability_lobes(CUT, LINES, TIP.receptance(LINES), speeds_rpm=SPEEDS, cuts=cuts)
    figure = replace(lobes, probability=0.9, name="three teeth").plot()
    FigureCanvasAgg(figure).draw()
    axes = figure.axes[0]
    boxes = [text.get_window_extent().transformed(axes.transData.inverted()) for text in axes.texts]
    assert len(boxes) == 3
    assert not any(first.overlaps(second) for first, second in itertools.combinations(boxes, 2))
    assert lobes.upper is not None
    for box in boxes:
        speeds = 1e-3 * SPEEDS
        below = 1e3 * lobes.upper[(speeds >= box.x0) & (speeds <= box.x1)]
        assert below.max() < box.y0 < box.y1 < axes.get_ylim()[1]
        assert axes.get_xlim()[0] < box.x0 < box.x1 < axes.get_xlim()[1]


def test_draws_of_a_measured_receptance_have_its_variance() -> None:
    values = TIP.receptance(LINES)
    x = FRF(frequency_hz=LINES, values=values[:, 0, 0], log_variance=0.02**2, correlated_lines=4.0)
    y = FRF(frequency_hz=LINES[50:], values=values[50:, 1, 1], log_variance=0.01**2)
    drawn = np.log(receptance_draws(x, y, draws=60, seed=1)[:, :, [0, 1], [0, 1]] / values[50:, [0, 1], [0, 1]])
    for part in (drawn.real, drawn.imag):
        np.testing.assert_allclose(part.std(axis=(0, 1)), [0.02, 0.01], rtol=0.03)
        for column, alike in ((0, 0.75), (1, 0.0)):
            own = part[:, :, column]
            assert np.mean(own[:, 1:] * own[:, :-1]) / np.mean(own**2) == pytest.approx(alike, abs=0.02)
    assert not receptance_draws(x, y, draws=1)[0, :, 0, 1].any()
    # Lines with unequal correlation, each as stated.
    unequal = x.with_(correlated_lines=np.where(np.arange(LINES.size) < LINES.size // 2, 8.0, 1.0))
    drawn = np.log(receptance_draws(unequal, draws=60, seed=1)[:, :, 0, 0] / values[:, 0, 0]).real
    half = LINES.size // 2
    np.testing.assert_allclose([drawn[:, :half].std(), drawn[:, half:].std()], 0.02, rtol=0.05)
    for own, share in ((drawn[:, :half], 7.0 / 8.0), (drawn[:, half:], 0.0)):
        assert np.mean(own[:, 1:] * own[:, :-1]) / np.mean(own**2) == pytest.approx(share, abs=0.03)


@pytest.mark.slow
def test_the_true_limit_lies_above_the_stable_depth() -> None:
    """Noisy measurements of one tip give a stable depth with at least the stated probability."""
    print(f"seed {SEED}")
    rng = np.random.default_rng(SEED)
    truth = TIP.receptance(LINES)
    speeds = np.array([9200.0, 13000.0, 18500.0])
    limit = stability_lobes(CUT, LINES, truth, speeds_rpm=speeds).depth
    held, cases = np.zeros(3), 40
    for case in range(cases):
        noise = 0.03 * rng.standard_normal((2, 2, LINES.size))
        x, y = (
            FRF(frequency_hz=LINES, values=truth[:, i, i] * np.exp(a + 1j * b), log_variance=0.03**2)
            for i, (a, b) in enumerate(noise)
        )
        matrix = np.stack([x.values[:, 0, 0], y.values[:, 0, 0]], axis=1)[:, :, None] * np.eye(2)
        draws = receptance_draws(x, y, draws=40, seed=case)
        held += limit >= stability_lobes(CUT, LINES, matrix, speeds_rpm=speeds, draws=draws).stable_depth(0.9)
    print(f"truly stable at the depth of 90 %: {held} of {cases}")
    assert stats.binomtest(int(held.min()), cases, 0.9, alternative="less").pvalue > 0.01


def test_modes_drawn_from_estimates() -> None:
    rng = np.random.default_rng(4)
    noise = 0.01 * rng.standard_normal((2, LINES.size))
    values = TIP.receptance(LINES)[:, 0, 0] * np.exp(noise[0] + 1j * noise[1])
    mode = circle_fit(FRF(frequency_hz=LINES, values=values, log_variance=0.01**2))
    drawn = TipModes.drawn_from_estimates([mode], draws=500, seed=1)
    spread = np.std([one.frequency_hz[0] for one in drawn])
    assert spread == pytest.approx(mode.frequency_standard_error_hz, rel=0.15)
    assert np.std([one.damping_ratio[0] for one in drawn]) == pytest.approx(mode.damping_standard_error, rel=0.15)


def test_semi_discretised_limits_of_draws() -> None:
    """The limit of each draw equals that of the full search."""
    cut = Milling(teeth=2, k_t=6e8, k_n=2e8, immersion=0.1)
    rng = np.random.default_rng(5)
    tips = [
        TipModes(frequency_hz=[922.0 * np.exp(0.01 * rng.standard_normal())], damping_ratio=[0.03], shapes=[[5.0, 0.0]])
        for _ in range(20)
    ]
    middle = TipModes(frequency_hz=[922.0], damping_ratio=[0.03], shapes=[[5.0, 0.0]])
    speeds = [15000.0, 25000.0]
    lobes = semi_discretised_lobes(
        cut, middle, speeds_rpm=speeds, most=0.03, draws=tips, cuts=cut.drawn(20, k_t=0.05, seed=1)
    )
    assert lobes.draws is not None
    for i in (0, 7):
        exact = semi_discretised_limit(cut.drawn(20, k_t=0.05, seed=1)[i], tips[i], speeds_rpm=speeds, most=0.03)
        np.testing.assert_allclose(lobes.draws[i], exact, rtol=5e-3)
    assert (lobes.stable_depth(0.9) < lobes.depth).all()
    none = semi_discretised_lobes(cut, middle, speeds_rpm=[25000.0], most=1e-4, cuts=cut.drawn(20))
    assert np.isinf(none.depth).all()
    assert "all depths up to 0.1 mm are stable" in none.notes[0]


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda lobes: lobes.stable_probability([1.0, 2.0]), r"depth has shape \(2,\), expected one number"),
        (lambda _: CUT.drawn(0), "draws is 0, expected a whole number of at least 1"),
        (lambda _: CUT.drawn(5, k_t=-0.1), "the standard deviation of k_t is -0.1"),
        (lambda _: _with_cuts(CUT.drawn(3)), "3 draws, expected at least 20"),
        (lambda _: _with_cuts([Turning(k=1e9)] * 20), "expected the type and the number of teeth"),
        (lambda _: _with_cuts(CUT.drawn(21), [TIP.receptance(LINES)] * 20), "21 cuts and 20 draws"),
        (
            lambda _: receptance_draws(FRF(frequency_hz=LINES, values=TIP.receptance(LINES)[:, 0, 0])),
            "x has no variance, expected an FRF with log_variance",
        ),
    ],
)
def test_invalid_bands(call: Any, words: str) -> None:
    lobes = stability_lobes(CUT, LINES, TIP.receptance(LINES), speeds_rpm=SPEEDS, cuts=CUT.drawn(20))
    with pytest.raises(ValueError, match=words):
        call(lobes)


def _with_cuts(cuts: Any, draws: Any = None) -> Any:
    return stability_lobes(CUT, LINES, TIP.receptance(LINES), speeds_rpm=SPEEDS, cuts=cuts, draws=draws)
