"""From the records of a hammer test to frequency response functions with their variance."""

from receptance.measurement.estimate import estimate_frf
from receptance.measurement.hits import Hit, Hits
from receptance.measurement.records import TimeRecords
from receptance.measurement.search import find_hits
from receptance.measurement.simulate import simulate_hits

__all__ = ["Hit", "Hits", "TimeRecords", "estimate_frf", "find_hits", "simulate_hits"]
