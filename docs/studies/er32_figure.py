"""The figure of the ER32 study."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from output import BAD, COLOURS, INK, set_up

_SYMBOLS = {"k_y": "$k_y$", "k_theta": "$k_\\theta$"}
_HOLLOW: dict[str, Any] = {"marker": "D", "linestyle": "none", "markerfacecolor": "none", "markeredgecolor": INK}
_CHANCE = ((4.0, "#DCE9F2", "chance, $\\pm$2 standard deviations"), (2.0, "#BDD7E7", "$\\pm$1 standard deviation"))
_SOURCES = {
    "reading": "readings",
    "overhang": "overhangs",
    "carbide": "carbide\n(shared)",
    "steel": "steel\n(shared)",
    "holder": "holder shape\n(shared)",
}


def draw(results: dict[str, Any]) -> Figure:
    """Draw stiffness over diameter and torque, transfer errors, parameter sets, and the bias against chance."""
    figure = Figure(figsize=(16.0, 9.6), layout="constrained")
    panels = figure.subplots(2, 3)
    _draw_diameter(panels[0, 0], results)
    _draw_torque(panels[0, 1], results)
    _draw_transfer(panels[0, 2], results["transfer"])
    _draw_sets(panels[1, 0], results["parameter_sets"])
    _draw_bias(panels[1, 1], results["long_first_mode_bias"])
    _draw_sources(panels[1, 2], results["long_first_mode_bias"])
    figure.suptitle(
        "ER32 collet holder: the joint identified from the printed frequencies of Matthias et al. 2016. The holder's "
        "shape is inferred, not published:\nagreement in the data it was inferred from is consistency, not validation."
    )
    return figure


def _draw_diameter(axes: Axes, results: dict[str, Any]) -> None:
    torque = results["trends"]["diameter"][0]["torque_nm"]
    title = f"Stiffness over diameter at {torque:g} N m"
    joints = sorted(
        (j for j in results["identified"] if j["torque_nm"] == torque), key=lambda j: float(j["diameter_mm"])
    )
    x = np.array([j["diameter_mm"] for j in joints])
    for law, colour in zip(results["trends"]["diameter"], COLOURS, strict=False):
        name = law["quantity"]
        y = np.array([j[name] for j in joints])
        low, high = np.array([j[f"{name}_interval"] for j in joints], dtype=float).T
        whiskers = [y - np.nan_to_num(low, nan=0.0), np.where(np.isnan(high), y, high) - y]
        centre = np.exp(np.log(x).mean())
        curve = np.exp(np.log(y).mean()) * (x / centre) ** law["exponent"]
        axes.plot(x, curve, color=colour, alpha=0.35, linewidth=1.2)
        axes.errorbar(
            x, y, whiskers, fmt="o", color=colour, markersize=6, capsize=3, label=f"{_SYMBOLS[name]} identified"
        )
        paper = [j[f"published_{name}"] for j in joints]
        axes.plot(x, paper, markersize=9, label="paper" if name == "k_y" else None, **_HOLLOW)
        ends = "95 %: {:.1f} to {:.1f}".format(*law["scatter_interval"])
        text = f"{_SYMBOLS[name]} $\\propto d^{{{law['exponent']:.1f}}}$  ({ends})"
        offset: dict[str, Any] = {"xytext": (0, -50), "textcoords": "offset points", "ha": "right"}
        axes.annotate(text, (x[-1], y[-1]), fontsize=9, color=colour, **offset)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xticks(x, [f"{value:g}" for value in x])
    axes.minorticks_off()
    set_up(axes, title, "tool diameter (mm)", "$k_y$ (N/m),  $k_\\theta$ (N m/rad)")


def _draw_torque(axes: Axes, results: dict[str, Any]) -> None:
    low, high = results["trends"]["torque_range_nm"]
    title = f"Change of stiffness from {low:g} to {high:g} N m, fitted line"
    diameters = sorted({trend["diameter_mm"] for trend in results["trends"]["torque"]})
    for trend in results["trends"]["torque"]:
        column = ("k_y", "k_theta").index(trend["quantity"])
        change, ends = trend["change_percent"], trend["interval"]
        x = diameters.index(trend["diameter_mm"]) + (-0.19, 0.19)[column]
        label = _SYMBOLS[trend["quantity"]] if trend["diameter_mm"] == diameters[0] else None
        alpha = 0.85 if trend["exceeds"] else 0.3
        axes.bar(x, change, 0.36, color=COLOURS[column], alpha=alpha, label=label)
        whiskers = [[0.0 if end is None else abs(change - end)] for end in ends]
        axes.errorbar(x, change, whiskers, color=INK, capsize=4, linewidth=1.2)
    axes.set_xticks(range(len(diameters)), [f"{value:g}" for value in diameters])
    axes.axhline(0.0, color=INK, linewidth=0.8)
    fine, coarse, change = results["settings"]["resolution"].values()
    note = f"whiskers: readings in steps of {fine:g} Hz,\n{coarse:g} Hz from {change / 1e3:g} kHz on"
    axes.text(0.99, 0.99, note, transform=axes.transAxes, ha="right", va="top", fontsize=8, color="0.6")
    set_up(axes, title, "tool diameter (mm)", "change (%)", room=0.16)


def _draw_transfer(axes: Axes, transfer: dict[str, Any]) -> None:
    keys = sorted({(row["diameter_mm"], row["overhang_mm"]) for row in transfer["rows"]})
    for index, key in enumerate(keys):
        rows = [row for row in transfer["rows"] if (row["diameter_mm"], row["overhang_mm"]) == key]
        for row in rows:
            x = index + 0.24 * (row["mode"] - (len(rows) + 1) / 2.0)
            ours, paper = row["error_percent"], row["published_error_percent"]
            axes.plot([x, x], [paper, ours], color="#CFCFCF", linewidth=1.2, zorder=1)
            axes.plot(x, paper, markersize=6, **_HOLLOW)
            axes.plot(x, ours, "o", color=COLOURS[row["mode"] + 1], markersize=7)
    for mode in sorted({row["mode"] for row in transfer["rows"]}):
        axes.plot([], [], "o", color=COLOURS[mode + 1], label=f"ours, mode {mode}")
    axes.plot([], [], label="paper", **_HOLLOW)
    axes.axhline(0.0, color=INK, linewidth=0.8)
    axes.set_xticks(range(len(keys)), [f"{d:g}\n{o:g}" for d, o in keys], fontsize=8)
    largest = max(max(abs(r["error_percent"]), abs(r["published_error_percent"])) for r in transfer["rows"])
    axes.set_ylim(-1.2 * largest, 1.7 * largest)  # room for the legend
    axes.plot(
        [], [], " ", label=f"rms: ours {transfer['rms_percent']:.2f} %, paper {transfer['published_rms_percent']:.2f} %"
    )
    set_up(axes, "Other overhangs: predicted against measured", "tool diameter / overhang (mm)", "error (%)")


def _draw_sets(axes: Axes, sets: list[dict[str, Any]]) -> None:
    set_up(axes, "Parameter sets of table 3: error per mode (%)")
    for row, chosen in enumerate(sets):
        for column, error in enumerate(chosen["errors"]):
            percent, refuted = error["error_percent"], error in chosen["refuted_by"]
            strength = min(1.0, np.log10(max(abs(percent), 1.0)) / 2.0) if refuted else 0.0
            red = (1.0 - 0.35 * strength, 0.85 - 0.62 * strength, 0.8 - 0.6 * strength)
            cell = Rectangle((column - 0.48, row - 0.46), 0.96, 0.92, facecolor=red if refuted else (0.93,) * 3)
            axes.add_patch(cell)
            colour, weight = "white" if strength > 0.6 else INK, "bold" if refuted else "normal"
            text = f"{percent:+.1f}"
            axes.text(column, row, text, ha="center", va="center", color=colour, fontsize=10, fontweight=weight)
    labels = [f"{error['overhang_mm']:g}\nmode {error['mode']}" for error in sets[0]["errors"]]
    axes.set_xlim(-0.5, len(labels) - 0.5)
    axes.set_ylim(len(sets) - 0.5, -0.5)
    axes.set_yticks(range(len(sets)), [chosen["set"].replace("_", " ") for chosen in sets], fontsize=9, color=INK)
    axes.set_xticks(range(len(labels)), labels, fontsize=8, color=INK)
    threshold = sets[0]["threshold_percent"]
    axes.set_xlabel(f"overhang (mm), mode; red: error above {threshold:.1f} %", color=INK)
    axes.tick_params(length=0)
    for spine in axes.spines.values():
        spine.set_visible(False)


def _draw_bias(axes: Axes, bias: dict[str, Any]) -> None:
    paper = [*bias["published_percent"], float(np.mean(bias["published_percent"]))]
    deviation = np.array([*bias["tool_deviation_percent"], bias["mean_deviation_percent"]])
    x = np.arange(len(paper))
    axes.use_sticky_edges = False
    for width, colour, label in _CHANCE:
        axes.bar(x, width * deviation, 0.7, bottom=-0.5 * width * deviation, color=colour, label=label)
    axes.plot(x, [*bias["percent"], bias["mean_percent"]], "o", color=BAD, markersize=8, label="ours")
    axes.plot(x, paper, markersize=7, label="paper", **_HOLLOW)
    axes.axhline(0.0, color=INK, linewidth=0.8)
    axes.set_xticks(x, [*(f"{d:g}" for d in bias["diameter_mm"]), "mean"])
    text = f"p = {bias['p_value']:.2g} for the mean, sign test p = {bias['sign_test_p_value']:.3g}"
    axes.plot([], [], " ", label=text)
    title = "First mode of the long tools against chance"
    set_up(axes, title, "tool diameter (mm)", "100 (predicted / measured - 1)  (%)", room=0.45)


def _draw_sources(axes: Axes, bias: dict[str, Any]) -> None:
    set_up(axes, "Sources of chance in that mean", "standard deviation of the mean (%)")
    rows = {_SOURCES[name]: value for name, value in bias["deviations_percent"].items()}
    rows["all,\nlinear"] = bias["mean_deviation_percent"]
    rows[f"all, {bias['simulation']['draws']}\nsimulations"] = bias["simulation"]["deviation_percent"]
    for index, (name, value) in enumerate(rows.items()):
        axes.barh(index, value, 0.62, color=COLOURS[0] if name.startswith("all") else "#BDD7E7")
        axes.text(value + 0.02, index, f"{value:.2f}", va="center", fontsize=9, color=INK)
    size = abs(bias["mean_percent"])
    axes.axvline(size, color=BAD, linewidth=1.5)
    axes.text(size - 0.03, -0.3, f"observed mean {bias['mean_percent']:+.2f} %", ha="right", fontsize=9, color=BAD)
    axes.set_yticks(range(len(rows)), list(rows), fontsize=9)
    axes.set_ylim(len(rows) - 0.4, -0.8)
    axes.set_xlim(0.0, 1.12 * max(size, *rows.values()))
