"""A taper joint over drawbar force: the procedure of Xu et al. 2012 on a virtual rig, and what it gets wrong."""
