"""Whether a fit leaves no more than noise and floor explain, and where it does not."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from receptance.diagnosis.fitting import Fit
from receptance.identification.floor import Floor
from receptance.identification.observations import MeasuredFRF

__all__ = ["GATE", "Adequacy", "Place", "judge"]

GATE = 1.25
"""Misfit up to which noise models are believed to be no better themselves."""
_RARE = 1e-3
"""Chance of a misfit that noise alone is allowed to have."""
_BLOCK = 8
"""Lines that are added up, where a misfit that is no noise shows itself."""
_BAND = 24
"""Bands of each receptance in which the worst misfit is looked for."""


@dataclass(frozen=True)
class Place:
    """Where the misfit is largest: a configuration, a band of frequency, how many times what is expected."""

    label: str
    low_hz: float
    high_hz: float
    misfit: float


@dataclass(frozen=True)
class Adequacy:
    """What is left of the residuals.

    Attributes
    ----------
    misfit : float
        Chi-square, priors included, as a multiple of its expectation.
    limit : float
        Up to which it counts as explained.
    smooth : float
        The same of neighbouring lines added up, where noise averages out and a wrong model does not; its
        expectation has the floor in it, which may be the same on all of them. 1 where there are no lines.
    smooth_limit : float
        Its limit.
    worst : tuple of Place
        Where the misfit is largest, one of each observation, the worst first.
    """

    misfit: float
    limit: float
    smooth: float
    smooth_limit: float
    worst: tuple[Place, ...]

    @property
    def passed(self) -> bool:
        """Whether noise and floor explain what is left."""
        return self.misfit <= self.limit and self.smooth <= self.smooth_limit


def judge(fit: Fit) -> Adequacy:
    """Return how well a fit explains its data."""
    freedom = fit.freedom
    blocks: list[NDArray[np.float64]] = []
    worst = []
    parts = np.split(fit.residual, np.cumsum([part.size for part in fit.problem.residuals])[:-1])
    for one, residual in zip(fit.model.observations, parts, strict=False):
        if isinstance(one, MeasuredFRF):
            pair = residual.reshape(2, -1)
            blocks.append(_blocks(one, pair))
            worst.append(_worst(one, pair))
        else:
            at = int(np.argmax(np.abs(residual)))
            places = np.append(one.frequency_hz, one.frequency_hz[one.damped])
            frequency = float(places[at])
            worst.append(Place(one.label or one.configuration, frequency, frequency, float(residual[at] ** 2)))
    smooth = np.concatenate(blocks) if blocks else np.ones(0)
    return Adequacy(
        misfit=fit.misfit,
        limit=max(GATE, _quantile(freedom)),
        smooth=float(np.mean(smooth)) if smooth.size else 1.0,
        smooth_limit=max(GATE, _quantile(float(smooth.size))) if smooth.size else GATE,
        worst=tuple(sorted(worst, key=lambda place: -place.misfit)),
    )


def _quantile(freedom: float) -> float:
    from scipy.special import chdtri  # the light part of scipy.stats

    return float(chdtri(freedom, _RARE)) / freedom


def _blocks(one: MeasuredFRF, pair: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return squares of sums of neighbouring residuals, as multiples of their expectation."""
    if one.standard_deviation is None or pair.shape[1] < 2 * _BLOCK:
        return np.ones(0)
    count = pair.shape[1] // _BLOCK
    cut = count * _BLOCK
    sums = pair[:, :cut].reshape(2, count, _BLOCK).sum(axis=2) / np.sqrt(_BLOCK)
    variance = one.standard_deviation**2
    floor = Floor().variance(one.frequency_hz.real, one.receptance, variance)
    share = (np.minimum(floor, variance) / variance)[:cut].reshape(count, _BLOCK).mean(axis=1)
    result: NDArray[np.float64] = (sums**2 / (1.0 - share + _BLOCK * share)).reshape(-1)
    return result


def _worst(one: MeasuredFRF, pair: NDArray[np.float64]) -> Place:
    lines = np.array_split(np.arange(pair.shape[1]), min(_BAND, pair.shape[1]))
    sizes = [float(np.mean(pair[:, own] ** 2)) * max(one.correlated_lines, 1.0) for own in lines]
    at = int(np.argmax(sizes))
    frequency = one.frequency_hz.real[lines[at]]
    return Place(one.label or one.configuration, float(frequency[0]), float(frequency[-1]), sizes[at])
