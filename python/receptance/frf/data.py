"""Data of a frequency response function: its fields, and what follows from them alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from receptance import _checks
from receptance.frf import fields
from receptance.frf.fields import Labelled, MeasuredField, without_undefined_zero_line
from receptance.model.coordinates import Coordinate, Side
from receptance.units import Form, FRFKind, frf_unit


def _coherence(frf: Any, name: str, value: ArrayLike | None) -> NDArray[np.float64] | None:
    array = fields.per_entry()(frf, name, value)
    return None if array is None else fields.coherence(frf, array)


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class FRFData(Labelled):
    """Fields of an `FRF`, whose docstring lists them; a check may use the fields above its own."""

    frequency_hz: MeasuredField[ArrayLike, NDArray[np.float64]] = MeasuredField(
        fields.lines,
        "array_like",
        "`(n,)` ascending lines in Hz; the first may be at 0 Hz. It is dropped with a note if its values are not "
        "finite.",
        axes="lines",
    )
    values: MeasuredField[ArrayLike, NDArray[np.complex128]] = MeasuredField(
        fields.values,
        "array_like",
        "`(n,)` or `(n, n_responses, n_excitations)` complex, in SI units of the form, for e^(+i w t).",
        axes="entries",
    )
    form: MeasuredField[Form, Form] = MeasuredField(
        fields.form,
        '{"receptance", "mobility", "accelerance"}',
        "Displacement, velocity or acceleration per load.",
        default="receptance",
    )
    responses: MeasuredField[Side, tuple[Coordinate, ...]] = MeasuredField(
        fields.places(1),
        "Coordinate or sequence",
        'Where motion was measured; "y" or "theta" if only the direction is known. By default y at an unknown '
        "position.",
        default=None,
    )
    excitations: MeasuredField[Side, tuple[Coordinate, ...]] = MeasuredField(
        fields.places(2),
        "Coordinate or sequence",
        'Where loads acted, as for `responses`. Direction "theta" means per moment.',
        default=None,
    )
    decay_rate: MeasuredField[float, float] = MeasuredField(
        lambda frf, name, value: _checks.not_negative(frf.owner, name, value, unit="1/s"),
        "float",
        "sigma in 1/s of an exponential window exp(-sigma t) on force and response; the values are then those at the "
        "complex frequencies w - i sigma.",
        default=0.0,
    )
    coherence: MeasuredField[ArrayLike | None, NDArray[np.float64] | None] = MeasuredField(
        _coherence, "array_like", "From 0 to 1, shaped as `values` or `(n,)`.", axes="entries", default=None
    )
    averages: MeasuredField[int | None, int | None] = MeasuredField(
        lambda frf, name, value: None if value is None else fields.average_count(frf.owner, value),
        "int",
        "Number of averages.",
        default=None,
    )
    log_variance: MeasuredField[ArrayLike | None, NDArray[np.float64] | None] = MeasuredField(
        fields.per_entry(at_least=0.0),
        "array_like",
        "Variance of the real part, and of the imaginary part, of the logarithm of the values; shaped as `values`, "
        "`(n,)` or one number. Infinite where it is unknown.",
        axes="entries",
        default=None,
    )
    degrees_of_freedom: MeasuredField[ArrayLike | None, NDArray[np.float64] | None] = MeasuredField(
        fields.per_entry(above=0.0),
        "array_like",
        "Degrees of freedom of that variance; infinite or None if it is known exactly.",
        axes="entries",
        default=None,
    )
    correlated_lines: MeasuredField[ArrayLike, NDArray[np.float64]] = MeasuredField(
        lambda frf, name, value: _checks.by_line(frf.owner, name, value, frf.frequency_hz.shape, least=1.0),
        "array_like",
        "Number of neighbouring lines per independent value (exponential windows and zero padding correlate lines), "
        "one number or `(n,)`.",
        axes="lines",
        default=1.0,
    )
    usable: MeasuredField[ArrayLike | None, NDArray[np.bool_] | None] = MeasuredField(
        fields.usable, "array_like of bool", "`(n,)` lines inside the usable band.", axes="lines", default=None
    )
    labels: MeasuredField[Sequence[Sequence[str]] | None, fields.Labels | None] = MeasuredField(
        fields.labels,
        "pair of sequences of str",
        "Names of the responses and of the excitations in the file.",
        default=None,
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        without_undefined_zero_line(self, PER_ENTRY)

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


def _with_axes(axes: str) -> tuple[str, ...]:
    return tuple(name for name, field in FRFData.declared.items() if field.axes == axes)


PER_LINE, PER_ENTRY, WITHOUT_AXES = _with_axes("lines"), _with_axes("entries"), _with_axes("")
"""Names of the arrays by line, of those by line and entry, and of the other fields."""
