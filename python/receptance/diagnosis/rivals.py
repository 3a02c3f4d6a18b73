"""Changes of the model that have no name: what a cause must not lose against before it is named.

A cause that is not the truth takes up what the truth has left, and may take up nearly all of it. So the best one is
compared with simple changes elsewhere: a mass, a softer place, another section, a taper, a body that swings. None of
them is a cause that could be reported: a mass somewhere on the shank says where to look and not what it is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import TYPE_CHECKING

from receptance.assembly import Assembly
from receptance.beams import Part
from receptance.diagnosis.causes import Cause, Parameter, UndecidableError, Variant
from receptance.diagnosis.fitting import Explored, explore
from receptance.diagnosis.model import Model, with_points
from receptance.diagnosis.part_causes import RESONATOR, resonances
from receptance.diagnosis.screening import Direction, directions
from receptance.diagnosis.starts import starts_of
from receptance.diagnosis.ways import chosen_of
from receptance.errors import ReceptanceError
from receptance.joints import PointMass

if TYPE_CHECKING:
    from receptance.diagnosis.explanation import Explanation, Selection
    from receptance.diagnosis.steps import Steps

__all__ = ["RIVALS", "challenge"]

_PLACES = (0.15, 0.3, 0.5, 0.7, 0.85)
"""Where on tool and holder something is tried, as shares of the length."""
_SOFT = 1e-3
"""Length in m of a place that bends more than the rest."""
_PIECES = 6
"""Into so many cylinders of equal length a cone is divided."""
_FINISHED = 3
"""Rivals that are fitted on all lines."""


def _tip(model: Model) -> str:
    tips = dict.fromkeys(anatomy.tool[0] if anatomy.tool else "" for anatomy in model.anatomies)
    if len(tips) != 1 or "" in tips:
        raise UndecidableError("the tools are called differently in the assemblies")
    return next(iter(tips))


def _holders(model: Model) -> tuple[str, ...]:
    holders = {anatomy.holder for anatomy in model.anatomies}
    return holders.pop() if len(holders) == 1 else ()


def _length(part: Part) -> float:
    return float(sum(segment.length for segment in part.segments))


def _within(part: Part, share: float) -> float:
    return share * _length(part)


def _massed(name: str, share: float, assembly: Assembly) -> Assembly:
    part = assembly.elements.get(name)
    if not isinstance(part, Part):
        return assembly
    return with_points(assembly, PointMass(mass=0.0, part=name, position=share * _length(part), name="rival_mass"))


def _mass(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    places = [(_tip(model), share) for share in _PLACES]
    places += [(name, share) for name in _holders(model) for share in (0.0, *_PLACES)]
    for name, share in places:
        changed = model.rebuilt(partial(_massed, name, share)).plus(p["mass"].unknown("rival_mass.mass"))
        title = f"at {100.0 * share:.0f} % of {name}"
        yield Variant(title, changed)
        yield Variant(f"{title}, with inertia", changed.plus(p["inertia"].unknown("rival_mass.inertia")))


def _section(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    found = {
        f"{name}.segment[{index}].outer_diameter"
        for one in model.observations
        for name, part in one.assembly.elements.items()
        if isinstance(part, Part)
        for index in range(len(part.segments))
    }
    for address in sorted(found):
        if not model.has(address):
            title = f"of {address.removesuffix('.outer_diameter')}"
            yield Variant(title, model.plus(p["log_diameter"].move({address: 1.0}, relative=True)))


def _cone(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    tip = _tip(model)
    owners = [one.assembly.elements[tip] for one in model.observations if tip in one.assembly.elements]
    if any(len(part.segments) != 1 for part in owners):  # type: ignore[union-attr]
        raise UndecidableError("the tool has steps")
    for i in range(_PIECES - 1):
        # Each step is laid into what is left behind the last one.
        model, _ = model.split(tip, partial(_within, share=(i + 1) / _PIECES))
    weights = {
        f"{tip}.segment[{i}].outer_diameter": 1.0 - (i + 0.5) / _PIECES for i in range(_PIECES)
    }  # at the tip by all of it, at the holder by nothing
    yield Variant(f"of {tip}", model.plus(p["log_diameter"].move(weights, relative=True)))


def _soft(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    tip = _tip(model)
    for share in _PLACES:
        begun, _ = model.split(tip, partial(_within, share=share))
        ended, index = begun.split(tip, partial(_behind, share=share))
        move = {f"{tip}.segment[{index - 1}].outer_diameter": 1.0}
        yield Variant(f"at {100.0 * share:.0f} % of {tip}", ended.plus(p["log_diameter"].move(move, relative=True)))


def _behind(part: Part, share: float) -> float:
    return share * _length(part) + _SOFT


def _swinging(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    tip = _tip(model)
    yield from resonances(p, model, tip, 0.0, f"on the tip of {tip}")


def _rival(id: str, change: Callable[..., Iterator[Variant]], *parameters: Parameter, meaning: str) -> Cause:
    remedy = "look there: a weight, a crack, a dimension, something loose"
    return Cause(id=id, group="structure", parameters=parameters, change=change, meaning=meaning, remedy=remedy)


def _diameter(lower: float, upper: float, typical: float) -> Parameter:
    return Parameter(name="log_diameter", unit="", lower=lower, upper=upper, typical=typical)


_LIGHT = Parameter(name="mass", unit="kg", lower=1e-8, upper=1.0, typical=1e-3, null=1e-8)
"""At the tip a milligram on a spring is more than nothing."""

RIVALS = (
    _rival(
        "mass_somewhere",
        _mass,
        Parameter(name="mass", unit="kg", lower=0.0, upper=2.0, typical=0.005),
        Parameter(name="inertia", unit="kg m2", lower=0.0, upper=1e-2, typical=1e-6),
        meaning="a mass",
    ),
    _rival("other_section", _section, _diameter(-0.4, 0.4, 0.02), meaning="another diameter"),
    _rival("cone", _cone, _diameter(-0.4, 0.4, 0.02), meaning="a taper"),
    _rival("soft_place", _soft, _diameter(-2.0, 0.0, -0.2), meaning="a place that bends more than the rest"),
    _rival("body_on_the_tip", _swinging, _LIGHT, *RESONATOR[1:], meaning="a body that swings on a spring"),
)
"""Changes that are fitted beside the causes and never reported as one."""


def challenge(selection: Selection, threads: int | None, say: Steps) -> None:
    """Fit the rivals where a cause may be reported."""
    say.plan("rivals", 0)
    passing = [one for one in selection.explanations if one.adequacy.passed]
    if not passing or passing[0].evidence <= max(selection.threshold, 0.0):
        return
    base, best = selection.base, passing[0]
    if _of_another_quantity(best, base.model):
        return
    variants = [(rival, variant) for rival in RIVALS for variant in _ways(rival, base.model)]
    found = directions(base, variants)
    selection.evaluations += len(found)
    explored: list[tuple[Direction, Explored]] = []
    chosen = chosen_of([one for one in found if one.slopes.shape[1]], selection.penalty)
    say.plan("rivals", len(chosen))
    for direction in chosen:
        say("rivals", f"something without a name: {direction.cause.meaning} {direction.variant.name}")
        starts = starts_of(direction, base)
        # The joint is nearer in the best explanation than in a base that is far off.
        starts += [{**one, **best.fit.values} for one in starts[-2:]]
        there = explore(direction.variant.model, starts, threads=threads)
        selection.evaluations += there.evaluations
        if there.ends:
            explored.append((direction, there))
    explored.sort(key=lambda pair: pair[1].chi_square + selection.penalty * pair[0].count)
    # Of each rival the best way only: neighbouring frequencies lead to the same place.
    leaders: dict[str, tuple[Direction, Explored]] = {}
    for direction, there in explored:
        leaders.setdefault(direction.cause.id, (direction, there))
    for direction, there in list(leaders.values())[:_FINISHED]:
        try:
            fit = there.finished()
        except ReceptanceError:
            continue
        selection.evaluations += fit.evaluations - there.evaluations
        selection.rivals.append(selection.explained((direction.step_name,), fit))
    selection.rivals.sort(key=lambda one: -one.evidence)


def _of_another_quantity(best: Explanation, model: Model) -> bool:
    """Return whether the data are another quantity: what a structure has elsewhere does not change them by factors."""
    return any(one.fresh for cause, way in best.steps for one in _ways(cause, model) if one.name == way)


def _ways(cause: Cause, model: Model) -> list[Variant]:
    try:
        return cause.variants(model)
    except (UndecidableError, ValueError):
        return []  # such a change cannot be described in this model
