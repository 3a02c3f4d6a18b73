"""The commands `show` and `check`: what they print, draw and refuse."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

from command_line import PNG, call, left
from receptance import FRF, _files, campaign, examples
from receptance.cli import files as module
from receptance.io import Coherence, TimeSeries, write

GERMAN = "Messung;7\nFrequenz [Hz];Real [g/N];Imag [g/N];Coh\n" + "".join(
    f"{f};{1 + f / 100:.3f};-0.5;0.99\n".replace(".", ",") for f in range(10, 60)
)


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")


def test_show_prints_what_was_understood(capsys: pytest.CaptureFixture[str]) -> None:
    Path("tip.csv").write_text(GERMAN)
    assert call("show", "tip.csv", "--plot", "tip.png") == 0
    text = capsys.readouterr().out
    for words in (
        "tip.csv: FRF",
        "50, 10 to 59 Hz, 1 Hz apart",
        "accelerance in m/s^2/N",
        "median 0.99, lowest 0.99",
        "tip.csv (table with a header)",
        "- 1 line before line 2 was not read",
        "Figure: tip.png",
    ):
        assert words in text
    assert max(map(len, text.splitlines())) <= 80
    assert Path("tip.png").read_bytes().startswith(PNG)
    assert left() == {"tip.csv", "tip.png"}


def test_show_writes_what_was_understood(capsys: pytest.CaptureFixture[str]) -> None:
    Path("tip.csv").write_text(GERMAN)
    assert call("show", "tip.csv", "--json", "-", "--report", "tip.html") == 0
    output = capsys.readouterr()
    found = json.loads(output.out)
    assert found["format"] == "table with a header"
    (frf,) = found["measurements"]
    assert (frf["kind"], frf["form"], frf["units"]) == ("frf", "accelerance", ["m/s^2/N"])
    assert (frf["lines"], frf["band_hz"], frf["median_coherence"]) == (50, [10.0, 59.0], pytest.approx(0.99))
    assert "Report: tip.html" in output.err
    page = Path("tip.html").read_text()
    assert "accelerance in m/s^2/N" in page
    assert "<svg" in page
    assert left() == {"tip.csv", "tip.html"}


def test_show_of_every_kind_of_measurement(capsys: pytest.CaptureFixture[str]) -> None:
    lines = np.arange(10.0, 20.0)
    write("hit.csv", TimeSeries(values=[[0.0, 1.0], [2.0, -3.5]], channels=["f", "a"], units=["N", "g"],
                                sample_rate_hz=1000.0))  # fmt: skip
    write("coh.csv", Coherence(frequency_hz=lines, values=np.full(10, 0.75)))
    many = [FRF(frequency_hz=lines, values=np.ones(10) * (1 + 1j), form="mobility", label=f"p{i}") for i in range(6)]
    write("many.npz", many)
    for name, words in (
        ("hit.csv", ("2 at 1000 Hz", "force", "acceleration", "34.32")),
        ("coh.csv", ("10, 10 to 19 Hz", "median 0.75")),
        ("many.npz", ("6: FRF p5", "the first 4 of 6 measurements; `--number", "N` shows another")),
    ):
        assert call("show", name, "--plot", "a.svg", "--overwrite") == 0
        text = capsys.readouterr().out
        assert all(word in text for word in words), text
        assert b"<svg" in Path("a.svg").read_bytes()
    assert call("show", "many.npz", "--number", "5") == 0
    text = capsys.readouterr().out
    assert "FRF p4" in text
    assert "p0" not in text
    assert "No figure in a pipe: --plot FILE.png saves it." in text
    assert left() == {"hit.csv", "coh.csv", "many.npz", "a.svg"}


def test_the_figure_is_opened_on_a_terminal(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("tip.csv").write_text(GERMAN)
    opened = []

    def launch(path: str) -> int:
        opened.append(Path(path).read_bytes()[:8])
        Path(path).unlink()
        return 0

    monkeypatch.setattr(module.typer, "launch", launch)
    for stream in (module.sys.stdin, module.sys.stdout):
        monkeypatch.setattr(stream, "isatty", lambda: True, raising=False)
    assert call("show", "tip.csv", "--no-window") == 0
    assert opened == []
    assert call("show", "tip.csv") == 0
    assert opened == [PNG]
    monkeypatch.setattr(module.typer, "launch", lambda path: launch(path) + 1)
    assert call("show", "tip.csv") == 0
    assert "There is no viewer for" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["no.csv"], "there is no file no.csv"),
        (["tip.png", "--plot", "tip.png"], "--plot names tip.png, which is the file to show"),
        (["tip.csv", "--plot", "tip.png"], "--plot would replace tip.png, which exists; .*--overwrite"),
        (["tip.csv", "--json", "tip.csv", "--overwrite"], "--json names tip.csv, which is the file to show"),
        (["tip.csv", "--plot", "tip.xyz"], "cannot write tip.xyz: expected an ending with a format of figures: .*png"),
        (["tip.csv", "--number", "3"], "--number is 3, but there are 1"),
        (["tip.csv", "--variable", "values=H"], "variables was given, but the file is a table"),
        (["bare.csv"], r"bare.csv, line 1: .*--columns 'Frequenz \[Hz\],Real,Imag'"),
        (["bare.csv", "--columns", "Frequenz [Hz],Real,Imag"], r"column 'Real' has no unit.*--unit m/s\^2/N"),
        (["text.csv"], "text.csv, line 1: this line has no columns"),
        (["."], "it is a folder"),
    ],
)
def test_show_refuses(arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]) -> None:
    Path("tip.csv").write_text(GERMAN)
    Path("bare.csv").write_text("Frequenz;Real;Imag\n10;1;2\n20;3;4\n")
    Path("text.csv").write_text("words\n")
    Path("tip.png").write_text("a table with the name of an image")
    before = left()
    assert call("show", *arguments) == 2
    output = capsys.readouterr()
    assert re.search(message, output.err), output.err
    assert "Traceback" not in output.err
    assert left() == before


def test_check_of_a_complete_campaign(capsys: pytest.CaptureFixture[str]) -> None:
    examples.write("machine", "machine")
    assert call("check", "machine", "--plot", "a.png", "--json", "a.json") == 0
    text = capsys.readouterr().out
    for words in (
        "3 assemblies, 2 measurements, 1 unknown",
        "receptance identify    ready",
        "no measurement is held out",
    ):
        assert words in text
    assert max(map(len, text.splitlines())) <= 80
    assert Path("a.png").read_bytes().startswith(PNG)
    found = json.loads(Path("a.json").read_text())
    assert found["assemblies"]["long"]["length_m"] == pytest.approx(0.63)
    assert found["missing"] == {
        "invert": "no point joint with unknown stiffnesses was measured with an FRF for identification",
    }
    assert call("check", "machine", "--strict", "--no-window") == 3


def test_check_names_what_is_missing() -> None:
    examples.write("machine", "machine")
    file = Path("machine/campaign.toml")
    text = file.read_text()
    complete = campaign.CampaignCheck(campaign.load(file))
    assert complete.missing["identify"] == complete.missing["diagnose"] == ""
    before, _, after = text.partition("[unknowns]")
    known = before.replace('k_y = "2e8 N/m"', 'k_y = "2e8 N/m"\nk_theta = "4e4 N m/rad"')
    file.write_text(known + after[after.index("[prediction]") :])
    found = campaign.CampaignCheck(campaign.load(file))
    assert found.missing["identify"].startswith("no unknowns, expected")
    assert found.missing["diagnose"] == found.missing["identify"]
    assert found.missing["predict"] == ""  # without unknowns the model alone predicts
    file.write_text(text.replace('standard_deviation = "2 Hz"', ""))
    bare = campaign.CampaignCheck(campaign.load(file))
    assert bare.missing["diagnose"] == "no standard deviation of short, long"


def test_check_lists_all_mistakes(capsys: pytest.CaptureFixture[str]) -> None:
    examples.write("machine", "machine")
    file = Path("machine/campaign.toml")
    file.write_text(file.read_text().replace('"580 GPa"', '"580 kg"').replace('"60 mm"', '"60"'))
    assert call("check", "machine", "--plot", "a.png") == 2
    output = capsys.readouterr()
    assert 'is "580 kg", a mass, expected a modulus' in output.err
    assert 'is "60", without a unit' in output.err
    assert left() == {"machine"}


def test_check_says_what_to_type_instead(capsys: pytest.CaptureFixture[str]) -> None:
    Path("tip.csv").write_text(GERMAN)
    assert call("check", ".") == 2
    assert "no campaign.toml in the folder .; `receptance new . FILES` writes one" in capsys.readouterr().err
    assert call("check", "tip.csv") == 2
    assert "`receptance show tip.csv` shows a measurement file" in capsys.readouterr().err
    assert left() == {"tip.csv"}


def test_a_figure_that_cannot_be_written_leaves_nothing(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("tip.csv").write_text(GERMAN)

    def full(*arguments: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(_files.os, "replace", full)
    assert call("show", "tip.csv", "--plot", "a.png") == 2
    assert "cannot write" in capsys.readouterr().err
    assert left() == {"tip.csv"}
