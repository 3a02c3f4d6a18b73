"""Shared functions of figures, which are returned, not shown.

Modules of figures import matplotlib; they are loaded when a figure is drawn (`Renderable.plotted_by`).
"""

from __future__ import annotations

import io
import re
import textwrap
import warnings
from html import escape
from typing import Any, Literal

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure, SubFigure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.text import Text
from matplotlib.ticker import FuncFormatter, MaxNLocator, NullLocator
from numpy.typing import NDArray

from receptance._text import printable
from receptance.report.colours import BAD, BAND, COLOURS, INK, PALE
from receptance.report.rejection import ACCEPTED, Rejection

_GRID = "#E6E6E6"
_PADDING = 0.08
"""Distance between panels, titles and the edge of a figure in inches."""
_LETTERS_PER_INCH = 14.0
"""Letters of 9 points per inch."""
_POWER = "$\\mathdefault{"
"""Prefix of the labels that matplotlib writes at logarithmic axes."""


class ShownFigure(Figure):
    """A figure that a notebook shows without a magic command of matplotlib, which would register figures."""

    def _repr_png_(self) -> bytes:
        return as_image(self, "png", self.dpi)


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure without window and global state, of a size in inches."""
    layout = ConstrainedLayoutEngine(w_pad=_PADDING, h_pad=_PADDING)
    return ShownFigure(figsize=(width, height), layout=layout, facecolor="white")


def surface(ax: Axes | None, width: float, height: float) -> Figure | SubFigure:
    """Return an empty figure, or a subfigure in place of axes, for one or several panels.

    Axes that were created with `subplots` or `add_subplot` are replaced; others are a ValueError. Without axes the
    figure is a new one, of a size in inches.
    """
    if ax is None:
        return new_figure(width, height)
    place = ax.get_subplotspec()
    if place is None:
        raise ValueError("plot: ax is not part of a grid; create it with `figure.subplots()` or `plt.subplots()`")
    parent = ax.figure
    ax.remove()
    subfigure = parent.add_subfigure(place)
    subfigure.set_facecolor("none")
    return subfigure


def panels(figure: Figure | SubFigure, count: int, columns: int, **options: Any) -> list[Axes]:
    """Return axes in a grid; unused cells of the last row stay empty.

    Options are keyword arguments of `Figure.subplots`, such as `sharex`.
    """
    grid = figure.subplots(-(-count // columns), columns, squeeze=False, **options)
    axes = [cell for row in grid for cell in row]
    for empty in axes[count:]:
        empty.set_visible(False)
    return axes[:count]


_REASONS = 2
"""Number of reasons of each kind in a title; a figure has room for few."""


def finished(figure: Figure | SubFigure, rejection: Rejection = ACCEPTED) -> Figure:
    """Return the whole figure, with the rejection of its numbers as the first lines of its title.

    Its texts have names of users, in which dollar signs mark no formulas.
    """
    if rejection:
        width = int(_LETTERS_PER_INCH * figure.bbox.width / figure.get_dpi())
        texts = []
        for heading, reasons in rejection.headed():
            rest = len(reasons) - _REASONS
            texts += [f"{heading}.", *reasons[:_REASONS], *([f"{rest} more reasons in the text."] if rest > 0 else [])]
        lines = [textwrap.fill(text.replace("`", ""), width) for text in texts]
        title = figure.get_suptitle()
        figure.suptitle("\n".join([*lines, *filter(None, [title])]), x=0.01, ha="left", fontsize=9, color=BAD)
    for artist in figure.findobj(Text):
        assert isinstance(artist, Text)
        text = artist.get_text()
        if not text.startswith(_POWER):
            artist.set_text(printable(text))
            artist.set_parse_math("$" not in text)
    whole = figure if isinstance(figure, Figure) else figure.figure
    assert isinstance(whole, Figure)
    return whole


def title_left(figure: Figure | SubFigure, text: str, size: float = 13.0) -> None:
    """Add a title at the left of a figure or subfigure."""
    figure.suptitle(text, x=0.01, ha="left", fontsize=size, color=INK)


def set_up(axes: Axes, title: str, x: str = "", y: str = "", *, grid: Literal["x", "y", "both", "none"] = "y") -> None:
    """Set title, labels and grid lines of axes, and remove the upper and the right part of the frame."""
    axes.set_title(title, loc="left", fontsize=11, fontweight="bold", color=INK)
    axes.set_xlabel(x, color=INK)
    axes.set_ylabel(y, color=INK)
    axes.tick_params(labelsize=9, colors=INK)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    axes.grid(visible=False)
    if grid != "none":
        axes.grid(visible=True, axis=grid, color=_GRID, linewidth=0.8)
    axes.set_axisbelow(True)


def add_legend(place: Axes | Figure | SubFigure, *entries: Any, **options: Any) -> None:
    """Add a legend without frame to axes, or to a figure: then below the axes; options as in `matplotlib`."""
    if not isinstance(place, Axes):
        options = {"loc": "outside lower center", **options}
    place.legend(*entries, **{"frameon": False, "fontsize": 9, **options})


def plain_ticks(axis: Axis) -> None:
    """Use a few plain numbers along a logarithmic axis with a small range."""
    axis.set_major_locator(MaxNLocator(nbins=4, steps=[1, 2, 5, 10]))
    axis.set_minor_locator(NullLocator())
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.4g}"))


def label_point(
    axes: Axes,
    text: str,
    point: tuple[float, float],
    *,
    left: bool = False,
    offset: tuple[float, float] = (7.0, 0.0),
    colour: str = INK,
) -> None:
    """Write a text to the left or to the right of a point, with horizontal and vertical distances in points."""
    axes.annotate(
        text,
        point,
        xytext=(-offset[0] if left else offset[0], offset[1]),
        textcoords="offset points",
        ha="right" if left else "left",
        fontsize=8.5,
        color=colour,
        bbox={"boxstyle": "round,pad=0.15", "fc": "white", "ec": "none", "alpha": 0.75},
    )


def phase_line(
    lines: NDArray[np.float64], values: NDArray[np.inexact], lowest: float = -180.0
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return lines and phases in degrees, from `lowest` over a full turn, with a gap at each jump by a turn."""
    phase = (np.degrees(np.angle(values)) - lowest) % 360.0 + lowest
    jumps = np.flatnonzero(np.abs(np.diff(phase)) > 180.0) + 1
    return np.insert(lines, jumps, np.nan), np.insert(phase, jumps, np.nan)


def set_up_phase(axes: Axes, lowest: float, x: str = "") -> None:
    """Set labels, ticks and limits of axes for phases in degrees over a full turn."""
    set_up(axes, "", x, "phase (°)")
    axes.set_yticks([-180, -90, 0, 90, 180])
    axes.set_ylim(lowest - 5.0, lowest + 365.0)


def as_image(figure: Figure, kind: str, dpi: float = 150.0) -> bytes:
    """Return the content of an image file in one of `image_formats`, such as "png"."""
    buffer = io.BytesIO()
    with warnings.catch_warnings():
        # Names of users may have signs that the font lacks; a box is drawn for them.
        warnings.filterwarnings("ignore", message="Glyph", category=UserWarning)
        figure.savefig(buffer, format=kind, dpi=dpi)
    return buffer.getvalue()


_ROLES = {
    "#000000": "ink",
    INK.lower(): "ink",
    PALE.lower(): "pale",
    _GRID.lower(): "grid",
    "#ffffff": "paper",
    COLOURS[1].lower(): "before",
    COLOURS[2].lower(): "after",
    BAND.lower(): "band",
    BAD.lower(): "bad",
}
"""Names of the colours in a page, which has values of them for a light and a dark background."""
_COLOUR = re.compile("|".join(map(re.escape, _ROLES)), re.IGNORECASE)
_DECIMALS = re.compile(r"(-?\d+\.\d)\d+")


def as_svg(figure: Figure, title: str) -> str:
    """Return a figure of `new_figure` as SVG to be part of an HTML page.

    Text remains text, colours are variables of the page (`--ink`, `--before` and so on), and coordinates have one
    decimal, a tenth of a point, which keeps the page small. The title names the figure for readers who do not see it.

    Examples
    --------
    >>> from receptance.report.figure import as_svg, new_figure
    >>> figure = new_figure(2.0, 1.0)
    >>> _ = figure.subplots().plot([1.0, 2.0], color="#222222")
    >>> text = as_svg(figure, "a < b")
    >>> text[:39], "<title>a &lt; b</title>" in text, "var(--ink)" in text, "script" in text
    ('<svg class="figure" role="img" viewBox=', True, True, False)
    """
    buffer = io.StringIO()
    # The salt makes the names of markers and clipping paths of each figure of a page different ones.
    options: dict[Any, Any] = {
        "svg.fonttype": "none",
        "svg.hashsalt": title,
        "font.family": "sans-serif",
        "path.simplify_threshold": 0.4,
    }
    nothing = dict.fromkeys(("Date", "Creator", "Format", "Type"))
    with mpl.rc_context(options):
        figure.savefig(buffer, format="svg", metadata=nothing, facecolor="none")
    text = buffer.getvalue()
    size = re.search(r'viewBox="[^"]*"', text)
    assert size is not None
    body = text[text.index("<defs>") :]
    body = re.sub(r'<g id="[^"]*"', "<g", body)
    body = re.sub(r' d="[^"]*"', lambda match: _DECIMALS.sub(r"\1", match[0]).replace("\n", ""), body)
    body = _COLOUR.sub(lambda match: f"var(--{_ROLES[match[0].lower()]})", body)
    return f'<svg class="figure" role="img" {size[0]}><title>{escape(printable(title))}</title>{body}'


def image_formats() -> tuple[str, ...]:
    """Return the names of the formats in which figures can be saved."""
    return tuple(sorted(Figure().canvas.get_supported_filetypes()))
