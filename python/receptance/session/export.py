"""Files of results that a page writes: figures, reports and tables, under names that do not exist yet."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from receptance import report
from receptance._files import new_path, write_whole
from receptance.catalogue.results import file_names
from receptance.report import Result, Table
from receptance.report.csv_text import table_csv

Kind = Literal["svg", "png", "html", "csv"]
"""Figure in vectors or as image, report, or tables."""


def write_result(result: Result, kind: Kind, folder: Path, stem: str, measured: Sequence[Table] = ()) -> list[Path]:
    """Write one kind of content of a result, completely or not at all, and return the new files.

    Parameters
    ----------
    result : Result
        The result.
    kind : {"svg", "png", "html", "csv"}
        What is written; each table is a CSV file of its own.
    folder : Path
        Where.
    stem : str
        Beginning of the names.
    measured : sequence of Table, optional
        Tables of the data for the report.

    Raises
    ------
    OSError
        A file cannot be written.
    ValueError
        The result has no tables.
    """
    contents: dict[Path, bytes] = {}
    if kind == "html":
        contents[new_path(folder, stem, ".html")] = result.to_html(measured=measured).encode()
    elif kind == "csv":
        tables = {table.title: table for table in result.tables()}
        if not tables:
            raise ValueError(f"{result.heading.lower()}: there are no tables")
        for title, name in file_names(tables).items():
            path = new_path(folder, f"{stem}-{name.replace('_', '-').lower()}", ".csv")
            contents[path] = table_csv(tables[title]).encode()
    else:
        contents[new_path(folder, stem, f".{kind}")] = report.figure.as_image(result.plot(), kind)
    write_whole(contents)
    return list(contents)
