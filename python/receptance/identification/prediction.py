"""Predictions from the posterior of a fit: natural frequencies and receptances of assemblies, and their uncertainty.

The posterior is Gaussian: the fitted variables, which include the errors of dimensions and materials, have the
covariance of the fit, and errors that the fit does not know, those of a new clamping say, have their priors, which are
standard normal. To first order a result with the gradient g has the variance g' C g. Where a resonance may move by more
than its width a receptance is not linear in the variables; then vectors are drawn from the posterior and each is
evaluated.
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance import _checks
from receptance._stepped_place import SteppedPlace
from receptance.errors import ReceptanceError
from receptance.identification.factors import FACTORS
from receptance.identification.mapping import Addresses, Parameters
from receptance.identification.residuals import FRFResidual
from receptance.identification.spread import quantile
from receptance.identification.unknowns import Variables

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from receptance.assembly import Assembly
    from receptance.coordinates import Coordinate
    from receptance.identification.laws import Tolerance
    from receptance.identification.mapping import Place
    from receptance.identification.observations import MeasuredFRF
    from receptance.identification.result import Identification

__all__ = ["Forecast", "PredictedReceptance", "Scatter", "lowest_frequencies"]

_GROWTH = 1.5


@dataclass(frozen=True)
class Scatter:
    """Standard deviations of results, `(n,)` each, and the share of the tolerances in them.

    Attributes
    ----------
    total : ndarray
        By the posterior; infinite where a parameter that matters is not determined.
    data : ndarray
        If every error of a dimension or material were known: only the noise of the data is left.
    errors : dict of str to ndarray
        By error: signed change of the result that goes with one posterior standard deviation of the error, all else
        following as the posterior has it. Its square is the variance that would vanish if the error were known.
    """

    total: NDArray[np.float64]
    data: NDArray[np.float64]
    errors: dict[str, NDArray[np.float64]]

    @classmethod
    def of(
        cls,
        gradient: NDArray[np.float64],
        covariance: NDArray[np.float64],
        errors: Sequence[tuple[str, int]],
        *,
        fresh: NDArray[np.float64] | None = None,
        fresh_names: Sequence[str] = (),
    ) -> Scatter:
        """Return the scatter of results that are linear in Gaussian variables.

        Parameters
        ----------
        gradient : ndarray
            `(n, p)` derivatives by the variables.
        covariance : ndarray
            `(p, p)`, infinite for variables that are not determined.
        errors : sequence of (str, int)
            Names of the errors among the variables, and their places.
        fresh : ndarray, optional
            `(n, q)` derivatives by further errors, which are standard normal and independent of all others.
        fresh_names : sequence of str, optional
            Names of these.
        """
        lost = ~np.isfinite(np.diag(covariance))
        known = np.where(lost[:, None] | lost[None, :], 0.0, covariance)
        with_results = gradient @ known
        variance = np.maximum(np.einsum("ni,ni->n", with_results, gradient), 0.0)
        errors = [(name, index) for name, index in errors if known[index, index] > 0.0]
        own = [index for _, index in errors]
        deviation = np.sqrt(np.diag(known)[own])
        changes = with_results[:, own] / deviation
        given = variance
        if own:
            correlation = known[np.ix_(own, own)] / np.outer(deviation, deviation)
            given = np.maximum(variance - np.einsum("ni,in->n", changes, np.linalg.solve(correlation, changes.T)), 0.0)
        moved = np.any(gradient[:, lost] != 0.0, axis=1)
        named = {name: changes[:, i] for i, (name, _) in enumerate(errors)}
        if fresh is not None:
            variance = variance + np.sum(fresh**2, axis=1)
            named |= {name: fresh[:, i] for i, name in enumerate(fresh_names)}
        total, data = (np.where(moved, np.inf, np.sqrt(one)) for one in (variance, given))
        return cls(total, data, named)

    @property
    def shares(self) -> dict[str, NDArray[np.float64]]:
        """Share of the variance that goes with each error, `(n,)`; shares of correlated errors overlap."""
        whole = np.where(self.total > 0.0, self.total, 1.0) ** 2
        return {name: change**2 / whole for name, change in self.errors.items()}


@dataclass(frozen=True, kw_only=True)
class PredictedReceptance:
    """A predicted receptance and the interval of the true one.

    Attributes
    ----------
    frequency_hz : ndarray
        `(n,)` lines, real or complex.
    receptance : ndarray
        `(n,)` complex, with the identified values.
    scatter, phase_scatter : Scatter
        Of the real and of the imaginary part of its logarithm, to first order.
    drawn : ndarray
        `(draws, n)` logarithms of the magnitude for vectors that were drawn; `(0, n)` if none were asked for.
    degrees_of_freedom : int or None
        Of the scatter, where it was estimated; None where it was known.
    """

    frequency_hz: NDArray[Any]
    receptance: NDArray[np.complex128]
    scatter: Scatter
    phase_scatter: Scatter
    drawn: NDArray[np.float64] = field(repr=False)
    degrees_of_freedom: int | None = None

    def band(self, level: float = 0.95, noise: ArrayLike = 0.0) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return lower and upper magnitude of where the response is, line by line.

        Parameters
        ----------
        level : float, optional
            Share of cases in which a line is to be inside.
        noise : array_like, optional
            Standard deviation of the logarithm of what it is to be compared with: the band is then for a measurement.

        Raises
        ------
        ValueError
            A level not between 0 and 1.
        """
        reach = quantile(level, self.degrees_of_freedom)
        noise = _checks.unmasked("band", "noise", noise, np.float64)
        middle = np.log(np.abs(self.receptance))
        if len(self.drawn):
            low, high = np.quantile(self.drawn, [0.5 - 0.5 * level, 0.5 + 0.5 * level], axis=0)
            low, high = np.minimum(low, middle), np.maximum(high, middle)
            # The noise of a measurement comes on top, as if each side were a normal one.
            low = middle - np.hypot(middle - low, reach * noise)
            high = middle + np.hypot(high - middle, reach * noise)
        else:
            half = reach * np.hypot(self.scatter.total, noise)
            low, high = middle - half, middle + half
        with np.errstate(over="ignore"):
            return np.exp(low), np.exp(high)

    def __repr__(self) -> str:
        low, high = self.frequency_hz[[0, -1]].real
        return f"PredictedReceptance({self.frequency_hz.size} lines from {low:g} to {high:g} Hz)"


class Forecast:
    """An assembly with the identified values, and how its parameters move with the variables of the posterior.

    Parameters
    ----------
    fit : Identification or None
        The fit; None where nothing was identified, so that only the errors of the assembly count.
    place : Place
        The assembly as it is described, its configuration and conditions.
    tolerances : sequence of Tolerance, optional
        Its errors; by default those of the fit. Those that the fit does not know have their prior.

    Attributes
    ----------
    assembly : Assembly
        With the identified values.
    addresses : tuple of str
        What moves, `m` parameters.
    fresh : tuple of str
        Errors that the fit does not know, `q` of them.

    Raises
    ------
    ValueError
        A law cannot say what holds for this assembly, or it has no model with the identified values.
    """

    def __init__(self, fit: Identification | None, place: Place, tolerances: Sequence[Tolerance] | None = None) -> None:
        fresh: list[str] = []
        parameters = Parameters((), (), ()) if fit is None else fit.task.parameters
        self._variables = Variables(parameters.unknowns)
        self._values = np.array([] if fit is None else list(fit.values.values()))
        self._covariance = np.zeros((0, 0)) if fit is None else fit.covariance
        self._errors = [(name, fit.addresses.index(name)) for name in parameters.errors] if fit is not None else []
        self._freedom = None if fit is None or fit.known_scatter else fit.degrees_of_freedom
        self._parameters, self._place, self._tolerances = parameters, place, tolerances
        self._placed = parameters.at(place, tolerances, fresh)
        self._bare = place.assembly
        vector = np.append(self._values, np.zeros(len(fresh)))
        self.assembly = self._placed.apply(self._bare, vector)
        self.addresses = self._placed.addresses
        self.fresh = tuple(fresh)
        slope = self._placed.jacobian(vector)
        count = self._values.size
        self._own = slope[:, :count] * self._variables.slopes(self._values)
        self._new = slope[:, count:]

    @property
    def uncertain(self) -> bool:
        """Whether anything of the assembly is uncertain."""
        return bool(self.addresses)

    def scatter(self, slope: NDArray[np.float64]) -> Scatter:
        """Return the scatter of results with derivatives `(n, m)` per SI unit of the addresses."""
        return Scatter.of(
            slope @ self._own, self._covariance, self._errors, fresh=slope @ self._new, fresh_names=self.fresh
        )

    def natural_frequencies(self, upper_hz: float) -> tuple[NDArray[np.float64], Scatter]:
        """Return natural frequencies up to a limit and their scatter in Hz."""
        found, slope = self.assembly.natural_frequency_derivatives(upper_hz, list(self.addresses))
        return found, self.scatter(slope)

    def modes(self, numbers: Sequence[int], near_hz: float) -> tuple[NDArray[np.float64], Scatter]:
        """Return the natural frequencies of some modes, counted from 1, and their scatter in Hz."""
        found, slope = lowest_frequencies(self.assembly, max(numbers), near_hz, self.addresses)
        rows = [number - 1 for number in numbers]
        return found[rows], self.scatter(slope[rows])

    def receptance(
        self,
        frequency_hz: ArrayLike,
        response: Coordinate | None = None,
        excitation: Coordinate | None = None,
        *,
        force: ArrayLike | None = None,
        draws: int = 0,
        seed: int = 0,
        threads: int | None = None,
    ) -> PredictedReceptance:
        """Return a receptance with its scatter, and with its magnitudes for vectors that are drawn.

        Raises
        ------
        ReceptanceError
            Fewer than half of the vectors have a model.
        """
        options: dict[str, Any] = {"response": response, "excitation": excitation, "force": force, "threads": threads}
        found, slope = self.assembly.derivatives(frequency_hz, list(self.addresses), **options)
        slope = slope / found[:, None]
        assemblies = [one for one in self.drawn(draws, seed) if one is not None]
        if 2 * len(assemblies) < draws:
            raise ReceptanceError(f"only {len(assemblies)} of {draws} vectors drawn from the posterior have a model")
        drawn = [np.log(np.abs(one.receptance(frequency_hz, **options))) for one in assemblies]
        return PredictedReceptance(
            frequency_hz=np.asarray(frequency_hz),
            receptance=found,
            scatter=self.scatter(slope.real),
            phase_scatter=self.scatter(slope.imag),
            drawn=np.array(drawn).reshape(-1, found.size),
            degrees_of_freedom=self._freedom,
        )

    def observed(
        self, seen: MeasuredFRF, *, draws: int = 0, seed: int = 0, threads: int | None = None
    ) -> PredictedReceptance:
        """Return the receptance on the lines of a measurement of this assembly, as its measuring chain records it.

        A coordinate on a step between two segments stays on it. Gain, delay, window and early end of the record count
        where the fit has identified them.
        """
        places = (SteppedPlace(seen.assembly, one).on(self.assembly) for one in (seen.response, seen.excitation))
        found = self.receptance(seen.frequency_hz, *places, force=seen.force, draws=draws, seed=seed, threads=threads)
        if not any(unknown.address in FACTORS for unknown in self._parameters.wanted):
            return found
        chain = self.recorded(seen) / found.receptance
        return replace(found, receptance=chain * found.receptance, drawn=found.drawn + np.log(np.abs(chain)))

    def recorded(self, seen: MeasuredFRF) -> NDArray[np.complex128]:
        """Return the receptance that the identified measuring chain records on the lines of a measurement."""
        placed = self._parameters.at(replace(self._place, factors=FACTORS), self._tolerances, [])
        vector = np.append(self._values, np.zeros(len(self.fresh)))
        residual = FRFResidual(seen, Addresses(placed.addresses), "logarithm", None, None).value(placed.values(vector))
        real, imaginary = residual.reshape(2, -1)
        found: NDArray[np.complex128] = seen.receptance * np.exp(-real - 1j * imaginary)
        return found

    def drawn(self, count: int, seed: int) -> list[Assembly | None]:
        """Return assemblies with vectors drawn from the posterior; None where a vector has no model.

        Fitted variables are normal with the covariance of the fit, within their bounds; a variable that the data do not
        determine is uniform between its bounds. The draws of an error follow from the seed and its name alone, so two
        assemblies that share the fit or an error get the same draws of it.
        """
        vectors = np.concatenate([self._drawn_values(count, seed), _drawn_errors(self.fresh, count, seed)], axis=1)
        found: list[Assembly | None] = []
        for vector in vectors:
            try:
                found.append(self._placed.apply(self._bare, vector))
            except ValueError:
                found.append(None)  # a joint that is not passive, say
        return found

    def _drawn_values(self, count: int, seed: int) -> NDArray[np.float64]:
        if not self._values.size:
            return np.zeros((count, 0))
        random = np.random.default_rng(seed)
        low, high = self._variables.limits
        known = np.isfinite(np.diag(self._covariance))
        covariance = self._covariance[np.ix_(known, known)]
        deviation = np.sqrt(np.diag(covariance))
        scale = np.where(deviation > 0.0, deviation, 1.0)
        values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
        root = scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
        x = low + (high - low) * random.random((count, low.size))
        centre = self._variables.from_values(self._values)
        x[:, known] = centre[known] + random.standard_normal((count, len(root))) @ root.T
        return self._variables.to_values(np.clip(x, low, high))


def _drawn_errors(names: Sequence[str], count: int, seed: int) -> NDArray[np.float64]:
    """Return draws `(count, q)` of standard normal errors, each of which depends on the seed and its name alone."""
    drawn = [np.random.default_rng([seed, zlib.crc32(name.encode())]).standard_normal(count) for name in names]
    return np.array(drawn).reshape(len(names), count).T


def lowest_frequencies(
    assembly: Assembly, count: int, near_hz: float, addresses: Sequence[str] = ()
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return at least `count` natural frequencies in Hz and their derivatives; `near_hz` is a guess of the last one."""
    upper = _GROWTH * near_hz
    while True:
        found, slope = assembly.natural_frequency_derivatives(upper, list(addresses))
        if found.size >= count:
            return found, slope
        upper *= _GROWTH
