"""What an explanation improves on a configuration that its fit never saw."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from receptance.diagnosis.bias import slenderness_of
from receptance.diagnosis.by_mode import ModeResidual, curve_of, modes_of
from receptance.diagnosis.causes import Cause, IndescribableError
from receptance.diagnosis.explanation import Explanation, Selection
from receptance.diagnosis.fitting import Fit
from receptance.diagnosis.foresight import Foresight, with_causes
from receptance.diagnosis.judgement import conclude
from receptance.diagnosis.model import Model
from receptance.diagnosis.selection import select
from receptance.diagnosis.steps import Steps
from receptance.diagnosis.verdict import Gain
from receptance.errors import ReceptanceError
from receptance.identification.laws import Tolerance
from receptance.identification.observations import MeasuredFRF
from receptance.identification.residuals import InfeasibleError
from receptance.identification.task import Observation, place_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.assembly import Assembly

__all__ = ["FREQUENCIES", "SCORE", "SPECTRAL", "HeldOut", "Improvement", "Metric", "folded", "folds_of", "improvement"]

FREQUENCIES = "natural frequencies, rms error in percent"
SPECTRAL = "log-spectral distance, rms of ln(measured / calculated)"
SCORE = "predictive log score in nats"
_RIVALS = 8
"""Causes whose own improvement is measured in each fold, the best evidence first."""
_FOLDS = 4
"""Folds at most: each repeats the whole selection."""


@dataclass(frozen=True, eq=False)
class HeldOut:
    """An observation that the fit never saw, and what was predicted of it: what a metric of one's own is given.

    Attributes
    ----------
    observation : MeasuredFRF or MeasuredFrequencies
        What was measured.
    assembly : Assembly
        The predicted structure as it was measured, a sensor's mass included.
    receptance : ndarray or None
        `(n,)` predicted on the lines of a MeasuredFRF, as the chain would record it; None of natural frequencies.
    """

    observation: Observation
    assembly: Assembly
    receptance: NDArray[np.complex128] | None


Metric = Callable[[HeldOut], float]
"""An error of a prediction: smaller is better. Not a number where it says nothing of that observation."""


@dataclass(frozen=True)
class _Fold:
    """One configuration that was held out, and each metric before and after."""

    configuration: str
    verdict: str
    causes: tuple[str, ...]
    before: Mapping[str, float]
    after: Mapping[str, float]
    rivals: Mapping[str, float] = field(default_factory=dict)
    modes: tuple[ModeResidual, ...] = ()
    modes_after: tuple[ModeResidual, ...] = ()


@dataclass(frozen=True)
class Improvement:
    """What was found on data that no fit has seen.

    Attributes
    ----------
    gains : tuple of Gain
        By metric, the one of what was measured most first.
    rivals : dict of str to float
        The first metric if one cause alone were believed, by id, whatever the verdict says of it.
    modes, modes_after : tuple of ModeResidual
        Held-out modes, measured less predicted, before and after.
    slenderness : dict of str to float
        Overhang over diameter of the held-out configurations.
    complete : bool
        Whether all folds were done.
    """

    gains: tuple[Gain, ...] = ()
    rivals: Mapping[str, float] = field(default_factory=dict)
    modes: tuple[ModeResidual, ...] = ()
    modes_after: tuple[ModeResidual, ...] = ()
    slenderness: Mapping[str, float] = field(default_factory=dict)
    complete: bool = True


def folded(
    model: Model,
    causes: Sequence[Cause],
    *,
    seed: int,
    threads: int | None,
    most: int,
    metrics: Mapping[str, Metric] | None = None,
    progress: Steps | None = None,
) -> Improvement:
    """Leave out one configuration after the other, with the whole selection repeated without it.

    Where there are many, every few of them are left out together. A KeyboardInterrupt ends it with the folds that are
    done.
    """
    names = model.configurations
    count = folds_of(model)
    steps = progress or Steps(selections=count)
    folds: list[_Fold] = []
    complete = True
    for group in (names[i::count] for i in range(count)):
        name = ", ".join(group)
        out = tuple(o for i, o in enumerate(model.observations) if place_of(o, i).configuration in group)
        steps.holding_out = name
        try:
            selection = select(without(model, group), causes, seed=seed, threads=threads, most=most, progress=steps)
            if selection.interrupted:
                raise KeyboardInterrupt
        except (ValueError, ReceptanceError) as error:
            folds.append(_Fold(name, f"not fitted: {error}", (), {}, {}))
            continue
        except KeyboardInterrupt:
            complete = False
            break
        steps.again()
        judgement = conclude(selection)
        best = judgement.reported[0] if judgement.reported else None
        folds.append(_fold(name, judgement.answer, selection, best, out, model.tolerances, metrics))
    return replace(_together(folds, model, metrics), complete=complete)


def folds_of(model: Model) -> int:
    """Return in how many folds configurations are left out; none of a model with one."""
    count = len(model.configurations)
    return min(count, _FOLDS) if count > 1 else 0


def improvement(
    selection: Selection,
    best: Explanation | None,
    observations: Sequence[Observation],
    tolerances: Sequence[Tolerance],
    metrics: Mapping[str, Metric] | None = None,
) -> Improvement:
    """Return what the explanation improves on observations that no fit has seen."""
    groups: dict[str, list[Observation]] = {}
    for index, one in enumerate(observations):
        groups.setdefault(place_of(one, index).configuration, []).append(one)
    answer = conclude(selection).answer
    folds = [_fold(name, answer, selection, best, own, tolerances, metrics) for name, own in groups.items()]
    return _together(folds, replace(selection.base.model, observations=tuple(observations)), metrics)


def _fold(
    name: str,
    answer: str,
    selection: Selection,
    best: Explanation | None,
    observations: Sequence[Observation],
    tolerances: Sequence[Tolerance],
    metrics: Mapping[str, Metric] | None,
) -> _Fold:
    base = replace(selection.base.model, observations=tuple(observations), tolerances=tuple(tolerances))
    before, modes = measured_by(selection.base, base, metrics)
    after, modes_after = before, modes
    if best is not None:
        after, modes_after = _believed(best, base, metrics)
    first = _names(observations)[0]
    rivals = {}
    for one in [single for single in selection.singles if single.evidence > 0.0][:_RIVALS]:
        found, _ = _believed(one, base, scored=False)
        rivals[one.steps[0][0].id] = found.get(first, math.nan)
    causes = () if best is None else tuple(sorted(best.ids))
    return _Fold(name, answer, causes, before, after, rivals, modes, modes_after)


def _believed(
    one: Explanation, base: Model, metrics: Mapping[str, Metric] | None = None, *, scored: bool = True
) -> tuple[dict[str, float], tuple[ModeResidual, ...]]:
    """Return the metrics of an explanation; none where its causes cannot be described for what was held out."""
    try:
        return measured_by(one.fit, with_causes(base, one.steps), metrics, scored=scored)
    except IndescribableError:
        return {}, ()


def measured_by(
    fit: Fit, model: Model, metrics: Mapping[str, Metric] | None = None, *, scored: bool = True
) -> tuple[dict[str, float], tuple[ModeResidual, ...]]:
    """Return each metric of a prediction of observations, as `model` has them with the causes of the fit, and modes.

    Their own errors, which nothing else could tell, are fitted to them with their tolerances, before and after alike.
    """
    foresight = Foresight(fit, model)
    try:
        residuals = foresight.predicted
        if not residuals:
            return {}, ()
        assemblies = foresight.assemblies
        known = scored and all(_weighed(one) for one in model.observations)
        score = foresight.log_score if known else math.nan
    except InfeasibleError:
        return {}, ()
    modes: list[ModeResidual] = []
    distances: list[float] = []
    own: dict[str, list[float]] = {name: [] for name in metrics or {}}
    for one, residual, assembly in zip(model.observations, residuals, assemblies, strict=True):
        curve = curve_of(one, residual)
        modes += modes_of(one, curve)
        receptance = None
        if isinstance(one, MeasuredFRF):
            receptance = np.asarray(curve.modelled, dtype=np.complex128)
            distances += np.square(np.abs(np.log(one.receptance / receptance))).tolist()
        for name, metric in (metrics or {}).items():
            own[name].append(float(metric(HeldOut(one, assembly, receptance))))
    errors = [mode.frequency_percent for mode in modes if np.isfinite(mode.frequency_percent)]
    found = {FREQUENCIES: _rms(errors), SPECTRAL: math.sqrt(float(np.mean(distances))) if distances else math.nan}
    found[SCORE] = score
    return {**found, **{name: _mean(values) for name, values in own.items()}}, tuple(modes)


def _weighed(one: Observation) -> bool:
    return (one.standard_deviation if isinstance(one, MeasuredFRF) else one.standard_deviation_hz) is not None


def _rms(values: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values)))) if values else math.nan


def _mean(values: Sequence[float]) -> float:
    finite = [value for value in values if math.isfinite(value)]
    return float(np.mean(finite)) if finite else math.nan


def _names(observations: Sequence[Observation]) -> list[str]:
    """Return the metrics, that of what was measured most first."""
    frfs = any(isinstance(one, MeasuredFRF) for one in observations)
    return [SPECTRAL, FREQUENCIES, SCORE] if frfs else [FREQUENCIES, SCORE]


def _together(folds: Sequence[_Fold], model: Model, metrics: Mapping[str, Metric] | None) -> Improvement:
    """Return what all folds together say."""
    names = _names(model.observations)
    gains = [gain_of(name, folds) for name in (*names, *(metrics or ()))]
    rivals = {}
    for id in dict.fromkeys(id for one in folds for id in one.rivals):
        # Where a fold does not have a cause, it would not have been believed there.
        own = [one.rivals.get(id, one.before.get(names[0], math.nan)) for one in folds]
        told = gain_of(names[0], [replace(one, after={names[0]: x}) for one, x in zip(folds, own, strict=True)])
        if told is not None:
            rivals[id] = told.held_out_after
    return Improvement(
        gains=tuple(one for one in gains if one is not None),
        rivals=rivals,
        modes=tuple(mode for one in folds for mode in one.modes),
        modes_after=tuple(mode for one in folds for mode in one.modes_after),
        slenderness=slenderness_of(model),
    )


def gain_of(metric: str, folds: Sequence[_Fold]) -> Gain | None:
    """Return a metric before and after, and the 95 % interval of the improvement by the jackknife over the folds."""
    there = [one for one in folds if math.isfinite(one.before.get(metric, math.nan))]
    there = [one for one in there if math.isfinite(one.after.get(metric, math.nan))]
    if not there:
        return None
    table = np.array([(one.before[metric], one.after[metric]) for one in there])
    sign = -1.0 if metric == SCORE else 1.0

    def ends(rows: NDArray[np.float64]) -> NDArray[np.float64]:
        squares = metric in (FREQUENCIES, SPECTRAL)
        result: NDArray[np.float64] = np.sqrt(np.mean(rows**2, axis=0)) if squares else np.mean(rows, axis=0)
        return result

    before, after = ends(table)
    return Gain(
        metric=metric,
        held_out_before=float(before),
        held_out_after=float(after),
        interval=_interval(table, lambda rows: sign * float(np.subtract(*ends(rows)))),
        better=int(np.count_nonzero(sign * (table[:, 0] - table[:, 1]) > 0.0)),
        folds=tuple(
            {
                "configuration": one.configuration,
                "verdict": one.verdict,
                "causes": list(one.causes),
                "before": one.before.get(metric, math.nan),
                "after": one.after.get(metric, math.nan),
            }
            for one in folds
        ),
    )


def _interval(table: NDArray[np.float64], value: Callable[[NDArray[np.float64]], float]) -> tuple[float, float]:
    """Return the 95 % interval of a number made of the folds; open where one fold says nothing of scatter."""
    from receptance.identification.spread import quantile

    count = len(table)
    if not np.any(table[:, 0] != table[:, 1]):
        return 0.0, 0.0
    if count == 1:
        return -math.inf, math.inf
    left = [value(np.delete(table, i, axis=0)) for i in range(count)]
    pseudo = count * value(table) - (count - 1) * np.array(left)
    reach = quantile(0.95, count - 1) * float(np.std(pseudo, ddof=1)) / math.sqrt(count)
    middle = float(np.mean(pseudo))
    return middle - reach, middle + reach


def without(model: Model, configurations: Sequence[str]) -> Model:
    """Return the model without some configurations, and without the unknowns and errors that only these have."""
    kept = (o for i, o in enumerate(model.observations) if place_of(o, i).configuration not in configurations)
    return model.of(tuple(kept))
