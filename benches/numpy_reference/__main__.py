"""Nanoseconds per line of every reference: ``OMP_NUM_THREADS=1 python -m numpy_reference``."""

from __future__ import annotations

import os
import time
from collections.abc import Callable

import numpy as np

from . import (
    BothEndsSeries,
    LogResidual,
    Substructures,
    TipSeries,
    TransferChain,
    identify,
    natural_frequencies,
    segment_receptance,
    tip_by_stiffness,
    tip_receptance,
)
from .cases import GUESS, HIGHEST, JOINT, segment_row, ten_segments, tool_and_holder

LINES = 12_000
REPEATS = 9


def seconds(call: Callable[[], object]) -> tuple[float, float]:
    """Least and median time of a call."""
    call()
    taken = []
    for _ in range(REPEATS):
        began = time.perf_counter()
        call()
        taken.append(time.perf_counter() - began)
    return min(taken), float(np.median(taken))


def report(name: str, call: Callable[[], object], lines: int | None = LINES) -> None:
    """One row of the table: per line when ``lines`` is given, else in milliseconds a call."""
    least, median = (t * 1e9 / lines if lines else t * 1e3 for t in seconds(call))
    print(f"{name:<62}{least:>9.1f}{median:>9.1f}  {'ns/line' if lines else 'ms/call'}")


def main() -> None:
    """Print the table."""
    w = np.linspace(2 * np.pi * 50, HIGHEST, LINES)
    rod = np.array(segment_row(0, 0.125, 0.01, material=(200e9, 7800.0, 0.29, 0.01)))
    chain, (tool, holder) = ten_segments(), tool_and_holder()
    both, tip = np.empty((LINES, 4, 4), complex), np.empty((LINES, 2, 2), complex)
    threads = os.environ.get("OMP_NUM_THREADS", "not set")
    print(f"{f'{LINES} lines, OMP_NUM_THREADS {threads}':<62}{'least':>9}{'median':>9}")
    report("segment 4x4, closed form", lambda: segment_receptance(w, rod, out=both))
    report("segment 4x4, closed form, complex w", lambda: segment_receptance(w - 20j, rod, out=both))
    report("segment 4x4, closed form, fresh output", lambda: segment_receptance(w, rod))
    series = BothEndsSeries(rod[None], HIGHEST)
    report("segment 4x4, series", lambda: series(w, out=both))
    report("segment 4x4, series, with set-up", lambda: BothEndsSeries(rod[None], HIGHEST)(w, out=both))
    whole = TipSeries(chain, HIGHEST)
    report("ten segments, tip, whole-chain series", lambda: whole(w, out=tip))
    report("ten segments, tip, whole-chain series, complex w", lambda: whole(w - 20j, out=tip))
    report("ten segments, tip, whole-chain series, with set-up", lambda: TipSeries(chain, HIGHEST)(w, out=tip))
    report("ten segments, tip, whole-chain series, set-up", lambda: TipSeries(chain, HIGHEST), None)
    for name, merge in (("merged", True), ("each segment", False)):
        transfer = TransferChain(chain, HIGHEST, merge=merge)
        report(f"ten segments, tip, transfer Riccati, {name}", lambda transfer=transfer: transfer(w))
    report("ten segments, tip, transfer Riccati, set-up", lambda: TransferChain(chain, HIGHEST), None)
    report("ten segments, tip, stiffness Riccati, closed form", lambda: tip_by_stiffness(w, chain))
    three = BothEndsSeries(tool, HIGHEST)
    report("three-segment tool 4x4, whole-chain series", lambda: three(w, out=both))
    parts = Substructures(tool, holder, HIGHEST)
    out = (np.empty(LINES, complex), np.empty((LINES, 4), complex))
    report("tool 3 + joint + holder 6, tip", lambda: tip_receptance(w, parts, JOINT, out=out))
    report("tool 3 + joint + holder 6, tip + slopes", lambda: tip_receptance(w, parts, JOINT, True, out=out))
    report(
        "tool 3 + joint + holder 6, tip + slopes, with set-up",
        lambda: tip_receptance(w, Substructures(tool, holder, HIGHEST), JOINT, True, out=out),
    )
    report("tool 3 + joint + holder 6, set-up", lambda: Substructures(tool, holder, HIGHEST), None)
    planes = parts(w)
    report("substructures hoisted, tip", lambda: tip_receptance(w, planes, JOINT, out=out))
    report("substructures hoisted, tip + slopes", lambda: tip_receptance(w, planes, JOINT, True, out=out))
    report("natural frequencies, ten segments, 10 kHz", lambda: natural_frequencies(chain, 1e4), None)
    report("natural frequencies, ten segments, 30 kHz", lambda: natural_frequencies(chain, 3e4), None)
    noise = np.random.default_rng(0).standard_normal((LINES, 2)) @ np.array([0.02, 0.02j])
    measured = tip_receptance(w, planes, JOINT)[0] * np.exp(noise)
    residual, at = LogResidual(w, measured, planes), np.array([7.7, 5.3, 4.6, -0.7])
    report("identification, residual", lambda: residual(at))
    report("identification, Jacobian after it", lambda: residual.jacobian(at))
    for analytic, name in ((True, "analytic"), (False, "2-point")):
        fit = identify(w, measured, tool, holder, GUESS, analytic)
        report(
            f"identification, {name}, nfev {fit.nfev}, njev {fit.result.njev}",
            lambda analytic=analytic: identify(w, measured, tool, holder, GUESS, analytic),
            None,
        )


if __name__ == "__main__":
    main()
