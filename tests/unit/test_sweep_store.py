"""Sweeps that outlive their process: Zarr stores, interruptions, workers."""

from __future__ import annotations

import errno
import multiprocessing
import os
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from scipy import stats

from receptance import STEEL, Assembly, MeasuredFRF, Part, PointJoint, ReceptanceWarning, Segment
from receptance.sweep import (
    FrequencyResponse,
    Grid,
    Misfit,
    NaturalFrequencies,
    Sampled,
    SweepError,
    as_grid,
    open_sweep,
    sweep,
)
from receptance.sweep.chunks import Chunks
from receptance.sweep.workers import Waiting

LINES = np.linspace(200.0, 4000.0, 50)


def pair() -> Assembly:
    tool = Segment(length=0.1, outer_diameter=0.02, material=STEEL)
    joint = PointJoint(k_y=1e8, k_theta=1e5, c_y=100.0, c_theta=0.1, name="joint")
    return Assembly([Part([tool], name="tool"), joint, Part([tool], name="holder")])


def measured() -> Misfit:
    return Misfit(
        MeasuredFRF(assembly=pair(), frequency_hz=LINES, receptance=pair().receptance(LINES), standard_deviation=0.01)
    )


def drawn(count: int) -> Sampled:
    ranges = {"joint.k_y": stats.loguniform(1e7, 1e9), "joint.k_theta": stats.loguniform(1e4, 1e6)}
    return Sampled(ranges, count=count, seed=3)


GRID = Grid({"joint.k_y": [1e7, 1e8], "joint.k_theta": [1e4, 1e5, 1e6]})


def same(one: xr.Dataset, other: xr.Dataset) -> None:
    assert set(one.variables) == set(other.variables)
    for name in one.variables:
        assert one[name].dims == other[name].dims
        np.testing.assert_array_equal(one[name].values, other[name].values)


def test_a_store_holds_what_memory_holds(tmp_path: Path) -> None:
    outputs = [FrequencyResponse(frequency_hz=LINES), NaturalFrequencies(upper_hz=5000.0), measured()]
    models = {"one": pair(), "other": pair().replace({"tool.segment[0].length": 0.12})}
    kept = sweep(models, GRID, outputs, store=tmp_path / "s.zarr", block=4)
    same(kept, sweep(models, GRID, outputs))
    same(open_sweep(tmp_path / "s.zarr"), kept)
    assert as_grid(kept)["misfit"].shape == (2, 3)
    assert kept["natural_frequency"].attrs["units"] == "Hz"
    assert [path.name for path in tmp_path.iterdir()] == ["s.zarr"]


def test_a_run_that_was_killed_is_gone_on_with(tmp_path: Path) -> None:
    store = tmp_path / "killed.zarr"
    script = """
        import sys, time
        sys.path.insert(0, sys.argv[1])
        import unit.test_sweep_store as own
        from receptance.sweep import sweep
        sweep(own.pair(), own.drawn(600), own.measured(), store=sys.argv[2], block=7,
              progress=lambda told: (print(told.done, flush=True), time.sleep(0.05)))
    """
    command = [sys.executable, "-c", textwrap.dedent(script), str(Path(__file__).parents[1]), str(store)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    begun = 0.0
    for line in process.stdout:
        # Long enough for a first moment from which on it can be resumed.
        begun = begun or time.monotonic()
        if int(line) >= 14 and time.monotonic() - begun > 2.6:
            break
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    process.stdout.close()
    with pytest.warns(ReceptanceWarning, match="candidates are missing"):
        part = open_sweep(store)
    there = int(part["valid"].values.sum())
    assert 0 < there < 600
    told: list[Any] = []
    whole = sweep(pair(), drawn(600), measured(), store=store, progress=told.append)
    assert told[0].resumed > 0
    assert told[-1].done == 600
    same(whole, sweep(pair(), drawn(600), measured()))


def test_an_interruption_keeps_what_is_done(tmp_path: Path) -> None:
    def stop(told: Any) -> None:
        if told.done >= 30:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sweep(pair(), drawn(100), measured(), store=tmp_path / "s", block=10, progress=stop)
    told: list[Any] = []
    found = sweep(pair(), drawn(100), measured(), store=tmp_path / "s", progress=told.append)
    assert told[0].resumed == 30
    assert len(told) == 7
    same(found, sweep(pair(), drawn(100), measured()))
    # A finished one is only opened.
    told.clear()
    same(sweep(pair(), drawn(100), measured(), store=tmp_path / "s", progress=told.append), found)
    assert not told


def test_a_disk_that_is_full_ends_the_sweep_and_not_the_store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    put = Chunks._put
    written: list[Path] = []

    def full(self: Chunks, path: Path, *rest: Any) -> None:
        written.append(path)
        if len(written) > 20:
            raise OSError(errno.ENOSPC, "no space left on device", str(path))
        put(self, path, *rest)

    with monkeypatch.context() as until:
        until.setattr(Chunks, "_put", full)
        with pytest.raises(OSError, match="no space left"):
            sweep(pair(), drawn(100), measured(), store=tmp_path / "s", block=10)
    same(
        sweep(pair(), drawn(100), measured(), store=tmp_path / "s").load(),
        sweep(pair(), drawn(100), measured()),
    )


def test_tasks_are_several_blocks_where_these_are_short_and_single_ones_at_the_end() -> None:
    blocks = [(number, 10 * number, 10 * number + 10) for number in range(100)]
    waiting = Waiting(blocks, under_way=4)
    tasks = list(waiting.first())
    assert [len(task) for task in tasks] == [1, 1, 1, 1]
    waiting.learn(0.1, [{"misfit": np.zeros(10)}])
    while task := waiting.take():
        tasks.append(task)
    assert [block for task in tasks for block in task] == blocks
    sizes = [len(task) for task in tasks[4:]]
    assert sizes[0] == 5
    assert sizes == sorted(sizes, reverse=True)
    assert sizes[-4:] == [1, 1, 1, 1]
    # Results that are large go one by one, however short they take.
    large = Waiting(blocks, under_way=4)
    large.learn(0.01, [{"receptance": np.zeros((1000, 2000))}])
    assert len(large.take()) == 1


def test_a_store_of_another_sweep_is_not_touched(tmp_path: Path) -> None:
    store = tmp_path / "s"
    found = sweep(pair(), drawn(20), measured(), store=store).load()
    others: list[tuple[Any, ...]] = [
        (pair().replace({"tool.segment[0].length": 0.11}), drawn(20), measured(), "model"),
        (pair(), drawn(21), measured(), "candidates"),
        (pair(), drawn(20), NaturalFrequencies(upper_hz=1e3), "output misfit, output natural_frequency"),
    ]
    for model, candidates, output, words in others:
        with pytest.raises(SweepError, match=f"another sweep: it differs in {words}"):
            sweep(model, candidates, output, store=store)
    with pytest.raises(SweepError, match="begun with blocks of"):
        sweep(pair(), drawn(20), measured(), store=store, block=3)
    same(open_sweep(store), found)
    (tmp_path / "folder").mkdir()
    with pytest.raises(SweepError, match="no sweep"):
        sweep(pair(), drawn(20), measured(), store=tmp_path / "folder")
    assert not list((tmp_path / "folder").iterdir())
    with pytest.raises(SweepError, match="there is no folder"):
        sweep(pair(), drawn(20), measured(), store=tmp_path / "none" / "s")
    with pytest.raises(SweepError, match="there is no sweep"):
        open_sweep(tmp_path / "nothing")


def test_two_runs_do_not_write_to_one_store(tmp_path: Path) -> None:
    def second(_: Any) -> None:
        with pytest.raises(SweepError, match="another run writes"):
            sweep(pair(), drawn(20), measured(), store=tmp_path / "s", block=5)

    sweep(pair(), drawn(20), measured(), store=tmp_path / "s", block=5, progress=second)


def test_a_grid_is_what_as_grid_takes() -> None:
    with pytest.raises(SweepError, match="no grid"):
        as_grid(sweep(pair(), drawn(5), measured()))


def _in_child(queue: Any) -> None:
    queue.put(sweep(pair(), drawn(50), measured(), threads=2)["misfit"].values)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_a_forked_process_sweeps_as_its_parent() -> None:
    before = sweep(pair(), drawn(50), measured(), threads=2)["misfit"].values
    context = multiprocessing.get_context("fork")
    queue = context.Queue()
    child = context.Process(target=_in_child, args=(queue,))
    child.start()
    found = queue.get(timeout=60)
    child.join(10)
    assert child.exitcode == 0
    np.testing.assert_array_equal(found, before)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_workers_that_die_change_no_number(tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed", reason="dask.distributed is not installed")
    expected = sweep(pair(), drawn(3000), measured())
    killed: list[int] = []
    with (
        distributed.LocalCluster(
            n_workers=3, threads_per_worker=1, processes=True, dashboard_address=None, local_directory=str(tmp_path)
        ) as cluster,
        # Not the default one, which is another's business.
        distributed.Client(cluster, set_as_default=False) as client,
    ):
        workers = client.run(os.getpid)

        def kill(told: Any) -> None:
            if told.done >= 500 and not killed:
                killed.append(next(iter(workers.values())))
                os.kill(killed[0], signal.SIGKILL)

        found = sweep(
            pair(), drawn(3000), measured(), store=tmp_path / "s", block=50, client=client, progress=kill
        ).load()
        again = sweep(pair(), drawn(3000), measured(), block=70, client=client)
    assert killed
    same(found, expected)
    same(again, expected)
