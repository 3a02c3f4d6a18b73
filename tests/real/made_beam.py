"""A beam in place of the measured one: modes of a free Euler-Bernoulli beam, for tests without measured files."""

from __future__ import annotations

import numpy as np

from real.structures import HIT_PLACES, LENGTH, Beam

SPACING = 0.01953125
HZ = np.array([112.0, 307.0, 596.0, 974.0])
DAMPING = 2e-4
MASS = 6.0
_BETA = np.array([4.730041, 7.853205, 10.995608, 14.137165])


def shapes() -> np.ndarray:
    """Return rigid and elastic mode shapes `(9, 6)` at the places, each with unit modal mass."""
    x = np.array(HIT_PLACES) / LENGTH
    sigma = (np.cosh(_BETA) - np.cos(_BETA)) / (np.sinh(_BETA) - np.sin(_BETA))
    bx = np.outer(x, _BETA)
    elastic = np.cosh(bx) + np.cos(bx) - sigma * (np.sinh(bx) + np.sin(bx))
    rigid = np.stack([np.ones_like(x), np.sqrt(12.0) * (x - 0.5)], axis=1)
    return np.hstack([rigid, elastic]) / np.sqrt(MASS)


def accelerance(s: np.ndarray, drive: int, mass: float = 0.0, stiffness: float = 0.0) -> np.ndarray:
    """Return `(9, n)` accelerances to the drive point, by solving the modal equations with a body there."""
    phi = shapes()
    w = 2.0 * np.pi * np.concatenate([[2.0, 3.0], HZ])
    damping = np.where(w < 100.0, 0.05, DAMPING)  # all has decayed within the period of the lines
    body = np.outer(phi[drive], phi[drive])
    found = np.empty((phi.shape[0], s.size), dtype=np.complex128)
    for first in range(0, s.size, 4096):
        own = s[first : first + 4096, None, None]
        dynamic = (np.eye(w.size) + mass * body) * own**2
        dynamic = dynamic + own * np.diag(2.0 * damping * w) + np.diag(w**2) + stiffness * body
        load = np.broadcast_to(phi[drive][:, None], (own.shape[0], w.size, 1))
        found[:, first : first + 4096] = phi @ (np.linalg.solve(dynamic, load)[:, :, 0] * own[:, 0] ** 2).T
    return found


def made_beam(drive: int) -> Beam:
    """Return it on the lines of the measured files, with a little noise."""
    hz = SPACING * np.arange(51201)
    rng = np.random.default_rng(3)
    noise = 1e-3 * (rng.normal(size=(9, hz.size)) + 1j * rng.normal(size=(9, hz.size)))
    return Beam(SPACING, accelerance(2j * np.pi * hz, drive) + noise)
