"""The clamping studies of Matthias et al. 2016: insertion, material and damping virtual, torque and diameter published.

Examples
--------
>>> from receptance.studies.clamping import needed_ratio
>>> round(needed_ratio(1.0))
8
"""

from receptance.studies.clamping.claims import CLAIMS, Claim
from receptance.studies.clamping.damping import DampingStudy
from receptance.studies.clamping.findings import findings
from receptance.studies.clamping.form import as_dict
from receptance.studies.clamping.insertion import InsertionStudy, needed_ratio
from receptance.studies.clamping.material import MaterialStudy
from receptance.studies.clamping.study import ClampingSettings, ClampingStudy, run
from receptance.studies.clamping.trends import FittedLaw, TorqueVerdict

__all__ = [
    "CLAIMS",
    "Claim",
    "ClampingSettings",
    "ClampingStudy",
    "DampingStudy",
    "FittedLaw",
    "InsertionStudy",
    "MaterialStudy",
    "TorqueVerdict",
    "as_dict",
    "findings",
    "needed_ratio",
    "run",
]
