"""A taper joint over drawbar force: the procedure of Xu et al. 2012 on a virtual rig, and its errors."""

from receptance.studies.bt50.figure import draw
from receptance.studies.bt50.report import sections
from receptance.studies.bt50.study import response_without_damping, rigid_campaign, run

__all__ = ["draw", "response_without_damping", "rigid_campaign", "run", "sections"]
