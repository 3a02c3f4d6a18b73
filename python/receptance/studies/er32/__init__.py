"""The joint of an ER32 collet holder: Matthias, Ozsahin, Altintas, Denkena 2016, from its printed tables.

Examples
--------
>>> from receptance.studies.er32 import ER32Settings, run
>>> study = run(ER32Settings(starts=1, draws=1))
>>> round(study.published_predictions_rms_percent, 2)
0.49
"""

from receptance.studies.er32.bias import ChanceModel, LongToolBias
from receptance.studies.er32.findings import findings
from receptance.studies.er32.form import as_dict
from receptance.studies.er32.holder import HolderModel, load_holder
from receptance.studies.er32.joints import IdentifiedJoint, Resolution
from receptance.studies.er32.study import ER32Settings, ER32Study, run
from receptance.studies.er32.tables import Published, load

__all__ = [
    "ChanceModel",
    "ER32Settings",
    "ER32Study",
    "HolderModel",
    "IdentifiedJoint",
    "LongToolBias",
    "Published",
    "Resolution",
    "as_dict",
    "findings",
    "load",
    "load_holder",
    "run",
]
