"""Colours, themes and small pieces of HTML that all views of a page share."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from importlib import resources
from typing import Any

from bokeh.models import Button, CustomJS, Div
from bokeh.plotting import figure
from bokeh.themes import Theme

from receptance.report.figure import COLOURS

MEASURED, MODEL, DIFFERENCE, UNUSED = "#7F7F7F", COLOURS[0], COLOURS[1], "#BDBDBD"
"""Colours of curves, safe for colour-blind readers (Okabe and Ito) on light and dark."""
_DARK = {
    "paper": "#15191C",
    "panel": "#1D2327",
    "ink": "#E8E8E8",
    "pale": "#3A434A",
    "accent": "#56B4E9",
    "on": "#0B1216",
}
_LIGHT = {
    "paper": "#FFFFFF",
    "panel": "#F5F7F8",
    "ink": "#16191B",
    "pale": "#D8DDE0",
    "accent": "#0B5394",
    "on": "#FFFFFF",
}


def palette(dark: bool) -> dict[str, str]:
    """Return the colours of a page by what they colour."""
    return _DARK if dark else _LIGHT


def theme(dark: bool) -> Theme:
    """Return the theme of figures."""
    c = palette(dark)
    axis = {
        "axis_line_color": c["pale"], "major_tick_line_color": c["pale"], "minor_tick_line_color": None,
        "major_label_text_color": c["ink"], "axis_label_text_color": c["ink"], "axis_label_text_font_style": "normal",
    }  # fmt: skip
    return Theme(
        json={
            "attrs": {
                "figure": {
                    "background_fill_color": c["panel"],
                    "border_fill_color": c["paper"],
                    "outline_line_color": None,
                },
                "Grid": {"grid_line_color": c["pale"], "grid_line_alpha": 0.6},
                "Axis": axis,
                "Title": {"text_color": c["ink"], "text_font_size": "13px"},
                "Legend": {
                    "background_fill_alpha": 0.6, "background_fill_color": c["panel"], "label_text_color": c["ink"],
                    "border_line_color": None, "label_text_font_size": "12px", "padding": 3, "spacing": 1,
                },
            }
        }
    )  # fmt: skip


def template() -> str:
    """Return the page around the views."""
    return resource("page.html")


def labels() -> CustomJS:
    """Return the script that names sliders, curves and tabs for screen readers, and gives tabs their keys."""
    return CustomJS(code=resource("labels.js"))


def resource(name: str) -> str:
    """Return the text of a file of this package."""
    return (resources.files("receptance.app") / name).read_text(encoding="utf-8")


def curve_figure(title: str, x: str, y: str, height: int = 220, **options: Any) -> Any:
    """Return an empty figure of curves over a common axis, with wheel and box zoom along x."""
    made = figure(
        title=title, x_axis_label=x, y_axis_label=y, height=height, sizing_mode="stretch_width",
        tools="xpan,xwheel_zoom,xbox_zoom,reset,save", active_drag="xbox_zoom", **options,
    )  # fmt: skip
    made.toolbar.logo = None
    made.toolbar.autohide = True
    return made


def text(html: str = "", *, role: str = "", classes: Sequence[str] = ()) -> Div:
    """Return a piece of HTML; what is not ours has to be escaped before."""
    attributes = {"role": role, "aria-live": "polite"} if role else {}
    return Div(text=html, html_attributes=attributes, css_classes=list(classes), sizing_mode="stretch_width")


def status() -> Div:
    """Return a line that a screen reader reads when it changes."""
    return text(role="status", classes=["status"])


INPUT = """.bk-input { background: var(--panel); color: var(--ink); border-color: var(--pale); }
.bk-input::placeholder { color: var(--ink); opacity: 0.65; } label { white-space: normal; }"""
"""Style of inputs with long labels, on light and dark."""


def button(label: str, call: Any, *, primary: bool = False, width: int = 110) -> Button:
    """Return a button."""
    made = Button(label=label, button_type="primary" if primary else "default", width=width)
    made.on_click(call)
    return made


def items(lines: Iterable[str]) -> str:
    """Return texts as a list, escaped."""
    # Indented texts belong to the one above, as in `Result.grouped_notes`.
    inner = "".join(
        f'<li style="margin-left: 1.5em">{escape(line[2:])}</li>'
        if line.startswith("  ")
        else f"<li>{escape(line)}</li>"
        for line in lines
    )
    return f"<ul>{inner}</ul>" if inner else ""


def rows(head: Sequence[str], body: Iterable[Sequence[str]], *, caption: str = "") -> str:
    """Return a table, escaped."""
    heads = "".join(f'<th scope="col">{escape(cell)}</th>' for cell in head)
    lines = "".join(f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in line)}</tr>" for line in body)
    title = f"<caption>{escape(caption)}</caption>" if caption else ""
    return f"<table>{title}<thead><tr>{heads}</tr></thead><tbody>{lines}</tbody></table>"
