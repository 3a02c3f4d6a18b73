"""Receptances of spindles, identified from tip responses of known blanks, as a table or as modes."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
