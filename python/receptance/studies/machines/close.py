"""Two modes close together: what an error of the spindle's mode does to the tools, and whether it is named."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from receptance.coordinates import Coordinate
from receptance.diagnosis import Verdict, diagnose
from receptance.identification import MeasuredFRF, Tolerance, Unknown
from receptance.studies.machines.machine import tools
from receptance.studies.machines.tips import peaks_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from receptance.modal_parts import ModalPart
    from receptance.studies.machines.machine import Tool, VirtualMachine

__all__ = ["CAUSES", "Displaced", "displaced", "named"]

CAUSES = (
    "spindle_mode",
    "joint_cross_term",
    "joint_spread",
    "collet_mass",
    "overhang_error",
    "tool_modulus",
    "tool_density",
    "holder_modulus",
    "holder_inertia",
    "calibration_gain",
)
"""Causes that are weighed against each other; the command `diagnose` looks at the whole catalogue."""
_LINES = np.arange(200.0, 4500.0, 5.0)
_FINE = np.arange(200.0, 4500.0, 1.0)
_NOISE = 0.02
_DIAMETER_MM = 12.7
"""The tool whose medium length the paper misses in height on both machines."""


@dataclass(frozen=True)
class Displaced:
    """A tool's peak when one mode of the spindle is not where it was identified.

    Attributes
    ----------
    tool : Tool
        Which.
    true_hz : float
        Where the peak is.
    apart_percent : float
        How far from the spindle's mode.
    frequency_percent, magnitude_percent : float
        What the prediction is off by.
    """

    tool: Tool
    true_hz: float
    apart_percent: float
    frequency_percent: float
    magnitude_percent: float


def displaced(machine: VirtualMachine, spindle: ModalPart, mode: int, percent: float) -> tuple[Displaced, ...]:
    """Return what each peak is off by when a mode is predicted some percent off."""
    own = spindle.modes[mode].frequency_hz
    wrong = _moved(spindle, mode, percent)
    result = []
    for tool in tools("medium", "long"):
        true, off = (np.abs(machine.predicted(tool, one).receptance(_FINE)) for one in (spindle, wrong))
        found = peaks_of(off)
        for index in peaks_of(true):
            near = found[np.argmin(np.abs(found - index))]
            result.append(
                Displaced(
                    tool,
                    float(_FINE[index]),
                    100.0 * float(_FINE[index] / own - 1.0),
                    100.0 * float(_FINE[near] / _FINE[index] - 1.0),
                    100.0 * float(off[near] / true[index] - 1.0),
                )
            )
    return tuple(result)


def named(
    machine: VirtualMachine,
    spindle: ModalPart,
    mode: int,
    percent: float,
    *,
    seed: int,
    progress: Callable[[str], None] | None = None,
) -> Verdict:
    """Return the diagnosis of tools measured in a spindle one mode of which has moved since it was identified.

    The joint is what is identified; tip and nose of two lengths of one tool are measured, with noise.
    """
    random = np.random.default_rng(seed)
    described = _moved(spindle, mode, percent)
    observed, tolerances = (
        [],
        [Tolerance(name="carbide", moves={"tool.segment[0].youngs_modulus": 0.01}, relative=True)],
    )
    for tool in (one for one in tools("medium", "long") if one.diameter_mm == _DIAMETER_MM):
        tolerances.append(
            Tolerance(
                name=f"overhang, {tool.length}", moves={"tool.segment[0].length": 1e-4}, configurations=(tool.length,)
            )
        )
        for place in (Coordinate(), Coordinate("holder", 0.0)):
            noise = _NOISE * (random.normal(size=_LINES.size) + 1j * random.normal(size=_LINES.size))
            h = machine.predicted(tool, spindle).receptance(_LINES, response=place) * np.exp(noise)
            observed.append(
                MeasuredFRF(
                    assembly=machine.predicted(tool, described),
                    frequency_hz=_LINES,
                    receptance=h,
                    response=place,
                    standard_deviation=_NOISE,
                    label=f"{tool.length}, {place.part or 'tip'}",
                    configuration=tool.length,
                )
            )
    unknowns = [
        Unknown(address="joint.k_y", lower=1e7, upper=1e10),
        Unknown(address="joint.k_theta", lower=1e3, upper=1e7),
        Unknown(address="joint.loss_factor", lower=1e-3, upper=0.3),
    ]
    return diagnose(observed, unknowns, tolerances=tolerances, causes=CAUSES, seed=seed, progress=progress)


def _moved(spindle: ModalPart, mode: int, percent: float) -> ModalPart:
    own = f"mode[{mode}].frequency_hz"
    return spindle.with_values({own: spindle.value(own) * (1.0 + 0.01 * percent)})
