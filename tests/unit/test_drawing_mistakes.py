"""DXF files that show no body of revolution, or are no drawing of a part: the entity, the layer and the place."""

from __future__ import annotations

import time
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import ezdxf
import pytest

from receptance import drawing
from receptance.drawing.dxf_entities import LARGEST_FILE, MOST_ENTITIES
from receptance.io import FileFormatError

BOX = [(0, 0), (0, 10), (50, 10), (50, 0)]
WHOLE = [(0, -10), (0, 10), (50, 10), (50, -10)]


def error_of(folder: Path, draw: Callable[[Any], None], *, stated: int = 4, **options: Any) -> str:
    """Return the message for a drawing that a function fills."""
    document = ezdxf.new("R2010")
    document.header["$INSUNITS"] = stated
    draw(document.modelspace())
    file = folder / "drawn.dxf"
    document.saveas(file)
    with pytest.raises(FileFormatError) as caught:
        drawing.read_contour(file, **options)
    text = str(caught.value)
    assert text.startswith("drawn.dxf")
    return text


def on(layer: str) -> dict[str, dict[str, str]]:
    return {"dxfattribs": {"layer": layer}}


def open_contour(space: Any) -> None:
    for start, end in (((0, 0), (0, 10)), ((0, 10), (50, 10)), ((50.3, 9.6), (50.3, 0))):
        space.add_line(start, end, **on("NOCUT"))


def crossing(space: Any) -> None:
    space.add_lwpolyline([(0, 0), (0, 10), (40, 20), (40, 10), (10, 20), (50, 15), (50, 0)], **on("NOCUT"))


def several(space: Any) -> None:
    space.add_lwpolyline([(0, -10), (0, 10), (50, 10), (50, -10)], close=True, **on("NOCUT"))
    space.add_lwpolyline([(20, 20), (20, 40), (70, 40), (70, 20)], close=True, **on("NOCUT"))
    space.add_lwpolyline([(20, -20), (20, -40), (70, -40), (70, -20)], close=True, **on("NOCUT"))


def in_a_row(space: Any) -> None:
    space.add_lwpolyline(BOX, close=True, **on("NOCUT"))
    space.add_lwpolyline([(x + 80, y) for x, y in BOX], close=True, **on("NOCUT"))


def unsymmetric(space: Any) -> None:
    space.add_lwpolyline([(0, -10), (0, 10), (50, 10), (50, -12), (20, -12), (20, -10)], close=True, **on("NOCUT"))


def keyway(space: Any) -> None:
    """A flat on one side only."""
    space.add_lwpolyline([(0, -10), (0, 10), (20, 10), (20, 6), (30, 6), (30, 10), (50, 10), (50, -10)], close=True)


def bore_too_large(space: Any) -> None:
    space.add_lwpolyline(BOX, close=True, **on("NOCUT"))
    space.add_lwpolyline([(20, 0), (20, 12), (50, 12), (50, 0)], close=True, **on("BORE"))


def bore_off_the_axis(space: Any) -> None:
    space.add_lwpolyline(BOX, close=True, **on("NOCUT"))
    space.add_lwpolyline([(20, 4), (20, 6), (50, 6), (50, 4)], close=True, **on("BORE"))


def bore_outside(space: Any) -> None:
    space.add_lwpolyline(BOX, close=True, **on("NOCUT"))
    space.add_lwpolyline([(40, 0), (40, 5), (60, 5), (60, 0)], close=True, **on("BORE"))


def undercut(space: Any) -> None:
    """A groove in the face."""
    space.add_lwpolyline([(0, 0), (0, 4), (10, 4), (10, 6), (0, 6), (0, 10), (50, 10), (50, 0)], close=True)


def circle(space: Any) -> None:
    space.add_circle((0, 0), 10.0, **on("NOCUT"))


def branches(space: Any) -> None:
    corners = [(0, 0), (0, 10), (20, 10), (50, 15), (50, 0)]
    for start, end in pairwise(corners):
        space.add_line(start, end, **on("NOCUT"))
    space.add_line((20, 10), (30, 10), **on("NOCUT"))


def one_gap(space: Any) -> None:
    space.add_lwpolyline([(0, 5), (0, 10), (50, 10), (50, 5), (0.2, 5)], **on("NOCUT"))


def out_of_the_plane(space: Any) -> None:
    space.add_line((0, 0, 0), (0, 10, 5), **on("NOCUT"))


def beside_the_axis(space: Any) -> None:
    space.add_lwpolyline([(0, 0.2), (0, 10), (50, 10), (50, 0.2)], **on("NOCUT"))


def end_beside_the_axis(space: Any) -> None:
    space.add_lwpolyline([(0, 0), (0, 10), (50, 10), (50, -0.3)], **on("NOCUT"))


def beside_a_line(space: Any) -> None:
    space.add_lwpolyline(BOX, **on("NOCUT"))
    space.add_lwpolyline([(0.3, 4), (30, 4), (30, 0)], **on("NOCUT"))


def bore_in_a_cone(space: Any) -> None:
    space.add_lwpolyline([(0, 0), (5, 10), (50, 10), (50, 0)], **on("NOCUT"))
    space.add_lwpolyline([(2, 4), (30, 4), (30, 0)], **on("NOCUT"))


def bore_that_protrudes(space: Any) -> None:
    space.add_lwpolyline(BOX, close=True, **on("NOCUT"))
    space.add_lwpolyline([(-5, 0), (-5, 4), (20, 4), (20, 0)], close=True, **on("NOCUT"))


def layers(space: Any) -> None:
    space.add_lwpolyline(BOX, close=True, **on("PART"))
    space.add_lwpolyline(WHOLE, close=True, **on("VIEW"))


def only_texts(space: Any) -> None:
    space.add_text("holder")


def other_axis(space: Any) -> None:
    space.add_lwpolyline([(x, y + 50) for x, y in WHOLE], close=True, **on("NOCUT"))


def two_axes(space: Any) -> None:
    space.add_lwpolyline(BOX, close=True, **on("NOCUT"))
    space.add_line((0, 0), (50, 0), **on("AXIS"))
    space.add_line((25, -20), (25, 20), **on("AXIS"))


MISTAKES: dict[Callable[[Any], None], tuple[str, ...]] = {
    open_contour: ('layer "NOCUT", LINE #', "at (50, 10) mm", "is open", "of LINE #", "at (50.3, 9.6) mm, 0.5 mm away"),
    crossing: ('layer "NOCUT", LWPOLYLINE #', "at (", "crosses LWPOLYLINE #"),
    several: ('layer "NOCUT", LWPOLYLINE #', "several profiles", "that of LWPOLYLINE #"),
    in_a_row: ('layer "NOCUT", LWPOLYLINE #', "in two pieces", "(50, 0) mm and (80, 0) mm"),
    unsymmetric: ('layer "NOCUT", LWPOLYLINE #', "is 10 mm above the axis, where the other side is 12 mm below it"),
    keyway: ('layer "0", LWPOLYLINE #', "at (25, 6) mm", "symmetric about the axis"),
    bore_too_large: ('layer "BORE", LWPOLYLINE #', "at (35, 12) mm", "diameter 24 mm", "is 20 mm (LWPOLYLINE #"),
    bore_off_the_axis: ('layer "BORE", LWPOLYLINE #', "no body of revolution"),
    bore_outside: ('layer "BORE", LWPOLYLINE #', "at (55, 5) mm", "outside of the body"),
    undercut: ('layer "0", LWPOLYLINE #', "at (5, 6) mm", "an undercut"),
    circle: ('layer "NOCUT", CIRCLE #', "a section across the axis, not a profile"),
    branches: ('layer "NOCUT", LINE #', "at (20, 10) mm", "3 lines meet here"),
    one_gap: ('layer "NOCUT", LWPOLYLINE #', "at (0, 5) mm", "of the same entity at (0.2, 5) mm, 0.2 mm away"),
    beside_the_axis: ('layer "NOCUT", LWPOLYLINE #', "(0, 0.2) mm", "misses the axis: it ends 0.2 mm from it at both"),
    end_beside_the_axis: ('layer "NOCUT", LWPOLYLINE #', "at (50, -0.3) mm", "it ends 0.3 mm from it, expected"),
    beside_a_line: ('layer "NOCUT", LWPOLYLINE #', "at (0.3, 4) mm", "line is LWPOLYLINE #", "0.3 mm away; close it"),
    bore_in_a_cone: ('layer "NOCUT", LWPOLYLINE #', "at (2, 4) mm", "this end is on LWPOLYLINE #", "into a layer BORE"),
    bore_that_protrudes: ('layer "NOCUT", LWPOLYLINE #', "at (0, 4) mm", "crosses LWPOLYLINE #", "into a layer BORE"),
    out_of_the_plane: ('layer "NOCUT", LINE #', "not in the plane", "z is from 0 to 5"),
    layers: ('"PART" (1 curves) and "VIEW" (1 curves)', "`layer`"),
    only_texts: ("no line in the model space", "it has TEXT"),
    other_axis: ("symmetric about y = 50 mm", '"y = 50 mm"'),
    two_axes: ('layer "AXIS", LINE #', "expected one axis"),
}


@pytest.mark.parametrize("draw", MISTAKES, ids=lambda draw: draw.__name__)
def test_mistakes_are_refused_with_entity_layer_and_place(tmp_path: Path, draw: Callable[[Any], None]) -> None:
    text = error_of(tmp_path, draw)
    for words in MISTAKES[draw]:
        assert words in text


def test_a_layer_that_is_not_there_is_named(tmp_path: Path) -> None:
    assert '"VIEWS" with lines, expected one of "PART", "VIEW" (did you mean "VIEW"?)' in error_of(
        tmp_path, layers, layer="VIEWS"
    )


def test_options_that_are_wrong_are_refused(tmp_path: Path) -> None:
    def box(space: Any) -> None:
        space.add_lwpolyline(BOX, close=True)

    assert "states the unit 3 ($INSUNITS)" in error_of(tmp_path, box, stated=3)
    assert 'the unit is "kg", expected one of length' in error_of(tmp_path, box, stated=0, unit="kg")
    assert '`axis` is "z", expected "x" or "y"' in error_of(tmp_path, box, axis="z")
    assert "give a larger tolerance, or check the unit" in error_of(
        tmp_path, lambda space: space.add_lwpolyline([(0, 0), *[(i, 10 + i % 2) for i in range(4000)], (4000, 0)])
    )
    with pytest.raises(ValueError, match="tip is 'up', expected one of left, right"):
        drawing.read_contour(tmp_path / "drawn.dxf", tip="up")


def test_files_that_are_no_drawing_are_refused(tmp_path: Path) -> None:
    for name, content, words in (
        ("a.dxf", b"AC1032" + bytes(100), "is a DWG file, expected DXF"),
        ("a.dxf", b"text", "is no DXF file"),
        ("a.step", b"ISO-10303-21;", 'has the ending ".step", expected .csv or .dxf'),
        ("a.dwg", b"AC1032", "the CAD program writes DXF"),
        ("a.dxf", b"  0\nSECTION\n  2\nENTITIES\n  0\nLINE\n 10\n", "damaged: it has no EOF at its end"),
        ("a.dxf", b"  0\nSECTION\n  2\nENTITIES\nx\n  0\nEOF\n", "damaged: Invalid group code"),
    ):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(FileFormatError, match=words):
            drawing.read_contour(tmp_path / name, unit="mm")
    with pytest.raises(FileNotFoundError, match="there is no file"):
        drawing.read_contour(tmp_path / "b.dxf")


def test_large_drawings_are_refused_before_they_are_parsed(tmp_path: Path) -> None:
    """A file of 100 MB, and one with a million entities, in seconds and with what to do."""
    large, many = tmp_path / "large.dxf", tmp_path / "many.dxf"
    with large.open("wb") as file:
        file.write(b"  0\nSECTION\n  2\nENTITIES\n")
        file.seek(100_000_000)
        file.write(b"  0\nENDSEC\n  0\nEOF\n")
    line = b"0\nLINE\n8\n0\n10\n0\n11\n1\n"
    many.write_bytes(b"0\nSECTION\n2\nENTITIES\n" + 1_000_000 * line + b"0\nENDSEC\n0\nEOF\n")
    assert many.stat().st_size < LARGEST_FILE < large.stat().st_size
    for file, words in ((large, "95 MiB, expected at most 50 MiB"), (many, f"expected at most {MOST_ENTITIES}")):
        before = time.perf_counter()
        with pytest.raises(FileFormatError, match=words) as caught:
            drawing.read_contour(file)
        assert time.perf_counter() - before < 5.0
        assert "export only the contour of the part" in str(caught.value)


def test_blocks_that_multiply_are_refused(tmp_path: Path) -> None:
    """Ten blocks, each of which inserts the one before it ten times."""
    document = ezdxf.new("R2010")
    document.header["$INSUNITS"] = 4
    document.blocks.new("B0").add_line((0, 0), (1, 0))
    for level in range(1, 10):
        block = document.blocks.new(f"B{level}")
        for index in range(10):
            block.add_blockref(f"B{level - 1}", (index, 0))
    document.modelspace().add_blockref("B9", (0, 0))
    file = tmp_path / "blocks.dxf"
    document.saveas(file)
    with pytest.raises(FileFormatError, match="blocks are inserted more than 8 deep"):
        drawing.read_contour(file)
