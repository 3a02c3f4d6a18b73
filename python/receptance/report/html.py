"""Results as HTML: fragments for notebooks, and pages that need no network and are legible on a phone and on paper."""

from __future__ import annotations

import base64
import re
from collections.abc import Iterable, Sequence
from datetime import date
from html import escape
from importlib import resources
from typing import TYPE_CHECKING

from receptance import report
from receptance._text import printable
from receptance.report.rejection import Rejection
from receptance.report.result import PageSection, Renderable, Result
from receptance.report.table import Fact, Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_CODE = re.compile("`([^`]+)`")


def as_html(content: Renderable, figure: Figure | None = None) -> str:
    """Return a result or another renderable as an HTML fragment, with a figure below its title."""
    parts = [f"<p><b>{shown(content.title)}</b></p>", rejection_html(content)]
    if figure is not None:
        # Of many lines a drawing in vectors would be many times as large.
        drawing = base64.b64encode(report.figure.as_image(figure, "png", figure.dpi)).decode()
        alternative = escape(printable(content.title), quote=True)
        parts.append(f'<img alt="{alternative}" style="max-width: 100%" src="data:image/png;base64,{drawing}">')
    return "\n".join(filter(None, [*parts, *content_html(content)]))


def rejection_html(content: Renderable) -> str:
    """Return the rejection of the numbers, for the beginning of a page; empty if there is none."""
    return reasons_html(content.rejection)


def reasons_html(rejection: Rejection) -> str:
    """Return the reasons of a rejection; empty without reasons."""
    items = "".join(part for heading, reasons in rejection.headed() for part in list_html(heading, reasons))
    return f'<div class="rejected">{items}</div>' if items else ""


def content_html(content: Renderable, sections: Sequence[PageSection] = ()) -> list[str]:
    """Return warnings, findings, tables, next step, sections and notes as parts of a page."""
    texts = [*filter(None, [content.description]), *content.sentences()]
    parts = list_html("Advice", content.warnings())
    parts += facts_html(content.facts()), *(f"<p>{shown(text)}</p>" for text in texts)
    parts += [table_html(table) for table in content.tables()]
    parts += [f"<p><b>Next step</b>: {shown(content.next_step)}</p>"] if content.next_step else []
    for section in sections:
        parts += _section_html(section)
    parts += list_html("Notes", content.grouped_notes())
    if content.origin:
        parts.append(f"<p><small>{shown(content.origin)}</small></p>")
    return list(filter(None, parts))


def facts_html(facts: Sequence[Fact]) -> str:
    """Return findings as a list of labels and texts."""
    items = []
    for fact in facts:
        lines = f"<pre>{escape(printable(chr(10).join(fact.lines)))}</pre>" if fact.lines else ""
        items.append(
            f"<dt>{shown(fact.label)}</dt><dd>{''.join(f'<p>{shown(text)}</p>' for text in fact.texts)}{lines}</dd>"
        )
    return f"<dl>{''.join(items)}</dl>" if items else ""


def table_html(table: Table, drawings: Sequence[str] = ()) -> str:
    """Return a table as HTML, with text aligned left and numbers aligned right.

    Each cell has the heading of its column, with which a narrow page shows every row as a list. `drawings` are one for
    each row, as SVG, and stand before its cells.
    """
    sides = ["left" if isinstance(column, str) else "right" for column in table.columns]
    head = "".join(_cell("th", text, side) for text, side in zip(table.headings, sides, strict=True))
    rows = (
        "".join(_cell("td", *cell) for cell in zip(row, sides, table.headings, strict=True)) for row in table.texts()
    )
    before = [f"<td>{drawing}</td>" for drawing in drawings] or [""] * len(table.rows)
    head = f"<td></td>{head}" if drawings else head
    body = "".join(f"<tr>{drawn}{row}</tr>" for drawn, row in zip(before, rows, strict=True))
    note = f"<p>{shown(table.note)}</p>" if table.note else ""
    caption = f"<caption>{shown(table.title)}</caption>" if table.title else ""
    return f"<table>{caption}<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>{note}"


def _cell(tag: str, text: str, side: str, heading: str = "") -> str:
    label = f' data-label="{escape(printable(heading.replace(chr(10), " ")))}"' if heading else ""
    return f'<{tag} style="text-align: {side}"{label}>{shown(text)}</{tag}>'


def list_html(title: str, texts: Iterable[str]) -> list[str]:
    """Return texts as a list with a title, as parts of a page; none without texts."""
    # Indented texts belong to the one above.
    items = "".join(
        f'<li style="margin-left: 1.5em">{shown(text[2:])}</li>' if text.startswith("  ") else f"<li>{shown(text)}</li>"
        for text in texts
    )
    return [f"<p>{title}</p><ul>{items}</ul>"] if items else []


def shown(text: str) -> str:
    """Return a text as HTML, with control characters escaped, and words between backticks as code."""
    return _CODE.sub(r"<code>\1</code>", escape(printable(text))).replace("\n", "<br>")


# Pages ----------------------------------------------------------------------------------------------------------------

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


def wide_figure(figure: Figure, title: str) -> str:
    """Return a figure in the width of the page; on a narrow screen it scrolls, so that its text stays legible."""
    # Two FRFs with their intervals are 16.8 inches wide, and the page on a desktop 1088 px.
    least = 64.0 * float(figure.get_size_inches()[0])
    return f'<figure class="wide" style="--least: {least:.0f}px">{report.figure.as_svg(figure, title)}</figure>'


def result_page(result: Result, title: str = "", measured: Sequence[Table] = ()) -> str:
    """Return a result as a page: key figures, rejection, figure, findings, tables, sections, notes and data."""
    heading, sections = title or result.title, result.sections()
    return html_page(
        heading,
        [
            _header(result, heading),
            rejection_html(result),
            "" if sections else wide_figure(result.plot(), heading),
            *content_html(result, sections),
            *(["<h2>Data</h2>", *(table_html(table) for table in measured)] if measured else []),
        ],
    )


def _header(result: Result, heading: str) -> str:
    """Return title, answer, date, campaign file, version and key figures of a page."""
    origin = result.provenance
    about = [date.today().isoformat(), *filter(None, [origin.file]), f"receptance {origin.versions['receptance']}"]
    badge, tiles = answer_html(result)
    return f'<header><h1>{shown(heading)}</h1>{badge}<p class="meta">{shown(" · ".join(about))}</p>{tiles}</header>'


def answer_html(result: Result) -> tuple[str, str]:
    """Return the answer of a result in one or two words, and its key figures; empty without them."""
    # Values before and after break only beside the arrow: 2.3e-4 has a hyphen.
    tiles = "".join(
        f'<div class="tile"><b>{" → ".join(f"<span>{shown(value)}</span>" for value in values)}</b>'
        f"<span>{shown(name)}</span></div>"
        for name, values in result.key_figures()
    )
    tiles = f'<div class="tiles">{tiles}</div>' if tiles else ""
    badge = f'<p><span class="badge {result.badge}">{result.badge}</span></p>' if result.badge else ""
    return badge, tiles


def _section_html(section: PageSection) -> list[str]:
    figures = "".join(f"<figure>{report.figure.as_svg(figure, title)}</figure>" for title, figure in section.figures)
    return [
        f"<h2>{shown(section.title)}</h2>",
        *(f'<p class="small">{shown(text)}</p>' for text in section.texts),
        f'<div class="figures">{figures}</div>' if figures else "",
        *(table_html(table) for table in section.tables),
    ]
