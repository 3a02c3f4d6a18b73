"""The case studies on two virtual machines: what is found, where it fails, and that every output says it is virtual."""

from __future__ import annotations

import io
import json

import numpy as np
import pytest

from receptance.cli.machines import print_machines
from receptance.plot import draw_machines
from receptance.studies.machines import MACHINES, MachinesSettings, MachinesStudy, as_dict, findings, run, tools
from receptance.studies.machines.findings import close_and_far

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def study() -> MachinesStudy:
    return run(MachinesSettings())


def test_the_tools_are_those_of_table_5() -> None:
    assert [tool.overhang_mm for tool in tools("medium")] == [62.5, 62.5, 62.8, 62.3, 75.7]
    assert [tool.overhang_mm for tool in tools("long")] == [113.5, 114.2, 114.6, 113.2]
    assert {machine.holder_mm is None for machine in MACHINES} == {True, False}


def test_spindles_and_tools(study: MachinesStudy) -> None:
    """Nine tenths of the lines are usable; frequencies within the paper's 2 %, heights within what is stated."""
    for case in study.cases:
        assert case.found.usable.mean() >= 0.9
        assert case.error < 0.03
        assert case.error_of_modes < case.error
        assert all(abs(peak.frequency_percent) < 2.0 for peak in case.peaks)
        assert np.median([abs(peak.magnitude_percent) for peak in case.peaks]) < 3.0
        z = [
            np.log1p(0.01 * peak.magnitude_percent) / tip.deviation[np.argmin(np.abs(tip.lines - peak.true_hz))]
            for tip in case.tips
            for peak in tip.peaks
        ]
        assert np.sqrt(np.mean(np.square(z))) < 2.5
        assert [tip.tool for tip in case.by_line] == [tip.tool for tip in case.tips]


def test_short_tools_fail_where_the_spindle_is_not_known(study: MachinesStudy) -> None:
    for case in study.cases:
        assert min(one.true_hz for one in case.short) > study.settings.band_hz[1]
        below = [one.usable for one in case.reach if 1000.0 <= one.low_hz < 5000.0]
        above = [one.usable for one in case.reach if one.low_hz >= 7000.0]
        assert min(below) > 0.95
        assert max(above) < 0.8
        assert any(not one.known for one in case.short)
        for one in case.short:
            if one.known:
                assert abs(one.magnitude_percent) < 4.0 * one.deviation_percent + 5.0


def test_close_modes_and_the_diagnosis(study: MachinesStudy) -> None:
    height, frequency, far = close_and_far(study)
    assert height > 15.0
    assert height > 4.0 * far
    assert frequency < 3.0
    verdict = study.verdict
    assert verdict.verdict == "named"
    assert [cause.id for cause in verdict.causes] == ["spindle_mode"]
    value, low, high = verdict.causes[0].parameters["spindle_mode.log_frequency"]
    moved = -np.log1p(0.01 * study.settings.moved_percent)
    assert low - 3e-4 < moved < high + 3e-4
    assert value == pytest.approx(moved, rel=0.02)


def test_what_is_printed_drawn_and_written_is_called_virtual(study: MachinesStudy) -> None:
    from rich.console import Console

    console = Console(width=132, no_color=True, record=True, file=io.StringIO())
    print_machines(console, study)
    text = console.export_text()
    assert text.count("VIRTUAL") >= 8
    assert "…" not in text, "a cell was cut off"
    assert max(map(len, text.splitlines())) <= 132
    form = json.loads(json.dumps(as_dict(study), allow_nan=False))
    assert form["provenance"].startswith("VIRTUAL")
    assert len(form["virtual"]) == 2
    assert all(about in {"virtual", "spindle", "tools", "short", "close"} for about, _ in findings(study))
    figure = draw_machines(study)
    assert any("VIRTUAL" in one.get_text() for one in figure.texts)
    assert len(figure.axes) == 12
