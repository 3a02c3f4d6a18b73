"""Materials of beams."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field

from receptance import _checks
from receptance.errors import ReceptanceWarning

__all__ = ["CARBIDE", "STEEL", "Material"]

_SOFTEST = 1e5
"""Young's moduli below this, in Pa, are taken for a slip of the unit."""


@dataclass(frozen=True, kw_only=True)
class Material:
    """A linear isotropic material that may lose energy.

    Parameters
    ----------
    youngs_modulus : float
        Young's modulus E in Pa; with a loss factor it is E (1 + i loss_factor).
    density : float
        Mass density in kg/m3.
    poisson_ratio : float
        Poisson's ratio, more than -1 and at most 0.5. The shear modulus is E / (2 (1 + nu)).
    loss_factor : float, optional
        Hysteretic loss factor of both moduli; 0 means that the material loses nothing.
    name : str, optional
        For people.

    Raises
    ------
    ValueError, TypeError
        A quantity without physical meaning; the message names it.

    Examples
    --------
    >>> from receptance import Material
    >>> carbide = Material(youngs_modulus=580e9, density=14500.0, poisson_ratio=0.22, loss_factor=0.002)
    >>> round(carbide.shear_modulus / 1e9, 1)
    237.7
    """

    youngs_modulus: float
    density: float
    poisson_ratio: float
    loss_factor: float = 0.0
    name: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        owner = f"Material {self.name!r}" if self.name else "Material"
        checked = {
            "youngs_modulus": _checks.positive(owner, "youngs_modulus", self.youngs_modulus, unit="Pa"),
            "density": _checks.positive(owner, "density", self.density, unit="kg/m3"),
            "poisson_ratio": _checks.number(owner, "poisson_ratio", self.poisson_ratio),
            "loss_factor": _checks.not_negative(owner, "loss_factor", self.loss_factor),
        }
        if not -1.0 < checked["poisson_ratio"] <= 0.5:
            raise ValueError(
                f"{owner}: poisson_ratio is {checked['poisson_ratio']:g}, expected more than -1 and at most 0.5"
            )
        if checked["youngs_modulus"] < _SOFTEST:
            text = f"{owner}: youngs_modulus is {checked['youngs_modulus']:g} Pa, softer than rubber; is this in GPa?"
            warnings.warn(text, ReceptanceWarning, stacklevel=3)
        for name, value in checked.items():
            object.__setattr__(self, name, value)

    @property
    def shear_modulus(self) -> float:
        """Shear modulus G in Pa."""
        return self.youngs_modulus / (2.0 * (1.0 + self.poisson_ratio))

    def columns(self) -> tuple[float, float, float, float]:
        """Return the four columns of the segment table: modulus, density, Poisson's ratio, loss factor."""
        return (self.youngs_modulus, self.density, self.poisson_ratio, self.loss_factor)


STEEL = Material(youngs_modulus=210e9, density=7850.0, poisson_ratio=0.3, name="steel")
"""Steel with common textbook values and no loss."""

CARBIDE = Material(youngs_modulus=580e9, density=14500.0, poisson_ratio=0.22, name="carbide")
"""Cemented carbide: E 550-630 GPa and density 13 800-15 000 kg/m3 are common, so measure your own blank."""
