"""Machines of finite elements, and campaigns written from them. Independent of the library."""

from .campaign import write
from .machine import Machine, Record, draw_machine
from .structure import Place, spindle_modes

__all__ = ["Machine", "Place", "Record", "draw_machine", "spindle_modes", "write"]
