"""Receptances of spindles, identified from tip responses of known blanks, as a table or as modes."""

from typing import TYPE_CHECKING

from receptance._lazy import lazily

if TYPE_CHECKING:
    from receptance.spindle.crossed import CrossedSpindle, identify_crossed_spindle
    from receptance.spindle.differences import rotations
    from receptance.spindle.files import read_spindle, write_spindle
    from receptance.spindle.modes import SpindleModes, fit_spindle, mode_tolerances
    from receptance.spindle.receptance import SpindleReceptance, identify_spindle

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

_NAMES = {
    "crossed": ["CrossedSpindle", "identify_crossed_spindle"],
    "differences": ["rotations"],
    "files": ["read_spindle", "write_spindle"],
    "modes": ["SpindleModes", "fit_spindle", "mode_tolerances"],
    "receptance": ["SpindleReceptance", "identify_spindle"],
}

if not TYPE_CHECKING:  # a type checker is to find misspelt names
    __getattr__, __dir__ = lazily(__name__, _NAMES)
