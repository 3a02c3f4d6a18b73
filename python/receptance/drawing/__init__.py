"""Drawings: contours of parts and outlines of sections from CSV and DXF files."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
