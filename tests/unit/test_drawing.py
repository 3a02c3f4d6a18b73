"""Contours and outlines that are read from DXF and CSV files."""

from __future__ import annotations

import math
import tempfile
from itertools import pairwise
from pathlib import Path
from random import Random
from typing import Any

import ezdxf
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import drawn_holder
from receptance import drawing
from receptance.drawing import DrawnContour
from receptance.model.contour import Contour

FINE = 1e-6
TOLERANCE = 2e-5


def exact() -> tuple[float, float]:
    """Return volume and centre of gravity of the drawn holder in SI units by the trapezoidal rule."""
    x = np.linspace(0.0, 140.0, 1_400_001)
    outer = np.interp(x, [0.0, 40.0, 64.0], [13.5, 16.5, 16.5])
    fillet = (x > 64.0) & (x < 70.0)
    outer[fillet] = 22.5 - np.sqrt(36.0 - (x[fillet] - 64.0) ** 2)
    outer[(x >= 70.0) & (x <= 90.0)] = 31.5
    behind = x > 90.0
    outer[behind] = np.interp(x[behind], [90.0, 140.0], [20.0, 12.5])
    inner = np.zeros_like(x)
    for bore in drawn_holder.BORES:
        within = (x >= bore[0][0]) & (x <= bore[-1][0])
        inner[within] = np.interp(x[within], *zip(*bore, strict=True))
    area = np.pi * (outer**2 - inner**2)
    volume = float(np.trapezoid(area, x))
    return 1e-9 * volume, 1e-3 * float(np.trapezoid(area * x, x)) / volume


@pytest.mark.parametrize("half", [False, True])
@pytest.mark.parametrize("axis", [0.0, 37.5, -80.0])
def test_the_drawn_holder_is_read(tmp_path: Path, half: bool, axis: float) -> None:
    """As a whole and as a half, and about any line in the layer AXIS."""
    file = drawn_holder.write(tmp_path / "holder.dxf", half=half, axis=axis)
    drawn = drawing.read_contour(file, tolerance=FINE)
    volume, centre = exact()
    assert drawn.contour.volume == pytest.approx(volume, rel=1e-5)
    assert drawn.contour.centre_of_gravity == pytest.approx(centre, rel=1e-5)
    assert drawn.contour.length == pytest.approx(0.14)
    for bore, expected in zip(drawn.contour.bores, drawn_holder.BORES, strict=True):
        assert np.array(bore) == pytest.approx(1e-3 * np.array(expected) * [1.0, 2.0], abs=2e-6)
    text = "\n".join(drawn.assumptions)
    assert 'the profile is that of layer "NOCUT"' in text
    assert 'in layer "AXIS"' in text
    assert ("a half profile" in text) == half
    assert "the tip is assumed at the left" in text


def test_a_default_tolerance_takes_few_pieces(tmp_path: Path) -> None:
    contour = drawing.read_contour(drawn_holder.write(tmp_path / "holder.dxf")).contour
    volume, _ = exact()
    assert len(contour.pieces) < 30
    assert contour.volume == pytest.approx(volume, rel=3e-4)


@pytest.mark.parametrize(("code", "factor"), [(1, 25.4), (4, 1.0), (5, 10.0), (6, 1e3)])
def test_the_unit_is_that_of_the_file(tmp_path: Path, code: int, factor: float) -> None:
    file = drawn_holder.write(tmp_path / "holder.dxf", unit=code)
    drawn = drawing.read_contour(file, tolerance=factor * TOLERANCE)
    assert drawn.contour.length == pytest.approx(0.14 * factor)


def test_a_unit_that_is_missing_is_asked_for(tmp_path: Path) -> None:
    file = drawn_holder.write(tmp_path / "holder.dxf", unit=0)
    with pytest.raises(ValueError, match=r"states no unit .* expected one; give it as `unit`") as caught:
        drawing.read_contour(file)
    assert caught.value.option == "unit"
    drawn = drawing.read_contour(file, unit="mm")
    assert drawn.contour.length == pytest.approx(0.14)
    assert "the unit is mm, as stated; the drawing states none" in drawn.assumptions
    other = drawing.read_contour(drawn_holder.write(tmp_path / "inch.dxf", unit=1), unit="mm")
    assert "the unit is mm, as stated; the drawing states in" in other.assumptions


def test_the_tip_may_be_at_the_other_end(tmp_path: Path) -> None:
    file = drawn_holder.write(tmp_path / "holder.dxf")
    left, right = (drawing.read_contour(file, tip=tip).contour for tip in ("left", "right"))
    assert right.outer[0][1] == pytest.approx(left.outer[-1][1])
    assert right.centre_of_gravity == pytest.approx(left.length - left.centre_of_gravity)
    assert len(right.bores) == len(left.bores)


def saved(document: Any, folder: Path) -> Path:
    path = folder / "drawn.dxf"
    document.saveas(path)
    return path


def drawn(folder: Path, *shapes: Any, unit: int = 4, **options: Any) -> DrawnContour:
    """Return the contour of polylines on layers: (layer, points) pairs, closed if the first point is repeated."""
    document = ezdxf.new("R2010")
    document.header["$INSUNITS"] = unit
    for layer, points in shapes:
        close = len(points) > 2 and points[0] == points[-1]
        corners = points[:-1] if close else points
        document.modelspace().add_lwpolyline(corners, close=close, dxfattribs={"layer": layer})
    return drawing.read_contour(saved(document, folder), **options)


BOX = [(0, 0), (0, 10), (50, 10), (50, 0), (0, 0)]


def test_lines_arcs_splines_and_ellipses_form_one_contour(tmp_path: Path) -> None:
    """Entities in any order and direction; the volumes of the pieces are known."""
    document = ezdxf.new("R2010")
    document.header["$INSUNITS"] = 4
    space = document.modelspace()
    space.add_line((10.0, 0.0), (10.0, 10.0))
    space.add_line((30.0, 10.0), (10.0, 10.0))
    space.add_arc((30.0, 20.0), 10.0, 270.0, 360.0)
    space.add_line((60.0, 20.0), (40.0, 20.0))
    space.add_ellipse((60.0, 0.0), (0.0, 20.0), 0.5, 1.5 * math.pi, 2.0 * math.pi)
    contour = drawing.read_contour(saved(document, tmp_path), tolerance=FINE).contour
    x = np.linspace(30.0, 40.0, 100_001)
    arc = float(np.trapezoid(np.pi * (20.0 - np.sqrt(100.0 - (x - 30.0) ** 2)) ** 2, x))
    ellipse = 2.0 / 3.0 * math.pi * 20.0**2 * 10.0
    whole = 1e-9 * (math.pi * 100.0 * 20.0 + arc + math.pi * 400.0 * 20.0 + ellipse)
    assert contour.volume == pytest.approx(whole, rel=3e-4)
    assert contour.notes  # the far end is a point


def test_a_spline_is_read_within_the_tolerance(tmp_path: Path) -> None:
    document = ezdxf.new("R2010")
    document.header["$INSUNITS"] = 4
    space = document.modelspace()
    # A cubic Bezier curve of a parabola: r = 10 + x^2 / 40.
    space.add_spline().control_points = [(0, 10), (20 / 3, 10), (40 / 3, 10 + 400 / 120), (20, 20)]
    spline = space.query("SPLINE").first
    spline.dxf.degree = 3
    spline.knots = [0, 0, 0, 0, 1, 1, 1, 1]
    for ends in (((0, 0), (0, 10)), ((20, 20), (20, 0))):
        space.add_line(*ends)
    contour = drawing.read_contour(saved(document, tmp_path), tolerance=TOLERANCE).contour
    for x, diameter in contour.outer:
        assert 0.5 * diameter == pytest.approx(0.01 + x**2 / 0.04, abs=2.0 * TOLERANCE)


def test_an_arc_of_ten_thousand_points_is_simplified(tmp_path: Path) -> None:
    angles = np.linspace(0.0, 0.5 * np.pi, 10_000)
    arc = [(30.0 + 20.0 * math.sin(a), 30.0 - 20.0 * math.cos(a)) for a in angles]
    contour = drawn(tmp_path, ("0", [(0, 0), (0, 10), *arc, (80, 30), (80, 0), (0, 0)])).contour
    assert len(contour.pieces) < 40
    x = np.linspace(30.0, 50.0, 100_001)
    flare = float(np.trapezoid(np.pi * (30.0 - np.sqrt(400.0 - (x - 30.0) ** 2)) ** 2, x))
    assert contour.volume == pytest.approx(1e-9 * (flare + np.pi * (100.0 * 30.0 + 900.0 * 30.0)), rel=3e-4)


def test_a_half_section_of_a_wall_has_its_bore(tmp_path: Path) -> None:
    """The hatched area of a section above the axis; with a bore from end to end it does not touch the axis."""
    contour = drawn(tmp_path, ("0", [(0, 4), (0, 10), (30, 12), (30, 4), (0, 4)])).contour
    assert contour.bores == (((0.0, 0.008), (0.03, 0.008)),)
    assert contour.outer == ((0.0, 0.02), (0.03, 0.024))


def test_bores_may_be_closed_contours_in_the_layer_of_the_profile(tmp_path: Path) -> None:
    hole = [(0, -3), (0, 3), (20, 3), (20, -3), (0, -3)]
    body = [(0, -10), (0, 10), (50, 10), (50, -10), (0, -10)]
    contour = drawn(tmp_path, ("0", body), ("0", hole)).contour
    assert contour.bores == (((0.0, 0.006), (0.02, 0.006)),)


def test_cutting_and_other_parts_are_joined(tmp_path: Path) -> None:
    """The common names of layers of tool drawings; the tip is where the cutting part is."""
    cut = [(100, 0), (100, 5), (140, 5), (140, 0), (100, 0)]
    shank = [(0, 0), (0, 6), (100, 6), (100, 0), (0, 0)]
    read = drawn(tmp_path, ("CUT", cut), ("NOCUT", shank))
    assert read.contour.outer == ((0.0, 0.01), (0.04, 0.01), (0.04, 0.012), (0.14, 0.012))
    assert "the tip is at the right, where the layer CUT is" in read.assumptions


def test_visible_edges_and_lines_drawn_twice_are_told(tmp_path: Path) -> None:
    """The lines across a shaft at its shoulders, from contour to contour, are no part of it."""
    document = ezdxf.new("R2010")
    document.header["$INSUNITS"] = 4
    space = document.modelspace()
    for sign in (1.0, -1.0):
        space.add_line((0, 0), (0, sign * 10))
        space.add_line((0, sign * 10), (30, sign * 10))
        space.add_line((30, sign * 20), (60, sign * 20))
        space.add_line((60, sign * 20), (60, 0))
    space.add_line((30, -20), (30, 20))
    space.add_line((0, 10), (30, 10))
    space.add_line((-5, 0), (65, 0))
    read = drawing.read_contour(saved(document, tmp_path))
    assert read.contour.outer == ((0.0, 0.02), (0.03, 0.02), (0.03, 0.04), (0.06, 0.04))
    text = "\n".join(read.assumptions)
    for words in ("edges within the contour", "drawn twice", "1 lines on the axis", "the axis is y = 0 mm"):
        assert words in text


def test_blocks_are_read_with_the_layer_of_their_insertion(tmp_path: Path) -> None:
    document = ezdxf.new("R2010")
    document.header["$INSUNITS"] = 4
    block = document.blocks.new("HOLDER")
    block.add_lwpolyline(BOX[:-1], close=True)
    document.modelspace().add_blockref("HOLDER", (5, 0), dxfattribs={"layer": "NOCUT", "xscale": 2.0, "yscale": 2.0})
    document.modelspace().add_text("DIN 69871")
    read = drawing.read_contour(saved(document, tmp_path))
    assert read.contour.outer == ((0.0, 0.04), (0.1, 0.04))
    assert "entities that are no lines are left out: 1 TEXT" in read.assumptions


@pytest.mark.parametrize("axis", ["y", "x = 0 mm"])
def test_the_axis_may_be_vertical(tmp_path: Path, axis: str) -> None:
    upright = [(y, x) for x, y in [(0, 0), (0, 10), (40, 10), (40, 20), (50, 20), (50, 0), (0, 0)]]
    contour = drawn(tmp_path, ("0", upright), axis=axis).contour
    assert contour.outer == ((0.0, 0.02), (0.04, 0.02), (0.04, 0.04), (0.05, 0.04))
    assert drawn(tmp_path, ("0", upright), axis=axis, tip="top").contour.outer[0] == (0.0, 0.04)


def test_an_inclined_axis_is_followed(tmp_path: Path) -> None:
    angle = math.radians(30.0)
    c, s = math.cos(angle), math.sin(angle)

    def turned(points: list[tuple[float, float]]) -> list[tuple[float, float]]:
        return [(7.0 + c * x - s * y, -3.0 + s * x + c * y) for x, y in points]

    read = drawn(tmp_path, ("0", turned([*BOX])), ("AXIS", turned([(-5, 0), (60, 0)])))
    assert np.array(read.contour.outer) == pytest.approx(np.array([(0.0, 0.02), (0.05, 0.02)]), abs=1e-9)


rows_of_a_profile = st.lists(
    st.tuples(st.floats(0.5, 30.0), st.floats(6.0, 30.0), st.floats(6.0, 30.0)), min_size=1, max_size=8
)


@settings(deadline=None, max_examples=60)
@given(
    rows_of_a_profile,
    st.booleans(),
    st.floats(0.5, 5.5),
    st.floats(-math.pi / 2.0 + 0.01, math.pi / 2.0),
    st.randoms(use_true_random=False),
)
def test_any_profile_is_read_as_it_was_drawn(
    rows: list[tuple[float, float, float]], half: bool, bore: float, angle: float, chance: Random
) -> None:
    """Frusta in a row as single lines in any order and direction, about an axis in any direction."""
    outer: list[tuple[float, float]] = []
    x = 0.0
    for length, near, far in rows:
        outer += [(x, near), (x + length, far)]
        x += length
    wall = [(0.0, 0.0), *outer, (x, 0.0)]
    holes = [(0.0, bore), (0.4 * x, bore), (0.4 * x, 0.0)]
    lines = [(chain, sign) for chain in (wall, [(0.0, 0.0), *holes]) for sign in ((1.0,) if half else (1.0, -1.0))]
    document = ezdxf.new("R2010")
    document.header["$INSUNITS"] = 4
    c, s = math.cos(angle), math.sin(angle)

    def placed(point: tuple[float, float], sign: float) -> tuple[float, float]:
        return 11.0 + c * point[0] - s * sign * point[1], 7.0 + s * point[0] + c * sign * point[1]

    edges = []
    for layer, (chain, sign) in zip(("NOCUT",) * (len(lines) // 2) + ("BORE",) * (len(lines) // 2), lines, strict=True):
        for start, end in pairwise(chain):
            ends = [placed(start, sign), placed(end, sign)]
            chance.shuffle(ends)
            edges.append((layer, ends))
    chance.shuffle(edges)
    for layer, ends in edges:
        document.modelspace().add_line(*ends, dxfattribs={"layer": layer})
    document.modelspace().add_line(placed((0, 0), 1.0), placed((x, 0), 1.0), dxfattribs={"layer": "AXIS"})
    with tempfile.TemporaryDirectory() as folder:
        contour = drawing.read_contour(saved(document, Path(folder)), tolerance=FINE).contour
    metres = [(1e-3 * x, 2e-3 * r) for x, r in outer]
    expected = Contour(metres, [[(1e-3 * x, 2e-3 * r) for x, r in holes[:2]]])
    assert contour.length == pytest.approx(expected.length, abs=1e-8)
    assert contour.volume == pytest.approx(expected.volume, rel=1e-3)
    assert contour.centre_of_gravity == pytest.approx(expected.centre_of_gravity, rel=1e-3)


# CSV ------------------------------------------------------------------------------------------------------------------


def from_csv(folder: Path, text: str, **options: Any) -> DrawnContour:
    file = folder / "drawn.csv"
    file.write_text(text, encoding="utf-8")
    return drawing.read_contour(file, **options)


def test_tables_have_units_arcs_and_bores(tmp_path: Path) -> None:
    rows = ("0,10,,1", "30,10,,1", "40,20,-10,", "60,20,,", "60,15,,0.5", "80,15,,0.5", "")
    text = "# a holder\nx [mm],radius [mm],arc [mm],bore [cm]\n" + "\n".join(rows)
    contour = from_csv(tmp_path, text).contour
    assert contour.bores == (((0.0, 0.01), (0.03, 0.01)), ((0.06, 0.005), (0.08, 0.005)))
    assert contour.outer[0] == (0.0, 0.02)
    assert contour.outer[-1] == (0.08, 0.03)
    assert sum(0.03 < x < 0.04 for x, _ in contour.outer) > 3


def test_a_second_table_has_the_bore(tmp_path: Path) -> None:
    text = "x [in];diameter [mm]\n0;20,5\n2;20,5\n\nx [mm];bore radius [mm]\n0;4\n10;4\n;\n20;3\n30;3\n"
    contour = from_csv(tmp_path, text).contour
    assert contour.outer == ((0.0, 0.0205), (0.0508, 0.0205))
    assert contour.bores == (((0.0, 0.008), (0.01, 0.008)), ((0.02, 0.006), (0.03, 0.006)))


def test_a_table_without_units_needs_one(tmp_path: Path) -> None:
    text = "x,diameter\n0,20\n50,20\n"
    with pytest.raises(ValueError, match='line 1: column "x" has no unit'):
        from_csv(tmp_path, text)
    assert from_csv(tmp_path, text, unit="mm").contour.length == pytest.approx(0.05)


WRONG_TABLES = {
    "x [mm],height [mm]\n0,20\n": 'line 1: column "height [mm]" is no known column',
    "x [mm],diameter [N]\n0,20\n": "line 1",
    "x [mm]\n0\n": "line 1: has",
    "x [mm],diameter [mm],radius [mm]\n0,20,10\n": "line 1: has a diameter and a radius",
    "x [mm],diameter [mm]\n0,20\n30,20\n10,20\n": "line 4: goes back from x = 30 mm to 10 mm",
    "x [mm],diameter [mm]\n0,20\n30,ten\n": 'line 3: diameter is "ten", expected a number',
    "x [mm],diameter [mm]\n0,20\n30\n": "line 3: has 1 cells, expected 2",
    "x [mm],diameter [mm]\n0,20\n50,20\nx [mm],diameter [mm]\n0,20\n": "line 4: begins a second outer profile",
    "x [mm],bore [mm]\n0,20\n50,20\n": "there is no outer profile",
    "x [mm],diameter [mm],bore [mm]\n0,20,30\n50,20,30\n": "at x = 0 mm the outer diameter is 20 mm",
    "0,20\n": "line 1: is no head",
    "": "the file is empty",
}


@pytest.mark.parametrize("text", WRONG_TABLES)
def test_tables_with_mistakes_are_refused_with_their_line(tmp_path: Path, text: str) -> None:
    with pytest.raises(ValueError, match=r"drawn\.csv") as caught:
        from_csv(tmp_path, text)
    assert WRONG_TABLES[text] in str(caught.value)


# Outlines -------------------------------------------------------------------------------------------------------------


def test_an_outline_has_holes(tmp_path: Path) -> None:
    document = ezdxf.new("R2010")
    document.header["$INSUNITS"] = 4
    space = document.modelspace()
    space.add_lwpolyline([(0, 0), (0, 20), (40, 20), (40, 0)], close=True)
    space.add_circle((10, 10), 5)
    shape = drawing.outline(saved(document, tmp_path), tolerance=FINE)
    (hole,) = shape.holes
    assert area(shape.points) == pytest.approx(8e-4)
    assert area(hole) == pytest.approx(-np.pi * 25e-6, rel=1e-3)


def area(points: Any) -> float:
    x, y = np.array(points).T
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


def test_an_outline_in_a_table_has_holes_below_empty_rows(tmp_path: Path) -> None:
    file = tmp_path / "tube.csv"
    file.write_text("x [mm],y [mm]\n0,0\n20,0\n20,20\n0,20\n0,0\n,\n5,5\n5,15\n15,15\n15,5\n")
    shape = drawing.outline(file)
    assert area(shape.points) == pytest.approx(4e-4)
    assert [area(hole) for hole in shape.holes] == pytest.approx([-1e-4])


WRONG_OUTLINES = {
    "0,0\n20,20\n20,0\n0,20\n": "crosses the outline",
    "0,0\n20,0\n20,20\n0,20\n,\n30,5\n30,15\n35,15\n": "is outside of the contour",
    "0,0\n20,0\n": "fewer than three points",
}


@pytest.mark.parametrize("rows", WRONG_OUTLINES)
def test_outlines_with_mistakes_are_refused(tmp_path: Path, rows: str) -> None:
    file = tmp_path / "tube.csv"
    file.write_text(f"x [mm],y [mm]\n{rows}")
    with pytest.raises(ValueError, match=WRONG_OUTLINES[rows]):
        drawing.outline(file)
