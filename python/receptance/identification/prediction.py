"""Predictions from the posterior of a fit: natural frequencies and receptances of assemblies, and their uncertainty.

The posterior is Gaussian. The fitted variables, which include the errors of dimensions and materials, have the
covariance of the fit. Errors that are not in the fit, those of a new clamping for example, have their priors, which
are standard normal. To first order a result with the gradient g has the variance g' C g. A receptance is not linear in
the variables where a resonance may move by more than its width; then vectors are drawn from the posterior and each is
evaluated.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance import _checks
from receptance.errors import ReceptanceError
from receptance.identification.covariance import confidence_multiplier, square_root
from receptance.identification.mapping import FACTORS, Parameters
from receptance.identification.new_observations import calculated
from receptance.identification.peaks import PredictedMode, match_peaks
from receptance.identification.unknowns import Variables, error_of
from receptance.model.addresses import MovingCoordinate
from receptance.model.coordinates import Coordinate

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from receptance.identification.mapping import Site
    from receptance.identification.observations import Observation
    from receptance.identification.result import Identification
    from receptance.identification.unknowns import Tolerance
    from receptance.model.assembly import Assembly

DECIBEL = 20.0 / math.log(10.0)
"""Decibels of a factor of e."""
_FACTOR = 10.0
"""Factor to either side from which the band of a magnitude is too wide to be useful."""


@dataclass(frozen=True)
class Scatter:
    """Standard deviations of results, `(n,)` each, and the share of the tolerances in them.

    Attributes
    ----------
    total : ndarray
        By the posterior; infinite where the result depends on a parameter that is not determined.
    data : ndarray
        By the noise of the data alone, if every error of a dimension or material were known.
    errors : dict of str to ndarray
        By error: signed change of the result for one posterior standard deviation of the error, with the other
        variables at their conditional means. Its square is the variance that would vanish if the error were known.
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
            Names of the errors among the variables, and their indices.
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
        """Share of each error in the variance, `(n,)`; shares of correlated errors overlap."""
        whole = np.where(self.total > 0.0, self.total, 1.0) ** 2
        return {name: change**2 / whole for name, change in self.errors.items()}


@dataclass(frozen=True, kw_only=True)
class PredictedFrequencies:
    """Predicted natural frequencies of an assembly, with measured ones if there are any.

    Attributes
    ----------
    name, assembly : str
        Names of the measurement, or of the assembly without one, and of the assembly.
    modes : tuple of PredictedMode
        The natural frequencies.
    scatter : Scatter
        Of the predictions in Hz.
    """

    name: str = ""
    assembly: str = ""
    modes: tuple[PredictedMode, ...]
    scatter: Scatter = field(repr=False)

    @property
    def predicted_hz(self) -> NDArray[np.float64]:
        """Predicted natural frequencies, `(m,)`."""
        return np.array([mode.predicted_hz for mode in self.modes], dtype=np.float64)

    @property
    def measured_hz(self) -> NDArray[np.float64] | None:
        """Measured natural frequencies, `(m,)`; None if they were not measured."""
        measured = [mode.measured_hz for mode in self.modes]
        return None if None in measured else np.array(measured, dtype=np.float64)

    def data(self, level: float = 0.95) -> dict[str, Any]:
        """Return the numbers by name, with intervals of a level."""
        found: dict[str, Any] = {
            "name": self.name,
            "assembly": self.assembly,
            "modes": [mode.mode for mode in self.modes],
            "predicted_hz": self.predicted_hz,
            "interval_hz": list(zip(*(mode.interval_hz(level) or () for mode in self.modes), strict=True)),
            "interval_uninformative": [mode.uninformative(level) for mode in self.modes],
            "standard_error_hz": self.scatter.total,
            "standard_error_of_fit_hz": self.scatter.data,
            "change_for_one_deviation_hz": self.scatter.errors,
        }
        if self.measured_hz is not None:
            deviations = [mode.measured_deviation_hz for mode in self.modes]
            found |= {
                "measured_hz": self.measured_hz,
                "measured_deviation_hz": deviations if any(deviations) else None,
                "error_percent": [mode.error_percent for mode in self.modes],
                "within": [mode.within(level) for mode in self.modes],
            }
        return found


@dataclass(frozen=True, kw_only=True)
class PredictedFRF:
    """A predicted frequency response with its band, and the measured one where there is one.

    Attributes
    ----------
    name, assembly : str
        Names of the measurement, or of the assembly where there is none, and of the assembly.
    response, excitation : Coordinate
        Coordinates of the motion and of the load.
    frequency_hz : ndarray
        `(n,)` lines, complex where both channels had an exponential window.
    receptance : ndarray
        `(n,)` complex, with the identified values.
    scatter, phase_scatter : Scatter
        Of the real and of the imaginary part of its logarithm, to first order.
    drawn : ndarray
        `(draws, n)` logarithms of the magnitude for vectors drawn from the posterior; `(0, n)` without draws.
    degrees_of_freedom : int or None
        Of the scatter, where it was estimated; None where it was known.
    measured : ndarray or None
        `(n,)` complex.
    measured_deviation : ndarray or None
        `(n,)` standard deviation of the real and of the imaginary part of its logarithm.
    peaks : tuple of PredictedMode
        Peaks of measurement and prediction.
    """

    name: str = ""
    assembly: str = ""
    response: Coordinate
    excitation: Coordinate
    frequency_hz: NDArray[np.inexact]
    receptance: NDArray[np.complex128] = field(repr=False)
    scatter: Scatter = field(repr=False)
    phase_scatter: Scatter = field(repr=False)
    drawn: NDArray[np.float64] = field(repr=False)
    degrees_of_freedom: int | None = None
    measured: NDArray[np.complex128] | None = field(default=None, repr=False)
    measured_deviation: NDArray[np.float64] | None = field(default=None, repr=False)
    peaks: tuple[PredictedMode, ...] = ()

    def band(self, level: float = 0.95, noise: ArrayLike = 0.0) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the lower and upper end of the interval of the magnitude on each line.

        Parameters
        ----------
        level : float, optional
            Probability that the magnitude of a line lies in its interval.
        noise : array_like, optional
            Standard deviation of the logarithm of a measurement; the band then holds the measured magnitude.

        Raises
        ------
        ValueError
            A level not between 0 and 1.
        """
        multiplier = confidence_multiplier(level, self.degrees_of_freedom)
        noise = _checks.unmasked("band", "noise", noise, np.float64)
        middle = np.log(np.abs(self.receptance))
        if len(self.drawn):
            low, high = np.quantile(self.drawn, [0.5 - 0.5 * level, 0.5 + 0.5 * level], axis=0)
            low, high = np.minimum(low, middle), np.maximum(high, middle)
            # The noise of a measurement is added as if each side were that of a normal distribution.
            low = middle - np.hypot(middle - low, multiplier * noise)
            high = middle + np.hypot(high - middle, multiplier * noise)
        else:
            half = multiplier * np.hypot(self.scatter.total, noise)
            low, high = middle - half, middle + half
        with np.errstate(over="ignore"):
            return np.exp(low), np.exp(high)

    def uninformative(self, level: float = 0.95) -> NDArray[np.bool_]:
        """Return the lines on which the band is too wide to be useful, a factor of ten to either side, `(n,)`."""
        size = np.abs(self.receptance)
        low, high = self.band(level)
        useful: NDArray[np.bool_] = (high < _FACTOR * size) & (size < _FACTOR * low)
        return ~useful

    @property
    def log_ratio(self) -> NDArray[np.complex128]:
        """Logarithm of measured over predicted: factor and phase, `(n,)`; empty if not measured."""
        return np.empty(0, dtype=np.complex128) if self.measured is None else np.log(self.measured / self.receptance)

    @property
    def rms_decibel(self) -> float | None:
        """Root mean square over the lines of measured over predicted magnitude in dB; None if not measured."""
        return None if self.measured is None else float(DECIBEL * np.sqrt(np.mean(self.log_ratio.real**2)))

    def share_within(self, level: float = 0.95) -> float | None:
        """Return the share of the lines whose measured magnitude is in the band, noise included.

        Of the lines whose band is useful; None without any, or if not measured.
        """
        useful = ~self.uninformative(level)
        if self.measured is None or not useful.any():
            return None
        low, high = self.band(level, 0.0 if self.measured_deviation is None else self.measured_deviation)
        size = np.abs(self.measured)
        return float(np.mean(((low <= size) & (size <= high))[useful]))

    def data(self, level: float = 0.95) -> dict[str, Any]:
        """Return the numbers by name, with the band and intervals of a level."""
        nothing = self.uninformative(level)
        low, high = (np.where(nothing, np.nan, side) for side in self.band(level))
        found: dict[str, Any] = {
            "name": self.name,
            "assembly": self.assembly,
            "response": _coordinate(self.response),
            "excitation": _coordinate(self.excitation),
            "frequency_hz": self.frequency_hz.real,
            "receptance": self.receptance,
            "magnitude_interval": [low, high],
            "standard_error_of_log": [self.scatter.total, self.phase_scatter.total],
        }
        if np.iscomplexobj(self.frequency_hz):
            found["decay_rate"] = -2.0 * np.pi * float(self.frequency_hz[0].imag)
        if self.measured is not None:
            found |= {
                "measured": self.measured,
                "rms_decibel": self.rms_decibel,
                "share_within": self.share_within(level),
                "share_of_lines_with_uninformative_band": float(np.mean(nothing)),
                "peaks": [
                    {
                        "measured_hz": peak.measured_hz,
                        "measured_deviation_hz": peak.measured_deviation_hz,
                        "predicted_hz": peak.predicted_hz,
                        "standard_error_hz": peak.deviation_hz,
                        "error_percent": peak.error_percent,
                        "within": peak.within(level),
                        "interval_uninformative": peak.uninformative(level),
                    }
                    for peak in self.peaks
                ],
            }
        return found

    def __repr__(self) -> str:
        low, high = self.frequency_hz[[0, -1]].real
        return f"PredictedFRF({self.frequency_hz.size} lines from {low:g} to {high:g} Hz)"


def _coordinate(at: Coordinate) -> dict[str, Any]:
    return {"part": at.part, "position_m": at.position, "direction": at.direction}


class Forecast:
    """An assembly with the identified values, and its parameters as functions of the variables of the posterior.

    Parameters
    ----------
    fit : Identification or None
        The fit; None where nothing was identified: only the errors of the assembly apply.
    site : Site
        The assembly as described, its configuration and conditions.
    tolerances : sequence of Tolerance, optional
        Its errors; by default those of the fit. Errors that are not in the fit have their prior.

    Attributes
    ----------
    assembly : Assembly
        With the identified values.
    addresses : tuple of str
        Addresses of the `m` uncertain parameters.
    fresh : tuple of str
        The `q` errors that are not in the fit.

    Raises
    ------
    ValueError
        A law has no value for this assembly, or the assembly has no model with the identified values.
    """

    def __init__(self, fit: Identification | None, site: Site, tolerances: Sequence[Tolerance] | None = None) -> None:
        fresh: list[str] = []
        parameters = Parameters((), (), ()) if fit is None else fit.task.parameters
        self._variables = Variables(parameters.unknowns)
        self._values = np.array([] if fit is None else list(fit.values.values()))
        self._covariance = np.zeros((0, 0)) if fit is None else fit.covariance
        self._errors = [(name, fit.index(name)) for name in parameters.errors] if fit is not None else []
        self._threads = None if fit is None else fit.task.threads
        self._freedom = None if fit is None or fit.known_scatter else fit.degrees_of_freedom
        self._parameters, self._site, self._tolerances = parameters, site, tolerances
        self._mapping = parameters.at(site, tolerances, fresh)
        self._bare = site.assembly
        vector = np.append(self._values, np.zeros(len(fresh)))
        self.assembly = self._mapping.apply(self._bare, vector)
        self.addresses = self._mapping.addresses
        self.fresh = tuple(fresh)
        slope = self._mapping.jacobian(vector)
        count = self._values.size
        self._own = slope[:, :count] * self._variables.slopes(self._values)
        self._new = slope[:, count:]

    @property
    def uncertain(self) -> bool:
        """Whether any parameter of the assembly is uncertain."""
        return bool(self.addresses)

    def scatter(self, slope: NDArray[np.float64]) -> Scatter:
        """Return the scatter of results with derivatives `(n, m)` per SI unit of the addresses."""
        return Scatter.of(
            slope @ self._own, self._covariance, self._errors, fresh=slope @ self._new, fresh_names=self.fresh
        )

    def natural_frequencies(self, upper_hz: float) -> PredictedFrequencies:
        """Return the natural frequencies up to a limit."""
        found, slope = self.assembly.natural_frequency_derivatives(upper_hz, list(self.addresses))
        return self._frequencies(range(1, found.size + 1), found, self.scatter(slope))

    def modes(self, numbers: Sequence[int]) -> PredictedFrequencies:
        """Return the natural frequencies of some modes, counted from 1."""
        found, slope = self.assembly.lowest_natural_frequencies(max(numbers), self.addresses)
        rows = [number - 1 for number in numbers]
        return self._frequencies(numbers, found[rows], self.scatter(slope[rows]))

    def _frequencies(
        self, numbers: Sequence[int], found: NDArray[np.float64], scatter: Scatter
    ) -> PredictedFrequencies:
        modes = [
            PredictedMode(mode=number, predicted_hz=frequency, deviation_hz=deviation, degrees_of_freedom=self._freedom)
            for number, frequency, deviation in zip(numbers, found.tolist(), scatter.total.tolist(), strict=True)
        ]
        return PredictedFrequencies(modes=tuple(modes), scatter=scatter)

    def observed_modes(self, measured: Observation, noise: NDArray[np.float64] | None = None) -> PredictedFrequencies:
        """Return the natural frequencies of a measurement of this assembly; `noise` are its deviations in Hz."""
        found = self.modes(measured.modes)
        noise = measured.standard_deviation if noise is None else noise
        deviations = np.zeros(len(found.modes)) if noise is None else noise
        modes = [
            replace(
                mode,
                configuration=measured.configuration,
                label=measured.label,
                measured_hz=frequency,
                measured_deviation_hz=deviation,
            )
            for mode, frequency, deviation in zip(
                found.modes, measured.frequency_hz.tolist(), deviations.tolist(), strict=True
            )
        ]
        name = measured.label or measured.configuration
        return replace(found, name=name, assembly=measured.configuration, modes=tuple(modes))

    def receptance(
        self,
        frequency_hz: ArrayLike,
        response: Coordinate | None = None,
        excitation: Coordinate | None = None,
        *,
        force: ArrayLike | None = None,
        draws: int = 0,
        seed: int = 0,
    ) -> PredictedFRF:
        """Return a receptance with its scatter, and with its magnitudes for vectors drawn from the posterior.

        A ReceptanceError is raised if fewer than half of the vectors have a model.
        """
        response, excitation = response or Coordinate(), excitation or Coordinate()
        options: dict[str, Any] = {
            "response": response,
            "excitation": excitation,
            "force": force,
            "threads": self._threads,
        }
        found, slope = self.assembly.derivatives(frequency_hz, list(self.addresses), **options)
        slope = slope / found[:, None]
        assemblies = [one for one in self.drawn(draws, seed) if one is not None]
        if 2 * len(assemblies) < draws:
            raise ReceptanceError(f"only {len(assemblies)} of {draws} vectors drawn from the posterior have a model")
        drawn = [np.log(np.abs(assembly.receptance(frequency_hz, **options))) for assembly in assemblies]
        return PredictedFRF(
            response=response,
            excitation=excitation,
            frequency_hz=np.asarray(frequency_hz),
            receptance=found,
            scatter=self.scatter(slope.real),
            phase_scatter=self.scatter(slope.imag),
            drawn=np.array(drawn).reshape(-1, found.size),
            degrees_of_freedom=self._freedom,
        )

    def observed(
        self,
        measured: Observation,
        noise: NDArray[np.float64] | None = None,
        *,
        draws: int = 0,
        seed: int = 0,
    ) -> PredictedFRF:
        """Return the receptance on the lines of a measurement of this assembly, as its measuring chain records it.

        A coordinate on a step between two segments stays on it. Gain, delay, window and early end of the record apply
        where the fit has identified them. `noise` is the standard deviation of the measured logarithm, by default the
        stated one; draws are those of `receptance`.
        """
        places = (
            MovingCoordinate(measured.assembly, one).on(self.assembly)
            for one in (measured.response, measured.excitation)
        )
        found = self.receptance(measured.frequency_hz, *places, force=measured.force, draws=draws, seed=seed)
        if any(unknown.address in FACTORS for unknown in self._parameters.given):
            chain = self.recorded(measured) / found.receptance
            found = replace(found, receptance=chain * found.receptance, drawn=found.drawn + np.log(np.abs(chain)))
        noise = measured.standard_deviation if noise is None else noise
        return replace(
            found,
            name=measured.label or measured.configuration,
            assembly=measured.configuration,
            response=measured.response,
            excitation=measured.excitation,
            measured=measured.receptance,
            measured_deviation=noise,
            peaks=self._peaks(
                measured, match_peaks(measured.frequency_hz, measured.receptance, found.receptance, noise)
            ),
        )

    def _peaks(self, measured: Observation, peaks: Sequence[PredictedMode]) -> tuple[PredictedMode, ...]:
        """Return peaks with the mode and the standard deviation of the natural frequency nearest to each.

        An assembly that ends with receptances or modes has no natural frequencies; its peaks have no interval.
        """
        highest = max((peak.predicted_hz or 0.0 for peak in peaks), default=0.0)
        modes: tuple[PredictedMode, ...] = ()
        if highest and self.assembly.countable:
            modes = self.natural_frequencies(1.1 * highest).modes
        frequencies = np.array([mode.predicted_hz for mode in modes])
        found = []
        for peak in peaks:
            peak = replace(
                peak, configuration=measured.configuration, label=measured.label, degrees_of_freedom=self._freedom
            )
            if peak.predicted_hz is not None and modes:
                near = modes[int(np.abs(frequencies - peak.predicted_hz).argmin())]
                peak = replace(peak, mode=near.mode, deviation_hz=near.deviation_hz)
            found.append(peak)
        return tuple(found)

    def recorded(self, measured: Observation) -> NDArray[np.complex128]:
        """Return the receptance that the identified measuring chain records on the lines of a measurement."""
        mapping = self._parameters.at(replace(self._site, factors=FACTORS), self._tolerances, [])
        variables = Variables((*self._variables.unknowns, *map(error_of, self.fresh)))
        values = np.append(self._values, np.zeros(len(self.fresh)))
        return np.asarray(calculated(measured, mapping, variables, variables.from_values(values)), dtype=np.complex128)

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
                found.append(self._mapping.apply(self._bare, vector))
            except ValueError:
                found.append(None)  # a joint that is not passive, say
        return found

    def _drawn_values(self, count: int, seed: int) -> NDArray[np.float64]:
        if not self._values.size:
            return np.zeros((count, 0))
        random = np.random.default_rng(seed)
        low, high = self._variables.limits
        known = np.isfinite(np.diag(self._covariance))
        root = square_root(self._covariance[np.ix_(known, known)])
        x = low + (high - low) * random.random((count, low.size))
        centre = self._variables.from_values(self._values)
        x[:, known] = centre[known] + random.standard_normal((count, len(root))) @ root.T
        return self._variables.to_values(np.clip(x, low, high))


def _drawn_errors(names: Sequence[str], count: int, seed: int) -> NDArray[np.float64]:
    """Return draws `(count, q)` of standard normal errors, each of which depends on the seed and its name alone."""
    drawn = [np.random.default_rng([seed, zlib.crc32(name.encode())]).standard_normal(count) for name in names]
    return np.array(drawn).reshape(len(names), count).T
