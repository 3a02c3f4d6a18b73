"""The input of a fit: observations, parameters and units of the residuals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

from receptance.identification.factors import FACTORS
from receptance.identification.laws import Law
from receptance.identification.mapping import Parameters, Place, Placed
from receptance.identification.observations import MeasuredFrequencies, MeasuredFRF, on_lines
from receptance.identification.peaks import find_bands, within
from receptance.identification.problem import Observed, Problem
from receptance.identification.residuals import Unit
from receptance.identification.unknowns import Variables

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from receptance.identification.peaks import Bands

__all__ = ["Observation", "Task", "place_of"]

Observation = MeasuredFRF | MeasuredFrequencies


def place_of(observation: Observation, index: int) -> Place:
    """Return the assembly, configuration and conditions of an observation; unnamed ones are configurations."""
    name = observation.configuration or f"observation {index}"
    factors = FACTORS if isinstance(observation, MeasuredFRF) else ()
    return Place(observation.assembly, name, observation.label, observation.conditions, factors)


@dataclass(frozen=True, eq=False)
class Task:
    """Observations, unknown parameters and units of the residuals.

    Attributes
    ----------
    observed : tuple of MeasuredFRF and MeasuredFrequencies
        The observations.
    parameters : Parameters
        The unknowns and their map to parameters of the assemblies.
    units : tuple of str
        Unit of the residuals of each observation.
    bands : list of (float, float) or None
        Bands of the lines that are used, in Hz; by default all.
    band_width_percent : float
        Half width of bands around peaks, with percentages.
    threads : int or None
        As in `Assembly.receptance`.
    noise_factor : float
        Factor of the standard deviations of `observed` over the stated ones, see `noisier`.
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
        """Parameters of each observation's assembly as functions of the unknowns."""
        return self.parameters.of([place_of(o, i) for i, o in enumerate(self.observed)])

    def problem(
        self, lines: Sequence[NDArray[np.intp] | None] | None = None, smoothing: float | None = None
    ) -> Problem:
        """Return the residuals as a problem of the core.

        Parameters
        ----------
        lines : sequence of ndarray or None, optional
            Lines of each observation; by default all within the bands.
        smoothing : float, optional
            As of `Problem`.
        """
        chosen = [self.chosen(i) for i in range(len(self.observed))] if lines is None else lines
        observed = [Observed(*one) for one in zip(self.observed, self.placed, self.units, chosen, strict=True)]
        return Problem(self.variables, observed, self.threads, smoothing=smoothing)

    def approach(self) -> Problem:
        """Return a problem whose fit is a start for percentages: logarithms on all lines.

        Percentages in bands around measured peaks do not depend on calculated peaks outside of them.
        """
        units: list[Unit] = ["logarithm" if isinstance(o, MeasuredFRF) else "relative" for o in self.observed]
        return replace(self, units=tuple(units), band_width_percent=0.0).problem()

    def noisier(self, factor: float) -> Task:
        """Return the task with the stated standard deviations times a factor."""
        more = factor / self.noise_factor
        return replace(self, observed=tuple(one.noisier(more) for one in self.observed), noise_factor=factor)

    def without_errors(self) -> Task:
        """Return the task with exact dimensions and materials; its vector is the first part of that of this task."""
        exact = [replace(one, individual=0.0) if isinstance(one, Law) else one for one in self.parameters.wanted]
        places = [place_of(o, i) for i, o in enumerate(self.observed)]
        return replace(self, parameters=Parameters(exact, (), places))

    def on(self, observed: Sequence[Observation], units: Sequence[Unit]) -> Task:
        """Return the task with other data, one observation for each."""
        return replace(self, observed=tuple(observed), units=tuple(units), bands=None)

    def independent_numbers(self) -> list[float]:
        """Return the number of independent numbers of each observation: two per line, over `correlated_lines`."""
        found = []
        for index, one in enumerate(self.observed):
            if isinstance(one, MeasuredFRF):
                chosen = self.chosen(index)
                found.append(2.0 * (one if chosen is None else on_lines(one, chosen)).independent_lines)
            else:
                found.append(float(one.frequency_hz.size + one.damped.size))
        return found

    def chosen(self, index: int) -> NDArray[np.bool_] | None:
        """Return the mask of the lines of a measured FRF within the bands; None for all."""
        observation, bands = self.observed[index], self.bands
        if isinstance(observation, MeasuredFrequencies):
            return None
        if bands is None and self.units[index] == "percent":
            bands = find_bands(observation, width_percent=self.band_width_percent)
        return None if bands is None else within(observation, bands)
