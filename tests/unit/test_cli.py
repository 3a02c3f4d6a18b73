"""The command line: files, exit codes, messages for mistakes, and interruption."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from types import FrameType

import numpy as np
import pytest
import typer
from rich.text import Text

import foreign_beam
from campaign_text import write
from command_line import PNG, call, left
from limits import LIMIT_S
from receptance import FRF, _core, _files, io
from receptance._files import check_target, write_whole
from receptance.campaign import Campaign
from receptance.cli import app as command_line
from receptance.cli import running
from receptance.examples import EXAMPLES

pytestmark = pytest.mark.usefixtures("empty_folder")


def test_demo_in_an_empty_folder(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """Plain text in a pipe; the files are in the current folder and named. The README runs the demo with all causes."""
    of_all = Campaign.diagnose
    monkeypatch.setattr(Campaign, "diagnose", lambda self: of_all(self, ["sensor_mass", "calibration_gain"]))
    monkeypatch.setenv("COLUMNS", "80")
    assert call("demo", "--json", "results.json") == 0
    text = capsys.readouterr().out
    assert "Figure: receptance-demo.png" in text
    assert "Report: receptance-demo.html" in text
    assert "The cause is named: mass of the sensor; mass 1.99" in " ".join(text.split())
    # The caption of the figure in the README.
    caption = " ".join((Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8").split())
    (before, _) = re.findall(r"natural frequencies, rms error (?:< )?([\d.e-]+) %", " ".join(text.split()))
    assert f"wrongly (dashed): {before} % in natural frequency" in caption
    changes = {}
    for name, unit in (("k_theta", "N m/rad"), ("k_y", "N/m")):
        without, joint = map(float, re.findall(rf"{name} = ([\d.e+]+) {unit}", text))
        changes[name] = f"{abs(100.0 * (joint / without - 1.0)):.0f} % {'larger' if joint > without else 'smaller'}"
    assert f"k_theta, is {changes['k_theta']}, k_y across the axis {changes['k_y']}" in caption
    assert "\x1b" not in text
    assert len(text.splitlines()) <= 20
    assert max(map(len, text.splitlines())) <= 80
    assert left() == {"receptance-demo.png", "receptance-demo.html", "results.json"}
    assert Path("receptance-demo.png").read_bytes().startswith(PNG)
    assert "sensor = " in Path("receptance-demo.html").read_text(encoding="utf-8")  # a line for the campaign file
    found = json.loads(Path("results.json").read_text())
    assert (found["verdict"], [one["id"] for one in found["causes"]]) == ("named", ["sensor_mass"])
    (size,) = found["causes"][0]["parameters"].values()
    assert size["lower"] < 1e-3 * foreign_beam.SENSOR_G < size["upper"]


def test_the_packaged_files_are_those_of_the_foreign_model(tmp_path: Path) -> None:
    packaged = EXAMPLES["forgotten-sensor"].files()
    for path in foreign_beam.write(tmp_path, beam=foreign_beam.DEMO):
        own, other = (
            np.loadtxt(text.replace(",", ".").splitlines()[5:], delimiter=";")
            for text in (packaged[path.name].decode(), path.read_text(encoding="utf-8"))
        )
        np.testing.assert_allclose(own, other, rtol=1e-5, atol=1e-6 * np.abs(own[:, 1:3]).max())


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    assert call("--version") == 0
    assert capsys.readouterr().out.startswith("receptance ")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["dmo"], 'there is no command "dmo", expected one of "demo"'),
        (["demo", "--jsn", "a"], "--jsn"),
        (["identify", "a.toml", "--seed", "-1"], "--seed"),
        (["sweep", "a.toml", "--sample", "many"], "--sample"),
        (["demo", "--json", "missing/a.json"], "cannot write missing/a.json: there is no folder missing"),
        (["demo", "--json", "."], "cannot write .: it is a folder"),
        (["demo", "--plot", "a.txt"], "cannot write a.txt: expected an ending with a format of figures"),
        (["demo", "--plot", "a.png", "--json", "a.png"], "--json and --plot both name a.png"),
        (["demo", "--plot", "missing/a.png"], "there is no folder missing"),
    ],
)
def test_mistake_prints_message_without_traceback(
    arguments: list[str], words: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def work(*_: object) -> None:
        raise AssertionError("the message comes before the work")

    monkeypatch.setattr(_core, "Model", work)
    assert call(*arguments) == 2
    output = capsys.readouterr()
    assert words in output.err
    assert "Traceback" not in output.err
    assert output.out == ""
    assert left() == set()


def test_internal_error_has_a_separate_exit_code(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise ZeroDivisionError("of the program")

    monkeypatch.setattr("receptance.cli.story.diagnose", fail)
    assert call("demo", "--json", "a.json") == 1
    output = capsys.readouterr().err
    assert "an error of the program" in output
    assert "ZeroDivisionError" in output
    assert left() == set()


def test_results_are_written_together_or_not_at_all(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The second file fails after the first is ready: neither is there, and an older one is as it was."""
    write(Path())
    Path("a.json").write_text("older")
    stage = _files._stage

    def fail(path: Path, content: bytes, waiting: dict[Path, Path]) -> None:
        if path.suffix == ".png":
            raise OSError(28, "No space left on device")
        stage(path, content, waiting)

    monkeypatch.setattr(_files, "_stage", fail)
    files = ("--json", "a.json", "--plot", "a.png", "--overwrite")
    assert call("sweep", "campaign.toml", "--sample", "3", *files) == 2
    assert "cannot write a.png: No space left on device" in capsys.readouterr().err
    assert left() == {"a.json", "campaign.toml"}
    assert Path("a.json").read_text() == "older"


@pytest.mark.parametrize("place", ["os.fsync", "receptance.report.figure.as_image"])
def test_interrupted_in_the_middle_of_writing(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], place: str
) -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(place, interrupt)
    write(Path())
    files = ("--json", "a.json", "--plot", "a.png")
    assert call("sweep", "campaign.toml", "--sample", "3", *files) == 130
    assert "interrupted, no file was left incomplete" in capsys.readouterr().err
    assert left() == {"campaign.toml"}


@pytest.mark.skipif(sys.platform == "win32", reason="pipes of POSIX")
def test_closed_output_pipe(tmp_path: Path) -> None:
    write(tmp_path)
    started = subprocess.Popen(
        [sys.executable, "-m", "receptance.cli", "predict", "campaign.toml", "--json", "p.json"],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    assert started.stdout is not None
    assert started.stderr is not None
    started.stdout.close()
    assert started.wait(timeout=LIMIT_S) == 0
    err = started.stderr.read()
    started.stderr.close()
    assert b"Traceback" not in err
    assert b"BrokenPipe" not in err
    assert left() == {"campaign.toml", "p.json"}


def test_the_package_runs_as_a_module() -> None:
    command = [sys.executable, "-m", "receptance", "materials", "steel"]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT_S, check=False)
    assert (ended.returncode, ended.stderr) == (0, "")
    assert '[materials.steel]\nyoungs_modulus = "210 GPa"' in ended.stdout


def test_no_command_shows_the_help(capsys: pytest.CaptureFixture[str]) -> None:
    call()
    output = capsys.readouterr()
    assert "demo" in output.out + output.err
    assert call("identify", "--help") == 0
    assert "--json" in capsys.readouterr().out


@pytest.mark.parametrize(
    "command",
    [
        "identify er32",
        "check er32 --no-window",
        "convert data.uff data.csv",
    ],
)
def test_quiet_prints_nothing_and_writes_files(capsys: pytest.CaptureFixture[str], command: str) -> None:
    assert call("example", "er32", "--quiet") == 0
    frf = FRF(frequency_hz=[10.0, 20.0, 30.0], values=[1e-6, 2e-6, 1e-6], coherence=[0.9, 0.2, 0.9])
    io.write("data.uff", [frf])
    assert call(*command.split(), "-q") == 0
    assert capsys.readouterr() == ("", "")
    assert Path("data.csv").is_file() == command.startswith("convert")
    if command.startswith("identify"):
        assert call(*command.split(), "--quiet", "--json", "-") == 0
        out, err = capsys.readouterr()
        assert isinstance(json.loads(out), dict)
        assert err == ""
    # Errors are printed, and the next command in the same process is not quiet.
    assert call("identify", "absent.toml", "-q") == 2
    assert "absent.toml" in capsys.readouterr().err
    assert call("example", "--list") == 0
    assert "er32" in capsys.readouterr().out


def test_brackets_in_help_are_text_and_no_markup() -> None:
    texts = [
        getattr(one, "help", None) or ""
        for command in typer.main.get_command(command_line.app).commands.values()
        for one in [command, *command.params]
    ]
    assert any("\\[" in text for text in texts)
    for text in texts:
        assert Text.from_markup(text).plain == text.replace("\\[", "["), text


def test_an_interruption_of_the_start(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    class Interrupting:
        @staticmethod
        def find_spec(name: str, *_: object) -> None:
            if name == "receptance.cli.app":
                raise KeyboardInterrupt

    monkeypatch.delitem(sys.modules, "receptance.cli.app")
    monkeypatch.setattr(sys, "meta_path", [Interrupting, *sys.meta_path])
    assert call("--version") == 130
    output = capsys.readouterr()
    assert (output.out, output.err) == ("", "receptance: interrupted, no file was left incomplete\n")


class TestFiles:
    def test_no_signal_divides_the_renaming(self, tmp_path: Path) -> None:
        """The interpreter calls the handlers of signals after calls, as it does a profiler."""

        def interrupt(_: FrameType, event: str, function: object) -> None:
            if event == "c_return" and function is os.replace:
                raise KeyboardInterrupt

        sys.setprofile(interrupt)
        try:
            with suppress(KeyboardInterrupt):
                write_whole({tmp_path / name: b"text" for name in ("a.txt", "b.txt")})
        finally:
            sys.setprofile(None)
        assert {path.name for path in tmp_path.iterdir()} in (set(), {"a.txt", "b.txt"})

    def test_a_link_stays_a_link(self, tmp_path: Path) -> None:
        target = tmp_path / "target.txt"
        target.write_text("older")
        target.chmod(0o640)
        link = tmp_path / "link.txt"
        link.symlink_to(target)
        write_whole({link: b"newer"})
        assert link.is_symlink()
        assert target.read_text() == "newer"
        assert target.stat().st_mode & 0o777 == 0o640

    def test_a_pipe_is_written_to(self, tmp_path: Path) -> None:
        reading, writing = os.pipe()
        write_whole({Path(f"/dev/fd/{writing}"): b"text"})
        assert os.read(reading, 4) == b"text"
        os.close(reading)
        os.close(writing)

    @pytest.mark.skipif(os.name == "nt" or os.geteuid() == 0, reason="root may write everywhere")
    def test_no_permission(self, tmp_path: Path) -> None:
        tmp_path.chmod(0o500)
        with pytest.raises(PermissionError, match="no permission"):
            check_target(tmp_path / "a.txt")


def test_progress_in_a_pipe_goes_on_through_a_long_step(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(running, "_QUIET", 0.1)

    def work(say: Callable[[str], None]) -> int:
        say("step 1 of 2")
        time.sleep(0.6)
        return 7

    assert running.with_progress(work) == 7
    output = capsys.readouterr().err.splitlines()
    assert len(output) >= 2
    assert all(re.fullmatch(r"[01] s: step 1 of 2", line) for line in output)
