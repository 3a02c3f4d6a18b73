"""Which causes, alone or together, explain the data: every one refitted, then more added one at a time."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from time import perf_counter

from receptance.diagnosis.adequacy import GATE
from receptance.diagnosis.causes import Cause, UndecidableError
from receptance.diagnosis.explanation import MARGIN, Explanation, Selection
from receptance.diagnosis.fitting import Explored, Fit, explore, fit_base, on_few_lines, refit, starting_at, unfitted
from receptance.diagnosis.levels import fit_again, fit_from_far, has_levels
from receptance.diagnosis.model import Model
from receptance.diagnosis.rivals import challenge
from receptance.diagnosis.screening import Direction, chance, directions
from receptance.diagnosis.starts import starts_of, starts_together
from receptance.diagnosis.steps import Steps
from receptance.diagnosis.ways import chosen_of, ways_of
from receptance.errors import ReceptanceError

__all__ = ["select"]

_ANOTHER = 20.0
"""One more cause has to add this much evidence: weak ones come in pairs where something unknown is at work."""
_ROOTS = 3
"""Explanations to which more causes are added."""
_MORE = 6
"""Causes that are tried in addition to each of them."""
_PAIRS = 8
"""Explanations by several causes that are fitted again, by level, where nothing explains the data."""
_HOPELESS = 20.0
"""Misfit from which on neither a promise to first order nor a few steps say much: every cause is tried, to its end."""
_SETTLED = 1e-9
_TOLD = 12
"""So many explanations are evaluated on all lines where a selection is interrupted while few lines lead."""
_LEAST = 4
"""The best variants of so many causes are fitted on all lines in any case."""
_IDLE = 10.0
"""A cause that gains less on few lines, and nothing to first order on all, is not fitted on all of them."""
_FAR = 60.0
_FAR_SHARE = 0.3
"""An explanation whose chi-square on few lines is worse than the best by more is only evaluated on all lines."""


def select(
    model: Model,
    causes: Sequence[Cause],
    *,
    seed: int = 0,
    threads: int | None = None,
    most: int = 2,
    base: Fit | None = None,
    progress: Steps | None = None,
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
    progress : Steps, optional
        Is told of each step. A KeyboardInterrupt ends the selection with what is known: `Selection.interrupted`.
    """
    say = progress or Steps()
    began = perf_counter()
    try:
        base = base or fit_from_far(model, seed=seed, threads=threads, say=partial(say, "base"))
        interrupted = False
    except KeyboardInterrupt:
        base, interrupted = unfitted(model, threads), True
    selection = Selection(base, math.log(max(base.independent, 2.0)), 0.0, [], {}, interrupted=interrupted)
    if not interrupted:
        try:
            for stage in _stages(selection, causes, seed, threads, most, say):
                stage()
                if selection.interrupted:
                    break
        except KeyboardInterrupt:
            selection.interrupted = True
    selection.seconds = perf_counter() - began
    return selection


def _stages(
    selection: Selection, causes: Sequence[Cause], seed: int, threads: int | None, most: int, say: Steps
) -> Iterator[Callable[[], None]]:
    """Yield what is done after the fit of the base, one after the other; each adds to the selection."""

    def singles() -> None:
        base = selection.base
        variants, selection.undecidable = ways_of(base.model, causes, base)
        selection.found = directions(base, variants)
        selection.threshold = chance(selection.found, selection.penalty, seed=seed)
        selection.evaluations = base.evaluations + len(selection.found)
        chosen = chosen_of(selection.found, selection.penalty)
        selection.singles = _fitted(selection, (), base, chosen, seed, threads, say)

    def together() -> None:
        roots = selection.singles
        for _ in range(1, most):
            roots = _added(selection, roots, causes, seed, threads, say)
            selection.several += roots
            if not roots or selection.interrupted:
                break

    yield singles
    yield lambda: _rebased(selection, threads)
    yield together
    yield lambda: _exchanged(selection, causes, seed, threads, say)
    if not any(one.adequacy.passed for one in selection.explanations):
        yield lambda: _begun_anew(selection, seed, threads, say)
    say.plan("together", 0)
    yield lambda: _ended(selection, threads)
    yield lambda: _pruned(selection, threads)
    yield lambda: challenge(selection, threads, say)


def _ended(selection: Selection, threads: int | None) -> None:
    """Let the fit of the best explanation go on where its evaluations were used up: beside it nothing is named."""
    best = selection.explanations[0] if selection.explanations else None
    if best is None or best.fit.converged or not best.adequacy.passed:
        return
    again = selection.explained(best.steps, refit(best.fit.model, best.fit.values, threads=threads))
    target = selection.singles if len(best.steps) == 1 else selection.several
    target[:] = _best_each([again, *(one for one in target if one is not best)])


def _begun_anew(selection: Selection, seed: int, threads: int | None, say: Steps) -> None:
    """Fit the best causes from far: a base that is far off may have led all their starts astray.

    Where there are levels, causes together as well: who cannot explain one of them is not fitted to the others. Of the
    best cause the other ways of acting are fitted too: from that base another one came nearer than the right one.
    """
    if selection.base.misfit <= GATE:
        return
    levels = has_levels(selection.base.model)
    together = sorted(selection.tried, key=lambda one: -one.evidence)[:_PAIRS] if levels else []
    for one in [*selection.singles[:_ROOTS], *together]:
        say("together", f"{' + '.join(cause.id for cause, _ in one.steps)}, anew")
        try:
            fit = fit_again(one.fit, seed=seed, threads=threads)
        except (ReceptanceError, ValueError):
            continue
        if fit is None:
            continue
        selection.evaluations += fit.evaluations
        target = selection.singles if len(one.steps) == 1 else selection.several
        target.append(selection.explained(one.steps, fit))
    for step, model in () if levels else _other_ways(selection):
        say("together", f"{step[0].id}, {step[1]}, anew")
        try:
            fit = fit_base(model, seed=seed, threads=threads)
        except (ReceptanceError, ValueError):
            continue
        selection.evaluations += fit.evaluations
        selection.singles.append(selection.explained((step,), fit))
    selection.singles, selection.several = _best_each(selection.singles), _best_each(selection.several)


def _other_ways(selection: Selection) -> Iterator[tuple[tuple[Cause, str], Model]]:
    """Yield the best cause in its other ways of acting, with the model, where it comes near the data."""
    best = max(selection.singles, key=lambda one: one.evidence, default=None)
    if best is None or best.fit.misfit > _HOPELESS:
        return
    ((cause, own),) = best.steps
    others = [variant for variant in cause.variants(selection.base.model) if variant.name != own and not variant.fresh]
    for variant in others[:_MORE]:
        yield (variant.of(cause), variant.name), variant.model


def _pruned(selection: Selection, threads: int | None) -> None:
    """Take each cause out of the best explanation again, or some of its numbers, and keep what does as well without.

    A cause that fails alone, because the base led its fit astray, may have needed company only on the way.
    """
    best = selection.explanations[0] if selection.explanations else None
    if best is None or len(best.steps) < 2 or not best.adequacy.passed:
        return
    fewer = [tuple(step for step in best.steps if step is not left) for left in best.steps]
    for steps in [*fewer, *_with_less(selection.base.model, best)]:
        try:
            fit = refit(_with(selection.base.model, steps), best.fit.values, threads=threads)
        except (ReceptanceError, UndecidableError, StopIteration):
            continue
        own = selection.explained(steps, fit)
        target = selection.singles if len(steps) == 1 else selection.several
        target[:] = _best_each([*target, own])


def _with_less(model: Model, best: Explanation) -> Iterator[tuple[tuple[Cause, str], ...]]:
    """Yield the steps of an explanation with a variant of one cause that has some of its unknowns and no others."""
    for i, (cause, own) in enumerate(best.steps):
        variants = cause.variants(model)
        names = {v.name: {one.name for one in v.model.unknowns} for v in variants if not v.fresh}
        for name, unknowns in names.items():
            if unknowns < names.get(own, set()):
                yield (*best.steps[:i], (cause, name), *best.steps[i + 1 :])
        model = next(v.model for v in variants if v.name == own)


def _exchanged(selection: Selection, causes: Sequence[Cause], seed: int, threads: int | None, say: Steps) -> None:
    """Put other causes, and other ways of acting, in the place of each cause of the best explanation.

    What was found first decided how it acts while the others were not there, and kept rivals from being tried.
    """
    best = selection.explanations[0] if selection.explanations else None
    if best is None or len(best.steps) < 2 or not best.adequacy.of_lines:
        return
    for left in best.steps:
        kept = tuple(step for step in best.steps if step is not left)
        ids = {cause.id for cause, _ in kept}
        try:
            root = refit(_with(selection.base.model, kept), best.fit.values, threads=threads)
        except (ReceptanceError, UndecidableError, StopIteration):
            continue
        variants, _ = ways_of(root.model, [cause for cause in causes if cause.id not in ids], root)
        directed = [one for one in directions(root, variants) if not one.variant.fresh]
        selection.evaluations += root.evaluations + len(directed)
        ranked = chosen_of(directed, selection.penalty)
        others = list({one.cause.id: one for one in reversed(ranked) if one.cause.id != left[0].id}.values())[::-1]
        own = [one for one in ranked if one.cause.id == left[0].id] + others[:_MORE]
        found = _fitted(selection, kept, root, own, seed, threads, say)
        selection.several = _best_each([*selection.several, *found])
        if selection.interrupted:
            break


def _with(model: Model, steps: Sequence[tuple[Cause, str]]) -> Model:
    for cause, name in steps:
        model = next(variant.model for variant in cause.variants(model) if variant.name == name)
    return model


def _rebased(selection: Selection, threads: int | None) -> None:
    """Fit the base from the best explanation too: a base that was stuck convicts none."""
    if not selection.singles:
        return
    base, best = selection.base, selection.singles[0]
    try:
        again = refit(base.model, best.fit.values, threads=threads)
    except ReceptanceError:
        return
    if again.chi_square >= base.chi_square - _SETTLED * base.chi_square:
        return
    less = base.chi_square - again.chi_square
    selection.base = again
    selection.singles = [replace(one, gain=one.gain - less, evidence=one.evidence - less) for one in selection.singles]


def _fitted(
    selection: Selection,
    steps: tuple[tuple[Cause, str], ...],
    root: Fit,
    chosen: Sequence[Direction],
    seed: int,
    threads: int | None,
    say: Steps,
) -> list[Explanation]:
    """Return the explanations that add one cause each, the best variant of each, the best evidence first.

    All are explored on few lines. Those that come anywhere near the best one there are fitted on all lines; what is far
    off is only evaluated on them.
    """
    stage = "together" if steps else "causes"
    say.plan(stage, len(chosen))
    explored: list[tuple[Direction, Explored]] = []
    found = _read_anew(selection, steps, chosen, seed, threads, say)
    settled = any(one.adequacy.passed for one in found)
    lead = math.inf
    try:
        for direction in [] if selection.interrupted else chosen:
            if direction.variant.fresh:
                continue
            if settled:
                # Data that are explained as another quantity are off by factors as this one: no fit leads there.
                fit = starting_at(root, direction.variant.model)
                found.append(selection.explained((*steps, direction.step_name), fit, direction.score))
                continue
            say(stage, f"{_titled(steps, direction)}, {direction.variant.name}")
            alone = [one.fit for one in selection.singles if steps and one.steps[0] == direction.step_name]
            starts = [*starts_of(direction, root), *starts_together(selection.base, alone, root)]
            there = explore(direction.variant.model, starts, threads=threads)
            selection.evaluations += there.evaluations
            if there.ends:
                explored.append((direction, there))
            if there.chi_square < lead:
                lead = there.chi_square
                say.leading = _titled(steps, direction)
    except KeyboardInterrupt:
        selection.interrupted = True
    explored.sort(key=lambda pair: pair[1].chi_square)
    if selection.interrupted:
        # Few lines have led so far: what that is worth on all of them is known after one evaluation.
        for direction, there in explored[:_TOLD]:
            found.append(selection.explained((*steps, direction.step_name), there.evaluated()))
        return _best_each(found)
    without = on_few_lines(root, threads)
    best = min(explored[0][1].chi_square, without) if explored else without
    far = best + _FAR + _FAR_SHARE * (without - best)
    leaders: dict[str, float] = {}
    say.plan(stage, len(explored))
    for direction, there in explored:
        # A variant that is far behind another one of its cause is not needed.
        number, lead = len(leaders), leaders.setdefault(direction.cause.id, there.chi_square)
        behind = there.chi_square > lead + _FAR
        try:
            if not selection.interrupted:
                say(stage, f"{_titled(steps, direction)}, {direction.variant.name}, on all lines")
            if selection.interrupted:
                fit = there.evaluated()
            elif number >= _LEAST and _idle(selection, direction, there, without):
                fit = starting_at(root, direction.variant.model)
                found.append(selection.explained((*steps, direction.step_name), fit, direction.score))
                continue
            else:
                near = ((number < _LEAST or there.chi_square <= far) and not behind) or root.misfit > _HOPELESS
                fit = there.finished() if near else there.evaluated()
            selection.evaluations += fit.evaluations - there.evaluations
        except ReceptanceError:
            continue
        except KeyboardInterrupt:
            selection.interrupted = True
            fit = there.evaluated()
        found.append(selection.explained((*steps, direction.step_name), fit))
        leading = max(found, key=lambda one: one.evidence)
        say.leading = f"{' + '.join(cause.id for cause, _ in leading.steps)}, misfit {leading.fit.misfit:.2f}"
    return _best_each(found)


def _read_anew(
    selection: Selection,
    steps: tuple[tuple[Cause, str], ...],
    chosen: Sequence[Direction],
    seed: int,
    threads: int | None,
    say: Steps,
) -> list[Explanation]:
    """Return the explanations by which the data are another quantity: their fits begin anew."""
    found = []
    for direction in chosen:
        if direction.variant.fresh:
            try:
                say("together" if steps else "causes", f"{_titled(steps, direction)}, {direction.variant.name}")
                fit = fit_base(direction.variant.model, seed=seed, threads=threads)
            except ReceptanceError:
                continue
            except KeyboardInterrupt:
                selection.interrupted = True
                break
            selection.evaluations += fit.evaluations
            found.append(selection.explained((*steps, direction.step_name), fit))
    return found


def _titled(steps: tuple[tuple[Cause, str], ...], direction: Direction) -> str:
    return " + ".join([cause.id for cause, _ in steps] + [direction.cause.id])


def _idle(selection: Selection, direction: Direction, there: Explored, without: float) -> bool:
    """Return whether a cause is worth nothing, neither to first order on all lines nor from any start on few."""
    promised = direction.score - selection.penalty * direction.count
    return promised < 0.0 and without - there.chi_square < _IDLE


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
    say: Steps,
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
        variants, _ = ways_of(root.fit.model, others, root.fit)
        directed = [one for one in directions(root.fit, variants) if not one.variant.fresh]
        selection.evaluations += len(directed)
        least = max(selection.threshold, 0.0)
        far = root.adequacy.misfit > _HOPELESS
        promising = [one for one in directed if far or one.score > selection.penalty * one.count + least]
        open_ = open_ or bool(promising)
        ranked = chosen_of(promising, selection.penalty)
        own: list[Direction] = []
        for direction in ranked:
            if (far or len(own) < _MORE) and all(direction.cause.id != other.cause.id for other in own):
                own.append(direction)
        fitted = _fitted(selection, root.steps, root.fit, own, seed, threads, say)
        selection.tried = _best_each([*selection.tried, *fitted])
        for one in fitted:
            if one.evidence > best.evidence + max(selection.threshold, _ANOTHER):
                found.append(one)
        if selection.interrupted:
            break
    return _best_each(found)
