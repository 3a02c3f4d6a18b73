"""Figures of catalogues: the receptance of one tool, and the most flexible modes of all."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from receptance.catalogue.building import Catalogue
from receptance.catalogue.prediction import ToolPrediction
from receptance.catalogue.results import CatalogueSummary
from receptance.fit.figure import OPEN
from receptance.model.assembly import Assembly
from receptance.model.beams import Part
from receptance.model.figure import draw_outline
from receptance.report.colours import COLOURS, INK, PALE
from receptance.report.figure import add_legend, finished, label_point, new_figure, plain_ticks, set_up, surface

_LARGEST_WITH_NAMES, _LARGEST_WITH_BARS = 15, 80
"""Largest numbers of tools with names and with intervals."""
_LARGEST_LEGEND = 25
"""Largest number of holders in a legend."""
_LARGEST_PLAIN = 20.0
"""Smaller ranges of the dynamic stiffness have plain numbers along the axis."""
_DECADES = 3.5
"""Largest range of the magnitude."""


def draw_tool(prediction: ToolPrediction) -> Figure:
    """Draw the receptance of a predicted tip with its band, and its modes with theirs.

    With draws the band is also valid where resonances move by more than their width.
    """
    figure = new_figure(9.0, 5.0)
    axes = figure.subplots()
    tip = prediction.tip
    size = 1e6 * np.abs(tip.receptance)
    low, high = tip.band(prediction.level)
    low, high = np.maximum(1e6 * low, size / OPEN), np.minimum(high, 1e-6 * size * OPEN) * 1e6
    kind = f"{100 * prediction.level:g} % band" + ("" if len(tip.drawn) else ", to first order")
    axes.fill_between(tip.frequency_hz, low, high, color=COLOURS[0], alpha=0.25, lw=0, label=kind)
    axes.plot(tip.frequency_hz, size, color=COLOURS[0], lw=1.3, label="predicted")
    top = 3.0 * float(np.max(size))
    axes.set_yscale("log")
    axes.set_ylim(max(float(np.min(size)) / 2.0, top * 10.0**-_DECADES), top)
    axes.set_xlim(tip.frequency_hz[0], tip.frequency_hz[-1])
    modes = zip(prediction.modes, prediction.modes_interval, strict=True)
    for number, ((frequency, damping, stiffness), interval) in enumerate(modes):
        height = 1e6 / stiffness
        axes.errorbar(
            frequency,
            height,
            xerr=[[frequency - interval[0, 0]], [interval[0, 1] - frequency]],
            yerr=[[height - 1e6 / interval[2, 1]], [1e6 / interval[2, 0] - height]],
            fmt="o",
            color=INK,
            ms=4,
            lw=1.0,
            capsize=2,
            label="modes" if number == 0 else None,
        )
        half_width = 50.0 * (interval[1, 1] - interval[1, 0])
        text = f"{frequency:.0f} Hz\n{100 * damping:.2f} \u00b1 {half_width:.2g} %\n{1e-6 * stiffness:.3g} N/\u00b5m"
        at_end = frequency > 0.85 * tip.frequency_hz[-1]
        label_point(axes, text, (frequency, height), left=bool(at_end), offset=(8.0, 4.0))
    set_up(
        axes, f"{prediction.row.name} in {prediction.row.holder}", "frequency (Hz)", "receptance of the tip (\u00b5m/N)"
    )
    add_legend(figure, ncols=3)
    return finished(figure, prediction.rejection)


def draw_outlines(catalogue: Catalogue) -> Iterator[Figure]:
    """Yield the tools of a catalogue in their holders as small figures, all to one scale."""
    tools = [tool.site.assembly for tool in catalogue]
    held = [_held(assembly, row.holder) for assembly, row in zip(tools, catalogue.tools, strict=True)]
    length, radius = max(length for length, _ in held), max(radius for _, radius in held)
    for assembly in tools:
        yield draw_outline(assembly, 1e3 * length, 1.1e3 * radius)


def _held(assembly: Assembly, holder: str) -> tuple[float, float]:
    """Return length and largest radius of an assembly up to the end of its holder in m."""
    length, radius = 0.0, 0.0
    for name, element in assembly.elements.items():
        length += float(getattr(element, "length", 0.0))
        if isinstance(element, Part):
            radius = max(radius, *(0.5 * outer for segment in element.segments for outer, _ in segment.ends))
        if name == holder:
            break
    return length, radius


def draw_catalogue(catalogue: CatalogueSummary, ax: Axes | None = None) -> Figure:
    """Draw the most flexible mode of every tool: dynamic stiffness over natural frequency."""
    figure = surface(ax, 9.0, 5.8)
    axes = figure.subplots()
    tools = catalogue.tools
    shown = [tool for tool in tools if tool.values is not None and tool.interval is not None]
    holders = list(dict.fromkeys(tool.holder for tool in shown))
    for index, holder in enumerate(holders):
        group = [tool for tool in shown if tool.holder == holder]
        values = np.array([tool.values for tool in group])
        ends = np.array([tool.interval for tool in group])
        x, y = values[:, 0], 1e-6 * values[:, 2]
        # Colours repeat with another marker.
        colour, marker = COLOURS[index % len(COLOURS)], "osD^v"[index // len(COLOURS) % 5]
        if len(shown) <= _LARGEST_WITH_BARS:
            bars = {"xerr": np.abs(ends[:, 0].T - x), "yerr": np.abs(1e-6 * ends[:, 2].T - y)}
            axes.errorbar(x, y, **bars, fmt=marker, color=colour, ms=5, lw=0.9, capsize=2, label=holder)
        else:
            axes.plot(x, y, marker, color=colour, ms=2.5, alpha=0.5, label=holder)
        if len(shown) <= _LARGEST_WITH_NAMES:
            for tool, point in zip(group, zip(x, y, strict=True), strict=True):
                label_point(axes, tool.name, point, offset=(5.0, 5.0))
    axes.set_yscale("log")
    low, high = axes.get_ylim()
    if high < _LARGEST_PLAIN * low:
        plain_ticks(axes.yaxis)
    hidden = len(tools) - len(shown)
    if hidden:
        axes.text(0.01, 0.01, f"{hidden} without a mode", transform=axes.transAxes, fontsize=8, color=PALE)
    x_label = "natural frequency of the most flexible mode (Hz)"
    set_up(axes, catalogue.provenance.title, x_label, "dynamic stiffness (N/\u00b5m)", grid="both")
    if len(holders) <= _LARGEST_LEGEND:
        add_legend(figure, ncols=6)
    return finished(figure, catalogue.rejection)
