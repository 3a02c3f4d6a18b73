"""What to measure next: from a menu with costs, what separates best what is left."""

from __future__ import annotations

from dataclasses import dataclass

from receptance.diagnosis.judgement import Judgement
from receptance.diagnosis.selection import Selection
from receptance.diagnosis.verdict import NextMeasurement

__all__ = ["MENU", "Choice", "advise"]


@dataclass(frozen=True)
class Choice:
    """Something that can be measured.

    Attributes
    ----------
    action : str
        What to do.
    cost : float
        Effort, in hits on the machine or so.
    tells : frozenset of str
        Ids of causes that it measures by themselves, apart from everything else.
    """

    action: str
    cost: float
    tells: frozenset[str]


MENU = (
    Choice("weigh the blank", 1.0, frozenset({"tool_density"})),
    Choice("weigh the sensor and state its mass", 1.0, frozenset({"sensor_mass"})),
    Choice("weigh collet and nut", 1.0, frozenset({"collet_mass"})),
    Choice("weigh the holder", 1.0, frozenset({"holder_inertia"})),
    Choice("measure the overhangs again with a caliper", 1.0, frozenset({"overhang_error"})),
    Choice("repeat one measurement without the exponential window", 2.0, frozenset({"exponential_window"})),
    Choice("measure a free mass that is known", 3.0, frozenset({"calibration_gain", "time_delay", "wrong_quantity"})),
    Choice("hit once at marked offsets", 2.0, frozenset({"hammer_offset"})),
    Choice("hang it softer and repeat one measurement", 3.0, frozenset({"suspension"})),
    Choice("measure the blank alone, free-free", 4.0, frozenset({"tool_modulus", "tool_density", "fluted_part"})),
    Choice(
        "measure the holder alone, free-free", 4.0, frozenset({"holder_modulus", "holder_inertia", "flexible_body"})
    ),
    Choice(
        "measure an FRF at the holder's nose",
        3.0,
        frozenset({"joint_cross_term", "collet_mass", "joint_spread", "missing_mode"}),
    ),
    Choice("hit at two force levels", 3.0, frozenset({"joint_amplitude"})),
    Choice("measure a plain blank of the tool's size", 4.0, frozenset({"fluted_part"})),
    Choice("vary the insertion at one overhang", 5.0, frozenset({"joint_overhang_law", "joint_spread"})),
)
"""What advice is chosen from; the nearest to what an engineer has at hand is the cheapest."""


def advise(selection: Selection, judgement: Judgement) -> NextMeasurement | None:
    """Return the choice that halves best what is left, for its cost; None where nothing is left to be told apart.

    A choice separates two causes where it measures one of them by itself and not the other.
    """
    if judgement.answer in ("adequate", "named"):
        return None
    if len(selection.base.model.configurations) == 1:
        return NextMeasurement(
            action="measure another overhang", reason="one configuration cannot tell the joint from the parts"
        )
    if judgement.answer == "unexplained":
        return NextMeasurement(
            action="measure blank and holder alone, free-free",
            reason="no known cause explains the data: it shows which of the parts is not what the model says",
        )
    ids = judgement.between or tuple(cause.id for one in judgement.reported for cause, _ in one.steps)
    weights = dict.fromkeys(ids, 0.0)
    for one in judgement.reported:
        for cause, _ in one.steps:
            if cause.id in weights:
                weights[cause.id] = max(weights[cause.id], 1.0)

    def value(choice: Choice) -> float:
        told = sum(weight for name, weight in weights.items() if name in choice.tells)
        rest = sum(weights.values()) - told
        # The number of pairs that it separates; a lone suspect is separated from nothing being there.
        return (told * rest if rest else told) / choice.cost

    best = max(MENU, key=value)
    if not value(best):
        return None
    told = tuple(name for name in ids if name in best.tells)
    return NextMeasurement(action=best.action, reason=f"it shows {', '.join(told)} by itself", separates=told)
