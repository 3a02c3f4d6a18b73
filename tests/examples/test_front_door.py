"""From measurement files to the named cause with the commands of the protocol, in an empty folder."""

from __future__ import annotations

import json
import shlex
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

import foreign_beam
import front_door
from receptance import campaign, examples

MOST_COMMANDS = 5
ALIKE = ("sensor_mass", "tool_density", "tool_modulus", "hammer_offset", "fluted_part", "missing_mode")


def run(text: str, folder: Path) -> str:
    program, *words = shlex.split(text)
    assert program == "receptance"
    command = [sys.executable, "-m", "receptance.cli", *words]
    done = subprocess.run(command, cwd=folder, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_protocol_is_short() -> None:
    installed = 1
    assert installed + len(front_door.COMMANDS) <= MOST_COMMANDS


def test_the_generator_shares_nothing_with_the_package() -> None:
    code = "import sys; import foreign_beam; print([m for m in sys.modules if m.split('.')[0] == 'receptance'])"
    folder = Path(foreign_beam.__file__).parent
    done = subprocess.run([sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.slow
def test_the_forgotten_sensor_is_named(tmp_path: Path) -> None:
    files = {path.name for path in foreign_beam.write(tmp_path)}
    new, check, diagnose = front_door.COMMANDS
    run(new, tmp_path)
    written = front_door.digest(tmp_path)
    assert "receptance diagnose    ready" in run(check, tmp_path)
    text = run(diagnose, tmp_path)
    assert front_door.named_cause(tmp_path) == ("named", front_door.CAUSE)
    (cause,) = json.loads((tmp_path / front_door.RESULT).read_text())["causes"]
    size = cause["parameters"]["sensor_mass.mass"]
    assert size["lower"] < 1e-3 * foreign_beam.SENSOR_G < size["upper"]
    assert size["value"] == pytest.approx(1e-3 * foreign_beam.SENSOR_G, rel=0.05)
    assert "State the sensor in the campaign" in " ".join(text.split())
    assert front_door.digest(tmp_path) == written
    assert {path.name for path in tmp_path.iterdir()} == files | {"beam", "beam.png", front_door.RESULT.name}


@pytest.mark.slow
def test_a_stated_sensor_is_adequate(tmp_path: Path) -> None:
    foreign_beam.write(tmp_path)
    new, _, diagnose = front_door.COMMANDS
    run(new.replace("--sensor none", f"--sensor '{foreign_beam.SENSOR_G} g'"), tmp_path)
    run(diagnose, tmp_path)
    assert front_door.named_cause(tmp_path) == ("adequate", None)


@pytest.mark.slow
def test_a_look_alike_is_not_named_in_place_of_the_sensor(tmp_path: Path) -> None:
    """Up to 5 kHz the fit with the sensor ends in a local minimum if it starts from the base."""
    examples.write("forgotten-sensor", tmp_path)
    foreign_beam.write(tmp_path, beam=replace(foreign_beam.DEMO, span_hz=5000.0))
    verdict = campaign.load(tmp_path).diagnose(ALIKE)
    assert "sensor_mass" in [one.id for one in verdict.causes]
    (sensor,) = (one for one in verdict.causes if one.id == "sensor_mass")
    _, lower, upper = sensor.parameters["sensor_mass.mass"]
    assert lower < 1e-3 * foreign_beam.SENSOR_G < upper
