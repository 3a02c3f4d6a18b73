"""The protocol of results, and their rendering to terminal, text, HTML and JSON."""

from receptance.report.result import Provenance, Renderable, Result, Results
from receptance.report.table import Column, Table

__all__ = ["Column", "Provenance", "Renderable", "Result", "Results", "Table"]
