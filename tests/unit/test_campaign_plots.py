"""Figures of campaigns: they are drawn for any result of the fit, without a warning."""

from __future__ import annotations

from pathlib import Path

import pytest
from matplotlib.figure import Figure

from campaign_text import TEXT, changed, load
from receptance import campaign, examples

MORE = ('["2500 Hz", "10000 Hz"]', '["2500 Hz", "10000 Hz", "13000 Hz"]')


def titles(figure: Figure) -> list[str]:
    """Draw the figure and return the titles of its panels."""
    figure.draw_without_rendering()
    return [axes.get_title(loc="left") for axes in figure.axes if axes.get_title(loc="left")]


def test_frfs_and_frequencies(tmp_path: Path) -> None:
    examples.write("free-free", tmp_path)
    read = campaign.load(tmp_path)
    found = read.identify()
    assert titles(found.plot()) == ["short", "medium", "95 % intervals of the parameters"]
    assert titles(read.predict(found).plot()) == ["long: held out", "not_measured: predicted, not measured"]


def test_a_title_of_any_length(tmp_path: Path) -> None:
    found = load(tmp_path, changed(("A blank in a holder", "A very long title $ with % signs _ and so on " * 8)))
    figure = found.identify().plot()
    titles(figure)
    # The lines of a rejection stand above the title.
    assert len(figure.texts[0].get_text().splitlines()[-1]) < 250


@pytest.mark.parametrize(
    ("joint", "unknown"),
    [
        ("", '"joint.k_ytheta" = { lower = "-1e5 N/rad", upper = "1e6 N/rad" }'),
        ('c_y = "10 N s/m"\nc_theta = "0.01 N m s/rad"', '"joint.c_y" = { lower = "1 N s/m", upper = "1e4 N s/m" }'),
        ("", '"tool.segment[0].poisson_ratio" = { lower = -0.5, upper = 0.49, start = 0.0 }'),
    ],
)
def test_parameters_with_open_or_zero_crossing_intervals(joint: str, unknown: str, tmp_path: Path) -> None:
    text = changed(("[joints.joint]", f"[joints.joint]\n{joint}"), ("[unknowns]", f"[unknowns]\n{unknown}"), MORE)
    read = load(tmp_path, text)
    found = read.identify()
    assert titles(found.plot())
    assert titles(read.predict(found).plot())


@pytest.mark.slow
def test_many_measurements(tmp_path: Path) -> None:
    chain = 'chain = ["tool", "joint", "holder"]'
    more = "".join(
        f'[assemblies.more{i}]\n{chain}\nset = {{ "tool.segment[0].length" = "{70 + i} mm" }}\n' for i in range(13)
    )
    read = load(tmp_path, TEXT.replace("[unknowns]", f"{more}[settings]\nprofiles = false\n\n[unknowns]"))
    drawn = titles(read.predict().plot())
    assert sum("not measured" in title for title in drawn) == 12


def test_without_tolerances(tmp_path: Path) -> None:
    bare = "\n".join(line for line in TEXT.splitlines() if not line.startswith("tolerance"))
    assert titles(load(tmp_path, bare).identify().plot())
