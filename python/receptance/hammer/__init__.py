"""Hammer tests: records, hits, and estimates of FRFs with their variance."""

from receptance.hammer.estimate import estimate_frf
from receptance.hammer.hits import Hit, Hits, find_hits
from receptance.hammer.records import HammerRecords
from receptance.hammer.simulate import simulate_hits

__all__ = ["HammerRecords", "Hit", "Hits", "estimate_frf", "find_hits", "simulate_hits"]
