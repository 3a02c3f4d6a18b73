"""How a fitted model meets observations that it has not seen.

What it knows is the point where its fit ended and the normal matrix there. The new observations bring errors of their
own, those of a new clamping say, which nothing else could tell. Two things are asked of it: the prediction with the
model as it was fitted, where only these errors may move; and how well the new data go with all that it knows, where
everything may move as far as the old data allow. The second is a Laplace approximation of the predictive density, about
a refitted point, because a density that is linear about the prediction fails where a peak moves by more than its width.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from receptance.diagnosis.causes import Step
from receptance.diagnosis.fitting import Fit
from receptance.diagnosis.model import Model
from receptance.identification.laws import error_of
from receptance.identification.observations import MeasuredFRF
from receptance.identification.problem import End, Observed, Problem
from receptance.identification.residuals import InfeasibleError
from receptance.identification.task import place_of
from receptance.identification.unknowns import Variables

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.assembly import Assembly
    from receptance.identification.mapping import Placed
    from receptance.identification.task import Observation

__all__ = ["Foresight", "with_causes"]

_STEPS = 12
_LEAST = 1e-3


def with_causes(model: Model, steps: Sequence[Step]) -> Model:
    """Return other observations with causes; unknowns and errors go with them."""
    for step in steps:
        model = step.transfer(model)
    return model


@dataclass(frozen=True, eq=False)
class Foresight:
    """A fit, and observations that it has not seen.

    Parameters
    ----------
    fit : Fit
        What is known.
    model : Model
        The observations with the causes of the fit, see `with_causes`, and their errors as tolerances.
    """

    fit: Fit
    model: Model

    @cached_property
    def _placed(self) -> tuple[list[Placed], tuple[str, ...]]:
        """The parameters of each observation as functions of unknowns and new errors, and the names of these."""
        parameters = self.fit.task.parameters
        known = len(parameters.unknowns)
        found: list[tuple[Placed, list[str]]] = []
        for index, one in enumerate(self.model.observations):
            fresh: list[str] = []
            found.append((parameters.at(place_of(one, index), self.model.tolerances, fresh), fresh))
        names = tuple(dict.fromkeys(name for _, fresh in found for name in fresh))

        def widened(matrix: NDArray[np.float64], fresh: list[str]) -> NDArray[np.float64]:
            whole = np.zeros((len(matrix), known + len(names)))
            whole[:, [*range(known), *(known + names.index(name) for name in fresh)]] = matrix
            return whole

        return [
            replace(placed, exponents=widened(placed.exponents, fresh), shifts=widened(placed.shifts, fresh))
            for placed, fresh in found
        ], names

    @cached_property
    def _problem(self) -> tuple[Problem, NDArray[np.float64], NDArray[np.float64]]:
        """All residuals, where they begin, and the root of what is known."""
        placed, names = self._placed
        variables = Variables((*self.fit.task.parameters.unknowns, *map(error_of, names)))
        low, high = variables.limits
        known = self.fit.x.size
        # Within its bounds anything is possible of what the data do not see.
        spans = np.diag(np.sqrt(12.0) / (high - low)[:known])
        root = np.eye(known + len(names))
        root[:known, :known] = np.linalg.qr(np.vstack([self.fit.jacobian, spans]), mode="r")
        start = np.append(self.fit.x, np.zeros(len(names)))
        observed = [
            Observed(one, own, "standard deviations") for one, own in zip(self.model.observations, placed, strict=True)
        ]
        return Problem(variables, observed, known=(root, start)), start, root

    def _end(self, everything: bool) -> End:
        problem, start, _ = self._problem
        free = np.ones(start.size, dtype=np.bool_)
        if not everything:
            free[: self.fit.x.size] = False
        return problem.fit_one(start, _STEPS, free=free, least=_LEAST)

    @cached_property
    def _own_fitted(self) -> End:
        return self._end(False)

    @cached_property
    def predicted(self) -> list[NDArray[np.float64]]:
        """Residuals of each observation in its standard deviations, its own errors fitted to it; empty: no value."""
        end = self._own_fitted
        problem, _, _ = self._problem
        if not np.isfinite(end.cost):
            return []
        return [part.copy() for part in problem.parts(problem.residual(end.x))]

    @property
    def unfitted(self) -> list[NDArray[np.float64]]:
        """Residuals of each observation where the fit ended and without errors of its own."""
        problem, start, _ = self._problem
        residual = problem.residual(start)
        if not np.isfinite(residual).all():
            raise InfeasibleError(problem.reason(start))
        return [part.copy() for part in problem.parts(residual)]

    @cached_property
    def assemblies(self) -> list[Assembly]:
        """The assemblies of `predicted`."""
        values = self._problem[0].variables.to_values(self._own_fitted.x)
        placed, _ = self._placed
        return [own.apply(one.assembly, values) for one, own in zip(self.model.observations, placed, strict=True)]

    @cached_property
    def _refitted(self) -> End:
        return self._end(True)

    @property
    def chi_square(self) -> float:
        """By how much chi-square grows when the new data are fitted together with the old ones."""
        return 2.0 * self._refitted.cost

    @property
    def log_score(self) -> float:
        """Natural logarithm of the predictive density of the data: of log FRFs, and of frequencies in Hz."""
        problem, _, root = self._problem
        end = self._refitted
        if not np.isfinite(end.cost):
            return -math.inf
        jacobian = problem.jacobian(end.x)[: -root.shape[0]]
        wide = np.linalg.solve(root.T, jacobian.T)
        _, volume = np.linalg.slogdet(np.eye(root.shape[0]) + wide @ wide.T)
        spreads = [np.asarray(_spread(one), dtype=np.float64) for one in self.model.observations]
        scale = sum(float(np.sum(np.log(spread * math.sqrt(2.0 * math.pi)))) for spread in spreads)
        return -end.cost - 0.5 * float(volume) - scale


def _spread(one: Observation) -> NDArray[np.float64]:
    """Return the standard deviation of each observed number."""
    if isinstance(one, MeasuredFRF):
        spread = one.standard_deviation if one.standard_deviation is not None else np.ones(one.frequency_hz.size)
        return np.tile(spread, 2)
    if one.standard_deviation_hz is None:
        return np.ones(one.frequency_hz.size + one.damped.size)
    damping = one.standard_deviation_damping
    return np.append(one.standard_deviation_hz, [] if damping is None else damping[one.damped])
