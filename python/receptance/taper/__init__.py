"""The joint between a holder and the taper of a spindle, from FRFs over drawbar force (Xu et al. 2012)."""

from receptance.taper.holder import Holder, TaperFit, fit_taper, without_each
from receptance.taper.rigid import (
    AxialSolution,
    Body,
    RadialJoint,
    RadialSolution,
    RadialSolutions,
    RigidModes,
    Shape,
    as_rigid,
    axial_from_mode,
    body_of,
    radial_from_modes,
)
from receptance.taper.series import ForceLaw, ForceSeries, Trend, fit_laws

__all__ = [
    "AxialSolution",
    "Body",
    "ForceLaw",
    "ForceSeries",
    "Holder",
    "RadialJoint",
    "RadialSolution",
    "RadialSolutions",
    "RigidModes",
    "Shape",
    "TaperFit",
    "Trend",
    "as_rigid",
    "axial_from_mode",
    "body_of",
    "fit_laws",
    "fit_taper",
    "radial_from_modes",
    "without_each",
]
