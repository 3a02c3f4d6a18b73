"""The packaged data files."""

from __future__ import annotations

import csv
import tomllib
from importlib import resources
from typing import Any

Row = dict[str, str]


def read_table(name: str) -> list[Row]:
    """Rows of a packaged CSV file by column; lines that begin with # are remarks."""
    lines = [line for line in _text(name).splitlines() if line.strip() and not line.startswith("#")]
    return list(csv.DictReader(lines))


def read_toml(name: str) -> dict[str, Any]:
    """Content of a packaged TOML file."""
    return tomllib.loads(_text(name))


def number(row: Row, column: str) -> float:
    """Return a cell as a number."""
    return float(row[column])


def number_or_none(row: Row, column: str) -> float | None:
    """Return a cell as a number, or None where it is empty."""
    return float(row[column]) if row[column].strip() else None


def _text(name: str) -> str:
    return (resources.files("receptance.studies") / "data" / name).read_text(encoding="utf-8")
