"""Stiffness that joints have besides their columns, line by line, against joints that have it in their columns."""

from __future__ import annotations

import numpy as np
import pytest

from oracle.tables import joint, make, segment
from receptance import _core

CARBIDE, STEEL = (580e9, 14500.0, 0.22), (205e9, 7850.0, 0.29)
PARTS = [segment(0, 1, 0.05, 0.012, CARBIDE, loss_factor=0.001), segment(3, 4, 0.1, 0.045, STEEL, loss_factor=0.002)]
ENDS = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 1.0]])
PARAMETERS = np.array([[1, 0, 5], [1, 0, 6], [1, 1, 3], [0, 0, 2], [0, 1, 5]], dtype=float)
LINES = 2.0 * np.pi * np.geomspace(5.0, 15e3, 700) + 0j
"""More than one task of the core has."""
SECOND = joint(2, 3, 5e8, 1e5, 0.0, (1.0, 0.1, 0.0))


def evaluate(
    first: list[float], w: np.ndarray, added: np.ndarray | None, threads: int = 1
) -> tuple[np.ndarray, np.ndarray]:
    tables = make(PARTS, [first, SECOND])
    flat = None if added is None else np.ascontiguousarray(added).reshape(-1)
    return _core.Model(0, *tables).receptance(_core.Lines(w), ENDS, ENDS, PARAMETERS, threads, _core.ByLine(flat))


def close(found: tuple[np.ndarray, np.ndarray], expected: tuple[np.ndarray, np.ndarray], bound: float) -> None:
    for one, other in zip(found, expected, strict=True):
        size = np.abs(other).max(axis=0, keepdims=True)
        assert np.max(np.abs(one - other) / np.maximum(np.abs(other), 1e-9 * size)) <= bound


def test_half_of_a_joint_may_be_added() -> None:
    loss, c = 0.02, 7.0
    whole = evaluate(joint(1, 2, 8e8, 2e5, 0.0, (c, 0.0, 0.0), loss), LINES, None)
    added = np.zeros((LINES.size, 2, 2), dtype=complex)
    added[:, 0, 0] = 3e8 * (1.0 + 1j * loss) + 1j * LINES * c
    added[:, 0, 1] = 1e5 * (1.0 + 1j * loss)
    half = joint(1, 2, 5e8, 1e5, 0.0, (0.0, 0.0, 0.0), loss)
    found = evaluate(half, LINES, added)
    close(found, whole, 1e-10)
    for threads in (2, 3):
        assert all(np.array_equal(a, b) for a, b in zip(evaluate(half, LINES, added, threads), found, strict=True))
    nothing = evaluate(half, LINES, np.zeros_like(added))
    close(nothing, evaluate(half, LINES, None), 1e-10)


def test_each_line_has_its_own() -> None:
    rng = np.random.default_rng(4)
    shares = rng.uniform(-0.5, 1.0, (LINES.size, 2)) + 1j * rng.uniform(0.0, 0.5, (LINES.size, 2))
    added = np.zeros((LINES.size, 2, 2), dtype=complex)
    added[:, 0] = shares * [5e8, 1e5]
    base = joint(1, 2, 5e8, 1e5)
    h, slope = evaluate(base, LINES, added)
    for line in (0, 1, 7, 255, 256, 300, 511, 512, 699):
        alone = evaluate(base, LINES[line : line + 1], added[line])
        close((h[line : line + 1], slope[line : line + 1]), alone, 1e-9)
        k, w = np.diag([5e8, 1e5]) + np.diag(added[line, 0]), LINES[line].real
        c = (k[0, 0].imag / w, k[1, 1].imag / w, 0.0)
        point = evaluate(joint(1, 2, k[0, 0].real, k[1, 1].real, 0.0, c), LINES[line : line + 1], None)
        close(alone, point, 1e-9)


def test_what_cannot_be_added_is_refused() -> None:
    base = joint(1, 2, 5e8, 1e5)
    with pytest.raises(ValueError, match="number of stiffnesses added to joints 0 is 3, expected none or 2800"):
        evaluate(base, LINES, np.zeros(3, dtype=complex))
    wrong = np.zeros(2800, dtype=complex)
    wrong[5] = np.nan
    with pytest.raises(ValueError, match="stiffness added to joints 5 is NaN, expected a finite number"):
        evaluate(base, LINES, wrong)
