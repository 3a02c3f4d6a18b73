"""Improvement by an explanation on held-out configurations, by cross-validation or on separate measurements."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from receptance._peaks import nearest_peak
from receptance.diagnosis.by_mode import Bias, ModeResidual, bias_of, curve_of, modes_of, slenderness_of
from receptance.diagnosis.causes import parameters_of, transfer
from receptance.diagnosis.discrepancy_search import use_own_discrepancies
from receptance.diagnosis.explanation import Explanation, Selection, behind_limit, best_of_each
from receptance.diagnosis.fitting import Fit, refit
from receptance.diagnosis.judgement import Answer, Judgement, conclude, is_of_some, only_improved
from receptance.diagnosis.model import IndescribableError, Model
from receptance.diagnosis.progress import Progress, in_parallel
from receptance.diagnosis.text import Reason
from receptance.diagnosis.thresholds import EVALUATIONS_OF_PREDICTION, FOLDS
from receptance.errors import ReceptanceError
from receptance.fit.covariance import confidence_multiplier
from receptance.fit.observation import Observation
from receptance.fit.predictor import PredictedData, Predictor
from receptance.fit.problem import CONVERGED, InfeasibleError
from receptance.model.assembly import Assembly

FREQUENCIES = "natural frequencies, rms error in percent"
SPECTRAL = "log-spectral distance, rms of ln(measured / calculated)"
SCORE = "predictive log score in nats"


@dataclass(frozen=True, kw_only=True)
class Gain:
    """Improvement by the extended model on held-out data."""

    metric: str
    """Name of the metric."""
    held_out_before: float
    """The metric over all folds: root mean square of errors, mean of scores and user-defined metrics."""
    held_out_after: float
    """The same of the extended model."""
    interval: tuple[float, float]
    """95 % interval of the improvement, positive where the extended model is better; infinite where one configuration
    was held out, zero where no cause was added."""
    folds: tuple[dict[str, Any], ...] = ()
    """By configuration: verdict and causes without it, and the metric before and after."""
    better: int = 0
    """Number of folds in which it improves the prediction."""
    units: int = 0
    """Number of units that the interval rests on."""
    unit: str = "folds"
    """What they are: modes, records, or whole folds."""
    correlation: float = 0.0
    """Correlation of their improvements within a fold, from 0 to 1."""


@dataclass(frozen=True, kw_only=True)
class Improvement:
    """Improvement by the extended model on held-out data, in all metrics."""

    gains: tuple[Gain, ...] = ()
    """By metric, that of the quantity that was measured most first."""
    singles: Mapping[str, float] = field(default_factory=dict)
    """First metric with one cause alone, by id, whatever the verdict; of natural frequencies that the model without and
    that with this cause have."""
    modes: tuple[ModeResidual, ...] = ()
    """Held-out modes before, predicted less measured."""
    modes_after: tuple[ModeResidual, ...] = ()
    """The same of the extended model."""
    bias: Bias | None = None
    """Held-out natural frequencies in which the errors before have a common sign."""
    complete: bool = True
    """Whether all folds were completed."""


@dataclass(frozen=True, eq=False)
class HeldOut:
    """A held-out observation and its prediction: the argument of a user-defined metric."""

    observation: Observation
    """The measurement."""
    assembly: Assembly
    """The predicted structure as measured, a sensor's mass included."""
    receptance: NDArray[np.complex128] | None
    """`(n,)` prediction on the lines of an observation, measuring chain included; None for natural frequencies."""


Metric = Callable[[HeldOut], float]
"""An error of a prediction: smaller is better; NaN where it does not apply to an observation."""


def predictor_of(fit: Fit) -> Predictor:
    """Return the predictor of a fit, from its end point and the normal matrix there."""
    values = np.array(list(fit.values.values()))
    return Predictor(fit.task.parameters, values, root=fit.curvature_root, threads=fit.model.threads)


def predicted_data(fit: Fit, model: Model) -> PredictedData:
    """Return the data of the observations of a model, with its tolerances as their errors, by a fit.

    The observations have errors of their own, those of a new clamping for example, which only they determine. The
    residuals of a prediction are those with these errors fitted; its score is that of a fit of all variables.
    """
    return predictor_of(fit).of(model.observations, [model.tolerances] * len(model.observations))


Units = Mapping[str, "NDArray[np.float64]"]
"""Metrics of a prediction in the units that err independently, `(u, 2)` each: sums and numbers of values.

The values are squared errors of lines, in the units of the modes of each record, and of natural frequencies, each of
them a unit; scores, of which a fold is one unit; and user-defined metrics, of which an observation is a unit.
"""
UNIT = {SPECTRAL: "modes", FREQUENCIES: "modes", SCORE: "folds"}
"""Names of these units; those of user-defined metrics are records."""


@dataclass(frozen=True)
class _Fold:
    """Metrics of one held-out configuration, before and after."""

    configuration: str
    verdict: str
    causes: tuple[str, ...]
    before: Units
    after: Units
    singles: Units = field(default_factory=dict)
    modes: tuple[ModeResidual, ...] = ()
    modes_after: tuple[ModeResidual, ...] = ()


def cross_validate(
    selection: Selection,
    *,
    metrics: Mapping[str, Metric] | None = None,
    progress: Progress | None = None,
) -> Improvement:
    """Return the improvement on configurations that are left out in turn, with the choice of the causes repeated.

    Where there are more configurations than folds, several are left out together. A KeyboardInterrupt ends it with the
    completed folds.

    Parameters
    ----------
    selection : Selection
        The fits to all configurations.
    metrics : mapping of str to callable, optional
        User-defined metrics.
    progress : Progress, optional
        Reports each fold.
    """
    model = selection.base.model
    names, count = model.configurations, count_folds(model)
    report = progress or Progress()
    report.plan("held out", count)
    folds: list[_Fold] = []
    complete = True
    for group in (names[i::count] for i in range(count)):
        name = ", ".join(group)
        try:
            report("held out", f"held out: {name}")
            fold = select_without(selection, group)
        except (ValueError, ReceptanceError) as error:
            folds.append(_Fold(name, f"not fitted: {error}", (), {}, {}))
            continue
        except KeyboardInterrupt:
            complete = False
            break
        judgement = conclude(fold)
        best = judgement.reported[0] if judgement.reported else None
        held_out = replace(fold.base.model, observations=model.of(group), tolerances=model.tolerances)
        folds.append(_fold(name, judgement.answer, fold, best, held_out, metrics))
    return replace(_combine(folds, model, metrics), complete=complete)


def select_without(selection: Selection, configurations: Sequence[str]) -> Selection:
    """Return the selection without some configurations.

    The base and every explanation that is close to the best one on the other configurations are fitted to these,
    from the values of the fit to all, and so are the single causes whose own improvement is measured. An
    explanation is close by the rule that decides which explanations are fitted on all lines. Variants of causes,
    threshold and directions are those of the whole selection. `tests/validation/folds.py` compares the answers and
    the improvement with a complete selection for each fold.
    """
    base = refit(selection.base.model.without(configurations), selection.base.values)
    found = replace(
        selection,
        base=base,
        # Errors of modes are counted in all configurations.
        penalty=selection.penalty if selection.beside is not None else math.log(max(base.independent_values, 2.0)),
        explanations=[],
        tried=[],
        alternatives=[],
    )
    every = best_of_each([*selection.explanations, *selection.tried])
    remaining = {one: _on_others(one.fit, configurations) - one.expected for one in every}
    limit = behind_limit(_on_others(selection.base, configurations), remaining.values())
    singles = selection.held_out_singles
    chosen = [one for one in every if remaining[one] <= limit or one in singles]
    # One that is far behind on the other configurations does not compete in any of them.
    alternatives = [one for one in selection.alternatives if _on_others(one.fit, configurations) <= limit]
    both = [*chosen, *alternatives]
    fits = list(in_parallel([partial(_refit, found, one, configurations) for one in both], selection.workers))
    found.add(*(fit for fit in fits[: len(chosen)] if fit is not None))
    found.alternatives += [fit for fit in fits[len(chosen) :] if fit is not None]
    found.alternatives.sort(key=lambda one: -one.evidence)
    if selection.beside is not None:
        use_own_discrepancies(found, selection.beside, configurations)
    return found


def _on_others(fit: Fit, configurations: Sequence[str]) -> float:
    """Return chi-square without the residuals of some configurations."""
    own = fit.by_configuration
    return fit.chi_square - sum(own.get(name, 0.0) for name in configurations)


def _refit(selection: Selection, one: Explanation, configurations: Sequence[str]) -> Explanation | None:
    """Return an explanation fitted without some configurations; None where it acts in these alone."""
    model = one.fit.model.without(configurations)
    if not parameters_of(model.unknowns).keys() >= one.parameters.keys():
        return None
    try:
        return selection.explain(one.variants, refit(model, one.fit.values))
    except ReceptanceError:
        return None


def count_folds(model: Model) -> int:
    """Return the number of folds; zero for a model with one configuration."""
    count = len(model.configurations)
    return min(count, FOLDS) if count > 1 else 0


def improvement_on(
    selection: Selection,
    best: Explanation | None,
    held_out: Model,
    metrics: Mapping[str, Metric] | None = None,
) -> Improvement:
    """Return the improvement by an explanation on the observations of a base model, which were not fitted."""
    answer = conclude(selection).answer
    each = {name: replace(held_out, observations=held_out.of([name])) for name in held_out.configurations}
    folds = [_fold(name, answer, selection, best, own, metrics) for name, own in each.items()]
    return _combine(folds, held_out, metrics)


def _fold(
    name: str,
    answer: str,
    selection: Selection,
    best: Explanation | None,
    held_out: Model,
    metrics: Mapping[str, Metric] | None,
) -> _Fold:
    before, modes = _measure(selection.base, held_out, metrics)
    after, modes_after = before, modes
    if best is not None:
        after, modes_after = _measure_with(best, held_out, metrics)
    first = _names(held_out)[0]
    singles = {}
    for held_out_single in selection.held_out_singles:
        found, _ = _measure_with(held_out_single, held_out, scored=False)
        singles[held_out_single.variants[0].cause.id] = found.get(first, np.empty((0, 2)))
    causes = () if best is None else tuple(sorted(best.ids))
    return _Fold(name, answer, causes, before, after, singles, modes, modes_after)


def _measure_with(
    one: Explanation, base: Model, metrics: Mapping[str, Metric] | None = None, *, scored: bool = True
) -> tuple[Units, tuple[ModeResidual, ...]]:
    """Return the metrics with an explanation; none where its causes cannot be described for the held-out data."""
    try:
        return _measure(one.fit, transfer(base, one.variants), metrics, scored=scored)
    except IndescribableError:
        return {}, ()


def metrics_of(
    fit: Fit, model: Model, metrics: Mapping[str, Metric] | None = None, *, scored: bool = True
) -> tuple[dict[str, float], tuple[ModeResidual, ...]]:
    """Return each metric of a prediction of the observations of a model with the causes of a fit, and their modes.

    Errors that only these observations have are fitted to them with their tolerances, before and after alike.
    """
    units, modes = _measure(fit, model, metrics, scored=scored)
    return {name: _value(name, own) for name, own in units.items()}, modes


def _measure(
    fit: Fit, model: Model, metrics: Mapping[str, Metric] | None = None, *, scored: bool = True
) -> tuple[Units, tuple[ModeResidual, ...]]:
    """Return the units of each metric, and the modes; see `metrics_of`."""
    data = predicted_data(fit, model)
    try:
        end = data.fit(EVALUATIONS_OF_PREDICTION, CONVERGED)
        if not np.isfinite(end.cost):
            return {}, ()
        residuals, assemblies, score = data.residuals(end), data.assemblies(end.x), math.nan
        if scored and all(one.weighted for one in model.observations):
            score = data.log_score(data.fit(EVALUATIONS_OF_PREDICTION, CONVERGED, all_variables=True))
    except InfeasibleError:
        return {}, ()
    modes: list[ModeResidual] = []
    rows: dict[str, list[tuple[float, int]]] = {name: [] for name in (FREQUENCIES, SPECTRAL, SCORE, *(metrics or {}))}
    for one, residual, assembly in zip(model.observations, residuals, assemblies, strict=True):
        curve = curve_of(one, residual)
        own = modes_of(one, curve)
        modes += own
        rows[FREQUENCIES] += [_row(mode.frequency_percent**2) for mode in own]
        receptance = None
        if one.is_receptance:
            receptance = np.asarray(curve.modelled, dtype=np.complex128)
            squares = np.square(np.abs(np.log(one.receptance / receptance)))
            rows[SPECTRAL] += _by_mode(curve.frequency_hz, squares, [mode.measured_hz for mode in own])
        for name, metric in (metrics or {}).items():
            rows[name].append(_row(float(metric(HeldOut(one, assembly, receptance)))))
    rows[SCORE].append(_row(score))
    return {name: np.array(row, dtype=np.float64).reshape(-1, 2) for name, row in rows.items()}, tuple(modes)


def _row(value: float) -> tuple[float, int]:
    return (value, 1) if math.isfinite(value) else (0.0, 0)


def _by_mode(
    lines: NDArray[np.float64], values: NDArray[np.float64], peaks_hz: Sequence[float]
) -> list[tuple[float, int]]:
    """Return sums and numbers of the values on the lines next to each peak."""
    peaks = np.sort(np.array(peaks_hz, dtype=np.float64))
    number, least = nearest_peak(lines, peaks), max(peaks.size, 1)
    sums, counts = np.bincount(number, values, least), np.bincount(number, minlength=least)
    return list(zip(sums.tolist(), counts.tolist(), strict=True))


def _value(metric: str, *folds: NDArray[np.float64]) -> float:
    """Return a metric of the units of folds: mean, or root mean square of errors, with equal weight of each fold.

    NaN where a fold has no value.
    """
    if not all(units[:, 1].any() for units in folds):
        return math.nan
    return _pooled(metric, np.concatenate([_weighted(units) for units in folds]))


def _weighted(units: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return units with weights instead of numbers of values; those of a fold add up to one."""
    weighted: NDArray[np.float64] = units / units[:, 1].sum()
    return weighted


def _pooled(metric: str, units: NDArray[np.float64]) -> float:
    total, weight = units.sum(axis=0)
    mean = float(total / weight)
    return math.sqrt(mean) if metric in (FREQUENCIES, SPECTRAL) else mean


def _names(model: Model) -> list[str]:
    """Return the names of the metrics, that of the quantity that was measured most first."""
    return [SPECTRAL, FREQUENCIES, SCORE] if model.receptances else [FREQUENCIES, SCORE]


def _combine(folds: Sequence[_Fold], model: Model, metrics: Mapping[str, Metric] | None) -> Improvement:
    """Return the improvement over all folds."""
    names = _names(model)
    gains = [gain_of(name, folds) for name in (*names, *(metrics or ()))]
    singles = {}
    for id in dict.fromkeys(id for fold in folds for id in fold.singles):
        # In a fold without evidence for a cause the base predicts.
        own = [fold.singles.get(id, fold.before.get(names[0], np.empty((0, 2)))) for fold in folds]
        gain = gain_of(names[0], [replace(fold, after={names[0]: x}) for fold, x in zip(folds, own, strict=True)])
        if gain is not None:
            singles[id] = gain.held_out_after
    modes = tuple(mode for fold in folds for mode in fold.modes)
    return Improvement(
        gains=tuple(one for one in gains if one is not None),
        singles=singles,
        modes=modes,
        modes_after=tuple(mode for one in folds for mode in one.modes_after),
        bias=bias_of(modes, slenderness_of(model)),
    )


def gain_of(metric: str, folds: Sequence[_Fold]) -> Gain | None:
    """Return a metric before and after, and the 95 % interval of the improvement; None where no fold has both.

    Both are of the same units: a mode that one of the predictions does not have is left out.
    """
    none = np.empty((0, 2))
    pairs = [_in_both(fold.before.get(metric, none), fold.after.get(metric, none)) for fold in folds]
    ends = [(_value(metric, before), _value(metric, after)) for before, after in pairs]
    used = [pair for pair, values in zip(pairs, ends, strict=True) if np.isfinite(values).all()]
    if not used:
        return None
    sign = -1.0 if metric == SCORE else 1.0
    before, after = (_value(metric, *(pair[i] for pair in used)) for i in (0, 1))
    interval, count, correlation = _interval(metric, used)
    low, high = sorted(sign * end for end in interval)
    return Gain(
        metric=metric,
        held_out_before=before,
        held_out_after=after,
        interval=(low, high),
        units=count,
        unit=UNIT.get(metric, "records"),
        correlation=correlation,
        better=sum(sign * (b - a) > 0.0 for b, a in ends),
        folds=tuple(
            {
                "configuration": fold.configuration,
                "verdict": fold.verdict,
                "causes": list(fold.causes),
                "before": before,
                "after": after,
            }
            for fold, (before, after) in zip(folds, ends, strict=True)
        ),
    )


def _in_both(
    before: NDArray[np.float64], after: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the units of a fold that have a value before and after.

    A change of the data may change the number of their peaks: the fold is then one unit.
    """
    if not len(before) or not len(after):
        return before[:0], after[:0]
    if len(before) != len(after):
        before, after = (units.sum(axis=0, keepdims=True) for units in (before, after))
    both = (before[:, 1] > 0.0) & (after[:, 1] > 0.0)
    return before[both], after[both]


def _interval(
    metric: str, folds: Sequence[tuple[NDArray[np.float64], NDArray[np.float64]]]
) -> tuple[tuple[float, float], int, float]:
    """Return the 95 % interval of before less after, the number of units, and their correlation within a fold.

    Jackknife over the units. Units of one fold share its fit, so that the variance of the mean of N independent units
    is multiplied by the design effect 1 + (m - 1) rho, with m units in a fold and the intraclass correlation rho of
    their differences. The number of effective units, N over the design effect, gives the degrees of freedom, which are
    at least those of the folds. The interval of a single fold is infinite: it does not show the scatter between folds.
    `tests/validation/improvement_interval.py` measures the coverage.

    Parameters
    ----------
    metric : str
        The metric.
    folds : sequence of (ndarray, ndarray)
        Units of each fold, before and after.
    """
    numbers = np.repeat(np.arange(len(folds)), [len(before) for before, _ in folds])
    count = numbers.size
    if all(np.array_equal(before, after) for before, after in folds):
        return (0.0, 0.0), count, 0.0
    if np.unique(numbers).size < 2:
        return (-math.inf, math.inf), count, 0.0
    tables = [np.concatenate([_weighted(pair[i]) for pair in folds]) for i in (0, 1)]

    def difference(left_out: int | None = None) -> float:
        before, after = (t if left_out is None else np.delete(t, left_out, axis=0) for t in tables)
        return _pooled(metric, before) - _pooled(metric, after)

    # Without one unit its fold has less weight, so that the numbers differ between the folds as the folds do.
    pseudo = count * difference() - (count - 1) * np.array([difference(unit) for unit in range(count)])
    values = [pseudo[numbers == number] for number in np.unique(numbers)]
    variance, correlation, size = _correlated_variance(values)
    effect = 1.0 + (size - 1.0) * correlation
    freedom = max(count / effect, len(values)) - 1.0
    half_width = confidence_multiplier(0.95, freedom) * math.sqrt(variance * effect / count)
    middle = float(np.mean(pseudo))
    return (middle - half_width, middle + half_width), count, correlation


def _correlated_variance(groups: Sequence[NDArray[np.float64]]) -> tuple[float, float, float]:
    """Return variance and intraclass correlation of numbers in groups, and the number in a group.

    They follow from the mean squares between and within the groups (analysis of variance, random effects). The
    correlation is zero or more; groups of one number have none.
    """
    sizes = np.array([len(group) for group in groups], dtype=np.float64)
    total, count = float(sizes.sum()), len(groups)
    means = np.array([np.mean(group) for group in groups])
    middle = float(sizes @ means) / total
    between = float(sizes @ (means - middle) ** 2) / (count - 1)
    if total == count:
        return between, 0.0, 1.0
    within = sum(float(np.sum((group - mean) ** 2)) for group, mean in zip(groups, means, strict=True))
    within /= total - count
    size = (total - float(sizes @ sizes) / total) / (count - 1)
    shared = max(between - within, 0.0) / size
    variance = shared + within
    return variance, shared / variance if variance > 0.0 else 0.0, size


def doubted(judgement: Judgement, base: Fit, improvement: Improvement) -> Judgement:
    """Return a judgement, doubted where held-out data contradict its only explanation.

    What was named is then suspected, and what was partly explained is unexplained. Folds that are not complete show
    nothing.
    """
    if judgement.answer not in ("named", "partly explained") or not improvement.complete or not improvement.gains:
        return judgement
    doubt = doubt_prediction(base, judgement.reported[0], improvement.gains[0])
    if doubt is None:
        return judgement
    answer: Answer = "suspected" if judgement.answer == "named" else "unexplained"
    return replace(judgement, answer=answer, reasons=(*judgement.reasons, doubt))


def doubt_prediction(base: Fit, explanation: Explanation, gain: Gain) -> Reason | None:
    """Return why held-out data contradict the only explanation; None where they do not.

    Causes that act in all configurations must improve the prediction of those that are left out. One that acts in a
    single configuration cannot: without it nothing shows the cause, and the others do not have it. `gain` is the first
    metric of the improvement, an error.
    """
    if (
        gain.held_out_after < gain.held_out_before
        or is_of_some(base, explanation)
        or only_improved(base, explanation) is not None
    ):
        return None
    if all(fold["before"] == fold["after"] for fold in gain.folds):
        return Reason("not_predicted", {"title": explanation.title})
    values = {"metric": gain.metric, "before": gain.held_out_before, "after": gain.held_out_after}
    return Reason("not_better", {"title": explanation.title, **values})
