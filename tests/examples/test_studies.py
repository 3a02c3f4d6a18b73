"""The scripts in docs/studies run as documented, print, write JSON and save a figure."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from examples.documents import ROOT

SCRIPTS = {"clamped_rods": False, "table3": True, "clamping": True, "machines": True}
"""Whether a script takes longer than a few seconds."""


def test_every_script_is_run() -> None:
    found = {path.stem for path in (ROOT / "docs" / "studies").glob("*.py")}
    assert found == {*SCRIPTS, "output"}


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] if slow else []) for name, slow in SCRIPTS.items()]
)
def test_script(name: str, tmp_path: Path) -> None:
    script = str(ROOT / "docs" / "studies" / f"{name}.py")
    done = subprocess.run(
        [sys.executable, "-W", "error", script, "--json", "a.json", "--plot", "a.png"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    document = json.loads((tmp_path / "a.json").read_text(encoding="utf-8"))
    assert document["study"] == name.replace("_", "-")
    assert document["versions"]
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    assert name == "clamped_rods" or "VIRTUAL" in done.stdout
