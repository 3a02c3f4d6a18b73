"""Options, tables, figures and JSON files of the scripts in this folder."""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from functools import reduce
from pathlib import Path
from typing import Any

from rich.console import Console

from receptance.report import Column, Table, terminal, versions
from receptance.report.result import plain

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00")
INK, BAD = "#222222", "#B2182B"
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
    """Print a table of dictionaries.

    By heading, `columns` has the key of a row, with dots for inner dictionaries, and after a colon the format of a
    number. A column without a format is text; a list or a tuple in a row is an interval.
    """
    keys = [key.partition(":")[::2] for key in columns.values()]
    heads = [Column(head, form=form) if form else head for head, (_, form) in zip(columns, keys, strict=True)]
    print()
    terminal.print_table(
        Console(width=WIDTH), Table(title, heads, [[_cell(row, path) for path, _ in keys] for row in rows])
    )


def _cell(row: Mapping[str, Any], path: str) -> Any:
    value = row[path] if path in row else reduce(lambda inner, key: inner[key], path.split("."), row)
    return tuple(value) if isinstance(value, list) else value


def set_up(axes: Any, title: str, x: str = "", y: str = "", *, room: float = 0.0) -> None:
    """Set title, labels and legend of a panel that is drawn, with a share of its height added above for the legend."""
    axes.set_title(title, loc="left", fontsize=10, fontweight="bold")
    axes.set(xlabel=x, ylabel=y)
    axes.spines[["top", "right"]].set_visible(False)
    if room:
        low, high = axes.get_ylim()
        axes.set_ylim(low, high + room * (high - low))
    if axes.get_legend_handles_labels()[0]:
        axes.legend(fontsize=8, frameon=False)


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
