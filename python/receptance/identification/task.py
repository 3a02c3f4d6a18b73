"""What is to be fitted to what: observations, parameters and weights, ready to be evaluated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

from receptance.identification.bands import find_bands, within
from receptance.identification.factors import FACTORS
from receptance.identification.laws import Law
from receptance.identification.mapping import Parameters, Place, Placed
from receptance.identification.observations import MeasuredFrequencies, MeasuredFRF, on_lines
from receptance.identification.problem import Observed, Problem
from receptance.identification.residuals import Unit
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

    def problem(
        self, lines: Sequence[NDArray[np.intp] | None] | None = None, smoothing: float | None = None
    ) -> Problem:
        """Return the residuals as a problem of the core.

        `lines` are those of each observation that are used, by default all that count; `smoothing` as of `Problem`.
        """
        chosen = [self.chosen(i) for i in range(len(self.observed))] if lines is None else lines
        observed = [Observed(*one) for one in zip(self.observed, self.placed, self.units, chosen, strict=True)]
        return Problem(self.variables, observed, self.threads, smoothing=smoothing)

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
