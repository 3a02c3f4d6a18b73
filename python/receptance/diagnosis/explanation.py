"""Explanations of the data by causes, and the set of all explanations of a diagnosis."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property

from receptance.diagnosis.causes import Cause, Parameter, Variant, parameters_of
from receptance.diagnosis.fitting import DiscrepancyFit, Fit
from receptance.diagnosis.model import UndecidableError
from receptance.diagnosis.screening import Direction
from receptance.diagnosis.text import Size
from receptance.diagnosis.thresholds import BEHIND, BEHIND_SHARE, LISTED
from receptance.fit.adequacy import Adequacy, misfit_limit
from receptance.fit.discrepancy import Discrepancy


@dataclass(frozen=True, eq=False)
class Explanation:
    """Causes that act together, and the fit that includes them."""

    variants: tuple[Variant, ...]
    """The causes in the order in which they were added, each in one of its variants."""
    fit: Fit
    """The extended model at its best point."""
    gain: float
    """Decrease of chi-square relative to the base."""
    evidence: float
    """The gain less the penalty of its unknowns; about twice the logarithm of the odds."""
    expected: float = 0.0
    """The part of the gain that is predicted to first order and not fitted."""
    has_discrepancy: bool = False
    """Whether the fit allows for a discrepancy. Tolerances absorb a part of it, so their strain is no objection."""

    def with_gain(self, gain: float) -> Explanation:
        """Return it with another gain; the penalty is the same."""
        return replace(self, gain=gain, evidence=self.evidence + gain - self.gain)

    @property
    def ids(self) -> frozenset[str]:
        """Ids of the causes."""
        return frozenset(variant.cause.id for variant in self.variants)

    @property
    def title(self) -> str:
        """Names of the causes, in the order in which they were added."""
        return " + ".join(variant.cause.title for variant in self.variants)

    @property
    def place(self) -> str:
        """What an alternative is, and where, such as "a mass at 30 % of tool", after the causes beside it."""
        *causes, variant = self.variants
        return " + ".join([*(cause.cause.title for cause in causes), f"{variant.meaning} {variant.name}"])

    @property
    def adequacy(self) -> Adequacy:
        """Adequacy of the fit."""
        return self.fit.adequacy

    @cached_property
    def passed(self) -> bool:
        """Whether the fit is adequate."""
        # The misfit comes first, because the rest of the adequacy takes longer.
        if self.fit.misfit > misfit_limit(self.fit.expected_chi_square):
            return False
        return self.adequacy.of_lines if self.has_discrepancy else self.adequacy.passed

    @cached_property
    def parameters(self) -> dict[str, Parameter]:
        """Parameters of all its causes by the names of their unknowns."""
        found = parameters_of(self.fit.model.unknowns)
        # The model that is diagnosed may have the unknowns of an earlier diagnosis.
        return {name: one for name, one in found.items() if one.cause in self.ids}

    def sizes(self, cause: Cause) -> dict[str, float]:
        """Return the values of the parameters of a cause by the names of their unknowns."""
        return {
            name: self.fit.values[name] for name, parameter in self.parameters.items() if parameter.cause == cause.id
        }

    @property
    def negligible(self) -> frozenset[str]:
        """Ids of the causes all of whose sizes are negligible."""
        found = set()
        for variant in self.variants:
            sizes = [(self.parameters[name], value) for name, value in self.sizes(variant.cause).items()]
            if sizes and all(abs(value - one.null) < one.negligible for one, value in sizes):
                found.add(variant.cause.id)
        return frozenset(found)

    @property
    def implausible(self) -> tuple[str, ...]:
        """Names of the unknowns whose values lie outside their plausible range.

        Beside a discrepancy, which moves sizes, these are the unknowns whose 95 % interval has no plausible value.
        """
        outside = [
            name for name, parameter in self.parameters.items() if not parameter.is_plausible(self.fit.values[name])
        ]
        if not outside or not self.has_discrepancy:
            return tuple(outside)
        interval = self.fit.identification.interval
        return tuple(name for name in outside if not self.parameters[name].is_plausible(*interval(name)))

    def implausible_sizes(self, cause: Cause | None = None) -> list[Size]:
        """Return the sizes outside their plausible range, with this range: all, or those of a cause."""
        pairs = [(name, self.parameters[name]) for name in self.implausible]
        return [
            Size.of(name, parameter, self.fit.values[name], *parameter.plausible)
            for name, parameter in pairs
            if cause is None or parameter.cause == cause.id
        ]

    @property
    def extraordinary(self) -> tuple[str, ...]:
        """Names of the unknowns whose values are more than ordinary; see `Parameter.ordinary`."""
        values = self.fit.values
        return tuple(
            name
            for name, parameter in self.parameters.items()
            if abs(values[name] - parameter.null) > parameter.ordinary
        )

    @property
    def unusual(self) -> bool:
        """Whether it is implausible by its size alone, and not by the place where it acts."""
        return bool(self.implausible) and not any(self.parameters[name].secondary for name in self.implausible)


def best_of_each(found: Iterable[Explanation]) -> list[Explanation]:
    """Return the explanation with the highest evidence of each set of causes, the highest evidence first."""
    best: dict[frozenset[str], Explanation] = {}
    for one in sorted(found, key=lambda one: -one.evidence):
        best.setdefault(one.ids, one)
    return list(best.values())


def behind_limit(without: float, found: Iterable[float]) -> float:
    """Return the largest chi-square that an explanation may have to be fitted on all lines.

    It follows from chi-square without a cause and that of the explanations.
    """
    best = min([without, *found])
    return best + BEHIND + BEHIND_SHARE * (without - best)


@dataclass(eq=False)
class Selection:
    """All fits of a diagnosis.

    The evidence of every explanation is relative to `base`.
    """

    base: Fit
    """The model without causes."""
    penalty: float
    """Penalty of each unknown in evidence: the logarithm of the number of independent measured values, or of errors of
    modes beside a discrepancy."""
    threshold: float = 0.0
    """Evidence that the best cause reaches by chance in one of a thousand diagnoses of an adequate model."""
    directions: list[Direction] = field(default_factory=list)
    """Linear effects of the causes on the base."""
    undecidable: dict[str, UndecidableError] = field(default_factory=dict)
    """Causes that the data cannot show, and the reasons."""
    explanations: list[Explanation] = field(default_factory=list)
    """The best explanation by each set of causes, the highest evidence first."""
    tried: list[Explanation] = field(default_factory=list)
    """All explanations by several causes that were fitted, including those that are not better than one cause."""
    alternatives: list[Explanation] = field(default_factory=list)
    """Changes that are not causes, see `receptance.diagnosis.catalogue`."""
    evaluations: int = 0
    """Number of evaluations of all observations with derivatives, on few lines or on all."""
    seconds: float = 0.0
    """Duration in s."""
    interrupted: bool = False
    """Whether a KeyboardInterrupt ended it: later steps are missing, and not all fits have converged."""
    workers: int = 1
    """Number of fits that run at the same time."""
    discrepancy: Discrepancy | None = None
    """The discrepancy that all fits allow for."""
    beside: DiscrepancyFit | None = None
    """With `discrepancy`: the fit of the base with a discrepancy of its own."""
    fast: bool = False
    """Whether the alternatives are not fitted."""

    @property
    def absorbed(self) -> tuple[str, ...]:
        """Ids of causes whose typical size has too small an effect, because the other unknowns would absorb it.

        To first order, that is an increase of chi-square below the threshold. A cause with several variants is absorbed
        if all of them are.
        """
        largest: dict[str, float] = {}
        for direction in self.directions:
            if (gain := direction.typical_gain) is not None:
                largest[direction.cause.id] = max(largest.get(direction.cause.id, 0.0), gain)
        return tuple(id for id, gain in largest.items() if gain < self.threshold)

    def explain(self, variants: tuple[Variant, ...], fit: Fit, expected: float = 0.0) -> Explanation:
        """Return the explanation of a fit; `expected` is the further gain that is predicted of a complete fit."""
        causes = parameters_of(fit.model.unknowns)
        free = sum(unknown.prior is None for unknown in fit.model.unknowns if unknown.name not in causes)
        free += sum(parameter.penalised for parameter in causes.values())
        count = max(free - sum(unknown.prior is None for unknown in self.base.model.unknowns), 1)
        gain = self.gain(fit.chi_square - expected)
        # The choice among places is that of a place by chance: the look-elsewhere effect.
        penalty = self.penalty * count + 2.0 * sum(math.log(variant.choices) for variant in variants)
        return Explanation(variants, fit, gain, gain - penalty, expected, self.discrepancy is not None)

    def gain(self, chi_square: float) -> float:
        """Return the gain of a fit: twice the difference of the logarithms of the likelihoods.

        A discrepancy has a size of its own in each model.
        """
        if self.discrepancy is None:
            return self.base.chi_square - chi_square
        before, after = self.discrepancy.deviance([self.base.chi_square, chi_square], self.base.independent_values)
        return float(before - after)

    def share(self, one: Explanation) -> float:
        """Return the share of the misfit of the base that an explanation takes.

        Beside a discrepancy it is the share of the variance of the errors of modes, a geometric mean over their kinds.
        """
        if self.beside is None:
            return 1.0 - one.fit.chi_square / self.base.chi_square
        return -math.expm1(-max(one.gain, 0.0) / self.beside.errors)

    def add(self, *found: Explanation) -> None:
        """Add explanations; of each set of causes the best one is kept."""
        self.explanations = best_of_each([*self.explanations, *found])

    @property
    def evaluations_per_second(self) -> float:
        """Evaluations of all observations in one second, over the whole duration."""
        return self.evaluations / self.seconds if self.seconds else 0.0

    @property
    def singles(self) -> list[Explanation]:
        """Explanations by one cause, the highest evidence first."""
        return [explanation for explanation in self.explanations if len(explanation.variants) == 1]

    @property
    def held_out_singles(self) -> list[Explanation]:
        """Explanations by one cause whose own improvement on held-out data is measured."""
        return [single for single in self.singles if single.evidence > 0.0][:LISTED]

    @property
    def best(self) -> Explanation | None:
        """The explanation with the highest evidence."""
        return next(iter(self.explanations), None)

    @property
    def adequate(self) -> Explanation | None:
        """The adequate explanation with the highest evidence."""
        return next((explanation for explanation in self.explanations if explanation.passed), None)
