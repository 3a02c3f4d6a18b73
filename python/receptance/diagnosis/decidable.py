"""Causes that the measurements cannot show at their typical size, because the other unknowns would absorb them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from receptance.diagnosis.explanation import Selection
    from receptance.diagnosis.screening import Direction

__all__ = ["absorbed_causes"]


def absorbed_causes(selection: Selection) -> tuple[str, ...]:
    """Return the ids of causes whose typical size has too small an effect after a refit of all other unknowns.

    To first order, that is an increase of chi-square below the evidence that the best cause exceeds by chance. A cause
    with several variants is absorbed if all of them are.
    """
    largest: dict[str, float] = {}
    for one in selection.directions:
        gain = _typical_gain(one)
        if gain is not None:
            largest[one.cause.id] = max(largest.get(one.cause.id, 0.0), gain)
    return tuple(id for id, gain in largest.items() if gain < selection.threshold)


def _typical_gain(direction: Direction) -> float | None:
    """Return the increase of chi-square by the typical size; None where the effect is not linear in the parameters."""
    parameters = list(direction.parameters.values())
    if not parameters or direction.slopes.shape[1] != len(parameters):
        return None
    size = np.array([0.0 if one.secondary else one.typical - one.null for one in parameters])
    change = direction.slopes @ size
    return float(change @ change)
