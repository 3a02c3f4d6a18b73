"""Shared parts of all figures; matplotlib is loaded when one is drawn, and figures are returned, not shown."""

from __future__ import annotations

import functools
import io
from typing import TYPE_CHECKING, Any

from receptance._text import printable

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

__all__ = [
    "BAD",
    "COLOURS",
    "INK",
    "PALE",
    "as_image",
    "finished",
    "image_formats",
    "keep_clear",
    "new_figure",
    "set_up",
    "surface",
    "title_left",
]

# Okabe and Ito's colours, which most people with a colour deficiency can tell apart.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00")
INK = "#222222"
PALE = "#9A9A9A"
BAD = "#B2182B"
_POWER = "$\\mathdefault{"
"""Beginning of the labels that matplotlib writes at logarithmic axes."""


def new_figure(width: float, height: float, *, math: bool = False) -> Figure:
    """Return an empty figure that belongs to no window and no global state; inches.

    Its texts are shown as they are written: titles and names are those of people, and dollar signs in them are no
    formulas. With `math` they are formulas.
    """
    from matplotlib.figure import Figure

    kind = Figure if math else _literal_figure()
    return kind(figsize=(width, height), layout="constrained", facecolor="white")


def surface(ax: Axes | None, width: float, height: float) -> Figure | SubFigure:
    """Return an empty figure, or the place of axes in their figure, for one panel or several.

    Parameters
    ----------
    ax : Axes or None
        Axes that were created with `subplots` or `add_subplot`; they are replaced. None for a new figure.
    width, height : float
        Size of a new figure in inches.

    Raises
    ------
    ValueError
        Axes that have no place in a grid.
    """
    if ax is None:
        return new_figure(width, height)
    place = ax.get_subplotspec()
    if place is None:
        raise ValueError("plot: ax has no place in a grid; create it with `figure.subplots()` or `plt.subplots()`")
    parent = ax.figure
    ax.remove()
    found = parent.add_subfigure(place)
    found.set_facecolor("none")
    return found


def finished(figure: Figure | SubFigure) -> Figure:
    """Return the whole figure; texts with dollar signs in a part of somebody's figure are no formulas."""
    from matplotlib.figure import Figure
    from matplotlib.text import Text

    if isinstance(figure, Figure):
        return figure
    for artist in figure.findobj(Text):
        assert isinstance(artist, Text)
        text = artist.get_text()
        if "$" in text and not text.startswith(_POWER):
            artist.set_parse_math(False)
    whole = figure.figure
    assert isinstance(whole, Figure)
    return whole


def title_left(figure: Figure | SubFigure, text: str, size: float = 13.0) -> None:
    """Give a figure or a part of one a title, for which room is made."""
    figure.suptitle(text, x=0.01, ha="left", fontsize=size, color=INK)


@functools.cache
def _literal_figure() -> type[Figure]:
    from matplotlib.figure import Figure
    from matplotlib.text import Text

    class LiteralFigure(Figure):
        """A figure without formulas, but for the powers of ten that matplotlib writes at logarithmic axes."""

        def draw(self, renderer: Any) -> None:
            for artist in self.findobj(Text):
                text = artist.get_text()
                if not text.startswith(_POWER):
                    shown = printable(text)
                    if shown != text:
                        artist.set_text(shown)
                    if "$" in text:
                        artist.set_parse_math(False)
            super().draw(renderer)

    return LiteralFigure


def keep_clear(figure: Figure, top: float) -> None:
    """Keep the panels below a height, from 0 to 1, so that there is room for titles."""
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    figure.set_layout_engine(ConstrainedLayoutEngine(rect=(0.0, 0.0, 1.0, top), w_pad=0.08, h_pad=0.08))


def set_up(axes: Axes, title: str, x: str = "", y: str = "") -> None:
    """Give axes a title on the left, labels, and no frame where nothing ends."""
    axes.set_title(title, loc="left", fontsize=11, fontweight="bold", color=INK)
    axes.set_xlabel(x, color=INK)
    axes.set_ylabel(y, color=INK)
    axes.tick_params(labelsize=9, colors=INK)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    axes.grid(visible=True, axis="y", color="#E6E6E6", linewidth=0.8)
    axes.set_axisbelow(True)


def as_image(figure: Figure, kind: str) -> bytes:
    """Return the figure as the content of a file of some format: png, pdf, svg and so on."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format=kind, dpi=150)
    return buffer.getvalue()


def image_formats() -> tuple[str, ...]:
    """Names of the formats that a figure can be saved in."""
    from matplotlib.figure import Figure

    return tuple(sorted(Figure().canvas.get_supported_filetypes()))
