"""Results as pieces of a page, and the buttons that write them into files."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

from bokeh.layouts import row
from bokeh.models import LayoutDOM

from receptance.app import look
from receptance.report import Result
from receptance.report.html import (
    answer_html,
    facts_html,
    list_html,
    rejection_html,
    shown,
    table_html,
    wide_figure,
)
from receptance.session.export import Kind
from receptance.session.state import Session

_KINDS: dict[str, Kind] = {"Figure": "svg", "Image": "png", "Report": "html", "CSV": "csv"}


def answer(result: Result) -> str:
    """Return the answer of a result: what makes it doubtful first, then findings, key figures and the next step."""
    badge, tiles = answer_html(result)
    parts = [
        f"<h2>{shown(result.heading)}</h2>",
        badge,
        rejection_html(result),
        *list_html("Advice", result.warnings()),
        tiles,
        facts_html(result.facts()),
        *(f"<p>{shown(text)}</p>" for text in result.sentences()),
        f"<p><b>Next step</b>: {shown(result.next_step)}</p>" if result.next_step else "",
    ]
    return "".join(filter(None, parts))


def figure(result: Result) -> str:
    """Return the figure of a result as SVG with its title as alternative text."""
    return wide_figure(result.plot(), result.title)


def details(result: Result, drawings: Sequence[str] = ()) -> str:
    """Return the tables of a result, the first one with drawings of its rows, and the notes."""
    tables = [table_html(table, () if i else drawings) for i, table in enumerate(result.tables())]
    return "".join(
        [*tables, *list_html("Notes", result.grouped_notes()), f"<p><small>{shown(result.origin)}</small></p>"]
    )


def export_buttons(session: Session, result: Callable[[], Result | None], say: Callable[[str], None]) -> LayoutDOM:
    """Return buttons that write figure, report and tables of a result into the folder, and say under which names."""

    def write(kind: Kind) -> None:
        shown_result = result()
        if shown_result is None:
            return
        try:
            say(f"written: {', '.join(path.name for path in session.export(shown_result, kind))}")
        except (OSError, ValueError, TypeError) as error:
            say(str(error))

    return row(*(look.button(label, partial(write, kind), width=80) for label, kind in _KINDS.items()))
