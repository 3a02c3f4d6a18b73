"""The command `new`: campaigns from files and answers, and what it refuses."""

from __future__ import annotations

import io
import re
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import foreign_beam
from command_line import call
from receptance import CARBIDE, FRF, MATERIALS, campaign, examples
from receptance.io import Coherence, TimeSeries, read_frf, write

ANSWERS = {
    "--overhang": "60 mm",
    "--tool": "20 mm",
    "--tool-material": "carbide",
    "--holder": "48 mm x 50 mm, 90 mm x 44/16 mm",
    "--holder-material": "steel",
    "--insertion": "48 mm",
    "--sensor": "2 g",
    "--support": "free",
}


def options(without: tuple[str, ...] = (), **changed: str) -> list[str]:
    """Return all options, some of them left out or with other values."""
    own = ANSWERS | {f"--{name.replace('_', '-')}": value for name, value in changed.items()}
    return [word for pair in own.items() if pair[0] not in without for word in pair]


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setattr("sys.stdin", io.StringIO())
    beam = replace(foreign_beam.PROTOCOL, step_hz=50.0, span_hz=950.0)
    headers = {60.0: "Mittelungen;10\nFrequenz [Hz];Real [g/N];Imag [g/N];Coh\n", 80.0: "Frequenz;Real;Imag;Coh\n"}
    for (overhang, header), name in zip(headers.items(), ("tool_60mm.csv", "bare.csv"), strict=True):
        pairs = zip(beam.lines, foreign_beam.accelerance(beam, overhang, 0.0), strict=True)
        rows = [f"{f:g};{h.real:.6e};{h.imag:.6e};0,99\n".replace(".", ",") for f, h in pairs]
        Path(name).write_text(header + "".join(rows))


def left() -> set[str]:
    return {str(path) for path in Path().rglob("*") if path.is_file() or not any(path.iterdir())}


BEFORE = {"tool_60mm.csv", "bare.csv"}


def test_a_campaign_from_options(capsys: pytest.CaptureFixture[str]) -> None:
    assert call("new", "a/b", "tool_60mm.csv", *options()) == 0
    text = capsys.readouterr().out
    assert "Written: a/b/campaign.toml" in text
    assert "Next: receptance check a/b" in text
    assert max(map(len, text.splitlines())) <= 80
    found = campaign.load("a/b")
    (measured,) = found.measurements.values()
    assert (measured.label, found.table.measurements["tool_60mm"].sensor, found.files_of("tool_60mm")) == (
        "tool_60mm",
        "accelerometer",
        ("../../tool_60mm.csv",),
    )
    assembly = found.assemblies["tool_60mm"]
    assert list(assembly.elements) == ["tool", "joint", "holder"]
    assert assembly.get("tool.segment[0].length") == pytest.approx(0.06)
    assert assembly.get("tool.segment[0].youngs_modulus") == CARBIDE.youngs_modulus
    assert assembly.get("holder.segment[0].core.density") == CARBIDE.density
    assert assembly.get("holder.segment[0].inner_diameter") == pytest.approx(0.02)
    assert measured.assembly.get("accelerometer.mass") == pytest.approx(0.002)
    assert [unknown.name for unknown in found.unknowns] == [f"joint.{n}" for n in ("k_y", "k_theta", "c_y", "c_theta")]
    assert campaign.CampaignCheck(found).missing["diagnose"] == ""
    assert left() == BEFORE | {"a/b/campaign.toml"}


def test_flutes_have_an_effective_diameter() -> None:
    assert call("new", "made", "tool_60mm.csv", *options(tool="30 mm x 16 mm, 20 mm")) == 0
    flutes, shank = tomllib.loads(Path("made/campaign.toml").read_text())["parts"]["tool"]["segments"]
    assert flutes["tolerance"]["outer_diameter"] == "3 %"
    assert shank["tolerance"]["outer_diameter"] == "0.05 %"


def test_the_file_is_commented_and_holds_the_answers() -> None:
    assert call("new", "made", "tool_60mm.csv", *options(title='A "tool"')) == 0
    text = Path("made/campaign.toml").read_text()
    assert sum(line.startswith("#") for line in text.splitlines()) > 10
    assert max(map(len, text.splitlines())) <= 120
    data = tomllib.loads(text)
    assert data["title"] == 'A "tool"'
    assert data["parts"]["holder"]["segments"][1] == {
        "length": "90 mm",
        "outer_diameter": "44 mm",
        "inner_diameter": "16 mm",
        "material": "steel",
        "tolerance": {"length": "0.1 mm", "outer_diameter": "0.1 %", "inner_diameter": "0.3 %"},
    }


def test_existing_files_are_kept(capsys: pytest.CaptureFixture[str]) -> None:
    Path("mine").mkdir()
    Path("mine/campaign.toml").write_text("mine")
    assert call("new", "mine", "tool_60mm.csv", *options()) == 2
    assert "mine/campaign.toml exists already; choose another folder, or replace it with --overwrite" in (
        capsys.readouterr().err
    )
    assert Path("mine/campaign.toml").read_text() == "mine"
    assert call("new", "mine", "tool_60mm.csv", *options(support="wall"), "--overwrite") == 2
    assert Path("mine/campaign.toml").read_text() == "mine"
    assert call("new", "mine", "tool_60mm.csv", *options(), "--overwrite") == 0
    assert len(campaign.load("mine").measurements) == 1


def test_all_missing_options_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    columns = ["--columns", "Frequenz [Hz],Real,Imag,Coh", "--unit", "g/N"]
    assert call("new", "made", "bare.csv", *columns) == 2
    error = capsys.readouterr().err
    assert "standard input is not a terminal" in error
    for option in (*ANSWERS, "--averages"):
        assert f"  {option} " in error
    assert left() == BEFORE
    # What is listed is what is missing: with it the command runs.
    listed = dict(re.findall(r"^  (--[a-z-]+) ('[^']*'|\S+)", error, re.MULTILINE))
    answers = [word for pair in listed.items() for word in (pair[0], pair[1].strip("'"))]
    assert call("new", "made", "bare.csv", *columns, *answers) == 0
    assert campaign.load("made").measurements["bare"].weighted


class Terminal(io.StringIO):
    """Standard input of a user who types some lines."""

    def isatty(self) -> bool:
        return True


def test_questions_on_a_terminal(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    answers = [
        *("Frequenz [Hz],Real,Imag,Coh", "g/N", "none", "12", "", "80", "80 mm", "20 mm", "carbid", "carbide"),
        *("48 mm x 50 mm, 90x44/16 mm", "steel", "400 mm", "48 mm", "laser", "spindle"),
        *("", "tip", "", "holder@4", "holder@4 mm"),
    ]
    monkeypatch.setattr("sys.stdin", Terminal("\n".join(answers) + "\n"))
    assert call("new", "made", "tool_60mm.csv", "bare.csv") == 0
    text = capsys.readouterr().out
    said = ('this is "none", expected a whole number', 'this is "80", without a unit', "did you mean", "400 mm")
    for words in (
        *said,
        'this is "holder@4", whose distance is "4", without a unit',
        "no record has hit and sensor on",
    ):
        assert words in text
    assert "Overhang of tool_60mm, from the holder's face to the tip (such as 60 mm) [60 mm]" in text
    made = campaign.load("made")
    assert list(made.assemblies["bare"].elements) == ["tool", "joint", "holder", "spindle"]
    assert made.assemblies["tool_60mm"].get("tool.segment[0].length") == pytest.approx(0.06)
    assert made.assemblies["bare"].get("tool.segment[0].length") == pytest.approx(0.08)
    assert made.table.measurements["bare"].averages == 12
    assert (made.measurements["bare"].response.part, made.measurements["bare"].excitation.part) == ("tool", "holder")
    assert made.table.measurements["tool_60mm"].unit is None


def test_the_end_of_the_input_leaves_nothing(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.stdin", Terminal("60 mm\n20 mm\n"))
    assert call("new", "made", "tool_60mm.csv") == 130
    assert "interrupted, no file was left incomplete" in capsys.readouterr().err
    assert left() == BEFORE


def test_an_interruption_leaves_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    class Interrupted(Terminal):
        def readline(self, *arguments: object) -> str:
            raise KeyboardInterrupt

    monkeypatch.setattr("sys.stdin", Interrupted())
    assert call("new", "made", "tool_60mm.csv") == 130
    assert left() == BEFORE


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["made", "no.csv", *options()], "there is no file no.csv"),
        (["tool_60mm.csv", "bare.csv", *options()], "tool_60mm.csv is a file, expected first the folder"),
        (["made", "tool_60mm.csv", "./tool_60mm.csv", *options()], "tool_60mm.csv is given twice"),
        (["made", "bare.csv", *options()], r"bare.csv, line 1: .*--columns 'Frequenz \[Hz\],Real,Imag,Coh'"),
        (["made", "tool_60mm.csv", *options(overhang="60")], '--overhang of tool_60mm is "60", without a unit'),
        (["made", "tool_60mm.csv", *options(overhang="x=60 mm")], '--overhang names "x", expected "tool_60mm"'),
        (["made", "tool_60mm.csv", *options(), "--overhang", "9 mm"], "2 --overhang are given for 1 measurements"),
        (["made", "tool_60mm.csv", *options(tool="12,7 mm")], "--tool is .*decimals are written with a point"),
        (["made", "tool_60mm.csv", *options(tool="70 mm x 9 mm, 20 mm")], "overhang of tool_60mm is 60 mm, expected"),
        (["made", "tool_60mm.csv", *options(tool_material="wood")], '--tool-material is "wood", expected one of'),
        (["made", "tool_60mm.csv", *options(holder="50 mm")], "--holder is .* has no length"),
        (["made", "tool_60mm.csv", *options(holder="no.csv")], "there is no file no.csv"),
        (
            ["made", "tool_60mm.csv", *options(holder="48 mm x 20 mm")],
            "--insertion is 48 mm, but the shank of tool has 20 mm and .* an outer diameter of 20 mm",
        ),
        (
            ["made", "tool_60mm.csv", *options(insertion="1 m")],
            "--insertion is 1000 mm, longer than the bore .* shank of 20 mm, which is 48 mm deep; .* a bore of 16 mm",
        ),
        (["made", "tool_60mm.csv", *options(sensor="2")], '--sensor is "2", without a unit.*, or none'),
        (["made", "tool_60mm.csv", *options(support="wall")], '--support is "wall", expected one of "free", "spindle"'),
        (["made", "tool_60mm.csv", *options(), "--spindle-modes", "2"], "expected --support spindle"),
        (["made", "tool_60mm.csv", *options(averages="5")], "--averages is 5, but tool_60mm.csv states 10"),
        (["made", "tool_60mm.csv", *options(standard_deviation="2")], '--standard-deviation is "2", expected'),
        (["made", "tool_60mm.csv", *options(hold_out="x")], '--hold-out names "x", expected "tool_60mm"'),
        (["made", "tool_60mm.csv", *options(hold_out="tool_60mm")], "--hold-out names all measurements"),
        (["made", "tool_60mm.csv", *options(material="alu")], '--material is "alu", expected "NAME ='),
        (["made", "tool_60mm.csv", *options(material="alu = 70 kg, 1 kg/m^3")], "a mass, expected a modulus"),
        (["made", "coh.csv", *options()], "coh.csv holds Coherence.* --coherence coh.csv"),
        (["made", "two.csv", *options()], "two.csv has 2 channels with the unit of a force, expected --force"),
        (["made", "matrix.npz", *options()], "2 responses and 1 excitations"),
    ],
)
def test_new_refuses(arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]) -> None:
    lines = np.arange(1.0, 20.0)
    write("coh.csv", Coherence(frequency_hz=lines, values=np.full(19, 0.9)))
    write("two.csv", TimeSeries(values=np.ones((9, 2)), channels=["a", "b"], units=["N", "N"], sample_rate_hz=1e4))
    write("matrix.npz", FRF(frequency_hz=lines, values=np.ones((19, 2, 1)), responses=["y", "theta"]))
    before = left()
    assert call("new", *arguments) == 2
    error = capsys.readouterr().err
    assert re.search(message, error), error
    assert "Traceback" not in error
    assert left() == before


def test_hammer_records() -> None:
    examples.write("hammer", "hammer")
    assert call("new", "made", "hammer/short.npz", *options()) == 0
    table = campaign.load("made").table.measurements["short"]
    assert (table.kind, table.force, table.motion) == ("hammer records", "hammer", "tip")


def test_several_frfs_in_a_file() -> None:
    frf = read_frf("tool_60mm.csv")
    write("both.npz", [frf, frf.with_(values=1.1 * frf.values)])
    overhangs = ["--overhang", "both 1=60 mm", "--overhang", "both 2=80 mm"]
    assert call("new", "made", "both.npz", *options(without=("--overhang",)), *overhangs) == 0
    found = campaign.load("made")
    assert [found.table.measurements[name].entry.number for name in ("both 1", "both 2")] == [0, 1]
    assert found.assemblies["both 2"].get("tool.segment[0].length") == pytest.approx(0.08)


def test_holders_from_files() -> None:
    Path("h.csv").write_text(
        "holder,length [mm],outer diameter [mm],inner diameter [mm],material,core\n"
        "small,40,30,20,steel,carbide\nbig,48,50,20,steel,carbide\nbig,90,44,16,steel,\n"
    )
    Path("h.toml").write_text(
        '[[segments]]\nlength = "48 mm"\nouter_diameter = "50 mm"\n[[segments]]\nlength = "90 mm"\n'
        'outer_diameter = "44 mm"\ninner_diameter = "16 mm"\n'
    )
    assert call("new", "text", "tool_60mm.csv", *options()) == 0
    assert call("new", "toml", "tool_60mm.csv", *options(holder="h.toml")) == 0
    without = ("--insertion", "--holder-material")
    assert call("new", "csv", "tool_60mm.csv", *options(without=without, holder="h.csv:big")) == 0
    holders = [
        tomllib.loads(Path(f"{n}/campaign.toml").read_text())["parts"]["holder"] for n in ("text", "toml", "csv")
    ]
    assert holders[0] == holders[1] == holders[2]


@pytest.mark.parametrize(
    ("name", "content", "holder", "message"),
    [
        ("h.csv", "holder,length [mm]\n", "h.csv", "names a file with mistakes"),
        ("h.csv", "holder,length [mm],outer diameter [mm],material\na,1,2,s\nb,1,2,s\n", "h.csv", "such as h.csv:a"),
        ("h.csv", "holder,length [mm],outer diameter [mm],material\na,1,2,s\n", "h.csv:b", 'has no "b"'),
        ("h.toml", "x = ", "h.toml", "is not TOML"),
        ("h.toml", "x = 1", "h.toml", r"has neither \[\[segments\]\] nor"),
        ("h.toml", '[[segments]]\nlength = "1 mm"', "h.toml", r"segments\[0\]\.outer_diameter: is missing"),
        (
            "h.toml",
            '[[segments]]\nlength = "1 kg"\nouter_diameter = "9 mm"',
            "h.toml",
            r"line 2, segments\[0\]\.length: is .*mass",
        ),
        ("h.txt", "48 mm", "h.txt", "expected .csv or .toml"),
    ],
)
def test_wrong_files_of_holders(
    name: str,
    content: str,
    holder: str,
    message: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    Path(name).write_text(content)
    assert call("new", "made", "tool_60mm.csv", *options(holder=holder)) == 2
    assert re.search(message, capsys.readouterr().err)
    assert left() == {*BEFORE, name}


def test_ends_of_low_coherence_are_left_out() -> None:
    frf = read_frf("tool_60mm.csv")
    lines = np.arange(200.0, 1000.0, 5.0)
    coherence = np.where(lines < 300.0, 0.4, 0.99)
    coherence[80] = 0.1  # an antiresonance inside the band is no end
    noisy = FRF(frequency_hz=lines, values=np.full(lines.size, 1e-3 + 1e-5j), coherence=coherence, averages=10)
    write("noisy.npz", noisy)
    assert call("new", "made", "noisy.npz", *options()) == 0
    (band,) = tomllib.loads(Path("made/campaign.toml").read_text())["measurements"]["noisy"]["bands"]
    assert band == ["300 Hz", "995 Hz"]
    assert frf.coherence is not None


def test_pieces_with_other_units(monkeypatch: pytest.MonkeyPatch) -> None:
    pieces = options(tool="30x9.6 mm, 0.5 in", holder="40 mm x 50/12.7 mm, 6 cm x 40 mm", insertion="55 mm")
    assert call("new", "made", "tool_60mm.csv", *pieces) == 0
    parts = tomllib.loads(Path("made/campaign.toml").read_text())["parts"]
    sizes = [
        (row["length"], row["outer_diameter"], row.get("inner_diameter"), row.get("core"))
        for name in ("tool", "holder")
        for row in parts[name]["segments"]
    ]
    assert sizes == [
        ("30 mm", "9.6 mm", None, None),
        ("30 mm", "12.7 mm", None, None),
        ("40 mm", "50 mm", "12.7 mm", "carbide"),
        ("15 mm", "40 mm", "12.7 mm", "carbide"),
        ("45 mm", "40 mm", None, None),
    ]


@pytest.mark.parametrize("text", ["", "mm", "50/60 mm", "10 mm x 5 mm x 3 mm", "10 kg", "-5 mm", "1 mm/"])
def test_wrong_pieces(text: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    assert call("new", "made", "tool_60mm.csv", *options(tool=text)) == 2
    assert f'--tool is "{text}"' in capsys.readouterr().err
    assert left() == BEFORE


def test_another_material(monkeypatch: pytest.MonkeyPatch) -> None:
    given = options(material="aluminium = 70 GPa, 2.7 g/cm^3, 0.33", holder_material="aluminium", insertion="none")
    assert call("new", "made", "tool_60mm.csv", *given) == 0
    holder = campaign.load("made").assemblies["tool_60mm"]
    assert holder.get("holder.segment[0].youngs_modulus") == 70e9
    assert holder.get("holder.segment[0].density") == pytest.approx(2700.0)


@pytest.mark.parametrize("name", ["steel", "carbide", "carbide-10co"])
def test_listed_material(name: str) -> None:
    """The file states values and scatter of the list, so that it is the same when the list changes."""
    assert call("new", "made", "tool_60mm.csv", *options(tool_material=name)) == 0
    made, listed = campaign.load("made"), MATERIALS[name]
    assert made.assemblies["tool_60mm"].get("tool.segment[0].density") == pytest.approx(listed.density)
    errors = {error.name: error for error in made.tolerances["tool_60mm"]}
    for field, deviation in listed.deviations.items():
        moves = errors[f"materials.{name}.{field}"].moves
        assert moves[f"tool.segment[0].{field}"] == pytest.approx(deviation, rel=1e-3), field


def in_spindle(*places: str) -> list[str]:
    """Return the options of a holder in a spindle with hits and sensors at places."""
    return [*options(support="spindle"), *places]


def three_files() -> list[str]:
    """Write two more files like the first."""
    frf = read_frf("tool_60mm.csv")
    for name, factor in (("across.csv", 0.8), ("nose.csv", 0.5)):
        write(name, frf.with_(values=factor * frf.values))
    return ["tool_60mm.csv", "across.csv", "nose.csv"]


def test_roving_hits_are_in_one_clamping(capsys: pytest.CaptureFixture[str]) -> None:
    files = three_files()
    places = ["--response", "tip", "--response", "tip", "--response", "nose"]
    places += ["--hit", "tip", "--hit", "holder@4 mm -Z", "--hit", "holder@end"]
    assert call("new", "made", *files, *in_spindle(*places)) == 0
    assert "Missing" not in capsys.readouterr().out
    made = campaign.load("made")
    assert list(made.assemblies) == ["overhang 60 mm"]
    seen = made.table.measurements
    assert (seen["across"].excitation.part, seen["across"].excitation.position) == ("holder", pytest.approx(0.004))
    assert (seen["across"].excitation.direction, seen["across"].response.direction) == ("-y", "+y")
    assert (seen["nose"].response.part, seen["nose"].excitation.position) == ("holder", "end")
    assert campaign.missing_records(made) == ()


@pytest.mark.parametrize(
    ("hits", "words"),
    [
        (["tip", "tip", "tip"], ("no record is across joint", "no record has hit and sensor on holder")),
        (["tip", "nose", "holder@4 mm"], ("no record has hit and sensor on holder",)),
    ],
)
def test_records_that_are_missing_are_named_with_what_to_type(
    hits: list[str], words: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    """What the message says to type is what is missing."""
    files = three_files()
    chosen = [word for hit in hits for word in ("--hit", hit)]
    assert call("new", "made", *files, *in_spindle("--response", "tip", *chosen)) == 0
    output = " ".join(capsys.readouterr().out.split())
    missing = campaign.missing_records(campaign.load("made"))
    assert len(missing) == len(words)
    for text, expected in zip(missing, words, strict=True):
        assert expected in text
        assert expected in output
        assert text in campaign.CampaignCheck(campaign.load("made")).warnings()
    places = re.findall(r"--response '(.+?)' --hit '(.+?)'", " ".join(missing))
    assert len(places) == len(words)
    added = [word for response, hit in places for word in ("--response", response, "--hit", hit)]
    rest = ["--response", "tip", "--hit", "nose"] * (3 - len(places))
    assert call("new", "again", *files, *in_spindle(*added, *rest)) == 0
    assert campaign.missing_records(campaign.load("again")) == ()


@pytest.mark.parametrize(
    ("header", "directions"),
    [
        ("Frequency (Hz),1:+Z/2:-Z Real (g/N),1:+Z/2:-Z Imag (g/N)", ("+y", "-y")),
        (
            "Frequency [Hz],H1(Point 1 -X;Point 2 -X) Real [m/s²/N],H1(Point 1 -X;Point 2 -X) Imag [m/s²/N]",
            ("-y", "-y"),
        ),
        ("Frequency (Hz),Z- Real ((m/s^2)/N),Z- Imaginary ((m/s^2)/N)", ("+y", "+y")),
        ("Frequency Hz,Real Y+ Y- g/N,Imag Y+ Y- g/N", ("+y", "-y")),
        ("Hz,1:-3/7:+3 Real [g/N],1:-3/7:+3 Imag [g/N]", ("-y", "+y")),
    ],
)
def test_directions_in_the_header(header: str, directions: tuple[str, str]) -> None:
    """Both are read, or none: one alone does not say whether the other has the same sign."""
    rows = [f"{10 * i},{i},{-0.1 * i}" for i in range(1, 9)]
    Path("one.csv").write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    given = ["--standard-deviation", "2 %", "--hit", "holder@4 mm", "--response", "tip"]
    assert call("new", "made", "one.csv", *in_spindle(*given)) == 0
    table = campaign.load("made").table.measurements["one"]
    assert (table.response.direction, table.excitation.direction) == directions


@pytest.mark.parametrize(
    ("places", "message"),
    [
        (["--hit", "holder4"], '--hit of tool_60mm is "holder4", expected a place such as "tool@0 mm"'),
        (["--hit", "body@3 mm"], '--hit of tool_60mm is "body@3 mm", which names "body", expected one of "tool"'),
        (["--hit", "holder@4 kg"], 'whose distance is "4 kg", a mass, expected a place'),
        (["--hit", "holder@900 mm"], "--hit of tool_60mm: is 900 mm, expected at most the length 138 mm"),
        (["--hit", "tip -X +Z"], "expected a place such as"),
        (["--hit", "tip", "--hit", "nose"], "2 --hit are given for 1 measurements, expected one for each"),
        (
            ["--hit", "tip +X", "--response", "tip +Z"],
            "the response is along Z and the hits along X, expected one axis",
        ),
        ([], r"--response 'tool_60mm=tool@0 mm'  Place of the sensor"),
    ],
)
def test_wrong_places(places: list[str], message: str, capsys: pytest.CaptureFixture[str]) -> None:
    before = left()
    more = ["--response", "tip"] if places and "--response" not in places else []
    assert call("new", "made", "tool_60mm.csv", *in_spindle(*places, *more)) == 2
    assert message in capsys.readouterr().err
    assert left() == before


def test_one_overhang_of_several_files_without_hits_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert call("new", "made", *three_files(), *options()) == 2
    assert "1 --overhang is given for 3 measurements, expected one for each" in capsys.readouterr().err
