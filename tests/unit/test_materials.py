"""Materials: invalid input, messages, and computed values."""

from __future__ import annotations

from typing import Any

import pytest

from receptance import CARBIDE, STEEL, Material, ReceptanceWarning

GOOD: dict[str, Any] = {"youngs_modulus": 210e9, "density": 7850.0, "poisson_ratio": 0.3, "loss_factor": 0.001}


@pytest.mark.parametrize(
    ("quantity", "value", "words"),
    [
        ("youngs_modulus", 0.0, "youngs_modulus is 0, expected more than zero Pa"),
        ("density", 0.0, "density is 0, expected more than zero kg/m\\^3"),
        ("poisson_ratio", -1.0, "poisson_ratio is -1, expected more than -1 and at most 0.5"),
        ("loss_factor", -1e-9, "loss_factor is -1e-09, expected zero or more"),
    ],
)
def test_errors_name_invalid_values(quantity: str, value: float, words: str) -> None:
    with pytest.raises(ValueError, match=f"Material: {words}"):
        Material(**{**GOOD, quantity: value})
    with pytest.raises(ValueError, match=f"Material 'blank': {words}"):
        Material(**{**GOOD, quantity: value}, name="blank")


@pytest.mark.parametrize("ratio", [-0.999, 0.0, 0.5])
def test_poisson_ratios_at_the_limits(ratio: float) -> None:
    assert Material(**{**GOOD, "poisson_ratio": ratio}).poisson_ratio == ratio


def test_values_and_shear_modulus() -> None:
    material = Material(youngs_modulus=200_000_000, density=3, poisson_ratio=0.25)
    assert material.shear_modulus == 80e6
    assert isinstance(material.youngs_modulus, float)
    assert material.columns == (200e6, 3.0, 0.25, 0.0)
    assert STEEL.loss_factor == CARBIDE.loss_factor == 0.0


def test_modulus_in_gigapascals_raises_a_warning() -> None:
    with pytest.warns(ReceptanceWarning, match="youngs_modulus is 210 Pa.*GPa"):
        Material(youngs_modulus=210, density=7850, poisson_ratio=0.3)
