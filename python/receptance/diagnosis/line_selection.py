"""Lines of measured receptances: those that a diagnosis can use, and the most informative ones of these."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from receptance.diagnosis.model import Model
from receptance.diagnosis.text import Reason
from receptance.fit.line_selection import FEWEST_LINES, usable_lines
from receptance.fit.observation import Observation


def select_lines(model: Model) -> tuple[Model, tuple[Reason, ...]]:
    """Return the model with the lines that a diagnosis can use, and the reasons why others are left out.

    Raises
    ------
    ValueError
        No measurement has enough such lines.
    """
    reasons: list[Reason] = []
    dropped: dict[str, int] = {}
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
            dropped[observation.label or name] = count
            continue
        kept.append(observation if good.all() else observation.select(good))
    if lost:
        reasons.append(Reason("lines_left_out", {"lost": lost, "total": total}))
    if dropped:
        reasons.append(Reason("records_left_out", {"records": dropped}))
        if not kept:
            raise ValueError(str(reasons[-1]))
    return (model.select(tuple(kept)) if dropped else replace(model, observations=tuple(kept))), tuple(reasons)
