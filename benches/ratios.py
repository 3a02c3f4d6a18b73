"""Our time beside the NumPy reference's, pair by pair in one process: ``python benches/ratios.py [--json FILE]``.

Each pair first has to agree. Then both sides run in turns, so that whatever else the machine does meets both, and the
medians over the rounds are compared. Nothing is asserted about time. The rows are described in ``README.md`` beside
this file.
"""

from __future__ import annotations

import os

# One thread each, before NumPy loads the library that would start more; tests import this file with NumPy loaded.
if __name__ == "__main__":
    os.environ["OMP_NUM_THREADS"] = "1"
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    os.environ["MKL_NUM_THREADS"] = "1"
    os.environ["VECLIB_MAXIMUM_THREADS"] = "1"

import argparse
import gc
import json
import math
import platform
import statistics
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from pairs import FIT_LINES, Pair, all_pairs, compiled, peers
from pairs.fits import Share, scipy_share
from pairs.threads import machine_gain
from receptance import _core
from receptance._files import check_target, write_whole

ROUNDS, QUICK_ROUNDS, QUICK_SHARE = 15, 3, 10
# Least duration of a turn of one side [s], by repeating the call.
LEAST_TURN = 0.01
TITLE = f"""
  {"":<58} {"ms a call":>19} {"":>7} {"ratio,":>13} {"ours, ns a":>17} {"reference, ns a":>17} {"largest":>9}
  {"against":<58} {"ours":>9} {"reference":>9} {"ratio":>7} {"quartiles":>13} {"line":>9} {"segment":>7} {"line":>9} \
{"segment":>7} {"difference":>9}"""


Clock = Callable[[], float]


@dataclass(frozen=True)
class Row:
    """Measurement of a pair: seconds a call of both sides, their ratio, and its quartiles over the rounds."""

    pair: Pair
    ours_s: float
    reference_s: float
    ratio: float
    quartiles: tuple[float, float]
    difference: float
    remark: str
    machine_gain: float | None
    clock: str

    def as_json(self) -> dict[str, Any]:
        """Return the row of the file."""
        pair = self.pair
        per_line = 1e9 / pair.lines if pair.lines else None
        return {
            "name": pair.name,
            "ours_s": self.ours_s,
            "reference_s": self.reference_s,
            "ratio": self.ratio,
            "threads": pair.threads,
            "ratio_is": pair.ratio_is,
            "ratio_quartiles": list(self.quartiles),
            "lines": pair.lines,
            "segments": pair.segments,
            "ours_ns_per_line": per_line and self.ours_s * per_line,
            "reference_ns_per_line": per_line and self.reference_s * per_line,
            "difference": self.difference,
            "tolerance": pair.tolerance,
            "remark": self.remark,
            "machine_gain": self.machine_gain,
            "clock": self.clock,
        }


def turn(call: Callable[[], object], times: int, clock: Clock = time.perf_counter) -> float:
    """Return the seconds of one call, the mean of several in a row."""
    began = clock()
    for _ in range(times):
        call()
    return (clock() - began) / times


def measure(pair: Pair, rounds: int, least: float, clock: Clock = time.perf_counter) -> Row:
    """Check that both sides of a pair agree, then time them in turns; several threads by the clock on the wall."""
    clock = clock if pair.threads == 1 else time.perf_counter
    difference, remark = pair.check()
    sides = (pair.ours, pair.reference)
    rounds = min(rounds, pair.most_rounds or rounds)
    times = [1, 1]
    if least > 0.0:
        # Besides counting the repeats, this warms caches and thread pools up.
        times = [max(1, math.ceil(least / max(min(turn(side, 1, clock) for _ in range(2)), 1e-6))) for side in sides]
    taken: tuple[list[float], list[float]] = ([], [])
    gains: list[float] = []
    gc.collect()
    gc.disable()
    try:
        for count in range(rounds):
            # The first side alternates between rounds, so a slowing machine biases neither.
            for side in (0, 1) if count % 2 else (1, 0):
                taken[side].append(turn(sides[side], times[side], clock))
            if pair.threads > 1:
                gains.append(machine_gain())
    finally:
        gc.enable()
    above, below = taken if pair.is_cost else taken[::-1]
    ratios = [x / y for x, y in zip(above, below, strict=True)]
    low, _, high = statistics.quantiles(ratios, n=4, method="inclusive") if rounds > 1 else ratios * 3
    return Row(
        pair=pair,
        ours_s=statistics.median(taken[0]),
        reference_s=statistics.median(taken[1]),
        ratio=statistics.median(above) / statistics.median(below),
        quartiles=(low, high),
        difference=difference,
        remark=remark,
        machine_gain=statistics.median(gains) if gains else None,
        clock="processor" if clock is time.process_time else "wall",
    )


def machine() -> dict[str, Any]:
    """Return the properties of the machine and the versions."""
    return {
        "processor": processor(),
        "cores": os.cpu_count(),
        "usable_cores": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count(),
        "load": round(os.getloadavg()[0], 2) if hasattr(os, "getloadavg") else None,
        "instruction_set": _core.instruction_set(),
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        **{name: version(name) for name in ("numpy", "scipy", "receptance")},
    }


def processor() -> str:
    """Return the processor's name as far as the system provides it."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor()


def heading(pair: Pair) -> str:
    """Return the line above the rows of one subject."""
    size = [f"{pair.lines:,} lines"] if pair.lines else []
    size += [f"{pair.segments} segment{'s' if pair.segments > 1 else ''}"] if pair.segments else []
    size += [f"{pair.threads} thread{'s' if pair.threads > 1 else ''}"]
    return f"\n{pair.subject} ({', '.join(size)})"


def line(row: Row) -> str:
    """Return a row of the printed table."""
    pair = row.pair
    cells = [f"  {pair.against:<58}", f"{row.ours_s * 1e3:>9.3f}", f"{row.reference_s * 1e3:>9.3f}"]
    cells += [f"{row.ratio:>7.2f}", f"{f'{row.quartiles[0]:.2f}-{row.quartiles[1]:.2f}':>13}"]
    for seconds in (row.ours_s, row.reference_s):
        per_line = seconds * 1e9 / pair.lines if pair.lines else math.nan
        cells.append(f"{per_line:>9.1f}" if pair.lines else " " * 9)
        cells.append(f"{per_line / pair.segments:>7.1f}" if pair.lines and pair.segments else " " * 7)
    cells += [f"{row.difference:>9.1e}", f" {row.remark}"]
    if row.machine_gain is not None:
        cells += [f"independent checksums at the same time gain {row.machine_gain:.2f}"]
    return " ".join(cells).rstrip()


def describe(fit: Share) -> str:
    """Return the share of SciPy in the time of the reference identification, as text."""
    setup = fit.whole - fit.scipy - fit.model
    return (
        f"reference identification, analytic Jacobian: {fit.whole * 1e3:.2f} ms, of these SciPy's own "
        f"{fit.scipy * 1e3:.2f} ms ({100 * fit.scipy / fit.whole:.0f} %), residuals and Jacobians "
        f"{fit.model * 1e3:.2f} ms, set-up {setup * 1e3:.2f} ms;\n"
        f"SciPy on all residuals and a model that costs nothing would gain {fit.whole / fit.scipy:.1f}"
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table, and write it to a file if one is given."""
    parser = argparse.ArgumentParser(description="Our time beside a NumPy reference's, one process, medians.")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the rows to a file, whole or not at all")
    parser.add_argument("--rounds", type=int, metavar="N", help=f"turns of each side, {ROUNDS} by default")
    parser.add_argument("--quick", action="store_true", help="few lines and rounds: to try it out")
    parser.add_argument("--only", default="", metavar="TEXT", help="only the pairs whose name contains the text")
    parser.add_argument(
        "--processor", action="store_true", help="processor times, where one thread works: for a machine that is busy"
    )
    options = parser.parse_args(arguments)
    clock = time.process_time if options.processor else time.perf_counter
    rounds = options.rounds if options.rounds is not None else QUICK_ROUNDS if options.quick else ROUNDS
    if rounds < 1:
        parser.error(f"--rounds is {rounds}, expected at least 1")
    if options.json:
        try:
            check_target(options.json)
        except OSError as error:
            parser.error(f"--json: {error}")
    share, least = (QUICK_SHARE, 0.0) if options.quick else (1, LEAST_TURN)
    chosen = [pair for pair in all_pairs(share) if options.only in pair.name]
    if not chosen:
        parser.error(f"--only: no pair's name contains {options.only!r}")

    about = machine()
    print(", ".join(f"{key.replace('_', ' ')} {value}" for key, value in about.items()))
    print(f"one process, {rounds} rounds in turns, medians; ratio: reference / ours (cost rows: ours / reference)")
    if options.processor:
        print("processor times where one thread works, else by the clock on the wall")
    if options.quick:
        print("quick: too few lines and rounds for times that mean something")
    print(TITLE)
    rows: list[Row] = []
    for pair in chosen:
        if not rows or rows[-1].pair.subject != pair.subject:
            print(heading(pair))
        rows.append(measure(pair, rounds, least, clock))
        print(line(rows[-1]), flush=True)

    for reason in filter(None, (compiled.skipped(), peers.skipped())):
        print(f"\nskipped: {reason}")

    shared: dict[str, Any] = {"rounds": rounds, "machine": about}
    if any(pair.subject.startswith("identification") for pair in chosen):
        fit = scipy_share(FIT_LINES // share, rounds)
        print(f"\n{describe(fit)}")
        shared["reference_fit_parts_s"] = fit._asdict()
    if options.json:
        content = json.dumps([{**row.as_json(), **shared} for row in rows], indent=2)
        write_whole({options.json: f"{content}\n".encode()})
    return 0


if __name__ == "__main__":
    sys.exit(main())
