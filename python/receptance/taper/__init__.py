"""The joint between a holder and the spindle's taper, from FRFs over drawbar force (Xu et al. 2012)."""

from receptance.taper.body import Body, body_of
from receptance.taper.choice import Shape
from receptance.taper.from_modes import (
    AxialSolution,
    RadialSolution,
    RadialSolutions,
    axial_from_mode,
    radial_from_modes,
    rotation_alone,
)
from receptance.taper.rigid import AxialJoint, RadialJoint, RigidModes

__all__ = [
    "AxialJoint",
    "AxialSolution",
    "Body",
    "RadialJoint",
    "RadialSolution",
    "RadialSolutions",
    "RigidModes",
    "Shape",
    "axial_from_mode",
    "body_of",
    "radial_from_modes",
    "rotation_alone",
]
