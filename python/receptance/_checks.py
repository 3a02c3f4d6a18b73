"""Checks of numbers and arrays given by users; the messages name owner and quantity."""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Iterable
from typing import Any, TypeVar, cast, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from receptance.units import Quantity

_T = TypeVar("_T")


def number(owner: str, quantity: str, value: Any, *, unit: str = "") -> float:
    """Return `value` as a finite float; errors name the owner, the quantity and the value."""
    expected = f"a finite number{' of ' + unit if unit else ''}"
    if isinstance(value, (bool, np.bool_, str)) or value is None:
        raise TypeError(f"{owner}: {quantity} is {value!r}, expected {expected}")
    try:
        result = float(value)
    except (TypeError, ValueError):
        raise TypeError(f"{owner}: {quantity} is {value!r}, expected {expected}") from None
    except OverflowError:
        raise ValueError(f"{owner}: {quantity} is too large a number, expected {expected}") from None
    if not math.isfinite(result):
        raise ValueError(f"{owner}: {quantity} is {result}, expected {expected}")
    return result


def whole_number(owner: str, quantity: str, value: Any, *, least: int = 1) -> int:
    """Return `value` as an int of at least `least`, or raise."""
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < least:
        raise ValueError(f"{owner}: {quantity} is {value!r}, expected a whole number of at least {least}")
    return int(value)


def one_of(owner: str, quantity: str, value: Any, kinds: Any) -> None:
    """Raise if `value` is not one of the texts of a `Literal`, or of a collection."""
    known = get_args(kinds) or tuple(kinds)
    if value not in known:
        first = f"{owner}: " if owner else ""
        raise ValueError(f"{first}{quantity} is {value!r}, expected one of {', '.join(known)}")


def unmasked(owner: str, quantity: str, value: Any, dtype: Any = None) -> NDArray[Any]:
    """Return `np.asarray(value, dtype)`, or raise where values are masked or rows have different lengths."""
    parts = value if isinstance(value, (list, tuple)) else (value,)
    # NumPy loads this module at its first use, which takes a fiftieth of a second; before there are no masks.
    masked = getattr(sys.modules.get("numpy.ma"), "MaskedArray", ())
    count = sum(int(np.count_nonzero(part.mask)) for part in parts if isinstance(part, masked))
    first = f"{owner}: {quantity}" if owner else quantity
    if count:
        raise ValueError(
            f"{first} has {count} masked value{'s' if count > 1 else ''}, expected an array without a mask: leave the "
            "masked lines out of all arrays, as in frequency_hz[~mask], or fill in numbers and mark the usable lines "
            "of an FRF with usable=~mask"
        )
    try:
        array = np.asarray(value)
    except ValueError:
        raise ValueError(f"{first} has rows of different lengths, expected equal lengths") from None
    return array if dtype is None else array.astype(dtype, copy=False)


def numbers(owner: str, quantity: str, value: ArrayLike, kinds: str, expected: str) -> NDArray[Any]:
    """Return an array whose dtype is of one of the `kinds` (NumPy's dtype codes such as "iuf"), or raise."""
    array = unmasked(owner, quantity, value)
    if array.dtype.kind not in kinds:
        raise TypeError(f"{owner}: {quantity} has dtype {array.dtype}, expected {expected}")
    return array


def by_line(
    owner: str, quantity: str, value: ArrayLike, shape: tuple[int, ...], *, least: float = 0.0
) -> NDArray[np.float64]:
    """Return finite numbers of a shape; a single number stands for all.

    They are above zero, or at least `least` where this is given.
    """
    array = numbers(owner, quantity, value, "iuf", "real numbers").astype(np.float64)
    if array.shape not in ((), shape):
        raise ValueError(f"{owner}: {quantity} has shape {array.shape}, expected one number or {shape}")
    array = np.ascontiguousarray(np.broadcast_to(array, shape))
    bad = np.flatnonzero(~(np.isfinite(array) & ((array >= least) if least else (array > 0.0))))
    if bad.size:
        expected = f"a finite number {f'of at least {least:g}' if least else 'above zero'}"
        raise ValueError(f"{owner}: {quantity}[{bad[0]}] is {array[bad[0]]:g}, expected {expected}")
    return array


def items(name: str, given: _T | Iterable[_T], kind: type[_T], *, least: int = 1, text: str = "") -> tuple[_T, ...]:
    """Return one object or several as a tuple; raise if one is not of the kind, or if there are too few.

    `text` replaces the name of the kind in messages.
    """
    text = text or kind.__name__
    found = (given,) if isinstance(given, kind) else tuple(cast("Iterable[_T]", given))
    for index, one in enumerate(found):
        if not isinstance(one, kind):
            article = "an" if text[0] in "AEIOU" else "a"
            raise TypeError(f"{name}[{index}] is {one!r}, expected {article} {text}")
    if len(found) < least:
        raise ValueError(f"{name} is empty, expected at least one {text}")
    return found


def quantity(owner: str, name: str, value: Any, of: Quantity) -> float:
    """Return `value` as a finite float within the bounds of a quantity."""
    result = number(owner, name, value, unit=of.unit)
    if not of.holds(result):
        raise ValueError(f"{owner}: {name} is {result:g}, expected {of.bounds}{' ' + of.unit if of.unit else ''}")
    return result


def set_fields(instance: Any, values: dict[str, Any]) -> None:
    """Set the attributes of a frozen dataclass; arrays are stored as read-only C-contiguous copies."""
    for name, value in values.items():
        if isinstance(value, np.ndarray) and value.flags.writeable:
            value = np.array(value, order="C")
            value.setflags(write=False)
        object.__setattr__(instance, name, value)


def positive(owner: str, quantity: str, value: Any, *, unit: str = "") -> float:
    """Return `value` as a positive finite float."""
    result = number(owner, quantity, value, unit=unit)
    if result <= 0.0:
        raise ValueError(f"{owner}: {quantity} is {result:g}, expected more than zero{' ' + unit if unit else ''}")
    return result


def not_negative(owner: str, quantity: str, value: Any, *, unit: str = "") -> float:
    """Return `value` as a finite float of at least zero."""
    result = number(owner, quantity, value, unit=unit)
    if result < 0.0:
        raise ValueError(f"{owner}: {quantity} is {result:g}, expected zero or more{' ' + unit if unit else ''}")
    return result


def frequencies(frequency_hz: ArrayLike, owner: str = "") -> NDArray[np.float64] | NDArray[np.complex128]:
    """Return ascending, positive, finite frequency lines, real or complex, as a contiguous array `(n,)`.

    The result is contiguous and aligned, as required by the core, and may be the given array itself.
    """
    array, name = unmasked(owner, "frequency_hz", frequency_hz), f"{owner}: frequency_hz" if owner else "frequency_hz"
    if array.dtype.kind not in "iufc":
        raise TypeError(f"{name} has dtype {array.dtype}, expected real or complex numbers in Hz")
    if array.ndim > 1:
        raise ValueError(f"{name} has shape {array.shape}, expected one dimension")
    array = np.atleast_1d(array)
    array = array.astype(np.complex128 if array.dtype.kind == "c" else np.float64, copy=False)
    if array.size == 0:
        raise ValueError(f"{name} is empty, expected at least one line")
    if not (array.flags.c_contiguous and array.flags.aligned):
        array = array.copy()
    real = array.real
    # Ascending values between a positive first and a finite last one are finite and positive: one pass suffices.
    ascends = bool((real[1:] > real[:-1]).all())
    if not (ascends and real[0] > 0.0 and real[-1] < np.inf and (array is real or np.isfinite(array.imag).all())):
        raise _frequency_error(name, array)
    return array


def _frequency_error(name: str, array: NDArray[Any]) -> ValueError:
    """Return the error for invalid frequency lines."""
    real = array.real
    if (bad := np.flatnonzero(~np.isfinite(array))).size:
        return ValueError(f"{name}[{bad[0]}] is {array[bad[0]]}, expected a finite number of Hz")
    if (bad := np.flatnonzero(real <= 0.0)).size:
        return ValueError(
            f"{name}[{bad[0]}] is {array[bad[0]]:g} Hz, expected more than zero "
            "(a free structure has no receptance at 0 Hz; omit that line)"
        )
    bad = np.flatnonzero(real[1:] <= real[:-1])
    first, second = real[bad[0]], real[bad[0] + 1]
    return ValueError(
        f"{name} is not ascending: line {bad[0] + 1} is {second:g} Hz after {first:g} Hz; "
        "sort the lines and omit repeated ones"
    )


def thread_count(threads: int | None) -> int:
    """Return the number of threads: given, or from RECEPTANCE_THREADS, or 0 for all allowed processors."""
    source = "threads"
    value: Any = threads
    if value is None:
        source, value = "the environment variable RECEPTANCE_THREADS", os.environ.get("RECEPTANCE_THREADS", "0")
    try:
        count = int(value)
    except (TypeError, ValueError):
        count = -1
    if count < 0 or isinstance(value, (bool, float)):
        raise ValueError(
            f"{source} is {value!r}, expected a whole number (0: all processors that this process may use)"
        )
    return count


def worker_count(threads: int | None) -> int:
    """Return the number of threads of a pool in Python: `thread_count`, with 0 replaced by the allowed processors."""
    allowed = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return thread_count(threads) or allowed
