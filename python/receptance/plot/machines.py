"""The case studies on two machines as a figure: tools predicted and true, as the seed's figures 16 and 17."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from receptance.plot._style import COLOURS, INK, PALE, keep_clear, new_figure, set_up

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from receptance.studies.machines.study import MachineCase, MachinesStudy
    from receptance.studies.machines.tips import Tip

__all__ = ["draw_machines"]

_REACH = 1.96
_TOP_HZ = 3500.0
_LENGTHS = {"medium": COLOURS[0], "long": COLOURS[1]}


def draw_machines(study: MachinesStudy) -> Figure:
    """Draw each diameter's medium and long tool on both machines, and how well the spindles are known.

    Parameters
    ----------
    study : MachinesStudy
        From `receptance.studies.machines.run`.

    Returns
    -------
    matplotlib.figure.Figure
        It belongs to no window; save it with `savefig`.
    """
    diameters = sorted({tip.tool.diameter_mm for tip in study.cases[0].tips})
    figure = new_figure(3.3 * (len(diameters) + 1), 7.6)
    keep_clear(figure, 0.9)
    title = "Tip responses in two machines: VIRTUAL, spindles and measurements simulated"
    figure.text(0.01, 0.965, title, va="center", fontsize=14, color=INK)
    said = "grey: true;  blue: medium tool and orange: long tool, predicted with 95 % bands from the identified spindle"
    figure.text(0.01, 0.925, said, va="center", fontsize=9.5, color=INK)
    panels = figure.subplots(2, len(diameters) + 1)
    for row, case in zip(panels, study.cases, strict=True):
        for axes, diameter in zip(row, diameters, strict=False):
            own = [tip for tip in case.tips if tip.tool.diameter_mm == diameter]
            _tool(axes, own, f"{case.machine.name.split()[0]}, {diameter:g} mm")
        _known(row[-1], case)
    return figure


def _tool(axes: Axes, tips: list[Tip], title: str) -> None:
    set_up(axes, title, "frequency [Hz]", "y/F [m/N]")
    for tip in tips:
        colour = _LENGTHS[tip.tool.length]
        size = np.abs(tip.predicted)
        reach = np.exp(_REACH * tip.deviation)
        axes.semilogy(tip.lines, np.abs(tip.true), color=PALE, linewidth=3.0, alpha=0.6)
        axes.fill_between(tip.lines, size / reach, size * reach, color=colour, alpha=0.25, linewidth=0)
        axes.semilogy(tip.lines, size, color=colour, linewidth=1.0)
    axes.set_xlim(0.0, _TOP_HZ)


def _known(axes: Axes, case: MachineCase) -> None:
    set_up(axes, "Spindle: usable lines", "frequency [kHz]", "share")
    places = [0.5e-3 * (one.low_hz + one.high_hz) for one in case.reach]
    axes.bar(places, [one.usable for one in case.reach], width=0.85, color=COLOURS[2], alpha=0.7)
    for one in case.short:
        axes.axvline(1e-3 * one.true_hz, color=INK, linewidth=1.0, linestyle="-" if one.known else ":")
    axes.set_ylim(0.0, 1.05)
    axes.text(0.02, 0.03, "lines: short tools' peaks", transform=axes.transAxes, fontsize=8, color=INK)
