"""Joint parameters, or any others, from measured receptances and natural frequencies."""

from receptance.identification.bands import find_bands
from receptance.identification.fit import identify
from receptance.identification.floor import Floor
from receptance.identification.laws import Law, Move, Power, Tolerance
from receptance.identification.observations import MeasuredFrequencies, MeasuredFRF
from receptance.identification.priors import Prior
from receptance.identification.result import Identification, Start
from receptance.identification.unknowns import Unknown

__all__ = [
    "Floor",
    "Identification",
    "Law",
    "MeasuredFRF",
    "MeasuredFrequencies",
    "Move",
    "Power",
    "Prior",
    "Start",
    "Tolerance",
    "Unknown",
    "find_bands",
    "identify",
]
