"""A taper joint over drawbar force: the procedure of Xu et al. 2012 on a virtual rig, and its errors."""

from receptance.studies.bt50.figure import draw
from receptance.studies.bt50.report import sections
from receptance.studies.bt50.study import diagnose_rigid, observations, response_without_damping, run

__all__ = ["diagnose_rigid", "draw", "observations", "response_without_damping", "run", "sections"]
