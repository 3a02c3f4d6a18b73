"""Bores in the layer of the profile: a half profile with its bore, as lines, open and closed polylines."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal

import ezdxf
import pytest

from receptance import drawing

PROFILE = [(0.0, 0.0), (0.0, 10.0), (50.0, 10.0), (50.0, 0.0)]
Points = Sequence[tuple[float, float]]
Kind = Literal["lines", "open", "closed"]
BORES: dict[str, Points] = {
    "blind": [(0, 0), (0, 4), (30, 4), (30, 0)],
    "from the other face": [(50, 0), (50, 4), (20, 4), (20, 0)],
    "stepped": [(0, 0), (0, 4), (20, 4), (20, 6), (30, 6), (30, 0)],
    "with a drilled end": [(0, 0), (0, 4), (30, 4), (32, 0)],
    "through": [(0, 0), (0, 4), (50, 4), (50, 0)],
    "cavity": [(10, 0), (10, 4), (40, 4), (40, 0)],
}
"""Corners of bores, from the axis to the axis."""


def draw(space: Any, points: Points, kind: Kind, layer: str = "NOCUT") -> None:
    attributes = {"layer": layer}
    if kind == "lines":
        for start, end in pairwise(points):
            space.add_line(start, end, dxfattribs=attributes)
    else:
        space.add_lwpolyline(points, close=kind == "closed", dxfattribs=attributes)


def read(file: Path, draws: Sequence[tuple[Points, Kind, str]]) -> drawing.DrawnContour:
    document = ezdxf.new("R2010")
    document.header["$INSUNITS"] = 4
    for points, kind, layer in draws:
        draw(document.modelspace(), points, kind, layer)
    document.saveas(file)
    return drawing.read_contour(file)


@pytest.mark.parametrize("profile", ["lines", "open", "closed"])
@pytest.mark.parametrize("kind", ["lines", "open", "closed"])
@pytest.mark.parametrize("name", BORES)
@pytest.mark.parametrize("turn", [0, 1])
def test_a_bore_in_the_layer_of_the_profile_is_that_of_a_layer_of_its_own(
    tmp_path: Path, name: str, kind: Kind, profile: Kind, turn: int
) -> None:
    """Also where a closed polyline begins at another corner, and without the line in the face of the profile."""
    corners = [*BORES[name][turn:], *BORES[name][:turn]] if kind == "closed" else list(BORES[name])
    expected = read(tmp_path / "two.dxf", [(PROFILE, "closed", "NOCUT"), (BORES[name], "closed", "BORE")]).contour
    same = read(tmp_path / "same.dxf", [(PROFILE, profile, "NOCUT"), (corners, kind, "NOCUT")]).contour
    assert (same.outer, same.bores) == (expected.outer, expected.bores)
    if kind != "closed" and name != "cavity":
        ends = corners[1:-1] if name == "through" else corners[1:]
        bare = read(tmp_path / "bare.dxf", [(PROFILE, profile, "NOCUT"), (ends, kind, "NOCUT")]).contour
        assert (bare.outer, bare.bores) == (expected.outer, expected.bores)
