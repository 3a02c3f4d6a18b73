"""Blocks of a sweep on the workers of a dask cluster."""

from __future__ import annotations

import functools
import itertools
import pickle
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

from receptance.sweep.definition import Block, Definition

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["on_workers"]

_AHEAD = 3
"""Blocks under way for each thread of the workers: enough that none waits, few enough for any memory."""
_TRIES = 5
"""How often a block is given out that workers died with."""


def on_workers(
    client: Any, definition: Definition, blocks: Sequence[tuple[int, int, int]]
) -> Iterator[tuple[int, dict[str, NDArray[Any]]]]:
    """Run blocks (number, first, last + 1) on the workers of a `dask.distributed.Client`, give them as they come.

    A worker that dies loses nothing: its blocks are given to others. Each of a worker's threads runs one block on one
    thread of the core.
    """
    from distributed import KilledWorker, as_completed

    # As a task it is made again where the worker that held it died; sent by hand it would be lost.
    shared = client.submit(_kept, pickle.dumps(definition), pure=False)
    waiting = iter(blocks)
    running: dict[Any, tuple[tuple[int, int, int], int]] = {}

    def submit(one: tuple[int, int, int], tries: int = 0) -> Any:
        future = client.submit(_run, shared, one[1], one[2], pure=False)
        running[future] = one, tries
        return future

    threads = sum(client.nthreads().values()) or 1
    done = as_completed(submit(one) for one in itertools.islice(waiting, _AHEAD * threads))
    try:
        for future in done:
            one, tries = running.pop(future)
            try:
                arrays = future.result()
            except KilledWorker:
                if tries + 1 >= _TRIES:
                    raise
                done.add(submit(one, tries + 1))
                continue
            yield one[0], arrays
            following = next(waiting, None)
            if following is not None:
                done.add(submit(following))
    finally:
        client.cancel([*running, shared])


def _kept(definition: bytes) -> bytes:
    return definition


@functools.lru_cache(maxsize=2)
def _prepared(definition: bytes) -> Block:
    """Return a definition made ready once a process, for its threads of one core each."""
    found: Definition = pickle.loads(definition)
    return found.prepare(threads=1)


def _run(definition: bytes, start: int, stop: int) -> dict[str, NDArray[Any]]:
    return _prepared(definition)(start, stop)
