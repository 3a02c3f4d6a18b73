"""Joint parameters, or any others, from measured receptances and natural frequencies."""

from receptance.identification.bands import find_bands
from receptance.identification.evidence import log_evidence
from receptance.identification.fit import identify
from receptance.identification.floor import Floor
from receptance.identification.held import Held, hold
from receptance.identification.laws import Law, Power, Tolerance
from receptance.identification.observations import MeasuredFrequencies, MeasuredFRF
from receptance.identification.prediction import PredictedReceptance
from receptance.identification.priors import Prior
from receptance.identification.result import Identification, Start
from receptance.identification.transfer import transfer
from receptance.identification.transferred import Split, Transfer, TransferredFRF, TransferredMode
from receptance.identification.unknowns import Unknown

__all__ = [
    "Floor",
    "Held",
    "Identification",
    "Law",
    "MeasuredFRF",
    "MeasuredFrequencies",
    "Power",
    "PredictedReceptance",
    "Prior",
    "Split",
    "Start",
    "Tolerance",
    "Transfer",
    "TransferredFRF",
    "TransferredMode",
    "Unknown",
    "find_bands",
    "hold",
    "identify",
    "log_evidence",
    "transfer",
]
