"""Hits on a tool in a holder, by finite elements in the time domain, without waves or spectra.

The elements are those of the oracle. Their modes, damped by the joint's dashpots, are integrated on a grid much finer
than the recorder's, the force straight between grid points; then force and acceleration go through one low-pass filter
and are thinned out, as a recorder does it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, signal

import hammer
from oracle import elements, tables

FloatArray = NDArray[np.float64]
CARBIDE = (580e9, 14500.0, 0.22)
STEEL = (210e9, 7850.0, 0.3)
TOOL = (0.0623, 0.0127)
SECTIONS = ((0.03, 0.035), (0.03, 0.047), (0.03, 0.05), (0.03, 0.042))
FINER = 64
SLOW = 0.25
"""Radians per step of the grid up to which a mode is integrated."""


@dataclass(frozen=True)
class Structure:
    """A lossless tool and a lossless holder with a joint between them, seen and hit at the tip."""

    k_y: float
    k_theta: float
    c_y: float
    c_theta: float

    @cached_property
    def poles(self) -> tuple[NDArray[np.complex128], NDArray[np.complex128], float]:
        """Poles above the real axis, their residues of the tip's displacement, and the rigid-body terms."""
        rows = [tables.segment(0, 1, *TOOL, CARBIDE)]
        rows += [tables.segment(2 + i, 3 + i, *section, STEEL) for i, section in enumerate(SECTIONS)]
        model = tables.make(rows, [tables.joint(1, 2, self.k_y, self.k_theta)])
        strain, inertia = elements._factors(model, 2.0 * np.pi * 40e3, 1.0)
        squares, shapes = linalg.eigh(strain.T @ strain, inertia.T @ inertia)
        # The two rigid-body modes have no relative motion in the joint, so no dashpot couples them.
        rigid, squares, shapes = shapes[0, :2], squares[2:], shapes[:, 2:]
        gaps = np.array([shapes[4] - shapes[2], shapes[5] - shapes[3]])
        damping = gaps.T @ np.diag([self.c_y, self.c_theta]) @ gaps
        n = squares.size
        first_order = np.block([[np.zeros((n, n)), np.eye(n)], [-np.diag(squares), -damping]])
        values, right = linalg.eig(first_order)
        drive = linalg.solve(right, np.concatenate([np.zeros(n), shapes[0]]))
        residues = (shapes[0] @ right[:n]) * drive
        upper = values.imag > 0.0
        return values[upper], residues[upper], float(rigid @ rigid)

    def receptance(self, frequency_hz: FloatArray, decay_rate: float = 0.0) -> NDArray[np.complex128]:
        """Return displacement over force at the tip, at w - i sigma."""
        poles, residues, rigid = self.poles
        s = (2j * np.pi * np.asarray(frequency_hz) + decay_rate)[:, None]
        terms = residues / (s - poles) + residues.conj() / (s - poles.conj())
        return terms.sum(axis=1) + rigid / s[:, 0] ** 2

    def respond(self, force: FloatArray, step: float) -> FloatArray:
        """Return the acceleration of the tip under a force that is straight between samples.

        What rings faster than the grid can follow moves with the force: its compliance times the force's second
        derivative.
        """
        poles, residues, rigid = self.poles
        slow = np.abs(poles) < SLOW / step
        compliance = -2.0 * np.sum((residues / poles).real[~slow])
        padded = np.concatenate([[0.0], force, [0.0]])
        response = compliance * np.diff(padded, 2) / step**2
        response += 2.0 * np.sum(residues.real[slow]) * np.gradient(force, step)
        response += (rigid + 2.0 * np.sum((residues * poles).real[slow])) * force
        for pole, residue in zip(poles[slow], residues[slow], strict=True):
            x = pole * step
            # y' = pole y + f, exactly, for f straight over a step
            now = (np.exp(x) - 1.0 - x) / (x * x) * step
            before = (np.exp(x) - 1.0) / x * step - now
            y = signal.lfilter([now, before], [1.0, -np.exp(x)], force.astype(complex))
            response = response + 2.0 * (residue * pole**2 * y).real
        return response


@dataclass(frozen=True)
class Bench:
    """A structure, a recorder and a few pulses, of which the hits of a test are scaled copies."""

    structure: Structure
    sample_rate_hz: float = 51200.0
    duration_s: float = 0.1
    contacts_s: tuple[float, ...] = (0.9e-4, 1.0e-4, 1.1e-4)
    start_s: float = 0.008

    @cached_property
    def clean(self) -> tuple[FloatArray, FloatArray]:
        """Force and response of the pulses at 1 N, `(n_pulses, n)`, as recorded without noise."""
        step = 1.0 / (FINER * self.sample_rate_hz)
        time = np.arange(round(self.duration_s / step)) * step
        low_pass = signal.firwin(64 * FINER + 1, 0.8 / FINER, window=("kaiser", 9.0))
        recorded = []
        for contact in self.contacts_s:
            force = hammer.pulse(time, self.start_s, contact, 1.0)
            both = np.stack([force, self.structure.respond(force, step)])
            recorded.append(signal.upfirdn(low_pass, both, down=FINER)[:, 32 : 32 + time.size // FINER])
        forces, responses = np.swapaxes(recorded, 0, 1)
        return forces, responses

    def strike(
        self, generator: np.random.Generator, hits: int, peak_n: float, force_noise_db: float, response_noise_db: float
    ) -> tuple[FloatArray, FloatArray]:
        """Return noisy force and response of some hits, one record each; noise as in `hammer.strike`."""
        which = generator.integers(0, len(self.contacts_s), hits)
        strength = peak_n * generator.uniform(0.4, 1.0, hits)
        shift = generator.integers(-40, 1, hits)
        found = []
        for clean, level in zip(self.clean, (force_noise_db, response_noise_db), strict=True):
            hit = np.array([a * np.roll(clean[i], d) for i, a, d in zip(which, strength, shift, strict=True)])
            # The shift wraps silence from the beginning; the end is not used.
            hit[:, -40:] = np.array([a * clean[i][-40:] for i, a in zip(which, strength, strict=True)])
            found.append(hit + np.abs(hit).max() * 10.0 ** (level / 20.0) * generator.standard_normal(hit.shape))
        return found[0], found[1]
