"""Judgement: the rules that lead from all fits of a diagnosis to one answer."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from receptance.diagnosis.explanation import Explanation, Selection
from receptance.diagnosis.fitting import Fit
from receptance.diagnosis.model import DATA_HOLDER, TABLE
from receptance.diagnosis.text import Reason
from receptance.diagnosis.thresholds import (
    LEAST_FREEDOM,
    LEAST_SHARE,
    MARGIN,
    MARGIN_OF_ALTERNATIVE,
    ONE_CONFIGURATION,
    STRAIN_CHANCE,
)

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
    reasons: tuple[Reason, ...] = ()
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
    5. If an alternative has more evidence, see `receptance.diagnosis.catalogue`: unexplained.
    6. If one explanation is left: named. It is only suspected near the detection limit, where it strains the tolerances
       beyond the 1 % level, where an alternative has about as much evidence, or where the data are not sufficient:
       there is one configuration or one mode, a cause that should act everywhere shows in one configuration, or several
       causes share the residual of an adequate base. If several are left: ambiguous. Nothing is named if a competing
       fit has not converged. `doubt_prediction` judges a named one by held-out data.

    Where the selection allows for a discrepancy, every model is adequate. What would be named, or suspected for its
    evidence alone, is then partly explained if it takes at least half of the misfit; all other answers are unexplained.
    `confirmed` compares it with the selection without a discrepancy.
    """
    judgement = _conclude(selection)
    return judgement if selection.discrepancy is None else _with_share(selection, judgement)


def _with_share(selection: Selection, judgement: Judgement) -> Judgement:
    """Return the answer of a selection that allows for a discrepancy."""
    if not judgement.reported:
        return replace(judgement, answer="unexplained", reasons=())
    best = judgement.reported[0]
    share = selection.share(best)
    values = {"title": best.title, "percent": 100.0 * share, "discrepancy": selection.discrepancy}
    further: tuple[Reason, ...] = ()
    if any(variant.cause.unspecific for variant in best.variants):
        code = "share_unspecific"
    elif is_of_some(selection.base, best):
        code = "share_of_some"
    elif share < LEAST_SHARE:
        code = "share_small"
    elif judgement.answer == "named":
        reasons = (*judgement.reasons, Reason("share_taken", values))
        return replace(judgement, answer="partly explained", reasons=reasons)
    elif judgement.ambiguous_between:
        code, values = "share_ambiguous", {**values, "causes": judgement.ambiguous_between}
    else:
        code = "share_uncertain"
        further = tuple(_doubts(selection, best, selection.threshold)) or judgement.reasons
    return Judgement("unexplained", reasons=(Reason(code, values), *further))


def confirmed(judgement: Judgement, plain: Selection) -> Judgement:
    """Return an answer beside a discrepancy, without the cause if the best explanation without one does not have it.

    The two likelihoods err in different ways: what only one of them prefers is not reported.

    Parameters
    ----------
    judgement : Judgement
        The answer beside a discrepancy.
    plain : Selection
        The selection without a discrepancy.
    """
    best = plain.best
    if judgement.answer != "partly explained" or (best is not None and judgement.reported[0].ids <= best.ids):
        return judgement
    *others, share = judgement.reasons
    without = "no cause" if best is None else best.title
    share = Reason("share_unconfirmed", {**share.values, "without": without})
    return Judgement("unexplained", reasons=(*others, share))


def _conclude(selection: Selection) -> Judgement:
    """Return the answer, whether the selection allows for a discrepancy or not."""
    limit = max(selection.threshold, 0.0)
    best = selection.best
    if best is None or best.evidence <= limit:
        return _judge_base(selection)
    # Beside a discrepancy adequacy is not tested: each model would need its own one.
    beside = selection.discrepancy is not None
    # Beside a discrepancy the best one may be just above the limit, so rivals below the limit count as well.
    least = best.evidence - MARGIN if beside else limit
    rivals = [explanation for explanation in selection.explanations if explanation.evidence > least]
    passing = [explanation for explanation in rivals if beside or explanation.passed]
    if not passing:
        rejected = Reason("rejected", {"title": best.title, "adequacy": best.adequacy})
        return Judgement("unexplained", reasons=(rejected,))
    # An explanation that only adds causes to another one counts where these are needed.
    passing = [
        explanation
        for explanation in passing
        if not any(other.ids < explanation.ids <= other.ids | explanation.negligible for other in passing)
    ]
    near = [explanation for explanation in passing if explanation.evidence >= passing[0].evidence - MARGIN]
    near = [
        explanation
        for explanation in near
        if not any(other.ids < explanation.ids and explanation.evidence < other.evidence + MARGIN for other in near)
    ]
    remaining = [explanation for explanation in near if not explanation.implausible]
    if not remaining and len(near) == 1 and near[0].unusual:
        remaining = near
    reasons = [
        Reason("vetoed", {"title": explanation.title, "sizes": explanation.implausible_sizes()})
        for explanation in near
        if explanation.implausible and explanation not in remaining
    ]
    alternative = _preferred_alternative(selection, remaining or near)
    if alternative is not None:
        leading = (remaining or near)[0]
        values = {"title": leading.title, "evidence": alternative.evidence - leading.evidence}
        reasons.append(Reason("alternative_preferred", {**values, "alternative": alternative.place}))
        return Judgement("unexplained", reasons=tuple(reasons), alternative=alternative)
    if not remaining or remaining[0].evidence <= limit:
        return Judgement("unexplained", reasons=tuple(reasons))
    unfinished = [
        Reason("not_converged", {"title": explanation.title})
        for explanation in remaining
        if not explanation.fit.converged
    ]
    reasons += unfinished
    if len(remaining) > 1:
        common = frozenset.intersection(*(explanation.ids for explanation in remaining))
        in_order = dict.fromkeys(variant.cause.id for explanation in remaining for variant in explanation.variants)
        between = tuple(id for id in in_order if id not in common)
        return Judgement("ambiguous", tuple(remaining), between, tuple(reasons))
    doubts = [*_doubts(selection, remaining[0], limit)]
    answer: Answer = "suspected" if doubts or unfinished else "named"
    return Judgement(answer, tuple(remaining), reasons=(*reasons, *doubts))


def _judge_base(selection: Selection) -> Judgement:
    """Return the answer where no cause has evidence."""
    base = selection.base
    unfinished = () if base.converged else (Reason("base_not_converged"),)
    if base.adequacy.passed and base.degrees_of_freedom < LEAST_FREEDOM:
        values = {**_freedom(base), "another": base.model.separable[1]}
        return Judgement("undecided", reasons=(Reason("too_few_values", values),))
    if base.adequacy.passed:  # a fit that goes on only reduces the misfit
        return Judgement("adequate", reasons=unfinished)
    return Judgement("unexplained", reasons=unfinished or (Reason("base_inadequate", {"adequacy": base.adequacy}),))


def _preferred_alternative(selection: Selection, remaining: Sequence[Explanation]) -> Explanation | None:
    """Return the alternative that is preferred to all causes.

    It needs more evidence than as many causes by the margin. To be preferred to more of them it may have less by the
    margin.
    """
    fewest = min(len(explanation.variants) for explanation in remaining)
    for alternative in selection.alternatives:
        margin = MARGIN if len(alternative.variants) == fewest else -MARGIN
        if len(alternative.variants) <= fewest and alternative.evidence > remaining[0].evidence + margin:
            return alternative
    return None


def _contains(alternative: Explanation, explanation: Explanation) -> bool:
    """Return whether an explanation is a special case of an alternative."""
    return any(id in explanation.ids for variant in alternative.variants for id in variant.cause.contains)


def _doubts(selection: Selection, explanation: Explanation, limit: float) -> Iterator[Reason]:
    """Yield the reasons why the only explanation is not certain."""
    base = selection.base

    def doubt(code: str, **values: Any) -> Reason:
        return Reason(code, {"title": explanation.title, **values})

    if selection.fast:
        yield doubt("fast")
    if explanation.implausible:
        yield doubt("unusual_size", sizes=explanation.implausible_sizes())
    # Beside a discrepancy a cause explains the data partly at most, which claims less than a name.
    if explanation.evidence <= limit + MARGIN and selection.discrepancy is None:
        yield doubt("near_threshold")
    least = explanation.evidence - MARGIN_OF_ALTERNATIVE
    no_more = (other for other in selection.alternatives if len(other.variants) <= len(explanation.variants))
    rivals = (other for other in no_more if not _contains(other, explanation))
    alternative = next((rival for rival in rivals if rival.evidence > least), None)
    if alternative is not None:
        yield doubt("alternative_near", alternative=alternative.place)
    if explanation.fit.degrees_of_freedom < LEAST_FREEDOM:
        yield doubt("few_degrees", **_freedom(explanation.fit))
    strain = explanation.adequacy.strain
    # Beside a discrepancy the tolerances absorb a part of it.
    if strain.chance < STRAIN_CHANCE and selection.discrepancy is None:
        yield doubt("strained", errors=dict(strain.worst))
    window = selection.undecidable.get("exponential_window")
    if "joint_hysteretic_loss" in explanation.ids and window is not None and window.shared == TABLE:
        yield doubt("window_at_table")
    structure = any(variant.cause.group == "structure" for variant in explanation.variants)
    one_configuration = len(base.model.configurations) == 1 and structure
    if one_configuration:
        sources, another = base.model.separable
        yield doubt("one_configuration", sources=sources, another=another)
    if structure and base.one_mode:
        yield doubt("one_mode")
    everywhere = not is_of_some(base, explanation) and all(
        variant.cause.group == "structure" for variant in explanation.variants
    )
    if everywhere and not one_configuration and (only := only_improved(base, explanation)):
        yield doubt("one_improved", configuration=only)
    large = explanation.extraordinary if len(explanation.variants) > 1 else ()
    if large:
        yield doubt("large_sizes", sizes={size: explanation.fit.values[size] for size in large})
    fewer = [other.fit for other in selection.explanations if other.ids < explanation.ids]
    if len(explanation.variants) > 1 and any(fit.adequacy.misfit <= fit.adequacy.limit for fit in (base, *fewer)):
        yield doubt("within_limit")


def is_of_some(base: Fit, explanation: Explanation) -> bool:
    """Return whether a cause acts in some configurations or records and not in all."""
    causes = [unknown for unknown in explanation.fit.model.unknowns if unknown.name in explanation.parameters]
    if any(unknown.configurations is not None or unknown.labels is not None for unknown in causes):
        return True
    pairs = zip(base.model.receptances, explanation.fit.model.receptances, strict=True)
    changed = {not np.array_equal(before.receptance, after.receptance) for before, after in pairs}
    return changed == {True, False}


def only_improved(base: Fit, one: Explanation) -> str | None:
    """Return the only configuration whose residuals an explanation improves."""
    before, after = base.by_configuration, one.fit.by_configuration
    gains = {name: max(before[name] - after[name], 0.0) for name in before}
    total, most = sum(gains.values()), max(gains, key=lambda name: gains[name])
    # Where tolerances had absorbed the cause, most of the gain is in the priors and not in the lines.
    if total <= 0.5 * one.gain or gains[most] < ONE_CONFIGURATION * total:
        return None
    return most


def _freedom(fit: Fit) -> dict[str, float]:
    """Return numbers of independent values and of unknowns, and the degrees of freedom that are left."""
    values, freedom = fit.independent_values, fit.degrees_of_freedom
    return {"values": values, "unknowns": round(values - freedom), "freedom": max(freedom, 0.0)}


def limits_of(selection: Selection) -> Iterator[Reason]:
    """Yield what the data of a selection do not show, or cannot distinguish."""
    model = selection.base.model
    if not model.tolerances:
        yield Reason("no_tolerances")
    if len(model.configurations) == 1:
        sources, another = model.separable
        yield Reason("single_configuration", {"sources": sources, "another": another})
    if selection.base.one_mode:
        yield Reason("single_mode")
    for code in (DATA_HOLDER, TABLE):
        if causes := [id for id, error in selection.undecidable.items() if error.shared == code]:
            yield Reason(code, {"causes": causes})
    frequencies = [observation for observation in model.observations if not observation.is_receptance]
    if len(frequencies) == len(model.observations):
        damping = [] if any(one.damped.size for one in frequencies) else ["damping"]
        yield Reason("frequencies_alone", {"hidden": [*damping, "gain", "delay", "hits"]})
    elif frequencies:
        yield Reason("frequencies_and_frfs")
