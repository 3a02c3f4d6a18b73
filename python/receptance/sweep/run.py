"""The sweep itself."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance.sweep.definition import Definition
from receptance.sweep.disk import SweepError
from receptance.sweep.progress import SweepProgress
from receptance.sweep.store import target

if TYPE_CHECKING:
    import os

    import xarray as xr
    from numpy.typing import NDArray

    from receptance.assembly import Assembly
    from receptance.campaign import Campaign
    from receptance.sweep.candidates import Candidates
    from receptance.sweep.outputs import Output

__all__ = ["sweep"]


def sweep(
    model: Assembly | Mapping[str, Assembly] | Campaign,
    candidates: Candidates,
    outputs: Output | Sequence[Output],
    *,
    store: str | os.PathLike[str] | None = None,
    block: int | None = None,
    threads: int | None = None,
    client: Any = None,
    progress: Callable[[SweepProgress], None] | None = None,
) -> xr.Dataset:
    """Evaluate many candidates of a model and keep what was asked for of each.

    A candidate that is no model (a negative diameter, a singular interface) has NaN and is not `valid`; it does not end
    the sweep. Results do not depend on threads, blocks, workers or interruptions, to the last bit on one kind of
    processor.

    Parameters
    ----------
    model : Assembly, mapping of str to Assembly, or Campaign
        What is varied; several assemblies, or those of a campaign, are a dimension `assembly` of the results.
        A parameter that an assembly does not have leaves it as it is.
    candidates : Grid, Listed or Sampled
        Values of parameters, by address.
    outputs : Output or sequence of Output
        What is kept of each: `FrequencyResponse`, `NaturalFrequencies`, `Misfit`, `StableDepth`, or your own.
    store : path, optional
        Folder of a Zarr store that the results are written to as they come, so that memory stays bounded. If it exists
        and holds the same sweep, its chunks are checked and only what is missing or damaged is evaluated, the latter
        with a `ReceptanceWarning`: an interrupted run loses at most its last seconds.
    block : int, optional
        Candidates that are evaluated and written together; by default some megabytes.
    threads : int, optional
        As in `Assembly.receptance`; with a client each thread of a worker runs a block on one thread.
    client : dask.distributed.Client, optional
        Runs the blocks on its workers. Results come back to this process, which alone writes.
    progress : callable, optional
        Called with a `SweepProgress` after each block.

    Returns
    -------
    xarray.Dataset
        With the dimension `candidate`, the parameters as coordinates along it, and the variable `valid`. Results of a
        store are read when they are asked for. `as_grid` gives a `Grid` one dimension a parameter.

    Raises
    ------
    TypeError, ValueError
        No such parameter, two outputs of one name, or an input of another kind.
    SweepError
        The store holds another sweep (other models, candidates, outputs, code of functions, or another version of the
        program), it is damaged beyond its chunks, another run writes to it, or the results are too large for memory.

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
    definition = Definition.of(model, candidates, outputs)
    if block is not None and (isinstance(block, bool) or not isinstance(block, (int, np.integer)) or block < 1):
        raise ValueError(f"sweep: block is {block!r}, expected a whole number of at least one")
    with target(store, definition, None if block is None else int(block)) as kept:
        count, size = candidates.count, kept.block
        missing = [(i, i * size, min((i + 1) * size, count)) for i in np.flatnonzero(~kept.finished).tolist()]
        done = resumed = count - sum(stop - start for _, start, stop in missing)
        begun = time.perf_counter()
        results = _here(definition, missing, threads) if client is None else _there(client, definition, missing)
        for number, arrays in results:
            kept.write(number, arrays)
            done += len(next(iter(arrays.values())))
            if progress is not None:
                progress(SweepProgress(done=done, count=count, resumed=resumed, seconds=time.perf_counter() - begun))
        if done < count:
            raise SweepError(f"sweep: {count - done} candidates did not come back from the workers; run it again")
    return kept.dataset()


def _here(
    definition: Definition, missing: list[tuple[int, int, int]], threads: int | None
) -> Iterator[tuple[int, dict[str, NDArray[Any]]]]:
    if missing:
        run = definition.prepare(threads)
        for number, start, stop in missing:
            yield number, run(start, stop)


def _there(
    client: Any, definition: Definition, missing: list[tuple[int, int, int]]
) -> Iterator[tuple[int, dict[str, NDArray[Any]]]]:
    from receptance.sweep.workers import on_workers

    return on_workers(client, definition, missing)
