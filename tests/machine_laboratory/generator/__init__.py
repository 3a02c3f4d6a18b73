"""Machines of finite elements, and campaigns written from them. Independent of the library."""

from .campaign import write
from .effects import EFFECTS, FOREIGN, Effect
from .lobes import Cut, stable_limit
from .machine import Machine, Record, draw_machine
from .spindle import spindle_modes
from .structure import Place

__all__ = [
    "EFFECTS",
    "FOREIGN",
    "Cut",
    "Effect",
    "Machine",
    "Place",
    "Record",
    "draw_machine",
    "spindle_modes",
    "stable_limit",
    "write",
]
