"""Figures of assemblies to scale and of their modes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Polygon

from receptance.model.assembly import Assembly
from receptance.model.modes import ModeShapes
from receptance.model.sketch import Drawing, Sketch, extent
from receptance.report.colours import COLOURS, INK, PALE
from receptance.report.figure import add_legend, finished, panels, set_up, surface, title_left
from receptance.report.table import percent

_WIDTH = 9.0
"""Width of a figure in inches."""
_MARGIN = 0.45
"""Room beside the longest assembly in inches, for labels at its ends."""
_SIZE = 8.5
"""Size of labels in points."""
_THUMBNAIL = 2.0
"""Width of an outline in inches."""
_OVER = 0.03
"""Room at the ends of an outline as a share of its length."""
_MM = 1e3


def draw_assembly(assembly: Assembly, ax: Axes | None = None) -> Figure:
    """Draw an assembly to scale: sections of its parts in mm, joints and attachments."""
    return draw_assemblies([Drawing(assembly)], ax)


def draw_assemblies(drawings: Sequence[Drawing], ax: Axes | None = None, *, title: str = "") -> Figure:
    """Draw assemblies below each other, all to the same scale, in mm from the tip.

    Segments are drawn in section, cones as trapezoids: bores are white, or have the fill of the material in them. Below
    are the lengths of segments and the names of parts, above the diameters (outer/inner, of cones those of both ends)
    and the names of joints, attachments and points of measurement. A part of many segments has its length and the
    diameters of its ends.
    """
    longest = max(extent(drawing.assembly) for drawing in drawings)
    fills: dict[str, str] = {}
    inches = _WIDTH - 2.0 * _MARGIN - 0.3
    scale = longest / inches
    ends = (-_MARGIN * scale, longest + _MARGIN * scale)
    sketches = [Sketch(drawing, scale, ends, fills) for drawing in drawings]
    heights = [sketch.height / scale + 0.75 for sketch in sketches]
    figure = surface(ax, _WIDTH, sum(heights) + 0.6)
    axes = panels(figure, len(sketches), 1, height_ratios=heights, sharex=True)
    for sketch, place in zip(sketches, axes, strict=True):
        _draw(sketch, place)
    axes[-1].set_xlabel("distance from the tip (mm)", color=INK)
    if any(fills):
        patches = [
            Patch(facecolor=fill, edgecolor=INK, linewidth=0.6, label=name) for name, fill in fills.items() if name
        ]
        add_legend(figure, handles=patches, loc="outside lower right", ncols=len(patches))
    if title:
        title_left(figure, title, 11.0)
    return finished(figure)


def draw_outline(assembly: Assembly, length: float, radius: float, width: float = _THUMBNAIL) -> Figure:
    """Draw the beginning of an assembly to scale without labels, such as a tool in its holder.

    `length` is what is drawn from the tip on and `radius` the room beside the axis, both in mm; equal ones give several
    drawings one scale. `width` is in inches.
    """
    over = _OVER * length
    figure = surface(None, width, width * 2.0 * radius / (length + 2.0 * over))
    (axes,) = panels(figure, 1, 1)
    _draw_shapes(Sketch(Drawing(assembly), length / width, (-over, length + over), {}), axes)
    axes.set_ylim(-radius, radius)
    axes.set_axis_off()
    return finished(figure)


def draw_mode_shapes(shapes: ModeShapes, ax: Axes | None = None) -> Figure:
    """Draw the assembly and below it the deflection of each mode, over the distance from the tip."""
    assembly = shapes.assembly
    ends = (-0.03 * extent(assembly), 1.03 * extent(assembly))
    sketch = Sketch(Drawing(assembly), extent(assembly) / (_WIDTH - 2.0 * _MARGIN), ends, {})
    figure = surface(ax, _WIDTH, 1.2 + 1.3 * max(len(shapes), 1))
    outline, *axes = panels(figure, 1 + len(shapes), 1, height_ratios=[1.0, *[1.3] * len(shapes)], sharex=True)
    _draw_shapes(sketch, outline)
    for number, place in enumerate(axes):
        y = shapes.y[number]
        # The phase of the largest deflection; what is left of the imaginary part is due to damping.
        turned = (y * np.conj(y[np.abs(y).argmax()]) / np.abs(y).max()).real
        text = f"{shapes.frequency_hz[number]:.1f} Hz, damping ratio {percent(shapes.damping_ratio[number], 3)}"
        set_up(place, "", "", "y (1/√kg)", grid="none")
        place.set_title(f"{number + 1}: {text}", loc="left", fontsize=9.5, color=INK)
        place.axhline(0.0, color=PALE, linewidth=0.8)
        for index, name in enumerate(dict.fromkeys(shapes.part)):
            points = [point for point, part in enumerate(shapes.part) if part == name]
            colour = COLOURS[index % len(COLOURS)]
            x = _MM * shapes.distance[points]
            place.plot(x, turned[points], color=colour, linewidth=1.6, label=name)
            place.fill_between(x, turned[points], 0.0, color=colour, alpha=0.15, linewidth=0)
    (axes[-1] if axes else outline).set_xlabel("distance from the tip (mm)", color=INK)
    if axes:
        add_legend(axes[0], loc="best")
    return finished(figure)


def _draw(sketch: Sketch, axes: Axes) -> None:
    """Draw everything; the axes have the scale of the sketch."""
    _draw_shapes(sketch, axes)
    set_up(axes, sketch.drawing.title, "", "", grid="none")
    bar = {"arrowstyle": "|-|,widthA=0.18,widthB=0.18", "color": INK, "linewidth": 0.6, "shrinkA": 0, "shrinkB": 0}
    for low, high, y in sketch.spans:
        axes.annotate("", (low, y), (high, y), arrowprops=bar)
    for x, y, kind, colour, _ in sketch.symbols:
        _draw_symbol(sketch, axes, x, y, kind, colour)
    white = {"boxstyle": "square,pad=0.1", "facecolor": "white", "edgecolor": "none"}
    for label in sketch.labels:
        axes.text(
            *label.centre, label.text, ha="center", va="center", fontsize=_SIZE, color=label.colour, bbox=white,
            zorder=6,
        )  # fmt: skip
        if label.leader is not None:
            x, y = label.leader
            axes.plot([x, x], [y, label.centre[1]], color=label.colour, linewidth=0.5, alpha=0.6, zorder=1)
    axes.set_aspect("equal", adjustable="box")
    axes.set_xlim(*sketch.ends)
    axes.set_ylim(sketch.below.end - 0.03 * sketch.scale, sketch.above.end + 0.03 * sketch.scale)
    axes.set_yticks([])
    axes.spines["left"].set_visible(False)
    axes.tick_params(labelbottom=True)


def _draw_shapes(sketch: Sketch, axes: Axes) -> None:
    """Draw the axis, the sections and the joints without labels."""
    set_up(axes, "", "", "", grid="none")
    over = 0.3 * sketch.ends[0]
    axis = ([over, extent(sketch.drawing.assembly) - over], [0.0, 0.0])
    axes.plot(*axis, color=PALE, linewidth=0.6, linestyle=(0, (8, 3, 1, 3)), zorder=3)
    for body in sketch.bodies:
        style = {"facecolor": body.fill, "edgecolor": INK, "linewidth": body.edge, "hatch": body.hatch, "zorder": 2}
        axes.add_patch(Polygon(body.corners(), closed=True, **style))
    for x, length, half, _ in sketch.joints:
        for side in (-half, half) if length else (0.0,):
            ends = ([x, x + length], [side, side]) if length else ([x, x], [-half, half])
            axes.plot(*ends, color=COLOURS[1], linewidth=2.4, zorder=4, solid_capstyle="butt")
    axes.set_xlim(*sketch.ends)
    axes.set_ylim(-1.1 * sketch.radius, 1.1 * sketch.radius)
    axes.set_yticks([])
    axes.spines["left"].set_visible(False)


def _draw_symbol(sketch: Sketch, axes: Axes, x: float, y: float, kind: str, colour: str) -> None:
    if kind == "excitation":
        length = 0.22 * sketch.scale
        arrow = {"arrowstyle": "-|>", "color": colour, "linewidth": 1.4, "shrinkA": 0, "shrinkB": 0}
        axes.annotate("", (x, y), (x, y + length), arrowprops=arrow, zorder=7)
        return
    marker = {"response": "^", "mass": "s", "ground": "^"}[kind]
    offset = 0.045 * sketch.scale * (1.0 if y > 0.0 else -1.0)
    axes.plot([x], [y + offset], marker=marker, color=colour, markersize=6, zorder=7, linestyle="none")
