"""What a page has open, without any widget: the file, its values, uploads, calculations. It needs the extra `app`."""

import lazy_loader

from receptance.errors import require

require("app", "the page in the browser")

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
