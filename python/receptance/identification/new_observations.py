"""Measurements that a fit does not have: hypothetical ones, and their residuals beside the information of the fit.

The residuals are those of every fit. The information of the fit replaces the priors. Errors that only the new
observations have, such as those of another clamping, are further variables with a standard normal prior. The choice of
the next measurement, predictions of held-out data and the advice of a diagnosis use this.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance import _checks
from receptance.identification.from_frf import Floor
from receptance.identification.observations import MeasuredFrequencies, MeasuredFRF, Observation, altered
from receptance.identification.problem import Observed, Problem
from receptance.identification.unknowns import Tolerance, Variables, error_of
from receptance.model.assembly import Assembly
from receptance.model.coordinates import Coordinate

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from receptance.identification.mapping import ParameterMap, Parameters


@dataclass(frozen=True, kw_only=True, eq=False)
class Candidate:
    """A hypothetical measurement: an observation without data.

    It is a receptance on `frequency_hz`, or the natural frequencies of some `modes`. `next_measurement` ranks
    candidates, and takes them as predictions that are to be improved.

    Parameters
    ----------
    label : str
        Its name.
    assembly : Assembly
        The assembly that would be measured. The values of identified parameters do not matter.
    frequency_hz : array_like, optional
        `(n,)` ascending lines of a receptance in Hz, complex where an exponential window would be used.
    response, excitation : Coordinate, optional
        Coordinates of the motion and of the load; by default y at the tip.
    standard_deviation : array_like, optional
        Standard deviation of the real and of the imaginary part of the logarithm of the receptance, one number or
        `(n,)`; by default 1 %.
    floor : float or Floor, optional
        Standard deviation of errors that no noise model covers, added in quadrature as in `MeasuredFRF.from_frf`.
    modes : sequence of int, optional
        Ascending numbers of the elastic modes whose natural frequencies would be measured; the lowest is 1.
    standard_deviation_hz : array_like, optional
        Standard deviation of these frequencies in Hz, one number or one for each mode. A prediction needs none.
    tolerances : Tolerance or sequence of Tolerance, optional
        Errors of the measurement, of its clamping for example. An error with the name of an error of the fit is the
        same error. Errors of the fit that the assembly has apply in any case.
    configuration : str, optional
        Name of its configuration, for laws and tolerances; by default the label.
    conditions : mapping of str to float, optional
        Numbers that describe it, in SI units, for laws.
    cost : float, optional
        Cost in any unit that is the same for all candidates.

    Raises
    ------
    TypeError, ValueError
        Neither lines nor modes, or both; lines, modes or standard deviations that cannot be used.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance import STEEL, Assembly, Part, Segment
    >>> from receptance.identification import Candidate
    >>> bar = Assembly([Part([Segment(length=0.2, outer_diameter=0.02, material=STEEL)], name="bar")])
    >>> blank = Candidate(label="blank", assembly=bar, frequency_hz=np.linspace(100.0, 4000.0, 40))
    >>> blank
    Candidate('blank', receptance on 40 lines from 100 to 4000 Hz)
    >>> blank.observation(bar.receptance(blank.frequency_hz))
    MeasuredFRF('blank', 40 lines from 100 to 4000 Hz)
    """

    label: str
    assembly: Assembly
    frequency_hz: NDArray[np.inexact] | None = None
    response: Coordinate = field(default_factory=Coordinate)
    excitation: Coordinate = field(default_factory=Coordinate)
    standard_deviation: ArrayLike = 0.01
    floor: float | Floor = 0.0
    modes: tuple[int, ...] | None = None
    standard_deviation_hz: ArrayLike | None = None
    tolerances: tuple[Tolerance, ...] = ()
    configuration: str = ""
    conditions: Mapping[str, float] = field(default_factory=dict)
    cost: float = 1.0

    def __post_init__(self) -> None:
        if not isinstance(self.label, str) or not self.label:
            raise TypeError(f"Candidate: label is {self.label!r}, expected a name as text")
        owner = f"Candidate {self.label!r}"
        if (self.frequency_hz is None) == (self.modes is None):
            both = "neither frequency_hz nor modes is" if self.modes is None else "frequency_hz and modes are both"
            raise ValueError(f"{owner}: {both} given, expected one of the two")
        if self.modes is not None and not len(self.modes):
            raise ValueError(f"{owner}: modes is empty, expected at least one number")
        fields: dict[str, Any] = {
            "tolerances": _checks.items(f"{owner}: tolerances", self.tolerances, Tolerance, least=0),
            "configuration": self.configuration or self.label,
            "floor": self.floor if isinstance(self.floor, Floor) else Floor(relative=self.floor, frequency=0.0),
            "cost": _checks.positive(owner, "cost", self.cost),
        }
        _checks.set_fields(self, fields)
        try:
            if self.frequency_hz is not None:
                _checks.frequencies(self.frequency_hz)
            blank = self._blank
        except (TypeError, ValueError) as error:
            kind = "MeasuredFRF" if self.modes is None else "MeasuredFrequencies"
            text = str(error).removeprefix(f"{kind} {self.label!r}: ")
            raise type(error)(f"{owner}: {text}") from None
        checked = ("conditions", "frequency_hz", "standard_deviation", "modes", "standard_deviation_hz")
        given = [name for name in checked if getattr(self, name) is not None and hasattr(blank, name)]
        _checks.set_fields(self, {name: getattr(blank, name) for name in given})

    def observation(self, data: ArrayLike | None = None) -> MeasuredFRF | MeasuredFrequencies:
        """Return the measurement as an observation.

        Parameters
        ----------
        data : array_like, optional
            `(n,)` receptances in SI units, or natural frequencies in Hz. By default placeholders:
            ones, and 1 Hz, 2 Hz and so on.

        Returns
        -------
        MeasuredFRF or MeasuredFrequencies
            With standard deviations that include the floor; those of frequencies are 1 Hz where none were given.
        """
        blank = self._blank
        if data is None:
            return blank
        if isinstance(blank, MeasuredFrequencies):
            return altered(blank, frequency_hz=np.asarray(data, dtype=np.float64))
        values = np.asarray(data, dtype=np.complex128)
        variance = np.square(np.asarray(self.standard_deviation, dtype=np.float64))
        if isinstance(self.floor, Floor) and self.floor:
            variance = variance + self.floor.variance(blank.frequency_hz.real, values)
        return altered(blank, receptance=values, standard_deviation=np.sqrt(variance))

    @cached_property
    def _blank(self) -> MeasuredFRF | MeasuredFrequencies:
        """The observation with ones as data; it checks the fields."""
        common: dict[str, Any] = {
            "assembly": self.assembly,
            "label": self.label,
            "configuration": self.configuration,
            "conditions": self.conditions,
        }
        if self.frequency_hz is None:
            modes = () if self.modes is None else self.modes
            return MeasuredFrequencies(
                frequency_hz=np.arange(1.0, 1.0 + len(modes)),
                modes=modes,
                standard_deviation_hz=1.0 if self.standard_deviation_hz is None else self.standard_deviation_hz,
                **common,
            )
        return MeasuredFRF(
            frequency_hz=self.frequency_hz,
            receptance=np.ones(np.size(self.frequency_hz)),
            response=self.response,
            excitation=self.excitation,
            standard_deviation=self.standard_deviation,
            **common,
        )

    def __repr__(self) -> str:
        if self.frequency_hz is None:
            what = f"natural frequencies of modes {', '.join(map(str, self.modes or ()))}"
        else:
            low, high = self.frequency_hz[[0, -1]].real
            what = f"receptance on {self.frequency_hz.size} lines from {low:g} to {high:g} Hz"
        return f"Candidate({self.label!r}, {what})"


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
    if not isinstance(observation, MeasuredFrequencies):
        problem = Problem(variables, [Observed(observation, mapping, "logarithm")])
        real, imaginary = problem.parts(problem.value(x))[0].reshape(2, -1)
        recorded: NDArray[np.complex128] = observation.data * np.exp(-real - 1j * imaginary)
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
