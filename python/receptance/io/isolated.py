"""Reading MAT and HDF5 files in a process of its own.

Of 20,000 randomly damaged files scipy.io 1.17 crashed the process on 97 MAT files and ran for more than a second on 15,
libhdf5 2.0 crashed on 3 HDF5 files and ran for more than five seconds on 6. So one process beside this one reads them,
within limits of processor time and memory; where it dies, that is an answer.
"""

from __future__ import annotations

import atexit
import json
import os
import re
import signal
import struct
import subprocess
import sys
import threading
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from receptance._files import open_file
from receptance.io.errors import FileFormatError
from receptance.io.limits import BYTES_PER_SECOND, LARGEST, check_size, seconds

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Contents", "load"]

_PATIENCE = 60.0
"""Seconds by the clock beyond those of the processor, for a machine that has much else to do."""
_CRASHES = ("SIGSEGV", "SIGABRT", "SIGBUS", "SIGFPE", "SIGILL")
_COMPRESSED = 15
"""Type of an element of a MAT file that zlib compressed."""
_PIECE = 1 << 18
_DTYPE = re.compile(r"[<>|=][biufc][0-9]{1,2}")
_NAMES = {"mat": "MAT", "hdf5": "HDF5"}


@dataclass(frozen=True)
class Contents:
    """What a file holds."""

    arrays: dict[str, NDArray[Any]]
    texts: dict[str, str]
    listed: dict[str, str]
    """Shape and type of everything that is there."""


class _DiedError(Exception):
    """The process is gone, or does not answer as it should."""


class _Alarm:
    """Ends a process that has not answered in time, and knows whether it did."""

    def __init__(self, process: subprocess.Popen[bytes], patience: float) -> None:
        self.rang = False
        self._process = process
        self._timer = threading.Timer(patience, self._ring)
        self._timer.daemon = True
        self._timer.start()

    def _ring(self) -> None:
        self.rang = True
        self._process.kill()

    def cancel(self) -> None:
        self._timer.cancel()


class _Reader:
    """The process beside this one."""

    def __init__(self) -> None:
        script = Path(__file__).with_name("_worker.py")
        if not sys.executable or getattr(sys, "frozen", False):
            # What a frozen program would start is itself.
            raise FileFormatError(
                "MAT and HDF5 files are read in a second process, but there is no interpreter to start"
            )
        environment = os.environ | dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
        # -P: the folder of the script is not searched for modules; the names of some would hide others.
        command = [sys.executable, "-P", "-W", "ignore", str(script)]
        self.process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env=environment
        )

    def ask(self, request: dict[str, Any], patience: float) -> Contents:
        """Return the answer to a request, or raise _DiedError."""
        incoming, outgoing = self.process.stdin, self.process.stdout
        assert incoming is not None
        assert outgoing is not None
        self.late = False
        alarm = _Alarm(self.process, patience)
        try:
            incoming.write(json.dumps(request).encode() + b"\n")
            incoming.flush()
            (length,) = struct.unpack("<Q", self._exactly(8))
            header = json.loads(self._exactly(length))
            if "error" in header:
                raise FileFormatError(f"this {_NAMES[request['kind']]} file cannot be read: {header['error']}")
            arrays = {name: self._array(dtype, tuple(shape)) for name, dtype, shape in header["arrays"]}
            return Contents(arrays, dict(header["texts"]), dict(header["listed"]))
        except FileFormatError:
            raise
        except (OSError, ValueError, KeyError, TypeError, MemoryError, struct.error) as error:
            raise _DiedError from error
        finally:
            alarm.cancel()
            self.late = alarm.rang

    def _exactly(self, count: int) -> bytes:
        stream = self.process.stdout
        content = stream.read(count) if stream is not None and 0 <= count < 1 << 40 else b""
        if len(content) != count:
            raise _DiedError
        return content

    def _array(self, dtype: str, shape: tuple[int, ...]) -> NDArray[Any]:
        if not _DTYPE.fullmatch(dtype):
            raise _DiedError
        kind = np.dtype(dtype)
        count = 1
        for length in shape:
            count *= int(length)
        return np.frombuffer(self._exactly(count * kind.itemsize), dtype=kind).reshape(shape)

    def ended(self) -> int | None:
        """Return how the process ended, None where it goes on."""
        try:
            return self.process.wait(timeout=0.1)
        except subprocess.TimeoutExpired:
            return None

    def end(self) -> int | None:
        """End the process; return how it ended."""
        self.process.kill()
        for stream in (self.process.stdin, self.process.stdout):
            if stream is not None:
                try:
                    stream.close()
                except OSError:
                    continue
        return self.process.wait()


_lock = threading.Lock()
_reader: _Reader | None = None


def load(path: Path, kind: Literal["mat", "hdf5"], names: Sequence[str] | None) -> Contents:
    """Return the named arrays of a MAT or HDF5 file; without names, those that this library wrote.

    Raises
    ------
    FileFormatError
        A file that cannot be read, in the words of scipy.io or h5py, or that ends the process which reads it.
    """
    global _reader
    size = path.stat().st_size
    allowed = seconds(_expanded_mat(path) if kind == "mat" else size)
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
            _reader.end()
            _reader = None
        if _reader is None:
            _reader = _Reader()
        try:
            return _reader.ask(request, _PATIENCE + seconds(LARGEST))
        except _DiedError:
            code, late = _reader.ended(), _reader.late
            _reader.end()
            _reader = None
            raise FileFormatError(_epitaph(kind, code, allowed, late)) from None
        except BaseException as error:
            # Interrupted in the middle of an answer, the rest of which would be taken for the next one.
            if not isinstance(error, FileFormatError):
                _reader.end()
                _reader = None
            raise


def _epitaph(kind: str, code: int | None, allowed: float, late: bool) -> str:
    """Return what to say of a reader that ended, or gave an answer that is none; the file need not be at fault."""
    library = {"mat": "scipy.io", "hdf5": "libhdf5"}[kind]
    if late:
        return f"{library} gave no answer within {_PATIENCE + seconds(LARGEST):.0f} s by the clock; it was ended"
    if code is None or code >= 0:
        ended = "gave an answer that cannot be understood" if code is None else f"ended with code {code}"
        return f"the process that read the file with {library} {ended}; the file may be damaged"
    if code == -getattr(signal, "SIGPROF", 0):
        return (
            f"{library} was not done with it after {allowed:.1f} s of processor time, the limit for a file of this "
            "size; the file may be damaged"
        )
    try:
        name = signal.Signals(-code).name
    except ValueError:
        name = f"signal {-code}"
    if name in _CRASHES:
        return f"{library} crashed on it ({name}): the file is damaged"
    return (
        f"the process that read the file with {library} was ended from outside ({name}), perhaps for lack of memory; "
        "this does not mean that the file is damaged, read it again"
    )


def _expanded_mat(path: Path) -> int:
    """Return the bytes that the elements of a MAT file of version 5 expand to.

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
            if kind != _COMPRESSED:
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
                break  # what is wrong is for scipy.io to say
    return total


def _forget() -> None:
    """Leave the reader, and a lock that a thread may have held, to the process that this one was forked from."""
    global _lock, _reader
    if _reader is not None:
        # It is not this one's child: nothing to wait for, and nothing to complain of.
        _reader.process.returncode = 0
    _lock, _reader = threading.Lock(), None


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget)


@atexit.register
def _at_exit() -> None:
    if _reader is not None:
        _reader.end()
