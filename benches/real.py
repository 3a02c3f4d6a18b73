"""Effects hidden in real measurements: `python benches/real.py --cases N --seed S [--jobs N] [--only NAME ...]
[--json FILE] [--shard i/n] [--resume FILE] [--budget MIN]`, `--plain`, `--coverage`.

Adds an effect exactly to measured FRFs (nothing in a third of the cases), runs the diagnosis, compares it with the
truth and prints the score table, with exact binomial intervals. The measured files are those of others and are read in
`../shared/measured` beside the checkout; what is absent is skipped with a message. Structures, effects and the rule of
the score are described in `tests/real`. `--plain` prints what the models leave with nothing hidden, and runs no case.
`--coverage` prints how often the 95 % intervals of `transfer` and of verdicts hold natural frequencies and lines that
were not fitted, see `real.coverage`; it runs no case either.
`--only` keeps some structures and effects, for example `--only sensor_mass nothing`. Cases, files and budgets are those
of `benches/blind.py`.
"""

from __future__ import annotations

import os

# One thread each, before NumPy loads the library that would start more.
if __name__ == "__main__":
    os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import argparse
import functools
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

# The laboratory is the package `real` under tests, and this file must not shadow it.
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from blind.files import add_options, append, read, run_batch
from blind.outcome import Outcome
from real.bridge import ask, fit
from real.cases import ANSWERS, DRIVE, PLAN, available, plan
from real.coverage import measure, measure_verdicts, trials
from real.coverage import table as coverage_table
from real.discrepancy import describe, text
from real.outcome import run_case
from real.score import report, table
from real.structures import MEASURED, REFUSED

ABSENT = f"its measured files are not in {MEASURED}"


def main(arguments: list[str] | None = None) -> int:
    """Run, print the table, write JSON if requested."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add_options(parser, cases=20)
    parser.add_argument("--jobs", type=int, default=1, help="processes, each with one thread")
    parser.add_argument(
        "--only",
        nargs="+",
        default=[],
        metavar="NAME",
        choices=["nothing", *ANSWERS, *dict(PLAN)],
        help="structures and effects, or nothing",
    )
    parser.add_argument("--plain", action="store_true", help="what the plain models leave of the records; no case")
    parser.add_argument("--coverage", action="store_true", help="coverage of predictions; no case")
    options = parser.parse_args(arguments)
    if options.coverage:
        coverages = []
        for trial in trials():
            coverages.append(measure(trial))
            if trial.diagnosed:
                coverages.append(measure_verdicts(trial))
        sys.stdout.write(f"{coverage_table(coverages)}\n" if coverages else f"{ABSENT}\n")
        return 0
    if options.plain:
        for structure, left_out in (("modelab", ()), ("modelab", (DRIVE,)), ("brake_reuss", ())):
            found = text(describe(structure, left_out)) if available(structure) else f"{structure}: {ABSENT}"
            sys.stdout.write(f"{found}\n")
        return 0
    run_batch(options, functools.partial(run, options), report, table)
    return 0


def run(options: argparse.Namespace, seed: int) -> list[Outcome]:
    """Return the outcomes of a shard, those that were finished before included."""
    for name, reason in REFUSED.items():
        sys.stdout.write(f"not used: {name}: {reason}\n")
    outcomes = [o for o in read([options.resume]) if o.seed == seed] if options.resume else []
    done = {o.index for o in outcomes}
    own, count = options.shard
    begun = time.perf_counter()
    pending = []
    absent = set()
    for index, structure, effect in plan(options.cases, options.only):
        if index % count != own - 1 or index in done:
            continue
        if available(structure):
            pending.append((index, structure, effect))
        elif structure not in absent:
            absent.add(structure)
            sys.stdout.write(f"skipped: {structure}: {ABSENT}\n")
    one_case = functools.partial(_run, seed, begun + 60.0 * options.budget)
    with ProcessPoolExecutor(options.jobs) if options.jobs > 1 else _Here() as pool:
        for one in pool.map(one_case, pending):
            if one is None:
                sys.stdout.write("the budget is used up\n")
                break
            outcomes.append(one)
            sys.stdout.write(f"{_line(one)}, {one.seconds:.0f} s of {time.perf_counter() - begun:.0f} s\n")
            sys.stdout.flush()
            if options.resume:
                append(options.resume, one)
    return outcomes


class _Here:
    """An executor in this process, so that a budget and an interruption act between cases."""

    map = staticmethod(map)

    def __enter__(self) -> _Here:
        return self

    def __exit__(self, *_: object) -> None:
        pass


def _run(seed: int, end: float, case: tuple[int, str, str]) -> Outcome | None:
    if time.perf_counter() > end:
        return None
    return run_case(seed, *case, ask, fit)


def _line(one: Outcome) -> str:
    effect = one.effects[0] if one.effects else "nothing"
    size = f" {one.sizes[0]:.3g}" if one.sizes else ""
    ratio = f" ratio {one.oracle['ratio']:.1f}" if one.effects else ""
    found = " ".join([one.verdict, *one.reported])
    return (
        f"{one.index:3d} {one.kind} {effect}{size}{ratio} -> {found}, misfit {one.misfit:.3g} to "
        f"{one.misfit_after:.3g}{'  ' + one.error if one.error else ''}"
    )


if __name__ == "__main__":
    sys.exit(main())
