"""Running a sweep in this process or on the workers of a dask cluster, and its progress."""

from __future__ import annotations

import functools
import os
import pickle
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from receptance import _checks
from receptance.errors import require
from receptance.model.assembly import Assembly
from receptance.sweep.candidates import Candidates
from receptance.sweep.definition import Block, Definition, SweepError
from receptance.sweep.outputs import Output
from receptance.sweep.store import Memory, Store

if TYPE_CHECKING:
    import xarray as xr


def sweep(
    model: Assembly | Mapping[str, Assembly],
    candidates: Candidates,
    outputs: Output | Sequence[Output],
    *,
    store: str | os.PathLike[str] | None = None,
    block: int | None = None,
    threads: int | None = None,
    client: Any = None,
    progress: Callable[[SweepProgress], None] | None = None,
) -> xr.Dataset:
    """Evaluate outputs for many candidates of a model.

    An infeasible candidate (a negative diameter, a singular interface) has NaN in all outputs and is not `valid`; the
    sweep continues. Results are bit-identical for any number of threads, blocks, workers and interruptions on one type
    of processor.

    Parameters
    ----------
    model : Assembly or mapping of str to Assembly
        Model whose parameters vary. Several assemblies, such as `Campaign.assemblies`, become the dimension
        `assembly` of the results. An assembly ignores parameters that it does not have.
    candidates : Grid, Listed or Sampled
        Values of parameters, by address.
    outputs : Output or sequence of Output
        Quantities to keep: `FrequencyResponse`, `NaturalFrequencies`, `Misfit`, `StableDepth`, or a subclass of
        `Output`.
    store : path, optional
        Folder of a Zarr store to which the results are written block by block, so that memory is bounded. If it holds
        the same sweep already, its blocks are checked and only missing or damaged ones are evaluated; damaged ones
        cause a `ReceptanceWarning`. An interrupted run loses the block that it evaluated.
    block : int, optional
        Number of candidates that are evaluated and written together; by default at most 16 MB of results.
    threads : int, optional
        As in `Assembly.receptance`; with a client each thread of a worker runs a block on one thread.
    client : dask.distributed.Client, optional
        Client of a cluster whose workers evaluate the blocks; this process alone writes the results.
    progress : callable, optional
        Called with a `SweepProgress` after each block.

    Returns
    -------
    xarray.Dataset
        Outputs over the dimension `candidate`, with the parameters as coordinates and the variable `valid`. Results in
        a store are loaded lazily. `as_grid` converts the results of a `Grid` to one dimension per parameter.

    Raises
    ------
    TypeError, ValueError
        An unknown parameter, two outputs of one name, or an input of the wrong type.
    MissingExtraError
        xarray or Zarr is not installed: `pip install 'receptance[sweep]'`.
    SweepError
        The store holds a different sweep (models, candidates, outputs, versions of reductions or of the program
        differ), its metadata are damaged, or the results do not fit into memory.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance import STEEL, Assembly, Part, PointJoint, Segment
    >>> from receptance.sweep import Grid, NaturalFrequencies, as_grid, sweep
    >>> bar = Segment(length=0.1, outer_diameter=0.02, material=STEEL)
    >>> joint = PointJoint(k_y=1e8, k_theta=1e5, name="joint")
    >>> pair = Assembly([Part([bar], name="tool"), joint, Part([bar], name="holder")])
    >>> stiffness = Grid({"joint.k_y": np.geomspace(1e7, 1e9, 5), "joint.k_theta": [1e4, 1e5, 1e6]})
    >>> found = as_grid(sweep(pair, stiffness, NaturalFrequencies(upper_hz=9000.0, modes=2)))
    >>> found["natural_frequency"].sizes["joint.k_y"]
    5
    >>> bool((found["natural_frequency"].diff("joint.k_theta") > 0.0).sel(mode=1).all())
    True
    """
    require("sweep", "a sweep")
    definition = Definition(model, candidates, outputs)
    size = None if block is None else _checks.whole_number("sweep", "block", block)
    results = Memory(definition, size) if store is None else Store(store, definition, size)
    count, size = candidates.count, results.block
    missing = [(i, i * size, min((i + 1) * size, count)) for i in np.flatnonzero(~results.finished).tolist()]
    done = resumed = count - sum(stop - start for _, start, stop in missing)
    start_s = time.perf_counter()
    run = _in_process(definition, missing, threads) if client is None else _on_workers(client, definition, missing)
    for number, arrays in run:
        results.write(number, arrays)
        done += len(next(iter(arrays.values())))
        if progress is not None:
            progress(SweepProgress(done=done, count=count, resumed=resumed, seconds=time.perf_counter() - start_s))
    if done < count:
        raise SweepError(f"sweep: {count - done} candidates were not returned by the workers; run the sweep again")
    return results.dataset()


def _in_process(
    definition: Definition, missing: Sequence[BlockRange], threads: int | None
) -> Iterator[tuple[int, Arrays]]:
    if missing:
        run = definition.prepare(threads)
        for number, start, stop in missing:
            yield number, run(start, stop)


@dataclass(frozen=True, kw_only=True)
class SweepProgress:
    """Progress of a sweep.

    Examples
    --------
    >>> from receptance.sweep import SweepProgress
    >>> print(SweepProgress(done=3000, count=9000, resumed=1000, seconds=2.0))
    3,000 of 9,000 candidates, 1,000 a second, 6 s left
    """

    done: int
    """Number of finished candidates."""
    count: int
    """Number of all candidates."""
    resumed: int
    """Number of candidates that an earlier run had finished."""
    seconds: float
    """Duration of this run in s."""

    @property
    def rate(self) -> float:
        """Candidates per second in this run; zero before the first block."""
        return (self.done - self.resumed) / self.seconds if self.seconds > 0.0 else 0.0

    @property
    def remaining_seconds(self) -> float:
        """Remaining time in s at this rate; infinite before the first block."""
        return (self.count - self.done) / self.rate if self.rate > 0.0 else float("inf")

    def __str__(self) -> str:
        text = f"{self.done:,} of {self.count:,} candidates"
        if self.rate > 0.0:
            text += f", {self.rate:,.{0 if self.rate >= 10.0 else 2}f} a second, {self.remaining_seconds:,.0f} s left"
        return text


_TASKS_PER_THREAD = 3
"""Submitted tasks per thread of the workers: enough to keep all threads busy, few enough to bound the memory."""
_TASK_S, _TASK_BYTES = 0.5, 16e6
"""Largest duration and result size of a task. Several blocks share a task because the scheduler and this process
need some milliseconds per task."""
_TRIES = 5
"""Number of attempts for a task whose worker died."""

BlockRange = tuple[int, int, int]
"""Number of a block, its first candidate, and its last one plus 1."""
Arrays = dict[str, "NDArray[Any]"]


def _on_workers(client: Any, definition: Definition, blocks: Sequence[BlockRange]) -> Iterator[tuple[int, Arrays]]:
    """Evaluate blocks on the workers of a `dask.distributed.Client` and yield them in the order of completion.

    Blocks of a worker that died are submitted again. Each thread of a worker runs one task on one thread of the core.
    """
    require("dask", "a sweep on the workers of a cluster")
    from distributed import KilledWorker, as_completed

    # A task is recomputed when its worker dies; data sent with `scatter` would be lost.
    shared = client.submit(_identity, pickle.dumps(definition), pure=False)
    threads = sum(client.nthreads().values()) or 1
    pending = PendingBlocks(blocks, _TASKS_PER_THREAD * threads)
    running: dict[Any, tuple[list[BlockRange], int]] = {}

    def submit(task: list[BlockRange], tries: int = 0) -> Any:
        future = client.submit(_run, shared, [block[1:] for block in task], pure=False)
        running[future] = task, tries
        return future

    # The default loop may belong to another client.
    done = as_completed((submit(task) for task in pending.first_tasks()), loop=client.loop)
    try:
        for future in done:
            task, tries = running.pop(future)
            try:
                seconds, results = future.result()
            except KilledWorker:
                if tries + 1 >= _TRIES:
                    raise
                done.add(submit(task, tries + 1))
                continue
            pending.adapt(seconds, results)
            yield from zip((block[0] for block in task), results, strict=True)
            if following := pending.next_task():
                done.add(submit(following))
    finally:
        client.cancel([*running, shared])


class PendingBlocks:
    """Blocks that are not submitted yet, in tasks; `tasks` are submitted at the same time.

    Tasks have one block until the duration of a block is known, and again when few blocks are left.
    """

    def __init__(self, blocks: Sequence[BlockRange], tasks: int) -> None:
        self._blocks = deque(blocks)
        self._tasks = tasks
        self._blocks_per_task = 1

    def first_tasks(self) -> Iterator[list[BlockRange]]:
        """Yield the blocks of the first tasks."""
        for _ in range(min(self._tasks, len(self._blocks))):
            yield self.next_task()

    def next_task(self) -> list[BlockRange]:
        """Return the blocks of the next task; empty if none is left."""
        count = min(self._blocks_per_task, -(-len(self._blocks) // self._tasks))
        return [self._blocks.popleft() for _ in range(count)]

    def adapt(self, seconds: float, results: list[Arrays]) -> None:
        """Adapt the number of blocks of a task to the duration and result size of a finished one."""
        size = sum(values.nbytes for arrays in results for values in arrays.values())
        factor = min(_TASK_S / max(seconds, 1e-6), _TASK_BYTES / max(size, 1))
        self._blocks_per_task = max(int(len(results) * factor), 1)


def _identity(definition: bytes) -> bytes:
    return definition


@functools.lru_cache(maxsize=2)
def _prepared(definition: bytes) -> Block:
    """Return the prepared definition, which the threads of a process share."""
    unpickled: Definition = pickle.loads(definition)
    return unpickled.prepare(threads=1)


def _run(definition: bytes, ranges: list[tuple[int, int]]) -> tuple[float, list[Arrays]]:
    start_s = time.perf_counter()
    block = _prepared(definition)
    results = [block(start, stop) for start, stop in ranges]
    return time.perf_counter() - start_s, results
