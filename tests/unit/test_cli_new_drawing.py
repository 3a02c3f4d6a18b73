"""From a drawing and files of FRFs to an identified joint, with no dimension of the holder typed."""

from __future__ import annotations

import json
from pathlib import Path

import ezdxf
import numpy as np
import pytest

import drawn_holder
from command_line import call
from receptance import CARBIDE, FRF, STEEL, Assembly, Part, PointJoint, Segment, campaign, drawing, insert
from receptance.draft import DrawnHolder, parse_holder
from receptance.io import write

JOINT = {"k_y": 2e8, "k_theta": 3e4, "c_y": 200.0, "c_theta": 0.05}
OVERHANGS = {"short": 0.05, "long": 0.08}
INSERTION = 0.036
SEED = 20230512


@pytest.fixture(autouse=True)
def _in_a_folder_with_a_drawing_and_records(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """FRFs of the drawn holder with a tool at two overhangs, with noise of 1 %."""
    print(f"seed {SEED}")
    random = np.random.default_rng(SEED)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")
    drawn_holder.write(Path("holder.dxf"))
    contour = drawing.read_contour("holder.dxf").contour
    holder = Part.from_contour(contour, material=STEEL, name="holder")
    lines = np.linspace(300.0, 6e3, 150)
    for name, overhang in OVERHANGS.items():
        shank = Segment(length=overhang + INSERTION, outer_diameter=0.012, material=CARBIDE)
        inserted = insert(Part([shank], name="tool"), holder, INSERTION)
        chain = [inserted.tool, PointJoint(name="joint", **JOINT), inserted.holder]
        values = Assembly(chain).receptance(lines).ravel()
        noise = random.normal(size=lines.size) + 1j * random.normal(size=lines.size)
        values = values * (1.0 + 0.01 / np.sqrt(2.0) * noise)
        write(Path(f"{name}.csv"), [FRF(frequency_hz=lines, values=values, form="receptance")])


def test_five_commands_lead_to_the_joint(capsys: pytest.CaptureFixture[str]) -> None:
    assert call("contour", "holder.dxf", "--no-window") == 0
    answers = ("--tool", "12 mm", "--tool-material", "carbide", "--holder", "holder.dxf", "--holder-material", "steel")
    more = ("--insertion", "36 mm", "--sensor", "none", "--support", "free")
    each = [text for overhang in OVERHANGS.values() for text in ("--overhang", f"{1e3 * overhang:g} mm")]
    each += ["--standard-deviation", "1 %", "--standard-deviation", "1 %"]
    files = [f"{name}.csv" for name in OVERHANGS]
    code = call("new", "mine", *files, *answers, *more, *each)
    assert code == 0, capsys.readouterr().err
    text = Path("mine/campaign.toml").read_text()
    assert 'contour = "../holder.dxf"' in text
    assert 'insertion = "36 mm"' in text
    assert call("check", "mine", "--no-window") == 0
    assert "the tip is assumed at the left" in capsys.readouterr().out
    assert call("identify", "mine", "--json", "fit.json") == 0
    found = json.loads(Path("fit.json").read_text())
    assert found["parameters"]["joint.k_theta"]["value"] == pytest.approx(JOINT["k_theta"], rel=0.1)
    # The part has the pieces of the drawing, none of which was typed.
    holder = campaign.load("mine").built.parts["holder"]
    drawn = Part.from_contour(drawing.read_contour("holder.dxf").contour, material=holder.segments[0].material)
    assert holder == drawn


def test_a_drawing_with_mistakes_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    document = ezdxf.new("R2010")
    document.header["$INSUNITS"] = 4
    document.modelspace().add_line((0, 5), (50, 5))
    document.saveas("open.dxf")
    for name, words in (("open.dxf", "names a drawing with mistakes: open.dxf, layer"), ("no.dxf", "there is no file")):
        assert call("new", "mine", "short.csv", "--holder", name) == 2
        assert words in capsys.readouterr().err


def test_mistakes_of_the_new_campaign_name_options(capsys: pytest.CaptureFixture[str]) -> None:
    """Its file is not written, so that it has no lines."""
    answers = ("--tool", "12 mm", "--tool-material", "carbide", "--holder", "holder.dxf", "--holder-material", "steel")
    more = ("--sensor", "none", "--support", "free", "--overhang", "50 mm", "--standard-deviation", "1 %")
    for insertion, places, words in (
        ("130 mm", (), "--insertion of short: the insertion is 130 mm, longer than the bore of holder"),
        ("36 mm", ("--hit", "holder@900 mm"), "--hit of short: "),
        ("36 mm", ("--response", "holder@901 mm"), "--response of short: "),
    ):
        assert call("new", "mine", "short.csv", *answers, *more, "--insertion", insertion, *places) == 2
        error = capsys.readouterr().err
        assert words in error, error
        assert "mine/campaign.toml was not written" in error
        assert "line" not in error
        assert not Path("mine").exists()


def test_the_lines_of_contour_and_tables_of_points_are_holders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    points = "x,diameter\n0,27\n40,33\n40,63\n100,63\n"
    Path("bare.csv").write_text(points, encoding="utf-8")
    Path("holder.csv").write_text(points.replace("x,diameter", "x [mm],diameter [mm]"), encoding="utf-8")
    drawn = parse_holder("holder.csv")
    assert isinstance(drawn, DrawnHolder)
    assert (drawn.file, dict(drawn.keys)) == ("holder.csv", {})
    # What a drawing does not state is in the lines of a campaign.
    with pytest.raises(ValueError, match=r"--campaign-lines > FILE\.toml"):
        parse_holder("bare.csv")
    Path("holder.toml").write_text(
        '[parts.nose]\ncontour = "bare.csv"\nmaterial = "steel"\nunit = "mm"\n', encoding="utf-8"
    )
    drawn = parse_holder("holder.toml")
    assert isinstance(drawn, DrawnHolder)
    assert (drawn.file, drawn.material, dict(drawn.keys)) == ("bare.csv", "steel", {"unit": "mm"})
    Path("holder.toml").write_text('[parts.nose]\nmaterial = "steel"\n', encoding="utf-8")
    with pytest.raises(ValueError, match="has neither segments nor a contour"):
        parse_holder("holder.toml")
