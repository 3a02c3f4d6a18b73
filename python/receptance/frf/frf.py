"""Frequency response functions: what was measured, with its form, places, quality and provenance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance import _checks
from receptance.coordinates import Coordinate
from receptance.frf import arrays
from receptance.frf.forms import FORMS, Form, check_form, conversion, unit_of
from receptance.frf.places import pick, places

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from receptance.frf.places import Pick, Side

__all__ = ["FRF"]

_PER_LINE = ("values", "coherence", "log_variance", "degrees_of_freedom", "correlated_lines", "usable")
_PER_ENTRY = ("values", "coherence", "log_variance", "degrees_of_freedom")


@dataclass(frozen=True, init=False, eq=False, repr=False)
class FRF:
    """A frequency response function between some excitations and responses.

    Parameters
    ----------
    frequency_hz : array_like
        `(n,)` ascending lines in Hz; the first may be at 0 Hz. Where the values of that line are not finite it is
        dropped, with a note.
    values : array_like
        `(n,)` or `(n, n_responses, n_excitations)` complex, in SI units of the form, for e^(+i w t).
    form : {"receptance", "mobility", "accelerance"}, optional
        Displacement, velocity or acceleration per load.
    responses, excitations : Coordinate or sequence, optional
        Where motion was seen and where loads acted; "y" or "theta" where only a direction is known. Direction
        "theta" of an excitation means per moment. By default y at an unknown place.
    decay_rate : float, optional
        sigma in 1/s of an exponential window exp(-sigma t) on force and response: the values then belong to the
        complex lines w - i sigma.
    coherence : array_like, optional
        From 0 to 1, shaped as `values` or `(n,)`.
    averages : int, optional
        How many were averaged.
    log_variance : array_like, optional
        Variance of the real and of the imaginary part, each, of the logarithm of the values; shaped as `values`,
        `(n,)` or one number. Infinite where nothing is known.
    degrees_of_freedom : array_like, optional
        Of that variance; infinite or None where it is known exactly.
    correlated_lines : array_like, optional
        How many neighbouring lines share one independent value (an exponential window and zero padding correlate
        them), one number or `(n,)`.
    usable : array_like of bool, optional
        `(n,)` lines inside the usable band.
    labels : pair of sequences of str, optional
        Names of the responses and of the excitations in the file.
    label : str, optional
        For people.
    source : str, optional
        File and reader, or how the FRF was made.
    notes : sequence of str, optional
        What was changed or is suspicious.

    Attributes
    ----------
    values, coherence, log_variance, degrees_of_freedom : ndarray
        `(n, n_responses, n_excitations)`, read-only; the last three None where not given.

    Raises
    ------
    TypeError, ValueError
        Shapes that do not fit, lines that are not ascending, values that are not finite, a coherence that is clearly
        above 1; the message names the field and the line.

    Warns
    -----
    ReceptanceWarning
        A drive point whose peaks fit another form, sign or time convention than the declared ones. Nothing is
        changed: declare another form, or use `conjugated` or `flipped`.

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

    def __init__(
        self,
        *,
        frequency_hz: ArrayLike,
        values: ArrayLike,
        form: Form = "receptance",
        responses: Side = None,
        excitations: Side = None,
        decay_rate: float = 0.0,
        coherence: ArrayLike | None = None,
        averages: int | None = None,
        log_variance: ArrayLike | None = None,
        degrees_of_freedom: ArrayLike | None = None,
        correlated_lines: ArrayLike = 1.0,
        usable: ArrayLike | None = None,
        labels: Sequence[Sequence[str]] | None = None,
        label: str = "",
        source: str = "",
        notes: Sequence[str] = (),
    ) -> None:
        owner = f"FRF {label!r}" if label else "FRF"
        lines = arrays.lines(owner, frequency_hz)
        response = arrays.response_values(owner, values, lines)
        shape = response.shape
        if isinstance(notes, str):
            raise TypeError(f"{owner}: notes is {notes!r}, expected a sequence of texts")
        quality, clipped = arrays.coherences(owner, coherence, lines, shape)
        found: dict[str, Any] = {
            "frequency_hz": lines,
            "values": response,
            "form": check_form(owner, form),
            "responses": places(owner, "responses", responses, shape[1]),
            "excitations": places(owner, "excitations", excitations, shape[2]),
            "decay_rate": _checks.not_negative(owner, "decay_rate", decay_rate, unit="1/s"),
            "coherence": quality,
            "averages": arrays.count(owner, "averages", averages),
            "log_variance": arrays.per_entry(owner, "log_variance", log_variance, shape, at_least=0.0),
            "degrees_of_freedom": arrays.per_entry(
                owner, "degrees_of_freedom", degrees_of_freedom, shape, at_least=0.0, above=True
            ),
            "correlated_lines": arrays.per_line(owner, "correlated_lines", correlated_lines, lines.size, at_least=1.0),
            "usable": arrays.mask(owner, usable, lines.size),
            "labels": arrays.text_pair(owner, labels, (shape[1], shape[2])),
            "label": str(label),
            "source": str(source),
            "notes": tuple(str(note) for note in notes) + ((clipped,) if clipped else ()),
        }
        _set(self, arrays.without_bad_zero_line(owner, found))

    @property
    def shape(self) -> tuple[int, int, int]:
        """Numbers of lines, responses and excitations."""
        n, n_out, n_in = self.values.shape
        return n, n_out, n_in

    @property
    def complex_frequency_hz(self) -> NDArray[Any]:
        """`(n,)` lines that the values belong to, f - i sigma / (2 pi) in Hz; real without an exponential window."""
        if self.decay_rate == 0.0:
            return self.frequency_hz
        return self.frequency_hz - 1j * self.decay_rate / (2.0 * np.pi)

    @property
    def standard_deviation(self) -> NDArray[np.float64] | None:
        """Standard deviation of the real and of the imaginary part, each, of the logarithm of the values."""
        return None if self.log_variance is None else np.sqrt(self.log_variance)

    @property
    def units(self) -> tuple[tuple[str, ...], ...]:
        """SI unit of each entry, responses first."""
        return tuple(tuple(unit_of(self.form, r, e) for e in self.excitations) for r in self.responses)

    @property
    def unit(self) -> str:
        """SI unit of all entries; raises ValueError where translations and rotations are mixed, see `units`."""
        found = sorted({unit for row in self.units for unit in row})
        if len(found) > 1:
            raise ValueError(f"{self!r} has several units: {', '.join(found)}; use units, or select one entry")
        return found[0]

    def to(self, form: Form) -> FRF:
        """Return the FRF in another form: multiplied by powers of i w, with the complex w of an exponential window.

        The variance of the logarithm, the coherence and the lines stay; a line at 0 Hz is dropped, with a note, where
        it would be divided by zero.

        Raises
        ------
        TypeError, ValueError
            Something else than a form, or no line but the one at 0 Hz.

        Examples
        --------
        >>> from receptance import FRF
        >>> mass = FRF(frequency_hz=[0.0, 10.0], values=[0.5, 0.5], form="accelerance")
        >>> mass.to("receptance").notes
        ('the line at 0 Hz is dropped: acceleration says nothing of displacement there',)
        """
        owner = repr(self)
        new = check_form(owner, form)
        if new == self.form:
            return self
        source = self
        motion = {"receptance": "displacement", "mobility": "velocity", "accelerance": "acceleration"}
        if FORMS.index(new) < FORMS.index(self.form) and self.complex_frequency_hz[0] == 0.0:
            if self.frequency_hz.size == 1:
                raise ValueError(f"{owner}: {self.form} at 0 Hz says nothing of {new}, and there is no other line")
            source = self._lines(slice(1, None))._noted(
                f"the line at 0 Hz is dropped: {motion[self.form]} says nothing of {motion[new]} there"
            )
        factor = conversion(source.complex_frequency_hz, self.form, new)
        return source._made(form=new, values=source.values * factor[:, None, None])

    def select(
        self,
        *,
        responses: Pick = None,
        excitations: Pick = None,
        low_hz: float | None = None,
        high_hz: float | None = None,
    ) -> FRF:
        """Return some of the responses and excitations, and the lines between two frequencies, both included.

        Parameters
        ----------
        responses, excitations : int, Coordinate, str or sequence, optional
            Which ones: by number from 0, by coordinate, or by label in the file; by default all.
        low_hz, high_hz : float, optional
            Ends of the band in Hz.

        Raises
        ------
        TypeError, ValueError
            Something that is not there, or is there several times, and a band without lines.
        """
        owner = repr(self)
        names = self.labels or (None, None)
        rows = pick(owner, "responses", responses, self.responses, names[0])
        columns = pick(owner, "excitations", excitations, self.excitations, names[1])
        low = -np.inf if low_hz is None else _checks.number(owner, "low_hz", low_hz, unit="Hz")
        high = np.inf if high_hz is None else _checks.number(owner, "high_hz", high_hz, unit="Hz")
        inside = (self.frequency_hz >= low) & (self.frequency_hz <= high)
        if not inside.any():
            raise ValueError(f"{owner}: there is no line from {low:g} to {high:g} Hz")
        entries = {name: getattr(self, name) for name in _PER_ENTRY}
        changes: dict[str, Any] = {
            name: array[:, rows][:, :, columns] for name, array in entries.items() if array is not None
        }
        if self.labels is not None:
            changes["labels"] = (tuple(names[0][i] for i in rows), tuple(names[1][i] for i in columns))  # type: ignore[index]
        changes["responses"] = tuple(self.responses[i] for i in rows)
        changes["excitations"] = tuple(self.excitations[i] for i in columns)
        return self._made(**changes)._lines(inside)

    def masked(self) -> FRF:
        """Return the usable lines alone; all where no band is stated.

        Raises
        ------
        ValueError
            No line is usable.
        """
        if self.usable is None or self.usable.all():
            return self
        if not self.usable.any():
            raise ValueError(f"{self!r}: no line is usable")
        return self._lines(self.usable)

    def conjugated(self) -> FRF:
        """Return the complex conjugate, for files written for e^(-i w t), with a note."""
        return self.with_(values=self.values.conj(), notes=(*self.notes, "conjugated on request"))

    def flipped(self) -> FRF:
        """Return the FRF with the other sign, for a sensor or hammer that faces the other way, with a note."""
        return self.with_(values=-self.values, notes=(*self.notes, "sign changed on request"))

    def with_coordinates(self, responses: Side = None, excitations: Side = None) -> FRF:
        """Return the FRF with other coordinates; None leaves a side as it is."""
        changes = {"responses": responses, "excitations": excitations}
        return self.with_(**{name: side for name, side in changes.items() if side is not None})

    def with_(self, **changes: Any) -> FRF:
        """Return the FRF with other fields, checked as on creation.

        Examples
        --------
        >>> from receptance import FRF
        >>> FRF(frequency_hz=[10.0], values=[1e-6]).with_(label="nose").label
        'nose'
        """
        names = [field.name for field in fields(self)]
        for name in changes:
            if name not in names:
                raise TypeError(f"{self!r} has no field {name!r}; the fields are {', '.join(names)}")
        return FRF(**{name: changes.get(name, getattr(self, name)) for name in names})

    def _made(self, **changes: Any) -> FRF:
        """Return a copy with some fields changed that need no check."""
        other = object.__new__(FRF)
        _set(other, {**{field.name: getattr(self, field.name) for field in fields(self)}, **changes})
        return other

    def _noted(self, note: str) -> FRF:
        return self._made(notes=(*self.notes, note))

    def _lines(self, chosen: NDArray[np.bool_] | slice) -> FRF:
        kept = {name: getattr(self, name) for name in ("frequency_hz", *_PER_LINE)}
        return self._made(**{name: array[chosen] for name, array in kept.items() if array is not None})

    def __setstate__(self, state: dict[str, Any]) -> None:
        _set(self, state)

    def __repr__(self) -> str:
        units = sorted({unit for row in self.units for unit in row})
        n, n_out, n_in = self.shape
        name = f"{self.label!r}: " if self.label else ""
        window = f", decay rate {self.decay_rate:g}/s" if self.decay_rate else ""
        return (
            f"FRF({name}{self.form} in {', '.join(units)}, {n_out} x {n_in}, {n} lines from {self.frequency_hz[0]:g} "
            f"to {self.frequency_hz[-1]:g} Hz{window})"
        )


def _set(target: FRF, values: dict[str, Any]) -> None:
    """Fill a frozen dataclass; its arrays are its own, contiguous, and stay as they are."""
    for name, value in values.items():
        if isinstance(value, np.ndarray) and value.flags.writeable:
            value = np.array(value, order="C")
            value.setflags(write=False)
        object.__setattr__(target, name, value)
