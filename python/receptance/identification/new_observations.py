"""Measurements that a fit does not have: hypothetical ones, and their residuals beside the information of the fit.

The residuals are those of every fit. The information of the fit replaces the priors. Errors that only the new
observations have, such as those of another clamping, are further variables with a standard normal prior. The choice of
the next measurement, predictions of held-out data and the advice of a diagnosis use this.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from receptance import _checks
from receptance.identification.observations import Observation
from receptance.identification.problem import Observed, Problem
from receptance.identification.unknowns import Tolerance, Variables, error_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.identification.mapping import ParameterMap, Parameters


@dataclass(frozen=True, kw_only=True, eq=False)
class Candidate:
    """A hypothetical measurement: an observation without values, the errors that only it has, and its cost.

    `next_measurement` ranks candidates, and takes them as predictions that are to be improved.

    Parameters
    ----------
    observation : Observation
        What would be measured; its label is the name of the candidate. A prediction needs no standard deviation.
    tolerances : Tolerance or sequence of Tolerance, optional
        Errors of the measurement, of its clamping for example. An error with the name of an error of the fit is the
        same error. Errors of the fit that the assembly has apply in any case.
    cost : float, optional
        Cost in any unit that is the same for all candidates.

    Raises
    ------
    TypeError, ValueError
        An observation without a label, or a cost that is not positive.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance import STEEL, Assembly, Part, Segment
    >>> from receptance.identification import Candidate, Observation
    >>> bar = Assembly([Part([Segment(length=0.2, outer_diameter=0.02, material=STEEL)], name="bar")])
    >>> blank = Observation(
    ...     label="blank", assembly=bar, frequency_hz=np.linspace(100.0, 4000.0, 40), standard_deviation=0.01
    ... )
    >>> Candidate(observation=blank, cost=2.0)
    Candidate('blank', 40 lines from 100 to 4000 Hz)
    """

    observation: Observation
    tolerances: tuple[Tolerance, ...] = ()
    cost: float = 1.0

    def __post_init__(self) -> None:
        if not isinstance(self.observation, Observation):
            raise TypeError(f"Candidate: observation is {self.observation!r}, expected an Observation")
        if not self.observation.label:
            raise ValueError(f"Candidate: {self.observation!r} has no label, expected one, which names the candidate")
        owner = f"Candidate {self.label!r}"
        tolerances = _checks.items(f"{owner}: tolerances", self.tolerances, Tolerance, least=0)
        _checks.set_fields(self, {"tolerances": tolerances, "cost": _checks.positive(owner, "cost", self.cost)})

    @property
    def label(self) -> str:
        """Label of the observation."""
        return self.observation.label

    def __repr__(self) -> str:
        return f"Candidate{repr(self.observation).removeprefix('Observation')}"


class NewObservations:
    """Observations as functions of the variables of a fit and of the errors that only these observations have.

    Parameters
    ----------
    parameters : Parameters
        Unknowns and errors of the fit.
    observations : sequence of Observation
        Observations that were not fitted.
    tolerances : sequence of sequence of Tolerance
        Errors of each observation. Errors of one name are one error, in the fit and in all observations.

    Attributes
    ----------
    mappings : list of ParameterMap
        The parameters of each observation's assembly.
    errors : tuple of str
        Names of the `q` errors that are not in the fit.
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
        sites = [observation.site(index) for index, observation in enumerate(self.observations)]
        self.mappings, self.errors = parameters.extended(sites, tolerances)
        self.variables = Variables((*parameters.unknowns, *map(error_of, self.errors)))

    def start(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return fitted variables `(p,)`, followed by the new errors at zero, `(p + q,)`."""
        return np.append(x, np.zeros(len(self.errors)))

    def calculated(self, x: NDArray[np.float64]) -> list[NDArray[np.inexact]]:
        """Return the noise-free data of each observation at fitted variables `(p,)`; see `calculated`."""
        start = self.start(x)
        return [
            calculated(observation, mapping, self.variables, start)
            for observation, mapping in zip(self.observations, self.mappings, strict=True)
        ]

    def problem(
        self, x: NDArray[np.float64], root: NDArray[np.float64], observations: Sequence[Observation] | None = None
    ) -> Problem:
        """Return the residuals of the observations, followed by those of the information of the fit.

        R is `root`, `(p, p)`, with R^T R the information of the fit at the fitted variables `x`. Other `observations`
        have the same parameters and other data.
        """
        whole = np.eye(x.size + len(self.errors))
        whole[: x.size, : x.size] = root
        given = self.observations if observations is None else observations
        observed = [Observed(one, own, "standard deviations") for one, own in zip(given, self.mappings, strict=True)]
        return Problem(self.variables, observed, known=(whole, self.start(x)))


def calculated(
    observation: Observation, mapping: ParameterMap, variables: Variables, x: NDArray[np.float64]
) -> NDArray[np.complex128] | NDArray[np.float64]:
    """Return the noise-free data of an observation: receptances with its measuring chain, or frequencies in Hz.

    Its parameters are functions of variables with the values `x`; the data that it has do not matter. Where the model
    has no value, an InfeasibleError, ReceptanceError or ValueError is raised.
    """
    if observation.is_receptance:
        if not observation.has_values:
            observation = observation.with_values(np.ones(observation.frequency_hz.size))
        problem = Problem(variables, [Observed(observation, mapping, "logarithm")])
        real, imaginary = problem.parts(problem.value(x))[0].reshape(2, -1)
        recorded: NDArray[np.complex128] = observation.receptance * np.exp(-real - 1j * imaginary)
        return recorded
    assembly = mapping.apply(observation.assembly, variables.to_values(x))
    lowest, _ = assembly.lowest_natural_frequencies(max(observation.modes))
    frequencies: NDArray[np.float64] = lowest[np.array(observation.modes) - 1]
    return frequencies


def information_root(root: NDArray[np.float64], variables: Variables) -> NDArray[np.float64]:
    """Return R, `(p, p)`, with R^T R the information of a fit: J^T J, and the bounds of unknowns without a prior.

    `root` is J, or any matrix with the same J^T J. Bounds count as a prior of the same variance, so that every
    direction has information.
    """
    low, high = variables.limits
    free = [unknown.prior is None for unknown in variables.unknowns]
    spans = np.diag(np.where(free, math.sqrt(12.0) / (high - low), 0.0))
    return np.asarray(np.linalg.qr(np.vstack([root, spans]), mode="r"), dtype=np.float64)
