"""Causes that lie in what holds a part to ground: a taper, a fixture."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial

from receptance.assembly import Assembly
from receptance.beams import Part
from receptance.diagnosis.causes import Cause, Parameter, UndecidableError, Variant
from receptance.diagnosis.model import Model, renamed
from receptance.identification.laws import Move
from receptance.identification.unknowns import Unknown
from receptance.joints import GroundSpring

__all__ = ["SUPPORT_CAUSES"]

_PIECES = (6, 5, 4, 3, 2)
"""Into how many a stretch of contact is divided."""
_COUNT = 6
_FADING = 2.3
"""How far contact falls off between two springs that have been taken to be at points: to a tenth."""
_FIELDS = ("k_y", "k_theta", "k_ytheta", "c_y", "c_theta", "c_ytheta")
_TRACE = math.log(1e-3)
"""Logarithm of what lies along the stretch over what lies at the point, where nothing is believed to be there."""


@dataclass(frozen=True)
class _Pieces:
    """A spring and what it is divided into: the first piece keeps its name, `shares` are of the whole."""

    name: str
    springs: tuple[GroundSpring, ...]
    shares: tuple[float, ...]
    places: tuple[float, ...]
    """Of the middles along the stretch."""


def _contact(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    wanted = _wanted(model)
    spread = [_divided(one) for one in wanted if one.length > 0.0]
    points = [one for one in wanted if one.length == 0.0]
    if len(points) not in (0, 2) or (not spread and len(points) != 2):
        raise UndecidableError("nothing says along which stretch the springs to ground could act")
    uneven: dict[str, tuple[Unknown, ...]] = {}
    if spread:
        own = _within(spread)
        ends = _moved(p["log_ends"], own, {one.name: [2.0 * x * x - 1.0 for x in one.places] for one in own})
        tilt = _moved(p["log_tilt"], own, {one.name: list(one.places) for one in own})
        uneven = {
            "more or less at the ends": (ends,),
            "more at one end": (tilt,),
            "more at the ends, and more at one of them": (ends, tilt),
        }
        for name, unknowns in uneven.items():
            yield Variant(name, _with(model, own).plus(*unknowns))
        spread = own
    if not points:
        return
    laid = [_laid_out(one, points, model) for one in points]
    # As what lies along the stretch grows, what lies at the point falls: at both ends an unknown is the whole.
    along = (
        _moved(p["log_along"], laid, {one.name: [-1.0] + [1.0] * _COUNT for one in laid}),
        _moved(p["fading"], laid, {one.name: [0.0, *(0.5 - x for x in one.places[1:])] for one in laid}),
    )
    yield Variant("not at points", _with(model, laid).plus(*along))
    for name, unknowns in uneven.items():
        yield Variant(f"not at points, {name}", _with(model, [*laid, *spread]).plus(*along, *unknowns))


def _wanted(model: Model) -> list[GroundSpring]:
    """Return the springs to ground that are identified: of one part, and the same in all assemblies."""
    found: dict[str, GroundSpring] = {}
    for one in model.observations:
        for name, point in one.assembly.attachments.items():
            if isinstance(point, GroundSpring) and any(model.has(f"{name}.{field}") for field in _FIELDS[:3]):
                spring = replace(point, name=name, part=point.part or next(iter(one.assembly.elements)))
                place = (spring.part, spring.position, spring.length, spring.weights)
                own = found.setdefault(name, spring)
                if place != (own.part, own.position, own.length, own.weights):
                    raise UndecidableError(f"{name} is elsewhere in another assembly")
    if not found:
        raise UndecidableError("no spring to ground is identified")
    if len({one.part for one in found.values()}) > 1:
        raise UndecidableError("the springs to ground are on several parts")
    return list(found.values())


def _position(spring: GroundSpring, model: Model) -> float:
    if spring.position != "end":
        return float(spring.position)
    parts = (one.assembly.elements.get(spring.part) for one in model.observations)
    return next(part.length for part in parts if isinstance(part, Part))


def _divided(spring: GroundSpring) -> _Pieces:
    """Return a spring with a length in pieces that hold its points as they are."""
    count = next((n for n in _PIECES if spring.points % n == 0), 0)
    if not count:
        raise UndecidableError(f"{spring.name} has {spring.points} points, which cannot be put into a few equal groups")
    each, length = spring.points // count, spring.length / count
    weights = [spring.shares[i * each : (i + 1) * each] for i in range(count)]
    if any(sum(own) == 0.0 for own in weights):
        raise UndecidableError(f"{spring.name} leaves a piece of its length without contact")
    begin = float(spring.position)
    springs = tuple(
        replace(spring, position=begin + i * length, length=length, weights=own, name=_named(spring, i))
        for i, own in enumerate(weights)
    )
    return _Pieces(spring.name, springs, tuple(sum(own) for own in weights), (0.0,) * count)


def _within(pieces: list[_Pieces]) -> list[_Pieces]:
    """Return pieces with their places, from -1 at the first beginning to 1 at the last end of all."""
    springs = [spring for one in pieces for spring in one.springs]
    first = min(float(one.position) for one in springs)
    whole = max(float(one.position) + one.length for one in springs) - first
    return [
        replace(
            one, places=tuple(2.0 * (float(s.position) + 0.5 * s.length - first) / whole - 1.0 for s in one.springs)
        )
        for one in pieces
    ]


def _laid_out(spring: GroundSpring, both: list[GroundSpring], model: Model) -> _Pieces:
    """Return a spring at a point, and others from there to where the other one is, less and less.

    Places are shares of the way.
    """
    first, last = sorted(_position(one, model) for one in both)
    if first == last:
        raise UndecidableError("the springs to ground are at one point")
    each = (last - first) / _COUNT
    places = tuple((i + 0.5) / _COUNT for i in range(_COUNT))
    onwards = _position(spring, model) == first
    springs = [
        replace(
            spring,
            position=first + i * each if onwards else last - (i + 1) * each,
            length=each,
            points=2,
            weights=(),
            name=_named(spring, i + 1),
        )
        for i in range(_COUNT)
    ]
    weights = [math.exp(-_FADING * x) for x in places]
    shares = (1.0, *(math.exp(_TRACE) * weight / sum(weights) for weight in weights))
    return _Pieces(spring.name, (spring, *springs), shares, (0.0, *places))


def _named(spring: GroundSpring, number: int) -> str:
    return spring.name if number == 0 else f"cause_{spring.name}_{number}"


def _with(model: Model, pieces: list[_Pieces]) -> Model:
    """Return the model with springs in pieces, and unknowns that go on meaning the whole."""
    by_name = {one.name: one for one in pieces}
    changed = model.rebuilt(partial(_rebuilt, by_name))
    return replace(changed, unknowns=tuple(_shared(unknown, by_name) for unknown in model.unknowns))


def _rebuilt(by_name: Mapping[str, _Pieces], assembly: Assembly) -> Assembly:
    points = []
    for name, point in assembly.attachments.items():
        if name not in by_name or not isinstance(point, GroundSpring):
            points.append(replace(point, name=name))
            continue
        own = by_name[name]
        for spring, share in zip(own.springs, own.shares, strict=True):
            values = {field: share * getattr(point, field) for field in _FIELDS}
            points.append(replace(spring, **values, loss_factor=point.loss_factor))
    return Assembly(renamed(assembly).values(), points, motion=assembly.motion)


def _shared(unknown: Unknown, by_name: Mapping[str, _Pieces]) -> Unknown:
    if isinstance(unknown, Move):
        moves = dict(unknown.moves)
        for address, n in unknown.moves.items():
            moves |= dict.fromkeys(_others(address, by_name), n)
        return replace(unknown, moves=moves)
    name, field = unknown.address.partition(".")[::2]
    if name not in by_name:
        return unknown
    shares = by_name[name].shares if field in _FIELDS else (1.0,) * len(by_name[name].shares)
    also = dict(zip(_others(unknown.address, by_name), shares[1:], strict=True))
    return replace(unknown, multiple=shares[0], also=also)


def _others(address: str, by_name: Mapping[str, _Pieces]) -> list[str]:
    name, field = address.partition(".")[::2]
    return [f"{one.name}.{field}" for one in by_name[name].springs[1:]] if name in by_name else []


def _moved(parameter: Parameter, pieces: list[_Pieces], shape: Mapping[str, list[float]]) -> Move:
    moves = {
        f"{spring.name}.{field}": weight
        for one in pieces
        for spring, weight in zip(one.springs, shape[one.name], strict=True)
        for field in _FIELDS
        if weight
    }
    return parameter.move(moves, relative=True)


SUPPORT_CAUSES = (
    Cause(
        id="contact_distribution",
        group="structure",
        parameters=(
            Parameter(name="log_ends", unit="", lower=-3.0, upper=3.0, typical=0.5, plausible=(-2.0, 2.0)),
            Parameter(name="log_tilt", unit="", lower=-3.0, upper=3.0, typical=0.5, plausible=(-2.0, 2.0)),
            Parameter(name="log_along", unit="", lower=0.0, upper=9.0, typical=2.3),
            Parameter(name="fading", unit="", lower=-5.0, upper=8.0, typical=0.0, secondary=True),
        ),
        change=_contact,
        meaning="a part is held elsewhere along its contact than the model says: more at an end, or not at points",
        remedy="blue the taper and spread the springs as it bears; mode shapes along the contact confirm it",
    ),
)
