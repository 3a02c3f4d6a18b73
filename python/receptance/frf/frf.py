"""Frequency response functions: what was measured, with its form, places, quality and provenance."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance import _checks
from receptance.errors import ReceptanceWarning
from receptance.frf import arrays
from receptance.frf.creation import checked
from receptance.frf.forms import converted, unit_of
from receptance.frf.places import picked
from receptance.frf.record import Record, set_fields
from receptance.frf.resampling import resampled
from receptance.frf.showing import as_dataset, describing_table
from receptance.frf.variance import half_width_of, pool_entries, variance_from_coherence
from receptance.units import Form

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike, NDArray

    from receptance.frf.places import Pick, Side

__all__ = ["FRF"]


@dataclass(frozen=True, init=False, eq=False, repr=False)
class FRF(Record):
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
        given = {name: value for name, value in locals().items() if name != "self"}
        set_fields(self, checked(**given))
        self._look_at_drive_points()

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
        changes, kept = converted(self, form)
        return self._lines(kept)._made(**changes)

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
        low = -np.inf if low_hz is None else _checks.number(repr(self), "low_hz", low_hz, unit="Hz")
        high = np.inf if high_hz is None else _checks.number(repr(self), "high_hz", high_hz, unit="Hz")
        inside = (self.frequency_hz >= low) & (self.frequency_hz <= high)
        if not inside.any():
            raise ValueError(f"{self!r}: there is no line from {low:g} to {high:g} Hz")
        return self._lines(inside)._entries(*picked(self, responses, excitations))

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

    def resample(self, frequency_hz: ArrayLike) -> FRF:
        """Return the FRF on other lines, which may not stand closer than the measured ones.

        Lines that were measured keep their values exactly; others lie on a cubic spline. Variances and coherence lie on
        straight lines between neighbours: a mean of two lines knows no more than one.

        Parameters
        ----------
        frequency_hz : array_like
            `(m,)` ascending lines in Hz, inside those measured.

        Raises
        ------
        TypeError, ValueError
            Lines outside the measured ones, or closer together than these: that would invent resolution.

        Warns
        -----
        ReceptanceWarning
            A peak too sharp for its lines: under four in the half-power band, 1 % and more are lost between them.

        Examples
        --------
        >>> from receptance import FRF
        >>> frf = FRF(frequency_hz=[10.0, 20.0, 30.0, 40.0], values=[4.0, 3.0, 2.0, 1.0])
        >>> frf.resample([15.0, 30.0]).values.ravel().real
        array([3.5, 2. ])
        """
        changes, sharp = resampled(self, arrays.lines(repr(self), frequency_hz))
        if sharp:
            warnings.warn(f"{self!r}: {sharp}", ReceptanceWarning, stacklevel=2)
        return self._made(**changes)

    def log_interval(self, level: float = 0.95) -> NDArray[np.float64]:
        """Half-width `(n, n_responses, n_excitations)` of the interval for the real and the imaginary part of the log.

        Student's t with the degrees of freedom of the variance, the normal distribution where there are none.

        Raises
        ------
        ValueError
            No variance, or a level that is not between 0 and 1.

        Examples
        --------
        >>> from receptance import FRF
        >>> frf = FRF(frequency_hz=[10.0], values=[1e-6], log_variance=1e-4, degrees_of_freedom=4)
        >>> frf.log_interval().round(4).item()
        0.0278
        """
        if self.log_variance is None:
            raise ValueError(f"{self!r} has no variance; with coherence and averages: with_coherence_variance()")
        return half_width_of(self.log_variance, self.degrees_of_freedom, level)

    def with_coherence_variance(
        self, *, averages: int | None = None, pool: bool = True, half_width: int | None = None
    ) -> FRF:
        """Return the FRF with the variance that follows from its coherence and its number of averages.

        Parameters
        ----------
        averages : int, optional
            Where the FRF does not know it.
        pool : bool, optional
            Whether neighbouring lines are pooled, see `receptance.frf.variance`.
        half_width : int, optional
            Lines to each side that are pooled; by default as many as are needed.

        Raises
        ------
        TypeError, ValueError
            No coherence, or fewer than two averages.
        """
        n = self.averages if averages is None else averages
        if self.coherence is None:
            raise ValueError(f"{self!r} has no coherence, so its variance is not known")
        if n is None:
            raise ValueError(f"{self!r} does not know how many were averaged: give averages")
        variance, freedom = variance_from_coherence(self.coherence, n)
        known = np.full(self.shape, freedom)
        if pool:
            variance, known = pool_entries(self, variance, known, half_width)
        return self._made(averages=int(n), log_variance=variance, degrees_of_freedom=known)

    def to_xarray(self) -> xarray.Dataset:
        """Return an `xarray.Dataset` over frequency_hz, response and excitation; needs xarray.

        The values are the variable `frf`; coherence, log_variance and so on where they are known. Units, long names and
        everything else are attributes.
        """
        return as_dataset(self)

    def plot(self, ax: Axes | None = None) -> Figure:
        """Return a figure of magnitude, phase and, where known, coherence; see `receptance.frf.figure.draw_frf`."""
        from receptance.frf.figure import draw_frf

        return draw_frf(self, ax)

    def conjugated(self) -> FRF:
        """Return the complex conjugate, for files written for e^(-i w t), with a note."""
        return self._replaced({"values": self.values.conj(), "notes": (*self.notes, "conjugated on request")}, 4)

    def flipped(self) -> FRF:
        """Return the FRF with the other sign, for a sensor or hammer that faces the other way, with a note."""
        return self._replaced({"values": -self.values, "notes": (*self.notes, "sign changed on request")}, 4)

    def with_coordinates(self, responses: Side = None, excitations: Side = None) -> FRF:
        """Return the FRF with other coordinates; None leaves a side as it is."""
        sides = {"responses": responses, "excitations": excitations}
        return self._replaced({name: side for name, side in sides.items() if side is not None}, 4)

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
        return self._replaced(changes, 4)

    def _repr_html_(self) -> str:
        from receptance.report.html import table_html

        return table_html(describing_table(self))

    def __repr__(self) -> str:
        units = sorted({unit for row in self.units for unit in row})
        n, n_out, n_in = self.shape
        name = f"{self.label!r}: " if self.label else ""
        window = f", decay rate {self.decay_rate:g}/s" if self.decay_rate else ""
        return (
            f"FRF({name}{self.form} in {', '.join(units)}, {n_out} x {n_in}, {n} lines from {self.frequency_hz[0]:g} "
            f"to {self.frequency_hz[-1]:g} Hz{window})"
        )
