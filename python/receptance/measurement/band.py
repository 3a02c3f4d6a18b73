"""The usable band: which lines of an estimated FRF say what they are said to say."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["BIAS_SHARE", "NEGLIGIBLE", "force_band", "summary"]

BIAS_SHARE = 0.25
"""Known error over standard deviation up to which a line is usable; the variance is enlarged by its square."""
NEGLIGIBLE = 1e-3
"""Relative error that is small enough in any case: no record is worth refusing for a tenth of a percent."""
_SMOOTH = 5
"""Lines over which the force's power is averaged, so that noise does not end the band."""


def force_band(power: NDArray[np.float64], drop_db: float) -> NDArray[np.bool_]:
    """Return the lines around the force spectrum's largest, up to the first on either side that is `drop_db` lower.

    Beyond the first minimum of a pulse's spectrum its side lobes come back, from hits of different length at different
    places; there the hits do not repeat, so the band is one piece.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance.measurement.band import force_band
    >>> force_band(np.array([1.0, 1.0, 0.9, 0.5, 1e-3, 1e-3, 0.1, 0.1]), 20.0)
    array([ True,  True,  True,  True, False, False, False, False])
    """
    width = min(_SMOOTH, power.size)
    ones = np.ones(width)
    level = np.convolve(power, ones, "same") / np.convolve(np.ones_like(power), ones, "same")
    # The average reaches over the edges of the band; a line must also be strong itself.
    weak = np.minimum(level, power) < level.max() * 10.0 ** (-drop_db / 10.0)
    top = int(np.argmax(level))
    below, above = np.flatnonzero(weak[:top]), np.flatnonzero(weak[top:])
    inside = np.zeros(power.size, dtype=bool)
    inside[int(below[-1]) + 1 if below.size else 0 : top + int(above[0]) if above.size else None] = True
    return inside


def summary(frequency_hz: NDArray[np.float64], refused: Mapping[str, NDArray[np.bool_]]) -> tuple[str, ...]:
    """Say which lines are usable and, reason by reason, which are not; each line is counted at its first reason."""
    usable = ~np.any(list(refused.values()), axis=0)
    if usable.any():
        low, high = frequency_hz[usable][[0, -1]]
        lines = [f"usable: {usable.sum()} of {usable.size} lines, from {low:g} to {high:g} Hz"]
    else:
        lines = ["no line is usable"]
    counted = np.zeros(usable.size, dtype=bool)
    for reason, lines_refused in refused.items():
        new = lines_refused & ~counted
        counted |= lines_refused
        if new.any():
            low, high = frequency_hz[new][[0, -1]]
            which = f"{new.sum()} lines between {low:g} and {high:g} Hz" if new.sum() > 1 else f"1 line at {low:g} Hz"
            lines.append(f"not usable: {which}, {reason}")
    return tuple(lines)
