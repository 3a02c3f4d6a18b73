"""The check that a command prints its numbers whole, however narrow the terminal."""

from __future__ import annotations

import html
import json
import re
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import pytest

from command_line import call

_NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
_WIDE = 1000


def _numbers(text: str) -> Counter[str]:
    # The time that the work took is another one every time, and not part of the result.
    return Counter(_NUMBER.findall(re.sub(r"(\d+ tools )?in [\d.]+ s$", "", text, flags=re.MULTILINE)))


def assert_no_number_is_cut(
    arguments: tuple[str, ...],
    code: int,
    report: tuple[str, ...],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    widths: Sequence[str | None] = ("40", "80", "100", "120", None),
) -> None:
    """Run a command at several widths: what it prints without a limit is printed at any, and is in the report.

    `code` is its exit code, and `report` the options that write `report.html`, none where it has no report. `widths`
    are values of COLUMNS, None where it is not set.
    """
    monkeypatch.setenv("COLUMNS", str(_WIDE))
    assert call(*arguments, "--json", "results.json", *report) == code, capsys.readouterr().err
    output = capsys.readouterr()
    if code:
        assert output.err.startswith("receptance: ")
        return
    assert json.loads(Path("results.json").read_text(encoding="utf-8"))
    wide = _numbers(output.out)
    assert wide
    if report:
        page = html.unescape(
            re.sub(r"<(style|svg).*?</\1>|<[^>]*>", " ", Path("report.html").read_text("utf-8"), flags=re.S)
        )
        assert not (lost := wide - _numbers(page)), f"these numbers are not in the report: {dict(lost)}"
    for columns in widths:
        if columns is None:
            monkeypatch.delenv("COLUMNS")
        else:
            monkeypatch.setenv("COLUMNS", columns)
        assert call(*arguments) == 0
        text = capsys.readouterr().out
        lost = wide - _numbers(text)
        assert not lost, f"at {columns} columns these numbers are cut: {dict(lost)}"
        assert "\u2026" not in text
        tables = [line for line in text.splitlines() if "\u2500" in line]
        assert max(map(len, tables), default=0) <= int(columns or 132)
