"""Checks of the fields of observations; messages name the observation."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from receptance import _checks
from receptance.model.assembly import Assembly

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import ArrayLike, NDArray

__all__ = ["ascending", "conditions_of", "decaying", "fill", "mode_numbers", "owner_of", "spread"]


def owner_of(kind: str, label: str, assembly: Any) -> str:
    """Return the name of an observation in messages; raise unless it has an assembly."""
    owner = f"{kind} {label!r}" if label else kind
    if not isinstance(assembly, Assembly):
        raise TypeError(f"{owner}: assembly is {assembly!r}, expected an Assembly")
    return owner


def fill(target: Any, **fields: Any) -> None:
    """Set the fields of a frozen dataclass; arrays are copied and read-only."""
    for name, value in fields.items():
        if isinstance(value, np.ndarray):
            value = value.copy()
            value.setflags(write=False)
        object.__setattr__(target, name, value)


def conditions_of(owner: str, conditions: Mapping[str, float] | None) -> dict[str, float]:
    """Return conditions as numbers by name."""
    return {str(name): _checks.number(owner, f"conditions[{name!r}]", v) for name, v in dict(conditions or {}).items()}


def ascending(owner: str, array: NDArray[Any]) -> NDArray[Any]:
    """Return ascending frequencies, or raise."""
    try:
        return _checks.frequencies(array)
    except (TypeError, ValueError) as error:
        raise type(error)(f"{owner}: {error}") from None


def decaying(owner: str, lines: NDArray[Any]) -> NDArray[Any]:
    """Return the lines of an exponential window: imaginary parts of zero or less; real without a window."""
    bad = np.flatnonzero(lines.imag > 0.0)
    if bad.size:
        raise ValueError(
            f"{owner}: frequency_hz[{bad[0]}] is {lines[bad[0]]:g} Hz, expected an imaginary part of zero or less: "
            "f - i sigma / (2 pi) for the window exp(-sigma t)"
        )
    return lines if lines.imag.any() else lines.real.astype(np.float64)


def spread(owner: str, quantity: str, value: ArrayLike, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Return positive numbers, one for each line; a single number stands for all."""
    array = _checks.numbers(owner, quantity, value, "iuf", "real numbers").astype(np.float64)
    if array.shape not in ((), shape):
        raise ValueError(f"{owner}: {quantity} has shape {array.shape}, expected one number or {shape}")
    array = np.broadcast_to(array, shape)
    bad = np.flatnonzero(~(np.isfinite(array) & (array > 0.0)))
    if bad.size:
        raise ValueError(f"{owner}: {quantity}[{bad[0]}] is {array[bad[0]]:g}, expected a finite number above zero")
    return array


def mode_numbers(owner: str, modes: Sequence[int]) -> tuple[int, ...]:
    """Return ascending mode numbers from 1 on."""
    array = _checks.unmasked(owner, "modes", modes)
    if array.ndim != 1 or array.dtype.kind not in "iu":
        raise TypeError(f"{owner}: modes is {modes!r}, expected a list of whole numbers")
    if array.size and (array[0] < 1 or np.any(np.diff(array) <= 0)):
        raise ValueError(f"{owner}: modes is {modes!r}, expected ascending numbers from 1 on")
    return tuple(int(number) for number in array)


def damping(
    owner: str, ratio: ArrayLike | None, deviation: ArrayLike | None, weighed: bool, shape: tuple[int, ...]
) -> tuple[NDArray[np.float64] | None, NDArray[np.float64] | None]:
    """Return damping ratios and their standard deviations; NaN is a missing ratio, at least one is needed."""
    if ratio is None:
        if deviation is not None:
            raise ValueError(f"{owner}: standard_deviation_damping is given without damping_ratio")
        return None, None
    values = np.atleast_1d(_checks.numbers(owner, "damping_ratio", ratio, "iuf", "real numbers")).astype(np.float64)
    if values.shape != shape:
        raise ValueError(f"{owner}: damping_ratio has shape {values.shape}, expected {shape}, one for each frequency")
    known = ~np.isnan(values)
    bad = np.flatnonzero(known & ~((values >= 0.0) & (values < 1.0)))
    if bad.size:
        raise ValueError(f"{owner}: damping_ratio[{bad[0]}] is {values[bad[0]]:g}, expected 0 or more and less than 1")
    if not known.any():
        raise ValueError(f"{owner}: damping_ratio has no number, expected at least one, or None")
    if (deviation is not None) != weighed:
        given, missing = "frequencies", "damping_ratio"
        if not weighed:
            given, missing = missing, given
        raise ValueError(
            f"{owner}: {given} has standard deviations and {missing} has none, so their weights are unknown; give "
            "both, or neither"
        )
    return values, None if deviation is None else spread(owner, "standard_deviation_damping", deviation, shape)
