"""Figures of measurements as read from files."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from receptance.io.contents import MOST_DRAWN, FileContents
from receptance.io.measurements import Coherence, TimeSeries
from receptance.report.colours import COLOURS, INK
from receptance.report.figure import add_legend, finished, panels, set_up, surface, title_left

_MAX_PANELS = 8
"""Most channels drawn; the title states how many there are."""
_MAX_NAMED = 8
"""Most entries of a coherence named in the legend."""


def draw_contents(contents: FileContents, ax: Axes | None = None) -> Figure:
    """Draw the first measurements, a panel each."""
    drawn = contents.measurements[:MOST_DRAWN]
    if len(drawn) == 1:
        return drawn[0].plot(ax)
    figure = surface(ax, 9.0, 4.6 * len(drawn))
    for axes, measurement in zip(figure.subplots(len(drawn), 1), drawn, strict=True):
        measurement.plot(axes)
    return finished(figure)


def draw_coherence(coherence: Coherence, ax: Axes | None = None) -> Figure:
    """Draw the coherence of all entries over frequency."""
    figure = surface(ax, 9.0, 3.2)
    axes = figure.subplots()
    set_up(axes, "", "frequency (Hz)", "coherence")
    labels = coherence.labels if coherence.values[0].size <= _MAX_NAMED else None
    for number, (i, j) in enumerate(np.ndindex(coherence.values.shape[1:])):
        name = f"{labels[0][i]} over {labels[1][j]}" if labels else None
        colour = COLOURS[number % len(COLOURS)]
        axes.plot(coherence.frequency_hz, coherence.values[:, i, j], color=colour, linewidth=0.9, label=name)
    axes.set_ylim(0.0, 1.05)
    axes.set_xlim(float(coherence.frequency_hz[0]), max(float(coherence.frequency_hz[-1]), 1e-9))
    if labels:
        add_legend(axes, loc="best")
    title_left(figure, coherence.label or "Coherence", 11.0)
    return finished(figure)


def draw_time_series(series: TimeSeries, ax: Axes | None = None) -> Figure:
    """Draw all channels over time, a panel each."""
    shown = min(len(series.channels), _MAX_PANELS)
    figure = surface(ax, 9.0, 1.2 + 1.7 * shown)
    for index, axes in enumerate(panels(figure, shown, 1, sharex=True)):
        unit = series.units[index].replace("^2", "²")
        set_up(axes, "", "", f"{series.channels[index]}\n({unit})")
        axes.plot(series.time_s, series.values[:, index], color=COLOURS[index % len(COLOURS)], linewidth=0.8)
    axes.set_xlabel("time (s)", color=INK)
    axes.set_xlim(float(series.time_s[0]), float(series.time_s[-1]) + 1e-12)
    more = f"  ·  the first {shown} of {len(series.channels)} channels" if shown < len(series.channels) else ""
    title_left(figure, (series.label or "Time records") + more, 11.0)
    return finished(figure)
