"""The command `sweep` in an empty folder."""

from __future__ import annotations

import errno
import json
import os
from pathlib import Path

import pytest

from campaign_text import TEXT, changed, load, write
from command_line import call


@pytest.fixture
def campaign(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.chdir(tmp_path)
    return str(write(tmp_path, TEXT))


def test_the_best_of_a_grid_of_the_unknowns(campaign: str, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ("sweep", campaign, "--points", "4", "--json", "s.json", "--plot", "s.png", "--store", "s.zarr")
    assert call(*arguments) == 0
    printed = capsys.readouterr()
    assert "16 candidates of joint.k_y, joint.k_theta" in printed.out
    assert not printed.err
    document = json.loads(Path("s.json").read_text())
    best = document["best"]
    assert [one["misfit"] for one in best] == sorted(one["misfit"] for one in best)
    assert set(best[0]["values"]) == {"joint.k_y", "joint.k_theta"}
    assert Path("s.png").read_bytes().startswith(b"\x89PNG")
    # Resumed, it has no work left and prints the same.
    assert call("sweep", campaign, "--points", "4", "--store", "s.zarr", "--json", "again.json") == 0
    assert json.loads(Path("again.json").read_text())["best"] == best


def test_draws_of_named_ranges(campaign: str) -> None:
    ranges = (
        "--vary",
        "joint.k_theta = 1e4 N m/rad to 1e6 N m/rad",
        "--vary",
        "tool.segment[0].length = 59 mm to 61 mm",
    )
    assert call("sweep", campaign, *ranges, "--sample", "30", "--seed", "3", "--json", "s.json") == 0
    document = json.loads(Path("s.json").read_text())
    assert document["candidates"] == 30
    assert document["settings"]["candidates"]["seed"] == 3
    assert all(0.059 <= one["values"]["tool.segment[0].length"] <= 0.061 for one in document["best"])


def test_unvaried_unknowns_are_identified(campaign: str, capsys: pytest.CaptureFixture[str]) -> None:
    """The best of a few values of k_theta is the identified one, because k_y is at its identified value."""
    short = load(Path(), TEXT).assemblies["short"].replace({"joint.k_y": 4e8, "joint.k_theta": 6e4})
    first, second = short.natural_frequencies(2e4)[:2]
    write(Path(), changed(('["2500 Hz", "10000 Hz"]', f'["{first:.4f} Hz", "{second:.4f} Hz"]')))
    assert call("identify", campaign, "--json", "i.json") == 0
    parameters = json.loads(Path("i.json").read_text())["parameters"]
    k_y, k_theta = (parameters[name]["value"] for name in ("joint.k_y", "joint.k_theta"))
    vary = f"joint.k_theta = {0.9 * k_theta!r} N m/rad to {1.1 * k_theta!r} N m/rad"
    capsys.readouterr()
    assert call("sweep", campaign, "--vary", vary, "--points", "5", "--json", "s.json") == 0
    found = json.loads(Path("s.json").read_text())
    assert found["best"][0]["values"]["joint.k_theta"] == pytest.approx(k_theta)
    assert found["held"] == pytest.approx({"joint.k_y": k_y})
    assert found["expected_misfit"] == 2.0
    assert found["agrees"] is True
    text = capsys.readouterr().out
    assert f"Not varied: joint.k_y = {k_y:.5g} N/m, identified." in text
    assert "The best candidate agrees with the data" in text
    # No number of steps helps if the other stiffness is wrong, as the note states.
    wrong = ("--at", f"joint.k_y = {2.0 * k_y!r} N/m")
    assert call("sweep", campaign, "--vary", vary, "--points", "50", *wrong, "--json", "w.json") == 0
    found = json.loads(Path("w.json").read_text())
    assert found["held"] == {"joint.k_y": 2.0 * k_y}
    assert found["agrees"] is False
    assert "No candidate agrees with the data: the smallest misfit is" in capsys.readouterr().out
    # A step that misses the narrow optimum is distinguished from a wrong model.
    assert call("sweep", campaign, "--vary", vary, "--points", "2") == 0
    assert "The fit of the unknowns agrees, with" in capsys.readouterr().out


def test_agreement_needs_standard_deviations(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, TEXT.replace('standard_deviation = "2 Hz"\n', ""))
    assert call("sweep", str(tmp_path), "--points", "3") == 0
    assert "Agreement with the data cannot be tested" in " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--vary", "joint.k_y"], "expected 'ADDRESS = LOW to HIGH'"),
        (["--vary", "joint.k_y = 1e7 N to 1e8 N"], 'the lower end is "1e7 N", a force'),
        (["--vary", "joint.k_y = 1e8 N/m to 1e7 N/m"], "expected the lower end first"),
        (["--vary", "joint.k_y = 1e7 N/m to 1e8 N/m"] * 2, "--vary joint.k_y is given twice"),
        (["--points", "5", "--sample", "10"], "expected one of them"),
        (["--at", "joint.k_y"], "expected 'ADDRESS = VALUE'"),
        (["--at", "drawbar.k_y = 1e7 N/m"], 'no measured assembly has the parameter "drawbar.k_y"'),
        (
            ["--vary", "joint.k_y = 1e7 N/m to 1e8 N/m", "--at", "joint.k_y = 2e7 N/m"],
            "is varied and has a fixed value by --at",
        ),
        (["--points", "4000"], "use --sample"),
        (["--store", "none/s.zarr"], "there is no folder none"),
        (["--store", "."], "holds no sweep; expected a store written by a sweep"),
    ],
)
def test_mistakes_give_messages(
    campaign: str,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    words: str,
) -> None:
    assert call("sweep", campaign, *arguments) == 2
    assert words in capsys.readouterr().err
    assert {path.name for path in Path().iterdir()} == {Path(campaign).name}


def test_an_interruption_names_the_store(
    campaign: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ("sweep", campaign, "--sample", "40", "--store", "tried.zarr")

    def interrupted(_: object) -> str:
        raise KeyboardInterrupt

    with monkeypatch.context() as until:
        until.setattr("receptance.sweep.SweepProgress.__str__", interrupted)
        assert call(*arguments) == 130
    assert "the store tried.zarr contains the results so far; the same command resumes" in capsys.readouterr().err
    assert call(*arguments) == 0
    assert "40 candidates" in capsys.readouterr().out


def test_damaged_store_is_repaired_and_noted(campaign: str, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ("sweep", campaign, "--sample", "40", "--store", "tried.zarr")
    assert call(*arguments) == 0
    first = capsys.readouterr()
    chunk = Path("tried.zarr/misfit/c/0")
    chunk.write_bytes(chunk.read_bytes()[::-1])
    assert call(*arguments) == 0
    second = capsys.readouterr()
    assert "tried.zarr: candidates 0 to 39 are damaged" in second.err
    assert not first.err
    assert second.out == first.out


def test_a_full_disk_names_the_store(
    campaign: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ("sweep", campaign, "--sample", "40", "--store", "tried.zarr")
    replace = Path.replace

    def full(source: Path, target: Path) -> None:
        if str(target).endswith("misfit/c/0"):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        replace(source, target)

    with monkeypatch.context() as until:
        until.setattr(Path, "replace", full)
        assert call(*arguments) == 2
    text = capsys.readouterr().err
    assert "tried.zarr: No space left on device" in text
    assert "the store tried.zarr contains the results so far; the same command resumes" in text
    assert call(*arguments) == 0
    assert "40 candidates" in capsys.readouterr().out
