"""Evidence of a model: how likely the data were under it before they were seen, to compare laws with each other."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from receptance.identification.result import Identification

__all__ = ["log_evidence"]

_BASE = math.log(10.0)


def log_evidence(found: Identification) -> float:
    """Return the natural logarithm of the evidence, by Laplace's approximation at the fit.

    What is compared must be fits of the same observations with the same standard deviations: what depends on these
    alone is left out. Unknowns without a prior are flat over their bounds, on the scale of the fit; errors and
    individual parts are standard normal. A difference of 3 is a factor of 20 in probability, one of 10 settles it.

    Parameters
    ----------
    found : Identification
        From `identify` with known standard deviations and the objective "log".

    Returns
    -------
    float
        Not a number where the data do not determine a parameter: there the fit is no peak.

    Raises
    ------
    ValueError
        No standard deviations were given, or the percentage objective was used.

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
    x = problem.variables.from_values(np.array(list(found.values.values())))
    residual = problem.residual(x)
    # Standard deviations that the fit has multiplied by a factor make the density of the data lower by as much.
    total = -0.5 * float(residual @ residual) - sum(found.task.independent_numbers()) * math.log(found.noise_factor)
    low, high = problem.variables.limits
    for i, unknown in enumerate(found.unknowns):
        if unknown.prior is None:
            total -= math.log(float(high[i] - low[i]))
        else:
            # A prior on a log scale is of the natural logarithm, and the variable is the decimal one.
            spread = unknown.prior.standard_deviation / (_BASE if unknown.scale == "log" else 1.0)
            total -= 0.5 * math.log(2.0 * math.pi) + math.log(spread)
    if not np.isfinite(found.covariance).all():
        return float("nan")
    sign, logarithm = np.linalg.slogdet(found.covariance)
    if sign <= 0.0:
        return float("nan")
    return total + 0.5 * len(found.unknowns) * math.log(2.0 * math.pi) + 0.5 * float(logarithm)
