"""Contours: pieces, volumes and centres of gravity in closed form, and profiles that are none."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from receptance import STEEL, Part
from receptance.model.contour import MOST_PIECES, Contour

BALL = 0.01


def turned_volume(points: list[tuple[float, float]], count: int = 200_001) -> tuple[float, float]:
    """Return volume and centre of gravity by the trapezoidal rule, of a profile without steps."""
    x = np.linspace(points[0][0], points[-1][0], count)
    area = 0.25 * np.pi * np.interp(x, *zip(*points, strict=True)) ** 2
    volume = float(np.trapezoid(area, x))
    return volume, float(np.trapezoid(area * x, x)) / volume


lengths = st.floats(1e-4, 0.2)


@given(st.lists(st.tuples(lengths, st.floats(0.01, 0.1), st.floats(0.001, 0.009)), min_size=2, max_size=8))
def test_volume_and_centre_of_gravity_are_those_of_the_integrals(rows: list[tuple[float, float, float]]) -> None:
    x = np.cumsum([length for length, _, _ in rows]).tolist()
    outer = [(place, diameter) for place, (_, diameter, _) in zip(x, rows, strict=True)]
    bore = [(place, diameter) for place, (_, _, diameter) in zip(x, rows, strict=True)]
    contour = Contour(outer, [bore])
    (body, centre), (hole, hole_centre) = turned_volume(outer), turned_volume(bore)
    assert contour.volume == pytest.approx(body - hole, rel=1e-6)
    moment = (body * centre - hole * hole_centre) / (body - hole)
    assert contour.centre_of_gravity == pytest.approx(moment - x[0], rel=1e-6)
    assert contour.length == pytest.approx(x[-1] - x[0])


@given(st.floats(0.002, 0.05), st.floats(1e-6, 1e-4))
def test_arcs_are_within_the_tolerance(radius: float, tolerance: float) -> None:
    """A quarter of a circle that bulges outwards, and one that bulges inwards."""
    start, end = (0.0, 0.02), (radius, 0.02 + 2.0 * radius)
    for side, centre in ((1.0, (radius, 0.01)), (-1.0, (0.0, 0.01 + radius))):
        contour = Contour([start, (*end, side * radius), (radius + 0.01, end[1])], tolerance=tolerance)
        chain = [(x, 0.5 * diameter) for x, diameter in contour.outer if x <= radius]
        for (x0, r0), (x1, r1) in pairwise(chain):
            corners = [math.hypot(x0 - centre[0], r0 - centre[1]), math.hypot(x1 - centre[0], r1 - centre[1])]
            middle = math.hypot(0.5 * (x0 + x1) - centre[0], 0.5 * (r0 + r1) - centre[1])
            assert corners == pytest.approx([radius, radius], rel=1e-9)
            assert radius - middle <= tolerance * (1.0 + 1e-6)


def test_a_half_profile_is_the_same_contour() -> None:
    outer, bore = [(0.0, 0.02), (0.05, 0.04)], [(0.0, 0.01), (0.02, 0.0)]
    halves = [[(x, 0.5 * d) for x, d in chain] for chain in (outer, bore)]
    assert Contour(halves[0], halves[1:], radii=True) == Contour(outer, [bore])


def test_pieces_end_where_the_profile_or_a_bore_changes() -> None:
    bores = [[(0.0, 0.01), (0.03, 0.01)], [(0.05, 0.0), (0.06, 0.02)]]
    contour = Contour([(0.0, 0.03), (0.02, 0.03), (0.02, 0.05), (0.06, 0.07)], bores)
    assert [round(1e3 * piece.start) for piece in contour.pieces] == [0, 20, 30, 50]
    diameters = [(piece.outer_diameter, piece.end_outer_diameter) for piece in contour.pieces]
    assert np.ravel(diameters) == pytest.approx([0.03, 0.03, 0.05, 0.055, 0.055, 0.065, 0.065, 0.07])
    assert [piece.end_inner_diameter for piece in contour.pieces] == [0.01, 0.01, 0.0, 0.02]


def test_a_ball_nose_has_a_small_face_instead_of_its_point() -> None:
    contour = Contour([(0.0, 0.0), (0.5 * BALL, BALL, 0.5 * BALL), (0.03, BALL)], tolerance=1e-7)
    (note,) = contour.notes
    assert "the tip-side end is a point" in note
    assert contour.pieces[0].outer_diameter == pytest.approx(0.2 * BALL)
    whole = np.pi / 4.0 * BALL**2 * (0.03 - 0.5 * BALL) + 2.0 / 3.0 * np.pi * (0.5 * BALL) ** 3
    assert contour.volume == pytest.approx(whole, rel=2e-4)
    back = Contour([(0.0, BALL), (0.03 - 0.5 * BALL, BALL), (0.03, 0.0, 0.5 * BALL)], tolerance=1e-7)
    assert back.volume == pytest.approx(contour.volume, rel=1e-9)
    assert back.centre_of_gravity == pytest.approx(contour.length - contour.centre_of_gravity, rel=1e-9)


def test_a_part_has_the_pieces_and_the_mass_of_its_contour() -> None:
    contour = Contour(
        [(0.0, 0.02), (0.05, 0.03), (0.05, 0.06), (0.07, 0.06)], [[(0.01, 0.0), (0.03, 0.01), (0.07, 0.02)]]
    )
    part = Part.from_contour(contour, material=STEEL, name="holder")
    assert part.mass == pytest.approx(STEEL.density * contour.volume, rel=1e-12)
    assert part.length == pytest.approx(contour.length)
    assert [segment.length for segment in part.segments] == [piece.length for piece in contour.pieces]
    assert part.segments[-1].end_outer_diameter is None
    assert part == Part.from_contour(contour.outer, contour.bores, material=STEEL)


WRONG = {
    "back": ([(0.0, 0.02), (0.03, 0.02), (0.01, 0.02)], [], "outer[2] goes back from x = 30 mm to 10 mm"),
    "length": ([(0.01, 0.02), (0.01, 0.03)], [], "outer has no length: it begins and ends at x = 10 mm"),
    "one point": ([(0.0, 0.02)], [], "outer has 1 points, expected two or more"),
    "negative": ([(0.0, 0.02), (0.1, -0.02)], [], "outer[1] has the diameter -20 mm, expected zero or more"),
    "not finite": ([(0.0, 0.02), (0.1, math.nan)], [], "expected finite numbers"),
    "in two": ([(0.0, 0.02), (0.1, 0.0), (0.2, 0.02)], [], "outer has the diameter 0 at x = 100 mm"),
    "nothing": ([(0.0, 0.0), (0.1, 0.0)], [], "outer has no diameter above zero"),
    "bore too large": (
        [(0.0, 0.02), (0.1, 0.02)], [[(0.0, 0.01), (0.05, 0.01), (0.05, 0.03), (0.1, 0.03)]],
        "at x = 50 mm the outer diameter is 20 mm and that of the bore 30 mm, expected a bore that is smaller",
    ),
    "bore outside": (
        [(0.0, 0.02), (0.1, 0.02)], [[(-0.01, 0.01), (0.05, 0.01)]], "bores[0] is from x = -10 mm to 50 mm",
    ),
    "bores overlap": (
        [(0.0, 0.02), (0.1, 0.02)], [[(0.0, 0.01), (0.05, 0.01)], [(0.04, 0.008), (0.1, 0.008)]],
        "bores[1] begins at x = 40 mm, where bores[0], which ends at 50 mm, still is",
    ),
    "short arc": ([(0.0, 0.02), (0.1, 0.02, 0.03)], [], "outer[1] ends an arc of the radius 30 mm, but its ends"),
    "undercut": ([(0.0, 0.02), (0.0, 0.04, -0.006)], [], "that goes back at x"),
    "unit": ([(0.0, 30.0), (50.0, 40.0, 80.0), (60.0, 40.0)], [], "give lengths in metres, not in millimetres"),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_profiles_with_mistakes_are_refused_with_their_place(case: str) -> None:
    outer, bores, words = WRONG[case]
    with pytest.raises(ValueError, match=r".") as caught:
        Contour(outer, bores)
    assert words in str(caught.value)


def test_a_point_that_is_none_is_refused() -> None:
    with pytest.raises(TypeError, match=r"outer\[1\] is .* expected a point"):
        Contour([(0.0, 0.02), "end"])


def test_too_many_pieces_are_refused() -> None:
    points = [(1e-4 * index, 0.02 + 1e-4 * (index % 2)) for index in range(MOST_PIECES + 2)]
    with pytest.raises(ValueError, match=f"has {MOST_PIECES + 1} pieces, expected at most {MOST_PIECES}"):
        Contour(points)
