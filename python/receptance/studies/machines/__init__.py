"""Case studies 1 and 2 of Matthias et al. 2016: tools in two machines. VIRTUAL: the machines are simulated."""

from receptance.studies.machines.findings import as_dict, findings
from receptance.studies.machines.machine import MACHINES, Tool, VirtualMachine, tools
from receptance.studies.machines.study import MachineCase, MachinesSettings, MachinesStudy, run

__all__ = [
    "MACHINES",
    "MachineCase",
    "MachinesSettings",
    "MachinesStudy",
    "Tool",
    "VirtualMachine",
    "as_dict",
    "findings",
    "run",
    "tools",
]
