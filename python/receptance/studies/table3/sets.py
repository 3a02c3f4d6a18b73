"""Table 3's parameter sets against a simulated measurement: by hand, mode by mode, and by the likelihood."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from receptance.identification import Held, MeasuredFRF, hold
from receptance.identification.peaks import match_peaks

if TYPE_CHECKING:
    from receptance.assembly import Assembly
    from receptance.identification import Identification
    from receptance.studies.er32.tables import ParameterSet
    from receptance.studies.table3.machine import VirtualMachine

__all__ = ["SetMode", "SetVerdict", "judge_sets", "with_set"]

_DAMPINGS = ("joint.c_y", "joint.c_theta")


@dataclass(frozen=True, kw_only=True)
class SetMode:
    """One mode with a parameter set, against the simulated measurement.

    `true_hz` and `with_set_hz` are undamped natural frequencies of the same number; `peak` says whether the mode shows
    as a peak in the measured response, so that a person at the screen would read it.
    """

    mode: int
    true_hz: float
    with_set_hz: float
    peak: bool

    @property
    def percent(self) -> float:
        """With the set against the truth."""
        return 100.0 * (self.with_set_hz / self.true_hz - 1.0)


@dataclass(frozen=True, kw_only=True)
class SetVerdict:
    """One parameter set and one test.

    Attributes
    ----------
    name, k_y, k_theta
        The set.
    test : str
        Which test.
    modes : tuple of SetMode
        Within the band of the test.
    held : Held or None
        The best fit of everything else with the set's stiffnesses; None where no fit was made.
    """

    name: str
    k_y: float
    k_theta: float
    test: str
    modes: tuple[SetMode, ...]
    held: Held | None

    @property
    def reading_percent(self) -> float:
        """Reading accuracy from which on the set passes by hand: its largest error of a mode that shows as a peak."""
        return max((abs(mode.percent) for mode in self.modes if mode.peak), default=0.0)

    @property
    def all_modes_percent(self) -> float:
        """The same over all modes of the band, whether they show or not."""
        return max(abs(mode.percent) for mode in self.modes)

    def rejected(self, level: float) -> bool | None:
        """Whether the data reject it at the stated noise."""
        return None if self.held is None else self.held.rejected(level)


def judge_sets(machine: VirtualMachine, measured: MeasuredFRF, fit: Identification | None) -> tuple[SetVerdict, ...]:
    """Compare every set of table 3 with a measurement."""
    return tuple(_judge(machine, measured, fit, one) for one in machine.published.parameter_sets)


def with_set(assembly: Assembly, chosen: ParameterSet, dampings: dict[str, float]) -> Assembly:
    """Return an assembly with a set's stiffnesses and given dampings."""
    return assembly.replace({"joint.k_y": chosen.k_y, "joint.k_theta": chosen.k_theta, **dampings})


def _judge(
    machine: VirtualMachine, measured: MeasuredFRF, fit: Identification | None, chosen: ParameterSet
) -> SetVerdict:
    upper = float(measured.frequency_hz[-1])
    true = measured.assembly.natural_frequencies(upper)
    moved = with_set(measured.assembly, chosen, {name: machine.truth[name] for name in _DAMPINGS})
    ours = moved.natural_frequencies(3.0 * upper)[: true.size]
    read = match_peaks(measured.frequency_hz, measured.receptance, measured.receptance, measured.standard_deviation)
    peaks = [peak.measured_hz for peak in read if peak.measured_hz is not None]
    nearest = {int(np.abs(true - peak).argmin()) for peak in peaks} if true.size else set()
    held = None
    if fit is not None:
        held = hold(fit, {"joint.k_y": chosen.k_y, "joint.k_theta": chosen.k_theta})
    return SetVerdict(
        name=chosen.name,
        k_y=chosen.k_y,
        k_theta=chosen.k_theta,
        test=measured.label,
        modes=tuple(
            SetMode(mode=i + 1, true_hz=float(t), with_set_hz=float(o), peak=i in nearest)
            for i, (t, o) in enumerate(zip(true, ours, strict=True))
        ),
        held=held,
    )
