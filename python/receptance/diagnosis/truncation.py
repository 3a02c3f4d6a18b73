"""Truncated records: the time at which they end, from their lines alone, and the start of a fit of it.

Chi-square has a minimum in each period of the highest mode, so that a fit starts at the best of many ends. A record
that ends at the time e has the transform s^-2 int_0^e a(t) exp(-s t) dt of the acceleration a(t) after a unit impulse,
as in `rust/core/src/observe/truncation.rs`. From the first end on the integral is summed over time, so that one impulse
response gives the misfit of every end.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from receptance.diagnosis.thresholds import (
    TRUNCATION_FROM,
    TRUNCATION_POINTS,
    TRUNCATION_STEP,
    TRUNCATION_WINDOW,
    UNEVEN_LINES,
)
from receptance.fit.observation import Observation
from receptance.fit.parameters import DELAY, LOG_GAIN
from receptance.fit.problem import InfeasibleError, Task
from receptance.fit.unknowns import Unknown
from receptance.model.assembly import Assembly

ALL_RECORDS = ""
"""Key of all records together among the ends of records."""
_PERIOD = 1.6
"""Period of the impulse response, as a multiple of the latest end."""
_DECAY = 9.0
"""Natural logarithm by which it decays over a period where its samples are taken: it wraps around at its end."""
_FADE = (1.05, 1.35)
"""Multiples of the highest line between which samples fade out."""
_INSTANTS = 12
"""Instants in a period of the highest line."""
_BLOCK = 512
"""Instants that are summed at once: it bounds memory."""


def record_ends(records: Sequence[Observation]) -> dict[str, float]:
    """Return the times in s after the hit at which records were truncated, where their lines show it.

    They are those of each record by its label, and that of all together under `ALL_RECORDS`.
    """
    groups = {ALL_RECORDS: tuple(records), **{record.label: (record,) for record in records if record.label}}
    ends = {name: _truncation_time(members) for name, members in groups.items()}
    return {name: end for name, end in ends.items() if end is not None}


def _truncation_time(records: Sequence[Observation]) -> float | None:
    """Return the time in s after the hit at which records were truncated; None where they do not show it.

    The lines of a record of the length T are multiples of 1 / T, and the corresponding response covers one period T.
    A truncated record rings up to its end and is silent from there on.
    """
    # A stepped sine has no end.
    hits = [(record, power) for record in records if record.force is None and (power := _power(record)) is not None]
    periods = [period for _, (period, _) in hits]
    if not hits or max(periods) > (1.0 + 1e-6) * min(periods):
        return None
    first = int(TRUNCATION_FROM * TRUNCATION_POINTS)
    # Each record is normalised by its late power.
    power = np.sum([power / np.mean(power[first:]) for _, (_, power) in hits], axis=0)
    width = int(TRUNCATION_WINDOW * TRUNCATION_POINTS)
    largest, at = 0.0, 0
    for i in range(first, TRUNCATION_POINTS - 4):
        before, after = np.mean(power[i - width : i]), np.mean(power[i : min(i + width, TRUNCATION_POINTS - 2)])
        # The ordinary decay over one window is not part of the step.
        decay = max(float(np.mean(power[i - 2 * width : i - width]) / before), 1.0)
        step = float(before / after) / decay
        if step > largest:
            largest, at = step, i
    # The power of few records varies more: every eighth record without an end has a step of 2.5 by chance.
    if largest <= TRUNCATION_STEP ** max(2.0 / math.sqrt(len(hits)), 1.0):
        return None
    # The window over the band spreads the response by 2 / band, so that it seems to end that much later. A fit that
    # starts late ends in another optimum: over a period of a mode the phase of its end turns once.
    spread = 2.0 / min(float(np.ptp(record.frequency_hz.real)) for record, _ in hits)
    return at / TRUNCATION_POINTS * periods[0] - spread


def _power(observation: Observation) -> tuple[float, NDArray[np.float64]] | None:
    """Return the period of the lines in s, and the power of the acceleration after a unit impulse along it."""
    lines = observation.frequency_hz.real
    if lines.size < 3:
        return None
    numbers = lines / float(np.min(np.diff(lines)))
    spacing = float(np.polyfit(np.round(numbers), lines, 1)[0])
    numbers = np.round(lines / spacing)
    if np.max(np.abs(lines / spacing - numbers)) > UNEVEN_LINES:
        return None
    every = np.arange(numbers[0], numbers[-1] + 1)
    angular = 2j * np.pi * observation.frequency_hz
    accelerance = np.interp(every, numbers, observation.receptance * angular**2)
    # A window over the band keeps the hit at time zero from ringing over the whole period.
    accelerance = accelerance * np.hanning(every.size)
    size = 8 * TRUNCATION_POINTS * (1 + int(every[-1]) // (4 * TRUNCATION_POINTS))
    spectrum = np.zeros(size // 2 + 1, dtype=np.complex128)
    spectrum[every.astype(int)] = accelerance
    signal = np.fft.irfft(spectrum, size) ** 2
    return 1.0 / spacing, signal.reshape(TRUNCATION_POINTS, -1).mean(axis=1)


def best_end(
    end: Unknown, task: Task, observations: Sequence[Observation], values: Mapping[str, float]
) -> dict[str, float]:
    """Return the end of records, within its bounds, at which a model has the smallest chi-square.

    Parameters
    ----------
    end : Unknown
        The end, an unknown of the task.
    task : Task
        The fit.
    observations : sequence of Observation
        Those of the task, on some of their lines.
    values : mapping of str to float
        Values of the other unknowns by name.

    Returns
    -------
    dict of str to float
        The end in s by the name of its unknown; empty where the model has no value.
    """
    sites = [observation.site(i) for i, observation in enumerate(observations)]
    among = [site.among(end.configurations, end.labels) for site in sites]
    recorded = [i for i, observation in enumerate(observations) if among[i] and observation.ends is not None]
    highest = max(float(observations[i].frequency_hz.real.max()) for i in recorded)
    period = _PERIOD * end.upper
    count = fft.next_fast_len(int(np.ceil(_INSTANTS * highest * period)))
    step = period / count
    first, last = int(np.ceil(end.lower / step)), int(end.upper / step)
    problem, x = task.problem(observations), task.variables.vector_of({**values, end.name: first * step})
    try:
        parts = problem.parts(problem.value(x))
    except InfeasibleError:
        return {}
    unknowns = task.variables.to_values(x)
    chi_square = np.zeros(last - first)
    for i in recorded:
        mapping, observation = task.mappings[i], observations[i]
        chain = dict(zip(mapping.addresses, mapping.values(unknowns).tolist(), strict=True))
        s = (2j * np.pi * observation.frequency_hz).astype(np.complex128)
        factor = np.exp(chain.get(LOG_GAIN, 0.0) - s * chain.get(DELAY, 0.0)) / (s * s * observation.receptance)
        impulse = _accelerations(mapping.apply(observation.assembly, unknowns), observation, highest, period, count)
        deviation = observation.standard_deviations[: s.size]
        real, imaginary = parts[i].reshape(2, -1) * deviation
        # Residuals are logarithms of measured over modelled values.
        at_first = np.exp(-(real + 1j * imaginary))
        chi_square += _misfits(impulse[first:last], step, first * step, s, factor, at_first, deviation)
    return {end.name: float((first + int(np.argmin(chi_square))) * step)}


def _accelerations(
    assembly: Assembly, observation: Observation, highest: float, period: float, count: int
) -> NDArray[np.float64]:
    """Return the acceleration after a unit impulse at `count` instants of a period."""
    low, high = (share * highest for share in _FADE)
    lines = np.arange(0.5 / period, high, 1.0 / period)
    weights = 0.5 + 0.5 * np.cos(np.pi * np.clip((lines - low) / (high - low), 0.0, 1.0))
    p = _DECAY / period + 2j * np.pi * lines
    response = assembly.receptance(
        p / (2j * np.pi), response=observation.response, excitation=observation.excitation, threads=1
    )
    # The samples lie between the multiples of 1 / period: what wraps around has the other sign.
    turned = fft.ifft(weights * p * p * response, count) * np.exp(1j * np.pi * np.arange(count) / count)
    signal: NDArray[np.float64] = turned.real * (2.0 * count / period) * np.exp(_DECAY * np.arange(count) / count)
    return signal


def _misfits(
    impulse: NDArray[np.float64],
    step: float,
    begin: float,
    s: NDArray[np.complex128],
    factor: NDArray[np.complex128],
    ratio: NDArray[np.complex128],
    deviation: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return chi-square of a record for an end at each of some instants.

    Parameters
    ----------
    impulse : ndarray
        `(n,)` acceleration at the instants.
    step, begin : float
        Their distance and the first one, in s.
    s : ndarray
        `(m,)` the lines as i w.
    factor : ndarray
        `(m,)` ratio of modelled over measured receptance to the integral of the acceleration.
    ratio : ndarray
        `(m,)` modelled over measured receptance with an end at the first instant.
    deviation : ndarray
        `(m,)` standard deviations.
    """
    kernel = np.exp(-s * step * np.arange(_BLOCK)[:, None])
    misfits = np.zeros(impulse.size)
    before = np.zeros_like(ratio)
    for start in range(0, impulse.size, _BLOCK):
        block = impulse[start : start + _BLOCK, None]
        turned = block * kernel[: len(block)] * (step * np.exp(-s * (begin + start * step)))
        # The trapezoidal rule, from the first instant on.
        total = before + np.cumsum(turned, axis=0) - 0.5 * turned - (0.5 * turned[0] if start == 0 else 0.0)
        before = total[-1] + 0.5 * turned[-1]
        error = np.log(ratio + factor * total) / deviation
        misfits[start : start + len(block)] = np.sum(error.real**2 + error.imag**2, axis=1)
    return misfits
