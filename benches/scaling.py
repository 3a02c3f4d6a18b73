"""How times grow with lines, segments, candidates, threads and workers: ``python benches/scaling.py --plot FILE``.

Each point is the least processor time of several calls, ours beside the NumPy reference on one thread. That of several
threads is by the clock on the wall, all numbers of threads in turns: it is meaningful on an idle machine only.
"""

from __future__ import annotations

import os

if __name__ == "__main__":
    os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"

import argparse
import itertools
import json
import math
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import numpy_reference as reference
import sweeping
from numpy_reference.cases import segment_row, ten_segments, tool_and_holder
from pairs.models import Array, chain, coupled, part, segment_addresses, sweep
from pairs.sweeps import joints, measured, swept
from receptance import Assembly, Coordinate, _core
from receptance._files import check_target, write_whole
from roofline import least

TIP = [Coordinate(direction="y"), Coordinate(direction="theta")]
LINES = (100, 1_000, 10_000, 100_000)
SEGMENTS = (1, 3, 10, 30, 100)
CANDIDATES = (1, 10, 100, 1_000, 10_000)
AT_LINES = 1_000
THREADS = tuple(range(1, min(os.cpu_count() or 1, 16) + 1))
ON_THE_WALL = ("threads", "workers")
ENOUGH_S = 0.3
"""About how long each point is measured."""


class Point(NamedTuple):
    """One measured point: panel, curve, abscissa, seconds."""

    panel: str
    curve: str
    x: int
    seconds: float


def repeats(call: Callable[[], object], quick: bool) -> int:
    """Return how often a call is to be measured."""
    return 1 if quick else max(3, min(100, int(ENOUGH_S / least(call, 1))))


def measure(quick: bool = False) -> Iterator[Point]:
    """Yield all points; fewer and less accurate ones for a trial run."""
    few = slice(0, 2) if quick else slice(None)

    def points(panel: str, x: int, calls: dict[str, Callable[[], Any]]) -> Iterator[Point]:
        for curve, call in calls.items():
            yield Point(panel, curve, x, least(call, repeats(call, quick)))

    for count in LINES[few]:
        f, w = sweep(count)
        tip = {
            "receptance": lambda f=f: chain().receptance(f, response=TIP, excitation=TIP, threads=1),
            "NumPy, closed form": lambda w=w: reference.tip_by_stiffness(w, ten_segments()),
        }
        yield from points("lines, ten segments", count, tip)
    f, w = sweep(AT_LINES)
    for count in SEGMENTS[few]:
        table = np.array([segment_row(i, 0.2 / count, 0.012 + 0.02 * i / count) for i in range(count)])
        bar = Assembly([part(table, "bar")])
        tip = {
            "receptance": lambda bar=bar: bar.receptance(f, response=TIP, excitation=TIP, threads=1),
            "NumPy, closed form": lambda table=table: reference.tip_by_stiffness(w, table),
        }
        yield from points(f"segments, {AT_LINES:,} lines", count, tip)
    data, own = measured(w), swept(AT_LINES, 1)
    plain = reference.JointSweep(w, reference.Substructures(*tool_and_holder(), w[-1]), True, data)
    for count in CANDIDATES[few]:
        rows = joints("viscous", count)
        misfit = {
            "receptance": lambda rows=rows: own.misfit(rows, data),
            "NumPy, matrix products": lambda rows=rows: plain.misfits(rows, np.ones(AT_LINES)),
        }
        yield from points(f"candidates (misfit), {AT_LINES:,} lines", count, misfit)
    yield from threaded(data, few, quick)


def threaded(data: Array, few: slice, quick: bool) -> Iterator[Point]:
    """Yield the points of several threads, all numbers of them in turns."""
    rows, (f, _), slopes = joints("viscous", 1_000), sweep(50_000), segment_addresses(coupled())
    many = {count: swept(AT_LINES, count) for count in THREADS}
    work: dict[str, Callable[[int], Any]] = {
        "misfits of 1,000 joints": lambda count: many[count].misfit(rows, data),
        "tool, joint and holder, 50,000 lines": lambda count: coupled().receptance(f, threads=count),
        "with 40 derivatives": lambda count: coupled().derivatives(f, slopes, threads=count),
    }
    for curve, call in work.items():
        taken: dict[int, float] = {}
        for _ in range(repeats(lambda call=call: call(1), quick)):
            for count in THREADS[few]:
                once = least(lambda call=call, count=count: call(count), 1, time.perf_counter)
                taken[count] = min(once, taken.get(count, once))
        for count, best in taken.items():
            yield Point("threads", curve, count, best)


def on_workers(numbers: Sequence[int], quick: bool) -> Iterator[Point]:
    """Yield the points of dask workers of one thread each: a sweep of misfits, on the wall."""
    if not numbers:
        return
    frf, least = sweeping.measure(0), dict.fromkeys(numbers, math.inf)
    for number, row, _ in sweeping.on_workers(frf, 2_000 if quick else 500_000, 0, numbers, 1 if quick else 5):
        least[number] = min(least[number], row["seconds"])
    for number, seconds in least.items():
        yield Point("workers", "500,000 misfits of 2,000 lines to a store", number, seconds)


def figure(points: Sequence[Point], about: str = "") -> Any:
    """Return the figure: seconds over each abscissa, and how many times faster more threads are; `about` on top."""
    from matplotlib.figure import Figure

    panels = list(dict.fromkeys(point.panel for point in points))
    columns = (len(panels) + 1) // 2
    drawn = Figure(figsize=(5.5 * columns, 7.5), layout="constrained")
    drawn.suptitle(about, fontsize="medium")
    every = drawn.subplots(2, columns).ravel()
    for unused in every[len(panels) :]:
        unused.set_axis_off()
    for axes, panel in zip(every, panels, strict=False):
        own = [point for point in points if point.panel == panel]
        for curve in dict.fromkeys(point.curve for point in own):
            x = np.array([point.x for point in own if point.curve == curve])
            y = np.array([point.seconds for point in own if point.curve == curve])
            if panel in ON_THE_WALL:
                axes.plot(x, y[0] / y, "o-", label=curve)
            else:
                axes.loglog(x, 1e3 * y, "o-", label=curve)
        axes.set_xlabel(panel)
        axes.set_ylabel("times as fast as one" if panel in ON_THE_WALL else "processor time of a call [ms]")
        if panel in ON_THE_WALL:
            ticks = sorted({point.x for point in own})
            axes.plot(ticks, ticks, color="0.7", zorder=0, label="as many times as fast")
            axes.set_xticks(ticks)
            axes.set_ylim(bottom=0.0)
        axes.grid(visible=True, which="major", color="0.9")
        axes.legend(frameon=False)
    return drawn


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print, and write the requested files."""
    parser = argparse.ArgumentParser(description="How times grow with lines, segments, candidates and threads.")
    parser.add_argument("--plot", type=Path, metavar="FILE", help="write a figure (PNG, SVG or PDF)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the points")
    parser.add_argument("--workers", type=int, nargs="*", default=[], help="numbers of dask workers; by default none")
    parser.add_argument("--quick", action="store_true", help="few points: to try it out")
    options = parser.parse_args(arguments)
    for name, target in (("--plot", options.plot), ("--json", options.json)):
        try:
            if target:
                check_target(target)
        except OSError as error:
            parser.error(f"{name}: {error}")
    load = f"load {os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else "load unknown"
    about = f"{os.cpu_count()} processors, {_core.instruction_set()}, {load} at the beginning"
    print(f"least processor times of several calls (threads and workers: on the wall), {about}")
    found = []
    for point in itertools.chain(measure(options.quick), on_workers(options.workers, options.quick)):
        found.append(point)
        print(f"{point.panel:<40}{point.curve:<40}{point.x:>9,}{1e3 * point.seconds:>12.3f} ms", flush=True)
    if options.json:
        write_whole({options.json: f"{json.dumps([point._asdict() for point in found], indent=2)}\n".encode()})
    if options.plot:
        from io import BytesIO

        content = BytesIO()
        figure(found, about).savefig(content, format=options.plot.suffix.lstrip(".") or "png", dpi=150)
        write_whole({options.plot: content.getvalue()})
    return 0


if __name__ == "__main__":
    sys.exit(main())
