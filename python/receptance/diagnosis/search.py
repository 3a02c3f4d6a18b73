"""The search for causes: a loop over the neighbours of the best explanation.

    best = no cause
    repeat
        for all causes of `best`, and for all but one of them
            fit the model with these causes alone              (one is dropped)
            race the causes that can be added to them          (one is added, or exchanged for another one)
        best = the explanation with the highest evidence
    until `best` has no better neighbour

The linear effects of the causes order the rivals of a race (`race`), and leave out those that cannot gain.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from time import perf_counter

from receptance import _checks
from receptance.diagnosis.catalogue import ALTERNATIVES
from receptance.diagnosis.causes import Cause, Variant, extend
from receptance.diagnosis.explanation import Explanation, Selection, best_of_each
from receptance.diagnosis.fitting import Fit, continued, evaluate, fit_or_none, refit, with_null
from receptance.diagnosis.model import Model
from receptance.diagnosis.progress import Progress, in_parallel
from receptance.diagnosis.race import Neighbourhood, race
from receptance.diagnosis.screening import (
    Direction,
    detection_threshold,
    directions,
    first_of_each,
    in_common_basis,
    list_variants,
    look_alike,
    rank,
)
from receptance.diagnosis.starts import fit_again, fit_levels, has_levels
from receptance.diagnosis.thresholds import (
    ADDED_CAUSES,
    LEADING_CAUSES,
    LEAST_SHARE,
    LOOK_ALIKE,
    MARGIN,
    PREDICTED_SHARE,
    SCREENING_LIMIT,
)
from receptance.diagnosis.unknown_spindle import ChooseModes, beside_modes, lead_with_any_spindle, unstrained
from receptance.fit.adequacy import MISFIT_LIMIT
from receptance.fit.discrepancy import Discrepancy


def select(
    model: Model,
    causes: Sequence[Cause],
    *,
    max_causes: int = 2,
    progress: Progress | None = None,
    discrepancy: Discrepancy | None = None,
    fast: bool = False,
    beginning: Explanation | None = None,
    choose_modes: ChooseModes | None = None,
) -> Selection:
    """Return the fits of each cause, and of causes together.

    Parameters
    ----------
    model : Model
        Observations, unknowns and tolerances.
    causes : sequence of Cause
        The causes that are tried.
    max_causes : int
        Largest number of causes that act together.
    progress : Progress, optional
        Reports each step. A KeyboardInterrupt ends the selection with the results so far: `Selection.interrupted`.
    discrepancy : Discrepancy, optional
        The discrepancy that all fits allow for.
    fast : bool, optional
        Whether the alternatives are not fitted.
    beginning : Explanation, optional
        A single cause that explains the data. The base is fitted from its values, and its fit is one of those found.
    choose_modes : callable, optional
        Chooses the modes of unknown spindles. Where no single cause is adequate, the modes are chosen again beside each
        of the leading ones, and the selection starts again with those of the best.
    """
    report = progress or Progress()
    began = perf_counter()
    model = model if discrepancy is None else model.allow(discrepancy)
    try:
        base = fit_levels(model, partial(report, "base")) if beginning is None else refit(model, beginning.fit.values)
        interrupted = False
    except KeyboardInterrupt:
        base, interrupted = evaluate(model, {}), True
    # From here on the threads share the fits, and each fit has one.
    base = replace(base, model=replace(base.model, threads=1))
    selection = Selection(
        base,
        math.log(max(base.independent_values, 2.0)),
        interrupted=interrupted,
        workers=_checks.worker_count(model.threads),
        discrepancy=discrepancy,
        fast=fast,
    )
    if not interrupted:
        if beginning is not None:
            selection.add(selection.explain(beginning.variants, beginning.fit))
        again = Search(selection, causes, max_causes=max_causes, progress=report).run(model, choose_modes)
        if again is not None:
            without, best = again
            selection = select(without, causes, max_causes=max_causes, progress=progress, fast=fast, beginning=best)
    selection.seconds = perf_counter() - began
    return selection


class Search:
    """The loop over the neighbours of the best explanation, which adds explanations to a selection.

    A KeyboardInterrupt ends it; complete fits are kept.

    Parameters
    ----------
    selection : Selection
        With the fit of the base.
    causes, max_causes, progress
        As in `select`.
    """

    def __init__(
        self, selection: Selection, causes: Sequence[Cause], *, max_causes: int = 2, progress: Progress | None = None
    ) -> None:
        self.selection = selection
        self._causes = causes
        self._max_causes = max_causes
        self._report = progress or Progress()
        self._searched: dict[frozenset[Variant], float] = {}
        """Chi-square of the fits to which causes have been added, by their causes."""

    def run(self, model: Model, choose: ChooseModes | None = None) -> tuple[Model, Explanation] | None:
        """Run the loop, or return the model with other modes of an unknown spindle, and the cause to start again with.

        `model` is the one without a cause that is diagnosed, and `choose` as in `select`.
        """
        selection = self.selection
        try:
            if choose is not None:
                selection.base = unstrained(selection.base, model, choose)
            if choose is not None and selection.base.misfit > SCREENING_LIMIT:
                leading = lead_with_any_spindle(selection, self._causes, self._report)
                if again := beside_modes(selection, model, leading, choose, self._report):
                    return again
            self._race_singles()
            if choose is not None and not (selection.base.adequacy.passed or selection.adequate):
                least = LEAST_SHARE * (selection.base.chi_square - selection.base.expected_chi_square)
                singles = [single for single in selection.singles[:LEADING_CAUSES] if single.gain >= least]
                leading = [(single.variants[0], single.fit) for single in singles]
                if again := beside_modes(selection, model, leading, choose, self._report):
                    return again
            self._climb()
            if self._restart():
                self._climb()
            self._report.plan("together", 0)
            self._finish_best()
            # With a discrepancy alternatives follow when the evidence of the causes is final.
            if not selection.fast and selection.discrepancy is None:
                self.race_alternatives()
        except KeyboardInterrupt:
            selection.interrupted = True
        return None

    def _climb(self) -> None:
        """Race the neighbours of the best explanation until it has no better one."""
        selection = self.selection
        while selection.best is not None and selection.best.evidence >= selection.threshold - MARGIN:
            if self._is_searched(selection.best.variants, selection.best.fit):
                return
            self._searched[frozenset(selection.best.variants)] = selection.best.fit.chi_square
            for neighbourhood in self._neighbourhoods(selection.best):
                self._race(neighbourhood)

    def _is_searched(self, variants: Sequence[Variant], fit: Fit) -> bool:
        """Return whether causes have been added to a fit that is as good."""
        return self._searched.get(frozenset(variants), math.inf) <= fit.chi_square + MARGIN

    def _neighbourhoods(self, best: Explanation) -> Iterator[Neighbourhood]:
        """Yield the neighbourhoods of an explanation: with each cause dropped or exchanged, and with one cause more."""
        selection = self.selection
        if len(best.variants) == 1:
            yield self._others_alone(best)
        for dropped in best.variants if len(best.variants) > 1 else ():
            kept = tuple(variant for variant in best.variants if variant != dropped)
            root = self._refit(kept, best.fit.values)
            if root is not None:
                selection.evaluations += root.evaluations
                selection.add(selection.explain(kept, root))
                rivals = self._rivals(root, kept)
                same = [rival for rival in rivals if rival.cause.id == dropped.cause.id]
                others = _best_of_each_cause([rival for rival in rivals if rival.cause.id != dropped.cause.id])
                if self._is_searched(kept, root):
                    # Only other variants have not been added to the same fit.
                    same, others = [rival for rival in same if rival.variant != dropped], []
                self._searched[frozenset(kept)] = root.chi_square
                yield Neighbourhood(kept, root, [*same, *others[:ADDED_CAUSES]])
        if len(best.variants) < self._max_causes:
            rivals = _best_of_each_cause(self._rivals(best.fit, best.variants))
            # Far from the data predictions mean little.
            if best.fit.misfit <= SCREENING_LIMIT:
                limit = max(selection.threshold, 0.0)
                rivals = [rival for rival in rivals if rival.predicted_evidence(selection.penalty) > limit][
                    :ADDED_CAUSES
                ]
            least = best.evidence + max(selection.threshold, MARGIN)
            yield Neighbourhood(best.variants, best.fit, rivals, least=least)

    def _others_alone(self, best: Explanation) -> Neighbourhood:
        """Return the causes with an effect like that of a single one, and its other variants.

        The joint of the best explanation is closer to the solution than that of the base, from which the right cause
        may end in a local minimum.
        """
        selection = self.selection
        (variant,) = best.variants
        leading = next((each for each in selection.directions if each.variant == variant), None)
        rivals = [
            each
            for each in selection.directions
            if leading is not None
            and each.variant != variant
            and not each.cause.changes_data
            and (look_alike(each, leading) >= LOOK_ALIKE or (each.far and each.cause.id == variant.cause.id))
        ]
        return Neighbourhood((), selection.base, rank(rivals, selection.penalty), best.fit.values)

    def _refit(self, variants: Sequence[Variant], values: Mapping[str, float]) -> Fit | None:
        """Return the base with causes, fitted from values of unknowns; None where it has no value."""
        return fit_or_none(lambda: refit(extend(self.selection.base.model, variants), values))

    def _rivals(self, root: Fit, kept: Sequence[Variant]) -> list[Direction]:
        """Return the best variants of each cause that can be added to others, the highest predicted evidence first."""
        selection, ids = self.selection, {variant.cause.id for variant in kept}
        causes = [cause for cause in self._causes if cause.id not in ids and not cause.changes_data]
        extensions, _ = list_variants(root, causes)
        effects = directions(root, extensions, selection.workers)
        selection.evaluations += len(effects)
        return rank(effects, selection.penalty)

    def _race_singles(self) -> None:
        """Screen all causes, and race their best variants, except those that cannot gain where predictions are safe."""
        selection, base = self.selection, self.selection.base
        extensions, selection.undecidable = list_variants(base, self._causes)
        selection.directions = in_common_basis(directions(base, extensions, selection.workers))
        deviance = None
        if selection.discrepancy is not None:
            deviance = partial(selection.discrepancy.deviance, values=base.independent_values)
        selection.threshold = detection_threshold(
            selection.directions,
            selection.penalty,
            deviance=deviance,
            freedom=base.degrees_of_freedom,
            seed=base.model.seed,
        )
        selection.evaluations = base.evaluations + len(selection.directions)
        ranked = rank(selection.directions, selection.penalty)
        least = self._least_prediction(base, ranked)
        likely = [
            effect
            for effect in ranked
            # A parameter that only shapes the effect of others has none to first order.
            if effect.far
            or all(parameter.secondary for parameter in effect.parameters.values())
            or effect.predicted_evidence(selection.penalty) >= least
        ]
        self._race(Neighbourhood((), base, likely))
        unlikely = [effect for effect in ranked if effect not in likely]
        if unlikely and not (base.adequacy.passed or selection.adequate):
            # The predictions were wrong.
            self._race(Neighbourhood((), base, unlikely))
        raced = {single.variants[0].cause.id for single in selection.singles}
        # The others are listed with the gain that their linear effect predicts.
        others = [effect for effect in ranked if not effect.far and effect.cause.id not in raced]
        rest = _best_of_each_cause(others)
        selection.add(*(selection.explain((each.variant,), with_null(each.model, base), each.score) for each in rest))

    def _least_prediction(self, root: Fit, ranked: Sequence[Direction]) -> float:
        """Return the least predicted evidence of variants that race; minus infinity where predictions are unsafe.

        Effects are small on an adequate root, and where the linear effect of one variant explains the misfit.
        """
        selection = self.selection
        if selection.discrepancy is not None or not ranked:
            return -math.inf
        if root.adequacy.passed:
            return selection.threshold - MARGIN
        if root.chi_square - max(effect.score for effect in ranked) > MISFIT_LIMIT * root.expected_chi_square:
            return -math.inf
        return PREDICTED_SHARE * max(effect.predicted_evidence(selection.penalty) for effect in ranked)

    def _restart(self) -> bool:
        """Fit the best explanations from their own starting values, where none is adequate.

        The base may have led all other starts to a local minimum. With levels this includes the best cause together
        with each other one, fitted to one level first. Unknown modes have no other starts than those of the base.
        """
        selection = self.selection
        if selection.base.misfit <= MISFIT_LIMIT or selection.adequate or selection.base.model.unknown_modes:
            return False
        # The order by evidence means little here: the right cause can be last if all fits are in the wrong optimum. Far
        # from the data every cause is fitted again.
        levels = has_levels(selection.base.model)
        together = [each for each in selection.tried if selection.singles[0].ids <= each.ids] if levels else []
        is_far = selection.best is not None and selection.best.fit.misfit > SCREENING_LIMIT
        count = None if is_far else LEADING_CAUSES
        again = list(dict.fromkeys([*selection.explanations[:1], *selection.singles[:count], *together]))
        titles = [f"{each.title}, from its own starting values" for each in again]
        fits = [partial(fit_or_none, partial(fit_again, each.fit)) for each in again]
        for each, fit in zip(again, self._report.run("together", titles, fits, selection.workers), strict=True):
            if fit is not None:
                selection.evaluations += fit.evaluations
                selection.add(selection.explain(each.variants, fit))
        return True

    def _finish_best(self) -> None:
        """Continue the fits of explanations that may be reported and reached their limit of evaluations."""
        selection = self.selection
        best = selection.adequate or selection.best
        if best is None or best.evidence < max(selection.threshold, 0.0) - MARGIN:
            return
        # The best one may be left out of the answer, and others within the margin of the next one are then in it.
        near = [each for each in selection.explanations if each.evidence >= best.evidence - 2.0 * MARGIN]
        unfinished = [each for each in near if not each.fit.converged]
        fits = [partial(fit_or_none, partial(continued, each.fit)) for each in unfinished]
        for before, fit in zip(unfinished, in_parallel(fits, selection.workers), strict=True):
            if fit is not None:
                selection.evaluations += fit.evaluations - before.fit.evaluations
                others = [each for each in selection.explanations if each is not before]
                selection.explanations = best_of_each([selection.explain(before.variants, fit), *others])

    def race_alternatives(self) -> None:
        """Race changes that are not causes, where a cause may be reported: in place of all causes, and of each one."""
        selection = self.selection
        best = selection.best if selection.discrepancy else selection.adequate
        # No change of a structure changes the quantity of the data.
        if (
            best is None
            or best.evidence <= max(selection.threshold, 0.0)
            or any(variant.cause.changes_data for variant in best.variants)
        ):
            self._report.plan("alternatives", 0)
            return
        fewer = [tuple(each for each in best.variants if each != dropped) for dropped in best.variants]
        for kept in dict.fromkeys([(), *fewer]):
            root = self._refit(kept, best.fit.values) if kept else selection.base
            if root is None:
                continue
            extensions, _ = list_variants(root, ALTERNATIVES)
            effects = [effect for effect in directions(root, extensions, selection.workers) if effect.slopes.shape[1]]
            selection.evaluations += len(effects)
            ranked = rank(effects, selection.penalty)
            least = self._least_prediction(root, ranked)
            likely = [effect for effect in ranked if effect.predicted_evidence(selection.penalty) >= least]
            alternatives = Neighbourhood(kept, root, likely, best.fit.values, best.fit.chi_square, alternatives=True)
            for alternative in race(alternatives, selection, self._report):
                selection.alternatives = best_of_each([*selection.alternatives, alternative])

    def _race(self, neighbourhood: Neighbourhood) -> None:
        """Add the results of a race to the selection."""
        selection = self.selection
        for explanation in race(neighbourhood, selection, self._report):
            if math.isfinite(neighbourhood.least):
                selection.tried = best_of_each([*selection.tried, explanation])
            if explanation.evidence > neighbourhood.least:
                selection.add(explanation)


def _best_of_each_cause(rivals: Sequence[Direction]) -> list[Direction]:
    """Return the first variant of each cause."""
    return first_of_each(rivals, lambda rival: rival.cause.id)
