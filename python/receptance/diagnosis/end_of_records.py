"""Start of a fit of the time at which records end.

Chi-square has a minimum in each period of the highest mode, so that a fit starts at the best of many ends. A record
that ends at the time e has the transform s^-2 int_0^e a(t) exp(-s t) dt of the acceleration a(t) after a unit impulse,
as in `rust/core/src/observe/truncation.rs`. From the first end on the integral is summed over time, so that one impulse
response gives the misfit of every end.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from receptance.diagnosis.model import Model
from receptance.fit.observation import Observation
from receptance.fit.parameters import DELAY, END, LOG_GAIN
from receptance.fit.problem import InfeasibleError
from receptance.model.assembly import Assembly

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


def best_end(model: Model, values: Mapping[str, float]) -> dict[str, float]:
    """Return the end of records, within its bounds, at which a model has the smallest chi-square on few lines.

    Parameters
    ----------
    model : Model
        The model; the end of records is the last of its unknowns with this address.
    values : mapping of str to float
        Values of the other unknowns by name.

    Returns
    -------
    dict of str to float
        The end in s by the name of its unknown; empty where the model has no value.
    """
    end = next(unknown for unknown in reversed(model.unknowns) if unknown.address == END)
    observations = model.on_few_lines
    sites = [observation.site(i) for i, observation in enumerate(observations)]
    among = [site.among(end.configurations, end.labels) for site in sites]
    recorded = [i for i, observation in enumerate(observations) if among[i] and observation.ends is not None]
    highest = max(float(observations[i].frequency_hz.real.max()) for i in recorded)
    period = _PERIOD * end.upper
    count = fft.next_fast_len(int(np.ceil(_INSTANTS * highest * period)))
    step = period / count
    first, last = int(np.ceil(end.lower / step)), int(end.upper / step)
    problem, x = model.task.problem(observations), model.task.variables.vector_of({**values, end.name: first * step})
    try:
        parts = problem.parts(problem.value(x))
    except InfeasibleError:
        return {}
    unknowns = model.task.variables.to_values(x)
    chi_square = np.zeros(last - first)
    for i in recorded:
        mapping, observation = model.task.mappings[i], observations[i]
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
