"""Which causes, alone or together, explain the data: every one refitted, then more added one at a time."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from receptance.diagnosis.adequacy import Adequacy, judge
from receptance.diagnosis.causes import Cause, UndecidableError, Variant
from receptance.diagnosis.fitting import Explored, Fit, explore, fit_base, refit
from receptance.diagnosis.model import Model
from receptance.diagnosis.screening import Direction, chance, directions
from receptance.errors import ReceptanceError
from receptance.identification.laws import Move
from receptance.identification.observations import MeasuredFRF

__all__ = ["Explanation", "Selection", "select"]

MARGIN = 10.0
"""What is within this much of the best evidence is reported with it."""
_WAYS = 3
"""Variants of one cause that are fitted, the most promising ones first."""
_ROOTS = 3
"""Explanations to which more causes are added."""
_MORE = 6
"""Causes that are tried in addition to each of them."""
_FRESH_FROM = 0.3
"""Other quantities are only tried where the logarithm of the receptance is off by more than this, in the median."""
_LARGE = 3.0
"""Large sizes from which fits begin are so many times the typical one."""
_SETTLED = 1e-9
_LEAST = 4
"""So many explanations are fitted on all lines in any case."""
_FAR = 60.0
_FAR_SHARE = 0.3
"""An explanation whose chi-square on few lines is worse than the best by more than this is only evaluated on all lines."""


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
    selection.singles = _fitted(selection, (), base, _chosen(found), seed, threads, say)
    selection = _rebased(selection, threads)
    roots = selection.singles
    for _ in range(1, most):
        roots = _added(selection, roots, causes, seed, threads, say)
        if not roots:
            break
        selection.several += roots
    return selection


def _rebased(selection: Selection, threads: int | None) -> Selection:
    """Return the selection with the base fitted from the best explanation too: a base that was stuck convicts nobody."""
    if not selection.singles:
        return selection
    base, best = selection.base, selection.singles[0]
    try:
        again = refit(base.model, best.fit.values, threads=threads)
    except ReceptanceError:
        return selection
    if again.chi_square >= base.chi_square - _SETTLED * base.chi_square:
        return selection
    less = base.chi_square - again.chi_square
    singles = [replace(one, gain=one.gain - less, evidence=one.evidence - less) for one in selection.singles]
    return replace(selection, base=again, singles=singles)


def _variants(model: Model, causes: Sequence[Cause], fit: Fit) -> tuple[list[tuple[Cause, Variant]], dict[str, str]]:
    found: list[tuple[Cause, Variant]] = []
    undecidable: dict[str, str] = {}
    for cause in causes:
        try:
            own = cause.variants(model)
        except UndecidableError as error:
            undecidable[cause.id] = str(error)
            continue
        found += [(cause, variant) for variant in own if not variant.fresh or _far_off(fit)]
    return found, undecidable


def _far_off(fit: Fit) -> bool:
    """Return whether receptances are off by factors, as only another quantity makes them."""
    parts = np.split(fit.residual, np.cumsum([part.size for part in fit.problem.residuals])[:-1])
    off = [
        float(np.median(np.abs(residual.reshape(2, -1)) * one.standard_deviation))
        for one, residual in zip(fit.model.observations, parts, strict=False)
        if isinstance(one, MeasuredFRF)
    ]
    return bool(off) and max(off) > _FRESH_FROM


def _chosen(found: Sequence[Direction]) -> list[Direction]:
    """Return the variants that are fitted: the most promising ones of each cause."""
    by_cause: dict[str, list[Direction]] = {}
    for one in found:
        by_cause.setdefault(one.cause.id, []).append(one)
    chosen = []
    for own in by_cause.values():
        ranked = sorted(own, key=lambda one: -one.score)
        # What has no number of its own promises nothing to first order, and is fitted in any case.
        chosen += [one for one in ranked if not one.names]
        chosen += [one for one in ranked if one.names][:_WAYS]
    return sorted(chosen, key=lambda one: -one.score)


def _starts(direction: Direction, fit: Fit) -> list[dict[str, float]]:
    """Return where fits of a cause begin: at its null, where its direction points, and at larger sizes.

    What has no number of its own changes the joint instead: its stiffnesses begin at several times what they were.
    """
    values = fit.values
    if not direction.names:
        joints = tuple(f"{name}.k_" for name in fit.model.joints)
        stiff = [u.name for u in fit.model.unknowns if u.address.startswith(joints) and not isinstance(u, Move)]
        return [{**values, **{name: times * values[name] for name in stiff}} for times in (1.0, 3.0, 10.0)]
    parameters = {name: direction.cause.parameter_of(name) for name in direction.names}
    null = {name: one.start for name, one in parameters.items()}
    starts = [null]
    if direction.step:
        starts.append({**null, **direction.step})
    for times in (_LARGE, -_LARGE):
        large = {
            name: one.typical
            if one.secondary
            else min(max(one.null + times * (one.typical - one.null), one.lower), one.upper)
            for name, one in parameters.items()
        }
        starts.append(large)
    different = [one for i, one in enumerate(starts) if one not in starts[:i]]
    return [{**values, **one} for one in different]


def _fitted(
    selection: Selection,
    steps: tuple[tuple[Cause, str], ...],
    root: Fit,
    chosen: Sequence[Direction],
    seed: int,
    threads: int | None,
    say: Callable[[str], None],
) -> list[Explanation]:
    """Return the explanations that add one cause each, the best variant of each, the best evidence first.

    All are explored on few lines. Those that come anywhere near the best one there are fitted on all lines; what is far
    off is only evaluated on them.
    """
    explored: list[tuple[Direction, Explored]] = []
    found: list[Explanation] = []
    for direction in chosen:
        say(f"{' + '.join([cause.id for cause, _ in steps] + [direction.cause.id])}, {direction.variant.name}")
        if direction.variant.fresh:
            try:
                fit = fit_base(direction.variant.model, seed=seed, threads=threads)
            except ReceptanceError:
                continue
            found.append(_explanation(selection, steps, direction, fit))
            continue
        there = explore(direction.variant.model, _starts(direction, root), threads=threads)
        if there.ends:
            explored.append((direction, there))
    explored.sort(key=lambda pair: pair[1].chi_square)
    best = explored[0][1].chi_square if explored else 0.0
    far = best + _FAR + _FAR_SHARE * (max((one.chi_square for _, one in explored), default=0.0) - best)
    for number, (direction, there) in enumerate(explored):
        near = number < _LEAST or there.chi_square <= far
        try:
            fit = there.finished() if near else there.evaluated()
        except ReceptanceError:
            continue
        found.append(_explanation(selection, steps, direction, fit))
    return _best_each(found)


def _explanation(
    selection: Selection, steps: tuple[tuple[Cause, str], ...], direction: Direction, fit: Fit
) -> Explanation:
    base = selection.base
    own = sum(unknown.prior is None for unknown in fit.model.unknowns)
    count = max(own - sum(unknown.prior is None for unknown in base.model.unknowns), 1)
    gain = base.chi_square - fit.chi_square
    return Explanation((*steps, (direction.cause, direction.variant.name)), fit, gain, gain - selection.penalty * count)


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
    best = roots[0]
    open_ = not best.adequacy.passed
    for root in roots[:_ROOTS]:
        # Where the best one leaves nothing to be explained, only its rivals are worth a second look.
        if root is not best and not open_ and root.evidence < best.evidence - MARGIN:
            continue
        others = [cause for cause in causes if cause.id not in root.ids]
        variants, _ = _variants(root.fit.model, others, root.fit)
        directed = [one for one in directions(root.fit, variants) if not one.variant.fresh]
        promising = [
            one for one in directed if one.score > selection.penalty * one.count + max(selection.threshold, 0.0)
        ]
        open_ = open_ or bool(promising)
        ranked = _chosen(promising)
        own: list[Direction] = []
        for direction in ranked:
            if len(own) < _MORE and all(direction.cause.id != other.cause.id for other in own):
                own.append(direction)
        for one in _fitted(selection, root.steps, root.fit, own, seed, threads, say):
            if one.evidence > root.evidence + max(selection.threshold, 0.0):
                found.append(one)
    return _best_each(found)
