"""Cuts, tip modes and lobes: errors and notes."""

from __future__ import annotations

import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from receptance import FRF
from receptance.modal import circle_fit
from receptance.stability import (
    Milling,
    TipModes,
    Turning,
    floquet_multiplier,
    operating_point,
    receptance_matrix,
    rotated_receptance,
    semi_discretised_limit,
    stability_lobes,
)
from receptance.sweep import StableDepth

SEED = 20261121
TIP = TipModes(frequency_hz=[922.0, 1400.0], damping_ratio=[0.011, 0.02], shapes=[[5.0, 0.0], [0.0, 4.0]])
CUT = Milling(teeth=3, k_t=6e8, k_n=2e8, immersion=0.5, feed="up")
LINES = np.arange(500.0, 2500.0, 1.0)
SPEEDS = np.arange(4000.0, 30000.0, 100.0)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"teeth": 0}, "teeth is 0, expected a whole number from 1 to 1000"),
        ({"teeth": 2.5}, "teeth is 2.5"),
        ({"k_t": -6e8}, "k_t is -6e"),
        ({"k_n": -1.0}, "k_n is -1"),
        ({"immersion": 1.2}, "immersion is 1.2, expected more than zero and at most 1"),
        ({"immersion": 0.0}, "immersion is 0"),
        ({"feed": "climb"}, "feed is 'climb', expected one of down, up"),
        ({"helix_deg": 30.0}, "diameter is None, expected the diameter of the cutter, from which the lag of a helix"),
        ({"helix_deg": 80.0, "diameter": 0.01}, r"helix_deg\[0\] is 80, expected at least -75 and at most 75 deg"),
        (
            {"helix_deg": (10.0, 20.0, 30.0), "diameter": 0.01},
            "helix_deg has 3 angles, expected 2, one for each of the",
        ),
        ({"pitch_deg": (170.0, 180.0)}, "the sum of pitch_deg is 350 degrees, expected 360"),
        ({"pitch_deg": (2.0, 358.0)}, r"pitch_deg\[0\] is 2, expected at least 5 and at most 360 deg"),
    ],
)
def test_invalid_cuts(changes: dict[str, Any], words: str) -> None:
    with pytest.raises((ValueError, TypeError), match=words):
        Milling(**{"teeth": 2, "k_t": 6e8, "k_n": 2e8, **changes})


def test_turning_errors() -> None:
    with pytest.raises(ValueError, match="angle_deg is 90, expected between"):
        Turning(k=1e9, angle_deg=90.0)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"damping_ratio": [0.0, 0.1]}, r"damping_ratio\[0\] is 0, expected between 0 and 1"),
        ({"frequency_hz": [100.0, -1.0]}, r"frequency_hz\[1\] is -1"),
        ({"shapes": [[1.0, np.nan], [0.0, 1.0]]}, r"shapes\[0, 1\] is nan, expected finite"),
        ({"shapes": [[1.0, 1.0]]}, r"expected \(k,\), \(k,\) and \(k, 2\)"),
    ],
)
def test_invalid_modes(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        TipModes(**{"frequency_hz": [1.0, 2.0], "damping_ratio": [0.1, 0.1], "shapes": np.eye(2), **changes})


def test_lobes_from_measured_frfs() -> None:
    values = TIP.receptance(LINES)
    x = FRF(frequency_hz=LINES, values=values[:, 0, 0])
    y = FRF(frequency_hz=LINES[100:], values=values[100:, 1, 1]).to("accelerance")
    f, matrix = receptance_matrix(x, y)
    assert f.size == LINES.size - 100
    np.testing.assert_allclose(matrix, values[100:], rtol=1e-12, atol=1e-20)
    lobes = stability_lobes(CUT, f, matrix, speeds_rpm=SPEEDS)
    speed, depth = lobes.best()
    assert depth == lobes.depth[np.isfinite(lobes.depth)].max()
    assert speed in SPEEDS
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(lobes)).depth, lobes.depth)


@pytest.mark.parametrize(
    ("x", "words"),
    [
        (None, "x and y are both None"),
        (FRF(frequency_hz=LINES, values=np.ones((LINES.size, 2, 1))), r"x has entries \(2, 1\)"),
        (FRF(frequency_hz=LINES, values=TIP.receptance(LINES)[:, 0, 0], decay_rate=5.0), "exponential window of 5"),
    ],
)
def test_unsuitable_frfs(x: FRF | None, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        receptance_matrix(x)


def test_mismatched_lines() -> None:
    x = FRF(frequency_hz=LINES, values=TIP.receptance(LINES)[:, 0, 0])
    y = FRF(frequency_hz=LINES + 0.25, values=TIP.receptance(LINES)[:, 1, 1])
    with pytest.raises(ValueError, match="y shares 0 lines with the other FRFs"):
        receptance_matrix(x, y)


def test_modes_from_estimates() -> None:
    x = FRF(frequency_hz=LINES, values=TIP.receptance(LINES)[:, 0, 0])
    found = TipModes.from_estimates([circle_fit(x)])
    np.testing.assert_allclose(found.shapes, [[5.0, 0.0]], rtol=1e-6)
    assert found.frequency_hz[0] == pytest.approx(922.0)


def test_bands_from_draws() -> None:
    """The share of further draws with a limit above the stable depth is close to the stated probability."""
    print(f"seed {SEED}")
    rng = np.random.default_rng(SEED)

    def drawn() -> Any:
        shift = 1.0 + 0.01 * rng.normal(size=2)
        return TipModes(
            frequency_hz=TIP.frequency_hz * shift, damping_ratio=TIP.damping_ratio, shapes=TIP.shapes
        ).receptance(LINES)

    speeds = SPEEDS[::20]
    lobes = stability_lobes(CUT, LINES, TIP.receptance(LINES), speeds_rpm=speeds, draws=[drawn() for _ in range(200)])
    assert lobes.lower is not None
    assert lobes.upper is not None
    assert (lobes.lower <= lobes.upper).all()
    safe = lobes.stable_depth(0.9)
    more = np.array([stability_lobes(CUT, LINES, drawn(), speeds_rpm=speeds).depth for _ in range(150)])
    share = np.mean(more >= safe, axis=0)
    assert abs(share.mean() - 0.9) < 0.04, share
    assert lobes.best(probability=0.9)[1] <= lobes.best()[1]
    with pytest.raises(ValueError, match="there are 200 draws, expected at least 1000"):
        lobes.stable_depth(0.999)
    figure = replace(lobes, probability=0.9, name="three teeth").plot()
    assert [axes.get_ylabel() for axes in figure.axes] == ["depth of cut (mm)", "chatter (Hz)"]
    # The order of the speeds does not matter.
    turned = stability_lobes(CUT, LINES, TIP.receptance(LINES), speeds_rpm=speeds[::-1])
    np.testing.assert_array_equal(turned.depth[::-1], lobes.depth)


def test_invalid_lobes_and_notes() -> None:
    values = TIP.receptance(LINES)
    with pytest.raises(ValueError, match="there are no draws"):
        stability_lobes(CUT, LINES, values, speeds_rpm=SPEEDS).stable_depth()
    with pytest.raises(ValueError, match="3 draws, expected at least 20"):
        stability_lobes(CUT, LINES, values, speeds_rpm=SPEEDS, draws=[values] * 3)
    with pytest.raises(ValueError, match=r"receptance has shape \(5, 2, 2\)"):
        stability_lobes(CUT, LINES, values[:5], speeds_rpm=SPEEDS)
    with pytest.raises(ValueError, match="speeds_rpm must be finite and more than zero"):
        stability_lobes(CUT, LINES, values, speeds_rpm=[0.0])
    values[7] = np.nan
    with pytest.raises(ValueError, match="receptance is not finite at line 7"):
        stability_lobes(CUT, LINES, values, speeds_rpm=SPEEDS)
    below = LINES[LINES < 900.0]
    lobes = stability_lobes(CUT, below, TIP.receptance(below), speeds_rpm=SPEEDS)
    assert np.isnan(lobes.depth).all()
    assert [line[:64] for line in lobes.rejection] == [
        f"the magnitude of the tip in {axis} rises to the last of the lines, at" for axis in "xy"
    ]


def test_rotation_of_a_tip() -> None:
    """Identity at 0, exchange at 90 degrees, and between them the tensor of a tip that is flexible in one direction."""
    both = TIP.receptance(LINES)
    np.testing.assert_allclose(rotated_receptance(both, 0.0), both, rtol=1e-15)
    np.testing.assert_allclose(rotated_receptance(both, 90.0), both[:, ::-1, ::-1], rtol=1e-12, atol=1e-20)
    one = TipModes(frequency_hz=[922.0], damping_ratio=[0.011], shapes=[[5.0, 0.0]])
    direction = np.array([np.cos(np.pi / 6.0), np.sin(np.pi / 6.0)])
    expected = one.receptance(LINES)[:, :1, :1] * np.outer(direction, direction)
    np.testing.assert_allclose(rotated_receptance(one.receptance(LINES), 30.0), expected, rtol=1e-12)
    np.testing.assert_allclose(one.rotated(30.0).receptance(LINES), expected, rtol=1e-12)
    with pytest.raises(ValueError, match=r"receptance has shape \(2000,\), expected \(..., 2, 2\)"):
        rotated_receptance(both[:, 0, 0], 30.0)
    with pytest.raises(ValueError, match="rotation_deg is nan"):
        rotated_receptance(both, np.nan)


def test_teeth_with_different_delays_have_no_limit_by_the_mean_force() -> None:
    uneven = replace(CUT, pitch_deg=(100.0, 125.0, 135.0))
    twisted = replace(CUT, helix_deg=(30.0, 32.0, 34.0), diameter=0.01)
    for cut, words in ((uneven, "pitch_deg differs between teeth"), (twisted, "helix_deg differs between teeth")):
        with pytest.raises(ValueError, match=f"{words}.*expected equal teeth, or semi_discretised_lobes"):
            stability_lobes(cut, LINES, TIP.receptance(LINES), speeds_rpm=SPEEDS)
        with pytest.raises(ValueError, match=words):
            StableDepth(cut=cut, frequency_hz=LINES)
    # Equal angles are those of a cutter without them; one helix of all teeth changes neither mean nor delay.
    equal = replace(CUT, pitch_deg=(120.0,) * 3)
    assert equal == CUT
    same = replace(CUT, helix_deg=(30.0,) * 3, diameter=0.01)
    assert same.helix_deg == 30.0
    limits = [stability_lobes(c, LINES, TIP.receptance(LINES), speeds_rpm=SPEEDS).depth for c in (CUT, same)]
    np.testing.assert_array_equal(*limits)


def test_semi_discretisation_errors() -> None:
    with pytest.raises(ValueError, match="expected a whole number from 4 to 2000; use stability_lobes"):
        floquet_multiplier(CUT, TIP, speed_rpm=50.0, depth=1e-3)
    with pytest.raises(ValueError, match="expected finite depths in m, zero or more"):
        floquet_multiplier(CUT, TIP, speed_rpm=5000.0, depth=-1e-3)
    with pytest.raises(ValueError, match="most is 0"):
        semi_discretised_limit(CUT, TIP, speeds_rpm=5000.0, most=0.0)


def test_without_a_cut_the_structure_decays() -> None:
    """The multiplier is that of the mode with the slowest decay over a tooth period."""
    found = floquet_multiplier(CUT, TIP, speed_rpm=6000.0, depth=0.0)
    slowest = np.min(TIP.damping_ratio * 2.0 * np.pi * TIP.frequency_hz)
    np.testing.assert_allclose(found, np.exp(-slowest * 60.0 / (3 * 6000.0)), rtol=1e-9)


def test_an_operating_point_has_the_limit_of_the_nearest_speed() -> None:
    tip = TipModes(frequency_hz=[922.0], damping_ratio=[0.011], shapes=[[0.03993**-0.5, 0.0]])
    lines, speeds = np.arange(800.0, 1200.0, 0.5), np.arange(4000.0, 12000.0, 100.0)
    cut = Milling(teeth=2, k_t=6e8, k_n=2e8)
    exact = stability_lobes(cut, lines, tip.receptance(lines), speeds_rpm=speeds)
    draws = [factor * tip.receptance(lines) for factor in np.linspace(0.9, 1.1, 40)]
    banded = stability_lobes(cut, lines, tip.receptance(lines), speeds_rpm=speeds, draws=draws)
    index = 17
    depth = 0.99 * float(exact.depth[index])
    point = operating_point(exact, speeds[index] + 30.0, depth)
    assert (point.speed_rpm, point.limit) == (speeds[index], exact.depth[index])
    assert point.probability is None
    assert point.band is None
    assert ": stable; limit" in str(point)
    assert ": chatter; limit" in str(operating_point(exact, speeds[index], 1.02 * point.limit))
    uncertain = operating_point(banded, speeds[index], depth)
    assert uncertain.probability == banded.stable_probability(depth)[index]
    assert uncertain.band == (banded.lower[index], banded.upper[index])
    assert f"stable with {100.0 * uncertain.probability:.3g} %" in str(uncertain)


def test_where_no_limit_is_known_an_operating_point_says_so() -> None:
    # The lines end below the mode.
    tip = TipModes(frequency_hz=[922.0], damping_ratio=[0.011], shapes=[[0.03993**-0.5, 0.0]])
    lines = np.arange(400.0, 900.0, 1.0)
    cut = Milling(teeth=2, k_t=6e8, k_n=2e8)
    lobes = stability_lobes(cut, lines, tip.receptance(lines), speeds_rpm=[5000.0, 6000.0])
    assert not lobes.has_limits
    assert str(operating_point(lobes, 5200.0, 1e-3)) == "5000 rpm, 1.00 mm: no limit is known"
