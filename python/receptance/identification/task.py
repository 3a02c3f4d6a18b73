"""What is to be fitted to what: observations, parameters and weights, ready to be evaluated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

from receptance.errors import ReceptanceError
from receptance.identification.bands import find_bands, within
from receptance.identification.factors import FACTORS
from receptance.identification.frequency_residuals import FrequencyResidual
from receptance.identification.laws import Law
from receptance.identification.mapping import Addresses, MappedResidual, Parameters, Place, Placed
from receptance.identification.models import ModelledProblem, Models
from receptance.identification.observations import MeasuredFrequencies, MeasuredFRF, on_lines
from receptance.identification.priors import PriorResidual
from receptance.identification.problem import Problem
from receptance.identification.reduced import JointResidual, only_joint
from receptance.identification.residuals import FRFResidual, Residual, Unit
from receptance.identification.unknowns import Variables

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from receptance.identification.bands import Bands

__all__ = ["Observation", "Task", "place_of"]

Observation = MeasuredFRF | MeasuredFrequencies


def place_of(observation: Observation, index: int) -> Place:
    """Return what an observation is of; without a name it is a configuration of its own."""
    name = observation.configuration or f"observation {index}"
    factors = FACTORS if isinstance(observation, MeasuredFRF) else ()
    return Place(observation.assembly, name, observation.label, observation.conditions, factors)


@dataclass(frozen=True, eq=False)
class Task:
    """Observations, the parameters to find, and what a residual of 1 means.

    Attributes
    ----------
    observed : tuple of MeasuredFRF and MeasuredFrequencies
        What was measured.
    parameters : Parameters
        The fitted vector and its way into the assemblies.
    units : tuple of str
        What a residual of 1 means, for each observation.
    bands : list of (float, float) or None
        Lines that count, in Hz.
    band_width_percent : float
        Of bands that are found around peaks.
    threads : int or None
        As in `Assembly.receptance`.
    noise_factor : float
        By how much the standard deviations of `observed` are larger than stated, see `noisier`.
    """

    observed: tuple[Observation, ...]
    parameters: Parameters
    units: tuple[Unit, ...]
    bands: Bands | None = None
    band_width_percent: float = 5.0
    threads: int | None = None
    noise_factor: float = 1.0

    @cached_property
    def variables(self) -> Variables:
        """The fitted vector."""
        return Variables(self.parameters.unknowns)

    @cached_property
    def placed(self) -> list[Placed]:
        """The parameters of each observation's assembly."""
        return self.parameters.of([place_of(o, i) for i, o in enumerate(self.observed)])

    def problem(self) -> Problem:
        """Return all residuals on all lines."""
        return self._joined([self._residual(i) for i in range(len(self.observed))])

    def quick(self, problem: Problem) -> Problem:
        """Return the same problem with its fits in the core, compressed where only one joint is unknown."""
        if self.parameters.plain:
            pairs = zip(self.observed, problem.residuals, strict=False)
            reduced = [self._reduced(observation, residual) for observation, residual in pairs]
            if all(isinstance(residual, JointResidual) for residual in reduced):
                return self._joined(reduced)
        return self.modelled(problem) or problem

    def modelled(
        self, problem: Problem, lines: Sequence[NDArray[np.intp] | None] | None = None
    ) -> ModelledProblem | None:
        """Return the same problem with whole models in the core, if it knows all that is in them.

        `lines` are those of each observation that count; by default all.
        """
        models = Models.of(self, problem, lines)
        return None if models is None else ModelledProblem(problem, models)

    def approach(self) -> Problem:
        """Return the residuals that bring a start near, before percentages in bands are fitted.

        While the calculated peaks are outside the bands around the measured ones, a percentage is blind to where they
        are; the logarithm on all lines is not.
        """
        units: list[Unit] = ["logarithm" if isinstance(o, MeasuredFRF) else "relative" for o in self.observed]
        return replace(self, units=tuple(units), band_width_percent=0.0).problem()

    def noisier(self, factor: float) -> Task:
        """Return the task with the stated standard deviations multiplied by a factor."""
        more = factor / self.noise_factor
        return replace(self, observed=tuple(one.noisier(more) for one in self.observed), noise_factor=factor)

    def without_errors(self) -> Task:
        """Return the task with every dimension and material exact; its vector is the first part of this one's."""
        exact = [replace(one, individual=0.0) if isinstance(one, Law) else one for one in self.parameters.wanted]
        places = [place_of(o, i) for i, o in enumerate(self.observed)]
        return replace(self, parameters=Parameters(exact, (), places))

    def on(self, observed: Sequence[Observation], units: Sequence[Unit]) -> Task:
        """Return the same parameters on other data of the same places, one observation for one."""
        return replace(self, observed=tuple(observed), units=tuple(units), bands=None)

    def _joined(self, residuals: list[Residual]) -> Problem:
        if any(unknown.prior is not None for unknown in self.parameters.unknowns):
            residuals = [*residuals, PriorResidual(self.parameters.unknowns)]
        return Problem(residuals, self.variables)

    def _residual(self, index: int) -> Residual:
        if self.parameters.plain:
            return self._own(index, self.variables)
        placed = self.placed[index]
        return MappedResidual(self._own(index, Addresses(placed.addresses)), placed)

    def independent_numbers(self) -> list[float]:
        """Return how many independent numbers each observation has: two a line, over `correlated_lines`."""
        found = []
        for index, one in enumerate(self.observed):
            if isinstance(one, MeasuredFRF):
                chosen = self.chosen(index)
                found.append(2.0 * (one if chosen is None else on_lines(one, chosen)).independent_lines)
            else:
                found.append(float(one.frequency_hz.size + one.damped.size))
        return found

    def chosen(self, index: int) -> NDArray[np.bool_] | None:
        """Return which lines of a measured FRF count; None for all."""
        observation, bands = self.observed[index], self.bands
        if isinstance(observation, MeasuredFrequencies):
            return None
        if bands is None and self.units[index] == "percent":
            bands = find_bands(observation, width_percent=self.band_width_percent)
        return None if bands is None else within(observation, bands)

    def _own(self, index: int, addressed: Variables | Addresses) -> Residual:
        observation, unit = self.observed[index], self.units[index]
        if isinstance(observation, MeasuredFrequencies):
            return FrequencyResidual(observation, addressed, unit)
        return FRFResidual(observation, addressed, unit, self.chosen(index), self.threads)

    def _reduced(self, observation: Observation, residual: Residual) -> Residual:
        """Return the same residual compressed, where only one joint of the observation's assembly is unknown."""
        variables = self.variables
        if isinstance(observation, MeasuredFrequencies) or residual.size <= 2 * len(variables.addresses):
            return residual
        joint = only_joint(observation, variables)
        if joint is None:
            return residual
        chosen = None if self.bands is None else within(observation, self.bands)
        try:
            return JointResidual(observation, variables, residual.unit, chosen, joint, self.threads)
        except (ReceptanceError, ValueError):
            # The joint at the bounds has no value; the fit itself may never go there.
            return residual
