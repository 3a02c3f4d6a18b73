"""Changes of a model that several causes share.

A measuring chain has an error in a scope: in all records, those of a configuration or of a response channel, or in one.
A scope is described by what its records have in common and not by a list of them, so that it is the same in a model of
other observations: of fewer lines, of the configurations that are left in a fold, or of held-out records.

On a structure an element is added at a point, a step between two segments is moved, or an element takes the place of
another one, whose unknowns and tolerances are then those of the new one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, TypeVar

import numpy as np

from receptance.diagnosis.causes import Parameter
from receptance.diagnosis.model import IndescribableError, Model, UndecidableError
from receptance.diagnosis.thresholds import SHORTENED, START_LENGTH
from receptance.fit.observation import Observation
from receptance.fit.unknowns import Law, Move, Tolerance, Unknown
from receptance.model.addresses import edges_of
from receptance.model.anatomy import overhang_of
from receptance.model.coordinates import Coordinate
from receptance.model.joints import GroundSpring, PointMass, Resonator

Kind = Literal["all", "configuration", "response channel", "force level", "record"]
DirectedPlace = tuple[str, float | Literal["end"], str]
"""A part, a position on it in m from its start, and a direction."""
Places = Callable[[str], Mapping[str, float]]
"""Returns the addresses that take the place of one, and the ratios of their parameters to it."""
_Moving = TypeVar("_Moving", Move, Tolerance)


def require_receptances(model: Model) -> None:
    """Raise `UndecidableError` if nothing but natural frequencies was measured."""
    if not model.receptances:
        raise UndecidableError("natural frequencies alone do not show it; measure FRFs")


def require_free(model: Model, addresses: Iterable[str], what: str) -> None:
    """Raise `UndecidableError` if a parameter that a cause changes is an unknown of the model."""
    if any(map(model.has, addresses)):
        raise UndecidableError(f"{what} is an unknown of the model already")


def overhangs_of(model: Model) -> dict[str, list[str]]:
    """Return the addresses of the overhangs in assemblies with a joint, and the configurations that have each."""
    overhangs: dict[str, list[str]] = {}
    for name, observation, anatomy in zip(model.configuration_of, model.observations, model.anatomies, strict=True):
        if anatomy.joint:
            overhangs.setdefault(overhang_of(observation.assembly, anatomy), []).append(name)
    return overhangs


def attach(
    model: Model,
    points: Iterable[PointMass | GroundSpring | Resonator],
    parameters: Mapping[str, Parameter],
    scope: Scope | None = None,
) -> Model:
    """Return the model with point elements of one name, and parameters of a cause by the field that each one is.

    Outside a scope the parameters are null.
    """
    points = tuple(dict.fromkeys(points))
    for point in points:
        shortest = min((part.length for part in model.parts(point.part)), default=np.inf)
        if not isinstance(point.position, str) and point.position > shortest:
            raise IndescribableError(f"{point.part} is shorter than {1e3 * point.position:.3g} mm")
    # Elements of different names are equal.
    attached = model.with_change(_with_points, points, points[0].name)
    limits = {} if scope is None else scope.limits(model)
    return attached.plus(
        *(parameter.unknown(f"{points[0].name}.{field}", **limits) for field, parameter in parameters.items())
    )


def _with_points(model: Model, points: Iterable[PointMass | GroundSpring | Resonator], name: str) -> Model:
    return model.attach(*(replace(point, name=name) for point in points))


def moved_step(model: Model, part: str, position: float) -> dict[str, float]:
    """Return the moves of the lengths of two segments by which the step at a position moves away from the tip."""
    index = int(np.argmin(np.abs(np.subtract(edges_of(model.parts(part)[0]), position))))
    return {f"{part}.segment[{index - 1}].length": 1.0, f"{part}.segment[{index}].length": -1.0}


def room_of_step(model: Model, part: str, position: float, others: Iterable[float] = ()) -> tuple[float, float]:
    """Return how far a new step may move towards the tip and away from it before it meets a step or a place.

    It has no room where it is on one of them.
    """
    fixed = [*model.steps(part), *model.places(part), 0.0, model.parts(part)[0].length, *others]
    distances = [x - position for x in fixed]
    if min(map(abs, distances)) < START_LENGTH:
        return 0.0, 0.0
    return SHORTENED * max(x for x in distances if x < 0.0), SHORTENED * min(x for x in distances if x > 0.0)


def with_places(model: Model, places: Places) -> Model:
    """Return the model whose unknowns and tolerances are those of the parameters that take the place of others."""
    unknowns = tuple(_replaced(unknown, places) for unknown in model.unknowns)
    tolerances = tuple(_moved(tolerance, places) for tolerance in model.tolerances)
    return replace(
        model,
        unknowns=tuple(unknown for unknown in unknowns if unknown is not None),
        tolerances=tuple(tolerance for tolerance in tolerances if tolerance is not None),
    )


def _replaced(unknown: Unknown, places: Places) -> Unknown | None:
    if isinstance(unknown, Move):
        return _moved(unknown, places)
    before = {unknown.address: unknown.multiple, **unknown.also}
    after = {new: ratio * n for old, n in before.items() for new, ratio in places(old).items()}
    if isinstance(unknown, Law):
        # Parameters that follow a law are multiplied by a power of it, whatever their size.
        unknown = replace(unknown, follows={new: n for old, n in unknown.follows.items() for new in places(old)})
    if after == before or not after:
        return unknown if after else None
    (first, multiple), *others = after.items()
    return replace(unknown, address=first, name=unknown.name, multiple=multiple, also=dict(others))


def _moved(moving: _Moving, places: Places) -> _Moving | None:
    """Return an unknown or a tolerance that moves other parameters; None where these are none."""
    ratios = [(new, n, ratio) for old, n in moving.moves.items() for new, ratio in places(old).items()]
    moves = {new: n if moving.relative else ratio * n for new, n, ratio in ratios}
    return replace(moving, moves=moves) if moves else None


def place_of(observation: Observation, coordinate: Coordinate) -> DirectedPlace:
    """Return the place and the direction of a coordinate of an observation."""
    return coordinate.part or next(iter(observation.assembly.elements)), coordinate.position, coordinate.direction


def is_copy(first: Observation, second: Observation) -> bool:
    """Return whether two FRFs have the same values on their common lines, although they are of two configurations."""
    if first.configuration == second.configuration:
        return False
    lines, a, b = np.intersect1d(first.frequency_hz, second.frequency_hz, return_indices=True)
    return lines.size > 1 and np.array_equal(first.receptance[a], second.receptance[b])


_KEYS: Mapping[Kind, Callable[[Observation], Any]] = {
    "all": lambda observation: "all",
    "configuration": lambda observation: observation.configuration,
    # A channel of the measuring chain is the place and the direction of a response.
    "response channel": lambda observation: place_of(observation, observation.response),
    "force level": lambda observation: observation.conditions.get("force"),
    "record": lambda observation: observation.label,
}
"""What the records of a scope have in common, the widest scope first."""
OF_THE_CHAIN: tuple[Kind, ...] = ("all", "configuration", "response channel", "record")
"""Scopes of an error of the measuring chain."""


@dataclass(frozen=True)
class Scope:
    """Records that one error of a measuring chain changes."""

    kind: Kind = "all"
    key: str | float | DirectedPlace = "all"
    """What they have in common: a configuration, place and direction of a response, a force level, or a label."""

    @property
    def name(self) -> str:
        """Name in texts."""
        if self.kind == "all":
            return "all"
        if not isinstance(self.key, tuple):
            return f"{self.kind} {self.key}" if isinstance(self.key, str) else f"{self.kind} {self.key:g}"
        part, position, direction = self.key
        place = f"{part} {position}" if isinstance(position, str) else f"{part} {1e3 * position:g} mm"
        return f"{self.kind} {place}" + ("" if direction == "y" else f" {direction}")

    def within(self, name: str) -> str:
        """Return the name of a way of acting in these records; all records are not mentioned."""
        return name if self.kind == "all" else f"{name}, {self.name}"

    def has(self, observation: Observation) -> bool:
        """Return whether an observation is a record of the scope."""
        return observation.is_receptance and _KEYS[self.kind](observation) == self.key

    def change(self, model: Model, change: Callable[[Observation], Observation]) -> Model:
        """Return the model with changed records of the scope; raises `UndecidableError` where it has none."""
        self._require(model)
        return model.map(lambda observation: change(observation) if self.has(observation) else observation)

    def limits(self, model: Model) -> dict[str, Any]:
        """Return the arguments of `Parameter.unknown` by which only the records of the scope have an unknown.

        Raises
        ------
        UndecidableError
            The model has no such record, or a record outside the scope has the label of one within it.
        """
        if self.kind == "all":
            return {}
        self._require(model)
        if self.kind == "configuration":
            return {"configurations": self.key}
        labels = tuple(dict.fromkeys(record.label for record in model.receptances if self.has(record)))
        if any(record.label in labels for record in model.observations if not self.has(record)):
            raise UndecidableError(f"the {self.name} shares its label with another one: label each record differently")
        return {"labels": labels, "part": self.name}

    def _require(self, model: Model) -> None:
        if self.kind != "all" and not any(map(self.has, model.observations)):
            raise UndecidableError(f"no record is of the {self.name}")


def scopes_of(
    model: Model,
    among: Callable[[Observation], bool] = lambda observation: True,
    kinds: Sequence[Kind] = OF_THE_CHAIN,
) -> list[Scope]:
    """Return the scopes of some kinds, the widest first; scopes of the same records appear once.

    `among` chooses the records that an error can change; by default these are all FRFs. A record without a label, and
    one without a configuration or a force level, has no scope by it.
    """
    records = [record for record in model.receptances if among(record)]
    scopes = {frozenset(range(len(records))): Scope()}
    for kind in kinds:
        keys = list(map(_KEYS[kind], records))
        for key in dict.fromkeys(filter(None, keys)):
            members = frozenset(i for i, other in enumerate(keys) if other == key)
            scopes.setdefault(members, Scope(kind, key))
    return [scope for scope in scopes.values() if scope.kind in kinds]


def add(parameters: Mapping[str, Parameter], scope: Scope, model: Model) -> Model:
    """Return the model with parameters of a cause at addresses, in the records of a scope."""
    return model.plus(*(parameter.unknown(address, **scope.limits(model)) for address, parameter in parameters.items()))


def move(
    parameter: Parameter, moves: Mapping[str, float], scope: Scope, model: Model, *, relative: bool = True
) -> Model:
    """Return the model in which a parameter of a cause moves others, in the records of a scope."""
    return model.plus(parameter.move(moves, relative=relative, **scope.limits(model)))
