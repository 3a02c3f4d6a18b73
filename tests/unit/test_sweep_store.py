"""Sweeps in Zarr stores: interruptions, damage, workers."""

from __future__ import annotations

import errno
import multiprocessing
import os
import re
import signal
import subprocess
import sys
import textwrap
import threading
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from scipy import stats

from limits import LIMIT_S
from receptance import STEEL, Assembly, MeasuredFRF, Part, PointJoint, ReceptanceWarning, Segment
from receptance.sweep import (
    FrequencyResponse,
    Grid,
    Misfit,
    NaturalFrequencies,
    Output,
    Sampled,
    SweepError,
    Variable,
    as_grid,
    open_sweep,
    sweep,
)
from receptance.sweep.disk import Chunks
from receptance.sweep.run import PendingBlocks

LINES = np.linspace(200.0, 4000.0, 50)


def pair() -> Assembly:
    tool = Segment(length=0.1, outer_diameter=0.02, material=STEEL)
    joint = PointJoint(k_y=1e8, k_theta=1e5, c_y=100.0, c_theta=0.1, name="joint")
    return Assembly([Part([tool], name="tool"), joint, Part([tool], name="holder")])


def measure() -> Misfit:
    return Misfit(
        MeasuredFRF(assembly=pair(), frequency_hz=LINES, receptance=pair().receptance(LINES), standard_deviation=0.01)
    )


def draw(count: int) -> Sampled:
    ranges = {"joint.k_y": stats.loguniform(1e7, 1e9), "joint.k_theta": stats.loguniform(1e4, 1e6)}
    return Sampled(ranges, count=count, seed=3)


GRID = Grid({"joint.k_y": [1e7, 1e8], "joint.k_theta": [1e4, 1e5, 1e6]})


def same(one: xr.Dataset, other: xr.Dataset) -> None:
    assert set(one.variables) == set(other.variables)
    for name in one.variables:
        assert one[name].dims == other[name].dims
        np.testing.assert_array_equal(one[name].values, other[name].values)


def test_store_equals_result_in_memory(tmp_path: Path) -> None:
    outputs = [FrequencyResponse(frequency_hz=LINES), NaturalFrequencies(upper_hz=5000.0), measure()]
    models = {"one": pair(), "other": pair().replace({"tool.segment[0].length": 0.12})}
    kept = sweep(models, GRID, outputs, store=tmp_path / "s.zarr", block=4)
    same(kept, sweep(models, GRID, outputs))
    same(open_sweep(tmp_path / "s.zarr"), kept)
    assert as_grid(kept)["misfit"].shape == (2, 3)
    assert kept["natural_frequency"].attrs["units"] == "Hz"
    assert [path.name for path in tmp_path.iterdir()] == ["s.zarr"]


def test_killed_run_is_resumed(tmp_path: Path) -> None:
    store = tmp_path / "killed.zarr"
    script = """
        import sys, time
        from pathlib import Path
        sys.path.insert(0, sys.argv[1])
        import unit.test_sweep_store as module
        from receptance.sweep import sweep

        def report(told):
            while told.done >= 14 and not any(Path(sys.argv[2], "valid", "c").glob("[0-9]*")):
                time.sleep(0.01)
            print(told.done, flush=True)
            time.sleep(0.05 if told.done < 300 else 3600.0)  # killed before the end

        sweep(module.pair(), module.draw(600), module.measure(), store=sys.argv[2], block=7, progress=report)
    """
    command = [sys.executable, "-c", textwrap.dedent(script), str(Path(__file__).parents[1]), str(store)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    for line in process.stdout:
        if int(line) >= 14:  # a block is finished
            break
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    process.stdout.close()
    with pytest.warns(ReceptanceWarning, match="candidates are missing"):
        part = open_sweep(store)
    there = int(part["valid"].values.sum())
    assert 0 < there < 600
    reported: list[Any] = []
    whole = sweep(pair(), draw(600), measure(), store=store, progress=reported.append)
    assert reported[0].resumed > 0
    assert reported[-1].done == 600
    same(whole, sweep(pair(), draw(600), measure()))


def test_interruption_keeps_finished_blocks(tmp_path: Path) -> None:
    def stop(reported: Any) -> None:
        if reported.done >= 30:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sweep(pair(), draw(100), measure(), store=tmp_path / "s", block=10, progress=stop)
    reported: list[Any] = []
    found = sweep(pair(), draw(100), measure(), store=tmp_path / "s", progress=reported.append)
    assert reported[0].resumed == 30
    assert len(reported) == 7
    same(found, sweep(pair(), draw(100), measure()))
    # A finished sweep is only opened.
    reported.clear()
    same(sweep(pair(), draw(100), measure(), store=tmp_path / "s", progress=reported.append), found)
    assert not reported


def test_full_disk_ends_the_sweep_and_keeps_the_store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    put = Chunks._write_chunk
    written: list[Path] = []

    def full(self: Chunks, path: Path, *rest: Any) -> None:
        written.append(path)
        if len(written) > 20:
            raise OSError(errno.ENOSPC, "no space left on device", str(path))
        put(self, path, *rest)

    with monkeypatch.context() as until:
        until.setattr(Chunks, "_write_chunk", full)
        with pytest.raises(OSError, match="no space left"):
            sweep(pair(), draw(100), measure(), store=tmp_path / "s", block=10)
    same(
        sweep(pair(), draw(100), measure(), store=tmp_path / "s").load(),
        sweep(pair(), draw(100), measure()),
    )


def test_short_blocks_are_grouped_into_tasks() -> None:
    blocks = [(number, 10 * number, 10 * number + 10) for number in range(100)]
    pending = PendingBlocks(blocks, tasks=4)
    tasks = list(pending.first_tasks())
    assert [len(task) for task in tasks] == [1, 1, 1, 1]
    pending.adapt(0.1, [{"misfit": np.zeros(10)}])
    while task := pending.next_task():
        tasks.append(task)
    assert [block for task in tasks for block in task] == blocks
    sizes = [len(task) for task in tasks[4:]]
    assert sizes[0] == 5
    assert sizes == sorted(sizes, reverse=True)
    assert sizes[-4:] == [1, 1, 1, 1]
    # Blocks with large results are separate tasks, even if they are fast.
    large = PendingBlocks(blocks, tasks=4)
    large.adapt(0.01, [{"receptance": np.zeros((1000, 2000))}])
    assert len(large.next_task()) == 1


def test_store_of_another_sweep_is_unchanged(tmp_path: Path) -> None:
    store = tmp_path / "s"
    found = sweep(pair(), draw(20), measure(), store=store).load()
    others: list[tuple[Any, ...]] = [
        (pair().replace({"tool.segment[0].length": 0.11}), draw(20), measure(), "model"),
        (pair(), draw(21), measure(), "candidates"),
        (pair(), draw(20), NaturalFrequencies(upper_hz=1e3), "output misfit, output natural_frequency"),
    ]
    for model, candidates, output, words in others:
        with pytest.raises(SweepError, match=f"different sweep: it differs in {words}"):
            sweep(model, candidates, output, store=store)
    with pytest.raises(SweepError, match="started with blocks of"):
        sweep(pair(), draw(20), measure(), store=store, block=3)
    same(open_sweep(store), found)
    (tmp_path / "folder").mkdir()
    with pytest.raises(SweepError, match="no sweep"):
        sweep(pair(), draw(20), measure(), store=tmp_path / "folder")
    assert not list((tmp_path / "folder").iterdir())
    with pytest.raises(SweepError, match="there is no folder"):
        sweep(pair(), draw(20), measure(), store=tmp_path / "none" / "s")
    with pytest.raises(SweepError, match="there is no sweep"):
        open_sweep(tmp_path / "nothing")


def test_two_runs_do_not_write_to_one_store(tmp_path: Path) -> None:
    (tmp_path / "real").mkdir()
    (tmp_path / "folder").symlink_to("real")
    (tmp_path / "link").symlink_to(tmp_path / "real" / "s")

    def second(_: Any) -> None:
        for name in ("real/s", "folder/s", "link"):
            with pytest.raises(SweepError, match="another run is writing"):
                sweep(pair(), draw(20), measure(), store=tmp_path / name, block=5)

    sweep(pair(), draw(20), measure(), store=tmp_path / "link", block=5, progress=second)
    assert (tmp_path / "link").is_symlink()
    assert [path.name for path in (tmp_path / "real").iterdir()] == ["s"]


DAMAGES: dict[str, Any] = {
    "missing": lambda file: file.unlink(),
    "damaged": lambda file: file.write_bytes(bytes([file.read_bytes()[0] ^ 1]) + file.read_bytes()[1:]),
    "damaged: its checksum": lambda file: file.write_bytes(file.read_bytes()[:-9]),
    "damaged: its checksum does not": lambda file: file.write_bytes(b""),
}


@pytest.mark.parametrize("words", DAMAGES)
@pytest.mark.parametrize("name", ["misfit", "receptance", "joint.k_y"])
def test_damaged_chunks_are_noted_and_recomputed(tmp_path: Path, name: str, words: str) -> None:
    store, outputs = tmp_path / "s", [measure(), FrequencyResponse(frequency_hz=LINES)]
    expected = sweep(pair(), draw(20), outputs, store=store, block=5).load()
    chunk = store / name / "c" / "2"
    chunk = chunk / "0" if name == "receptance" else chunk
    DAMAGES[words](chunk)
    found = open_sweep(store)
    np.testing.assert_array_equal(found["valid"].values, expected["valid"].values)
    place = chunk.relative_to(store).as_posix()
    with pytest.raises(SweepError, match=f"{store}: the chunk {place} is {words}.*run the same sweep"):
        found[name].load()
    reported: list[Any] = []
    with pytest.warns(
        ReceptanceWarning, match=f"{store}: the chunk {place} is {words}.*5 candidates are evaluated again"
    ):
        same(sweep(pair(), draw(20), outputs, store=store, progress=reported.append), expected)
    assert reported[0].resumed == 15
    same(open_sweep(store), expected)


def test_block_without_its_last_chunk_is_unfinished(tmp_path: Path) -> None:
    expected = sweep(pair(), draw(20), measure(), store=tmp_path / "s", block=5).load()
    (tmp_path / "s" / "valid" / "c" / "3").unlink()
    with pytest.warns(ReceptanceWarning, match="5 of 20 candidates are missing"):
        found = open_sweep(tmp_path / "s").load()
    assert not found["valid"][15:].any()
    assert np.isnan(found["misfit"][15:]).all()
    same(sweep(pair(), draw(20), measure(), store=tmp_path / "s"), expected)


@pytest.mark.parametrize("damage", [lambda text: "", lambda text: text[:-100], lambda text: text.replace("{", "[", 3)])
def test_a_damaged_description_names_the_store_and_leaves_no_lock(tmp_path: Path, damage: Any) -> None:
    store = tmp_path / "s"
    sweep(pair(), draw(20), FrequencyResponse(frequency_hz=LINES), store=store)
    (store / "frequency_hz" / "c" / "0").unlink()
    with pytest.raises(SweepError, match=f"{store}: the chunk frequency_hz/c/0 is missing; remove the store"):
        sweep(pair(), draw(20), FrequencyResponse(frequency_hz=LINES), store=store)
    (store / "zarr.json").write_text(damage((store / "zarr.json").read_text()))
    for _ in range(2):
        with pytest.raises(SweepError, match=f"{store}"):
            sweep(pair(), draw(20), FrequencyResponse(frequency_hz=LINES), store=store)
        with pytest.raises(SweepError, match=f"{store}"):
            open_sweep(store)
    assert [path.name for path in tmp_path.iterdir()] == ["s"]


@pytest.mark.slow
def test_remains_of_a_killed_creation_are_removed(tmp_path: Path) -> None:
    script = """
        import os, signal, sys
        sys.path.insert(0, sys.argv[1])
        import unit.test_sweep_store as module
        import zarr
        zarr.consolidate_metadata = lambda path: os.kill(os.getpid(), signal.SIGKILL)
        module.sweep(module.pair(), module.draw(20), module.measure(), store=sys.argv[2])
    """
    command = [sys.executable, "-c", textwrap.dedent(script), str(Path(__file__).parents[1]), str(tmp_path / "s")]
    assert subprocess.run(command, check=False).returncode == -signal.SIGKILL
    assert any(path.name.endswith(".part") for path in tmp_path.iterdir())
    sweep(pair(), draw(20), measure(), store=tmp_path / "s")
    assert [path.name for path in tmp_path.iterdir()] == ["s"]


def test_a_store_opens_in_xarray_without_warnings(tmp_path: Path) -> None:
    kept = sweep(pair(), draw(20), FrequencyResponse(frequency_hz=LINES), store=tmp_path / "s", block=7)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        plain = xr.open_zarr(tmp_path / "s", chunks=None)
    np.testing.assert_array_equal(plain["receptance"].values, kept["receptance"].values)
    np.testing.assert_array_equal(plain["frequency_hz"].values, LINES)


@pytest.mark.slow
def test_a_disk_without_space_names_the_chunk(tmp_path: Path) -> None:
    script = """
        import resource, signal, sys
        sys.path.insert(0, sys.argv[1])
        import unit.test_sweep_store as module
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))
        output = module.FrequencyResponse(frequency_hz=module.LINES)
        module.sweep(module.pair(), module.draw(400), output, store=sys.argv[2], block=200)
    """
    store = tmp_path / "s"
    # Python would truncate its files of bytecode as well.
    command = [sys.executable, "-B", "-c", textwrap.dedent(script), str(Path(__file__).parents[1]), str(store)]
    ended = subprocess.run(command, check=False, capture_output=True, text=True)
    assert re.search(rf"OSError: .*{store}/receptance/c/[01]/0", ended.stderr), ended.stderr
    assert not list(store.rglob("*.part"))
    output = FrequencyResponse(frequency_hz=LINES)
    same(sweep(pair(), draw(400), output, store=store), sweep(pair(), draw(400), output))


SCALE, NAMES = 2.0, {"factor": 1.0}


def scaled(h: Any) -> Any:
    return SCALE * NAMES["factor"] * abs(h).max(axis=1)


def peak(power: float) -> Callable[[Any], Any]:
    return lambda h: scaled(h) ** power


class Weighted:
    def __init__(self, weights: Any) -> None:
        self.weights = weights

    def __call__(self, h: Any) -> Any:
        return (abs(h) * self.weights).sum(axis=1)


def weighted(h: Any, weights: Any = LINES) -> Any:
    return (abs(h) * weights).sum(axis=1)


def made(source: str) -> Callable[[Any], Any]:
    """Return the function `reduce` of a text: as a script that was edited between two runs."""
    found: dict[str, Any] = {"__name__": "__main__", "np": np}
    exec(textwrap.dedent(source), found)
    function: Callable[[Any], Any] = found["reduce"]
    return function


CHANGES = {
    "a constant": ("reduce = lambda h: abs(h).max(axis=1)", "reduce = lambda h: 2 * abs(h).max(axis=1)"),
    "an operation": ("reduce = lambda h: abs(h).max(axis=1)", "reduce = lambda h: abs(h).min(axis=1)"),
    "a default": ("def reduce(h, n=3): return abs(h[:, n])", "def reduce(h, n=4): return abs(h[:, n])"),
    "a keyword": ("def reduce(h, *, n=3): return abs(h[:, n])", "def reduce(h, *, n=4): return abs(h[:, n])"),
    "a global": ("N = 3\ndef reduce(h): return abs(h[:, N])", "N = 4\ndef reduce(h): return abs(h[:, N])"),
    "a helper": (
        "def one(h): return abs(h[:, 3])\ndef reduce(h): return one(h)",
        "def one(h): return abs(h[:, 4])\ndef reduce(h): return one(h)",
    ),
    "an inner function": (
        "def reduce(h): return np.array([(lambda row: abs(row[3]))(row) for row in h])",
        "def reduce(h): return np.array([(lambda row: abs(row[4]))(row) for row in h])",
    ),
    "an object's method": (
        "class One:\n  def of(self, h): return abs(h[:, 3])\nreduce = One().of",
        "class One:\n  def of(self, h): return abs(h[:, 4])\nreduce = One().of",
    ),
    "a class's value": (
        "class One:\n  n = 3\n  def __call__(self, h): return abs(h[:, self.n])\nreduce = One()",
        "class One:\n  n = 4\n  def __call__(self, h): return abs(h[:, self.n])\nreduce = One()",
    ),
    "a partial": (
        "import functools\ndef of(n, h): return abs(h[:, n])\nreduce = functools.partial(of, 3)",
        "import functools\ndef of(n, h): return abs(h[:, n])\nreduce = functools.partial(of, 4)",
    ),
    "a decorated function": (
        "import functools\n@functools.lru_cache\ndef n(): return 3\ndef reduce(h): return abs(h[:, n()])",
        "import functools\n@functools.lru_cache\ndef n(): return 4\ndef reduce(h): return abs(h[:, n()])",
    ),
    "a set": (
        "N = {'a': {3, 5}}\ndef reduce(h): return abs(h[:, min(N['a'])])",
        "N = {'a': {4, 5}}\ndef reduce(h): return abs(h[:, min(N['a'])])",
    ),
}


@pytest.mark.parametrize("what", CHANGES)
def test_a_changed_function_is_another_sweep(tmp_path: Path, what: str) -> None:
    def run(source: str) -> xr.Dataset:
        output = FrequencyResponse(frequency_hz=LINES, reduce=made(source), name="peak")
        return sweep(pair(), draw(6), output, store=tmp_path / "s")

    before, after = CHANGES[what]
    first = run(before).load()
    same(run(before), first)
    with pytest.raises(SweepError, match="different sweep: it differs in output peak"):
        run(after)


def test_closure_and_globals_identify_a_function(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def run(reduce: Any, name: str) -> None:
        sweep(pair(), draw(6), FrequencyResponse(frequency_hz=LINES, reduce=reduce), store=tmp_path / name)

    run(peak(2.0), "closure")
    run(peak(2.0), "closure")
    run(Weighted(LINES), "object")
    run(Weighted(LINES.copy()), "object")
    run(weighted, "default")
    run(scaled, "global")
    others = [
        (peak(3.0), "closure"),
        (Weighted(LINES + 1.0), "object"),
        (np.vectorize(abs, signature="(n)->()"), "global"),
    ]
    for reduce, name in others:
        with pytest.raises(SweepError, match="different sweep: it differs in output receptance"):
            run(reduce, name)
    monkeypatch.setattr(weighted, "__defaults__", (LINES[::-1],))
    with pytest.raises(SweepError, match="different sweep"):
        run(weighted, "default")
    monkeypatch.setitem(NAMES, "factor", 1.5)
    for reduce, name in ((scaled, "global"), (peak(2.0), "closure")):
        with pytest.raises(SweepError, match="different sweep"):
            run(reduce, name)


def test_changed_user_module_is_another_sweep(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    for number, differs in (("3", False), ("3", False), ("4", True)):
        (tmp_path / "sweep_helpers.py").write_text(f"LINE = {number}\ndef one(h):\n    return abs(h[:, LINE])\n")
        monkeypatch.delitem(sys.modules, "sweep_helpers", raising=False)
        reduce = made("import sweep_helpers\ndef reduce(h): return sweep_helpers.one(h)")
        output = FrequencyResponse(frequency_hz=LINES, reduce=reduce, name="peak")
        if differs:
            with pytest.raises(SweepError, match="different sweep: it differs in output peak"):
                sweep(pair(), draw(6), output, store=tmp_path / "s")
        else:
            sweep(pair(), draw(6), output, store=tmp_path / "s")


@pytest.mark.slow
def test_function_identity_persists_across_processes(tmp_path: Path) -> None:
    script = """
        import sys
        import numpy as np
        sys.path.insert(0, sys.argv[1])
        import unit.test_sweep_store as module
        NAMES = {"large", "larger", "largest"}
        def reduce(h):
            assert "large" in NAMES
            return module.scaled(h) + module.Weighted(module.LINES)(h) * np.pi + (1 if NAMES & {"a", "b", "c"} else 0)
        output = module.FrequencyResponse(frequency_hz=module.LINES, reduce=reduce)
        module.sweep(module.pair(), module.draw(6), output, store=sys.argv[2])
    """
    command = [sys.executable, "-c", textwrap.dedent(script), str(Path(__file__).parents[1]), str(tmp_path / "s")]
    for seed in ("1", "2"):
        subprocess.run(command, check=True, env={**os.environ, "PYTHONHASHSEED": seed})


def test_a_function_that_cannot_be_compared_is_refused_before_the_work(tmp_path: Path) -> None:
    lock = threading.Lock()

    def reduce(h: Any) -> Any:
        with lock:
            return abs(h).max(axis=1)

    output = FrequencyResponse(frequency_hz=LINES, reduce=reduce, name="peak")
    assert sweep(pair(), draw(6), output).sizes["candidate"] == 6
    with pytest.raises(SweepError, match=r"output peak: <unlocked _thread.lock .* has no content .* without a store"):
        sweep(pair(), draw(6), output, store=tmp_path / "s")
    assert not list(tmp_path.iterdir())


def test_the_version_of_the_program_is_compared(tmp_path: Path) -> None:
    kept = sweep(pair(), draw(6), measure(), store=tmp_path / "s").load()
    text = (tmp_path / "s" / "zarr.json").read_text()
    version = kept.attrs["receptance"]
    (tmp_path / "s" / "zarr.json").write_text(text.replace(f'"receptance": "{version}"', '"receptance": "0.0.1"'))
    with pytest.raises(SweepError, match=f"started with receptance 0.0.1, and this is {version}"):
        sweep(pair(), draw(6), measure(), store=tmp_path / "s")
    assert open_sweep(tmp_path / "s").attrs["receptance"] == "0.0.1"


class Twice(Output):
    """A custom output."""

    factor = 2.0

    def variables(self) -> tuple[Variable, ...]:
        return (Variable("own", "float64", "m"),)

    def assemblies(self) -> tuple[Assembly, ...]:
        return ()

    def prepare(self, assembly: Assembly | None, addresses: Any, threads: int | None) -> Any:
        return lambda values: ({"own": self.factor * values[:, 0]}, np.ones(len(values), bool))

    def describe(self) -> list[Any]:
        return []


def test_custom_output_is_identified_by_its_code(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    sweep(pair(), draw(6), Twice(), store=tmp_path / "s")
    sweep(pair(), draw(6), Twice(), store=tmp_path / "s")
    monkeypatch.setattr(Twice, "factor", 3.0)
    with pytest.raises(SweepError, match="different sweep: it differs in output own"):
        sweep(pair(), draw(6), Twice(), store=tmp_path / "s")


class Bent:
    """A distribution that differs from the uniform one only between the quantiles in a store."""

    def __init__(self, bend: float) -> None:
        self.bend = bend

    def ppf(self, q: Any) -> Any:
        shares = np.asarray(q, float)
        return 1e7 * (1.0 + shares + self.bend * np.sin(np.pi * (shares - 0.01) / (0.98 / 8)))


def test_distributions_are_distinguished_between_quantiles(tmp_path: Path) -> None:
    for bend in (0.0, 0.01):
        candidates = Sampled({"joint.k_y": Bent(bend)}, count=60, seed=1)
        if not bend:
            sweep(pair(), candidates, measure(), store=tmp_path / "s")
            continue
        with pytest.raises(SweepError, match=r"different sweep: its candidate 0 has joint\.k_y = "):
            sweep(pair(), candidates, measure(), store=tmp_path / "s")


def test_grid_accepts_input_of_as_grid() -> None:
    with pytest.raises(SweepError, match="not a grid"):
        as_grid(sweep(pair(), draw(5), measure()))


def _in_child(queue: Any) -> None:
    queue.put(sweep(pair(), draw(50), measure(), threads=2)["misfit"].values)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_a_forked_process_sweeps_as_its_parent() -> None:
    before = sweep(pair(), draw(50), measure(), threads=2)["misfit"].values
    context = multiprocessing.get_context("fork")
    queue = context.Queue()
    child = context.Process(target=_in_child, args=(queue,))
    child.start()
    found = queue.get(timeout=LIMIT_S)
    child.join(LIMIT_S)
    assert child.exitcode == 0
    np.testing.assert_array_equal(found, before)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_killed_workers_do_not_change_results(tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed", reason="dask.distributed is not installed")
    expected = sweep(pair(), draw(3000), measure())
    killed: list[int] = []
    with (
        distributed.LocalCluster(
            n_workers=3, threads_per_worker=1, processes=True, dashboard_address=None, local_directory=str(tmp_path)
        ) as cluster,
        # Not the default one.
        distributed.Client(cluster, set_as_default=False) as client,
    ):
        workers = client.run(os.getpid)

        def kill(reported: Any) -> None:
            if reported.done >= 500 and not killed:
                killed.append(next(iter(workers.values())))
                os.kill(killed[0], signal.SIGKILL)

        found = sweep(
            pair(), draw(3000), measure(), store=tmp_path / "s", block=50, client=client, progress=kill
        ).load()
        again = sweep(pair(), draw(3000), measure(), block=70, client=client)
    assert killed
    same(found, expected)
    same(again, expected)
