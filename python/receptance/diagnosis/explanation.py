"""What was fitted: explanations of the data by causes, and all of a diagnosis together."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

from receptance.diagnosis.adequacy import Adequacy, judge
from receptance.diagnosis.causes import Cause
from receptance.diagnosis.fitting import Fit
from receptance.diagnosis.screening import Direction

__all__ = ["MARGIN", "Explanation", "Selection"]

MARGIN = 10.0
"""What is within this much of the best evidence is reported with it."""


@dataclass(frozen=True, eq=False)
class Explanation:
    """Causes that act together, and the fit that has them.

    Attributes
    ----------
    steps : tuple of (Cause, str)
        The causes in the order of adding, each with the name of its variant.
    fit : Fit
        The extended model at its best point.
    evidence : float
        Decrease of chi-square against the base, less the penalty for its unknowns: twice the logarithm of odds, nearly.
    """

    steps: tuple[tuple[Cause, str], ...]
    fit: Fit
    gain: float
    evidence: float

    @property
    def ids(self) -> frozenset[str]:
        """Ids of the causes."""
        return frozenset(cause.id for cause, _ in self.steps)

    @cached_property
    def adequacy(self) -> Adequacy:
        """What it leaves."""
        return judge(self.fit)

    def sizes(self, cause: Cause) -> dict[str, float]:
        """Return the values of a cause's parameters by the names of its unknowns."""
        return {name: value for name, value in self.fit.values.items() if name.split(" ")[0].split(".")[0] == cause.id}

    @property
    def negligible(self) -> frozenset[str]:
        """Ids of the causes all of whose sizes are so small that nobody would mean them."""
        found = set()
        for cause, _ in self.steps:
            sizes = [(cause.parameter_of(name), value) for name, value in self.sizes(cause).items()]
            if sizes and all(abs(value - one.null) < one.least for one, value in sizes):
                found.add(cause.id)
        return frozenset(found)

    @property
    def implausible(self) -> tuple[str, ...]:
        """Names of sizes that nobody would believe."""
        return tuple(
            name
            for cause, _ in self.steps
            for name, value in self.sizes(cause).items()
            if not cause.parameter_of(name).believable(value)
        )


@dataclass(eq=False)
class Selection:
    """All that was fitted.

    Attributes
    ----------
    base : Fit
        The model as it was given.
    singles, several : list of Explanation
        Each cause alone, and causes together, the best evidence first.
    tried : list of Explanation
        All causes together that were fitted, those that added nothing too.
    found : list of Direction
        What the causes promised at the base.
    threshold : float
        Evidence that the best cause reaches by chance in one of a thousand diagnoses of an adequate model.
    undecidable : dict of str to str
        Causes that the data cannot speak about, and why.
    rivals : list of Explanation
        Changes that are no causes, and that a cause must not lose against; see `receptance.diagnosis.rivals`.
    evaluations : int
        How often all observations were calculated with their derivatives, on few lines or on all.
    seconds : float
        How long it took.
    interrupted : bool
        Whether it was ended by a KeyboardInterrupt: what was not reached is missing, and not all fits have ended.
    """

    base: Fit
    penalty: float
    threshold: float
    found: list[Direction]
    undecidable: dict[str, str]
    singles: list[Explanation] = field(default_factory=list)
    several: list[Explanation] = field(default_factory=list)
    tried: list[Explanation] = field(default_factory=list)
    rivals: list[Explanation] = field(default_factory=list)
    evaluations: int = 0
    seconds: float = 0.0
    interrupted: bool = False

    def explained(self, steps: tuple[tuple[Cause, str], ...], fit: Fit, more: float = 0.0) -> Explanation:
        """Return what a fit makes of the data; `more` is what it is expected to gain beyond that."""
        own = sum(unknown.prior is None for unknown in fit.model.unknowns)
        count = max(own - sum(unknown.prior is None for unknown in self.base.model.unknowns), 1)
        gain = self.base.chi_square - fit.chi_square + more
        return Explanation(steps, fit, gain, gain - self.penalty * count)

    @property
    def evaluations_per_second(self) -> float:
        """Evaluations of the whole model a second, everything else that was done included."""
        return self.evaluations / self.seconds if self.seconds else 0.0

    @property
    def explanations(self) -> list[Explanation]:
        """All explanations, the best evidence first."""
        return sorted([*self.singles, *self.several], key=lambda one: -one.evidence)
