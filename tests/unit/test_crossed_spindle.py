"""A spindle whose principal directions are at an angle to x and y, so that two independent planes are coupled."""

from __future__ import annotations

import numpy as np
import pytest

from machine_spindle import LINES, make_blank, make_spindle, seen_at_the_plane, with_spindle
from receptance import Assembly, Coordinate, Observation
from receptance.coupling import identify_crossed_spindle

SPARSE = LINES[::8]
ANGLE = 0.5
TURN = np.array([[np.cos(ANGLE), -np.sin(ANGLE)], [np.sin(ANGLE), np.cos(ANGLE)]])
SPINDLES = [make_spindle(front) for front in (4e8, 2e8)]
PLACES = [Coordinate("blank", 0.0), Coordinate("blank", 0.07)]


def rotate(principal: list[np.ndarray]) -> np.ndarray:
    """Return receptances in x and y, `(2, 2, n, ...)`, from those in the two principal directions."""
    return np.einsum("ap,p...,bp->ab...", TURN, np.array(principal), TURN)


def truth() -> np.ndarray:
    parts = rotate([seen_at_the_plane(one, SPARSE) for one in SPINDLES])
    return np.moveaxis(parts, 2, 0).transpose(0, 1, 3, 2, 4).reshape(SPARSE.size, 4, 4)


def measure(sd: float, rng: np.random.Generator | None = None, cross: str = "xy") -> dict[str, list[Observation]]:
    blank = make_blank()
    h = rotate([with_spindle(blank, one).receptance(SPARSE, response=PLACES, excitation=PLACES) for one in SPINDLES])
    found: dict[str, list[Observation]] = {}
    for axes in ("xx", "yy", cross):
        for i, response in enumerate(PLACES):
            for j, excitation in enumerate(PLACES):
                if axes != cross and i < j:
                    continue
                values = h["xy".index(axes[0]), "xy".index(axes[1]), :, i, j]
                if rng is not None:
                    values = values * np.exp(sd * (rng.normal(size=SPARSE.size) + 1j * rng.normal(size=SPARSE.size)))
                one = Observation(
                    assembly=blank,
                    frequency_hz=SPARSE,
                    receptance=values,
                    response=response,
                    excitation=excitation,
                    standard_deviation=sd,
                )
                found.setdefault(axes, []).append(one)
    return found


@pytest.mark.parametrize("cross", ["xy", "yx"])
def test_both_planes_are_recovered_without_noise(cross: str) -> None:
    found = identify_crossed_spindle(measure(1e-9, cross=cross))
    assert found.usable.all()
    root = np.sqrt(np.abs(np.einsum("nii->ni", truth())))
    assert np.max(np.abs(found.matrix - truth()) / (root[:, :, None] * root[:, None, :])) < 1e-8
    np.testing.assert_allclose(found.matrix, found.matrix.transpose(0, 2, 1), rtol=1e-9, atol=1e-16)
    assert "usable" in repr(found)


def test_tip_receptance_equals_that_of_the_machine() -> None:
    tool = make_blank(0.15, 0.02)
    lines, tip, deviation = identify_crossed_spindle(measure(1e-9)).tip(tool)
    true = rotate([with_spindle(tool, one).receptance(SPARSE) for one in SPINDLES])
    np.testing.assert_allclose(tip, np.moveaxis(true, 2, 0), rtol=1e-6, atol=1e-9 * np.abs(true).max())
    assert lines.size == SPARSE.size
    assert np.all(deviation <= 1e-5 * np.abs(tip).max(axis=(1, 2))[:, None, None])


def test_missing_data_are_reported() -> None:
    whole = measure(1e-3)
    with pytest.raises(ValueError, match="there are 0 responses of xy, expected at least 4"):
        identify_crossed_spindle({axis: whole[axis] for axis in ("xx", "yy")})
    with pytest.raises(ValueError, match="there are 2 responses of yy, expected at least 3"):
        identify_crossed_spindle({**whole, "yy": whole["yy"][:2]})
    with pytest.raises(ValueError, match="has the direction 'xz', expected one of xx, yy, xy, yx"):
        identify_crossed_spindle({**whole, "xz": whole["xy"]})
    with pytest.raises(ValueError, match="of xx do not determine"):
        identify_crossed_spindle({**whole, "xx": [whole["xx"][0]] * 3})
    other = make_blank(0.12)
    strange = [
        Observation(
            assembly=Assembly(other.elements.values()),
            frequency_hz=SPARSE,
            receptance=one.receptance,
            response=one.response,
            excitation=one.excitation,
            standard_deviation=1e-3,
        )
        for one in whole["yy"]
    ]
    with pytest.raises(ValueError, match="expected one blank"):
        identify_crossed_spindle({**whole, "yy": strange})
