"""How an FRF is copied with changes: what needs no second check is not checked again."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance.errors import ReceptanceWarning
from receptance.frf.creation import SAID_OF_DRIVE_POINTS, about_drive_points, checked

if TYPE_CHECKING:
    from typing import Self

    from numpy.typing import NDArray

    from receptance.coordinates import Coordinate
    from receptance.units import Form


__all__ = ["Record", "set_fields"]

_PER_LINE = ("values", "coherence", "log_variance", "degrees_of_freedom", "correlated_lines", "usable")
_OF_DRIVE_POINTS = {"frequency_hz", "values", "form", "responses", "excitations", "usable"}
_PER_ENTRY = ("values", "coherence", "log_variance", "degrees_of_freedom")


@dataclass(frozen=True, init=False, eq=False, repr=False)
class Record:
    """What `FRF` consists of, apart from what people call."""

    frequency_hz: NDArray[np.float64]
    values: NDArray[np.complex128]
    form: Form
    responses: tuple[Coordinate, ...]
    excitations: tuple[Coordinate, ...]
    decay_rate: float
    coherence: NDArray[np.float64] | None
    averages: int | None
    log_variance: NDArray[np.float64] | None
    degrees_of_freedom: NDArray[np.float64] | None
    correlated_lines: NDArray[np.float64]
    usable: NDArray[np.bool_] | None
    labels: tuple[tuple[str, ...], tuple[str, ...]] | None
    label: str
    source: str
    notes: tuple[str, ...]

    def _replaced(self, changes: dict[str, Any], stacklevel: int) -> Self:
        given = {field.name: getattr(self, field.name) for field in fields(self)} | changes
        physics = not changes.keys().isdisjoint(_OF_DRIVE_POINTS)
        if physics:
            given["notes"] = tuple(note for note in given["notes"] if not note.startswith(SAID_OF_DRIVE_POINTS))
        other = object.__new__(type(self))
        set_fields(other, checked(**given))
        if physics:
            other._look_at_drive_points(stacklevel)
        return other

    def _look_at_drive_points(self, stacklevel: int = 3) -> None:
        said = about_drive_points(self)
        for text in said:
            warnings.warn(f"{self!r}: {text}", ReceptanceWarning, stacklevel=stacklevel)
        set_fields(self, {"notes": (*self.notes, *said)})

    def _made(self, **changes: Any) -> Self:
        """Return a copy with some fields changed that need no check."""
        other = object.__new__(type(self))
        set_fields(other, {**{field.name: getattr(self, field.name) for field in fields(self)}, **changes})
        return other

    def _lines(self, chosen: NDArray[np.bool_] | slice) -> Self:
        kept = {name: getattr(self, name) for name in ("frequency_hz", *_PER_LINE)}
        return self._made(**{name: array[chosen] for name, array in kept.items() if array is not None})

    def _entries(self, rows: list[int], columns: list[int]) -> Self:
        kept = {name: getattr(self, name) for name in _PER_ENTRY}
        changes: dict[str, Any] = {
            name: array[:, rows][:, :, columns] for name, array in kept.items() if array is not None
        }
        if self.labels is not None:
            names = self.labels
            changes["labels"] = tuple(names[0][i] for i in rows), tuple(names[1][j] for j in columns)
        responses, excitations = [self.responses[i] for i in rows], [self.excitations[j] for j in columns]
        return self._made(responses=tuple(responses), excitations=tuple(excitations), **changes)

    def __setstate__(self, state: dict[str, Any]) -> None:
        set_fields(self, state)


def set_fields(target: Any, values: dict[str, Any]) -> None:
    """Fill a frozen dataclass; its arrays are its own, contiguous, and stay as they are."""
    for name, value in values.items():
        if isinstance(value, np.ndarray) and value.flags.writeable:
            value = np.array(value, order="C")
            value.setflags(write=False)
        object.__setattr__(target, name, value)
