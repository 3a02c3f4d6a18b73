"""The paper's two case studies on virtual machines: spindle from blanks, tools predicted, and where that fails."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from receptance.diagnosis import Verdict
from receptance.provenance import versions
from receptance.spindle import SpindleModes, SpindleReceptance, fit_spindle, identify_spindle
from receptance.studies.machines.close import Displaced, displaced, named
from receptance.studies.machines.machine import MACHINES, VirtualMachine, tools
from receptance.studies.machines.short import Reach, ShortTool, reach_of, short_tools
from receptance.studies.machines.tips import Peak, Tip, predict, predict_line_by_line

__all__ = ["MachineCase", "MachinesSettings", "MachinesStudy", "run"]


@dataclass(frozen=True, kw_only=True)
class MachinesSettings:
    """What the study takes as given.

    Parameters
    ----------
    hits : int
        Hammer hits of each test of the blank.
    band_hz : (float, float)
        In which the spindle is fitted and the tools are predicted.
    reach_hz : float
        How far up the spindle is looked at for the short tools.
    moved_percent : float
        How far a spindle's mode is off where two modes are close.
    seed : int
        Of all that is drawn.
    """

    hits: int = 10
    band_hz: tuple[float, float] = (150.0, 5000.0)
    reach_hz: float = 9000.0
    moved_percent: float = -3.0
    seed: int = 0

    def __post_init__(self) -> None:
        if self.hits < 3:
            raise ValueError(f"hits is {self.hits}, expected at least 3: the variance comes from their scatter")
        if self.seed < 0:
            raise ValueError(f"seed is {self.seed}, expected zero or more")


@dataclass(frozen=True, kw_only=True, eq=False)
class MachineCase:
    """What the study found on one machine; the machine and all measurements are simulated.

    Attributes
    ----------
    machine : VirtualMachine
        What was simulated.
    found : SpindleReceptance
        Its spindle line by line, in the band.
    modes : SpindleModes
        The same as modes.
    error, error_of_modes : float
        Median error of either against the true spindle, as a share; of the first on its usable lines.
    tips : tuple of Tip
        Medium and long tools, predicted with the modes.
    by_line : tuple of Tip
        The same line by line.
    reach : tuple of Reach
        How well the spindle is known up to high frequency.
    short : tuple of ShortTool
        The short tools.
    """

    machine: VirtualMachine
    found: SpindleReceptance
    modes: SpindleModes
    error: float
    error_of_modes: float
    tips: tuple[Tip, ...]
    by_line: tuple[Tip, ...]
    reach: tuple[Reach, ...]
    short: tuple[ShortTool, ...]

    @property
    def peaks(self) -> tuple[Peak, ...]:
        """All peaks of the medium and long tools."""
        return tuple(peak for tip in self.tips for peak in tip.peaks)


@dataclass(frozen=True, kw_only=True, eq=False)
class MachinesStudy:
    """Everything that the study found.

    Attributes
    ----------
    cases : tuple of MachineCase
        The two machines.
    mode : int
        The mode of the first machine's spindle that is then taken to be off.
    displaced : tuple of Displaced
        What that does to each peak.
    verdict : Verdict
        What `diagnose` says of tools measured there.
    """

    settings: MachinesSettings
    cases: tuple[MachineCase, ...]
    mode: int
    displaced: tuple[Displaced, ...]
    verdict: Verdict
    versions: dict[str, str]


def run(settings: MachinesSettings | None = None, *, progress: Callable[[str], None] | None = None) -> MachinesStudy:
    """Do both case studies.

    Parameters
    ----------
    settings : MachinesSettings, optional
        What is taken as given.
    progress : callable, optional
        Is told in words what is being done.

    Raises
    ------
    ValueError
        Settings without meaning.
    """
    chosen = settings or MachinesSettings()
    say = progress or (lambda _: None)
    cases = tuple(_case(machine, chosen, number, say) for number, machine in enumerate(MACHINES))
    first = cases[0]
    part = first.modes.part
    mode = _among_the_tools(first)
    say("one mode of the spindle off")
    off = displaced(first.machine, part, mode, chosen.moved_percent)
    verdict = named(first.machine, part, mode, chosen.moved_percent, seed=chosen.seed, progress=progress)
    return MachinesStudy(settings=chosen, cases=cases, mode=mode, displaced=off, verdict=verdict, versions=versions())


def _case(machine: VirtualMachine, chosen: MachinesSettings, number: int, say: Callable[[str], None]) -> MachineCase:
    say(f"hitting the blank, {machine.name}")
    tests = machine.hit(hits=chosen.hits, seed=2 * chosen.seed + number)
    observed = machine.observed(tests, *chosen.band_hz)
    found = identify_spindle(observed)
    say(f"fitting the spindle's modes, {machine.name}")
    modes = fit_spindle(observed, found)
    say(f"predicting tools, {machine.name}")
    wide = identify_spindle(machine.observed(tests, chosen.band_hz[0], chosen.reach_hz), allow_mismatch=True)
    lines = np.asarray(found.frequency_hz).real
    true = machine.matrix(lines)
    root = np.sqrt(np.abs(true[:, [0, 1], [0, 1]]))
    size = root[:, :, None] * root[:, None, :]
    return MachineCase(
        machine=machine,
        found=found,
        modes=modes,
        error=float(np.median((np.abs(found.matrix - true) / size)[found.usable])),
        error_of_modes=float(np.median(np.abs(modes.part.receptance(lines) - true) / size)),
        tips=tuple(predict(machine, tool, modes) for tool in tools("medium", "long")),
        by_line=tuple(predict_line_by_line(machine, tool, found) for tool in tools("medium", "long")),
        reach=reach_of(wide),
        short=short_tools(machine, wide),
    )


def _among_the_tools(case: MachineCase) -> int:
    """Return the spindle's mode that most of the tools' peaks are near to."""
    places = np.array([peak.true_hz for peak in case.peaks])
    near = [np.sum(np.abs(np.log(places / mode.frequency_hz)) < 0.1) for mode in case.modes.part.modes]
    return int(np.argmax(near))
