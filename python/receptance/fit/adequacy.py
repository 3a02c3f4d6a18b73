"""Adequacy of a fit: whether its residuals agree with noise, floor and tolerances, and where they do not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import special

from receptance._text import first_of
from receptance.fit.line_selection import FEWEST_LINES, usable_lines
from receptance.fit.observation import Observation
from receptance.fit.problem import Task
from receptance.fit.weights import Floor
from receptance.report.table import amount

MISFIT_LIMIT = 1.25
"""Misfit up to which a model is adequate: estimates of the noise are not better than that."""
CHANCE = 1e-3
"""Probability with which noise alone exceeds a limit of the adequacy test, and the best evidence by chance the
detection threshold of a diagnosis. It is small because the threshold holds to first order and for noise of known size:
of 150 virtual diagnoses without a hidden cause five exceeded that of the probability 0.01."""
_LISTED = 3
"""Number of strained tolerances that are listed."""
_BLOCK_LINES = 8
"""Neighbouring lines whose residuals are added: noise averages out, an error of the model does not."""
_OBSERVABLE_VARIANCE = 0.05
"""Share of the prior variance that the data must remove before the error of a tolerance is tested."""
_MISFIT_BANDS = 24
"""Frequency bands of each receptance among which the largest misfit is located."""
_AT_STOP = 1e-3
"""Largest distance from a bound, as a share of the range, of an error that is at its stop."""


@dataclass(frozen=True)
class MisfitBand:
    """The frequency band with the largest misfit of an observation."""

    label: str
    """The observation."""
    low_hz: float
    high_hz: float
    """End of the band; equal to its beginning for a natural frequency."""
    misfit: float
    """Mean squared residual divided by its expectation."""

    def __str__(self) -> str:
        if self.low_hz == self.high_hz:
            return f"{self.label} at {self.low_hz:.0f} Hz"
        return f"{self.label} from {self.low_hz:.0f} to {self.high_hz:.0f} Hz"


@dataclass(frozen=True)
class Strain:
    """Fitted errors of tolerances and clampings relative to their expected scatter.

    They can absorb an error of the model, so that no line shows it. An error z with a standard normal prior and the
    posterior variance v has the standard deviation sqrt(1 - v) in an adequate model.
    """

    worst: tuple[tuple[str, float], ...] = ()
    """The largest errors in these standard deviations, the largest first."""
    limit: float = np.inf
    """Limit of the largest one."""
    together: float = 1.0
    """Sum of squares of all errors that the data show, divided by its expectation."""
    together_limit: float = np.inf
    """Its limit."""
    chance: float = 1.0
    """Probability of such errors in an adequate model: of the largest one or of all together, whichever is smaller."""
    at_stop: tuple[str, ...] = ()
    """Errors at the bounds of the fit, which no adequate model has."""

    @property
    def passed(self) -> bool:
        """Whether the errors are within their limits."""
        return (
            not self.at_stop
            and self.together <= self.together_limit
            and all(abs(size) <= self.limit for _, size in self.worst)
        )


@dataclass(frozen=True)
class Adequacy:
    """Agreement of a fit with its data."""

    misfit: float
    """Chi-square, priors included, divided by its expectation."""
    limit: float
    smooth: float
    """The same for sums over neighbouring lines, in which noise averages out and an error of the model does not. The
    expectation includes the floor, which may be common to all lines. 1 where there are no lines."""
    smooth_limit: float
    """Its limit."""
    worst: tuple[MisfitBand, ...]
    """The largest misfit of each observation, the largest first."""
    strain: Strain = Strain()
    """Strain of the tolerances."""

    @property
    def passed(self) -> bool:
        """Whether noise and floor explain the residuals, with plausible errors of the tolerances."""
        return self.of_lines and self.strain.passed

    @property
    def needs_discrepancy(self) -> bool:
        """Whether predictions allow for an error of the model: it does not pass, or only because the data are few."""
        return not self.passed or self.misfit > MISFIT_LIMIT

    @property
    def of_lines(self) -> bool:
        """Whether noise and floor explain the residuals, with any errors of the tolerances."""
        return self.misfit <= self.limit and self.smooth <= self.smooth_limit

    def data(self) -> dict[str, Any]:
        """Return the result of each test by name."""
        return {
            "passed": self.passed,
            "misfit": self.misfit,
            "misfit_limit": self.limit,
            "smooth": self.smooth,
            "smooth_limit": self.smooth_limit,
            "worst": [str(band) for band in self.worst[:_LISTED]],
            "strained": dict(self.strain.worst) if not self.strain.passed else {},
            "at_stop": self.strain.at_stop,
        }

    @property
    def shortcoming(self) -> str:
        """The reason why it does not pass, as text; empty where it does."""
        if self.misfit > self.limit:
            return (
                f"leaves residuals of {times(self.misfit)} times the noise (limit {times(self.limit)}), largest in "
                f"{self.worst[0]}"
            )
        if self.smooth > self.smooth_limit:
            return (
                f"leaves residuals of {times(self.smooth)} times the noise in sums over neighbouring lines (limit "
                f"{times(self.smooth_limit)}), largest in {self.worst[0]}"
            )
        if self.strain.at_stop:
            return f"moves {first_of(self.strain.at_stop)} to the limit of the fit, which no tolerance explains"
        if not self.strain.passed:
            strained = ", ".join(f"{name} at {size:+.1f}" for name, size in self.strain.worst)
            return f"requires implausible errors of the tolerances, in standard deviations: {strained}"
        return ""


def misfit_limit(expected_chi_square: float) -> float:
    """Return the misfit up to which a fit with this expectation of chi-square may be adequate."""
    return max(MISFIT_LIMIT, _quantile(expected_chi_square))


def judge(
    observations: Sequence[Observation],
    residual_of: Sequence[NDArray[np.float64]],
    chi_square: float,
    expected_chi_square: float,
    strain: Strain,
) -> Adequacy:
    """Return the adequacy of a fit.

    Parameters
    ----------
    observations : sequence of Observation
        The fitted observations.
    residual_of : sequence of ndarray
        Residuals of each observation.
    chi_square, expected_chi_square : float
        Sum of all squared residuals, and its expectation from noise and floor.
    strain : Strain
        From `strain_of`.
    """
    smooth = expected = 0.0
    worst = []
    for observation, residual in zip(observations, residual_of, strict=True):
        if observation.is_receptance:
            pair = residual.reshape(2, -1)
            of_blocks = _blocks(observation, pair)
            smooth, expected = smooth + of_blocks[0], expected + of_blocks[1]
            worst.append(_worst(observation, pair))
        else:
            at = int(np.argmax(np.abs(residual)))
            places = np.append(observation.frequency_hz, observation.frequency_hz[observation.damped])
            frequency = float(places[at])
            worst.append(
                MisfitBand(
                    observation.label or observation.configuration, frequency, frequency, float(residual[at] ** 2)
                )
            )
    return Adequacy(
        misfit=chi_square / expected_chi_square,
        limit=misfit_limit(expected_chi_square),
        smooth=smooth / expected if expected else 1.0,
        smooth_limit=max(MISFIT_LIMIT, _quantile(expected)) if expected else MISFIT_LIMIT,
        worst=tuple(sorted(worst, key=lambda band: -band.misfit)),
        strain=strain,
    )


def adequacy_of(task: Task, residual: NDArray[np.float64], root: NDArray[np.float64]) -> Adequacy:
    """Return the adequacy of a fit from its lines that can be judged.

    Parameters
    ----------
    task : Task
        The fitted model; all observations have standard deviations.
    residual, root : ndarray
        As in `strain_of`.
    """
    observations, parts = [], []
    sizes = [2 * one.frequency_hz.size if one.is_receptance else one.standard_deviations.size for one in task.selected]
    *split, priors = np.split(residual, np.cumsum(sizes))
    masks = usable_lines(task.selected, task.configurations)
    for observation, part, mask in zip(task.selected, split, masks, strict=True):
        if mask is not None and mask.sum() >= min(FEWEST_LINES, mask.size):
            observation, part = observation.select(mask), part.reshape(2, -1)[:, mask].ravel()
        observations.append(observation)
        parts.append(part)
    free = sum(unknown.prior is None for unknown in task.parameters.unknowns)
    expected = max(sum(observation.independent_values for observation in observations) - free, 1.0)
    chi_square = float(sum(part @ part for part in parts) + priors @ priors)
    return judge(observations, parts, chi_square, expected, strain_of(task, residual, root))


def strain_of(task: Task, residual: NDArray[np.float64], root: NDArray[np.float64]) -> Strain:
    """Return the errors of the tolerances relative to their expected scatter.

    Parameters
    ----------
    task : Task
        The fitted model.
    residual : ndarray
        All residuals, priors last.
    root : ndarray
        R with R^T R = J^T J, see `Fit.curvature_root`.

    Notes
    -----
    With residuals r = J x and the rows P of J that belong to the priors, the residuals of the priors of an adequate
    model have the covariance I - P (J^T J)^-1 P^T.
    """
    names = [unknown.name for unknown in task.parameters.unknowns if unknown.prior is not None]
    if not names:
        return Strain()
    errors = residual[-len(names) :]
    scale = np.linalg.norm(root, axis=0)
    scaled = root / np.where(scale > 0.0, scale, 1.0)
    columns, slopes, _ = task.variables.priors.T
    own = columns.astype(np.intp)
    rows = np.zeros((len(names), scale.size))
    rows[np.arange(len(names)), own] = slopes / scale[own]
    expected = np.eye(len(names)) - rows @ np.linalg.pinv(scaled.T @ scaled, rcond=1e-13, hermitian=True) @ rows.T
    variance = np.diag(expected)
    is_observable = variance > _OBSERVABLE_VARIANCE
    tested = int(np.count_nonzero(is_observable))
    ends = {unknown.name: (unknown.lower, unknown.upper) for unknown in task.parameters.unknowns}
    at_stop = tuple(
        name
        for name, error in zip(names, errors.tolist(), strict=True)
        if name in task.parameters.errors
        and min(error - ends[name][0], ends[name][1] - error) <= _AT_STOP * (ends[name][1] - ends[name][0])
    )
    if not tested:
        return Strain(at_stop=at_stop)
    sizes = np.where(is_observable, errors / np.sqrt(np.where(is_observable, variance, 1.0)), 0.0)
    values, vectors = np.linalg.eigh(expected)
    kept = values > _OBSERVABLE_VARIANCE
    parts = vectors[:, kept].T @ errors
    count = max(int(np.count_nonzero(kept)), 1)
    together = float(np.sum(parts**2 / values[kept]))
    order = np.argsort(-np.abs(sizes))[:_LISTED]
    largest = float(np.abs(sizes).max())
    return Strain(
        at_stop=at_stop,
        worst=tuple((names[i], float(sizes[i])) for i in order if is_observable[i]),
        limit=float(-special.ndtri(0.5 * CHANCE / tested)),
        together=together / count,
        together_limit=_quantile(float(count)),
        chance=min(2.0 * tested * float(special.ndtr(-largest)), float(special.chdtrc(count, together)), 1.0),
    )


def times(misfit: float) -> str:
    """Return the root mean square of residuals relative to their expectation, as text."""
    return amount(float(np.sqrt(misfit)))


def _quantile(freedom: float) -> float:
    return float(special.chdtri(freedom, CHANCE)) / freedom


def _blocks(observation: Observation, pair: NDArray[np.float64]) -> tuple[float, float]:
    """Return the sum of squares of sums over neighbouring residuals, and the number of independent ones.

    Each square is divided by its expectation for lines that are independent or correlated over less than a block. Where
    c lines are correlated, a residual has the variance 1 / c. A block of fewer than c lines then has the expectation
    _BLOCK_LINES / c, and counts as that part of an independent block.
    """
    if observation.standard_deviation is None or pair.shape[1] < 2 * _BLOCK_LINES:
        return 0.0, 0.0
    count = pair.shape[1] // _BLOCK_LINES
    cut = count * _BLOCK_LINES
    sums = pair[:, :cut].reshape(2, count, _BLOCK_LINES).sum(axis=2) / np.sqrt(_BLOCK_LINES)
    variance = observation.standard_deviation**2
    floor = Floor().variance(observation.frequency_hz.real, observation.receptance, variance)
    share = (np.minimum(floor, variance) / variance)[:cut].reshape(count, _BLOCK_LINES).mean(axis=1)
    alone = np.minimum(
        1.0, _BLOCK_LINES * (1.0 / observation.correlated_lines)[:cut].reshape(count, _BLOCK_LINES).mean(axis=1)
    )
    squares = sums**2 / (1.0 - share + _BLOCK_LINES * share / alone)
    return float(np.sum(squares)), 2.0 * float(np.sum(alone))


def _worst(observation: Observation, pair: NDArray[np.float64]) -> MisfitBand:
    count = pair.shape[1]
    bands = np.arange(min(_MISFIT_BANDS, count) + 1)
    length, longer = divmod(count, len(bands) - 1)
    edges = length * bands + np.minimum(bands, longer)
    squares = np.add.reduceat(np.sum(pair**2, axis=0), edges[:-1])
    sizes = squares / (2.0 * np.add.reduceat(1.0 / observation.correlated_lines, edges[:-1]))
    at = int(np.argmax(sizes))
    low, high = observation.frequency_hz.real[[edges[at], edges[at + 1] - 1]]
    return MisfitBand(observation.label or observation.configuration, float(low), float(high), float(sizes[at]))
