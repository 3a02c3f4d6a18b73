"""What the cells of a notebook show in a new kernel, without a magic command of matplotlib."""

from __future__ import annotations

import base64
import os
import re
from collections.abc import Sequence
from typing import Any

import nbformat
import pytest
from nbclient import NotebookClient

_SET_UP = """\
import numpy as np
import receptance as rc
bar = rc.Segment(length=0.1, outer_diameter=0.02, material=rc.STEEL)
joint = rc.PointJoint(k_y=1e8, k_theta=1e5)
pair = rc.Assembly([rc.Part([bar], name="tool"), joint, rc.Part([bar], name="holder")])
lines = np.linspace(500.0, 5000.0, 91)
frf = rc.FRF(frequency_hz=lines, values=pair.receptance(lines), label="tip")
measured = rc.Observation.from_modes(
    assembly=pair, frequency_hz=pair.natural_frequencies(2e4)[:3], standard_deviation_hz=1.0
)
errors = [rc.Tolerance(name=f"length {i}", moves={"tool.segment[0].length": 1e-5 * i}) for i in range(1, 41)]
found = rc.identify(measured, rc.Unknown(address="joint.k_theta", lower=1e3, upper=1e7), tolerances=errors)
"""
_CELLS = ("frf", "frf.plot()", "pair", "found", "found.plot()", "found.summary()", "repr(found)")


_OPEN = """\
import asyncio, re, tempfile, urllib.request
from receptance import campaign, examples
folder = tempfile.TemporaryDirectory()
_ = examples.write("er32", folder.name)
page = campaign.load(folder.name).open()
"""
_ASKED = "re.search('<title>.*', (await asyncio.to_thread(urllib.request.urlopen, page.address)).read().decode())[0]"


@pytest.fixture(scope="module")
def shown() -> dict[str, list[dict[str, Any]]]:
    """Return the outputs of each cell."""
    return _run([_SET_UP, *_CELLS])


def _run(texts: Sequence[str]) -> dict[str, list[dict[str, Any]]]:
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(text) for text in texts])
    # The kernel's own default, with which a notebook starts.
    environment = {name: value for name, value in os.environ.items() if name != "MPLBACKEND"}
    client = NotebookClient(notebook, timeout=None, startup_timeout=600, kernel_name="python3")
    client.execute(env=environment)
    return {cell.source: cell.outputs for cell in notebook.cells}


@pytest.mark.parametrize("cell", ["frf.plot()", "found.plot()"])
def test_a_figure_is_shown_in_a_new_kernel(shown: dict[str, list[dict[str, Any]]], cell: str) -> None:
    (output,) = shown[cell]
    assert base64.b64decode(output["data"]["image/png"]).startswith(b"\x89PNG")


@pytest.mark.parametrize("cell", ["frf", "pair"])
def test_frfs_and_assemblies_are_shown_with_their_figure(shown: dict[str, list[dict[str, Any]]], cell: str) -> None:
    (output,) = shown[cell]
    html = output["data"]["text/html"]
    assert html.count("data:image/png;base64,") == 1
    assert "<table" in html


def test_a_summary_is_one_text(shown: dict[str, list[dict[str, Any]]]) -> None:
    (output,) = shown["found.summary()"]
    assert output["output_type"] == "execute_result"
    assert "joint.k_theta" in output["data"]["text/plain"]


def test_a_result_is_short_where_no_html_is_shown(shown: dict[str, list[dict[str, Any]]]) -> None:
    (output,) = shown["found"]
    assert "joint.k_theta" in output["data"]["text/html"]
    assert output["data"]["text/plain"].startswith("Identification(joint.k_theta=1e+05")
    assert len(output["data"]["text/plain"]) < 200


def test_the_page_of_a_campaign_is_shown_and_served_by_the_kernel() -> None:
    pytest.importorskip("bokeh", reason="needs Bokeh: pip install 'receptance[app]'")
    cells = _run([_OPEN, "page", _ASKED, "page.close()", "folder.cleanup()"])
    (frame,) = cells["page"]
    assert re.search(
        r'<iframe src="http://127\.0\.0\.1:\d+/[\w-]{32,}/\?file=campaign\.toml"', frame["data"]["text/html"]
    )
    (title,) = cells[_ASKED]
    assert "receptance" in title["data"]["text/plain"]
