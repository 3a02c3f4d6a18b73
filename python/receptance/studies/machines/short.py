"""Why short tools fail: their modes lie where the hammer does not reach, and the spindle is not known there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from receptance.studies.machines.machine import tools
from receptance.studies.machines.tips import Tip, peaks_of, predict_line_by_line

if TYPE_CHECKING:
    from receptance.spindle import SpindleReceptance
    from receptance.studies.machines.machine import Tool, VirtualMachine

__all__ = ["Reach", "ShortTool", "reach_of", "short_tools"]

_WIDTH_HZ = 1000.0
_HIGHEST_HZ = 12e3
_NEAR = 0.01


@dataclass(frozen=True)
class Reach:
    """How well a spindle is known in a band.

    Attributes
    ----------
    low_hz, high_hz : float
        The band.
    usable : float
        Share of its lines that are usable.
    deviation : float
        Median standard deviation of the three terms, as a share of them.
    """

    low_hz: float
    high_hz: float
    usable: float
    deviation: float


@dataclass(frozen=True)
class ShortTool:
    """A short tool's highest peak, true and as it is predicted.

    Attributes
    ----------
    tool : Tool
        Which.
    true_hz : float
        Where its highest peak is.
    known : bool
        Whether the spindle has usable lines there.
    magnitude_percent, deviation_percent : float
        Error of the predicted height and its stated standard deviation; not numbers where nothing is predicted.
    """

    tool: Tool
    true_hz: float
    known: bool
    magnitude_percent: float
    deviation_percent: float


def reach_of(found: SpindleReceptance) -> tuple[Reach, ...]:
    """Return how well a spindle is known, kilohertz by kilohertz."""
    lines = np.asarray(found.frequency_hz).real
    root = np.sqrt(np.abs(found.matrix[:, [0, 1], [0, 1]]))
    relative = found.standard_deviation / (root[:, :, None] * root[:, None, :])
    result = []
    for low in np.arange(0.0, lines[-1], _WIDTH_HZ):
        rows = (lines >= low) & (lines < low + _WIDTH_HZ)
        if rows.any():
            result.append(
                Reach(
                    float(low),
                    float(low + _WIDTH_HZ),
                    float(found.usable[rows].mean()),
                    float(np.nanmedian(relative[rows])),
                )
            )
    return tuple(result)


def short_tools(machine: VirtualMachine, found: SpindleReceptance) -> tuple[ShortTool, ...]:
    """Return the short tools' highest peaks, predicted with the spindle line by line."""
    result = []
    for tool in tools("short"):
        fine = np.arange(2000.0, _HIGHEST_HZ, 4.0)
        true = np.abs(machine.true(tool).receptance(fine))
        at = peaks_of(true)
        highest = at[np.argmax(true[at])]
        tip = predict_line_by_line(machine, tool, found)
        result.append(_short(tip, float(fine[highest]), float(true[highest])))
    return tuple(result)


def _short(tip: Tip, true_hz: float, height: float) -> ShortTool:
    near = np.flatnonzero(np.abs(tip.lines / true_hz - 1.0) < _NEAR)
    if not near.size:
        return ShortTool(tip.tool, true_hz, False, float("nan"), float("nan"))
    best = near[np.argmax(np.abs(tip.predicted[near]))]
    error = 100.0 * (float(abs(tip.predicted[best])) / height - 1.0)
    return ShortTool(tip.tool, true_hz, True, error, 100.0 * float(tip.deviation[best]))
