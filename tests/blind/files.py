"""Batches of cases: their options, shards, files of finished cases with one JSON line each, and the report."""

from __future__ import annotations

import argparse
import dataclasses
import json
import secrets
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from blind.outcome import Outcome


def add_options(parser: argparse.ArgumentParser, cases: int) -> None:
    """Add the options that all batches have; `cases` is the default number of cases."""
    parser.add_argument("--cases", type=int, default=cases)
    parser.add_argument("--seed", type=int, help="by default a new one, which is printed")
    parser.add_argument("--json", type=Path, help="outcomes and table as JSON")
    parser.add_argument("--shard", type=shard, default=(1, 1), metavar="i/n")
    parser.add_argument("--resume", type=Path, help="file of finished cases, which it goes on with")
    parser.add_argument(
        "--budget", type=float, default=float("inf"), metavar="MIN", help="begin no case after these minutes"
    )
    parser.add_argument("--score", type=Path, nargs="+", help="score files of finished cases, run nothing")


def run_batch(
    options: argparse.Namespace,
    run: Callable[[int], list[Outcome]],
    report: Callable[[Sequence[Outcome]], str],
    table: Callable[[Sequence[Outcome]], tuple[Sequence[Any], Sequence[str]]],
) -> None:
    """Run the cases or read finished ones, print their report, and write it as JSON if requested.

    Parameters
    ----------
    options : Namespace
        Those of `add_options`.
    run : callable
        Returns the outcomes of the shard for a seed, those that were finished before included.
    report : callable
        Returns the whole table as text.
    table : callable
        Returns the lines of the score table, and the text below it.
    """
    if options.score:
        outcomes = read(options.score)
    else:
        seed = secrets.randbelow(2**31) if options.seed is None else options.seed
        own, count = options.shard
        sys.stdout.write(f"seed {seed}, {options.cases} cases, shard {own}/{count}\n")
        outcomes = run(seed)
    if not outcomes:
        sys.stdout.write("no case\n")
        return
    seeds = sorted({one.seed for one in outcomes})
    hidden = sum(bool(one.effects) for one in outcomes)
    sys.stdout.write(
        f"seed {', '.join(map(str, seeds))}: {len(outcomes)} cases, {hidden} with something hidden, "
        f"{len(outcomes) - hidden} with nothing\n{report(outcomes)}\n"
    )
    if options.json:
        lines, rest = table(outcomes)
        rows = [{**dataclasses.asdict(line), "interval": line.interval} for line in lines]
        cases = [dataclasses.asdict(one) for one in outcomes]
        document = {"seed": seeds[0] if len(seeds) == 1 else seeds, "lines": rows, "text": rest, "cases": cases}
        options.json.write_text(json.dumps(document, indent=1), encoding="utf-8")


def outcome_from(row: dict[str, Any]) -> Outcome:
    """Return an outcome from a line of a file."""
    names = (
        "effects",
        "sizes",
        "reported",
        "together",
        "same",
        "covered",
        "size_covered",
        "shuffled",
        "within",
        "notes",
    )
    return Outcome(**{name: tuple(v) if name in names else v for name, v in row.items()})


def read(paths: list[Path]) -> list[Outcome]:
    """Return the finished cases of files that exist."""
    rows = [line for path in paths if path.exists() for line in path.read_text(encoding="utf-8").splitlines()]
    found: dict[tuple[int, str, int], Outcome] = {}
    for row in rows:
        try:
            one = outcome_from(json.loads(row))
        except (json.JSONDecodeError, TypeError):
            continue  # the line that an interrupted run was writing
        found[one.seed, one.knowledge, one.index] = one
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
