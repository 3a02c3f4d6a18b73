"""What a page has open, without any widget: its file, its values, its calculations."""

from __future__ import annotations

import os
import re
import threading
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from receptance import campaign, examples
from receptance.campaign import Prediction
from receptance.diagnosis import Verdict
from receptance.errors import ReceptanceError
from receptance.fit import Identification
from receptance.session import ConflictError, Document, Session, Work

WAIT_S = 600.0
"""Longest wait for a calculation; only one that never ends takes as long."""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    examples.write("forgotten-sensor", tmp_path / "mine")
    return tmp_path / "mine"


@pytest.fixture
def session(folder: Path) -> Session:
    made = Session(folder)
    made.open("campaign.toml")
    return made


# The document.


def test_a_value_is_changed_and_the_rest_of_the_text_stays(folder: Path) -> None:
    document = Document.open(folder)
    changed = document.with_value(("title",), "Another")
    assert changed.campaign is not None
    assert changed.campaign.title == "Another"
    lines = zip(document.text.splitlines(), changed.text.splitlines(), strict=True)
    assert [new for old, new in lines if old != new] == ['title = "Another"']
    assert changed.is_changed
    assert not document.is_changed


def test_a_value_needs_the_table_that_it_is_in(folder: Path) -> None:
    with pytest.raises(ValueError, match=r"campaign\.toml has no parts\.none\.length"):
        Document.open(folder).with_value(("parts", "none", "length"), "1 mm")


@pytest.mark.parametrize(
    ("text", "mistake"),
    [
        ("a = \n", "no TOML: .*line 1"),
        ("", "missing|expected"),
        ("heading = 'x'\n", "heading"),
        ("[parts.a\n", "no TOML"),
    ],
)
def test_mistakes_are_those_of_the_campaign(folder: Path, text: str, mistake: str) -> None:
    document = Document.open(folder).with_text(text)
    assert document.campaign is None
    assert re.search(mistake, "\n".join(map(str, document.mistakes)))


def test_nothing_is_written_without_save(session: Session, folder: Path) -> None:
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    assert session.document is not None
    session.edit(session.document.with_value(("title",), "Another"))
    session.move({"joint.k_theta": 2e4})
    session.fit()
    assert {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()} == before
    session.save()
    assert 'title = "Another"' in (folder / "campaign.toml").read_text(encoding="utf-8")
    assert not session.document.is_changed


def test_of_two_pages_the_second_is_told(folder: Path) -> None:
    first, second = Document.open(folder), Document.open(folder)
    saved = first.with_text(first.text + "# first\n").save()
    with pytest.raises(ConflictError, match="has changed on the disk"):
        second.with_text(second.text + "# second\n").save()
    assert first.file.read_text(encoding="utf-8") == saved.text
    assert (
        saved.with_text(saved.text + "# more\n").save().file.read_text(encoding="utf-8").endswith("# first\n# more\n")
    )


def test_a_full_disk_leaves_the_file_as_it_was(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    document = Document.open(folder)
    before = document.file.read_bytes()

    def full(*arguments: Any, **options: Any) -> Any:
        raise OSError(28, "No space left on device", str(document.file))

    monkeypatch.setattr(os, "replace", full)
    with pytest.raises(OSError, match="No space left"):
        document.with_text(document.text + "# more\n").save()
    assert document.file.read_bytes() == before
    assert [path.name for path in folder.iterdir() if "campaign" in path.name] == ["campaign.toml"]


def test_a_file_that_is_no_text_is_refused(folder: Path) -> None:
    (folder / "campaign.toml").write_bytes(b"title = '\xff'\n")
    with pytest.raises(ValueError, match=r"is not UTF-8 text \(byte 9\)"):
        Document.open(folder)


def test_line_ends_and_the_mark_of_windows_are_no_conflict(folder: Path) -> None:
    file = folder / "campaign.toml"
    file.write_bytes(b"\xef\xbb\xbf" + file.read_bytes().replace(b"\n", b"\r\n"))
    document = Document.open(folder)
    assert document.campaign is not None
    assert document.with_text(document.text + "# more\n").save().saved.endswith("# more\n")


# The folder.


def test_files_below_the_folder_are_opened(session: Session, folder: Path) -> None:
    (folder / "below").mkdir()
    examples.write("er32", folder / "below" / "er32")
    session.open("below/er32")
    assert session.document is not None
    assert session.document.file == (folder / "below/er32/campaign.toml").resolve()


@pytest.mark.parametrize("name", ["../other", "../other/campaign.toml", "link", "link/campaign.toml", "file.toml"])
def test_files_beside_the_folder_are_refused(session: Session, folder: Path, name: str) -> None:
    examples.write("er32", folder.parent / "other")
    (folder / "link").symlink_to(folder.parent / "other", target_is_directory=True)
    (folder / "file.toml").symlink_to(folder.parent / "other" / "campaign.toml")
    before = session.document
    for path in (name, str((folder / name).absolute())):
        with pytest.raises(PermissionError, match="is not below"):
            session.open(path)
    assert session.document is before


# Values.


def test_views_are_told_of_what_changes(session: Session) -> None:
    told: list[str] = []
    session.on("trial", call=lambda: told.append("trial"))
    session.on("document", "trial", call=lambda: told.append("both"))
    session.move({"joint.k_theta": 2e4})
    assert told == ["trial", "both"]
    told.clear()
    assert session.document is not None
    session.edit(session.document.with_value(("title",), "Another"))
    assert sorted(told) == ["both", "trial"]  # each once


def test_values_that_were_moved_stay_when_the_text_is_edited(session: Session) -> None:
    session.move({"joint.k_theta": 2e4})
    assert session.document is not None
    session.edit(session.document.with_value(("title",), "Another"))
    assert session.trial is not None
    assert session.trial.values["joint.k_theta"] == 2e4
    session.restart()
    assert session.trial.values["joint.k_theta"] != 2e4


def test_held_values_are_held_in_the_fit(session: Session) -> None:
    session.move({"joint.k_theta": 2e4})
    session.held.add("joint.k_theta")
    session.fit()
    assert session.trial is not None
    assert session.trial.values["joint.k_theta"] == 2e4
    held = session.trial.misfit
    session.held.clear()
    session.fit()
    assert held is not None
    assert session.trial.misfit is not None
    assert session.trial.misfit < held


def test_the_page_and_the_library_give_the_same_answers(session: Session, folder: Path) -> None:
    read = campaign.load(folder)
    session.identify()
    work = session.work
    assert work is not None
    work.wait(WAIT_S)
    assert session.finish() is work
    assert session.identified is not None
    assert session.identified.values == read.identify().values
    assert session.trial is not None
    for name, record in read.trial(session.identified).with_overhangs().records.items():
        np.testing.assert_array_equal(session.trial.records[name].calculated, record.calculated)
    session.predict()
    assert session.work is not None
    session.work.wait(WAIT_S)
    session.finish()
    assert session.prediction is not None
    assert _results(session.prediction) == _results(read.predict(session.identified))


def _results(result: Prediction) -> dict[str, Any]:
    """Return what a result says, without the time at which it was made."""
    return {name: value for name, value in result.to_dict().items() if name != "provenance"}


# Calculations.


def test_one_calculation_at_a_time(session: Session) -> None:
    goes_on = threading.Event()
    session.begin("first", lambda read: goes_on.wait(WAIT_S))
    assert session.finish() is None
    with pytest.raises(ValueError, match="first still runs; stop it first"):
        session.identify()
    goes_on.set()
    assert session.work is not None
    session.work.wait(WAIT_S)
    session.finish()
    session.begin("second", lambda read: None)


def test_a_calculation_needs_a_campaign(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="no campaign without mistakes"):
        Session(tmp_path).identify()


def test_an_error_of_an_analysis_is_kept(session: Session) -> None:
    def fails(read: campaign.Campaign) -> None:
        raise ReceptanceError("no value at any start")

    session.begin("identify", fails)
    assert session.work is not None
    session.work.wait(WAIT_S)
    work = session.finish()
    assert work is not None
    assert str(work.error) == "no value at any start"
    assert session.identified is None


def test_a_stopped_diagnosis_gives_the_answer_so_far(folder: Path) -> None:
    steps: list[str] = []
    ready, goes_on = threading.Event(), threading.Event()

    def until_stopped(read: campaign.Campaign) -> Verdict:
        report = read.progress

        def step(text: str) -> None:
            steps.append(text)
            if len(steps) == 12:
                ready.set()
                goes_on.wait(WAIT_S)
            report(text)

        return replace(read, progress=step).diagnose()

    work = Work("diagnose", campaign.load(folder), until_stopped)
    assert ready.wait(WAIT_S)
    work.stop()
    goes_on.set()
    work.wait(WAIT_S)
    assert not work.runs
    assert work.stopped
    assert work.error is None
    assert isinstance(work.result, Verdict)
    assert not work.result.final
    assert len(steps) < len(_steps_of_a_whole_diagnosis(folder))


def _steps_of_a_whole_diagnosis(folder: Path) -> list[str]:
    steps: list[str] = []
    assert campaign.load(folder, progress=steps.append).diagnose().final
    return steps


def test_a_stopped_fit_has_no_answer(folder: Path) -> None:
    ready, goes_on = threading.Event(), threading.Event()

    def waits(read: campaign.Campaign) -> Identification:
        ready.set()
        goes_on.wait(WAIT_S)
        return read.identify()

    work = Work("identify", campaign.load(folder), waits)
    assert ready.wait(WAIT_S)
    work.stop()
    goes_on.set()
    work.wait(WAIT_S)
    assert (work.result, work.error, work.runs) == (None, None, False)


def test_progress_and_time_are_told(folder: Path) -> None:
    work = Work("identify", campaign.load(folder), lambda read: read.identify())
    work.wait(WAIT_S)
    assert isinstance(work.result, Identification)
    assert work.progress
    assert work.seconds > 0.0


def test_an_accepted_cause_is_a_new_file_that_is_not_saved(session: Session, folder: Path) -> None:
    with pytest.raises(ValueError, match="no diagnosis"):
        session.accept()
    session.diagnose()
    assert session.work is not None
    session.work.wait(WAIT_S)
    session.finish()
    accepted = session.accept()
    assert accepted.file.parent == folder.resolve()
    assert accepted.is_changed
    assert not accepted.file.exists()
    assert accepted.campaign is not None
    assert _results(accepted.campaign.predict()) != _results(campaign.load(folder).predict())
    accepted.save()
    assert campaign.load(accepted.file).title == accepted.campaign.title


def test_results_of_another_text_are_not_shown(session: Session) -> None:
    session.diagnose()
    work = session.work
    assert work is not None
    assert session.document is not None
    session.edit(session.document.with_value(("title",), "Another"))
    assert session.work is None
    work.wait(WAIT_S)
    assert session.finish() is None
    assert session.verdict is None
