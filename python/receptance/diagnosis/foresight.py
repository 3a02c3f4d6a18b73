"""Predictions of a fitted model for observations that were not fitted.

The fit is known by its end point and the normal matrix there. The new observations have errors of their own, those of a
new clamping for example, which only they determine. Two quantities follow: the prediction with the fitted model, in
which only these errors are fitted; and the agreement of the new data with the fit, in which all variables are fitted to
both. The second one is a Laplace approximation of the predictive density about this joint fit, because an approximation
that is linear about the prediction fails where a peak moves by more than its width.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from receptance.diagnosis.causes import Step
from receptance.diagnosis.fitting import Fit
from receptance.diagnosis.model import Model
from receptance.identification.new_observations import NewObservations, information_root
from receptance.identification.problem import End, Problem

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.model.assembly import Assembly

__all__ = ["Foresight", "with_causes"]

_STEPS = 12
"""Most evaluations of each fit."""
_LEAST = 1e-3
"""Predicted decrease of the cost by the next step below which a fit has converged."""


def with_causes(model: Model, steps: Sequence[Step]) -> Model:
    """Return observations that were not fitted with causes; unknowns and errors are changed with them."""
    for step in steps:
        model = step.transfer(model)
    return model


@dataclass(frozen=True, eq=False)
class Foresight:
    """A fit, and observations that were not fitted.

    Parameters
    ----------
    fit : Fit
        The fit.
    model : Model
        The observations with the causes of the fit, see `with_causes`, and their errors as tolerances.
    """

    fit: Fit
    model: Model

    @cached_property
    def _new(self) -> NewObservations:
        observations = self.model.observations
        return NewObservations(self.fit.task.parameters, observations, [self.model.tolerances] * len(observations))

    @cached_property
    def _root(self) -> NDArray[np.float64]:
        return information_root(self.fit.jacobian, self.fit.task.variables)

    @cached_property
    def _problem(self) -> Problem:
        return self._new.problem(self.fit.x, self._root)

    def _end(self, everything: bool) -> End:
        start = self._new.start(self.fit.x)
        free = np.ones(start.size, dtype=np.bool_)
        if not everything:
            free[: self.fit.x.size] = False
        return self._problem.fit_one(start, _STEPS, free=free, least=_LEAST)

    @cached_property
    def _own_fitted(self) -> End:
        return self._end(False)

    @cached_property
    def predicted(self) -> list[NDArray[np.float64]]:
        """Residuals of each observation in standard deviations, with its own errors fitted; empty without a value."""
        end = self._own_fitted
        if not np.isfinite(end.cost):
            return []
        return [part.copy() for part in self._problem.parts(self._problem.residual(end.x))]

    @cached_property
    def assemblies(self) -> list[Assembly]:
        """The assemblies of `predicted`."""
        values = self._new.variables.to_values(self._own_fitted.x)
        pairs = zip(self.model.observations, self._new.mappings, strict=True)
        return [own.apply(one.assembly, values) for one, own in pairs]

    @cached_property
    def _refitted(self) -> End:
        return self._end(True)

    @property
    def chi_square(self) -> float:
        """Increase of chi-square when the new data are fitted together with the data of the fit."""
        return 2.0 * self._refitted.cost

    @property
    def log_score(self) -> float:
        """Natural logarithm of the predictive density of the data: of log FRFs, and of frequencies in Hz."""
        end = self._refitted
        if not np.isfinite(end.cost):
            return -math.inf
        rows = self._problem.jacobian(end.x)
        jacobian, root = np.split(rows, [len(rows) - rows.shape[1]])
        wide = np.linalg.solve(root.T, jacobian.T)
        _, volume = np.linalg.slogdet(np.eye(len(root)) + wide @ wide.T)
        spread = np.concatenate([one.standard_deviations for one in self.model.observations])
        return -end.cost - 0.5 * float(volume) - float(np.sum(np.log(spread * math.sqrt(2.0 * math.pi))))
