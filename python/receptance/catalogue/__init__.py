"""Catalogues of tools and holders: the tip of every tool in a machine, predicted with its uncertainty."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
