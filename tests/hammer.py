"""Hits on a structure, simulated in the time domain, independent of the estimation of FRFs.

A structure is a sum of modes, each turned into a difference equation by SciPy. The force is sampled as it is, the
response follows from the difference equations sample by sample, and the true FRF is that of the very same equations,
at any complex frequency. So no sampling, aliasing or truncation of a series stands between records and truth.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import signal

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

KINDS = ("displacement", "velocity", "acceleration")


@dataclass(frozen=True)
class Structure:
    """Modes of a free structure, a rigid body among them (0 Hz)."""

    frequency_hz: tuple[float, ...]
    damping_ratio: tuple[float, ...]
    residue: tuple[float, ...]
    """phi_response phi_force / modal mass [1/kg]."""
    sample_rate_hz: float
    quantity: str = "acceleration"

    def filters(self) -> list[tuple[FloatArray, FloatArray]]:
        """Return one difference equation for each mode."""
        order = KINDS.index(self.quantity)
        found = []
        for f, zeta, residue in zip(self.frequency_hz, self.damping_ratio, self.residue, strict=True):
            w = 2.0 * np.pi * f
            numerator = [residue] + [0.0] * order
            denominator = [1.0, 2.0 * zeta * w, w * w]
            if f == 0.0:  # a body that floats: its acceleration is force over mass
                assert self.quantity == "acceleration", "the other quantities of a free body never die away"
                found.append((np.array([residue]), np.array([1.0])))
                continue
            b, a, _ = signal.cont2discrete((numerator, denominator), 1.0 / self.sample_rate_hz, method="zoh")
            found.append((np.atleast_1d(np.squeeze(b)), np.atleast_1d(a)))
        return found

    def respond(self, force: FloatArray) -> FloatArray:
        """Return the response to a force, samples on the last axis."""
        return np.sum([signal.lfilter(b, a, force, axis=-1) for b, a in self.filters()], axis=0)

    def frf(self, frequency_hz: FloatArray, decay_rate: float = 0.0) -> ComplexArray:
        """Return the FRF of the difference equations at w - i sigma."""
        s = 2j * np.pi * np.asarray(frequency_hz) + decay_rate
        z = np.exp(s / self.sample_rate_hz)
        return np.sum([np.polyval(b, z) * z ** (len(a) - len(b)) / np.polyval(a, z) for b, a in self.filters()], axis=0)


def pulse(time: FloatArray, start: float, length: float, peak: float, shape: str = "half sine") -> FloatArray:
    """Return the force of one contact: half a sine, or its square with a smooth beginning and end."""
    phase = (time - start) / length
    inside = (phase > 0.0) & (phase < 1.0)
    value = np.sin(np.pi * np.where(inside, phase, 0.0))
    return peak * np.where(inside, value if shape == "half sine" else value**2, 0.0)


def coloured(generator: np.random.Generator, shape: tuple[int, ...], rms: float, colour: float = 0.0) -> FloatArray:
    """Return Gaussian noise; with a colour between 0 and 1 low frequencies are the stronger ones."""
    white = generator.standard_normal((*shape[:-1], shape[-1] + 512))
    noise = signal.lfilter([np.sqrt(1.0 - colour**2)], [1.0, -colour], white, axis=-1)
    return rms * noise[..., 512:]


@dataclass(frozen=True)
class Records:
    """Simulated records, and the true FRF."""

    force: FloatArray
    response: FloatArray
    true_force: FloatArray
    structure: Structure


def strike(
    structure: Structure,
    generator: np.random.Generator,
    *,
    hits: int = 10,
    duration_s: float = 0.4,
    contact_s: float = 4e-4,
    peak_n: float = 200.0,
    force_noise_db: float = -60.0,
    response_noise_db: float = -60.0,
    shape: str = "half sine",
    colour: float = 0.0,
    pre_trigger_s: float = 0.01,
) -> Records:
    """Hit a structure several times, one record each; all hits differ.

    Noise is in dB of the largest hit's peak, in the time domain: -40 dB is a standard deviation of 1 % of that peak.
    """
    time = np.arange(round(duration_s * structure.sample_rate_hz)) / structure.sample_rate_hz
    force = np.array([
        pulse(
            time,
            pre_trigger_s * generator.uniform(0.9, 1.0),
            contact_s * generator.uniform(0.9, 1.1),
            peak_n * generator.uniform(0.4, 1.0),
            shape,
        )
        for _ in range(hits)
    ])  # fmt: skip
    response = structure.respond(force)
    noises = []
    for clean, level, tint in ((force, force_noise_db, 0.0), (response, response_noise_db, colour)):
        rms = np.abs(clean).max() * 10.0 ** (level / 20.0)
        noises.append(coloured(generator, clean.shape, rms, tint))
    return Records(force + noises[0], response + noises[1], force, structure)
