"""Materials of beams."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field
from typing import Annotated

from receptance import units
from receptance.errors import ReceptanceWarning
from receptance.fields import Element, Field, Number

__all__ = ["CARBIDE", "STEEL", "Material"]

_SOFTEST = 1e5
"""Young's moduli below this, in Pa, are taken for a slip of the unit."""


@dataclass(frozen=True, kw_only=True)
class Material(Element):
    """A linear isotropic material that may lose energy.

    Parameters
    ----------
    {fields}

    Raises
    ------
    ValueError, TypeError
        A number out of its bounds; the message names it.

    Examples
    --------
    >>> from receptance import Material
    >>> carbide = Material(youngs_modulus=580e9, density=14500.0, poisson_ratio=0.22, loss_factor=0.002)
    >>> round(carbide.shear_modulus / 1e9, 1)
    237.7
    """

    youngs_modulus: Annotated[
        float, Number(units.MODULUS, "Young's modulus; with a loss factor it is E (1 + i loss_factor)")
    ]
    density: Annotated[float, Number(units.DENSITY, "mass density")]
    poisson_ratio: Annotated[
        float, Number(units.POISSON_RATIO, "Poisson's ratio; the shear modulus is E / (2 (1 + nu))")
    ]
    loss_factor: Annotated[float, Number(units.LOSS_FACTOR, "hysteretic loss factor of both moduli")] = 0.0
    name: Annotated[str, Field("name in reports and files")] = field(default="", compare=False)

    def __post_init__(self) -> None:
        self.check()
        if self.youngs_modulus < _SOFTEST:
            text = f"{self.owner}: youngs_modulus is {self.youngs_modulus:g} Pa, softer than rubber; is this in GPa?"
            warnings.warn(text, ReceptanceWarning, stacklevel=3)

    @property
    def shear_modulus(self) -> float:
        """Shear modulus G in Pa."""
        return self.youngs_modulus / (2.0 * (1.0 + self.poisson_ratio))


STEEL = Material(youngs_modulus=210e9, density=7850.0, poisson_ratio=0.3, name="steel")
"""Steel with common textbook values and no loss."""

CARBIDE = Material(youngs_modulus=580e9, density=14500.0, poisson_ratio=0.22, name="carbide")
"""Cemented carbide: E 550-630 GPa and density 13 800-15 000 kg/m3 are common, so measure your own blank."""
