"""Modal analysis: natural frequencies, damping ratios and modal constants of measured FRFs, with standard errors."""

from receptance.modal.estimate import ModeEstimate
from receptance.modal.global_fit import fit_modes
from receptance.modal.local import CircleFit, circle_fit, find_peaks, half_power
from receptance.modal.modal_fit import ModalFit
from receptance.modal.ring_down import RingDown, ring_down

__all__ = [
    "CircleFit",
    "ModalFit",
    "ModeEstimate",
    "RingDown",
    "circle_fit",
    "find_peaks",
    "fit_modes",
    "half_power",
    "ring_down",
]
