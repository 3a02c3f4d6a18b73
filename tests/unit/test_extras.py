"""Optional parts without their packages: the message, and that a command ends before its work."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from command_line import call
from receptance import FRF, STEEL, Assembly, Part, Segment, examples
from receptance.cli import main
from receptance.errors import MissingExtraError
from receptance.io import write
from receptance.sweep import Grid, NaturalFrequencies, as_grid, open_sweep, sweep

BAR = Assembly([Part([Segment(length=0.1, outer_diameter=0.01, material=STEEL)], name="bar")])
RECORD = FRF(frequency_hz=[10.0, 20.0], values=[1.0, 2.0])


@pytest.fixture(autouse=True)
def _nothing_optional(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)


@pytest.mark.parametrize(
    ("work", "message"),
    [
        (
            lambda folder: sweep(BAR, Grid({"bar.segment[0].length": [0.1]}), NaturalFrequencies(upper_hz=1e4)),
            r"a sweep needs xarray and zarr and pandas: pip install 'receptance\[sweep\]'",
        ),
        (open_sweep, r"open_sweep needs .*'receptance\[sweep\]'"),
        (as_grid, r"as_grid needs .*'receptance\[sweep\]'"),
        (lambda folder: RECORD.to_xarray(), r"FRF.to_xarray needs xarray: pip install 'receptance\[sweep\]'"),
        (lambda folder: write(folder / "a.h5", RECORD), r"an HDF5 file needs h5py: pip install 'receptance\[hdf5\]'"),
    ],
)
def test_messages_name_the_extra(tmp_path: Path, work: Callable[[Path], object], message: str) -> None:
    with pytest.raises(MissingExtraError, match=message) as caught:
        work(tmp_path)
    assert isinstance(caught.value, ImportError)
    assert not list(tmp_path.iterdir())


def test_commands_end_before_their_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    examples.write("free-free", tmp_path / "mine")
    monkeypatch.setattr(sys, "argv", ["receptance", "sweep", str(tmp_path / "mine"), "--sample", "5"])
    with pytest.raises(SystemExit) as end:
        main()
    assert end.value.code == 2
    assert "needs xarray and zarr" in capsys.readouterr().err


def test_the_page_names_its_extra(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    examples.write("er32", tmp_path)
    assert call("open", tmp_path, "--no-browser") == 2
    text = " ".join(capsys.readouterr().err.split())
    assert "the page in the browser needs bokeh and tomlkit and tornado: pip install 'receptance[app]'" in text
    assert "Traceback" not in text


def test_a_drawing_of_an_example_names_its_extra(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    examples.write("drawing", tmp_path / "mine")
    for words in (("check", tmp_path / "mine"), ("contour", tmp_path / "mine" / "holder.dxf")):
        assert call(*words) == 2
        text = " ".join(capsys.readouterr().err.split())
        assert "a DXF file needs ezdxf: pip install 'receptance[drawing]'" in text
        assert "Traceback" not in text
