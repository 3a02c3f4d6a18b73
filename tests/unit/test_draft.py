"""New campaigns from texts, without a command: what is asked, and errors that list all of it."""

from __future__ import annotations

from pathlib import Path

import pytest

from receptance import FRF, draft
from receptance.io import write

TEXTS = {
    "tool": "12 mm",
    "tool_material": "carbide",
    "holder": "40 mm x 40 mm",
    "holder_material": "steel",
    "insertion": "30 mm",
    "sensor": "none",
    "support": "free",
}


@pytest.fixture
def measured(tmp_path: Path) -> list[draft.MeasuredFile]:
    """Return an FRF with coherence but no averages, and one without either."""
    lines = [100.0, 200.0, 300.0]
    values = [1e-6 - 1e-8j] * 3
    write(tmp_path / "with_40mm.npz", FRF(frequency_hz=lines, values=values, coherence=[0.99] * 3))
    write(tmp_path / "without.npz", FRF(frequency_hz=lines, values=[2e-6 - 3e-8j] * 3))
    found = []
    for name in ("with_40mm.npz", "without.npz"):
        contents, options = draft.read_file(tmp_path / name, {})
        channels = {"force": None, "motion": None}
        found += draft.measured_files(tmp_path / name, contents.measurements, options, channels, tmp_path)
    return found


def test_an_error_lists_all_that_is_missing_and_wrong(measured: list[draft.MeasuredFile], tmp_path: Path) -> None:
    texts = {"tool": "12", "sensor": "2 mm", "overhang": {"without": "60 mm"}}
    with pytest.raises(draft.DraftError) as caught:
        draft.make_draft(measured, texts, tmp_path / "campaign.toml")
    error = caught.value
    assert [item.question.name for item in error.wrong] == ["tool", "sensor"]
    assert {(item.question.name, item.file) for item in error.missing} == {
        *((name, "") for name in ("averages", "standard_deviation", *(set(TEXTS) - {"tool", "sensor"}))),
        ("overhang", "with_40mm"),
    }
    for item in (*error.wrong, *error.missing):
        assert f"{item.text}: " in str(error)


def test_an_answer_about_a_file_without_coherence_leaves_the_others(
    measured: list[draft.MeasuredFile], tmp_path: Path
) -> None:
    texts = {**TEXTS, "overhang": {"with_40mm": "40 mm", "without": "60 mm"}}
    texts |= {"averages": "10", "standard_deviation": "2 %"}
    made = draft.make_draft(measured, texts, tmp_path / "campaign.toml")
    first, second = made.campaign.table.measurements.values()
    assert (first.averages, second.averages) == (10, None)
    assert made.text.count("standard_deviation") == 1
    assert list(tmp_path.glob("*.toml")) == []
    # The measurements of the caller are as they were read.
    assert all("averages" not in item.table and item.overhang == 0.0 for item in measured)


def test_mistakes_of_the_campaign_name_the_answer(measured: list[draft.MeasuredFile], tmp_path: Path) -> None:
    texts = {**TEXTS, "overhang": {"with_40mm": "40 mm", "without": "60 mm"}, "averages": "10"}
    texts |= {"standard_deviation": "2 %", "hit": {"with_40mm": "holder@900 mm", "without": "tip"}}
    texts |= {"response": {"with_40mm": "tip", "without": "tip"}}
    with pytest.raises(draft.DraftError, match="hit of with_40mm: is 900 mm") as caught:
        draft.make_draft(measured, texts, tmp_path / "campaign.toml")
    (mistake,) = caught.value.mistakes
    assert (mistake.name, mistake.of) == ("hit", "with_40mm")
