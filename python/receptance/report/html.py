"""Results as HTML, for notebooks and reports."""

from __future__ import annotations

import base64
import re
from html import escape
from typing import TYPE_CHECKING

from receptance._text import printable
from receptance.report.figure import as_image

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from matplotlib.figure import Figure

    from receptance.report.result import Renderable
    from receptance.report.table import Fact, Table

_CODE = re.compile("`([^`]+)`")

__all__ = ["as_html", "content_html", "facts_html", "shown", "table_html"]


def as_html(content: Renderable, figure: Figure | None = None) -> str:
    """Return a result or another renderable as an HTML fragment, with a figure below its title."""
    parts = [f"<p><b>{shown(content.title)}</b></p>"]
    if figure is not None:
        # In an image of its own: names inside several drawings of one page must not meet.
        drawing = base64.b64encode(as_image(figure, "svg")).decode()
        alternative = escape(printable(content.title), quote=True)
        parts.append(f'<img alt="{alternative}" style="max-width: 100%" src="data:image/svg+xml;base64,{drawing}">')
    return "\n".join([*parts, *content_html(content)])


def content_html(content: Renderable) -> list[str]:
    """Return warnings, findings, tables, next step and notes as parts of a page."""
    texts = [*filter(None, [content.description]), *content.sentences()]
    parts = _list("Advice", content.warnings())
    parts += facts_html(content.facts()), *(f"<p>{shown(text)}</p>" for text in texts)
    parts += [table_html(table) for table in content.tables()]
    parts += [f"<p><b>Next step</b>: {shown(content.next_step)}</p>"] if content.next_step else []
    parts += _list("Notes", content.grouped_notes())
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


def table_html(table: Table) -> str:
    """Return a table as HTML, with text aligned left and numbers aligned right.

    Each cell has the heading of its column, with which a narrow page shows every row as a list.
    """
    sides = ["left" if isinstance(column, str) else "right" for column in table.columns]
    head = "".join(_cell("th", text, side) for text, side in zip(table.headings, sides, strict=True))
    rows = (
        "".join(_cell("td", *cell) for cell in zip(row, sides, table.headings, strict=True)) for row in table.texts()
    )
    body = "".join(f"<tr>{row}</tr>" for row in rows)
    note = f"<p>{shown(table.note)}</p>" if table.note else ""
    caption = f"<caption>{shown(table.title)}</caption>" if table.title else ""
    return f"<table>{caption}<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>{note}"


def _cell(tag: str, text: str, side: str, heading: str = "") -> str:
    label = f' data-label="{escape(printable(heading.replace(chr(10), " ")))}"' if heading else ""
    return f'<{tag} style="text-align: {side}"{label}>{shown(text)}</{tag}>'


def _list(title: str, texts: Iterable[str]) -> list[str]:
    # Indented texts belong to the one above.
    items = "".join(
        f'<li style="margin-left: 1.5em">{shown(text[2:])}</li>' if text.startswith("  ") else f"<li>{shown(text)}</li>"
        for text in texts
    )
    return [f"<p>{title}</p><ul>{items}</ul>"] if items else []


def shown(text: str) -> str:
    """Return a text as HTML, with control characters escaped, and words between backticks as code."""
    return _CODE.sub(r"<code>\1</code>", escape(printable(text))).replace("\n", "<br>")
