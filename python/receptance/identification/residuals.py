"""Residuals of one observation each, and their derivatives with respect to the fitted variables.

The fit knows nothing of assemblies: it asks each of these for numbers at a point. So another way to evaluate an
observation (a compressed residual, many points at once) is another class here and nothing else.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, Protocol

import numpy as np

from receptance.beams import Part
from receptance.errors import ReceptanceError
from receptance.identification.damped import complex_frequencies
from receptance.identification.factors import DECAY_RATES, DELAY, FACTORS, LOG_GAIN, frequency_weights
from receptance.identification.unknowns import covered

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.assembly import Assembly
    from receptance.coordinates import Coordinate
    from receptance.identification.observations import MeasuredFrequencies, MeasuredFRF

__all__ = ["FRFResidual", "FrequencyResidual", "InfeasibleError", "Pair", "Residual", "SteppedPlace", "Unit"]

Unit = Literal["standard deviations", "percent", "logarithm", "relative"]
"""What a residual of 1 means: one logarithm is a factor of e, one relative is twice a natural frequency."""
Pair = tuple["NDArray[np.float64]", "NDArray[np.float64]"]

_MARGIN = 1.05
"""Modes are counted up to this many times the highest measured frequency first."""
_GROWTH = 1.5
"""By how much the limit grows when there are too few modes below it."""
_FARTHEST = 1e3
"""A mode this many times above its measured frequency says nothing but that the point is far off."""


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


class _Model:
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
        rate = sum(values[column] for column in self._decays.values())
        shifted: NDArray[Any] = self._lines - 1j * rate / (2.0 * np.pi)
        return shifted

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
        self, name: str, values: NDArray[np.float64], by_frequency: NDArray[np.complex128]
    ) -> NDArray[np.complex128]:
        """Return the derivative of the logarithm of the receptance; `by_frequency` is that by ln w."""
        if name in DECAY_RATES:
            rate = values[self.columns[name]]
            result: NDArray[np.complex128] = (by_frequency + DECAY_RATES[name]) / (self._stated + rate)
            return result
        if name == DELAY:
            return np.asarray(-1j * self._angular, dtype=np.complex128)
        return np.ones(self._angular.size, dtype=np.complex128)


class SteppedPlace:
    """A coordinate that stays on its step between two segments when a length changes."""

    def __init__(self, assembly: Assembly, place: Coordinate) -> None:
        self._place = place
        self._step: int | None = None
        if place.position != "end":
            edges = _edges(assembly, place.part)
            distance = np.abs(edges - place.position)
            if distance.min() <= 1e-9 * edges[-1]:
                self._step = int(distance.argmin())

    def on(self, assembly: Assembly) -> Coordinate:
        """Return the coordinate on the assembly with other lengths."""
        if self._step is None:
            return self._place
        return replace(self._place, position=float(_edges(assembly, self._place.part)[self._step]))


def _edges(assembly: Assembly, name: str) -> NDArray[np.float64]:
    """Return where the segments of a part begin and end."""
    part = assembly.elements[name or next(iter(assembly.elements))]
    lengths = [segment.length for segment in part.segments] if isinstance(part, Part) else []
    return np.cumsum([0.0, *lengths])


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
        self._measured = frf.receptance[select]
        self._weight = None
        if unit == "standard deviations" and frf.standard_deviation is not None:
            self._weight = 1.0 / frf.standard_deviation[select]

    # What only an evaluation here needs: most fits run in the core.
    @cached_property
    def _model(self) -> _Model:
        return _Model(self._frf.assembly, self._variables)

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
        """Return lines in rad/s, measured values and weights; None for percentages, which are no logarithm."""
        if self._percentage:
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
                factors.lines(values), addresses, response=response, excitation=excitation, **self._options
            )
        except (ReceptanceError, ValueError) as error:
            raise InfeasibleError(str(error)) from None
        with np.errstate(all="ignore"):
            columns = model.columns
            if factors.columns:
                own = len(model.addresses)
                by_frequency = dh[:, own:] @ weights / h
                added = np.column_stack([h * factors.slope(name, values, by_frequency) for name in factors.columns])
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
            lines = self._factors.lines(values)
            h = assembly.receptance(lines, response=response, excitation=excitation, **self._options)
        except (ReceptanceError, ValueError) as error:
            raise InfeasibleError(str(error)) from None
        ratio = self._measured / (h * self._factors.factor(values))
        if self._percentage:
            return 100.0 / np.abs(ratio) - 100.0
        residual = np.stack([np.log(np.abs(ratio)), np.angle(ratio)])
        if self._weight is not None:
            residual *= self._weight
        return residual.reshape(-1)

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


class FrequencyResidual:
    """Residuals of measured natural frequencies, and of the damping ratios beside them."""

    def __init__(self, measured: MeasuredFrequencies, variables: Addressed, unit: Unit) -> None:
        self.unit = unit
        self._assembly, self._variables = measured.assembly, variables
        self._measured = measured.frequency_hz
        self._rows = np.array(measured.modes) - 1
        self._count = len(variables.addresses)
        self._damped = measured.damped
        spread = measured.standard_deviation_hz
        share = 0.01 if unit == "percent" else 1.0
        weighed = unit == "standard deviations" and spread is not None
        self._unit_hz = spread if weighed and spread is not None else self._measured * share
        self._damping = np.empty(0)
        self._unit_damping = np.empty(0)
        if measured.damping_ratio is not None:
            self._damping = measured.damping_ratio[self._damped]
            known = measured.standard_deviation_damping
            self._unit_damping = (
                known[self._damped] if weighed and known is not None else np.maximum(self._damping, 1e-4) * share
            )

    @cached_property
    def _model(self) -> _Model:
        return _Model(self._assembly, self._variables)

    @property
    def size(self) -> int:
        """Number of frequencies and damping ratios."""
        return self._measured.size + self._damping.size

    def arrays(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]] | None:
        """Return modes counted from zero, measured angular frequencies and weights; None where damping counts."""
        if self._damping.size:
            return None
        return self._rows.astype(np.float64), 2.0 * np.pi * self._measured, 0.5 / (np.pi * self._unit_hz)

    def evaluate(self, values: NDArray[np.float64], slopes: NDArray[np.float64]) -> Pair:
        """Return residuals and their derivatives; see `Residual`."""
        model = self._model
        assembly = model.at(values)
        found, slope = self._undamped(assembly)
        ratio, steeper = np.empty(0), np.empty((0, len(model.addresses)))
        if self._damping.size:
            try:
                poles, moved = complex_frequencies(assembly, found, model.addresses)
            except (ReceptanceError, ValueError) as error:
                raise InfeasibleError(str(error)) from None
            # |w| and Im w / |w|, and what they change by with w.
            found = np.abs(poles)
            slope = (np.conj(poles)[:, None] * moved).real / found[:, None]
            ratio = (poles.imag / found)[self._damped]
            steeper = ((moved.imag - (poles.imag / found)[:, None] * slope) / found[:, None])[self._damped]
        jacobian = np.zeros((self.size, self._count))
        jacobian[:, model.columns] = (
            np.vstack([slope / self._unit_hz[:, None], steeper / self._unit_damping[:, None]]) * slopes[model.columns]
        )
        residual = [(found - self._measured) / self._unit_hz, (ratio - self._damping) / self._unit_damping]
        return np.concatenate(residual), jacobian

    def _undamped(self, assembly: Assembly) -> Pair:
        """Return undamped natural frequencies of the measured modes, and their derivatives."""
        most = int(self._rows[-1]) + 1
        highest = float(self._measured[-1])
        upper = _MARGIN * highest
        while True:
            try:
                found, slope = assembly.natural_frequency_derivatives(upper, self._model.addresses)
            except ReceptanceError as error:
                raise InfeasibleError(str(error)) from None
            if len(found) >= most:
                return found[self._rows], slope[self._rows]
            if upper > _FARTHEST * highest:
                raise InfeasibleError(f"mode {most} lies more than {_FARTHEST:g} times above where it was measured")
            upper *= _GROWTH

    def value(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return residuals alone; see `Residual`."""
        return self.evaluate(values, np.zeros(self._count))[0]
