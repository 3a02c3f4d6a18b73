"""Selection of causes: which of them, alone or together, explain the data."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from time import perf_counter

from receptance.diagnosis.alternatives import fit_alternatives
from receptance.diagnosis.causes import Cause, Step, UndecidableError
from receptance.diagnosis.explanation import Explanation, Selection, best_of_each
from receptance.diagnosis.fitting import (
    Explored,
    Fit,
    chi_square_on_few_lines,
    evaluate_at,
    evaluate_start,
    explore,
    fit_base,
    refit,
)
from receptance.diagnosis.model import Model
from receptance.diagnosis.progress import Progress
from receptance.diagnosis.screening import Direction, chance, directions, list_variants, rank
from receptance.diagnosis.starts import fit_anew, fit_levels, has_levels, starts_of, starts_together
from receptance.diagnosis.thresholds import (
    ADDED_CAUSES,
    ADDED_EVIDENCE,
    BEHIND,
    BEHIND_SHARE,
    EVALUATED_ON_INTERRUPT,
    IDLE,
    LEADING_CAUSES,
    MARGIN,
    MISFIT_LIMIT,
    RESTARTED,
    ROOTS,
    SCREENING_LIMIT,
    SETTLED,
)
from receptance.errors import ReceptanceError

__all__ = ["Search", "select"]


def select(
    model: Model,
    causes: Sequence[Cause],
    *,
    seed: int = 0,
    threads: int | None = None,
    most: int = 2,
    base: Fit | None = None,
    progress: Progress | None = None,
) -> Selection:
    """Return the fits of each cause, and of causes together.

    Parameters
    ----------
    model : Model
        Observations, unknowns and tolerances.
    causes : sequence of Cause
        The causes that are tried.
    seed : int
        Seed of all random numbers.
    threads : int, optional
        As in `Assembly.receptance`; it does not change the result.
    most : int
        Largest number of causes that act together.
    base : Fit, optional
        The fit of the base, where it is known.
    progress : Progress, optional
        Reports each step. A KeyboardInterrupt ends the selection with the results so far: `Selection.interrupted`.
    """
    report = progress or Progress()
    began = perf_counter()
    try:
        base = base or fit_levels(model, seed=seed, threads=threads, say=partial(report, "base"))
        interrupted = False
    except KeyboardInterrupt:
        base, interrupted = evaluate_start(model, threads), True
    selection = Selection(base, math.log(max(base.independent, 2.0)), interrupted=interrupted)
    if not interrupted:
        Search(selection, causes, seed=seed, threads=threads, most=most, progress=report).run()
    selection.seconds = perf_counter() - began
    return selection


class Search:
    """The steps of a selection after the fit of the base; each adds explanations to the selection.

    1. `fit_singles`: every cause is screened to first order and its best variants are fitted.
    2. `refit_base`: the base is fitted again from the best explanation. If its first fit ended in a local minimum, no
       cause is convicted by that.
    3. `add_causes`: to the best explanations further causes are added, one at a time.
    4. `exchange_causes`: in the best explanation by several causes each one is exchanged for others and for its other
       variants. The cause that was found first acted in its variant without the others, and excluded similar causes.
    5. `restart`: where nothing is adequate, the best explanations are fitted from their own starting values, because
       the base may have led all other starts to a local minimum.
    6. `finish_best`: the fit of the best explanation continues where it reached its limit of evaluations. Beside a fit
       that has not converged no cause is named.
    7. `prune`: causes, and parameters of causes, are taken out of the best explanation where it is as good without.
    8. `fit_alternatives`: changes that are not causes are fitted where a cause may be reported.

    After each step the invariant of `Selection` holds. A KeyboardInterrupt ends the step; its complete fits are kept.

    Parameters
    ----------
    selection : Selection
        With the fit of the base.
    causes, seed, threads, most, progress
        As in `select`.
    """

    def __init__(
        self,
        selection: Selection,
        causes: Sequence[Cause],
        *,
        seed: int = 0,
        threads: int | None = None,
        most: int = 2,
        progress: Progress | None = None,
    ) -> None:
        self.selection = selection
        self._causes = causes
        self._seed = seed
        self._threads = threads
        self._most = most
        self._report = progress or Progress()

    def run(self) -> None:
        """Run all steps."""
        try:
            for step in self._steps():
                step()
                if self.selection.interrupted:
                    break
        except KeyboardInterrupt:
            self.selection.interrupted = True

    def _steps(self) -> Iterator[Callable[[], None]]:
        yield self.fit_singles
        yield self.refit_base
        yield self.add_causes
        yield self.exchange_causes
        if not any(one.adequacy.passed for one in self.selection.explanations):
            yield self.restart
        self._report.plan("together", 0)
        yield self.finish_best
        yield self.prune
        yield lambda: fit_alternatives(self.selection, self._threads, self._report)

    def fit_singles(self) -> None:
        """Screen all causes, and fit the best variants of each."""
        own, base = self.selection, self.selection.base
        variants, own.undecidable = list_variants(base.model, self._causes, base)
        own.found = directions(base, variants)
        own.threshold = chance(own.found, own.penalty, seed=self._seed)
        own.evaluations = base.evaluations + len(own.found)
        own.add(self._fit((), base, rank(own.found, own.penalty)))

    def refit_base(self) -> None:
        """Fit the base from the best explanation, and replace it if that fit is better."""
        own = self.selection
        if not own.singles:
            return
        try:
            again = refit(own.base.model, own.singles[0].fit.values, threads=self._threads)
        except ReceptanceError:
            return
        if again.chi_square < own.base.chi_square - SETTLED * own.base.chi_square:
            own.replace_base(again)

    def add_causes(self) -> None:
        """Add further causes to the best explanations, one at a time, while they gain evidence."""
        roots = self.selection.singles
        for _ in range(1, self._most):
            roots = self._add_one(roots)
            self.selection.add(roots)
            if not roots or self.selection.interrupted:
                break

    def _add_one(self, roots: Sequence[Explanation]) -> list[Explanation]:
        """Return the best explanations with one further cause, if it gains evidence."""
        own = self.selection
        if not roots or roots[0].evidence <= own.threshold:
            return []
        found: list[Explanation] = []
        best = roots[0]
        open_ = not best.adequacy.passed
        for root in roots[:ROOTS]:
            # Where the best explanation is adequate, only those within the margin are extended.
            if root is not best and not open_ and root.evidence < best.evidence - MARGIN:
                continue
            others = [cause for cause in self._causes if cause.id not in root.ids]
            variants, _ = list_variants(root.fit.model, others, root.fit)
            directed = [one for one in directions(root.fit, variants) if not one.variant.changes_data]
            own.evaluations += len(directed)
            unreliable = root.adequacy.misfit > SCREENING_LIMIT
            least = max(own.threshold, 0.0)
            promising = [one for one in directed if unreliable or one.predicted_evidence(own.penalty) > least]
            open_ = open_ or bool(promising)
            chosen = _first_of_each(rank(promising, own.penalty))
            fitted = self._fit(root.steps, root.fit, chosen if unreliable else chosen[:ADDED_CAUSES])
            own.tried = best_of_each([*own.tried, *fitted])
            found += [one for one in fitted if one.evidence > best.evidence + max(own.threshold, ADDED_EVIDENCE)]
            if own.interrupted:
                break
        return best_of_each(found)

    def exchange_causes(self) -> None:
        """Exchange each cause of the best explanation for other causes and for its other variants."""
        own, best = self.selection, self.selection.best
        if best is None or len(best.steps) < 2 or not best.adequacy.of_lines:
            return
        for left in best.steps:
            kept = tuple(step for step in best.steps if step is not left)
            ids = {cause.id for cause, _ in kept}
            try:
                root = refit(_extend(own.base.model, kept), best.fit.values, threads=self._threads)
            except (ReceptanceError, UndecidableError):
                continue
            variants, _ = list_variants(root.model, [cause for cause in self._causes if cause.id not in ids], root)
            directed = [one for one in directions(root, variants) if not one.variant.changes_data]
            own.evaluations += root.evaluations + len(directed)
            ranked = rank(directed, own.penalty)
            others = _first_of_each([one for one in ranked if one.cause.id != left.cause.id])
            same = [one for one in ranked if one.cause.id == left.cause.id]
            own.add(self._fit(kept, root, same + others[:ADDED_CAUSES]))
            if own.interrupted:
                break

    def restart(self) -> None:
        """Fit the best explanations from their own starting values.

        With levels this includes explanations by several causes, which are fitted to one level first; causes that
        cannot explain one level are not fitted to the others. Without levels it includes the other variants of the
        best cause: from the base a wrong variant may end closer to the data than the right one.
        """
        own = self.selection
        if own.base.misfit <= MISFIT_LIMIT:
            return
        levels = has_levels(own.base.model)
        together = sorted(own.tried, key=lambda one: -one.evidence)[:RESTARTED] if levels else []
        for one in [*own.singles[:ROOTS], *together]:
            self._restart_one(one.steps, partial(fit_anew, one.fit))
        for step, model in [] if levels else self._other_variants():
            self._restart_one((step,), partial(fit_base, model))

    def _restart_one(self, steps: tuple[Step, ...], fit: Callable[..., Fit | None]) -> None:
        titles = [f"{cause.id}, {variant}" if len(steps) == 1 else cause.id for cause, variant in steps]
        self._report("together", f"{' + '.join(titles)}, from its own starting values")
        try:
            found = fit(seed=self._seed, threads=self._threads)
        except (ReceptanceError, ValueError):
            return
        if found is not None:
            self.selection.evaluations += found.evaluations
            self.selection.add([self.selection.explain(steps, found)])

    def _other_variants(self) -> list[tuple[Step, Model]]:
        """Return the other variants of the best single cause with their models, if it comes close to the data."""
        best = next(iter(self.selection.singles), None)
        if best is None or best.fit.misfit > SCREENING_LIMIT:
            return []
        ((cause, own),) = best.steps
        variants = [one for one in cause.variants(self.selection.base.model) if one.name != own]
        others = [one for one in variants if not one.changes_data][:ADDED_CAUSES]
        return [(Step(one.describe(cause), one.name), one.model) for one in others]

    def finish_best(self) -> None:
        """Continue the fit of the best explanation, if it is adequate and reached its limit of evaluations."""
        own, best = self.selection, self.selection.best
        if best is None or best.fit.converged or not best.adequacy.passed:
            return
        again = own.explain(best.steps, refit(best.fit.model, best.fit.values, threads=self._threads))
        own.remove(best)
        own.add([again])

    def prune(self) -> None:
        """Take each cause, and parameters of each cause, out of the best explanation, and keep equally good ones.

        A cause may be inadequate alone only because the base led its fit to a local minimum, and adequate when its fit
        starts from the one together with another cause.
        """
        own, best = self.selection, self.selection.best
        if best is None or len(best.steps) < 2 or not best.adequacy.passed:
            return
        fewer = [tuple(step for step in best.steps if step is not left) for left in best.steps]
        for steps in [*fewer, *_with_fewer_parameters(own.base.model, best)]:
            try:
                fit = refit(_extend(own.base.model, steps), best.fit.values, threads=self._threads)
            except (ReceptanceError, UndecidableError):
                continue
            own.add([own.explain(steps, fit)])

    def _fit(self, steps: tuple[Step, ...], root: Fit, chosen: Sequence[Direction]) -> list[Explanation]:
        """Return explanations that add one cause each, the best variant of each, the highest evidence first.

        Variants that change the data are fitted from their own starting values. All others are explored on few lines;
        those that come close to the best one are fitted on all lines, the others are evaluated on these.

        Parameters
        ----------
        steps : tuple of Step
            The causes that `root` has already.
        root : Fit
            The fit to which they are added.
        chosen : sequence of Direction
            The variants.
        """
        own = self.selection
        stage = "together" if steps else "causes"
        self._report.plan(stage, len(chosen))
        found = self._fit_changed_data(steps, chosen)
        explored: list[tuple[Direction, Explored]] = []
        others = [one for one in chosen if not one.variant.changes_data]
        if any(one.adequacy.passed for one in found):
            # The data are of another quantity, so without that change no fit comes close to them.
            for one in others:
                fit = evaluate_at(root, one.variant.model)
                found.append(own.explain((*steps, one.step), fit, one.score))
        elif not own.interrupted:
            explored = self._explore(steps, root, others)
        if own.interrupted:
            # The comparison on few lines is incomplete, so the leading ones are evaluated on all lines.
            for direction, few in explored[:EVALUATED_ON_INTERRUPT]:
                found.append(own.explain((*steps, direction.step), few.evaluate()))
            return best_of_each(found)
        found += self._finish(steps, root, explored, found)
        return best_of_each(found)

    def _fit_changed_data(self, steps: tuple[Step, ...], chosen: Sequence[Direction]) -> list[Explanation]:
        """Return explanations by which the data are of another quantity, fitted from their own starting values."""
        own = self.selection
        found = []
        for direction in chosen:
            if not direction.variant.changes_data:
                continue
            try:
                self._report("together" if steps else "causes", _titled(steps, direction))
                fit = fit_base(direction.variant.model, seed=self._seed, threads=self._threads)
            except ReceptanceError:
                continue
            except KeyboardInterrupt:
                own.interrupted = True
                break
            own.evaluations += fit.evaluations
            found.append(own.explain((*steps, direction.step), fit))
        return found

    def _explore(
        self, steps: tuple[Step, ...], root: Fit, chosen: Sequence[Direction]
    ) -> list[tuple[Direction, Explored]]:
        """Return the variants with their fits on few lines, the smallest chi-square first."""
        own = self.selection
        explored: list[tuple[Direction, Explored]] = []
        leading = math.inf
        try:
            for direction in chosen:
                self._report("together" if steps else "causes", _titled(steps, direction))
                alone = [one.fit for one in own.singles if steps and one.steps[0] == direction.step]
                starts = [*starts_of(direction, root), *starts_together(own.base, alone, root)]
                few = explore(direction.variant.model, starts, threads=self._threads)
                own.evaluations += few.evaluations
                if few.ends:
                    explored.append((direction, few))
                if few.chi_square < leading:
                    leading = few.chi_square
                    self._report.leading = " + ".join([*(cause.id for cause, _ in steps), direction.cause.id])
        except KeyboardInterrupt:
            own.interrupted = True
        return sorted(explored, key=lambda pair: pair[1].chi_square)

    def _finish(
        self,
        steps: tuple[Step, ...],
        root: Fit,
        explored: Sequence[tuple[Direction, Explored]],
        before: Sequence[Explanation],
    ) -> list[Explanation]:
        """Return explanations on all lines: fitted where they come close to the best one, else evaluated."""
        own = self.selection
        without = chi_square_on_few_lines(root, self._threads)
        best = min(explored[0][1].chi_square, without) if explored else without
        limit = best + BEHIND + BEHIND_SHARE * (without - best)
        leaders: dict[str, float] = {}
        stage = "together" if steps else "causes"
        self._report.plan(stage, len(explored))
        found: list[Explanation] = []
        for direction, few in explored:
            number, leader = len(leaders), leaders.setdefault(direction.cause.id, few.chi_square)
            is_leading = number < LEADING_CAUSES
            # A variant far behind another one of its cause is not needed.
            is_close = (is_leading or few.chi_square <= limit) and few.chi_square <= leader + BEHIND
            idle = direction.predicted_evidence(own.penalty) < 0.0 and without - few.chi_square < IDLE
            try:
                if own.interrupted:
                    fit = few.evaluate()
                else:
                    self._report(stage, f"{_titled(steps, direction)}, on all lines")
                    if idle and not is_leading:
                        fit = evaluate_at(root, direction.variant.model)
                        found.append(own.explain((*steps, direction.step), fit, direction.score))
                        continue
                    fit = few.finish() if is_close or root.misfit > SCREENING_LIMIT else few.evaluate()
                own.evaluations += fit.evaluations - few.evaluations
            except ReceptanceError:
                continue
            except KeyboardInterrupt:
                own.interrupted = True
                fit = few.evaluate()
            found.append(own.explain((*steps, direction.step), fit))
            best_so_far = max([*before, *found], key=lambda one: one.evidence)
            self._report.leading = f"{best_so_far.title}, misfit {best_so_far.fit.misfit:.2f}"
        return found


def _titled(steps: tuple[Step, ...], direction: Direction) -> str:
    ids = [*(cause.id for cause, _ in steps), direction.cause.id]
    return f"{' + '.join(ids)}, {direction.variant.name}"


def _first_of_each(ranked: Sequence[Direction]) -> list[Direction]:
    """Return the first direction of each cause."""
    found: dict[str, Direction] = {}
    for one in ranked:
        found.setdefault(one.cause.id, one)
    return list(found.values())


def _extend(model: Model, steps: Sequence[Step]) -> Model:
    """Return the model with causes."""
    for step in steps:
        model = step.extend(model)
    return model


def _with_fewer_parameters(model: Model, best: Explanation) -> Iterator[tuple[Step, ...]]:
    """Yield the steps of an explanation with a variant of one cause that has a proper subset of its unknowns."""
    for i, step in enumerate(best.steps):
        variants = [one for one in step.cause.variants(model) if not one.changes_data]
        names = {one.name: {unknown.name for unknown in one.model.unknowns} for one in variants}
        for name, unknowns in names.items():
            if unknowns < names.get(step.variant, set()):
                yield (*best.steps[:i], Step(step.cause, name), *best.steps[i + 1 :])
        model = step.extend(model)
