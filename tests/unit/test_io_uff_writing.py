"""Universal files written by this library and by pyuff."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest

from receptance import FRF, Coordinate, ReceptanceWarning
from receptance.io import TimeSeries, read_frf, read_time_series, write
from receptance.io.uff.datasets import Function, data_sets


def test_written_files_are_standard_and_pyuff_reads_them(tmp_path: Path) -> None:
    pyuff = pytest.importorskip("pyuff")
    rng = np.random.default_rng(3)
    numbers = rng.normal(size=(30, 2, 1)) + 1j * rng.normal(size=(30, 2, 1))
    frf = FRF(
        frequency_hz=np.arange(30) * 0.01953125,
        values=numbers,
        form="accelerance",
        responses=[Coordinate("tool", 0.0), Coordinate("tool", 0.0, "theta")],
        excitations=Coordinate("tool", 0.0),
    )
    for name in ("text.uff", "binary.ufb"):
        write(tmp_path / name, frf)
        units, *sets = pyuff.UFF(str(tmp_path / name)).read_sets()
        assert (units["type"], units["length"], units["force"]) == (164, 1.0, 1.0)
        for row, one in enumerate(sets):
            assert np.allclose(one["data"], numbers[:, row, 0], rtol=2e-12)
            assert np.array_equal(one["x"], frf.frequency_hz)
            assert (one["func_type"], one["ordinate_spec_data_type"], one["orddenom_spec_data_type"]) == (4, 12, 13)
            assert one["rsp_dir"] == (2, 6)[row]
            assert one["ordinate_axis_units_lab"] == ("m/s^2", "rad/s^2")[row]
    assert all(len(line) <= 80 for line in (tmp_path / "text.uff").read_bytes().split(b"\n"))


def test_nodes_represent_positions(tmp_path: Path) -> None:
    """Other programs take equal nodes for a drive point."""
    tip, nose = Coordinate("tool", 0.0), Coordinate("holder", 0.0)
    numbers = np.ones((2, 3, 2))
    frf = FRF(
        frequency_hz=[1.0, 2.0],
        values=numbers,
        responses=[tip, Coordinate("tool", 0.0, "theta"), nose],
        excitations=[nose, "y"],
    )
    write(tmp_path / "a.uff", frf)
    data = [item for item in data_sets((tmp_path / "a.uff").read_bytes()) if isinstance(item, Function)]
    nodes = [(one.response.node, one.response.direction, one.reference.node, one.reference.direction) for one in data]
    assert nodes == [(1, 2, 2, 2), (1, 2, 3, 2), (1, 6, 2, 2), (1, 6, 3, 2), (2, 2, 2, 2), (2, 2, 3, 2)]
    back = read_frf(tmp_path / "a.uff")
    assert (back.responses, back.excitations, back.labels) == (frf.responses, frf.excitations, None)


def test_files_that_pyuff_writes(tmp_path: Path) -> None:
    """Its binaries declare too few bytes, and with uneven spacing hold double-precision abscissae."""
    pyuff = pytest.importorskip("pyuff")
    rng = np.random.default_rng(4)
    numbers = rng.normal(size=12) + 1j * rng.normal(size=12)
    lines = np.cumsum(rng.uniform(0.5, 1.5, size=12))
    for binary in (0, 1):
        for even in (0, 1):
            for data in (numbers, numbers.real):
                x = np.arange(12) * 0.5 if even else lines
                given = {
                    "type": 58,
                    "binary": binary,
                    "func_type": 4,
                    "rsp_node": 1,
                    "rsp_dir": 3,
                    "ref_node": 2,
                    "ref_dir": 3,
                }
                given |= {"data": data.copy(), "x": x, "abscissa_spacing": even, "abscissa_spec_data_type": 18}
                given |= {"ordinate_spec_data_type": 12, "orddenom_spec_data_type": 13, "z_axis_spec_data_type": 0}
                path = tmp_path / f"{binary}{even}{data.dtype}.uff"
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore", ResourceWarning)
                    pyuff.UFF(str(path)).write_sets([given])
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore", ReceptanceWarning)
                    frf = read_frf(path, unit="SI")
                assert np.allclose(frf.values[:, 0, 0], data, rtol=0.0 if binary else 1e-11)
                assert np.allclose(frf.frequency_hz, x, rtol=0.0 if binary else 6e-6)


def test_warning_for_fields_without_storage(tmp_path: Path) -> None:
    full = FRF(
        frequency_hz=[1.0, 2.3, 7.1234567890123],
        values=[1.0, 2.0, 3.0],
        log_variance=1e-4,
        usable=[True, True, False],
        notes=["a note"],
        labels=(["a name longer than ten"], ["x"]),
    )
    with pytest.warns(ReceptanceWarning, match="labels .*; log_variance; usable; notes") as caught:
        write(tmp_path / "a.uff", full)
    assert caught[0].filename == __file__
    with pytest.warns(ReceptanceWarning, match="frequency lines more exactly than 2e-07 Hz"):
        write(tmp_path / "b.ufb", full)
    series = TimeSeries(values=[1.0], channels=["c" * 30], units=["N"], sample_rate_hz=10.0, notes=["n"])
    with pytest.warns(ReceptanceWarning, match="a channel's name of more than 20 characters"):
        write(tmp_path / "c.uff", series)
    assert read_time_series(tmp_path / "c.uff").channels == ("c" * 20,)


def test_indistinguishable_lines_are_refused(tmp_path: Path) -> None:
    """A file with equal lines could not be read again."""
    for lines, binary, words in (
        ([1e-3, 1e-3 * (1 + 1e-12), 1.0], False, "13 columns"),
        ([1000.0, 1000.00001, 1.7e4], True, "single precision"),
    ):
        with pytest.raises(
            ValueError, match=f"cannot distinguish the lines .* Hz: it has {words} for each; write .npz"
        ):
            write(tmp_path / "a.uff", FRF(frequency_hz=lines, values=[1.0, 2.0, 3.0]), binary=binary)
    assert not list(tmp_path.iterdir())
