"""Where motion was seen and where loads acted: coordinates, known or not, and how to pick some of them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from receptance.coordinates import Coordinate

if TYPE_CHECKING:
    from receptance.frf.frf import FRF

    Side = Coordinate | str | Sequence[Coordinate | str] | None
    Pick = Coordinate | str | int | Sequence[Coordinate | str | int] | None

__all__ = ["Unplaced", "describe", "picked", "places"]


@dataclass(frozen=True, init=False, repr=False)
class Unplaced(Coordinate):
    """A coordinate whose direction is known and whose place is not: what a file without positions can say.

    It equals no other coordinate that has a place. Where a place is needed it stands at the tip of the first part.

    Parameters
    ----------
    direction : {"y", "theta"}, optional
        Transverse displacement and force, or slope and moment.

    Examples
    --------
    >>> from receptance.frf import Unplaced
    >>> Unplaced("theta")
    Unplaced('theta')
    """

    def __init__(self, direction: str = "y") -> None:
        super().__init__(direction=direction)  # type: ignore[arg-type]

    def __repr__(self) -> str:
        return f"Unplaced({self.direction!r})"


def places(owner: str, quantity: str, side: Side, count: int) -> tuple[Coordinate, ...]:
    """Return one side's coordinates, of an unknown place where none is given or only a direction."""
    if side is None:
        return (Unplaced(),) * count
    given = tuple(side) if isinstance(side, Iterable) and not isinstance(side, str) else (side,)
    if len(given) != count:
        raise ValueError(f"{owner}: there are {len(given)} {quantity} for values with {count}, expected as many")
    return tuple(_place(owner, f"{quantity}[{index}]", one) for index, one in enumerate(given))


def _place(owner: str, quantity: str, one: Any) -> Coordinate:
    if isinstance(one, Coordinate):
        return one
    if one in ("y", "theta"):
        return Unplaced(one)
    raise TypeError(
        f"{owner}: {quantity} is {one!r}, expected a Coordinate, or 'y' or 'theta' where only the direction is known"
    )


def picked(frf: FRF, responses: Pick, excitations: Pick) -> tuple[list[int], list[int]]:
    """Return which responses and excitations of an FRF are wanted; see `FRF.select`."""
    names = frf.labels or (None, None)
    return (
        _pick(repr(frf), "responses", responses, frf.responses, names[0]),
        _pick(repr(frf), "excitations", excitations, frf.excitations, names[1]),
    )


def _pick(
    owner: str, quantity: str, wanted: Pick, side: tuple[Coordinate, ...], labels: tuple[str, ...] | None
) -> list[int]:
    """Return which of a side's coordinates are wanted: by number, by coordinate, or by label in the file."""
    if wanted is None:
        return list(range(len(side)))
    many = list(wanted) if isinstance(wanted, Iterable) and not isinstance(wanted, str) else [wanted]
    if not many:
        raise ValueError(f"{owner}: {quantity} is empty, expected at least one")
    return [_index(owner, quantity, one, side, labels) for one in many]


def _index(owner: str, quantity: str, one: Any, side: tuple[Coordinate, ...], labels: tuple[str, ...] | None) -> int:
    if isinstance(one, Coordinate):
        found = [index for index, place in enumerate(side) if place == one]
    elif isinstance(one, str):
        found = [index for index, label in enumerate(labels or ()) if label == one]
    else:
        try:
            index = one.__index__()
        except AttributeError:
            raise TypeError(f"{owner}: {quantity} holds {one!r}, expected a number, Coordinate or label") from None
        found = [index % len(side)] if -len(side) <= index < len(side) else []
    if len(found) == 1:
        return found[0]
    known = "; ".join(
        f"{index}: {describe(place)}" + (f" ({labels[index]})" if labels and labels[index] else "")
        for index, place in enumerate(side)
    )
    what = "several" if found else "none"
    raise ValueError(f"{owner}: {what} of the {quantity} is {one!r}; they are {known}")


def describe(place: Coordinate) -> str:
    """Return a coordinate in a few words.

    Examples
    --------
    >>> from receptance import Coordinate
    >>> from receptance.frf.places import describe
    >>> describe(Coordinate("holder", 0.05, "theta"))
    "theta at 'holder' 0.05 m"
    """
    if isinstance(place, Unplaced):
        return f"{place.direction} somewhere"
    part = f"{place.part!r} " if place.part else ""
    position = "end" if place.position == "end" else f"{place.position:g} m"
    return f"{place.direction} at {part}{position}"
