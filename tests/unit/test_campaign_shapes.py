"""Sections that are not circular in campaign files."""

from pathlib import Path

import numpy as np
import pytest

from receptance import STEEL, Assembly, GroundSpring, Part, SectionShape, Segment, campaign
from receptance.campaign.shapes import note_on_directions, shape_keys

HEAD = """
[materials.steel]
youngs_modulus = "210 GPa"
density = "7850 kg/m3"
poisson_ratio = 0.3

[parts.bar]

[[parts.bar.segments]]
length = "100 mm"
material = "steel"
"""
TAIL = """

[assemblies.free]
chain = ["bar"]
"""


def read(folder: Path, lines: str) -> Segment:
    file = folder / "campaign.toml"
    file.write_text(HEAD + lines + TAIL, encoding="utf-8")
    return campaign.load(file).assemblies["free"].parts["bar"].segments[0]


@pytest.mark.parametrize(
    ("lines", "shape"),
    [
        (
            'outer_diameter = "12 mm"\nshape = { flutes = 4, core_diameter = "7 mm" }',
            SectionShape.fluted(4, diameter=0.012, core_diameter=0.007),
        ),
        (
            'outer_diameter = "12 mm"\nshape = { flutes = 2, core_diameter = "8 mm", straight = true, plane = "x" }',
            SectionShape.fluted(2, diameter=0.012, core_diameter=0.008, straight=True).turned(),
        ),
        ('shape = { width = "50 mm", height = "2 mm" }', SectionShape.rectangle(0.05, 0.002)),
        ('shape = { width = "50 mm", height = "2 mm", plane = "x" }', SectionShape.rectangle(0.05, 0.002).turned()),
        (
            'shape = { width = "5 mm", height = "2 mm", plane = "mean" }',
            SectionShape.rectangle(0.005, 0.002).averaged(),
        ),
        (
            'shape = { points = [[0, 0], [30, 0], [30, 20], [0, 20]], unit = "mm" }',
            SectionShape.polygon([(0, 0), (30, 0), (30, 20), (0, 20)], unit="mm"),
        ),
    ],
)
def test_shapes_are_read_and_written(tmp_path: Path, lines: str, shape: SectionShape) -> None:
    segment = read(tmp_path, lines)
    assert segment.shape == shape
    assert segment.outer_diameter == pytest.approx(shape.diameter, rel=1e-12)
    # As another size and as written again: the same receptance.
    larger = Segment(length=0.1, outer_diameter=1.5 * shape.diameter, shape=shape, material=segment.material)
    table = shape_keys(larger)["shape"]
    values = ", ".join(f"{key} = {_toml(value)}" for key, value in table.items())
    again = read(tmp_path, f'outer_diameter = "{1e3 * larger.outer_diameter!r} mm"\nshape = {{ {values} }}')
    lines_hz = [500.0, 5e3]
    expected, found = (Assembly([Part([part])]).receptance(lines_hz) for part in (larger, again))
    np.testing.assert_allclose(found, expected, rtol=1e-8)


def _toml(value: object) -> str:
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, bool):
        return str(value).lower()
    return repr(value)


def test_an_outline_is_read_from_a_file(tmp_path: Path) -> None:
    (tmp_path / "strip.csv").write_text("x [mm],y [mm]\n0,0\n50,0\n50,2\n0,2\n", encoding="utf-8")
    segment = read(tmp_path, 'shape = { outline = "strip.csv" }')
    assert segment.mass == pytest.approx(7850 * 0.1 * 0.05 * 0.002)
    assert segment.outer_diameter == pytest.approx(np.hypot(0.05, 0.002))


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (
            'outer_diameter = "12 mm"\nshape = { flutes = 4, core_diameter = "13 mm" }',
            "shape: core_diameter is 13 mm, expected less than the diameter 12 mm",
        ),
        ('shape = { points = [[0, 0], [1, 0]], unit = "mm" }', "shape: points has 2 different points"),
        (
            'shape = { points = [[0, 0], [1, 0], [1, 1]], unit = "kg" }',
            "shape: unit is 'kg', expected a unit of length",
        ),
        (
            'outer_diameter = "12 mm"\ninner_diameter = "2 mm"\nshape = { flutes = 4, core_diameter = "7 mm" }',
            "a shape is given beside a bore or a core",
        ),
        ('outer_diameter = "12 mm"\nshape = { core_diameter = "7 mm" }', "has none of them, expected one of `flutes`"),
        ('outer_diameter = "12 mm"\nshape = { flutes = 4 }', "has `flutes` without `core_diameter`"),
        ('shape = { flutes = 4, core_diameter = "7 mm" }', "expected `outer_diameter` of the segment as well"),
        ('outer_diameter = "12 mm"\nshape = { flutes = 4, core_diameter = "13 mm" }', "core_diameter"),
        ('shape = { width = "50 mm" }', "has `width` without `height`"),
        ('shape = { width = "50 mm", height = "2 mm", straight = true }', "`straight` beside `width`"),
        ('outer_diameter = "40 mm"\nshape = { width = "50 mm", height = "2 mm" }', "outer_diameter is 40 mm"),
        ('shape = { points = [[0, 0], [1, 1], [1, 0], [0, 1]], unit = "mm" }', "cross"),
        ('shape = { points = [[0, 0], [1, "a"]], unit = "mm" }', "expected two numbers"),
        ("shape = { points = [[0, 0], [1, 0], [1, 1]] }", "has `points` without `unit`"),
        ('shape = { outline = "none.csv" }', "does not exist"),
        ("", "outer_diameter: is missing"),
    ],
)
def test_mistakes_are_told(tmp_path: Path, lines: str, message: str) -> None:
    with pytest.raises(campaign.CampaignError) as error:
        read(tmp_path, lines)
    text = str(error.value)
    assert message in text.replace(", parts.bar.segments[0].", " "), text
    assert "SectionShape" not in text


def test_two_flutes_with_a_helix_are_noted(tmp_path: Path) -> None:
    for flutes, key, told in ((2, "", True), (2, ", straight = true", False), (3, "", False)):
        read(tmp_path, f'outer_diameter = "12 mm"\nshape = {{ flutes = {flutes}, core_diameter = "7 mm"{key} }}')
        notes = campaign.load(tmp_path / "campaign.toml").notes
        assert any("shape: has two flutes" in note for note in notes) == told, notes


@pytest.mark.parametrize("helix", [None, 0.0])
def test_the_note_on_straight_flutes_has_the_ratio_of_both_planes(helix: float | None) -> None:
    """A long tool, so that bending alone counts."""
    shape = SectionShape.fluted(2, diameter=0.012, core_diameter=0.007, straight=True)

    def compliance(in_plane: SectionShape) -> float:
        flutes = Segment(length=0.2, outer_diameter=0.012, shape=in_plane, material=STEEL)
        shank = Segment(length=0.1, outer_diameter=0.014, material=STEEL)
        clamp = GroundSpring(k_y=1e13, k_theta=1e10, part="tool", position="end")
        return float(Assembly([Part([flutes, shank], name="tool")], [clamp]).receptance([0.01])[0].real)

    ratio = compliance(shape) / compliance(shape.turned())
    text = note_on_directions(shape, 0.2, helix=helix, shank=(0.1, 14 / 12))
    assert float(text.split(" times")[0].split()[-1]) == pytest.approx(ratio, abs=0.01)
