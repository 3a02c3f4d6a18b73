"""Data of a frequency response function: its fields, and what follows from them alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from receptance.model.coordinates import Coordinate
from receptance.units import Form, FRFKind, frf_unit


@dataclass(frozen=True, init=False, eq=False, repr=False)
class FRFData:
    """Fields of an `FRF`, whose documentation states their meaning."""

    frequency_hz: NDArray[np.float64]
    values: NDArray[np.complex128]
    form: Form
    responses: tuple[Coordinate, ...]
    excitations: tuple[Coordinate, ...]
    decay_rate: float
    coherence: NDArray[np.float64] | None
    averages: int | None
    log_variance: NDArray[np.float64] | None
    degrees_of_freedom: NDArray[np.float64] | None
    correlated_lines: NDArray[np.float64]
    usable: NDArray[np.bool_] | None
    labels: tuple[tuple[str, ...], tuple[str, ...]] | None
    label: str
    source: str
    notes: tuple[str, ...]

    @property
    def shape(self) -> tuple[int, int, int]:
        """Numbers of lines, responses and excitations."""
        n, n_out, n_in = self.values.shape
        return n, n_out, n_in

    @property
    def complex_frequency_hz(self) -> NDArray[np.inexact]:
        """`(n,)` frequencies of the values, f - i sigma / (2 pi) in Hz; real without an exponential window."""
        if self.decay_rate == 0.0:
            return self.frequency_hz
        return self.frequency_hz - 1j * self.decay_rate / (2.0 * np.pi)

    @property
    def standard_deviation(self) -> NDArray[np.float64] | None:
        """Standard deviation of the real part, and of the imaginary part, of the logarithm of the values."""
        return None if self.log_variance is None else np.sqrt(self.log_variance)

    @property
    def units(self) -> tuple[tuple[str, ...], ...]:
        """SI unit of each entry, responses first."""
        return tuple(
            tuple(frf_unit(FRFKind(self.form, r.direction, e.direction)) for e in self.excitations)
            for r in self.responses
        )

    @property
    def unit(self) -> str:
        """SI unit of all entries; raises ValueError if translations and rotations are mixed, see `units`."""
        if len(self.distinct_units) > 1:
            listed = ", ".join(self.distinct_units)
            raise ValueError(f"{self!r} has several units: {listed}; use units, or select one entry")
        return self.distinct_units[0]

    @property
    def distinct_units(self) -> tuple[str, ...]:
        """SI units of the entries without repetition, sorted."""
        return tuple(sorted({unit for row in self.units for unit in row}))

    def __len__(self) -> int:
        return self.frequency_hz.size

    def __repr__(self) -> str:
        n, n_out, n_in = self.shape
        name = f"{self.label!r}: " if self.label else ""
        window = f", decay rate {self.decay_rate:g}/s" if self.decay_rate else ""
        return (
            f"FRF({name}{self.form} in {', '.join(self.distinct_units)}, {n_out} x {n_in}, {n} lines from "
            f"{self.frequency_hz[0]:g} to {self.frequency_hz[-1]:g} Hz{window})"
        )


def band_text(frequency_hz: NDArray[np.float64]) -> str:
    """Return the band of lines as text, for messages."""
    return f", {frequency_hz[0]:g} to {frequency_hz[-1]:g} Hz" if frequency_hz.size else ""
