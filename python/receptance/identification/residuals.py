"""Residuals of one observation each, and their derivatives with respect to the fitted variables.

The fit knows nothing of assemblies: it asks each of these for numbers at a point. So another way to evaluate an
observation (a compressed residual, many points at once) is another class here and nothing else.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, Protocol

import numpy as np

from receptance._stepped_place import SteppedPlace
from receptance.errors import ReceptanceError
from receptance.identification.early_end import EarlyEnd
from receptance.identification.factors import DECAY_RATES, DELAY, END, FACTORS, LOG_GAIN, frequency_weights
from receptance.identification.unknowns import covered

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.assembly import Assembly
    from receptance.identification.observations import MeasuredFRF

__all__ = ["Addressed", "AtValues", "FRFResidual", "InfeasibleError", "Pair", "Residual", "Unit"]

Unit = Literal["standard deviations", "percent", "logarithm", "relative"]
"""What a residual of 1 means: one logarithm is a factor of e, one relative is twice a natural frequency."""
Pair = tuple["NDArray[np.float64]", "NDArray[np.float64]"]

LONGEST = 1.2
"""An early end is looked for up to this many times the one that is stated."""


class InfeasibleError(Exception):
    """A point at which the model has no value; the fit keeps away from it."""


class Residual(Protocol):
    """What the fit asks of an observation."""

    unit: Unit
    """What a residual of 1 means."""

    @property
    def size(self) -> int:
        """Number of residuals."""

    def evaluate(self, values: NDArray[np.float64], slopes: NDArray[np.float64]) -> Pair:
        """Return residuals `(size,)` and their derivatives with respect to the fitted variables `(size, p)`.

        `values` are all unknowns in SI units, `slopes` their derivatives with respect to the variables. Raises
        `InfeasibleError` where the model has no value.
        """

    def value(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the residuals alone."""


class Addressed(Protocol):
    """The unknowns of a residual: those of the whole fit, or the parameters of its own assembly."""

    @property
    def addresses(self) -> tuple[str, ...]:
        """Their addresses, in the order of `values`."""


class AtValues:
    """An assembly as a function of those unknowns that it has."""

    def __init__(self, assembly: Assembly, variables: Addressed) -> None:
        self.assembly = assembly
        self.columns = [i for i, name in enumerate(variables.addresses) if covered(name, assembly)]
        self.addresses = [variables.addresses[i] for i in self.columns]

    def at(self, values: NDArray[np.float64]) -> Assembly:
        """Return the assembly at a point."""
        try:
            return self.assembly.replace(dict(zip(self.addresses, values[self.columns].tolist(), strict=True)))
        except ValueError as error:
            raise InfeasibleError(str(error)) from None


class _Factors:
    """What the observation itself does to a receptance: a gain, a delay, a decaying window (see `factors`)."""

    def __init__(self, variables: Addressed, lines: NDArray[Any]) -> None:
        self.columns = {name: variables.addresses.index(name) for name in FACTORS if name in variables.addresses}
        self._lines = lines
        self._angular = 2.0 * np.pi * lines.real
        self._stated = 2j * np.pi * lines
        self._decays = {name: column for name, column in self.columns.items() if name in DECAY_RATES}

    def lines(self, values: NDArray[np.float64]) -> NDArray[Any]:
        """Return the lines on which the structure is evaluated."""
        if not self._decays:
            return self._lines
        shifted: NDArray[Any] = self._lines - 1j * self.rate(values) / (2.0 * np.pi)
        return shifted

    def rate(self, values: NDArray[np.float64]) -> float:
        """Return the rate of windows that nobody stated."""
        return float(sum(values[column] for column in self._decays.values()))

    def weights(self, assembly: Assembly) -> tuple[list[str], NDArray[np.float64]]:
        """Return the addresses whose derivatives make that with respect to frequency, and their weights."""
        return frequency_weights(assembly) if self._decays else ([], np.empty(0))

    def factor(self, values: NDArray[np.float64]) -> NDArray[np.complex128] | float:
        """Return what the receptance is multiplied by."""
        if not self.columns:
            return 1.0
        gain = values[self.columns[LOG_GAIN]] if LOG_GAIN in self.columns else 0.0
        delay = values[self.columns[DELAY]] if DELAY in self.columns else 0.0
        result: NDArray[np.complex128] = np.exp(gain - 1j * self._angular * delay)
        for name, column in self._decays.items():
            result *= (1.0 + values[column] / self._stated) ** DECAY_RATES[name]
        return result

    def slope(
        self,
        name: str,
        values: NDArray[np.float64],
        by_frequency: NDArray[np.complex128],
        by_end: NDArray[np.complex128] | float = 0.0,
    ) -> NDArray[np.complex128]:
        """Return the derivative of the logarithm of the receptance; `by_frequency` is that by ln w."""
        if name == END:
            return np.broadcast_to(np.asarray(by_end, dtype=np.complex128), self._angular.shape)
        if name in DECAY_RATES:
            rate = values[self.columns[name]]
            result: NDArray[np.complex128] = (by_frequency + DECAY_RATES[name]) / (self._stated + rate)
            return result
        if name == DELAY:
            return np.asarray(-1j * self._angular, dtype=np.complex128)
        return np.ones(self._angular.size, dtype=np.complex128)


class FRFResidual:
    """Residuals of a measured receptance on its chosen lines, those of the magnitude where the unit is percent."""

    def __init__(
        self,
        frf: MeasuredFRF,
        variables: Addressed,
        unit: Unit,
        chosen: NDArray[np.bool_] | None,
        threads: int | None,
    ) -> None:
        select: NDArray[np.bool_] | slice = slice(None) if chosen is None else chosen
        self._frf, self._variables = frf, variables
        self._options: Any = {"threads": threads, "force": None if frf.force is None else frf.force[select]}
        self.unit = unit
        self._percentage = unit == "percent"
        self._count = len(variables.addresses)
        self._lines = frf.frequency_hz[select]
        self._end = frf.ends
        self._early = None if frf.ends is None else EarlyEnd(self._lines, LONGEST * frf.ends)
        self._measured = frf.receptance[select]
        self._weight = None
        if unit == "standard deviations" and frf.standard_deviation is not None:
            self._weight = 1.0 / frf.standard_deviation[select]

    # What only an evaluation here needs: most fits run in the core.
    @cached_property
    def _model(self) -> AtValues:
        return AtValues(self._frf.assembly, self._variables)

    @cached_property
    def _places(self) -> list[SteppedPlace]:
        return [SteppedPlace(self._frf.assembly, place) for place in (self._frf.response, self._frf.excitation)]

    @cached_property
    def _factors(self) -> _Factors:
        return _Factors(self._variables, self._lines)

    @cached_property
    def _inverse(self) -> NDArray[np.complex128]:
        result: NDArray[np.complex128] = -1.0 / self._measured
        return result

    @property
    def size(self) -> int:
        """Number of residuals: one a line for percentages, else two."""
        return self._lines.size * (1 if self._percentage else 2)

    def arrays(self) -> tuple[NDArray[np.complex128], NDArray[np.complex128], NDArray[np.float64]] | None:
        """Return lines in rad/s, measured values and weights; None for what is no logarithm on these lines alone."""
        if self._percentage or self._early is not None:
            return None
        weights = np.ones(self._lines.size) if self._weight is None else self._weight
        lines = np.ascontiguousarray(2.0 * np.pi * self._lines, dtype=np.complex128)
        return lines, np.ascontiguousarray(self._measured), np.ascontiguousarray(weights)

    def evaluate(self, values: NDArray[np.float64], slopes: NDArray[np.float64]) -> Pair:
        """Return residuals and their derivatives; see `Residual`."""
        model = self._model
        assembly = model.at(values)
        response, excitation = (place.on(assembly) for place in self._places)
        factors = self._factors
        extra, weights = factors.weights(assembly)
        addresses = [*model.addresses, *extra]
        try:
            h, dh = assembly.derivatives(
                self._evaluated(values), addresses, response=response, excitation=excitation, **self._options
            )
        except (ReceptanceError, ValueError) as error:
            raise InfeasibleError(str(error)) from None
        with np.errstate(all="ignore"):
            h, dh, by_end = self._ended(h, dh, values)
            columns = model.columns
            if factors.columns:
                own = len(model.addresses)
                by_frequency = dh[:, own:] @ weights / h
                added = np.column_stack(
                    [h * factors.slope(name, values, by_frequency, by_end) for name in factors.columns]
                )
                factor = np.asarray(factors.factor(values))
                dh = np.hstack([dh[:, :own], added]) * factor[:, None]
                h = h * factor
                columns = [*columns, *factors.columns.values()]
            # Of the logarithm's derivative dH/H, times -1: the measured receptance is divided by once and for all.
            ratio = self._measured / h
            relative = dh * (ratio * self._inverse)[:, None]
            if self._percentage:
                return self._percent(ratio, relative, slopes, columns)
            return self._logarithm(ratio, relative, slopes, columns)

    def value(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return residuals alone; see `Residual`."""
        assembly = self._model.at(values)
        response, excitation = (place.on(assembly) for place in self._places)
        try:
            lines = self._evaluated(values)
            h = assembly.receptance(lines, response=response, excitation=excitation, **self._options)
            h, _, _ = self._ended(h, h[:, None], values)
        except (ReceptanceError, ValueError) as error:
            raise InfeasibleError(str(error)) from None
        ratio = self._measured / (h * self._factors.factor(values))
        if self._percentage:
            return 100.0 / np.abs(ratio) - 100.0
        residual = np.stack([np.log(np.abs(ratio)), np.angle(ratio)])
        if self._weight is not None:
            residual *= self._weight
        return residual.reshape(-1)

    def _evaluated(self, values: NDArray[np.float64]) -> NDArray[Any]:
        """Return the lines on which the structure is evaluated."""
        if self._early is None:
            return self._factors.lines(values)
        shifted: NDArray[Any] = self._early.lines_hz - 1j * self._factors.rate(values) / (2.0 * np.pi)
        return shifted

    def _ended(
        self, h: NDArray[np.complex128], dh: NDArray[np.complex128], values: NDArray[np.float64]
    ) -> tuple[NDArray[np.complex128], NDArray[np.complex128], NDArray[np.complex128] | float]:
        """Return what a record that ends early shows of the response, and its logarithm's derivative by that end."""
        if self._early is None or self._end is None:
            return h, dh, 0.0
        column = self._factors.columns.get(END)
        end = self._end if column is None else float(values[column])
        rate = self._factors.rate(values)
        both = self._early.seen(np.column_stack([h, dh]), end, rate)
        return both[:, 0], both[:, 1:], self._early.slope(h, end, rate) / both[:, 0]

    def _logarithm(
        self,
        ratio: NDArray[np.complex128],
        relative: NDArray[np.complex128],
        slopes: NDArray[np.float64],
        columns: list[int],
    ) -> Pair:
        n = ratio.size
        residual = np.empty((2, n))
        np.log(np.abs(ratio), out=residual[0])
        residual[1] = np.angle(ratio)
        jacobian = np.zeros((2, n, self._count))
        jacobian[0][:, columns] = relative.real * slopes[columns]
        jacobian[1][:, columns] = relative.imag * slopes[columns]
        if self._weight is not None:
            residual *= self._weight
            jacobian *= self._weight[:, None]
        return residual.reshape(2 * n), jacobian.reshape(2 * n, self._count)

    def _percent(
        self,
        ratio: NDArray[np.complex128],
        relative: NDArray[np.complex128],
        slopes: NDArray[np.float64],
        columns: list[int],
    ) -> Pair:
        share = 100.0 / np.abs(ratio)
        jacobian = np.zeros((ratio.size, self._count))
        jacobian[:, columns] = -share[:, None] * relative.real * slopes[columns]
        return share - 100.0, jacobian
