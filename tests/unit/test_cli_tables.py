"""Printed tables: no command cuts a number, however narrow the terminal, and a pipe has the width of COLUMNS."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest

from command_line import call
from printed_tables import assert_no_number_is_cut
from receptance import campaign, catalogue, examples
from receptance.campaign import Campaign

_STEPS = ("predict", "transfer", "diagnose", "invert", "spindle", "next_measurement", "stability", "compare")

COMMANDS = {
    "check": ("--no-window",),
    "identify": (),
    "predict": (),
    "transfer": (),
    "diagnose": ("--cause", "calibration_gain"),
    "invert": (),
    "spindle": ("--output", "spindle.npz", "--overwrite"),
    "next": (),
    "sweep": ("--sample", "20"),
    "stability": (),
    "catalogue": (),
}
NO_ANSWER = {
    "bt50": ("invert", "spindle", "stability", "catalogue"),
    "drawing": ("spindle", "stability", "catalogue"),
    "er32": ("invert", "spindle", "stability", "catalogue"),
    "forgotten-sensor": ("spindle", "stability", "catalogue"),
    "free-free": ("spindle", "stability", "catalogue"),
    "gauge": tuple(command for command in COMMANDS if command not in ("check", "spindle")),
    "hammer": ("spindle", "stability", "catalogue"),
    "machine": ("invert", "spindle"),
}
"""Examples without the tables of a command, which then reports that there is nothing to do; of the example gauge the
spindle is not identified yet."""
WITHOUT_FIGURE = {("bt50", "sweep"), ("er32", "sweep")}
"""Sweeps of more parameters than a figure shows, which has no report."""
FAST = {
    *(("free-free", command) for command in COMMANDS),
    *((example, command) for example, commands in NO_ANSWER.items() if example != "bt50" for command in commands),
    ("hammer", "check"),
    ("gauge", "check"),
    ("gauge", "spindle"),
    ("er32", "identify"),
}
"""Every command on an example that takes little time; the others are slow tests, at more widths."""
DRAWN = {("machine", "stability"), ("machine", "catalogue"), ("free-free", "next")}
"""Fast cases whose report has its figures: the slow tests have reports with figures of the other commands."""


def _cases() -> list[Any]:
    """Return the commands on all examples but the taper, of which bt50 has some levels: the tables are the same."""
    return [
        pytest.param(
            (command, example, *options),
            2 if command in NO_ANSWER[example] else 0,
            marks=[] if (example, command) in FAST else [pytest.mark.slow],
            id=f"{command} {example}",
        )
        for example in examples.EXAMPLES
        for command, options in COMMANDS.items()
        if example != "taper" and (example, command) != ("bt50", "diagnose")
    ]


def _once(work: Callable[..., Any]) -> Callable[..., Any]:
    """Return work that is done once: widths are compared, the numbers are the same."""
    results: list[Any] = []

    @functools.wraps(work)
    def wrapped(*arguments: Any, **options: Any) -> Any:
        if not results:
            results.append(work(*arguments, **options))
        return results[0]

    return wrapped


_FITS: dict[tuple[Path, str], Any] = {}
"""The fit of each example, which most commands begin with."""


def _fitted_once(identify: Callable[..., Any]) -> Callable[..., Any]:
    @functools.wraps(identify)
    def wrapped(self: Campaign, profiles: Sequence[str] | None = None) -> Any:
        key = self.file.resolve(), repr((self.table.settings, profiles))
        if key not in _FITS:
            _FITS[key] = identify(self, profiles)
        return _FITS[key]

    return wrapped


@pytest.fixture
def calculated_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Campaign, "identify", _fitted_once(Campaign.identify))
    for step in _STEPS:
        monkeypatch.setattr(Campaign, step, _once(getattr(Campaign, step)))
    monkeypatch.setattr("receptance.campaign.load", _once(campaign.load))
    predict = catalogue.predict_catalogue
    monkeypatch.setattr(
        catalogue, "predict_catalogue", _once(lambda *given, **options: list(predict(*given, **options)))
    )


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """Return a function that writes an example where it is not there yet."""
    top = tmp_path_factory.mktemp("examples")

    @functools.cache
    def folder(name: str) -> Path:
        examples.write(name, top / name)
        return top / name

    return folder


@pytest.mark.usefixtures("calculated_once")
@pytest.mark.parametrize(("arguments", "code"), _cases())
def test_no_number_is_cut(
    arguments: tuple[str, ...],
    code: int,
    folders: Callable[[str], Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Every number that is printed without a limit of width is printed at any width, and is in the report."""
    monkeypatch.chdir(tmp_path)
    fast = arguments[1::-1] in FAST
    if fast and arguments[1::-1] not in DRAWN:
        monkeypatch.setattr("receptance.report.figure.as_svg", lambda *_: "<svg></svg>")
    report = () if arguments[1::-1] in WITHOUT_FIGURE else ("--report", "report.html")
    if arguments[0] in COMMANDS:
        # A path without numbers, which a narrow terminal may break.
        folder = Path(arguments[1])
        folder.symlink_to(folders(arguments[1]))
        arguments = (arguments[0], str(folder), *arguments[2:])
    widths = ("40", "80", None) if fast else ("40", "80", "100", "120", None)
    assert_no_number_is_cut(arguments, code, report, monkeypatch, capsys, widths)


def test_a_pipe_is_as_wide_as_columns_says(
    folders: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    assert call("identify", str(folders("er32"))) == 0
    narrow = capsys.readouterr().out
    assert 60 < max(map(len, narrow.splitlines())) <= 80
    for unset in ("", "0", "wide"):
        monkeypatch.setenv("COLUMNS", unset)
        assert call("identify", str(folders("er32"))) == 0
        assert 80 < max(map(len, capsys.readouterr().out.splitlines())) <= 132
