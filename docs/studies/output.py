"""Options, plain tables and JSON files of the scripts in this folder."""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from receptance.provenance import versions
from receptance.studies.report import table


def options(description: str | None) -> argparse.ArgumentParser:
    """Return a parser with the options that all scripts have."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", metavar="FILE", type=Path, help="write all results to a JSON file")
    parser.add_argument("--plot", metavar="FILE", type=Path, help="save the figure (png, pdf or svg)")
    parser.add_argument("--seed", type=int, default=0, help="seed of all random numbers")
    return parser


def print_table(title: str, rows: Sequence[Mapping[str, Any]], columns: Mapping[str, str]) -> None:
    """Print a table of dictionaries; for the columns see `receptance.studies.report.table`."""
    title, heads, body = table(title, rows, columns)
    widths = [max(map(len, column)) for column in zip(heads, *body, strict=True)]
    print(f"\n{title}\n")
    for line in [heads, ["-" * width for width in widths], *body]:
        cells = [
            text.removeprefix("<").ljust(width) if head.startswith("<") else text.rjust(width)
            for text, width, head in zip(line, widths, heads, strict=True)
        ]
        print("  ".join(cells).rstrip())


def save(path: Path | None, results: Mapping[str, Any]) -> None:
    """Write results to a JSON file with the versions of the software; keys that begin with _ are left out."""
    if path is not None:
        document = plain({**results, "versions": versions()})
        path.write_text(json.dumps(document, indent=1, allow_nan=False) + "\n", encoding="utf-8")


def plain(value: Any) -> Any:
    """Return a value as JSON holds it; a number that is not finite is None."""
    if is_dataclass(value) and not isinstance(value, type):
        return plain(asdict(value))
    if isinstance(value, Mapping):
        return {str(key): plain(inner) for key, inner in value.items() if not str(key).startswith("_")}
    if isinstance(value, (np.ndarray, np.generic)):
        return plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [plain(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
