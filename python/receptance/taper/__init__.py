"""The joint between a holder and the taper of a spindle, from FRFs over drawbar force (Xu et al. 2012)."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
