"""The protocol of results, and their rendering to terminal, text, HTML and JSON."""

from typing import TYPE_CHECKING

from receptance._lazy import lazily

if TYPE_CHECKING:
    from receptance.report.result import Provenance, Renderable, Result, Results, versions
    from receptance.report.table import Column, Fact, Table

__all__ = ["Column", "Fact", "Provenance", "Renderable", "Result", "Results", "Table", "versions"]

_NAMES = {
    "result": ["Provenance", "Renderable", "Result", "Results", "versions"],
    "table": ["Column", "Fact", "Table"],
}

if not TYPE_CHECKING:  # a type checker is to find misspelt names
    __getattr__, __dir__ = lazily(__name__, _NAMES)
