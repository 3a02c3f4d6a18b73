"""NPZ, MAT and HDF5 files: of this library, of other programs, and files that crash their readers."""

from __future__ import annotations

import io
import json
import os
import signal
import struct
import time
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.io

from limits import LIMIT_S
from receptance import FRF, Coordinate, ReceptanceWarning
from receptance.io import Coherence, FileFormatError, TimeSeries, errors, mat_hdf5, read, read_all, read_frf, write
from receptance.io.description import about_text, arrays_of

h5py = pytest.importorskip("h5py", reason="needs h5py: pip install 'receptance[hdf5]'")

LINES = np.array([10.0, 20.0, 30.0])
NUMBERS = np.array([1 + 1j, 2 - 2j, 3 + 0.5j])
FRF_VARIABLES = {"frequency_hz": "f", "values": "H"}


def save(path: Path, arrays: dict[str, Any]) -> Path:
    if path.suffix == ".npz":
        np.savez(path, **arrays)
    elif path.suffix == ".mat":
        scipy.io.savemat(path, arrays)
    else:
        with h5py.File(path, "w") as file:
            for name, value in arrays.items():
                file[name] = value
    return path


@pytest.fixture(params=[".npz", ".mat", ".h5"])
def path(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    return tmp_path / f"made{request.param}"


def test_variables_of_other_programs(path: Path) -> None:
    save(path, {"f": LINES[:, None], "H": NUMBERS, "coh": np.array([[0.9, 0.8, 0.7]]), "text": "hello"})
    with pytest.raises(FileFormatError, match=r"name its variables and their unit.*H \((1x)?3 complex128\)|double"):
        read(path)
    with pytest.raises(FileFormatError, match="does not state the unit of its FRF"):
        read(path, variables=FRF_VARIABLES)
    frf = read_frf(path, variables={**FRF_VARIABLES, "coherence": "coh"}, unit="g/N")
    assert np.allclose(frf.values[:, 0, 0], NUMBERS * 9.80665)
    assert frf.coherence is not None
    assert frf.coherence.ravel().tolist() == [0.9, 0.8, 0.7]
    alone = read(path, variables={"frequency_hz": "f", "coherence": "coh"})
    assert isinstance(alone, Coherence)
    with pytest.raises(FileFormatError, match="there is no numeric variable 'G' for 'values'; the file holds"):
        read(path, variables={"frequency_hz": "f", "values": "G"}, unit="g/N")
    with pytest.raises(FileFormatError, match="variables names 'phase', expected some of"):
        read(path, variables={**FRF_VARIABLES, "phase": "coh"}, unit="g/N")


def test_separate_parts_and_matrices(path: Path) -> None:
    cube = np.arange(12.0).reshape(3, 2, 2)
    save(path, {"f": LINES, "re": NUMBERS.real, "im": NUMBERS.imag, "cube": cube, "square": cube[:, :, 0]})
    apart = read_frf(path, variables={"frequency_hz": "f", "real": "re", "imaginary": "im"}, unit="m/N")
    assert np.array_equal(apart.values[:, 0, 0], NUMBERS)
    with pytest.warns(ReceptanceWarning, match="the values are real: without a phase"):
        matrix = read_frf(path, variables={"frequency_hz": "f", "values": "cube"}, quantity="mobility", unit="SI")
    assert np.array_equal(matrix.values.real, cube)
    assert "the values are real" in matrix.notes[0]
    with pytest.raises(FileFormatError, match="its columns may be responses or excitations"):
        read(path, variables={"frequency_hz": "f", "values": "square"}, unit="m/N")
    with pytest.raises(FileFormatError, match=r"has shape \(3, 2, 2\)|has shape"):
        read(path, variables={"frequency_hz": "re", "values": "cube", "coherence": "square"}, unit="m/N")
    with pytest.raises(FileFormatError, match="expected 'values', 'real' and 'imaginary', or 'magnitude'"):
        read(path, variables={"frequency_hz": "f", "real": "re"}, unit="m/N")


def test_columns_of_arrays(path: Path) -> None:
    """Analysers that write [axis, value] in two columns, a complex axis, or one column a channel without names."""
    t = np.arange(100) / 512.0
    save(
        path,
        {
            "X1": np.column_stack([t, np.sin(t)]),
            "X2": np.column_stack([t, np.cos(t)]),
            "H1_2": np.column_stack([LINES, NUMBERS]),
            "C1_2": np.column_stack([LINES, [0.9, 0.8, 0.7]]),
            "many": np.outer(NUMBERS, np.arange(1.0, 5.0)),
            "f": LINES,
        },
    )
    in_units: dict[str, Any] = {"unit": {"hammer": "N", "tip": "g"}}
    series = read(path, variables={"time_s": "X1[:,0]", "hammer": "X1[:,1]", "tip": "X2[:, 1]"}, **in_units)
    assert isinstance(series, TimeSeries)
    assert series.sample_rate_hz == pytest.approx(512.0)
    assert np.array_equal(series.channel("hammer"), np.sin(t))
    for variables, options in (
        ({"time_s": "X1", "hammer": "X1", "tip": "X2"}, {}),
        ({"hammer": "X1", "tip": "X2"}, {"sample_rate_hz": 512.0}),
    ):
        with pytest.raises(FileFormatError, match=r"has shape \(100, 2\), expected one column.*\[:,[01]\]"):
            read(path, variables=variables, **in_units, **options)
    frf = read_frf(
        path,
        variables={"frequency_hz": "H1_2[:,0]", "values": "H1_2[:,1]", "coherence": "C1_2[:,1]"},
        unit="m/N",
    )
    assert np.array_equal(frf.frequency_hz, LINES)
    assert np.array_equal(frf.values.ravel(), NUMBERS)
    assert frf.coherence is not None
    with pytest.raises(FileFormatError, match=r"'H1_2\[:,0\]' is its first column"):
        read(path, variables={"frequency_hz": "H1_2", "values": "H1_2"}, unit="m/N")
    with pytest.raises(FileFormatError, match=r"has shape \(3, 2\) and no column 2; columns"):
        read(path, variables={"frequency_hz": "f", "values": "H1_2[:,2]"}, unit="m/N")
    with pytest.raises(FileFormatError, match=r"select one column, counted from 0, for example 'many\[:,0\]'"):
        read(path, variables={"frequency_hz": "f", "values": "many"}, unit="m/N")
    third = read_frf(path, variables={"frequency_hz": "f", "values": "many[:,2]"}, unit="m/N")
    assert np.array_equal(third.values.ravel(), 3.0 * NUMBERS)
    places = [Coordinate("tip", 0.01 * i, "y") for i in range(4)]
    roving = read_frf(path, variables={"frequency_hz": "f", "values": "many"}, unit="m/N", excitations=places)
    assert roving.values.shape == (3, 1, 4)
    assert np.array_equal(roving.values[:, 0, 2], 3.0 * NUMBERS)
    measured_data = read_frf(path, variables={"frequency_hz": "f", "values": "many"}, unit="m/N", responses=places)
    assert measured_data.values.shape == (3, 4, 1)


def test_separate_magnitude_and_phase(path: Path) -> None:
    save(path, {"f": LINES, "mag": np.abs(NUMBERS), "deg": np.degrees(np.angle(NUMBERS)), "rad": np.angle(NUMBERS)})
    for role, name in (("phase_deg", "deg"), ("phase_rad", "rad")):
        frf = read_frf(path, variables={"frequency_hz": "f", "magnitude": "mag", role: name}, unit="m/N")
        np.testing.assert_allclose(frf.values.ravel(), NUMBERS, rtol=1e-14)
    with pytest.raises(FileFormatError, match="or 'magnitude' and 'phase_deg' or 'phase_rad'"):
        read(path, variables={"frequency_hz": "f", "magnitude": "mag"}, unit="m/N")


def test_mat_files_with_strings_of_matlab(tmp_path: Path) -> None:
    """An object of MATLAB (a string, a table) beside the numbers; scipy.io.whosmat cannot list it."""

    def element(kind: int, content: bytes) -> bytes:
        return struct.pack("<II", kind, len(content)) + content + b"\0" * (-len(content) % 8)

    inner = element(6, struct.pack("<II", 13, 0)) + element(5, struct.pack("<ii", 6, 1)) + element(1, b"")
    inner += element(6, np.arange(6, dtype="<u4").tobytes())
    texts = b"".join(element(1, text) for text in (b"note", b"MCOS", b"string"))
    opaque = element(14, element(6, struct.pack("<II", 17, 0)) + texts + element(14, inner))
    path = save(tmp_path / "analyser.mat", {"f": LINES, "H": NUMBERS})
    content = path.read_bytes()
    path.write_bytes(content[:128] + opaque + content[128:])
    with pytest.raises(TypeError):
        scipy.io.whosmat(path)
    frf = read_frf(path, variables=FRF_VARIABLES, unit="m/N")
    assert np.array_equal(frf.values.ravel(), NUMBERS)
    with pytest.raises(FileFormatError, match=r"The file holds f \(1x3 float64\), H \(1x3 complex128\)"):
        read(path)


def test_variables_with_the_names_of_this_library(path: Path) -> None:
    """`np.savez("tip.npz", frequency_hz=..., values=...)` needs only its unit; MAT and HDF5 contain it."""
    save(path, {"frequency_hz": LINES, "values": NUMBERS})
    options: dict[str, Any] = (
        {} if path.suffix == ".npz" else {"variables": {"frequency_hz": "frequency_hz", "values": "values"}}
    )
    assert np.array_equal(read_frf(path, unit="m/N", **options).values[:, 0, 0], NUMBERS)


def test_time_series_of_other_programs(path: Path) -> None:
    arrays = {"t": np.arange(4) / 1000.0, "F": np.arange(4.0), "a": np.arange(4, dtype=np.int16)}
    save(path, {**arrays, "short": np.arange(3.0), "gap": np.array([0.0, np.nan, 0.0, 0.0])})
    variables = {"time_s": "t", "hammer": "F", "tip": "a"}
    series = read(path, variables=variables, unit={"hammer": "kN", "tip": "g"})
    assert isinstance(series, TimeSeries)
    assert series.values[3] == pytest.approx([3000.0, 3 * 9.80665])
    assert series.sample_rate_hz == pytest.approx(1000.0)
    fast = read(path, variables={"tip": "a"}, unit="g", sample_rate_hz=51200.0)
    assert isinstance(fast, TimeSeries)
    assert (fast.sample_rate_hz, fast.start_s) == (51200.0, 0.0)
    for changed, options, message in (
        ({**variables, "x": "short"}, {}, "different numbers of samples"),
        (variables, {"unit": "N"}, "a single unit, 'N', was given for 2 channels"),
        (variables, {"unit": {"hammer": "N"}}, "channel 'tip' has no unit; give it"),
        ({"tip": "a"}, {"unit": "g"}, "there are no times and no sample rate"),
        ({"time_s": "t"}, {}, "variables names no channel"),
        ({"time_s": "short", "tip": "a"}, {"unit": "g"}, "different numbers of samples"),
        ({"time_s": "t", "tip": "gap"}, {"unit": "g"}, "row 2: TimeSeries: sample 1 of 'tip' is nan"),
    ):
        with pytest.raises(FileFormatError, match=message):
            read(path, variables=changed, **options)


def test_matlab_version_7_3(tmp_path: Path) -> None:
    """An HDF5 file with a header before it, arrays the other way round, complex numbers as pairs."""
    path = tmp_path / "v73.mat"
    pair = np.zeros((1, 3), dtype=[("real", "f8"), ("imag", "f8")])
    pair["real"], pair["imag"] = NUMBERS.real, NUMBERS.imag
    cube = np.arange(12.0).reshape(3, 2, 2)
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, value in (("f", LINES[None, :]), ("H", pair), ("cube", cube.T)):
            file.create_dataset(name, data=value).attrs["MATLAB_class"] = np.bytes_("double")
    content = path.read_bytes()
    path.write_bytes(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(512) + content[512:])
    frf = read_frf(path, variables=FRF_VARIABLES, unit="m/N")
    assert np.array_equal(frf.values[:, 0, 0], NUMBERS)
    with pytest.warns(ReceptanceWarning, match="the values are real"):
        frf = read_frf(path, variables={"frequency_hz": "f", "values": "cube"}, unit="m/N")
    assert np.array_equal(frf.values.real, cube)


def test_older_mat_files_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "v4.mat"
    scipy.io.savemat(path, {"f": LINES}, format="4")
    with pytest.raises(
        FileFormatError, match=r"v4.mat, byte 0: this is not a MAT file of version 5 to 7 \(save it with -v7\)"
    ):
        read(path)
    (tmp_path / "a.h5").write_bytes(b"something else")
    with pytest.raises(FileFormatError, match="HDF5 signature is missing"):
        read(tmp_path / "a.h5")


# Damage ----------------------------------------------------------------------------------------------------------


def test_pickles_are_not_read(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    np.savez(path, f=np.array([{"a": 1}], dtype=object))
    with pytest.raises(FileFormatError, match=r"a.npz, array 'f': .*(Python objects \(pickles\) are not read|header)"):
        read(path)


def npz_with(path: Path, content: bytes, *, compression: int = zipfile.ZIP_STORED) -> Path:
    with zipfile.ZipFile(path, "w", compression) as archive:
        archive.writestr("f.npy", content)
    return path


def test_npz_sizes_are_checked_before_allocation(tmp_path: Path) -> None:
    buffer = io.BytesIO()
    np.save(buffer, LINES)
    good = buffer.getvalue()
    path = tmp_path / "a.npz"
    for old, new, message in (
        (b"(3,), ", b"(3, 99999999999), ", "takes .* bytes, there are 24"),
        (b"(3,), ", b"(-3,), ", r"shape \(-3,\)"),
        (b"'<f8'", b"'|O'", "Python objects"),
        (b"'<f8'", b"'<M8[s]'", "expected numbers or text"),
        (b"{'descr'", b"{'", "the header is damaged"),
        (b"\x93NUMPY", b"\x92NUMPY", "the header is damaged"),
    ):
        header, _, data = good.partition(b"\n")
        changed = header.replace(old, new)
        changed = changed[: len(header)] if len(changed) > len(header) else changed.ljust(len(header))
        with pytest.raises(FileFormatError, match=message):
            read(npz_with(path, changed + b"\n" + data))
    with pytest.raises(FileFormatError, match="there are 16"):
        read(npz_with(path, good[:-8]))
    with pytest.raises(FileFormatError, match="the compression 14 is not one of NumPy's"):
        read(npz_with(path, good, compression=zipfile.ZIP_LZMA))
    content = bytearray(npz_with(path, b"\0" * 2000, compression=zipfile.ZIP_DEFLATED).read_bytes())
    at = content.rfind(b"PK\x01\x02")
    content[at + 24 : at + 28] = (2**31).to_bytes(4, "little")
    path.write_bytes(bytes(content))
    with pytest.raises(FileFormatError, match="the arrays take more than 1024 MiB when expanded"):
        read(path)
    path.write_bytes(b"PK\x03\x04" + b"\0" * 50)
    with pytest.raises(FileFormatError, match="not a complete NPZ file"):
        read(path)


def test_declared_sizes_are_not_allocated(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file.create_dataset("f", shape=(10**9,), dtype="f8", chunks=(1000,))
        file["H"] = NUMBERS
        file["outside"] = h5py.ExternalLink("other.h5", "/f")
        file["again"] = h5py.SoftLink("/H")
    with pytest.raises(FileFormatError, match="its arrays take more than 1024 MiB when expanded"):
        read(path, variables=FRF_VARIABLES, unit="m/N")
    with pytest.raises(FileFormatError, match="no numeric variable 'outside'"):
        read(path, variables={"frequency_hz": "outside", "values": "H"}, unit="m/N")


def test_links_to_other_files_are_not_read(tmp_path: Path) -> None:
    """External storage and virtual data sets are links into other files; reading a pipe among these would block."""
    np.array([1e-6, 2e-6, 3e-6]).tofile(tmp_path / "secret.bin")
    with h5py.File(tmp_path / "source.h5", "w") as file:
        file["H"] = NUMBERS.real
    names = ["secret.bin", "source.h5"]
    if hasattr(os, "mkfifo"):
        os.mkfifo(tmp_path / "pipe")
        names.append("pipe")
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file["f"] = LINES
        for name in names:
            other = str(tmp_path / name)
            file.create_dataset(f"external {name}", shape=(3,), dtype="f8", external=[(other, 0, 24)])
            for length in (3, h5py.h5s.UNLIMITED):
                layout = h5py.VirtualLayout(shape=(3,), maxshape=(None,), dtype="f8")
                layout[:length] = h5py.VirtualSource(other, "H", shape=(3,), maxshape=(None,))[:length]
                file.create_virtual_dataset(f"virtual {name} {length}", layout)
        listed = [name for name in file if name != "f"]
    for name in listed:
        began = time.perf_counter()
        with pytest.raises(FileFormatError, match=rf"no numeric variable '{name}'.*{name} \(in another file, which"):
            read(path, variables={"frequency_hz": "f", "values": name}, unit="m/N")
        assert time.perf_counter() - began < LIMIT_S


def test_highly_compressed_arrays_are_read(tmp_path: Path) -> None:
    """Zeros take a thousandth of their space, and less with filters before; no rule about ratios holds for them."""
    options: dict[str, Any] = {"variables": {"a": "a"}, "unit": "N", "sample_rate_hz": 1e3}
    still = np.zeros(4_000_000)
    scipy.io.savemat(tmp_path / "a.mat", {"a": still}, do_compression=True)
    np.savez_compressed(tmp_path / "a.npz", a=still)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.create_dataset("a", data=still, compression="gzip", shuffle=True)
    with h5py.File(tmp_path / "fill.h5", "w") as file:
        file.create_dataset("a", shape=still.shape, dtype="f8", chunks=(1000,), fillvalue=0.0)
    for name in ("a.mat", "a.npz", "a.h5", "fill.h5"):
        assert (tmp_path / name).stat().st_size < still.nbytes / 400
        assert isinstance(series := read(tmp_path / name, **options), TimeSeries)
        assert series.values.shape == (*still.shape, 1)


def test_expanded_size_of_mat_files_is_limited(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An element of 16 MiB, twice; the limit is lowered for speed."""

    monkeypatch.setattr(errors, "LARGEST", 1 << 25)
    options: dict[str, Any] = {"variables": {"a": "a"}, "unit": "N", "sample_rate_hz": 1e3}
    scipy.io.savemat(tmp_path / "a.mat", {"a": np.zeros(1 << 21)}, do_compression=True)
    content = (tmp_path / "a.mat").read_bytes()
    assert isinstance(read(tmp_path / "a.mat", **options), TimeSeries)
    (tmp_path / "a.mat").write_bytes(content[:128] + content[128:] * 2)
    with pytest.raises(FileFormatError, match=r"a\.mat: its arrays take more than 32 MiB when expanded"):
        read(tmp_path / "a.mat", **options)


@pytest.mark.skipif(os.name != "posix", reason="process groups are those of POSIX")
def test_an_interruption_from_a_terminal_does_not_reach_the_reader(tmp_path: Path) -> None:
    path = tmp_path / "a.mat"
    write(path, FRF(frequency_hz=LINES, values=NUMBERS))
    read_frf(path)
    assert mat_hdf5._reader is not None
    assert os.getpgid(mat_hdf5._reader.pid) != os.getpgid(0)


def test_a_killed_reader_is_replaced(tmp_path: Path) -> None:
    path = tmp_path / "a.mat"
    write(path, FRF(frequency_hz=LINES, values=NUMBERS))
    assert read_frf(path).shape == (3, 1, 1)
    reader = mat_hdf5._reader
    assert reader is not None
    os.kill(reader.pid, signal.SIGKILL)
    reader.wait()
    assert read_frf(path).shape == (3, 1, 1)
    assert mat_hdf5._reader is not reader


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="limits of processor time need POSIX")
def test_reader_that_blocks_or_crashes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A reader that behaves as scipy.io and libhdf5 on some damaged files."""
    worker = Path(mat_hdf5.__file__).with_name("_worker.py").read_text()
    path = tmp_path / "a.mat"
    write(path, FRF(frequency_hz=LINES, values=NUMBERS))
    for line, message in (
        ("while True: pass", r"scipy.io did not finish within 0\.3 s of processor time"),
        ("import os; os.abort()", r"a.mat: scipy.io crashed on it \(SIGABRT\): the file is damaged"),
        ("np.ones(10**13)", "it takes more than 4096 MiB of memory"),
        ("sys.stdout.buffer.write(b'x' * 100); sys.stdout.flush()", "sent an invalid answer"),
        (
            "import os, signal; os.kill(os.getpid(), signal.SIGKILL)",
            "was killed .*need not be damaged",
        ),
        ("sys.exit(3)", "ended with code 3"),
    ):
        bad = tmp_path / "_worker.py"
        bad.write_text(
            worker.replace("    import scipy.io\n\n    try:\n", f"    import scipy.io\n    {line}\n    try:\n")
        )
        assert line in bad.read_text()
        monkeypatch.setattr(mat_hdf5, "__file__", str(tmp_path / "mat_hdf5.py"))
        mat_hdf5._close_reader()
        with pytest.raises(FileFormatError, match=message):
            read(path)
        monkeypatch.undo()
        mat_hdf5._close_reader()
    assert read_frf(path).shape == (3, 1, 1)


def test_reading_in_a_forked_process(tmp_path: Path) -> None:
    if not hasattr(os, "fork"):
        pytest.skip("this system does not fork")
    path = tmp_path / "a.mat"
    write(path, FRF(frequency_hz=LINES, values=NUMBERS))
    read(path)
    reader = mat_hdf5._reader
    child = os.fork()
    if child == 0:
        try:
            os._exit(0 if read_frf(path).shape == (3, 1, 1) else 1)
        finally:
            os._exit(2)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
    assert mat_hdf5._reader is reader
    assert read_frf(path).shape == (3, 1, 1)


def changed(data: bytes, seed: int, count: int) -> Iterator[bytes]:
    """Yield copies of a file with a changed byte."""
    rng = np.random.default_rng(seed)
    for place in rng.choice(len(data), size=count, replace=False).tolist():
        damaged = bytearray(data)
        damaged[place] ^= int(rng.integers(1, 256))
        yield bytes(damaged)


@pytest.mark.parametrize("ending", [".npz", ".h5"])
def test_a_changed_byte_never_changes_a_measurement(ending: str, tmp_path: Path) -> None:
    path = tmp_path / f"a{ending}"
    frf = FRF(frequency_hz=LINES, values=NUMBERS, coherence=0.9, log_variance=1e-4, averages=7, label="tip")
    things = [frf, TimeSeries(values=[[1.0], [2.0]], channels=["f"], units=["N"], sample_rate_hz=512.0)]
    write(path, things)
    data = path.read_bytes()
    whole = [about_text(thing) + repr(arrays_of(thing)) for thing in read_all(path)]
    refused = 0
    for damaged in changed(data, 1, 300):
        path.write_bytes(damaged)
        try:
            assert [about_text(thing) + repr(arrays_of(thing)) for thing in read_all(path)] == whole
        except FileFormatError:
            refused += 1
    assert refused > 10


def rewritten(path: Path, change: Callable[[dict[str, Any]], None]) -> None:
    """Change the arrays of an NPZ file."""
    with np.load(path) as file:
        arrays = dict(file)
    change(arrays)
    np.savez(path, **arrays)


def test_the_checksum_is_of_names_types_fields_and_numbers(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    frfs = [FRF(frequency_hz=LINES, values=NUMBERS, coherence=0.9, label=label) for label in ("first", "second")]
    for change in (
        lambda arrays: arrays.update({"frf1.values": arrays["frf1.values"] * 1.01}),
        lambda arrays: arrays.pop("frf2.coherence"),
        lambda arrays: arrays.update({"frf1.frequency_hz": arrays["frf1.frequency_hz"].astype("f4")}),
        lambda arrays: arrays.update({"frf1.about": np.array(str(arrays["frf1.about"]).replace("first", "other"))}),
    ):
        write(path, frfs)
        rewritten(path, change)
        with pytest.raises(FileFormatError, match=r"a\.npz, frf.: the checksum is .*damaged or changed after"):
            read_all(path)
    write(path, frfs)
    rewritten(path, lambda arrays: arrays.pop("frf2.about"))
    with pytest.raises(FileFormatError, match="the file holds 1 of 2 measurements"):
        read_all(path)

    # Files of others and earlier versions have none.
    def without(arrays: dict[str, Any]) -> None:
        fields = json.loads(str(arrays["frf1.about"]))
        arrays["frf1.about"] = np.array(
            json.dumps({k: fields[k] for k in fields if k not in ("checksum", "measurements")})
        )

    write(path, frfs[0])
    rewritten(path, without)
    assert read_frf(path).label == "first"


@pytest.mark.parametrize("ending", [".npz", ".mat", ".h5", ".csv"])
def test_a_low_coherence_in_a_file_of_this_library_is_noted_once(ending: str, tmp_path: Path) -> None:
    path = tmp_path / f"a{ending}"
    write(path, FRF(frequency_hz=LINES, values=NUMBERS, coherence=[0.2, 0.3, 0.9]))
    with pytest.warns(ReceptanceWarning, match="the median coherence is 0.30 over 3 lines"):
        frf = read_frf(path)
    assert len(frf.notes) == 1
    write(path, frf)
    with pytest.warns(ReceptanceWarning, match="the median coherence is 0.30 over 3 lines"):
        assert read_frf(path).notes == frf.notes


def sdynpy(path: Path, kind: int, ordinate: np.ndarray, coordinate: list[Any], **more: Any) -> Path:
    """Write the arrays of SDynPy: functions x abscissae, and node and direction of their ends."""
    shape, n = ordinate.shape[:-1], ordinate.shape[-1]
    point = [("node", "u8"), ("direction", "i1")]
    fields = [("abscissa", "f8", (n,)), ("ordinate", ordinate.dtype, (n,)), ("comment1", "<U80")]
    data = np.zeros(shape, dtype=[*fields, ("coordinate", point, np.shape(coordinate)[-1:])])
    data["abscissa"], data["ordinate"], data["comment1"] = LINES, ordinate, "swept"
    data["coordinate"]["node"] = np.array(coordinate) // 10
    data["coordinate"]["direction"] = np.array(coordinate) % 10
    if more:
        data = data[[name for name in data.dtype.names or () if name != "abscissa"]].copy()
    np.savez(path, data=data, function_type=kind, **more)
    return path


def test_arrays_of_sdynpy(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    matrix = np.stack([[NUMBERS, 2 * NUMBERS], [3 * NUMBERS, 4 * NUMBERS]])
    points = [[[11, 11], [11, 25]], [[25, 11], [25, 25]]]
    with pytest.raises(FileFormatError, match=r"a\.npz, the array 'data': .* unit of the FRF; give it"):
        read_frf(sdynpy(path, 4, matrix, points))
    frf = read_frf(path, unit="SI", quantity="accelerance")
    assert np.array_equal(frf.values, np.moveaxis(matrix, -1, 0))
    assert (frf.labels, frf.label) == ((("1:+1", "2:+5"), ("1:+1", "2:+5")), "swept")
    assert frf.units[1] == ("rad/s^2/N", "rad/s^2/(N m)")
    single = read_frf(sdynpy(path, 4, NUMBERS[None], [[11, 11]], abscissa_start=5.0, abscissa_step=2.0), unit="g/N")
    assert single.frequency_hz.tolist() == [5.0, 7.0, 9.0]
    coherence = read(sdynpy(path, 6, np.array([[0.5, 0.6, 0.7]]), [[11, 11]]))
    assert isinstance(coherence, Coherence)
    series = read(sdynpy(path, 1, np.arange(6.0).reshape(2, 3), [[11], [21]]), unit={"1:+1": "N", "2:+1": "g"})
    assert isinstance(series, TimeSeries)
    assert series.channels == ("1:+1", "2:+1")
    named = {"frequency_hz": "data.abscissa", "values": "data.ordinate"}
    sdynpy(path, 4, NUMBERS, [11, 11])
    assert np.array_equal(read_frf(path, variables=named, unit="m/N").values.ravel(), NUMBERS)


def test_cells_of_matlab_7_3(tmp_path: Path) -> None:
    path = tmp_path / "cells.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        stored = [file.create_dataset(f"#refs#/{name}", data=value) for name, value in (("a", LINES), ("b", 2 * LINES))]
        inner = file.create_group("#refs#/c")
        inner.create_dataset("f", data=3 * LINES)
        cells = file.create_dataset("C", (3, 1), dtype=h5py.ref_dtype)
        cells[:, 0] = [stored[0].ref, stored[1].ref, inner.ref]
        cells.attrs["MATLAB_class"] = np.bytes_("cell")
    content = path.read_bytes()
    path.write_bytes(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(512) + content[512:])
    with pytest.raises(
        FileFormatError, match=r"The file holds C\[0\] \(3 float64\), C\[1\] .*, C\[2\]/f \(3 float64\)"
    ):
        read(path)
    with pytest.warns(ReceptanceWarning, match="the values are real"):
        frf = read_frf(path, variables={"frequency_hz": "C[0]", "values": "C[2]/f"}, unit="m/N")
    assert np.array_equal(frf.values[:, 0, 0].real, 3 * LINES)
