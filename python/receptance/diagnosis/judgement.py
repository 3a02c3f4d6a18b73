"""From all that was fitted to one answer: rules, and nothing but rules."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from receptance.diagnosis.adequacy import FEWEST, judge
from receptance.diagnosis.explanation import MARGIN, Explanation, Selection
from receptance.diagnosis.fitting import Fit
from receptance.diagnosis.verdict import Answer

__all__ = ["Judgement", "conclude"]

_LONELY = 0.97
"""Share of the improvement from which one configuration has it alone."""
_TIE = 0.01
"""Difference of evidence that is no difference: fits end within less than this of their optimum."""
_HARDLY = 1e-2
"""Chance of strained tolerances below which a cause is not named: a wrong one leaves them to take up the rest."""


@dataclass(frozen=True, eq=False)
class Judgement:
    """The answer, the explanations that are reported, the ids that cannot be told apart, and why.

    `rival` is the change without a name for which causes were withheld.
    """

    answer: Answer
    reported: tuple[Explanation, ...]
    between: tuple[str, ...]
    notes: tuple[str, ...]
    rival: Explanation | None = None


def conclude(selection: Selection) -> Judgement:
    """Return the answer.

    1. Where no cause gains more than chance, the base is adequate if it passes the gate, else unexplained. With fewer
       than three degrees of freedom it passes whatever it lacks: undecided.
    2. Only what passes the gate itself may explain; nothing does: unexplained.
    3. All within the margin of the best evidence are reported, without what only adds to another one of them, or adds
       something to any other that is too small for anyone to mean.
    4. What nobody would believe is taken out, aloud; nothing else left: unexplained.
    5. A change that is no cause does better, see `receptance.diagnosis.rivals`: unexplained.
    6. One left: named; suspected near the limit of detection, where it leaves tolerances farther off than chance does
       in one of a hundred, where a change that is no cause does as well, or where the data cannot convict: there is
       but one configuration or one mode, a cause that all should show is seen in one of them, or several causes share
       what a model leaves that passes the gate by itself. Several left: ambiguous.
       Beside a fit that has not ended nothing is named.
    """
    notes: list[str] = []
    limit = max(selection.threshold, 0.0)
    best = next(iter(selection.explanations), None)
    if best is None or best.evidence <= limit:
        return _nothing(selection)
    passing = [one for one in selection.explanations if one.adequacy.passed]
    if not passing:
        notes.append(f"the best explanation, {_called(best)}, {best.adequacy.why_not}, so it is none")
        return Judgement("unexplained", (), (), tuple(notes))
    # What only adds something that nobody would mean is as good without it.
    passing = [one for one in passing if not any(_adds_nothing(one, other) for other in passing)]
    near = [one for one in passing if one.evidence >= passing[0].evidence - MARGIN and one.evidence > limit]
    near = [one for one in near if not any(_only_adds(one, other) for other in near)]
    for one in near:
        if one.implausible:
            sizes = ", ".join(f"{name} = {one.fit.values[name]:.3g}" for name in one.implausible)
            notes.append(f"{_called(one)} would explain the data, but {sizes} is outside the plausible range: vetoed")
    left = [one for one in near if not one.implausible]
    rival = _preferred(selection, left or near)
    if rival is not None:
        return Judgement("unexplained", (), (), (*notes, _withheld(rival, (left or near)[0])), rival)
    if not left:
        return Judgement("unexplained", (), (), tuple(notes))
    unfinished = [one for one in left if not one.fit.converged]
    for one in unfinished:
        notes.append(f"the fit with {_called(one)} has not converged, so nothing is named alone")
    if len(left) > 1:
        common = frozenset.intersection(*(one.ids for one in left))
        between = _ordered(left, frozenset.union(*(one.ids for one in left)) - common)
        return Judgement("ambiguous", tuple(left), between, tuple(notes))
    if unfinished:
        return Judgement("suspected", tuple(left), (), tuple(notes))
    doubts = list(_doubts(selection, left[0], limit))
    return Judgement("suspected" if doubts else "named", tuple(left), (), (*notes, *doubts))


def _preferred(selection: Selection, left: Sequence[Explanation]) -> Explanation | None:
    """Return the change that is no cause but is to be preferred.

    It has to do better than a cause. Of causes that explain the data only together it is enough to do nearly as well:
    it is one thing, and they are several.
    """
    least = left[0].evidence + (MARGIN if any(len(one.steps) == 1 for one in left) else -MARGIN)
    return next((one for one in selection.rivals if one.evidence > least), None)


def _withheld(rival: Explanation, best: Explanation) -> str:
    more = rival.evidence - best.evidence
    does = f"does so better, by {more:.0f} in evidence" if more > MARGIN else "alone does so as well"
    return (
        f"{_called(best)} would explain the data, but {_described(rival)} {does}: it is no cause that is known, so "
        "none is named; look there"
    )


def _doubts(selection: Selection, one: Explanation, limit: float) -> Iterator[str]:
    """Yield why the only explanation that is left is suspected and not named."""
    base, name = selection.base, _called(one)
    if one.evidence <= limit + MARGIN:
        yield f"{name} gains little more than chance could, so it is suspected and not named"
    rival = next((other for other in selection.rivals if other.evidence > one.evidence + _TIE), None)
    if rival is not None:
        yield f"{_described(rival)} does better than {name}, so it is a suspicion"
    if one.fit.left < FEWEST:
        yield f"{name}: {_few(one.fit)} to judge it, so it is a suspicion"
    strain = one.adequacy.strain
    if strain.chance < _HARDLY:
        far = ", ".join(f"{error} at {size:+.1f}" for error, size in strain.worst)
        yield (
            f"{name} leaves tolerances farther off than chance would in one of a hundred, in standard deviations: "
            f"{far}; something else may be at work, so it is a suspicion"
        )
    structure = any(cause.group == "structure" for cause, _ in one.steps)
    alone = len(base.model.configurations) == 1 and structure
    if alone:
        yield (
            "one configuration cannot tell the joint from the parts: measure another overhang; until then it is "
            "a suspicion"
        )
    if structure and base.one_mode:
        yield (
            "one mode cannot tell the joint from the parts: measure up to a second one; until then it is a suspicion"
        )
    lonely = None if alone else _lonely(base, one)
    if lonely:
        yield (
            f"{name} shows in {lonely} alone: what sits on that tool or in that clamping may be it; "
            "until another configuration shows it, it is a suspicion"
        )
    before = judge(base)
    if len(one.steps) > 1 and before.misfit <= before.limit:
        yield (
            f"the model leaves hardly more than noise explains, and {name} take it up between them: so can "
            "what no cause describes; they are a suspicion"
        )


def _lonely(base: Fit, one: Explanation) -> str | None:
    """Return the only configuration whose lines an explanation improves, where it says something of all of them."""
    local = any(" @ " in name for cause, _ in one.steps for name in one.sizes(cause))
    if local or any(cause.group == "measurement" for cause, _ in one.steps):
        return None
    before, after = base.by_configuration, one.fit.by_configuration
    gains = {name: max(before[name] - after[name], 0.0) for name in before}
    total, most = sum(gains.values()), max(gains, key=lambda name: gains[name])
    # Where tolerances had given way to it, the lines do not show it at all.
    if total <= 0.5 * one.gain or gains[most] < _LONELY * total:
        return None
    return most


def _nothing(selection: Selection) -> Judgement:
    adequacy = judge(selection.base)
    if not selection.base.converged:
        return Judgement("unexplained", (), (), ("the fit of the base model has not converged",))
    if adequacy.passed and selection.base.left < FEWEST:
        note = f"{_few(selection.base)} to judge the model: measure further modes, another overhang, or an FRF"
        return Judgement("undecided", (), (), (note,))
    if adequacy.passed:
        return Judgement("adequate", (), (), ())
    note = f"the base model {adequacy.why_not}, and no cause helps"
    return Judgement("unexplained", (), (), (note,))


def _few(fit: Fit) -> str:
    free, left = round(fit.independent - fit.left), max(fit.left, 0.0)
    return (
        f"{fit.independent:.3g} independent numbers were measured for {free} unknown{'s' if free != 1 else ''}: "
        f"{left:.3g} degree{' of freedom is' if left == 1 else 's of freedom are'} left, fewer than the {FEWEST} it "
        "takes"
    )


def _adds_nothing(one: Explanation, other: Explanation) -> bool:
    return other.ids < one.ids and one.ids - other.ids <= one.negligible


def _only_adds(one: Explanation, other: Explanation) -> bool:
    return other.ids < one.ids and one.evidence < other.evidence + MARGIN


def _called(one: Explanation) -> str:
    return " + ".join(cause.id for cause, _ in one.steps)


def _described(rival: Explanation) -> str:
    ((cause, way),) = rival.steps
    return f"{cause.meaning} {way}"


def _ordered(left: Sequence[Explanation], ids: frozenset[str]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(cause.id for one in left for cause, _ in one.steps if cause.id in ids))
