"""Table 3 of Matthias et al. 2016: four joints that match one response in the machine. VIRTUAL: all is simulated."""

from receptance.studies.table3.candidates import Candidate, Expected
from receptance.studies.table3.findings import as_dict, findings
from receptance.studies.table3.machine import Measuring, VirtualMachine
from receptance.studies.table3.sets import SetMode, SetVerdict
from receptance.studies.table3.study import Table3Settings, Table3Study, run

__all__ = [
    "Candidate",
    "Expected",
    "Measuring",
    "SetMode",
    "SetVerdict",
    "Table3Settings",
    "Table3Study",
    "VirtualMachine",
    "as_dict",
    "findings",
    "run",
]
