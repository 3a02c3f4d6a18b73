"""Judgement: the rules that lead from all fits of a diagnosis to one answer."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from receptance.diagnosis.explanation import Explanation, Selection
from receptance.diagnosis.fitting import Fit
from receptance.diagnosis.model import TABLE
from receptance.diagnosis.thresholds import (
    LEAST_FREEDOM,
    LEAST_SHARE,
    MARGIN,
    ONE_CONFIGURATION,
    STRAIN_CHANCE,
    TIE,
)
from receptance.diagnosis.wording import implausible, names, odds

_LISTED_SIZES = 3
"""Most sizes that are listed with a doubt."""

Answer = Literal["adequate", "undecided", "named", "suspected", "ambiguous", "partly explained", "unexplained"]
"""The answer of a diagnosis."""


@dataclass(frozen=True, eq=False)
class Judgement:
    """The answer and its reasons."""

    answer: Answer
    """One of the seven answers of `Verdict`."""
    reported: tuple[Explanation, ...] = ()
    """Explanations that are reported, the highest evidence first."""
    ambiguous_between: tuple[str, ...] = ()
    """Ids of causes between which the data do not decide."""
    notes: tuple[str, ...] = ()
    """Reasons."""
    alternative: Explanation | None = None
    """The alternative because of which no cause is reported."""


def conclude(selection: Selection) -> Judgement:
    """Return the answer.

    1. If no cause gains more evidence than chance, the base is adequate if it passes the test of adequacy, else
       unexplained. With fewer than three degrees of freedom every model passes: undecided.
    2. Only adequate explanations are considered; if there is none: unexplained.
    3. All within the margin of the highest evidence are reported, except those that only add causes to another one of
       them, or that add a negligible cause to any other.
    4. Implausible explanations are vetoed, with a note, if a plausible one is reported. A single explanation whose only
       fault is an unusual size is reported and suspected: a simplified drawing or a stated value may be that wrong, and
       an effect outside the catalogue may act in its place. If no explanation is left: unexplained.
    5. If an alternative has more evidence, see `receptance.diagnosis.alternatives`: unexplained.
    6. If one explanation is left: named. It is only suspected near the detection limit, where it strains the tolerances
       beyond the 1 % level, where an alternative has as much evidence, or where the data are not sufficient: there is
       one configuration or one mode, a cause that should act everywhere shows in one configuration, or several causes
       share the residual of an adequate base. If several are left: ambiguous. Nothing is named if a competing fit has
       not converged. `doubt_prediction` judges a named one by held-out data.

    Where the selection allows for a discrepancy, every model is adequate. What would be named, or suspected for its
    evidence alone, is then partly explained if it takes at least half of the misfit; all other answers are unexplained.
    """
    found = _conclude(selection)
    return found if selection.discrepancy is None else _with_share(selection, found)


def _with_share(selection: Selection, found: Judgement) -> Judgement:
    """Return the answer of a selection that allows for a discrepancy."""
    if not found.reported:
        return replace(found, answer="unexplained", notes=())
    best = found.reported[0]
    share = selection.share(best)
    taken = f"beside a discrepancy of {selection.discrepancy} {best.title} takes {100.0 * share:.0f} % of the misfit"
    if any(variant.cause.unspecific for variant in best.variants):
        reason = f"{taken}, but other errors of the structure would have a similar effect"
    elif share < LEAST_SHARE:
        reason = f"{taken}, expected at least {100.0 * LEAST_SHARE:.0f} %"
    elif found.answer == "named":
        return replace(found, answer="partly explained", notes=(*found.notes, f"{taken}; the rest has no known cause"))
    elif found.ambiguous_between:
        reason = f"{taken}, but these cannot be distinguished: {names(found.ambiguous_between)}"
    else:
        doubts = _doubts(selection, best, selection.threshold)
        reason = f"{taken}, but this is not certain: {'; '.join(doubts) or '; '.join(found.notes)}"
    return Judgement("unexplained", notes=(reason,))


def _conclude(selection: Selection) -> Judgement:
    """Return the answer, whether the selection allows for a discrepancy or not."""
    notes: list[str] = []
    limit = max(selection.threshold, 0.0)
    best = selection.best
    if best is None or best.evidence <= limit:
        return _judge_base(selection)
    # Beside a discrepancy adequacy is not tested: each model would need its own one.
    beside = selection.discrepancy is not None
    # Beside a discrepancy the best one may be just above the limit, so rivals below the limit count as well.
    least = best.evidence - MARGIN if beside else limit
    passing = [
        explanation
        for explanation in selection.explanations
        if explanation.evidence > least and (beside or explanation.passed)
    ]
    if not passing:
        notes.append(f"the best explanation, {best.title}, {best.adequacy.shortcoming}, so it is rejected")
        return Judgement("unexplained", notes=tuple(notes))
    passing = [one for one in passing if not any(_adds_negligible(one, other) for other in passing)]
    near = [one for one in passing if one.evidence >= passing[0].evidence - MARGIN]
    near = [one for one in near if not any(_adds_only(one, other) for other in near)]
    remaining = [one for one in near if not one.implausible]
    if not remaining and len(near) == 1 and near[0].unusual:
        remaining = near
    for one in near:
        if one.implausible and one not in remaining:
            notes.append(f"{one.title} explains the data, but only with an implausible size: {_sizes(one)}: vetoed")
    alternative = _preferred_alternative(selection, remaining or near)
    if alternative is not None:
        reason = _withhold(alternative, (remaining or near)[0])
        return Judgement("unexplained", notes=(*notes, reason), alternative=alternative)
    if not remaining or remaining[0].evidence <= limit:
        return Judgement("unexplained", notes=tuple(notes))
    unfinished = [one for one in remaining if not one.fit.converged]
    for one in unfinished:
        notes.append(f"the fit with {one.title} has not converged, so no cause is named on its own")
    if len(remaining) > 1:
        common = frozenset.intersection(*(one.ids for one in remaining))
        between = _in_order(remaining, frozenset.union(*(one.ids for one in remaining)) - common)
        return Judgement("ambiguous", tuple(remaining), between, tuple(notes))
    verb = "is" if len(remaining[0].variants) == 1 else "are"
    doubts = [f"{remaining[0].title} {verb} suspected only: {why}" for why in _doubts(selection, remaining[0], limit)]
    return Judgement("suspected" if doubts or unfinished else "named", tuple(remaining), notes=(*notes, *doubts))


def _judge_base(selection: Selection) -> Judgement:
    """Return the answer where no cause has evidence."""
    adequacy = selection.base.adequacy
    unfinished = () if selection.base.converged else ("the fit of the base model has not converged",)
    if adequacy.passed and selection.base.degrees_of_freedom < LEAST_FREEDOM:
        another = selection.base.model.separable[1]
        note = f"the model cannot be judged: {_freedom(selection.base)}; measure more modes, {another}, or an FRF"
        return Judgement("undecided", notes=(note,))
    if adequacy.passed:  # a fit that goes on only reduces the misfit
        return Judgement("adequate", notes=unfinished)
    if unfinished:
        return Judgement("unexplained", notes=unfinished)
    note = f"the base model {adequacy.shortcoming}, and no cause improves it"
    return Judgement("unexplained", notes=(note,))


def _preferred_alternative(selection: Selection, remaining: Sequence[Explanation]) -> Explanation | None:
    """Return the alternative that is preferred to all causes.

    It needs more evidence than as few causes by the margin. To be preferred to more of them it may have less by the
    margin.
    """
    fewest = min(len(explanation.variants) for explanation in remaining)
    for alternative in selection.alternatives:
        is_simpler = len(alternative.variants) < fewest
        if alternative.evidence > remaining[0].evidence + (-MARGIN if is_simpler else MARGIN):
            return alternative
    return None


def _withhold(alternative: Explanation, best: Explanation) -> str:
    more = alternative.evidence - best.evidence
    better = "is as likely as a single change"
    if more > MARGIN:
        better = f"is more likely (odds {odds(more)})"
    return (
        f"{best.title} explains the data, but {_describe(alternative)} {better}; it is not a known cause, so no cause "
        "is named: inspect that place"
    )


def _doubts(selection: Selection, one: Explanation, limit: float) -> Iterator[str]:
    """Yield the reasons why the only explanation is not certain."""
    base = selection.base
    if selection.fast:
        yield "a fast diagnosis names no cause"
    if one.implausible:
        yield f"its size is unusual: {_sizes(one)}; check the drawing or the stated value"
    # Beside a discrepancy a cause explains the data partly at most, which claims less than a name.
    if one.evidence <= limit + MARGIN and selection.discrepancy is None:
        yield "its effect is near the detection threshold"
    alternative = next((other for other in selection.alternatives if other.evidence > one.evidence + TIE), None)
    if alternative is not None:
        yield f"{_describe(alternative)} is more likely"
    if one.fit.degrees_of_freedom < LEAST_FREEDOM:
        yield _freedom(one.fit)
    strain = one.adequacy.strain
    # Beside a discrepancy the tolerances absorb a part of it.
    if strain.chance < STRAIN_CHANCE and selection.discrepancy is None:
        errors = ", ".join(f"{error} at {size:+.1f}" for error, size in strain.worst)
        yield (
            f"it strains the tolerances beyond the 1 % level, in standard deviations {errors}; another cause may act"
        )
    window = selection.undecidable.get("exponential_window")
    if "joint_hysteretic_loss" in one.ids and window is not None and window.shared == TABLE:
        yield (
            "an exponential window that the FRFs do not state has a similar effect, and "
            f"{TABLE}, which does not allow for it"
        )
    structure = any(variant.cause.group == "structure" for variant in one.variants)
    one_configuration = len(base.model.configurations) == 1 and structure
    if one_configuration:
        sources, another = base.model.separable
        yield f"one configuration does not distinguish {sources}; measure {another}"
    if structure and base.one_mode:
        yield "one mode does not distinguish the joint from the parts; measure up to a second one"
    only = None if one_configuration else _only_configuration(base, one)
    if only:
        yield (
            f"it improves {only} alone, where an effect of that tool or clamping may be the "
            "same; measure another configuration"
        )
    large = one.extraordinary if len(one.variants) > 1 else ()
    if large:
        sizes = ", ".join(f"{size} = {one.fit.values[size]:.3g}" for size in large[:_LISTED_SIZES])
        more = f" and {len(large) - _LISTED_SIZES} more" if len(large) > _LISTED_SIZES else ""
        yield (
            f"{sizes}{more} is large for a cause beside another one, and an effect that is not in "
            "the catalogue may act in place of both"
        )
    before = base.adequacy
    if len(one.variants) > 1 and before.misfit <= before.limit:
        yield (
            "the misfit without them is within its limit, and an effect that is not in the "
            "catalogue may explain the rest"
        )


def _only_configuration(base: Fit, one: Explanation) -> str | None:
    """Return the only configuration that an explanation improves, if its causes should act in all of them."""
    if is_of_one(one) or any(variant.cause.group == "measurement" for variant in one.variants):
        return None
    return only_improved(base, one)


def is_of_one(one: Explanation) -> bool:
    """Return whether a cause is declared for some configurations or records."""
    causes = [unknown for unknown in one.fit.model.unknowns if unknown.name in one.parameters]
    return any(unknown.configurations is not None or unknown.labels is not None for unknown in causes)


def only_improved(base: Fit, one: Explanation) -> str | None:
    """Return the only configuration whose residuals an explanation improves."""
    before, after = base.by_configuration, one.fit.by_configuration
    gains = {name: max(before[name] - after[name], 0.0) for name in before}
    total, most = sum(gains.values()), max(gains, key=lambda name: gains[name])
    # Where tolerances had absorbed the cause, most of the gain is in the priors and not in the lines.
    if total <= 0.5 * one.gain or gains[most] < ONE_CONFIGURATION * total:
        return None
    return most


def _sizes(one: Explanation) -> str:
    """Return the sizes outside their plausible range, and the ranges."""
    return implausible(one.parameters, {name: one.fit.values[name] for name in one.implausible})


def _freedom(fit: Fit) -> str:
    unknowns, degrees = round(fit.independent_values - fit.degrees_of_freedom), max(fit.degrees_of_freedom, 0.0)
    return (
        f"{fit.independent_values:.3g} independent values were measured for {unknowns} unknown"
        f"{'s' if unknowns != 1 else ''}, so {degrees:.3g} degree{'s' if degrees != 1 else ''} of freedom "
        f"{'are' if degrees != 1 else 'is'} left, expected at least "
        f"{LEAST_FREEDOM}"
    )


def _adds_negligible(one: Explanation, other: Explanation) -> bool:
    return other.ids < one.ids and one.ids - other.ids <= one.negligible


def _adds_only(one: Explanation, other: Explanation) -> bool:
    return other.ids < one.ids and one.evidence < other.evidence + MARGIN


def _describe(alternative: Explanation) -> str:
    *causes, variant = alternative.variants
    return " + ".join([*(cause.cause.title for cause in causes), f"{variant.meaning} {variant.name}"])


def _in_order(remaining: Sequence[Explanation], ids: frozenset[str]) -> tuple[str, ...]:
    together = (variant.cause.id for explanation in remaining for variant in explanation.variants)
    return tuple(dict.fromkeys(id for id in together if id in ids))
