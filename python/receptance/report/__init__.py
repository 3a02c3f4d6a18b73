"""The protocol of results, and their rendering to terminal, text, HTML and JSON."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
