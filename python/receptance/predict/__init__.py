"""Predictions that are checked, and measurements that are planned, with the posterior of a fit.

`transfers` fits some configurations and compares its predictions with the others. `menu` describes measurements that
nobody has made; `gain` computes what one of them is expected to add to a fit: narrower intervals, by which `ranking`
orders them, and evidence against a rival explanation, by which a diagnosis advises one.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
