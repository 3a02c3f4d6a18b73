"""The blind laboratory: `python benches/blind.py --cases N --seed S [--json FILE] [--shard i/n] [--resume FILE]
[--budget MIN]`.

Hides an effect in every case (none in a third of them), runs the diagnosis, compares it with the truth and prints the
score table, with exact binomial intervals. Every case is drawn anew from the seed and its number, so shards and a
resumed run give the same cases as one long run. The file of `--resume` has one JSON line for each finished case;
several shards are scored together with `--score FILE FILE ...`. Any beginning of the list of cases is a fair mixture,
so `--budget` may end a run early: after so many minutes no case is begun any more, and the table says how many ran.
"""

from __future__ import annotations

import os

# One thread each, before NumPy loads the library that would start more.
if __name__ == "__main__":
    os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import argparse
import dataclasses
import functools
import json
import secrets
import sys
import time
from pathlib import Path
from typing import Any

# The laboratory is the package `blind` under tests, and this file must not shadow it.
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from blind.bridge import ask
from blind.generator import every
from blind.outcome import Outcome, run_case
from blind.score import report, table


def outcome_from(row: dict[str, Any]) -> Outcome:
    """Return an outcome from a line of a file."""
    names = ("effects", "sizes", "reported", "together", "same", "covered", "size_covered", "shuffled")
    return Outcome(**{name: tuple(v) if name in names else v for name, v in row.items()})


def read(paths: list[Path]) -> list[Outcome]:
    """Return the finished cases of files that exist."""
    rows = [line for path in paths if path.exists() for line in path.read_text(encoding="utf-8").splitlines()]
    found = {}
    for row in rows:
        try:
            one = outcome_from(json.loads(row))
        except (json.JSONDecodeError, TypeError):
            continue  # the line that an interrupted run was writing
        found[one.seed, one.index] = one
    return list(found.values())


def append(path: Path, one: Outcome) -> None:
    """Write a finished case to the end of a file; a line that a killed run left open is closed first."""
    begun = path.read_text(encoding="utf-8") if path.exists() else ""
    with path.open("a", encoding="utf-8") as file:
        file.write(("\n" if begun and not begun.endswith("\n") else "") + json.dumps(dataclasses.asdict(one)) + "\n")


def shard(text: str) -> tuple[int, int]:
    """Return `i/n` as two numbers."""
    own, _, count = text.partition("/")
    if not (own.isdigit() and count.isdigit() and 1 <= int(own) <= int(count)):
        raise argparse.ArgumentTypeError(f"the shard is {text!r}, expected i/n with 1 <= i <= n")
    return int(own), int(count)


def main(arguments: list[str] | None = None) -> int:
    """Run, print the table, write JSON if requested."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=30)
    parser.add_argument("--seed", type=int, help="by default a new one, which is printed")
    parser.add_argument("--json", type=Path, help="outcomes and table as JSON")
    parser.add_argument("--shard", type=shard, default=(1, 1), metavar="i/n")
    parser.add_argument("--resume", type=Path, help="file of finished cases, which it goes on with")
    parser.add_argument(
        "--budget", type=float, default=float("inf"), metavar="MIN", help="begin no case after these minutes"
    )
    parser.add_argument("--score", type=Path, nargs="+", help="score files of finished cases, run nothing")
    parser.add_argument("--quick", action="store_true", help="three overhangs and a narrower band")
    parser.add_argument("--threads", type=int, default=1, help="of one diagnosis; shards are the better use of cores")
    options = parser.parse_args(arguments)
    own, count = options.shard
    if options.score:
        outcomes = read(options.score)
        seeds = sorted({one.seed for one in outcomes})
        seed = seeds[0] if len(seeds) == 1 else seeds
        requested = len(outcomes)
    else:
        seed = secrets.randbelow(2**31) if options.seed is None else options.seed
        sys.stdout.write(f"seed {seed}, {options.cases} cases, shard {own}/{count}\n")
        outcomes = run(seed, options, own, count)
        requested = len(range(own - 1, options.cases, count))
    if not outcomes:
        sys.stdout.write("no case\n")
        return 0
    hidden = sum(bool(one.effects) for one in outcomes)
    sys.stdout.write(
        f"seed {seed}: {len(outcomes)} of {requested} cases ran, {hidden} with something hidden, "
        f"{len(outcomes) - hidden} with nothing\n{report(outcomes)}\n"
    )
    if options.json:
        lines, rest = table(outcomes)
        rows = [{**dataclasses.asdict(line), "interval": line.interval} for line in lines]
        document = {"seed": seed, "lines": rows, "text": rest, "cases": [dataclasses.asdict(o) for o in outcomes]}
        options.json.write_text(json.dumps(document, indent=1), encoding="utf-8")
    return 0


def run(seed: int, options: argparse.Namespace, own: int, count: int) -> list[Outcome]:
    """Return the outcomes of a shard, those that were finished before included."""
    outcomes = [o for o in read([options.resume]) if o.seed == seed] if options.resume else []
    done = {o.index for o in outcomes}
    begun = time.perf_counter()
    for index, (kind, effects) in enumerate(every(options.cases)):
        if index % count != own - 1 or index in done:
            continue
        if time.perf_counter() - begun > 60.0 * options.budget:
            sys.stdout.write("the budget is used up\n")
            break
        one = run_case(seed, index, kind, effects, functools.partial(ask, threads=options.threads), quick=options.quick)
        outcomes.append(one)
        sizes = ", ".join(f"{id} {u:.2f}" for id, u in zip(one.effects, one.sizes, strict=True)) or "nothing"
        large = "large" if one.large else "small"
        sys.stdout.write(
            f"{index:4d} {kind:<17} {sizes:<40} {large}  ->  {one.verdict} {', '.join(one.reported)}  misfit "
            f"{one.misfit:.2f} to {one.misfit_after:.2f}, {one.seconds:.0f} s of {time.perf_counter() - begun:.0f} s"
            f"{'  ' + one.error if one.error else ''}\n"
        )
        sys.stdout.flush()
        if options.resume:
            append(options.resume, one)
    return outcomes


if __name__ == "__main__":
    sys.exit(main())
