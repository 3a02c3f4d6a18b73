"""Lines of measured receptances: those that can be judged, the most informative ones, and those of antiresonances."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from receptance.fit.observation import Observation
from receptance.model.coordinates import Coordinate

NOISIEST_LINE = 0.12
"""Largest standard deviation of the logarithm of a line that can be judged. Above it the logarithm is not normal: it
has long tails, which heavily damped modes and other wrong changes can fit."""
FEWEST_LINES = 16
"""Smallest number of lines of a receptance that can be judged."""
_SHARED_LOSS = 0.1
"""Largest share of its lines that a record may lose so that all records of its configuration use the same lines."""
_DISCREPANCY_LINES = 300
"""Lines of each receptance of fits that allow for a discrepancy."""
_DIP_WIDTH = 0.08
_DIP_RATIO = 2.0
"""A line is in an antiresonance if receptances within this relative distance on both sides are larger by this ratio."""

_Key = tuple[str, Coordinate, Coordinate, bytes]
"""Configuration, response, excitation and lines of a receptance."""


def usable_lines(observations: Sequence[Observation], configurations: Sequence[str]) -> list[NDArray[np.bool_] | None]:
    """Return a mask of the lines of each observation that can be judged, None where there are no lines.

    Records of one configuration keep the same lines where that costs few lines, so that they share one evaluation.
    """
    own: list[NDArray[np.bool_] | None] = []
    groups: dict[tuple[str, bytes], list[int]] = {}
    for index, observation in enumerate(observations):
        own.append(None)
        if observation.is_receptance and observation.standard_deviation is not None:
            own[index] = observation.standard_deviation <= NOISIEST_LINE
            key = (configurations[index], observation.frequency_hz.tobytes())
            groups.setdefault(key, []).append(index)
    result = list(own)
    for indices in groups.values():
        masks = [mask for i in indices if (mask := own[i]) is not None]
        common = np.logical_and.reduce(masks)
        if np.mean(~common) <= _SHARED_LOSS:
            for i in indices:
                result[i] = common
    return result


def informative_lines(
    observations: Sequence[Observation], configurations: Sequence[str], lines: int
) -> list[NDArray[np.intp] | None]:
    """Return the most informative lines of each observation, dense where the logarithm changes fast; None for all.

    Records of one configuration on the same lines get the same selection, so that they share one evaluation.
    """
    paths: dict[_Key, NDArray[np.float64]] = {}
    keys: list[_Key | None] = []
    for index, observation in enumerate(observations):
        keys.append(None)
        if (
            observation.is_receptance
            and observation.frequency_hz.size > lines
            and observation.standard_deviation is not None
        ):
            path = np.abs(np.diff(np.log(observation.receptance))) / observation.standard_deviation[1:]
            path = np.minimum(path, 20.0 * np.median(path)) + np.mean(path)
            name = configurations[index]
            key = (name, observation.response, observation.excitation, observation.frequency_hz.tobytes())
            keys[index] = key
            paths[key] = paths.get(key, 0.0) + path
    chosen: dict[_Key | None, NDArray[np.intp] | None] = {None: None}
    for key, path in paths.items():
        total = np.concatenate([[0.0], np.cumsum(path)])
        ends = np.searchsorted(total, np.linspace(0.0, total[-1], lines)).clip(0, total.size - 1)
        chosen[key] = np.unique(ends)
    return [chosen[key] for key in keys]


def resonant_lines(observations: Sequence[Observation], configurations: Sequence[str]) -> tuple[Observation, ...]:
    """Return observations on few lines of each receptance, without those of antiresonances."""
    kept = [
        observation.select(~in_antiresonance(observation.frequency_hz.real, np.abs(observation.receptance)))
        if observation.is_receptance
        else observation
        for observation in observations
    ]
    chosen = informative_lines(kept, configurations, _DISCREPANCY_LINES)
    return tuple(observation.select(lines) for observation, lines in zip(kept, chosen, strict=True))


def in_antiresonance(lines: NDArray[np.float64], size: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return whether lines in Hz have much larger receptances on both sides nearby, from their magnitudes."""
    low, high = (np.searchsorted(lines, lines * (1.0 + width)) for width in (-_DIP_WIDTH, _DIP_WIDTH))
    deep = [
        min(size[i : k + 1].max(), size[k:j].max()) > _DIP_RATIO * own
        for k, (i, j, own) in enumerate(zip(low, high, size, strict=True))
    ]
    return np.array(deep, dtype=np.bool_)
