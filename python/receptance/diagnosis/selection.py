"""Selection of causes: which of them, alone or together, explain the data."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from time import perf_counter
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from receptance import _checks
from receptance.diagnosis.alternatives import ALTERNATIVES
from receptance.diagnosis.causes import Cause, Variant, extend, parameters_of
from receptance.diagnosis.explanation import Explanation, Selection, behind_limit, best_of_each
from receptance.diagnosis.fitting import (
    Exploration,
    Fit,
    continued,
    evaluate,
    explore,
    fit_base,
    in_parallel,
    refit,
    with_null,
)
from receptance.diagnosis.model import Model, UndecidableError
from receptance.diagnosis.progress import Progress
from receptance.diagnosis.screening import (
    Direction,
    coordinates_of,
    detection_threshold,
    directions,
    in_common_basis,
    list_variants,
    look_alike,
    rank,
    scores_beside,
)
from receptance.diagnosis.starts import fit_again, fit_levels, has_levels, starts_from_singles, starts_of
from receptance.diagnosis.thresholds import (
    ADDED_CAUSES,
    ADDED_EVIDENCE,
    BEHIND,
    FINISHED,
    KEPT_ON_INTERRUPT,
    LEADING_CAUSES,
    LEAST_SHARE,
    LOOK_ALIKE,
    MARGIN,
    OVERSTATED,
    PREDICTED_SHARE,
    ROOTS,
    SCREENING_LIMIT,
    STRAIN_CHANCE,
    VARIANTS_AGAIN,
)
from receptance.diagnosis.unknown_spindle import ChooseModes, fit_unstrained, fit_with_modes, with_any_spindle
from receptance.errors import ReceptanceError
from receptance.fit.adequacy import MISFIT_LIMIT
from receptance.fit.discrepancy import Discrepancy
from receptance.fit.problem import CONVERGED

_T = TypeVar("_T")


def select(
    model: Model,
    causes: Sequence[Cause],
    *,
    most: int = 2,
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
    most : int
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
        search = Search(selection, causes, most=most, progress=report)
        again = search.screen(model, choose_modes)
        if again is None:
            search.run()
        else:
            without, best = again
            selection = select(without, causes, most=most, progress=progress, fast=fast, known=best)
    selection.seconds = perf_counter() - began
    return selection


class Search:
    """The steps of a selection after the fit of the base; each adds explanations to the selection.

    `screen` is the first one, `run` all others.

    1. `fit_singles`: every cause is screened to first order and its best variants are fitted, except those of little
       predicted effect where predictions are reliable.
    2. `refit_base`: the base is fitted again from the best explanation, because its first fit may have ended in a local
       minimum.
    3. `fit_variants`: the other variants of the best cause are fitted from its values, where it takes most of the
       misfit but is not adequate, or strains the tolerances.
    4. `fit_look_alikes`: causes with an effect like that of an adequate one are fitted from its joint, which is closer
       to the solution than that of the base. From the base the right cause may end in a local minimum.
    5. `add_causes`: to the best explanations further causes are added, one at a time, unless predictions exclude them.
    6. `exchange_causes`: in the best explanation by several causes each one is exchanged for others and for its other
       variants. The cause that was found first acted in its variant without the others, and excluded similar causes.
    7. `restart`: where nothing is adequate, the best explanations are fitted from their own starting values, because
       the base may have led all other starts to a local minimum. Unknown modes have no others than those of the base;
       `screen` chooses them again instead.
    8. `finish_best`: the fits of the explanations that may be reported continue where they reached their limit of
       evaluations. Beside a fit that has not converged no cause is named.
    9. `prune`: causes, and parameters of causes, are taken out of the best explanation where it is as good without.
    10. `fit_alternatives`: changes that are not causes are fitted where a cause may be reported.

    After each step the invariant of `Selection` holds. A KeyboardInterrupt ends the steps; complete fits are kept.

    Parameters
    ----------
    selection : Selection
        With the fit of the base.
    causes, most, progress
        As in `select`.
    """

    def __init__(
        self, selection: Selection, causes: Sequence[Cause], *, most: int = 2, progress: Progress | None = None
    ) -> None:
        self.selection = selection
        self._causes = causes
        self._most = most
        self._report = progress or Progress()
        self._rest: NDArray[np.float64] | None = None
        """Residuals of the base in the basis of the directions, where linear predictions are reliable."""

    def screen(self, model: Model, choose: ChooseModes | None = None) -> tuple[Model, Explanation] | None:
        """Fit all single causes, or return the model with other modes and a cause with which to start again.

        `model` is the one without a cause that is diagnosed. Its unknown modes are chosen again beside the causes that
        take most of the misfit, the leading one first. These are the causes that lead with the spindle eliminated where
        the fits beside the modes say nothing, else the single causes, if none is adequate.
        """
        own, base = self.selection, self.selection.base
        try:
            if choose is not None and base.adequacy.of_lines and not base.adequacy.strain.passed:
                base = self._fit_unstrained(model, choose)
            if choose is not None and base.adequacy.misfit > SCREENING_LIMIT:
                again = self._beside_modes(model, self._lead_with_any_spindle(), choose)
                if again is not None:
                    return again
            self.fit_singles()
            if choose is not None and not base.adequacy.passed and not any(one.passed for one in own.explanations):
                least = LEAST_SHARE * (base.chi_square - base.expected_chi_square)
                leading = [single for single in own.singles[:LEADING_CAUSES] if single.gain >= least]
                return self._beside_modes(model, [(single.variants[0], single.fit) for single in leading], choose)
        except KeyboardInterrupt:
            own.interrupted = True
        return None

    def _fit_unstrained(self, model: Model, choose: ChooseModes) -> Fit:
        """Replace the base by one with other modes if these do not strain the tolerances, and return it."""
        _, fit = fit_unstrained(replace(model, threads=1), choose)
        if fit.adequacy.passed:
            self.selection.base = fit
        return self.selection.base

    def _lead_with_any_spindle(self) -> list[tuple[Variant, Fit]]:
        """Return the causes that take most of the misfit whatever the spindle is, each with its sizes."""
        base = self.selection.base
        without = with_any_spindle(base.model)
        if without is None:
            return []
        extensions, _ = list_variants(base, self._causes)
        self._report.plan("causes", len(extensions))
        # A change of the data has no start near that of the data as they are.
        fits = [
            partial(with_any_spindle, model, None if variant.cause.changes_data else without)
            for variant, model in extensions
        ]
        titles = [f"{_title(variant)}, whatever the spindle is" for variant, _ in extensions]
        least = LEAST_SHARE * (without.chi_square - without.expected)
        gains: list[tuple[float, Variant, Fit]] = []
        for (variant, model), end in zip(extensions, self._each("causes", titles, fits), strict=True):
            if end is None or without.chi_square - end.chi_square < least:
                continue
            count = sum(parameter.penalised for parameter in parameters_of(model.unknowns).values())
            gain = without.chi_square - end.chi_square - self.selection.penalty * count
            gains.append((gain, variant, evaluate(model, {**base.values, **end.values})))
        leading: dict[str, tuple[Variant, Fit]] = {}
        for _, variant, fit in sorted(gains, key=lambda each: -each[0]):
            leading.setdefault(variant.cause.id, (variant, fit))
        return list(leading.values())[:LEADING_CAUSES]

    def _beside_modes(
        self, model: Model, candidates: Sequence[tuple[Variant, Fit]], choose: ChooseModes
    ) -> tuple[Model, Explanation] | None:
        """Return the model with modes chosen beside the best of some causes, and this cause.

        They are tried until one explains all lines. The modes with the least chi-square, with a penalty for each
        unknown, are used if it is less than that of the base and of the causes beside its modes, else None is returned.
        """
        self._report.plan("together", len(candidates))
        titles = [f"{_title(variant)}, with modes chosen beside it" for variant, _ in candidates]
        on_one_thread = replace(model, threads=1)
        fits = [
            partial(_fit_with_modes_or_none, on_one_thread, variant, before, choose) for variant, before in candidates
        ]
        least = min(self._size(before) for before in (self.selection.base, *(fit for _, fit in candidates))) - MARGIN
        best: tuple[Model, Explanation] | None = None
        for (variant, _), pair in zip(candidates, self._each("together", titles, fits), strict=True):
            if pair is None:
                continue
            without, fit = pair
            if self._size(fit) < least:
                least = self._size(fit)
                best = replace(without, threads=model.threads), self.selection.explain((variant,), fit)
                # Tolerances may be strained by the modes, and not by the cause.
                if best[1].adequacy.of_lines:
                    break
        return best

    def _size(self, fit: Fit) -> float:
        """Return chi-square of a fit with a penalty for each of its unknowns."""
        return fit.chi_square + self.selection.penalty * fit.task.parameters.count

    def run(self) -> None:
        """Run the steps after `screen`."""
        if self.selection.interrupted:
            return
        try:
            self.refit_base()
            self.fit_variants()
            self.fit_look_alikes()
            self.add_causes()
            self.exchange_causes()
            self.restart()
            self._report.plan("together", 0)
            self.finish_best()
            self.prune()
            # Beside a discrepancy alternatives follow when the evidence of the causes is final.
            if not self.selection.fast and self.selection.discrepancy is None:
                self.fit_alternatives()
        except KeyboardInterrupt:
            self.selection.interrupted = True

    def fit_singles(self) -> None:
        """Screen all causes, and fit the best variants of each."""
        own, base = self.selection, self.selection.base
        extensions, own.undecidable = list_variants(base, self._causes)
        found = directions(base, extensions, own.workers)
        own.directions = in_common_basis(found)
        beside = own.discrepancy
        own.threshold = detection_threshold(
            own.directions,
            own.penalty,
            deviance=None if beside is None else partial(beside.deviance, values=base.independent_values),
            freedom=base.degrees_of_freedom,
            seed=base.model.seed,
        )
        own.evaluations = base.evaluations + len(own.directions)
        ranked = rank(own.directions, own.penalty)
        leading = _first_of_each(ranked)[:LEADING_CAUSES]
        least = self._least_prediction(ranked)
        if math.isfinite(least):
            self._rest = coordinates_of(base.residual, found, own.directions)
        fitted: list[Direction] = []
        left_out: list[Direction] = []
        for one in ranked:
            # A parameter that only shapes the effect of others has none to first order.
            has_prediction = any(not parameter.secondary for parameter in one.parameters.values())
            is_weak = has_prediction and one.predicted_evidence(own.penalty) < least
            (left_out if is_weak and not (one.far or one in leading) else fitted).append(one)
        # A far variant has no prediction, but other variants of its cause do.
        ids = {one.cause.id for one in fitted if not one.far}
        own.add(*(self._predict((), base, one) for one in ranked if not (one.far or one.cause.id in ids)))
        for explanation in self._fit((), base, fitted):
            own.add(explanation)
        if left_out and not base.adequacy.passed and not any(one.passed for one in own.explanations):
            # The predictions were wrong.
            self._rest = None
            for explanation in self._fit((), base, left_out):
                own.add(explanation)

    def _least_prediction(self, ranked: Sequence[Direction]) -> float:
        """Return the least predicted evidence of variants that are fitted; minus infinity where predictions are unsafe.

        Effects are small on an adequate base, and where the linear effect of one variant explains the misfit.
        """
        own, base = self.selection, self.selection.base
        if own.discrepancy is not None or not ranked:
            return -math.inf
        if base.adequacy.passed:
            return own.threshold - MARGIN
        if base.chi_square - max(one.score for one in ranked) > MISFIT_LIMIT * base.expected_chi_square:
            return -math.inf
        return PREDICTED_SHARE * max(one.predicted_evidence(own.penalty) for one in ranked)

    def refit_base(self) -> None:
        """Fit the base from the best explanation, and replace it if that fit is better."""
        own = self.selection
        if own.best is None:
            return
        try:
            again = refit(own.base.model, own.best.fit.values)
        except ReceptanceError:
            return
        if again.chi_square < own.base.chi_square - MARGIN:
            # The predictions were those of another minimum.
            self._rest = None
        if again.chi_square < own.base.chi_square - CONVERGED:
            own.replace_base(again)

    def fit_look_alikes(self) -> None:
        """Fit the causes with an effect like that of the best one from the values of the best one."""
        own, best = self.selection, self.selection.best
        # Without evidence nothing is reported, and causes with a similar effect have as little.
        if best is None or not best.passed or best.evidence < own.threshold - MARGIN:
            return
        (variant,) = best.variants
        leading = next((direction for direction in own.directions if direction.variant == variant), None)
        if leading is None:
            return
        similar = [
            direction
            for direction in own.directions
            if direction.cause.id != variant.cause.id
            and not direction.cause.changes_data
            and look_alike(direction, leading) >= LOOK_ALIKE
        ]
        self._fit_near(best, rank(similar, own.penalty))

    def fit_variants(self) -> None:
        """Fit the other variants of the best cause from its values, where it takes most of the misfit.

        That is, where it is not adequate all the same, or strains the tolerances: these absorb what a variant leaves
        that acts in another way than the right one. The screening of the base ranks the right variant too low where the
        effect is large.
        """
        own, best = self.selection, self.selection.best
        if best is None or own.base.misfit <= MISFIT_LIMIT or own.share(best) < LEAST_SHARE:
            return
        if best.passed and best.adequacy.strain.chance >= STRAIN_CHANCE:
            return
        (variant,) = best.variants
        others = [
            direction
            for direction in own.directions
            if direction.cause.id == variant.cause.id
            and direction.variant != variant
            and not direction.cause.changes_data
        ]
        others.sort(key=lambda one: -one.predicted_evidence(own.penalty))
        self._fit_near(best, others[:VARIANTS_AGAIN])

    def _fit_near(self, best: Explanation, chosen: Sequence[Direction]) -> None:
        """Fit variants from the joint of an explanation, and the best one of each cause on all lines."""
        own = self.selection
        joint = {name: best.fit.values[name] for name in own.base.values}
        starts = [[[{**start, **joint} for start in group] for group in starts_of(one, own.base)] for one in chosen]
        for one, groups in zip(chosen, starts, strict=True):
            if one.cause.id in best.ids:
                # Another variant of the same cause may have the same size.
                groups[0].append(best.fit.values)
        self._report.plan("causes", len(chosen))
        titles = [_title(direction.variant) for direction in chosen]
        explored = dict(self._explore("causes", titles, chosen, starts, own.base))
        near = [pair for pair in explored.items() if pair[1].misfit <= SCREENING_LIMIT]
        finished = _first_causes(_in_order(near), FINISHED)
        self._report.plan("causes", len(finished))
        titles = [f"{_title(direction.variant)}, on all lines" for direction, _ in finished]
        fits = [few.finish for _, few in finished]
        for (one, few), fit in zip(finished, self._each("causes", titles, fits), strict=True):
            if fit is not None:
                own.evaluations += fit.evaluations - few.evaluations
                own.add(own.explain((one.variant,), fit))

    def add_causes(self) -> None:
        """Add further causes to the best explanations, one at a time, while they gain evidence."""
        roots = self.selection.singles
        for _ in range(1, self._most):
            roots = self._add_one(roots)

    def _add_one(self, roots: Sequence[Explanation]) -> list[Explanation]:
        """Add one further cause to the best explanations, and return those that gain evidence by it."""
        own = self.selection
        if not roots or roots[0].evidence <= own.threshold:
            return []
        found: list[Explanation] = []
        best = roots[0]
        if best.passed and best.fit.misfit < OVERSTATED:
            return []
        threshold = max(own.threshold, 0.0)
        extends_all = not best.passed
        limit = behind_limit(own.base.chi_square, (root.fit.chi_square for root in roots))
        for root in roots[:ROOTS]:
            # Where the best explanation is adequate, only those within the margin are extended.
            if root is not best and not extends_all and root.evidence < best.evidence - MARGIN:
                continue
            if root.fit.chi_square > limit:
                continue
            if self._predicts_nothing_beside(root):
                continue
            effects = self._effects_of_others(root.fit, root.ids)
            is_unreliable = root.adequacy.misfit > SCREENING_LIMIT
            likely = [
                effect for effect in effects if is_unreliable or effect.predicted_evidence(own.penalty) > threshold
            ]
            extends_all = extends_all or bool(likely)
            chosen = _first_of_each(rank(likely, own.penalty))
            if best.passed:
                # From a worse start, the same causes lead to no other fit.
                chosen = [effect for effect in chosen if not self._is_tried(root.ids | {effect.cause.id})]
            for one in self._fit(root.variants, root.fit, chosen if is_unreliable else chosen[:ADDED_CAUSES]):
                own.tried = best_of_each([*own.tried, one])
                if one.evidence > best.evidence + max(own.threshold, ADDED_EVIDENCE):
                    own.add(one)
                    found.append(one)
        return best_of_each(found)

    def _is_tried(self, ids: frozenset[str]) -> bool:
        """Return whether causes were fitted together."""
        return any(each.ids == ids for each in (*self.selection.tried, *self.selection.explanations))

    def _predicts_nothing_beside(self, root: Explanation) -> bool:
        """Return whether no other cause is predicted to have evidence beside an adequate explanation by one cause."""
        own = self.selection
        if self._rest is None or not root.passed or len(root.variants) > 1:
            return False
        (variant,) = root.variants
        first = next((direction for direction in own.directions if direction.variant == variant), None)
        if first is None or first.far or not first.slopes.shape[1]:
            return False
        others = [other for other in own.directions if other.cause.id != variant.cause.id and not other.far]
        scores = scores_beside(first, others, self._rest)
        gains = [score - own.penalty * other.count for score, other in zip(scores.tolist(), others, strict=True)]
        return max(gains, default=-math.inf) < own.threshold - MARGIN

    def _effects_of_others(self, root: Fit, ids: frozenset[str]) -> list[Direction]:
        """Return the linear effects on a fit of all causes but some; no variant changes the data."""
        others = [cause for cause in self._causes if cause.id not in ids and not cause.changes_data]
        extensions, _ = list_variants(root, others)
        effects = directions(root, extensions, self.selection.workers)
        self.selection.evaluations += len(effects)
        return effects

    def exchange_causes(self) -> None:
        """Exchange each cause of the best explanation for other causes and for its other variants."""
        own, best = self.selection, self.selection.best
        if best is None or len(best.variants) < 2 or not best.adequacy.of_lines:
            return
        for removed in best.variants:
            kept = tuple(variant for variant in best.variants if variant != removed)
            kept_ids = frozenset(variant.cause.id for variant in kept)
            root = self._refit_without(best, kept)
            if root is None:
                continue
            own.evaluations += root.evaluations
            ranked = rank(self._effects_of_others(root, kept_ids), own.penalty)
            others = _first_of_each([one for one in ranked if one.cause.id != removed.cause.id])
            before = next((each for each in own.explanations if each.variants == kept), None)
            if before is not None and root.chi_square > before.fit.chi_square - MARGIN:
                # They have been added to the same fit.
                others = [one for one in others if not self._is_tried(kept_ids | {one.cause.id})]
            same = [one for one in ranked if one.cause.id == removed.cause.id]
            for one in self._fit(kept, root, same + others[:ADDED_CAUSES]):
                own.add(one)

    def restart(self) -> None:
        """Fit the best explanations from their own starting values, where no explanation is adequate.

        With levels this includes the best cause together with each other one, fitted to one level first; causes that
        cannot explain one level are not fitted to the others. Without levels it includes the other variants of the
        best cause: from the base a wrong variant may end closer to the data than the right one.
        """
        own = self.selection
        if own.base.misfit <= MISFIT_LIMIT or any(explanation.passed for explanation in own.explanations):
            return
        if own.base.model.unknown_modes:
            return
        levels = has_levels(own.base.model)
        # The order by evidence means little here: the right cause can be last if all fits are in the wrong optimum.
        together = [one for one in own.tried if own.singles[0].ids <= one.ids] if levels else []
        started = [*own.singles[:ROOTS], *together]
        self._restart([(explanation.variants, partial(fit_again, explanation.fit)) for explanation in started])
        others = [] if levels else self._other_variants()
        self._restart([((variant,), partial(fit_base, model)) for variant, model in others])

    def _restart(self, again: Sequence[tuple[tuple[Variant, ...], Callable[[], Fit | None]]]) -> None:
        titles = [
            f"{_title(*variants, variant=len(variants) == 1)}, from its own starting values" for variants, _ in again
        ]
        fits = [partial(_fit_or_none, fit) for _, fit in again]
        for (variants, _), fit in zip(again, self._each("together", titles, fits), strict=True):
            if fit is not None:
                self.selection.evaluations += fit.evaluations
                self.selection.add(self.selection.explain(variants, fit))

    def _other_variants(self) -> list[tuple[Variant, Model]]:
        """Return the other variants of the best single cause with their models, if it comes close to the data."""
        best = next(iter(self.selection.singles), None)
        if best is None or best.fit.misfit > SCREENING_LIMIT:
            return []
        (variant,) = best.variants
        if variant.cause.changes_data:
            return []
        extensions = variant.cause.extensions(self.selection.base.model)
        return [(other, model) for other, model in extensions if other != variant][:ADDED_CAUSES]

    def finish_best(self) -> None:
        """Continue the fits of explanations that may be reported and reached their limit of evaluations."""
        own = self.selection
        first = next((explanation for explanation in own.explanations if explanation.passed), own.best)
        if first is None or first.evidence < max(own.threshold, 0.0) - MARGIN:
            return
        # The first one may be left out of the answer, and others within the margin of the next one are then in it.
        near = [
            explanation for explanation in own.explanations if explanation.evidence >= first.evidence - 2.0 * MARGIN
        ]
        unfinished = [one for one in near if not one.fit.converged]
        fits = [partial(_fit_or_none, partial(continued, one.fit)) for one in unfinished]
        for before, fit in zip(unfinished, in_parallel(fits, own.workers), strict=True):
            if fit is not None:
                own.evaluations += fit.evaluations - before.fit.evaluations
                others = [explanation for explanation in own.explanations if explanation is not before]
                own.explanations = best_of_each([own.explain(before.variants, fit), *others])

    def prune(self) -> None:
        """Take each cause, and parameters of each cause, out of the best explanation, and keep equally good ones.

        A cause may be inadequate alone only because the base led its fit to a local minimum, and adequate when its fit
        starts from the one together with another cause.
        """
        own, best = self.selection, self.selection.best
        if best is None or len(best.variants) < 2 or not best.passed:
            return
        fewer = [tuple(kept for kept in best.variants if kept != removed) for removed in best.variants]
        fewer += _with_fewer_parameters(own.base.model, best)
        fits = [partial(self._refit_without, best, variants) for variants in fewer]
        for variants, fit in zip(fewer, in_parallel(fits, own.workers), strict=True):
            if fit is not None:
                own.add(own.explain(variants, fit))

    def _refit_without(self, best: Explanation, variants: Sequence[Variant]) -> Fit | None:
        """Return the fit with fewer causes than an explanation, from its values; None where there is none."""
        try:
            return refit(extend(self.selection.base.model, variants), best.fit.values)
        except (ReceptanceError, UndecidableError):
            return None

    def fit_alternatives(self) -> None:
        """Fit changes that are not causes to the base where a cause may be reported."""
        own, base = self.selection, self.selection.base
        best = (
            own.best
            if own.discrepancy
            else next((explanation for explanation in own.explanations if explanation.passed), None)
        )
        # No change of a structure changes the quantity of the data.
        if (
            best is None
            or best.evidence <= max(own.threshold, 0.0)
            or any(variant.cause.changes_data for variant in best.variants)
        ):
            self._report.plan("alternatives", 0)
            return
        extensions, _ = list_variants(base, ALTERNATIVES)
        screened = directions(base, extensions, own.workers)
        own.evaluations += len(screened)
        chosen = rank([one for one in screened if one.slopes.shape[1]], own.penalty)
        self._report.plan("alternatives", len(chosen))
        starts = [starts_of(direction, base) for direction in chosen]
        for groups in starts:
            # The joint of the best explanation is closer to the solution than that of an inadequate base.
            groups[-1] += [{**start, **best.fit.values} for group in groups for start in group]
        titles = [f"no cause: {direction.variant.meaning} {direction.variant.name}" for direction in chosen]
        found = dict(self._explore("alternatives", titles, chosen, starts, base, best.fit.chi_square_on_few_lines))
        # The penalty is that of all lines: it is smaller beside chi-square on few lines, as that of the base is.
        share = base.chi_square_on_few_lines / base.chi_square
        explored = sorted(found.items(), key=lambda pair: pair[1].chi_square + share * own.penalty * pair[0].count)
        limit = behind_limit(base.chi_square_on_few_lines, (best.fit.chi_square_on_few_lines,))
        # Only the best variant of each is fitted: neighbouring frequencies lead to the same end point.
        finished = _first_causes([pair for pair in explored if pair[1].chi_square <= limit], FINISHED)
        titles = [f"no cause: {direction.variant.meaning}, on all lines" for direction, _ in finished]
        fits = [few.finish for _, few in finished]
        for (direction, few), fit in zip(finished, self._each("alternatives", titles, fits), strict=True):
            if fit is not None:
                own.evaluations += fit.evaluations - few.evaluations
                own.alternatives.append(own.explain((direction.variant,), fit))
        own.alternatives.sort(key=lambda one: -one.evidence)

    def _fit(self, variants: tuple[Variant, ...], root: Fit, chosen: Sequence[Direction]) -> Iterator[Explanation]:
        """Yield explanations that add one cause each.

        Variants that change the data are fitted from their own starting values. All others are explored on few lines;
        those that come close to the best one are fitted on all lines, the others are evaluated on these. After a
        KeyboardInterrupt those that are explored are evaluated on all lines.

        Parameters
        ----------
        variants : tuple of Variant
            The causes that `root` has already.
        root : Fit
            The fit to which they are added.
        chosen : sequence of Direction
            The variants that are added.
        """
        own, stage = self.selection, "together" if variants else "causes"
        self._report.plan(stage, len(chosen))
        is_other_quantity = any(
            single.variants[0].cause.changes_data and single.adequacy.of_lines for single in own.singles
        )
        for direction in () if is_other_quantity else chosen:
            if direction.cause.changes_data:
                self._report(stage, _title(*variants, direction.variant))
                try:
                    fit = fit_base(direction.model)
                except ReceptanceError:
                    continue
                own.evaluations += fit.evaluations
                found = own.explain((*variants, direction.variant), fit)
                is_other_quantity = is_other_quantity or found.adequacy.of_lines
                yield found
        others = [one for one in chosen if not one.cause.changes_data]
        if is_other_quantity:
            # Without that change of the data no fit comes close to them.
            for one in others:
                if not one.far:
                    yield self._predict(variants, root, one)
            return
        explored: dict[Direction, Exploration] = {}
        try:
            singles = [
                [single.fit for single in own.singles if variants and single.variants[0] == each.variant]
                for each in others
            ]
            starts = [starts_of(each, root) for each in others]
            for groups, fits in zip(starts, singles, strict=True):
                groups[0] += starts_from_singles(own.base, fits, root)
            titles = [_title(*variants, each.variant) for each in others]
            for direction, few in self._explore(stage, titles, others, starts, root):
                explored[direction] = few
                leading = min(explored, key=lambda one: explored[one].chi_square)
                self._report.leading = _title(*variants, leading.variant, variant=False)
        except KeyboardInterrupt:
            for direction, few in _first_causes(_in_order(explored.items()), KEPT_ON_INTERRUPT):
                yield own.explain((*variants, direction.variant), few.evaluate())
            raise
        yield from self._finish(variants, root, _in_order(explored.items()))

    def _explore(
        self,
        stage: str,
        titles: Sequence[str],
        chosen: Sequence[Direction],
        starts: Sequence[list[list[dict[str, float]]]],
        root: Fit,
        adequate: float = math.inf,
    ) -> Iterator[tuple[Direction, Exploration]]:
        """Yield the variants with their fits on few lines, except those that have no value at any start.

        Each is fitted shortly from its first group of starts, and yielded again after fits from all of its starts,
        unless it has fallen far behind an adequate one, and was predicted to. A fit that is still above chi-square of
        `root`, the fit without the cause, has not come far. A far variant goes on up to a misfit of `SCREENING_LIMIT`.
        `adequate` is chi-square on few lines of a fit that is adequate already: beside it the leading variants are not
        continued in any case.
        """
        found: list[tuple[Direction, Exploration]] = []
        fits = [partial(explore, one.model, start[0], far=one.far) for one, start in zip(chosen, starts, strict=True)]
        for direction, few in zip(chosen, self._each(stage, titles, fits), strict=True):
            self.selection.evaluations += few.evaluations
            found.append((direction, few))
            if few.ends:
                yield direction, few
        without, limit = root.chi_square_on_few_lines, math.inf
        is_adequate = math.isfinite(adequate)
        if is_adequate or any(few.misfit <= MISFIT_LIMIT for _, few in found):
            limit = behind_limit(without, (adequate, *(few.chi_square for _, few in found)))
        leading = {direction for direction, _ in _first_causes(_in_order(found), 0 if is_adequate else LEADING_CAUSES)}

        def may_be_near(one: Direction, few: Exploration) -> bool:
            if one in leading or few.chi_square <= limit:
                return True
            if one.far:
                return few.misfit <= SCREENING_LIMIT
            return few.chi_square > without or without * (1.0 - one.score / root.chi_square) <= limit

        near = [i for i, (one, few) in enumerate(found) if may_be_near(one, few)]
        self._report.plan(stage, len(near))
        fits = [partial(found[i][1].go_on, [one for group in starts[i][1:] for one in group]) for i in near]
        for i, few in zip(near, self._each(stage, [f"{titles[i]}, continued" for i in near], fits), strict=True):
            direction, before = found[i]
            self.selection.evaluations += few.evaluations - before.evaluations
            if few.ends:
                yield direction, few

    def _each(self, stage: str, titles: Sequence[str], fits: Sequence[Callable[[], _T]]) -> Iterator[_T]:
        """Yield the results of fits in their order, after a report of each."""
        results = in_parallel(fits, self.selection.workers)
        for title in titles:
            self._report(stage, title)
            yield next(results)

    def _predict(self, variants: tuple[Variant, ...], root: Fit, direction: Direction) -> Explanation:
        """Return a variant at the values of the fit without it, with the gain that its linear effect predicts."""
        fit = with_null(direction.model, root)
        return self.selection.explain((*variants, direction.variant), fit, direction.score)

    def _finish(
        self, variants: tuple[Variant, ...], root: Fit, explored: Sequence[tuple[Direction, Exploration]]
    ) -> Iterator[Explanation]:
        """Yield explanations on all lines: fitted where they come close to the best one, else evaluated."""
        own, stage = self.selection, "together" if variants else "causes"
        without = root.chi_square_on_few_lines
        limit = behind_limit(without, (few.chi_square for _, few in explored))
        # Far from the data short fits are unreliable, unless one of them has come close.
        fit_all = root.misfit > SCREENING_LIMIT and all(few.misfit > MISFIT_LIMIT for _, few in explored[:1])
        predicted = {direction.cause.id for direction, _ in explored if not direction.far}
        leaders: dict[str, float] = {}
        finished: list[tuple[Direction, Exploration]] = []
        fits: list[Callable[[], Fit | None]] = []
        for direction, few in explored:
            is_leading = len(leaders) < LEADING_CAUSES
            leader = leaders.setdefault(direction.cause.id, few.chi_square)
            # A variant far behind another one of its cause is not needed.
            is_close = (is_leading or few.chi_square <= limit) and few.chi_square <= leader + BEHIND
            may_gain = direction.predicted_evidence(own.penalty) >= 0.0 or without - few.chi_square >= MARGIN
            may_gain = may_gain or (is_leading and not root.adequacy.passed)
            if not may_gain:
                # A far variant has no prediction, but other variants of its cause do.
                if not direction.far:
                    yield self._predict(variants, root, direction)
                    continue
                if direction.cause.id in predicted:
                    continue
            finished.append((direction, few))
            fits.append(few.finish if (is_close and may_gain) or fit_all else few.evaluate)
        leading: Explanation | None = None
        done = 0
        titles = [f"{_title(*variants, direction.variant)}, on all lines" for direction, _ in finished]
        self._report.plan(stage, len(finished))
        try:
            for (direction, few), fit in zip(finished, self._each(stage, titles, fits), strict=True):
                done += 1
                if fit is None:
                    continue
                own.evaluations += fit.evaluations - few.evaluations
                if fit.chi_square > root.chi_square:
                    # Where the cause has no effect it is as good as the fit without the cause.
                    null = evaluate(direction.model, root.values, evaluations=fit.evaluations)
                    fit = min(fit, null, key=lambda one: one.chi_square)
                found = own.explain((*variants, direction.variant), fit)
                leading = found if leading is None or found.evidence > leading.evidence else leading
                self._report.leading = f"{leading.title}, misfit {leading.fit.misfit:.2f}"
                yield found
        except KeyboardInterrupt:
            known = {direction.cause.id for direction, _ in finished[:done]}
            rest = [pair for pair in finished[done:] if pair[0].cause.id not in known]
            for direction, few in _first_causes(rest, KEPT_ON_INTERRUPT):
                yield own.explain((*variants, direction.variant), few.evaluate())
            raise


def _fit_with_modes_or_none(
    model: Model, variant: Variant, before: Fit, choose: ChooseModes
) -> tuple[Model, Fit] | None:
    """Return the result of `fit_with_modes`; None where the model has no value."""
    try:
        return fit_with_modes(model, variant, before, choose)
    except (ReceptanceError, UndecidableError):
        return None


def _fit_or_none(fit: Callable[[], Fit | None]) -> Fit | None:
    """Return a fit; None where the model has no value at its start."""
    try:
        return fit()
    except (ReceptanceError, ValueError):
        return None


def _title(*variants: Variant, variant: bool = True) -> str:
    """Return the names of causes, and the variant of the last one."""
    return " + ".join(each.cause.title for each in variants) + (f", {variants[-1].name}" if variant else "")


def _first_of_each(ranked: Sequence[Direction]) -> list[Direction]:
    """Return the first direction of each cause."""
    found: dict[str, Direction] = {}
    for one in ranked:
        found.setdefault(one.cause.id, one)
    return list(found.values())


def _in_order(explored: Iterable[tuple[Direction, Exploration]]) -> list[tuple[Direction, Exploration]]:
    """Return explored variants, the smallest chi-square on few lines first."""
    return sorted(explored, key=lambda pair: pair[1].chi_square)


def _first_causes(explored: Iterable[tuple[Direction, Exploration]], most: int) -> list[tuple[Direction, Exploration]]:
    """Return the first variant of each cause, of at most so many causes."""
    found: dict[str, tuple[Direction, Exploration]] = {}
    for pair in explored:
        found.setdefault(pair[0].cause.id, pair)
    return list(found.values())[:most]


def _with_fewer_parameters(model: Model, best: Explanation) -> Iterator[tuple[Variant, ...]]:
    """Yield the variants of an explanation with one of them exchanged for one with a proper subset of its unknowns."""
    for i, variant in enumerate(best.variants):
        extended = variant.apply(model)
        names = {unknown.name for unknown in extended.unknowns}
        for other, fewer in variant.cause.extensions(model):
            if {unknown.name for unknown in fewer.unknowns} < names:
                yield (*best.variants[:i], other, *best.variants[i + 1 :])
        model = extended
