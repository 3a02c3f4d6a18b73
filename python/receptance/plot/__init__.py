"""Figures; matplotlib is loaded when one is drawn, and figures are returned, not shown."""

from receptance.plot._style import as_image, image_formats
from receptance.plot.bt50 import draw_bt50
from receptance.plot.clamped_rods import draw_clamped_rods
from receptance.plot.clamping import draw_clamping
from receptance.plot.er32 import draw_er32
from receptance.plot.machines import draw_machines
from receptance.plot.table3 import draw_table3
from receptance.plot.transfer import draw_transfer

__all__ = [
    "as_image",
    "draw_bt50",
    "draw_clamped_rods",
    "draw_clamping",
    "draw_er32",
    "draw_machines",
    "draw_table3",
    "draw_transfer",
    "image_formats",
]
