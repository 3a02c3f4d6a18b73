"""Joints, spindles and holders without a complete model: from receptances line by line, from blanks, over force.

`line_equations` solves the coupling of known structures at one line; `inverse` finds a joint with it,
`spindle_receptance` and `crossed_spindle` a spindle from `blanks`. `spindle_modes` and `unknown_modes` fit a spindle
as modes, and `stabilisation` chooses their number. `taper_holder`, `rigid_holder` and `force_series` are the joint of a
taper over drawbar force (Xu et al. 2012).
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
