"""Lines of measured receptances: those that a diagnosis can use, and the most informative ones of these."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from receptance.diagnosis.model import Model
from receptance.diagnosis.thresholds import EXPLORING_LINES, FEWEST_LINES, NOISIEST_LINE, SHARED_LOSS
from receptance.fit.observation import Observation
from receptance.model.coordinates import Coordinate

_Key = tuple[str, Coordinate, Coordinate, bytes]
"""Configuration, response, excitation and lines of a receptance."""


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
    for name, observation, good in zip(model.configuration_of, model.observations, _usable(model), strict=True):
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


def _usable(model: Model) -> list[NDArray[np.bool_] | None]:
    """Return a mask of the usable lines of each observation, None where there are no lines.

    Records of one configuration keep the same lines where that costs few lines, so that they share one evaluation.
    """
    own: list[NDArray[np.bool_] | None] = []
    groups: dict[tuple[str, bytes], list[int]] = {}
    for index, observation in enumerate(model.observations):
        own.append(None)
        if observation.is_receptance and observation.standard_deviation is not None:
            own[index] = observation.standard_deviation <= NOISIEST_LINE
            key = (model.configuration_of[index], observation.frequency_hz.tobytes())
            groups.setdefault(key, []).append(index)
    result = list(own)
    for indices in groups.values():
        masks = [mask for i in indices if (mask := own[i]) is not None]
        common = np.logical_and.reduce(masks)
        if np.mean(~common) <= SHARED_LOSS:
            for i in indices:
                result[i] = common
    return result


def _informative_lines(model: Model, lines: int) -> list[NDArray[np.intp] | None]:
    """Return the most informative lines of each observation, dense where the logarithm changes fast; None for all.

    Records of one configuration on the same lines get the same selection, so that they share one evaluation.
    """
    paths: dict[_Key, NDArray[np.float64]] = {}
    keys: list[_Key | None] = []
    for index, observation in enumerate(model.observations):
        keys.append(None)
        if (
            observation.is_receptance
            and observation.frequency_hz.size > lines
            and observation.standard_deviation is not None
        ):
            path = np.abs(np.diff(np.log(observation.receptance))) / observation.standard_deviation[1:]
            path = np.minimum(path, 20.0 * np.median(path)) + np.mean(path)
            name = model.configuration_of[index]
            key = (name, observation.response, observation.excitation, observation.frequency_hz.tobytes())
            keys[index] = key
            paths[key] = paths.get(key, 0.0) + path
    chosen: dict[_Key | None, NDArray[np.intp] | None] = {None: None}
    for key, path in paths.items():
        total = np.concatenate([[0.0], np.cumsum(path)])
        ends = np.searchsorted(total, np.linspace(0.0, total[-1], lines)).clip(0, total.size - 1)
        chosen[key] = np.unique(ends)
    return [chosen[key] for key in keys]


def on_few_lines(model: Model, lines: int = EXPLORING_LINES) -> tuple[Observation, ...]:
    """Return the observations on the most informative lines of each receptance."""
    # Models that differ in their unknowns share them.
    while model.shorter is not None and model.shorter.observations is model.observations:
        model = model.shorter
    if lines not in model.on_few_lines:
        pairs = zip(model.observations, _informative_lines(model, lines), strict=True)
        model.on_few_lines[lines] = tuple(one.select(own) for one, own in pairs)
    return model.on_few_lines[lines]


def thin(model: Model, lines: int = EXPLORING_LINES) -> Model:
    """Return the model with the most informative lines of each receptance."""
    return replace(model, observations=on_few_lines(model, lines))
