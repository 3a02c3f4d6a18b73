"""The page in Chromium: values that are moved, mistakes that are mended, tabs, keyboard and accessibility."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from browser_page import WAIT_MS, Served, Tabs, browser, go_to, is_own, not_focused, served, tab_through, views
from limits import LIMIT_S
from receptance import campaign, examples

pytestmark = pytest.mark.slow
playwright = pytest.importorskip("playwright.sync_api", reason="needs playwright: pip install playwright")

_MODEL = """() => Bokeh.documents[0].get_model_by_name('moving').data.model0.slice(0, 20)"""

_ANSWERS = {
    "Diameter of the tool": "12 mm",
    "Material of the tool": "carbide",
    "Pieces of the holder": "40 mm x 40/12 mm, 80 mm x 34/10 mm",
    "Material of the holder": "steel",
    "Length of the shank": "40 mm",
    "Mass of the accelerometer": "none",
    "free for a holder": "free",
}
"""Answers by the beginnings of their questions: the parts of the example `forgotten-sensor`, and no sensor."""


@pytest.fixture(scope="module")
def program() -> Iterator[Any]:
    with browser() as started:
        yield started


@pytest.fixture
def tabs(program: Any) -> Iterator[Tabs]:
    made = Tabs(program)
    yield made
    made.close()


@pytest.fixture
def server(program: Any, tmp_path: Path) -> Iterator[Served]:
    examples.write("forgotten-sensor", tmp_path)
    with served(tmp_path) as running:
        yield running


def _slider(page: Any, name: str) -> Any:
    return page.get_by_role("slider", name=re.compile(rf"^{re.escape(name)}\b")).first


def _misfit(page: Any) -> str:
    return str(page.get_by_text(re.compile("^misfit ")).inner_text())


def test_a_slider_moved_by_keyboard_moves_curve_and_misfit(server: Served, tabs: Tabs) -> None:
    page = tabs.open(server.address)
    slider = _slider(page, "joint.k_theta")
    slider.focus()
    spoken, curve, misfit = slider.get_attribute("aria-valuetext"), page.evaluate(_MODEL), _misfit(page)
    assert "N m/rad" in spoken
    for _ in range(20):
        page.keyboard.press("ArrowLeft")
    page.wait_for_function(f"({_MODEL})()[0] != {curve[0]}")
    page.get_by_text(re.compile("^misfit ")).filter(has_not_text=misfit).wait_for()
    assert page.evaluate(_MODEL) != curve
    playwright.expect(slider).not_to_have_attribute("aria-valuetext", spoken, timeout=WAIT_MS)
    page.get_by_role("button", name="Start values").click()
    page.get_by_text(misfit, exact=True).wait_for()
    assert not tabs.console


def test_the_address_opens_the_view_that_it_was_copied_from(server: Served, tabs: Tabs) -> None:
    page = tabs.open(server.address)
    go_to(page, "File")
    page.wait_for_url("**view=file*")
    other = tabs.open(page.url)
    assert other.get_by_role("tab", name="File").get_attribute("aria-selected") == "true"
    other.get_by_label("Campaign file").wait_for()


def test_the_process_ends_with_the_last_tab(server: Served, tabs: Tabs) -> None:
    first, second = tabs.open(server.address), tabs.open(server.address)
    first.close()
    second.reload()  # takes a moment without any tab
    second.get_by_role("tab").first.wait_for()
    assert server.process.poll() is None
    second.close()
    assert server.code(60.0) == 0


def test_a_mistake_is_shown_at_its_line_and_mended_in_place(server: Served, tabs: Tabs) -> None:
    file = server.folder / "campaign.toml"
    right = file.read_text(encoding="utf-8")
    line = next(number for number, text in enumerate(right.splitlines(), 1) if text.startswith("title"))
    file.write_text(right.replace("title", "heading", 1), encoding="utf-8")
    page = tabs.open(server.address)
    page.get_by_text(re.compile(rf"line {line}, heading")).filter(visible=True).first.wait_for()
    text = page.get_by_label("Campaign file")
    text.fill(right)
    page.get_by_role("button", name="Check").click()
    page.get_by_text("the file has no mistakes").wait_for()
    assert file.read_text(encoding="utf-8") != right  # nothing is written without "Save"
    page.get_by_role("button", name="Save").click()
    page.get_by_text("saved", exact=True).wait_for()
    assert file.read_text(encoding="utf-8") == right
    go_to(page, "Model")
    _slider(page, "joint.k_theta").wait_for()


def test_two_tabs_do_not_overwrite_each_other(server: Served, tabs: Tabs) -> None:
    file = server.folder / "campaign.toml"
    right = file.read_text(encoding="utf-8")
    pages = {title: tabs.open(f"{server.address}?view=file") for title in ("First", "Second")}
    for title, page in pages.items():
        page.get_by_label("Campaign file").fill(f"{right}\n# {title}\n")
        page.get_by_role("button", name="Check").click()
        page.get_by_text("the file has no mistakes").wait_for()
    pages["First"].get_by_role("button", name="Save").click()
    pages["First"].get_by_text("saved", exact=True).wait_for()
    pages["Second"].get_by_role("button", name="Save").click()
    pages["Second"].get_by_text("has changed on the disk").wait_for()
    assert file.read_text(encoding="utf-8").endswith("# First\n")
    assert pages["Second"].get_by_label("Campaign file").input_value().endswith("# Second\n")  # nothing is lost


def test_what_the_file_says_is_text_and_not_run(server: Served, tabs: Tabs) -> None:
    file = server.folder / "campaign.toml"
    title = "<img src=x onerror=window.run=1><script>window.run=1</script>"
    text = re.sub(r"(?m)^title = .*$", f'title = "{title}"', file.read_text(encoding="utf-8"), count=1)
    file.write_text(text, encoding="utf-8")
    page = tabs.open(server.address)
    page.get_by_text(title).first.wait_for()
    assert page.evaluate("window.run") is None


def test_a_file_outside_of_the_folder_is_refused(server: Served, tabs: Tabs, tmp_path_factory: Any) -> None:
    outside = tmp_path_factory.mktemp("outside")
    examples.write("er32", outside)
    (server.folder / "link").symlink_to(outside, target_is_directory=True)
    for name in (f"../{outside.name}", "link/campaign.toml", str(outside)):
        page = tabs.open(f"{server.address}?file={name}")
        page.get_by_text("is not below").wait_for()
        assert "ER32" not in page.content()


def test_light_and_dark(server: Served, tabs: Tabs) -> None:
    page = tabs.open(server.address)
    paper = "() => getComputedStyle(document.body).backgroundColor"
    light = page.evaluate(paper)
    page.get_by_role("button", name="Light / dark").click()
    page.wait_for_url("**theme=dark*")
    page.get_by_role("tab").first.wait_for()
    dark = page.evaluate(paper)
    lightness = [sum(map(int, re.findall(r"\d+", colour)[:3])) for colour in (light, dark)]
    assert lightness[0] > 3 * 128 > lightness[1]


def test_all_is_reached_by_keyboard(server: Served, tabs: Tabs) -> None:
    page = tabs.open(f"{server.address}?view=start")
    names = views(page).all_inner_texts()
    for number, name in enumerate(names):
        if number:
            page.keyboard.press("ArrowRight")
        page.get_by_role("tab", name=name, selected=True).wait_for()
        page.wait_for_timeout(1000)  # names of curves and sliders are set after they are drawn
        focused = tab_through(page)
        assert f"tab {name}" in focused
        assert not_focused(page) == []
        assert [what for what in focused if " " not in what] == []  # each has a name
        page.get_by_role("tab", name=name).focus()


def test_nothing_is_asked_from_elsewhere(server: Served, tabs: Tabs) -> None:
    page = tabs.open(server.address)
    for name in views(page).all_inner_texts():
        go_to(page, name)
        page.wait_for_load_state("networkidle")
    assert tabs.requests
    assert all(map(is_own, tabs.requests)), [address for address in tabs.requests if not is_own(address)]
    assert not tabs.console


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_every_view_is_accessible(server: Served, tabs: Tabs, theme: str) -> None:
    axe = pytest.importorskip("axe_playwright_python.sync_playwright").Axe()
    page = tabs.open(f"{server.address}?theme={theme}")
    for name in views(page).all_inner_texts():
        go_to(page, name)
        page.get_by_role("tab", name=name, selected=True).wait_for()
        page.wait_for_timeout(1000)  # labels of curves and sliders are set after they are drawn
        findings = [
            f"{name}, {finding['impact']} {finding['id']}: {finding['nodes'][0]['html'][:200]}"
            for finding in axe.run(page).response["violations"]
            if finding["impact"] in ("serious", "critical")
        ]
        assert findings == []


def test_figures_are_zoomed_together_by_keyboard(server: Served, tabs: Tabs) -> None:
    page = tabs.open(server.address)
    ends = """() => [...Bokeh.documents[0]._all_models.values()]
        .filter(m => m.x_range && m.renderers.some(r => r.data_source?.name == 'moving'))
        .map(m => [m.x_range.start, m.x_range.end])"""
    whole = page.evaluate(ends)
    assert len(whole) >= 2
    assert all(pair == whole[0] for pair in whole)
    page.get_by_role("group", name=re.compile("^zoom ")).first.focus()
    page.keyboard.press("+")
    near = page.evaluate(ends)
    assert all(pair == near[0] for pair in near)
    assert whole[0][0] < near[0][0] < near[0][1] < whole[0][1]
    page.keyboard.press("0")
    assert page.evaluate(ends) == whole


# From data to a cause.


def _choose_files(page: Any, *files: Path) -> None:
    page.locator("input[type=file]").first.set_input_files([str(file) for file in files])


def test_files_that_are_no_measurements_are_refused(program: Any, tabs: Tabs, tmp_path: Path) -> None:
    folder = tmp_path / "empty"
    folder.mkdir()
    files = {
        "picture.png": bytes(range(256)),
        "empty.csv": b"",
        "letter.csv": b"Dear reader,\nthis is no measurement.\n",
    }
    for name, content in files.items():
        (tmp_path / name).write_bytes(content)
    with served(folder) as running:
        page = tabs.open(running.address)
        for name in files:
            _choose_files(page, tmp_path / name)
            page.get_by_text(name).filter(visible=True).first.wait_for()
        assert running.process.poll() is None
    # A table that cannot be read may need options; it is kept, and nothing is made of it.
    assert {path.name for path in folder.iterdir()} <= {"letter.csv"}


def test_a_diagnosis_is_stopped_with_the_answer_so_far(server: Served, tabs: Tabs) -> None:
    page = tabs.open(f"{server.address}?view=ask")
    page.get_by_role("button", name="Diagnose").click()
    page.get_by_role("button", name="Stop").click()
    page.get_by_text(re.compile("diagnose: stopped")).wait_for()
    page.get_by_role("button", name="Diagnose").wait_for()
    assert not tabs.console


def test_the_forgotten_sensor_is_named_accepted_and_saved(server: Served, tabs: Tabs) -> None:
    page = tabs.open(f"{server.address}?view=ask")
    page.get_by_role("button", name="Diagnose").click()
    page.get_by_text(re.compile("diagnose: done")).wait_for(timeout=1e3 * LIMIT_S)
    page.get_by_text(re.compile("sensor", re.IGNORECASE)).first.wait_for()
    page.get_by_role("button", name="Accept").click()
    page.get_by_text("extended.toml is open and not saved").wait_for()
    assert not (server.folder / "extended.toml").exists()
    page.get_by_role("button", name="Save").click()
    page.get_by_text("saved", exact=True).wait_for()
    extended = campaign.load(server.folder / "extended.toml")
    before = campaign.load(server.folder)
    assert extended.predict().to_dict() != before.predict().to_dict()
    assert not tabs.console


def test_from_files_to_a_cause(program: Any, tabs: Tabs, tmp_path: Path) -> None:
    """Three files, seven answers, and three clicks; the overhangs are in the names of the files."""
    folder, source = tmp_path / "mine", tmp_path / "source"
    folder.mkdir()
    examples.write("forgotten-sensor", source)
    with served(folder) as running:
        page = tabs.open(running.address)
        _choose_files(page, *sorted(source.glob("*.csv")))
        for label, text in _ANSWERS.items():
            answer = page.get_by_label(re.compile(f"^{label}")).filter(visible=True).first
            answer.fill(text)
            answer.press("Enter")
        page.get_by_role("button", name="Write campaign").click()
        _slider(page, "joint.k_theta").wait_for()
        page.get_by_role("tab", name="Ask").click()
        page.get_by_role("button", name="Diagnose").click()
        page.get_by_text(re.compile("diagnose: done")).wait_for(timeout=1e3 * LIMIT_S)
        page.get_by_text(re.compile("Mass of the sensor: the sensor")).filter(visible=True).first.wait_for()
    assert not tabs.console
