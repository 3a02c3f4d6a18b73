"""Whether the fit of unknown modes together with the joint reaches the best known optimum, and in which time.

The best known optimum is the least cost of all fits of a machine: that of `identify`, and fits with a long budget from
the truth and from starts near it, with as many modes as the records showed. The latter depend on the program as little
as possible, and may be kept in a file.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from machine_laboratory.batch import Row, append_row, finished_and_left, read_rows, run, seed_of, share
from machine_laboratory.generator import Machine, draw_machine, spindle_modes, write

Bounded = dict[str, tuple[float, float, float]]
"""Lower bound, start and upper bound of unknowns by address."""
SAME = 1e-3
"""Relative difference of the cost up to which an optimum is the best known one."""
NEAR = 0.03
"""Standard deviation of the logarithms of starts near the truth; that of frequencies is a third of it."""
BUDGET = 300
"""Evaluations of a fit from near the truth."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of this command."""
    parser.add_argument("--near", type=int, default=2, help="fits from near the truth (default 2; 0: from no start)")
    parser.add_argument("--best", type=Path, metavar="FILE", help="JSON lines of best known costs, read and extended")
    parser.add_argument(
        "--near-limit", type=float, default=900.0, metavar="S", help="processor time of these fits (900)"
    )
    parser.add_argument("--profiles", action="store_true", help="intervals from profile likelihoods")


def main(options: argparse.Namespace) -> int:
    """Run all machines and print a line for each, then the totals."""
    seed = seed_of(options)
    rows, left = finished_and_left(options, seed, profiles=options.profiles)
    for case, result in run(fit, left, jobs=options.jobs, limit=options.limit):
        row = rows[case["index"]] = {**case, **result}
        append_row(options.resume, row)
        _say(f"identified: machine {case['index']}", result)
    every = [rows[i] for i in sorted(rows)]
    best = _best_known(options, seed, every)
    lines = [HEADER, *(_line(row, best.get(row["index"], np.inf)) for row in every), *totals(every, best)]
    sys.stdout.write("\n".join(lines) + "\n")
    return 0


def _say(what: str, result: Row) -> None:
    """Print the cost of a fit, or its failure."""
    cost = f"cost {result['cost']:.2f}" if "cost" in result else result["failure"]
    sys.stdout.write(f"{what}, {cost}\n")
    sys.stdout.flush()


def _best_known(options: argparse.Namespace, seed: int, rows: Sequence[Row]) -> dict[int, float]:
    """Return the least cost of fits from near the truth, of machines for which there is one.

    They have as many modes as the fit of the machine.
    """
    modes = {row["index"]: row.get("number", row["modes"]) for row in rows}
    modes = {index: number for index, number in modes.items() if isinstance(number, int)}
    known: dict[tuple[int, int], float] = {}
    for row in read_rows(options.best):
        if row["seed"] == seed and row["modes"] == modes.get(row["index"]):
            known[row["index"], row["start"]] = row.get("cost", np.inf)
    left = [
        {"seed": seed, "index": i, "modes": number, "threads": options.threads, "start": start}
        for i, number in modes.items()
        for start in range(options.near)
        if (i, start) not in known
    ]
    for case, result in run(fit_near, left, jobs=options.jobs, limit=options.near_limit):
        append_row(options.best, {**case, **result})
        known[case["index"], case["start"]] = result.get("cost", np.inf)
        _say(f"near the truth: machine {case['index']}, start {case['start']}", result)
    least: dict[int, float] = {}
    for (index, _), cost in known.items():
        least[index] = min(cost, least.get(index, np.inf))
    return least


def machine_of(seed: int, index: int) -> Machine:
    """Return a machine of a batch."""
    return draw_machine(int(np.random.SeedSequence([seed, index]).generate_state(1)[0]))


def fit(seed: int, index: int, modes: int | str, threads: int, profiles: bool) -> Row:
    """Identify joint and modes of a machine as a user would."""
    machine = machine_of(seed, index)
    with tempfile.TemporaryDirectory() as folder:
        return _identified(machine, write(machine, Path(folder), modes=modes, settings={"profiles": profiles}), threads)


def fit_near(seed: int, index: int, modes: int, threads: int, start: int) -> Row:
    """Fit from the truth, or from a start near it."""
    machine = machine_of(seed, index)
    settings = {"profiles": False, "starts": 1, "strategy": "direct", "max_evaluations": BUDGET}
    rng = np.random.default_rng([seed, index, start])
    with tempfile.TemporaryDirectory() as folder:
        starts = starts_near_truth(machine, modes, rng if start else None)
        path = write(machine, Path(folder), modes=modes, starts=starts, settings=settings)
        return _identified(machine, path, threads)


def _identified(machine: Machine, path: Path, threads: int) -> Row:
    from receptance import campaign

    loaded = campaign.load(path, threads=threads)
    begun, busy = time.perf_counter(), time.process_time()
    fit = loaded.identify()
    seconds, busy = time.perf_counter() - begun, time.process_time() - busy
    true = {f"joint.{name}": machine.truth[0][f"joint.{name}"] for name in ("k_y", "k_theta")}
    intervals = {address: fit.interval(address) for address in true}
    return {
        "number": sum(name.startswith("spindle.mode[") and name.endswith(".frequency_hz") for name in fit.values),
        # Half of chi-square, with the stated noise.
        "cost": float(min(one.cost for one in fit.starts)),
        "rms": float(fit.rms),
        "converged": bool(fit.converged),
        "seconds": seconds,
        "processor": busy,
        "evaluations": int(sum(one.evaluations for one in fit.starts)),
        "ratio": {address: float(fit.values[address] / value) for address, value in true.items()},
        "inside": {address: bool(low <= true[address] <= high) for address, (low, high) in intervals.items()},
        "width": {address: float((high - low) / true[address]) for address, (low, high) in intervals.items()},
    }


def starts_near_truth(machine: Machine, modes: int, rng: np.random.Generator | None) -> Bounded:
    """Return bounds and starts of joint and modes from the truth, or near it if there is a generator."""
    p, lines = machine.truth[0], machine.records[0].frequency_hz
    rows, rest = spindle_modes(p, modes, lines)
    length = sum(p[name] for name in p if name.startswith("holder.") and name.endswith(".length"))

    def near(value: float, share: float = 1.0) -> float:
        return value if rng is None else value * float(np.exp(NEAR * share * rng.standard_normal()))

    bounds = {"k_y": (1e7, 1e10), "k_theta": (1e3, 1e6), "c_y": (1.0, 1e5), "c_theta": (1e-4, 10.0)}
    found = {f"joint.{name}": (low, near(p[f"joint.{name}"]), high) for name, (low, high) in bounds.items()}
    lowest, highest = 0.25 * float(lines[0]), 4.0 * float(lines[-1])
    reach = 10.0 * float(np.abs(rows[:, 2]).max())
    slope = max(5.0 * reach / length, 2.0 * float(np.abs(rows[:, 3::2]).max()))
    compliance = float(np.sum((rows[:, 2] / (2.0 * np.pi * rows[:, 0])) ** 2))
    for number, (frequency, damping, *shape) in enumerate(rows.tolist()):
        first = f"spindle.mode[{number}]"
        at = near(frequency, 1 / 3)
        found[f"{first}.frequency_hz"] = min(lowest, 0.5 * at), at, max(highest, 1.5 * at)
        found[f"{first}.damping_ratio"] = min(1e-3, 0.5 * damping), near(damping), max(0.3, 2.0 * damping)
        for name, value in zip(("y", "theta", "y_imaginary", "theta_imaginary"), shape, strict=True):
            limit = reach if name.startswith("y") else slope
            found[f"{first}.{name}"] = -limit, near(value), limit
    units = {"residual_y": 1.0, "residual_theta": 1.0 / length**2, "residual_ytheta": 1.0 / length}
    for (name, unit), value in zip(units.items(), rest.tolist(), strict=True):
        limit = max(10.0 * compliance * unit, 2.0 * abs(value))
        found[f"spindle.{name}"] = -limit, near(value), limit
    return found


# The table ------------------------------------------------------------------------------------------------------------

HEADER = "machine modes     cost     best   rms  conv. cpu s    MB  k_theta  width  inside"


def _line(row: Row, best: float) -> str:
    """Return a line of the table."""
    if "failure" in row:
        return f"{row['index']:7d}  {row['failure'][:70]}"
    best = min(best, row["cost"])
    ratio, width, inside = (row[key]["joint.k_theta"] for key in ("ratio", "width", "inside"))
    number = row.get("number", row["modes"])
    return (
        f"{row['index']:7d} {number:>5} {row['cost']:8.1f} {best:8.1f} {row['rms']:5.2f}"
        f"  {_yes(row['converged']):<5} {row['processor']:5.0f} {row['megabytes']:5.0f}"
        f" {ratio:8.4f} {100.0 * width:5.1f}%  {_yes(inside)}"
    )


def _yes(value: bool) -> str:
    return "yes" if value else "no"


def totals(rows: Sequence[Row], best: dict[int, float]) -> list[str]:
    """Return the totals of a batch."""
    ended = [row for row in rows if "failure" not in row]
    reached = [row for row in ended if row["cost"] <= (1.0 + SAME) * best.get(row["index"], np.inf)]
    inside = {name: [row for row in ended if row["inside"][f"joint.{name}"]] for name in ("k_theta", "k_y")}

    lines = [
        share("optimum within 0.1 % of the best", reached, rows, ">= 95 %"),
        share("converged", [row for row in ended if row["converged"]], rows),
        share("k_theta inside its 95 % interval", inside["k_theta"], ended, "90 to 98 %"),
        share("k_y inside its 95 % interval", inside["k_y"], ended),
    ]
    better = sum(row["cost"] < (1.0 - SAME) * best[row["index"]] for row in ended if row["index"] in best)
    lines.append(f"better than the fits from near the truth: {better}; failed: {len(rows) - len(ended)}")
    if ended:
        seconds = [row["processor"] for row in ended]
        memory = max(row["megabytes"] for row in ended)
        lines.append(
            f"processor time median {np.median(seconds):.0f} s, largest {max(seconds):.0f} s; "
            f"peak memory {memory:.0f} MB"
        )
    return lines
