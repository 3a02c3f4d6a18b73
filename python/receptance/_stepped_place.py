"""Coordinates that go with the steps of a part."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from receptance.beams import Part

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.assembly import Assembly
    from receptance.coordinates import Coordinate

__all__ = ["SteppedPlace"]


class SteppedPlace:
    """A coordinate that stays on its step between two segments when a length changes."""

    def __init__(self, assembly: Assembly, place: Coordinate) -> None:
        self._place = place
        self._step: int | None = None
        if place.position != "end":
            edges = _edges(assembly, place.part)
            distance = np.abs(edges - place.position)
            if distance.min() <= 1e-9 * edges[-1]:
                self._step = int(distance.argmin())

    def on(self, assembly: Assembly) -> Coordinate:
        """Return the coordinate on the assembly with other lengths."""
        if self._step is None:
            return self._place
        return replace(self._place, position=float(_edges(assembly, self._place.part)[self._step]))


def _edges(assembly: Assembly, name: str) -> NDArray[np.float64]:
    """Return where the segments of a part begin and end."""
    part = assembly.elements[name or next(iter(assembly.elements))]
    lengths = [segment.length for segment in part.segments] if isinstance(part, Part) else []
    return np.cumsum([0.0, *lengths])
