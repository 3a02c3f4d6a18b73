"""A misfit sweep: `python benches/sweeping.py [--candidates N] [--workers N ...] [--rounds N]`.

Draws k_y, k_theta, c_y and c_theta of a joint, compares each candidate with a receptance of 2,000 lines, and writes the
misfits to a Zarr store: a tenth of the candidates first, then all, in this process on one thread and on two, then on
dask workers of one thread each, all numbers of workers in turns. Prints candidates a second, the largest memory of this
process, and the processor time of it and of the workers. The misfits must be the same in all cases.
"""

from __future__ import annotations

import os

# One thread each, before NumPy loads the library that would start more.
if __name__ == "__main__":
    os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import argparse
import json
import resource
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy import stats

from receptance import CARBIDE, STEEL, Assembly, Observation, Part, PointJoint, Segment
from receptance.sweep import Misfit, Sampled, sweep

LINES = 2000
QUICK = 2000


def measure(seed: int) -> Observation:
    """Return a simulated measurement with 2 % noise."""
    tool = Part([Segment(length=0.09, outer_diameter=0.016, material=CARBIDE)], name="tool")
    joint = PointJoint(k_y=1.5e8, k_theta=9e4, c_y=400.0, c_theta=0.15, name="joint")
    holder = Part([Segment(length=0.12, outer_diameter=0.05, material=STEEL)], name="holder")
    assembly = Assembly([tool, joint, holder])
    lines = np.linspace(100.0, 6000.0, LINES)
    rng = np.random.default_rng(seed)
    noise = 0.02 * (rng.standard_normal(LINES) + 1j * rng.standard_normal(LINES))
    return Observation(
        assembly=assembly,
        frequency_hz=lines,
        receptance=assembly.receptance(lines) * np.exp(noise),
        standard_deviation=0.02,
    )


def draw(count: int, seed: int) -> Sampled:
    """Return the candidates."""
    ranges = {
        "joint.k_y": (3e7, 1e9),
        "joint.k_theta": (2e4, 4e5),
        "joint.c_y": (50.0, 3e3),
        "joint.c_theta": (0.02, 1.0),
    }
    return Sampled({name: stats.loguniform(*ends) for name, ends in ranges.items()}, count=count, seed=seed)


def run(frf: Observation, count: int, seed: int, name: str, **options: Any) -> tuple[dict[str, Any], Any]:
    """Sweep, and return a row and the misfits."""
    with tempfile.TemporaryDirectory() as folder:
        before, begun = processor_seconds(options.get("client")), time.perf_counter()
        found = sweep(frf.assembly, draw(count, seed), Misfit(frf), store=Path(folder) / "sweep.zarr", **options)
        seconds = time.perf_counter() - begun
        here, on_workers = np.subtract(processor_seconds(options.get("client")), before).tolist()
        misfits = found["misfit"].values
    row = {
        "name": name,
        "candidates": count,
        "lines": LINES,
        "seconds": seconds,
        "processor_seconds_here": here,
        "processor_seconds_workers": on_workers,
        "candidates_per_second": count / seconds,
        "memory_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0,
        "load": os.getloadavg()[0],
    }
    workers = f" and {on_workers:.2f} s on workers" if on_workers else ""
    print(
        f"{name:<29} {count:>9,} candidates {seconds:6.2f} s {count / seconds:>8,.0f} a second "
        f"{1e-6 * LINES * count / seconds:4.0f} million candidate-lines a second, {row['memory_mb']:.0f} MB, "
        f"{here:.2f} s of a processor here{workers}, load {row['load']:.1f}",
        flush=True,
    )
    return row, misfits


def processor_seconds(client: Any) -> tuple[float, float]:
    """Return the processor time of this process, which has dask's scheduler in it, and of all workers."""
    return time.process_time(), sum(client.run(time.process_time).values()) if client is not None else 0.0


def on_workers(
    frf: Observation, count: int, seed: int, numbers: Sequence[int], rounds: int
) -> Iterator[tuple[int, dict[str, Any], Any]]:
    """Sweep on the given numbers of dask workers of one thread each, in turns, after small warm-up sweeps."""
    from distributed import Client, LocalCluster

    options: dict[str, Any] = {"threads_per_worker": 1, "processes": True, "dashboard_address": None}
    for number in list(numbers) * rounds:
        # One cluster at a time: workers and schedulers that wait take some of the processors too.
        # Its folder is removed with it; dask leaves its own in the system's temporary folder.
        with (
            tempfile.TemporaryDirectory() as folder,
            LocalCluster(n_workers=number, local_directory=folder, **options) as cluster,
            Client(cluster) as client,
        ):
            sweep(frf.assembly, draw(200 * number, seed), Misfit(frf), block=50, client=client)
            title = f"dask, {number} worker{'s' if number > 1 else ''} of one thread"
            yield number, *run(frf, count, seed, title, client=client)


def compared(rows: Sequence[dict[str, Any]]) -> str:
    """Return how many times faster more workers were than the first number of them, by the least times."""
    names = list(dict.fromkeys(row["name"] for row in rows))
    least = {name: min(row["seconds"] for row in rows if row["name"] == name) for name in names}
    return "\n".join(f"{name}: {least[names[0]] / least[name]:.2f} times {names[0]}" for name in names[1:])


def main(arguments: list[str] | None = None) -> int:
    """Measure, print, write JSON if requested."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--candidates", type=int, default=1_000_000)
    parser.add_argument("--workers", type=int, nargs="*", default=[1, 2], help="numbers of dask workers; none for none")
    parser.add_argument("--rounds", type=int, default=3, help="turns of each number of workers")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--quick", action="store_true", help=f"{QUICK} candidates and no workers: does it run?")
    options = parser.parse_args(arguments)
    count, workers = (QUICK, []) if options.quick else (options.candidates, options.workers)
    print(f"seed {options.seed}, {os.cpu_count()} processors")
    frf = measure(options.seed)
    rows = [run(frf, max(count // 10, 1), options.seed, "one thread, a tenth", threads=1)[0]]
    row, expected = run(frf, count, options.seed, "one thread", threads=1)
    rows.append(row)
    row, found = run(frf, count, options.seed, "two threads", threads=2)
    rows.append(row)
    assert np.array_equal(found, expected), "two threads gave other numbers"
    spread = []
    for number, row, found in on_workers(frf, count, options.seed, workers, options.rounds):
        spread.append(row)
        assert np.array_equal(found, expected), f"{number} workers gave other numbers"
    if len(workers) > 1:
        print(f"least of {options.rounds}:\n{compared(spread)}")
    rows += spread
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
