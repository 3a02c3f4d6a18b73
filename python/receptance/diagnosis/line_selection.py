"""Lines of measured receptances: those that a diagnosis can use, and the most informative ones of these."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from receptance.diagnosis.model import Model
from receptance.diagnosis.thresholds import EXPLORING_LINES
from receptance.fit.line_selection import FEWEST_LINES, NOISIEST_LINE, informative_lines, usable_lines
from receptance.fit.observation import Observation


def select_lines(model: Model) -> tuple[Model, tuple[str, ...]]:
    """Return the model with the lines that a diagnosis can use, and notes on the others.

    Raises
    ------
    ValueError
        No measurement has enough such lines.
    """
    notes: list[str] = []
    dropped: list[str] = []
    kept: list[Observation] = []
    lost = total = 0
    usable = usable_lines(model.observations, model.configuration_of)
    for name, observation, good in zip(model.configuration_of, model.observations, usable, strict=True):
        if not observation.is_receptance or good is None:
            kept.append(observation)
            continue
        count = int(np.count_nonzero(good))
        total += good.size
        lost += good.size - count
        if count < min(FEWEST_LINES, good.size):
            dropped.append(f"{observation.label or name} ({count} of {good.size})")
            continue
        kept.append(observation if good.all() else observation.select(good))
    if lost:
        notes.append(
            f"{lost} of {total} lines are not used: the standard deviation of their logarithm, or of the same line in "
            f"another record of the configuration, is above {NOISIEST_LINE:g}, where the logarithm is not normal "
            "(antiresonances, or a low coherence)"
        )
    if dropped:
        missing = (
            f"too few lines with a standard deviation up to {NOISIEST_LINE:g}: {', '.join(dropped)}; the coherence is "
            "too low there: hit harder, or average more hits"
        )
        if not kept:
            raise ValueError(missing)
        notes.append(f"not used: {missing}")
    return (model.select(tuple(kept)) if dropped else replace(model, observations=tuple(kept))), tuple(notes)


def on_few_lines(model: Model, lines: int = EXPLORING_LINES) -> tuple[Observation, ...]:
    """Return the observations on the most informative lines of each receptance."""
    # Models that differ in their unknowns share them.
    while model.shorter is not None and model.shorter.observations is model.observations:
        model = model.shorter
    if lines not in model.on_few_lines:
        chosen = informative_lines(model.observations, model.configuration_of, lines)
        pairs = zip(model.observations, chosen, strict=True)
        model.on_few_lines[lines] = tuple(one.select(own) for one, own in pairs)
    return model.on_few_lines[lines]


def thin(model: Model, lines: int = EXPLORING_LINES) -> Model:
    """Return the model with the most informative lines of each receptance."""
    return replace(model, observations=on_few_lines(model, lines))
