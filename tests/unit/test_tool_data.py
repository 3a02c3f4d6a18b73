"""Tool lists with the property names of ISO 13399, and materials of the list in catalogues and campaigns."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from campaign_text import TEXT as CAMPAIGN
from campaign_text import by_name
from campaign_text import load as load_campaign
from command_line import call
from machine_with_catalogue import HOLDERS, TOOLS, load
from receptance import MATERIALS, STEEL, Part, SectionShape
from receptance.campaign import CampaignError
from receptance.catalogue import Catalogue, predict_catalogue, read_holders, read_tools
from receptance.catalogue.iso13399 import TOOL_SYMBOLS, symbol_table

PLAIN = """\
name,holder,material,overhang [mm],diameter [mm],flute length [mm],effective diameter [mm],teeth,torque [N m]
T1,er32,carbide,60,12,30,9.6,4,80
"""
HEADS = "name,holder,material,DC,DCONMS,OAL,LSC,LCF,effective diameter [%],NOF,torque [N m]"
ISO = f"{HEADS}\nT1,er32,carbide,12,12,100,40,30,80,4,80\n"
NECK = """\
name,holder,material,DC,DMM,LPR,OAL,APMX,LU,DN,effective diameter [%],NOF,FHA,RE,TDES
T1,er32,carbide,10,12,60,100,20,40,9.5,80,4,35,0.5,EM-10
"""


def rows(tmp_path: Path, text: str) -> tuple[list[object], list[str]]:
    """Return the tools of a file, and what a user is told."""
    path = tmp_path / "list.csv"
    path.write_text(text)
    notes: list[str] = []
    return list(read_tools(path, notes=notes)), notes


def mistakes(tmp_path: Path, text: str) -> str:
    with pytest.raises(CampaignError) as error:
        rows(tmp_path, text)
    return str(error.value)


def test_symbols_are_heads_of_columns(tmp_path: Path) -> None:
    (plain,), silent = rows(tmp_path, PLAIN)
    (named,), notes = rows(tmp_path, ISO)
    for field in ("name", "overhang", "diameter", "flute_length", "effective_diameter", "teeth", "conditions"):
        assert getattr(named, field) == pytest.approx(getattr(plain, field)), field
    assert silent == []
    (note,) = notes
    assert note.endswith('"DC", "DCONMS", "OAL", "LSC", "LCF" without a unit in mm, as ISO 13399 defines')


def test_symbols_may_be_in_lower_case(tmp_path: Path) -> None:
    heads, _, cells = ISO.partition("\n")
    (plain,), _ = rows(tmp_path, ISO)
    (lower,), notes = rows(tmp_path, f"{heads.lower().replace('[n m]', '[N m]')}\n{cells}")
    assert lower == plain
    assert notes[1] == "list.csv: symbols of ISO 13399 in lower case: " + ", ".join(
        f'"{name.lower()}" as {name}' for name in ("DC", "DCONMS", "OAL", "LSC", "LCF", "NOF")
    )


def test_a_lower_case_head_may_be_a_condition(tmp_path: Path) -> None:
    """A unit of another quantity makes it one; the same symbol in both cases is refused."""
    text = ISO.replace("torque [N m]", "lf [N]")
    (tool,), _ = rows(tmp_path, text)
    assert tool.conditions == {"lf": 80.0}  # type: ignore[attr-defined]
    assert tool.functional_length == 0.0  # type: ignore[attr-defined]
    (tool,), _ = rows(tmp_path, ISO.replace("torque [N m]", "lf [mm]"))
    assert tool.functional_length == pytest.approx(0.08)  # type: ignore[attr-defined]
    assert 'column "dc [mm]" is also column "DC"' in mistakes(tmp_path, ISO.replace("torque [N m]", "dc [mm]"))


def test_all_contradictions_of_a_row_come_together(tmp_path: Path) -> None:
    text = mistakes(tmp_path, NECK.replace("12,60,100,20,40,9.5", "12,101,100,102,103,9.5"))
    for words in (
        "LPR: is 101 mm, expected at most the overall length, 100 mm",
        "APMX: is 102 mm, expected at most the overall length, 100 mm",
        "LU: is 103 mm, expected at most the overall length, 100 mm",
        "DN: ends 103 mm from the tip",
    ):
        assert f"line 2, {words}" in text


def test_a_mistake_has_no_consequences(tmp_path: Path) -> None:
    """Where a cell cannot be read, what depends on it is not told as a second mistake."""
    assert "has a mistake:" in mistakes(tmp_path, ISO.replace("12,12,100", "x,12,100"))  # effective diameter in %
    assert "has a mistake:" in mistakes(tmp_path, ISO.replace(",100,40,", ",x,40,"))  # overhang
    assert "has a mistake:" in mistakes(tmp_path, ISO.replace(",30,80,", ",30,x,"))
    assert "has a mistake:" in mistakes(tmp_path, NECK.replace(",20,40,", ",20,x,"))  # end of the neck
    assert "line 3" not in mistakes(tmp_path, FLUTES.replace(",60,4,35,", ",60,x,35,"))


def test_stated_units_are_used(tmp_path: Path) -> None:
    heads = ("DC", "DCONMS", "OAL", "LSC", "LCF")
    text = ISO
    for head in heads:
        text = text.replace(f",{head},", f",{head} [cm],")
    in_cm = text.replace("12,12,100,40,30", "1.2,1.2,10,4,3")
    (stated,), notes = rows(tmp_path, in_cm)
    (by_standard,), _ = rows(tmp_path, ISO)
    assert notes == []
    assert stated.overhang == pytest.approx(by_standard.overhang)  # type: ignore[attr-defined]


def test_columns_that_are_not_needed_are_told(tmp_path: Path) -> None:
    _, notes = rows(tmp_path, NECK)
    assert notes[0].endswith('"DN" without a unit in mm, column "FHA" in deg, as ISO 13399 defines')
    assert notes[1].endswith('not needed: columns "RE", "TDES"')
    _, notes = rows(tmp_path, PLAIN.replace("torque [N m]", "comment").replace(",80\n", ",first\n"))
    assert notes == ['list.csv: not needed: column "comment"']


def test_a_neck_is_a_segment(tmp_path: Path) -> None:
    machine = Catalogue(load(tmp_path, tools=NECK))
    (tool,) = machine
    part = tool.site.assembly.elements["tool"]
    assert isinstance(part, Part)
    found = [(segment.length, segment.outer_diameter) for segment in part.segments]
    expected = [(0.02, 0.008), (0.02, 0.0095), (0.02, 0.012)]  # 80 % of the cutting diameter
    assert found == [pytest.approx(pair) for pair in expected]
    assert any("not needed" in note for note in machine.notes)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (",100,40,", ",100,,", "line 2, overhang: is empty, expected it, or overall length and clamping length"),
        (",100,40,", ",100,100,", "line 2, overhang: is 0 mm, from overall length less clamping length"),
        (",100,40,", ",x,40,", 'line 2, OAL: is "x mm"'),
        (",12,12,", ",,,", "line 2, DCONMS: is empty"),
        (",40,30,80", ",40,61,80", "line 2, LCF: is 61 mm, expected at most the overhang, 60 mm"),
        (",30,80,4", ",30,,4", 'line 2, "effective diameter": is empty, but the tool has flutes'),
        ("DC,DCONMS", "DCON,DCONMS", 'column "DCONMS" is also column "DCON"'),
        ("DC,DCONMS", "DCONMS,DCONMS", 'column "DCONMS" occurs twice'),
        ("DC,DCONMS", "DC [kg],DCONMS", 'column "DC [kg]" is in "kg", a mass, expected a length'),
        ("OAL,LSC", "OAL,LS", 'there is no column "overhang"'),
    ],
)
def test_incomplete_rows_are_told_with_row_and_column(tmp_path: Path, old: str, new: str, words: str) -> None:
    assert ISO.count(old) == 1
    assert words in mistakes(tmp_path, ISO.replace(old, new))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (",20,40,", ",20,101,", "line 2, LU: is 101 mm, expected at most the overall length, 100 mm"),
        (",60,100,", ",101,100,", "line 2, LPR: is 101 mm, expected at most the overall length, 100 mm"),
        (",20,40,", ",41,40,", "line 2, APMX: is 41 mm, expected at most the usable length, 40 mm"),
        (",20,40,", ",20,,", "line 2, DN: is given without usable length (LU) or head length (LH)"),
        (",20,40,", ",20,61,", "line 2, DN: ends 61 mm from the tip, expected more than the flute length, 20 mm"),
        (",RE,TDES", ",LF,TDES", "line 2, LF: is 500 mm, expected at most the overall length, 100 mm"),
        (",RE,TDES", ",DCX,TDES", "line 2, DC: is 10 mm, expected at most the largest cutting diameter, 9 mm"),
        (",RE,TDES", ",LSC,TDES", "line 2, LSC: is 50 mm, which makes 110 mm with the overhang of 60 mm"),
    ],
)
def test_contradictions_are_refused_with_their_row(tmp_path: Path, old: str, new: str, words: str) -> None:
    assert NECK.count(old) == 1
    value = {"LF": "500", "DCX": "9", "LSC": "50"}.get(new[1:4].strip(","), "0.5")
    assert words in mistakes(tmp_path, NECK.replace(old, new).replace(",35,0.5,", f",35,{value},"))


FLUTES = """\
name,holder,material,DC,DMM,LPR,LCF,core diameter [%],NOF,FHA,bore [mm]
T1,er32,carbide,10,12,60,25,60,4,35,
T2,er32,carbide,10,12,60,25,60,2,0,
"""


def test_flutes_have_the_section_of_their_number_and_core(tmp_path: Path) -> None:
    four, two = Catalogue(load(tmp_path, tools=FLUTES))
    parts = [tool.site.assembly.elements["tool"] for tool in (four, two)]
    first = [part.segments[0] for part in parts if isinstance(part, Part)]
    shapes = [
        SectionShape.fluted(4, diameter=0.01, core_diameter=0.006),
        SectionShape.fluted(2, diameter=0.01, core_diameter=0.006, straight=True),
    ]
    for segment, shape in zip(first, shapes, strict=True):
        assert segment.shape is not None
        assert (segment.length, segment.outer_diameter) == pytest.approx((0.025, 0.01))
        assert segment.shape.moment == pytest.approx(shape.moment)
    assert parts[0].segments[1].shape is None  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (",25,60,4,35,", ",25,60,,35,", "line 2, NOF: is empty, expected the number of flutes"),
        (",25,60,4,35,", ",,60,4,35,", 'line 2, "core diameter": is given without a flute length'),
        (",25,60,4,35,", ",25,60,4,35,2", "line 2, bore: is given beside a core diameter"),
        (",25,60,4,35,", ",25,100,4,35,", 'line 2, "core diameter": makes no section of flutes'),
        (",25,60,4,35,", ",25,60,4,80,", 'line 2, FHA: is "80 deg", expected at least -75 and at most 75'),
        (",25,60,4,35,", ",25,,4,35,", "or `core diameter` and the number of teeth"),
        ("FHA,bore [mm]", "effective diameter [mm],bore [mm]", "is given beside an effective diameter"),
    ],
)
def test_flutes_that_are_incomplete_are_refused(tmp_path: Path, old: str, new: str, words: str) -> None:
    assert FLUTES.count(old) == 1
    assert words in mistakes(tmp_path, FLUTES.replace(old, new))


def test_holders_have_symbols(tmp_path: Path) -> None:
    path = tmp_path / "holders.csv"
    path.write_text("holder,material,LB,BD,DCB\nh,steel,40,50,12\n")
    ((row,),) = read_holders(path).values()
    assert (row.length, row.outer_diameter, row.inner_diameter) == (0.04, 0.05, 0.012)


def test_the_documentation_shows_the_symbols() -> None:
    text = (Path(__file__).parents[2] / "docs" / "tool_data.md").read_text(encoding="utf-8")
    assert symbol_table() in text
    assert all(f"`{name}`" in text for name in TOOL_SYMBOLS)


# Materials ------------------------------------------------------------------------------------------------------------


def test_a_row_names_a_listed_material(tmp_path: Path) -> None:
    """Its scatter is the tolerance of every tool of this material, one error for all of them."""
    text = TOOLS.replace("T1,er32,carbide", "T1,er32,carbide-9co")
    machine = Catalogue(load(tmp_path, tools=text))
    first, second, _ = machine
    assert first.site.assembly.get("tool.segment[0].density") == 14634.0
    errors = by_name(first.tolerances)
    assert errors["materials.carbide-9co.density"].keys() == {"tool.segment[0].density", "tool.segment[1].density"}
    assert "materials.carbide-9co.density" not in by_name(second.tolerances)
    assert any(note.startswith("materials.carbide-9co: from the list of materials") for note in machine.notes)
    with pytest.raises(CampaignError, match='"carbid", which is not known, expected one of'):
        Catalogue(load(tmp_path, tools=TOOLS.replace("T1,er32,carbide", "T1,er32,carbid")))


def test_a_holder_names_a_listed_material(tmp_path: Path) -> None:
    machine = Catalogue(load(tmp_path, holders=HOLDERS.replace("12,steel", "12,tool-steel")))
    errors = by_name(machine.assemble(machine.tools[1]).tolerances)
    assert "materials.tool-steel.density" in errors


WITHOUT_TABLE = CAMPAIGN.replace(CAMPAIGN[CAMPAIGN.index("[materials.carbide]") : CAMPAIGN.index("[[parts.tool")], "")


def test_a_campaign_names_listed_materials_without_a_table(tmp_path: Path) -> None:
    assert "[materials" not in WITHOUT_TABLE
    read = load_campaign(tmp_path, WITHOUT_TABLE.replace('"carbide"', '"carbide-10co"'))
    assembly, listed = read.assemblies["short"], MATERIALS["carbide-10co"]
    assert assembly.get("tool.segment[0].youngs_modulus") == listed.youngs_modulus
    assert assembly.get("holder.segment[1].density") == STEEL.density
    errors = by_name(read.tolerances["short"])
    moves = errors["materials.carbide-10co.youngs_modulus"]
    assert moves.keys() == {"tool.segment[0].youngs_modulus", "holder.segment[0].core.youngs_modulus"}
    assert list(moves.values()) == pytest.approx(2 * [listed.deviations["youngs_modulus"]], rel=1e-3)
    assert [note.partition(":")[0] for note in read.notes] == ["materials.carbide-10co", "materials.steel"]


def test_a_table_of_the_file_takes_precedence(tmp_path: Path) -> None:
    read = load_campaign(tmp_path)
    assert "materials.steel.density" not in by_name(read.tolerances["short"])  # the table states none
    assert not any(note.startswith("materials") for note in read.notes)


def test_misspelt_materials_are_told(tmp_path: Path) -> None:
    text = CAMPAIGN.replace('material = "carbide"', 'material = "heavy-metal-9"')
    words = 'is "heavy-metal-9", which is not a material of this file.*; the list of materials has "heavy-metal-1"'
    with pytest.raises(CampaignError, match=words):
        load_campaign(tmp_path, text)


def test_the_command_lists_materials(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    assert call("materials") == 0
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= 80
    assert all(any(line.split()[:1] == [name] for line in lines) for name in MATERIALS)
    assert call("materials", "carbide 9% Co", "--json", "-") == 0
    (found,) = json.loads(capsys.readouterr().out)["materials"].values()
    assert (found["name"], found["density"]) == ("carbide-9co", 14634.0)
    assert call("materials", "stel") == 2
    assert 'did you mean "steel"?' in capsys.readouterr().err


def test_the_command_prints_a_table_for_a_campaign(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    assert call("materials", "carbide-10co") == 0
    out = capsys.readouterr().out
    table = out[out.index("[materials.carbide-10co]") :]
    assert 'youngs_modulus = "578.2 GPa"\ndensity = "14531 kg/m^3"' in table
    assert max(map(len, out.splitlines())) <= 80
    text = WITHOUT_TABLE.replace('"carbide"', '"carbide-10co"')
    stated = load_campaign(tmp_path, f"{table}\n{text.partition(chr(10))[2]}")
    listed = load_campaign(tmp_path, text)
    assert by_name(stated.tolerances["short"]) == by_name(listed.tolerances["short"])
    assert stated.assemblies["short"].get("tool.segment[0].density") == MATERIALS["carbide-10co"].density


def test_two_flutes_are_told_to_bend_differently_in_two_directions(tmp_path: Path) -> None:
    text = FLUTES + "T3,er32,carbide,10,12,60,25,60,2,30,\nT4,er32,carbide,10,12,60,25,60,2,,\n"
    notes = {tool.row.name: " ".join(tool.notes) for tool in predict_catalogue(Catalogue(load(tmp_path, tools=text)))}
    assert "flutes" not in notes["T1"]
    assert "T2: has two straight flutes; the model has the plane y" in notes["T2"]
    assert 'plane = "x"' in notes["T2"]
    for name in ("T3", "T4"):
        assert "has two flutes, which bend differently in x and y; the model has the mean" in notes[name]
        assert "(helix of 30 deg)" in notes[name]
