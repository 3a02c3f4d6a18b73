"""Which causes, alone or together, explain the data: every one refitted, then more added one at a time."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

from receptance.diagnosis.adequacy import Adequacy, judge
from receptance.diagnosis.causes import Cause, UndecidableError, Variant
from receptance.diagnosis.fitting import Fit, fit_base, refit
from receptance.diagnosis.model import Model
from receptance.diagnosis.screening import Direction, chance, directions
from receptance.errors import ReceptanceError

__all__ = ["Explanation", "Selection", "select"]

MARGIN = 10.0
"""What is within this much of the best evidence is reported with it."""
_WAYS = 3
"""Variants of one cause that are fitted, the most promising ones first."""
_ROOTS = 3
"""Explanations to which more causes are added."""
_MORE = 6
"""Causes that are tried in addition to each of them."""
_FRESH_FROM = 4.0
"""Other quantities are only tried where the base misses the data by more than this."""
_SETTLED = 1e-9


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
    found : list of Direction
        What the causes promised at the base.
    threshold : float
        Evidence that the best cause reaches by chance in one of a hundred diagnoses of an adequate model.
    undecidable : dict of str to str
        Causes that the data cannot speak about, and why.
    """

    base: Fit
    penalty: float
    threshold: float
    found: list[Direction]
    undecidable: dict[str, str]
    singles: list[Explanation] = field(default_factory=list)
    several: list[Explanation] = field(default_factory=list)

    @property
    def explanations(self) -> list[Explanation]:
        """All explanations, the best evidence first."""
        return sorted([*self.singles, *self.several], key=lambda one: -one.evidence)


def select(
    model: Model,
    causes: Sequence[Cause],
    *,
    seed: int = 0,
    threads: int | None = None,
    most: int = 2,
    base: Fit | None = None,
    progress: Callable[[str], None] | None = None,
) -> Selection:
    """Return what each cause, and causes together, make of the data.

    Parameters
    ----------
    model : Model
        Observations, unknowns and tolerances.
    causes : sequence of Cause
        Those to try.
    seed : int
        Of everything random.
    threads : int, optional
        As in `Assembly.receptance`; it changes no result.
    most : int
        How many causes may act together.
    base : Fit, optional
        The base where it is known.
    progress : callable, optional
        Is told what is being done.
    """
    say = progress or (lambda text: None)
    say("base model")
    base = base or fit_base(model, seed=seed, threads=threads)
    variants, undecidable = _variants(base.model, causes, base)
    found = directions(base, variants)
    penalty = math.log(max(base.independent, 2.0))
    selection = Selection(base, penalty, chance(found, penalty, seed=seed), found, undecidable)
    for direction in _chosen(found):
        say(f"{direction.cause.id}, {direction.variant.name}")
        one = _explained(selection, (), base, direction, seed, threads)
        if one is not None:
            selection.singles.append(one)
    selection.singles = _best_each(selection.singles)
    roots = selection.singles
    for _ in range(1, most):
        roots = _added(selection, roots, causes, seed, threads, say)
        if not roots:
            break
        selection.several += roots
    return selection


def _variants(
    model: Model, causes: Sequence[Cause], fit: Fit
) -> tuple[list[tuple[Cause, Variant]], dict[str, str]]:
    found: list[tuple[Cause, Variant]] = []
    undecidable: dict[str, str] = {}
    for cause in causes:
        try:
            own = cause.variants(model)
        except UndecidableError as error:
            undecidable[cause.id] = str(error)
            continue
        found += [(cause, variant) for variant in own if not variant.fresh or fit.misfit > _FRESH_FROM]
    return found, undecidable


def _chosen(found: Sequence[Direction]) -> list[Direction]:
    """Return the variants that are fitted: the most promising ones of each cause."""
    by_cause: dict[str, list[Direction]] = {}
    for one in found:
        by_cause.setdefault(one.cause.id, []).append(one)
    chosen = []
    for own in by_cause.values():
        ranked = sorted(own, key=lambda one: -one.score)
        chosen += ranked if own[0].variant.fresh else ranked[:_WAYS]
    return sorted(chosen, key=lambda one: -one.score)


def _starts(direction: Direction, values: dict[str, float]) -> list[dict[str, float]]:
    """Return where fits of a cause begin: at its null, where its direction points, and at ordinary sizes."""
    parameters = {name: direction.cause.parameter_of(name) for name in direction.names}
    null = {name: one.start for name, one in parameters.items()}
    starts = [null]
    if direction.step:
        starts.append({**null, **direction.step})
    starts.append({name: one.typical for name, one in parameters.items()})
    if any(one.lower < one.null for one in parameters.values() if not one.secondary):
        starts.append({n: 2 * one.null - one.typical if not one.secondary else one.typical for n, one in parameters.items()})
    different = [one for i, one in enumerate(starts) if one not in starts[:i]]
    return [{**values, **one} for one in different]


def _explained(
    selection: Selection,
    steps: tuple[tuple[Cause, str], ...],
    root: Fit,
    direction: Direction,
    seed: int,
    threads: int | None,
) -> Explanation | None:
    try:
        if direction.variant.fresh:
            fit = fit_base(direction.variant.model, seed=seed, threads=threads)
        else:
            fit = refit(direction.variant.model, _starts(direction, root.values), threads=threads)
    except ReceptanceError:
        return None
    base = selection.base
    own = sum(unknown.prior is None for unknown in fit.model.unknowns)
    count = max(own - sum(unknown.prior is None for unknown in base.model.unknowns), 1)
    gain = base.chi_square - fit.chi_square
    return Explanation(
        (*steps, (direction.cause, direction.variant.name)), fit, gain, gain - selection.penalty * count
    )


def _best_each(found: Sequence[Explanation]) -> list[Explanation]:
    """Return the best variant of each set of causes, the best evidence first."""
    best: dict[frozenset[str], Explanation] = {}
    for one in sorted(found, key=lambda one: -one.evidence):
        best.setdefault(one.ids, one)
    return list(best.values())


def _added(
    selection: Selection,
    roots: Sequence[Explanation],
    causes: Sequence[Cause],
    seed: int,
    threads: int | None,
    say: Callable[[str], None],
) -> list[Explanation]:
    """Return the best explanations with one cause more, where one more is worth anything."""
    if not roots or roots[0].evidence <= selection.threshold:
        return []
    found: list[Explanation] = []
    best = roots[0].evidence
    for root in roots[:_ROOTS]:
        if root.adequacy.passed and root.evidence < best - MARGIN:
            continue
        others = [cause for cause in causes if cause.id not in root.ids]
        variants, _ = _variants(root.fit.model, others, root.fit)
        directed = [one for one in directions(root.fit, variants) if not one.variant.fresh]
        ranked = _chosen([one for one in directed if one.score > selection.penalty * one.count])
        seen: dict[str, int] = {}
        for direction in ranked:
            seen[direction.cause.id] = seen.get(direction.cause.id, 0) + 1
            if len(seen) > _MORE or seen[direction.cause.id] > 1:
                continue
            say(f"{' + '.join(sorted(root.ids))} + {direction.cause.id}")
            one = _explained(selection, root.steps, root.fit, direction, seed, threads)
            if one is not None and one.evidence > root.evidence + max(selection.threshold, 0.0):
                found.append(one)
    return _best_each(found)
