"""From the records of a hammer test to frequency response functions with their variance."""

from receptance.measurement.hits import Hit, Hits
from receptance.measurement.records import TimeRecords
from receptance.measurement.search import find_hits

__all__ = ["Hit", "Hits", "TimeRecords", "find_hits"]
