"""Records of a hammer test: force and response against time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from receptance import _checks
from receptance.io.measurements import TimeSeries
from receptance.model.coordinates import Coordinate, Side, measured_coordinates
from receptance.units import ROTATIONS, channel_factor

Quantity = Literal["displacement", "velocity", "acceleration"]
"""Quantity of the response channels."""
_SMALLEST = 1e-30
"""Least and (inverse) largest magnitude of a channel, so that squares and quotients of two channels are finite."""
_LEAST_SAMPLES = 16
"""Least number of samples of a record."""


@dataclass(frozen=True, init=False, eq=False, repr=False)
class HammerRecords:
    """Force and response of a hammer test: one record with several hits, or one record for each hit.

    Parameters
    ----------
    force : array_like
        `(n,)`, or `(n_records, n)` for several records of one length.
    response : array_like
        `(n,)` or `(n, n_channels)`; with several records `(n_records, n)` or `(n_records, n, n_channels)`. Sampled
        synchronously with the force.
    sample_rate_hz : float
        Samples per second.
    quantity : {"acceleration", "velocity", "displacement"}
        Quantity of the response.
    force_unit, response_unit : str, optional
        Units of the given numbers, SI by default: any unit of such a quantity. "V/(2.25 mV/N)", for example, converts
        volts of a sensor with 2.25 mV/N. The attributes are in SI.
    full_scale_force, full_scale_response : float, optional
        Full scale of the recorder in the given units; one number, or one for each channel. If it is unknown, overloads
        are detected by flat tops only.
    excitation : Coordinate or {"y", "theta"}, optional
        Position and direction of the hits, or the direction alone; by default y at an unknown position.
    responses : Coordinate, {"y", "theta"} or sequence, optional
        The same for each channel.
    response_decay_rate : float, optional
        Decay rate in 1/s of an exponential window that the recorder applied to the response and not to the force, with
        its origin at the first sample. `estimate_frf` applies it to the force as well.
    label : str, optional
        Free-text label.
    source : str, optional
        Origin of the data.
    notes : sequence of str, optional
        Notes for the user.

    Raises
    ------
    TypeError, ValueError
        Mismatched shapes, values that are not finite numbers (the message gives the position), an unknown unit, or
        a number of coordinates that differs from that of the channels.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance.hammer import HammerRecords
    >>> time = np.arange(4096) / 25600.0
    >>> force = np.where(time < 4e-4, 120.0 * np.sin(np.pi * time / 4e-4), 0.0)
    >>> response = 9.0 * np.exp(-40.0 * time) * np.sin(2 * np.pi * 800.0 * time)
    >>> HammerRecords(
    ...     force=force, response=response, sample_rate_hz=25600.0, quantity="acceleration", response_unit="g",
    ...     label="tip",
    ... )
    HammerRecords('tip', 1 record of 0.16 s at 25600 Hz, acceleration, 1 channel)
    """

    force: NDArray[np.float64]
    """`(n_records, n)` in N, or N m for a moment."""
    response: NDArray[np.float64]
    """`(n_records, n, n_channels)` in m/s^2, m/s or m, or the same with rad for rotations."""
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
        owner = f"HammerRecords {label!r}" if label else "HammerRecords"
        _checks.one_of(owner, "quantity", quantity, Quantity)
        hammer, motion = _matched_shapes(owner, _samples(owner, "force", force), _samples(owner, "response", response))
        (hit,) = measured_coordinates(owner, "excitations", excitation, 1)
        sensors = measured_coordinates(owner, "responses", responses, motion.shape[2])
        load = "force" if hit.direction == "y" else "moment"
        f_factor = 1.0 if force_unit is None else channel_factor(owner, "force_unit", load, force_unit)
        x_factors = np.ones(len(sensors))
        if response_unit is not None:
            kinds = [quantity if sensor.direction == "y" else ROTATIONS[quantity] for sensor in sensors]
            x_factors = np.array([channel_factor(owner, "response_unit", kind, response_unit) for kind in kinds])
        limit = None
        if full_scale_force is not None:
            limit = abs(f_factor) * _checks.positive(owner, "full_scale_force", full_scale_force)
        limits = None
        if full_scale_response is not None:
            limits = np.abs(x_factors) * _full_scales(owner, full_scale_response, motion.shape[2])
        _checks.set_fields(
            self,
            {
                "force": hammer * f_factor,
                "response": motion * x_factors,
                "sample_rate_hz": _checks.positive(owner, "sample_rate_hz", sample_rate_hz, unit="Hz"),
                "quantity": quantity,
                "full_scale_force": limit,
                "full_scale_response": limits,
                "excitation": hit,
                "responses": sensors,
                "response_decay_rate": _checks.not_negative(
                    owner, "response_decay_rate", response_decay_rate, unit="1/s"
                ),
                "label": str(label),
                "source": str(source),
                "notes": (notes,) if isinstance(notes, str) else tuple(str(note) for note in notes),
            },
        )

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
    ) -> HammerRecords:
        """Select the channels of a time series read by `receptance.io.read`.

        Parameters
        ----------
        series : receptance.io.TimeSeries
            Channels in SI units with their quantities.
        force : str or int
            Name or number of the hammer's channel.
        responses : str, int or sequence of them
            Names or numbers of the response channels, all of one quantity.
        excitation, at : Coordinate, {"y", "theta"} or sequence, optional
            Coordinates of the hits and of the response channels; rotations are "theta" by default.
        **options
            Further parameters of `HammerRecords`; full scales are in SI units.

        Raises
        ------
        ValueError
            An unknown channel, or one of another quantity.

        Examples
        --------
        >>> import numpy as np
        >>> from receptance.io import TimeSeries
        >>> from receptance.hammer import HammerRecords
        >>> series = TimeSeries(
        ...     values=np.ones((64, 2)), channels=["hammer", "tip"], units=["N", "g"], sample_rate_hz=51200.0
        ... )
        >>> HammerRecords.from_series(series, force="hammer", responses="tip").quantity
        'acceleration'
        """
        owner = f"HammerRecords from {series.source or series.label or 'a time series'}"
        names = [responses] if isinstance(responses, (str, int)) else list(responses)
        hammer, *motions = (series.index(name) for name in [force, *names])
        if series.quantities[hammer] not in ("force", "moment"):
            raise ValueError(
                f"{owner}: channel {series.channels[hammer]!r} holds "
                f"{series.quantities[hammer] or 'an unknown quantity'}, expected the force of the hammer"
            )
        translations = {kind: name for name in get_args(Quantity) for kind in (name, ROTATIONS[name])}
        kinds = {translations.get(series.quantities[channel], "unknown") for channel in motions}
        if len(kinds) != 1 or "unknown" in kinds:
            listed = ", ".join(f"{series.channels[k]!r}: {series.quantities[k] or 'unknown'}" for k in motions)
            raise ValueError(
                f"{owner}: the responses are {listed}; expected displacement, velocity or acceleration, the same for "
                "all (missing units are given to receptance.io.read)"
            )
        directions = ["theta" if series.quantities[k] in ROTATIONS.values() else "y" for k in motions]
        sensors = measured_coordinates(owner, "at", directions if at is None else at, len(directions))
        for channel, direction, sensor in zip(motions, directions, sensors, strict=True):
            if direction != sensor.direction:
                raise ValueError(
                    f"{owner}: channel {series.channels[channel]!r} is {series.quantities[channel]}, at {sensor!r}"
                )
        return cls(
            force=series.values[:, hammer],
            response=series.values[:, motions],
            sample_rate_hz=series.sample_rate_hz,
            excitation=excitation,
            responses=sensors,
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
        """`(n,)` times of the samples, from zero."""
        return np.arange(self.force.shape[1]) / self.sample_rate_hz

    def channel(self, index: int) -> HammerRecords:
        """Return the records with one response channel."""
        if not 0 <= index < self.n_channels:
            raise ValueError(f"{self!r}: there is no channel {index}, expected 0 to {self.n_channels - 1}")
        scale = None if self.full_scale_response is None else self.full_scale_response[[index]]
        return replace(
            self, response=self.response[:, :, [index]], full_scale_response=scale, responses=(self.responses[index],)
        )

    def __repr__(self) -> str:
        count = f"{self.n_records} record{'s' if self.n_records > 1 else ''} of {self.duration_s:g} s"
        channels = f"{self.n_channels} channel{'s' if self.n_channels > 1 else ''}"
        return f"HammerRecords({self.label!r}, {count} at {self.sample_rate_hz:g} Hz, {self.quantity}, {channels})"


def _samples(owner: str, name: str, value: ArrayLike) -> NDArray[np.float64]:
    array = _checks.numbers(owner, name, value, "iuf", "real numbers")
    array = array.astype(np.float64)
    bad = np.argwhere(~np.isfinite(array))
    if bad.size:
        position = ", ".join(str(index) for index in bad[0])
        raise ValueError(f"{owner}: {name}[{position}] is {array[tuple(bad[0])]}, expected a finite number")
    largest = float(np.abs(array).max(initial=0.0))
    if largest != 0.0 and not _SMALLEST < largest < 1.0 / _SMALLEST:
        raise ValueError(f"{owner}: the largest value of {name} is {largest:g}, outside the range of sensors")
    return array


def _matched_shapes(
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


def _full_scales(owner: str, value: ArrayLike, count: int) -> NDArray[np.float64]:
    name = "full_scale_response"
    scales = _checks.unmasked(owner, name, value)
    if scales.shape not in ((), (count,)):
        raise ValueError(f"{owner}: {name} has shape {scales.shape}, expected one number or {(count,)}")
    return np.array([_checks.positive(owner, name, scale) for scale in np.broadcast_to(scales, (count,)).tolist()])
