"""Likelihood of a fit: constrained fits and their likelihood ratio, and the evidence of a model."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from receptance import _checks
from receptance._chances import chi_square_chance
from receptance.errors import ReceptanceWarning
from receptance.identification.observations import MeasuredFRF
from receptance.identification.problem import COST_TOLERANCE

if TYPE_CHECKING:
    from receptance.identification.result import Identification

__all__ = ["ConstrainedFit", "constrained_fit", "log_evidence", "require_likelihood", "residual_variance"]

_BETTER = 0.01
"""Decrease of -2 log L below that of the fit from which on the fit was not the global optimum."""


def require_likelihood(found: Identification) -> None:
    """Raise ValueError if receptances were fitted with the percentage objective."""
    pairs = zip(found.units, found.task.observed, strict=True)
    if any(unit == "percent" and isinstance(one, MeasuredFRF) for unit, one in pairs):
        raise ValueError("the percentage objective is no likelihood: identify with the objective 'log'")


def residual_variance(found: Identification, cost: float) -> float:
    """Return the variance of a residual: 1 with given standard deviations, otherwise from the least cost."""
    return 1.0 if found.known_scatter else 2.0 * cost / max(found.degrees_of_freedom, 1)


@dataclass(frozen=True, kw_only=True)
class ConstrainedFit:
    """The best fit with some parameters at given values.

    Attributes
    ----------
    values : dict of str to float
        The given values in SI units.
    others : dict of str to float
        The other parameters, fitted again.
    rise : float
        Increase of -2 log L over the unconstrained fit; infinite if the model has no value.
    p_value : float
        Probability of at least this increase if the given values are true (Wilks 1938); from the F distribution if the
        scatter was estimated.
    """

    values: dict[str, float]
    others: dict[str, float]
    rise: float
    p_value: float

    def rejected(self, level: float = 0.95) -> bool:
        """Return whether the data reject the values at a level."""
        return self.p_value < 1.0 - level

    def __repr__(self) -> str:
        given = ", ".join(f"{name}={value:.4g}" for name, value in self.values.items())
        return f"ConstrainedFit({given}: rise {self.rise:.3g}, p = {self.p_value:.2g})"


def constrained_fit(found: Identification, values: Mapping[str, float], *, starts: int = 8) -> ConstrainedFit:
    """Fit all other parameters with some at given values, and test the values by the likelihood ratio.

    A profile holds one parameter; this tests a set of several values at once. Errors of tolerances are fitted within
    their priors.

    Parameters
    ----------
    found : Identification
        From `identify`, with the objective "log".
    values : mapping of str to float
        Values by name, in SI units, within the bounds of the fit.
    starts : int, optional
        Number of starts of the others: the fitted values, then a Latin hypercube within the bounds, without errors.

    Raises
    ------
    TypeError, ValueError
        A parameter that was not identified, a value outside its bounds, or the percentage objective, which is no
        likelihood.

    Examples
    --------
    >>> from receptance import STEEL, Assembly, MeasuredFrequencies, Part, PointJoint, Segment, Unknown, identify
    >>> from receptance.identification import constrained_fit
    >>> bar = Segment(length=0.1, outer_diameter=0.02, material=STEEL)
    >>> pair = Assembly([Part([bar], name="tool"), PointJoint(k_y=1e8, k_theta=1e5), Part([bar], name="holder")])
    >>> modes = MeasuredFrequencies(
    ...     assembly=pair, frequency_hz=pair.natural_frequencies(2e4)[:3], standard_deviation_hz=2.0
    ... )
    >>> found = identify(modes, Unknown(address="joint.k_theta", lower=1e3, upper=1e7))
    >>> [constrained_fit(found, {"joint.k_theta": k}).rejected() for k in (1.001e5, 1.1e5)]
    [False, True]
    """
    if not values:
        raise ValueError("values is empty, expected at least one parameter and its value")
    require_likelihood(found)
    problem = found.task.problem()
    variables = problem.variables
    given = found.vector.copy()
    free = np.ones(given.size, dtype=np.bool_)
    for name, value in values.items():
        index = found.index(name)
        unknown = variables.unknowns[index]
        number = _checks.number("constrained_fit", name, value)
        if not unknown.lower <= number <= unknown.upper:
            raise ValueError(
                f"constrained_fit: {name} is {number:g}, outside the bounds {unknown.lower:g} to {unknown.upper:g}"
            )
        given[index] = np.log10(number) if unknown.scale == "log" else number
        free[index] = False
    best = problem.fit_one(found.vector, least=1e-9)
    variance = residual_variance(found, best.cost)
    # Errors start at their fitted values.
    drawn = free & (np.arange(given.size) < found.task.parameters.count)
    begun = [given, *(np.where(drawn, x, given) for x in variables.draw(max(starts, 1), found.seed)[1:])]
    end = min(problem.fit(np.array(begun), free=free, least=COST_TOLERANCE), key=lambda one: one.cost)
    rise = 2.0 * (end.cost - best.cost) / variance if np.isfinite(end.cost) and variance > 0.0 else np.inf
    if rise < -_BETTER:
        text = "the constrained fit found a better optimum than the fit: identify with more starts"
        warnings.warn(text, ReceptanceWarning, stacklevel=2)
    rise = max(float(rise), 0.0)
    others = variables.to_values(end.x)
    return ConstrainedFit(
        values={name: float(value) for name, value in values.items()},
        others={name: float(others[i]) for i, name in enumerate(found.addresses) if free[i]},
        rise=rise,
        p_value=_p_value(rise, len(values), None if found.known_scatter else found.degrees_of_freedom),
    )


def _p_value(rise: float, count: int, degrees_of_freedom: int | None) -> float:
    if np.isinf(rise):
        return 0.0
    if degrees_of_freedom is None:
        return float(chi_square_chance(rise, count))
    from scipy.special import fdtrc  # the light part of scipy.stats

    return float(fdtrc(count, max(degrees_of_freedom, 1), rise / count))


def log_evidence(found: Identification) -> float:
    """Return the natural logarithm of the evidence, by Laplace's approximation at the fit.

    It compares models, such as laws, that are fitted to the same observations with the same standard deviations;
    factors that depend on these alone are omitted. The prior of an unknown without one is uniform within its bounds,
    on the scale of the fit; errors and individual parts are standard normal. A difference of 3 is a factor of 20 in
    probability, a difference of 10 is decisive.

    Parameters
    ----------
    found : Identification
        From `identify` with known standard deviations and the objective "log".

    Returns
    -------
    float
        NaN if the data do not determine a parameter: the approximation needs a peak of the likelihood.

    Raises
    ------
    ValueError
        No standard deviations, or the percentage objective.

    Examples
    --------
    >>> from receptance import STEEL, Assembly, MeasuredFrequencies, Part, PointJoint, Segment, Unknown, identify
    >>> from receptance.identification import Law, Power, log_evidence
    >>> bar = Segment(length=0.1, outer_diameter=0.02, material=STEEL)
    >>> pair = Assembly([Part([bar], name="tool"), PointJoint(k_y=1e8, k_theta=1e5), Part([bar], name="holder")])
    >>> measured = [
    ...     MeasuredFrequencies(
    ...         assembly=pair,
    ...         frequency_hz=pair.replace({"joint.k_theta": k}).natural_frequencies(2e4)[:2],
    ...         standard_deviation_hz=1.0,
    ...         configuration=f"{torque} N m",
    ...         conditions={"torque": torque},
    ...     )
    ...     for torque, k in ((40.0, 0.9e5), (80.0, 1.2e5))
    ... ]
    >>> grows = Power(of="torque", reference=40.0)
    >>> laws = [Law(address="joint.k_theta", lower=1e3, upper=1e7, powers=powers) for powers in ((), grows)]
    >>> constant, power = (log_evidence(identify(measured, law)) for law in laws)
    >>> power > constant + 10.0
    True
    """
    if not found.known_scatter:
        raise ValueError("evidence needs standard deviations: give the observations them, and the objective 'log'")
    problem = found.task.problem()
    residual = problem.residual(found.vector)
    # A factor on the standard deviations divides the density of each independent number.
    total = -0.5 * float(residual @ residual) - found.task.independent_values * math.log(found.noise_factor)
    low, high = problem.variables.limits
    for i, unknown in enumerate(found.unknowns):
        if unknown.prior is None:
            total -= math.log(float(high[i] - low[i]))
        else:
            # A prior on a log scale is one of the natural logarithm, and the variable is the decimal one.
            deviation = unknown.prior.standard_deviation / (math.log(10.0) if unknown.scale == "log" else 1.0)
            total -= 0.5 * math.log(2.0 * math.pi) + math.log(deviation)
    if not np.isfinite(found.covariance).all():
        return float("nan")
    sign, logarithm = np.linalg.slogdet(found.covariance)
    if sign <= 0.0:
        return float("nan")
    return total + 0.5 * len(found.unknowns) * math.log(2.0 * math.pi) + 0.5 * float(logarithm)
