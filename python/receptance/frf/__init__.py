"""Frequency response functions with their form, places, quality and provenance."""

from receptance.frf.frf import FRF
from receptance.frf.places import Unplaced

__all__ = ["FRF", "Unplaced"]
