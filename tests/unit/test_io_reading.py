"""Reading and writing in all formats: detection, options, errors, time series and coherences."""

from __future__ import annotations

import gzip
import os
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from receptance import FRF, Coordinate, ReceptanceWarning
from receptance.io import (
    Coherence,
    FileFormatError,
    TimeSeries,
    errors,
    read,
    read_all,
    read_frf,
    read_time_series,
    write,
)

FREQUENCY = [10.0, 20.0]
ONE = FRF(frequency_hz=FREQUENCY, values=[1 - 1j, 2 - 2j], form="mobility")
HIT = TimeSeries(values=[[0.0, 1.0], [2.0, 3.0]], channels=["f", "a"], units=["N", "g"], sample_rate_hz=100.0)


@pytest.mark.parametrize("ending", [".npz", ".mat", ".h5", ".uff", ".csv", ".frf"])
def test_the_format_is_detected_from_the_contents(ending: str, tmp_path: Path) -> None:
    """Independent of the file name; only .frf has no identifying content."""
    with_form = ONE.to("receptance") if ending == ".frf" else ONE
    write(tmp_path / f"a{ending}", with_form)
    for name in ("renamed.txt", "renamed", "renamed.csv"):
        (tmp_path / name).write_bytes((tmp_path / f"a{ending}").read_bytes())
        options: dict[str, Any] = {"format": "cutpro"} if ending == ".frf" else {}
        if ending == ".csv" and name == "renamed":
            options["format"] = "csv"
        assert np.array_equal(read_frf(tmp_path / name, **options).values, with_form.values)


def test_contents_without_a_format(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"\x7fELF something")
    with pytest.raises(
        FileFormatError,
        match=r"^a: the format is recognised neither by the contents nor by the extension; give .*, one of uff",
    ):
        read(tmp_path / "a")
    (tmp_path / "a").write_bytes(b"")
    with pytest.raises(FileFormatError, match="the file is empty"):
        read(tmp_path / "a")
    with pytest.raises(ValueError, match="format is 'wav', expected one of uff, csv"):
        read(tmp_path / "a", format="wav")
    with pytest.raises(FileNotFoundError):
        read(tmp_path / "missing.uff")
    for format_ in ("uff", "npz", "mat", "hdf5", "cutpro", "dataphysics", "csv"):
        (tmp_path / "a").write_bytes(b"\x7fELF something")
        with pytest.raises(FileFormatError, match=r"^a"):
            read(tmp_path / "a", format=format_)


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"colour": 1}, TypeError, "read has no option 'colour'; the options are columns, "),
        ({"quantity": "impedance"}, ValueError, "quantity is 'impedance', expected one of"),
        ({"unit": "m/apple"}, ValueError, "unknown: 'apple'"),
        ({"responses": "tip"}, TypeError, "expected a Coordinate"),
        ({"variables": ["a"]}, TypeError, "expected a mapping such as"),
        ({"columns": "a,b"}, TypeError, "columns is 'a,b', expected a list"),
        ({"sample_rate_hz": -1.0}, ValueError, "sample_rate_hz is -1, expected more than zero"),
    ],
)
def test_invalid_options(options: dict[str, Any], error: type[Exception], message: str, tmp_path: Path) -> None:
    """They are mistakes of the call, not of the file."""
    write(tmp_path / "a.csv", ONE)
    with pytest.raises(error, match=message) as caught:
        read(tmp_path / "a.csv", **options)
    assert not isinstance(caught.value, FileFormatError)


@pytest.mark.parametrize(
    ("thing", "options", "message"),
    [
        (HIT, {"quantity": "mobility"}, "quantity was given, but there is no FRF in the file: it holds TimeSeries"),
        (HIT, {"variables": {"a": "b"}}, "variables was given, but the file is a table with a header"),
        (HIT, {"unit": {"a": "m"}}, r"channel 'a' of the file is in 'm/s\^2', but unit='m' was given"),
        (ONE, {"unit": "m/N"}, "the file states that it holds mobility in m/s/N, but"),
        (ONE, {"unit": {"a": "m"}}, "unit names the channel 'a'; the channels of the file are none: it holds FRF"),
        (HIT, {"unit": {"hamer": "N"}}, "unit names the channel 'hamer'; the channels of the file are 'f', 'a'"),
        (ONE, {"sample_rate_hz": 10.0}, "sample_rate_hz was given, but there is no time series in the file"),
        (HIT, {"sample_rate_hz": 10.0}, r"the file has 100.0 samples per second, but sample_rate_hz=10.0 was given"),
        (HIT, {"sample_rate_hz": 100.0}, None),
        (ONE, {"unit": "SI", "quantity": "mobility"}, None),
    ],
)
def test_options_that_do_not_apply_to_the_file(
    thing: Any, options: dict[str, Any], message: str | None, tmp_path: Path
) -> None:
    write(tmp_path / "a.csv", thing)
    if message is None:
        assert read(tmp_path / "a.csv", **options)
        return
    with pytest.raises(FileFormatError, match=message):
        read(tmp_path / "a.csv", **options)


def test_read_frf_and_read_time_series(tmp_path: Path) -> None:
    write(tmp_path / "both.npz", [ONE, HIT])
    assert read_frf(tmp_path / "both.npz").form == "mobility"
    assert read_time_series(tmp_path / "both.npz").channels == ("f", "a")
    with pytest.raises(
        FileFormatError, match=r"both.npz: the file holds 2 measurements, expected one: 0: FRF.*; 1: TimeSeries"
    ):
        read(tmp_path / "both.npz")
    write(tmp_path / "two.npz", [ONE, ONE])
    with pytest.raises(FileFormatError, match="the file holds 2 FRFs, expected one: 0: FRF"):
        read_frf(tmp_path / "two.npz")
    with pytest.raises(FileFormatError, match="the file holds no time series, expected one: 0: FRF"):
        read_time_series(tmp_path / "two.npz")


def test_coordinates_from_options(tmp_path: Path) -> None:
    tip = Coordinate("tool", 0.0)
    for ending in (".uff", ".csv", ".npz"):
        write(tmp_path / f"a{ending}", ONE)
        frf = read_frf(tmp_path / f"a{ending}", responses=Coordinate("tool", 0.01), excitations=tip)
        assert (frf.responses, frf.excitations) == ((Coordinate("tool", 0.01),), (tip,))


def test_a_coherence_from_another_file(tmp_path: Path) -> None:
    write(tmp_path / "frf.uff", ONE)
    write(tmp_path / "coh.uff", Coherence(frequency_hz=FREQUENCY, values=[0.9, 0.8], labels=(["1:+2"], ["1:+2"])))
    frf = read_frf(tmp_path / "frf.uff", coherence=tmp_path / "coh.uff")
    assert frf.coherence is not None
    assert frf.coherence.ravel() == pytest.approx([0.9, 0.8])
    assert frf.notes == ("coherence of coh.uff",)
    own = tmp_path / "own.npz"
    write(own, frf)
    with pytest.raises(FileFormatError, match="the file contains a coherence, but coherence="):
        read_frf(own, coherence=tmp_path / "coh.uff")
    write(tmp_path / "poor.csv", Coherence(frequency_hz=FREQUENCY, values=[0.1, 0.2]))
    with pytest.warns(ReceptanceWarning, match="the median coherence is 0.15") as caught:
        read_frf(tmp_path / "frf.uff", coherence=tmp_path / "poor.csv")
    assert caught[0].filename == __file__
    write(tmp_path / "other.csv", Coherence(frequency_hz=[1.0, 2.0], values=[0.1, 0.2]))
    with pytest.raises(FileFormatError, match=r"^other.csv: none of its coherences has the lines and points of FRF"):
        read_frf(tmp_path / "frf.uff", coherence=tmp_path / "other.csv")
    with pytest.raises(FileFormatError, match=r"^frf.uff: none of its coherences .* they are none"):
        read_frf(tmp_path / "frf.uff", coherence=tmp_path / "frf.uff")


def test_writing(tmp_path: Path) -> None:
    for things, name, options, error, message in (
        (ONE, "a.wav", {}, ValueError, "a.wav: unknown extension, expected one of .uff"),
        (ONE, "a.csv", {"binary": True}, ValueError, "binary applies to universal files"),
        ([], "a.uff", {}, ValueError, "expected at least one to write"),
        ([1], "a.uff", {}, TypeError, "cannot write 1, expected an FRF"),
        ([ONE, ONE], "a.csv", {}, ValueError, "holds a single measurement, there are 2; write several files"),
        (HIT, "a.txt", {"format": "dataphysics"}, ValueError, "holds an FRF, this is TimeSeries"),
        (ONE, "no/folder.uff", {}, OSError, "there is no folder"),
    ):
        with pytest.raises(error, match=message):
            write(tmp_path / name, things, **options)  # type: ignore[arg-type]
    assert not list(tmp_path.iterdir())
    write(tmp_path / "a.uff", ONE, binary=True)
    assert b"    58b" in (tmp_path / "a.uff").read_bytes()
    write(tmp_path / "a.bin", ONE, format="npz")
    assert read_frf(tmp_path / "a.bin").form == "mobility"
    write(str(tmp_path / "a.uff.gz"), ONE)
    assert read_frf(str(tmp_path / "a.uff.gz")).form == "mobility"
    assert read_all(tmp_path / "a.uff.gz")[0].source == "a.uff.gz (universal file (data set 58))"


def test_errors_and_measurements_pickle() -> None:
    error = FileFormatError("found x", file="a.uff", line=3, place="column 'y'")
    again = pickle.loads(pickle.dumps(error))
    assert str(again) == str(error) == "a.uff, line 3, column 'y': found x"
    assert (again.file, again.line, again.byte) == ("a.uff", 3, None)
    assert isinstance(error, ValueError)
    assert str(FileFormatError("found x", byte=7)) == "byte 7: found x"
    series = pickle.loads(pickle.dumps(HIT))
    assert np.array_equal(series.values, HIT.values)
    assert series.units == HIT.units


def test_time_series() -> None:
    assert HIT.units == ("N", "m/s^2")
    assert HIT.quantities == ("force", "acceleration")
    assert HIT.time_s.tolist() == [0.0, 0.01]
    assert (len(HIT), HIT.duration_s) == (2, 0.02)
    assert HIT.channel("a").tolist() == HIT.channel(1).tolist() == [9.80665, 3 * 9.80665]
    assert repr(HIT) == "TimeSeries(f [N], a [m/s^2]: 2 samples at 100 Hz)"
    with pytest.raises(ValueError, match="there is no channel 'x'; the channels are 'f', 'a'"):
        HIT.channel("x")
    with pytest.raises(ValueError, match="read-only"):
        HIT.values[0, 0] = 1.0
    many = TimeSeries(
        values=np.zeros((1, 9)), channels=list("abcdefghi"), units=["V"] * 9, sample_rate_hz=1.0, label="run"
    )
    assert "'run', a [V], b [V], c [V], d [V], e [V], and 4 more: 1 samples" in repr(many)


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        ({"values": [[0.0, np.nan]]}, ValueError, "sample 0 of 'a' is nan"),
        ({"values": [1j, 2.0]}, TypeError, "dtype complex128, expected real"),
        ({"values": [1.0, 2.0]}, ValueError, r"shape \(2, 1\), expected \(n_samples, 2\)"),
        ({"channels": ["a", "a"]}, ValueError, "different names"),
        ({"units": ["N"]}, ValueError, "there are 1 units for 2 channels"),
        ({"units": ["N", 3]}, TypeError, "units holds 3"),
        ({"sample_rate_hz": 0.0}, ValueError, "sample_rate_hz is 0"),
        ({"start_s": "x"}, TypeError, "start_s is 'x'"),
        ({"notes": "note"}, TypeError, "notes is 'note'"),
        ({"values": [[1.0, 1e308]], "units": ["N", "g"]}, ValueError, "values overflow in SI"),
    ],
)
def test_invalid_time_series(changes: dict[str, Any], error: type[Exception], message: str) -> None:
    good: dict[str, Any] = {
        "values": [[0.0, 1.0]],
        "channels": ["f", "a"],
        "units": ["N", "g"],
        "sample_rate_hz": 100.0,
    }
    with pytest.raises(error, match=message), np.errstate(over="ignore"):
        TimeSeries(**(good | changes))


def test_coherences() -> None:
    assert Coherence(frequency_hz=[0.0, 1.0], values=[1.00005, -0.00005]).values.ravel().tolist() == [1.0, 0.0]
    for changes, message in (
        ({"values": [0.5, 1.001]}, "the coherence at 2 Hz is 1.001"),
        ({"values": [0.5, np.nan]}, "the coherence at 2 Hz is nan"),
        ({"values": [0.5]}, r"expected \(2,\) or \(2, responses, excitations\)"),
        ({"frequency_hz": [2.0, 1.0]}, "frequency_hz is not ascending"),
        ({"labels": (["a", "b"], ["c"])}, "labels names 2 responses and 1 excitations"),
    ):
        with pytest.raises(ValueError, match=message):
            Coherence(**({"frequency_hz": [1.0, 2.0], "values": [0.5, 0.5]} | changes))


# Compressed and endless files ------------------------------------------------------------------------------------


def test_all_members_of_a_gzip_file_are_read(tmp_path: Path) -> None:
    """`cat a.gz b.gz`, and block gzip, which ends with an empty member; tapes end with zeros."""
    write(tmp_path / "whole.csv", FRF(frequency_hz=np.arange(1.0, 1001.0), values=np.arange(1000) * (1 - 2j)))
    content = (tmp_path / "whole.csv").read_bytes()
    path = tmp_path / "many.csv.gz"
    for pieces in (2, 7, 300):
        step = -(-len(content) // pieces)
        members = [gzip.compress(content[k : k + step]) for k in range(0, len(content), step)]
        for end in (b"", gzip.compress(b""), b"\0" * 512):
            path.write_bytes(b"".join(members) + end)
            assert np.array_equal(read_frf(path).values, read_frf(tmp_path / "whole.csv").values)
    path.write_bytes(b"".join(members) + b"something else")
    with pytest.raises(FileFormatError, match="or followed by other data: Not a gzipped file"):
        read(path)
    path.write_bytes(b"".join(members)[:-3])
    with pytest.raises(FileFormatError, match="gzip data are truncated"):
        read(path)


def test_expanded_size_is_limited(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """16 MiB out of 16 kB are read where they are a table, one byte more is not; the limit is lowered for speed."""

    monkeypatch.setattr(errors, "LARGEST", 1 << 24)
    path = tmp_path / "bomb.csv.gz"
    blanks = b"#" * (1 << 20)
    path.write_bytes(gzip.compress(b"f [Hz],coherence\n1,1\n#" + b"#" * ((1 << 24) - 22) + b"\n"))
    with pytest.raises(FileFormatError, match=r"bomb\.csv\.gz: the contents take more than 16 MiB when expanded"):
        read(path)
    path.write_bytes(gzip.compress(b"f [Hz],coherence\n1,1\n#") + gzip.compress(blanks) * 15 + gzip.compress(b"\n"))
    assert isinstance(read(path), Coherence)


def test_number_of_lines_is_limited(tmp_path: Path) -> None:
    for line in (b"\n", b"\r", b"0,0\n"):
        path = tmp_path / "lines.csv.gz"
        path.write_bytes(gzip.compress(line * ((1 << 22) + 1), 1))
        with pytest.raises(FileFormatError, match="the text has 4194305 lines or more, expected at most 4194304"):
            read(path)


def test_processor_time_is_limited(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The limit grows with the size of the file; here it is zero."""

    write(tmp_path / "a.csv", ONE)
    write(tmp_path / "a.uff", ONE)
    monkeypatch.setattr(errors, "_IMPORT_SECONDS", 0.0)
    monkeypatch.setattr(errors, "_MAX_SECONDS", 0.0)
    for name in ("a.csv", "a.uff"):
        with pytest.raises(FileFormatError, match=f"{name}.*: reading was stopped after 0 s of processor time"):
            read(tmp_path / name)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
@pytest.mark.parametrize("name", ["pipe.csv", "pipe.mat", "pipe.h5", "pipe.npz", "pipe.uff.gz"])
def test_pipes_and_devices_are_refused(name: str, tmp_path: Path) -> None:
    """The pipe has no writer; opening it would block."""
    os.mkfifo(tmp_path / name)
    with pytest.raises(OSError, match=f"cannot read .*{name}: it is a pipe or a device, expected a file"):
        read(tmp_path / name)
    link = tmp_path / f"link{name[4:]}"
    link.symlink_to("/dev/zero")
    with pytest.raises(OSError, match="it is a pipe or a device"):
        read(link)
