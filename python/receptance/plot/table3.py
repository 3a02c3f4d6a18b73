"""The study of table 3 as a figure: the sets against two responses, and what the responses say of the joint."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from receptance.plot._style import BAD, COLOURS, INK, PALE, keep_clear, new_figure, set_up

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from receptance.identification import MeasuredFRF
    from receptance.studies.table3.sets import SetVerdict
    from receptance.studies.table3.study import Table3Study

__all__ = ["draw_table3"]

_DASHES = ("-", "--", "-.", ":")
_TOP = 3.0
_WIDE = 3.0
"""Factor around the truth that the profile of the machine alone is at least drawn over."""


def draw_table3(study: Table3Study) -> Figure:
    """Draw the four sets against the simulated responses, and the profiles before and after the free-free test.

    Parameters
    ----------
    study : Table3Study
        From `receptance.studies.table3.run`.

    Returns
    -------
    matplotlib.figure.Figure
        It belongs to no window; save it with `savefig`.
    """
    figure = new_figure(14.0, 9.4, math=True)
    keep_clear(figure, 0.94)
    title = "Table 3 found by the program: VIRTUAL, all measurements simulated"
    figure.text(0.5, 0.97, title, ha="center", va="center", fontsize=15, color=INK)
    panels = figure.subplots(2, 2)
    _responses(panels[0, 0], study, study.measured, study.sets, "In the machine")
    _responses(panels[0, 1], study, study.free, study.free_sets, study.chosen.name.capitalize())
    for axes, name in zip(panels[1], ("joint.k_y", "joint.k_theta"), strict=True):
        _profiles(axes, study, name)
    return figure


def _responses(
    axes: Axes, study: Table3Study, measured: MeasuredFRF, verdicts: tuple[SetVerdict, ...], title: str
) -> None:
    set_up(axes, title, "frequency (Hz)", "tip receptance (m/N)")
    lines = measured.frequency_hz.real
    axes.plot(lines, np.abs(measured.receptance), ".", color=PALE, markersize=3.0, label="simulated measurement")
    dampings = {name: study.machine.truth[name] for name in ("joint.c_y", "joint.c_theta")}
    for i, one in enumerate(verdicts):
        moved = measured.assembly.replace({"joint.k_y": one.k_y, "joint.k_theta": one.k_theta, **dampings})
        label = f"{one.name.replace('_', ' ')}: worst peak {one.reading_percent + 0.0:.2f} %"
        size = np.abs(moved.receptance(lines))
        axes.plot(lines, size, color=COLOURS[i], linewidth=1.2, linestyle=_DASHES[i], label=label)
    axes.set_yscale("log")
    low, high = axes.get_ylim()
    axes.set_ylim(low, 20.0 * high)
    axes.legend(fontsize=8, frameon=False, loc="upper right", ncols=2)


def _profiles(axes: Axes, study: Table3Study, name: str) -> None:
    unit = "N/m" if name.endswith("k_y") else "N m/rad"
    alone, both, truth = study.profiles[name], study.both_profiles[name], study.machine.truth[name]
    set_up(axes, name, f"value ({unit})", "rise of $-2\\,\\log L$")
    pairs = ((alone, COLOURS[0], "machine alone"), (both, COLOURS[1], f"with {study.chosen.name}"))
    for profile, colour, label in pairs:
        fine = np.geomspace(profile.values[0], profile.values[-1], 400)
        root = np.sqrt(profile.rise) * np.sign(profile.values - profile.value)
        rise = np.interp(np.log(fine), np.log(profile.values), root) ** 2
        axes.plot(fine, rise, color=colour, linewidth=1.4, label=f"{label}: {profile.statement}")
        axes.plot(profile.values, profile.rise, "o", color=colour, markersize=3.0)
    axes.axhline(alone.threshold, color=BAD, linewidth=1.0)
    axes.annotate(
        f"{100.0 * alone.level:g} %",
        (1.0, alone.threshold),
        xycoords=("axes fraction", "data"),
        xytext=(-2, 3),
        textcoords="offset points",
        ha="right",
        fontsize=9,
        color=BAD,
    )
    axes.axvline(truth, color=INK, linewidth=0.9, linestyle=":", label=f"simulated: {truth:.3g}")
    axes.set_xscale("log")
    inside = alone.values[alone.rise <= _TOP * alone.threshold]
    axes.set_xlim(min(inside[0], truth / 1.02), max(inside[-1], truth * 1.02))
    if inside[-1] < _WIDE * inside[0]:
        from matplotlib.ticker import LogFormatterSciNotation, MaxNLocator

        axes.xaxis.set_major_locator(MaxNLocator(6))
        axes.xaxis.set_major_formatter(LogFormatterSciNotation(labelOnlyBase=False, minor_thresholds=(np.inf, np.inf)))
        axes.xaxis.set_minor_locator(MaxNLocator(1))
    axes.set_ylim(-0.05 * alone.threshold, _TOP * alone.threshold)
    axes.legend(fontsize=8, frameon=True, framealpha=0.9, edgecolor="none", loc="upper center")
