"""MAT files (version 5 to 7, as written by `save -v7` and scipy.io) and HDF5 files, which include MATLAB's version 7.3.

Of 20,000 randomly damaged files scipy.io 1.17 crashed the process on 97 MAT files and ran for more than a second on 15;
libhdf5 2.0 crashed on 3 HDF5 files and ran for more than five seconds on 6. Files are therefore read in a second
process (`_worker.py`) with limits of processor time and memory, and its exit is reported as an error.
"""

from __future__ import annotations

import atexit
import contextlib
import io
import os
import pickle
import signal
import struct
import subprocess
import sys
import threading
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from receptance._files import LARGEST, open_file
from receptance.errors import require
from receptance.io.arrays import measurements_of, named_items, requested_names
from receptance.io.build import ReadOptions
from receptance.io.errors import BYTES_PER_SECOND, FileFormatError, allowed_seconds, check_size
from receptance.io.measurements import Measurement

_WAIT_SECONDS = 60.0
"""Wall-clock seconds added to the limit of processor time, for a busy machine."""
_CRASH_SIGNALS = ("SIGSEGV", "SIGABRT", "SIGBUS", "SIGFPE", "SIGILL")
_COMPRESSED_ELEMENT = 15
"""Type of a zlib-compressed element of a MAT file."""
_PIECE = 1 << 18
_HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"
_LIBRARIES = {"mat": "scipy.io", "hdf5": "libhdf5"}


def is_mat(start: bytes) -> bool:
    """Return whether a file begins like a MAT file before version 7.3, which is HDF5."""
    return start.startswith(b"MATLAB ") and not is_hdf5(start)


def is_hdf5(start: bytes) -> bool:
    """Return whether a file begins like an HDF5 file, in MATLAB's version 7.3 after 512 bytes of text."""
    return start.startswith(_HDF5_SIGNATURE) or start[512:520] == _HDF5_SIGNATURE


def mat_bytes(measurements: Sequence[Measurement]) -> bytes:
    """Return the contents of a MAT file with one struct per measurement (frf1, time1, ...); all fields are stored."""
    import scipy.io

    structs: dict[str, dict[str, Any]] = {}
    # MATLAB changes shapes and types when it saves a struct again, so there is no checksum of them.
    for name, value in named_items(measurements, separator=".", with_checksum=False).items():
        owner, _, field = name.partition(".")
        structs.setdefault(owner, {})[field] = value
    buffer: Any = io.BytesIO()
    scipy.io.savemat(buffer, structs, do_compression=True)
    return bytes(buffer.getvalue())


def hdf5_bytes(measurements: Sequence[Measurement]) -> bytes:
    """Return the contents of an HDF5 file with one group per measurement (frf1, time1, ...); all fields are stored."""
    require("hdf5", "an HDF5 file")
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
    with open_file(path) as file:
        if file.read(10) != b"MATLAB 5.0":
            raise FileFormatError("this is not a MAT file of version 5 to 7 (save it with -v7)", byte=0)
    items, listed = _load(path, "mat", requested_names(options))
    return measurements_of(items, options, separator=".", listed=listed)


def read_hdf5(path: Path, options: ReadOptions) -> list[Measurement]:
    """Return the measurements in an HDF5 file: those written by this library, else the data sets of the options."""
    with open_file(path) as file:
        if not is_hdf5(file.read(520)):
            raise FileFormatError("this is not an HDF5 file: the HDF5 signature is missing", byte=0)
    require("hdf5", "an HDF5 file (MATLAB's version 7.3 is one as well)")
    items, listed = _load(path, "hdf5", requested_names(options))
    return measurements_of(items, options, separator="/", listed=listed)


_lock = threading.Lock()
_reader: subprocess.Popen[bytes] | None = None
"""The process that reads files."""


def _load(path: Path, kind: str, names: Sequence[str] | None) -> tuple[dict[str, Any], dict[str, str]]:
    """Return the named contents of a MAT or HDF5 file, and shape and type of all its variables.

    Without names, the measurements written by this library are loaded. The error has the message of scipy.io or h5py,
    or the way in which the reading process ended.
    """
    size = path.stat().st_size
    allowed = allowed_seconds(_expanded_mat_size(path) if kind == "mat" else size)
    request = {
        "kind": kind,
        "path": str(path.resolve()),
        "names": None if names is None else list(names),
        "size": size,
        "largest": LARGEST,
        "seconds": allowed,
        "bytes_per_second": BYTES_PER_SECOND,
    }
    answer = _ask(request, _WAIT_SECONDS + allowed_seconds(LARGEST))
    if isinstance(answer, str):
        raise FileFormatError(f"this {kind.upper()} file cannot be read: {answer}")
    arrays, texts, listed = answer
    return arrays | texts, listed


def _ask(request: dict[str, Any], timeout: float) -> Any:
    """Return the answer of the reading process, which is started if there is none, and killed after the timeout."""
    with _lock:
        reader = _started_reader()
        timer = threading.Timer(timeout, reader.kill)
        timer.daemon = True
        timer.start()
        try:
            pickle.dump(request, reader.stdin)  # type: ignore[arg-type]
            reader.stdin.flush()  # type: ignore[union-attr]
            return pickle.load(reader.stdout)  # type: ignore[arg-type]
        except Exception:
            late = timer.finished.is_set()
            with contextlib.suppress(subprocess.TimeoutExpired):
                reader.wait(timeout=0.1)
            code = reader.returncode
            _close_reader()
            problem = (
                f"{_LIBRARIES[request['kind']]} did not answer within {timeout:.0f} s and was stopped"
                if late
                else _exit_message(_LIBRARIES[request["kind"]], code, request["seconds"])
            )
            raise FileFormatError(problem) from None
        except BaseException:
            # After an interruption the rest of the answer would be taken for the next one.
            _close_reader()
            raise
        finally:
            timer.cancel()


def _started_reader() -> subprocess.Popen[bytes]:
    global _reader
    if _reader is not None and _reader.poll() is None:
        return _reader
    _close_reader()
    if not sys.executable or getattr(sys, "frozen", False):
        # The executable of a frozen program is the program itself.
        raise FileFormatError(
            "MAT and HDF5 files are read in a second process, but there is no Python interpreter to start"
        )
    # -P: modules in the folder of the script must not hide others.
    command = [sys.executable, "-P", "-W", "ignore", str(Path(__file__).with_name("_worker.py"))]
    environment = os.environ | dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    # A process group of its own: Ctrl-C in a terminal must not end the reader, whose end is told as a damaged file.
    _reader = subprocess.Popen(
        command,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env=environment,
        process_group=0 if os.name == "posix" else None,
    )
    return _reader


def _exit_message(library: str, code: int | None, allowed: float) -> str:
    """Return the error message for a reading process that ended; the file is not always the cause."""
    if code is None or code >= 0:
        outcome = "sent an invalid answer" if code is None else f"ended with code {code}"
        return f"the process that read the file with {library} {outcome}; the file may be damaged"
    name = signal.Signals(-code).name if -code in set(signal.Signals) else f"signal {-code}"
    if name == "SIGPROF":
        return (
            f"{library} did not finish within {allowed:.1f} s of processor time, the limit for a file of this size; "
            "the file may be damaged"
        )
    if name in _CRASH_SIGNALS:
        return f"{library} crashed on it ({name}): the file is damaged"
    return (
        f"the process that read the file with {library} was killed ({name}), possibly for lack of memory; the file "
        "need not be damaged, read it again"
    )


def _expanded_mat_size(path: Path) -> int:
    """Return the size in bytes of the expanded elements of a MAT file of version 5, or raise above the limit."""
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
        _reader.kill()
        with contextlib.suppress(OSError), _reader:
            pass  # closes the pipes and waits
    _reader = None


def _leave_reader_to_parent() -> None:
    """Give up the reader and the lock in a forked process; they belong to the parent."""
    global _lock, _reader
    if _reader is not None:
        # Not a child of this process, so that it must neither be waited for nor reported as running.
        _reader.returncode = 0
    _lock, _reader = threading.Lock(), None


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_leave_reader_to_parent)
