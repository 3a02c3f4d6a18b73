"""Ordinary errors that the catalogue of causes does not contain: kinds, cases, outcomes, score."""

from .case import COVERED, NEIGHBOURS, Neighbour, draw_neighbour, every
from .kind import GROUPS, Kind

__all__ = ["COVERED", "GROUPS", "NEIGHBOURS", "Kind", "Neighbour", "draw_neighbour", "every"]
