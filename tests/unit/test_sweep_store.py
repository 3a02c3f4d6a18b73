"""Sweeps in Zarr stores: interruptions, damage, workers."""

from __future__ import annotations

import contextlib
import json
import multiprocessing
import os
import signal
import subprocess
import sys
import textwrap
import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
import zarr
from scipy import stats

from limits import LIMIT_S
from receptance import STEEL, Assembly, Observation, Part, PointJoint, ReceptanceWarning, Segment
from receptance.sweep import (
    FrequencyResponse,
    Grid,
    Listed,
    Misfit,
    NaturalFrequencies,
    Output,
    Reduction,
    Sampled,
    SweepError,
    Variable,
    as_grid,
    open_sweep,
    sweep,
)

LINES = np.linspace(200.0, 4000.0, 50)


def pair() -> Assembly:
    tool = Segment(length=0.1, outer_diameter=0.02, material=STEEL)
    joint = PointJoint(k_y=1e8, k_theta=1e5, c_y=100.0, c_theta=0.1, name="joint")
    return Assembly([Part([tool], name="tool"), joint, Part([tool], name="holder")])


def measure() -> Misfit:
    return Misfit(
        Observation(assembly=pair(), frequency_hz=LINES, receptance=pair().receptance(LINES), standard_deviation=0.01)
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


@pytest.mark.slow
def test_a_run_that_is_killed_at_any_moment_is_resumed(tmp_path: Path) -> None:
    store = tmp_path / "killed.zarr"
    script = """
        import sys
        sys.path.insert(0, sys.argv[1])
        import unit.test_sweep_store as module

        outputs = [module.measure(), module.FrequencyResponse(frequency_hz=module.LINES)]
        print("begun", flush=True)
        module.sweep(module.pair(), module.draw(600), outputs, store=sys.argv[2], block=4,
                     progress=lambda state: print(state.done, flush=True))
    """
    command = [sys.executable, "-c", textwrap.dedent(script), str(Path(__file__).parents[1]), str(store)]
    rng = np.random.default_rng(4)
    for blocks in (0, 1, 20, 40):  # killed while the store is made, and after some blocks
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
            assert process.stdout is not None
            for _ in range(blocks + 1):
                process.stdout.readline()
            time.sleep(rng.uniform(0.0, 0.02))
            process.kill()
    with pytest.warns(ReceptanceWarning, match="candidates are missing"):
        part = open_sweep(store).load()
    expected = sweep(pair(), draw(600), [measure(), FrequencyResponse(frequency_hz=LINES)])
    there = part["valid"].values
    assert 60 * 4 <= there.sum() < 600
    np.testing.assert_array_equal(part["misfit"].values, np.where(there, expected["misfit"].values, np.nan))
    reported: list[Any] = []
    outputs = [measure(), FrequencyResponse(frequency_hz=LINES)]
    whole = sweep(pair(), draw(600), outputs, store=store, progress=reported.append)
    assert reported[0].resumed == there.sum()
    assert reported[-1].done == 600
    same(whole, expected)


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


def test_a_block_that_is_not_completely_written_is_missing(tmp_path: Path) -> None:
    """A run was killed between the outputs of a block."""

    def stop(reported: Any) -> None:
        if reported.done >= 30:
            raise KeyboardInterrupt

    store = tmp_path / "s"
    with pytest.raises(KeyboardInterrupt):
        sweep(pair(), draw(100), measure(), store=store, block=10, progress=stop)
    group = zarr.open_group(store, mode="r+")
    for name, value in (("misfit", 1.0), ("valid", True)):
        group[name][30:40] = value
        with pytest.warns(ReceptanceWarning, match="70 of 100 candidates are missing"):
            part = open_sweep(store).load()
        assert part["valid"].dtype == bool
        np.testing.assert_array_equal(part["valid"].values, np.arange(100) < 30)
        np.testing.assert_array_equal(np.isnan(part["misfit"].values), np.arange(100) >= 30)
    same(sweep(pair(), draw(100), measure(), store=store, block=10), sweep(pair(), draw(100), measure()))


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


def test_two_runs_of_one_sweep_may_write_to_one_store(tmp_path: Path) -> None:
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "real" / "s")

    def second(state: Any) -> None:
        if state.done == 5:
            sweep(pair(), draw(20), measure(), store=tmp_path / "real" / "s")
        with pytest.raises(SweepError, match="different sweep"):
            sweep(pair(), draw(21), measure(), store=tmp_path / "link")

    expected = sweep(pair(), draw(20), measure())
    same(sweep(pair(), draw(20), measure(), store=tmp_path / "link", block=5, progress=second), expected)
    assert (tmp_path / "link").is_symlink()
    assert [path.name for path in (tmp_path / "real").iterdir()] == ["s"]


DAMAGES: dict[str, Any] = {
    "missing": lambda file: file.unlink(),
    "changed": lambda file: file.write_bytes(bytes([file.read_bytes()[0] ^ 1]) + file.read_bytes()[1:]),
    "short": lambda file: file.write_bytes(file.read_bytes()[:-9]),
    "empty": lambda file: file.write_bytes(b""),
}


@pytest.mark.parametrize(
    ("name", "damage"),
    [
        ("misfit", "missing"),
        ("receptance", "changed"),
        ("joint.k_y", "short"),
        ("checksum", "empty"),
        ("checksum", "missing"),
    ],
)
def test_damaged_blocks_are_noted_and_evaluated_again(tmp_path: Path, name: str, damage: str) -> None:
    store, outputs = tmp_path / "s", [measure(), FrequencyResponse(frequency_hz=LINES)]
    expected = sweep(pair(), draw(20), outputs, store=store, block=5).load()
    chunk = store / name / "c" / "2"
    chunk = chunk / "0" if name == "receptance" else chunk
    DAMAGES[damage](chunk)
    # A block without a checksum was not finished.
    absent = name == "checksum" and damage == "missing"
    if not absent:
        words = {"missing": f"{store}: chunks of {name} are missing", "changed": "checksum"}.get(damage)
        with pytest.raises(ValueError, match=words):
            open_sweep(store)[name].load()
    reported: list[Any] = []
    words = f"{store}: candidates 10 to 14 are damaged.*5 candidates are evaluated again"
    with contextlib.nullcontext() if absent else pytest.warns(ReceptanceWarning, match=words):
        same(sweep(pair(), draw(20), outputs, store=store, progress=reported.append), expected)
    assert reported[0].resumed == 15
    same(open_sweep(store), expected)


@pytest.mark.parametrize("damage", [lambda text: "", lambda text: text[:-100], lambda text: text.replace("{", "[", 3)])
def test_a_damaged_description_names_the_store(tmp_path: Path, damage: Any) -> None:
    store = tmp_path / "s"
    sweep(pair(), draw(20), FrequencyResponse(frequency_hz=LINES), store=store)
    (store / "frequency_hz" / "c" / "0").unlink()
    with pytest.raises(SweepError, match=f"{store}: frequency_hz is damaged or missing; remove the store"):
        sweep(pair(), draw(20), FrequencyResponse(frequency_hz=LINES), store=store)
    with pytest.raises(SweepError, match=f"{store}: chunks of frequency_hz are missing"):
        open_sweep(store)
    (store / "zarr.json").write_text(damage((store / "zarr.json").read_text()))
    with pytest.raises(SweepError, match=f"{store}"):
        sweep(pair(), draw(20), FrequencyResponse(frequency_hz=LINES), store=store)
    with pytest.raises(SweepError, match=f"{store}"):
        open_sweep(store)
    assert [path.name for path in tmp_path.iterdir()] == ["s"]


def test_a_store_opens_in_xarray_without_warnings(tmp_path: Path) -> None:
    kept = sweep(pair(), draw(20), FrequencyResponse(frequency_hz=LINES), store=tmp_path / "s", block=7)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        plain = xr.open_zarr(tmp_path / "s", chunks=None, consolidated=False)
    np.testing.assert_array_equal(plain["receptance"].values, kept["receptance"].values)
    np.testing.assert_array_equal(plain["frequency_hz"].values, LINES)


@pytest.mark.slow
def test_a_disk_without_space_names_the_store(tmp_path: Path) -> None:
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
    assert f"File too large: '{store}'" in ended.stderr
    output = FrequencyResponse(frequency_hz=LINES)
    same(sweep(pair(), draw(400), output, store=store), sweep(pair(), draw(400), output))


def peak(h: Any) -> Any:
    return abs(h).max(axis=1)


@pytest.mark.parametrize(("name", "version"), [("peak", "2"), ("level", "1")])
def test_another_version_of_a_reduction_is_another_sweep(tmp_path: Path, name: str, version: str) -> None:
    def run(reduction: Reduction) -> xr.Dataset:
        output = FrequencyResponse(frequency_hz=LINES, reduce=reduction, name="result")
        return sweep(pair(), draw(6), output, store=tmp_path / "s")

    first = run(Reduction(peak, name="peak", version="1")).load()
    # Code is not compared.
    same(run(Reduction(lambda h: peak(h), name="peak", version="1")), first)
    record = json.loads((tmp_path / "s" / "zarr.json").read_text())["attributes"]["receptance_sweep"]
    assert record["code"] == {"output result": "peak, version 1"}
    text = rf"output result \(by peak, version 1 in the store, by {name}, version {version} now\)"
    with pytest.raises(SweepError, match=f"different sweep: it differs in {text}"):
        run(Reduction(peak, name=name, version=version))
    with pytest.raises(SweepError, match=r"output result \(by peak, version 1 in the store, by the program now\)"):
        sweep(pair(), draw(6), FrequencyResponse(frequency_hz=LINES, name="result"), store=tmp_path / "s")


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

    version = "1"
    described: Any = 2.0

    def variables(self) -> tuple[Variable, ...]:
        return (Variable("own", "float64", "m"),)

    def assemblies(self) -> tuple[Assembly, ...]:
        return ()

    def prepare(self, assembly: Assembly | None, addresses: Any, threads: int | None) -> Any:
        return lambda values: ({"own": 2.0 * values[:, 0]}, np.ones(len(values), bool))

    def describe(self) -> list[Any]:
        return [self.described]


def test_custom_output_is_identified_by_its_version_and_values(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def run() -> None:
        sweep(pair(), draw(6), Twice(), store=tmp_path / "s")

    run()
    run()
    with monkeypatch.context() as patch:
        patch.setattr(Twice, "version", "2")
        with pytest.raises(SweepError, match=r"own \(by Twice, version 1 in the store, by Twice, version 2 now\)"):
            run()
    for value in (3.0, 2, [2.0], (2.0, None), np.array([2.0]), {"a": 2.0}, 2.0 + 0.0j):
        with monkeypatch.context() as patch:
            patch.setattr(Twice, "described", value)
            with pytest.raises(SweepError, match="different sweep: it differs in output own; "):
                run()
    monkeypatch.setattr(Twice, "described", staticmethod(peak))
    with pytest.raises(SweepError, match=r"output own: <function peak .* described by Reduction"):
        run()


@pytest.mark.parametrize("name", ["receptance", "valid"])
def test_exchanged_chunks_are_evaluated_again(tmp_path: Path, name: str) -> None:
    """Both files are sound, and each belongs to the other block."""
    store, outputs = tmp_path / "s", [measure(), FrequencyResponse(frequency_hz=LINES)]
    # The bar is shorter than it can be in the second half, so that `valid` differs.
    lengths = Listed({"joint.k_y": [1e7, 2e7, 3e7, 4e7], "tool.segment[0].length": [0.1, 0.1, -0.1, 0.1]})
    expected = sweep(pair(), lengths, outputs, store=store, block=2).load()
    assert expected["valid"].values.tolist() == [True, True, False, True]
    folder, within = store / name / "c", "0" if name == "receptance" else ""
    first, second = folder / "0" / within, folder / "1" / within
    contents = first.read_bytes(), second.read_bytes()
    first.write_bytes(contents[1])
    second.write_bytes(contents[0])
    with pytest.warns(ReceptanceWarning, match="candidates 0 to 1 are damaged.*1 more.*; 4 candidates"):
        same(sweep(pair(), lengths, outputs, store=store), expected)


def test_exchanged_blocks_are_evaluated_again(tmp_path: Path) -> None:
    """All files of two blocks, their checksums included."""
    store, lengths = tmp_path / "s", Listed({"tool.segment[0].length": [0.08, 0.09, 0.1, 0.11]})
    expected = sweep(pair(), lengths, measure(), store=store, block=2).load()
    for second in store.glob("*/c/1"):
        second.rename(second.with_name("moved"))
        second.with_name("0").rename(second)
        second.with_name("moved").rename(second.with_name("0"))
    with pytest.warns(ReceptanceWarning, match="candidates 0 to 1 are damaged.*1 more.*; 4 candidates"):
        same(sweep(pair(), lengths, measure(), store=store), expected)


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
