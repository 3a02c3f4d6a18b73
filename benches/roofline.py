"""Floating-point operations of the kernels beside the machine's measured peak: ``python benches/roofline.py``.

The peak is that of the BLAS of NumPy on one thread with a product of large matrices, about the highest of any program.
Times are the least processor times of many calls, which are valid on a busy machine too; those of the chain are slopes
over the lines, without the constant cost of a call. The count of operations is explained at each kernel.
"""

from __future__ import annotations

import os

if __name__ == "__main__":
    os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"

import argparse
import json
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from numpy_reference.cases import ten_segments
from numpy_reference.chain import TipSeries
from pairs.models import Array, chain, sweep
from pairs.sweeps import joints, measured, swept
from receptance import Coordinate, _core
from receptance._files import write_whole

LINES, CANDIDATES, REPEATS, MATRIX = 2_000, 128, 300, 512
# Real operations of a candidate on a line after N and D (a fused multiply-add counts as two): 1/D and N/D; the quotient
# of two squared moduli and its weight; one logarithm and one arctangent as polynomials, with one division for both.
AFTER = {"receptance": 12, "misfit, complex": 9, "misfit, logarithm": 73}
# Columns of N and D, each a fused multiply-add for the real and for the imaginary part of both.
COLUMNS, A_COLUMN = {"elastic": 4, "viscous": 8}, 8


@dataclass(frozen=True)
class Kernel:
    """Measurement of a kernel: nanoseconds, operations and roots, exponentials and the like of one item."""

    name: str
    item: str
    ns: float
    operations: float
    transcendental: str

    @property
    def gflops(self) -> float:
        """Operations per nanosecond."""
        return self.operations / self.ns


def least(call: Callable[[], object], repeats: int, clock: Callable[[], float] = time.process_time) -> float:
    """Return the least seconds of a call, of processor time: what else runs lengthens it little."""
    call()
    taken = []
    for _ in range(repeats):
        began = clock()
        call()
        taken.append(clock() - began)
    return min(taken)


def peak(repeats: int) -> float:
    """Return operations per nanosecond of a product of two large matrices on one thread."""
    a = np.random.default_rng(0).standard_normal((MATRIX, MATRIX))
    out = np.empty_like(a)
    return 2e-9 * MATRIX**3 / least(lambda: np.matmul(a, a, out=out), repeats)


def chains(repeats: int) -> list[Kernel]:
    """Return the ten-segment chain's tip: the slope of the time over the lines, without the constant cost of a call."""
    table = ten_segments()
    few, many = sweep(2_000)[0], sweep(12_000)[0]
    powers = TipSeries(table, sweep(2)[1][-1]).series.powers
    tip = [Coordinate(direction="y"), Coordinate(direction="theta")]

    def taken(f: Array, points: list[Coordinate]) -> float:
        return least(lambda: chain().receptance(f, response=points, excitation=points, threads=1), repeats)

    found = []
    # Functions: one numerator or three, and the denominator; the power is real. Then the reciprocal and the quotients.
    for name, points, functions in (("tip yy", tip[:1], 2), ("tip 2x2", tip, 4)):
        ns = 1e9 * (taken(many, points) - taken(few, points)) / (many.size - few.size) / len(table)
        operations = (4 * powers * functions + 6 + 6 * (functions - 1)) / len(table)
        found.append(Kernel(f"ten-segment chain, {name}", "segment-line", ns, operations, "none"))
    return found


def sweeps(repeats: int) -> list[Kernel]:
    """Return the kernels of sweeps over joints."""
    _, w = sweep(LINES)
    own, data, found = swept(LINES, 1), measured(w), []
    for kind, columns in COLUMNS.items():
        rows = joints(kind, CANDIDATES)
        calls = {
            "receptance": lambda rows=rows: own.receptance(rows),
            "misfit, complex": lambda rows=rows: own.misfit(rows, data, residual="complex"),
            "misfit, logarithm": lambda rows=rows: own.misfit(rows, data),
        }
        for name, call in calls.items():
            ns = 1e9 * least(call, repeats) / (CANDIDATES * LINES)
            what = "1 logarithm, 1 arctangent" if name.endswith("logarithm") else "none"
            title = f"sweep of {kind} joints, {name}"
            found.append(Kernel(title, "candidate-line", ns, A_COLUMN * columns + AFTER[name], what))
    return found


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table, and write it to a file if one is given."""
    parser = argparse.ArgumentParser(description="Operations of the kernels beside the measured peak, one thread.")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the rows to a file")
    parser.add_argument("--quick", action="store_true", help="few repeats: to try it out")
    options = parser.parse_args(arguments)
    repeats = 1 if options.quick else REPEATS
    most = peak(repeats)
    load = f", load {os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else ""
    print(
        f"instruction set {_core.instruction_set()}, one thread{load}; measured peak {most:.1f} Gflop/s (BLAS, dgemm)"
    )
    print(f"{'':<48}{'item':>16}{'ns':>8}{'flop':>7}{'Gflop/s':>9}{'of peak':>9}  roots, exponentials and the like")
    rows = []
    for kernel in [*chains(repeats), *sweeps(repeats)]:
        share = kernel.gflops / most
        print(
            f"{kernel.name:<48}{kernel.item:>16}{kernel.ns:>8.2f}{kernel.operations:>7.0f}{kernel.gflops:>9.1f}"
            f"{100 * share:>8.0f}%  {kernel.transcendental}",
            flush=True,
        )
        rows.append({**asdict(kernel), "gflops": kernel.gflops, "peak_gflops": most, "share_of_peak": share})
    if options.json:
        write_whole({options.json: f"{json.dumps(rows, indent=2)}\n".encode()})
    return 0


if __name__ == "__main__":
    sys.exit(main())
