"""How the scatter of the data and the tolerances go through a fit into predictions, to first order.

A fit that takes dimensions as exact answers an error t of a dimension by moving the fitted variables x: it minimises
|J dx + J_t t|^2, so dx = -(J^T J)^-1 J^T J_t t = S t, where J and J_t are the derivatives of the weighted residuals. A
prediction y then errs by dy/dx (e + S t) + dy/dt t, where e has the covariance of the fit. What an error does through
the joint and what it does directly may cancel, as it does where the predicted assembly is like the measured one.

Errors that were fitted are unknowns like others: their part comes with the covariance of the fit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, cast

import numpy as np

from receptance.identification import MeasuredFRF, find_bands
from receptance.identification.bands import within
from receptance.identification.frequency_residuals import FrequencyResidual
from receptance.identification.laws import Tolerance
from receptance.identification.mapping import Addresses, Place
from receptance.identification.problem import prior_table
from receptance.identification.unknowns import Variables

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.assembly import Assembly
    from receptance.campaign.tolerances import Effects
    from receptance.coordinates import Coordinate
    from receptance.identification import Identification, MeasuredFrequencies
    from receptance.identification.residuals import Unit

__all__ = ["NOWHERE", "Moved", "Propagation", "Scatter", "Where", "frequency_slopes", "frf_slopes", "tolerances_of"]

_GROWTH = 1.5


@dataclass(frozen=True)
class Scatter:
    """Standard deviations of predicted numbers, `(n,)` each, and what they consist of.

    Attributes
    ----------
    fit : ndarray
        From the scatter of the data, through the fit; infinite where a parameter that matters is not determined.
    errors : dict of str to ndarray
        By error of the tolerances: signed change for one standard deviation of it, through the fit included.
    """

    fit: NDArray[np.float64]
    errors: dict[str, NDArray[np.float64]]

    @property
    def tolerances(self) -> NDArray[np.float64]:
        """From all tolerances together."""
        return np.sqrt(sum((change**2 for change in self.errors.values()), np.zeros_like(self.fit)))

    @property
    def total(self) -> NDArray[np.float64]:
        """From both."""
        return np.hypot(self.fit, self.tolerances)


@dataclass(frozen=True)
class Where:
    """The configuration and conditions of what is predicted, for laws."""

    configuration: str = ""
    conditions: Mapping[str, float] = field(default_factory=dict)


NOWHERE = Where()


@dataclass(frozen=True)
class Moved:
    """How the parameters of an assembly move with the fitted variables `(m, p)` and with unfitted errors `(m, q)`."""

    addresses: tuple[str, ...]
    variables: NDArray[np.float64]
    errors: NDArray[np.float64]
    fresh: list[str]


def tolerances_of(effects: Effects, labels: str | None = None) -> list[Tolerance]:
    """Return the errors of an assembly as tolerances, perhaps of one observation alone.

    What is stated with a standard deviation of zero is exact, and no error.
    """
    some = {name: {a: d for a, d in moves.items() if d} for name, moves in effects.items()}
    return [Tolerance(name=name, moves=moves, labels=labels) for name, moves in some.items() if moves]


class Propagation:
    """The reaction of a fit to the errors of its observations, ready for any prediction.

    Parameters
    ----------
    fit : Identification or None
        None where nothing was identified: then only the predicted assembly's own errors count.
    observations, effects : sequences
        What the fit saw, and the errors of each.
    """

    def __init__(
        self,
        fit: Identification | None,
        observations: Sequence[MeasuredFRF | MeasuredFrequencies],
        effects: Sequence[Effects],
        band_width_percent: float = 5.0,
    ) -> None:
        self.fit = fit
        self.variables = None if fit is None else Variables(fit.unknowns)
        self.errors: tuple[str, ...] = tuple(sorted({name for own in effects for name in own}))
        count = 0 if fit is None else len(fit.unknowns)
        self.reaction = np.zeros((count, len(self.errors)))
        """Change of the fitted variables for one standard deviation of each error, `(p, n_errors)`."""
        if fit is None or not self.errors:
            return
        rows = [
            self._rows(observation, assembly, unit, own, band_width_percent)
            for observation, assembly, unit, own in zip(observations, fit.assemblies, fit.units, effects, strict=True)
        ]
        jacobian = np.vstack([row[0] for row in rows])
        moved = np.vstack([row[1] for row in rows])
        priors = prior_table(fit.unknowns)
        if len(priors):
            # Priors oppose the errors as well.
            known = np.zeros((len(priors), count))
            known[np.arange(len(priors)), priors[:, 0].astype(np.intp)] = priors[:, 1]
            jacobian = np.vstack([jacobian, known])
            moved = np.vstack([moved, np.zeros((len(priors), len(self.errors)))])
        scale = np.linalg.norm(jacobian, axis=0)
        scale = np.where(scale > 0.0, scale, 1.0)
        found, *_ = np.linalg.lstsq(jacobian / scale, -moved, rcond=None)
        self.reaction = found / scale[:, None]

    def standard_errors(self) -> dict[str, float]:
        """Standard errors of the identified values from data and tolerances together, in SI units by address."""
        if self.fit is None or self.variables is None:
            return {}
        variance = np.diag(self.fit.covariance) + np.sum(self.reaction**2, axis=1)
        values = np.array([self.fit.values[name] for name in self.variables.names])
        errors = np.sqrt(variance) * self.variables.slopes(values)
        return dict(zip(self.variables.names, errors.tolist(), strict=True))

    def frequencies(
        self, assembly: Assembly, modes: Sequence[int], near_hz: float, effects: Effects, at: Where = NOWHERE
    ) -> tuple[NDArray[np.float64], Scatter]:
        """Return natural frequencies of an assembly with the identified values, in Hz, and their scatter."""
        placed = self.placed(assembly, effects, at)
        found, slope = frequency_slopes(assembly, modes, near_hz, placed.addresses)
        return found, self.scatter(slope, placed)

    def receptance(
        self,
        assembly: Assembly,
        frequency_hz: NDArray[np.float64] | NDArray[np.complex128],
        response: Coordinate,
        excitation: Coordinate,
        effects: Effects,
        at: Where = NOWHERE,
        force: NDArray[np.float64] | None = None,
    ) -> tuple[NDArray[np.complex128], Scatter, Scatter]:
        """Return a receptance and the scatter of the real and of the imaginary part of its logarithm."""
        placed = self.placed(assembly, effects, at)
        found, slope = frf_slopes(assembly, frequency_hz, response, excitation, placed.addresses, force)
        real, imaginary = (self.scatter(part, placed) for part in (slope.real, slope.imag))
        return found, real, imaginary

    def placed(self, assembly: Assembly, effects: Effects, at: Where) -> Moved:
        """Return how parameters of an assembly move with the unknowns, and with errors that the fit does not know."""
        tolerances = tolerances_of(effects)
        if self.fit is None or self.variables is None:
            addresses = tuple(dict.fromkeys(address for moved in effects.values() for address in moved))
            direct = [[moved.get(address, 0.0) for moved in effects.values()] for address in addresses]
            width = len(effects)
            return Moved(addresses, np.zeros((len(addresses), 0)), np.reshape(direct, (-1, width)), list(effects))
        fresh: list[str] = []
        place = Place(assembly, at.configuration, "", at.conditions)
        placed = self.fit.task.parameters.at(place, tolerances, fresh)
        values = np.array([self.fit.values[name] for name in self.variables.names])
        slope = placed.jacobian(np.append(values, np.zeros(len(fresh))))
        own = slope[:, : values.size] * self.variables.slopes(values)
        return Moved(placed.addresses, own, slope[:, values.size :], fresh)

    def scatter(self, slope: NDArray[np.float64], moved: Moved) -> Scatter:
        """Return the scatter of numbers with derivatives `(n, m)` per SI unit of the addresses of `moved`."""
        direct = dict(zip(moved.fresh, (slope @ moved.errors).T, strict=True))
        nothing = np.zeros(len(slope))
        if self.fit is None:
            return Scatter(nothing, direct)
        to_variables = slope @ moved.variables
        through = dict(zip(self.errors, (to_variables @ self.reaction).T, strict=True))
        errors = {
            name: direct.get(name, nothing) + through.get(name, nothing) for name in dict.fromkeys([*direct, *through])
        }
        return Scatter(_spread(to_variables, self.fit.covariance), errors)

    def _rows(
        self,
        observation: MeasuredFRF | MeasuredFrequencies,
        assembly: Assembly,
        unit: str,
        effects: Effects,
        band_width_percent: float,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the weighted residuals' derivatives: to the fitted variables, and for one deviation of each error."""
        placed = self.placed(assembly, effects, Where(observation.configuration, observation.conditions))
        addresses = placed.addresses
        if isinstance(observation, MeasuredFRF):
            slope = _weighted_frf(observation, assembly, unit, addresses, band_width_percent)
        else:
            values = np.array([assembly.get(address) for address in addresses])
            residual = FrequencyResidual(observation, Addresses(addresses), cast("Unit", unit))
            _, slope = residual.evaluate(values, np.ones(values.size))
        direct = dict(zip(placed.fresh, (slope @ placed.errors).T, strict=True))
        columns = [direct.get(name, np.zeros(len(slope))) for name in self.errors]
        return slope @ placed.variables, np.stack(columns, axis=1)


def frequency_slopes(
    assembly: Assembly, modes: Sequence[int], near_hz: float, addresses: Sequence[str]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return natural frequencies of some modes in Hz, `(m,)`, and derivatives in Hz per SI unit, `(m, p)`."""
    upper = _GROWTH * near_hz
    while True:
        found, slope = assembly.natural_frequency_derivatives(upper, list(addresses))
        if found.size >= max(modes):
            break
        upper *= _GROWTH
    rows = [mode - 1 for mode in modes]
    return found[rows], slope[rows]


def frf_slopes(
    assembly: Assembly,
    frequency_hz: NDArray[np.float64] | NDArray[np.complex128],
    response: Coordinate,
    excitation: Coordinate,
    addresses: Sequence[str],
    force: NDArray[np.float64] | None = None,
) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Return a receptance `(n,)` and the derivatives of its logarithm per SI unit, `(n, p)`."""
    found, slope = assembly.derivatives(
        frequency_hz, list(addresses), response=response, excitation=excitation, force=force
    )
    return found, slope / found[:, None]


def _weighted_frf(
    frf: MeasuredFRF, assembly: Assembly, unit: str, addresses: Sequence[str], width_percent: float
) -> NDArray[np.float64]:
    lines = frf.frequency_hz
    if unit == "percent":
        chosen = within(frf, find_bands(frf, width_percent=width_percent))
        force = None if frf.force is None else frf.force[chosen]
        _, slope = frf_slopes(assembly, lines[chosen], frf.response, frf.excitation, addresses, force)
        return 100.0 * slope.real
    _, slope = frf_slopes(assembly, lines, frf.response, frf.excitation, addresses, frf.force)
    if unit == "standard deviations" and frf.standard_deviation is not None:
        slope = slope / frf.standard_deviation[:, None]
    return np.vstack([slope.real, slope.imag])


def _spread(slope: NDArray[np.float64], covariance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the standard deviation of slope @ x, infinite where it moves with something that is not determined."""
    lost = ~np.isfinite(np.diag(covariance))
    kept = slope[:, ~lost]
    variance = np.einsum("ni,ij,nj->n", kept, covariance[np.ix_(~lost, ~lost)], kept)
    spread = np.sqrt(np.maximum(variance, 0.0))
    return np.where(np.any(slope[:, lost] != 0.0, axis=1), np.inf, spread)
