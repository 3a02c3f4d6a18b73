"""Frequency lines as the extension takes them: real or complex, in Hz or in rad/s."""

from __future__ import annotations

import numpy as np
import pytest

from bindings import calls
from bindings.test_fuzz import good
from bindings.test_fuzz_fits import fit, normal_matrix, reduced_model, reduction


@pytest.mark.parametrize("line", [0.0, -1.0, np.nan, np.inf, -np.inf, 1e308])
@pytest.mark.parametrize("number", [0, 1, 16, 39])
def test_real_lines_that_are_no_frequency(number: int, line: float) -> None:
    lines = np.linspace(10.0, 1e3, 40)
    lines[number] = line
    for kind in (lines, lines + 0j):
        with pytest.raises(ValueError, match=f"frequency line {number}: angular frequency is"):
            calls.receptance(**{**good(), "angular_frequency": kind}, scale=2 * np.pi)


@pytest.mark.parametrize("scale", [0.0, -1.0, np.nan, np.inf])
def test_a_scale_that_leaves_no_frequency(scale: float) -> None:
    with pytest.raises(ValueError, match="frequency line 0"):
        calls.receptance(**good(), scale=scale)


@pytest.mark.parametrize("count", [1, 11, 300, 2001])
def test_real_lines_are_complex_lines_and_hertz_are_radians(count: int) -> None:
    """Bit for bit: what a line becomes does not depend on how it came."""
    f = np.linspace(3.0, 2e3, count)
    for window in (0.0, 0.7j):
        w = 2 * np.pi * (f - window)
        expected = calls.receptance(**{**good(), "angular_frequency": w.astype(complex)})
        ways = [(f - window, 2 * np.pi), (w, 1.0)]
        if not window:
            ways.append((f + 0j, 2 * np.pi))
        for lines, scale in ways:
            for threads in (1, 2):
                changed = {"angular_frequency": lines, "threads": threads, "scale": scale}
                for found, known in zip(calls.receptance(**{**good(), **changed}), expected, strict=True):
                    np.testing.assert_array_equal(found, known)


def test_fits_take_real_and_complex_lines() -> None:
    complete = reduction()
    w = complete["angular_frequency"]
    both = []
    for kind in (w.real.copy(), w):
        reduced = reduced_model({**complete, "angular_frequency": kind})
        ends = calls.fit(**{**fit(), "reduction": reduced})
        both.append((calls.normal_matrix(**{**normal_matrix(), "reduction": reduced}), *ends))
    for one, other in zip(*both, strict=True):
        np.testing.assert_array_equal(one, other)
