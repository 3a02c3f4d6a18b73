"""What this library writes into the free ID lines of data set 58, because the format has no place for it.

ID line 4 names the coordinates, `receptance ["tool",0.0,"y"] ["tool",0.05,"y"]` (response, excitation), ID line 5 holds
the other values, `receptance {"averages":10,"decay_rate":20.0}`: averages, decay rate, sample rate, first frequency
line and increment with all their digits ("lines"), and whether the points are only numbered ("labels":0). Programs that
do not know them show them as text.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from receptance.coordinates import Coordinate
from receptance.frf import Unplaced

__all__ = ["Remembered", "coordinates_line", "remembered", "values_line"]

_MARK = "receptance "
WIDTH = 80


@dataclass(frozen=True)
class Remembered:
    """What the ID lines of a data set say."""

    coordinates: tuple[Coordinate, Coordinate] | None = None
    values: Mapping[str, Any] = field(default_factory=dict)


def coordinates_line(response: Coordinate, excitation: Coordinate) -> str | None:
    """Return ID line 4, or None where it is too long."""
    places = [
        json.dumps([c.part, None if isinstance(c, Unplaced) else c.position, c.direction], separators=(",", ":"))
        for c in (response, excitation)
    ]
    line = _MARK + " ".join(places)
    return line if len(line) <= WIDTH else None


def values_line(values: Mapping[str, Any]) -> str:
    """Return ID line 5, empty where there is nothing to say; the exact lines are left out where they are too long."""
    line = _MARK + json.dumps(dict(values), separators=(",", ":"), sort_keys=True) if values else ""
    return line if len(line) <= WIDTH else values_line({k: v for k, v in values.items() if k != "lines"})


def remembered(texts: Sequence[str]) -> Remembered:
    """Return what the five ID lines say; lines of others, or such that were changed, say nothing.

    Examples
    --------
    >>> from receptance.io.uff.header import remembered
    >>> remembered(["hit 3", "", "", "", 'receptance {"averages":10}']).values
    {'averages': 10}
    """
    places = _parsed(texts[3].replace("] [", "],["), "[{}]") if texts[3].startswith(_MARK) else None
    values = _parsed(texts[4], "{}") if texts[4].startswith(_MARK) else None
    coordinates = None
    if isinstance(places, list) and len(places) == 2 and all(_is_place(place) for place in places):
        coordinates = (_place(*places[0]), _place(*places[1]))
    return Remembered(coordinates, _checked(values) if isinstance(values, dict) else {})


def _parsed(line: str, form: str) -> Any:
    try:
        return json.loads(form.replace("{}", line.removeprefix(_MARK)))
    except (ValueError, RecursionError):
        return None


def _place(part: str, position: Any, direction: Any) -> Coordinate:
    return Unplaced(direction) if position is None else Coordinate(part, position, direction)


def _is_place(place: Any) -> bool:
    if not (isinstance(place, list) and len(place) == 3 and isinstance(place[0], str) and place[2] in ("y", "theta")):
        return False
    position = place[1]
    return position is None or position == "end" or (isinstance(position, float) and math.isfinite(position))


def _checked(values: dict[str, Any]) -> dict[str, Any]:
    good: dict[str, Any] = {}
    averages = values.get("averages")
    if isinstance(averages, int) and not isinstance(averages, bool) and averages > 0:
        good["averages"] = averages
    lines = values.get("lines")
    if isinstance(lines, list) and len(lines) == 2 and all(isinstance(x, float) and 0.0 <= x < math.inf for x in lines):
        good["lines"] = (lines[0], lines[1])
    if values.get("labels") == 0:
        good["labels"] = 0
    for name in ("decay_rate", "sample_rate_hz"):
        value = values.get(name)
        if isinstance(value, (int, float)) and not isinstance(value, bool) and 0.0 < value < math.inf:
            good[name] = float(value)
    return good
