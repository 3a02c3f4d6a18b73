"""Sweeps: many candidates through one model, on all cores and on many machines."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
