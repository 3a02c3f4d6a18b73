"""Joint parameters of spindle-holder-tool assemblies from measured vibration."""

from receptance.assembly import Assembly
from receptance.beams import Part, Section, Segment
from receptance.collet import ColletJoint
from receptance.complex_modes import DampedModes, damped_modes
from receptance.coordinates import Coordinate
from receptance.errors import (
    GrossSlipError,
    ReceptanceError,
    ReceptanceWarning,
    ResonanceError,
    SingularInterfaceError,
)
from receptance.frf import FRF
from receptance.identification import (
    Identification,
    MeasuredFrequencies,
    MeasuredFRF,
    Unknown,
    find_bands,
    identify,
)
from receptance.joints import GroundSpring, PointJoint, PointMass
from receptance.materials import CARBIDE, STEEL, Material
from receptance.microslip import MicroslipJoint
from receptance.modal_parts import ModalPart, Mode
from receptance.spread import SpreadJoint
from receptance.terminals import MeasuredPart

__all__ = [
    "CARBIDE",
    "FRF",
    "STEEL",
    "Assembly",
    "ColletJoint",
    "Coordinate",
    "DampedModes",
    "GrossSlipError",
    "GroundSpring",
    "Identification",
    "Material",
    "MeasuredFRF",
    "MeasuredFrequencies",
    "MeasuredPart",
    "MicroslipJoint",
    "ModalPart",
    "Mode",
    "Part",
    "PointJoint",
    "PointMass",
    "ReceptanceError",
    "ReceptanceWarning",
    "ResonanceError",
    "Section",
    "Segment",
    "SingularInterfaceError",
    "SpreadJoint",
    "Unknown",
    "damped_modes",
    "find_bands",
    "identify",
]
