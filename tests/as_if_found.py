"""A diagnosis that ended at causes, without the work of one."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from receptance import campaign
from receptance.diagnosis.explanation import Explanation
from receptance.diagnosis.fitting import Fit
from receptance.diagnosis.model import Model
from variant_of_cause import variant_of


def as_if_found(read: campaign.Campaign, *causes: tuple[str, str]) -> tuple[campaign.Campaign, Any]:
    """A diagnosis that ended at causes where they are small, without the work of one."""
    model, _ = read.base_model()
    model = model.with_witnesses()
    base = fit_at_start(model)
    variants = []
    for cause, name in causes:
        variants.append(variant_of(model, cause, name))
        model = variants[-1].apply(model)
    fit = fit_at_start(model)
    explanation = Explanation(tuple(variants), fit, 100.0, 100.0)
    verdict: Any = SimpleNamespace(
        verdict="named",
        explanation=explanation,
        extended=fit,
        ambiguous_between=(),
        discrepancy=None,
        selection=SimpleNamespace(base=base),
    )
    return read, verdict


def fit_at_start(model: Model) -> Fit:
    task = model.task
    values = {}
    for unknown in task.variables.unknowns:
        small = 1e-4 * (unknown.upper - unknown.lower) if unknown.scale == "linear" else 0.0
        values[unknown.name] = min(max(float(unknown.start or 0.0) + small, unknown.lower), unknown.upper)
    x = task.variables.from_values(np.array(list(values.values())))
    residual = model.problem.residual(x)
    assert np.isfinite(residual).all(), model.problem.reason(x)
    return Fit(model, x, float(residual @ residual), True)
