"""Simulated hammer tests of an assembly, with noise, double hits and overloads."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Protocol, get_args

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from receptance import _checks
from receptance.hammer.records import HammerRecords, Quantity
from receptance.model.coordinates import Coordinate, as_coordinates

_LENGTH_FACTOR = 2
"""Length of the computed blocks relative to the recorded ones, so that the wrap-around is outside."""
_WRAP_AROUND = 1e-5
"""Attenuation of the wrap-around by the shift off the real axis, in addition to the damping of the structure."""
_OVERSAMPLING = 2
"""Computed samples per recorded sample; the filter prevents aliasing."""
_STOP_DB = 80.0
_FILTER_ORDER = 10
_HEADROOM = 1.25
"""Full scale of the channels relative to the largest regular hit."""
_OVERLOAD = 1.8
"""Force of an overload relative to the largest regular hit."""


class Structure(Protocol):
    """Structure with a receptance, such as an `Assembly`."""

    def receptance(
        self,
        frequency_hz: ArrayLike,
        *,
        response: Sequence[Coordinate] | None = None,
        excitation: Sequence[Coordinate] | None = None,
    ) -> NDArray[np.complex128]:
        """Return the receptance as `Assembly.receptance`."""


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
) -> HammerRecords:
    """Simulate a hammer test: half-sine pulses, the responses, a recorder's filter and noise.

    The response is the inverse transform of the receptance times the pulse's spectrum at complex frequencies
    w - i sigma, multiplied by e^(sigma t), so that a response that has not decayed at the end of the block does not
    wrap around. Both channels have the same low-pass filter, down 80 dB at half the sampling rate.

    Parameters
    ----------
    assembly : Assembly
        The structure, or another object with `receptance(frequency_hz, response=, excitation=)`. With dashpots the
        records are exact; with loss factors there is a small motion before the hit, because hysteretic damping is not
        causal.
    response, excitation : Coordinate, optional
        Coordinates of the sensors and of the hits; the tip by default. Several responses are several channels.
    hits : int, optional
        Number of hits, with random strength and duration.
    quantity : {"acceleration", "velocity", "displacement"}, optional
        Quantity of the sensors.
    sample_rate_hz, duration_s : float, optional
        Samples per second, and the time between hits.
    pre_trigger_s : float, optional
        Time before the hit, with random variation of a tenth.
    peak, contact_s : float, optional
        Largest force in N, and duration of the contact.
    force_noise_db, response_noise_db : float, optional
        White noise: its standard deviation relative to the peak of the largest regular hit in the channel.
    double_hits, overloads : collection of int, optional
        Numbers, from 1, of hits with a bounce, and of hits that exceed the full scale.
    one_record : bool, optional
        A single record with all hits, instead of a record for each hit.
    seed : int, optional
        Seed of the random numbers.
    label : str, optional
        Free-text label.

    Returns
    -------
    HammerRecords
        Labelled as simulated in `source` and `notes`.

    Raises
    ------
    TypeError, ValueError
        Invalid numbers, or coordinates outside the assembly.

    Examples
    --------
    >>> from dataclasses import replace
    >>> from receptance import STEEL, Assembly, Part, Segment
    >>> from receptance.hammer import find_hits, simulate_hits
    >>> steel = replace(STEEL, loss_factor=0.01)
    >>> bar = Assembly([Part([Segment(length=0.2, outer_diameter=0.02, material=steel)], name="bar")])
    >>> records = simulate_hits(bar, hits=3, duration_s=0.1, seed=4)
    >>> records
    HammerRecords('simulated', 3 records of 0.1 s at 51200 Hz, acceleration, 1 channel)
    >>> find_hits(records)
    Hits(3 of 3 kept, blocks of 0.1 s)
    """
    if not callable(getattr(assembly, "receptance", None)):
        raise TypeError(f"simulate_hits: assembly is {assembly!r}, expected an Assembly")
    _checks.one_of("simulate_hits", "quantity", quantity, Quantity)
    _checks.whole_number("simulate_hits", "hits", hits)
    for number in (*double_hits, *overloads):
        if not 1 <= number <= hits:
            raise ValueError(f"simulate_hits: there is no hit {number}, expected 1 to {hits}")
    rate = _checks.positive("simulate_hits", "sample_rate_hz", sample_rate_hz, unit="Hz")
    interval_s = _checks.positive("simulate_hits", "duration_s", duration_s, unit="s")
    delay_s = _checks.not_negative("simulate_hits", "pre_trigger_s", pre_trigger_s, unit="s")
    contact = _checks.positive("simulate_hits", "contact_s", contact_s, unit="s")
    if delay_s + 100.0 * contact > interval_s or contact * rate < 2.0:
        raise ValueError(
            f"simulate_hits: duration_s is {interval_s:g} s for a contact of {contact:g} s after {delay_s:g} s at "
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
            start_s=delay_s * generator.uniform(0.9, 1.0),
            contact_s=contact * generator.uniform(0.9, 1.1),
            peak=largest * (_OVERLOAD if number in overloads else generator.uniform(0.4, 1.0)),
            bounce=generator.uniform(0.1, 0.4) if number in double_hits else 0.0,
            bounce_s=interval_s * generator.uniform(0.02, 0.1) + 3.0 * contact,
        )
        for number in range(1, hits + 1)
    ]
    sensors, hammer = as_coordinates(response), as_coordinates(excitation)
    clean = _responses(assembly, sensors, hammer, quantity, pulses, rate, interval_s)
    regular = [number - 1 for number in range(1, hits + 1) if number not in overloads] or list(range(hits))
    recorded, scales = [], []
    for blocks, level in zip(clean, levels, strict=True):
        channel = _as_records(blocks, round(interval_s * rate), one_record)
        top = np.abs(blocks[regular]).max(axis=(0, 1))
        noisy = channel + level * top * generator.standard_normal(channel.shape)
        recorded.append(np.clip(noisy, -_HEADROOM * top, _HEADROOM * top))
        scales.append(_HEADROOM * top)
    return HammerRecords(
        force=recorded[0][:, :, 0],
        response=recorded[1],
        sample_rate_hz=rate,
        quantity=quantity,
        full_scale_force=float(scales[0][0]),
        full_scale_response=scales[1],
        excitation=hammer[0],
        responses=sensors,
        label=label,
        source=f"simulated by receptance, seed {seed}",
        notes=("simulated, not measured",),
    )


@dataclass(frozen=True)
class _Pulse:
    """Half-sine pulse, optionally followed by a smaller one."""

    start_s: float
    contact_s: float
    peak: float
    bounce: float
    bounce_s: float

    def spectrum(self, s: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Return the Laplace transform: w (1 + e^(-s T)) / (s^2 + w^2) with w = pi / T."""
        w = np.pi / self.contact_s
        pulse = self.peak * w * (1.0 + np.exp(-s * self.contact_s)) / (s**2 + w**2)
        return np.asarray(pulse * np.exp(-s * self.start_s) * (1.0 + self.bounce * np.exp(-s * self.bounce_s)))


def _as_records(blocks: NDArray[np.float64], n_samples: int, one_record: bool) -> NDArray[np.float64]:
    """Return records `(n_records, n, n_channels)` from blocks longer than the time between hits."""
    if not one_record:
        return blocks[:, :n_samples]
    record = np.zeros((1, n_samples * len(blocks), blocks.shape[2]))
    for number, block in enumerate(blocks):
        remainder = record[0, number * n_samples :]
        remainder[: len(block)] += block[: len(remainder)]
    return record


def _responses(
    assembly: Structure,
    sensors: tuple[Coordinate, ...],
    hammer: tuple[Coordinate, ...],
    quantity: Quantity,
    pulses: Sequence[_Pulse],
    rate: float,
    interval_s: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return force `(n_hits, n, 1)` and response `(n_hits, n, n_channels)`, 1.5 times as long as recorded."""
    n_samples = _LENGTH_FACTOR * _OVERSAMPLING * round(interval_s * rate)
    step = 1.0 / (_OVERSAMPLING * rate)
    sigma = -np.log(_WRAP_AROUND) / (n_samples * step)
    lines = np.arange(n_samples // 2 + 1) / (n_samples * step)
    s = 2j * np.pi * lines + sigma
    low_pass = scipy.signal.freqs(
        *scipy.signal.cheby2(_FILTER_ORDER, _STOP_DB, np.pi * rate, analog=True), worN=s / 1j
    )[1]
    # Above the pass band the filtered response vanishes and is not computed.
    passed = lines <= rate / 2.0
    # A free body has no receptance at 0 Hz; the shifted line beside it is used.
    lines_hz = np.where(lines == 0.0, 1e-6 * lines[1], lines)[passed] - 1j * sigma / (2.0 * np.pi)
    motion = np.zeros((lines.size, len(sensors)), dtype=np.complex128)
    motion[passed] = assembly.receptance(lines_hz, response=sensors, excitation=hammer)[:, :, 0]
    motion *= s[:, None] ** get_args(Quantity).index(quantity)
    force = np.array([pulse.spectrum(s) * low_pass * passed for pulse in pulses])[:, :, None]
    samples = slice(0, 3 * n_samples // 4, _OVERSAMPLING)
    growth = np.exp(sigma * step * np.arange(n_samples))[samples, None]
    channels = [
        scipy.fft.irfft(spectra, n_samples, axis=1)[:, samples] * growth / step for spectra in (force, force * motion)
    ]
    return channels[0], channels[1]
