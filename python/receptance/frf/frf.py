"""Measured frequency response functions with form, coordinates, variance and provenance."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, Self, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from receptance import _checks
from receptance.errors import ReceptanceWarning
from receptance.frf import fields
from receptance.frf.data import PER_ENTRY, PER_LINE, FRFData, band_text
from receptance.frf.fields import store, without_undefined_zero_line
from receptance.frf.interchange import Order, dataset, fields_from_pandas, fields_from_xarray, frame, ordered, reordered
from receptance.frf.plausibility import drive_point_notes
from receptance.frf.resampling import resample
from receptance.frf.variance import interval_factor, pool_entries, saturation_note, variance_from_coherence
from receptance.model.coordinates import Coordinate
from receptance.report import Renderable, Table
from receptance.report.table import percent
from receptance.units import FORMS, Form

if TYPE_CHECKING:
    import pandas
    import xarray

Selection: TypeAlias = Coordinate | str | int | Sequence[Coordinate | str | int] | None
"""Responses or excitations to select: by number, coordinate or label; all by default."""

_ASSIGNED = ("frequency_hz", "values")
"""Fields whose change requires a check of all others."""
_PHYSICAL = {*_ASSIGNED, "form", "responses", "excitations", "usable"}
"""Fields whose change requires a new plausibility check of the drive points."""


class FRF(FRFData, Renderable):
    """Frequency response function (FRF) between one or several excitations and responses.

    Parameters
    ----------
    {fields}

    Attributes
    ----------
    values, coherence, log_variance, degrees_of_freedom : ndarray
        `(n, n_responses, n_excitations)`, read-only; the last three are None if not given.

    Raises
    ------
    TypeError, ValueError
        Mismatched shapes, lines that are not ascending, values that are not finite, a coherence above 1; the message
        names the field and the line.

    Warns
    -----
    ReceptanceWarning
        A drive point whose peaks contradict the declared form, sign or time convention. The data are not changed:
        declare another form, or use `conjugated` or `flipped`.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance import FRF
    >>> f = np.linspace(900.0, 1100.0, 201)
    >>> frf = FRF(frequency_hz=f, values=1e-3 / (1000.0**2 - f**2 + 10j * f), label="tip")
    >>> frf
    FRF('tip': receptance in m/N, 1 x 1, 201 lines from 900 to 1100 Hz)
    >>> frf.to("accelerance").unit
    'm/s^2/N'
    """

    plotted_by = "receptance.frf.figure:draw_frf"
    drawn_in_notebooks = True

    def __post_init__(self) -> None:
        super().__post_init__()
        self._warn_of_contradictions(stacklevel=4)

    def _warn_of_contradictions(self, stacklevel: int) -> None:
        for contradiction in self.contradictions:
            warnings.warn(f"{self!r}: {contradiction}", ReceptanceWarning, stacklevel=stacklevel)

    @cached_property
    def contradictions(self) -> tuple[str, ...]:
        """A note on each drive point whose peaks contradict the form, the sign or the time convention."""
        return tuple(drive_point_notes(self))

    def to(self, form: Form) -> FRF:
        """Return the FRF in another form: multiplied by a power of i w, with the complex w of an exponential window.

        Variance of the logarithm, coherence and lines are kept. A line at 0 Hz is dropped with a note if it would be
        divided by zero.

        Raises
        ------
        TypeError, ValueError
            An unknown form, or a conversion of the line at 0 Hz alone.

        Examples
        --------
        >>> from receptance import FRF
        >>> mass = FRF(frequency_hz=[0.0, 10.0], values=[0.5, 0.5], form="accelerance")
        >>> mass.to("receptance").notes
        ('the line at 0 Hz is dropped: the displacement does not follow from the acceleration there',)
        """
        new = fields.form(self, "form", form)
        if new == self.form:
            return self
        source, notes = self, self.notes
        if self.frequency_hz[0] == self.decay_rate == 0.0 and FORMS.index(new) < FORMS.index(self.form):
            motions = dict(zip(FORMS, ("displacement", "velocity", "acceleration"), strict=True))
            if self.frequency_hz.size == 1:
                raise ValueError(f"{self!r}: the {new} does not follow from the {self.form} at 0 Hz, its only line")
            reason = f"the {motions[new]} does not follow from the {motions[self.form]} there"
            notes = (*notes, f"the line at 0 Hz is dropped: {reason}")
            source = self.on_lines(slice(1, None))
        factor = form_factor(source.complex_frequency_hz, self.form, new)[:, None, None]
        return source._copy(form=new, values=source.values * factor, notes=notes)

    def select(
        self,
        *,
        responses: Selection = None,
        excitations: Selection = None,
        low_hz: float | None = None,
        high_hz: float | None = None,
    ) -> FRF:
        """Return some of the responses and excitations, and the lines between two frequencies, both included.

        Parameters
        ----------
        responses, excitations : int, Coordinate, str or sequence, optional
            By number from 0, by coordinate, or by label in the file; all by default.
        low_hz, high_hz : float, optional
            Ends of the band in Hz.

        Raises
        ------
        TypeError, ValueError
            An unknown or ambiguous response or excitation, or a band without lines.
        """
        low = -np.inf if low_hz is None else _checks.number(repr(self), "low_hz", low_hz, unit="Hz")
        high = np.inf if high_hz is None else _checks.number(repr(self), "high_hz", high_hz, unit="Hz")
        inside = (self.frequency_hz >= low) & (self.frequency_hz <= high)
        if not inside.any():
            raise ValueError(f"{self!r}: there is no line from {low:g} to {high:g} Hz")
        names = self.labels or (None, None)
        rows = _selected(repr(self), "responses", responses, self.responses, names[0])
        columns = _selected(repr(self), "excitations", excitations, self.excitations, names[1])
        return self.on_lines(inside)._of_entries(rows, columns)

    def masked(self) -> FRF:
        """Return the usable lines only; all lines if `usable` is None.

        Raises
        ------
        ValueError
            No line is usable.
        """
        if self.usable is None or self.usable.all():
            return self
        if not self.usable.any():
            raise ValueError(f"{self!r}: no line is usable")
        return self.on_lines(self.usable)

    def resample(self, frequency_hz: ArrayLike) -> FRF:
        """Return the FRF on other lines, which may not be closer together than the measured ones.

        Measured lines keep their values exactly; others are interpolated by a cubic spline. Variance and coherence are
        interpolated linearly: the mean of two lines is not taken to be more precise than one line.

        Parameters
        ----------
        frequency_hz : array_like
            `(m,)` ascending lines in Hz, inside those measured.

        Raises
        ------
        TypeError, ValueError
            Lines outside the measured band, or closer together than the measured lines.

        Warns
        -----
        ReceptanceWarning
            A peak with fewer than four lines in its half-power band, where the interpolation error exceeds 1 %.

        Examples
        --------
        >>> from receptance import FRF
        >>> frf = FRF(frequency_hz=[10.0, 20.0, 30.0, 40.0], values=[4.0, 3.0, 2.0, 1.0])
        >>> frf.resample([15.0, 30.0]).values.ravel().real
        array([3.5, 2. ])
        """
        changes, warning = resample(self, fields.lines(self, "frequency_hz", frequency_hz))
        if warning:
            warnings.warn(f"{self!r}: {warning}", ReceptanceWarning, stacklevel=2)
        return self._copy(**changes)

    def log_interval(self, level: float = 0.95) -> NDArray[np.float64]:
        """Half-width `(n, n_responses, n_excitations)` of the interval of the real and the imaginary part of the log.

        From Student's t distribution with the degrees of freedom of the variance; from the normal distribution if the
        variance is known exactly.

        Raises
        ------
        ValueError
            No variance, or a level outside 0 to 1.

        Examples
        --------
        >>> from receptance import FRF
        >>> frf = FRF(frequency_hz=[10.0], values=[1e-6], log_variance=1e-4, degrees_of_freedom=4)
        >>> frf.log_interval().round(4).item()
        0.0278
        """
        if self.log_variance is None:
            raise ValueError(
                f"{self!r} has no variance; with coherence and averages it follows from with_coherence_variance()"
            )
        return np.asarray(np.sqrt(self.log_variance) * interval_factor(level, self.degrees_of_freedom))

    def with_coherence_variance(self, *, averages: int | None = None, pool: bool = True) -> FRF:
        """Return the FRF with the variance computed from its coherence and number of averages.

        Parameters
        ----------
        averages : int, optional
            Number of averages; that of the FRF by default.
        pool : bool, optional
            Whether neighbouring lines are pooled, see `receptance.frf.variance`.

        Raises
        ------
        TypeError, ValueError
            No coherence, or fewer than two averages.
        """
        n = self.averages if averages is None else averages
        if self.coherence is None:
            raise ValueError(f"{self!r} has no coherence, from which its variance could be computed")
        if n is None:
            raise ValueError(f"{self!r} has no number of averages: give averages")
        variance, freedom = variance_from_coherence(self.coherence, n)
        known = np.full(self.shape, freedom)
        if pool:
            variance, known = pool_entries(self, variance, known)
        note = saturation_note(self.coherence)
        notes = (*self.notes, note) if note and note not in self.notes else self.notes
        return self._copy(averages=int(n), log_variance=variance, degrees_of_freedom=known, notes=notes)

    def to_xarray(self) -> xarray.Dataset:
        """Return an `xarray.Dataset` with the dimensions frequency_hz, response and excitation.

        The values are the variable `frf`; coherence, log_variance and so on are variables if they are known. Units,
        long names and all other fields are attributes.
        """
        return dataset(self)

    @classmethod
    def from_xarray(cls, data: xarray.Dataset) -> FRF:
        """Return the FRF of a data set of `to_xarray`, with all its fields."""
        return cls(**fields_from_xarray(data))

    def to_pandas(self) -> pandas.DataFrame:
        """Return the complex values as a `pandas.DataFrame` over frequency_hz, with columns (response, excitation)."""
        return frame(self)

    @classmethod
    def from_pandas(cls, table: pandas.DataFrame | pandas.Series[Any], **fields: Any) -> FRF:
        """Return the FRF of a table of complex values over frequency in Hz.

        Parameters
        ----------
        table : pandas.DataFrame or pandas.Series
            Columns are responses, or pairs (response, excitation), whose names become `labels`.
        **fields
            Other arguments of `FRF`, such as `form`.
        """
        return cls(**{**fields_from_pandas(table), **fields})

    def to_array(self, order: Order = "lines first") -> NDArray[np.complex128]:
        """Return a copy of the values in the order of another program.

        Parameters
        ----------
        order : {"lines first", "lines last"}, optional
            "lines first": lines, responses, excitations, as in pyFBS. "lines last": responses, excitations, lines, as
            in pyFRF and sdypy.
        """
        return ordered(self.values, order)

    @classmethod
    def from_array(cls, values: ArrayLike, frequency_hz: ArrayLike, order: Order = "lines first", **fields: Any) -> FRF:
        """Return the FRF of an array of another program.

        Parameters
        ----------
        values : array_like
            Complex, as of `to_array`. Of two axes one is that of the lines, the other that of the responses.
        frequency_hz : array_like
            `(n,)` lines in Hz.
        order
            As in `to_array`.
        **fields
            Other arguments of `FRF`, such as `form`.

        Examples
        --------
        >>> import numpy as np
        >>> from receptance import FRF
        >>> frf = FRF.from_array(np.ones((3, 2, 50)), np.arange(1.0, 51.0), "lines last", form="mobility")
        >>> frf.shape, frf.to_array("lines last").shape
        ((50, 3, 2), (3, 2, 50))
        """
        return cls(frequency_hz=frequency_hz, values=reordered(values, order), **fields)

    # An array of its values -------------------------------------------------------------------------------------------

    __array_priority__ = 1000.0
    """NumPy's numbers and arrays leave arithmetic to the FRF."""
    __iter__ = None
    """Not iterable: a position is a frequency."""

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        """Return the values, so that NumPy's functions take the FRF as an array."""
        del copy  # the values are read-only, so a copy is always made
        return np.array(self.values, dtype=dtype)

    def __getitem__(self, chosen: slice | tuple[Any, ...]) -> FRF:
        """Return the lines between two frequencies in Hz, both included, and responses and excitations.

        Examples
        --------
        >>> import numpy as np
        >>> from receptance import FRF
        >>> frf = FRF(frequency_hz=np.arange(1.0, 101.0), values=np.ones((100, 2, 1)), labels=(["a", "b"], ["hammer"]))
        >>> frf[20:40], frf[:50, "b"].shape
        (FRF(receptance in m/N, 2 x 1, 21 lines from 20 to 40 Hz), (50, 1, 1))
        """
        lines, *sides = chosen if isinstance(chosen, tuple) else (chosen,)
        if not isinstance(lines, slice) or lines.step is not None or len(sides) > 2:
            raise TypeError(
                f"{self!r}[{chosen!r}] is not understood, expected frequencies in Hz as in [500:2000], optionally with "
                'a response and an excitation as in [500:2000, "tip", 0]; values[...] takes numbers of lines'
            )
        every = [None if one == slice(None) else one for one in (*sides, None, None)]
        return self.select(low_hz=lines.start, high_hz=lines.stop, responses=every[0], excitations=every[1])

    def __abs__(self) -> NDArray[np.float64]:
        return np.abs(self.values)

    def __add__(self, other: Any) -> Any:
        """Return the sum with an FRF on the same lines, with its variance, or with numbers as an array."""
        return self._copy(**_sum_fields(self, other, 1.0)) if isinstance(other, FRF) else self.values + other

    def __sub__(self, other: Any) -> Any:
        """Return the difference from an FRF on the same lines, with its variance, or from numbers as an array."""
        return self._copy(**_sum_fields(self, other, -1.0)) if isinstance(other, FRF) else self.values - other

    def __mul__(self, other: Any) -> Any:
        """Return the FRF times a number, or the product of the values with an array."""
        return self._times(other) if _is_number(other) else self.values * np.asarray(other)

    def __truediv__(self, other: Any) -> Any:
        """Return the FRF over a number, or the quotient of the values and an array or another FRF."""
        if _is_number(other) and other != 0:
            return self._times(1.0 / other)
        return self.values / np.asarray(other)

    def _times(self, factor: complex) -> FRF:
        if factor == 0:
            raise ValueError(f"{self!r} times zero has no logarithm, expected a factor other than zero")
        return self._copy(values=self.values * factor)

    __radd__ = __add__
    __rmul__ = __mul__

    def __rsub__(self, other: Any) -> NDArray[np.complex128]:
        found: NDArray[np.complex128] = other - self.values
        return found

    def __rtruediv__(self, other: Any) -> NDArray[np.complex128]:
        found: NDArray[np.complex128] = other / self.values
        return found

    def __neg__(self) -> FRF:
        return self._copy(values=-self.values)

    @property
    def title(self) -> str:
        """Title of `summary`."""
        return f"FRF {self.label}".rstrip()

    def tables(self) -> list[Table]:
        """Return the table of `summary`: lines, form, coordinates, averages and quality."""
        lines = self.frequency_hz
        rows = [
            ("lines", f"{lines.size}, {lines[0]:g} to {lines[-1]:g} Hz{_spacing(lines)}"),
            ("form", f"{self.form} in {', '.join(self.distinct_units)}"),
        ]
        sides = {"responses": self.responses, "excitations": self.excitations}
        for (title, side), labels in zip(sides.items(), self.labels or ((), ()), strict=True):
            names = [
                coordinate.describe() + (f" ({labels[index]})" if labels and labels[index] else "")
                for index, coordinate in enumerate(side)
            ]
            rows.append((title, "; ".join(names)))
        if self.decay_rate:
            rows.append(("exponential window", f"decay rate {self.decay_rate:g} 1/s on force and response"))
        if self.averages is not None:
            rows.append(("averages", str(self.averages)))
        if self.coherence is not None:
            rows.append(("coherence", f"median {np.median(self.coherence):.4g}, lowest {self.coherence.min():.4g}"))
        if self.standard_deviation is not None:
            rows.append(("standard deviation", f"median {percent(np.median(self.standard_deviation), 3)}"))
        if self.usable is not None:
            rows.append(("usable", f"{np.count_nonzero(self.usable)} lines{band_text(lines[self.usable])}"))
        if self.source:
            rows.append(("source", self.source))
        return [Table("", ("property", "value"), rows)]

    def conjugated(self) -> FRF:
        """Return the complex conjugate, for files written for e^(-i w t), with a note."""
        return self._turned(self.values.conj(), "conjugated on request")

    def flipped(self) -> FRF:
        """Return the FRF with the opposite sign, for a sensor or hammer of reversed direction, with a note."""
        return self._turned(-self.values, "sign changed on request")

    def _turned(self, values: NDArray[np.complex128], note: str) -> FRF:
        turned = self._copy(values=values, notes=(*self.notes, note))
        turned._warn_of_contradictions(stacklevel=4)
        return turned

    def with_(self, **changes: Any) -> Self:
        """Return the FRF with some fields replaced, which are checked as on creation.

        Parameters
        ----------
        **changes
            New values of fields, by name.

        Examples
        --------
        >>> from receptance import FRF
        >>> FRF(frequency_hz=[10.0], values=[1e-6]).with_(label="nose").label
        'nose'
        """
        for name in changes:
            if name not in self.declared:
                raise TypeError(f"{self!r} has no field {name!r}; the fields are {', '.join(self.declared)}")
        if not changes.keys().isdisjoint(_ASSIGNED):
            changes = {name: getattr(self, name) for name in self.declared} | changes
        copy = self._copy()
        for name, field in self.declared.items():
            if name in changes:
                store(copy, name, field.check(copy, name, changes[name]))
        without_undefined_zero_line(copy, [name for name in PER_ENTRY if name in changes])
        if not _PHYSICAL.isdisjoint(changes):
            copy._warn_of_contradictions(stacklevel=3)
        return copy

    def _copy(self, **changes: Any) -> Self:
        """Return a copy with some fields replaced that need no check."""
        for name, value in changes.items():
            if isinstance(value, np.ndarray):
                changes[name] = np.ascontiguousarray(value)
                changes[name].setflags(write=False)
        copy = object.__new__(type(self))
        copy.__dict__.update({name: getattr(self, name) for name in self.declared} | changes)
        return copy

    def on_lines(self, chosen: NDArray[np.bool_] | slice) -> Self:
        """Return the FRF on some of its lines."""
        arrays = {name: getattr(self, name) for name in (*PER_LINE, *PER_ENTRY)}
        return self._copy(**{name: array[chosen] for name, array in arrays.items() if array is not None})

    def _of_entries(self, rows: list[int], columns: list[int]) -> Self:
        arrays = {name: getattr(self, name) for name in PER_ENTRY}
        changes: dict[str, Any] = {
            name: array[:, rows][:, :, columns] for name, array in arrays.items() if array is not None
        }
        if self.labels is not None:
            names = self.labels
            changes["labels"] = tuple(names[0][i] for i in rows), tuple(names[1][j] for j in columns)
        responses, excitations = [self.responses[i] for i in rows], [self.excitations[j] for j in columns]
        return self._copy(responses=tuple(responses), excitations=tuple(excitations), **changes)


def form_factor(frequency_hz: NDArray[np.inexact], old: Form, new: Form) -> NDArray[np.complex128]:
    """Return the factors `(n,)` from one form to another on real or complex lines, a power of i w.

    The power is computed by multiplication, so that converting there and back changes at most the last digit.
    """
    s = 2j * np.pi * frequency_hz.astype(np.complex128)
    power = FORMS.index(new) - FORMS.index(old)
    factor = np.ones_like(s)
    for _ in range(abs(power)):
        factor = factor * s
    return 1.0 / factor if power < 0 else factor


def _spacing(frequency_hz: NDArray[np.float64]) -> str:
    steps = np.diff(frequency_hz)
    if not steps.size:
        return ""
    even = bool(np.ptp(steps) <= 1e-6 * steps.max())
    return f", {steps.mean():.6g} Hz apart" if even else f", {steps.min():.6g} to {steps.max():.6g} Hz apart"


def _selected(
    owner: str, quantity: str, selection: Selection, side: tuple[Coordinate, ...], labels: tuple[str, ...] | None
) -> list[int]:
    """Return the numbers of the selected responses or excitations."""
    if selection is None:
        return list(range(len(side)))
    items = list(selection) if isinstance(selection, Iterable) and not isinstance(selection, str) else [selection]
    if not items:
        raise ValueError(f"{owner}: {quantity} is empty, expected at least one")
    return [_index(owner, quantity, item, side, labels) for item in items]


def _index(owner: str, quantity: str, item: Any, side: tuple[Coordinate, ...], labels: tuple[str, ...] | None) -> int:
    if isinstance(item, Coordinate):
        matching = [index for index, coordinate in enumerate(side) if coordinate == item]
    elif isinstance(item, str):
        matching = [index for index, label in enumerate(labels or ()) if label == item]
    else:
        try:
            index = item.__index__()
        except AttributeError:
            raise TypeError(f"{owner}: {quantity} holds {item!r}, expected a number, Coordinate or label") from None
        matching = [index % len(side)] if -len(side) <= index < len(side) else []
    if len(matching) == 1:
        return matching[0]
    listed = "; ".join(
        f"{index}: {coordinate.describe()}" + (f" ({labels[index]})" if labels and labels[index] else "")
        for index, coordinate in enumerate(side)
    )
    count = "several" if matching else "none"
    raise ValueError(f"{owner}: {count} of the {quantity} is {item!r}; they are {listed}")


def _is_number(value: Any) -> bool:
    """Return whether a value is one finite real or complex number."""
    if isinstance(value, (bool, np.bool_, str)) or not np.isscalar(value):
        return False
    return bool(np.isfinite(np.asarray(value)).all())


def _sum_fields(one: FRF, other: FRF, sign: float) -> dict[str, Any]:
    """Return the changed fields of the sum or the difference of two FRFs with independent errors.

    The degrees of freedom of the variance follow from those of both (Welch and Satterthwaite).

    Raises
    ------
    ValueError
        Other lines, another window, or other quantities.
    """
    other = other.to(one.form)
    for name, same in (
        ("lines", np.array_equal(one.frequency_hz, other.frequency_hz)),
        ("decay rates", one.decay_rate == other.decay_rate),
        ("units", one.units == other.units),
    ):
        if not same:
            remedy = "; resample one of them" if name == "lines" else ""
            raise ValueError(f"{one!r} and {other!r} have different {name}, expected the same{remedy}")
    values = one.values + sign * other.values
    changes: dict[str, Any] = {
        "values": values,
        "coherence": None,
        "averages": None,
        "log_variance": None,
        "degrees_of_freedom": None,
        "correlated_lines": np.maximum(one.correlated_lines, other.correlated_lines),
        "usable": _both(one.usable, other.usable),
        "notes": tuple(dict.fromkeys((*one.notes, *other.notes))),
    }
    if one.log_variance is None or other.log_variance is None:
        return changes
    parts = [np.abs(frf.values) ** 2 * frf.log_variance for frf in (one, other) if frf.log_variance is not None]
    total = parts[0] + parts[1]
    with np.errstate(divide="ignore", invalid="ignore"):
        changes["log_variance"] = np.where(values == 0.0, np.inf, total / np.abs(values) ** 2)
        weights = [
            part**2 / (np.inf if frf.degrees_of_freedom is None else frf.degrees_of_freedom)
            for part, frf in zip(parts, (one, other), strict=True)
        ]
        freedom = np.where(weights[0] + weights[1] > 0.0, total**2 / (weights[0] + weights[1]), np.inf)
    if one.degrees_of_freedom is not None or other.degrees_of_freedom is not None:
        changes["degrees_of_freedom"] = freedom
    return changes


def _both(one: NDArray[np.bool_] | None, other: NDArray[np.bool_] | None) -> NDArray[np.bool_] | None:
    if one is None or other is None:
        return other if one is None else one
    return one & other


def with_variance(frf: FRF) -> FRF:
    """Return an FRF with the pooled variance from its coherence.

    The FRF is returned unchanged if it has a variance, or lacks coherence or averages.
    """
    if frf.log_variance is not None or frf.coherence is None or frf.averages is None or frf.averages < 2:
        return frf
    return frf.with_coherence_variance()
