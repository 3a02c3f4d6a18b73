"""Which of the measured lines a diagnosis can take: those whose logarithm scatters like a normal number."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from receptance.diagnosis.model import Model
from receptance.identification.observations import MeasuredFRF, on_lines
from receptance.identification.task import Observation, place_of

__all__ = ["NOISIEST", "usable"]

NOISIEST = 0.12
"""Standard deviation of the logarithm up to which a line counts: above it the logarithm is not normal, has long tails,
and heavily damped modes and other inventions fit them."""
_SHARED = 0.1
"""Share of its lines that a record may lose so that all records of its configuration keep the same ones."""
_FEWEST = 16
"""A receptance with fewer lines left says nothing."""


def usable(model: Model) -> tuple[Model, tuple[str, ...]]:
    """Return the model with the lines that a diagnosis can take, and what is to be said of the others.

    Raises
    ------
    ValueError
        No measurement has enough such lines.
    """
    notes: list[str] = []
    dropped: list[str] = []
    kept: list[Observation] = []
    lost = total = 0
    for index, (one, good) in enumerate(zip(model.observations, _good(model), strict=True)):
        if not isinstance(one, MeasuredFRF) or good is None:
            kept.append(one)
            continue
        count = int(np.count_nonzero(good))
        total += good.size
        lost += good.size - count
        if count < min(_FEWEST, good.size):
            name = one.label or place_of(one, index).configuration or f"observation {index}"
            dropped.append(f"{name} ({count} of {good.size})")
            continue
        kept.append(one if good.all() else on_lines(one, good))
    if lost:
        notes.append(
            f"{lost} of {total} lines are left out: the standard deviation of their logarithm, or of the same line in "
            f"another record of the configuration, is above {NOISIEST:g}, and it is then no longer normal "
            "(antiresonances, or a coherence that is too low)"
        )
    if dropped:
        missing = (
            f"too few lines with a standard deviation up to {NOISIEST:g}: {', '.join(dropped)}; the coherence is too "
            "low there: hit harder, or average more hits"
        )
        if not kept:
            raise ValueError(missing)
        notes.append(f"left out, {missing}")
    return (model.of(tuple(kept)) if dropped else replace(model, observations=tuple(kept))), tuple(notes)


def _good(model: Model) -> list[NDArray[np.bool_] | None]:
    """Return the lines of each observation that count, None where there are no lines.

    Records of one configuration keep the same ones where that costs little: one evaluation then serves all of them.
    """
    own: list[NDArray[np.bool_] | None] = []
    groups: dict[Any, list[int]] = {}
    for index, one in enumerate(model.observations):
        own.append(None)
        if isinstance(one, MeasuredFRF) and one.standard_deviation is not None:
            own[index] = one.standard_deviation <= NOISIEST
            key = (place_of(one, index).configuration, one.frequency_hz.tobytes())
            groups.setdefault(key, []).append(index)
    result = list(own)
    for indices in groups.values():
        masks = [mask for i in indices if (mask := own[i]) is not None]
        common = np.logical_and.reduce(masks)
        if np.mean(~common) <= _SHARED:
            for i in indices:
                result[i] = common
    return result
