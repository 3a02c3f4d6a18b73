"""Chunks of a Zarr store, written and made sure of by a thread of their own while the next blocks are evaluated.

A chunk is one file: the numbers of one block, little-endian, in C order. Writing them through Zarr took more of the
processor than all else that a sweep does beside its candidates, and the time that a disk takes to be sure of them would
be waited for.
"""

from __future__ import annotations

import os
import time
from collections import deque
from collections.abc import Callable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance.sweep.disk import flush

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Chunks"]

_KEPT_EVERY = 1.0
"""Seconds between two moments from which on an interrupted run is resumed."""
_MOST_WAITING = 4
"""Blocks that wait for the disk: where it is slower than the sweep, the sweep waits, and memory stays bounded."""


class Chunks:
    """Writes blocks, and says which are finished once the disk has them.

    Parameters
    ----------
    path : Path
        Of the Zarr group.
    layout : mapping of str to (dtype, shape)
        Of one candidate, for every array.
    rows : int
        Candidates of a chunk.
    finish : callable
        Writes down that blocks (their numbers) are finished; called in the thread that writes.
    """

    def __init__(
        self,
        path: Path,
        layout: Mapping[str, tuple[str, tuple[int, ...]]],
        rows: int,
        finish: Callable[[list[int]], None],
    ) -> None:
        self._path, self._layout, self._rows, self._finish = path, dict(layout), rows, finish
        self._thread = ThreadPoolExecutor(1, "receptance-store")
        self._under_way: deque[Future[None]] = deque()
        self._waiting: list[int] = []
        self._kept = time.monotonic()

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
        for name, values in arrays.items():
            self._put(self._file(name, number), np.dtype(self._layout[name][0]), values)
        self._waiting.append(number)
        if time.monotonic() - self._kept > _KEPT_EVERY:
            self._keep()

    def _put(self, path: Path, dtype: np.dtype[Any], values: NDArray[Any]) -> None:
        """Write a chunk, whole or not at all; what is missing of the last one is zero, and nobody reads it."""
        content = np.ascontiguousarray(values, dtype.newbyteorder("<"))
        missing = (self._rows - len(content)) * (content.nbytes // len(content))
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary = path.with_name(f".{path.name}.part")
        with temporary.open("wb", buffering=0) as file:
            for part in (content.data.cast("B"), bytes(missing)):
                while len(part) > 0:
                    part = part[file.write(part) :]
        os.replace(temporary, path)

    def _keep(self) -> None:
        """Say that blocks are finished, after the disk has them."""
        files = [self._file(name, number) for number in self._waiting for name in self._layout]
        flush(files, self._path)
        self._finish(self._waiting)
        self._waiting = []
        self._kept = time.monotonic()

    def _file(self, name: str, number: int) -> Path:
        return self._path.joinpath(name, "c", *map(str, (number, *(0 for _ in self._layout[name][1]))))
