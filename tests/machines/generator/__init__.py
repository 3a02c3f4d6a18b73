"""Machines of finite elements, and campaigns written from them. Independent of the library."""

from .campaign import write
from .machine import Machine, Record, draw_machine
from .spindle import real_modes, spindle_modes
from .structure import Place

__all__ = ["Machine", "Place", "Record", "draw_machine", "real_modes", "spindle_modes", "write"]
