"""Advice: the next measurement, from a menu with costs, that separates the remaining explanations best."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from receptance.diagnosis.explanation import Explanation, Selection
from receptance.diagnosis.judgement import Judgement
from receptance.diagnosis.simulated import (
    DirectMeasurement,
    Measurement,
    Rival,
    SimulatedMeasurement,
    assembly_again,
    at_the_nose,
    base_explanation,
    holder_alone,
    other_force,
    other_overhang,
    tool_alone,
)
from receptance.diagnosis.thresholds import MARGIN
from receptance.diagnosis.verdict import NextMeasurement

__all__ = ["MENU", "Choice", "advise"]

_BLANK = frozenset({"fluted_part"})
_HIT_PLACE = frozenset({"hammer_offset"})
_SUSPENSION = frozenset({"suspension"})
_WINDOW = frozenset({"exponential_window"})


@dataclass(frozen=True)
class Choice:
    """A measurement that can be advised.

    Attributes
    ----------
    action : str
        Instruction to the user.
    cost : float
        Effort, about that of so many hits on the machine.
    measurement : Measurement
        Its simulation.
    """

    action: str
    cost: float
    measurement: Measurement


MENU = (
    Choice(
        "weigh the blank",
        1.0,
        DirectMeasurement({"tool_density.log_density": 5e-4, "tool_material.log_density": 5e-4}),
    ),
    Choice("weigh the sensor and state its mass", 1.0, DirectMeasurement({"sensor_mass.mass": 2e-5})),
    Choice("weigh collet and nut", 1.0, DirectMeasurement({"collet_mass.mass": 2e-3})),
    Choice(
        "weigh the holder",
        1.0,
        DirectMeasurement({"holder_inertia.log_density": 1e-3, "holder_inertia.mass": 2e-3}),
    ),
    Choice(
        "measure the overhangs again with a caliper",
        1.0,
        DirectMeasurement({"overhang_error.length": 3e-5}),
    ),
    Choice(
        "look up which exponential window the analyser had",
        1.0,
        DirectMeasurement({"exponential_window.decay_rate": 0.1}),
    ),
    Choice(
        "measure frequency and decay of its swing on the suspension",
        1.0,
        DirectMeasurement({"suspension.stiffness": 2e3, "suspension.damping": 2.0}),
    ),
    Choice(
        "repeat one measurement without the exponential window",
        2.0,
        SimulatedMeasurement(assembly_again, without=_WINDOW),
    ),
    Choice(
        "hit once exactly at a marked place",
        2.0,
        SimulatedMeasurement(assembly_again, without=_HIT_PLACE),
    ),
    Choice(
        "measure a free mass that is known",
        3.0,
        DirectMeasurement(
            {"calibration_gain.log_gain": 3e-3, "time_delay.delay": 2e-7}, presence=frozenset({"wrong_quantity"})
        ),
    ),
    Choice(
        "hang it softer and repeat one measurement",
        3.0,
        SimulatedMeasurement(assembly_again, without=_SUSPENSION),
    ),
    Choice(
        "measure an FRF at the holder's nose",
        3.0,
        SimulatedMeasurement(at_the_nose, elsewhere=_HIT_PLACE),
    ),
    Choice("measure at a longer overhang", 3.0, SimulatedMeasurement(other_overhang)),
    Choice("hit at three times the force", 3.0, SimulatedMeasurement(other_force)),
    Choice("measure the blank alone, free-free", 4.0, SimulatedMeasurement(tool_alone)),
    Choice("measure the holder alone, free-free", 4.0, SimulatedMeasurement(holder_alone)),
    Choice(
        "measure a plain blank of the tool's size",
        4.0,
        SimulatedMeasurement(assembly_again, without=_BLANK),
    ),
)
"""The menu of the advice."""


@dataclass(frozen=True)
class _Valued:
    """A measurement, or two, with its value for the decision between the remaining explanations.

    Attributes
    ----------
    action : str
        Instruction to the user.
    cost : float
        Effort.
    apart : dict of (int, int) to float
        Increase of chi-square of the second explanation if the first one is true.
    separates : tuple of str
        Ids of the causes that it confirms or refutes in any case.
    resolves : float
        Share of the explanations that are found if they are true.
    """

    action: str
    cost: float
    apart: Mapping[tuple[int, int], float]
    separates: tuple[str, ...]
    resolves: float

    @property
    def worth(self) -> float:
        """Resolved share for its cost; if none is resolved, the smallest increase of chi-square."""
        return (self.resolves + 1e-3 * math.tanh(min(self.apart.values()) / MARGIN)) / math.sqrt(self.cost)


def advise(selection: Selection, judgement: Judgement) -> NextMeasurement | None:
    """Return the choice, or two of them, that resolve most for their cost; None if no choice is left.

    Each choice is simulated with each explanation as the truth. It separates another one from the truth where the
    evidence of the other is then expected to be lower by more than the margin, even two standard deviations below the
    expectation.
    """
    if judgement.answer in ("adequate", "named"):
        return None
    if judgement.answer == "undecided":
        return NextMeasurement(
            action="measure further modes, or another overhang",
            reason="the data have too few degrees of freedom to test the model",
        )
    if len(selection.base.model.configurations) == 1:
        return NextMeasurement(
            action="measure another overhang", reason="one configuration cannot separate the joint from the parts"
        )
    if selection.base.one_mode:
        return NextMeasurement(
            action="measure up to a second mode", reason="one mode cannot separate the joint from the parts"
        )
    if judgement.answer == "unexplained":
        return NextMeasurement(
            action="measure blank and holder alone, free-free",
            reason="no known cause explains the data: this shows which part differs from its model",
        )
    left = list(judgement.reported)
    if len(left) == 1:
        left.append(base_explanation(selection))
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


def _best(left: Sequence[Explanation], rivals: Sequence[Rival], ids: Sequence[str]) -> _Valued | None:
    """Return the measurement of the highest value, or two of them where one alone leaves a question open."""
    best: _Valued | None = None
    singles: list[_Valued] = []
    for choice in sorted(MENU, key=lambda one: one.cost):
        # A choice that resolves everything is not exceeded by more expensive ones.
        if best is not None and best.worth >= 1.0 / math.sqrt(choice.cost):
            break
        apart = {
            (a, b): choice.measurement.apart(truth, other)
            for a, truth in enumerate(rivals)
            for b, other in enumerate(rivals)
            if a != b
        }
        singles.append(_value(choice.action, choice.cost, apart, left, ids))
        best = max(singles, key=lambda one: one.worth)
    if best is None or best.resolves == 1.0:
        return best
    useful = [one for one in singles if max(one.apart.values()) > MARGIN]
    for one, other in itertools.combinations(useful, 2):
        # The increases of chi-square of two measurements add up at least.
        apart = {pair: one.apart[pair] + other.apart[pair] for pair in one.apart}
        both = _value(f"{one.action}, and {other.action}", one.cost + other.cost, apart, left, ids)
        best = max(best, both, key=lambda found: found.worth)
    return best


def _value(
    action: str,
    cost: float,
    apart: Mapping[tuple[int, int], float],
    left: Sequence[Explanation],
    ids: Sequence[str],
) -> _Valued:
    separated = {pair: _separates(apart[pair], left[pair[0]], left[pair[1]]) for pair in apart}
    numbers = range(len(left))
    resolved = [all(separated[a, b] for b in numbers if b != a) for a in numbers]
    separates = []
    for name in ids:
        having = [a for a in numbers if name in left[a].ids]
        lacking = [a for a in numbers if name not in left[a].ids]
        if lacking and all(separated[a, b] and separated[b, a] for a in having for b in lacking):
            separates.append(name)
    return _Valued(action, cost, apart, tuple(separates), sum(resolved) / len(left))


def _separates(apart: float, truth: Explanation, other: Explanation) -> bool:
    # The standard deviation of the increase is twice its square root.
    return apart - 2.0 * math.sqrt(apart) > MARGIN + max(other.evidence - truth.evidence, 0.0)


def _reason(best: _Valued, count: int) -> str:
    if best.resolves == 0.0:
        return "simulated for each cause that is left, nothing on the menu settles it; this comes nearest"
    if best.resolves == 1.0:
        return "simulated for each cause that is left, it finds every one of them"
    share = round(best.resolves * count)
    named = f" ({', '.join(best.separates)})" if best.separates else ""
    return f"simulated for each cause that is left, it finds {share} of {count}{named}"
