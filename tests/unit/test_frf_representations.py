"""Representations of an FRF: text, HTML, figures, xarray, pickles, and their imports."""

import pickle
import warnings

import numpy as np
import pytest

from bar_frf import LINES, make
from receptance import FRF
from receptance.report.figure import as_image


def test_pickles():
    frf = make(decay_rate=2.0)
    again = pickle.loads(pickle.dumps(frf))
    for name in vars(frf):
        value = getattr(frf, name)
        same = np.array_equal if isinstance(value, np.ndarray) else lambda a, b: a == b
        assert same(getattr(again, name), value), name
    assert not again.values.flags.writeable
    assert repr(again) == repr(frf)


def test_representations():
    frf = make(label="<blank>", decay_rate=20.0, notes=["say & note"])
    assert repr(frf) == (
        "FRF('<blank>': receptance in m/(N m), m/N, rad/(N m), rad/N, 3 x 2, 100 lines from 50 to 5000 Hz, "
        "decay rate 20/s)"
    )
    page = frf._repr_html_()
    for words in (
        "&lt;blank&gt;",
        "say &amp; note",
        "100, 50 to 5000 Hz, 50 Hz apart",
        "theta at &#x27;bar&#x27; 0 m (1:+RZ)",
        "decay rate 20 1/s",
        ">10</td>",
        "median 0.75, lowest 0.5",
        "98 lines, 150 to 5000 Hz",
    ):
        assert words in page, words
    assert "unknown position" in FRF(frequency_hz=[1.0], values=[1.0])._repr_html_()
    uneven = FRF(frequency_hz=[1.0, 2.0, 4.0], values=[1.0, 1.0, 1.0])
    assert "1 to 2 Hz apart" in uneven._repr_html_()


def test_to_xarray():
    xarray = pytest.importorskip("xarray")
    data = make(decay_rate=2.0).to("mobility").to_xarray()
    assert isinstance(data, xarray.Dataset)
    assert data.frf.dims == ("frequency_hz", "response", "excitation")
    assert data.frequency_hz.attrs["units"] == "Hz"
    assert data.frf.attrs == {"long_name": "mobility"}
    assert data.unit.sel(response="theta at 'bar' 0 m", excitation="y at 'bar' 0 m") == "rad/s/N"
    np.testing.assert_array_equal(data.coherence.values, make().coherence)
    assert data.attrs["decay_rate"] == 2.0
    assert data.attrs["averages"] == 10
    assert list(data.response_label.values) == ["1:+Y", "2:+Y", "1:+RZ"]
    one = make().select(responses=0, excitations=0).to_xarray()
    assert one.frf.attrs["units"] == "m/N"


def test_figures(tmp_path):
    frf = make()
    figure = frf.plot()
    assert [axes.get_ylabel() for axes in figure.axes] == ["|receptance| (SI units)", "phase (°)", "coherence"]
    assert len(figure.axes[0].lines) == 6
    assert len(figure.axes[0].patches) == 1  # 50 and 100 Hz are not usable
    assert as_image(figure, "png").startswith(b"\x89PNG")
    plain = FRF(frequency_hz=[5.0], values=[1.0], form="accelerance").plot()
    assert len(plain.axes) == 2
    assert as_image(plain, "svg")
    many = FRF(frequency_hz=LINES, values=np.ones((100, 5, 4)), log_variance=np.inf).plot()
    assert len(many.axes[0].get_legend().get_texts()) == 8
    assert any("5 responses x 4 excitations" in text.get_text() for text in many.texts)
    assert as_image(many, "png")


def test_zeros_and_phase_turns_are_drawn_without_warnings():
    values = np.exp(1j * np.linspace(0.0, 12.0, 100))
    values[3] = 0.0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        figure = FRF(frequency_hz=np.r_[0.0, LINES[1:]], values=values).plot()
        as_image(figure, "png")
    phase = figure.axes[1].lines[0].get_ydata()
    assert np.nanmax(np.abs(np.diff(phase))) <= 180.0
