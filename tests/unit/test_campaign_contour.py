"""Parts of a campaign whose contour is a drawing: segments, tolerances, mistakes, and the extended file."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest
import tomli_w

import drawn_holder
from campaign_text import TEXT, by_name, load, write
from command_line import call
from receptance import STEEL, Assembly, Part, Segment, campaign, drawing
from receptance.campaign import Campaign, CampaignError, json_schema
from receptance.campaign.write import _element_table, _Materials, _rebase_files
from receptance.model.contour import Contour

HEAD, _, _REST = TEXT.partition("[[parts.holder.segments]]")
TAIL = TEXT[TEXT.index("[joints.joint]") :]
PART = '[parts.holder]\ncontour = "holder.dxf"\nmaterial = "steel"\n'
SPREAD = 'tolerance = { diameter = "0.02 mm", bore = "1 %", length = "0.1 mm" }\n'


def text_of(part: str) -> str:
    """Return the campaign with another table of the holder."""
    return f"{HEAD}{part}\n{TAIL}"


@pytest.fixture(scope="module")
def read(tmp_path_factory: pytest.TempPathFactory) -> Campaign:
    folder = tmp_path_factory.mktemp("campaign")
    drawn_holder.write(folder / "holder.dxf")
    return load(folder, text_of(f'{PART}within = "0.05 mm"\n{SPREAD}'))


def test_the_holder_is_that_of_the_drawing(read: Campaign, tmp_path: Path) -> None:
    file = drawn_holder.write(tmp_path / "holder.dxf")
    contour = drawing.read_contour(file, tolerance=5e-5).contour
    holder = read.assemblies["short"].parts["holder"]
    assert holder.length == pytest.approx(0.14)
    assert holder == Part.from_contour(contour, material=read.built.materials["steel"])
    assert holder.mass == pytest.approx(STEEL.density * contour.volume)


def test_what_the_drawing_does_not_state_is_noted(read: Campaign) -> None:
    place = "parts.holder.contour: "
    notes = [note.removeprefix(place) for note in read.notes if note.startswith(place)]
    assert 'the profile is that of layer "NOCUT"' in notes
    assert any("the tip is assumed at the left" in note for note in notes)


def test_one_tolerance_is_that_of_all_diameters_and_one_of_the_length(read: Campaign) -> None:
    """Diameters change together, and the whole length has the stated standard deviation."""
    holder = read.assemblies["short"].parts["holder"]
    errors = by_name(read.tolerances["short"])
    diameter = errors["parts.holder.tolerance.diameter"]
    assert set(diameter.values()) == {2e-5}
    ends = sum(segment.end_outer_diameter is not None for segment in holder.segments)
    assert len(diameter) == len(holder.segments) + ends
    length = errors["parts.holder.tolerance.length"]
    assert sum(length.values()) == pytest.approx(1e-4)
    shares = [size / segment.length for size, segment in zip(length.values(), holder.segments, strict=True)]
    assert shares == pytest.approx([1e-4 / 0.14] * len(shares))
    bore = errors["parts.holder.tolerance.bore"]
    first = holder.segments[0].inner_diameter
    assert bore["holder.segment[0].inner_diameter"] == pytest.approx(0.01 * first)
    assert all(read.assemblies["short"].get(address) > 0.0 for address in bore)


def test_a_material_with_a_tolerance_has_it_in_every_segment(tmp_path: Path) -> None:
    drawn_holder.write(tmp_path / "holder.dxf")
    tool = load(tmp_path, text_of(PART.replace('"steel"', '"carbide"')))
    moves = by_name(tool.tolerances["short"])["materials.carbide.density"]
    count = len(tool.assemblies["short"].parts["holder"].segments)
    assert sum(address.startswith("holder.segment[") for address in moves) == count


def test_a_csv_file_is_read_with_its_keys(tmp_path: Path) -> None:
    (tmp_path / "holder.csv").write_text("x,diameter,bore\n0,40,12\n40,50,12\n40,60,\n100,60,\n")
    part = '[parts.holder]\ncontour = "holder.csv"\nmaterial = "steel"\nunit = "mm"\ntip = "right"\n'
    holder = load(tmp_path, text_of(part)).assemblies["short"].parts["holder"]
    reversed_ = Contour(
        [(0.0, 0.06), (0.06, 0.06), (0.06, 0.05), (0.1, 0.04)], [[(0.06, 0.012), (0.1, 0.012)]]
    )  # fmt: skip
    assert holder.mass == pytest.approx(STEEL.density * reversed_.volume)
    assert holder.segments[0].outer_diameter == pytest.approx(0.06)


def test_a_contour_may_be_rigid(tmp_path: Path) -> None:
    drawn_holder.write(tmp_path / "holder.dxf")
    rigid = load(tmp_path, text_of(f"{PART}rigid = true\n")).assemblies["short"]
    plain = load(tmp_path, text_of(PART)).assemblies["short"]
    assert rigid.mass == pytest.approx(plain.mass)


def test_frequencies_are_those_of_fine_cylinders(tmp_path: Path) -> None:
    """The drawn holder, free: its first bending modes against those of cylinders of 0.1 mm."""
    contour = drawing.read_contour(drawn_holder.write(tmp_path / "holder.dxf"), tolerance=5e-5).contour
    part = Part.from_contour(contour, material=STEEL, name="holder")
    fine = []
    for piece in contour.pieces:
        count = max(round(piece.length / 1e-4), 1)
        for index in range(count):
            share = (index + 0.5) / count
            fine.append(
                Segment(
                    length=piece.length / count,
                    outer_diameter=piece.outer_diameter + share * (piece.end_outer_diameter - piece.outer_diameter),
                    inner_diameter=piece.inner_diameter + share * (piece.end_inner_diameter - piece.inner_diameter),
                    material=STEEL,
                )
            )
    found, expected = (
        Assembly([one]).natural_frequencies(30e3)[:2] for one in (part, Part(fine, name="holder"))
    )  # fmt: skip
    assert np.asarray(found) == pytest.approx(np.asarray(expected), rel=1e-4)


MISTAKES = {
    '[parts.holder]\ncontour = "holder.dfx"\nmaterial = "steel"\n': 'is "holder.dfx", which does not exist',
    '[parts.holder]\ncontour = "holder.dxf"\n': "parts.holder.material: is missing",
    f'{PART}layer = "CUTS"\n': 'there is no layer "CUTS" with lines',
    f'{PART}tip = "up"\n': 'is "up", expected one of "left"',
    f'{PART}axis = "z"\n': '`axis` is "z"',
    f'{PART}within = "0 mm"\n': "parts.holder.within",
    f'{PART}tolerance = {{ diamter = "1 %" }}\n': "is not a known key",
    '[parts.holder]\nmaterial = "steel"\n': "parts.holder.material: is given without `contour`",
    "[parts.holder]\nrigid = false\n": "parts.holder.segments: is missing",
    f'{PART}[[parts.holder.segments]]\nlength = "1 mm"\nouter_diameter = "1 mm"\nmaterial = "steel"\n': (
        "are given with `contour`, expected one of the two"
    ),
    f'{PART}bore_layer = "NOCUT"\nlayer = "BORE"\n': 'layer "NOCUT", LWPOLYLINE #',
}


@pytest.mark.parametrize("part", MISTAKES)
def test_mistakes_have_their_place(tmp_path: Path, part: str) -> None:
    drawn_holder.write(tmp_path / "holder.dxf")
    with pytest.raises(CampaignError) as caught:
        load(tmp_path, text_of(part))
    assert MISTAKES[part] in str(caught.value)


def test_a_drawing_without_unit_names_the_key(tmp_path: Path) -> None:
    drawn_holder.write(tmp_path / "holder.dxf", unit=0)
    with pytest.raises(CampaignError, match=r"parts\.holder\.contour: .* states no unit .* give it as `unit`"):
        load(tmp_path, text_of(PART))
    assert load(tmp_path, text_of(f'{PART}unit = "mm"\n')).assemblies["short"].parts["holder"].length == 0.14


def test_written_campaigns_find_the_drawing(tmp_path: Path) -> None:
    data = tomllib.loads(text_of(PART))
    _rebase_files(data, tmp_path / "a", tmp_path / "b" / "c")
    assert data["parts"]["holder"]["contour"] == "../../a/holder.dxf"


def test_a_part_that_a_cause_has_changed_is_written_as_segments(read: Campaign, tmp_path: Path) -> None:
    """The tables of its cones are read as the same part, without the drawing."""
    holder = read.assemblies["short"].parts["holder"]
    table = tomli_w.dumps({"parts": {"holder": _element_table(holder, _Materials(["steel"]))}})
    assert load(tmp_path, text_of(table)).assemblies["short"].parts["holder"] == holder


def test_the_schema_has_the_keys() -> None:
    part = json_schema()["$defs"]["PartTable"]
    assert {"segments", "contour", "layer", "unit", "axis", "tip", "within", "tolerance"} <= part["properties"].keys()
    assert "required" not in part


def test_a_drawing_is_not_overwritten(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = drawn_holder.write(tmp_path / "holder.dxf")
    before = file.read_bytes()
    campaign_file = write(tmp_path, text_of(PART))
    assert call("check", str(campaign_file), "--json", str(file), "--overwrite") == 2
    assert "which is a data file of the campaign" in capsys.readouterr().err
    assert file.read_bytes() == before
    assert campaign.load(campaign_file)
