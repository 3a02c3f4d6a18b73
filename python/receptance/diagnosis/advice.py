"""What to measure next: from a menu with costs, what separates best what is left, by simulating it."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from receptance.diagnosis.explanation import Explanation, Selection
from receptance.diagnosis.judgement import Judgement
from receptance.diagnosis.simulated import (
    Alone,
    FRFAgain,
    Known,
    Measurement,
    Rival,
    at_the_nose,
    nothing,
    other_force,
    other_overhang,
    same_again,
)
from receptance.diagnosis.thresholds import MARGIN
from receptance.diagnosis.verdict import NextMeasurement

__all__ = ["MENU", "Choice", "advise"]

_BLANK = frozenset({"fluted_part"})
_WINDOW = frozenset({"exponential_window"})


@dataclass(frozen=True)
class Choice:
    """Something that can be measured.

    Attributes
    ----------
    action : str
        What to do.
    cost : float
        Effort, in hits on the machine or so.
    measurement : Measurement
        How it is simulated.
    """

    action: str
    cost: float
    measurement: Measurement


MENU = (
    Choice("weigh the blank", 1.0, Known({"tool_density.log_density": 5e-4, "tool_material.log_density": 5e-4})),
    Choice("weigh the sensor and state its mass", 1.0, Known({"sensor_mass.mass": 2e-5})),
    Choice("weigh collet and nut", 1.0, Known({"collet_mass.mass": 2e-3})),
    Choice("weigh the holder", 1.0, Known({"holder_inertia.log_density": 1e-3, "holder_inertia.mass": 2e-3})),
    Choice("measure the overhangs again with a caliper", 1.0, Known({"overhang_error.length": 3e-5})),
    Choice(
        "look up which exponential window the analyser had",
        1.0,
        Known({"exponential_window.decay_rate": 0.1}),
    ),
    Choice(
        "measure frequency and decay of its swing on the suspension",
        1.0,
        Known({"suspension.stiffness": 2e3, "suspension.damping": 2.0}),
    ),
    Choice(
        "repeat one measurement without the exponential window",
        2.0,
        FRFAgain(same_again, _WINDOW),
    ),
    Choice("hit once exactly at a marked place", 2.0, FRFAgain(same_again, frozenset({"hammer_offset"}))),
    Choice(
        "measure a free mass that is known",
        3.0,
        Known({"calibration_gain.log_gain": 3e-3, "time_delay.delay": 2e-7}, presence=frozenset({"wrong_quantity"})),
    ),
    Choice("hang it softer and repeat one measurement", 3.0, FRFAgain(same_again, frozenset({"suspension"}))),
    Choice("measure an FRF at the holder's nose", 3.0, FRFAgain(at_the_nose, elsewhere=frozenset({"hammer_offset"}))),
    Choice("measure at a longer overhang", 3.0, FRFAgain(other_overhang)),
    Choice("hit at three times the force", 3.0, FRFAgain(other_force)),
    Choice("measure the blank alone, free-free", 4.0, Alone("tool")),
    Choice("measure the holder alone, free-free", 4.0, Alone("holder")),
    Choice("measure a plain blank of the tool's size", 4.0, FRFAgain(same_again, _BLANK)),
)
"""What advice is chosen from."""


@dataclass(frozen=True)
class _Weighed:
    """What is to be done, which ids it settles, and in how many of the cases that are left it finds the truth."""

    action: str
    cost: float
    apart: Mapping[tuple[int, int], float]
    separates: tuple[str, ...]
    resolves: float

    @property
    def worth(self) -> float:
        """What it brings for its cost; among those that settle nothing, what comes nearest to it."""
        return (self.resolves + 1e-3 * math.tanh(min(self.apart.values()) / MARGIN)) / math.sqrt(self.cost)


def advise(selection: Selection, judgement: Judgement) -> NextMeasurement | None:
    """Return the choice, or two of them, that resolve most of what is left for their cost; None where nothing is left.

    Each choice is simulated with each explanation as the truth. It tells the truth from another one where the other's
    evidence is then expected to fall behind by more than the margin, with two standard deviations of chance to spare.
    """
    if judgement.answer in ("adequate", "named"):
        return None
    if judgement.answer == "undecided":
        return NextMeasurement(
            action="measure further modes, or another overhang",
            reason="hardly more numbers were measured than are fitted, so nothing is left to judge the model by",
        )
    if len(selection.base.model.configurations) == 1:
        return NextMeasurement(
            action="measure another overhang", reason="one configuration cannot tell the joint from the parts"
        )
    if selection.base.one_mode:
        return NextMeasurement(
            action="measure up to a second mode", reason="one mode cannot tell the joint from the parts"
        )
    if judgement.answer == "unexplained":
        return NextMeasurement(
            action="measure blank and holder alone, free-free",
            reason="no known cause explains the data: it shows which of the parts is not what the model says",
        )
    left = list(judgement.reported)
    if len(left) == 1:
        left.append(nothing(selection))
    ids = judgement.between or tuple(cause.id for cause, _ in judgement.reported[0].steps)
    best = _best(left, [Rival(one, selection.base.model) for one in left], ids)
    if best is None or best.worth <= 0.0:
        return None
    return NextMeasurement(
        action=best.action,
        reason=_reason(best, len(left)),
        separates=best.separates,
        resolves=best.resolves,
        cost=best.cost,
    )


def _best(left: Sequence[Explanation], rivals: Sequence[Rival], ids: Sequence[str]) -> _Weighed | None:
    """Return what is worth most: a measurement, or two of them where one alone leaves something open."""
    best: _Weighed | None = None
    singles: list[_Weighed] = []
    for choice in sorted(MENU, key=lambda one: one.cost):
        # None that costs more can be worth more than one that finds the truth in any case.
        if best is not None and best.worth >= 1.0 / math.sqrt(choice.cost):
            break
        apart = {
            (a, b): choice.measurement.apart(truth, other)
            for a, truth in enumerate(rivals)
            for b, other in enumerate(rivals)
            if a != b
        }
        singles.append(_weighed(choice.action, choice.cost, apart, left, ids))
        best = max(singles, key=lambda one: one.worth)
    if best is None or best.resolves == 1.0:
        return best
    useful = [one for one in singles if max(one.apart.values()) > MARGIN]
    for one, other in itertools.combinations(useful, 2):
        # Together they tell apart at least what each does.
        apart = {pair: one.apart[pair] + other.apart[pair] for pair in one.apart}
        both = _weighed(f"{one.action}, and {other.action}", one.cost + other.cost, apart, left, ids)
        best = max(best, both, key=lambda found: found.worth)
    return best


def _weighed(
    action: str,
    cost: float,
    apart: Mapping[tuple[int, int], float],
    left: Sequence[Explanation],
    ids: Sequence[str],
) -> _Weighed:
    told = {pair: _tells(apart[pair], left[pair[0]], left[pair[1]]) for pair in apart}
    numbers = range(len(left))
    resolved = [all(told[a, b] for b in numbers if b != a) for a in numbers]
    separates = []
    for name in ids:
        having = [a for a in numbers if name in left[a].ids]
        lacking = [a for a in numbers if name not in left[a].ids]
        if lacking and all(told[a, b] and told[b, a] for a in having for b in lacking):
            separates.append(name)
    return _Weighed(action, cost, apart, tuple(separates), sum(resolved) / len(left))


def _tells(apart: float, truth: Explanation, other: Explanation) -> bool:
    return apart - 2.0 * math.sqrt(apart) > MARGIN + max(other.evidence - truth.evidence, 0.0)


def _reason(best: _Weighed, count: int) -> str:
    if best.resolves == 0.0:
        return "simulated for each cause that is left, nothing on the menu settles it; this comes nearest"
    if best.resolves == 1.0:
        return "simulated for each cause that is left, it finds every one of them"
    share = round(best.resolves * count)
    named = f" ({', '.join(best.separates)})" if best.separates else ""
    return f"simulated for each cause that is left, it finds {share} of {count}{named}"
