"""Coordinates: where motion is seen and where loads act."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

__all__ = ["Coordinate"]


@dataclass(frozen=True)
class Coordinate:
    """A place and a direction of motion or load.

    Parameters
    ----------
    part : str, optional
        Name of the part; empty for the first one.
    position : float or "end", optional
        Distance in m from the part's tip-side end, or its far end. A position on a step between two segments
        moves with the step when a length changes; one inside a segment stays where it is.
    direction : {"y", "theta"}, optional
        Transverse displacement and force, or slope and moment.

    Examples
    --------
    >>> from receptance import Coordinate
    >>> nose = Coordinate("holder", 0.0)
    """

    part: str = ""
    position: float | Literal["end"] = 0.0
    direction: Literal["y", "theta"] = "y"

    def __post_init__(self) -> None:
        if self.direction not in ("y", "theta"):
            raise ValueError(f"Coordinate: direction is {self.direction!r}, expected 'y' or 'theta'")


def as_coordinates(side: Coordinate | Sequence[Coordinate] | None) -> tuple[Coordinate, ...]:
    """Return one or several coordinates as a tuple, the tip where none is given."""
    if side is None:
        return (Coordinate(),)
    if isinstance(side, str):
        raise TypeError(f"the coordinate is {side!r}, expected a Coordinate such as Coordinate('tool', 0.0, 'y')")
    points = (side,) if isinstance(side, Coordinate) else tuple(side)
    for index, point in enumerate(points):
        if not isinstance(point, Coordinate):
            raise TypeError(f"coordinate {index} is {point!r}, expected a Coordinate")
    if not points:
        raise ValueError("there is no coordinate, expected at least one")
    return points
