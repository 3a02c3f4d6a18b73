"""Blocks of a sweep on the workers of a dask cluster."""

from __future__ import annotations

import functools
import pickle
import time
from collections import deque
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

from receptance.sweep.definition import Block, Definition

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Waiting", "on_workers"]

_AHEAD = 3
"""Tasks under way for each thread of the workers: enough that none waits, few enough for any memory."""
_TASK_S, _TASK_BYTES = 0.5, 16e6
"""What a task of several blocks takes and returns at most: handing one out and taking it back costs the scheduler and
this process some milliseconds of a core that workers may want."""
_TRIES = 5
"""How often a task is given out that workers died with."""

Blocks = list[tuple[int, int, int]]
Arrays = dict[str, "NDArray[Any]"]


def on_workers(
    client: Any, definition: Definition, blocks: Sequence[tuple[int, int, int]]
) -> Iterator[tuple[int, Arrays]]:
    """Run blocks (number, first, last + 1) on the workers of a `dask.distributed.Client`, give them as they come.

    A worker that dies loses nothing: its blocks are given to others. Each of a worker's threads runs one task on one
    thread of the core.
    """
    from distributed import KilledWorker, as_completed

    # As a task it is made again where the worker that held it died; sent by hand it would be lost.
    shared = client.submit(_kept, pickle.dumps(definition), pure=False)
    threads = sum(client.nthreads().values()) or 1
    waiting = Waiting(blocks, _AHEAD * threads)
    running: dict[Any, tuple[Blocks, int]] = {}

    def submit(own: Blocks, tries: int = 0) -> Any:
        future = client.submit(_run, shared, [block[1:] for block in own], pure=False)
        running[future] = own, tries
        return future

    # Without its loop it would take the default client's, which may be another's.
    done = as_completed((submit(own) for own in waiting.first()), loop=client.loop)
    try:
        for future in done:
            own, tries = running.pop(future)
            try:
                seconds, results = future.result()
            except KilledWorker:
                if tries + 1 >= _TRIES:
                    raise
                done.add(submit(own, tries + 1))
                continue
            waiting.learn(seconds, results)
            yield from zip((block[0] for block in own), results, strict=True)
            following = waiting.take()
            if following:
                done.add(submit(following))
    finally:
        client.cancel([*running, shared])


class Waiting:
    """Blocks that nobody has yet: handed out one by one until it is known what one takes, and at the end."""

    def __init__(self, blocks: Sequence[tuple[int, int, int]], under_way: int) -> None:
        self._blocks = deque(blocks)
        self._under_way = under_way
        self._most = 1

    def first(self) -> Iterator[Blocks]:
        """Give the first tasks."""
        for _ in range(min(self._under_way, len(self._blocks))):
            yield self.take()

    def take(self) -> Blocks:
        """Return the blocks of the next task; none if there are none."""
        count = min(self._most, -(-len(self._blocks) // self._under_way))
        return [self._blocks.popleft() for _ in range(count)]

    def learn(self, seconds: float, results: list[Arrays]) -> None:
        """Take note of what a task took and brought."""
        size = sum(values.nbytes for arrays in results for values in arrays.values())
        self._most = max(int(len(results) * min(_TASK_S / max(seconds, 1e-6), _TASK_BYTES / max(size, 1))), 1)


def _kept(definition: bytes) -> bytes:
    return definition


@functools.lru_cache(maxsize=2)
def _prepared(definition: bytes) -> Block:
    """Return a definition made ready once a process, for its threads of one core each."""
    found: Definition = pickle.loads(definition)
    return found.prepare(threads=1)


def _run(definition: bytes, ranges: list[tuple[int, int]]) -> tuple[float, list[Arrays]]:
    begun = time.perf_counter()
    block = _prepared(definition)
    results = [block(start, stop) for start, stop in ranges]
    return time.perf_counter() - begun, results
