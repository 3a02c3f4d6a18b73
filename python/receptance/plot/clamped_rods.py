"""The figure of the clamped rods."""

from __future__ import annotations

from typing import TYPE_CHECKING

from receptance.plot._style import COLOURS, INK, PALE, new_figure, set_up

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from receptance.studies.clamped_rods import ClampedRods

__all__ = ["draw_clamped_rods"]


def draw_clamped_rods(study: ClampedRods) -> Figure:
    """Draw the predicted first modes of every rod, with intervals, against what was read."""
    figure = new_figure(11.0, 4.8)
    panels = figure.subplots(1, 2, sharey=True)
    names = [rod.name for rod in study.rods]
    for axes, assumption in zip(panels, ("rotation", "translation"), strict=True):
        set_up(
            axes, f"Clamp yields in {assumption} alone", "rod", "against the reading (%)" if axes is panels[0] else ""
        )
        for index, rod in enumerate(study.rods):
            band = 100.0 * study.reading_error_hz / rod.measured_hz
            axes.bar(
                index, 2.0 * band, 0.8, bottom=-band, color="#E3E3E3", label="reading error" if index == 0 else None
            )
            rigid = 100.0 * (study.rigid_hz[rod.name] / rod.measured_hz - 1.0)
            axes.plot(index, rigid, "_", color=PALE, markersize=26, label="rigid clamp" if index == 0 else None)
        for source, colour in zip(names, COLOURS, strict=False):
            chosen = [p for p in study.predictions if p.assumption == assumption and p.identified_on == source]
            places = [names.index(p.rod) + 0.22 * (names.index(source) - (len(names) - 1) / 2) for p in chosen]
            ends = [
                [100.0 * (p.predicted_hz - p.interval_hz[0]) / p.measured_hz for p in chosen],
                [100.0 * (p.interval_hz[1] - p.predicted_hz) / p.measured_hz for p in chosen],
            ]
            axes.errorbar(
                places,
                [p.error_percent for p in chosen],
                ends,
                fmt="o",
                color=colour,
                capsize=4,
                label=f"clamp from rod {source}",
            )
        axes.axhline(0.0, color=INK, linewidth=0.8)
        labels = []
        for rod in study.rods:
            shape = " + ".join(f"{length:g} \u00d7 \u00d8{diameter:g}" for length, diameter in rod.segments_mm)
            labels.append(f"{rod.name}: {rod.measured_hz:g} Hz\n{shape} mm")
        axes.set_xticks(range(len(names)), labels, fontsize=9)
    panels[1].legend(frameon=False, fontsize=9, loc="upper right")
    figure.suptitle(
        "First mode of clamped aluminium rods, predicted with the clamp of another rod", fontsize=13, color=INK
    )
    return figure
