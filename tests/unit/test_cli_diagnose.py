"""The command `diagnose`, in a separate folder: a short summary, a report, JSON, and the extended campaign."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest
import tomli_w

from campaign_lines import merged
from campaign_text import TEXT, write
from command_line import call, interrupted
from receptance import FRF, campaign, io
from receptance.campaign.write import with_campaign_lines
from receptance.units import Form

pytestmark = pytest.mark.usefixtures("empty_folder")

LINES = np.linspace(300.0, 6000.0, 160)
HEAD = TEXT.partition("[measurements.short]")[0]
MEASURED = """
[measurements.{name}]
kind = "frf"
assembly = "{name}"
role = "{role}"
file = "{name}.csv"
standard_deviation = "1 %"
"""
UNKNOWNS = """
[settings]
profiles = false

[unknowns]
"joint.k_y" = { lower = "1e7 N/m", upper = "1e10 N/m" }
"joint.k_theta" = { lower = "1e3 N m/rad", upper = "1e7 N m/rad" }
"joint.c_y" = { lower = "1 N s/m", upper = "1e5 N s/m" }
"joint.c_theta" = { lower = "1e-3 N m s/rad", upper = "1e2 N m s/rad" }
"""
JOINT = {"joint.k_y": 5e8, "joint.k_theta": 1e5, "joint.c_y": 200.0, "joint.c_theta": 0.5}


def simulated(factor: float, *, derivatives: int = 0, output: Form = "receptance") -> None:
    """Three overhangs with one per cent of noise, and an undeclared gain, or another quantity than stated."""
    rng = np.random.default_rng(8)
    folder = Path("rods")
    folder.mkdir()
    plain = campaign.load(write(folder, f"{HEAD}{UNKNOWNS}"))
    for name, assembly in plain.assemblies.items():
        noise = 0.01 * (rng.normal(size=LINES.size) + 1j * rng.normal(size=LINES.size))
        values = factor * assembly.replace(JOINT).receptance(LINES) * np.exp(noise)
        values = values * (2j * np.pi * LINES) ** derivatives
        io.write(folder / f"{name}.csv", FRF(frequency_hz=LINES, values=values, form=output))
    roles = {"short": "identify", "long": "identify", "longest": "hold out"}
    write(folder, HEAD + "".join(MEASURED.format(name=name, role=role) for name, role in roles.items()) + UNKNOWNS)


def test_gain_is_named_and_extended_campaign_written(capsys: pytest.CaptureFixture[str]) -> None:
    simulated(1.06)
    asked = ("--cause", "calibration_gain", "--cause", "sensor_mass", "--cause", "time_delay")
    files = ("--json", "v.json", "--report", "v.html", "--extended", "extended.toml", "--plot", "v.png")
    assert call("diagnose", "rods", *asked, *files) == 0
    output = capsys.readouterr().out
    assert "Calibration gain: " in output
    assert "calibration_gain" not in output.partition("Campaign file")[0]
    assert "Extended campaign: extended.toml" in output
    assert "`receptance diagnose rods --extended extended.toml`" in " ".join(output.split())
    found = json.loads(Path("v.json").read_text())
    assert found["verdict"] == "named"
    assert Path("v.html").read_text().startswith("<!DOCTYPE html>")
    assert Path("v.png").read_bytes().startswith(b"\x89PNG")
    assert call("identify", "extended.toml", "--json", "i.json") == 0
    gain = json.loads(Path("i.json").read_text())["parameters"]["calibration_gain.log_gain"]
    assert gain["value"] == pytest.approx(found["extended"]["calibration_gain.log_gain"], rel=1e-3)
    assert gain["value"] == pytest.approx(np.log(1.06), abs=3e-3)


@pytest.mark.filterwarnings("ignore::receptance.errors.ReceptanceWarning")
@pytest.mark.parametrize(
    ("factor", "derivatives", "causes"),
    [
        (1.06, 0, ["calibration_gain"]),
        pytest.param(-1.0, 0, ["reversed_polarity"], marks=pytest.mark.slow),
        pytest.param(1.0, 2, ["wrong_quantity"], marks=pytest.mark.slow),
    ],
)
def test_the_lines_of_the_answer_make_the_model_adequate(factor: float, derivatives: int, causes: list[str]) -> None:
    simulated(factor, derivatives=derivatives)
    rods = campaign.load("rods")
    found = with_campaign_lines(rods, rods.diagnose(causes))
    assert [one.id for one in found.causes] == causes
    assert found.campaign.lines
    assert not any(line.startswith(("role", "title")) for line in found.campaign.lines)
    lines = "\n".join(f"    {line}" for line in found.campaign.lines)
    assert lines in found.summary(40)
    for width in (40, 80):
        text = found.summary(width)
        assert max(len(line) for line in text.splitlines() if line.strip() not in found.campaign.lines) <= width
    Path("rods", "fixed.toml").write_text(tomli_w.dumps(merged(rods.contents, found.campaign.lines)))
    fixed = campaign.load("rods/fixed.toml")
    again = with_campaign_lines(fixed, fixed.diagnose(["time_delay"]))
    assert again.verdict == "adequate"
    assert again.campaign.lines == ()
    assert again.adequacy.misfit == pytest.approx(found.adequacy_after.misfit, rel=1e-3)


CUTS = """
[cuts.roughing]
kind = "milling"
teeth = 2
k_t = "800 MPa"
k_n = "250 MPa"
x = { assembly = "short" }

[cuts.facing]
kind = "turning"
k = "2000 MPa"
x = { assembly = "short" }
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("output", "derivatives", "data", "line"),
    [
        ("mobility", 2, "accelerance", "integrate = 1"),
        ("accelerance", 0, "receptance", "integrate = -2"),
        ("receptance", -1, "receptance whose displacement is integrated once", "integrate = -1"),
    ],
)
def test_another_quantity_is_named_with_the_line_to_write(
    output: Form,
    derivatives: int,
    data: str,
    line: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Stated and true quantity, and the line that makes the model adequate."""
    simulated(1.0, derivatives=derivatives, output=output)
    arguments = ["diagnose", "rods", "--cause", "wrong_quantity", "--cause", "calibration_gain", "--json", "found.json"]
    assert call(*arguments) == 0
    out = capsys.readouterr().out
    assert f"the files say {output}, and the data are {data} " in " ".join(out.split())
    assert f"`{line}`" in out
    (cause,) = json.loads(Path("found.json").read_text())["causes"]
    assert cause["id"] == "wrong_quantity"
    assert cause["meaning"] == f"the files say {output}, and the data are {data}"
    assert f"`{line}`" in cause["remedy"]
    file = Path("rods", "campaign.toml")
    file.write_text(file.read_text().replace('kind = "frf"', f'kind = "frf"\n{line}'))
    assert call(*arguments, "--overwrite") == 0
    assert "adequate: noise" in capsys.readouterr().out


@pytest.mark.slow
def test_reversed_polarity_is_named_and_turned_in_the_extended_campaign(capsys: pytest.CaptureFixture[str]) -> None:
    simulated(-1.0)
    causes = [word for id in ("reversed_polarity", "wrong_quantity", "time_delay") for word in ("--cause", id)]
    assert call("diagnose", "rods", *causes, "--json", "found.json", "--extended", "extended.toml") == 0
    found = json.loads(Path("found.json").read_text())
    assert (found["verdict"], [one["id"] for one in found["causes"]]) == ("named", ["reversed_polarity"])
    capsys.readouterr()
    assert Path("extended.toml").read_text().count('direction = "-y"') == 3
    assert call("diagnose", "extended.toml", "--cause", "time_delay") == 0
    assert "adequate: noise" in capsys.readouterr().out


@pytest.mark.slow
def test_partly_explained_with_all_outputs(capsys: pytest.CaptureFixture[str]) -> None:
    """A mass at the tip is added exactly to receptances whose axis and level are bent, as no model can match them."""
    simulated(1.0)
    bent = 1.0 + 0.0015 * np.sin(LINES / 800.0)
    level = np.exp(0.02 * np.cos(LINES / 1100.0) + 0.015j * np.sin(LINES / 700.0))
    rng = np.random.default_rng(3)
    for name, assembly in campaign.load("rods").assemblies.items():
        exact = assembly.replace(JOINT).receptance(LINES * bent) * level
        with_mass = exact / (1.0 - (2.0 * np.pi * LINES) ** 2 * 8e-3 * exact)
        noise = 0.003 * (rng.normal(size=LINES.size) + 1j * rng.normal(size=LINES.size))
        io.write(Path("rods", f"{name}.csv"), FRF(frequency_hz=LINES, values=with_mass * np.exp(noise)))
    text = Path("rods/campaign.toml").read_text().replace('"hold out"', '"identify"').replace('"1 %"', '"0.3 %"')
    Path("rods/campaign.toml").write_text(text)
    outputs = ["--json", "found.json", "--report", "found.html", "--extended", "extended.toml", "--plot", "found.png"]
    causes = ("sensor_mass", "calibration_gain", "time_delay", "tool_modulus", "hammer_offset", "suspension")
    assert call("diagnose", "rods", *outputs, *(word for id in causes for word in ("--cause", id))) == 0
    shown = capsys.readouterr().out
    print(shown)
    assert "partly explained: the model is inadequate" in shown
    assert "model discrepancy, natural frequencies" in shown
    found = json.loads(Path("found.json").read_text())
    assert (found["verdict"], [one["id"] for one in found["causes"]]) == ("partly explained", ["sensor_mass"])
    assert found["discrepancy"]["after"]["frequency"] < found["discrepancy"]["before"]["frequency"]
    assert 'class="badge partly explained"' in Path("found.html").read_text()
    assert Path("found.png").stat().st_size > 10_000
    assert "partly explained: mass of the sensor" in Path("extended.toml").read_text()
    assert call("identify", "extended.toml") == 0
    assert "sensor" in capsys.readouterr().out


def test_the_stable_depth_is_a_metric(capsys: pytest.CaptureFixture[str]) -> None:
    simulated(1.06)
    asked = ("diagnose", "rods", "--cause", "calibration_gain", "--metric")
    assert call(*asked, "stable_depth") == 2
    assert "expected [cuts.NAME]" in capsys.readouterr().err
    file = Path("rods/campaign.toml")
    file.write_text(file.read_text() + CUTS)
    assert call(*asked, "stable_dept") == 2
    assert 'did you mean "stable_depth"' in " ".join(capsys.readouterr().err.split())
    assert call(*asked, "stable_depth", "--json", "v.json") == 0
    gains = {one["metric"]: one for one in json.loads(Path("v.json").read_text())["gains"]}
    assert np.isfinite(gains["stable depth of roughing, error in percent"]["held_out_after"])
    # The depth goes with one over the receptance, of which the base lacks a gain of 1.06.
    own = gains["stable depth of facing, error in percent"]
    assert own["held_out_before"] == pytest.approx(6.0, abs=3.0)
    assert own["held_out_after"] < 0.5 * own["held_out_before"]


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="a console's Ctrl-C cannot be sent to one process")
def test_interruption_gives_a_preliminary_verdict() -> None:
    simulated(1.06)
    arguments = ["diagnose", "rods", "--json", "v.json", "--report", "v.html", "--extended", "extended.toml"]
    code, out, err = interrupted(*arguments, progress=r"step [5-9] of about \d+, about \d+ (s|min) left")
    assert code == 130, err
    assert ", not final: " in out
    assert "interrupted after" in out
    assert "extended.toml was not written: the diagnosis was interrupted" in out
    assert err.rstrip().endswith("receptance: interrupted, the result is preliminary")
    found = json.loads(Path("v.json").read_text())
    assert found["final"] is False
    assert found["candidates"]
    assert "not final" in Path("v.html").read_text()
    assert not Path("extended.toml").exists()


def test_message_without_an_extension(capsys: pytest.CaptureFixture[str]) -> None:
    simulated(1.0)
    assert call("diagnose", "rods", "--cause", "calibration_gain", "--extended", "e.toml") == 0
    assert (
        "e.toml was not written: there is no extended model, because the verdict is adequate" in capsys.readouterr().out
    )
    assert not Path("e.toml").exists()


@pytest.mark.parametrize(
    ("options", "output"),
    [
        (("--report", "x.pdf"), "expected an ending .html"),
        (("--extended", "x.json"), "expected an ending .toml"),
        (("--extended", "rods/campaign.toml"), "which is the campaign file"),
        (("--json", "x.html", "--report", "x.html"), "--json and --report both name x.html"),
    ],
)
def test_mistakes(capsys: pytest.CaptureFixture[str], options: tuple[str, ...], output: str) -> None:
    simulated(1.0)
    assert call("diagnose", "rods", *options) == 2
    assert output in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "causes", "verdict"),
    [
        ("drawing", (), "adequate"),
        ("er32", (), "unexplained"),
        ("free-free", ("sensor_mass", "calibration_gain", "hammer_offset", "joint_cross_term"), "adequate"),
        ("hammer", (), "adequate"),
        ("machine", (), "undecided"),
    ],
)
def test_every_packaged_example_is_diagnosed(name: str, causes: tuple[str, ...], verdict: str) -> None:
    """All causes, or some where all take long. The study of bt50 diagnoses its campaign, and taper is of its kind."""
    assert call("example", name, name) == 0
    assert call("diagnose", name, "--json", "found.json", *(word for id in causes for word in ("--cause", id))) == 0
    found = json.loads(Path("found.json").read_text(encoding="utf-8"))
    assert (found["verdict"], found["final"]) == (verdict, True)
