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


def options(description: str | None) -> argparse.ArgumentParser:
    """Return a parser with the options that all scripts have."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", metavar="FILE", type=Path, help="write all results to a JSON file")
    parser.add_argument("--plot", metavar="FILE", type=Path, help="save the figure (png, pdf or svg)")
    parser.add_argument("--seed", type=int, default=0, help="seed of all random numbers")
    return parser


def print_table(title: str, rows: Sequence[Mapping[str, Any]], columns: Mapping[str, str]) -> None:
    """Print a table of dictionaries.

    Parameters
    ----------
    title : str
        Printed above the table.
    rows : sequence of mappings
        One for each row.
    columns : mapping of str to str
        By heading the key of the row and, after a colon, the format of a number: "value:.3g".
    """
    keys = [key.partition(":")[::2] for key in columns.values()]
    body = [[cell(row[key], form) for key, form in keys] for row in rows]
    widths = [max(map(len, column)) for column in zip(columns, *body, strict=True)]
    print(f"\n{title}\n")
    for line in [list(columns), ["-" * width for width in widths], *body]:
        # A column without a format is text and aligned left.
        cells = [
            text.rjust(width) if form else text.ljust(width)
            for text, width, (_, form) in zip(line, widths, keys, strict=True)
        ]
        print("  ".join(cells).rstrip())


def cell(value: Any, form: str) -> str:
    """Return a value as text; a pair is an interval, None or infinity an open end of it."""
    if isinstance(value, (list, tuple)):
        return " to ".join(cell(end, form) or "open" for end in value)
    if isinstance(value, (bool, np.bool_)):
        return "yes" if value else "no"
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    return "open" if isinstance(value, float) and math.isinf(value) else format(value, form)


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
