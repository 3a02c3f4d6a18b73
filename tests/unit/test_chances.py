"""Chances and quantiles against scipy.special."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from scipy import special

from receptance._chances import (
    chi_square_chance,
    chi_square_quantile,
    f_chance_4,
    normal_chance,
    normal_quantile,
)

RNG = np.random.default_rng(20261123)


@pytest.mark.parametrize("freedom", [1, 2, 3, 4, 7, 10, 61, 300, 2901, 5800])
def test_whole_degrees_of_freedom(freedom: int) -> None:
    """To rounding, relative to the chance itself in both tails as far as it is above 1e-290."""
    chi_square = freedom * np.array([0.0, 1e-6, 0.1, 0.5, 0.9, 1.0, 1.1, 1.3, 2.0])
    found, expected = chi_square_chance(chi_square, freedom), special.chdtrc(freedom, chi_square)
    kept = expected > 1e-290
    np.testing.assert_allclose(found[kept], expected[kept], rtol=1e-10, atol=0.0)
    assert found.max() <= 1.0


def test_arrays_of_mixed_degrees_of_freedom() -> None:
    freedom = RNG.integers(1, 40, size=(20, 30)).astype(float)
    chi_square = freedom * RNG.gamma(1.0, 1.5, size=freedom.shape)
    np.testing.assert_allclose(chi_square_chance(chi_square, freedom), special.chdtrc(freedom, chi_square), rtol=1e-11)
    fractions = freedom + 0.3
    np.testing.assert_array_equal(
        chi_square_chance(chi_square, fractions), special.gammaincc(0.5 * fractions, 0.5 * chi_square)
    )
    assert chi_square_chance(np.inf, 3.0) == 0.0
    assert chi_square_chance(3.0, 3.0).shape == ()


@pytest.mark.parametrize("freedom", [2, 4, 10, 60, 2000])
def test_f_with_four_degrees_of_freedom(freedom: int) -> None:
    for ratio in (0.01, 0.5, 1.0, 3.0, 12.0):
        assert f_chance_4(ratio, freedom) == pytest.approx(special.fdtrc(4, freedom, ratio), rel=1e-11)
    assert f_chance_4(-0.2, freedom) == f_chance_4(0.0, freedom) == 1.0


def test_normal_quantiles() -> None:
    for chance in (1e-12, 1e-3, 0.3, 0.5, 0.975, 1.0 - 1e-9):
        assert normal_quantile(chance) == pytest.approx(special.ndtri(chance), rel=1e-13, abs=1e-15)


@pytest.mark.parametrize("chance", [1e-4, 1e-3, 0.05, 0.5])
def test_quantiles_of_chi_square(chance: float) -> None:
    for freedom in (0.5, 1.0, 1.7, 3.2, 20.0, 431.6, 5800.25, 90000.0, 3e6):
        assert chi_square_quantile(freedom, chance) == pytest.approx(special.chdtri(freedom, chance), rel=1e-8)
    assert chi_square_quantile(0.1, 0.5) == special.chdtri(0.1, 0.5)


def test_chances_of_the_normal_distribution() -> None:
    for value in (-3.0, 0.0, 1.96, 8.0):
        assert normal_chance(value) == pytest.approx(special.ndtr(-value), rel=1e-12)


def test_scipy_is_not_loaded() -> None:
    code = (
        "import sys; from receptance._chances import *; chi_square_chance([1.0, 2.0], [3, 4]); f_chance_4(1.0, 4); "
        "chi_square_quantile(4.5, 1e-3); normal_chance(1.0); normal_quantile(0.9); sys.exit('scipy' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
