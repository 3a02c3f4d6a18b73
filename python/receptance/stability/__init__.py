"""Stability of cutting: lobes from receptances, by the mean force and by semi-discretisation."""

from receptance.stability.cutting import Milling, Turning
from receptance.stability.lobes import Lobes, Stability, StableCut, critical_depths, stability_lobes
from receptance.stability.semi_discretisation import (
    floquet_multiplier,
    semi_discretised_limit,
    semi_discretised_lobes,
)
from receptance.stability.tip import TipModes, receptance_draws, receptance_matrix

__all__ = [
    "Lobes",
    "Milling",
    "Stability",
    "StableCut",
    "TipModes",
    "Turning",
    "critical_depths",
    "floquet_multiplier",
    "receptance_draws",
    "receptance_matrix",
    "semi_discretised_limit",
    "semi_discretised_lobes",
    "stability_lobes",
]
