"""Sums of FRFs and products with numbers, with their variance."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from receptance.frf.frf import FRF

__all__ = ["is_number", "multiplied", "sum_fields"]


def is_number(value: Any) -> bool:
    """Return whether a value is one finite real or complex number."""
    if isinstance(value, (bool, np.bool_, str)) or not np.isscalar(value):
        return False
    return bool(np.isfinite(np.asarray(value)).all())


def multiplied(frf: FRF, factor: complex) -> dict[str, Any]:
    """Return the fields of an FRF times a number; the relative variance is the same."""
    if factor == 0:
        raise ValueError(f"{frf!r} times zero has no logarithm, expected a factor other than zero")
    return {"values": frf.values * factor}


def sum_fields(one: FRF, other: FRF, sign: float) -> dict[str, Any]:
    """Return the changed fields of the sum or the difference of two FRFs with independent errors.

    The degrees of freedom of the variance follow from those of both (Welch and Satterthwaite).

    Raises
    ------
    ValueError
        Other lines, another window, or other quantities.
    """
    other = other.to(one.form)
    for name, same in (
        ("lines", np.array_equal(one.frequency_hz, other.frequency_hz)),
        ("decay rates", one.decay_rate == other.decay_rate),
        ("units", one.units == other.units),
    ):
        if not same:
            remedy = "; resample one of them" if name == "lines" else ""
            raise ValueError(f"{one!r} and {other!r} have different {name}, expected the same{remedy}")
    values = one.values + sign * other.values
    changes: dict[str, Any] = {
        "values": values,
        "coherence": None,
        "averages": None,
        "log_variance": None,
        "degrees_of_freedom": None,
        "correlated_lines": np.maximum(one.correlated_lines, other.correlated_lines),
        "usable": _both(one.usable, other.usable),
        "notes": tuple(dict.fromkeys((*one.notes, *other.notes))),
    }
    if one.log_variance is None or other.log_variance is None:
        return changes
    parts = [np.abs(frf.values) ** 2 * frf.log_variance for frf in (one, other) if frf.log_variance is not None]
    total = parts[0] + parts[1]
    with np.errstate(divide="ignore", invalid="ignore"):
        changes["log_variance"] = np.where(values == 0.0, np.inf, total / np.abs(values) ** 2)
        weights = [
            part**2 / (np.inf if frf.degrees_of_freedom is None else frf.degrees_of_freedom)
            for part, frf in zip(parts, (one, other), strict=True)
        ]
        freedom = np.where(weights[0] + weights[1] > 0.0, total**2 / (weights[0] + weights[1]), np.inf)
    if one.degrees_of_freedom is not None or other.degrees_of_freedom is not None:
        changes["degrees_of_freedom"] = freedom
    return changes


def _both(one: NDArray[np.bool_] | None, other: NDArray[np.bool_] | None) -> NDArray[np.bool_] | None:
    if one is None or other is None:
        return other if one is None else one
    return one & other
