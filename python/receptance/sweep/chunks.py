"""Chunks of a Zarr store, written by a thread of their own while the next blocks are evaluated, and checked.

A chunk is one file: the numbers of one block, little-endian, in C order, then their checksum (CRC-32C, Zarr's codec
`crc32c`). Writing them through Zarr took more processor time than everything else that a sweep does besides evaluating
its candidates. The chunk of `valid` is written last: a block that has one is finished, unless a checksum is wrong.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance.sweep.disk import flush, renamed

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Chunks", "fault"]

_KEPT_EVERY = 1.0
"""Seconds after which the disk is made to take what was written, so that a power cut loses no more."""
_CHECKSUM = 4
"""Bytes of a checksum."""
_MOST_WAITING = 4
"""Blocks that wait for the disk: where it is slower than the sweep, the sweep waits, and memory stays bounded."""


class Chunks:
    """Writes blocks, and reads them back.

    Parameters
    ----------
    path : Path
        Of the Zarr group.
    layout : mapping of str to (dtype, shape)
        Of one candidate, for every array; the last one is `valid`.
    rows : int
        Candidates of a chunk.
    """

    def __init__(self, path: Path, layout: Mapping[str, tuple[str, tuple[int, ...]]], rows: int) -> None:
        self._path, self._layout, self._rows = path, dict(layout), rows
        self._thread = ThreadPoolExecutor(1, "receptance-store")
        self._under_way: deque[Future[None]] = deque()
        self._waiting: list[int] = []
        self._kept = time.monotonic()

    def check(self, number: int) -> list[str] | None:
        """Return what is wrong with the chunks of a block, nothing if all are sound; None if it was never finished."""
        files = [self._file(name, number) for name in self._layout]
        if not files[-1].exists():
            return None
        found = []
        for file in files:
            wrong = fault(_content(file))
            if wrong:
                found.append(f"{file.relative_to(self._path).as_posix()} {wrong}")
        return found

    def read(self, name: str, number: int) -> NDArray[Any]:
        """Return the numbers of a sound chunk, those that fill the last one included."""
        content = self._file(name, number).read_bytes()[:-_CHECKSUM]
        return np.frombuffer(content, np.dtype(self._layout[name][0]).newbyteorder("<"))

    def write(self, number: int, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Take a block; what went wrong with an earlier one is raised here or by `close`."""
        self._under_way.append(self._thread.submit(self._take, number, arrays))
        while len(self._under_way) > _MOST_WAITING or (self._under_way and self._under_way[0].done()):
            self._under_way.popleft().result()

    def close(self) -> None:
        """Write all that was taken and make sure of it."""
        try:
            while self._under_way:
                self._under_way.popleft().result()
            if self._waiting:
                self._thread.submit(self._keep).result()
        finally:
            self._thread.shutdown()

    def _take(self, number: int, arrays: Mapping[str, NDArray[Any]]) -> None:
        for name, (dtype, _) in self._layout.items():
            self._put(self._file(name, number), np.dtype(dtype), arrays[name])
        self._waiting.append(number)
        if time.monotonic() - self._kept > _KEPT_EVERY:
            self._keep()

    def _put(self, path: Path, dtype: np.dtype[Any], values: NDArray[Any]) -> None:
        """Write a chunk, whole or not at all; what is missing of the last one is zero, and nobody reads it."""
        content = np.ascontiguousarray(values, dtype.newbyteorder("<"))
        missing = (self._rows - len(content)) * (content.nbytes // len(content))
        whole = content.tobytes() + bytes(missing)
        path.parent.mkdir(parents=True, exist_ok=True)
        with renamed(path) as temporary, temporary.open("wb", buffering=0) as file:
            for part in (memoryview(whole), memoryview(_checksum(whole))):
                while len(part) > 0:
                    part = part[file.write(part) :]

    def _keep(self) -> None:
        """Have the disk take the blocks that were written."""
        flush([self._file(name, number) for number in self._waiting for name in self._layout], self._path)
        self._waiting = []
        self._kept = time.monotonic()

    def _file(self, name: str, number: int) -> Path:
        return self._path.joinpath(name, "c", *map(str, (number, *(0 for _ in self._layout[name][1]))))


def fault(content: bytes | None) -> str:
    """Return what is wrong with the content of a chunk, empty if nothing is; None where there is no file."""
    if content is None:
        return "is missing"
    if len(content) < _CHECKSUM or _checksum(content[:-_CHECKSUM]) != content[-_CHECKSUM:]:
        return "is damaged: its checksum does not agree with its content"
    return ""


def _content(path: Path) -> bytes | None:
    try:
        return path.read_bytes()
    except FileNotFoundError:
        return None


def _checksum(content: bytes) -> bytes:
    import google_crc32c  # used by Zarr as well

    return int(google_crc32c.value(content)).to_bytes(_CHECKSUM, "little")
