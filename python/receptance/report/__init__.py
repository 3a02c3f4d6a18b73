"""The protocol of results, and their rendering to terminal, text, HTML and JSON."""

from receptance.report.provenance import Provenance, versions
from receptance.report.result import Renderable, Result, Results
from receptance.report.table import Column, Fact, Table

__all__ = ["Column", "Fact", "Provenance", "Renderable", "Result", "Results", "Table", "versions"]
