"""The joint between a holder and the spindle's taper, from FRFs over drawbar force (Xu et al. 2012)."""

from receptance.taper.body import Body, as_rigid, body_of
from receptance.taper.choice import Shape
from receptance.taper.direct import TaperFit, fit_axial, fit_radial
from receptance.taper.from_modes import RadialSolution, RadialSolutions, radial_from_modes
from receptance.taper.holder import Holder
from receptance.taper.jackknife import without_each
from receptance.taper.one_mode import AxialSolution, axial_from_mode, rotation_alone
from receptance.taper.rigid import AxialJoint, RadialJoint, RigidModes
from receptance.taper.series import ForceLaw, ForceSeries, Trend, fit_laws

__all__ = [
    "AxialJoint",
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
    "fit_axial",
    "fit_laws",
    "fit_radial",
    "radial_from_modes",
    "rotation_alone",
    "without_each",
]
