"""Receptances of spindles, identified from tip responses of known blanks, as a table or as modes."""

from receptance.spindle.crossed import CrossedSpindle, identify_crossed_spindle
from receptance.spindle.differences import rotations
from receptance.spindle.files import read_spindle, write_spindle
from receptance.spindle.identify import identify_spindle
from receptance.spindle.modes import SpindleModes, fit_spindle, mode_tolerances
from receptance.spindle.receptance import SpindleReceptance

__all__ = [
    "CrossedSpindle",
    "SpindleModes",
    "SpindleReceptance",
    "fit_spindle",
    "identify_crossed_spindle",
    "identify_spindle",
    "mode_tolerances",
    "read_spindle",
    "rotations",
    "write_spindle",
]
