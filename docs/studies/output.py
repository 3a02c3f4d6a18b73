"""Options, tables and JSON files of the scripts in this folder."""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console

from receptance.report import terminal, versions
from receptance.report.result import plain
from receptance.studies.report import table

WIDTH = 150
"""Width of the tables in characters."""


def options(description: str | None) -> argparse.ArgumentParser:
    """Return a parser with the options that all scripts have."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", metavar="FILE", type=Path, help="write all results to a JSON file")
    parser.add_argument("--plot", metavar="FILE", type=Path, help="save the figure (png, pdf or svg)")
    parser.add_argument("--seed", type=int, default=0, help="seed of all random numbers")
    return parser


def print_table(title: str, rows: Sequence[Mapping[str, Any]], columns: Mapping[str, str]) -> None:
    """Print a table of dictionaries; for the columns see `receptance.studies.report.table`."""
    print()
    terminal.print_table(Console(width=WIDTH), table(title, rows, columns))


def save(path: Path | None, results: Mapping[str, Any]) -> None:
    """Write results to a JSON file with the versions of the software; keys that begin with _ are left out."""
    if path is not None:
        document = plain(without_private({**results, "versions": versions()}))
        path.write_text(json.dumps(document, indent=1, allow_nan=False) + "\n", encoding="utf-8")


def without_private(value: Any) -> Any:
    """Return dictionaries and lists without the keys that begin with _."""
    if isinstance(value, Mapping):
        return {key: without_private(inner) for key, inner in value.items() if not str(key).startswith("_")}
    return [without_private(inner) for inner in value] if isinstance(value, (list, tuple)) else value
