"""Stability of cutting: lobes from receptances, by the mean force and by semi-discretisation."""

from typing import TYPE_CHECKING

from receptance._lazy import lazily

if TYPE_CHECKING:
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

_NAMES = {
    "cutting": ["Milling", "Turning"],
    "lobes": ["Lobes", "Stability", "StableCut", "critical_depths", "stability_lobes"],
    "semi_discretisation": ["floquet_multiplier", "semi_discretised_limit", "semi_discretised_lobes"],
    "tip": ["TipModes", "receptance_draws", "receptance_matrix"],
}

if not TYPE_CHECKING:  # a type checker is to find misspelt names
    __getattr__, __dir__ = lazily(__name__, _NAMES)
