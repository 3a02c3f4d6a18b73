"""Figures; matplotlib is loaded when one is drawn, and figures are returned, not shown."""

from receptance.plot._style import as_image, image_formats
from receptance.plot.transfer import draw_transfer

__all__ = [
    "as_image",
    "draw_transfer",
    "image_formats",
]
