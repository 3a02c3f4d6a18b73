"""The scripts in docs/studies run as documented, print, write JSON and save a figure."""

from __future__ import annotations

from pathlib import Path

import pytest

import study_scripts
from examples.documents import ROOT

ELSEWHERE = ("bt50", "er32", "table3", "clamping", "machines")
"""Scripts that take longer than a few seconds; the tests of their results run them."""


def test_every_script_is_run() -> None:
    scripts = {path.stem for path in (ROOT / "docs" / "studies").glob("*.py") if "__main__" in path.read_text()}
    assert scripts == {*ELSEWHERE, "clamped_rods"}
    for name in ELSEWHERE:
        tests = ROOT / "tests" / "validation" / f"test_{name}.py"
        assert f'study_scripts.run("{name}", ' in tests.read_text(encoding="utf-8")


@pytest.mark.slow
def test_script(tmp_path: Path) -> None:
    study_scripts.run("clamped_rods", tmp_path)
