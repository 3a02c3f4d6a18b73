"""Collets against fifty digits and finite elements: springs in a row with a mass between and no beam."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from oracle import elements, exact
from oracle.tables import Tables, joint, make, segment
from receptance import _core

SEED = 20261121
CASES = 25
ENDS = np.array([[0.0, 0.0], [0.0, 1.0], [3.0, 0.0], [3.0, 1.0]])
NONE = np.zeros((0, 3))
CARBIDE, STEEL = (580e9, 14500.0, 0.22), (205e9, 7850.0, 0.29)
Summarise = Callable[[str, str, object], None]


def spring(rng: np.random.Generator, *, lossy: bool = True) -> tuple[list[float], float]:
    """Return stiffnesses, dampings and a loss factor of a collet's spring, over four decades."""
    k_y, k_theta = 10.0 ** rng.uniform(6.5, 10.5), 10.0 ** rng.uniform(3.0, 7.0)
    k = [k_y, k_theta, rng.uniform(-0.9, 0.9) * np.sqrt(k_y * k_theta)]
    c_y, c_theta = (10.0 ** rng.uniform(0.0, 3.0), 10.0 ** rng.uniform(-3.0, 0.0)) if lossy else (0.0, 0.0)
    return [*k, c_y, c_theta, 0.0], float(rng.uniform(0.0, 0.05)) if lossy else 0.0


def collet(rng: np.random.Generator, *, lossy: bool = True) -> Tables:
    rows = []
    for a, b in ((1, 4), (4, 2)):
        (k_y, k_theta, both, c_y, c_theta, c_both), loss = spring(rng, lossy=lossy)
        rows.append([a, b, k_y, k_theta, both, c_y, c_theta, c_both, loss])
    mass = 0.0 if rng.uniform() < 0.2 else 10.0 ** rng.uniform(-3.0, 0.5)
    return make(
        [
            segment(0, 1, rng.uniform(0.03, 0.12), rng.uniform(0.006, 0.02), CARBIDE),
            segment(2, 3, rng.uniform(0.05, 0.15), rng.uniform(0.03, 0.06), STEEL),
        ],
        rows,
        [[4.0, mass, mass * 1e-4]],
    )


def test_random_collets_against_fifty_digits(summarise: Summarise) -> None:
    rng = np.random.default_rng(SEED)
    worst = 0.0
    for _ in range(CASES):
        tables = collet(rng)
        w = 2.0 * np.pi * np.sort(10.0 ** rng.uniform(0.5, 4.0, 4)) + 0j
        expected = exact.receptance_complex128(tables, w, ENDS, ENDS)
        found = _core.Model(0, *tables).receptance(_core.Lines(w), ENDS, ENDS, NONE, 1)[0]
        error = np.abs(found - expected) / np.abs(expected)
        worst = max(worst, max(float(error[:, k, k].max()) for k in range(4)))
        assert worst <= 1e-9, f"seed {SEED}"
        assert error.max() <= 1e-7, f"seed {SEED}"
    summarise("collets against fifty digits", f"seed {SEED}, {CASES} models: drive points {worst:.1e}", worst)


def test_all_natural_frequencies_of_a_collet_are_found() -> None:
    rng = np.random.default_rng([SEED, 1])
    for _ in range(12):
        tables = collet(rng, lossy=False)
        expected = elements.natural_frequencies(tables, 30e3)
        found, _ = _core.Model(0, *tables).natural_frequencies(2 * np.pi * 30e3, 1000, NONE)
        np.testing.assert_allclose(found / (2 * np.pi), expected, rtol=1e-6, err_msg=f"seed {SEED}")


def test_massless_series_to_rounding_error() -> None:
    """k1 k2 / (k1 + k2), eq. 15, at springs a million times apart as well."""
    w = 2.0 * np.pi * np.array([3.0, 90.0, 1300.0, 8000.0]) + 0j
    for k1, k2 in ((8e8, 5e8), (1e6, 1e12), (1e12, 1e6)):
        parts = [segment(0, 1, 0.06, 0.012, CARBIDE), segment(2, 3, 0.1, 0.045, STEEL)]
        pair = make(parts, [joint(1, 4, k1, 1e-4 * k1), joint(4, 2, k2, 1e-4 * k2)])
        k = k1 * k2 / (k1 + k2)
        one = make(parts, [joint(1, 2, k, 1e-4 * k)])
        found, expected = (_core.Model(0, *t).receptance(_core.Lines(w), ENDS, ENDS, NONE, 1)[0] for t in (pair, one))
        drive = np.abs(found - expected) / np.abs(expected)
        assert max(float(drive[:, i, i].max()) for i in range(4)) <= 1e-11
