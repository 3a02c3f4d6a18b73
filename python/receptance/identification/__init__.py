"""Joint parameters, or any others, from measured receptances and natural frequencies."""

from receptance.identification.bands import find_bands
from receptance.identification.candidates import Candidate, FrequencyTarget, ReceptanceTarget
from receptance.identification.damped import complex_frequencies
from receptance.identification.evidence import log_evidence
from receptance.identification.expectations import Expectation, NextMeasurement, RankedCandidate
from receptance.identification.fit import identify
from receptance.identification.floor import Floor
from receptance.identification.held import Held, hold
from receptance.identification.inverse_coupling import InverseCoupling, InverseCouplings
from receptance.identification.inversion import invert_coupling
from receptance.identification.laws import Law, Move, Power, Tolerance
from receptance.identification.next_measurement import next_measurement
from receptance.identification.observations import MeasuredFrequencies, MeasuredFRF
from receptance.identification.prediction import PredictedReceptance, Scatter
from receptance.identification.profiles import Profile, Profiles
from receptance.identification.result import Identification, Start
from receptance.identification.sampling import Samples
from receptance.identification.transfer import transfer
from receptance.identification.transferred import Split, Transfer, TransferredFRF, TransferredMode
from receptance.identification.unknowns import Prior, Unknown

__all__ = [
    "Candidate",
    "Expectation",
    "Floor",
    "FrequencyTarget",
    "Held",
    "Identification",
    "InverseCoupling",
    "InverseCouplings",
    "Law",
    "MeasuredFRF",
    "MeasuredFrequencies",
    "Move",
    "NextMeasurement",
    "Power",
    "PredictedReceptance",
    "Prior",
    "Profile",
    "Profiles",
    "RankedCandidate",
    "ReceptanceTarget",
    "Samples",
    "Scatter",
    "Split",
    "Start",
    "Tolerance",
    "Transfer",
    "TransferredFRF",
    "TransferredMode",
    "Unknown",
    "complex_frequencies",
    "find_bands",
    "hold",
    "identify",
    "invert_coupling",
    "log_evidence",
    "next_measurement",
    "transfer",
]
