"""The command `contour`: what it prints, draws and refuses, and lines that a campaign reads."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import ezdxf
import pytest

import drawn_holder
from campaign_text import TEXT, load
from command_line import PNG, call, left
from receptance import STEEL, drawing


@pytest.fixture(autouse=True)
def _in_a_folder_with_a_drawing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")
    drawn_holder.write(Path("holder.dxf"))


def test_it_prints_what_was_read_and_assumed(capsys: pytest.CaptureFixture[str]) -> None:
    assert call("contour", "holder.dxf", "--plot", "holder.png") == 0
    text = capsys.readouterr().out
    mass = STEEL.density * drawing.read_contour("holder.dxf").contour.volume
    for words in (
        "holder.dxf: contour",
        "140 mm",
        "63 mm at most",
        f"{mass:.4g} kg of steel",
        "bores: 2",
        "27 to 32.7",
        '- the profile is that of layer "NOCUT"',
        "- the tip is assumed at the left",
        "Figure: holder.png",
    ):
        assert words in text
    assert max(map(len, text.splitlines())) <= 80
    assert Path("holder.png").read_bytes().startswith(PNG)
    assert left() == {"holder.dxf", "holder.png"}


def test_the_data_are_those_of_the_contour(capsys: pytest.CaptureFixture[str]) -> None:
    assert call("contour", "holder.dxf", "--json", "-", "--material", "heavy = 340 GPa, 17600 kg/m^3, 0.28") == 0
    found = json.loads(capsys.readouterr().out)
    contour = drawing.read_contour("holder.dxf").contour
    assert found["mass_kg"] == pytest.approx(17600.0 * contour.volume)
    assert found["centre_of_gravity_m"] == pytest.approx(contour.centre_of_gravity)
    assert len(found["pieces"]) == len(contour.pieces)


def test_its_lines_are_those_of_a_campaign(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The part of the printed lines is the one that the command has read, with its options."""
    options = ("--layer", "NOCUT", "--tip", "right", "--within", "0.1 mm", "--unit", "mm")
    assert call("contour", "holder.dxf", "--campaign-lines", "--name", "holder", *options) == 0
    lines = capsys.readouterr().out
    part = tomllib.loads(lines)["parts"]["holder"]
    assert part == {
        "contour": "holder.dxf", "material": "steel",
        "layer": ["NOCUT"], "tip": "right", "within": "0.1 mm", "unit": "mm",
    }  # fmt: skip
    own = lines[lines.index("[parts.holder]") :]
    text = f"{TEXT[: TEXT.index('[[parts.holder.segments]]')]}{own}\n{TEXT[TEXT.index('[joints.joint]') :]}"
    holder = load(tmp_path, text).assemblies["short"].parts["holder"]
    contour = drawing.read_contour("holder.dxf", layer="NOCUT", tip="right", tolerance=1e-4).contour
    assert holder.mass == pytest.approx(STEEL.density * contour.volume)


def test_a_listed_material_needs_no_table(capsys: pytest.CaptureFixture[str]) -> None:
    """A campaign then takes values and scatter from the list."""
    for name in ("steel", "carbide", "tool-steel"):
        assert call("contour", "holder.dxf", "--campaign-lines", "--material", name) == 0
        lines = tomllib.loads(capsys.readouterr().out)
        assert "materials" not in lines
        assert lines["parts"]["holder"]["material"] == name


def test_a_missing_unit_names_its_option(capsys: pytest.CaptureFixture[str]) -> None:
    drawn_holder.write(Path("none.dxf"), unit=0)
    assert call("contour", "none.dxf") == 2
    error = capsys.readouterr().err
    assert "give it as --unit" in error
    assert "`" not in error
    assert call("contour", "none.dxf", "--unit", "mm", "--no-window") == 0
    assert "the unit is mm, as stated" in capsys.readouterr().out


REFUSED = {
    ("contour", "holders.dxf"): "there is no file holders.dxf; did you mean",
    ("contour", "holder.dxf", "--layer", "CUT"): 'there is no layer "CUT" with lines',
    ("contour", "holder.dxf", "--material", "stel"): "--material is 'stel', expected one of",
    ("contour", "holder.dxf", "--within", "1"): '--within is "1", without a unit',
    ("contour", "holder.dxf", "--name", "1"): "--name is '1'",
    ("contour", "holder.dxf", "--tip", "up"): "--tip is 'up', expected one of \"left\"",
    ("contour", "holder.dxf", "--plot", "holder.dxf"): "expected an ending with a format of figures",
    ("contour", "holder.dxf", "--axis", "q"): '--axis is "q", expected "x" or "y"',
}


@pytest.mark.parametrize("command", REFUSED)
def test_mistakes_are_refused(command: tuple[str, ...], capsys: pytest.CaptureFixture[str]) -> None:
    assert call(*command) == 2
    error = capsys.readouterr().err
    assert REFUSED[command] in error
    assert "Traceback" not in error
    assert left() == {"holder.dxf"}


def test_messages_and_notes_name_options(capsys: pytest.CaptureFixture[str]) -> None:
    """A drawing with two layers and no more, read with and without an answer."""
    document = ezdxf.new("R2010")
    document.header["$INSUNITS"] = 4
    for layer, radius in (("PART", 10), ("HOLS", 4)):
        corners = [(0, 0), (0, radius), (50, radius), (50, 0)]
        document.modelspace().add_lwpolyline(corners, close=True, dxfattribs={"layer": layer})
    document.saveas("two.dxf")
    assert call("contour", "two.dxf") == 2
    assert "give its name as --layer" in capsys.readouterr().err
    assert call("contour", "two.dxf", "--layer", "PARTS") == 2
    assert "(--layer)" in capsys.readouterr().err
    assert call("contour", "two.dxf", "--layer", "PART", "--no-window") == 0
    text = capsys.readouterr().out
    assert "no --axis states another one" in " ".join(text.split())
    assert "--tip states another end" in " ".join(text.split())
    assert "`" not in text


def test_names_of_layers_do_not_control_the_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    document = ezdxf.new("R2010")
    document.header["$INSUNITS"] = 4
    layer = "A\x1b[2J"
    document.modelspace().add_lwpolyline([(0, 0), (0, 5), (20, 5)], dxfattribs={"layer": layer})
    document.saveas("bad.dxf")
    assert call("contour", "bad.dxf") == 2
    assert "\x1b" not in capsys.readouterr().err
