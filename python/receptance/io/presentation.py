"""Figures and summary tables of coherences and time series."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from receptance.report import Column, Table
from receptance.report.figure import COLOURS, INK, add_legend, finished, panels, set_up, surface, title_left

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from receptance.io.measurements import Coherence, TimeSeries

_MAX_PANELS = 8
"""Most channels drawn; the title states how many there are."""
_MAX_NAMED = 8
"""Most entries of a coherence named in the legend."""


def coherence_table(coherence: Coherence) -> Table:
    """Return lines, entries, median and source of a coherence."""
    lines = coherence.frequency_hz
    rows = [
        ("lines", f"{lines.size}, {lines[0]:g} to {lines[-1]:g} Hz"),
        ("entries", f"{coherence.values.shape[1]} responses x {coherence.values.shape[2]} excitations"),
        ("coherence", f"median {np.median(coherence.values):.4g}, lowest {coherence.values.min():.4g}"),
    ]
    if coherence.source:
        rows.append(("source", coherence.source))
    return Table("", ("property", "value"), rows)


def series_tables(series: TimeSeries) -> list[Table]:
    """Return the sampling of time records, and their channels with unit and largest magnitude."""
    rows = [
        ("samples", f"{len(series)} at {series.sample_rate_hz:.6g} Hz, {series.duration_s:.4g} s"),
        ("start", f"{series.start_s:g} s"),
    ]
    if series.source:
        rows.append(("source", series.source))
    largest = np.max(np.abs(series.values), axis=0)
    channels = [
        (name, quantity or "other", float(value), unit)
        for name, quantity, value, unit in zip(series.channels, series.quantities, largest, series.units, strict=True)
    ]
    return [
        Table("", ("property", "value"), rows),
        Table("Channels", ("channel", "quantity", Column("largest magnitude", form=".4g"), "unit"), channels),
    ]


def draw_coherence(coherence: Coherence, ax: Axes | None = None) -> Figure:
    """Draw the coherence of all entries over frequency; `ax` as in `draw_frf`."""
    figure = surface(ax, 9.0, 3.2)
    axes = figure.subplots()
    set_up(axes, "", "frequency (Hz)", "coherence")
    named = coherence.values[0].size <= _MAX_NAMED and coherence.labels is not None
    for number, (i, j) in enumerate(np.ndindex(coherence.values.shape[1:])):
        name = f"{coherence.labels[0][i]} over {coherence.labels[1][j]}" if named and coherence.labels else None
        colour = COLOURS[number % len(COLOURS)]
        axes.plot(coherence.frequency_hz, coherence.values[:, i, j], color=colour, linewidth=0.9, label=name)
    axes.set_ylim(0.0, 1.05)
    axes.set_xlim(float(coherence.frequency_hz[0]), max(float(coherence.frequency_hz[-1]), 1e-9))
    if named:
        add_legend(axes, loc="best")
    title_left(figure, coherence.label or "Coherence", 11.0)
    return finished(figure)


def draw_series(series: TimeSeries, ax: Axes | None = None) -> Figure:
    """Draw the channels of time records over time, a panel each; `ax` as in `draw_frf`."""
    shown = min(len(series.channels), _MAX_PANELS)
    figure = surface(ax, 9.0, 1.2 + 1.7 * shown)
    for index, axes in enumerate(panels(figure, shown, 1, sharex=True)):
        unit = series.units[index].replace("^2", "²")
        set_up(axes, "", "", f"{series.channels[index]}\n({unit})")
        axes.plot(series.time_s, series.values[:, index], color=COLOURS[index % len(COLOURS)], linewidth=0.8)
        last = axes
    last.set_xlabel("time (s)", color=INK)
    last.set_xlim(float(series.time_s[0]), float(series.time_s[-1]) + 1e-12)
    title = series.label or "Time records"
    if shown < len(series.channels):
        title += f"  ·  the first {shown} of {len(series.channels)} channels"
    title_left(figure, title, 11.0)
    return finished(figure)
