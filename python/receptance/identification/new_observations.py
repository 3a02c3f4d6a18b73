"""Observations that a fit has not seen: their noise-free data and their residuals, beside the information of the fit.

The residuals are those of every fit. The information of the fit takes the place of the priors, and errors that only the
new observations have, those of another clamping for example, are further variables, which are standard normal. The
choice of the next measurement, predictions of held-out data and the advice of a diagnosis all use this.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance.identification.laws import Tolerance, error_of
from receptance.identification.observations import MeasuredFRF
from receptance.identification.problem import Observed, Problem
from receptance.identification.task import Observation, place_of
from receptance.identification.unknowns import Variables

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.identification.mapping import Parameters, Placed

__all__ = ["NewObservations", "calculated", "information_root", "standard_deviations"]


class NewObservations:
    """Observations as functions of the variables of a fit and of the errors that only these observations have.

    Parameters
    ----------
    parameters : Parameters
        Unknowns and errors of the fit.
    observations : sequence of MeasuredFRF and MeasuredFrequencies
        Observations that were not fitted.
    tolerances : sequence of sequence of Tolerance
        Errors of each observation. Errors of one name are one error, in the fit and in all observations.

    Attributes
    ----------
    placed : list of Placed
        The parameters of each observation's assembly.
    errors : tuple of str
        Names of the `q` errors that the fit does not know.
    variables : Variables
        The `p` fitted variables, followed by these errors.
    """

    def __init__(
        self,
        parameters: Parameters,
        observations: Sequence[Observation],
        tolerances: Sequence[Sequence[Tolerance]],
    ) -> None:
        self.observations = tuple(observations)
        places = [place_of(one, index) for index, one in enumerate(self.observations)]
        self.placed, self.errors = parameters.extended(places, tolerances)
        self.variables = Variables((*parameters.unknowns, *map(error_of, self.errors)))

    def start(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return fitted variables `(p,)`, followed by the new errors at zero, `(p + q,)`."""
        return np.append(x, np.zeros(len(self.errors)))

    def calculated(self, x: NDArray[np.float64]) -> list[NDArray[Any]]:
        """Return the noise-free data of each observation at fitted variables `(p,)`; see `calculated`."""
        start = self.start(x)
        return [
            calculated(one, placed, self.variables, start)
            for one, placed in zip(self.observations, self.placed, strict=True)
        ]

    def problem(
        self, x: NDArray[np.float64], root: NDArray[np.float64], observations: Sequence[Observation] | None = None
    ) -> Problem:
        """Return the residuals of the observations, followed by those of the information of the fit.

        Parameters
        ----------
        x : ndarray
            `(p,)` fitted variables.
        root : ndarray
            `(p, p)`, R with R^T R the information of the fit at `x`.
        observations : sequence of MeasuredFRF and MeasuredFrequencies, optional
            The same observations with other data.
        """
        whole = np.eye(x.size + len(self.errors))
        whole[: x.size, : x.size] = root
        seen = self.observations if observations is None else observations
        observed = [Observed(one, own, "standard deviations") for one, own in zip(seen, self.placed, strict=True)]
        return Problem(self.variables, observed, known=(whole, self.start(x)))


def calculated(
    one: Observation, placed: Placed, variables: Variables, x: NDArray[np.float64]
) -> NDArray[np.complex128] | NDArray[np.float64]:
    """Return the noise-free data of an observation: receptances with its measuring chain, or frequencies in Hz.

    The data that it has do not matter.

    Parameters
    ----------
    one : MeasuredFRF or MeasuredFrequencies
        The observation.
    placed : Placed
        The parameters of its assembly.
    variables : Variables
        The variables that these are functions of.
    x : ndarray
        Values of the variables.

    Raises
    ------
    InfeasibleError, ReceptanceError, ValueError
        The model has no value there.
    """
    if isinstance(one, MeasuredFRF):
        problem = Problem(variables, [Observed(one, placed, "logarithm")])
        real, imaginary = problem.parts(problem.value(x))[0].reshape(2, -1)
        recorded: NDArray[np.complex128] = one.receptance * np.exp(-real - 1j * imaginary)
        return recorded
    assembly = placed.apply(one.assembly, variables.to_values(x))
    lowest, _ = assembly.lowest_natural_frequencies(max(one.modes))
    frequencies: NDArray[np.float64] = lowest[np.array(one.modes) - 1]
    return frequencies


def information_root(jacobian: NDArray[np.float64], variables: Variables) -> NDArray[np.float64]:
    """Return R, `(p, p)`, with R^T R the information of a fit: J^T J, and the bounds of unknowns without a prior.

    Bounds count as a prior of the same variance, so that every direction has information.
    """
    low, high = variables.limits
    free = [unknown.prior is None for unknown in variables.unknowns]
    spans = np.diag(np.where(free, math.sqrt(12.0) / (high - low), 0.0))
    return np.asarray(np.linalg.qr(np.vstack([jacobian, spans]), mode="r"), dtype=np.float64)


def standard_deviations(one: Observation) -> NDArray[np.float64]:
    """Return the standard deviation of each residual of an observation in the unit of its data; ones if none given."""
    if isinstance(one, MeasuredFRF):
        spread = np.ones(one.frequency_hz.size) if one.standard_deviation is None else one.standard_deviation
        return np.tile(spread, 2)
    if one.standard_deviation_hz is None:
        return np.ones(one.frequency_hz.size + one.damped.size)
    damping = one.standard_deviation_damping
    return np.append(one.standard_deviation_hz, [] if damping is None else damping[one.damped])
