"""The figure of the ER32 study."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from receptance.plot._style import BAD, COLOURS, INK, PALE, keep_clear, new_figure, set_up
from receptance.studies.er32.trends import QUANTITIES, Quantity

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.patches import Rectangle

    from receptance.studies.er32.joints import IdentifiedJoint
    from receptance.studies.er32.study import ER32Study

__all__ = ["draw_er32"]

_UNITS: dict[Quantity, tuple[str, str]] = {"k_y": ("$k_y$", "N/m"), "k_theta": ("$k_\\theta$", "N m/rad")}


def draw_er32(study: ER32Study) -> Figure:
    """Draw six panels: stiffness over diameter and over torque, transfer errors, parameter sets, bias against chance.

    Parameters
    ----------
    study : ER32Study
        From `receptance.studies.er32.run`.

    Returns
    -------
    matplotlib.figure.Figure
        It belongs to no window; save it with `savefig`.
    """
    figure = new_figure(16.0, 9.6, math=True)
    panels = figure.subplots(2, 3)
    _draw_diameter(panels[0, 0], study)
    _draw_torque(panels[0, 1], study)
    _draw_transfer(panels[0, 2], study)
    _draw_sets(panels[1, 0], study)
    _draw_bias(panels[1, 1], study)
    _draw_causes(panels[1, 2], study)
    keep_clear(figure, 0.93)
    title = "ER32 collet holder: the joint identified from the printed frequencies of Matthias et al. 2016"
    figure.text(0.5, 0.977, title, ha="center", va="center", fontsize=15, color=INK)
    figure.text(
        0.5,
        0.95,
        "The holder's shape is inferred, not published: agreement in what it was inferred from is consistency, "
        "not validation.",
        ha="center",
        va="center",
        fontsize=10.5,
        color="#6A6A6A",
    )
    return figure


def _draw_diameter(axes: Axes, study: ER32Study) -> None:
    torque = study.published.recommended_torque_nm
    set_up(
        axes, f"Stiffness over diameter at {torque:g} N m", "tool diameter (mm)", "$k_y$ (N/m),  $k_\\theta$ (N m/rad)"
    )
    joints = sorted((j for j in study.identified if j.torque_nm == torque), key=lambda j: j.diameter_mm)
    x = np.array([j.diameter_mm for j in joints])
    for quantity, colour in zip(QUANTITIES, COLOURS, strict=False):
        symbol, _ = _UNITS[quantity]
        law = next(law for law in study.trends.diameter if law.quantity == quantity)
        y = np.array([getattr(j, quantity) for j in joints])
        below = [value - (ends[0] or 0.0) for value, ends in zip(y, _ends(joints, quantity), strict=True)]
        above = [(ends[1] or value) - value for value, ends in zip(y, _ends(joints, quantity), strict=True)]
        centre = np.exp(np.log(x).mean())
        axes.plot(x, np.exp(np.log(y).mean()) * (x / centre) ** law.exponent, color=colour, alpha=0.35, linewidth=1.2)
        axes.errorbar(
            x, y, [below, above], fmt="o", color=colour, markersize=6, capsize=3, label=f"{symbol} identified"
        )
        paper = [getattr(j, f"published_{quantity}") for j in joints]
        axes.plot(
            x,
            paper,
            "D",
            markerfacecolor="none",
            markeredgecolor=INK,
            markersize=9,
            label="paper" if quantity == "k_y" else None,
        )
        low, high = law.scatter_interval
        axes.annotate(
            f"{symbol} $\\propto d^{{{law.exponent:.1f}}}$  (95 %: {low:.1f} to {high:.1f})",
            (x[-1], y[-1]),
            xytext=(0, -50),
            textcoords="offset points",
            ha="right",
            fontsize=9,
            color=colour,
        )
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xticks(x, [f"{value:g}" for value in x])
    axes.minorticks_off()
    axes.legend(frameon=False, fontsize=9, loc="center left", bbox_to_anchor=(0.0, 0.52))


def _ends(joints: Sequence[IdentifiedJoint], quantity: str) -> list[tuple[float | None, float | None]]:
    return [getattr(joint, f"{quantity}_interval") for joint in joints]


def _draw_torque(axes: Axes, study: ER32Study) -> None:
    low, high = study.trends.torque_range_nm
    set_up(axes, f"Change of stiffness from {low:g} to {high:g} N m, fitted line", "tool diameter (mm)", "change (%)")
    diameters = sorted({trend.diameter_mm for trend in study.trends.torque})
    for shift, quantity, colour in zip((-0.19, 0.19), QUANTITIES, COLOURS, strict=False):
        trends = [trend for trend in study.trends.torque if trend.quantity == quantity]
        for position, trend in enumerate(sorted(trends, key=lambda t: t.diameter_mm)):
            below = 0.0 if trend.interval[0] is None else trend.change_percent - trend.interval[0]
            above = 0.0 if trend.interval[1] is None else trend.interval[1] - trend.change_percent
            axes.bar(
                position + shift,
                trend.change_percent,
                0.36,
                color=colour,
                alpha=0.85 if trend.exceeds else 0.3,
                label=_UNITS[quantity][0] if position == 0 else None,
            )
            axes.errorbar(
                position + shift, trend.change_percent, [[below], [above]], color=INK, capsize=4, linewidth=1.2
            )
    axes.set_xticks(range(len(diameters)), [f"{value:g}" for value in diameters])
    axes.axhline(0.0, color=INK, linewidth=0.8)
    axes.legend(frameon=False, fontsize=9, loc="upper left")
    low_end, high_end = axes.get_ylim()
    axes.set_ylim(low_end, high_end + 0.16 * (high_end - low_end))
    r = study.settings.resolution
    axes.text(
        0.99,
        0.99,
        f"whiskers: readings in steps of {r.fine_hz:g} Hz,\n{r.coarse_hz:g} Hz from {r.change_hz / 1e3:g} kHz on",
        transform=axes.transAxes,
        ha="right",
        va="top",
        fontsize=8,
        color=PALE,
    )


def _draw_transfer(axes: Axes, study: ER32Study) -> None:
    set_up(axes, "Other overhangs: predicted against measured", "", "error (%)")
    keys = sorted({(row.diameter_mm, row.overhang_mm) for row in study.transfers})
    for index, (diameter, overhang) in enumerate(keys):
        rows = [row for row in study.transfers if (row.diameter_mm, row.overhang_mm) == (diameter, overhang)]
        for row in rows:
            x = index + 0.24 * (row.mode - (len(rows) + 1) / 2.0)
            axes.plot(
                [x, x], [row.published_error_percent, row.error_percent], color="#CFCFCF", linewidth=1.2, zorder=1
            )
            axes.plot(x, row.published_error_percent, "D", markerfacecolor="white", markeredgecolor=INK, markersize=6)
            axes.plot(x, row.error_percent, "o", color=COLOURS[row.mode + 1], markersize=7)
    modes = sorted({row.mode for row in study.transfers})
    for mode in modes:
        axes.plot([], [], "o", color=COLOURS[mode + 1], label=f"ours, mode {mode}")
    axes.plot([], [], "D", markerfacecolor="white", markeredgecolor=INK, label="paper")
    axes.axhline(0.0, color=INK, linewidth=0.8)
    axes.set_xticks(range(len(keys)), [f"{d:g}\n{o:g}" for d, o in keys], fontsize=8)
    axes.set_xlabel("tool diameter / overhang (mm)", color=INK)
    # Room for the legend above the largest error.
    largest = _largest(study)
    axes.set_ylim(-1.2 * largest, 1.7 * largest)
    _add_titled_legend(
        axes, f"rms: ours {study.transfer_rms_percent:.2f} %, paper {study.published_transfer_rms_percent:.2f} %"
    )


def _largest(study: ER32Study) -> float:
    return max(max(abs(row.error_percent), abs(row.published_error_percent)) for row in study.transfers)


def _draw_sets(axes: Axes, study: ER32Study) -> None:
    axes.set_title(
        "Parameter sets of table 3: error per mode (%)", loc="left", fontsize=11, fontweight="bold", color=INK
    )
    sets = study.parameter_sets
    columns = [(error.overhang_mm, error.mode) for error in sets[0].errors]
    for row, verdict in enumerate(sets):
        for column, error in enumerate(verdict.errors):
            betrayed = error in verdict.betrayed_by
            strength = min(1.0, np.log10(max(abs(error.percent), 1.0)) / 2.0) if betrayed else 0.0
            axes.add_patch(
                _cell(
                    column,
                    row,
                    (1.0 - 0.35 * strength, 0.85 - 0.62 * strength, 0.8 - 0.6 * strength) if betrayed else (0.93,) * 3,
                )
            )
            axes.text(
                column,
                row,
                f"{error.percent:+.1f}",
                ha="center",
                va="center",
                fontsize=10,
                color="white" if strength > 0.6 else INK,
                fontweight="bold" if betrayed else "normal",
            )
    axes.set_xlim(-0.5, len(columns) - 0.5)
    axes.set_ylim(len(sets) - 0.5, -0.5)
    axes.set_yticks(range(len(sets)), [verdict.name.replace("_", " ") for verdict in sets], fontsize=9, color=INK)
    axes.set_xticks(
        range(len(columns)), [f"{overhang:g}\nmode {mode}" for overhang, mode in columns], fontsize=8, color=INK
    )
    axes.set_xlabel(
        f"overhang (mm), mode; red betrays the set: more than {sets[0].threshold_percent:.1f} % off", color=INK
    )
    axes.tick_params(length=0)
    for spine in axes.spines.values():
        spine.set_visible(False)


def _cell(column: int, row: int, colour: tuple[float, ...]) -> Rectangle:
    from matplotlib.patches import Rectangle

    return Rectangle((column - 0.48, row - 0.46), 0.96, 0.92, facecolor=colour, edgecolor="none")


def _draw_bias(axes: Axes, study: ER32Study) -> None:
    bias = study.bias
    set_up(
        axes, "First mode of the long tools against chance", "tool diameter (mm)", "100 (predicted / measured - 1)  (%)"
    )
    count = len(bias.percent)
    x = np.arange(count)
    spread = np.array(bias.tool_deviation_percent)
    axes.bar(x, 4.0 * spread, 0.7, bottom=-2.0 * spread, color="#DCE9F2", label="chance, $\\pm$2 standard deviations")
    axes.bar(x, 2.0 * spread, 0.7, bottom=-spread, color="#BDD7E7", label="chance, $\\pm$1 standard deviation")
    axes.plot(x, bias.percent, "o", color=BAD, markersize=8, label="ours")
    axes.plot(x, bias.published_percent, "D", markerfacecolor="white", markeredgecolor=INK, markersize=7, label="paper")
    mean = count
    axes.bar(mean, 4.0 * bias.mean_deviation_percent, 0.7, bottom=-2.0 * bias.mean_deviation_percent, color="#DCE9F2")
    axes.bar(mean, 2.0 * bias.mean_deviation_percent, 0.7, bottom=-bias.mean_deviation_percent, color="#BDD7E7")
    axes.plot(mean, bias.mean_percent, "o", color=BAD, markersize=8)
    axes.plot(
        mean, float(np.mean(bias.published_percent)), "D", markerfacecolor="white", markeredgecolor=INK, markersize=7
    )
    axes.axhline(0.0, color=INK, linewidth=0.8)
    axes.set_xticks(range(count + 1), [*(f"{d:g}" for d in bias.diameter_mm), "mean"])
    _add_titled_legend(axes, f"p = {bias.p_value:.2g} for the mean, sign test p = {bias.sign_test_p_value:.3g}")
    low, high = axes.get_ylim()
    axes.set_ylim(low - 0.06 * (high - low), high + 0.45 * (high - low))


def _draw_causes(axes: Axes, study: ER32Study) -> None:
    set_up(axes, "Where chance comes from in that mean", "standard deviation of the mean (%)")
    axes.grid(visible=False, axis="y")
    axes.grid(visible=True, axis="x", color="#E6E6E6", linewidth=0.8)
    rows = [*study.bias.deviations_percent.items(), ("together", study.bias.mean_deviation_percent)]
    rows.append(("simulated", study.simulation.deviation_percent))
    labels = {
        "reading": "readings",
        "overhang": "overhangs",
        "carbide": "carbide (shared)",
        "steel": "steel (shared)",
        "holder": "holder's shape (shared)",
        "together": "all together, linear",
        "simulated": f"all, {study.simulation.draws} simulations",
    }
    for index, (name, value) in enumerate(rows):
        total = name in ("together", "simulated")
        axes.barh(index, value, 0.62, color=COLOURS[0] if total else "#BDD7E7")
        axes.text(value + 0.02, index, f"{value:.2f}", va="center", fontsize=9, color=INK)
    size = abs(study.bias.mean_percent)
    axes.axvline(size, color=BAD, linewidth=1.5)
    axes.text(size - 0.03, -0.3, f"observed mean {study.bias.mean_percent:+.2f} %", ha="right", fontsize=9, color=BAD)
    axes.set_yticks(range(len(rows)), [labels[name] for name, _ in rows], fontsize=9)
    axes.set_ylim(len(rows) - 0.4, -0.8)
    axes.set_xlim(0.0, 1.12 * max(size, *(value for _, value in rows)))


def _add_titled_legend(axes: Axes, title: str) -> None:
    """Two columns under a line that says what the panel comes to."""
    axes.legend(frameon=False, fontsize=9, ncols=2, loc="upper left", title=title, title_fontsize=9, alignment="left")
