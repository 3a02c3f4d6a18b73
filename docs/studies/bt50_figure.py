"""The figure of the BT50 study: the paper's figures 10 to 13 and 16, with intervals, on virtual data."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from output import BAD, COLOURS, INK, set_up
from receptance.coupling import ForceSeries

_FORCE = "drawbar force (kN)"
_BAND = "#EDEDED"


def draw(results: dict[str, Any]) -> Figure:
    """Draw six panels: stiffness and damping along and across over force, frequencies, and levels left out."""
    virtual, published = results["virtual"], results["published"]
    series = results["_series"]
    figure = Figure(figsize=(16.0, 9.6), layout="constrained")
    cells = figure.add_gridspec(2, 3)
    broken = cells[0, 2].subgridspec(2, 1, height_ratios=(1.0, 4.0))
    _draw_axial_stiffness(figure.add_subplot(cells[0, 0]), series, published)
    _draw_axial_damping(figure.add_subplot(cells[0, 1]), series, virtual, published)
    _draw_frequencies(figure.add_subplot(broken[0]), figure.add_subplot(broken[1]), virtual)
    across = [figure.add_subplot(cells[1, i]) for i in range(3)]
    _draw_radial(across[0], series, "k", "Radial stiffness (paper's figure 12)", "$K_{X}$ (10$^9$ N/m)", 1e-9)
    _draw_radial(across[1], series, "c", "Radial damping (paper's figure 13)", "$C_{X}$ (N s/m)", 1.0)
    _draw_left_out(across[2], virtual["left_out"], published)
    figure.suptitle(
        "BT50 taper over drawbar force: the procedure of Xu et al. 2012 on a virtual rig. All data are virtual (finite "
        "elements, ten hits,\n20 480 Hz, 20 Hz lines); only the grey bands are the paper's. Whiskers: 95 %."
    )
    return figure


def _power(series: ForceSeries) -> str:
    low, high = series.exponent_interval
    return f"n = {series.laws[2].exponent:.2f} ({low:.2f} to {high:.2f})"


def _draw_axial_stiffness(axes: Axes, series: dict[str, ForceSeries], published: dict[str, Any]) -> None:
    low, high = published["axial_stiffness_n_per_m"]
    axes.axhspan(1e-9 * low, 1e-9 * high, color=_BAND, label="paper's range")
    for name, colour, text in (("rigid", COLOURS[1], "rigid holder"), ("elastic", COLOURS[0], "elastic holder")):
        stiffness = series[f"{name} k_z1"]
        draw_over_levels(axes, stiffness, 1e-9, colour, f"{text}, {_power(stiffness)}")
    set_up(axes, "Axial stiffness (paper's figure 10)", _FORCE, "$K_{Z1}$ (10$^9$ N/m)", room=0.3)


def _draw_axial_damping(
    axes: Axes, series: dict[str, ForceSeries], virtual: dict[str, Any], published: dict[str, Any]
) -> None:
    axes.axhspan(*published["axial_damping_ns_per_m"], color=_BAND, label="paper's range")
    half_power = series["half-power c_z1"]
    draw_over_levels(axes, half_power, 1.0, COLOURS[1], "half-power, 20 Hz lines", marker="s", law=False)
    draw_over_levels(axes, series["rigid c_z1"], 1.0, COLOURS[0], "circle fit of the same hits")
    force = [level["force_kn"] for level in virtual["axial"]]
    truth = [level["truth"] for level in virtual["axial"]]
    factor = 4.0 * np.pi * virtual["holder"]["mass"]
    damping = [factor * mode["frequency_hz"] * mode["damping_ratio"] for mode in truth]
    axes.plot(force, damping, color=INK, linewidth=1.0, linestyle=":", label="virtual rig (eq. 15)")
    set_up(axes, "Axial damping, rigid holder (paper's figure 11)", _FORCE, "$C_{Z1}$ (N s/m)", room=0.25)


def _draw_frequencies(above: Axes, axes: Axes, virtual: dict[str, Any]) -> None:
    """Draw the first axial mode below a break of the axis, and that of the bonded holder above it."""
    levels = virtual["axial"]
    force = [level["force_kn"] for level in levels]
    bonded = virtual["bonded_hz"]["axial"][0]
    above.plot(force, [bonded] * len(force), color=COLOURS[2], linestyle="--")
    text = f"bonded, {bonded:.0f} Hz"
    above.text(0.98, 0.12, text, transform=above.transAxes, ha="right", fontsize=9, color=COLOURS[2])
    above.set_ylim(0.96 * bonded, 1.02 * bonded)
    for key, style, colour, label in (
        ("experiment_hz", "o", INK, "experiment (virtual)"),
        ("elastic_hz", "-", COLOURS[0], "elastic holder, springs of the elastic holder"),
        ("simulated_hz", "-", COLOURS[1], "elastic holder, springs of the rigid holder"),
    ):
        axes.plot(force, [level[key] for level in levels], style, color=colour, markersize=4.5, label=label)
    share = np.mean([100.0 * (level["simulated_hz"] / level["experiment_hz"] - 1.0) for level in levels])
    axes.text(0.98, 0.3, f"{share:+.1f} % on average", transform=axes.transAxes, ha="right", fontsize=9, color="0.6")
    set_up(above, "First axial mode (paper's figure 16)")
    set_up(axes, "", _FORCE, "frequency (Hz)", room=0.35)
    _break(above, axes)


def _break(above: Axes, below: Axes) -> None:
    """Mark a break of the axis: no frame and no ticks at the gap, and two slanting strokes."""
    above.sharex(below)
    above.spines["bottom"].set_visible(False)
    above.tick_params(bottom=False, labelbottom=False)
    above.locator_params(axis="y", nbins=2)
    stroke: dict[str, Any] = {
        "marker": [(-1.0, -0.5), (1.0, 0.5)],
        "markersize": 9,
        "color": INK,
        "linestyle": "none",
        "clip_on": False,
    }
    above.plot([0.0], [0.0], transform=above.transAxes, **stroke)
    below.plot([0.0], [1.0], transform=below.transAxes, **stroke)


def _draw_radial(axes: Axes, series: dict[str, ForceSeries], kind: str, title: str, label: str, factor: float) -> None:
    for end, colour, text in (("x1", COLOURS[0], "big end"), ("x2", COLOURS[2], "small end")):
        parameter = series[f"elastic {kind}_{end}"]
        draw_over_levels(axes, parameter, factor, colour, f"{text}, {_power(parameter)}")
    set_up(axes, title, _FORCE, label, room=0.25)


def _draw_left_out(axes: Axes, left_out: list[dict[str, Any]], published: dict[str, Any]) -> None:
    for motion in left_out:
        marker = "o" if motion["motion"] == "axial" else "^"
        for name, colour, values in (
            ("springs of rigid holder", COLOURS[1], motion["rigid_percent"]),
            ("springs of elastic holder", COLOURS[0], motion["elastic_percent"]),
        ):
            modes = len(values[0]) if values else 0
            for mode in range(modes):
                axes.plot(
                    motion["force_kn"][: len(values)],
                    [abs(row[mode]) for row in values],
                    marker,
                    color=colour,
                    markersize=5,
                    markerfacecolor=colour if mode == 0 else "none",
                    label=f"{motion['motion']} {mode + 1}, {name}",
                )
    axes.set_yscale("log")
    percent = published["simulated_below_experiment_percent"]
    axes.axhline(percent, color=BAD, linewidth=0.8, linestyle="--", label=f"paper: about {percent:g} %")
    bottom, top = axes.get_ylim()
    axes.set_ylim(bottom, top * 100.0)
    set_up(axes, "Force levels that were left out", _FORCE, "|error| of predicted frequency (%)")


def draw_over_levels(
    axes: Axes, series: ForceSeries, factor: float, colour: str, label: str, *, marker: str = "o", law: bool = True
) -> None:
    """Draw a parameter over force with error bars, and its law."""
    if law:
        force = np.linspace(series.force[0], series.force[-1], 200)
        axes.plot(force, factor * series.law.at(force), color=colour, alpha=0.45)
    errors = 1.96 * factor * series.standard_errors
    axes.errorbar(
        series.force, factor * series.values, errors, fmt=marker, color=colour, markersize=4, capsize=2.5, label=label
    )
