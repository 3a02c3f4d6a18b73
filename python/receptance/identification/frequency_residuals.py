"""Residuals of natural frequencies and damping ratios, and their derivatives with respect to the fitted variables."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from receptance.errors import ReceptanceError
from receptance.identification.damped import complex_frequencies
from receptance.identification.residuals import Addressed, AtValues, InfeasibleError, Pair, Unit

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.assembly import Assembly
    from receptance.identification.observations import MeasuredFrequencies

__all__ = ["FrequencyResidual"]

_FARTHEST = 1e3
"""A mode this many times above its measured frequency says nothing but that the point is far off."""


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
    def _model(self) -> AtValues:
        return AtValues(self._assembly, self._variables)

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
        try:
            found, slope = assembly.lowest_natural_frequencies(most, self._model.addresses)
        except (ReceptanceError, ValueError) as error:
            raise InfeasibleError(str(error)) from None
        if found[-1] > _FARTHEST * highest:
            raise InfeasibleError(f"mode {most} lies more than {_FARTHEST:g} times above where it was measured")
        return found[self._rows], slope[self._rows]

    def value(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return residuals alone; see `Residual`."""
        return self.evaluate(values, np.zeros(self._count))[0]
