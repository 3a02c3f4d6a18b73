"""Whether a fit leaves no more than noise and floor explain, and where it does not."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from receptance.diagnosis.fitting import Fit
from receptance.identification.floor import Floor
from receptance.identification.observations import MeasuredFRF

__all__ = ["FEWEST", "GATE", "Adequacy", "Place", "Strain", "judge"]

FEWEST = 3
"""Degrees of freedom below which a fit that passes says nothing of its model: of two, a misfit of 6.9 still passes."""

GATE = 1.25
"""Misfit up to which noise models are believed to be no better themselves."""
_RARE = 1e-3
"""Chance of a misfit that noise alone is allowed to have."""
_BLOCK = 8
"""Lines that are added up, where a misfit that is no noise shows itself."""
_SEEN = 0.05
"""Share of a prior's variance that data must have taken away, for the prior to be compared with what they say."""
_FARTHEST = 3
"""So many strained errors are told."""
_BAND = 24
"""Bands of each receptance in which the worst misfit is looked for."""


@dataclass(frozen=True)
class Place:
    """Where the misfit is largest: a configuration, a band of frequency, how many times what is expected."""

    label: str
    low_hz: float
    high_hz: float
    misfit: float

    def __str__(self) -> str:
        if self.low_hz == self.high_hz:
            return f"{self.label} at {self.low_hz:.0f} Hz"
        return f"{self.label} from {self.low_hz:.0f} to {self.high_hz:.0f} Hz"


@dataclass(frozen=True)
class Strain:
    """How far the fit had to pull tolerances and scatter of clampings from what was stated.

    A fit can hide in them what the model lacks, so that no line shows it. To be expected is that an error z, whose
    prior is standard normal and whose variance the data leave at v, ends within a few sqrt(1 - v) of zero.

    Attributes
    ----------
    worst : tuple of (str, float)
        The errors that are farthest off, in these standard deviations, the farthest first.
    limit : float
        Of the largest one among so many.
    together : float
        Sum of squares of all that the data see, as a multiple of its expectation.
    together_limit : float
        Its limit.
    chance : float
        How often an adequate model would be pulled as far, by its farthest error or by all together, whichever is
        rarer.
    """

    worst: tuple[tuple[str, float], ...] = ()
    limit: float = np.inf
    together: float = 1.0
    together_limit: float = np.inf
    chance: float = 1.0

    @property
    def passed(self) -> bool:
        """Whether ordinary errors do that."""
        return self.together <= self.together_limit and all(abs(size) <= self.limit for _, size in self.worst)


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
    strain : Strain
        What the fit made of tolerances and scatter.
    """

    misfit: float
    limit: float
    smooth: float
    smooth_limit: float
    worst: tuple[Place, ...]
    strain: Strain = Strain()

    @property
    def passed(self) -> bool:
        """Whether noise and floor explain what is left, with tolerances that nobody would doubt."""
        return self.of_lines and self.strain.passed

    @property
    def of_lines(self) -> bool:
        """Whether noise and floor explain what is left, whatever tolerances it takes."""
        return self.misfit <= self.limit and self.smooth <= self.smooth_limit

    @property
    def why_not(self) -> str:
        """What is too large, for people; empty where nothing is."""
        if not self.of_lines:
            return f"leaves {self.misfit:.2f} times what noise and floor explain, most of it in {self.worst[0]}"
        if not self.strain.passed:
            far = ", ".join(f"{name} at {size:+.1f}" for name, size in self.strain.worst)
            return f"fits only with tolerances that nobody would believe, in standard deviations: {far}"
        return ""


def judge(fit: Fit) -> Adequacy:
    """Return how well a fit explains its data."""
    freedom = fit.freedom
    smooth = expected = 0.0
    worst = []
    parts = fit.problem.parts(fit.residual)
    for one, residual in zip(fit.model.observations, parts, strict=True):
        if isinstance(one, MeasuredFRF):
            pair = residual.reshape(2, -1)
            of_blocks = _blocks(one, pair)
            smooth, expected = smooth + of_blocks[0], expected + of_blocks[1]
            worst.append(_worst(one, pair))
        else:
            at = int(np.argmax(np.abs(residual)))
            places = np.append(one.frequency_hz, one.frequency_hz[one.damped])
            frequency = float(places[at])
            worst.append(Place(one.label or one.configuration, frequency, frequency, float(residual[at] ** 2)))
    return Adequacy(
        misfit=fit.misfit,
        limit=max(GATE, _quantile(freedom)),
        smooth=smooth / expected if expected else 1.0,
        smooth_limit=max(GATE, _quantile(expected)) if expected else GATE,
        worst=tuple(sorted(worst, key=lambda place: -place.misfit)),
        strain=_strain(fit),
    )


def _strain(fit: Fit) -> Strain:
    """Return how far errors ended from zero, each beside what its prior and the data allow.

    With residuals r = J x and their rows P of the priors, those of an adequate model have the covariance
    I - P (J^T J)^-1 P^T: the prior's own less what a prior keeps to itself where the data say nothing.
    """
    from scipy.special import chdtrc, ndtr, ndtri  # the light part of scipy.stats

    names = [unknown.name for unknown in fit.task.parameters.unknowns if unknown.prior is not None]
    if not names:
        return Strain()
    off, slopes = fit.residual[-len(names) :], fit.jacobian
    scale = np.linalg.norm(slopes, axis=0)
    scaled = slopes / np.where(scale > 0.0, scale, 1.0)
    rows = scaled[-len(names) :]
    expected = np.eye(len(names)) - rows @ np.linalg.pinv(scaled.T @ scaled, rcond=1e-13, hermitian=True) @ rows.T
    own = np.diag(expected)
    seen = own > _SEEN
    if not seen.any():
        return Strain()
    sizes = np.where(seen, off / np.sqrt(np.where(seen, own, 1.0)), 0.0)
    values, vectors = np.linalg.eigh(expected)
    kept = values > _SEEN
    parts = vectors[:, kept].T @ off
    count = int(np.count_nonzero(kept))
    together = float(np.sum(parts**2 / values[kept]))
    order = np.argsort(-np.abs(sizes))[:_FARTHEST]
    farthest = float(np.abs(sizes).max())
    return Strain(
        worst=tuple((names[i], float(sizes[i])) for i in order if seen[i]),
        limit=float(-ndtri(0.5 * _RARE / np.count_nonzero(seen))),
        together=together / max(count, 1),
        together_limit=_quantile(float(max(count, 1))),
        chance=min(2.0 * np.count_nonzero(seen) * float(ndtr(-farthest)), float(chdtrc(max(count, 1), together)), 1.0),
    )


def _quantile(freedom: float) -> float:
    from scipy.special import chdtri  # the light part of scipy.stats

    return float(chdtri(freedom, _RARE)) / freedom


def _blocks(one: MeasuredFRF, pair: NDArray[np.float64]) -> tuple[float, float]:
    """Return the sum of squares of sums of neighbouring residuals, and how many independent ones there are.

    Each square is divided by its expectation for lines that are independent or correlated over less than a block. Where
    c lines are correlated, a residual has the variance 1 / c. A block that is shorter than c lines then has _BLOCK / c
    of that expectation, and counts as so much of an independent block.
    """
    if one.standard_deviation is None or pair.shape[1] < 2 * _BLOCK:
        return 0.0, 0.0
    count = pair.shape[1] // _BLOCK
    cut = count * _BLOCK
    sums = pair[:, :cut].reshape(2, count, _BLOCK).sum(axis=2) / np.sqrt(_BLOCK)
    variance = one.standard_deviation**2
    floor = Floor().variance(one.frequency_hz.real, one.receptance, variance)
    share = (np.minimum(floor, variance) / variance)[:cut].reshape(count, _BLOCK).mean(axis=1)
    alone = np.minimum(1.0, _BLOCK * (1.0 / one.correlated_lines)[:cut].reshape(count, _BLOCK).mean(axis=1))
    squares = sums**2 / (1.0 - share + _BLOCK * share / alone)
    return float(np.sum(squares)), 2.0 * float(np.sum(alone))


def _worst(one: MeasuredFRF, pair: NDArray[np.float64]) -> Place:
    lines = np.array_split(np.arange(pair.shape[1]), min(_BAND, pair.shape[1]))
    expected = 1.0 / one.correlated_lines
    sizes = [float(np.mean(pair[:, own] ** 2) / np.mean(expected[own])) for own in lines]
    at = int(np.argmax(sizes))
    frequency = one.frequency_hz.real[lines[at]]
    return Place(one.label or one.configuration, float(frequency[0]), float(frequency[-1]), sizes[at])
