"""MAT files (version 5 to 7, as written by `save -v7` and scipy.io) and HDF5 files, which include MATLAB's version 7.3.

Of 20,000 randomly damaged files scipy.io 1.17 crashed the process on 97 MAT files and ran for more than a second on 15;
libhdf5 2.0 crashed on 3 HDF5 files and ran for more than five seconds on 6. Files are therefore read in a second
process (`_worker.py`) with limits of processor time and memory, and its exit is reported as an error.
"""

from __future__ import annotations

import atexit
import io
import json
import math
import os
import re
import signal
import struct
import subprocess
import sys
import threading
import time
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from receptance._files import open_file
from receptance.io.arrays import measurements_of, named_items, requested_names
from receptance.io.errors import FileFormatError
from receptance.io.limits import BYTES_PER_SECOND, LARGEST, allowed_seconds, check_size
from receptance.io.measurements import Measurement
from receptance.io.options import ReadOptions

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["hdf5_bytes", "mat_bytes", "read_hdf5", "read_mat"]

Kind = Literal["mat", "hdf5"]
_WAIT_SECONDS = 60.0
"""Wall-clock seconds added to the limit of processor time, for a busy machine."""
_CRASH_SIGNALS = ("SIGSEGV", "SIGABRT", "SIGBUS", "SIGFPE", "SIGILL")
_COMPRESSED_ELEMENT = 15
"""Type of a zlib-compressed element of a MAT file."""
_PIECE = 1 << 18
_DTYPE = re.compile(r"[<>|=][biufc][0-9]{1,2}")
_NAMES = {"mat": "MAT", "hdf5": "HDF5"}
_LIBRARIES = {"mat": "scipy.io", "hdf5": "libhdf5"}


def mat_bytes(measurements: Sequence[Measurement]) -> bytes:
    """Return the contents of a MAT file with one struct per measurement (frf1, time1, ...); all fields are stored."""
    import scipy.io

    structs: dict[str, dict[str, Any]] = {}
    for name, value in named_items(measurements, separator=".").items():
        owner, _, field = name.partition(".")
        structs.setdefault(owner, {})[field] = value
    buffer: Any = io.BytesIO()
    scipy.io.savemat(buffer, structs, do_compression=True)
    return bytes(buffer.getvalue())


def hdf5_bytes(measurements: Sequence[Measurement]) -> bytes:
    """Return the contents of an HDF5 file with one group per measurement (frf1, time1, ...); all fields are stored."""
    import h5py  # type: ignore[import-untyped]

    buffer = io.BytesIO()
    with h5py.File(buffer, "w", track_order=True) as file:
        for name, value in named_items(measurements, separator="/").items():
            # The checksum detects damaged numbers.
            options = {"chunks": value.shape, "fletcher32": True} if isinstance(value, np.ndarray) else {}
            file.create_dataset(name, data=value, **options)
    return buffer.getvalue()


def read_mat(path: Path, options: ReadOptions) -> list[Measurement]:
    """Return the measurements in a MAT file: those written by this library, else the variables of the options."""
    contents = _load(path, "mat", requested_names(options))
    return measurements_of(contents.arrays | contents.texts, options, separator=".", listed=contents.listed)


def read_hdf5(path: Path, options: ReadOptions) -> list[Measurement]:
    """Return the measurements in an HDF5 file: those written by this library, else the data sets of the options."""
    contents = _load(path, "hdf5", requested_names(options))
    return measurements_of(contents.arrays | contents.texts, options, separator="/", listed=contents.listed)


@dataclass(frozen=True)
class _Contents:
    """Loaded arrays and texts of a file, and shape and type of all its variables."""

    arrays: dict[str, NDArray[Any]]
    texts: dict[str, str]
    listed: dict[str, str]


class _ReaderExitError(Exception):
    """The reading process ended, or sent an invalid answer."""


class _Reader:
    """The process that reads files."""

    def __init__(self) -> None:
        script = Path(__file__).with_name("_worker.py")
        if not sys.executable or getattr(sys, "frozen", False):
            # The executable of a frozen program is the program itself.
            raise FileFormatError(
                "MAT and HDF5 files are read in a second process, but there is no Python interpreter to start"
            )
        environment = os.environ | dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
        # -P: modules in the folder of the script must not hide others.
        command = [sys.executable, "-P", "-W", "ignore", str(script)]
        self.process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env=environment
        )

    def ask(self, request: dict[str, Any], timeout: float) -> _Contents:
        """Return the answer to a request, or raise _ReaderExitError; the process is killed after the timeout."""
        requests = self.process.stdin
        assert requests is not None
        timer = threading.Timer(timeout, self.process.kill)
        timer.daemon = True
        timer.start()
        try:
            requests.write(json.dumps(request).encode() + b"\n")
            requests.flush()
            (length,) = struct.unpack("<Q", self._receive(8))
            header = json.loads(self._receive(length))
            if "error" in header:
                raise FileFormatError(f"this {_NAMES[request['kind']]} file cannot be read: {header['error']}")
            arrays = {name: self._receive_array(dtype, tuple(shape)) for name, dtype, shape in header["arrays"]}
            return _Contents(arrays, dict(header["texts"]), dict(header["listed"]))
        except FileFormatError:
            raise
        except (OSError, ValueError, KeyError, TypeError, MemoryError, struct.error) as error:
            raise _ReaderExitError from error
        finally:
            timer.cancel()

    def _receive(self, count: int) -> bytes:
        answers = self.process.stdout
        content = answers.read(count) if answers is not None and 0 <= count < 1 << 40 else b""
        if len(content) != count:
            raise _ReaderExitError
        return content

    def _receive_array(self, dtype: str, shape: tuple[int, ...]) -> NDArray[Any]:
        if not _DTYPE.fullmatch(dtype):
            raise _ReaderExitError
        kind = np.dtype(dtype)
        return np.frombuffer(self._receive(math.prod(shape) * kind.itemsize), dtype=kind).reshape(shape)

    def exit_code(self) -> int | None:
        """Return the exit code of the process, None if it is still running."""
        try:
            return self.process.wait(timeout=0.1)
        except subprocess.TimeoutExpired:
            return None

    def close(self) -> None:
        """Kill the process."""
        self.process.kill()
        for stream in (self.process.stdin, self.process.stdout):
            if stream is not None:
                try:
                    stream.close()
                except OSError:
                    continue
        self.process.wait()


_lock = threading.Lock()
_reader: _Reader | None = None


def _load(path: Path, kind: Kind, names: Sequence[str] | None) -> _Contents:
    """Return the named arrays of a MAT or HDF5 file; without names, those written by this library.

    Raises
    ------
    FileFormatError
        A file that cannot be read, with the message of scipy.io or h5py, or one on which the reading process ends.
    """
    global _reader
    size = path.stat().st_size
    allowed = allowed_seconds(_expanded_mat_size(path) if kind == "mat" else size)
    timeout = _WAIT_SECONDS + allowed_seconds(LARGEST)
    request = {
        "kind": kind,
        "path": str(path.resolve()),
        "names": None if names is None else list(names),
        "size": size,
        "largest": LARGEST,
        "seconds": allowed,
        "bytes_per_second": BYTES_PER_SECOND,
    }
    with _lock:
        if _reader is not None and _reader.process.poll() is not None:
            _close_reader()
        if _reader is None:
            _reader = _Reader()
        begin = time.monotonic()
        try:
            return _reader.ask(request, timeout)
        except FileFormatError:
            raise
        except _ReaderExitError:
            code, late = _reader.exit_code(), time.monotonic() - begin >= timeout
            _close_reader()
            raise FileFormatError(_exit_message(kind, code, allowed, timeout if late else None)) from None
        except BaseException:
            # After an interruption the rest of the answer would be taken for the next one.
            _close_reader()
            raise


def _exit_message(kind: Kind, code: int | None, allowed: float, timeout: float | None) -> str:
    """Return the error message for a reading process that ended; the file is not always the cause."""
    library = _LIBRARIES[kind]
    if timeout is not None:
        return f"{library} did not answer within {timeout:.0f} s and was stopped"
    if code is None or code >= 0:
        outcome = "sent an invalid answer" if code is None else f"ended with code {code}"
        return f"the process that read the file with {library} {outcome}; the file may be damaged"
    if code == -getattr(signal, "SIGPROF", 0):
        return (
            f"{library} did not finish within {allowed:.1f} s of processor time, the limit for a file of this size; "
            "the file may be damaged"
        )
    try:
        name = signal.Signals(-code).name
    except ValueError:
        name = f"signal {-code}"
    if name in _CRASH_SIGNALS:
        return f"{library} crashed on it ({name}): the file is damaged"
    return (
        f"the process that read the file with {library} was killed ({name}), possibly for lack of memory; the file "
        "need not be damaged, read it again"
    )


def _expanded_mat_size(path: Path) -> int:
    """Return the size in bytes of the expanded elements of a MAT file of version 5.

    Raises
    ------
    FileFormatError
        More than are read of one file.
    """
    total = path.stat().st_size
    with open_file(path) as file:
        file.seek(124)
        order = "<" if file.read(4)[2:] == b"IM" else ">"
        while len(tag := file.read(8)) == 8:
            kind, length = struct.unpack(f"{order}II", tag)
            if kind != _COMPRESSED_ELEMENT:
                file.seek(length, os.SEEK_CUR)
                continue
            end, stream = file.tell() + length, zlib.decompressobj()
            try:
                while piece := file.read(min(_PIECE, end - file.tell())):
                    while piece:
                        total += len(stream.decompress(piece, _PIECE))
                        check_size(total, "its arrays")
                        piece = stream.unconsumed_tail
            except zlib.error:
                break  # reported by scipy.io
    return total


@atexit.register
def _close_reader() -> None:
    global _reader
    if _reader is not None:
        _reader.close()
    _reader = None


def _leave_reader_to_parent() -> None:
    """Give up the reader and the lock in a forked process; they belong to the parent."""
    global _lock, _reader
    if _reader is not None:
        # Not a child of this process, so that it must neither be waited for nor reported as running.
        _reader.process.returncode = 0
    _lock, _reader = threading.Lock(), None


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_leave_reader_to_parent)
