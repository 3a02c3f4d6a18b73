"""The joint between a holder and the taper of a spindle, from FRFs over drawbar force (Xu et al. 2012)."""

from typing import TYPE_CHECKING

from receptance._lazy import lazily

if TYPE_CHECKING:
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

_NAMES = {
    "holder": ["Holder", "TaperFit", "fit_taper", "without_each"],
    "rigid": [
        "AxialSolution",
        "Body",
        "RadialJoint",
        "RadialSolution",
        "RadialSolutions",
        "RigidModes",
        "Shape",
        "as_rigid",
        "axial_from_mode",
        "body_of",
        "radial_from_modes",
    ],
    "series": ["ForceLaw", "ForceSeries", "Trend", "fit_laws"],
}

if not TYPE_CHECKING:  # a type checker is to find misspelt names
    __getattr__, __dir__ = lazily(__name__, _NAMES)
