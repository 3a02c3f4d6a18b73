"""Predictions of a fit: natural frequencies and receptances of other assemblies, and how sure they are.

To first order a prediction y errs by dy/dx e + dy/dt t: e has the covariance of the fitted variables x, and t are the
errors that the fit does not know, those of a new clamping say, which are standard normal. Where a resonance may move by
more than its width a receptance is no longer linear in them; there vectors are drawn instead, and each is evaluated.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance import _checks
from receptance.errors import ReceptanceError
from receptance.identification.mapping import Place
from receptance.identification.spread import quantile
from receptance.identification.unknowns import Variables

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from receptance.assembly import Assembly
    from receptance.coordinates import Coordinate
    from receptance.identification.laws import Tolerance
    from receptance.identification.result import Identification

__all__ = ["Forecast", "PredictedReceptance", "VariableDraws"]

_ATTEMPTS = 4
"""Times as many vectors as are wanted are drawn at most; one without a model is drawn again."""


@dataclass(frozen=True, kw_only=True)
class PredictedReceptance:
    """A predicted receptance and where the true one may be.

    Attributes
    ----------
    frequency_hz : ndarray
        `(n,)` lines, real or complex.
    receptance : ndarray
        `(n,)` complex, with the identified values.
    deviation, phase_deviation : ndarray
        `(n,)` standard deviations of the real and of the imaginary part of its logarithm, to first order; infinite
        where a parameter that matters is not determined.
    drawn : ndarray
        `(draws, n)` logarithms of the magnitude for vectors that were drawn; `(0, n)` if none were asked for.
    degrees_of_freedom : int or None
        Of the scatter, where it was estimated; None where it was known.
    """

    frequency_hz: NDArray[Any]
    receptance: NDArray[np.complex128]
    deviation: NDArray[np.float64]
    phase_deviation: NDArray[np.float64]
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
            half = reach * np.hypot(self.deviation, noise)
            low, high = middle - half, middle + half
        with np.errstate(over="ignore"):
            return np.exp(low), np.exp(high)

    def __repr__(self) -> str:
        low, high = self.frequency_hz[[0, -1]].real
        return f"PredictedReceptance({self.frequency_hz.size} lines from {low:g} to {high:g} Hz)"


class VariableDraws:
    """Values of the unknowns of a fit that may be the true ones.

    Fitted variables are normal with the covariance of the fit, within their bounds; what the data do not determine at
    all is anywhere within them.
    """

    def __init__(self, fit: Identification) -> None:
        self._variables = Variables(fit.unknowns)
        self._centre = self._variables.from_values(np.array(list(fit.values.values())))
        self._known = ~np.isinf(np.diag(fit.covariance))
        covariance = fit.covariance[np.ix_(self._known, self._known)]
        deviation = np.sqrt(np.diag(covariance))
        scale = np.where(deviation > 0.0, deviation, 1.0)
        values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
        self._root = scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))

    def values(self, random: np.random.Generator, moved: NDArray[np.float64] | float = 0.0) -> NDArray[np.float64]:
        """Return one draw `(p,)` in SI units; `moved` is added to the fitted variables."""
        low, high = self._variables.limits
        x = low + (high - low) * random.random(self._centre.size)
        x[self._known] = self._centre[self._known] + self._root @ random.standard_normal(len(self._root))
        return self._variables.to_values(np.clip(x + moved, low, high))


class Forecast:
    """An assembly with the identified values, and how its parameters move with what the fit left open.

    Parameters
    ----------
    fit : Identification
        What was found.
    assembly, configuration, conditions, tolerances
        As in `Identification.apply`.
    label : str, optional
        Of a measurement that has errors of its own.

    Attributes
    ----------
    assembly : Assembly
        With the identified values.
    addresses : tuple of str
        What moves, `m` parameters.
    fresh : tuple of str
        Errors that the fit does not know, `q` of them.
    """

    def __init__(
        self,
        fit: Identification,
        assembly: Assembly,
        configuration: str = "",
        conditions: Mapping[str, float] | None = None,
        tolerances: Sequence[Tolerance] | None = None,
        label: str = "",
    ) -> None:
        fresh: list[str] = []
        place = Place(assembly, configuration, label, conditions or {})
        self._placed = fit.task.parameters.at(place, tolerances, fresh)
        if not self._placed.addresses:
            raise ValueError(f"{assembly!r} has none of the identified parameters {', '.join(fit.addresses)}")
        self._fit = fit
        self._bare = assembly
        self._values = np.array(list(fit.values.values()))
        vector = np.append(self._values, np.zeros(len(fresh)))
        self.assembly = self._placed.apply(assembly, vector)
        self.addresses = self._placed.addresses
        self.fresh = tuple(fresh)
        slope = self._placed.jacobian(vector)
        count = self._values.size
        self._own = slope[:, :count] * Variables(fit.unknowns).slopes(self._values)
        self._new = slope[:, count:]

    def deviation(self, slope: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return standard deviations `(n,)` of numbers with derivatives `(n, m)` per SI unit of the addresses."""
        lost = np.isinf(np.diag(self._fit.covariance))
        own = slope @ self._own
        kept = own[:, ~lost]
        variance = np.einsum("ni,ij,nj->n", kept, self._fit.covariance[np.ix_(~lost, ~lost)], kept)
        variance = np.maximum(variance, 0.0) + np.sum((slope @ self._new) ** 2, axis=1)
        return np.where(np.any(own[:, lost] != 0.0, axis=1), np.inf, np.sqrt(variance))

    def natural_frequencies(self, upper_hz: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return natural frequencies and their standard deviations in Hz."""
        found, slope = self.assembly.natural_frequency_derivatives(upper_hz, self.addresses)
        return found, self.deviation(slope)

    def receptance(
        self,
        frequency_hz: ArrayLike,
        response: Coordinate | None,
        excitation: Coordinate | None,
        draws: int,
        seed: int,
        threads: int | None,
    ) -> PredictedReceptance:
        """Return a receptance with its deviations, and with its magnitudes for vectors that are drawn."""
        places: dict[str, Any] = {"response": response, "excitation": excitation, "threads": threads}
        found, slope = self.assembly.derivatives(frequency_hz, self.addresses, **places)
        slope = slope / found[:, None]
        drawn = [np.log(np.abs(a.receptance(frequency_hz, **places))) for a in self.drawn(draws, seed)]
        return PredictedReceptance(
            frequency_hz=np.asarray(frequency_hz),
            receptance=found,
            deviation=self.deviation(slope.real),
            phase_deviation=self.deviation(slope.imag),
            drawn=np.array(drawn).reshape(-1, found.size),
            degrees_of_freedom=None if self._fit.known_scatter else self._fit.degrees_of_freedom,
        )

    def drawn(self, draws: int, seed: int) -> list[Assembly]:
        """Return assemblies with vectors drawn from what the fit left open.

        As `VariableDraws`; errors that the fit does not know are standard normal.
        """
        drawing = VariableDraws(self._fit)
        random = np.random.default_rng(seed)
        found: list[Assembly] = []
        for _ in range(_ATTEMPTS * draws):
            if len(found) == draws:
                break
            vector = np.append(drawing.values(random), random.standard_normal(len(self.fresh)))
            try:
                found.append(self._placed.apply(self._bare, vector))
            except ValueError:
                continue  # a joint that is no longer passive, say
        if len(found) < draws:
            raise ReceptanceError(
                f"only {len(found)} of {_ATTEMPTS * draws} vectors drawn from the covariance of the fit have a model"
            )
        return found
