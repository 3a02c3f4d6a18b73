"""Selection with a model discrepancy: the fits of causes to data that no model explains to their noise.

All fits of a selection allow for the same discrepancy. The evidence of the leading explanations is that of fits with
discrepancies of their own: a common one is larger than the errors that a right cause leaves, or smaller than those
without it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

from receptance.diagnosis.causes import Cause, Variant, extend
from receptance.diagnosis.explanation import Explanation, Selection, best_of_each
from receptance.diagnosis.fitting import DiscrepancyFit, fit_discrepancy, refit
from receptance.diagnosis.model import Model, UndecidableError
from receptance.diagnosis.progress import Progress, in_parallel
from receptance.diagnosis.screening import detection_threshold
from receptance.diagnosis.search import Search, select
from receptance.diagnosis.thresholds import DISCREPANCY_CAUSES, DISCREPANCY_SELECTIONS, LEADING_CAUSES
from receptance.errors import ReceptanceError
from receptance.fit.discrepancy import Discrepancy

_Own = dict[tuple[Variant, ...], DiscrepancyFit]
"""Fits with a discrepancy of their own, by the variants of causes."""


def select_with_discrepancy(
    base: DiscrepancyFit, first: Selection, catalogue: Sequence[Cause], report: Progress
) -> tuple[Selection, DiscrepancyFit]:
    """Return the fits of each cause that allow for a discrepancy, and that of the base, which may be a better one.

    The discrepancy is first that of the base, then that which the most likely cause leaves, until it no longer changes:
    a large effect of a cause in the discrepancy would hide the cause.

    Parameters
    ----------
    base : DiscrepancyFit
        The fit of the base.
    first : Selection
        The selection without a discrepancy.
    catalogue : sequence of Cause
        The causes that are tried.
    report : Progress
        Reports each step of the selections.
    """
    left = base.discrepancy
    tried: set[frozenset[str]] = set()
    own: _Own = {}
    for _ in range(DISCREPANCY_SELECTIONS):
        used = left
        selection = select(base.model, catalogue, max_causes=1, progress=report, discrepancy=used)
        if selection.interrupted:
            return selection, base
        # Causes that lead without a discrepancy may be hidden by that of the base.
        leading = [*selection.singles[:DISCREPANCY_CAUSES], *first.singles[:LEADING_CAUSES]]
        tried |= {one.ids for one in leading}
        for one, fit in zip(leading, _fits(base.model, base.fit.values, leading, selection.workers), strict=True):
            if fit is not None and (one.variants not in own or fit.deviance < own[one.variants].deviance):
                own[one.variants] = fit
        # The fit of the base may have ended in a local minimum.
        likely = min(own.values(), key=lambda fit: fit.deviance, default=base)
        base = _likeliest(base.model, (base.fit.values, selection.base.values, likely.fit.values)) or base
        selection.penalty = math.log(max(base.errors, 2.0))
        found = [(0.0, base.discrepancy)]
        for variants, fit in own.items():
            gain = base.deviance - fit.deviance
            found.append((selection.explain(variants, fit.fit).with_gain(gain).evidence, fit.discrepancy))
        left = max(found, key=lambda pair: pair[0])[1]
        if left.is_close(used):
            break
    _use_evidence(selection, base, own, tried)
    selection.beside = base
    selection.threshold = _threshold(selection, used, base)
    Search(selection, catalogue, progress=report).race_alternatives()
    fits = _fits(base.model, base.fit.values, selection.alternatives, selection.workers)
    pairs = zip(selection.alternatives, fits, strict=True)
    selection.alternatives = best_of_each(
        one.with_gain(base.deviance - fit.deviance) for one, fit in pairs if fit is not None
    )
    return selection, base


def _likeliest(model: Model, starts: Sequence[Mapping[str, float]]) -> DiscrepancyFit | None:
    """Return the most likely fit from several starts; None where the model has no value at any of them."""
    found = []
    for start in starts:
        try:
            found.append(fit_discrepancy(model, start))
        except ReceptanceError:
            continue
    return min(found, key=lambda one: one.deviance, default=None)


def _fits(
    model: Model,
    base: Mapping[str, float],
    found: Sequence[Explanation],
    workers: int,
    left_out: Sequence[str] = (),
) -> list[DiscrepancyFit | None]:
    """Return the fits of explanations with discrepancies of their own; None for those that have no value.

    Parameters
    ----------
    model : Model
        The model without causes.
    base : mapping of str to float
        Values of its fit, from which each explanation is fitted as well.
    found : sequence of Explanation
        The explanations.
    workers : int
        Number of fits that run at the same time.
    left_out : sequence of str
        Configurations that are not fitted.
    """
    single = replace(model, threads=1)

    def fitted(one: Explanation) -> DiscrepancyFit | None:
        try:
            extended = extend(single, one.variants)
        except UndecidableError:
            return None
        return _likeliest(extended.without(left_out), (one.fit.values, {**one.fit.values, **base}))

    return list(in_parallel([partial(fitted, one) for one in found], workers))


def _use_evidence(selection: Selection, base: DiscrepancyFit, own: _Own, tried: set[frozenset[str]]) -> None:
    """Replace the explanations that were tried by those with discrepancies of their own.

    These are fitted with the discrepancy of the selection, from the values of their own fits. The others were less
    likely with that discrepancy, and get no more evidence than these.
    """

    def fitted(variants: tuple[Variant, ...], fit: DiscrepancyFit) -> Explanation | None:
        try:
            common = refit(extend(selection.base.model, variants), fit.fit.values)
        except (ReceptanceError, UndecidableError):
            return None
        return selection.explain(variants, common).with_gain(base.deviance - fit.deviance)

    fits = in_parallel([partial(fitted, *one) for one in own.items()], selection.workers)
    found = [one for one in fits if one is not None]
    least = min((one.evidence for one in found), default=math.inf)
    for one in selection.explanations:
        if one.ids not in tried:
            # Exactly as much at most: of equal evidence those that were tried come first.
            excess = max(one.evidence - least, 0.0)
            found.append(replace(one, gain=one.gain - excess, evidence=min(one.evidence, least)))
    selection.explanations = best_of_each(found)


def _threshold(selection: Selection, used: Discrepancy, base: DiscrepancyFit) -> float:
    """Return the evidence that the best cause reaches by chance, for as many values as there are errors of modes."""
    unknowns = base.fit.independent_values - base.fit.degrees_of_freedom
    return detection_threshold(
        selection.directions,
        selection.penalty,
        deviance=partial(used.deviance, values=base.errors),
        freedom=base.errors - unknowns,
        seed=base.model.seed,
    )


def use_own_discrepancies(selection: Selection, beside: DiscrepancyFit, configurations: Sequence[str]) -> None:
    """Use the evidence of fits with discrepancies of their own in a selection without some configurations.

    Parameters
    ----------
    selection : Selection
        The selection; explanations that have no value are left out of it.
    beside : DiscrepancyFit
        The fit of the base to all configurations.
    configurations : sequence of str
        Names of the configurations that are left out.
    """
    base = _likeliest(beside.model.without(configurations), (selection.base.values, beside.fit.values))
    if base is None:
        return
    both = [*selection.explanations, *selection.alternatives]
    fits = _fits(beside.model, base.fit.values, both, selection.workers, configurations)
    found = [
        None if fit is None else one.with_gain(base.deviance - fit.deviance)
        for one, fit in zip(both, fits, strict=True)
    ]
    count = len(selection.explanations)
    selection.beside = base
    selection.explanations = best_of_each(one for one in found[:count] if one is not None)
    selection.alternatives = best_of_each(one for one in found[count:] if one is not None)
