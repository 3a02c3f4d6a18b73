"""The clamping studies as a figure, virtual ones labelled so."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from receptance.plot._style import BAD, COLOURS, INK, PALE, keep_clear, new_figure, set_up
from receptance.studies.clamping.insertion import INSERTIONS_MM

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from receptance.studies.clamping.study import ClampingStudy

__all__ = ["draw_clamping"]

_MARKS = ("o", "s", "^", "D", "v")


def draw_clamping(study: ClampingStudy) -> Figure:
    """Draw all clamping studies.

    Parameters
    ----------
    study : ClampingStudy
        From `receptance.studies.clamping.run`.

    Returns
    -------
    matplotlib.figure.Figure
        It belongs to no window; save it with `savefig`.
    """
    figure = new_figure(16.0, 9.6)
    keep_clear(figure, 0.94)
    figure.text(0.5, 0.97, "Clamping of an ER32 collet holder", ha="center", va="center", fontsize=15, color=INK)
    panels = figure.subplots(2, 3)
    _series(panels[0, 0])
    _evidence(panels[0, 1], study)
    _material(panels[0, 2], study)
    _damping(panels[1, 0], study)
    _torque(panels[1, 1], study)
    _diameter(panels[1, 2], study)
    return figure


def _series(axes: Axes) -> None:
    set_up(axes, "VIRTUAL: what eq. 15 leaves of the insertion", "k2 / k1 at full insertion", "change 40 to 20 mm (%)")
    ratio = np.geomspace(0.1, 1000.0, 200)
    half = INSERTIONS_MM[-1] / INSERTIONS_MM[0]
    for i, (name, exponent) in enumerate((("k_y, as the length", 1.0), ("k_theta, as its cube", 3.0))):
        share = half**exponent
        change = 100.0 * ((1.0 + 1.0 / ratio) / (1.0 + 1.0 / (ratio * share)) - 1.0)
        axes.plot(ratio, change, color=COLOURS[i], linewidth=1.6, label=name)
    axes.axhline(-10.0, color=BAD, linewidth=1.0, linestyle=":")
    axes.annotate("10 %", (0.12, -10.0), xytext=(0, 4), textcoords="offset points", fontsize=9, color=BAD)
    axes.set_xscale("log")
    axes.legend(fontsize=9, frameon=False, loc="lower right")


def _evidence(axes: Axes, study: ClampingStudy) -> None:
    title = "VIRTUAL: which law the data ask for"
    set_up(axes, title, "k2 / k1 of the simulation", "log evidence behind the best")
    cases = study.insertion.cases
    names = sorted({one.name for case in cases for one in case.hypotheses})
    for i, name in enumerate(names):
        behind = []
        for case in cases:
            own = next(one for one in case.hypotheses if one.name == name)
            behind.append(case.hypotheses[0].log_evidence - own.log_evidence)
        at = np.arange(len(cases)) + 0.12 * (i - 0.5 * (len(names) - 1))
        values = np.where(np.isfinite(behind), behind, np.nan)
        axes.plot(at, values, _MARKS[i], color=COLOURS[i], markersize=7, label=name)
    axes.set_xticks(range(len(cases)), [f"{case.ratio:g}" for case in cases])
    axes.set_yscale("symlog", linthresh=1.0)
    axes.set_ylim(1e4 * max(axes.get_ylim()), -0.6)
    axes.legend(fontsize=7, frameon=False, loc="lower left", ncols=2, columnspacing=0.8, handletextpad=0.2)


def _material(axes: Axes, study: ClampingStudy) -> None:
    set_up(
        axes, "VIRTUAL: what a slip in the steel blank makes", "tool diameter (mm)", "apparent change of k_theta (%)"
    )
    for i, slip in enumerate(dict.fromkeys(one.slip for one in study.material.changes)):
        own = [one for one in study.material.changes if one.slip == slip]
        values = [one.k_theta_percent for one in own]
        axes.plot([one.diameter_mm for one in own], values, marker=_MARKS[i], color=COLOURS[i], label=slip)
    axes.axhline(0.0, color=INK, linewidth=0.8)
    for side in (-45.0, 45.0):
        axes.axhline(side, color=BAD, linewidth=1.0, linestyle=":")
    note = "claimed: over 45 % (sign not in words)"
    axes.annotate(note, (8.0, 45.0), xytext=(0, 4), textcoords="offset points", fontsize=9, color=BAD)
    axes.set_ylim(-60.0, 85.0)
    axes.legend(fontsize=8, frameon=False, loc="upper right", ncols=2)


def _damping(axes: Axes, study: ClampingStudy) -> None:
    title = "VIRTUAL: interface damping neglected"
    set_up(axes, title, "damping, times table 3's", "least real part too large by (%)")
    for i, test in enumerate(study.damping.allowed):
        own = [case for case in study.damping.cases if case.test == test]
        values = [max(case.real_percent, 1e-3) for case in own]
        axes.plot([case.factor for case in own], values, marker=_MARKS[i], color=COLOURS[i], label=test)
    axes.axhline(study.damping.worth_percent, color=BAD, linewidth=1.0, linestyle=":")
    axes.set_xscale("log")
    axes.set_yscale("log")
    low, high = axes.get_ylim()
    axes.set_ylim(low, 100.0 * high)
    axes.legend(fontsize=8, frameon=False, loc="upper left")


def _torque(axes: Axes, study: ClampingStudy) -> None:
    low, high = study.trends.torque_range_nm
    title = f"Published: growth of k_y, {low:g} to {high:g} N m"
    set_up(axes, title, "tool diameter (mm)", "change (%)")
    at = np.arange(len(study.torque))
    for i, (name, laws) in enumerate(
        (
            ("power law with scatter", [one.law for one in study.torque]),
            ("the same, clamped anew each time", [one.reclamped for one in study.torque]),
        )
    ):
        for x, law in zip(at, laws, strict=True):
            change, least, most = law.change_percent(low, high)
            colour = COLOURS[i]
            place = x + 0.16 * (i + 0.5)
            axes.plot([place, place], [least, most], color=colour, linewidth=2.4, alpha=0.5)
            filled = colour if law.told else "white"
            axes.plot(place, change, _MARKS[i], markerfacecolor=filled, markeredgecolor=colour, markersize=6)
        axes.plot([], [], _MARKS[i], color=COLOURS[i], label=name)
    for x, one in zip(at, study.torque, strict=True):
        ends = [value if value is not None else np.nan for value in one.trend.interval]
        axes.plot([x - 0.16, x - 0.16], ends, color=PALE, linewidth=5.0, solid_capstyle="butt")
    axes.plot([], [], color=PALE, linewidth=5.0, label="what the resolution leaves open")
    axes.plot([], [], "o", markerfacecolor="white", markeredgecolor=INK, label="hollow: not told from scatter")
    axes.axhline(0.0, color=INK, linewidth=0.8)
    axes.set_xticks(at, [f"{one.diameter_mm:g}" for one in study.torque])
    bottom, top = axes.get_ylim()
    axes.set_ylim(bottom, top + 0.5 * (top - bottom))
    axes.legend(fontsize=8, frameon=False, loc="upper left")


def _diameter(axes: Axes, study: ClampingStudy) -> None:
    set_up(axes, "Published: exponent over diameter", "exponent of the diameter", "")
    axes.grid(visible=False, axis="y")
    for row, law in enumerate(study.diameter):
        low, high = law.interval
        axes.plot([low, high], [row, row], color=COLOURS[row], linewidth=3.0, alpha=0.5)
        axes.plot(law.exponent, row, "o", color=COLOURS[row], markersize=7)
        text = f"scatter {law.scatter_percent:.0f} %, log evidence {law.log_evidence:+.1f} against a constant"
        axes.annotate(text, (0.0, row), xytext=(8, 12), textcoords="offset points", fontsize=9)
    axes.axvline(0.0, color=INK, linewidth=0.8)
    axes.set_yticks(range(len(study.diameter)), [law.quantity for law in study.diameter])
    axes.set_ylim(-0.6, len(study.diameter) - 0.3)
