"""What observations tell of parameters to first order: information matrices, with the errors they bring."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from receptance.errors import ReceptanceError
from receptance.identification.candidates import Candidate, FrequencyTarget, ReceptanceTarget
from receptance.identification.mapping import Place, Placed
from receptance.identification.unknowns import Variables

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.identification.problem import Problem
    from receptance.identification.result import Identification

__all__ = ["Point", "Surroundings", "Target", "deviation", "joined", "widened"]

Target = str | FrequencyTarget | ReceptanceTarget


@dataclass(frozen=True)
class Point:
    """A point of the fitted variables with the information that the measurements taken have there.

    Attributes
    ----------
    x : ndarray
        `(p,)` fitted variables.
    weight : float
        Of the point among others.
    information : ndarray
        `(p, p)` of the measurements taken, priors, and the bounds as a weak prior.
    """

    x: NDArray[np.float64]
    weight: float
    information: NDArray[np.float64]


class Surroundings:
    """The fit that was made, and the information that other measurements would add to it."""

    def __init__(self, found: Identification) -> None:
        self.found = found
        task = found.task
        self.parameters = task.parameters
        self.variables: Variables = task.variables
        self.problem: Problem = task.problem()
        self.scatter = 1.0
        if not found.known_scatter:
            rest = np.concatenate(found.residuals)
            self.scatter = float(np.sum(rest**2)) / max(found.degrees_of_freedom, 1)
            self.scatter = max(self.scatter, 1e-300)
        self.names = self.variables.names
        self.errors = self.parameters.errors

    @property
    def values(self) -> NDArray[np.float64]:
        """The identified values."""
        return np.array(list(self.found.values.values()))

    def point(self, x: NDArray[np.float64], weight: float) -> Point:
        """Return a point with the information of the measurements taken.

        Bounds count as a prior of the width that they have, so that nothing is infinite.
        """
        if not np.isfinite(self.problem.residual(x)).all():
            raise ReceptanceError(self.problem.reason(x))
        jacobian = self.problem.jacobian(x)
        information = jacobian.T @ jacobian / self.scatter
        low, high = self.variables.limits
        bounded = [i for i, name in enumerate(self.names) if name not in self.errors]
        information[bounded, bounded] += 12.0 / (high - low)[bounded] ** 2
        return Point(x, weight, information)

    def named(self, point: Point) -> dict[str, float]:
        """Return the values at a point by name."""
        return dict(zip(self.names, self.variables.to_values(point.x).tolist(), strict=True))

    def placed(self, where: Candidate | FrequencyTarget | ReceptanceTarget) -> tuple[Placed, list[str]]:
        """Return the parameters of another assembly as functions of the unknowns, and the errors that it brings."""
        fresh: list[str] = []
        own = {one.name for one in where.tolerances}
        shared = [one for one in self.parameters.tolerances if one.name not in own]
        place = Place(where.assembly, where.configuration, where.label, where.conditions)
        return self.parameters.at(place, [*shared, *where.tolerances], fresh), fresh

    def rows(self, candidate: Candidate, point: Point) -> tuple[NDArray[np.float64], list[str]]:
        """Return derivatives of a candidate's weighted residuals by variables and its new errors, and their names."""
        placed, fresh = self.placed(candidate)
        vector, slopes = self._vector(point, fresh)
        rows = candidate.rows(placed.apply(candidate.assembly, vector), placed.addresses)
        return rows @ placed.jacobian(vector) * slopes, fresh

    def target(
        self, target: Target, point: Point
    ) -> tuple[list[str], list[NDArray[np.float64]], NDArray[np.float64], list[str]]:
        """Return names of what is to be known, for each its gradients, the values at the point, and new errors.

        The gradients `(k, p + q)` of one name are taken together, as a root mean square.
        """
        if isinstance(target, str):
            index = self.names.index(target)
            gradient = np.zeros((1, len(self.names)))
            gradient[0, index] = 1.0
            return [target], [gradient], point.x[index : index + 1], []
        placed, fresh = self.placed(target)
        vector, slopes = self._vector(point, fresh)
        names, values, rows = target.rows(placed.apply(target.assembly, vector), placed.addresses)
        rows = rows @ placed.jacobian(vector) * slopes
        gradients = [rows] if isinstance(target, ReceptanceTarget) else [row[None, :] for row in rows]
        return names, gradients, values, fresh

    def _vector(self, point: Point, fresh: list[str]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        values = self.variables.to_values(point.x)
        slopes = self.variables.slopes(values)
        return np.append(values, np.zeros(len(fresh))), np.append(slopes, np.ones(len(fresh)))


def joined(
    information: NDArray[np.float64], rows: NDArray[np.float64], own: Sequence[str], names: Sequence[str]
) -> NDArray[np.float64]:
    """Return the information with that of more rows, over the variables and all new errors by name.

    Parameters
    ----------
    information : ndarray
        `(p, p)`.
    rows : ndarray
        `(n, p + q)`; none where only the size is to grow.
    own, names : sequences of str
        Names of the new errors of the rows, and of all.
    """
    p = len(information)
    result = np.eye(p + len(names))
    result[:p, :p] = information
    if rows.size:
        wide = widened(rows, p, own, names)
        result += wide.T @ wide
    return result


def widened(rows: NDArray[np.float64], p: int, own: Sequence[str], names: Sequence[str]) -> NDArray[np.float64]:
    """Return rows over the variables and their own new errors as rows over all new errors."""
    wide = np.zeros((len(rows), p + len(names)))
    wide[:, :p] = rows[:, :p]
    for column, name in enumerate(own):
        wide[:, p + list(names).index(name)] = rows[:, p + column]
    return wide


def deviation(information: NDArray[np.float64], gradient: NDArray[np.float64]) -> float:
    """Return the standard deviation of what has these gradients, their root mean square if there are several."""
    scale = np.sqrt(np.diag(information))
    scaled = gradient / scale
    found = np.linalg.solve(information / np.outer(scale, scale), scaled.T)
    return float(np.sqrt(np.mean(np.sum(scaled.T * found, axis=0))))
