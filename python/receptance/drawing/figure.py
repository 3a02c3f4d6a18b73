"""Figure of a contour to scale: its section, the axis and the centre of gravity."""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from receptance.drawing.report import ContourReport
from receptance.report.colours import COLOURS, INK, PALE
from receptance.report.figure import finished, set_up, surface

_WIDTH = 9.0
"""Width of the figure in inches."""
_FILL = "#C9D3DC"
_MM = 1e3


def draw_contour(report: ContourReport, ax: Axes | None = None) -> Figure:
    """Draw the section of a contour to scale in mm, with the borders of its pieces, bores in white."""
    contour = report.contour
    length, diameter = _MM * contour.length, _MM * contour.largest_diameter
    figure = surface(ax, _WIDTH, min(max(_WIDTH * diameter / length, 1.0), 8.0) + 1.2)
    axes = figure.subplots()
    for piece in contour.pieces:
        x = [_MM * piece.start, _MM * (piece.start + piece.length)]
        outer = [0.5 * _MM * piece.outer_diameter, 0.5 * _MM * piece.end_outer_diameter]
        inner = [0.5 * _MM * piece.inner_diameter, 0.5 * _MM * piece.end_inner_diameter]
        for side in (1.0, -1.0):
            axes.fill_between(x, [side * r for r in inner], [side * r for r in outer], color=_FILL, linewidth=0)
        axes.plot([x[0], x[0]], [-outer[0], outer[0]], color=PALE, linewidth=0.4)
    start = contour.outer[0][0]
    for chain in (contour.outer, *contour.bores):
        x = [_MM * (along - start) for along, _ in chain]
        radius = [0.5 * _MM * across for _, across in chain]
        outline = ([x[0], *x, x[-1]], [0.0, *radius, 0.0])
        for side in (1.0, -1.0):
            axes.plot(outline[0], [side * r for r in outline[1]], color=INK, linewidth=1.0)
    margin = 0.04 * length
    axes.plot([-margin, length + margin], [0.0, 0.0], color=INK, linewidth=0.6, linestyle=(0, (12, 3, 2, 3)))
    axes.plot(_MM * contour.centre_of_gravity, 0.0, marker="o", color=COLOURS[1], linestyle="none")
    axes.annotate(
        f"{report.mass:.3g} kg",
        (_MM * contour.centre_of_gravity, 0.0),
        xytext=(6.0, 6.0),
        textcoords="offset points",
        color=COLOURS[1],
        fontsize=9,
    )
    set_up(axes, report.title, "distance from the tip-side end (mm)", "mm", grid="none")
    axes.set_aspect("equal")
    return finished(figure)
