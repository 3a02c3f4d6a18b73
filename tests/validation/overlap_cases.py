"""Random assemblies with an overlap, for the core and for the reference."""

from __future__ import annotations

import math
import os
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from oracle import draw, overlaps
from oracle.tables import Tables, make, segment

SEED = int(os.environ.get("RECEPTANCE_TEST_SEED", "20260728"))
LOWEST_HZ, HIGHEST_HZ = 1.0, 50e3
SOFTEST, STIFFEST = 1e4, 1e13
MOST_DECAY = 60.0
"""Exponent by which the relative motion may decay over the length: a stiffer layer is a bonded section."""
FAR = 3
ENDS = np.array([[0, 0], [0, 1], [FAR, 0], [FAR, 1]], dtype=float)
"""Tip and far end."""


class Case(NamedTuple):
    """Tables of tool and holder, the overlap between node 1 and node 2, lines, and what was drawn."""

    tables: Tables
    overlaps: NDArray[np.float64]
    w: NDArray[np.complex128]
    label: str


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    return float(math.exp(rng.uniform(math.log(low), math.log(high))))


def case(rng: np.random.Generator, n_lines: int = 2) -> Case:
    """Draw a tool, an overlap and a holder; the same generator state gives the same case."""
    lossy = bool(rng.random() < 0.5)
    diameter = log_uniform(rng, 3e-3, 0.04)
    length = diameter * log_uniform(rng, 0.2, 8.0)
    outside = diameter * log_uniform(rng, 1.2, 6.0)
    loss = [log_uniform(rng, 1e-4, 0.05) if lossy else 0.0 for _ in range(2)]
    inner_bore = diameter * float(rng.uniform(0.1, 0.6)) if rng.random() < 0.2 else 0.0
    inner = (diameter, inner_bore, *draw.material(rng), loss[0])
    outer = (outside, diameter, *draw.material(rng), loss[1])
    hz = sorted(log_uniform(rng, LOWEST_HZ, HIGHEST_HZ) for _ in range(n_lines))
    w = 2.0 * np.pi * np.array(hz) + 0j
    if rng.random() < 0.1:
        w = w - 1j * 0.1 * w[0].real
    k_y = log_uniform(rng, SOFTEST, STIFFEST)
    while _decay(k_y, length, inner) + _decay(k_y, length, outer) > MOST_DECAY:
        k_y /= 3.0
    k_theta = k_y * log_uniform(rng, 1e-4, 0.1) ** 2 if rng.random() < 0.8 else 0.0
    c_y = k_y / abs(w[-1]) * log_uniform(rng, 1e-4, 1.0) if lossy else 0.0
    c_theta = k_theta / abs(w[-1]) * log_uniform(rng, 1e-4, 1.0) if lossy else 0.0
    layer = (k_y, k_theta, c_y, c_theta, log_uniform(rng, 1e-3, 0.3) if lossy else 0.0)
    points = int(rng.integers(2, 8)) if rng.random() < 0.25 else 0
    segments = [
        segment(0, 1, log_uniform(rng, 5e-3, 0.2), diameter, inner[2:5], loss_factor=loss[0]),
        segment(2, FAR, log_uniform(rng, 5e-3, 0.2), outside, outer[2:5], loss_factor=loss[1]),
    ]
    grounds = [[FAR, 1e8, 1e5, 0.0, 0.0, 0.0, 0.0, 0.02]] if rng.random() < 0.3 else []
    masses = [[0, 1e-3, 1e-8]] if rng.random() < 0.2 else []
    slope = float(rng.uniform(-1.0, 1.0)) if points else 0.0
    row = overlaps.overlap(1, 2, length, inner, outer, layer, points, slope)
    label = (
        f"{'lossy' if lossy else 'lossless'}, k_y {k_y:.2g}, L {length:.3g}, d {diameter:.2g}, {points} points, "
        f"slope {slope:.2g}, {hz}"
    )
    return Case(make(segments, (), masses, grounds), np.array([row]), w, label)


def _decay(k_y: float, length: float, beam: tuple[float, ...]) -> float:
    """Exponent of the decay that a layer makes in one beam, by shear and by bending."""
    outer, bore, modulus = beam[:3]
    area, moment = math.pi / 4 * (outer**2 - bore**2), math.pi / 64 * (outer**4 - bore**4)
    k = k_y / length
    return length * (math.sqrt(k / (0.3 * modulus * area)) + (k / (modulus * moment)) ** 0.25)
