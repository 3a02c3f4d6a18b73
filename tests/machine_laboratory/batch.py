"""Batches of machines: one process for each case with a time limit, and files of finished cases, one JSON line each."""

from __future__ import annotations

import argparse
import json
import math
import multiprocessing
import resource
import secrets
import signal
import sys
import time
import traceback
import warnings
from collections.abc import Callable, Iterator, Sequence
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

from blind.score import Line

PATIENCE = 20
"""Real time until a process is ended, over its limit of processor time."""
Row = dict[str, Any]
Work = Callable[..., Row]


def add_options(parser: argparse.ArgumentParser, cases: int, limit: float) -> None:
    """Add the options that all commands have; `cases` and `limit` are defaults."""
    parser.add_argument("--seed", type=int, help="by default a new one, which is printed")
    parser.add_argument("--cases", type=int, default=cases, help=f"number of machines (default {cases})")
    parser.add_argument("--only", type=int, nargs="+", metavar="N", help="numbers of machines among these")
    parser.add_argument(
        "--modes", type=modes_of, default="auto", metavar="N|auto", help="number of unknown modes of the spindle (auto)"
    )
    parser.add_argument("--jobs", type=int, default=1, help="number of processes (default 1)")
    parser.add_argument("--threads", type=int, default=1, help="threads of each (default 1)")
    parser.add_argument(
        "--limit", type=float, default=limit, metavar="S", help=f"processor time of each (default {limit:g})"
    )
    parser.add_argument(
        "--resume", type=Path, metavar="FILE", help="JSON lines of finished cases, which it goes on with"
    )


def modes_of(text: str) -> int | str:
    return text if text == "auto" else int(text)


def seed_of(options: argparse.Namespace) -> int:
    """Return the seed of a batch: the given one or a new one, and print it."""
    seed = secrets.randbelow(2**31) if options.seed is None else int(options.seed)
    sys.stdout.write(f"seed {seed}, {options.cases} machines, modes: {options.modes}\n")
    sys.stdout.flush()
    return seed


def indices(options: argparse.Namespace) -> list[int]:
    """Return the numbers of the cases of a batch."""
    return [i for i in range(options.cases) if not options.only or i in options.only]


def finished_and_left(options: argparse.Namespace, seed: int, **settings: object) -> tuple[dict[int, Row], list[Row]]:
    """Return the finished cases of a batch by number, and the arguments of those that are left, with these settings."""
    chosen = indices(options)
    rows = {
        row["index"]: row
        for row in read_rows(options.resume)
        if row["seed"] == seed and row["modes"] == options.modes and row["index"] in chosen
    }
    common = {"seed": seed, "modes": options.modes, "threads": options.threads, **settings}
    return rows, [{**common, "index": i} for i in chosen if i not in rows]


def read_rows(path: Path | None) -> list[Row]:
    """Return the finished cases of a file; a line that an interrupted run left open is skipped."""
    if path is None or not path.exists():
        return []
    rows = []
    for line in path.read_text(encoding="utf-8").splitlines():
        try:
            rows.append(json.loads(line))
        except json.JSONDecodeError:
            continue
    return rows


def append_row(path: Path | None, row: Row) -> None:
    """Write a finished case to the end of a file; a line that a killed run left open is closed first."""
    if path is None:
        return
    begun = path.read_text(encoding="utf-8") if path.exists() else ""
    with path.open("a", encoding="utf-8") as file:
        file.write(("\n" if begun and not begun.endswith("\n") else "") + json.dumps(row) + "\n")


def run(work: Work, cases: Sequence[Row], *, jobs: int, limit: float) -> Iterator[tuple[Row, Row]]:
    """Yield each case with its result as cases end; `work` is called with the fields of a case, in its own process.

    The result has the key `failure` if the process raised, died, or exceeded the limit in seconds of processor time, or
    a multiple of it without result. `seconds`, the
    `processor` time in s and `megabytes`, the peak memory of the process, are added to it.
    """
    context = multiprocessing.get_context("spawn")
    waiting = list(cases)[::-1]
    running: dict[Connection, tuple[Row, BaseProcess, float]] = {}
    try:
        while waiting or running:
            while waiting and len(running) < jobs:
                case = waiting.pop()
                receiver, sender = context.Pipe(duplex=False)
                process = context.Process(target=_child, args=(work, case, limit, sender), daemon=True)
                process.start()
                sender.close()
                running[receiver] = case, process, time.monotonic()
            for receiver in [one for one in wait(list(running), timeout=0.5) if isinstance(one, Connection)]:
                case, process, _ = running.pop(receiver)
                try:
                    result = receiver.recv()
                except EOFError:
                    process.join()
                    result = _ended(process.exitcode, limit)
                process.join()
                yield case, result
            for receiver, (case, process, begun) in list(running.items()):
                if time.monotonic() - begun > PATIENCE * limit:
                    process.kill()
                    process.join()
                    del running[receiver]
                    yield case, {"failure": f"no result after {PATIENCE * limit:g} s", "processor": limit}
    finally:
        for _, process, _ in running.values():
            process.kill()


def share(name: str, hits: Sequence[object], trials: Sequence[object], target: str = "") -> str:
    """Return a line of a table: hits of trials, with the exact 95 % interval of the share."""
    if not trials:
        return f"{name:<38} no case  {target}".rstrip()
    line = Line(name, len(hits), len(trials))
    low, high = line.interval
    text = f"{name:<38} {line.hits:3d} of {line.trials:3d} = {100.0 * line.hits / line.trials:3.0f} %"
    return f"{text} ({100.0 * low:.0f} to {100.0 * high:.0f})  {target}".rstrip()


def _ended(code: int | None, limit: float) -> Row:
    """Return the result of a process that ended without one."""
    if code == -signal.SIGXCPU:
        return {"failure": f"more than {limit:g} s", "processor": limit}
    return {"failure": f"the process ended with {code}"}


def _child(work: Work, case: Row, limit: float, sender: Connection) -> None:
    most = math.ceil(time.process_time() + limit)
    resource.setrlimit(resource.RLIMIT_CPU, (most, most + 5))
    # What the program warns of is in its results, which are scored.
    warnings.simplefilter("ignore")
    begun = time.perf_counter()
    try:
        result = work(**case)
    except Exception as error:
        result = {"failure": f"{type(error).__name__}: {error}", "trace": traceback.format_exc(limit=-3)}
    result.setdefault("seconds", time.perf_counter() - begun)
    result.setdefault("processor", time.process_time())
    result["megabytes"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    sender.send(result)
