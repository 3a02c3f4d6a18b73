"""Runs of the scripts in docs/studies, as a reader runs them, for the tests of their results."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).resolve().parents[1] / "docs" / "studies"


def run(name: str, folder: Path, *options: str) -> dict[str, Any]:
    """Run a script in an empty folder, check that it prints, writes JSON and saves a figure, and return the JSON."""
    done = subprocess.run(
        [sys.executable, "-W", "error", str(FOLDER / f"{name}.py"), *options, "--json", "a.json", "--plot", "a.png"],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    document: dict[str, Any] = json.loads((folder / "a.json").read_text(encoding="utf-8"))
    assert document["study"] == name.replace("_", "-")
    assert document["versions"]
    assert (folder / "a.png").read_bytes().startswith(b"\x89PNG")
    assert name in ("clamped_rods", "er32") or "VIRTUAL" in done.stdout
    return document


def number(value: float | None) -> float:
    """Return a number of the JSON, which has null for an infinite one."""
    return math.inf if value is None else value
