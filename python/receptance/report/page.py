"""Results as one HTML file that needs no network: a page is legible on a phone, on paper and on a dark background."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from datetime import date
from importlib import resources
from typing import TYPE_CHECKING

from receptance.report.figure import as_svg
from receptance.report.html import content_html, shown, table_html

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from receptance.report.result import Result
    from receptance.report.table import Table

__all__ = ["html_page", "meta", "result_page", "wide_figure"]

_POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:"


def html_page(heading: str, parts: Iterable[str]) -> str:
    """Return an HTML page with a title and these parts, without scripts."""
    style = resources.files(__package__).joinpath("style.css").read_text(encoding="utf-8")
    head = (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">\n<title>{shown(heading)}</title>\n'
        f"<style>\n{style}</style>\n</head>\n"
    )
    return f"{head}<body>\n" + "\n".join(filter(None, parts)) + "\n</body>\n</html>\n"


def meta(result: Result, *more: str) -> str:
    """Return date, campaign file and version of a result, and more, as a line below the heading."""
    origin = result.provenance
    about = [date.today().isoformat(), *filter(None, [origin.file]), f"receptance {origin.versions['receptance']}"]
    return f'<p class="meta">{shown(" · ".join([*about, *more]))}</p>'


def wide_figure(figure: Figure, title: str) -> str:
    """Return a figure in the width of the page; on a narrow screen it scrolls, so that its text stays legible."""
    least = 72.0 * float(figure.get_size_inches()[0])
    return f'<figure class="wide" style="--least: {least:.0f}px">{as_svg(figure, title)}</figure>'


def result_page(result: Result, title: str = "", measured: Sequence[Table] = ()) -> str:
    """Return a result as a page: figure, warnings, findings, tables and notes, and the tables of its data."""
    heading = title or result.title
    return html_page(
        heading,
        [
            f"<header><h1>{shown(heading)}</h1>{meta(result)}</header>",
            wide_figure(result.plot(), heading),
            *content_html(result),
            *(["<h2>Data</h2>", *(table_html(table) for table in measured)] if measured else []),
        ],
    )
