"""Joint parameters of spindle-holder-tool assemblies from measured vibration."""

from receptance.assembly import Assembly, Coordinate
from receptance.beams import Part, Segment
from receptance.errors import ReceptanceError, ReceptanceWarning, ResonanceError, SingularInterfaceError
from receptance.joints import GroundSpring, PointJoint, PointMass
from receptance.materials import CARBIDE, STEEL, Material

__all__ = [
    "CARBIDE",
    "STEEL",
    "Assembly",
    "Coordinate",
    "GroundSpring",
    "Material",
    "Part",
    "PointJoint",
    "PointMass",
    "ReceptanceError",
    "ReceptanceWarning",
    "ResonanceError",
    "Segment",
    "SingularInterfaceError",
]
