"""Arrays of an FRF: shapes, types and ranges, answered in words."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance import _checks

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = [
    "coherences",
    "count",
    "lines",
    "mask",
    "per_entry",
    "per_line",
    "response_values",
    "text_pair",
    "texts",
    "without_bad_zero_line",
]

_MOST = 10**9
"""Averages; more is a number from somewhere else."""
_LARGEST = 1e50
"""Of a value: far beyond any structure, and its fourth power is still a number."""
_ROUNDING = 1e-4
"""A coherence above one by less is rounding of the analyser or of its file."""


def lines(owner: str, frequency_hz: ArrayLike) -> NDArray[np.float64]:
    """Return frequency lines `(n,)`: real, finite, ascending, none below 0 Hz."""
    array = _checks.numbers(
        owner, "frequency_hz", frequency_hz, "iuf", "real numbers in Hz (complex lines follow from decay_rate)"
    ).astype(np.float64)
    if array.ndim != 1:
        raise ValueError(f"{owner}: frequency_hz has shape {array.shape}, expected one dimension")
    if not array.size:
        raise ValueError(f"{owner}: frequency_hz is empty, expected at least one line")
    bad = np.flatnonzero(~(np.isfinite(array) & (array >= 0.0)))
    if bad.size:
        raise ValueError(f"{owner}: frequency_hz[{bad[0]}] is {array[bad[0]]:g} Hz, expected a finite number from 0 on")
    bad = np.flatnonzero(np.diff(array) <= 0.0)
    if bad.size:
        raise ValueError(
            f"{owner}: frequency_hz is not ascending: line {bad[0] + 1} is {array[bad[0] + 1]:g} Hz after "
            f"{array[bad[0]]:g} Hz; sort the lines and leave out repeated ones"
        )
    return array


def response_values(owner: str, values: ArrayLike, frequency_hz: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Return values as `(n, n_out, n_in)` complex; they may still be not finite."""
    array = _checks.numbers(owner, "values", values, "iufc", "complex numbers").astype(np.complex128)
    n = frequency_hz.size
    if array.shape == (n,):
        array = array.reshape(n, 1, 1)
    if array.ndim != 3 or array.shape[0] != n or 0 in array.shape:
        raise ValueError(
            f"{owner}: values has shape {array.shape} for {n} lines, expected ({n},) or ({n}, responses, excitations)"
        )
    size = np.maximum(np.abs(array.real), np.abs(array.imag))
    wild = np.argwhere(np.isfinite(size) & (size > _LARGEST))
    if wild.size:
        place = tuple(wild[0])
        raise ValueError(
            f"{owner}: values at {frequency_hz[place[0]]:g} Hz is {array[place]:g}, which no structure has in SI units"
        )
    return np.ascontiguousarray(array)


def per_entry(
    owner: str, quantity: str, value: ArrayLike | None, shape: tuple[int, ...], *, at_least: float, above: bool = False
) -> NDArray[np.float64] | None:
    """Return real numbers as `(n, n_out, n_in)`; one number or one a line count for all entries. Infinite is allowed.

    NaN in the first line is left for the caller, who knows whether that line is at 0 Hz.
    """
    if value is None:
        return None
    array = _checks.numbers(owner, quantity, value, "iuf", "real numbers").astype(np.float64)
    if array.shape not in ((), shape[:1], shape):
        raise ValueError(f"{owner}: {quantity} has shape {array.shape}, expected one number, {shape[:1]} or {shape}")
    if array.shape == shape[:1]:
        array = array[:, None, None]
    array = np.ascontiguousarray(np.broadcast_to(array, shape))
    wrong = (array < at_least) | ((array == at_least) & above)
    if wrong.any():
        place = tuple(int(index[0]) for index in np.nonzero(wrong))
        limit = f"{'more than' if above else 'at least'} {at_least:g}"
        raise ValueError(f"{owner}: {quantity}{list(place)} is {array[place]:g}, expected {limit}")
    return array


def per_line(owner: str, quantity: str, value: ArrayLike, n: int, *, at_least: float) -> NDArray[np.float64]:
    """Return finite real numbers `(n,)`, one number for all lines or one each."""
    array = _checks.numbers(owner, quantity, value, "iuf", "real numbers").astype(np.float64)
    if array.shape not in ((), (n,)):
        raise ValueError(f"{owner}: {quantity} has shape {array.shape}, expected one number or ({n},)")
    array = np.ascontiguousarray(np.broadcast_to(array, (n,)))
    bad = np.flatnonzero(~(np.isfinite(array) & (array >= at_least)))
    if bad.size:
        raise ValueError(
            f"{owner}: {quantity}[{bad[0]}] is {array[bad[0]]:g}, expected a finite number of at least {at_least:g}"
        )
    return array


def coherences(
    owner: str, value: ArrayLike | None, frequency_hz: NDArray[np.float64], shape: tuple[int, ...]
) -> tuple[NDArray[np.float64] | None, str]:
    """Return coherences `(n, n_out, n_in)` from 0 to 1, and a note where rounding was clipped."""
    array = per_entry(owner, "coherence", value, shape, at_least=-np.inf)
    if array is None:
        return None, ""
    below = np.argwhere(array < -_ROUNDING)
    if below.size:
        place = tuple(below[0])
        raise ValueError(
            f"{owner}: the coherence at {frequency_hz[place[0]]:g} Hz is {array[place]:.4g}, expected from 0 to 1"
        )
    above = array > 1.0 + _ROUNDING
    if above.any():
        place = tuple(int(index[0]) for index in np.nonzero(above))
        raise ValueError(
            f"{owner}: the coherence at {frequency_hz[place[0]]:g} Hz is {array[place]:.4g}"
            + (f" (and above 1 on {np.count_nonzero(above) - 1} more lines)" if np.count_nonzero(above) > 1 else "")
            + ". Coherence is the share of the response's power that the force explains, so it cannot be more than 1: "
            "the spectra it was formed from do not belong together (other averages or windows for force and "
            "response, too few averages of an overlapped record, or another quantity in this column), and nothing can "
            "be said of the quality of this FRF. Measure or export it again; to use the FRF without any statement of "
            "its quality, leave the coherence out."
        )
    clipped = np.clip(array, 0.0, 1.0)
    count = np.count_nonzero(clipped != array) - np.count_nonzero(np.isnan(array))
    return clipped, f"coherence outside 0 to 1 by rounding on {count} lines: clipped" if count else ""


def mask(owner: str, value: ArrayLike | None, n: int) -> NDArray[np.bool_] | None:
    """Return which lines are usable, `(n,)`."""
    if value is None:
        return None
    array = _checks.unmasked(owner, "usable", value)
    if array.dtype.kind != "b" or array.shape != (n,):
        raise ValueError(
            f"{owner}: usable has dtype {array.dtype} and shape {array.shape}, "
            f"expected True or False on each of {n} lines"
        )
    return array


def texts(owner: str, quantity: str, value: Iterable[str]) -> tuple[str, ...]:
    """Return several texts; one alone would be taken letter by letter."""
    if isinstance(value, str) or not isinstance(value, Iterable):
        raise TypeError(f"{owner}: {quantity} is {value!r}, expected a sequence of texts")
    return tuple(str(one) for one in value)


def text_pair(
    owner: str, value: Sequence[Sequence[str]] | None, counts: tuple[int, int]
) -> tuple[tuple[str, ...], tuple[str, ...]] | None:
    """Return the names of responses and excitations."""
    if value is None:
        return None
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


def count(owner: str, quantity: str, value: Any) -> int | None:
    """Return a whole number of at least one, or None."""
    if value is None:
        return None
    try:
        whole = int(value.__index__())
    except AttributeError:
        raise TypeError(f"{owner}: {quantity} is {value!r}, expected a whole number") from None
    if not 1 <= whole <= _MOST or isinstance(value, bool):
        raise ValueError(f"{owner}: {quantity} is {value!r}, expected a whole number from 1 to {_MOST}")
    return whole


def without_bad_zero_line(owner: str, found: dict[str, Any]) -> dict[str, Any]:
    """Return the fields, without the line at 0 Hz where it is not finite; raise where another line is not.

    Receptance is infinite there, and the coherence of sensors that pass no direct current is 0 / 0.
    """
    frequency_hz = found["frequency_hz"]
    names = [name for name, array in found.items() if isinstance(array, np.ndarray)]
    bad = {"values": ~np.isfinite(found["values"])}
    for name in ("coherence", "log_variance", "degrees_of_freedom"):
        if found[name] is not None:
            bad[name] = np.isnan(found[name])
    rows = {name: np.flatnonzero(wrong.reshape(frequency_hz.size, -1).any(axis=1)) for name, wrong in bad.items()}
    for name, index in rows.items():
        elsewhere = index[frequency_hz[index] > 0.0]
        if elsewhere.size:
            wrong = found[name][elsewhere[0]].ravel()
            value = wrong[bad[name][elsewhere[0]].ravel()][0]
            raise ValueError(
                f"{owner}: {name} at {frequency_hz[elsewhere[0]]:g} Hz is {value}, expected a finite number; "
                "leave the line out"
            )
    if not any(index.size for index in rows.values()):
        return found
    if frequency_hz.size == 1:
        raise ValueError(f"{owner}: the only line is at 0 Hz and not finite")
    what = " and ".join(name for name, index in rows.items() if index.size)
    changed: dict[str, Any] = {**found, **{name: found[name][1:] for name in names}}
    changed["notes"] = (*found["notes"], f"the line at 0 Hz is dropped: {what} not finite there")
    return changed
