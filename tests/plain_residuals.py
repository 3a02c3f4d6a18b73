"""Residuals of one observation from receptances of its assembly, in NumPy: the reference of those of the core."""

from __future__ import annotations

from typing import Any

import numpy as np

from receptance import Assembly
from receptance.errors import ReceptanceError
from receptance.fit.observation import Observation, Unit
from receptance.fit.parameters import (
    DECAY_RATES,
    DELAY,
    END,
    FACTORS,
    FREQUENCY_OFFSETS,
    HIGH_PASS,
    LEVEL_EXPONENT,
    LEVEL_SLOPE,
    LOG_GAIN,
    LOW_PASS,
    PHASE,
    ParameterMap,
)
from receptance.model.addresses import moved_coordinate


def residual_and_jacobian(
    data: Observation, mapping: ParameterMap, unit: Unit, values: np.ndarray
) -> tuple[np.ndarray, np.ndarray] | None:
    """Return residuals and their derivatives by the values of the unknowns; None where the model has no value."""
    own = dict(zip(mapping.addresses, mapping.values(values).tolist(), strict=True))
    try:
        assembly = mapping.apply(data.assembly, values)
        make = of_receptance if data.is_receptance else of_frequencies
        residual, slopes = make(data, unit, assembly, own)
    except (ReceptanceError, ValueError):
        return None
    return residual, slopes @ mapping.jacobian(values)


def of_receptance(frf: Any, unit: Unit, assembly: Assembly, own: dict[str, float]) -> tuple[np.ndarray, np.ndarray]:
    places = [
        moved_coordinate(place, frf.assembly.elements, assembly.elements) for place in (frf.response, frf.excitation)
    ]
    options = {"response": places[0], "excitation": places[1], "threads": 1}
    if frf.force is not None:
        options["force"] = frf.force
    f, structural = frf.frequency_hz, [name for name in own if name not in FACTORS]
    rate, end = sum(own.get(name, 0.0) for name in DECAY_RATES), own.get(END, frf.ends)
    offset = sum(own.get(name, 0.0) for name in FREQUENCY_OFFSETS)

    def columns_at(rate: float, end: float | None, by_end: bool = False, offset: float = offset) -> np.ndarray:
        """Return receptance and derivatives before gain, delay and integration, one column each; or by the end."""

        def columns(lines: np.ndarray) -> np.ndarray:
            return np.column_stack(assembly.derivatives(lines, structural, **options))

        if end is not None:
            return truncated(columns, f, end, 1.2 * frf.ends, rate, by_end)
        lines = f - offset
        return columns(lines if rate == 0.0 else lines - 1j * rate / (2.0 * np.pi))

    at = columns_at(rate, end)
    h, slopes = at[:, 0], dict(zip(structural, at.T[1:], strict=True))
    s = 2j * np.pi * f
    factor = np.exp(own.get(LOG_GAIN, 0.0) - 2j * np.pi * f.real * own.get(DELAY, 0.0))
    for name, power in DECAY_RATES.items():
        factor = factor * (1.0 + own.get(name, 0.0) / s) ** power
    for name, power in FREQUENCY_OFFSETS.items():
        factor = factor * ((f - own.get(name, 0.0)) / f) ** power
    w = 2.0 * np.pi * f.real
    amplifier = {
        LEVEL_EXPONENT: lambda z: (f.real / 1000.0) ** z,
        LEVEL_SLOPE: lambda z: np.exp(z * w),
        PHASE: lambda z: np.full(f.shape, np.exp(1j * z)),
        LOW_PASS: lambda z: 1.0 / (1.0 + z * s) if z > 0.0 else 1.0 - z * s,
        HIGH_PASS: lambda z: s / (s + z) if z > 0.0 else (s - z) / s,
    }
    for name, response in amplifier.items():
        factor = factor * response(own.get(name, 0.0))
    for name in own.keys() - set(structural):
        if name in DECAY_RATES:
            by_rate = derivative(lambda z: columns_at(z, end)[:, 0], rate, 0.5)
            slopes[name] = by_rate + h * DECAY_RATES[name] / (s + own[name])
        elif name in FREQUENCY_OFFSETS:
            by_offset = derivative(lambda z: columns_at(rate, end, offset=z)[:, 0], offset, 0.1)
            slopes[name] = by_offset - h * FREQUENCY_OFFSETS[name] / (f - own[name])
        elif name in amplifier:
            step = {LEVEL_SLOPE: 1e-7, LOW_PASS: 1e-7, HIGH_PASS: 1.0}.get(name, 1e-3)
            slopes[name] = h * derivative(lambda z, name=name: np.log(amplifier[name](z)), own[name], step)
        elif name == END:
            slopes[name] = columns_at(rate, end, by_end=True)[:, 0]
        else:
            slopes[name] = h * (1.0 if name == LOG_GAIN else -2j * np.pi * f.real)
    ratio = frf.receptance / (h * factor)
    relative = -np.array([slopes[name] / h for name in own]).reshape(len(own), -1).T
    if unit == "percent":
        percent = 100.0 / np.abs(ratio)
        return percent - 100.0, -percent[:, None] * relative.real
    weight = np.ones(f.size)
    if unit == "standard deviations" and frf.standard_deviation is not None:
        weight = 1.0 / frf.standard_deviation
    log = np.log(ratio) * weight
    relative = relative * weight[:, None]
    return np.concatenate([log.real, log.imag]), np.concatenate([relative.real, relative.imag])


def derivative(function: Any, x: float, step: float) -> np.ndarray:
    """Return the derivative by central differences of sixth order."""
    weights = {1: 0.75, 2: -0.15, 3: 1.0 / 60.0}
    return sum(w * (function(x + n * step) - function(x - n * step)) / step for n, w in weights.items())


def truncated(
    columns: Any, f: np.ndarray, end: float, latest: float, rate: float = 0.0, by_end: bool = False
) -> np.ndarray:
    """Return the columns of responses at lines in a record that ends at a time, or their derivatives by that time.

    They are sums over samples s^2 H(s) of the response, s = p + rate, p = s0 +- i v_j: Fourier coefficients of the
    acceleration times exp(-s0 t); see the core's `truncation`.
    """
    period, before = 1.6 * latest, 0.1 * latest
    top, decay = f.real.max(), 9.0 / period
    v = 2.0 * np.pi / period * (np.arange(int(1.35 * top * period)) + 0.5)
    fading = 0.5 + 0.5 * np.cos(np.pi * np.clip((v / (2.0 * np.pi * top) - 1.05) / 0.3, 0.0, 1.0))
    sampled = columns((v - 1j * (decay + rate)) / (2.0 * np.pi)) * (fading * (decay + 1j * v + rate) ** 2)[:, None]
    p = np.concatenate([decay + 1j * v, decay - 1j * v])
    z = p - 2j * np.pi * f[:, None]
    kernel = np.exp(z * end) / period if by_end else (np.exp(z * end) - np.exp(-z * before)) / (period * z)
    return kernel @ np.concatenate([sampled, sampled.conj()]) / ((2j * np.pi * f + rate) ** 2)[:, None]


def of_frequencies(data: Any, unit: Unit, assembly: Assembly, own: dict[str, float]) -> tuple[np.ndarray, np.ndarray]:
    assert not data.is_receptance
    rows = np.array(data.modes) - 1
    found, slope = (part[rows] for part in assembly.lowest_natural_frequencies(rows[-1] + 1, list(own)))
    share = 0.01 if unit == "percent" else 1.0
    weighed = unit == "standard deviations" and data.standard_deviation is not None
    size_of_one = data.standard_deviation if weighed else share * data.frequency_hz
    if data.damping_ratio is None:
        return (found - data.frequency_hz) / size_of_one, slope / size_of_one[:, None]
    poles, moved = assembly.complex_frequencies(found, list(own))
    size = np.abs(poles)
    ratio, slope = poles.imag / size, (poles.conj()[:, None] * moved).real / size[:, None]
    steeper = (moved.imag - ratio[:, None] * slope) / size[:, None]
    damped, spread = data.damped, data.standard_deviation_damping
    of_ratio = spread if weighed else share * np.maximum(data.damping_ratio, 1e-4)
    off = (ratio - data.damping_ratio) / of_ratio
    residual = np.concatenate([(size - data.frequency_hz) / size_of_one, off[damped]])
    return residual, np.vstack([slope / size_of_one[:, None], (steeper / of_ratio[:, None])[damped]])
