"""LabVIEW measurement files (.lvm) and arrays of NumPy (.npy)."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from properties.good_files import labview
from receptance import ReceptanceWarning
from receptance.hammer import HammerRecords, find_hits
from receptance.io import FileFormatError, TimeSeries, read, read_all, read_frf, read_time_series

SERIES = TimeSeries(
    values=np.round(np.random.default_rng(3).normal(size=(12, 2)), 6),
    channels=["hammer", "tip"],
    units=["N", "m/s^2"],
    sample_rate_hz=1000.0,
)
"""Seed 3."""


def saved(tmp_path: Path, content: bytes) -> Path:
    path = tmp_path / "made.lvm"
    path.write_bytes(content)
    return path


# LabVIEW -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("comma", [False, True])
@pytest.mark.parametrize("columns", ["No", "One", "Multi"])
def test_segments_are_records(columns: str, comma: bool, tmp_path: Path) -> None:
    path = saved(tmp_path, labview(SERIES, columns, comma=comma))
    records = read_all(path)
    assert [record.label for record in records] == ["record 1 of 2", "record 2 of 2"]
    for record, start in zip(records, (0.0, 3.5), strict=True):
        assert isinstance(record, TimeSeries)
        assert (record.channels, record.units) == (("hammer", "tip"), ("N", "m/s^2"))
        assert np.array_equal(record.values, SERIES.values)
        assert record.sample_rate_hz == pytest.approx(1000.0, rel=1e-12)
        assert record.start_s == start
    with pytest.raises(FileFormatError, match="the file holds 2 measurements, expected one"):
        read(path)
    path.rename(path.with_suffix(".txt"))
    assert len(read_all(path.with_suffix(".txt"))) == 2


def changed(*changes: tuple[str, str], columns: str = "No") -> bytes:
    """Return a file of one segment with replaced texts."""
    text = labview(SERIES, columns, comma=False).decode().replace("\r\n", "\n")
    text = text[: text.rindex("Channels")]
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    return text.encode()


def test_units_and_names_as_in_the_file(tmp_path: Path) -> None:
    series = read_time_series(saved(tmp_path, changed(("Newtons", "Volts"), ("m/s^2", "g"), ("tip", "tip (Trigger)"))))
    assert (series.channels, series.units) == (("hammer", "tip (Trigger)"), ("volts", "m/s^2"))
    assert series.values[0, 1] == pytest.approx(9.80665 * SERIES.values[0, 1])
    given = read_time_series(saved(tmp_path, changed(("Newtons", "counts"))), unit={"hammer": "lbf"})
    assert given.values[0, 0] == pytest.approx(4.4482216152605 * SERIES.values[0, 0])


def test_a_time_step_of_few_digits(tmp_path: Path) -> None:
    """1/1024 s with six decimals is 0.05 % off, which the given rate mends."""
    path = saved(tmp_path, changed(("0.001000", "0.000977")))
    with pytest.warns(ReceptanceWarning, match=r"the sample rate, 1023\.54 Hz, may be wrong by 0\.05 %"):
        assert read_time_series(path).sample_rate_hz == pytest.approx(1 / 0.000977)
    assert read_time_series(path, sample_rate_hz=1024.0).sample_rate_hz == 1024.0
    with pytest.raises(FileFormatError, match="sample_rate_hz is 1025, but the file has 1023"):
        read(path, sample_rate_hz=1025.0)


def test_comments_special_blocks_and_channels_without_samples(tmp_path: Path) -> None:
    first = f"\t{SERIES.values[0, 0]:.6f}\t{SERIES.values[0, 1]:.6f}"
    block = "***Start_Special***\nanything,1.5\n***End_Special***\nTime_Pref"
    content = changed((first, first + "\tcable moved, 2.5 mm"), ("Time_Pref", block))
    series = read_time_series(saved(tmp_path, content))
    assert np.array_equal(series.values, SERIES.values)
    assert series.notes == ("line 21 has the comment 'cable moved, 2.5 mm'",)
    content = changed(("Samples\t12\t12", "Samples\t12\t0")).decode().split("\n")
    rows = [row.rpartition("\t")[0] + "\t" if row.startswith("\t") and row.count("\t") == 2 else row for row in content]
    series = read_time_series(saved(tmp_path, "\n".join(rows).encode()))
    assert (series.channels, series.notes) == (("hammer",), ("channel 'tip' has no samples",))


def test_a_spectrum(tmp_path: Path) -> None:
    changes = (("Time\tTime", "Frequency\tFrequency"), ("hammer\ttip", "real\timag"), ("0.001000", "2.500000"))
    frf = read_frf(saved(tmp_path, changed(*changes, ("Newtons\tm/s^2", "m/N\tm/N"))))
    assert frf.frequency_hz.tolist() == [2.5 * k for k in range(12)]
    assert np.array_equal(frf.values[:, 0, 0], SERIES.values @ [1.0, 1.0j])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ([("Separator\tTab", "Separator\tSpace")], "line 3: the separator is 'Space', expected Tab or Comma"),
        ([("Channels\t2", "Channels\t7")], "line 17: there are 4 names, expected those of 7 channels"),
        ([("Samples\t12\t12", "Samples\t13\t13")], "line 29: the header states 13 samples and there are 12 rows"),
        ([("Samples\t12\t12", "Samples\t12\t13")], "line 11: the channels have 12 and 13 samples"),
        (
            [("Delta_X\t0.001000\t0.001000", "Delta_X\t0.001\t0.002")],
            r"line 15: Delta_X is 0\.001 and 0\.002, expected",
        ),
        ([("Time\tTime", "Depth\tDepth")], "line 13: the first column is 'Depth', expected Time or Frequency"),
        ([(f"{SERIES.values[3, 1]:.6f}", "x")], "line 21: channel 'tip' is 'x', expected a number"),
        ([(f"\t{SERIES.values[3, 1]:.6f}", "")], "line 21: there are 1 columns, expected 2"),
        ([("Newtons", "")], "channel 'hammer' has no unit; give it"),
    ],
)
def test_mistakes(changes: list[tuple[str, str]], message: str, tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=message):
        read(saved(tmp_path, changed(*changes)))


def test_a_truncated_file(tmp_path: Path) -> None:
    """At any byte within its numbers the file is refused, or a warning names its last line."""
    content = changed()
    start = content.index(b"Channels")
    for size in range(start, len(content) - 1):
        with pytest.raises((FileFormatError, ReceptanceWarning)):
            read(saved(tmp_path, content[:size]))


def test_measured_hits() -> None:
    path = Path(__file__).parents[3] / "shared" / "measured" / "impact_faults" / "impact2_response0.lvm.gz"
    if not path.is_file():
        pytest.skip(f"there is no {path.name} in ../shared/measured")
    records = [HammerRecords.from_series(s, force=0, responses=1) for s in read_all(path)]  # type: ignore[arg-type]
    assert [record.n_records for record in records] == [1] * 5
    assert {record.sample_rate_hz for record in records} == {51200.0}
    assert records[0].force[0, :3].tolist() == [-0.158373, -0.133621, -0.103197]
    peaks = [float(record.force.max()) for record in records]
    assert peaks == pytest.approx([2000.1, 176.6, 185.3, 170.3, 153.7], abs=0.06)
    with pytest.warns(ReceptanceWarning):
        hits = find_hits(records).hits
    assert len(hits) == 5
    assert not hits[2].kept  # the source calls it a double hit


# NumPy ---------------------------------------------------------------------------------------------------------------

LINES = np.array([10.0, 20.0, 30.0])
VALUES = np.array([1.0 - 2.0j, 3.0 + 4.0j, 0.5])


def array(tmp_path: Path, values: Any) -> Path:
    path = tmp_path / "made.npy"
    np.save(path, values)
    return path


@pytest.mark.parametrize(
    ("values", "columns"),
    [
        (np.column_stack([LINES, VALUES.real, VALUES.imag]), "f [Hz],real [m/N],imag [m/N]"),
        (np.stack([LINES, VALUES.real, VALUES.imag, VALUES.real])[:3].T, "f [Hz],real [m/N],imag [m/N]"),
        (np.column_stack([LINES, VALUES]), "f [Hz],H1 [m/N]"),
        (np.stack([LINES, VALUES]), "f [Hz],receptance [m/N]"),
        (np.stack([LINES, VALUES]).astype(np.complex64), "f [Hz],H [m/N]"),
    ],
)
def test_frfs_in_arrays(values: np.ndarray, columns: str, tmp_path: Path) -> None:
    frf = read_frf(array(tmp_path, values), columns=columns.split(","))
    assert frf.frequency_hz.tolist() == LINES.tolist()
    assert frf.values.ravel().tolist() == VALUES.tolist()


def test_records_in_arrays(tmp_path: Path) -> None:
    channels = np.arange(40).reshape(20, 2)
    series = read_time_series(array(tmp_path, channels), columns=["hammer [N]", "tip [g]"], sample_rate_hz=51200.0)
    assert series.channel("hammer").tolist() == channels[:, 0].tolist()
    alone = read_time_series(array(tmp_path, channels[:, 0]), columns=["tip [V]"], sample_rate_hz=51200.0)
    assert len(alone) == 20
    timed = np.column_stack([np.arange(20) / 1000.0, channels])
    series = read_time_series(array(tmp_path, timed), columns=["t [s]", "f [N]", "tip [g]"])
    assert (series.channels, series.sample_rate_hz) == (("f", "tip"), pytest.approx(1000.0))


@pytest.mark.parametrize(
    ("values", "options", "message"),
    [
        (np.ones((4, 3)), {}, r"an array \(4, 3\) of float64 without names; give them with columns=\[\.\.\.\]"),
        (np.ones((4, 2)), {"columns": ["a [N]", "b [g]"]}, "no times and no sample rate; give it"),
        (
            np.ones((2, 2, 2)),
            {"columns": ["a", "b"]},
            r"an array \(2, 2, 2\) of float64, expected numbers",
        ),
        (
            np.ones((4, 3)),
            {"columns": ["f [Hz]", "real [m/N]", "imag [m/N]"]},
            "row 2: FRF: frequency_hz is not",
        ),
        (np.full((4, 2), 1j), {"columns": ["f [Hz]", "H [m/N]"]}, "column 'f' has complex numbers"),
        (
            np.array([[1.0, np.nan]]),
            {"columns": ["f [Hz]", "coherence"]},
            "row 1: Coherence: the coherence at 1",
        ),
    ],
)
def test_arrays_that_are_not_understood(values: np.ndarray, options: dict, message: str, tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=message):
        read(array(tmp_path, values), **options)


def test_pickles_and_truncated_arrays_are_refused(tmp_path: Path) -> None:
    buffer = io.BytesIO()
    np.save(buffer, np.array([None, 1], dtype=object), allow_pickle=True)
    (tmp_path / "made.npy").write_bytes(buffer.getvalue())
    with pytest.raises(FileFormatError, match=r"Python objects \(pickles\) are not read"):
        read(tmp_path / "made.npy")
    path = array(tmp_path, np.ones((4, 3)))
    path.write_bytes(path.read_bytes()[:-8])
    with pytest.raises(FileFormatError, match=r"takes 96 bytes, there are 88"):
        read(path, columns=["f [Hz]", "real [m/N]", "imag [m/N]"])
