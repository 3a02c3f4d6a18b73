"""Segments and parts: invalid input, messages, and computed values."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from receptance import CARBIDE, STEEL, Assembly, Part, ReceptanceWarning, ResonanceError, Segment

GOOD: dict[str, Any] = {"length": 0.1, "outer_diameter": 0.05, "inner_diameter": 0.02, "material": STEEL}
BAR = Segment(length=0.1, outer_diameter=0.02, material=STEEL)


@pytest.mark.parametrize(
    ("quantity", "value", "words"),
    [
        ("length", 0.0, "length is 0, expected more than zero m"),
        ("length", float("nan"), "length is nan, expected a finite number of m"),
        ("inner_diameter", -0.01, "inner_diameter is -0.01, expected zero or more m"),
        ("inner_diameter", 0.05, "inner_diameter is 0.05 m, expected less than the outer diameter 0.05 m"),
        ("shear", "euler", "shear is 'euler', expected one of cowper, hutchinson"),
    ],
)
def test_errors_name_invalid_values(quantity: str, value: object, words: str) -> None:
    with pytest.raises(ValueError, match=f"Segment: {words}"):
        Segment(**{**GOOD, quantity: value})


def test_a_core_needs_a_bore() -> None:
    with pytest.raises(ValueError, match="core is given and inner_diameter is 0"):
        Segment(length=0.1, outer_diameter=0.05, material=STEEL, core=CARBIDE)


def test_masses_and_lengths() -> None:
    tube = Segment(**GOOD)
    assert tube.mass == pytest.approx(7850.0 * np.pi / 4 * (0.05**2 - 0.02**2) * 0.1)
    filled = replace(tube, core=CARBIDE)
    assert filled.mass == pytest.approx(tube.mass + CARBIDE.density * np.pi / 4 * 0.02**2 * 0.1)
    part = Part([tube, filled, BAR])
    assert part.mass == pytest.approx(tube.mass + filled.mass + BAR.mass)
    assert part.length == pytest.approx(0.3)


def test_a_core_of_the_same_material_is_a_solid() -> None:
    f = [10.0, 3000.0, 20e3]
    # Not the whole matrix: the shear coefficient of a ring with a core is the sum of two, not that of a solid.
    slender = [Segment(length=1.0, outer_diameter=0.01, inner_diameter=inner, material=STEEL, core=core)
               for inner, core in ((0.005, STEEL), (0.0, None))]  # fmt: skip
    found, expected = (Assembly([Part([segment])]).receptance(f[:1])[0] for segment in slender)
    assert found == pytest.approx(expected, rel=1e-3)
    axial, solid = (Assembly([Part([segment])], motion="axial").receptance(f) for segment in slender)
    np.testing.assert_allclose(axial, solid, rtol=1e-12)


def test_the_shear_models_differ_a_little() -> None:
    thick = Segment(length=0.05, outer_diameter=0.05, material=STEEL)
    f = Assembly([Part([thick])]).natural_frequencies(60e3)[0]
    g = Assembly([Part([replace(thick, shear="hutchinson")])]).natural_frequencies(60e3)[0]
    assert f != g
    assert f == pytest.approx(g, rel=0.02)


@pytest.mark.parametrize(
    ("segments", "error", "words"),
    [
        ([], ValueError, "Part: segments is empty, expected at least one Segment"),
        (["bar"], TypeError, r"Part: segments\[0\] is 'bar', expected a Segment"),
        ([BAR, STEEL], TypeError, r"Part: segments\[1\] is "),
        ([BAR, None], TypeError, r"Part: segments\[1\] is None"),
    ],
)
def test_parts_are_made_of_segments(segments: list[Any], error: type[Exception], words: str) -> None:
    with pytest.raises(error, match=words):
        Part(segments)
    with pytest.raises(error, match=words.replace("Part", "Part 'tool'")):
        Part(segments, name="tool")


def test_one_segment_needs_no_list() -> None:
    assert Part(BAR) == Part([BAR]) == Part(iter((BAR,)), name="other")


def test_receptance_at_an_exact_resonance_is_finite() -> None:
    """A lossless rod at half a wave: its float64 frequency has a rounding error, which the message states."""
    rod = Assembly([Part([BAR])], motion="axial")
    f = np.sqrt(STEEL.youngs_modulus / STEEL.density) / (2 * BAR.length)
    at, beside = np.abs(rod.receptance([f, 1.001 * f]))
    assert np.all(np.isfinite(at))
    assert at.min() > 1e9 * beside.max()


def test_a_receptance_that_overflows_is_a_resonance_error() -> None:
    """At 1e-200 Hz a free body moves more than any float64 holds: an error, not an infinity."""
    with pytest.raises(ResonanceError, match="not finite"):
        Assembly([Part([BAR])]).receptance([1e-200])


@pytest.mark.parametrize(("quantity", "value"), [("length", 62.3), ("outer_diameter", 12.7)])
def test_dimensions_in_millimetres_raise_a_warning(quantity: str, value: float) -> None:
    with pytest.warns(ReceptanceWarning, match=f"{quantity} is {value:g} m.*millimetres"):
        Segment(**({"length": 0.1, "outer_diameter": 0.02, "material": STEEL} | {quantity: value}))
