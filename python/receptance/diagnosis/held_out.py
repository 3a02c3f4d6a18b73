"""What an explanation improves on a configuration that its fit never saw."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from receptance.diagnosis.causes import Cause, changed
from receptance.diagnosis.fitting import Fit
from receptance.diagnosis.judgement import conclude
from receptance.diagnosis.model import Model
from receptance.diagnosis.selection import Explanation, Selection, select
from receptance.diagnosis.verdict import Gain
from receptance.errors import ReceptanceError
from receptance.identification.laws import Tolerance
from receptance.identification.mapping import Addresses, MappedResidual
from receptance.identification.observations import MeasuredFRF
from receptance.identification.residuals import FrequencyResidual, FRFResidual, InfeasibleError, Unit
from receptance.identification.task import Observation, place_of

__all__ = ["folded", "improvement", "score"]

_FOLDS = 4
"""Folds at most: each repeats the whole selection."""
_STEPS = 8
"""Steps in which a held-out configuration's own errors are found."""


def folded(
    model: Model,
    causes: Sequence[Cause],
    *,
    seed: int,
    threads: int | None,
    most: int,
    progress: Callable[[str], None] | None = None,
) -> Gain | None:
    """Leave out one configuration after the other, with the whole selection repeated without it.

    Where there are many, every few of them are left out together.
    """
    names = model.configurations
    if len(names) < 2:
        return None
    count = min(len(names), _FOLDS)
    pairs: list[tuple[float, float]] = []
    folds: list[dict[str, Any]] = []
    for group in (names[i::count] for i in range(count)):
        name = ", ".join(group)
        out = tuple(o for i, o in enumerate(model.observations) if place_of(o, i).configuration in group)
        left = without(model, group)
        if progress is not None:
            progress(f"held out: {name}")
        try:
            selection = select(left, causes, seed=seed, threads=threads, most=most)
        except (ValueError, ReceptanceError) as error:
            folds.append({"configuration": name, "why_not": str(error)})
            continue
        judgement = conclude(selection)
        best = judgement.reported[0] if judgement.reported else None
        before = score(selection.base, selection, None, out, model.tolerances)
        after = before if best is None else score(best.fit, selection, best, out, model.tolerances)
        pairs.append((before, after))
        ids = [] if best is None else sorted(best.ids)
        folds.append(
            {"configuration": name, "verdict": judgement.answer, "causes": ids, "before": before, "after": after}
        )
    return gain_of(pairs, _metric(model.observations), folds)


def improvement(
    selection: Selection, best: Explanation | None, observations: Sequence[Observation], tolerances: Sequence[Tolerance]
) -> Gain | None:
    """Return what the explanation improves on observations that no fit has seen."""
    pairs = []
    for one in observations:
        before = score(selection.base, selection, None, (one,), tolerances)
        pairs.append((before, before if best is None else score(best.fit, selection, best, (one,), tolerances)))
    return gain_of(pairs, _metric(observations), [])


def gain_of(pairs: Sequence[tuple[float, float]], metric: str, folds: Sequence[dict[str, Any]]) -> Gain | None:
    """Return root mean squares before and after, and the 95 % interval of their difference over the folds."""
    from receptance.identification.spread import quantile

    table = np.array([pair for pair in pairs if np.isfinite(pair).all()])
    if not table.size:
        return None
    before, after = np.sqrt(np.mean(table**2, axis=0))
    steps = table[:, 0] - table[:, 1]
    middle = float(np.mean(steps))
    if len(steps) > 1:
        reach = quantile(0.95, len(steps) - 1) * float(np.std(steps, ddof=1)) / math.sqrt(len(steps))
    else:
        reach = math.inf if steps[0] else 0.0
    return Gain(
        metric=metric,
        held_out_before=float(before),
        held_out_after=float(after),
        interval=(middle - reach, middle + reach),
        folds=tuple(folds),
    )


def without(model: Model, configurations: Sequence[str]) -> Model:
    """Return the model without some configurations, and without the unknowns and errors that only these have."""
    kept = (o for i, o in enumerate(model.observations) if place_of(o, i).configuration not in configurations)
    return model.of(tuple(kept))


def _metric(observations: Sequence[Observation]) -> str:
    if all(isinstance(one, MeasuredFRF) for one in observations):
        return "log-spectral distance, rms of ln(measured / calculated)"
    return "natural frequencies, rms error in percent"


def score(
    fit: Fit,
    selection: Selection,
    explanation: Explanation | None,
    observations: Sequence[Observation],
    tolerances: Sequence[Tolerance],
) -> float:
    """Return the rms error of a prediction of one configuration: of frequencies in percent, or of log FRFs.

    Its own errors, which nothing else could tell, are fitted to it with their tolerances, before and after alike.
    """
    model = replace(selection.base.model, observations=tuple(observations), tolerances=tuple(tolerances))
    for cause, name in explanation.steps if explanation is not None else ():
        model = changed(cause, name, model)
    errors: list[float] = []
    values = np.array([fit.values[u.name] for u in fit.task.parameters.unknowns])
    try:
        for index, one in enumerate(model.observations):
            place = place_of(one, index)
            placed = fit.task.parameters.at(place, model.tolerances, [])
            errors += _errors(one, placed, values)
    except InfeasibleError:
        return math.nan
    return float(np.sqrt(np.mean(np.square(errors))))


def _errors(one: Observation, placed: Any, values: NDArray[np.float64]) -> list[float]:
    addressed = Addresses(placed.addresses)
    unit: Unit = "standard deviations"
    inner: FRFResidual | FrequencyResidual
    if isinstance(one, MeasuredFRF):
        inner = FRFResidual(one, addressed, unit, None, None)
    else:
        inner = FrequencyResidual(one, addressed, unit)
    mapped = MappedResidual(inner, placed)
    own = placed.shifts.shape[1] - values.size
    z = np.zeros(own)
    ones = np.ones(values.size + own)
    residual, slope = mapped.evaluate(np.append(values, z), ones)
    for _ in range(_STEPS if own else 0):
        matrix = slope[:, values.size :]
        step = np.linalg.solve(matrix.T @ matrix + np.eye(own), -(matrix.T @ residual + z))
        trial = np.clip(z + step, -4.0, 4.0)
        new, new_slope = mapped.evaluate(np.append(values, trial), ones)
        if new @ new + trial @ trial >= residual @ residual + z @ z:
            break
        z, residual, slope = trial, new, new_slope
    if isinstance(one, MeasuredFRF):
        sd = one.standard_deviation if one.standard_deviation is not None else np.ones(one.frequency_hz.size)
        pair = residual.reshape(2, -1) * sd
        return [float(x) for x in np.sqrt(np.sum(pair**2, axis=0))]
    spread = one.standard_deviation_hz if one.standard_deviation_hz is not None else one.frequency_hz
    return [float(x) for x in 100.0 * residual * spread / one.frequency_hz]
