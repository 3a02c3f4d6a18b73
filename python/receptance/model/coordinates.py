"""Coordinates: where motion is measured and where loads act."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

from receptance import _checks


@dataclass(frozen=True)
class Coordinate:
    """A position and a direction of motion or load.

    Examples
    --------
    >>> from receptance import Coordinate
    >>> nose = Coordinate("holder", 0.0)
    >>> nose.describe()
    "y at 'holder' 0 m"
    """

    part: str = ""
    """Name of the part; empty for the first part."""
    position: float | Literal["end"] = 0.0
    """Distance in m from the tip-side end of the part, or its far end. A position at an end of a segment moves with
    that end when a length changes; a position inside a segment is fixed."""
    direction: Literal["y", "theta"] = "y"
    """Transverse displacement and force, or slope and moment."""

    def __post_init__(self) -> None:
        _checks.one_of("Coordinate", "direction", self.direction, ("y", "theta"))

    def describe(self) -> str:
        """Return direction and position as text for messages, legends and tables."""
        part = f"{self.part!r} " if self.part else ""
        position = "end" if self.position == "end" else f"{self.position:g} m"
        return f"{self.direction} at {part}{position}"


@dataclass(frozen=True, init=False, repr=False)
class UnknownPosition(Coordinate):
    """A coordinate with a known direction, "y" or "theta", and an unknown position, as in files without positions.

    It differs from every `Coordinate` with a position. Where a position is needed, the tip of the first part is used.

    Examples
    --------
    >>> from receptance.model.coordinates import UnknownPosition
    >>> UnknownPosition("theta")
    UnknownPosition('theta')
    """

    def __init__(self, direction: str = "y") -> None:
        super().__init__(direction=direction)  # type: ignore[arg-type]

    def describe(self) -> str:
        """Return the direction as text, with the note that the position is unknown."""
        return f"{self.direction} at unknown position"

    def __repr__(self) -> str:
        return f"UnknownPosition({self.direction!r})"


Side: TypeAlias = Coordinate | str | Sequence[Coordinate | str] | None
"""Responses or excitations of a measurement as arguments: coordinates, or "y" or "theta" for directions alone."""


def as_coordinates(side: Coordinate | Sequence[Coordinate] | None) -> tuple[Coordinate, ...]:
    """Return one or several coordinates as a tuple; the tip by default."""
    if side is None:
        return (Coordinate(),)
    if isinstance(side, str):
        raise TypeError(f"coordinate is {side!r}, expected a Coordinate such as Coordinate('tool', 0.0, 'y')")
    return _checks.items("coordinates", side, Coordinate)


def measured_coordinates(owner: str, quantity: str, side: Side, count: int) -> tuple[Coordinate, ...]:
    """Return the coordinates of a measurement's responses or excitations; `UnknownPosition` where no position is given.

    Another number than `count`, or an entry that is neither a coordinate nor a direction, is an error.
    """
    if side is None:
        return (UnknownPosition(),) * count
    points = tuple(side) if isinstance(side, Iterable) and not isinstance(side, str) else (side,)
    if len(points) != count:
        raise ValueError(f"{owner}: there are {len(points)} {quantity} for values with {count}, expected {count}")
    for index, point in enumerate(points):
        if not isinstance(point, Coordinate) and point not in ("y", "theta"):
            raise TypeError(
                f"{owner}: {quantity}[{index}] is {point!r}, expected a Coordinate, or 'y' or 'theta' for a direction "
                "alone"
            )
    return tuple(point if isinstance(point, Coordinate) else UnknownPosition(point) for point in points)
