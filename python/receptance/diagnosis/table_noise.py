"""Errors of a spindle or holder that is given as data, in the model of a diagnosis."""

from __future__ import annotations

from dataclasses import replace

from receptance.diagnosis.fitting import evaluate, fit_base
from receptance.diagnosis.line_selection import select_lines
from receptance.diagnosis.model import Model
from receptance.diagnosis.text import Reason
from receptance.fit.spindle_errors import has_spindle_errors, with_spindle_errors
from receptance.model.terminals import MeasuredPart


def with_table_noise(model: Model) -> tuple[Model, tuple[Reason, ...]]:
    """Return the model with records whose variance includes the errors of what ends their assemblies, and reasons.

    Parameters
    ----------
    model : Model
        Observations with standard deviations.
    """
    exact: list[MeasuredPart] = []
    for observation in model.observations:
        *_, end = observation.assembly.elements.values()
        if isinstance(end, MeasuredPart) and end.covariance is None and end not in exact:
            exact.append(end)
    reasons = [Reason("table_without_covariance", {"table": table.name}) for table in exact]
    if not has_spindle_errors(model.observations):
        return model, tuple(reasons)
    fit = evaluate(model, fit_base(select_lines(model)[0]).values)
    values = fit.task.variables.to_values(fit.x)
    pairs = zip(model.observations, fit.task.mappings, strict=True)
    fitted = [mapping.apply(observation.assembly, values) for observation, mapping in pairs]
    observations, errors = with_spindle_errors(model.observations, fitted)
    reasons += [] if errors is None else [Reason("spindle_errors", {"errors": errors})]
    return replace(model, observations=observations), tuple(reasons)
