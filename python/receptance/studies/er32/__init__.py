"""The joint of an ER32 collet holder: Matthias, Ozsahin, Altintas, Denkena 2016, from its printed tables."""

from receptance.studies.er32.bias import ChanceModel
from receptance.studies.er32.figure import draw
from receptance.studies.er32.joints import Resolution, find_trends, follow_joint, identify_joints, joint_of
from receptance.studies.er32.report import sections
from receptance.studies.er32.study import ER32Settings, run
from receptance.studies.er32.tables import SOURCE, Published, assembly, campaign, load

__all__ = [
    "SOURCE",
    "ChanceModel",
    "ER32Settings",
    "Published",
    "Resolution",
    "assembly",
    "campaign",
    "draw",
    "find_trends",
    "follow_joint",
    "identify_joints",
    "joint_of",
    "load",
    "run",
    "sections",
]
