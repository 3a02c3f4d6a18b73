"""Results as HTML, for notebooks."""

from __future__ import annotations

import base64
from html import escape
from typing import TYPE_CHECKING

from receptance._text import printable
from receptance.report.figure import as_image

if TYPE_CHECKING:
    from collections.abc import Iterable

    from matplotlib.figure import Figure

    from receptance.report.result import Renderable
    from receptance.report.table import Table

__all__ = ["as_html"]


def as_html(content: Renderable, figure: Figure | None = None) -> str:
    """Return a result or another renderable as an HTML fragment, with a figure below its title."""
    texts = [*filter(None, [content.description]), *content.sentences()]
    parts = [f"<p><b>{_shown(content.title)}</b></p>"]
    if figure is not None:
        # In an image of its own: names inside several drawings of one page must not meet.
        drawing = base64.b64encode(as_image(figure, "svg")).decode()
        alternative = escape(printable(content.title), quote=True)
        parts.append(f'<img alt="{alternative}" style="max-width: 100%" src="data:image/svg+xml;base64,{drawing}">')
    parts += [f"<p>{_shown(text)}</p>" for text in texts]
    parts += [_table(table) for table in content.tables()]
    parts += _list("Advice", content.warnings())
    parts += _list("Notes", content.grouped_notes())
    if content.origin:
        parts.append(f"<p><small>{_shown(content.origin)}</small></p>")
    return "\n".join(parts)


def _table(table: Table) -> str:
    """Return a table as HTML, with text aligned left and numbers aligned right."""
    sides = ["left" if isinstance(column, str) else "right" for column in table.columns]
    head = "".join(_cell("th", text, side) for text, side in zip(table.headings, sides, strict=True))
    rows = ("".join(_cell("td", text, side) for text, side in zip(row, sides, strict=True)) for row in table.texts())
    body = "".join(f"<tr>{row}</tr>" for row in rows)
    note = f"<p>{_shown(table.note)}</p>" if table.note else ""
    caption = f"<caption>{_shown(table.title)}</caption>" if table.title else ""
    return f"<table>{caption}<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>{note}"


def _cell(tag: str, text: str, side: str) -> str:
    return f'<{tag} style="text-align: {side}">{_shown(text)}</{tag}>'


def _list(title: str, texts: Iterable[str]) -> list[str]:
    items = "".join(f"<li>{_shown(text)}</li>" for text in texts)
    return [f"<p>{title}</p><ul>{items}</ul>"] if items else []


def _shown(text: str) -> str:
    return escape(printable(text)).replace("\n", "<br>")
