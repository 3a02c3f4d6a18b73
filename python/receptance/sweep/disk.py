"""Files of a sweep store: chunks with checksums, flushing to the disk, and a lock for one writer."""

from __future__ import annotations

import contextlib
import os
import shutil
import time
from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray


class SweepError(ValueError):
    """An unsuitable or damaged store, or results that do not fit into memory."""


def flush(files: Iterable[Path], root: Path) -> None:
    """Flush files below `root` and their folders to the disk."""
    folders: dict[Path, None] = {root: None}
    for file in files:
        _flush(file, os.O_RDWR)
        folder = file.parent
        while folder not in folders:
            folders[folder] = None
            folder = folder.parent
    for folder in folders:
        # Some systems cannot open folders.
        with contextlib.suppress(OSError):
            _flush(folder, os.O_RDONLY)


def _flush(path: Path, flags: int) -> None:
    handle = os.open(path, flags)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


@contextlib.contextmanager
def renamed(path: Path) -> Iterator[Path]:
    """Yield a temporary path; on success it is renamed to `path`, otherwise it is removed.

    The temporary path depends on `path` only, so the next run removes the remains of a process that was killed. System
    errors without a file name, such as that of a full disk, get the name of `path`.
    """
    temporary = path.with_name(f".{path.name}.part")
    try:
        _remove(temporary)
        yield temporary
        os.replace(temporary, path)
    except BaseException as error:
        with contextlib.suppress(OSError):
            _remove(temporary)
        if isinstance(error, OSError) and error.filename is None and error.errno is not None:
            raise OSError(error.errno, os.strerror(error.errno), str(path)) from error
        raise


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


class Lock:
    """An exclusive lock on a store, which the system releases when the process ends.

    Symbolic links in the path are resolved, so that all paths to a store share one lock.
    """

    def __init__(self, path: Path) -> None:
        self._path = path.with_name(f".{path.name}.lock")
        self._handle: int | None = None
        try:
            import fcntl
        except ImportError:  # not on Windows
            return
        if not path.parent.is_dir():
            return
        while self._handle is None:
            try:
                handle = os.open(self._path, os.O_RDWR | os.O_CREAT)
            except OSError as error:
                raise SweepError(
                    f"sweep: cannot write to the folder {path.parent}: {error.strerror}; give a store in another folder"
                    + (" (`receptance.sweep.open_sweep` reads one without writing)" if path.exists() else "")
                ) from error
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                os.close(handle)
                raise SweepError(f"sweep: another run is writing to {path}; give another store") from None
            # The previous process may have removed the file after it was opened here.
            if _same_file(handle, self._path):
                self._handle = handle
            else:
                os.close(handle)

    def close(self) -> None:
        """Release the lock."""
        if self._handle is not None:
            with contextlib.suppress(OSError):
                self._path.unlink()
            os.close(self._handle)
            self._handle = None


def _same_file(handle: int, path: Path) -> bool:
    """Return whether a path refers to an open file."""
    try:
        return os.path.samestat(os.fstat(handle), path.stat())
    except FileNotFoundError:
        return False


_FLUSH_INTERVAL_S = 1.0
"""Interval in s between flushes to the disk, which limits the loss at a power failure."""
_CHECKSUM = 4
"""Size of a checksum in bytes."""
_LONGEST_QUEUE = 4
"""Largest number of blocks that wait for the disk; the sweep pauses beyond it, so that memory is bounded."""


class Chunks:
    """Chunks of a Zarr store, written by a separate thread and checked by checksums.

    A chunk is one file: the values of one block of `rows` candidates, little-endian, in C order, followed by their
    checksum (CRC-32C, Zarr's codec `crc32c`). Writing through Zarr needed more processor time than all other steps
    besides the evaluation. The layout is data type and shape of one candidate for each array. A file beside the arrays
    has the marks of the chunks of a block: checksums that include its number, so that a chunk of another block is
    noticed. The chunk of the last array, `valid`, is written last: a block with this chunk is finished, unless a
    checksum is wrong.
    """

    def __init__(self, path: Path, layout: Mapping[str, tuple[str, tuple[int, ...]]], rows: int) -> None:
        self._path, self._layout, self._rows = path, dict(layout), rows
        self._thread = ThreadPoolExecutor(1, "receptance-store")
        self._pending: deque[Future[None]] = deque()
        self._unflushed: list[int] = []
        self._flushed = time.monotonic()

    def check(self, number: int) -> list[str] | None:
        """Return the faults of the chunks of a block, or None if the block was not finished."""
        files = {name: self._file(name, number) for name in self._layout}
        if not list(files.values())[-1].exists():
            return None
        marks = Marks(self._path, self._layout)
        faults = [(file, marks.fault(name, number, _content(file))) for name, file in files.items()]
        return [f"{file.relative_to(self._path).as_posix()} {text}" for file, text in faults if text]

    def read(self, name: str, number: int) -> NDArray[Any]:
        """Return the values of a chunk, with the padding of the last chunk."""
        content = self._file(name, number).read_bytes()[:-_CHECKSUM]
        return np.frombuffer(content, np.dtype(self._layout[name][0]).newbyteorder("<"))

    def write(self, number: int, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Queue a block for writing; errors of earlier blocks are raised here or in `close`."""
        self._pending.append(self._thread.submit(self._write_block, number, arrays))
        while len(self._pending) > _LONGEST_QUEUE or (self._pending and self._pending[0].done()):
            self._pending.popleft().result()

    def close(self) -> None:
        """Write and flush all queued blocks."""
        try:
            while self._pending:
                self._pending.popleft().result()
            if self._unflushed:
                self._thread.submit(self._flush).result()
        finally:
            self._thread.shutdown()

    def _write_block(self, number: int, arrays: Mapping[str, NDArray[Any]]) -> None:
        chunks = {name: self._chunk(np.dtype(dtype), arrays[name]) for name, (dtype, _) in self._layout.items()}
        marks = b"".join(_mark(number, chunk) for chunk in chunks.values())
        _write(Marks.file(self._path, number), marks)
        for name, chunk in chunks.items():
            _write(self._file(name, number), chunk)
        self._unflushed.append(number)
        if time.monotonic() - self._flushed > _FLUSH_INTERVAL_S:
            self._flush()

    def _chunk(self, dtype: np.dtype[Any], values: NDArray[Any]) -> bytes:
        """Return the content of a chunk; the last chunk is padded with zeros."""
        content = np.ascontiguousarray(values, dtype.newbyteorder("<"))
        missing = (self._rows - len(content)) * (content.nbytes // len(content))
        whole = content.tobytes() + bytes(missing)
        return whole + _checksum(whole)

    def _flush(self) -> None:
        """Flush the written blocks to the disk."""
        files = [self._file(name, number) for number in self._unflushed for name in self._layout]
        flush([*files, *(Marks.file(self._path, number) for number in self._unflushed)], self._path)
        self._unflushed = []
        self._flushed = time.monotonic()

    def _file(self, name: str, number: int) -> Path:
        return self._path.joinpath(name, "c", *map(str, (number, *(0 for _ in self._layout[name][1]))))


class Marks:
    """The marks of the blocks of a store, in the order of its arrays."""

    def __init__(self, path: Path, names: Iterable[str]) -> None:
        self._path, self._place = path, {name: i * _CHECKSUM for i, name in enumerate(names)}

    @staticmethod
    def file(path: Path, number: int) -> Path:
        """Return the file with the marks of a block."""
        return path / "marks" / str(number)

    def fault(self, name: str, number: int, content: bytes | None) -> str:
        """Return the fault of the chunk of a block as `fault` does; the chunk of another block is a fault as well."""
        place = self._place[name]
        marks = _content(self.file(self._path, number)) or b""
        if content is not None and _mark(number, content) != marks[place : place + _CHECKSUM]:
            return _DAMAGED
        return fault(content)


_DAMAGED = "is damaged: its checksum does not agree with its content"


def fault(content: bytes | None) -> str:
    """Return the fault of the content of a chunk, empty for a sound one; a content of None means a missing file."""
    if content is None:
        return "is missing"
    if len(content) < _CHECKSUM or _checksum(content[:-_CHECKSUM]) != content[-_CHECKSUM:]:
        return _DAMAGED
    return ""


def _write(path: Path, content: bytes) -> None:
    """Write a file completely or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with renamed(path) as temporary, temporary.open("wb", buffering=0) as file:
        part = memoryview(content)
        while len(part) > 0:
            part = part[file.write(part) :]


def _content(path: Path) -> bytes | None:
    try:
        return path.read_bytes()
    except FileNotFoundError:
        return None


def _checksum(content: bytes) -> bytes:
    import google_crc32c  # used by Zarr as well

    return int(google_crc32c.value(content)).to_bytes(_CHECKSUM, "little")


def _mark(number: int, content: bytes) -> bytes:
    """Return the checksum of the number of a block and of a chunk without its own checksum, which would cancel it."""
    return _checksum(number.to_bytes(8, "little") + content[:-_CHECKSUM])
