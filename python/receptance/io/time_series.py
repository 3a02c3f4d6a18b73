"""Time records as they stand in a file: plain arrays with names, units and a sample rate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance import _checks
from receptance.units import channel_kind, parse_unit

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["TimeSeries"]


@dataclass(frozen=True, init=False, eq=False, repr=False)
class TimeSeries:
    """Time records of one or several channels, sampled together.

    Parameters
    ----------
    values : array_like
        `(n_samples,)` or `(n_samples, n_channels)` real and finite, in the given units.
    channels : sequence of str
        Names, all different.
    sample_rate_hz : float
        Samples per second.
    units : sequence of str
        One per channel, such as "N", "g", "mm/s", "V". Forces, moments and motions are converted to SI, everything
        else is kept as it is.
    start_s : float, optional
        Time of the first sample.
    label, source : str, optional
        For people: a name, and where the data come from.
    notes : sequence of str, optional
        What was changed or is suspicious.

    Attributes
    ----------
    values : ndarray
        `(n_samples, n_channels)`, SI.
    quantities : tuple of str
        Per channel "force", "moment", "displacement", "velocity", "acceleration", "rotation", "angular velocity",
        "angular acceleration", or "" for anything else.
    units : tuple of str
        Unit of `values` per channel: "N", "N m", "m", "m/s", "m/s^2", "rad", "rad/s", "rad/s^2", or as given where
        the quantity is "".

    Raises
    ------
    TypeError, ValueError
        Values that are not finite or not real, or names and units that do not fit them; the message says which.

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

    values: NDArray[np.float64]
    channels: tuple[str, ...]
    sample_rate_hz: float
    quantities: tuple[str, ...]
    units: tuple[str, ...]
    start_s: float
    label: str
    source: str
    notes: tuple[str, ...]

    def __init__(
        self,
        *,
        values: ArrayLike,
        channels: Sequence[str],
        sample_rate_hz: float,
        units: Sequence[str],
        start_s: float = 0.0,
        label: str = "",
        source: str = "",
        notes: Sequence[str] = (),
    ) -> None:
        owner = f"TimeSeries {label!r}" if label else "TimeSeries"
        names = _texts(owner, "channels", channels)
        given = _texts(owner, "units", units)
        array = _samples(owner, values, names)
        if len(set(names)) != len(names):
            raise ValueError(f"{owner}: channels are {names}, expected names that differ")
        if len(given) != len(names):
            raise ValueError(f"{owner}: there are {len(given)} units for {len(names)} channels")
        quantities, si = [], []
        for column, text in enumerate(given):
            quantity, unit, factor = _to_si(text)
            quantities.append(quantity)
            si.append(unit)
            if factor != 1.0:
                array[:, column] *= factor
        if not np.all(np.isfinite(array)):
            raise ValueError(f"{owner}: values are too large a number in SI")
        array.setflags(write=False)
        object.__setattr__(self, "values", array)
        object.__setattr__(self, "channels", names)
        rate = _checks.positive(owner, "sample_rate_hz", sample_rate_hz, unit="Hz")
        object.__setattr__(self, "sample_rate_hz", rate)
        object.__setattr__(self, "quantities", tuple(quantities))
        object.__setattr__(self, "units", tuple(si))
        object.__setattr__(self, "start_s", _checks.number(owner, "start_s", start_s, unit="s"))
        object.__setattr__(self, "label", str(label))
        object.__setattr__(self, "source", str(source))
        object.__setattr__(self, "notes", _texts(owner, "notes", notes))

    @property
    def time_s(self) -> NDArray[np.float64]:
        """`(n_samples,)` times in s."""
        return self.start_s + np.arange(self.values.shape[0]) / self.sample_rate_hz

    @property
    def duration_s(self) -> float:
        """Number of samples over the sample rate."""
        return len(self) / self.sample_rate_hz

    def __len__(self) -> int:
        return int(self.values.shape[0])

    def channel(self, which: str | int) -> NDArray[np.float64]:
        """Return the `(n_samples,)` values of one channel, by its name or number (from 0)."""
        if isinstance(which, str):
            if which not in self.channels:
                raise ValueError(f"there is no channel {which!r}; the channels are {', '.join(self.channels)}")
            which = self.channels.index(which)
        return self.values[:, which]

    def __repr__(self) -> str:
        listed = [f"{name} [{unit}]" for name, unit in zip(self.channels, self.units, strict=True)]
        shown = ", ".join(listed if len(listed) <= 6 else [*listed[:5], f"and {len(listed) - 5} more"])
        title = f"{self.label!r}, " if self.label else ""
        return f"TimeSeries({title}{shown}: {len(self)} samples at {self.sample_rate_hz:.6g} Hz)"


def _texts(owner: str, what: str, given: Sequence[str]) -> tuple[str, ...]:
    if isinstance(given, str):
        raise TypeError(f"{owner}: {what} is {given!r}, expected a list of texts")
    texts = tuple(given)
    for text in texts:
        if not isinstance(text, str):
            raise TypeError(f"{owner}: {what} holds {text!r}, expected texts")
    return texts


def _samples(owner: str, values: Any, names: tuple[str, ...]) -> NDArray[np.float64]:
    try:
        array = _checks.unmasked(owner, "values", values)
    except _checks.MaskedError:
        raise
    except ValueError:
        raise ValueError(f"{owner}: values have rows of different lengths") from None
    if array.dtype.kind not in "iuf":
        raise TypeError(f"{owner}: values have dtype {array.dtype}, expected real numbers")
    if array.ndim == 1:
        array = array[:, None]
    if array.ndim != 2 or array.shape[0] == 0 or array.shape[1] != len(names):
        raise ValueError(
            f"{owner}: values have shape {array.shape}, expected (n_samples, {len(names)}) for the channels {names}"
        )
    array = np.array(array, dtype=np.float64, order="C")
    bad = np.argwhere(~np.isfinite(array))
    if bad.size:
        row, column = bad[0]
        raise ValueError(
            f"{owner}: sample {row} of {names[column]!r} is {array[row, column]}, expected a finite number"
        )
    return array


def _to_si(text: str) -> tuple[str, str, float]:
    """Return quantity, SI unit and factor; a unit that is not of a motion or a load stays as it is."""
    try:
        unit = parse_unit(text)
    except ValueError:
        return "", text, 1.0
    kind = channel_kind(unit)
    return ("", text, 1.0) if kind is None else (kind[0], kind[1], unit.factor)
