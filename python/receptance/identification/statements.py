"""What an interval means, in words."""

from __future__ import annotations

import math
from typing import NamedTuple

__all__ = ["Tie", "state"]

_FACTOR = 1.5
"""An interval that reaches farther than this factor to a side is told as a factor, not in percent."""
_WIDE = 10.0
"""An interval over more than this factor determines little more than the order of magnitude."""


class Tie(NamedTuple):
    """Another parameter that goes along, and how far, in spreads that it has when nothing else moves."""

    name: str
    way: float


def state(
    value: float, lower: float, upper: float, level: float, *, name: str, scale: str, tie: Tie | None = None
) -> str:
    """Return what an interval says about a parameter; open sides are 0 or -inf, and inf.

    Examples
    --------
    >>> from receptance.identification.statements import Tie, state
    >>> state(1e5, 9.8e4, 1.02e5, 0.95, name="joint.k_theta", scale="log")
    'determined to 2 %'
    >>> state(1e9, 4e7, float("inf"), 0.95, name="joint.k_y", scale="log")
    'only a lower bound: 4e+07'
    >>> state(1e9, 0.0, float("inf"), 0.95, name="joint.k_y", scale="log", tie=Tie("joint.k_theta", 40.0))
    'tied to joint.k_theta: the data determine a combination of the two'
    """
    open_below = lower == 0.0 if scale == "log" else math.isinf(lower)
    open_above = math.isinf(upper)
    along = "" if tie is None else f", tied to {tie.name}"
    if open_below and open_above:
        if tie is not None:
            return f"tied to {tie.name}: the data determine a combination of the two"
        return "not determined: the data say nothing about it within the bounds"
    if open_above:
        return f"only a lower bound: {lower:.2g}{along}"
    if open_below:
        return f"only an upper bound: {upper:.2g}{along}"
    if scale == "log":
        return _as_share(value, lower, upper, along)
    half = 0.5 * (upper - lower)
    if lower <= 0.0 <= upper:
        return f"not told from zero: {lower:.2g} to {upper:.2g}{along}"
    return f"determined to {_percent(half / abs(value))}" + (along if half > 0.5 * abs(value) else "")


def _as_share(value: float, lower: float, upper: float, along: str) -> str:
    factor = max(value / lower, upper / value)
    if factor <= _FACTOR:
        return f"determined to {_percent(math.sqrt(upper / lower) - 1.0)}"
    if upper / lower <= _WIDE:
        return f"determined to a factor of {factor:.2g}{along}"
    return f"hardly determined: between {lower:.2g} and {upper:.2g}{along}"


def _percent(share: float) -> str:
    return f"{100.0 * share:.2g} %" if share < 0.995 else f"{100.0 * share:.0f} %"
