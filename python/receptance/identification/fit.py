"""Identification: the least-squares fit of parameters to all observations together."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from receptance import _checks
from receptance.errors import ReceptanceError, ReceptanceWarning
from receptance.identification.bands import check_bands
from receptance.identification.conclusion import conclude, contradicts
from receptance.identification.laws import Tolerance
from receptance.identification.mapping import Parameters
from receptance.identification.observations import MeasuredFRF
from receptance.identification.result import Identification
from receptance.identification.search import fit_direct, fit_staged
from receptance.identification.task import Observation, Task, place_of
from receptance.identification.unknowns import Unknown

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.identification.problem import Problem
    from receptance.identification.residuals import Unit

__all__ = ["identify"]

Objective = Literal["log", "percentage"]
Strategy = Literal["direct", "staged"]
_APPROACH = 1e-4
"""Tolerance of the fit of logarithms that begins a fit of percentages."""
_SMOOTHING_PERCENT = 0.1
"""Percentages well above this count by their absolute value, those below by their square."""
_REWEIGHTINGS = 10
"""Most fits with another size of the noise."""
_SETTLED = 0.05
"""Chi-square this near its expectation, as a share, ends them."""
_LEAST_SLOPE = -0.3
"""Flattest slope of log chi-square over the log of the factor that a step is taken from."""


def identify(
    observations: Observation | Sequence[Observation],
    unknowns: Unknown | Sequence[Unknown],
    *,
    objective: Objective = "log",
    bands: Sequence[tuple[float, float]] | None = None,
    band_width_percent: float = 5.0,
    starts: int = 8,
    seed: int = 0,
    max_evaluations: int = 200,
    tolerance: float = 1e-10,
    threads: int | None = None,
    tolerances: Tolerance | Sequence[Tolerance] = (),
    strategy: Strategy = "direct",
) -> Identification:
    """Identify parameters of assemblies from what was measured on them.

    One least-squares problem over all observations: an unknown is shared by every observation whose assembly has
    its address. The fit runs from several starts on analytic derivatives, with the trust-region reflective method
    (Branch, Coleman and Li 1999), and the best end is kept.

    Parameters
    ----------
    observations : sequence of MeasuredFRF and MeasuredFrequencies
        What was measured; kinds and assemblies may be mixed.
    unknowns : sequence of Unknown and Law
        The parameters to identify, with bounds; a `Law` ties one across configurations.
    objective : {"log", "percentage"}, optional
        "log": the complex logarithm of measured over calculated receptance, real and imaginary part, and natural
        frequencies calculated minus measured; in standard deviations where these are given, else natural
        frequencies in percent. Sum of squares.

        "percentage": the absolute percentage difference between the magnitudes of calculated and measured
        receptance in bands around several resonances (Matthias et al. 2016, fig. 3), and natural frequencies in
        percent. The sum of absolute values is not smooth where a residual is zero, so it is smoothed: a residual well
        above 0.1 % counts by its absolute value, one below by its square. Standard deviations are not
        used, phases neither.
    bands : sequence of (float, float), optional
        Bands in Hz, the same for all receptances; only lines inside count. By default all lines with "log", and
        with "percentage" bands around each measurement's own peaks, see `find_bands`.
    band_width_percent : float, optional
        How far the bands that are found reach to either side of their peak.
    starts : int, optional
        Number of starts: first the given one, then a Latin hypercube within the bounds on the scale of the fit.
    seed : int, optional
        Seed of the starts that are drawn.
    max_evaluations : int, optional
        Most evaluations from one start.
    tolerance : float, optional
        Relative change of the cost and of the variables at which a fit has converged.
    threads : int, optional
        As in `Assembly.receptance`.
    tolerances : sequence of Tolerance, optional
        Errors of dimensions and materials, fitted as well, each with its prior. Where chi-square, priors included, is
        then larger than chance makes it in one of a hundred cases, the model or the standard deviations are wrong;
        these are multiplied by one factor that brings it to its expectation, so that such data do not overrule the
        tolerances.
    strategy : {"direct", "staged"}, optional
        "direct": every start goes straight into the problem.

        "staged": every start, and some drawn besides it, is led to it by way of easier problems: peaks as natural
        frequencies, then data and model with added damping that is taken down step by step, then the problem itself.
        It finds the best optimum from starts that are decades off, and one start is usually enough. Only with the
        objective "log".

    Returns
    -------
    Identification
        Values with their uncertainty, residuals, every start's end, whether it converged and what to try if not.

    Raises
    ------
    TypeError, ValueError
        Unusable observations, unknowns or settings; more unknowns than observed numbers and priors;
        standard deviations for some observations and not for others, or for none where there are
        priors or tolerances.
    ReceptanceError
        The model has no value at any of the starts.

    Examples
    --------
    >>> from receptance import CARBIDE, STEEL, Assembly, Part, PointJoint, Segment
    >>> from receptance.identification import MeasuredFrequencies, Unknown, identify
    >>> tool = Part([Segment(length=0.0623, outer_diameter=0.0127, material=CARBIDE)], name="tool")
    >>> holder = Part([Segment(length=0.129, outer_diameter=0.045, material=STEEL)], name="holder")
    >>> true = Assembly([tool, PointJoint(k_y=6.3e8, k_theta=1.0e5, name="joint"), holder])
    >>> measured = MeasuredFrequencies(assembly=true, frequency_hz=true.natural_frequencies(15e3)[:2])
    >>> found = identify(measured, [
    ...     Unknown(address="joint.k_y", lower=1e7, upper=1e10),
    ...     Unknown(address="joint.k_theta", lower=1e3, upper=1e7),
    ... ])
    >>> {address: f"{value:.4g}" for address, value in found.values.items()}
    {'joint.k_y': '6.3e+08', 'joint.k_theta': '1e+05'}
    """
    observed = _observed(observations)
    wanted = (unknowns,) if isinstance(unknowns, Unknown) else tuple(unknowns)
    errors = (tolerances,) if isinstance(tolerances, Tolerance) else tuple(tolerances)
    if not wanted:
        raise ValueError("unknowns is empty, expected at least one Unknown")
    parameters = Parameters(wanted, errors, [place_of(one, i) for i, one in enumerate(observed)])
    if objective not in get_args(Objective):
        raise ValueError(f"objective is {objective!r}, expected one of {', '.join(get_args(Objective))}")
    if strategy not in get_args(Strategy):
        raise ValueError(f"strategy is {strategy!r}, expected one of {', '.join(get_args(Strategy))}")
    if strategy == "staged" and objective != "log":
        raise ValueError('the strategy "staged" is for the objective "log"')
    _whole("starts", starts, 1)
    _whole("seed", seed, 0)
    _whole("max_evaluations", max_evaluations, 1)
    _checks.positive("identify", "tolerance", tolerance)
    _checks.thread_count(threads)
    chosen = None if bands is None else check_bands(bands)
    units = _units(observed, objective)
    known = "standard deviations" in units
    if not known and any(unknown.prior is not None for unknown in parameters.unknowns):
        raise ValueError(
            "priors and tolerances can only be weighed against observations whose standard deviations are used: give "
            'all observations one, and the objective "log"'
        )
    task = Task(observed, parameters, tuple(units), chosen, band_width_percent, threads)
    smoothing = _SMOOTHING_PERCENT if objective == "percentage" else None
    variables, problem = task.variables, task.problem(smoothing=smoothing)
    free = sum(unknown.prior is None for unknown in variables.unknowns)
    seen = problem.size - (len(variables.unknowns) - free)
    if seen < free:
        raise ValueError(f"there are {free} unknowns but only {seen} observed numbers; measure more or fix some")
    notes = [note for observation in observed for note in getattr(observation, "notes", ())]
    notes += [*parameters.notes, *_on_weights(observed, units, objective)]

    def fitted(task: Task, problem: Problem, x: NDArray[np.float64]) -> Identification:
        if strategy == "staged":
            runs = fit_staged(task, problem, x, seed, max_evaluations, tolerance)
        else:
            begun = task.approach().fit(x, max_evaluations, tolerance=_APPROACH) if smoothing is not None else None
            runs = fit_direct(problem, x, max_evaluations, tolerance, begun)
        if not np.isfinite(min(run.cost for run in runs)):
            raise ReceptanceError(
                f"the model has no value at any of the {len(x)} starts; at the first: {runs[0].message}"
            )
        return conclude(task, problem, runs, loss=smoothing, seed=seed, notes=list(notes))

    x = variables.draw(starts, seed)
    found = fitted(task, problem, x)
    if not parameters.errors:
        return found
    # Errors that are fitted take up what they can, so chi-square with their priors has as many degrees of freedom as
    # there are numbers less unknowns without a prior. Data that contradict the model must not overrule tolerances:
    # one factor of their standard deviations brings chi-square to its expectation (Paule and Mandel 1982).
    left = sum(task.independent_numbers()) - free
    if not contradicts(_chi_square(found), left):
        return found
    factor, slope = 1.0, -2.0
    for _ in range(_REWEIGHTINGS):
        ratio = _chi_square(found) / left
        if abs(ratio - 1.0) < _SETTLED:
            break
        last = (factor, ratio)
        factor = max(factor * ratio ** (-1.0 / slope), 1.0)
        noisier = task.noisier(factor)
        found = fitted(noisier, noisier.problem(smoothing=smoothing), x)
        if factor != last[0]:
            slope = math.log(max(_chi_square(found) / left, 1e-9) / last[1]) / math.log(factor / last[0])
            slope = min(max(slope, -2.0), _LEAST_SLOPE)
    return found


def _chi_square(found: Identification) -> float:
    """Return the sum of squares of residuals and priors where the fit ended."""
    return 2.0 * min(run.cost for run in found.starts)


def _observed(observations: Observation | Sequence[Observation]) -> tuple[Observation, ...]:
    found = (observations,) if isinstance(observations, Observation) else tuple(observations)
    if not found:
        raise ValueError("observations is empty, expected at least one MeasuredFRF or MeasuredFrequencies")
    for index, observation in enumerate(found):
        if not isinstance(observation, Observation):
            raise TypeError(f"observations[{index}] is {observation!r}, expected a MeasuredFRF or MeasuredFrequencies")
    return found


def _units(observed: Sequence[Observation], objective: Objective) -> list[Unit]:
    """Return what a residual of 1 is to mean for each observation, so that they can be weighed against each other."""
    if objective == "percentage":
        return ["percent"] * len(observed)
    known = [observation.weighted for observation in observed]
    if any(known) and not all(known):
        with_, without = observed[known.index(True)], observed[known.index(False)]
        raise ValueError(
            f"{with_!r} has a standard deviation but {without!r} has none, so they cannot be weighed against each "
            "other; give all observations one, or none"
        )
    if all(known):
        return ["standard deviations"] * len(observed)
    kinds = {type(observation) for observation in observed}
    lonely: Unit = "percent" if len(kinds) == 1 else "relative"
    return ["logarithm" if isinstance(observation, MeasuredFRF) else lonely for observation in observed]


def _on_weights(observed: Sequence[Observation], units: list[Unit], objective: Objective) -> list[str]:
    notes = []
    if objective == "percentage" and any(observation.weighted for observation in observed):
        notes.append("the percentage objective does not use the standard deviations that were given")
    if "relative" in units:
        notes.append(
            "receptances and natural frequencies without standard deviations: 1 % of a frequency weighs as much as 1 % "
            "of the receptance on one line; give standard deviations to weigh them by what is known"
        )
        warnings.warn(notes[-1], ReceptanceWarning, stacklevel=3)
    return notes


def _whole(name: str, value: Any, least: int) -> None:
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < least:
        raise ValueError(f"{name} is {value!r}, expected a whole number of at least {least}")
