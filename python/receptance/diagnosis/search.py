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
from receptance.diagnosis.alternatives import ALTERNATIVES
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
    ADDED_EVIDENCE,
    LEADING_CAUSES,
    LEAST_SHARE,
    LOOK_ALIKE,
    MARGIN,
    OVERSTATED,
    PREDICTED_SHARE,
    ROOTS,
    SCREENING_LIMIT,
)
from receptance.diagnosis.unknown_spindle import ChooseModes, beside_modes, lead_with_any_spindle, unstrained
from receptance.fit.adequacy import MISFIT_LIMIT
from receptance.fit.discrepancy import Discrepancy
from receptance.fit.problem import CONVERGED


def select(
    model: Model,
    causes: Sequence[Cause],
    *,
    max_causes: int = 2,
    progress: Progress | None = None,
    discrepancy: Discrepancy | None = None,
    fast: bool = False,
    known: Explanation | None = None,
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
    known : Explanation, optional
        A single cause that explains the data. The base is fitted from its values, and its fit is one of those found.
    choose_modes : callable, optional
        Chooses the modes of unknown spindles. Where no single cause is adequate, the modes are chosen again beside each
        of the leading ones, and the selection starts again with those of the best.
    """
    report = progress or Progress()
    began = perf_counter()
    model = model if discrepancy is None else model.allow(discrepancy)
    try:
        base = fit_levels(model, partial(report, "base")) if known is None else refit(model, known.fit.values)
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
        if known is not None:
            selection.add(selection.explain(known.variants, known.fit))
        again = Search(selection, causes, max_causes=max_causes, progress=report).run(model, choose_modes)
        if again is not None:
            without, best = again
            selection = select(without, causes, max_causes=max_causes, progress=progress, fast=fast, known=best)
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
        own = self.selection
        try:
            if choose is not None:
                own.base = unstrained(own.base, model, choose)
            if choose is not None and own.base.misfit > SCREENING_LIMIT:
                leading = lead_with_any_spindle(own, self._causes, self._report)
                if again := beside_modes(own, model, leading, choose, self._report):
                    return again
            self._race_singles()
            if choose is not None and not (own.base.adequacy.passed or own.adequate):
                least = LEAST_SHARE * (own.base.chi_square - own.base.expected_chi_square)
                singles = [single for single in own.singles[:LEADING_CAUSES] if single.gain >= least]
                leading = [(single.variants[0], single.fit) for single in singles]
                if again := beside_modes(own, model, leading, choose, self._report):
                    return again
            self._climb()
            if self._restart():
                self._climb()
            self._report.plan("together", 0)
            self._finish_best()
            # With a discrepancy alternatives follow when the evidence of the causes is final.
            if not own.fast and own.discrepancy is None:
                self.race_alternatives()
        except KeyboardInterrupt:
            own.interrupted = True
        return None

    def _climb(self) -> None:
        """Race the neighbours of the best explanation until it has no better one."""
        own = self.selection
        while own.best is not None and own.best.evidence >= own.threshold - MARGIN:
            if self._searched.get(frozenset(own.best.variants), math.inf) <= own.best.fit.chi_square + MARGIN:
                return
            self._searched[frozenset(own.best.variants)] = own.best.fit.chi_square
            for neighbourhood in self._neighbourhoods(own.best):
                self._race(neighbourhood)

    def _neighbourhoods(self, best: Explanation) -> Iterator[Neighbourhood]:
        """Yield the neighbourhoods of an explanation: with each cause dropped or exchanged, and with one cause more."""
        own = self.selection
        if len(best.variants) == 1:
            yield self._others_alone(best)
        else:
            for dropped in best.variants:
                kept = tuple(variant for variant in best.variants if variant != dropped)
                root = self._refit(kept, best.fit.values)
                if root is not None:
                    own.evaluations += root.evaluations
                    own.add(own.explain(kept, root))
                    rivals = self._rivals(root, kept)
                    same = [rival for rival in rivals if rival.cause.id == dropped.cause.id]
                    others = _best_of_each_cause([rival for rival in rivals if rival.cause.id != dropped.cause.id])
                    if self._searched.get(frozenset(kept), math.inf) <= root.chi_square + MARGIN:
                        # Only other variants have not been added to the same fit.
                        same, others = [rival for rival in same if rival.variant != dropped], []
                    yield Neighbourhood(kept, root, [*same, *others[:ADDED_CAUSES]])
        if len(best.variants) < self._max_causes and not (best.passed and best.fit.misfit < OVERSTATED):
            rivals = _best_of_each_cause(self._rivals(best.fit, best.variants))
            # Far from the data predictions mean little.
            if best.fit.misfit <= SCREENING_LIMIT:
                limit = max(own.threshold, 0.0)
                rivals = [rival for rival in rivals if rival.predicted_evidence(own.penalty) > limit][:ADDED_CAUSES]
            least = best.evidence + max(own.threshold, ADDED_EVIDENCE)
            yield Neighbourhood(best.variants, best.fit, rivals, least=least)

    def _others_alone(self, best: Explanation) -> Neighbourhood:
        """Return the causes with an effect like that of a single one, and its other variants.

        The joint of the best explanation is closer to the solution than that of the base, from which the right cause
        may end in a local minimum.
        """
        own = self.selection
        self._refit_base(best)
        (variant,) = best.variants
        leading = next((each for each in own.directions if each.variant == variant), None)
        rivals = [
            each
            for each in own.directions
            if leading is not None
            and each.variant != variant
            and not each.cause.changes_data
            and (look_alike(each, leading) >= LOOK_ALIKE or (each.far and each.cause.id == variant.cause.id))
        ]
        return Neighbourhood((), own.base, rank(rivals, own.penalty), best.fit.values)

    def _refit_base(self, best: Explanation) -> None:
        """Fit the base from an explanation, and replace it if that is better: it may be in a local minimum."""
        again = self._refit((), best.fit.values)
        if again is not None and again.chi_square < self.selection.base.chi_square - CONVERGED:
            self.selection.replace_base(again)

    def _refit(self, variants: Sequence[Variant], values: Mapping[str, float]) -> Fit | None:
        """Return the base with causes, fitted from values of unknowns; None where it has no value."""
        return fit_or_none(lambda: refit(extend(self.selection.base.model, variants), values))

    def _rivals(self, root: Fit, kept: Sequence[Variant]) -> list[Direction]:
        """Return the best variants of each cause that can be added to others, the highest predicted evidence first."""
        own, ids = self.selection, {variant.cause.id for variant in kept}
        causes = [cause for cause in self._causes if cause.id not in ids and not cause.changes_data]
        extensions, _ = list_variants(root, causes)
        effects = directions(root, extensions, own.workers)
        own.evaluations += len(effects)
        return rank(effects, own.penalty)

    def _race_singles(self) -> None:
        """Screen all causes, and race their best variants, except those that cannot gain where predictions are safe."""
        own, base = self.selection, self.selection.base
        extensions, own.undecidable = list_variants(base, self._causes)
        own.directions = in_common_basis(directions(base, extensions, own.workers))
        deviance = None
        if own.discrepancy is not None:
            deviance = partial(own.discrepancy.deviance, values=base.independent_values)
        own.threshold = detection_threshold(
            own.directions, own.penalty, deviance=deviance, freedom=base.degrees_of_freedom, seed=base.model.seed
        )
        own.evaluations = base.evaluations + len(own.directions)
        ranked = rank(own.directions, own.penalty)
        leading = _best_of_each_cause(ranked)[:LEADING_CAUSES]
        least = self._least_prediction(ranked)
        likely = [
            effect
            for effect in ranked
            # A parameter that only shapes the effect of others has none to first order.
            if effect.far
            or effect in leading
            or all(parameter.secondary for parameter in effect.parameters.values())
            or effect.predicted_evidence(own.penalty) >= least
        ]
        self._race(Neighbourhood((), base, likely))
        unlikely = [effect for effect in ranked if effect not in likely]
        if unlikely and not (base.adequacy.passed or own.adequate):
            # The predictions were wrong.
            self._race(Neighbourhood((), base, unlikely))
        raced = {single.variants[0].cause.id for single in own.singles}
        # The others are listed with the gain that their linear effect predicts.
        rest = [effect for effect in ranked if not effect.far and effect.cause.id not in raced]
        own.add(*(own.explain((each.variant,), with_null(each.model, base), each.score) for each in rest))

    def _least_prediction(self, ranked: Sequence[Direction]) -> float:
        """Return the least predicted evidence of variants that race; minus infinity where predictions are unsafe.

        Effects are small on an adequate base, and where the linear effect of one variant explains the misfit.
        """
        own, base = self.selection, self.selection.base
        if own.discrepancy is not None or not ranked:
            return -math.inf
        if base.adequacy.passed:
            return own.threshold - MARGIN
        if base.chi_square - max(effect.score for effect in ranked) > MISFIT_LIMIT * base.expected_chi_square:
            return -math.inf
        return PREDICTED_SHARE * max(effect.predicted_evidence(own.penalty) for effect in ranked)

    def _restart(self) -> bool:
        """Fit the best explanations from their own starting values, where none is adequate.

        The base may have led all other starts to a local minimum. With levels this includes the best cause together
        with each other one, fitted to one level first. Unknown modes have no other starts than those of the base.
        """
        own = self.selection
        if own.base.misfit <= MISFIT_LIMIT or own.adequate or own.base.model.unknown_modes:
            return False
        # The order by evidence means little here: the right cause can be last if all fits are in the wrong optimum.
        levels = has_levels(own.base.model)
        together = [each for each in own.tried if own.singles[0].ids <= each.ids] if levels else []
        again = list(dict.fromkeys([*own.explanations[:1], *own.singles[:ROOTS], *together]))
        titles = [f"{each.title}, from its own starting values" for each in again]
        fits = [partial(fit_or_none, partial(fit_again, each.fit)) for each in again]
        for each, fit in zip(again, self._report.run("together", titles, fits, own.workers), strict=True):
            if fit is not None:
                own.evaluations += fit.evaluations
                own.add(own.explain(each.variants, fit))
        return True

    def _finish_best(self) -> None:
        """Continue the fits of explanations that may be reported and reached their limit of evaluations."""
        own = self.selection
        best = own.adequate or own.best
        if best is None or best.evidence < max(own.threshold, 0.0) - MARGIN:
            return
        # The best one may be left out of the answer, and others within the margin of the next one are then in it.
        near = [each for each in own.explanations if each.evidence >= best.evidence - 2.0 * MARGIN]
        unfinished = [each for each in near if not each.fit.converged]
        fits = [partial(fit_or_none, partial(continued, each.fit)) for each in unfinished]
        for before, fit in zip(unfinished, in_parallel(fits, own.workers), strict=True):
            if fit is not None:
                own.evaluations += fit.evaluations - before.fit.evaluations
                others = [each for each in own.explanations if each is not before]
                own.explanations = best_of_each([own.explain(before.variants, fit), *others])

    def race_alternatives(self) -> None:
        """Race changes that are not causes, where a cause may be reported: in place of all causes, and of each one."""
        own = self.selection
        best = own.best if own.discrepancy else own.adequate
        # No change of a structure changes the quantity of the data.
        if (
            best is None
            or best.evidence <= max(own.threshold, 0.0)
            or any(variant.cause.changes_data for variant in best.variants)
        ):
            self._report.plan("alternatives", 0)
            return
        fewer = [tuple(each for each in best.variants if each != dropped) for dropped in best.variants]
        for kept in dict.fromkeys([(), *fewer]):
            root = self._refit(kept, best.fit.values) if kept else own.base
            if root is None:
                continue
            extensions, _ = list_variants(root, ALTERNATIVES)
            effects = [effect for effect in directions(root, extensions, own.workers) if effect.slopes.shape[1]]
            own.evaluations += len(effects)
            alternatives = Neighbourhood(
                kept, root, rank(effects, own.penalty), best.fit.values, best.fit.chi_square, alternatives=True
            )
            for alternative in race(alternatives, own, self._report):
                own.alternatives = best_of_each([*own.alternatives, alternative])

    def _race(self, neighbourhood: Neighbourhood) -> None:
        """Add the results of a race to the selection."""
        own = self.selection
        for explanation in race(neighbourhood, own, self._report):
            if math.isfinite(neighbourhood.least):
                own.tried = best_of_each([*own.tried, explanation])
            if explanation.evidence > neighbourhood.least:
                own.add(explanation)


def _best_of_each_cause(rivals: Sequence[Direction]) -> list[Direction]:
    """Return the first variant of each cause."""
    return first_of_each(rivals, lambda rival: rival.cause.id)
