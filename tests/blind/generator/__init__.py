"""Data from an independent simulation: finite elements, hits in time, noise. Independent of the library."""

from .advised import measured_again, shown_by
from .batch import alone, every, group_of, shuffled
from .case import KINDS, NEIGHBOUR, Bench, Case, Configuration, Nominal, Record, Stated, Truth, draw_bench, draw_case
from .effects import CATALOGUE, MEASUREMENT, OUTSIDE, Effect, Where
from .geometry import GEOMETRIES
from .knowledge import CHANGES, INSIDE, LEVELS, Blank, Modes, Table

__all__ = [
    "CATALOGUE",
    "CHANGES",
    "GEOMETRIES",
    "INSIDE",
    "KINDS",
    "LEVELS",
    "MEASUREMENT",
    "NEIGHBOUR",
    "OUTSIDE",
    "Bench",
    "Blank",
    "Case",
    "Configuration",
    "Effect",
    "Modes",
    "Nominal",
    "Record",
    "Stated",
    "Table",
    "Truth",
    "Where",
    "alone",
    "draw_bench",
    "draw_case",
    "every",
    "group_of",
    "measured_again",
    "shown_by",
    "shuffled",
]
