"""Hammer tests: records, hits, and estimates of FRFs with their variance."""

from receptance.measurement.estimate import estimate_frf
from receptance.measurement.hits import Hit, Hits, find_hits
from receptance.measurement.records import HammerRecords
from receptance.measurement.simulate import simulate_hits

__all__ = ["HammerRecords", "Hit", "Hits", "estimate_frf", "find_hits", "simulate_hits"]
