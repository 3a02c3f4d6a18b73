"""Residuals evaluated with assemblies and fitted by SciPy: the reference of the problems of the core."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.optimize import least_squares

import plain_residuals
from receptance.fit.parameters import Parameters
from receptance.fit.problem import Task


def task_of(observations: Any, unknowns: Any, unit: str = "logarithm", tolerances: Any = (), **settings: Any) -> Task:
    """Return a task in which all observations have one unit."""
    observed = tuple(observations) if isinstance(observations, (list, tuple)) else (observations,)
    parameters = Parameters(tuple(unknowns), tolerances, [one.site(i) for i, one in enumerate(observed)])
    return Task(observed, parameters, (unit,) * len(observed), **{"threads": 1, **settings})


def residual_and_jacobian(task: Task, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return all residuals and their derivatives by the variables, those of priors last; infinite without a value."""
    variables = task.variables
    values = variables.to_values(x)
    rows, slopes = [], []
    for one in zip(task.selected, task.mappings, task.units, strict=True):
        found = plain_residuals.residual_and_jacobian(*one, values)
        # Without a value one infinite residual is sufficient.
        row, slope = (np.array([np.inf]), np.zeros((1, x.size))) if found is None else found
        rows.append(row)
        slopes.append(slope * variables.slopes(values))
    for variable, scale, offset in variables.priors:
        rows.append(np.array([scale * x[int(variable)] - offset]))
        slopes.append(scale * np.eye(x.size)[[int(variable)]])
    return np.concatenate(rows), np.vstack(slopes)


def fit(task: Task, start: np.ndarray, smoothing: float | None = None, tolerance: float = 1e-10) -> Any:
    """Return the end of SciPy's fit."""
    options: dict[str, Any] = {} if smoothing is None else {"loss": "soft_l1", "f_scale": smoothing}
    return least_squares(
        lambda x: residual_and_jacobian(task, x)[0],
        start,
        jac=lambda x: residual_and_jacobian(task, x)[1],
        bounds=tuple(task.variables.limits),
        method="trf",
        x_scale="jac",
        ftol=tolerance,
        xtol=tolerance,
        gtol=tolerance,
        max_nfev=200,
        **options,
    )
