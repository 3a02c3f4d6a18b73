"""Hits on an assembly, simulated: what a recorder would have written, with noise and the usual accidents."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, get_args

import numpy as np

from receptance import _checks
from receptance.coordinates import Coordinate, as_coordinates
from receptance.measurement.records import Quantity, TimeRecords

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["simulate_hits"]

_LONGER = 2
"""Blocks are computed so many times longer than they are recorded: what wraps around falls outside."""
_FADED = 1e-5
"""To what the shift off the real axis brings what wraps around, beside the structure's own damping."""
_FINER = 2
"""Samples computed per sample recorded; the filter leaves nothing above that could fold back."""
_STOP_DB = 80.0
_FILTER_ORDER = 10
_HEADROOM = 1.25
"""Full scale of the channels over the largest regular hit."""
_TOO_HARD = 1.8
"""Force of a hit that overloads, over the largest regular one."""


class Structure(Protocol):
    """What can be hit: an `Assembly`, or anything else that has its receptance."""

    def receptance(
        self,
        frequency_hz: ArrayLike,
        *,
        response: Sequence[Coordinate] | None = None,
        excitation: Sequence[Coordinate] | None = None,
    ) -> NDArray[np.complex128]:
        """Receptance as of an `Assembly`."""


def simulate_hits(
    assembly: Structure,
    *,
    response: Coordinate | Sequence[Coordinate] | None = None,
    excitation: Coordinate | None = None,
    hits: int = 10,
    quantity: Quantity = "acceleration",
    sample_rate_hz: float = 51200.0,
    duration_s: float = 0.25,
    pre_trigger_s: float = 0.01,
    peak: float = 200.0,
    contact_s: float = 2e-4,
    force_noise_db: float = -70.0,
    response_noise_db: float = -70.0,
    double_hits: Collection[int] = (),
    overloads: Collection[int] = (),
    one_record: bool = False,
    seed: int = 0,
    label: str = "simulated",
) -> TimeRecords:
    """Simulate hits on an assembly: pulses of half a sine, the responses, a recorder's filter and noise.

    The response is the inverse transform of the receptance times the pulse's spectrum at complex frequencies
    w - i sigma, multiplied by e^(sigma t): a response that has not died away when the block ends then does not come
    back at its beginning. Both channels go through the same low-pass filter, down 80 dB at half the sampling rate.

    Parameters
    ----------
    assembly : Assembly
        The structure, or anything that has its `receptance(frequency_hz, response=, excitation=)`. With loss factors
        it begins to move before the hit, by a little, as such materials do in theory (they are not causal); with
        dashpots alone the records are exact.
    response, excitation : Coordinate, optional
        Where the sensors are and where the hammer hits; the tip by default. Several responses are several channels.
    hits : int, optional
        Number of hits; strength and duration differ from one to the next.
    quantity : {"acceleration", "velocity", "displacement"}, optional
        What the sensors measure.
    sample_rate_hz, duration_s : float, optional
        Samples per second, and the time from one hit to the next.
    pre_trigger_s : float, optional
        How long each record runs before its hit, but for a tenth that differs.
    peak, contact_s : float, optional
        Largest force in N, and how long the hammer touches.
    force_noise_db, response_noise_db : float, optional
        White noise on the channels: its standard deviation over the largest regular hit's peak in that channel.
    double_hits, overloads : collection of int, optional
        Numbers, from 1, of hits at which the hammer bounces back, and of hits too hard for the recorder.
    one_record : bool, optional
        One long record with all hits instead of one record each.
    seed : int, optional
        Seed of all that is drawn.
    label : str, optional
        For people.

    Returns
    -------
    TimeRecords
        Labelled as simulated in `source` and `notes`.

    Raises
    ------
    TypeError, ValueError
        Unusable numbers, or coordinates that the assembly does not have.

    Examples
    --------
    >>> from dataclasses import replace
    >>> from receptance import STEEL, Assembly, Part, Segment
    >>> from receptance.measurement import find_hits, simulate_hits
    >>> steel = replace(STEEL, loss_factor=0.01)
    >>> bar = Assembly([Part([Segment(length=0.2, outer_diameter=0.02, material=steel)], name="bar")])
    >>> records = simulate_hits(bar, hits=3, duration_s=0.1, seed=4)
    >>> records
    TimeRecords('simulated', 3 records of 0.1 s at 51200 Hz, acceleration, 1 channel)
    >>> find_hits(records)
    Hits(3 of 3 kept, blocks of 0.1 s)
    """
    if not callable(getattr(assembly, "receptance", None)):
        raise TypeError(f"simulate_hits: assembly is {assembly!r}, expected an Assembly")
    if quantity not in get_args(Quantity):
        raise ValueError(f"simulate_hits: quantity is {quantity!r}, expected one of {', '.join(get_args(Quantity))}")
    if isinstance(hits, bool) or not isinstance(hits, (int, np.integer)) or hits < 1:
        raise ValueError(f"simulate_hits: hits is {hits!r}, expected a whole number of at least 1")
    for number in (*double_hits, *overloads):
        if not 1 <= number <= hits:
            raise ValueError(f"simulate_hits: there is no hit {number}, expected 1 to {hits}")
    rate = _checks.positive("simulate_hits", "sample_rate_hz", sample_rate_hz, unit="Hz")
    long_s = _checks.positive("simulate_hits", "duration_s", duration_s, unit="s")
    before_s = _checks.not_negative("simulate_hits", "pre_trigger_s", pre_trigger_s, unit="s")
    contact = _checks.positive("simulate_hits", "contact_s", contact_s, unit="s")
    if before_s + 100.0 * contact > long_s or contact * rate < 2.0:
        raise ValueError(
            f"simulate_hits: duration_s is {long_s:g} s for a contact of {contact:g} s after {before_s:g} s at "
            f"{rate:g} Hz, expected a contact of two samples or more, and a hundred contacts after pre_trigger_s"
        )
    levels = [
        10.0 ** (_checks.number("simulate_hits", name, value, unit="dB") / 20.0)
        for name, value in (("force_noise_db", force_noise_db), ("response_noise_db", response_noise_db))
    ]
    generator = np.random.default_rng(seed)
    largest = _checks.positive("simulate_hits", "peak", peak, unit="N")
    pulses = [
        _Pulse(
            start_s=before_s * generator.uniform(0.9, 1.0),
            contact_s=contact * generator.uniform(0.9, 1.1),
            peak=largest * (_TOO_HARD if number in overloads else generator.uniform(0.4, 1.0)),
            bounce=generator.uniform(0.1, 0.4) if number in double_hits else 0.0,
            bounce_s=long_s * generator.uniform(0.02, 0.1) + 3.0 * contact,
        )
        for number in range(1, hits + 1)
    ]
    places = (as_coordinates(response), as_coordinates(excitation))
    clean = _responses(assembly, places, quantity, pulses, rate, long_s)
    regular = [number - 1 for number in range(1, hits + 1) if number not in overloads] or list(range(hits))
    recorded, scales = [], []
    for one, level in zip(clean, levels, strict=True):
        channel = _laid_out(one, round(long_s * rate), one_record)
        top = np.abs(one[regular]).max(axis=(0, 1))
        noisy = channel + level * top * generator.standard_normal(channel.shape)
        recorded.append(np.clip(noisy, -_HEADROOM * top, _HEADROOM * top))
        scales.append(_HEADROOM * top)
    return TimeRecords(
        force=recorded[0][:, :, 0],
        response=recorded[1],
        sample_rate_hz=rate,
        quantity=quantity,
        full_scale_force=float(scales[0][0]),
        full_scale_response=scales[1],
        excitation=places[1][0],
        responses=places[0],
        label=label,
        source=f"simulated by receptance, seed {seed}",
        notes=("simulated, not measured",),
    )


@dataclass(frozen=True)
class _Pulse:
    """Half a sine, and perhaps a smaller one after it."""

    start_s: float
    contact_s: float
    peak: float
    bounce: float
    bounce_s: float

    def spectrum(self, s: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Return the Laplace transform: w (1 + e^(-s T)) / (s^2 + w^2) with w = pi / T."""
        w = np.pi / self.contact_s
        one = self.peak * w * (1.0 + np.exp(-s * self.contact_s)) / (s**2 + w**2)
        shifted: NDArray[np.complex128] = (
            one * np.exp(-s * self.start_s) * (1.0 + self.bounce * np.exp(-s * self.bounce_s))
        )
        return shifted


def _laid_out(blocks: NDArray[np.float64], n_samples: int, one_record: bool) -> NDArray[np.float64]:
    """Return records `(n_records, n, n_channels)` from blocks that are longer than the time from hit to hit."""
    if not one_record:
        return blocks[:, :n_samples]
    whole = np.zeros((1, n_samples * len(blocks), blocks.shape[2]))
    for number, block in enumerate(blocks):
        rest = whole[0, number * n_samples :]
        rest[: len(block)] += block[: len(rest)]
    return whole


def _responses(
    assembly: Structure,
    places: tuple[tuple[Coordinate, ...], tuple[Coordinate, ...]],
    quantity: Quantity,
    pulses: Sequence[_Pulse],
    rate: float,
    long_s: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return force `(n_hits, n, 1)` and response `(n_hits, n, n_channels)`, half as long again as they are recorded."""
    from scipy.fft import irfft
    from scipy.signal import cheby2, freqs

    n_samples = _LONGER * _FINER * round(long_s * rate)
    step = 1.0 / (_FINER * rate)
    sigma = -np.log(_FADED) / (n_samples * step)
    lines = np.arange(n_samples // 2 + 1) / (n_samples * step)
    s = 2j * np.pi * lines + sigma
    low_pass = freqs(*cheby2(_FILTER_ORDER, _STOP_DB, np.pi * rate, analog=True), worN=s / 1j)[1]
    # Above the filter's stop band nothing is heard, so nothing need be computed.
    heard = lines <= rate / 2.0
    # A body that floats has no receptance at 0 Hz; beside it, on the shifted line, it does.
    places_hz = np.where(lines == 0.0, 1e-6 * lines[1], lines)[heard] - 1j * sigma / (2.0 * np.pi)
    motion = np.zeros((lines.size, len(places[0])), dtype=np.complex128)
    motion[heard] = assembly.receptance(places_hz, response=places[0], excitation=places[1])[:, :, 0]
    motion *= s[:, None] ** get_args(Quantity).index(quantity)
    force = np.array([pulse.spectrum(s) * low_pass * heard for pulse in pulses])[:, :, None]
    keep = slice(0, 3 * n_samples // 4, _FINER)
    grow = np.exp(sigma * step * np.arange(n_samples))[keep, None]
    channels = [irfft(one, n_samples, axis=1)[:, keep] * grow / step for one in (force, force * motion)]
    return channels[0], channels[1]
