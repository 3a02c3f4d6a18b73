"""Selection beside a discrepancy: the fits of causes to data that no model explains to their noise.

All fits of a selection allow for the same discrepancy. The evidence of the leading explanations is that of fits with
discrepancies of their own: a common one is larger than the errors that a right cause leaves, or smaller than those
without it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial

from receptance.diagnosis.causes import Cause, extend
from receptance.diagnosis.discrepancy import DiscrepancyFit, fit_discrepancy
from receptance.diagnosis.explanation import Explanation, Selection, best_of_each
from receptance.diagnosis.fitting import in_parallel, refit
from receptance.diagnosis.model import UndecidableError
from receptance.diagnosis.progress import Progress
from receptance.diagnosis.screening import detection_threshold
from receptance.diagnosis.selection import Search, select
from receptance.diagnosis.thresholds import DISCREPANCY_CAUSES, DISCREPANCY_SELECTIONS, LEADING_CAUSES
from receptance.errors import ReceptanceError


def select_beside(
    base: DiscrepancyFit, first: Selection, catalogue: Sequence[Cause], report: Progress
) -> tuple[Selection, DiscrepancyFit]:
    """Return the fits of each cause that allow for a discrepancy, and that of the base, which may be a better one.

    It is first that of the base, then that which the most likely cause leaves, until it no longer changes: a large
    effect of a cause in the discrepancy would hide the cause.

    Parameters
    ----------
    base : DiscrepancyFit
        The fit of the base.
    first : Selection
        The selection without a discrepancy.
    catalogue : sequence of Cause
        The causes that are tried.
    report : Progress
        Reports each step.
    """
    left = base.discrepancy
    for _ in range(DISCREPANCY_SELECTIONS):
        selection = select(base.model, catalogue, most=1, progress=report, discrepancy=left)
        if selection.interrupted:
            return selection, base
        selection.penalty = math.log(max(base.errors, 2.0))
        # Causes that lead without a discrepancy may be hidden by that of the base.
        leading = [*selection.singles[:DISCREPANCY_CAUSES], *first.singles[:LEADING_CAUSES]]
        found = _with_own_discrepancies(selection, base, leading)
        # The fit of the base may have ended in a local minimum.
        starts = [selection.base.values, *(fit.fit.values for _, fit in found[:1])]
        base = min((base, *(fit_discrepancy(base.model, one) for one in starts)), key=lambda one: one.deviance)
        own = [(one.with_gain(base.deviance - fit.deviance), fit.discrepancy) for one, fit in found]
        likely = max(own, key=lambda pair: pair[0].evidence, default=None)
        last, left = left, base.discrepancy if likely is None or likely[0].evidence <= 0.0 else likely[1]
        if left.is_close(last):
            break
    known = {one.ids for one, _ in own}
    others = [one for one in selection.explanations if one.ids not in known]
    selection.explanations = best_of_each([*others, *(one for one, _ in own)])
    selection.threshold = detection_threshold(
        selection.directions,
        selection.penalty,
        deviance=partial(last.deviance, values=base.errors),
        freedom=base.errors - (base.fit.independent_values - base.fit.degrees_of_freedom),
        seed=base.model.seed,
    )
    Search(selection, catalogue, progress=report).fit_alternatives()
    rivals = _with_own_discrepancies(selection, base, selection.alternatives)
    selection.alternatives = best_of_each(one.with_gain(base.deviance - fit.deviance) for one, fit in rivals)
    selection.beside = base
    return selection, base


def _with_own_discrepancies(
    selection: Selection, base: DiscrepancyFit, found: Sequence[Explanation]
) -> list[tuple[Explanation, DiscrepancyFit]]:
    """Return explanations with their fits that have discrepancies of their own, the most likely one first.

    The explanations are fitted from there with the discrepancy of the selection. Those that have no value are left out.
    """

    def fitted(one: Explanation) -> tuple[Explanation, DiscrepancyFit] | None:
        try:
            own = fit_discrepancy(extend(base.model, one.steps), one.fit.values)
            common = refit(extend(selection.base.model, one.steps), own.fit.values)
        except (ReceptanceError, UndecidableError):
            return None
        return selection.explain(one.steps, common), own

    pairs = in_parallel([partial(fitted, one) for one in found], selection.workers)
    return sorted((pair for pair in pairs if pair is not None), key=lambda pair: pair[1].deviance)


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
    base = fit_discrepancy(beside.model.without(configurations), selection.base.values)

    def fitted(one: Explanation) -> Explanation | None:
        try:
            own = fit_discrepancy(extend(beside.model, one.steps).without(configurations), one.fit.values)
        except (ReceptanceError, UndecidableError):
            return None
        return one.with_gain(base.deviance - own.deviance)

    both = [*selection.explanations, *selection.alternatives]
    found = list(in_parallel([partial(fitted, one) for one in both], selection.workers))
    count = len(selection.explanations)
    selection.beside = base
    selection.explanations = best_of_each(one for one in found[:count] if one is not None)
    selection.alternatives = best_of_each(one for one in found[count:] if one is not None)
