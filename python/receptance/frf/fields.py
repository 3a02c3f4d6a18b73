"""Fields of measurements: their declarations, and the checks of shapes, types and ranges that they name."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Generic, Literal, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from receptance import _checks
from receptance.model.coordinates import Coordinate, Side, measured_coordinates
from receptance.units import FORMS, Form

_MAX_AVERAGES = 10**9
_MAX_MAGNITUDE = 1e50
"""Largest magnitude of a value in SI units: beyond any structure, and its fourth power is still finite."""
_COHERENCE_ROUNDING = 1e-4
"""Excess of a coherence over 1 (or below 0) that is attributed to rounding by the analyser or its file."""

Accepted = TypeVar("Accepted", contravariant=True)
Stored = TypeVar("Stored", covariant=True)

Labels = tuple[tuple[str, ...], tuple[str, ...]]
"""Names of the responses and of the excitations."""


class MeasuredField(Generic[Accepted, Stored]):
    """Declaration of a field: what is accepted, the check that returns what is stored, and its axes.

    It is a descriptor for type checkers, which read both types from it. `Declared` replaces it by its default.

    Parameters
    ----------
    check : callable
        Of the measurement, the name of the field and the value; returns the value to store, an array of its own.
    kind : str
        Type of the argument, for the documentation.
    doc : str
        Meaning, unit and shape.
    axes : {"", "lines", "entries", "samples"}, optional
        Whether it is an array with a number for each line, for each line and entry, or for each sample and channel.
    default : optional
        Without it the field is required.
    """

    def __init__(
        self,
        check: Callable[[Any, str, Accepted], Stored],
        kind: str,
        doc: str,
        *,
        axes: Literal["", "lines", "entries", "samples"] = "",
        default: Any = ...,
    ) -> None:
        self.check, self.kind, self.doc, self.axes, self.default = check, kind, doc, axes, default

    def __get__(self, item: object | None, owner: type) -> Stored:
        raise TypeError(f"{owner.__name__} declares fields of a measurement, expected a subclass of Declared")

    def __set__(self, item: object, value: Accepted) -> None:
        raise TypeError(f"{type(item).__name__} declares fields of a measurement, expected a subclass of Declared")

    def documented(self, name: str) -> str:
        """Return the entry of the section "Parameters" of a docstring."""
        optional = "" if self.default is ... else ", optional"
        lines = textwrap.wrap(self.doc, 104, break_on_hyphens=False)
        return "\n".join([f"    {name} : {self.kind}{optional}", *(" " * 8 + line for line in lines)])


class LineError(ValueError):
    """An invalid number on a line, or in a sample, whose `index` tells a reader its place in a file."""

    def __init__(self, problem: str, index: int) -> None:
        super().__init__(problem, index)
        self.problem, self.index = problem, int(index)

    def __str__(self) -> str:
        return self.problem


class CoherenceError(LineError):
    """A coherence that is not one; without it the measurement may be valid."""


class Declared:
    """Base of dataclasses of declared fields, which are checked in their order at construction."""

    declared: ClassVar[dict[str, MeasuredField[Any, Any]]] = {}
    """Fields by name, in their order."""

    def __init_subclass__(cls) -> None:
        fields = {name: field for name, field in vars(cls).items() if isinstance(field, MeasuredField)}
        for name, field in fields.items():
            if field.default is ...:
                delattr(cls, name)
            else:
                setattr(cls, name, field.default)
        cls.declared = cls.declared | fields
        entries = "\n".join(field.documented(name) for name, field in cls.declared.items())
        cls.__doc__ = (cls.__doc__ or "").replace("    {fields}", entries)

    def __post_init__(self) -> None:
        for name, field in self.declared.items():
            store(self, name, field.check(self, name, getattr(self, name)))

    def __setstate__(self, state: dict[str, Any]) -> None:
        for name, value in state.items():
            store(self, name, value)


def store(item: object, name: str, value: Any) -> None:
    """Set a field of a measurement; an array becomes read-only."""
    if isinstance(value, np.ndarray):
        value = np.ascontiguousarray(value)
        value.setflags(write=False)
    object.__setattr__(item, name, value)


def text(item: Any, name: str, value: str | None) -> str:
    """Return a text."""
    return "" if value is None else str(value)


def texts(item: Any, name: str, value: Iterable[str]) -> tuple[str, ...]:
    """Return texts as a tuple; a single string, which would be split into letters, is refused."""
    if isinstance(value, str) or not isinstance(value, Iterable):
        raise TypeError(f"{item.owner}: {name} is {value!r}, expected a sequence of texts")
    several = tuple(value)
    for text in several:
        if not isinstance(text, str):
            raise TypeError(f"{item.owner}: {name} holds {text!r}, expected texts")
    return several


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Labelled(Declared):
    """Fields of every measurement."""

    label: MeasuredField[str, str] = MeasuredField(text, "str", "Free-text label.", default="")
    source: MeasuredField[str, str] = MeasuredField(text, "str", "File and reader, or origin.", default="")
    notes: MeasuredField[Sequence[str], tuple[str, ...]] = MeasuredField(
        texts, "sequence of str", "Notes for the user: changes to the data, doubts.", default=()
    )

    @property
    def owner(self) -> str:
        """Class and label, for messages; also while fields are checked."""
        return f"{type(self).__name__} {self.label!r}" if self.label else type(self).__name__


def lines(item: Any, name: str, value: ArrayLike) -> NDArray[np.float64]:
    """Return frequency lines `(n,)`: real, finite, ascending, none below 0 Hz."""
    owner = item.owner
    array = _checks.numbers(
        owner, name, value, "iuf", "real numbers in Hz (complex lines follow from decay_rate)"
    ).astype(np.float64)
    if array.ndim != 1:
        raise ValueError(f"{owner}: frequency_hz has shape {array.shape}, expected one dimension")
    if not array.size:
        raise ValueError(f"{owner}: frequency_hz is empty, expected at least one line")
    bad = np.flatnonzero(~(np.isfinite(array) & (array >= 0.0)))
    if bad.size:
        problem = f"{owner}: frequency_hz[{bad[0]}] is {array[bad[0]]:g} Hz, expected a finite number from 0 on"
        raise LineError(problem, bad[0])
    bad = np.flatnonzero(np.diff(array) <= 0.0)
    if bad.size:
        index = bad[0] + 1
        raise LineError(
            f"{owner}: frequency_hz is not ascending: [{index}] is {array[index]:.9g} Hz after {array[index - 1]:.9g} "
            "Hz; sort the lines and leave out repeated ones",
            index,
        )
    return array


def values(item: Any, name: str, value: ArrayLike) -> NDArray[np.complex128]:
    """Return values as complex `(n, n_responses, n_excitations)`; they may still be infinite or NaN."""
    owner, frequency_hz = item.owner, item.frequency_hz
    array = _checks.numbers(owner, name, value, "iufc", "complex numbers").astype(np.complex128, order="C")
    n = frequency_hz.size
    if array.shape == (n,):
        array = array.reshape(n, 1, 1)
    if array.ndim != 3 or array.shape[0] != n or 0 in array.shape:
        raise ValueError(
            f"{owner}: values has shape {array.shape} for {n} lines, expected ({n},) or ({n}, responses, excitations)"
        )
    size = np.maximum(np.abs(array.real), np.abs(array.imag))
    excessive = np.argwhere(np.isfinite(size) & (size > _MAX_MAGNITUDE))
    if excessive.size:
        index = tuple(excessive[0])
        raise LineError(
            f"{owner}: values at {frequency_hz[index[0]]:g} Hz is {array[index]:g}, expected at most "
            f"{_MAX_MAGNITUDE:g} in SI units",
            index[0],
        )
    return array


def form(item: Any, name: str, value: Form) -> Form:
    """Return the form of an FRF."""
    _checks.one_of(item.owner, name, value, FORMS)
    return value


def places(axis: int) -> Callable[[Any, str, Side], tuple[Coordinate, ...]]:
    """Return the check of the coordinates of an axis of the values."""
    return lambda item, name, side: measured_coordinates(item.owner, name, side, item.values.shape[axis])


def coherence(item: Any, array: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a coherence by line and entry, clipped to 0 to 1 with a note where it is outside by rounding; NaN is kept.

    A value below 0 or above 1 by more than rounding is a CoherenceError with the cause and the remedy.
    """
    wrong = (array < -_COHERENCE_ROUNDING) | (array > 1.0 + _COHERENCE_ROUNDING)
    if wrong.any():
        index = tuple(int(axis[0]) for axis in np.nonzero(wrong))
        others = int(wrong.any(axis=(1, 2)).sum()) - 1
        raise CoherenceError(
            f"{item.owner}: the coherence at {item.frequency_hz[index[0]]:g} Hz is {array[index]:.4g}"
            + (f" (and outside 0 to 1 on {others} more lines)" if others else "")
            + f", expected 0 to 1; its median is {np.nanmedian(array):.2f}. Coherence is the share of the "
            "response's power explained by the force. A value outside 0 to 1 means that the spectra do not "
            "belong together (different averages or windows for force and response, an overwritten record, or another "
            "quantity in this column), so the quality of this FRF is unknown. Measure or export it again, or use the "
            "FRF without its coherence",
            index[0],
        )
    clipped = np.clip(array, 0.0, 1.0)
    count = np.count_nonzero(clipped != array) - np.count_nonzero(np.isnan(array))
    if count:
        store(item, "notes", (*item.notes, f"coherence outside 0 to 1 by rounding on {count} lines: clipped"))
    return clipped


def per_entry(
    *, at_least: float = -np.inf, above: float = -np.inf
) -> Callable[[Any, str, ArrayLike | None], NDArray[np.float64] | None]:
    """Return the check of real numbers: one, or one per line or entry, within limits.

    Infinite values are allowed. NaN is checked by `without_undefined_zero_line`.
    """

    def check(item: Any, name: str, value: ArrayLike | None) -> NDArray[np.float64] | None:
        if value is None:
            return None
        owner, shape = item.owner, item.values.shape
        array = _checks.numbers(owner, name, value, "iuf", "real numbers").astype(np.float64)
        if array.shape not in ((), shape[:1], shape):
            raise ValueError(f"{owner}: {name} has shape {array.shape}, expected one number, {shape[:1]} or {shape}")
        if array.shape == shape[:1]:
            array = array[:, None, None]
        array = np.ascontiguousarray(np.broadcast_to(array, shape))
        wrong = (array < at_least) | (array <= above) if above > -np.inf else array < at_least
        if wrong.any():
            index = tuple(int(axis[0]) for axis in np.nonzero(wrong))
            limit = f"more than {above:g}" if above > -np.inf else f"at least {at_least:g}"
            raise LineError(f"{owner}: {name}{list(index)} is {array[index]:g}, expected {limit}", index[0])
        return array

    return check


def usable(item: Any, name: str, value: ArrayLike | None) -> NDArray[np.bool_] | None:
    """Return True or False for each line."""
    if value is None:
        return None
    array = _checks.unmasked(item.owner, name, value)
    if array.dtype.kind != "b" or array.shape != item.frequency_hz.shape:
        raise ValueError(
            f"{item.owner}: usable has dtype {array.dtype} and shape {array.shape}, "
            f"expected True or False on each of {item.frequency_hz.size} lines"
        )
    return array.copy()


def labels(item: Any, name: str, value: Sequence[Sequence[str]] | None) -> Labels | None:
    """Return the names of responses and excitations as a pair of tuples."""
    if value is None:
        return None
    owner, counts = item.owner, item.values.shape[1:]
    sides = list(value) if isinstance(value, Iterable) and not isinstance(value, str) else []
    if len(sides) != 2 or any(isinstance(side, str) or not isinstance(side, Iterable) for side in sides):
        raise TypeError(
            f"{owner}: labels is {value!r}, expected the names of the responses and those of the excitations"
        )
    pair = tuple(str(name) for name in sides[0]), tuple(str(name) for name in sides[1])
    if (len(pair[0]), len(pair[1])) != counts:
        raise ValueError(
            f"{owner}: labels names {len(pair[0])} responses and {len(pair[1])} excitations, "
            f"expected {counts[0]} and {counts[1]}"
        )
    return pair


def average_count(owner: str, value: Any) -> int:
    """Return the number of averages, or raise."""
    try:
        count = int(value.__index__())
    except AttributeError:
        raise TypeError(f"{owner}: averages is {value!r}, expected a whole number") from None
    if not 1 <= count <= _MAX_AVERAGES or isinstance(value, bool):
        raise ValueError(f"{owner}: averages is {value!r}, expected a whole number from 1 to {_MAX_AVERAGES}")
    return count


def without_undefined_zero_line(frf: Any, names: Iterable[str]) -> None:
    """Drop the line at 0 Hz of an FRF if one of the named arrays is not finite there; raise if it is not elsewhere.

    At 0 Hz the receptance of a free structure is infinite, and the coherence of AC-coupled sensors is 0 / 0.
    """
    owner, frequency_hz = frf.owner, frf.frequency_hz
    undefined = []
    for name in names:
        array = getattr(frf, name)
        if array is None:
            continue
        bad = ~np.isfinite(array) if name == "values" else np.isnan(array)
        rows = np.flatnonzero(bad.any(axis=(1, 2)))
        elsewhere = rows[frequency_hz[rows] > 0.0]
        if elsewhere.size:
            value = array[elsewhere[0]][bad[elsewhere[0]]][0]
            raise LineError(
                f"{owner}: {name} at {frequency_hz[elsewhere[0]]:g} Hz is {value}, expected a finite number; "
                "leave the line out",
                elsewhere[0],
            )
        undefined += [name] * bool(rows.size)
    if not undefined:
        return
    if frequency_hz.size == 1:
        raise ValueError(f"{owner}: the only line is at 0 Hz and not finite")
    for name, array in list(frf.__dict__.items()):
        if isinstance(array, np.ndarray):
            store(frf, name, array[1:])
    note = f"the line at 0 Hz is dropped: {' and '.join(undefined)} not finite there"
    store(frf, "notes", (*frf.notes, note))
