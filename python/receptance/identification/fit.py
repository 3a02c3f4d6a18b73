"""Identification: the least-squares fit of parameters to all observations together."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from receptance import _checks
from receptance.errors import ReceptanceError, ReceptanceWarning
from receptance.identification.conclusion import conclude, contradicts
from receptance.identification.laws import Tolerance
from receptance.identification.mapping import Parameters
from receptance.identification.observations import MeasuredFRF
from receptance.identification.peaks import check_bands
from receptance.identification.result import Identification
from receptance.identification.search import fit_direct, fit_staged
from receptance.identification.task import Observation, Task, place_of
from receptance.identification.unknowns import Unknown

if TYPE_CHECKING:
    from receptance.identification.problem import Problem
    from receptance.identification.residuals import Unit

__all__ = ["identify"]

Objective = Literal["log", "percentage"]
Strategy = Literal["direct", "staged"]
Noise = Literal["scaled", "stated"]
_START_TOLERANCE = 1e-4
"""Tolerance of the fit of logarithms that gives the starts of percentages."""
_SMOOTHING_PERCENT = 0.1
"""The cost is the absolute value of percentages well above this, and the square of those below."""
_MAX_RESCALINGS = 10
"""Largest number of fits with rescaled standard deviations."""
_CHI_SQUARE_TOLERANCE = 0.05
"""Relative tolerance of chi-square after rescaling."""
_MAX_SLOPE = -0.3
"""Largest slope of log chi-square over the log of the factor in a secant step."""


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
    noise: Noise = "scaled",
) -> Identification:
    """Identify parameters of assemblies from measured receptances and natural frequencies.

    All observations form one least-squares problem. An unknown is shared by every observation whose assembly has its
    address. The fit uses analytic derivatives and a trust-region method within bounds. It runs from several starts, and
    the best end is the result.

    Parameters
    ----------
    observations : sequence of MeasuredFRF and MeasuredFrequencies
        The measurements, of one or several assemblies.
    unknowns : sequence of Unknown and Law
        The parameters to identify, with bounds; a `Law` relates the values in several configurations.
    objective : {"log", "percentage"}, optional
        "log": sum of squares of the complex logarithm of measured over calculated receptance, real and imaginary part,
        and of natural frequencies, calculated minus measured. Residuals are in standard deviations if these are given;
        otherwise natural frequencies are in percent.

        "percentage": sum of the absolute percentage differences between the magnitudes of calculated and measured
        receptance in bands around several resonances (Matthias et al. 2016, fig. 3), and of natural frequencies. The
        cost is smoothed at zero: it is the absolute value of residuals well above 0.1 % and the square of smaller ones.
        Standard deviations and phases are not used.
    bands : sequence of (float, float), optional
        Bands in Hz of the lines that are used, the same for all receptances. The default is all lines with "log", and
        bands around the peaks of each measurement with "percentage", see `find_bands`.
    band_width_percent : float, optional
        Half width of the bands that are found, in percent of the peak's frequency.
    starts : int, optional
        Number of starts: the given one, then a Latin hypercube within the bounds on the scale of the fit.
    seed : int, optional
        Seed of the drawn starts.
    max_evaluations : int, optional
        Largest number of evaluations from one start.
    tolerance : float, optional
        Relative change of the cost and of the variables at which a fit has converged.
    threads : int, optional
        As in `Assembly.receptance`.
    tolerances : sequence of Tolerance, optional
        Errors of dimensions and materials, which are fitted as well, each with its prior.
    strategy : {"direct", "staged"}, optional
        "direct": the problem is fitted from every start.

        "staged": continuation. Every start, and additional drawn ones, are refined by a sequence of easier problems:
        peaks as natural frequencies, then data and model with added damping that is reduced step by step, then the
        problem itself. It finds the global optimum from starts that are decades off, and one start is usually enough.
        Only with the objective "log".
    noise : {"scaled", "stated"}, optional
        "scaled": with tolerances or individual parts, chi-square (priors included) is compared with its distribution.
        If it is significantly large at the 1 % level, the model or the standard deviations are wrong. Then all standard
        deviations are multiplied by one factor that brings chi-square to its expectation (Paule and Mandel 1982), so
        that data that contradict the model do not overrule the tolerances.

        "stated": the standard deviations are used as they are. Fits whose evidence is compared must have the same
        noise, see `log_evidence`.

    Returns
    -------
    Identification
        Values with their uncertainty, residuals, the ends of all starts, convergence and advice.

    Raises
    ------
    TypeError, ValueError
        Invalid observations, unknowns or settings; more unknowns than observed numbers and priors; standard deviations
        for only some observations, or for none with priors or tolerances.
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
    if noise not in get_args(Noise):
        raise ValueError(f"noise is {noise!r}, expected one of {', '.join(get_args(Noise))}")
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
            "priors and tolerances can only be weighed against observations with standard deviations: give all "
            'observations one, and the objective "log"'
        )
    task = Task(observed, parameters, tuple(units), chosen, band_width_percent, threads)
    smoothing = _SMOOTHING_PERCENT if objective == "percentage" else None
    variables, problem = task.variables, task.problem(smoothing=smoothing)
    free = sum(unknown.prior is None for unknown in variables.unknowns)
    count = problem.size - (len(variables.unknowns) - free)
    if count < free:
        raise ValueError(f"there are {free} unknowns but only {count} observed numbers; measure more or fix some")
    notes = [note for observation in observed for note in getattr(observation, "notes", ())]
    notes += [*parameters.notes, *_weight_notes(observed, units, objective)]

    x = variables.draw(starts, seed)

    def fit(task: Task, problem: Problem) -> Identification:
        if strategy == "staged":
            runs = fit_staged(task, problem, x, seed, max_evaluations, tolerance)
        else:
            ends = None if smoothing is None else task.approach().fit(x, max_evaluations, tolerance=_START_TOLERANCE)
            runs = fit_direct(problem, x, max_evaluations, tolerance, ends)
        if not np.isfinite(min(run.cost for run in runs)):
            raise ReceptanceError(
                f"the model has no value at any of the {len(x)} starts; at the first: {runs[0].message}"
            )
        return conclude(task, problem, runs, loss=smoothing, seed=seed, notes=list(notes))

    found = fit(task, problem)
    # The priors of fitted errors are residuals, so chi-square has as many degrees of freedom as there are independent
    # numbers minus unknowns without a prior.
    left = sum(task.independent_numbers()) - free
    if noise == "stated" or not parameters.errors or not contradicts(_chi_square(found), left):
        return found
    # Secant steps for the logarithm of chi-square over that of the factor.
    factor, slope = 1.0, -2.0
    for _ in range(_MAX_RESCALINGS):
        ratio = _chi_square(found) / left
        if abs(ratio - 1.0) < _CHI_SQUARE_TOLERANCE:
            break
        last = (factor, ratio)
        factor = max(factor * ratio ** (-1.0 / slope), 1.0)
        rescaled = task.noisier(factor)
        found = fit(rescaled, rescaled.problem(smoothing=smoothing))
        if factor != last[0]:
            slope = math.log(max(_chi_square(found) / left, 1e-9) / last[1]) / math.log(factor / last[0])
            slope = min(max(slope, -2.0), _MAX_SLOPE)
    return found


def _chi_square(found: Identification) -> float:
    """Return the sum of squares of residuals and priors at the best end."""
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
    """Return the unit of the residuals of each observation."""
    if objective == "percentage":
        return ["percent"] * len(observed)
    known = [observation.weighted for observation in observed]
    if any(known) and not all(known):
        with_, without = observed[known.index(True)], observed[known.index(False)]
        raise ValueError(
            f"{with_!r} has a standard deviation but {without!r} has none, so their weights are unknown; give all "
            "observations one, or none"
        )
    if all(known):
        return ["standard deviations"] * len(observed)
    kinds = {type(observation) for observation in observed}
    frequencies: Unit = "percent" if len(kinds) == 1 else "relative"
    return ["logarithm" if isinstance(observation, MeasuredFRF) else frequencies for observation in observed]


def _weight_notes(observed: Sequence[Observation], units: list[Unit], objective: Objective) -> list[str]:
    notes = []
    if objective == "percentage" and any(observation.weighted for observation in observed):
        notes.append("the percentage objective does not use the standard deviations that were given")
    if "relative" in units:
        notes.append(
            "receptances and natural frequencies have no standard deviations: 1 % of a frequency weighs as much as 1 % "
            "of the receptance on one line; give standard deviations to weigh them by their precision"
        )
        warnings.warn(notes[-1], ReceptanceWarning, stacklevel=3)
    return notes


def _whole(name: str, value: Any, least: int) -> None:
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < least:
        raise ValueError(f"{name} is {value!r}, expected a whole number of at least {least}")
