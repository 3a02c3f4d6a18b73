"""Hammer tests: records, hits, and estimates of FRFs with their variance."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
