"""What a recorder wrote during a hammer test: force and response against time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from receptance import _checks
from receptance.coordinates import Coordinate
from receptance.frf.places import places
from receptance.units import channel_factor

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from receptance.frf.places import Side
    from receptance.io.time_series import TimeSeries

__all__ = ["Quantity", "TimeRecords"]

Quantity = Literal["displacement", "velocity", "acceleration"]
"""What the response channels hold."""
_ROTATIONS = {"displacement": "rotation", "velocity": "angular velocity", "acceleration": "angular acceleration"}
_SMALLEST = 1e-30
"""What squares and quotients of two channels can still be taken of."""
_LEAST_SAMPLES = 16
"""Shorter than any pulse with something after it."""


@dataclass(frozen=True, init=False, eq=False, repr=False)
class TimeRecords:
    """Force and response against time: one record with several hits, or one record for each hit.

    Parameters
    ----------
    force : array_like
        `(n,)`, or `(n_records, n)` for several records of one length.
    response : array_like
        `(n,)` or `(n, n_channels)`; with several records `(n_records, n)` or `(n_records, n, n_channels)`. Sampled
        with the force by one clock.
    sample_rate_hz : float
        Samples per second.
    quantity : {"acceleration", "velocity", "displacement"}
        What the response is; never guessed.
    force_unit, response_unit : str, optional
        Units of the numbers given, SI by default: any text that pint reads as such a quantity, so that
        "V/(2.25 mV/N)" takes volts from a sensor of 2.25 mV/N. Inside all is SI.
    full_scale_force, full_scale_response : float, optional
        Largest value that the recorder can hold, in the units given; one number, or one for each channel. Where it
        is not known, only a flat top tells an overload.
    excitation : Coordinate or {"y", "theta"}, optional
        Where and in which direction the hammer hit, or the direction alone; by default y at an unknown place.
    responses : Coordinate, {"y", "theta"} or sequence, optional
        The same of each channel.
    response_decay_rate : float, optional
        Decay rate in 1/s of an exponential window that the recorder has already put on the response and not on the
        force, with its origin at the first sample. `estimate_frf` puts it on the force as well.
    label, source : str, optional
        For people: a name, and where the data come from.
    notes : sequence of str, optional
        What is known about the data.

    Attributes
    ----------
    force : ndarray
        `(n_records, n)` in N, or N m where the excitation is a moment.
    response : ndarray
        `(n_records, n, n_channels)` in m/s^2, m/s or m, or the same of an angle.

    Raises
    ------
    TypeError, ValueError
        Arrays whose shapes do not match or that hold something else than finite numbers (the message says where),
        an unknown unit, or coordinates of another number than channels.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance.measurement import TimeRecords
    >>> time = np.arange(4096) / 25600.0
    >>> force = np.where(time < 4e-4, 120.0 * np.sin(np.pi * time / 4e-4), 0.0)
    >>> response = 9.0 * np.exp(-40.0 * time) * np.sin(2 * np.pi * 800.0 * time)
    >>> TimeRecords(
    ...     force=force, response=response, sample_rate_hz=25600.0, quantity="acceleration", response_unit="g",
    ...     label="tip",
    ... )
    TimeRecords('tip', 1 record of 0.16 s at 25600 Hz, acceleration, 1 channel)
    """

    force: NDArray[np.float64]
    response: NDArray[np.float64]
    sample_rate_hz: float
    quantity: Quantity
    full_scale_force: float | None
    full_scale_response: NDArray[np.float64] | None
    excitation: Coordinate
    responses: tuple[Coordinate, ...]
    response_decay_rate: float
    label: str
    source: str
    notes: tuple[str, ...]

    def __init__(
        self,
        *,
        force: ArrayLike,
        response: ArrayLike,
        sample_rate_hz: float,
        quantity: Quantity,
        force_unit: str | None = None,
        response_unit: str | None = None,
        full_scale_force: float | None = None,
        full_scale_response: ArrayLike | None = None,
        excitation: Coordinate | str | None = None,
        responses: Side = None,
        response_decay_rate: float = 0.0,
        label: str = "",
        source: str = "",
        notes: Sequence[str] = (),
    ) -> None:
        owner = f"TimeRecords {label!r}" if label else "TimeRecords"
        if quantity not in get_args(Quantity):
            raise ValueError(f"{owner}: quantity is {quantity!r}, expected one of {', '.join(get_args(Quantity))}")
        hammer, motion = _matched(owner, _samples(owner, "force", force), _samples(owner, "response", response))
        hit = places(owner, "excitations", excitation, 1)
        where = places(owner, "responses", responses, motion.shape[2])
        f_factor, x_factors = _factors(owner, quantity, force_unit, response_unit, hit[0], where)
        limit = None
        if full_scale_force is not None:
            limit = abs(f_factor) * _checks.positive(owner, "full_scale_force", full_scale_force)
        limits = None
        if full_scale_response is not None:
            limits = np.abs(x_factors) * _full_scales(owner, full_scale_response, motion.shape[2])
        self._set(
            force=hammer * f_factor,
            response=motion * x_factors,
            sample_rate_hz=_checks.positive(owner, "sample_rate_hz", sample_rate_hz, unit="Hz"),
            quantity=quantity,
            full_scale_force=limit,
            full_scale_response=limits,
            excitation=hit[0],
            responses=where,
            response_decay_rate=_checks.not_negative(owner, "response_decay_rate", response_decay_rate, unit="1/s"),
            label=str(label),
            source=str(source),
            notes=(notes,) if isinstance(notes, str) else tuple(str(note) for note in notes),
        )

    def _set(self, **fields: Any) -> None:
        for name, value in fields.items():
            if isinstance(value, np.ndarray):
                value = np.ascontiguousarray(value, dtype=np.float64)
                value.setflags(write=False)
            object.__setattr__(self, name, value)

    @classmethod
    def from_series(
        cls,
        series: TimeSeries,
        *,
        force: str | int,
        responses: str | int | Sequence[str | int],
        excitation: Coordinate | str | None = None,
        at: Side = None,
        **options: Any,
    ) -> TimeRecords:
        """Take the channels of a file that `receptance.io.read` has read.

        Parameters
        ----------
        series : receptance.io.TimeSeries
            Channels in SI units with their quantities.
        force : str or int
            Name or number of the hammer's channel.
        responses : str, int or sequence of them
            Names or numbers of the response channels, all of one quantity.
        excitation, at : Coordinate, {"y", "theta"} or sequence, optional
            Where the hammer hit, and where each response channel measured; an angle is taken for "theta".
        **options
            Further parameters of `TimeRecords`; full scales are in SI units then.

        Raises
        ------
        ValueError
            A channel that is not there, or is not of the quantity it is taken for.

        Examples
        --------
        >>> import numpy as np
        >>> from receptance.io import TimeSeries
        >>> from receptance.measurement import TimeRecords
        >>> read = TimeSeries(
        ...     values=np.ones((64, 2)), channels=["hammer", "tip"], units=["N", "g"], sample_rate_hz=51200.0
        ... )
        >>> TimeRecords.from_series(read, force="hammer", responses="tip").quantity
        'acceleration'
        """
        owner = f"TimeRecords from {series.source or series.label or 'a time series'}"
        wanted = [responses] if isinstance(responses, (str, int)) else list(responses)
        rows = [_column(owner, series, name) for name in [force, *wanted]]
        if series.quantities[rows[0]] not in ("force", "moment"):
            raise ValueError(
                f"{owner}: channel {series.channels[rows[0]]!r} holds "
                f"{series.quantities[rows[0]] or 'an unknown quantity'}, expected the force of the hammer"
            )
        plain = {turned: name for name, turned in _ROTATIONS.items()} | {name: name for name in _ROTATIONS}
        kinds = {plain.get(series.quantities[row], "unknown") for row in rows[1:]}
        if len(kinds) != 1 or "unknown" in kinds:
            found = ", ".join(f"{series.channels[row]!r}: {series.quantities[row] or 'unknown'}" for row in rows[1:])
            raise ValueError(
                f"{owner}: the responses are {found}; expected displacement, velocity or acceleration, the same for "
                "all (what a file does not say is given to receptance.io.read)"
            )
        turning = [series.quantities[row] in _ROTATIONS.values() for row in rows[1:]]
        where = places(owner, "at", ["theta" if turn else "y" for turn in turning] if at is None else at, len(turning))
        for row, turn, place in zip(rows[1:], turning, where, strict=True):
            if turn != (place.direction == "theta"):
                raise ValueError(f"{owner}: channel {series.channels[row]!r} is {series.quantities[row]}, at {place!r}")
        return cls(
            force=series.values[:, rows[0]],
            response=series.values[:, rows[1:]],
            sample_rate_hz=series.sample_rate_hz,
            excitation=excitation,
            responses=where,
            **{
                "quantity": kinds.pop(),
                "label": series.label,
                "source": series.source,
                "notes": series.notes,
                **options,
            },
        )

    @property
    def n_records(self) -> int:
        """Number of records."""
        return int(self.force.shape[0])

    @property
    def n_channels(self) -> int:
        """Number of response channels."""
        return int(self.response.shape[2])

    @property
    def duration_s(self) -> float:
        """Length of one record."""
        return float(self.force.shape[1]) / self.sample_rate_hz

    @property
    def time_s(self) -> NDArray[np.float64]:
        """`(n,)` time of the samples from the first one on."""
        return np.arange(self.force.shape[1]) / self.sample_rate_hz

    def channel(self, index: int) -> TimeRecords:
        """Return the records with one response channel alone."""
        if not 0 <= index < self.n_channels:
            raise ValueError(f"{self!r}: there is no channel {index}, expected 0 to {self.n_channels - 1}")
        scale = None if self.full_scale_response is None else self.full_scale_response[[index]]
        return _changed(
            self, response=self.response[:, :, [index]], full_scale_response=scale, responses=(self.responses[index],)
        )

    def __repr__(self) -> str:
        count = f"{self.n_records} record{'s' if self.n_records > 1 else ''} of {self.duration_s:g} s"
        channels = f"{self.n_channels} channel{'s' if self.n_channels > 1 else ''}"
        return f"TimeRecords({self.label!r}, {count} at {self.sample_rate_hz:g} Hz, {self.quantity}, {channels})"


def _changed(records: TimeRecords, **fields: Any) -> TimeRecords:
    """Return records with some attributes changed, which are in SI units."""
    other = object.__new__(TimeRecords)
    other._set(**{name: getattr(records, name) for name in TimeRecords.__dataclass_fields__} | fields)
    return other


def _samples(owner: str, name: str, value: ArrayLike) -> NDArray[np.float64]:
    try:
        array = _checks.unmasked(owner, name, value)
    except _checks.MaskedError:
        raise
    except ValueError:
        raise ValueError(f"{owner}: {name} has rows of different lengths; give such records one by one") from None
    if array.dtype.kind not in "iuf":
        raise TypeError(f"{owner}: {name} has dtype {array.dtype}, expected real numbers")
    array = array.astype(np.float64)
    bad = np.argwhere(~np.isfinite(array))
    if bad.size:
        where = ", ".join(str(index) for index in bad[0])
        raise ValueError(f"{owner}: {name}[{where}] is {array[tuple(bad[0])]}, expected a finite number")
    largest = float(np.abs(array).max(initial=0.0))
    if largest != 0.0 and not _SMALLEST < largest < 1.0 / _SMALLEST:
        raise ValueError(f"{owner}: the largest value of {name} is {largest:g}, which no sensor gives in any unit")
    return array


def _matched(
    owner: str, force: NDArray[np.float64], response: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return force `(n_records, n)` and response `(n_records, n, n_channels)`."""
    if force.ndim not in (1, 2):
        raise ValueError(f"{owner}: force has shape {force.shape}, expected (n,) or (n_records, n)")
    expected = " or ".join(str((*force.shape, *more)) for more in ((), ("n_channels",)))
    if response.shape[: force.ndim] != force.shape or response.ndim > force.ndim + 1:
        raise ValueError(
            f"{owner}: response has shape {response.shape} for a force of {force.shape}, expected {expected}"
        )
    if force.shape[-1] < _LEAST_SAMPLES or 0 in response.shape:
        raise ValueError(
            f"{owner}: force has shape {force.shape} and response {response.shape}, "
            f"expected at least {_LEAST_SAMPLES} samples, one record and one channel"
        )
    records = np.atleast_2d(force)
    return records, response.reshape(*records.shape, -1)


def _factors(
    owner: str,
    quantity: Quantity,
    force_unit: str | None,
    response_unit: str | None,
    excitation: Coordinate,
    responses: tuple[Coordinate, ...],
) -> tuple[float, NDArray[np.float64]]:
    load = "force" if excitation.direction == "y" else "moment"
    force = 1.0 if force_unit is None else channel_factor(owner, "force_unit", load, force_unit)
    kinds = [quantity if place.direction == "y" else _ROTATIONS[quantity] for place in responses]
    if response_unit is None:
        return force, np.ones(len(kinds))
    factors = [channel_factor(owner, "response_unit", kind, response_unit) for kind in kinds]
    return force, np.array(factors)


def _full_scales(owner: str, value: ArrayLike, count: int) -> NDArray[np.float64]:
    given = _checks.unmasked(owner, "full_scale_response", value)
    if given.shape not in ((), (count,)):
        raise ValueError(f"{owner}: full_scale_response has shape {given.shape}, expected one number or {(count,)}")
    name = "full_scale_response"
    return np.array([_checks.positive(owner, name, one) for one in np.broadcast_to(given, (count,)).tolist()])


def _column(owner: str, series: TimeSeries, name: str | int) -> int:
    if isinstance(name, str):
        if name in series.channels:
            return tuple(series.channels).index(name)
    elif 0 <= name < len(series.channels):
        return name
    listed = ", ".join(repr(channel) for channel in series.channels)
    raise ValueError(f"{owner}: there is no channel {name!r}; the channels are {listed}")
