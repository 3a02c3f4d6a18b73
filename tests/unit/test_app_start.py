"""The page before there is a campaign: files that are dropped, answers, and the campaign that is written."""

from __future__ import annotations

import base64
import io
from pathlib import Path

import pytest

pytest.importorskip("bokeh")

from bokeh.document import Document

from command_line import call
from receptance import examples
from receptance.app.page import CampaignPage
from receptance.app.start_view import StartView
from receptance.session.start import Start
from receptance.session.uploads import LARGEST_UPLOAD, ExistingFilesError, safe_name, store

ANSWERS = {
    "tool": "12 mm",
    "tool_material": "carbide",
    "holder": "40 mm x 40 mm, 80 mm x 34/10 mm",
    "holder_material": "steel",
    "insertion": "40 mm",
    "sensor": "2 g",
    "support": "free",
}


@pytest.fixture
def measured(tmp_path: Path) -> dict[str, bytes]:
    """Return the three files of a hammer test, whose names have the overhangs."""
    examples.write("forgotten-sensor", tmp_path / "example")
    return {path.name: path.read_bytes() for path in sorted((tmp_path / "example").glob("*.csv"))}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    made = tmp_path / "page" / "mine"
    made.mkdir(parents=True)
    return made


def start_view(folder: Path) -> tuple[CampaignPage, StartView]:
    page = CampaignPage(Document(), folder, {})
    view = page.views["start"]
    assert isinstance(view, StartView)
    return page, view


def drop(view: StartView, contents: dict[str, bytes]) -> None:
    """Set what a browser sets, in its order."""
    view.drop.set_from_json("value", [base64.b64encode(content).decode() for content in contents.values()])
    view.drop.set_from_json("filename", list(contents))


def fill(view: StartView, answers: dict[str, str]) -> None:
    for name, text in answers.items():
        view.fields[name, ""].input.value = text


def test_the_page_and_the_command_write_the_same_campaign(
    measured: dict[str, bytes], folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    page, view = start_view(folder)
    assert page.tabs.active == list(page.views).index("start")
    drop(view, measured)
    assert view.chosen.value == list(measured)
    assert "1551" in view.contents.text
    assert view.fields["overhang", "tool_40mm"].input.value == "40 mm"
    assert view.write.disabled
    fill(view, ANSWERS)
    assert not view.write.disabled
    assert not (folder / "campaign.toml").exists()
    view.write_campaign()
    assert page.session.campaign is not None
    assert page.session.document is not None
    assert page.tabs.active == list(page.views).index("model")
    other = tmp_path / "command" / "mine"
    other.mkdir(parents=True)
    monkeypatch.chdir(other.parent)
    monkeypatch.setattr("sys.stdin", io.StringIO())
    store(other, measured)
    options = [word for name, text in ANSWERS.items() for word in (f"--{name.replace('_', '-')}", text)]
    options += [word for overhang in ("40 mm", "55 mm", "70 mm") for word in ("--overhang", overhang)]
    assert call("new", "mine", *(f"mine/{name}" for name in measured), *options) == 0
    assert (other / "campaign.toml").read_text() == (folder / "campaign.toml").read_text()


def test_a_campaign_is_replaced_only_after_a_second_click(measured: dict[str, bytes], folder: Path) -> None:
    page, view = start_view(folder)
    drop(view, measured)
    fill(view, ANSWERS)
    (folder / "campaign.toml").write_text("mine")
    view.write_campaign()
    assert (folder / "campaign.toml").read_text() == "mine"
    assert view.overwrite.visible
    assert "exists already" in page.status.html
    view.replace_campaign()
    assert page.session.campaign is not None
    assert not view.overwrite.visible


def test_mistakes_are_shown_at_their_answers_and_disappear(measured: dict[str, bytes], folder: Path) -> None:
    _, view = start_view(folder)
    drop(view, measured)
    fill(view, {**ANSWERS, "tool_material": "carbid"})
    wrong = view.fields["tool_material", ""]
    assert "did you mean" in wrong.problem.text
    assert view.write.disabled
    assert "<svg" in view.figure.text
    wrong.input.value = "carbide"
    assert not wrong.problem.text
    view.fields["insertion", ""].input.value = "400 mm"
    assert "longer than the bore" in view.fields["insertion", ""].problem.text
    assert view.write.disabled
    view.fields["insertion", ""].input.value = "40 mm"
    assert not view.write.disabled


def test_the_assembly_is_drawn_as_soon_as_tool_and_holder_are_stated(measured: dict[str, bytes], folder: Path) -> None:
    _, view = start_view(folder)
    drop(view, measured)
    fill(view, {"tool": ANSWERS["tool"]})
    assert not view.figure.text
    fill(view, {"holder": ANSWERS["holder"]})
    assert "overhang 55 mm" in view.figure.text


def test_places_are_asked_in_a_spindle_alone(measured: dict[str, bytes], folder: Path) -> None:
    _, view = start_view(folder)
    drop(view, measured)
    fill(view, {**ANSWERS, "support": "spindle"})
    assert view.fields["hit", "tool_55mm"].input.value == "tool@0 mm"
    assert "no record" in view.summary.text
    fill(view, {"support": "free"})
    assert not any(name in ("hit", "response") for name, _ in view.fields)
    assert "no record" not in view.summary.text


def test_files_that_exist_need_a_choice(measured: dict[str, bytes], folder: Path) -> None:
    name, content = next(iter(measured.items()))
    (folder / name).write_bytes(b"frequency [Hz],real [m/N],imag [m/N]\n1,2,3\n2,3,4\n")
    before = (folder / name).read_bytes()
    _, view = start_view(folder)
    drop(view, measured)
    assert (folder / name).read_bytes() == before
    assert "exists with other contents" in view.conflict.text
    assert [path.name for path in folder.iterdir()] == [name]
    view.keep_files()
    assert (folder / name).read_bytes() == before
    assert set(view.chosen.value) == set(measured)
    view.receive(measured)
    view.replace_files()
    assert (folder / name).read_bytes() == content
    assert "1551" in view.contents.text


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("notes.pdf", b"1", "no measurement file"),
        ("empty.csv", b"", "empty.csv: the file is empty"),
        ("large.csv", b" " * (LARGEST_UPLOAD + 1), "expected at most 60 MiB"),
    ],
)
def test_files_that_are_refused(name: str, content: bytes, words: str, folder: Path) -> None:
    page, view = start_view(folder)
    drop(view, {name: content})
    assert words in page.status.html
    assert list(folder.iterdir()) == []


def test_a_wrong_file_is_told_and_can_be_left_out(measured: dict[str, bytes], folder: Path) -> None:
    _, view = start_view(folder)
    drop(view, {**measured, "wrong.uff": b"no universal file"})
    fill(view, ANSWERS)
    assert "wrong.uff" in view.contents.text
    assert view.write.disabled
    assert "wrong.uff cannot be read" in view.summary.text
    view.chosen.value = list(measured)
    assert not view.write.disabled


def test_the_header_of_a_table_is_asked(folder: Path) -> None:
    lines = "".join(f"{f},{1e-6},{-1e-8},0.99\n" for f in range(100, 200))
    _, view = start_view(folder)
    drop(view, {"tool_60mm.csv": f"Frequenz,Real,Imag,Coh\n{lines}".encode()})
    assert not view.start.measurements
    fill(view, {"columns": "Frequenz [Hz],Real [m/N],Imag [m/N],Coh"})
    assert [item.name for item in view.start.measurements] == ["tool_60mm"]
    assert ("averages", "") in view.fields
    fill(view, {**ANSWERS, "averages": "10"})
    view.write_campaign()
    assert 'columns = ["Frequenz [Hz]"' in (folder / "campaign.toml").read_text()


def test_the_channel_of_several_is_asked(folder: Path) -> None:
    rows = "".join(f"{1e-4 * i:.4f},{i % 7},{i % 5},{i % 3}\n" for i in range(400))
    _, view = start_view(folder)
    drop(view, {"hit_60mm.csv": f"time [s],hammer [N],other [N],tip [g]\n{rows}".encode()})
    assert next(iter(view.fields)) == ("force", "")
    fill(view, {"force": "hamer"})
    assert "did you mean" in view.contents.text
    fill(view, {"force": "hammer"})
    assert ("overhang", "hit_60mm") in view.fields
    (measurement,) = view.start.measurements
    assert (measurement.table["force"], measurement.table["motion"]) == ("hammer", "tip")


def test_a_drawing_that_is_dropped_is_the_holder(measured: dict[str, bytes], folder: Path, tmp_path: Path) -> None:
    examples.write("drawing", tmp_path / "drawn")
    (drawing,) = (tmp_path / "drawn").glob("*.dxf")
    _, view = start_view(folder)
    drop(view, {**measured, drawing.name: drawing.read_bytes()})
    assert view.fields["holder", ""].input.value == drawing.name
    fill(view, {"tool": "12 mm"})
    assert "<svg" in view.figure.text


def test_no_file_outside_of_the_folder_is_read(measured: dict[str, bytes], folder: Path) -> None:
    (folder.parent / "secret.csv").write_bytes(next(iter(measured.values())))
    (folder / "link.csv").symlink_to(folder.parent / "secret.csv")
    start = Start(folder)
    assert start.available == []
    start.choose(["../secret.csv", "link.csv"])
    assert [("not below" in file.error, file.contents) for file in start.files] == [(True, None)] * 2
    start.choose([])
    for text in ("../secret.csv", str(folder.parent / "secret.csv"), "../holder.dxf", "link.csv"):
        start.answer("holder", text)
        (wrong,) = start.answers.wrong
        assert "not below the folder" in wrong.problem, text
    with pytest.raises(ValueError, match="is a link"):
        store(folder, {"link.csv": b"1"}, replace=True)


def test_names_of_uploads_stay_in_the_folder(folder: Path) -> None:
    for name in ("../../a.csv", "/etc/a.csv", "C:\\data\\a.csv", ".a.csv"):
        assert safe_name(name) == "a.csv"
    for name in ("..", "", ".csv", "a", "campaign.toml", "a.csv/"):
        with pytest.raises(ValueError, match="expected an ending of"):
            safe_name(name)
    store(folder, {"../a.csv": b"1"})
    assert [path.name for path in folder.iterdir()] == ["a.csv"]
    with pytest.raises(ExistingFilesError, match=r"a\.csv exists"):
        store(folder, {"a.csv": b"2", "b.csv": b"3"})
    assert [path.name for path in folder.iterdir()] == ["a.csv"]
