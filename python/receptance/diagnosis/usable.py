"""Which of the measured lines a diagnosis can take: those whose logarithm scatters like a normal number."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from receptance.diagnosis.model import Model
from receptance.identification.observations import MeasuredFRF, altered
from receptance.identification.task import Observation, place_of

__all__ = ["NOISIEST", "usable"]

NOISIEST = 0.12
"""Standard deviation of the logarithm up to which a line counts: above it the logarithm is not normal, has long tails,
and heavily damped modes and other inventions fit them."""
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
    for index, one in enumerate(model.observations):
        if not isinstance(one, MeasuredFRF) or one.standard_deviation is None:
            kept.append(one)
            continue
        good = one.standard_deviation <= NOISIEST
        count = int(np.count_nonzero(good))
        total += good.size
        lost += good.size - count
        if count < min(_FEWEST, good.size):
            name = one.label or place_of(one, index).configuration or f"observation {index}"
            dropped.append(f"{name} ({count} of {good.size})")
            continue
        kept.append(one if good.all() else _with(one, good))
    if lost:
        notes.append(
            f"{lost} of {total} lines are left out: their standard deviation is above {NOISIEST:g} of the "
            "logarithm, which is then no longer normal (antiresonances, or a coherence that is too low)"
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


def _with(one: MeasuredFRF, good: np.ndarray) -> MeasuredFRF:
    spread, force = one.standard_deviation, one.force
    return altered(
        one,
        frequency_hz=one.frequency_hz[good],
        receptance=one.receptance[good],
        standard_deviation=None if spread is None else spread[good],
        force=None if force is None else force[good],
    )
