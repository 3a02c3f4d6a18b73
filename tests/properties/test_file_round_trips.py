"""Written files read back: bit for bit, or with the digits of a text format."""

from __future__ import annotations

import contextlib
import tempfile
import warnings
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from receptance import FRF, Coordinate, ReceptanceWarning
from receptance.io import Coherence, TimeSeries, read, read_all, write
from receptance.model.coordinates import UnknownPosition

EXACT = (".npz", ".mat", ".h5", ".csv", ".csv.gz")
DIGITS = 5.1e-13
"""Half a unit of the thirteenth digit."""

texts = st.text(st.characters(exclude_categories=("Cs",)), max_size=12)
finite = st.floats(allow_nan=False, allow_infinity=False, min_value=-1e49, max_value=1e49)
coordinates = st.one_of(
    st.builds(UnknownPosition, st.sampled_from(("y", "theta"))),
    st.builds(
        Coordinate,
        texts,
        st.one_of(st.just("end"), st.floats(min_value=0.0, max_value=10.0)),
        st.sampled_from(("y", "theta")),
    ),
)


def draw_array(draw: st.DrawFn, shape: tuple[int, ...], elements: st.SearchStrategy[Any]) -> np.ndarray:
    drawn: np.ndarray = draw(arrays(np.float64, shape, elements=elements))
    return drawn


@st.composite
def lines(draw: st.DrawFn) -> np.ndarray:
    count = draw(st.integers(1, 7))
    if draw(st.booleans()):
        step = draw(st.floats(min_value=1e-3, max_value=100.0))
        return draw(st.sampled_from((0.0, step, 3.0 * step))) + step * np.arange(count)
    found = draw(st.lists(st.floats(min_value=1e-3, max_value=1e6), min_size=count, max_size=count))
    return np.unique(found)


@st.composite
def frfs(draw: st.DrawFn, *, text_file: bool = False) -> FRF:
    frequency_hz = draw(lines())
    shape = (frequency_hz.size, draw(st.integers(1, 2)), draw(st.integers(1, 2)))
    numbers = draw_array(draw, shape, finite) + 0j
    numbers.imag = draw_array(draw, shape, finite)
    known: dict[str, Any] = {}
    if draw(st.booleans()):
        # A poor one would be noted on reading another's file.
        known["coherence"] = draw_array(draw, shape, st.floats(0.5, 1.0))
    if draw(st.booleans()):
        known["averages"] = draw(st.integers(1, 1000))
    if draw(st.booleans()):
        known["decay_rate"] = draw(st.floats(min_value=0.0, max_value=1e4))
    names = st.from_regex(r"[a-z]{1,8}|[1-9][0-9]{0,3}:[+-][1-3]", fullmatch=True) if text_file else texts
    if draw(st.booleans()):
        sides = [draw(st.lists(names, min_size=k, max_size=k, unique=True)) for k in shape[1:]]
        known["labels"] = sides
    if not text_file:
        if draw(st.booleans()):
            known["log_variance"] = draw_array(draw, shape, st.one_of(st.floats(0.0, 10.0), st.just(np.inf)))
            known["degrees_of_freedom"] = draw_array(draw, shape, st.one_of(st.floats(1.0, 99.0), st.just(np.inf)))
        if draw(st.booleans()):
            known["usable"] = draw_array(draw, shape[:1], st.sampled_from((0.0, 1.0))) > 0.5
        if draw(st.booleans()):
            known["correlated_lines"] = draw_array(draw, shape[:1], st.floats(1.0, 50.0))
        known["notes"] = draw(st.lists(texts, max_size=2, unique=True))
        known["source"] = draw(texts)
    places = {
        name: ["y"] * k if text_file else draw(st.lists(coordinates, min_size=k, max_size=k))
        for name, k in (("responses", shape[1]), ("excitations", shape[2]))
    }
    form = draw(st.sampled_from(("receptance", "mobility", "accelerance")))
    label = draw(st.from_regex(r"[A-Za-z]{0,20}", fullmatch=True) if text_file else texts)
    return FRF(frequency_hz=frequency_hz, values=numbers, form=form, label=label, **places, **known)


@st.composite
def time_series(draw: st.DrawFn, *, text_file: bool = False) -> TimeSeries:
    names = st.from_regex(r"[a-z]{1,18}", fullmatch=True) if text_file else texts
    channels = draw(st.lists(names, min_size=1, max_size=3, unique=True))
    units = st.sampled_from(("N", "N m", "m", "m/s", "m/s^2", "rad", "rad/s", "rad/s^2", "V", "counts"))
    shape = (draw(st.integers(1, 6)), len(channels))
    return TimeSeries(
        values=draw_array(draw, shape, finite),
        channels=channels,
        units=draw(st.lists(units, min_size=shape[1], max_size=shape[1])),
        sample_rate_hz=draw(st.floats(min_value=1e-3, max_value=1e7)),
        start_s=draw(st.floats(min_value=-1.0, max_value=1.0)) if not text_file else -0.125,
        label="" if text_file else draw(texts),
        notes=() if text_file else draw(st.lists(texts, max_size=2)),
    )


@st.composite
def coherences(draw: st.DrawFn) -> Coherence:
    frequency_hz = draw(lines())
    shape = (frequency_hz.size, draw(st.integers(1, 2)), draw(st.integers(1, 2)))
    labels = [draw(st.lists(texts, min_size=k, max_size=k)) for k in shape[1:]] if draw(st.booleans()) else None
    return Coherence(frequency_hz=frequency_hz, values=draw_array(draw, shape, st.floats(0.0, 1.0)), labels=labels)


def differences(one: Any, other: Any) -> list[str]:
    """Return the fields that are not the same, arrays bit for bit."""
    assert type(one) is type(other)
    found = []
    for field in fields(one):
        mine, theirs = getattr(one, field.name), getattr(other, field.name)
        if isinstance(mine, np.ndarray):
            same = (mine.dtype, mine.shape, mine.tobytes()) == (theirs.dtype, theirs.shape, theirs.tobytes())
        elif field.name == "notes":
            # The reader adds that on a low coherence.
            same = mine == tuple(
                note for note in theirs if note in mine or not note.startswith("the median coherence is")
            )
        else:
            # Without a stated source the reader uses the file name.
            same = mine == theirs or (field.name == "source" and not mine)
        if not same:
            found.append(f"{field.name}: {mine!r} became {theirs!r}")
    return found


def again(thing: Any, ending: str, **options: Any) -> Any:
    """Return what a file of a measurement reads as."""
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        path = Path(folder) / f"made{ending}"
        write(path, thing, **options)
        return read_all(path) if isinstance(thing, list) else read(path)


@pytest.mark.parametrize("ending", EXACT)
@settings(max_examples=25)
@given(thing=st.one_of(frfs(), time_series(), coherences()))
@pytest.mark.filterwarnings("ignore::receptance.errors.ReceptanceWarning")
def test_formats_that_store_all_fields(thing: Any, ending: str) -> None:
    assert not differences(thing, again(thing, ending))


@pytest.mark.parametrize("ending", [".npz", ".mat", ".h5"])
@settings(max_examples=6)
@given(things=st.lists(st.one_of(frfs(), time_series(), coherences()), min_size=1, max_size=4))
@pytest.mark.filterwarnings("ignore::receptance.errors.ReceptanceWarning")
def test_several_in_one_file(things: list[Any], ending: str) -> None:
    back = again(things, ending)
    assert len(back) == len(things)
    for one, other in zip(things, back, strict=True):
        assert not differences(one, other)


@pytest.mark.parametrize("binary", [False, True])
@settings(max_examples=25)
@given(frf=frfs(text_file=True))
@pytest.mark.filterwarnings("ignore::receptance.errors.ReceptanceWarning")
def test_frfs_in_universal_files(frf: FRF, binary: bool) -> None:
    """Binary: ordinates bit for bit. Text: 13 digits. Lines: to 1e-9 where even, else 8 digits or single precision."""
    steps = np.diff(frf.frequency_hz)
    if steps.size and np.min(steps / frf.frequency_hz[1:]) < 1e-6:
        # Lines that may be the same in the digits of the format; they are refused before anything is written.
        with contextlib.suppress(ValueError):
            again(frf, ".uff", binary=binary)
        return
    back = again(frf, ".uff", binary=binary)
    different = {text.partition(":")[0] for text in differences(frf, back)}
    assert different <= ({"frequency_hz"} if binary else {"frequency_hz", "values", "coherence"})
    assert np.allclose(back.values.real, frf.values.real, rtol=DIGITS, atol=0.0)
    assert np.allclose(back.values.imag, frf.values.imag, rtol=DIGITS, atol=0.0)
    even = steps.size == 0 or np.ptp(steps) <= 1e-9 * frf.frequency_hz[-1]
    rounding = 1e-9 if even else 6.1e-8 if binary else 1e-7
    assert np.allclose(back.frequency_hz, frf.frequency_hz, rtol=rounding, atol=1e-9 * frf.frequency_hz[-1])


@pytest.mark.parametrize("binary", [False, True])
@settings(max_examples=30)
@given(series=time_series(text_file=True))
def test_time_series_in_universal_files(series: TimeSeries, binary: bool) -> None:
    back = again(series, ".uff", binary=binary)
    assert not differences(series, back)[: 0 if not binary else None]
    assert np.allclose(back.values, series.values, rtol=DIGITS, atol=0.0)
    assert (back.channels, back.units, back.sample_rate_hz) == (series.channels, series.units, series.sample_rate_hz)


@settings(max_examples=30)
@given(frequency_hz=lines(), data=st.data())
@pytest.mark.filterwarnings("ignore::receptance.errors.ReceptanceWarning")
def test_text_formats_of_one_frf(frequency_hz: np.ndarray, data: st.DataObject) -> None:
    numbers = draw_array(data.draw, frequency_hz.shape, finite) + 0j
    numbers.imag = draw_array(data.draw, frequency_hz.shape, finite)
    frf = FRF(frequency_hz=frequency_hz, values=numbers)
    for ending, options in ((".frf", {}), (".txt", {"format": "dataphysics"})):
        assert not differences(frf, again(frf, ending, **options))


@pytest.mark.parametrize("ending", EXACT)
def test_contradictions_of_drive_points_are_not_stored(ending: str, tmp_path: Path) -> None:
    tip = Coordinate("tool", 0.0)
    f = np.linspace(500.0, 1500.0, 400)
    conjugate = (1.0 / (1000.0**2 - f**2 + 20j * f)).conj()
    with pytest.warns(ReceptanceWarning, match="drive point"):
        frf = FRF(frequency_hz=f, values=conjugate, responses=tip, excitations=tip)
    assert not frf.notes
    write(tmp_path / f"a{ending}", frf)
    with pytest.warns(ReceptanceWarning, match="drive point"):
        back = read(tmp_path / f"a{ending}")
    assert not differences(frf, back)
