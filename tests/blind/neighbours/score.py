"""The score of ordinary errors that the catalogue does not contain. The rule was fixed before any batch was run.

An answer is right for a reported cause if a user would accept it (`Kind.right`: its remedy corrects or finds the error)
or if it is indistinguishable (`outcome.indistinguishable`). Every case is one of these:

wrong
    The verdict is "named" or "partly explained", and a cause is reported that is not right. Of two causes together both
    have to be right.
misleading
    The verdict is "suspected" or "ambiguous", and nothing that is reported is right.
right
    Any other verdict with causes.
adequate, unexplained, undecided
    The verdict. "Unexplained" is right where the data show the error, "adequate" where they do not.
failed
    The diagnosis ended with an error. Files that no program can use may be refused, so this has no target.

The target, at most 3 % wrong, is for all cases, those included whose error the data do not show (`outcome.Visible`);
cases whose error they show have a line of their own. Shares have exact (Clopper and Pearson) 95 % binomial intervals.
They are those of this list of kinds and sizes, which is no sample of what occurs in workshops.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from blind.outcome import Outcome
from blind.score import CERTAIN, Line, _line

from .case import NEIGHBOURS
from .kind import GROUPS

TARGET = "<= 3 %"
NAMING = ("named", "partly explained")
OPEN = ("suspected", "ambiguous")
ANSWERS = ("wrong", "misleading", "right", "adequate", "unexplained", "undecided", "failed")


def answer_of(o: Outcome) -> str:
    """Return which of `ANSWERS` an outcome is."""
    accepted = [id for id in o.reported if id in o.same]
    if o.verdict in NAMING:
        return "right" if len(accepted) == len(o.reported) else "wrong"
    if o.verdict in OPEN:
        return "right" if accepted else "misleading"
    return o.verdict


def is_wrong(o: Outcome) -> bool:
    """Return whether a cause is named, alone or for a part of the misfit, that is not right."""
    return answer_of(o) == "wrong"


def clear(o: Outcome) -> bool:
    """Return whether the error multiplies the misfit, so that it cannot be overlooked."""
    return o.large and o.oracle["misfit"] >= CERTAIN * o.oracle["misfit_true"]


def group_of(o: Outcome) -> str:
    """Return the group of a case; of a kind that is no longer in the list, none."""
    return NEIGHBOURS[o.effects[0]].group if o.effects[0] in NEIGHBOURS else ""


def table(outcomes: Iterable[Outcome]) -> tuple[list[Line], list[str]]:
    """Return the lines of the table, and results other than shares as text."""
    cases = list(outcomes)
    shown, hidden = [o for o in cases if o.large], [o for o in cases if not o.large]
    lines = [
        _line("all: named or partly explained wrongly", cases, is_wrong, TARGET),
        _line("   named wrongly", cases, lambda o: is_wrong(o) and o.verdict == "named"),
        _line("   partly explained wrongly", cases, lambda o: is_wrong(o) and o.verdict != "named"),
        _line("the data show the error: named or partly explained wrongly", shown, is_wrong, TARGET),
        _line("   the misfit as well", [o for o in shown if clear(o)], is_wrong),
        _line("the data do not show the error: the same", hidden, is_wrong),
    ]
    lines += [_line(f"group {group}: the same", [o for o in cases if group_of(o) == group], is_wrong)
              for group in GROUPS]  # fmt: skip
    for title, group in (("shown", shown), ("not shown", hidden)):
        lines += [
            _line(f"{title}: {answer}", group, lambda o, answer=answer: answer_of(o) == answer)  # type: ignore[misc]
            for answer in ANSWERS[1:]
        ]
    seconds = [o.seconds for o in cases] or [0.0]
    return lines, [f"time of a diagnosis: median {np.median(seconds):.1f} s, largest {max(seconds):.1f} s"]


def by_kind(outcomes: Sequence[Outcome]) -> list[str]:
    """Return one line for each kind: how often it was wrong, with an interval in percent, and what was answered."""
    texts = []
    for group in (*GROUPS, ""):
        for id in sorted({o.effects[0] for o in outcomes if group_of(o) == group}):
            cases = [o for o in outcomes if o.effects[0] == id]
            answers = [answer_of(o) for o in cases]
            low, high = _line(id, cases, is_wrong).interval
            counts = ", ".join(f"{answers.count(answer)} {answer}" for answer in ANSWERS[1:] if answer in answers)
            others = sorted({cause for o in cases for cause in o.reported if cause not in o.same})
            texts.append(
                f"   {group or 'formerly':<12}{id:<27}{len(cases):3d} cases, {sum(o.large for o in cases):3d} shown: "
                f"{answers.count('wrong')} wrong ({100 * low:.0f} to {100 * high:.0f})"
                f"{', ' + counts if counts else ''}{'; not right: ' + ', '.join(others) if others else ''}"
            )
    return texts


def report(outcomes: Sequence[Outcome]) -> str:
    """Return the whole table as text."""
    lines, rest = table(outcomes)
    return "\n".join([*map(str, lines), *rest, "by kind, named or partly explained wrongly:", *by_kind(outcomes)])
