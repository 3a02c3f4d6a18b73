"""The page in the browser: see, move and diagnose a campaign. It needs the extra `app`."""

import lazy_loader

from receptance.errors import require

require("app", "the page in the browser")

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
