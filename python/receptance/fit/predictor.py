"""Predictions from the posterior of a fit, and their uncertainty: the one predictor of all analyses.

The posterior is Gaussian. The fitted variables, which include the errors of dimensions and materials, have the
covariance of the fit. Errors that are not in the fit, those of a new clamping for example, have their priors, which
are standard normal. To first order a result with the gradient g has the variance g' C g. A receptance is not linear in
the variables where a resonance may move by more than its width; then vectors are drawn from the posterior and each is
evaluated.

Data of new observations have the residuals of every fit, and the information of the fit in place of the priors. They
are hypothetical ones for the next measurement and the advice of a diagnosis, or those of held-out configurations.

Where the model of the fit is not adequate, predictions have its discrepancy as well: see `fit.discrepancy`.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from receptance.errors import ReceptanceError
from receptance.fit.covariance import square_root
from receptance.fit.discrepancy import Curve, Discrepancy
from receptance.fit.line_modes import LineModes, line_modes
from receptance.fit.observation import Observation, Unit
from receptance.fit.parameters import FACTORS, ParameterMap, Parameters, Site
from receptance.fit.peaks import PredictedMode, match_peaks
from receptance.fit.prediction import PredictedFrequencies, PredictedFRF, Scatter
from receptance.fit.problem import End, Problem
from receptance.fit.unknowns import Tolerance, Variables, error_of
from receptance.model.addresses import moved_coordinate
from receptance.model.assembly import Assembly
from receptance.model.coordinates import Coordinate
from receptance.model.terminals import RESIDUALS, Terminal

_Value = TypeVar("_Value")
_SAME_PEAK = 0.02
"""Relative distance of the peak of a response from a natural frequency up to which it is the peak of this mode."""


@dataclass(frozen=True, eq=False)
class Predictor:
    """Predictor from a Gaussian posterior of fitted variables; without a fit only errors of assemblies apply.

    `Identification.predictor` is that of a fit; the example of `Identification` uses it.
    """

    parameters: Parameters = field(default_factory=lambda: Parameters((), (), ()))
    """The unknowns of the fit and their map to assemblies."""
    values: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))
    """`(p,)` identified values of the unknowns in SI units."""
    covariance: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 0)))
    """`(p, p)` of the fitted variables; infinite for variables that are not determined."""
    degrees_of_freedom: float | None = None
    """Of the covariance, where the scatter was estimated; None where it was known."""
    threads: int | None = None
    root: NDArray[np.float64] | None = None
    """Any matrix R with R^T R the information of data and priors at `values`, for predictions of data, see `of`."""
    discrepancy: Discrepancy | None = None
    """Error of the model, which every prediction has beside the posterior."""

    @cached_property
    def variables(self) -> Variables:
        """The fitted variables."""
        return Variables(self.parameters.unknowns)

    @cached_property
    def x(self) -> NDArray[np.float64]:
        """Mean of the fitted variables, `(p,)`."""
        return self.variables.from_values(self.values) if self.values.size else self.values

    def at(
        self, site: Site, tolerances: Sequence[Tolerance] | None = None, threads: int | None = None
    ) -> PredictedAssembly:
        """Return the predictions of an assembly as described, in its configuration and conditions.

        `tolerances` are its errors, `threads` its threads; by default those of the fit. A ValueError is raised if a law
        has no value for the assembly, or if it has no model with the identified values.
        """
        return PredictedAssembly(self, site, tolerances, threads or self.threads)

    def of(self, observations: Sequence[Observation], tolerances: Sequence[Sequence[Tolerance]]) -> PredictedData:
        """Return the predictions of the data of observations that were not fitted, each with its errors.

        Errors of one name are one error, in the fit and in all observations.
        """
        return PredictedData(self, observations, tolerances)

    @cached_property
    def information_root(self) -> NDArray[np.float64]:
        """R, `(p, p)`, with R^T R the information of the fit, and of the bounds of unknowns without a prior.

        Bounds count as a prior of the same variance, so that every direction has information.
        """
        low, high = self.variables.limits
        free = [unknown.prior is None for unknown in self.variables.unknowns]
        spans = np.diag(np.where(free, math.sqrt(12.0) / (high - low), 0.0))
        rows = spans if self.root is None else np.vstack([self.root, spans])
        return np.asarray(np.linalg.qr(rows, mode="r"), dtype=np.float64)

    def scatter(
        self,
        gradient: NDArray[np.float64],
        fresh: NDArray[np.float64] | None = None,
        fresh_names: Sequence[str] = (),
    ) -> Scatter:
        """Return the scatter of results that are linear in the variables, and what each error contributes.

        The derivatives are `gradient`, `(n, p)`, by the fitted variables, and `fresh`, `(n, q)`, by errors that are not
        in the fit, with the names `fresh_names`.
        """
        lost = ~np.isfinite(np.diag(self.covariance))
        covariance = np.where(lost[:, None] | lost[None, :], 0.0, self.covariance)
        with_results = gradient @ covariance
        variance = np.maximum(np.einsum("ni,ni->n", with_results, gradient), 0.0)
        unknowns = [unknown.name for unknown in self.parameters.unknowns]
        errors = [i for i in map(unknowns.index, self.parameters.errors) if covariance[i, i] > 0.0]
        deviation = np.sqrt(np.diag(covariance)[errors])
        changes = with_results[:, errors] / deviation
        of_data = variance
        if errors:
            correlation = covariance[np.ix_(errors, errors)] / np.outer(deviation, deviation)
            of_errors = np.einsum("ni,in->n", changes, np.linalg.solve(correlation, changes.T))
            of_data = np.maximum(variance - of_errors, 0.0)
        contributions = {unknowns[index]: changes[:, i] for i, index in enumerate(errors)}
        if fresh is not None:
            variance = variance + np.sum(fresh**2, axis=1)
            contributions |= {name: fresh[:, i] for i, name in enumerate(fresh_names)}
        moved = np.any(gradient[:, lost] != 0.0, axis=1)
        total, data = (np.where(moved, np.inf, np.sqrt(square)) for square in (variance, of_data))
        return Scatter(total, data, contributions)

    def draw(self, count: int, seed: int) -> NDArray[np.float64]:
        """Return values of the unknowns drawn from the posterior, `(count, p)`.

        They are normal within the bounds, or of Student's t distribution with a discrepancy; a variable that the data
        do not determine is uniform between its bounds.
        """
        if not self.values.size:
            return np.zeros((count, 0))
        return self.variables.to_values(np.clip(self.x + self.deviations(count, seed), *self.variables.limits))

    def deviations(self, count: int, seed: int) -> NDArray[np.float64]:
        """Return deviations of the variables from their mean as in `draw`, but for the bounds, `(count, p)`."""
        if not self.values.size:
            return np.zeros((count, 0))
        random = np.random.default_rng(seed)
        low, high = self.variables.limits
        determined = np.isfinite(np.diag(self.covariance))
        root = square_root(self.covariance[np.ix_(determined, determined)])
        deviations = low + (high - low) * random.random((count, low.size)) - self.x
        moved = random.standard_normal((count, len(root))) @ root.T
        deviations[:, determined] = self.spreads(count, seed)[:, None] * moved
        return np.asarray(deviations)

    def correlated_deviations(self, count: int, seed: int) -> NDArray[np.float64]:
        """Return deviations as those of `deviations`, with combinations of variables that alone are not determined.

        The data determine the sum of two modes that they do not tell apart, and it must not have the deviations of
        these. `root` is needed; the bounds are a prior, see `information_root`.
        """
        if self.root is None:
            return self.deviations(count, seed)
        normal = np.random.default_rng(seed).standard_normal((count, self.values.size))
        moved = np.linalg.solve(self.information_root, normal.T).T
        return np.asarray(self.spreads(count, seed)[:, None] * moved)

    def spreads(self, count: int, seed: int) -> NDArray[np.float64]:
        """Return the factor of all errors of each draw, `(count,)`: the size of a discrepancy is uncertain, else 1."""
        if self.discrepancy is None or self.degrees_of_freedom is None:
            return np.ones(count)
        freedom = self.degrees_of_freedom
        return np.asarray(np.sqrt(freedom / np.random.default_rng([seed, 3]).chisquare(freedom, count)))


class LinearFRF(NamedTuple):
    """A receptance with its first-order errors."""

    receptance: NDArray[np.complex128]
    """`(n,)` with the identified values."""
    slope: NDArray[np.complex128]
    """`(n, m)` its derivatives by the uncertain parameters."""
    spindle_errors: NDArray[np.complex128]
    """`(n, 3)` its changes by the errors of the spindle that no parameter describes, complex ones of unit variance of
    real and imaginary part; zero without them."""
    independent: bool
    """Whether these errors are independent between lines, else all lines share them."""
    frequency_hz: NDArray[np.inexact]
    """`(n,)` its lines."""

    @property
    def variance(self) -> NDArray[np.float64]:
        """Variance `(n,)` of real and imaginary part, each, by the errors of the spindle."""
        return np.asarray(np.sum(np.abs(self.spindle_errors) ** 2, axis=1))

    def drawn_errors(self, count: int, seed: int) -> NDArray[np.complex128]:
        """Return draws of the change of the receptance by the errors of the spindle, `(count, n)`."""
        random = np.random.default_rng([seed, 1])
        if self.independent:
            real, imaginary = random.standard_normal((2, count, self.receptance.size))
            return np.asarray(np.sqrt(self.variance) * (real + 1j * imaginary))
        real, imaginary = random.standard_normal((2, count, 3))
        return np.asarray((real + 1j * imaginary) @ self.spindle_errors.T)


class PredictedAssembly:
    """Natural frequencies and receptances of an assembly by a predictor; see `Predictor.at`.

    `assembly` has the identified values. `addresses` are those of its `m` uncertain parameters, `fresh` its `q` errors
    that are not in the fit, which have their priors.
    """

    def __init__(
        self, predictor: Predictor, site: Site, tolerances: Sequence[Tolerance] | None, threads: int | None
    ) -> None:
        fresh: list[str] = []
        self._threads = threads
        self.predictor, self._site, self._tolerances = predictor, site, tolerances
        self._mapping = predictor.parameters.at(site, tolerances, fresh)
        values = np.append(predictor.values, np.zeros(len(fresh)))
        self.assembly = self._mapping.apply(site.assembly, values)
        self.addresses = self._mapping.addresses
        self.fresh = tuple(fresh)
        slope = self._mapping.jacobian(values)
        count = predictor.values.size
        self._by_variables = slope[:, :count] * predictor.variables.slopes(predictor.values)
        self._by_fresh = slope[:, count:]

    @property
    def uncertain(self) -> bool:
        """Whether any parameter of the assembly is uncertain, or the spindle at its end."""
        end = next(reversed(self.assembly.elements.values()))
        known = not isinstance(end, Terminal) or end.error_root(np.ones(1)) is None
        return bool(self.addresses) or not known

    def scatter(self, slope: NDArray[np.float64]) -> Scatter:
        """Return the scatter of results with derivatives `(n, m)` per SI unit of the addresses."""
        return self.predictor.scatter(slope @ self._by_variables, slope @ self._by_fresh, self.fresh)

    def natural_frequencies(self, upper_hz: float) -> PredictedFrequencies:
        """Return the natural frequencies up to a limit, with their standard errors to first order."""
        frequency_hz, slope = self.assembly.natural_frequency_derivatives(upper_hz, list(self.addresses))
        return self._frequencies(
            range(1, frequency_hz.size + 1), frequency_hz, self._modal_scatter(frequency_hz, slope)
        )

    def _modal_scatter(self, frequency_hz: NDArray[np.float64], slope: NDArray[np.float64]) -> Scatter:
        """Return the scatter of natural frequencies with derivatives `(n, m)`, with the error of the model."""
        discrepancy = self.predictor.discrepancy
        scatter = self.scatter(slope)
        return scatter if discrepancy is None else scatter.widened(discrepancy.frequency * frequency_hz)

    def _frequencies(
        self, numbers: Sequence[int], frequency_hz: NDArray[np.float64], scatter: Scatter
    ) -> PredictedFrequencies:
        freedom = self.predictor.degrees_of_freedom
        modes = [
            PredictedMode(mode=number, predicted_hz=frequency, deviation_hz=deviation, degrees_of_freedom=freedom)
            for number, frequency, deviation in zip(numbers, frequency_hz.tolist(), scatter.total.tolist(), strict=True)
        ]
        return PredictedFrequencies(modes=tuple(modes), scatter=scatter)

    def observed_modes(self, measured: Observation, noise: NDArray[np.float64] | None = None) -> PredictedFrequencies:
        """Return the natural frequencies of a measurement of this assembly; `noise` are its deviations in Hz."""
        frequency_hz, slope = self.assembly.lowest_natural_frequencies(max(measured.modes), self.addresses)
        rows = [number - 1 for number in measured.modes]
        scatter = self._modal_scatter(frequency_hz[rows], slope[rows])
        predicted = self._frequencies(measured.modes, frequency_hz[rows], scatter)
        noise = measured.standard_deviation if noise is None else noise
        deviations = np.zeros(len(rows)) if noise is None else noise
        modes = [
            replace(
                mode,
                configuration=measured.configuration,
                label=measured.label,
                measured_hz=frequency,
                measured_deviation_hz=deviation,
            )
            for mode, frequency, deviation in zip(
                predicted.modes, measured.frequency_hz.tolist(), deviations.tolist(), strict=True
            )
        ]
        name = measured.label or measured.configuration
        return replace(predicted, name=name, assembly=measured.configuration, modes=tuple(modes))

    def linear(
        self,
        frequency_hz: ArrayLike,
        response: Coordinate | None = None,
        excitation: Coordinate | None = None,
        force: ArrayLike | None = None,
    ) -> LinearFRF:
        """Return a receptance with its first-order errors."""
        name, spindle = next(reversed(self.assembly.elements.items()))
        root, independent = None, True
        if isinstance(spindle, Terminal):
            root, independent = spindle.error_root(np.asarray(frequency_hz)), spindle.independent_lines
        residuals = [] if root is None else [f"{name}.{quantity}" for quantity in RESIDUALS]
        receptance, slopes = self.assembly.derivatives(
            frequency_hz, [*self.addresses, *residuals], **self._options(response, excitation, force)
        )
        slope, residual_slope = np.split(slopes, [len(self.addresses)], axis=1)
        errors = np.zeros((receptance.size, 3), dtype=np.complex128)
        if root is not None:
            errors = np.einsum("ni,nij->nj", residual_slope, root)
        return LinearFRF(receptance, slope, errors, independent, np.asarray(frequency_hz))

    def line_modes(self, frequency_hz: NDArray[np.float64], linear: LinearFRF) -> tuple[LineModes, Scatter]:
        """Return the modes that are peaks of a receptance on `(n,)` lines, and the scatter of the logarithms.

        The scatter is that of frequency, damping ratio and dynamic stiffness of each mode in turn, `(3 k,)`.
        """
        # Errors that all lines share make no peaks.
        modes = line_modes(frequency_hz, linear.receptance, linear.variance if linear.independent else None)
        slopes = modes.log_slopes(linear.slope).reshape(3 * len(modes), len(self.addresses))
        variances = modes.log_variances(linear.spindle_errors, independent=linear.independent)
        discrepancy = self.predictor.discrepancy
        if discrepancy is not None:
            # The height of a peak is that of its damping ratio as well.
            level = discrepancy.relative or 0.0
            variances = variances + np.square([discrepancy.frequency, discrepancy.damping or level, level])
        return modes, self.scatter(slopes).widened(np.sqrt(variances).ravel())

    def peak_frequencies(self, frequency_hz: NDArray[np.float64], linear: LinearFRF) -> PredictedFrequencies:
        """Return the natural frequencies that are peaks of a receptance on `(n,)` lines, numbered from the lowest.

        They are those of an assembly that ends with modes or with a table of receptances, where no modes are counted.
        """
        modes, scatter = self.line_modes(frequency_hz, linear)
        frequencies = modes.values[:, 0]
        return self._frequencies(range(1, len(modes) + 1), frequencies, scatter.of(slice(0, None, 3), frequencies))

    def receptance(
        self,
        frequency_hz: ArrayLike,
        response: Coordinate | None = None,
        excitation: Coordinate | None = None,
        *,
        force: ArrayLike | None = None,
        draws: int = 0,
        seed: int = 0,
        linear: LinearFRF | None = None,
        phase: bool = True,
    ) -> PredictedFRF:
        """Return a receptance with its band; lines, coordinates and force are those of `Assembly.receptance`.

        Parameters
        ----------
        draws, seed : int, optional
            Number and seed of draws from the posterior for the band. Without draws the band is linear in the errors,
            which is accurate while resonances move by less than about half their width.
        linear : LinearFRF, optional
            The result of `linear`, where it was computed before.
        phase : bool, optional
            Whether the scatter of the phase is computed as well.

        Raises
        ------
        ReceptanceError
            The model has no value for half or more of the draws.
        """
        linear = linear or self.linear(frequency_hz, response, excitation, force)
        options = self._options(response, excitation, force)

        def receptance(assembly: Assembly) -> NDArray[np.complex128]:
            return assembly.receptance(frequency_hz, **options)

        several = [drawn for drawn in self.drawn_receptances(receptance, linear, draws, seed) if drawn is not None]
        if 2 * len(several) < draws:
            raise ReceptanceError(f"only {len(several)} of {draws} vectors drawn from the posterior have a model")
        drawn = np.array(several, np.complex128).reshape(-1, linear.receptance.size)
        log_slope = linear.slope / linear.receptance[:, None]
        log_deviation, undrawn = np.sqrt(linear.variance) / np.abs(linear.receptance), None
        discrepancy = self.predictor.discrepancy
        if discrepancy is not None:
            curve = Curve.of(np.asarray(frequency_hz).real, linear.receptance)
            log_deviation = np.hypot(log_deviation, np.sqrt(discrepancy.log_variance(curve)))
            # In draws an error of level is a positive factor, so that antiresonances stay where they are.
            undrawn = (discrepancy.relative or 0.0) * np.sqrt(curve.growth - 1.0)
        return PredictedFRF(
            response=response or Coordinate(),
            excitation=excitation or Coordinate(),
            frequency_hz=np.asarray(frequency_hz),
            receptance=linear.receptance,
            scatter=self.scatter(log_slope.real).widened(log_deviation),
            phase_scatter=self.scatter(log_slope.imag).widened(log_deviation) if phase else None,
            drawn=drawn,
            undrawn_deviation=undrawn,
            degrees_of_freedom=self.predictor.degrees_of_freedom,
        )

    def _options(
        self, response: Coordinate | None, excitation: Coordinate | None, force: ArrayLike | None
    ) -> dict[str, Any]:
        places = {"response": response or Coordinate(), "excitation": excitation or Coordinate()}
        return {**places, "force": force, "threads": self._threads}

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
        lines, force = measured.frequency_hz, measured.force
        response, excitation = (
            moved_coordinate(place, measured.assembly.elements, self.assembly.elements)
            for place in (measured.response, measured.excitation)
        )
        linear = self.linear(lines, response, excitation, force)
        predicted = self.receptance(lines, response, excitation, force=force, draws=draws, seed=seed, linear=linear)
        if any(unknown.address in FACTORS for unknown in self.predictor.parameters.given):
            chain = self.recorded(measured) / predicted.receptance
            predicted = replace(predicted, receptance=chain * predicted.receptance, drawn=chain * predicted.drawn)
        noise = measured.standard_deviation if noise is None else noise
        peaks = match_peaks(measured.frequency_hz, measured.receptance, predicted.receptance, noise)
        return replace(
            predicted,
            name=measured.label or measured.configuration,
            assembly=measured.configuration,
            response=measured.response,
            excitation=measured.excitation,
            measured=measured.receptance,
            measured_deviation=noise,
            peaks=self._peaks(measured, peaks, linear),
        )

    def _peaks(
        self, measured: Observation, peaks: Sequence[PredictedMode], linear: LinearFRF
    ) -> tuple[PredictedMode, ...]:
        """Return peaks with the mode and the standard deviation of the natural frequency at each.

        A measured peak without a predicted one is matched with a natural frequency that is left: the place of a sensor
        may be a node of the model, and not quite one of the structure. A peak that is no natural frequency, such as a
        summit between two antiresonances, has no standard deviation. Where an assembly ends with modes or a table,
        natural frequencies are those of the lines.
        """
        frequencies_hz = [hz for peak in peaks if (hz := peak.predicted_hz or peak.measured_hz) is not None]
        modes: list[PredictedMode] = []
        if frequencies_hz and self.assembly.countable:
            modes = list(self.natural_frequencies(1.1 * max(frequencies_hz)).modes)
        elif any(peak.predicted_hz is not None for peak in peaks):
            of_lines = self.peak_frequencies(measured.frequency_hz.real, linear).modes
            modes = [replace(mode, mode=None) for mode in of_lines]
        freedom, named = self.predictor.degrees_of_freedom, list(peaks)
        # Predicted peaks first: a natural frequency is that of one peak.
        for index in sorted(range(len(peaks)), key=lambda i: peaks[i].predicted_hz is None):
            peak = peaks[index]
            peak = replace(peak, configuration=measured.configuration, label=measured.label, degrees_of_freedom=freedom)
            at = peak.predicted_hz or peak.measured_hz or 0.0
            mode = min(modes, key=lambda mode: abs((mode.predicted_hz or 0.0) - at), default=None)
            if mode is not None and mode.predicted_hz is not None and abs(at / mode.predicted_hz - 1.0) < _SAME_PEAK:
                modes.remove(mode)
                predicted_hz = peak.predicted_hz or mode.predicted_hz
                peak = replace(peak, mode=mode.mode, predicted_hz=predicted_hz, deviation_hz=mode.deviation_hz)
            named[index] = peak
        return tuple(named)

    def recorded(self, measured: Observation) -> NDArray[np.complex128]:
        """Return the receptance that the identified measuring chain records on the lines of a measurement."""
        predictor = self.predictor
        mapping = predictor.parameters.at(replace(self._site, factors=FACTORS), self._tolerances, [])
        variables = Variables((*predictor.parameters.unknowns, *map(error_of, self.fresh)))
        x = np.append(predictor.x, np.zeros(len(self.fresh)))
        return np.asarray(calculated(measured, mapping, variables, x), dtype=np.complex128)

    def assemblies(self, count: int, seed: int) -> list[Assembly | None]:
        """Return assemblies with vectors drawn from the posterior; None where a vector has no model.

        The draws of an error follow from the seed and its name alone, so two assemblies that share the fit or an error
        get the same draws of it.
        """
        errors = _draw_errors(self.fresh, count, seed)
        vectors = np.concatenate([self.predictor.draw(count, seed), errors], axis=1)
        drawn: list[Assembly | None] = []
        for vector in vectors:
            try:
                drawn.append(self._mapping.apply(self._site.assembly, vector))
            except ValueError:
                drawn.append(None)  # a joint that is not passive, say
        return drawn

    def _with_model_error(
        self, lines_hz: NDArray[np.float64], receptance: NDArray[np.complex128], number: int, seed: int
    ) -> NDArray[np.complex128]:
        """Return the receptance of the draw of a number with the error of the model in it."""
        curve = Curve.of(lines_hz, receptance)
        return curve.moved_by(*self.model_errors(curve.modes, number, seed))

    def model_errors(self, modes: int, number: int, seed: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the error of the model in a draw: logarithms of frequency and level of each mode, `(modes,)` each."""
        discrepancy = self.predictor.discrepancy
        if discrepancy is None:
            return np.zeros(modes), np.zeros(modes)
        spread = self.predictor.spreads(number + 1, seed)[number]
        shift, level = spread * np.random.default_rng([seed, number, 2]).standard_normal((modes, 2)).T
        return discrepancy.frequency * shift, (discrepancy.relative or 0.0) * level

    def draw(self, value: Callable[[Assembly], _Value], count: int, seed: int) -> list[_Value | None]:
        """Return a value of each drawn assembly; None where it cannot be evaluated."""
        drawn: list[_Value | None] = []
        for assembly in self.assemblies(count, seed):
            try:
                drawn.append(None if assembly is None else value(assembly))
            except (ValueError, ReceptanceError):  # waves too short for an absurd length, say
                drawn.append(None)
        return drawn

    def drawn_receptances(
        self, receptance: Callable[[Assembly], NDArray[np.complex128]], linear: LinearFRF, count: int, seed: int
    ) -> list[NDArray[np.complex128] | None]:
        """Return a receptance of each drawn assembly with drawn errors of model and spindle; None without a model.

        Modes of a spindle are correlated: the data determine their sum far better than their numbers, and a vector that
        is drawn from a normal distribution of these has another sum. So errors of such an assembly are of first order
        in the logarithm of the receptance.
        """
        if count and self.has_uncertain_modes:
            drawn = self._drawn_to_first_order(linear, count, seed)
        else:
            drawn = self.draw(receptance, count, seed) if count else []
        if self.predictor.discrepancy is not None:
            lines = np.asarray(linear.frequency_hz).real
            drawn = [None if h is None else self._with_model_error(lines, h, i, seed) for i, h in enumerate(drawn)]
        if not linear.spindle_errors.any():
            return drawn
        errors = linear.drawn_errors(count, seed)
        return [None if h is None else h + error for h, error in zip(drawn, errors, strict=True)]

    @property
    def has_uncertain_modes(self) -> bool:
        """Whether numbers of modes that end the assembly are uncertain."""
        last = next(reversed(self.assembly.elements))
        return any(address.startswith(f"{last}.mode[") for address in self.addresses)

    def _drawn_to_first_order(self, linear: LinearFRF, count: int, seed: int) -> list[NDArray[np.complex128] | None]:
        variables, errors = self.predictor.correlated_deviations(count, seed), _draw_errors(self.fresh, count, seed)
        moved = variables @ self._by_variables.T + errors @ self._by_fresh.T
        changes = moved @ (linear.slope / linear.receptance[:, None]).T
        return [linear.receptance * np.exp(change) for change in changes]


class PredictedData:
    """Data of observations that were not fitted, beside the information of the fit; see `Predictor.of`.

    `variables` are the `p` fitted ones, followed by the `q` errors that only these observations have, which `fresh`
    names. `start` is their posterior mean, `(p + q,)`.
    """

    def __init__(
        self, predictor: Predictor, observations: Sequence[Observation], tolerances: Sequence[Sequence[Tolerance]]
    ) -> None:
        self._predictor, self._observations = predictor, tuple(observations)
        sites = [observation.site(index) for index, observation in enumerate(self._observations)]
        self._mappings, self.fresh = predictor.parameters.extended(sites, tolerances)
        self.variables = Variables((*predictor.parameters.unknowns, *map(error_of, self.fresh)))
        self.start = np.append(predictor.x, np.zeros(len(self.fresh)))

    def mean(self) -> list[NDArray[np.inexact]]:
        """Return the noise-free data of each observation; see `calculated`."""
        pairs = zip(self._observations, self._mappings, strict=True)
        return [calculated(observation, mapping, self.variables, self.start) for observation, mapping in pairs]

    def problem(self, observations: Sequence[Observation] | None = None, fitted: Sequence[Observation] = ()) -> Problem:
        """Return the residuals of the observations, followed by those of the information of the fit.

        Other `observations` have the same parameters and other data. With `fitted`, the observations of the fit on
        some of their lines, all with standard deviations, their residuals and the priors replace the information.
        """
        count = self._predictor.values.size
        measured = [*(self._observations if observations is None else observations), *fitted]
        mappings, information = self._mappings, None
        if fitted:
            sites = [observation.site(index) for index, observation in enumerate(fitted)]
            maps = self._predictor.parameters.of(sites)
            mappings = [*mappings, *(mapping.widened(count + len(self.fresh)) for mapping in maps)]
        else:
            root = np.eye(count + len(self.fresh))
            root[:count, :count] = self._predictor.information_root
            information = root, self.start
        units: list[Unit] = ["standard deviations"] * len(measured)
        return Problem(self.variables, measured, mappings, units, self._predictor.threads, information=information)

    @cached_property
    def _problem(self) -> Problem:
        return self.problem()

    def fit(self, most: int, least: float, *, all_variables: bool = False) -> End:
        """Return the fit of the errors that only these observations have, or of all variables, to their data.

        `most` is the largest number of evaluations; a fit ends where the next step lowers the cost by at most `least`.
        """
        free = np.arange(self.start.size) >= (0 if all_variables else self._predictor.values.size)
        return self._problem.fit_one(self.start, most, free=free, least=least)

    def residuals(self, end: End) -> list[NDArray[np.float64]]:
        """Return the residuals of each observation in standard deviations at the end of a fit."""
        return [part.copy() for part in self._problem.parts(self._problem.residual(end.x))]

    def assemblies(self, x: NDArray[np.float64]) -> list[Assembly]:
        """Return the assembly of each observation at values of the variables."""
        values = self.variables.to_values(x)
        pairs = zip(self._observations, self._mappings, strict=True)
        return [mapping.apply(observation.assembly, values) for observation, mapping in pairs]

    def log_score(self, end: End) -> float:
        """Return the logarithm of the predictive density of the data: of log FRFs, and of frequencies in Hz.

        It is a Laplace approximation about the fit of all variables, `end`: one that is linear about the prediction
        fails where a peak moves by more than its width.
        """
        if not np.isfinite(end.cost):
            return -math.inf
        rows = self._problem.jacobian(end.x)
        jacobian, root = np.split(rows, [len(rows) - rows.shape[1]])
        wide = np.linalg.solve(root.T, jacobian.T)
        _, volume = np.linalg.slogdet(np.eye(len(root)) + wide @ wide.T)
        spread = np.concatenate([observation.standard_deviations for observation in self._observations])
        return -end.cost - 0.5 * float(volume) - float(np.sum(np.log(spread * math.sqrt(2.0 * math.pi))))


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
        problem = Problem(variables, [observation], [mapping], ["logarithm"])
        real, imaginary = problem.parts(problem.value(x))[0].reshape(2, -1)
        recorded: NDArray[np.complex128] = observation.receptance * np.exp(-real - 1j * imaginary)
        return recorded
    assembly = mapping.apply(observation.assembly, variables.to_values(x))
    lowest, _ = assembly.lowest_natural_frequencies(max(observation.modes))
    frequencies: NDArray[np.float64] = lowest[np.array(observation.modes) - 1]
    return frequencies


def _draw_errors(names: Sequence[str], count: int, seed: int) -> NDArray[np.float64]:
    """Return draws `(count, q)` of standard normal errors, each of which depends on the seed and its name alone."""
    drawn = [np.random.default_rng([seed, zlib.crc32(name.encode())]).standard_normal(count) for name in names]
    return np.array(drawn).reshape(len(names), count).T
