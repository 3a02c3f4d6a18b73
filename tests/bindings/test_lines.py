"""Frequency lines as the extension takes them: real or complex, in Hz or in rad/s."""

from __future__ import annotations

import numpy as np
import pytest

from bindings import calls
from bindings.random_calls import LINES, TIP, problem, tables
from bindings.random_calls import calls as known
from bindings.test_fuzz import good
from receptance import _core


@pytest.mark.parametrize("line", [0.0, -1.0, np.nan, np.inf, -np.inf, 1e308])
@pytest.mark.parametrize("number", [0, 1, 16, 39])
def test_invalid_real_frequencies_are_errors(number: int, line: float) -> None:
    lines = np.linspace(10.0, 1e3, 40)
    lines[number] = line
    for kind in (lines, lines + 0j):
        with pytest.raises(ValueError, match=f"frequency line {number}: angular frequency is"):
            calls.receptance(**{**good(), "angular_frequency": kind}, scale=2 * np.pi)


@pytest.mark.parametrize("scale", [0.0, -1.0, np.nan, np.inf])
def test_invalid_frequency_scale_is_an_error(scale: float) -> None:
    with pytest.raises(ValueError, match="frequency line 0"):
        calls.receptance(**good(), scale=scale)


@pytest.mark.parametrize("count", [1, 11, 300, 2001])
def test_real_and_complex_lines_agree_in_hertz_and_radians(count: int) -> None:
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
                for found, right in zip(calls.receptance(**{**good(), **changed}), expected, strict=True):
                    np.testing.assert_array_equal(found, right)


def test_fits_take_real_and_complex_lines() -> None:
    model = _core.Model(0, **tables())
    both = []
    for kind in (LINES, LINES + 0j):
        one = problem()
        _, added = known()["Problem.add_joint_receptance"]
        one.add_joint_receptance(**{**added, "model": model.reduced_to_joint(0, _core.Lines(kind), TIP, 1)})
        _, given = known()["Problem.fit"]
        ends = one.fit(**given)
        both.append((one.normal_matrix(np.array([7.0, 5.0])), ends.x, ends.cost, ends.evaluations, ends.status))
    for one, other in zip(*both, strict=True):
        np.testing.assert_array_equal(one, other)
