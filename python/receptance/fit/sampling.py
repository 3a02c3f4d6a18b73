"""Draws from the posterior of a fit, for posteriors that are not Gaussian.

The sampler is emcee's affine-invariant ensemble of walkers (Foreman-Mackey et al. 2013, PASP 125, 306), whose
efficiency does not depend on scales and correlations of the variables. The prior is uniform within the bounds of the
fitted variables, times the priors of the unknowns.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from receptance import _checks
from receptance.errors import ReceptanceError, require
from receptance.fit.likelihood import require_likelihood
from receptance.fit.problem import Problem
from receptance.fit.result import Identification
from receptance.report import Column, Provenance, Result, Table

_MIN_LENGTH = 50
"""Least length of a chain in autocorrelation times, for a reliable estimate of that time."""
_BURN_IN = 3
"""Autocorrelation times that are discarded at the beginning."""
_MIN_ACCEPTANCE = 0.1
"""Least share of accepted moves without a note."""
_CHUNK = 100
"""Steps between checks of convergence."""
_START_RANGE = 0.05
"""Largest standard deviation of the walkers' starts, as a share of the range of a variable."""


@dataclass(frozen=True, kw_only=True)
class Samples(Result):
    """Draws from the posterior of all fitted parameters."""

    names: tuple[str, ...]
    """As in `Identification.addresses`."""
    values: NDArray[np.float64]
    """`(n, p)` in SI units, errors in their standard deviations."""
    log_likelihood: NDArray[np.float64]
    """`(n,)` logarithm of likelihood times priors, up to a constant."""
    acceptance: float
    """Share of accepted moves; 0.2 to 0.5 is usual."""
    autocorrelation: NDArray[np.float64]
    """`(p,)` integrated autocorrelation time in steps."""
    effective: float
    """Effective number of independent draws, of the parameter with the longest autocorrelation time."""
    walkers: int
    """Number of walkers."""
    steps: int
    """Steps of each walker."""
    burnt: int
    """Discarded steps at the beginning."""
    seed: int
    """Seed of the random numbers."""
    notes: tuple[str, ...]
    provenance: Provenance = field(default_factory=Provenance, repr=False)

    heading = "Draws from the posterior"
    plotted_by = "receptance.fit.figure:draw_samples"

    def of(self, name: str) -> NDArray[np.float64]:
        """Return the draws of one parameter, `(n,)`; a ValueError for a name that was not sampled."""
        if name not in self.names:
            raise ValueError(f"{name!r} was not sampled, only {', '.join(self.names)}")
        return self.values[:, self.names.index(name)]

    def interval(self, name: str, level: float = 0.95) -> tuple[float, float]:
        """Return the interval with equal probabilities of either tail, in SI units."""
        if not 0.0 < level < 1.0:
            raise ValueError(f"interval: level is {level:g}, expected between 0 and 1")
        low, high = np.quantile(self.of(name), [0.5 - 0.5 * level, 0.5 + 0.5 * level])
        return float(low), float(high)

    def tables(self) -> list[Table]:
        """Return median, standard deviation and interval of each parameter."""
        columns = (
            "parameter",
            Column("median", form=".5g"),
            Column("standard deviation", form=".2g"),
            Column("95 % interval", form=".5g"),
            Column("autocorrelation", "steps", ".3g"),
        )
        rows = [
            (name, float(np.median(draws)), float(np.std(draws)), self.interval(name), float(steps))
            for name, draws, steps in zip(self.names, self.values.T, self.autocorrelation, strict=True)
        ]
        return [Table("Parameters, SI units", columns, rows)]

    def sentences(self) -> list[str]:
        """Return the number of draws and the acceptance."""
        return [f"{self._headline()}."]

    def data(self) -> dict[str, Any]:
        """Return quantiles of each parameter, and the settings of the sampler."""
        quantiles = np.quantile(self.values, [0.025, 0.5, 0.975], axis=0).T
        return {
            "parameters": {
                name: {"quantiles_025_500_975": quantile, "autocorrelation_steps": steps}
                for name, quantile, steps in zip(self.names, quantiles, self.autocorrelation, strict=True)
            },
            "draws": len(self.values),
            "effective": self.effective,
            "acceptance": self.acceptance,
            "walkers": self.walkers,
            "steps": self.steps,
            "burnt": self.burnt,
        }

    def __repr__(self) -> str:
        return f"Samples({'; '.join([self._headline(), *self.notes])})"

    def _headline(self) -> str:
        return (
            f"{len(self.values)} draws of {len(self.names)} parameters, effectively {self.effective:.0f} independent "
            f"ones, {100 * self.acceptance:.0f} % accepted"
        )


def sample_posterior(
    fit: Identification,
    *,
    steps: int = 5000,
    walkers: int | None = None,
    seed: int = 0,
    progress: Callable[[str], None] | None = None,
) -> Samples:
    """Draw from the posterior with priors that are uniform within bounds, times those given; needs emcee.

    Parameters
    ----------
    fit : Identification
        From `identify`, with the objective "log".
    steps : int, optional
        Largest number of steps of a walker; sampling ends at a hundred autocorrelation times.
    walkers : int, optional
        Number of walkers; by default four per parameter.
    seed : int, optional
        Seed of the random numbers.
    progress : callable, optional
        Called with a progress message.

    Raises
    ------
    ValueError, ReceptanceError
        Too few steps or walkers, the percentage objective, which is no likelihood, or emcee is not installed.
    """
    require("sampling", "sampling of the posterior")
    import emcee

    require_likelihood(fit)
    _checks.whole_number("sample_posterior", "steps", steps, least=_CHUNK)
    count = len(fit.unknowns)
    number = max(4 * count, 16) if walkers is None else walkers
    if isinstance(number, bool) or not isinstance(number, int) or number < 2 * count:
        raise ValueError(f"walkers is {number!r}, expected a whole number of at least {2 * count}, two per parameter")
    problem: Problem = fit.task.problem()
    variance = fit.variance_of_residuals(min(start.cost for start in fit.starts))
    if not variance > 0.0:
        raise ValueError("all residuals are zero and no standard deviations are given: the posterior has no width")
    low, high = problem.variables.limits

    def density(x: NDArray[np.float64]) -> float:
        if np.any(x < low) or np.any(x > high):
            return -np.inf
        return -problem.cost(x) / variance

    # emcee supports only NumPy's legacy generator.
    state = np.random.RandomState(seed)
    starts = _draw_starts(fit, number, density, np.random.default_rng(seed))
    sampler = emcee.EnsembleSampler(number, count, density)
    sampler.random_state = state.get_state()
    done = 0
    for _ in sampler.sample(starts, iterations=steps):
        done += 1
        if done % _CHUNK:
            continue
        lengths = sampler.get_autocorr_time(tol=0)
        if progress is not None:
            progress(f"sampling, step {done}")
        if np.all(done > 2 * _MIN_LENGTH * lengths):
            break
    chain = sampler.get_chain()
    lengths = np.asarray(sampler.get_autocorr_time(tol=0))
    slowest = float(np.max(lengths)) if np.isfinite(lengths).all() else float(done)
    burnt = min(int(_BURN_IN * slowest) + 1, done // 2)
    kept = chain[burnt:]
    values = fit.task.variables.to_values(kept.reshape(-1, chain.shape[2]))
    acceptance = float(np.mean(sampler.acceptance_fraction))
    notes = []
    if done < _MIN_LENGTH * slowest:
        notes.append(
            f"the chains are only {done / slowest:.0f} autocorrelation times long, expected {_MIN_LENGTH}: quantiles "
            "in the tails are unreliable; take more steps"
        )
    if acceptance < _MIN_ACCEPTANCE:
        notes.append(f"only {100 * acceptance:.1f} % of the moves were accepted: the posterior is explored slowly")
    if not fit.known_scatter:
        notes.append("the scatter is estimated from the residuals of the fit and taken as known")
    return Samples(
        names=fit.addresses,
        values=values,
        log_likelihood=sampler.get_log_prob()[burnt:].reshape(-1),
        acceptance=acceptance,
        autocorrelation=lengths,
        effective=len(values) / max(slowest, 1.0),
        walkers=chain.shape[1],
        steps=done,
        burnt=burnt,
        seed=seed,
        notes=tuple(notes),
        provenance=Provenance(seed=seed),
    )


def _draw_starts(
    fit: Identification,
    walkers: int,
    density: Callable[[NDArray[np.float64]], float],
    rng: np.random.Generator,
) -> NDArray[np.float64]:
    """Draw the walkers' starts around the optimum, with its standard errors, where the model has a value."""
    low, high = fit.task.variables.limits
    deviation = np.sqrt(np.diag(fit.covariance))
    deviation = np.minimum(np.where(np.isfinite(deviation), deviation, np.inf), _START_RANGE * (high - low))
    inside = np.clip(fit.vector, low + 1e-9 * (high - low), high - 1e-9 * (high - low))
    kept: list[NDArray[np.float64]] = []
    shrink = 1.0
    while len(kept) < walkers:
        x = inside + shrink * deviation * rng.standard_normal(inside.size)
        x = np.where(x < low, 2.0 * low - x, np.where(x > high, 2.0 * high - x, x))
        if np.isfinite(density(x)):
            kept.append(x)
        else:
            shrink *= 0.9
            if shrink < 1e-9:
                raise ReceptanceError("the model has no value around the fit, so walkers cannot start there")
    return np.array(kept)
