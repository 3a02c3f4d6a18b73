"""Colours, themes and small pieces of HTML that all views of a page share."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from importlib import resources
from typing import Any

from bokeh.models import Button, ColumnDataSource, CustomJS, Div, InlineStyleSheet
from bokeh.plotting import figure
from bokeh.themes import Theme

from receptance.report.colours import COLOURS, INK

MEASURED, MODEL, DIFFERENCE = "#7F7F7F", "#2485C7", COLOURS[1]
"""Colours of curves, safe for colour-blind readers (hues of Okabe and Ito), with a contrast of 3 on light and dark."""
_ON_DARK = dict(zip((*COLOURS, INK), ("#6CBDEE", "#F5893F", "#35C79A", "#E7A6CB", "#F0B93A", "#E8E8E8"), strict=True))
"""What is light enough for text on dark, in place of the colours of figures."""
_DARK = {
    "paper": "#15191C",
    "panel": "#1D2327",
    "ink": "#E8E8E8",
    "pale": "#3A434A",
    "edge": "#77828A",
    "unused": "#56606A",
    "soft": "#B4BDC3",
    "accent": "#56B4E9",
    "on": "#0B1216",
    "bad": "#FF9A80",
}
_LIGHT = {
    "paper": "#FFFFFF",
    "panel": "#F5F7F8",
    "ink": "#16191B",
    "pale": "#D8DDE0",
    "edge": "#8A949B",
    "unused": "#BFC4C7",
    "soft": "#565F66",
    "accent": "#0B5394",
    "on": "#FFFFFF",
    "bad": "#A61B1B",
}


def palette(dark: bool) -> dict[str, str]:
    """Return the colours of a page by what they colour."""
    return _DARK if dark else _LIGHT


def readable(colour: str, dark: bool) -> str:
    """Return the colour of a figure, or what is in its place on dark."""
    return _ON_DARK.get(colour, colour) if dark else colour


def theme(dark: bool) -> Theme:
    """Return the theme of figures."""
    c = palette(dark)
    # A notebook has no page around the views that has these.
    variables = "".join(f"--{name}: {colour}; " for name, colour in c.items())
    sheet = InlineStyleSheet(css=f":host {{ {variables} }}\n{resource('widgets.css')}")
    axis = {
        "axis_line_color": c["pale"], "major_tick_line_color": c["pale"], "minor_tick_line_color": None,
        "major_label_text_color": c["ink"], "axis_label_text_color": c["ink"], "axis_label_text_font_style": "normal",
    }  # fmt: skip
    return Theme(
        json={
            "attrs": {
                "LayoutDOM": {"stylesheets": [sheet]},
                "AbstractSlider": {"bar_color": c["accent"]},
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


_IN_RESULTS = """:host { font: 14px/1.45 system-ui, sans-serif; --soft: light-dark(#566573, #a9b4bc);
  --pale: light-dark(#9aa3aa, #7d8890); --grid: light-dark(#dde2e5, #38424a); --before: light-dark(#c4480a, #ff9a57);
  --after: light-dark(#00795a, #35c99c); --band: light-dark(#bbd9ec, #24465c); --good: #1e7d43;
  --open: #8a5a00; --bad: light-dark(#a93226, #e0796e); }
h2 { margin: .8rem 0 .4rem; } td svg.figure { width: 170px; } dl, .rejected { max-width: 1100px; }
.bk-clearfix { width: 100%; } table { display: block; width: fit-content; overflow-x: auto; }
svg.figure { max-width: 1100px; }"""
"""What differs in a page from the style of reports."""


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
    """Return an empty figure of curves over a common axis, by default with wheel and box zoom along x."""
    tools = options.pop("tools", "xpan,xwheel_zoom,xbox_zoom,reset,save")
    made = figure(
        title=title or None, x_axis_label=x or None, y_axis_label=y or None, height=height, tools=tools,
        sizing_mode="stretch_width", active_drag="xbox_zoom" if "xbox_zoom" in tools else None, **options,
    )  # fmt: skip
    made.toolbar.logo = None
    made.toolbar.autohide = True
    return made


def text(html: str = "", *, role: str = "", classes: Sequence[str] = ()) -> Div:
    """Return a piece of HTML; what is not ours has to be escaped before."""
    attributes = {"role": role, "aria-live": "polite"} if role else {}
    return Div(text=html, html_attributes=attributes, css_classes=list(classes), sizing_mode="stretch_width",
               disable_math=True)  # fmt: skip


def result() -> Div:
    """Return a place for HTML in the style of reports."""
    style = resources.files("receptance.report").joinpath("style.css").read_text(encoding="utf-8")
    made = text()
    made.stylesheets = [style, _IN_RESULTS]
    made.js_on_change("text", labels())
    return made


class LiveText:
    """HTML that changes often: the browser changes it in place.

    For a changed `Div` Bokeh lays the whole page out anew, which takes it 100 ms with four records. Text that appears,
    vanishes or has another number of rows needs that.
    """

    _IN_PLACE = "const view = Bokeh.index.find_one(place); if (view) view.markup_el.innerHTML = cb_obj.data.html[0];"

    def __init__(self, *, role: str = "", classes: Sequence[str] = ()) -> None:
        self.layout = text(role=role, classes=classes)
        self.html = ""
        """What is shown."""
        self._changes = ColumnDataSource({"html": [""]})
        self._changes.js_on_change("data", CustomJS(args={"place": self.layout}, code=self._IN_PLACE))
        # What no model of the page refers to is not sent.
        self.layout.js_on_change("visible", CustomJS(args={"changes": self._changes}, code=""))

    def show(self, html: str) -> None:
        """Show HTML; what is not ours has to be escaped before."""
        laid_out, self.html = self.layout.text, html
        if html and laid_out and html.count("<tr") == laid_out.count("<tr"):
            self._changes.data = {"html": [html]}
        else:
            self.layout.text = html


def status() -> LiveText:
    """Return a line that a screen reader reads when it changes; it takes no room while it is empty."""
    made = LiveText(role="status", classes=["status"])
    made.layout.margin = (0, 5, 0, 5)
    return made


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
