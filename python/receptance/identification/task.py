"""The input of a fit: observations, parameters and units of the residuals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

from receptance.identification.laws import Law
from receptance.identification.mapping import ParameterMap, Parameters
from receptance.identification.observations import MeasuredFRF, Observation, Unit
from receptance.identification.peaks import find_bands, within
from receptance.identification.problem import Observed, Problem
from receptance.identification.unknowns import Variables

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from receptance.identification.peaks import Bands

__all__ = ["Task"]


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
    def mappings(self) -> list[ParameterMap]:
        """Parameters of each observation's assembly as functions of the unknowns."""
        return self.parameters.of([observation.site(i) for i, observation in enumerate(self.observed)])

    @cached_property
    def selected(self) -> tuple[Observation, ...]:
        """The observations on the lines within the bands."""
        return tuple(
            self._in_bands(observation, unit) for observation, unit in zip(self.observed, self.units, strict=True)
        )

    @property
    def independent_values(self) -> float:
        """Effective number of independent real numbers that are fitted."""
        return sum(one.independent_values for one in self.selected)

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
        selected = self.selected
        if lines is not None:
            selected = tuple(observation.select(own) for observation, own in zip(self.observed, lines, strict=True))
        observed = [Observed(*one) for one in zip(selected, self.mappings, self.units, strict=True)]
        return Problem(self.variables, observed, self.threads, smoothing=smoothing)

    def approach(self) -> Problem:
        """Return a problem whose fit is a start for percentages: logarithms on all lines.

        Percentages in bands around measured peaks do not depend on calculated peaks outside of them.
        """
        return replace(
            self, units=tuple(observation.unit for observation in self.observed), band_width_percent=0.0
        ).problem()

    def noisier(self, factor: float) -> Task:
        """Return the task with the stated standard deviations times a factor."""
        more = factor / self.noise_factor
        return replace(
            self, observed=tuple(observation.noisier(more) for observation in self.observed), noise_factor=factor
        )

    def without_errors(self) -> Task:
        """Return the task with exact dimensions and materials; its vector is the first part of that of this task."""
        exact = [replace(one, individual=0.0) if isinstance(one, Law) else one for one in self.parameters.given]
        sites = [observation.site(i) for i, observation in enumerate(self.observed)]
        return replace(self, parameters=Parameters(exact, (), sites))

    def on(self, observed: Sequence[Observation]) -> Task:
        """Return the task with other data, one observation for each, all with standard deviations."""
        units: list[Unit] = ["standard deviations"] * len(observed)
        return replace(self, observed=tuple(observed), units=tuple(units), bands=None)

    def _in_bands(self, observation: Observation, unit: Unit) -> Observation:
        if not isinstance(observation, MeasuredFRF):
            return observation
        bands = self.bands
        if bands is None and unit == "percent":
            bands = find_bands(observation, width_percent=self.band_width_percent)
        return observation if bands is None else observation.select(within(observation, bands))
