"""The commands of campaigns in an empty folder: results, mistakes, exit codes, files."""

from __future__ import annotations

import gzip
import json
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from campaign_text import TEXT, changed, possible, write
from command_line import PNG, call, interrupted, left
from limits import LIMIT_S

pytestmark = pytest.mark.usefixtures("empty_folder")


def test_example_from_creation_to_prediction(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The last command runs as a user runs it: a separate process, plain text in a pipe, empty error output."""
    assert call("example", "er32") == 0
    assert call("identify", "er32") == 0
    text = capsys.readouterr().out
    done = subprocess.run(
        [sys.executable, "-W", "error", "-m", "receptance.cli", "predict",
         "er32", "--json", "p.json", "--plot", "p.png"],
        capture_output=True, cwd=tmp_path, timeout=LIMIT_S, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr.decode()
    # A slow machine prints progress.
    assert all(re.fullmatch(rb"\d+ s: .*", line) for line in done.stderr.splitlines())
    text += done.stdout.decode("utf-8")
    assert "\x1b" not in text
    assert "\u2026" not in text, "a cell was cut off"
    assert max(map(len, text.splitlines())) <= 132
    assert "held out: 20 natural frequencies and peaks" in text
    assert left() == {"er32", "p.json", "p.png"}
    assert {path.name for path in Path("er32").iterdir()} == {"campaign.toml"}
    assert Path("p.png").read_bytes().startswith(PNG)
    found = json.loads(Path("p.json").read_text())
    assert found["rms_percent"] == pytest.approx(1.09, abs=0.01)
    assert len(found["natural_frequencies"]) == 8
    assert found["identified"]["seed"] == 0


def test_identify_writes_everything_needed_to_repeat_it() -> None:
    write(Path(), changed(possible()))
    assert call("identify", "campaign.toml", "--json", "i.json", "--plot", "i.svg") == 0
    assert b"<svg" in Path("i.svg").read_bytes()
    found = json.loads(Path("i.json").read_text())
    assert list(found["parameters"]) == ["joint.k_y", "joint.k_theta"]
    for parameter in found["parameters"].values():
        low, high = parameter["interval_95"]
        assert low < parameter["value"] < high
        assert 0.9 < sum(parameter["shares_of_variance"].values()) < 1.1
        assert 0.0 < parameter["standard_error_of_data"] < parameter["standard_error"]
    assert found["correlation"]["matrix"][0][0] == 1.0
    assert [(m["name"], m["unit"], m["count"], len(m["residuals"])) for m in found["measurements"]] == [
        ("short", "standard deviations", 2, 2)
    ]
    assert found["seed"] == 0
    assert {"receptance", "python", "numpy", "scipy", "instruction_set"} <= found["versions"].keys()
    assert any("with their tolerances as priors" in note for note in found["notes"])
    assert found["settings"]["objective"] == "log"


@pytest.mark.parametrize(
    "arguments",
    [
        ("identify", "campaign.toml"),
    ],
)
def test_json_to_standard_output(arguments: tuple[str, ...], capsys: pytest.CaptureFixture[str]) -> None:
    """Standard output holds only the JSON, as in a file; the text is on standard error."""
    write(Path(), TEXT + "\n[settings]\nprofiles = false\n")
    assert call(*arguments, "--json", "-", "--plot", "p.png") == 0
    output = capsys.readouterr()
    found = json.loads(output.out)
    assert "Figure: p.png" in output.err
    assert left() == {"campaign.toml", "p.png"}
    assert call(*arguments, "--json", "f.json") == 0
    assert found == json.loads(Path("f.json").read_text())
    assert "Results: f.json" in capsys.readouterr().out
    assert call(*arguments, "--json", "-", "--plot", "-") == 2
    assert left() == {"campaign.toml", "p.png", "f.json"}


def test_every_command_with_results_has_the_options_of_output(capsys: pytest.CaptureFixture[str]) -> None:
    files = ("--json", "--plot", "--report", "--overwrite", "--quiet")
    analysing = ("identify", "predict", "transfer", "diagnose", "invert", "next", "sweep", "stability", "catalogue")
    options = dict.fromkeys((*analysing, "check", "show", "demo"), files)
    options |= {"new": ("--json", "--overwrite", "--quiet"), "convert": ("--overwrite", "--quiet")}
    for step, names in options.items():
        assert call(step, "-h") == 0
        output = capsys.readouterr().out
        assert [name for name in names if name not in output] == [], step


HOSTILE = r"5 $ \\alpha \\frac{ $ \u001b]0;owned\u0007\u001b[2J\u009b1m\u202e"
"""As TOML says it: a formula that matplotlib cannot parse, and sequences that a terminal obeys."""


@pytest.mark.slow
def test_title_is_not_interpreted(capsys: pytest.CaptureFixture[str]) -> None:
    """A title is neither a formula in figures nor a command in terminals; the JSON file has it unchanged."""
    text = changed(("A blank in a holder", HOSTILE)).replace("measurements.short]", 'measurements."s$x^$\\u001b[2J"]')
    write(Path(), text + "\n[settings]\nstarts = 2\n")
    for plot in ("i.svg", "i.pdf"):
        assert call("identify", "campaign.toml", "--json", "i.json", "--plot", plot, "--overwrite") == 0
        output = capsys.readouterr()
        assert "5 $ \\alpha \\frac{ $ \\x1b]0;owned" in output.out
        assert "\\x1b[2J\\x9b1m\\u202e: identified" in output.out
        assert not set("\x1b\x07\x9b\u202e") & set(output.out + output.err)
    assert json.loads(Path("i.json").read_text())["campaign"].endswith("\u202e")
    assert not set(b"\x1b\x07") & set(Path("i.svg").read_bytes())
    assert call("predict", "campaign.toml", "--plot", "p.svg") == 0
    write(Path(), text.replace("580 GPa", "580 \\u001b[2J"))
    assert call("identify", "campaign.toml") == 2
    output = capsys.readouterr()
    assert "\\x1b[2J" in output.err
    assert "\x1b" not in output.out + output.err


def test_results_are_not_lost_with_a_figure(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from receptance.report import figure as rendering

    def fails(figure: object, kind: str) -> bytes:
        raise RuntimeError("no such figure")

    write(Path())
    monkeypatch.setattr(rendering, "as_image", fails)
    assert call("identify", "campaign.toml", "--json", "i.json", "--plot", "i.svg") == 1
    assert "no such figure" in capsys.readouterr().err
    assert left() == {"campaign.toml", "i.json"}
    assert "joint.k_y" in json.loads(Path("i.json").read_text())["parameters"]


@pytest.mark.slow
def test_temporary_folder_is_removed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Simulated examples, compressed files and readers in processes of their own use it, and clear it."""
    used = tmp_path / "temporary"
    used.mkdir()
    monkeypatch.setenv("TMPDIR", str(used))
    monkeypatch.setattr(tempfile, "tempdir", None)
    assert call("example", "hammer") == 0
    assert call("example", "free-free") == 0
    assert call("convert", "free-free/long.csv", "long.h5") == 0
    Path("long.h5.gz").write_bytes(gzip.compress(Path("long.h5").read_bytes()))
    assert call("convert", "long.h5.gz", "long.mat") == 0
    assert call("identify", "free-free", "--plot", "i.png") == 0
    assert tempfile.gettempdir() == str(used)
    assert not list(used.iterdir())


def test_uninformative_interval_is_labelled(capsys: pytest.CaptureFixture[str]) -> None:
    """Readings with 100 % uncertainty leave the parameters undetermined, and no prediction counts as "within"."""
    write(Path(), changed(('standard_deviation = "2 Hz"', 'standard_deviation = "9 kHz"')))
    assert call("identify", "campaign.toml", "--json", "i.json") == 0
    output = capsys.readouterr().out
    assert "not determined" in output
    assert not re.search(r"e[+-]\d{3}", output)
    parameters = json.loads(Path("i.json").read_text())["parameters"]
    assert [one["determined"] for one in parameters.values()] == [False, False]
    assert call("predict", "campaign.toml", "--json", "p.json", "--plot", "p.png") == 0
    output = " ".join(capsys.readouterr().out.split())
    assert "uninformative" in output
    assert "0 of 0 within the 95 % intervals; 2 intervals are too wide to be useful" in output
    assert not re.search(r"e[+-]\d{3}", output)
    (long,) = (one for one in json.loads(Path("p.json").read_text())["natural_frequencies"] if one["name"] == "long")
    assert long["within"] == [None, None]
    assert long["interval_uninformative"] == [True, True]
    write(Path(), changed(possible()))
    assert call("predict", "campaign.toml", "--json", "p.json", "--overwrite") == 0
    (long,) = (one for one in json.loads(Path("p.json").read_text())["natural_frequencies"] if one["name"] == "long")
    assert None not in long["within"]
    assert long["interval_uninformative"] == [False, False]


def test_profiles_are_a_second_figure(capsys: pytest.CaptureFixture[str]) -> None:
    write(Path(), TEXT + "\n[settings]\nstarts = 2\n")
    assert call("identify", "campaign.toml", "--plot", "i.png") == 0
    assert left() == {"campaign.toml", "i.png", "i-profiles.png"}
    assert Path("i-profiles.png").read_bytes().startswith(PNG)
    assert "Figure: i-profiles.png" in capsys.readouterr().out
    write(Path(), TEXT + "\n[settings]\nstarts = 2\nprofiles = false\n")
    assert call("identify", "campaign.toml", "--plot", "j.png") == 0
    assert "j-profiles.png" not in left()


def test_profiles_are_computed_for_what_is_asked(capsys: pytest.CaptureFixture[str]) -> None:
    write(Path(), TEXT + "\n[settings]\nstarts = 2\n")
    assert call("identify", "campaign.toml", "--profile", "joint.k_theta", "--json", "i.json") == 0
    assert list(json.loads(Path("i.json").read_text())["profiles"]) == ["joint.k_theta"]
    assert call("identify", "campaign.toml", "--profile", "joint.k_teta") == 2
    error = " ".join(capsys.readouterr().err.split())
    assert 'no identified parameter "joint.k_teta" to profile' in error
    assert "joint.k_theta" in error
    assert call("predict", "campaign.toml", "--json", "p.json") == 0
    assert json.loads(Path("p.json").read_text())["identified"]["profiles"] == {}


def test_unmeasured_assemblies_are_predicted(capsys: pytest.CaptureFixture[str]) -> None:
    """Without anything held out the assemblies without measurements are predicted."""
    text = TEXT.replace('role = "hold out"\n', "")
    write(Path(), text)
    assert call("predict", ".", "--json", "p.json", "--plot", "p.png") == 0
    output = capsys.readouterr().out
    assert "Assemblies that were not measured" in output
    assert "Held out" not in output
    found = json.loads(Path("p.json").read_text())
    assert [one["name"] for one in found["frfs"]] == ["longest"]
    assert found["rms_percent"] is None
    frf = found["frfs"][0]
    assert len(frf["frequency_hz"]) == len(frf["receptance"]) == len(frf["magnitude_interval"][0]) > 1000
    assert frf["frequency_hz"][-1] == pytest.approx(10000.0)


def test_campaign_without_unknowns_is_predicted_from_given_values() -> None:
    joint = '[joints.joint]\nk_y = "4e8 N/m"\nk_theta = "6e4 N m/rad"'
    text = changed(("[joints.joint]", joint)).partition("[unknowns]")[0]
    write(Path(), text)
    assert call("predict", "campaign.toml", "--json", "p.json") == 0
    found = json.loads(Path("p.json").read_text())
    assert found["identified"] is None
    assert found["natural_frequencies"][0]["standard_error_hz"][0] > 0.0
    assert call("identify", "campaign.toml") == 2


@pytest.mark.parametrize(
    ("edit", "arguments", "words"),
    [
        (None, ["identify", "campain.toml"], "file or folder campain.toml; did you mean campaign.toml?"),
        (None, ["diagnose", "er32"], "folder er32; `receptance example er32` writes the example of this name"),
        (None, ["identify"], "CAMPAIGN"),
        (None, ["identify", "campaign.toml", "--jsn", "a"], "--jsn"),
        (None, ["identify", ".", "--json", "campaign.toml"], "--json names campaign.toml, which is the campaign"),
        (None, ["identify", "campaign.toml", "--json", "no/a.json"], "there is no folder no"),
        (None, ["predict", "campaign.toml", "--plot", "a.txt"], "expected an ending with a format of figures"),
        (None, ["predict", "campaign.toml", "--at-most", "-1"], "--at-most"),
        (('length = "60 mm"', 'length = "60 mn"'), ["identify", "."], "parts.tool.segments[0].length"),
        (('["2500 Hz", "10000 Hz"]', '["2500 Hz"]'), ["identify", "."], "2 unknowns but only 1 observed"),
        (('standard_deviation = "2 Hz"', 'role = "hold out"'), ["identify", "."], "no measurement for identification"),
        (None, ["example", "er33"], 'there is no example "er33", expected one of "bt50", "drawing"'),
        (None, ["example", "er32", "campaign.toml"], "cannot write to campaign.toml: it is a file"),
        (None, ["example", "er32", "."], "campaign.toml exists already; choose another folder"),
        (None, ["example"], "no example given, expected one of bt50, drawing"),
    ],
)  # fmt: skip
def test_mistake_prints_message_without_traceback(
    edit: tuple[str, str] | None,
    arguments: list[str],
    words: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    write(Path(), TEXT if edit is None else changed(edit))
    assert call(*arguments) == 2
    output = capsys.readouterr()
    assert words in output.err
    assert "Traceback" not in output.err
    assert output.out == ""
    assert left() == {"campaign.toml"}


def test_no_assembly_to_predict(capsys: pytest.CaptureFixture[str]) -> None:
    lines = [line for line in TEXT.replace("assemblies.longest", "assemblies.again").splitlines() if "role" not in line]
    again = [
        "[measurements.again]",
        'kind = "natural frequencies"',
        'assembly = "again"',
        'frequencies = ["900 Hz"]',
        'standard_deviation = "2 Hz"',
    ]
    write(Path(), "\n".join([*lines, *again, ""]))
    assert call("predict", ".") == 2
    assert "there is nothing to predict" in capsys.readouterr().err
    assert call("predict", ".", "--at-most", "1") == 2
    assert "--at-most needs held-out measurements" in capsys.readouterr().err


def test_confirmation_declined(capsys: pytest.CaptureFixture[str]) -> None:
    """Exit code 3 with --at-most or --strict, after all files are written."""
    assert call("example", "er32") == 0
    assert call("predict", "er32", "--at-most", "3") == 0
    assert "At most 3 %: yes, the largest error is 2.07 %" in capsys.readouterr().out
    assert call("predict", "er32", "--at-most", "1", "--json", "p.json") == 3
    assert "At most 1 %: no" in capsys.readouterr().out
    assert Path("p.json").is_file()
    assert call("identify", "er32", "--strict") == 0
    text = (
        Path("er32/campaign.toml")
        .read_text()
        .replace('"joint_d7.k_y" = { lower = "1e6', '"joint_d7.k_y" = { lower = "1e9')
    )
    Path("er32/campaign.toml").write_text(text)
    assert call("identify", "er32", "--strict") == 3
    assert call("identify", "er32") == 0


@pytest.mark.slow
def test_seed_of_the_command_replaces_that_of_the_file(capsys: pytest.CaptureFixture[str]) -> None:
    """Drawn starts and drawn cutting coefficients depend on the seed; without the option it is that of the file."""
    assert call("example", "machine") == 0
    found = {}
    for seed in ((), ("--seed", "0"), ("--seed", "5")):
        assert call("stability", "machine", *seed, "--json", "found.json", "--overwrite") == 0
        found[seed] = json.loads(Path("found.json").read_text(encoding="utf-8"))
    assert found["--seed", "0"] == found[()] != found["--seed", "5"]
    assert call("identify", "machine", "--seed", "5", "--json", "found.json", "--overwrite") == 0
    assert json.loads(Path("found.json").read_text(encoding="utf-8"))["seed"] == 5
    assert call("identify", "machine", "--seed", "-1") == 2


@pytest.mark.parametrize(
    ("command", "option"),
    [
        (("identify", "machine"), "--json"),
        (("diagnose", "machine"), "--extended"),
        (("sweep", "machine", "--sample", "3"), "--json"),
        (("catalogue", "machine"), "--figures"),
        (("convert", "machine/campaign.toml"), "OUT"),
    ],
)
def test_a_file_is_replaced_only_with_overwrite(
    command: tuple[str, ...], option: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """The refusal comes before the work, names option and file, and leaves everything as it was."""
    assert call("example", "machine") == 0
    endings = {"--json": ".json", "--plot": ".png", "--report": ".html", "--extended": ".toml", "--out": ".csv"}
    target = Path("figures/T01.png") if option == "--figures" else Path(f"older{endings.get(option, '.csv')}")
    target.parent.mkdir(exist_ok=True)
    if option == "--figures":
        for name in _tool_names():
            (target.parent / f"{name}.png").write_text("older")
        target = next(target.parent.iterdir())
    target.write_text("older")
    given = {"OUT": [str(target)], "--figures": [option, "figures"]}.get(option, [option, str(target)])
    assert call(*command, *given) == 2
    assert f"{option} would replace" in capsys.readouterr().err
    assert target.read_text() == "older"


def test_the_profiles_of_an_older_figure_are_kept(capsys: pytest.CaptureFixture[str]) -> None:
    assert call("example", "machine") == 0
    Path("a-profiles.png").write_text("older")
    assert call("identify", "machine", "--plot", "a.png") == 2
    assert "--plot would replace a-profiles.png" in capsys.readouterr().err
    assert not Path("a.png").exists()
    assert call("identify", "machine", "--plot", "a.png", "--overwrite") == 0
    assert Path("a.png").exists()


def _tool_names() -> list[str]:
    """Return the names of the tools of the example machine."""
    from receptance import campaign
    from receptance.catalogue import Catalogue

    return [row.name for row in Catalogue(campaign.load("machine"), None, None).tools]


def test_examples_are_listed_and_not_written_over(capsys: pytest.CaptureFixture[str]) -> None:
    assert call("example", "--list") == 0
    assert "published natural frequencies" in capsys.readouterr().out
    assert call("example", "er32", "some/where") == 0
    assert "Written: some/where/campaign.toml" in capsys.readouterr().out
    assert call("example", "er32", "some/where") == 2
    assert call("example", "er32", "some/where", "--overwrite") == 0


def test_failed_example_leaves_no_files(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(_: int) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "fsync", interrupt)
    assert call("example", "er32", "some/where") == 130
    assert left() == set()


def test_schema(capsys: pytest.CaptureFixture[str]) -> None:
    assert call("schema") == 0
    assert json.loads(capsys.readouterr().out)["title"] == "receptance campaign"
    assert call("schema", "--markdown") == 0
    assert "| `youngs_modulus` | needed |" in capsys.readouterr().out


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_interruption_during_computation(tmp_path: Path) -> None:
    write(tmp_path, TEXT + "[settings]\nstarts = 100000\n")
    code, out, err = interrupted("identify", "campaign.toml", "--json", "i.json")
    assert code == 130, err
    assert "interrupted, no file was left incomplete" in err
    assert "Traceback" not in err
    assert out == ""
    assert left() == {"campaign.toml"}


def test_every_assembly_from_the_others(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """One tool of the published campaign, three overhangs: each predicted from the other two."""
    from dataclasses import replace

    from receptance import campaign, examples

    read = campaign.load(examples.write("er32", "er32")[0])
    kept = {name: one for name, one in read.measurements.items() if one.configuration.startswith("d9_")}
    unknowns = tuple(one for one in read.unknowns if one.address.startswith("joint_d9."))
    one_tool = replace(read, measurements=kept, unknowns=unknowns)
    monkeypatch.setattr(campaign, "load", lambda *_, **__: one_tool)
    assert call("transfer", "er32", "--json", "t.json", "--plot", "t.png") == 0
    text = capsys.readouterr().out
    # Nine errors for four readings absorb a part of the error of the inferred holder, and two fits pass the test.
    inside = re.search(r"(\d) of 7 in their 95 % intervals", " ".join(text.split()))
    assert inside is not None
    assert int(inside[1]) >= 5
    found = json.loads(Path("t.json").read_text())
    assert [split["held_out"] for split in found["splits"]] == [["d9_medium"], ["d9_short"], ["d9_long"]]
    assert all("d9" in name for split in found["splits"] for name in split["fitted"])
    assert 0.3 < found["rms_percent"] < 1.5
    assert Path("t.png").read_bytes().startswith(PNG)


def test_impossible_transfer(capsys: pytest.CaptureFixture[str]) -> None:
    assert call("example", "er32") == 0
    assert call("transfer", "er32", "--splits", "some") == 2
    assert "--splits is 'some', expected leave-one-out or one-for-all" in capsys.readouterr().err
    from dataclasses import replace

    from receptance import campaign

    read = campaign.load("er32")
    first = next(iter(read.measurements))
    alone = replace(read, measurements={first: read.measurements[first]})
    with pytest.raises(campaign.CampaignError, match="expected at least two"):
        alone.transfer()
    with pytest.raises(campaign.CampaignError, match="there are no unknowns"):
        replace(read, unknowns=()).transfer()
