"""Joint parameters, or any others, from measured receptances and natural frequencies."""

from receptance.identification.bands import find_bands
from receptance.identification.fit import identify
from receptance.identification.observations import MeasuredFrequencies, MeasuredFRF
from receptance.identification.result import Identification, Start
from receptance.identification.unknowns import Unknown

__all__ = [
    "Identification",
    "MeasuredFRF",
    "MeasuredFrequencies",
    "Start",
    "Unknown",
    "find_bands",
    "identify",
]
