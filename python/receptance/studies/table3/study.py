"""Table 3 again, found by the program: what one tip response in the machine can say of the joint, and what helps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from receptance.identification import Identification, MeasuredFRF
from receptance.identification.profiles import Profile
from receptance.provenance import versions
from receptance.studies.table3.candidates import Candidate, Expected, expect, fit_all, half_width_percent
from receptance.studies.table3.machine import Measuring, VirtualMachine
from receptance.studies.table3.sets import SetVerdict, judge_sets

__all__ = ["Table3Settings", "Table3Study", "run"]

_ENOUGH_PERCENT = 10.0


@dataclass(frozen=True, kw_only=True)
class Table3Settings:
    """What the study takes as given.

    Parameters
    ----------
    measuring : Measuring
        Noise and lines of the simulated tests.
    level : float
        Level of intervals and rejections.
    seed : int
        Of the errors and the noise that are drawn, and of the starts.
    """

    measuring: Measuring = field(default_factory=Measuring)
    level: float = 0.95
    seed: int = 0

    def __post_init__(self) -> None:
        if not 0.0 < self.measuring.coherence < 1.0:
            raise ValueError(f"coherence is {self.measuring.coherence:g}, expected between 0 and 1")
        if self.measuring.averages < 2:
            raise ValueError(f"averages is {self.measuring.averages}, expected at least 2")
        if self.seed < 0:
            raise ValueError(f"seed is {self.seed}, expected zero or more")


@dataclass(frozen=True, kw_only=True)
class Table3Study:
    """Everything that the study found; all measurements in it are simulated.

    Attributes
    ----------
    machine : VirtualMachine
        What was simulated, with the true joint.
    errors : dict of str to float
        Errors of the things that were drawn, in standard deviations.
    measured : MeasuredFRF
        The tip response in the machine.
    alone : Identification
        The fit to it alone.
    profiles : dict of str to Profile
        What it says of every parameter.
    sets, free_sets : tuple of SetVerdict
        Table 3's sets against the response in the machine, and against the free one as well.
    expected : tuple of Expected
        Candidates for the next measurement, the best first.
    chosen : Candidate
        The free-free test of the same tool, which the seed made.
    free : MeasuredFRF
        Its simulated response.
    both : Identification
        The fit to both.
    both_profiles : dict of str to Profile
        What they say together.
    best : Candidate
        The candidate that promises most.
    best_profiles : dict of str to Profile
        What the machine's response says with it.
    """

    settings: Table3Settings
    machine: VirtualMachine
    errors: dict[str, float]
    measured: MeasuredFRF
    alone: Identification
    profiles: dict[str, Profile]
    sets: tuple[SetVerdict, ...]
    expected: tuple[Expected, ...]
    chosen: Candidate
    free: MeasuredFRF
    both: Identification
    both_profiles: dict[str, Profile]
    free_sets: tuple[SetVerdict, ...]
    best: Candidate
    best_profiles: dict[str, Profile]
    versions: dict[str, str]

    @property
    def closes(self) -> bool:
        """Whether the free-free test brings both stiffnesses under 10 %."""
        return all(half_width_percent(self.both_profiles[n]) < _ENOUGH_PERCENT for n in ("joint.k_y", "joint.k_theta"))

    def holds_truth(self, profiles: dict[str, Profile]) -> dict[str, bool]:
        """Return by parameter whether an interval holds the simulated value."""
        return {name: one.lower <= self.machine.truth[name] <= one.upper for name, one in profiles.items()}


def run(settings: Table3Settings | None = None, *, progress: Callable[[str], None] | None = None) -> Table3Study:
    """Do the study of table 3.

    Parameters
    ----------
    settings : Table3Settings, optional
        What is taken as given.
    progress : callable, optional
        Is told in words what is being done.

    Raises
    ------
    ValueError
        Settings without meaning.
    """
    chosen = settings or Table3Settings()
    say = progress or (lambda _: None)
    machine = VirtualMachine.load(chosen.measuring)
    random = np.random.default_rng(chosen.seed)
    first = Candidate("in the machine", machine.long_mm, free=False)
    free = Candidate(f"free-free at {machine.long_mm:g} mm", machine.long_mm, free=True)
    # All errors are drawn before anything is measured: a seed then means the same things whatever is measured later.
    places = {c.name: machine.assembly(c.overhang_mm, free=c.free) for c in (first, free)}
    errors = {one.name: float(random.standard_normal()) for one in machine.tolerances(places)}
    say("measuring in the machine")
    measured = _measured(machine, first, errors, random)
    say("identifying from it alone")
    alone = fit_all(machine, [measured], seed=chosen.seed)
    profiles = alone.profiles(level=chosen.level)
    say("holding table 3's sets against it")
    sets = judge_sets(machine, measured, alone)
    expected = expect(machine, [measured], alone, profiles["joint.k_y"], level=chosen.level, say=say)
    say("measuring free-free")
    free_measured = _measured(machine, free, errors, random)
    both = fit_all(machine, [measured, free_measured], near=alone.values, seed=chosen.seed)
    best = expected[0].candidate
    best_profiles = both.profiles(level=chosen.level)
    both_profiles = best_profiles
    if best != free:
        say(f"measuring {best.name}")
        errors[f"overhang, {best.name}"] = float(random.standard_normal())
        best_measured = _measured(machine, best, errors, random)
        best_fit = fit_all(machine, [measured, best_measured], near=alone.values, seed=chosen.seed)
        best_profiles = best_fit.profiles(level=chosen.level)
    return Table3Study(
        settings=chosen,
        machine=machine,
        errors=errors,
        measured=measured,
        alone=alone,
        profiles=dict(profiles),
        sets=sets,
        expected=expected,
        chosen=free,
        free=free_measured,
        both=both,
        both_profiles=dict(both_profiles),
        free_sets=judge_sets(machine, free_measured, both),
        best=best,
        best_profiles=dict(best_profiles),
        versions=versions(),
    )


def _measured(
    machine: VirtualMachine, what: Candidate, errors: dict[str, float], random: np.random.Generator
) -> MeasuredFRF:
    return machine.measure(
        what.name, what.overhang_mm, free=what.free, values=machine.truth, errors=errors, random=random
    )
