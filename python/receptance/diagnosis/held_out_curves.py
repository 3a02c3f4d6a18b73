"""Curves of held-out records, measured and predicted without and with the causes of a verdict."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from receptance.diagnosis.by_mode import Curve, curve_of
from receptance.diagnosis.causes import transfer
from receptance.diagnosis.explanation import Explanation
from receptance.diagnosis.fitting import Fit, refit
from receptance.diagnosis.held_out import predicted_data
from receptance.diagnosis.model import IndescribableError, Model
from receptance.diagnosis.thresholds import EVALUATIONS_OF_PREDICTION
from receptance.diagnosis.verdict import Verdict
from receptance.errors import ReceptanceError
from receptance.fit.problem import CONVERGED, InfeasibleError


def held_out_curves(verdict: Verdict, most: int = 4) -> list[tuple[Curve, Curve | None]]:
    """Return held-out receptances with their predictions, before and after the causes are part of the model.

    Separate held-out measurements are predicted by the fits to all others. Without these each configuration is left out
    of the fit of the base, and of the best of the reported explanations, from the values of the fits to all data.

    Parameters
    ----------
    verdict : Verdict
        A verdict with an improvement on held-out data; there are no curves without one.
    most : int, optional
        Largest number of records.

    Returns
    -------
    list of (Curve, Curve or None)
        Measured and predicted, before and after; None without a cause.
    """
    base, best = verdict.selection.base, verdict.explanation
    if not verdict.gains:
        return []
    if verdict.held_out is not None:
        return _pairs(base, best, verdict.held_out)[:most]
    found: list[tuple[Curve, Curve | None]] = []
    for name in base.model.configurations:
        records = tuple(observation for observation in base.model.of([name]) if observation.is_receptance)
        if not records or len(found) >= most:
            continue
        try:
            fit = refit(base.model.without([name]), base.values)
            own = None if best is None else replace(best, fit=refit(best.fit.model.without([name]), best.fit.values))
        except (ValueError, ReceptanceError):
            continue
        found += _pairs(fit, own, replace(base.model, observations=records))
    return found[:most]


def _pairs(base: Fit, best: Explanation | None, held_out: Model) -> list[tuple[Curve, Curve | None]]:
    before = _curves(base, held_out)
    after: list[Curve] = []
    if best is not None:
        try:
            after = _curves(best.fit, transfer(held_out, best.variants))
        except IndescribableError:
            after = []
    return [(one, after[i] if i < len(after) else None) for i, one in enumerate(before)]


def _curves(fit: Fit, model: Model) -> list[Curve]:
    try:
        data = predicted_data(fit, model)
        end = data.fit(EVALUATIONS_OF_PREDICTION, CONVERGED)
    except InfeasibleError:
        return []
    residuals = data.residuals(end) if np.isfinite(end.cost) else []
    pairs = zip(model.observations, residuals, strict=False)
    return [curve_of(observation, own) for observation, own in pairs if observation.is_receptance]
