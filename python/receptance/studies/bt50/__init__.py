"""A taper joint over drawbar force: the procedure of Xu et al. 2012 on a virtual rig, and what it gets wrong."""

from receptance.studies.bt50.diagnosed import Diagnosed, diagnosed
from receptance.studies.bt50.findings import damping_errors, findings
from receptance.studies.bt50.form import as_dict
from receptance.studies.bt50.observations import observations
from receptance.studies.bt50.settings import BT50Settings
from receptance.studies.bt50.study import BT50Study, DampingIgnored, LeftOut, run

__all__ = [
    "BT50Settings",
    "BT50Study",
    "DampingIgnored",
    "Diagnosed",
    "LeftOut",
    "as_dict",
    "damping_errors",
    "diagnosed",
    "findings",
    "observations",
    "run",
]
