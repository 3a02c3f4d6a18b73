"""Scopes of the errors of a measuring chain: all records, those of a configuration or of a response channel, or one.

A scope is described by what its records have in common and not by a list of them, so that it is the same in a model of
other observations: of fewer lines, of the configurations that are left in a fold, or of held-out records.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from receptance.diagnosis.model import Model, UndecidableError
from receptance.fit.observation import Observation
from receptance.model.coordinates import Coordinate

Kind = Literal["all", "configuration", "response channel", "force level", "record"]
DirectedPlace = tuple[str, float | Literal["end"], str]
"""A part, a position on it in m from its start, and a direction."""


def place_of(observation: Observation, coordinate: Coordinate) -> DirectedPlace:
    """Return the place and the direction of a coordinate of an observation."""
    return coordinate.part or next(iter(observation.assembly.elements)), coordinate.position, coordinate.direction


def _channel(observation: Observation) -> DirectedPlace:
    """Return the place and the direction of the response, which has one channel of the measuring chain."""
    return place_of(observation, observation.response)


_KEYS: Mapping[Kind, Callable[[Observation], Any]] = {
    "all": lambda observation: "all",
    "configuration": lambda observation: observation.configuration,
    "response channel": _channel,
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
