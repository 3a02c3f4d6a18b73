"""The posterior as draws: where an interval alone does not tell how parameters go together.

The sampler is emcee's ensemble of walkers (Foreman-Mackey et al. 2013, PASP 125, 306), which does not mind how
variables are scaled or correlated. It works on the fitted variables: flat within the bounds, times the priors.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance.errors import ReceptanceError
from receptance.report import Column, Provenance, Result, Table

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from receptance.identification.problem import Problem
    from receptance.identification.result import Identification

__all__ = ["Samples", "sample_posterior"]

_LENGTHS = 50
"""Autocorrelation times that a chain must be long, for its own time to be known."""
_BURNT = 3
"""Autocorrelation times that are left out at its beginning."""
_ACCEPTED = 0.1
"""Shares of accepted moves below this say that the walkers hardly move."""
_CHUNK = 100
"""Steps between two looks at the chain."""
_RANGE = 0.05
"""Share of the range in which walkers begin where the data do not determine a variable."""


@dataclass(frozen=True, kw_only=True)
class Samples(Result):
    """Draws from the posterior of all fitted parameters.

    Attributes
    ----------
    names : tuple of str
        As in `Identification.addresses`.
    values : ndarray
        `(n, p)` in SI units, errors in their standard deviations.
    log_likelihood : ndarray
        `(n,)` logarithm of likelihood times priors, up to a constant.
    acceptance : float
        Share of the proposed moves that were accepted; about 0.2 to 0.5 is usual.
    autocorrelation : ndarray
        `(p,)` steps until a walker has forgotten where it was.
    effective : float
        Number of independent draws that these are worth, of the slowest parameter.
    walkers, steps, burnt : int
        Walkers, steps of each, and how many of these were left out at the beginning.
    seed : int
        Of everything that was drawn.
    notes : tuple of str
        Notes for the user; empty where there are none.
    provenance : Provenance
        Seed and versions of the software.
    """

    names: tuple[str, ...]
    values: NDArray[np.float64]
    log_likelihood: NDArray[np.float64]
    acceptance: float
    autocorrelation: NDArray[np.float64]
    effective: float
    walkers: int
    steps: int
    burnt: int
    seed: int
    notes: tuple[str, ...]
    provenance: Provenance = field(default_factory=Provenance, repr=False)

    heading = "Draws from the posterior"

    def of(self, name: str) -> NDArray[np.float64]:
        """Return the draws of one parameter, `(n,)`.

        Raises
        ------
        ValueError
            A name that was not sampled.
        """
        if name not in self.names:
            raise ValueError(f"{name!r} was not sampled, only {', '.join(self.names)}")
        return self.values[:, self.names.index(name)]

    def interval(self, name: str, level: float = 0.95) -> tuple[float, float]:
        """Return the interval with equal probability on both sides outside, in SI units."""
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
            (name, float(np.median(own)), float(np.std(own)), self.interval(name), float(steps))
            for name, own, steps in zip(self.names, self.values.T, self.autocorrelation, strict=True)
        ]
        return [Table("Parameters, SI units", columns, rows)]

    def sentences(self) -> list[str]:
        """Return number of draws and acceptance."""
        return [f"{self._headline()}."]

    def data(self) -> dict[str, Any]:
        """Return quantiles of each parameter, and the settings of the sampler."""
        quantiles = np.quantile(self.values, [0.025, 0.5, 0.975], axis=0).T
        return {
            "parameters": {
                name: {"quantiles_025_500_975": own, "autocorrelation_steps": steps}
                for name, own, steps in zip(self.names, quantiles, self.autocorrelation, strict=True)
            },
            "draws": len(self.values),
            "effective": self.effective,
            "acceptance": self.acceptance,
            "walkers": self.walkers,
            "steps": self.steps,
            "burnt": self.burnt,
        }

    def plot(self, ax: Axes | None = None) -> Figure:
        """Draw a histogram of each parameter with its 95 % interval; see `Result.plot`."""
        from receptance.identification.figures.samples import draw_samples

        return draw_samples(self, ax)

    def __repr__(self) -> str:
        return f"Samples({'; '.join([self._headline(), *self.notes])})"

    def _headline(self) -> str:
        return (
            f"{len(self.values)} draws of {len(self.names)} parameters, worth {self.effective:.0f} independent "
            f"ones, {100 * self.acceptance:.0f} % accepted"
        )


def sample_posterior(
    found: Identification,
    *,
    steps: int = 5000,
    walkers: int | None = None,
    seed: int = 0,
    progress: Callable[[str], None] | None = None,
) -> Samples:
    """Sample the posterior of a fit; see `Identification.sample`."""
    try:
        import emcee
    except ImportError as error:
        raise ReceptanceError("sampling needs the package emcee: pip install 'receptance[sampling]'") from error
    if "percent" in found.units:
        raise ValueError("the percentage objective is no likelihood: identify with the objective 'log'")
    if isinstance(steps, bool) or not isinstance(steps, int) or steps < _CHUNK:
        raise ValueError(f"steps is {steps!r}, expected a whole number of at least {_CHUNK}")
    count = len(found.unknowns)
    number = max(4 * count, 16) if walkers is None else walkers
    if isinstance(number, bool) or not isinstance(number, int) or number < 2 * count:
        raise ValueError(f"walkers is {number!r}, expected a whole number of at least {2 * count}, two a parameter")
    problem: Problem = found.task.problem()
    scatter = 1.0 if found.known_scatter else 2.0 * _best(found) / max(found.degrees_of_freedom, 1)
    if not scatter > 0.0:
        raise ValueError("the residuals are all zero and no standard deviations are given: nothing has a spread")
    low, high = problem.variables.limits

    def density(x: NDArray[np.float64]) -> float:
        if np.any(x < low) or np.any(x > high):
            return -np.inf
        there = problem.normal(x)
        return -np.inf if there is None else -there.cost / scatter

    # emcee draws from NumPy's old generators only.
    state = np.random.RandomState(seed)
    begun = _begun(found, number, density, np.random.default_rng(seed))
    sampler = emcee.EnsembleSampler(number, count, density)
    sampler.random_state = state.get_state()
    done = 0
    for _ in sampler.sample(begun, iterations=steps):
        done += 1
        if done % _CHUNK:
            continue
        lengths = sampler.get_autocorr_time(tol=0)
        if progress is not None:
            progress(f"sampling, step {done}")
        if np.all(done > 2 * _LENGTHS * lengths):
            break
    return _told(found, sampler, done, seed)


def _best(found: Identification) -> float:
    return min(start.cost for start in found.starts)


def _begun(
    found: Identification,
    walkers: int,
    density: Callable[[NDArray[np.float64]], float],
    rng: np.random.Generator,
) -> NDArray[np.float64]:
    """Return where walkers begin: around the optimum as far as the standard errors reach, where the model exists."""
    variables = found.task.variables
    low, high = variables.limits
    centre = variables.from_values(np.array(list(found.values.values())))
    spread = np.sqrt(np.diag(found.covariance))
    spread = np.minimum(np.where(np.isfinite(spread), spread, np.inf), _RANGE * (high - low))
    inside = np.clip(centre, low + 1e-9 * (high - low), high - 1e-9 * (high - low))
    kept: list[NDArray[np.float64]] = []
    shrink = 1.0
    while len(kept) < walkers:
        x = inside + shrink * spread * rng.standard_normal(centre.size)
        x = np.where(x < low, 2.0 * low - x, np.where(x > high, 2.0 * high - x, x))
        if np.isfinite(density(x)):
            kept.append(x)
        else:
            shrink *= 0.9
            if shrink < 1e-9:
                raise ReceptanceError("the model has no value around the fit, so no walker can begin there")
    return np.array(kept)


def _told(found: Identification, sampler: Any, done: int, seed: int) -> Samples:
    chain = sampler.get_chain()
    lengths = np.asarray(sampler.get_autocorr_time(tol=0))
    slowest = float(np.max(lengths)) if np.isfinite(lengths).all() else float(done)
    burnt = min(int(_BURNT * slowest) + 1, done // 2)
    kept = chain[burnt:]
    variables = found.task.variables
    values = variables.to_values(kept.reshape(-1, chain.shape[2]))
    acceptance = float(np.mean(sampler.acceptance_fraction))
    notes = []
    if done < _LENGTHS * slowest:
        notes.append(
            f"the chains are only {done / slowest:.0f} autocorrelation times long, expected {_LENGTHS}: quantiles in "
            "the tails are not to be trusted; take more steps"
        )
    if acceptance < _ACCEPTED:
        notes.append(f"only {100 * acceptance:.1f} % of the moves were accepted: the walkers hardly move")
    if not found.known_scatter:
        notes.append("the scatter is estimated from the residuals of the fit and taken as known")
    return Samples(
        names=found.addresses,
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
