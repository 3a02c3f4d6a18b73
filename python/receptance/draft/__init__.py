"""New campaigns from measured files and answers: what the files do not state, and the text of the campaign."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
