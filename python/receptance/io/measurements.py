"""Coherences and time series as read from files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from receptance import _checks
from receptance.errors import warn_user
from receptance.frf import FRF, fields
from receptance.frf.fields import Labelled, LineError, MeasuredField, store
from receptance.report import Column, Renderable, Table
from receptance.units import channel_kind, parse_unit

_LOW_COHERENCE = 0.5
"""Below, more of the response is unexplained than explained."""


def _coherences(coherence: Any, name: str, value: ArrayLike) -> NDArray[np.float64]:
    """Return a coherence `(n, n_responses, n_excitations)`."""
    owner, lines = coherence.owner, coherence.frequency_hz
    array = _checks.numbers(owner, name, value, "iuf", "real numbers").astype(np.float64)
    if array.ndim == 1:
        array = array[:, None, None]
    if array.ndim != 3 or array.shape[0] != lines.size or 0 in array.shape:
        raise ValueError(
            f"{owner}: values has shape {array.shape} for {lines.size} lines, expected ({lines.size},) or "
            f"({lines.size}, responses, excitations)"
        )
    undefined = np.flatnonzero(np.isnan(array).any(axis=(1, 2)))
    if undefined.size:
        raise LineError(f"{owner}: the coherence at {lines[undefined[0]]:g} Hz is nan, expected 0 to 1", undefined[0])
    return fields.coherence(coherence, array)


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Coherence(Labelled, Renderable):
    """Ordinary coherence between excitations and responses, without its FRF.

    Parameters
    ----------
    {fields}

    Raises
    ------
    TypeError, ValueError
        Mismatched arrays, lines that are not ascending, or a coherence outside 0 to 1.

    Examples
    --------
    >>> from receptance.io import Coherence
    >>> Coherence(frequency_hz=[1.0, 2.0, 3.0], values=[0.4, 0.98, 0.99])
    Coherence(3 lines from 1 to 3 Hz, median 0.98)
    """

    plotted_by = "receptance.io.figure:draw_coherence"
    drawn_in_notebooks = True

    frequency_hz: MeasuredField[ArrayLike, NDArray[np.float64]] = MeasuredField(
        fields.lines, "array_like", "`(n,)` lines in Hz.", axes="lines"
    )
    values: MeasuredField[ArrayLike, NDArray[np.float64]] = MeasuredField(
        _coherences, "array_like", "`(n,)` or `(n, n_responses, n_excitations)`, from 0 to 1.", axes="entries"
    )
    labels: MeasuredField[Sequence[Sequence[str]] | None, fields.Labels | None] = MeasuredField(
        fields.labels,
        "pair of sequences of str",
        "Names of the responses and of the excitations.",
        default=None,
    )

    @property
    def title(self) -> str:
        """Title of `summary`."""
        return f"Coherence {self.label}".rstrip()

    def tables(self) -> list[Table]:
        """Return the table of `summary`: lines, entries, coherence and source."""
        lines, values = self.frequency_hz, self.values
        rows = [
            ("lines", f"{lines.size}, {lines[0]:g} to {lines[-1]:g} Hz"),
            ("entries", f"{values.shape[1]} responses x {values.shape[2]} excitations"),
            ("coherence", f"median {np.median(values):.4g}, lowest {values.min():.4g}"),
            *([("source", self.source)] if self.source else []),
        ]
        return [Table("", ("property", "value"), rows)]

    def __len__(self) -> int:
        return int(self.frequency_hz.size)

    def __repr__(self) -> str:
        title = f"{self.label!r}, " if self.label else ""
        low, high = self.frequency_hz[[0, -1]]
        return f"Coherence({title}{len(self)} lines from {low:g} to {high:g} Hz, median {np.median(self.values):.2g})"


def _names(series: Any, name: str, value: Sequence[str]) -> tuple[str, ...]:
    """Return the names of channels."""
    names = fields.texts(series, name, value)
    if len(set(names)) != len(names):
        raise ValueError(f"{series.owner}: channels are {names}, expected different names")
    return names


def _units(series: Any, name: str, value: Sequence[str]) -> tuple[str, ...]:
    """Return the units of channels."""
    units = fields.texts(series, name, value)
    if len(units) != len(series.channels):
        raise ValueError(f"{series.owner}: there are {len(units)} units for {len(series.channels)} channels")
    return units


def _samples(series: Any, name: str, value: ArrayLike) -> NDArray[np.float64]:
    """Return samples `(n_samples, n_channels)`."""
    owner, names = series.owner, series.channels
    array = _checks.numbers(owner, name, value, "iuf", "real numbers").astype(np.float64)
    if array.ndim == 1:
        array = array[:, None]
    if array.ndim != 2 or 0 in array.shape or array.shape[1] != len(names):
        raise ValueError(
            f"{owner}: values has shape {array.shape}, expected (n_samples, {len(names)}) for the channels {names}"
        )
    bad = np.argwhere(~np.isfinite(array))
    if bad.size:
        row, column = bad[0]
        problem = f"{owner}: sample {row} of {names[column]!r} is {array[row, column]}, expected a finite number"
        raise LineError(problem, row)
    return array


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class TimeSeries(Labelled, Renderable):
    """Time series of one or several channels with a common sample rate.

    Parameters
    ----------
    {fields}

    Raises
    ------
    TypeError, ValueError
        Values that are not finite or not real, or names and units that do not match them.

    Examples
    --------
    >>> from receptance.io import TimeSeries
    >>> hit = TimeSeries(
    ...     values=[[0.0, 0.0], [120.0, 0.5], [4.0, -0.25]],
    ...     channels=["hammer", "tip"],
    ...     units=["N", "g"],
    ...     sample_rate_hz=51200.0,
    ... )
    >>> hit
    TimeSeries(hammer [N], tip [m/s^2]: 3 samples at 51200 Hz)
    >>> hit.channel("tip")
    array([ 0.        ,  4.903325 , -2.4516625])
    """

    plotted_by = "receptance.io.figure:draw_time_series"
    drawn_in_notebooks = True

    channels: MeasuredField[Sequence[str], tuple[str, ...]] = MeasuredField(
        _names, "sequence of str", "Names, all different."
    )
    units: MeasuredField[Sequence[str], tuple[str, ...]] = MeasuredField(
        _units,
        "sequence of str",
        'One per channel, such as "N", "g", "mm/s", "V". Forces, moments and motions are converted to SI; other '
        "quantities are kept in their unit.",
    )
    values: MeasuredField[ArrayLike, NDArray[np.float64]] = MeasuredField(
        _samples,
        "array_like",
        "`(n_samples,)` or `(n_samples, n_channels)` real and finite, in the given units.",
        axes="samples",
    )
    sample_rate_hz: MeasuredField[float, float] = MeasuredField(
        lambda series, name, value: _checks.positive(series.owner, name, value, unit="Hz"),
        "float",
        "Samples per second.",
    )
    start_s: MeasuredField[float, float] = MeasuredField(
        lambda series, name, value: _checks.number(series.owner, name, value, unit="s"),
        "float",
        "Time of the first sample.",
        default=0.0,
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        _, units, factors = zip(*map(_si_unit, self.units), strict=True)
        with np.errstate(over="ignore"):
            values = self.values * np.array(factors)
        if not np.all(np.isfinite(values)):
            raise ValueError(f"{self.owner}: values overflow in SI units")
        store(self, "values", values)
        store(self, "units", units)

    @property
    def quantities(self) -> tuple[str, ...]:
        """Quantity per channel: "force", "moment", "displacement" to "angular acceleration", or "" for others."""
        return tuple(_si_unit(unit)[0] for unit in self.units)

    @property
    def time_s(self) -> NDArray[np.float64]:
        """`(n_samples,)` times in s."""
        return self.start_s + np.arange(self.values.shape[0]) / self.sample_rate_hz

    @property
    def duration_s(self) -> float:
        """Number of samples over the sample rate."""
        return len(self) / self.sample_rate_hz

    @property
    def title(self) -> str:
        """Title of `summary`."""
        return f"Time records {self.label}".rstrip()

    def tables(self) -> list[Table]:
        """Return the tables of `summary`: sampling, and the channels with their units and largest values."""
        rows = [
            ("samples", f"{len(self)} at {self.sample_rate_hz:.6g} Hz, {self.duration_s:.4g} s"),
            ("start", f"{self.start_s:g} s"),
            *([("source", self.source)] if self.source else []),
        ]
        largest = np.max(np.abs(self.values), axis=0).tolist()
        quantities = [quantity or "other" for quantity in self.quantities]
        channels = list(zip(self.channels, quantities, largest, self.units, strict=True))
        return [
            Table("", ("property", "value"), rows),
            Table("Channels", ("channel", "quantity", Column("largest magnitude", form=".4g"), "unit"), channels),
        ]

    def __len__(self) -> int:
        return int(self.values.shape[0])

    def channel(self, channel: str | int) -> NDArray[np.float64]:
        """Return the `(n_samples,)` values of a channel, by name or by number from 0."""
        return self.values[:, self.index(channel)]

    def index(self, channel: str | int) -> int:
        """Return the number of a channel, given by its name or number.

        Raises
        ------
        ValueError
            An unknown channel.
        """
        if channel in self.channels:
            return self.channels.index(str(channel))
        if isinstance(channel, str) or not 0 <= channel < len(self.channels):
            listed = ", ".join(map(repr, self.channels))
            raise ValueError(f"there is no channel {channel!r}; the channels are {listed}")
        return channel

    def __repr__(self) -> str:
        listed = [f"{name} [{unit}]" for name, unit in zip(self.channels, self.units, strict=True)]
        shown = ", ".join(listed if len(listed) <= 6 else [*listed[:5], f"and {len(listed) - 5} more"])
        title = f"{self.label!r}, " if self.label else ""
        return f"TimeSeries({title}{shown}: {len(self)} samples at {self.sample_rate_hz:.6g} Hz)"


Measurement: TypeAlias = FRF | TimeSeries | Coherence
"""Contents of a file."""


def low_coherence_notes(coherence: NDArray[np.float64]) -> list[str]:
    """Warn of a coherence with a median below one half, and return the note; an empty list for others."""
    median = float(np.nanmedian(coherence))
    if median >= _LOW_COHERENCE:
        return []
    below = float(np.mean(coherence < _LOW_COHERENCE))
    note = (
        f"the median coherence is {median:.2f} over {coherence.shape[0]} lines, and below {_LOW_COHERENCE} on "
        f"{below:.0%} of them: on half of the lines the force explains less than {median:.0%} of the response; the "
        "rest is noise, a second source, leakage or a structure that changes between hits. Such an FRF does not "
        "determine a joint: measure again (another hammer tip, more averages, sensor range, cables), or use only lines "
        "of high coherence"
    )
    warn_user(note)
    return [note]


def _si_unit(text: str) -> tuple[str, str, float]:
    """Return quantity, SI unit and factor; units of other quantities than motions and loads are kept."""
    try:
        unit = parse_unit(text)
    except ValueError:
        return "", text, 1.0
    kind = channel_kind(unit)
    return ("", text, 1.0) if kind is None else (kind[0], kind[1], unit.factor)
