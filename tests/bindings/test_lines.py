"""Frequency lines as the extension takes them: real or complex, in Hz or in rad/s."""

from __future__ import annotations

import numpy as np
import pytest

from bindings.test_fuzz import good
from bindings.test_fuzz_fits import fit, normal_matrix, reduction
from receptance import _core


@pytest.mark.parametrize("line", [0.0, -1.0, np.nan, np.inf, -np.inf, 1e308])
@pytest.mark.parametrize("number", [0, 1, 16, 39])
def test_real_lines_that_are_no_frequency(number: int, line: float) -> None:
    lines = np.linspace(10.0, 1e3, 40)
    lines[number] = line
    for kind in (lines, lines + 0j):
        with pytest.raises(ValueError, match=f"frequency line {number}: angular frequency is"):
            _core.receptance(**{**good(), "angular_frequency": kind}, scale=2 * np.pi)


@pytest.mark.parametrize("scale", [0.0, -1.0, np.nan, np.inf])
def test_a_scale_that_leaves_no_frequency(scale: float) -> None:
    with pytest.raises(ValueError, match="frequency line 0"):
        _core.receptance(**good(), scale=scale)


@pytest.mark.parametrize("count", [1, 11, 300, 2001])
def test_real_lines_are_complex_lines_and_hertz_are_radians(count: int) -> None:
    """Bit for bit: what a line becomes does not depend on how it came."""
    f = np.linspace(3.0, 2e3, count)
    for window in (0.0, 0.7j):
        w = 2 * np.pi * (f - window)
        expected = _core.receptance(**{**good(), "angular_frequency": w.astype(complex)})
        ways = [(f - window, 2 * np.pi), (w, 1.0)]
        if not window:
            ways.append((f + 0j, 2 * np.pi))
        for lines, scale in ways:
            for threads in (1, 2):
                changed = {"angular_frequency": lines, "threads": threads, "scale": scale}
                for found, known in zip(_core.receptance(**{**good(), **changed}), expected, strict=True):
                    np.testing.assert_array_equal(found, known)


def test_fits_take_real_and_complex_lines() -> None:
    for name, arguments in (("reduce_joint", reduction), ("joint_normal_matrix", normal_matrix), ("fit_joint", fit)):
        complete = arguments()
        lines = complete["angular_frequency"]
        real = [one.real.copy() for one in lines] if isinstance(lines, list) else lines.real.copy()
        both = [getattr(_core, name)(**{**complete, "angular_frequency": kind}) for kind in (real, lines)]
        arrays = zip(*(found if isinstance(found, tuple) else (found,) for found in both), strict=True)
        for one, other in arrays:
            np.testing.assert_array_equal(one, other)
