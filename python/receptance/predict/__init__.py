"""Predictions that are checked, and measurements that are planned, with the posterior of a fit.

`transfers` fits some configurations and compares its predictions with the others. `candidate` describes measurements
that nobody has made; `ranking` states the intervals that are expected with each of them.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
