"""The averages of two flutes over a pitch against twisted beams; `-s` prints the table of docs/sections.md."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from oracle import twisted
from receptance import CARBIDE, Assembly, GroundSpring, Part, SectionShape, Segment
from receptance.model.flutes import spread_of_directions

DIAMETER = 0.012
MATERIAL = twisted.Material(CARBIDE.youngs_modulus, CARBIDE.density, CARBIDE.poisson_ratio)
CIRCLE = math.pi * DIAMETER**2 / 4.0, math.pi * DIAMETER**4 / 64.0
HELIX_DEG = 30.0
HALF_PITCH = 0.5 * math.pi * DIAMETER / math.tan(math.radians(HELIX_DEG))
TURNS = (0.5, 1.0, 2.0, 4.0)
SHANKS = (0.0, 2.0)
"""Lengths of the shank over the diameter."""


def pieces(core: float, turns: float, shank: float) -> list[twisted.Piece]:
    """Return flutes with a helix and a shank; the numbers of the section are those of straight flutes."""
    straight = SectionShape.fluted(2, diameter=DIAMETER, core_diameter=core * DIAMETER, straight=True)
    planes = [straight.factors("x"), straight.factors("y")]
    s = MATERIAL.poisson / (1.0 + MATERIAL.poisson)
    kappas = [1.0 / (plane.p0 + plane.p1 * s + plane.p2 * s**2) for plane in planes]
    moments = [CIRCLE[1] * plane.moment for plane in planes]
    flutes = twisted.Piece(
        turns * HALF_PITCH,
        CIRCLE[0] * planes[0].area,
        (moments[0], moments[1]),
        (kappas[0], kappas[1]),
        twist=math.pi * turns,
    )
    return [flutes, *round_piece(shank)]


def round_piece(shank: float) -> list[twisted.Piece]:
    if not shank:
        return []
    nu = MATERIAL.poisson
    kappa = 6.0 * (1.0 + nu) / (7.0 + 6.0 * nu)
    return [twisted.Piece(shank * DIAMETER, CIRCLE[0], (CIRCLE[1], CIRCLE[1]), (kappa, kappa))]


def averaged(core: float, turns: float, shank: float) -> Assembly:
    """Return the same tool in one plane, with the averages."""
    shape = SectionShape.fluted(2, diameter=DIAMETER, core_diameter=core * DIAMETER)
    segments = [Segment(length=turns * HALF_PITCH, outer_diameter=DIAMETER, shape=shape, material=CARBIDE)]
    if shank:
        segments.append(Segment(length=shank * DIAMETER, outer_diameter=DIAMETER, material=CARBIDE))
    clamp = GroundSpring(k_y=1e13, k_theta=1e9, part="tool", position="end")
    return Assembly([Part(segments, name="tool")], [clamp])


def differences(core: float, turns: float, shank: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return compliances over that of the averages, and the frequencies of the first two pairs over theirs."""
    beam, average = pieces(core, turns, shank), averaged(core, turns, shank)
    compliance = average.receptance([1.0])[0].real
    frequency = average.lowest_natural_frequencies(2)[0]
    pairs = twisted.frequencies(beam, MATERIAL, 4).reshape(2, 2)
    return twisted.tip_compliances(beam, MATERIAL) / compliance, pairs / frequency[:, None]


def test_a_beam_without_twist_has_its_closed_form() -> None:
    length, moments = 0.2, (2.0 * CIRCLE[1], CIRCLE[1])
    (bar,) = round_piece(length / DIAMETER)
    flat = twisted.Piece(length, bar.area, moments, bar.kappas, start=0.4)
    shear = MATERIAL.modulus / (2.0 * (1.0 + MATERIAL.poisson)) * bar.area * bar.kappas[0]
    expected = [length**3 / (3.0 * MATERIAL.modulus * moment) + length / shear for moment in moments]
    assert twisted.tip_compliances([flat], MATERIAL) == pytest.approx(expected, rel=1e-9)
    wave = 1.875104068711961
    slender = wave**2 / length**2 * math.sqrt(MATERIAL.modulus * CIRCLE[1] / (MATERIAL.density * bar.area))
    first = twisted.frequencies([bar], MATERIAL, 2)
    assert first == pytest.approx([slender / (2.0 * math.pi)] * 2, rel=5e-3)


def test_half_as_many_elements_give_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    beam = pieces(0.6, 1.5, 2.0)
    fine = twisted.frequencies(beam, MATERIAL, 4), twisted.tip_compliances(beam, MATERIAL)
    monkeypatch.setattr(twisted, "PER_TURN", twisted.PER_TURN // 2)
    monkeypatch.setattr(twisted, "LEAST", twisted.LEAST // 2)
    assert twisted.frequencies(beam, MATERIAL, 4) == pytest.approx(fine[0], rel=1e-3)
    assert twisted.tip_compliances(beam, MATERIAL) == pytest.approx(fine[1], rel=1e-4)


@pytest.mark.parametrize("shank", SHANKS)
@pytest.mark.parametrize("core", [0.5, 0.6, 0.7])
def test_the_averages_are_the_mean_of_both_directions(core: float, shank: float) -> None:
    """The compliance is that of the average over all directions; of one direction it is not, and falls slowly to it."""
    spreads = []
    for turns in TURNS:
        compliances, pairs = differences(core, turns, shank)
        assert compliances.mean() == pytest.approx(1.0, abs=5e-4)
        assert np.mean(pairs[0] ** -2) == pytest.approx(1.0, abs=5e-3)
        spreads.append(compliances[1] - 1.0)
    assert spreads[TURNS.index(4.0)] < spreads[TURNS.index(1.0)]
    # Not even a length of four half pitches averages within one direction.
    assert spreads[-1] > 0.02


@pytest.mark.parametrize("shank", SHANKS)
@pytest.mark.parametrize("core", [0.5, 0.7])
@pytest.mark.parametrize("turns", [0.0, 0.25, 0.5, 1.0, 1.5, 2.0, 4.0])
def test_the_spread_of_directions_is_that_of_the_twisted_beam(core: float, shank: float, turns: float) -> None:
    """In bending alone the formula is exact; shear, which is nearly that of all directions, lessens the spread."""
    flutes, *rest = pieces(core, turns or 1.0, shank)
    flutes = flutes if turns else replace(flutes, twist=0.0)
    estimate = spread_of_directions(flutes.moments, flutes.length, turns, (shank * DIAMETER, CIRCLE[1]))

    def spread(beam: list[twisted.Piece]) -> float:
        stiff, soft = twisted.tip_compliances(beam, MATERIAL)
        return float((soft - stiff) / (soft + stiff))

    assert estimate == pytest.approx(spread([replace(one, kappas=(1e9, 1e9)) for one in (flutes, *rest)]), rel=2e-3)
    assert spread([flutes, *rest]) < 1.001 * estimate


def test_the_table_of_the_documentation() -> None:
    print("\n| core | shank | " + " | ".join(f"{turns:g}" for turns in TURNS) + " |")
    for core in (0.5, 0.6, 0.7):
        for shank in SHANKS:
            cells = []
            for turns in TURNS:
                compliances, pairs = differences(core, turns, shank)
                low, high = 100.0 * (pairs[0] - 1.0)
                second = 100.0 * np.abs(pairs[1] - 1.0).max()
                cells.append(f"{100.0 * (compliances[1] - 1.0):.1f} / {low:.1f}, {high:+.1f} / {second:.1f}")
                assert low < 0.0 < high
            print(f"| {core:g} D | {shank:g} D | " + " | ".join(cells) + " |")
