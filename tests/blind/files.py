"""Files of finished cases, one JSON line each, and shards of a batch."""

from __future__ import annotations

import argparse
import dataclasses
import json
from pathlib import Path
from typing import Any

from blind.outcome import Outcome


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
