"""Causes beside a spindle whose modes are unknowns of the model.

The modes are chosen from records that a cause may have changed: too many or too few of them, with wrong shapes. Beside
the right cause they are those of the spindle, so they are chosen again there.

Where the effect is large the fits of causes beside the first modes say nothing. But on each line the spindle has three
complex numbers, whatever its modes are, and four or more records leave equations without them: causes are compared with
the spindle eliminated line by line (`coupling.spindle_elimination`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from receptance.coupling.spindle_elimination import SpindleRecords
from receptance.coupling.unknown_modes import ModeChoice
from receptance.diagnosis.causes import Cause, Variant, parameters_of
from receptance.diagnosis.explanation import Explanation, Selection
from receptance.diagnosis.fitting import Fit, evaluate, fit_base, fit_or_none, refit
from receptance.diagnosis.model import Model
from receptance.diagnosis.progress import Progress
from receptance.diagnosis.screening import extensions_of, first_of_each, list_variants
from receptance.diagnosis.thresholds import LEADING_CAUSES, LEAST_SHARE, MARGIN
from receptance.errors import ReceptanceError
from receptance.fit.unknowns import Unknown
from receptance.model.terminals import MODE_ADDRESS

ChooseModes = Callable[[Model, ModeChoice], Model]
"""Returns a model with the modes of its unknown spindles chosen again, beside the causes that it has."""
MODE_CHOICES = (ModeChoice(1, 0), ModeChoice(1, 1), ModeChoice(2, 0), ModeChoice(2, 1))
"""Choices of modes. A further mode explains something, although too little to be worth its numbers, and a cause must
not take its place. All but the first one are for spindles whose modes are in the wrong places, or too few, so that
errors of the tolerances make up for them."""


@dataclass(frozen=True)
class AnySpindle:
    """A model fitted to some of its lines, on each of them with the spindle that explains the records best."""

    chi_square: float
    expected: float
    """Its expectation from noise and floor."""
    values: dict[str, float]
    """Values of the unknowns and errors before the plane, by name."""


def with_any_spindle(model: Model, start: AnySpindle | None = None) -> AnySpindle | None:
    """Return a model fitted with the spindle eliminated, from its own starting values or from those of another fit.

    The result is None where the records do not determine the spindle line by line, where the model cannot be evaluated,
    and where a cause changes modes of the spindle, which is not defined without them.
    """
    names = {name for name, _ in model.unknown_modes}
    if len(names) != 1 or _moved_modes(model):
        return None
    (name,) = names
    before = [unknown for unknown in model.unknowns if not unknown.address.startswith(f"{name}.")]
    records = SpindleRecords.of(model.observations, before, name, model.tolerances, threads=1)
    if records is None:
        return None
    records = records.thinned()
    try:
        spindle = records.eliminated(model.seed, None if start is None else start.values)
    except (ReceptanceError, ValueError):
        return None
    if spindle is None:
        return None
    expected = records.share_of_residuals * records.independent_values
    return AnySpindle(spindle.chi_square, expected, records.named(spindle.x))


def _moved_modes(model: Model) -> list[Unknown]:
    """Return the parameters of causes that move numbers of modes."""
    causes = parameters_of(model.unknowns)
    moved = [unknown for unknown in model.unknowns if unknown.name in causes]
    return [unknown for unknown in moved if any(MODE_ADDRESS.fullmatch(address) for address in unknown.addresses)]


def fit_unstrained(model: Model, choose: ChooseModes) -> tuple[Model, Fit]:
    """Return a model with the first choice of modes that does not strain its tolerances, and its fit.

    It is the first one of all where that does not explain all lines, and where all of them strain the tolerances.
    """
    fits: list[tuple[Model, Fit]] = []
    for choice in MODE_CHOICES:
        chosen = choose(model, choice)
        fit = fit_base(chosen, continuations=0)
        fits.append((chosen, fit))
        if fit.adequacy.passed or not fits[0][1].adequacy.of_lines:
            break
    else:
        chosen, fit = fits[0]
    return chosen, fit


def fit_with_modes(model: Model, variant: Variant, before: Fit, choose: ChooseModes) -> tuple[Model, Fit]:
    """Return a model whose modes are chosen beside a cause, and its fit with this cause.

    Beside a cause that changes the spindle in some configurations the modes are those of the others.

    Parameters
    ----------
    model : Model
        The model without the cause.
    variant : Variant
        The cause in one of its variants.
    before : Fit
        A fit with the cause and other modes: its sizes from which the choice starts.
    choose : callable
        Chooses the modes.
    """
    causes = parameters_of(before.model.unknowns)
    sized = tuple(
        replace(unknown, start=before.values[unknown.name]) if unknown.name in causes else unknown
        for unknown in before.model.unknowns
    )
    extended = replace(before.model, unknowns=sized)
    changed = {name for unknown in _moved_modes(extended) for name in unknown.configurations or ()}
    others = extended.without(changed) if changed else extended
    chosen, fit = fit_unstrained(others, choose)
    # Unknowns that only the changed configurations have.
    seen = {unknown.name for unknown in others.unknowns}
    unseen = [unknown for unknown in model.unknowns if unknown.name not in seen]
    # A cause that divides a segment has changed the addresses of the tolerances, but not their names.
    starts = {tolerance.name: tolerance.start for tolerance in chosen.tolerances}
    without = replace(
        model,
        unknowns=(*(unknown for unknown in chosen.unknowns if unknown.name not in causes), *unseen),
        tolerances=tuple(replace(tolerance, start=starts.get(tolerance.name, 0.0)) for tolerance in model.tolerances),
    )
    return without, refit(variant.apply(without), fit.values, evaluations=fit.evaluations)


def unstrained(base: Fit, model: Model, choose: ChooseModes) -> Fit:
    """Return the base with other modes if it explains all lines with strained tolerances, and these do not."""
    if not base.adequacy.of_lines or base.adequacy.strain.passed:
        return base
    _, fit = fit_unstrained(replace(model, threads=1), choose)
    return fit if fit.adequacy.passed else base


def lead_with_any_spindle(
    selection: Selection, causes: Sequence[Cause], progress: Progress
) -> list[tuple[Variant, Fit]]:
    """Return the causes that take most of the misfit whatever the spindle is, each with its sizes."""
    base = selection.base
    without = with_any_spindle(base.model)
    if without is None:
        return []
    extensions, _ = list_variants(base, causes)
    # A wrong level shows beside any modes, a wrong phase does not.
    turned = (pair for pair in extensions_of(base.model, causes)[0] if _changes_phase(pair[1], base.model))
    extensions = list({pair[0]: pair for pair in (*extensions, *turned)}.values())
    # A change of the data has no start near that of the data as they are.
    fits = [
        partial(with_any_spindle, model, None if variant.cause.changes_data else without)
        for variant, model in extensions
    ]
    titles = [f"{variant.cause.title}, {variant.name}, whatever the spindle is" for variant, _ in extensions]
    least = LEAST_SHARE * (without.chi_square - without.expected)
    gains: list[tuple[float, Variant, Fit]] = []
    ends = progress.run("causes", titles, fits, selection.workers)
    for (variant, model), end in zip(extensions, ends, strict=True):
        if end is None or without.chi_square - end.chi_square < least:
            continue
        count = sum(parameter.penalised for parameter in parameters_of(model.unknowns).values())
        gain = without.chi_square - end.chi_square - selection.penalty * count
        gains.append((gain, variant, evaluate(model, {**base.values, **end.values})))
    gains.sort(key=lambda each: -each[0])
    leading = first_of_each(gains, lambda each: each[1].cause.id)
    return [(variant, fit) for _, variant, fit in leading[:LEADING_CAUSES]]


def _changes_phase(changed: Model, model: Model) -> bool:
    """Return whether the data of a model have the magnitudes of those of another one, and other phases."""
    pairs = [(new.receptance, old.receptance) for new, old in zip(changed.receptances, model.receptances, strict=True)]
    same = all(np.allclose(np.abs(new), np.abs(old), rtol=1e-12) for new, old in pairs)
    return same and any(not np.array_equal(new, old) for new, old in pairs)


def beside_modes(
    selection: Selection,
    model: Model,
    candidates: Sequence[tuple[Variant, Fit]],
    choose: ChooseModes,
    progress: Progress,
) -> tuple[Model, Explanation] | None:
    """Return a model with modes chosen beside the best of some causes, and this cause.

    They are tried until one explains all lines. The modes with the least chi-square, with a penalty for each unknown,
    are used if it is less than that of the base and of the causes beside its modes, else None is returned.
    """

    def size(fit: Fit) -> float:
        return fit.chi_square + selection.penalty * fit.task.parameters.count

    on_one_thread = replace(model, threads=1)
    fits = [
        partial(fit_or_none, partial(fit_with_modes, on_one_thread, variant, before, choose))
        for variant, before in candidates
    ]
    titles = [f"{variant.cause.title}, with modes chosen beside it" for variant, _ in candidates]
    least = min(size(before) for before in (selection.base, *(fit for _, fit in candidates))) - MARGIN
    best: tuple[Model, Explanation] | None = None
    pairs = progress.run("together", titles, fits, selection.workers)
    for (variant, _), pair in zip(candidates, pairs, strict=True):
        if pair is None:
            continue
        without, fit = pair
        if size(fit) < least:
            least = size(fit)
            best = replace(without, threads=model.threads), selection.explain((variant,), fit)
            # Tolerances may be strained by the modes, and not by the cause.
            if best[1].adequacy.of_lines:
                break
    return best
