"""Notebooks of the gallery's examples, for download."""

from __future__ import annotations

import ast
import json
from typing import Any

__all__ = ["notebook"]


def notebook(page: str, script: str) -> str:
    """Return a Jupyter notebook with the text of a page and the code of its script, one cell for each paragraph.

    Parameters
    ----------
    page : str
        Markdown; its code blocks are left out.
    script : str
        Python that begins with a docstring and makes a `figure`.
    """
    lines = script.splitlines()
    cells = [_cell("markdown", page.partition("```")[0]), _cell("code", "%matplotlib inline")]
    _, *statements = ast.parse(script).body
    begin = statements[0].lineno - 1
    for before, after in zip(statements, [*statements[1:], None], strict=True):
        if after is None or not lines[after.lineno - 2].strip():
            cells.append(_cell("code", "\n".join(lines[begin : before.end_lineno])))
            begin = before.end_lineno or 0
    cells.append(_cell("code", "figure"))
    for number, cell in enumerate(cells):
        cell["id"] = f"cell-{number}"
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    whole = {"cells": cells, "metadata": {"kernelspec": kernel}, "nbformat": 4, "nbformat_minor": 5}
    return json.dumps(whole, indent=1)


def _cell(kind: str, text: str) -> dict[str, Any]:
    cell = {"cell_type": kind, "metadata": {}, "source": text.strip("\n").rstrip().splitlines(keepends=True)}
    return cell | ({"execution_count": None, "outputs": []} if kind == "code" else {})
