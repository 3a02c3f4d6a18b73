"""Given values against the data: how much worse the best fit with them is, and whether the data reject them."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from receptance import _checks
from receptance.errors import ReceptanceWarning
from receptance.identification.observations import MeasuredFRF

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.identification.result import Identification

__all__ = ["Held", "hold"]

_LEAST = 1e-6
"""Decrease of the cost that is not worth another step."""
_BETTER = 0.01
"""Fall of -2 log L below that of the fit beyond which the fit was not the best one."""


@dataclass(frozen=True, kw_only=True)
class Held:
    """The best fit with some parameters at given values.

    Attributes
    ----------
    values : dict of str to float
        The given values in SI units.
    others : dict of str to float
        Everything else, fitted again.
    rise : float
        Rise of -2 log L over the unrestricted fit; infinite where the model has no value with them.
    p_value : float
        Probability of so large a rise if the given values were the true ones (Wilks 1938; F where the scatter
        was estimated).
    """

    values: dict[str, float]
    others: dict[str, float]
    rise: float
    p_value: float

    def rejected(self, level: float = 0.95) -> bool:
        """Whether the data reject the values at a level."""
        return self.p_value < 1.0 - level

    def __repr__(self) -> str:
        given = ", ".join(f"{name}={value:.4g}" for name, value in self.values.items())
        return f"Held({given}: rise {self.rise:.3g}, p = {self.p_value:.2g})"


def hold(found: Identification, values: Mapping[str, float], *, starts: int = 8) -> Held:
    """Fit everything else again with some parameters at given values, and compare with the fit.

    Where a profile holds one parameter, this holds several at once, so it answers whether a whole set of them can be
    right. Errors of tolerances move along within their priors.

    Parameters
    ----------
    found : Identification
        From `identify`, with the objective "log".
    values : mapping of str to float
        By name, in SI units, within the bounds of the fit.
    starts : int, optional
        Starts for the rest: the fitted values, then a Latin hypercube within the bounds for all but errors.

    Raises
    ------
    TypeError, ValueError
        A parameter that was not identified, a value outside its bounds, or the percentage objective, which is no
        likelihood.

    Examples
    --------
    >>> from receptance import STEEL, Assembly, MeasuredFrequencies, Part, PointJoint, Segment, Unknown, identify
    >>> from receptance.identification import hold
    >>> bar = Segment(length=0.1, outer_diameter=0.02, material=STEEL)
    >>> pair = Assembly([Part([bar], name="tool"), PointJoint(k_y=1e8, k_theta=1e5), Part([bar], name="holder")])
    >>> modes = MeasuredFrequencies(
    ...     assembly=pair, frequency_hz=pair.natural_frequencies(2e4)[:3], standard_deviation_hz=2.0
    ... )
    >>> found = identify(modes, Unknown(address="joint.k_theta", lower=1e3, upper=1e7))
    >>> [hold(found, {"joint.k_theta": k}).rejected() for k in (1.001e5, 1.1e5)]
    [False, True]
    """
    if not values:
        raise ValueError("values is empty, expected at least one parameter and its value")
    if any(
        u == "percent" and isinstance(o, MeasuredFRF) for u, o in zip(found.units, found.task.observed, strict=True)
    ):
        raise ValueError("the percentage objective is no likelihood: identify with the objective 'log'")
    problem = found.task.problem()
    variables = problem.variables
    best_x = variables.from_values(np.array(list(found.values.values())))
    given = best_x.copy()
    free = np.ones(best_x.size, dtype=np.bool_)
    for name, value in values.items():
        if name not in found.values:
            raise ValueError(f"{name!r} was not identified, only {', '.join(found.addresses)}")
        index = found.addresses.index(name)
        unknown = variables.unknowns[index]
        number = _checks.number("hold", name, value)
        if not unknown.lower <= number <= unknown.upper:
            raise ValueError(
                f"hold: {name} is {number:g}, outside the bounds {unknown.lower:g} to {unknown.upper:g} of the fit"
            )
        given[index] = np.log10(number) if unknown.scale == "log" else number
        free[index] = False
    best = problem.fit_one(best_x, least=1e-9)
    scatter = 1.0 if found.known_scatter else 2.0 * best.cost / max(found.degrees_of_freedom, 1)
    ends = problem.fit(np.array(_begin(found, given, free, starts)), free=free, least=_LEAST)
    end = min(ends, key=lambda one: one.cost)
    rise = 2.0 * (end.cost - best.cost) / scatter if np.isfinite(end.cost) and scatter > 0.0 else np.inf
    if rise < -_BETTER:
        text = "with values held a better optimum than that of the fit was found: identify with more starts"
        warnings.warn(text, ReceptanceWarning, stacklevel=2)
    others = variables.to_values(end.x)
    return Held(
        values={name: float(value) for name, value in values.items()},
        others={name: float(others[i]) for i, name in enumerate(found.addresses) if free[i]},
        rise=max(float(rise), 0.0),
        p_value=_p_value(max(float(rise), 0.0), len(values), None if found.known_scatter else found.degrees_of_freedom),
    )


def _begin(
    found: Identification, given: NDArray[np.float64], free: NDArray[np.bool_], starts: int
) -> list[NDArray[np.float64]]:
    """Return starts: the fitted values, then drawn ones; errors begin at the fitted ones."""
    begun = [given]
    drawn = found.task.variables.draw(max(starts, 1), found.seed)[1:]
    moving = free & (np.arange(given.size) < found.task.parameters.count)
    for x in drawn:
        begun.append(np.where(moving, x, given))
    return begun


def _p_value(rise: float, count: int, degrees_of_freedom: int | None) -> float:
    from scipy.special import chdtrc, fdtrc  # the light part of scipy.stats

    if np.isinf(rise):
        return 0.0
    if degrees_of_freedom is None:
        return float(chdtrc(count, rise))
    return float(fdtrc(count, max(degrees_of_freedom, 1), rise / count))
