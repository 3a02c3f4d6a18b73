"""Improvement by an explanation on held-out configurations, by cross-validation or on separate measurements."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import zip_longest
from typing import Any

import numpy as np
from numpy.typing import NDArray

from receptance._peaks import nearest_peak
from receptance.diagnosis.by_mode import Bias, Curve, ModeResidual, bias_of, curve_of, modes_of, slenderness_of
from receptance.diagnosis.causes import parameters_of, transfer
from receptance.diagnosis.discrepancy_search import use_own_discrepancies
from receptance.diagnosis.explanation import Explanation, Selection, behind_limit, best_of_each
from receptance.diagnosis.fitting import Fit, refit
from receptance.diagnosis.judgement import Answer, Judgement, conclude, is_of_some, only_improved
from receptance.diagnosis.model import IndescribableError, Model
from receptance.diagnosis.prediction import predicted_data
from receptance.diagnosis.progress import Progress, in_parallel
from receptance.diagnosis.text import Reason
from receptance.diagnosis.thresholds import EVALUATIONS, FOLDS
from receptance.errors import ReceptanceError
from receptance.fit.covariance import confidence_multiplier
from receptance.fit.observation import Observation
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
    curves: tuple[tuple[Curve, Curve | None], ...] = ()
    """Held-out receptances, predicted by the base and by the extended model; None without a cause."""
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


Units = Mapping[str, "NDArray[np.float64]"]
"""Metrics of a prediction in the units that err independently, `(u, 2)` each: sums and numbers of values.

The values are squared errors of lines, in the units of the modes of each record, and of natural frequencies, each of
them a unit; scores, of which a fold is one unit; and user-defined metrics, of which an observation is a unit.
"""
UNIT = {SPECTRAL: "modes", FREQUENCIES: "modes", SCORE: "folds"}
"""Names of these units; those of user-defined metrics are records."""
_NONE = np.empty((0, 2))
"""Units of a metric that a prediction does not have."""


@dataclass(frozen=True)
class Prediction:
    """Held-out observations as a fit predicts them; nothing where it cannot."""

    units: Units = field(default_factory=dict)
    modes: tuple[ModeResidual, ...] = ()
    curves: tuple[Curve, ...] = ()
    """The receptances."""

    @property
    def metrics(self) -> dict[str, float]:
        """Each metric of these observations."""
        return {name: _value(name, units) for name, units in self.units.items()}


@dataclass(frozen=True)
class Fold:
    """Predictions of held-out configurations, before and after."""

    configuration: str
    verdict: str
    causes: tuple[str, ...] = ()
    before: Prediction = Prediction()
    after: Prediction = Prediction()
    singles: Units = field(default_factory=dict)
    """First metric with one cause alone, by id."""


def cross_validate(selection: Selection, metrics: Mapping[str, Metric] | None, progress: Progress) -> Improvement:
    """Return the improvement on configurations that are left out in turn, with the choice of the causes repeated.

    Where there are more configurations than folds, several are left out together. A KeyboardInterrupt ends it with the
    completed folds.
    """
    model = selection.base.model
    folds: list[Fold] = []
    complete, count = True, count_folds(model)
    try:
        for group in (model.configurations[i::count] for i in range(count)):
            name = ", ".join(group)
            progress("held out", f"held out: {name}")
            try:
                others = select_without(selection, group)
                judgement = conclude(others)
            except (ValueError, ReceptanceError) as error:
                folds.append(Fold(name, f"not fitted: {error}"))
                continue
            held_out = replace(others.base.model, observations=model.of(group), tolerances=model.tolerances)
            folds.append(_fold(name, others, judgement, held_out, metrics))
    except KeyboardInterrupt:
        complete = False
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
    others = replace(
        selection,
        base=base,
        # Errors of modes are counted in all configurations.
        penalty=selection.penalty if selection.beside is not None else math.log(max(base.independent_values, 2.0)),
        explanations=[],
        tried=[],
        alternatives=[],
    )
    every = best_of_each([*selection.explanations, *selection.tried])
    remaining = {each: _on_others(each.fit, configurations) - each.expected for each in every}
    limit = behind_limit(_on_others(selection.base, configurations), remaining.values())
    singles = selection.held_out_singles
    chosen = [each for each in every if remaining[each] <= limit or each in singles]
    # One that is far behind on the other configurations does not compete in any of them.
    alternatives = [each for each in selection.alternatives if _on_others(each.fit, configurations) <= limit]
    tasks = [partial(_refit, others, each, configurations) for each in (*chosen, *alternatives)]
    fits = list(in_parallel(tasks, selection.workers))
    others.add(*(fit for fit in fits[: len(chosen)] if fit is not None))
    competing = [fit for fit in fits[len(chosen) :] if fit is not None]
    others.alternatives = sorted(competing, key=lambda alternative: -alternative.evidence)
    if selection.beside is not None:
        use_own_discrepancies(others, selection.beside, configurations)
    return others


def _on_others(fit: Fit, configurations: Sequence[str]) -> float:
    """Return chi-square without the residuals of some configurations."""
    parts = fit.by_configuration
    return fit.chi_square - sum(parts.get(name, 0.0) for name in configurations)


def _refit(selection: Selection, explanation: Explanation, configurations: Sequence[str]) -> Explanation | None:
    """Return an explanation fitted without some configurations; None where it acts in these alone."""
    model = explanation.fit.model.without(configurations)
    if not parameters_of(model.unknowns).keys() >= explanation.parameters.keys():
        return None
    try:
        return selection.explain(explanation.variants, refit(model, explanation.fit.values))
    except ReceptanceError:
        return None


def count_folds(model: Model) -> int:
    """Return the number of folds; zero for a model with one configuration."""
    count = len(model.configurations)
    return min(count, FOLDS) if count > 1 else 0


def improvement_on(selection: Selection, held_out: Model, metrics: Mapping[str, Metric] | None) -> Improvement:
    """Return the improvement on the observations of a base model, which were not fitted."""
    judgement = conclude(selection)
    each = {name: replace(held_out, observations=held_out.of([name])) for name in held_out.configurations}
    folds = [_fold(name, selection, judgement, records, metrics) for name, records in each.items()]
    return _combine(folds, held_out, metrics)


def _fold(
    name: str, selection: Selection, judgement: Judgement, held_out: Model, metrics: Mapping[str, Metric] | None
) -> Fold:
    before = predict(selection.base, held_out, metrics)
    best = next(iter(judgement.reported), None)
    first = _names(held_out)[0]
    return Fold(
        name,
        judgement.answer,
        () if best is None else tuple(sorted(best.ids)),
        before,
        before if best is None else _predict_with(best, held_out, metrics),
        {
            single.variants[0].cause.id: _predict_with(single, held_out, scored=False).units.get(first, _NONE)
            for single in selection.held_out_singles
        },
    )


def _predict_with(
    explanation: Explanation, base: Model, metrics: Mapping[str, Metric] | None = None, *, scored: bool = True
) -> Prediction:
    """Return the prediction with an explanation; none where its causes cannot be described for the held-out data."""
    try:
        return predict(explanation.fit, transfer(base, explanation.variants), metrics, scored=scored)
    except IndescribableError:
        return Prediction()


def predict(fit: Fit, model: Model, metrics: Mapping[str, Metric] | None = None, *, scored: bool = True) -> Prediction:
    """Return the prediction of the observations of a model with the causes of a fit.

    Errors that only these observations have are fitted to them with their tolerances, before and after alike.
    """
    data = predicted_data(fit, model)
    try:
        end = data.fit(EVALUATIONS, CONVERGED)
        if not np.isfinite(end.cost):
            return Prediction()
        residuals, assemblies, score = data.residuals(end), data.assemblies(end.x), math.nan
        if scored and all(observation.weighted for observation in model.observations):
            score = data.log_score(data.fit(EVALUATIONS, CONVERGED, all_variables=True))
    except InfeasibleError:
        return Prediction()
    modes: list[ModeResidual] = []
    curves: list[Curve] = []
    rows: dict[str, list[tuple[float, int]]] = {name: [] for name in (FREQUENCIES, SPECTRAL, SCORE, *(metrics or {}))}
    for observation, residual, assembly in zip(model.observations, residuals, assemblies, strict=True):
        curve = curve_of(observation, residual)
        of_curve = modes_of(observation, curve)
        modes += of_curve
        rows[FREQUENCIES] += [_row(mode.frequency_percent**2) for mode in of_curve]
        receptance = None
        if observation.is_receptance:
            curves.append(curve)
            receptance = np.asarray(curve.modelled, dtype=np.complex128)
            squares = np.square(np.abs(np.log(observation.receptance / receptance)))
            rows[SPECTRAL] += _by_mode(curve.frequency_hz, squares, [mode.measured_hz for mode in of_curve])
        for name, metric in (metrics or {}).items():
            rows[name].append(_row(float(metric(HeldOut(observation, assembly, receptance)))))
    rows[SCORE].append(_row(score))
    units = {name: np.array(row, dtype=np.float64).reshape(-1, 2) for name, row in rows.items()}
    return Prediction(units, tuple(modes), tuple(curves))


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


def _combine(folds: Sequence[Fold], model: Model, metrics: Mapping[str, Metric] | None) -> Improvement:
    """Return the improvement over all folds."""
    names = _names(model)
    first = names[0]
    gains = [gain_of(name, folds) for name in (*names, *(metrics or ()))]
    singles = {}
    for id in dict.fromkeys(id for fold in folds for id in fold.singles):
        # In a fold without evidence for a cause the base predicts.
        units = [fold.singles.get(id, fold.before.units.get(first, _NONE)) for fold in folds]
        pairs = zip(folds, units, strict=True)
        gain = gain_of(first, [replace(fold, after=Prediction({first: alone})) for fold, alone in pairs])
        if gain is not None:
            singles[id] = gain.held_out_after
    modes = tuple(mode for fold in folds for mode in fold.before.modes)
    return Improvement(
        gains=tuple(gain for gain in gains if gain is not None),
        singles=singles,
        modes=modes,
        modes_after=tuple(mode for fold in folds for mode in fold.after.modes),
        curves=tuple(
            pair
            for fold in folds
            for pair in zip_longest(fold.before.curves, fold.after.curves if fold.causes else ())
            if pair[0] is not None
        ),
        bias=bias_of(modes, slenderness_of(model)),
    )


def gain_of(metric: str, folds: Sequence[Fold]) -> Gain | None:
    """Return a metric before and after, and the 95 % interval of the improvement; None where no fold has both.

    Both are of the same units: a mode that one of the predictions does not have is left out.
    """
    pairs = [_in_both(fold.before.units.get(metric, _NONE), fold.after.units.get(metric, _NONE)) for fold in folds]
    ends = [(_value(metric, before), _value(metric, after)) for before, after in pairs]
    used = [pair for pair, values in zip(pairs, ends, strict=True) if np.isfinite(values).all()]
    if not used:
        return None
    sign = -1.0 if metric == SCORE else 1.0
    before, after = (_value(metric, *(pair[i] for pair in used)) for i in (0, 1))
    interval, count, correlation = _interval(metric, used)
    low, high = sorted(sign * end for end in interval)
    keys = ("configuration", "verdict", "causes", "before", "after")
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
            dict(zip(keys, (fold.configuration, fold.verdict, [*fold.causes], *values), strict=True))
            for fold, values in zip(folds, ends, strict=True)
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
