"""Identification: the least-squares fit of parameters to all observations together, and its result with advice."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Literal, TypedDict

import numpy as np
from numpy.typing import NDArray
from scipy import special

from receptance import _checks
from receptance._text import first_of
from receptance.errors import ReceptanceError, warn_user
from receptance.fit.adequacy import Adequacy, adequacy_of, misfit_limit, strain_of, times
from receptance.fit.covariance import covariance_of, variance_factor
from receptance.fit.discrepancy import Discrepancy
from receptance.fit.discrepancy_fit import EVALUATIONS, DiscrepancyFit, expected_chi_square, fit_discrepancy, sufficient
from receptance.fit.observation import Observation, Unit, as_observations
from receptance.fit.parameters import Parameters
from receptance.fit.peaks import check_bands
from receptance.fit.problem import CONVERGED, End, Problem, Task
from receptance.fit.result import Identification
from receptance.fit.search import Start, fit_direct, fit_staged
from receptance.fit.spindle_errors import has_spindle_errors, with_spindle_errors
from receptance.fit.unknowns import Tolerance, Unknowns, Variables, as_unknowns
from receptance.report import Provenance, Rejection

Objective = Literal["log", "percentage"]
Noise = Literal["judged", "stated"]
Strategy = Literal["direct", "staged"]


class FitKeywords(TypedDict, total=False):
    """Options of `identify` that other functions pass on; their meaning is described there."""

    objective: Objective
    bands: Sequence[tuple[float, float]] | None
    band_width_percent: float
    starts: int
    max_evaluations: int
    tolerance: float
    threads: int | None
    strategy: Strategy
    noise: Noise


_SMOOTHING_PERCENT = 0.1
"""The cost is the absolute value of percentages well above this, and the square of those below."""
_TIED = 0.99
"""Least correlation of two parameters that are reported as tied."""
_AT_BOUND = 1e-3
"""Largest distance from a bound, as a share of the range, of a variable that is reported at its bound."""
_SAME = 0.2
"""Ends that differ by less than this many standard errors are one optimum."""
_SMALL_PROBABILITY = 1e-3
"""Standard deviations are reported as too large below this probability of so small a chi-square."""
_RESTARTS = 2
"""Largest number of restarts from the end of a fit that allows for a discrepancy."""
_AS_GOOD = 1e-3
"""Relative difference of the cost up to which two ends fit as well as each other."""
_OVERFIT = 0.5
"""Residuals are reported as too small below this rms, in standard deviations."""


def identify(
    observations: Observation | Sequence[Observation],
    unknowns: Unknowns,
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
    noise: Noise = "judged",
) -> Identification:
    """Identify parameters of assemblies from measured receptances and natural frequencies.

    All observations form one least-squares problem. An unknown is shared by every observation whose assembly has its
    address. The fit uses analytic derivatives and a trust-region method within bounds. It runs from several starts, and
    the best end is the result.

    Parameters
    ----------
    observations : sequence of Observation
        The measurements, of one or several assemblies.
    unknowns : sequence of Unknown and Law, or mapping of str to bounds
        The parameters to identify, with bounds; a `Law` relates the values in several configurations. A dictionary has
        by address a lower and an upper bound, with the start as an optional third number, or a dictionary with
        arguments of `Unknown`.
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
        As in `Assembly.receptance`; for predictions of the result as well.
    tolerances : sequence of Tolerance, optional
        Errors of dimensions and materials, which are fitted as well, each with its prior.
    strategy : {"direct", "staged"}, optional
        "direct": the problem is fitted from every start.

        "staged": continuation. Every start, and additional drawn ones, are refined by a sequence of easier problems:
        peaks as natural frequencies, then data and model with added damping that is reduced step by step, then the
        problem itself. It finds the global optimum from starts that are decades off, and one start is usually enough.
        Only with the objective "log".
    noise : {"judged", "stated"}, optional
        "judged": with standard deviations, the fit is tested as `receptance.diagnosis.diagnose` does: residuals, sums
        of neighbouring ones, and the errors of the tolerances, see `Identification.adequacy`. Where the model is not
        adequate, the fit is repeated with the discrepancy of the model in the likelihood, so that data that contradict
        the model do not overrule the tolerances: values, covariance and all predictions are those of this fit.

        "stated": the standard deviations are used as they are, and intervals of a model that is not adequate are too
        narrow. Fits whose evidence is compared must have this noise, see `log_evidence`.

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
    >>> from receptance.fit import Observation, Unknown, identify
    >>> tool = Part([Segment(length=0.0623, outer_diameter=0.0127, material=CARBIDE)], name="tool")
    >>> holder = Part([Segment(length=0.129, outer_diameter=0.045, material=STEEL)], name="holder")
    >>> true = Assembly([tool, PointJoint(k_y=6.3e8, k_theta=1.0e5, name="joint"), holder])
    >>> measured = Observation.from_modes(assembly=true, frequency_hz=true.natural_frequencies(15e3)[:2])
    >>> found = identify(measured, [
    ...     Unknown(address="joint.k_y", lower=1e7, upper=1e10),
    ...     Unknown(address="joint.k_theta", lower=1e3, upper=1e7),
    ... ])
    >>> {address: f"{value:.4g}" for address, value in found.values.items()}
    {'joint.k_y': '6.3e+08', 'joint.k_theta': '1e+05'}

    The same with a dictionary of bounds:

    >>> again = identify(measured, {"joint.k_y": (1e7, 1e10), "joint.k_theta": (1e3, 1e7)})
    >>> again.values == found.values
    True
    """
    observed = as_observations(observations)
    sites = [observation.site(i) for i, observation in enumerate(observed)]
    parameters = Parameters(as_unknowns(unknowns), tolerances, sites)
    _checks.one_of("", "objective", objective, Objective)
    _checks.one_of("", "noise", noise, Noise)
    _checks.one_of("", "strategy", strategy, Strategy)
    if strategy == "staged" and objective != "log":
        raise ValueError('the strategy "staged" is for the objective "log"')
    for name, count, least in (("starts", starts, 1), ("seed", seed, 0), ("max_evaluations", max_evaluations, 1)):
        _checks.whole_number("identify", name, count, least=least)
    _checks.positive("identify", "tolerance", tolerance)
    _checks.thread_count(threads)
    chosen = None if bands is None else check_bands(bands)
    units = _units(observed, objective)
    if "standard deviations" not in units and any(unknown.prior is not None for unknown in parameters.unknowns):
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
    notes = [note for observation in observed for note in observation.notes]
    notes += [*parameters.notes, *_weight_notes(observed, units, objective)]

    def fit(task: Task, problem: Problem) -> Identification:
        if strategy == "staged":
            runs = fit_staged(task, problem, starts, seed, max_evaluations, tolerance)
        else:
            easier = None if smoothing is None else task.approach()
            runs = fit_direct(problem, task.variables.draw(starts, seed), max_evaluations, tolerance, easier)
        if not np.isfinite(min(run.cost for run in runs)):
            raise ReceptanceError(
                f"the model has no value at any of the {starts} starts; at the first: {runs[0].message}"
            )
        return conclude(task, problem, runs, loss=smoothing, seed=seed, notes=list(notes))

    result = fit(task, problem)
    if objective == "log" and all(unit == "standard deviations" for unit in units) and has_spindle_errors(observed):
        # The errors of a measured spindle act through the joint, which the first fit knows.
        observed, errors = with_spindle_errors(observed, result.assemblies)
        notes += [] if errors is None else [str(errors)]
        task = replace(task, observed=observed)
        result = fit(task, task.problem())
    return result if noise == "stated" else _judged(result, tolerance)


def _judged(fit: Identification, tolerance: float) -> Identification:
    """Return a fit with an adequate model, or the fit repeated with the discrepancy of its model.

    Few data reject no model, and say as little against an error of a few times the noise: where their misfit is above
    that of an adequate model with many data, predictions allow for it. Fits that allow for a discrepancy have fewer
    local minima: the fit without it is tried again from their end.
    """
    for _ in range(_RESTARTS + 1):
        if fit.adequacy is None or not fit.adequacy.needs_discrepancy:
            return fit
        task = fit.task.resonant
        try:
            widened = fit_discrepancy(task, fit.vector)
        except ReceptanceError:
            return fit
        problem = fit.task.problem()
        end = problem.fit_one(widened.end.x, EVALUATIONS, tolerance=tolerance, least=CONVERGED)
        if not end.cost < (1.0 - _AS_GOOD) * min(run.cost for run in fit.starts):
            break
        runs = [*fit.starts, _start_of(problem, fit, end)]
        fit = conclude(fit.task, problem, runs, loss=None, seed=fit.seed, notes=list(fit.notes))
    return _discrepancy_search(fit, task, widened)


def _discrepancy_search(fit: Identification, task: Task, widened: DiscrepancyFit) -> Identification:
    """Return the fit repeated with a discrepancy that is sufficient."""
    with suppress(ReceptanceError):
        widened = sufficient(task, widened)
    notes = [*fit.notes, *_discrepancy_notes(fit.adequacy, widened.discrepancy)]
    problem = widened.task.problem()
    run = _start_of(problem, fit, widened.end)
    again = conclude(
        widened.task, problem, [run], loss=None, seed=fit.seed, notes=notes, adequacy=fit.adequacy, searched=fit.starts
    )
    return replace(again, starts=fit.starts)


def _discrepancy_notes(adequacy: Adequacy | None, discrepancy: Discrepancy) -> list[str]:
    """Return notes on why a fit that is not rejected allows for a discrepancy, and what this does not include."""
    notes = []
    if adequacy is not None and adequacy.passed:
        notes.append(
            f"residuals are {times(adequacy.misfit)} times the noise, and the data are too few to tell whether the "
            f"model is wrong: intervals allow for an error of the model of {discrepancy}"
        )
    if discrepancy.relative is None:
        notes.append(
            "only natural frequencies were measured, so the error of the model in the level of FRFs is unknown, and "
            "bands of FRFs and depths of cut do not include it: measure an FRF"
        )
    return notes


def _start_of(problem: Problem, fit: Identification, end: End) -> Start:
    """Return a fit that began at the values of another one."""
    return Start(
        start=fit.values,
        values=problem.named(end.x),
        variables=end.x,
        cost=end.cost,
        evaluations=end.evaluations,
        converged=end.converged,
        message=end.message,
    )


def _units(observed: Sequence[Observation], objective: Objective) -> list[Unit]:
    """Return the unit of the residuals of each observation."""
    if objective == "percentage":
        return ["percent"] * len(observed)
    weighted = [observation.weighted for observation in observed]
    if any(weighted) and not all(weighted):
        with_, without = observed[weighted.index(True)], observed[weighted.index(False)]
        raise ValueError(
            f"{with_!r} has a standard deviation but {without!r} has none, so their weights are unknown; give all "
            "observations one, or none"
        )
    if all(weighted):
        return ["standard deviations"] * len(observed)
    units: list[Unit] = [observation.unit for observation in observed]
    return ["percent"] * len(units) if set(units) == {"relative"} else units


def _weight_notes(observed: Sequence[Observation], units: list[Unit], objective: Objective) -> list[str]:
    notes = []
    if objective == "percentage" and any(observation.weighted for observation in observed):
        notes.append("the percentage objective does not use the standard deviations that were given")
    if "relative" in units:
        notes.append(
            "receptances and natural frequencies have no standard deviations: 1 % of a frequency weighs as much as 1 % "
            "of the receptance on one line; give standard deviations to weigh them by their precision"
        )
        warn_user(notes[-1])
    return notes


def conclude(
    task: Task,
    problem: Problem,
    runs: Sequence[Start],
    *,
    loss: float | None,
    seed: int,
    notes: list[str],
    adequacy: Adequacy | None = None,
    searched: Sequence[Start] | None = None,
) -> Identification:
    """Return the result of the best run.

    `adequacy` is that of the fit with the stated standard deviations where this one allows for a discrepancy, and
    `searched` are the starts of that fit.
    """
    variables, observed = problem.variables, task.observed
    weighted, bounded = "standard deviations" in task.units, has_spindle_errors(observed)
    count = len(variables.unknowns)
    best = min(runs, key=lambda run: run.cost)
    root = problem.curvature_root(best.variables)
    inverse, correlation = covariance_of(root)
    residual = problem.value(best.variables)
    if weighted and adequacy is None:
        adequacy = adequacy_of(task, residual, root)
    factor = 1.0 if weighted else variance_factor(residual, count, loss)
    # Infinite elements stay infinite if the factor is zero.
    covariance = np.full_like(inverse, np.inf)
    if np.isfinite(factor):
        np.multiply(inverse, factor, out=covariance, where=np.isfinite(inverse))
    values = np.array([best.values[name] for name in variables.names])
    errors = np.sqrt(np.diag(covariance)) * variables.slopes(values)
    # Residuals are reported on all lines, in the stated standard deviations.
    stated = problem if task.discrepancy is None else task.stated.problem()
    parts = stated.parts(residual if stated is problem else stated.value(best.variables))
    tried = runs if searched is None else searched
    first = min(tried, key=lambda run: run.cost)
    same, elsewhere = _count_optima(tried, first, variables, residual.size, np.sqrt(np.diag(covariance)))
    if not weighted and residual.size == count:
        notes.append(
            "there are as many unknowns as observed numbers, so the scatter cannot be estimated and the standard "
            "errors are infinite: give the observations standard deviations"
        )
    lost = [run for run in runs if not np.isfinite(run.cost)]
    if lost:
        notes.append(f"the model has no value at {len(lost)} of {len(runs)} starts; at the first: {lost[0].message}")
    bounds = _bound_advice(best.variables, variables, task.parameters.errors)
    rejection = _rejection(adequacy, task, problem, best)
    if rejection:
        # Of an accepted fit, data may limit a value from one side only.
        kind = "unusable" if rejection.unusable else "widened"
        rejection += Rejection(**{kind: tuple(bounds)})
        bounds = []
    return Identification(
        values=dict(best.values),
        standard_errors=dict(zip(variables.names, errors.tolist(), strict=True)),
        covariance=covariance,
        correlation=correlation,
        residuals=parts,
        converged=best.converged,
        adequacy=adequacy,
        rejection=rejection,
        advice=[
            *rejection,
            # Beside the errors of a spindle, which are an upper bound, residuals are smaller than expected.
            *(
                _overfit_advice(parts, task.independent_values, count)
                if weighted and not (rejection or bounded)
                else ()
            ),
            *_start_advice(tried, same, elsewhere),
            *bounds,
            *_covariance_advice(inverse, correlation, variables.names),
            *_copy_advice(observed),
        ],
        notes=notes,
        starts=tuple(runs),
        agreeing=same,
        seed=seed,
        task=task,
        provenance=Provenance(seed=seed),
    )


def restart(fit: Identification, better: End) -> Identification:
    """Return a fit with the objective "log" that ends at a better optimum of its problem.

    Values, covariance, residuals and advice are those of the better optimum, which is one more start.
    """
    problem = fit.task.problem()
    run = _start_of(problem, fit, better)
    is_stated = fit.task.discrepancy is None
    notes = [*fit.notes, "a profile led to a better optimum, from which the fit was restarted"]
    again = conclude(
        fit.task,
        problem,
        [*fit.starts, run] if is_stated else [run],
        loss=None,
        seed=fit.seed,
        notes=notes,
        adequacy=None if is_stated else fit.adequacy,
    )
    return replace(
        again, notes=list(dict.fromkeys(again.notes)), series=fit.series, groups=fit.groups, provenance=fit.provenance
    )


def _count_optima(
    runs: Sequence[Start], best: Start, variables: Variables, size: int, deviation: NDArray[np.float64]
) -> tuple[int, int]:
    """Count the runs that reached the best optimum, and equally good ones that ended at another."""
    low, high = variables.limits
    # Along a flat valley ends differ by a small part of the standard errors.
    tolerance = np.maximum(_AT_BOUND * (high - low), np.where(np.isfinite(deviation), _SAME * deviation, 0.0))
    good = best.cost * (1.0 + _AS_GOOD) + 1e-12 * size
    as_good = [run for run in runs if run.cost <= good]
    same = [run for run in as_good if np.all(np.abs(run.variables - best.variables) <= tolerance)]
    return len(same), len(as_good) - len(same)


def _convergence(best: Start) -> tuple[str, ...]:
    """Return the reason of a fit that has not converged."""
    if best.converged:
        return ()
    return (
        f"not converged after {best.evaluations} evaluations ({best.message.rstrip('.')}): raise max_evaluations, give "
        "a better start, or narrow the bounds",
    )


def _start_advice(runs: Sequence[Start], same: int, elsewhere: int) -> list[str]:
    advice = []
    if elsewhere:
        advice.append(
            f"{elsewhere} start(s) fit as well with other values: the data do not distinguish them; fix a parameter or "
            "measure another assembly"
        )
    if len(runs) > 1 and same == 1 and not elsewhere:
        advice.append(
            f"only 1 of {len(runs)} starts reached the best optimum, so a better one may exist: raise starts, or "
            "narrow the bounds"
        )
    return advice


def _bound_advice(x: NDArray[np.float64], variables: Variables, errors: Sequence[str]) -> list[str]:
    low, high = variables.limits
    advice = []
    at_bound: list[str] = []
    extreme: list[str] = []
    for i, unknown in enumerate(variables.unknowns):
        near = _AT_BOUND * (high[i] - low[i])
        if unknown.name in errors:
            extreme += [unknown.name] if min(x[i] - low[i], high[i] - x[i]) <= near else []
            continue
        sides = (("lower", unknown.lower, x[i] - low[i]), ("upper", unknown.upper, high[i] - x[i]))
        at_bound += [
            f"{unknown.name} is at its {side} bound {bound:g}" for side, bound, distance in sides if distance <= near
        ]
    if at_bound:
        advice.append(
            f"{first_of(at_bound)}: widen the bound, unless the data limit the parameter from one side only; its "
            "interval is not valid there"
        )
    if extreme:
        limit = variables.unknowns[variables.names.index(extreme[0])].upper
        advice.append(
            f"{first_of(extreme)}: {limit:g} standard deviations off, the limit of the fit: the tolerances are too "
            "small, a dimension is wrong, or the model is incomplete"
        )
    return advice


def _covariance_advice(
    inverse: NDArray[np.float64], correlation: NDArray[np.float64], names: tuple[str, ...]
) -> list[str]:
    advice = []
    if undetermined := [name for name, variance in zip(names, np.diag(inverse), strict=True) if np.isinf(variance)]:
        advice.append(
            f"the data do not determine {first_of(undetermined)}: fix it, or measure something that depends on it"
        )
    pairs = [(i, j) for i in range(len(names)) for j in range(i) if abs(correlation[i, j]) > _TIED]
    strongest = sorted(pairs, key=lambda pair: -abs(correlation[pair]))
    if tied := [f"{names[j]} and {names[i]} are tied (correlation {correlation[i, j]:+.4f})" for i, j in strongest]:
        advice.append(
            f"{first_of(tied)}: the data determine a combination of the two; fix one, or measure another overhang or "
            "mode"
        )
    return advice


_DIAGNOSE = "Next step: `receptance diagnose`, which tests the model and names the cause"


def _rejection(adequacy: Adequacy | None, task: Task, problem: Problem, best: Start) -> Rejection:
    """Return why a fit is rejected: the model is not adequate, or the fit has not converged."""
    unusable = _convergence(best)
    if adequacy is None or adequacy.passed:
        return Rejection(unusable)
    model = f"the model {adequacy.shortcoming}: it is incomplete, or standard deviations or tolerances are too small"
    if task.discrepancy is None:
        text = f"{model}. The intervals are those of the stated standard deviations, and are too narrow. {_DIAGNOSE}"
        return Rejection((*unusable, text))
    strain = strain_of(task, problem.value(best.variables), problem.curvature_root(best.variables))
    expected = expected_chi_square(task)
    if strain.at_stop or 2.0 * best.cost > expected * misfit_limit(expected):
        text = f"{model}. No error of the model that can be estimated explains that. {_DIAGNOSE}"
        return Rejection((*unusable, text))
    text = (
        f"{model}. Values and intervals are those of a fit that allows for an error of the model of "
        f"{task.discrepancy}. {_DIAGNOSE}"
    )
    return Rejection(unusable, (text,))


def _overfit_advice(residuals: Sequence[NDArray[np.float64]], independent: float, fitted: int) -> list[str]:
    """Return advice on a chi-square far below its expectation."""
    chi_square = _sum_of_squares(residuals)
    # Every fitted number uses one degree of freedom, errors of tolerances included.
    left = independent - fitted
    small = left > 0.0 and chi_square < left * _OVERFIT**2
    if small and 1.0 - special.chdtrc(left, chi_square) < _SMALL_PROBABILITY:
        share = float(np.sqrt(chi_square / left))
        return [
            f"the rms of the residuals is only {share:.2g} standard deviations, expected about 1: the standard "
            "deviations are too large (a percentage for a share, or a limit for a standard deviation?), and the "
            "standard errors are too large as well; or the data have no noise"
        ]
    return []


def _sum_of_squares(residuals: Sequence[NDArray[np.float64]]) -> float:
    return sum(float(np.sum(part**2)) for part in residuals)


def _comparable(observation: Observation, other: Observation) -> bool:
    # Two structures may have the same natural frequencies to the digits that are written.
    if observation.is_receptance:
        return True
    return observation.assembly is other.assembly or bool(
        observation.configuration and observation.configuration == other.configuration
    )


def _copy_advice(observed: Sequence[Observation]) -> list[str]:
    """Return advice on observations with the same numbers, which noise would make different."""
    copies = []
    names = [observation.title(i) for i, observation in enumerate(observed)]
    pairs = [
        (i, j)
        for i in range(len(observed))
        for j in range(i)
        if type(observed[i]) is type(observed[j]) and _comparable(observed[i], observed[j])
    ]
    # Sorting can take longer than a fit, so only comparable observations are sorted.
    values = {
        i: np.unique(observation.data) for i, observation in enumerate(observed) if any(i in pair for pair in pairs)
    }
    for i, j in pairs:
        same = np.intersect1d(values[i], values[j], assume_unique=True).size
        least = min(values[i].size, values[j].size)
        if same > 0.5 * least:
            copies.append(f"{names[j]} and {names[i]} have the same numbers ({same} of {least})")
    if not copies:
        return []
    return [
        f"{first_of(copies)}: a measurement that counts twice makes the standard errors too small; leave one of them "
        "out"
    ]
